//! Capture files: pcapng and pcap, read and written.
//!
//! Formats: draft-ietf-opsawg-pcapng and draft-ietf-opsawg-pcap. Start with [`CaptureReader`] to
//! read, [`PcapngWriter`] to write, [`RunClock`] to turn the file's times into times of the run.
//!
//! The readers on crates.io were measured and are quick (9 to 19 million frames a second), but
//! they allocate for each frame that has options, tell no file offset of a damage and hand out no
//! buffer in which a cooked header could be made an Ethernet header again; what they would save is
//! the block framing, a page of code.

mod byte_order;
mod cooked;
mod end;
mod error;
mod fcs;
mod frame;
mod link_type;
mod pcap;
mod pcap_writer;
mod pcapng;
mod pcapng_options;
mod pcapng_writer;
mod reader;
mod run_clock;
mod window;

pub use end::{CaptureEnd, Damage};
pub use error::{CaptureError, CaptureErrorKind, CaptureWriteError};
pub use frame::{
    CaptureFormat, CaptureInterface, CaptureInterfaceId, CaptureSection, CapturedFrame,
    FrameDirection, FrameNumber, SkippedLinkType, TimeResolution,
};
pub use link_type::LinkType;
pub use pcap_writer::PcapWriter;
pub use pcapng_writer::{FrameToWrite, InterfaceToWrite, PcapngWriter};
pub use reader::CaptureReader;
pub use run_clock::{Backward, Moment, RunClock};
