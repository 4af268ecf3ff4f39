//! Failure of a mailbox operation: SubDevice, operation, step, reason, next step.

use std::fmt;

use linesman_proto::address::DeviceId;
use linesman_proto::ads::AdsCode;
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::mailbox::eoe::EoeResult;
use linesman_proto::mailbox::error_reply::ErrorReplyCode;
use linesman_proto::mailbox::foe::FoeErrorCode;
use linesman_proto::mailbox::soe::SoeError;
use linesman_proto::mailbox::{BufferTooSmall, MailboxType};
use linesman_proto::time::Span;

use super::request::MailboxOperation;
use crate::exchange::ExchangeError;

/// An operation that came to nothing.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct MailboxFailure {
    /// Whose mailbox.
    pub id: DeviceId,
    /// What was to be done.
    pub operation: MailboxOperation,
    /// How far it had come.
    pub step: Step,
    /// Why it came to nothing.
    pub why: Why,
}

/// How far an operation had come.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Step {
    /// Nothing had been sent.
    #[default]
    Before,
    /// The request.
    Request,
    /// A segment of an object, from 1.
    Segment(u32),
    /// A fragment of a description, from 1.
    Fragment(u32),
    /// A packet of a file.
    Packet {
        /// Which, from 1.
        number: u32,
        /// Bytes of the file that are through.
        done: usize,
        /// Bytes of the whole file; `None` while nobody knows, as in reading.
        total: Option<usize>,
    },
}

impl fmt::Display for Step {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Before => f.write_str("before the request"),
            Self::Request => f.write_str("the request"),
            Self::Segment(number) => write!(f, "segment {number}"),
            Self::Fragment(number) => write!(f, "fragment {number}"),
            Self::Packet { number, done, total: Some(total) } => {
                write!(f, "packet {number}, {done} of {total} bytes through")
            }
            Self::Packet { number, done, total: None } => {
                write!(f, "packet {number}, {done} bytes through")
            }
        }
    }
}

/// Why an operation came to nothing.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Why {
    /// The SubDevice ended the SDO transfer, or refused a question about its dictionary.
    Aborted {
        /// Its reason.
        code: SdoAbortCode,
    },
    /// It refused a file.
    File {
        /// Its reason.
        code: FoeErrorCode,
        /// What it says about it; may be empty.
        text: String,
    },
    /// It refused addresses for an Ethernet port.
    Ethernet {
        /// Its reason.
        result: EoeResult,
    },
    /// Its drive refused an identification number.
    Drive {
        /// Its reason.
        code: SoeError,
    },
    /// It refused a request of ADS.
    Ads {
        /// Its reason.
        code: AdsCode,
    },
    /// It answers with an error of the mailbox itself.
    Mailbox {
        /// Its reason.
        code: ErrorReplyCode,
    },
    /// No answer came.
    NoAnswer {
        /// How long it was waited for.
        patience: Span,
        /// What came instead that is no message, in words.
        rubbish: Option<String>,
    },
    /// It does not fetch what is written to its mailbox.
    MailboxFull {
        /// How long it was tried.
        patience: Span,
    },
    /// It says "busy" for ever.
    Busy {
        /// For how long.
        patience: Span,
        /// What it says it does; may be empty.
        text: String,
    },
    /// Too many jobs wait for it already.
    Crowded {
        /// How many.
        waiting: usize,
    },
    /// It has no mailbox.
    NoMailbox,
    /// Its mailbox is not open in the state that it is in.
    NotOpen,
    /// It does not speak the protocol.
    NotSpoken {
        /// Which.
        protocol: MailboxType,
    },
    /// It answers something that does not belong there.
    Protocol {
        /// What was expected.
        expected: &'static str,
        /// What came.
        found: String,
    },
    /// More would come than is believed, or taken.
    TooLong {
        /// How many bytes.
        limit: usize,
    },
    /// The message does not fit into its mailbox.
    TooSmall(BufferTooSmall),
    /// It cannot be reached.
    Exchange(ExchangeError),
    /// The MainDevice was told to do something else meanwhile.
    Abandoned,
}

