//! Tests of the techniques against one another come with the scenes in `tests/rendering`.
