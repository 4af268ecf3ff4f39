//! Exceptions: reasons for which an answer may differ, where the recording itself shows them.
//!
//! A difference with such a reason is an exception; one without is a fault of the segment, or a
//! device that the segment does not know.

use linesman_proto::command::Addressing;
use linesman_proto::mailbox::coe::Message as CoeMessage;
use linesman_proto::mailbox::{MailboxType, Message};
use linesman_proto::register as r;

use super::recording::{Datagram, Recording, Turn};

/// Most datagrams that may differ for a reason, of a hundred.
pub const MOST_OF_A_HUNDRED: u64 = 1;

/// Why an answer differs.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Reason {
    /// Frames before it are missing in the recording: what they did to the devices is not known.
    FramesMissing,
    /// A command to an SII was under way when the recording began.
    SiiUnderWay,
    /// The device sent a message that nobody had asked for, or of a protocol that a learned device
    /// does not speak.
    OwnMessage,
}

impl Reason {
    /// For people and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::FramesMissing => "frames before it are missing in the recording",
            Self::SiiUnderWay => "a command to the SII was under way when the recording began",
            Self::OwnMessage => "the device sent a message of its own",
        }
    }
}

/// What of a recording gives reasons.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Reasons {
    /// Number of the first frame that is alone: its request or its return is missing.
    first_gap: Option<u64>,
    /// Number of the first request that commands an SII.
    first_command: Option<u64>,
}

impl Reasons {
    /// Those of a recording.
    #[must_use]
    pub fn of(recording: &Recording) -> Self {
        let commands = |turn: &&Turn| {
            turn.request.datagrams().iter().any(|datagram| {
                datagram.command.is_some_and(|command| command.effect().writes)
                    && touches_sii(datagram)
            })
        };
        let first_command = recording.turns.iter().find(commands).map(|turn| turn.request.number);
        Self { first_gap: recording.first_gap, first_command }
    }

    /// Why the answer to a datagram of this turn differs; `None` where the recording shows no reason.
    #[must_use]
    pub fn of_difference(&self, turn: &Turn, recorded: &Datagram<'_>) -> Option<Reason> {
        let number = turn.request.number;
        if is_own_message(recorded.data) {
            return Some(Reason::OwnMessage);
        }
        if self.first_gap.is_some_and(|gap| gap < number) {
            return Some(Reason::FramesMissing);
        }
        let before = self.first_command.is_none_or(|command| number < command);
        (before && touches_sii(recorded)).then_some(Reason::SiiUnderWay)
    }
}

/// Whether a datagram is about the registers by which an SII is commanded and read.
fn touches_sii(datagram: &Datagram<'_>) -> bool {
    let sii = r::SII_CONTROL_STATUS.address.0..r::SII_DATA.end().0;
    let registers =
        datagram.command.is_some_and(|command| command.addressing() != Addressing::Logical);
    registers && sii.contains(&datagram.ado.0)
}

fn is_own_message(data: &[u8]) -> bool {
    let Ok(message) = Message::parse(data) else { return false };
    match message.header.kind {
        MailboxType::Eoe | MailboxType::Soe | MailboxType::Voe | MailboxType::Aoe => true,
        MailboxType::Coe => {
            matches!(CoeMessage::parse(message.data), Ok(CoeMessage::Emergency(_)))
        }
        MailboxType::Foe | MailboxType::Error | MailboxType::Reserved(_) => false,
    }
}
