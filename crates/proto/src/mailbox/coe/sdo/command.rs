//! The first byte of an SDO message: command specifier in the upper three bits, switches below.
//!
//! Reference: ETG.1000.6, SDO.

/// Length of an SDO's command, address and four bytes, without the CoE header: no SDO message but a
/// normal one or a segment is longer, and none is shorter.
pub const SDO_LEN: usize = 8;

/// Complete access: all entries of an object at once.
pub(super) const COMPLETE: u8 = 0x10;
/// Toggle bit of a segment.
pub(super) const TOGGLE: u8 = 0x10;

/// The command specifier.
pub(super) const fn specifier(command: u8) -> u8 {
    command >> 5
}
