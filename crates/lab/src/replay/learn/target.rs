//! Target of a datagram: the devices that it reaches.

/// Whom a datagram reaches.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Target {
    /// The device at a position, counted from 0.
    One(usize),
    /// Every device.
    All,
    /// Whoever maps the address.
    Logical,
    /// Nobody that is known.
    Nobody,
}
