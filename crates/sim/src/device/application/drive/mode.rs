//! Modes of operation, object 0x6060.

/// A mode; one that the drive does not have is none.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Mode {
    None,
    ProfilePosition,
    ProfileVelocity,
    Homing,
    CyclicPosition,
    CyclicVelocity,
}

impl Mode {
    /// The mode with a code.
    pub(super) const fn of(code: i8) -> Self {
        match code {
            1 => Self::ProfilePosition,
            3 => Self::ProfileVelocity,
            6 => Self::Homing,
            8 => Self::CyclicPosition,
            9 => Self::CyclicVelocity,
            _ => Self::None,
        }
    }

    /// Its code, as 0x6061 shows it.
    pub(super) const fn code(self) -> i16 {
        match self {
            Self::None => 0,
            Self::ProfilePosition => 1,
            Self::ProfileVelocity => 3,
            Self::Homing => 6,
            Self::CyclicPosition => 8,
            Self::CyclicVelocity => 9,
        }
    }

    /// Whether the axis has a position to keep to.
    pub(super) const fn is_watched(self) -> bool {
        match self {
            Self::ProfilePosition | Self::CyclicPosition => true,
            Self::None | Self::ProfileVelocity | Self::Homing | Self::CyclicVelocity => false,
        }
    }
}
