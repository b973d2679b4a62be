//! Statistics over the runs of a study: pure functions of [`Results`](super::results::Results).