impl Why {
    /// What to do about it, in one sentence without a full stop; empty where there is nothing to
    /// advise.
    #[must_use]
    pub fn advice(&self) -> &'static str {
        match self {
            Self::Aborted { code } => code.explain().action,
            Self::File { code, .. } => code.action(),
            Self::Drive { code } => code.action(),
            Self::Ads { code } => code.action(),
            Self::Ethernet { .. } => {
                "check that the SubDevice takes addresses by EoE, and these ones; else set them with its \
                 maker's tool"
            }
            Self::Mailbox { code: ErrorReplyCode::UnsupportedProtocol } => {
                "ask the SubDevice for what it speaks: its SII says which protocols"
            }
            Self::Mailbox { .. } | Self::Protocol { .. } => {
                "take a capture of the mailbox messages and show it to the maker of the SubDevice"
            }
            Self::NoAnswer { .. } => {
                "its software is slow or stuck: look at the SubDevice's display and diagnosis \
                 history, then switch it off and on"
            }
            Self::MailboxFull { .. } => {
                "its software does not run: switch the SubDevice off and on, else replace it"
            }
            Self::Busy { .. } => "wait until the SubDevice is done, then repeat",
            Self::Crowded { .. } => "wait for answers before you ask for more",
            Self::NoMailbox => "choose a SubDevice that has a mailbox (`linesman scan -v`)",
            Self::NotOpen => "take it to PREOP first (`linesman state WHERE DEVICE --to PREOP`)",
            Self::NotSpoken { .. } => "choose a SubDevice that speaks it (`linesman scan -v`)",
            Self::TooLong { .. } => "check that it is the right object or file",
            Self::TooSmall(_) => "use a shorter name, or a smaller piece",
            Self::Exchange(_) => "look at the line with `linesman diagnose`",
            Self::Abandoned => "ask again",
        }
    }

    /// Whether the SubDevice itself has said no: its mailbox works, but what was asked does not suit.
    #[must_use]
    pub const fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::Aborted { .. }
                | Self::File { .. }
                | Self::Ethernet { .. }
                | Self::Drive { .. }
                | Self::Ads { .. }
                | Self::Mailbox { .. }
        )
    }

    /// Whether an answer may still come, so that it must not be taken for that to another question.
    pub(crate) const fn leaves_answer_behind(&self) -> bool {
        matches!(
            self,
            Self::NoAnswer { .. }
                | Self::MailboxFull { .. }
                | Self::Busy { .. }
                | Self::Protocol { .. }
                | Self::TooLong { .. }
                | Self::Exchange(_)
        )
    }
}

impl fmt::Display for Why {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Aborted { code } => write!(f, "the SubDevice aborts, {code}"),
            Self::File { code, text } if text.is_empty() => write!(f, "{code}"),
            Self::File { code, text } => write!(f, "{code}; it says: {text}"),
            Self::Ethernet { result } => write!(f, "the SubDevice refuses the addresses, {result}"),
            Self::Drive { code } => write!(f, "the drive refuses, {code}"),
            Self::Ads { code } => write!(f, "the SubDevice refuses, ADS code {code}"),
            Self::Mailbox { code } => write!(f, "the SubDevice refuses the message, {code}"),
            Self::NoAnswer { patience, rubbish } => {
                write!(f, "no answer within {patience}, although its mailbox takes messages")?;
                rubbish.iter().try_for_each(|rubbish| write!(f, "; what came is none: {rubbish}"))
            }
            Self::MailboxFull { patience } => {
                write!(f, "its mailbox stays full for {patience}: nobody reads what is written")
            }
            Self::Busy { patience, text } if text.is_empty() => {
                write!(f, "it says it is busy for {patience}")
            }
            Self::Busy { patience, text } => {
                write!(f, "it says it is busy for {patience}: {text}")
            }
            Self::Crowded { waiting } => {
                write!(f, "{waiting} requests wait for its mailbox already")
            }
            Self::NoMailbox => f.write_str("it has no mailbox"),
            Self::NotOpen => f.write_str("its mailbox is not open; that takes PREOP or higher"),
            Self::NotSpoken { protocol } => write!(f, "it does not speak {protocol}"),
            Self::Protocol { expected, found } => write!(f, "expected {expected}, came {found}"),
            Self::TooLong { limit } => write!(f, "more than {limit} bytes"),
            Self::TooSmall(error) => error.fmt(f),
            Self::Exchange(error) => error.fmt(f),
            Self::Abandoned => f.write_str("the MainDevice was told to do something else"),
        }
    }
}

impl From<ExchangeError> for Why {
    fn from(error: ExchangeError) -> Self {
        Self::Exchange(error)
    }
}

impl From<BufferTooSmall> for Why {
    fn from(error: BufferTooSmall) -> Self {
        Self::TooSmall(error)
    }
}

impl fmt::Display for MailboxFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { id, operation, step, why } = self;
        write!(f, "SubDevice {}, {operation}", id.no())?;
        if !matches!(step, Step::Before | Step::Request) {
            write!(f, ", {step}")?;
        }
        write!(f, ": {why}")?;
        if matches!(step, Step::Packet { .. }) && !why.is_refusal() {
            f.write_str(
                "; FoE cannot go on where it stopped, the file has to be sent anew as a whole",
            )?;
        }
        let advice = why.advice().trim_end_matches('.');
        let mut letters = advice.chars();
        match letters.next() {
            None => Ok(()),
            Some(first) => write!(f, ". Do: {}{}", first.to_ascii_lowercase(), letters.as_str()),
        }
    }
}

impl std::error::Error for MailboxFailure {}
