//! Capture files: pcapng and pcap, read and written.
//!
//! Formats: draft-ietf-opsawg-pcapng and draft-ietf-opsawg-pcap. Start with [`CaptureReader`] to
//! read, [`PcapngWriter`] to write, [`RunClock`] to turn the file's times into times of the run.
//!
//! `pcap-parser` takes blocks, options and frames apart, in a window over the stream that is ours:
//! so the place of a damage is known, and a cooked header can be made an Ethernet header in it.

mod byte_order;
mod cooked;
mod end;
mod error;
mod fcs;
mod frame;
mod link_type;
mod merged;
mod pcap;
mod pcap_writer;
mod pcapng;
mod pcapng_options;
mod pcapng_writer;
mod probe_clock;
mod read_ahead;
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
pub use merged::MergedCaptures;
pub use pcap_writer::PcapWriter;
pub use pcapng_writer::{FrameToWrite, InterfaceToWrite, PcapngWriter};
pub use read_ahead::ReadAhead;
pub use reader::CaptureReader;
pub use run_clock::{Backward, Moment, RunClock};
