//! Direction of a frame at the card where it was seen.

/// Which way a frame went at the card where it was seen.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub enum FrameDirection {
    /// The card received it.
    Incoming,
    /// The host sent it.
    Outgoing,
    /// The capture does not say; the source address mark must do.
    #[default]
    Unknown,
}
