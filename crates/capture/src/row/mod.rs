//! Rows of a capture: each frame with its datagrams, and what is known of them.

mod mailbox;
mod wrapping;

use linesman_diagnosis::Direction;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::esl::EslRecord;
use linesman_proto::frame::{Datagram, FrameView};
use linesman_proto::time::{Instant, Span};
use smallvec::SmallVec;

pub use mailbox::{CoeFields, MailboxView};
pub use wrapping::WrappingFields;

/// Datagrams of a frame that need no memory of their own; few frames have more.
const FEW: usize = 12;

/// A frame as a capture has it.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct CaptureFrame<'a> {
    /// Its number, from 1, as Wireshark counts.
    pub number: u64,
    /// When it was seen, since the start of the capture.
    pub time: Instant,
    /// Its date in ns since 1970 (UTC); `None` where the file has no times.
    pub date_ns: Option<i128>,
    /// The time since the frame before it in ns; negative where times run backwards.
    pub since_previous_ns: i128,
    /// The interface of the file, from 0.
    pub interface: u32,
    /// The direction that the file tells.
    pub direction: Direction,
    /// Bytes that were recorded, what was taken off in front and behind included.
    pub captured_len: u32,
    /// Length on the wire as the file tells it, in bytes.
    pub original_len: u32,
    /// True if bytes at its end were not recorded.
    pub truncated: bool,
    /// Whether its check sequence was right; `None` when nobody looked.
    pub fcs: Option<bool>,
    /// Record that a capture probe has added.
    pub probe: Option<EslRecord>,
    /// The frame from its destination address on, without check sequence.
    pub bytes: &'a [u8],
}

/// Facts about a frame that those before it tell.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct FrameFacts {
    /// Whether it goes out or comes back; `None` when that is not known.
    pub way: Option<FrameWay>,
    /// SubDevices that it has passed, where the port of a capture probe tells.
    pub passed: Option<u16>,
    /// The time since the cycle began in which it was seen; `None` before the first cycle.
    pub in_cycle: Option<Span>,
}

/// Way of a frame past the observer.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum FrameWay {
    /// From the MainDevice.
    Out,
    /// Back to the MainDevice.
    Back,
}

impl FrameWay {
    /// One word.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Out => "out",
            Self::Back => "back",
        }
    }
}

/// A frame with its datagrams.
#[derive(Clone, Debug)]
pub struct CaptureRow<'a> {
    /// The frame.
    pub frame: CaptureFrame<'a>,
    /// Facts that are known of it.
    pub facts: FrameFacts,
    /// Its datagrams, up to the first that is cut off.
    pub datagrams: SmallVec<[DatagramRow<'a>; FEW]>,
    /// True if it is EtherCAT with datagrams.
    pub is_ethercat: bool,
}

impl<'a> CaptureRow<'a> {
    /// The datagrams of a frame, of which nothing more is known yet.
    #[must_use]
    pub fn of(frame: CaptureFrame<'a>) -> Self {
        let view = FrameView::parse(frame.bytes).ok();
        let is_ethercat = view.is_some();
        let all = view.into_iter().flat_map(|view| view.datagrams()).map_while(Result::ok);
        let datagrams = all.map(DatagramRow::of).collect();
        Self { frame, facts: FrameFacts::default(), datagrams, is_ethercat }
    }

    /// True if it carries process data.
    #[must_use]
    pub fn is_cyclic(&self) -> bool {
        self.datagrams.iter().any(DatagramRow::is_logical)
    }

    /// The way it goes: as the file tells, else as the frames before tell; `None` when it is not known.
    #[must_use]
    pub const fn way(&self) -> Option<FrameWay> {
        match self.frame.direction {
            Direction::Sent => Some(FrameWay::Out),
            Direction::Received => Some(FrameWay::Back),
            Direction::Unknown => self.facts.way,
        }
    }

    /// Headers around the EtherCAT data.
    #[must_use]
    pub fn wrapping(&self) -> WrappingFields {
        WrappingFields::of(self.frame.bytes)
    }
}

/// A datagram with what is known of it.
#[derive(Clone, Debug)]
pub struct DatagramRow<'a> {
    /// The datagram.
    pub datagram: Datagram<'a>,
    /// The working counter it should come back with; `None` on its way out, and where several are right.
    pub expected_wkc: Option<u16>,
    /// Its working counter, all copies in a ring together; as [`Datagram::wkc`] elsewhere.
    pub wkc_sum: u16,
}

impl<'a> DatagramRow<'a> {
    /// A datagram of which nothing is known.
    #[must_use]
    pub fn of(datagram: Datagram<'a>) -> Self {
        Self { wkc_sum: datagram.wkc().0, datagram, expected_wkc: None }
    }

    /// True if it addresses process data.
    #[must_use]
    pub fn is_logical(&self) -> bool {
        self.datagram.command().map(Command::addressing) == Some(Addressing::Logical)
    }

    /// True if it came back with another working counter than expected.
    #[must_use]
    pub fn is_wkc_wrong(&self) -> bool {
        self.expected_wkc.is_some_and(|expected| expected != self.wkc_sum)
    }

    /// The mailbox message in it.
    #[must_use]
    pub fn mailbox(&self) -> Option<MailboxView<'a>> {
        MailboxView::of(&self.datagram)
    }

    /// Name of the command; its code for one that does not exist.
    #[must_use]
    pub fn command_name(&self) -> String {
        match self.datagram.command() {
            Some(command) => command.name().to_owned(),
            None => format!("command {}", self.datagram.code()),
        }
    }
}
