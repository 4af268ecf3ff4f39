//! Output of a reader: frames, and what the file says about where they come from.

use std::fmt;

use linesman_proto::esl::EslRecord;

use super::LinkType;
pub use crate::direction::FrameDirection;
use crate::unix_time::UnixTime;

/// A frame's number in its file, counted from 1 over all interfaces: the number that Wireshark
/// shows.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct FrameNumber(pub u64);

impl fmt::Display for FrameNumber {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// An interface of a capture: an index into [`CaptureReader::interfaces`].
///
/// Counted from 0 through the whole file, also when it has several sections.
///
/// [`CaptureReader::interfaces`]: super::CaptureReader::interfaces
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct CaptureInterfaceId(pub u32);

/// A frame of a capture. Its bytes are borrowed from the reader until the next one is asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CapturedFrame<'a> {
    /// Its number in the file.
    pub number: FrameNumber,
    /// When it was seen, by the clock of that interface; `None` in blocks that have no time.
    pub time: Option<UnixTime>,
    /// The interface that saw it.
    pub interface: CaptureInterfaceId,
    /// The number which the recording host gave to the card, where one interface of the file stands
    /// for several cards (Linux cooked, version 2).
    pub host_interface: Option<u32>,
    /// What the file stored. For the cooked types, [`bytes`](Self::bytes) is a rebuilt Ethernet
    /// frame whose destination address is made up (broadcast).
    pub link_type: LinkType,
    /// Which way it went.
    pub direction: FrameDirection,
    /// Length on the wire as the file tells it, check sequence included if the file keeps it, in
    /// bytes.
    pub original_len: u32,
    /// Whether the recorder kept less than the whole frame.
    pub truncated: bool,
    /// Whether the check sequence is right: checked here where the file keeps it, or what the
    /// recorder's card reported. `None` when the file does not say.
    pub fcs: Option<bool>,
    /// What a capture probe has added; [`time`](Self::time) is by its clock then.
    pub probe: Option<EslRecord>,
    /// All that was stored, without check sequence: [`bytes`](Self::bytes) and what a capture probe has added.
    pub stored: &'a [u8],
    /// The Ethernet frame, without check sequence.
    pub bytes: &'a [u8],
}

/// The kind of a capture file.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum CaptureFormat {
    /// The classic format: one interface.
    Pcap,
    /// The present format of Wireshark: blocks, interfaces, options.
    Pcapng,
}

impl fmt::Display for CaptureFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Pcap => "pcap",
            Self::Pcapng => "pcapng",
        })
    }
}

/// What the first section of a file says about its maker.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct CaptureSection {
    /// The recording computer.
    pub hardware: Option<String>,
    /// Its operating system.
    pub operating_system: Option<String>,
    /// The recording program.
    pub application: Option<String>,
}

/// An interface as the file describes it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CaptureInterface {
    /// Its name on the recording host.
    pub name: Option<String>,
    /// What people call it.
    pub description: Option<String>,
    /// What each of its frames begins with.
    pub link_type: LinkType,
    /// Most bytes kept of a frame; `None` is without limit.
    pub snap_len: Option<u32>,
    /// The step of its time stamps.
    pub resolution: TimeResolution,
    /// Frames that the recorder says it lost on this interface. They are missing in the file, not
    /// on the line. `None` when it does not say.
    pub drops: Option<u64>,
    /// Time up to which it was recorded, whether or not frames came; `None` when the recorder does not say.
    pub ended: Option<UnixTime>,
}

/// The step of a time stamp.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum TimeResolution {
    /// 10^-n s: 6 is a microsecond, 9 a nanosecond.
    Decimal(u8),
    /// 2^-n s.
    Binary(u8),
}

impl TimeResolution {
    /// A microsecond, the default of both formats.
    pub const MICROSECOND: Self = Self::Decimal(6);
    /// A nanosecond.
    pub const NANOSECOND: Self = Self::Decimal(9);

    /// From the value of the option `if_tsresol`.
    pub(super) const fn from_option(value: u8) -> Self {
        if value & 0x80 == 0 { Self::Decimal(value) } else { Self::Binary(value & 0x7F) }
    }

    /// `ticks` of this step in ns; what is finer than a nanosecond is cut off.
    #[inline]
    pub(super) fn nanos(self, ticks: u64) -> i128 {
        match self {
            Self::Decimal(9) => i128::from(ticks),
            Self::Decimal(digits @ 0..=8) => {
                i128::from(ticks) * i128::from(10_u64.pow(9 - u32::from(digits)))
            }
            // Beyond 10^19 steps to a nanosecond, 64 bits of ticks are less than one.
            Self::Decimal(digits) => {
                let steps = 10_u64.checked_pow(u32::from(digits) - 9);
                steps.map_or(0, |steps| i128::from(ticks / steps))
            }
            Self::Binary(bits) => (i128::from(ticks) * 1_000_000_000) >> bits,
        }
    }
}

impl fmt::Display for TimeResolution {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Decimal(0) => f.write_str("1 s"),
            Self::Decimal(3) => f.write_str("1 ms"),
            Self::Decimal(6) => f.write_str("1 µs"),
            Self::Decimal(9) => f.write_str("1 ns"),
            Self::Decimal(digits) => write!(f, "10^-{digits} s"),
            Self::Binary(bits) => write!(f, "2^-{bits} s"),
        }
    }
}

/// Frames that were passed over because no EtherCAT can be read from their link type.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct SkippedLinkType {
    /// The link type.
    pub link_type: LinkType,
    /// How many frames had it, or, for a cooked type, had it without being Ethernet frames.
    pub frames: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_of_any_step_become_nanoseconds() {
        let rows = [
            (6, 1_700_000_000_000_001, 1_700_000_000_000_001_000),
            (9, u64::MAX, i128::from(u64::MAX)),
            (0, 5, 5_000_000_000),
            (10, 19, 1),
            (12, 1_999, 1),
            (28, u64::MAX, 1),
            (29, u64::MAX, 0),
            (127, u64::MAX, 0),
            (0x80, 3, 3_000_000_000),
            (0x8A, 1, 976_562),
            (0x80 | 32, 1 << 31, 500_000_000),
            (0xFF, u64::MAX, 0),
        ];
        for (option, ticks, nanos) in rows {
            let resolution = TimeResolution::from_option(option);
            assert_eq!(resolution.nanos(ticks), nanos, "{resolution}, {ticks} ticks");
        }
    }
}
