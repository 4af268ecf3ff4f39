//! The TOML description of a segment.
