//! Files to scene descriptions: one file a format.
