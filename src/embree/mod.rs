//! The only wall around Embree.
