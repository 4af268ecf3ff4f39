//! End of a capture: regular, or early by a damage.

use std::fmt;

/// Where and how a capture stopped giving frames.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CaptureEnd {
    /// What is wrong with the rest of the file; `None` when there is no rest.
    pub damage: Option<Damage>,
    /// Byte offset of the damaged block, or the length of a whole file. In a compressed file it
    /// counts what was unpacked.
    pub offset: u64,
    /// Frames before it, those of other link types included: the number of the last frame.
    pub frames: u64,
}

impl CaptureEnd {
    /// Whether the file was read to its end.
    #[must_use]
    pub const fn complete(&self) -> bool {
        self.damage.is_none()
    }
}

impl fmt::Display for CaptureEnd {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { damage, offset, frames } = self;
        match damage {
            None => write!(f, "complete: {frames} frames in {offset} bytes"),
            Some(damage) => write!(f, "ends after {frames} frames: at byte {offset}, {damage}"),
        }
    }
}

/// Why the rest of a capture, or all of it, cannot be read.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Damage {
    /// The file ends inside a block.
    CutOff {
        /// What stands there.
        what: &'static str,
        /// Its length in bytes; at least so much, when the length itself is cut off.
        expected: u64,
        /// How much of it is there.
        present: u64,
    },
    /// A block says a length that no such block has.
    BlockLength {
        /// What stands there.
        what: &'static str,
        /// The length it says, in bytes.
        length: u32,
        /// The least it would need.
        least: u32,
        /// The most that is read.
        most: u32,
    },
    /// The length at a block's end is not the one at its start.
    LengthsDiffer {
        /// The length at the start.
        first: u32,
        /// The length at the end.
        last: u32,
    },
    /// A frame says more bytes than its block holds, or than any frame has.
    FrameLength {
        /// Bytes that the frame says it has.
        captured: u32,
        /// The most that would be possible here.
        most: u32,
    },
    /// A frame names an interface which the section has not described.
    UnknownInterface {
        /// The number in the frame.
        interface: u32,
        /// How many interfaces the section has described so far.
        described: u32,
    },
    /// A section's byte-order mark is none.
    ByteOrder {
        /// What stands in its place.
        mark: u32,
    },
    /// A version of the format that is not known.
    Version {
        /// Major version; 1 is known in pcapng, 2 in pcap.
        major: u16,
        /// Minor version.
        minor: u16,
    },
    /// More interfaces than a capture can have.
    TooManyInterfaces {
        /// The most that are read.
        most: u32,
    },
    /// The file could not be read on, or not be unpacked.
    Unreadable {
        /// The operating system's, the decompressor's or the parser's words.
        text: String,
    },
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CutOff { what, expected, present } => {
                write!(f, "{what} of {expected} bytes is cut off after {present}")
            }
            Self::BlockLength { what, length, least, most } => {
                write!(f, "{what} says it is {length} bytes long; {least} to {most} are possible")
            }
            Self::LengthsDiffer { first, last } => {
                write!(f, "a block says {first} bytes at its start and {last} at its end")
            }
            Self::FrameLength { captured, most } => {
                write!(f, "a frame says it has {captured} bytes; at most {most} are possible")
            }
            Self::UnknownInterface { interface, described } => write!(
                f,
                "a frame names interface {interface}, but its section describes {described}"
            ),
            Self::ByteOrder { mark } => {
                write!(f, "a section's byte-order mark is 0x{mark:08X}, expected 0x1A2B3C4D")
            }
            Self::Version { major, minor } => {
                write!(f, "version {major}.{minor} of the format is not known")
            }
            Self::TooManyInterfaces { most } => {
                write!(f, "there are more than {most} interfaces")
            }
            Self::Unreadable { text } => write!(f, "reading failed: {text}"),
        }
    }
}
