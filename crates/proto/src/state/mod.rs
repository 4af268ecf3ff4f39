//! Application layer states: which transitions exist, and what the status codes mean.
