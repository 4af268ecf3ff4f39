//! Network cards, clocks and capture files: the only crate that touches them.
