//! Frames in, findings out: where, why and what to do.
