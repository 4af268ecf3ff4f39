//! Single services for SubDevices: what tools ask for one at a time.
//!
//! [`MainDevice::serve_only`](crate::MainDevice::serve_only) serves the SubDevices of a plan without driving
//! them; [`MainDevice::serve`](crate::MainDevice::serve) does one [`Service`], there or beside a
//! running plan, and ends in [`Event::Served`](crate::Event::Served).

mod failure;
mod perform;
mod service_only;
mod state;

use linesman_proto::address::RegisterAddress;
use linesman_proto::register::AlStatus;
use linesman_proto::sii::WordAddress;
use linesman_proto::state::{AlState, AlStatusCode};

use crate::mailbox::MailboxRequest;

pub use failure::{RefusalKind, ServiceFailure};
pub(crate) use perform::{ServiceContext, perform};
pub(crate) use service_only::ServiceOnly;

/// Tells services apart that are under way at once.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct ServiceTicket(pub(crate) u64);

/// Something that is done for one SubDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Service {
    /// Ask through its mailbox; gives [`ServiceAnswer::Data`].
    Mailbox(MailboxRequest),
    /// Look at its state; gives [`ServiceAnswer::State`].
    State,
    /// Take it to a state, step by step, with all that each step needs; gives
    /// [`ServiceAnswer::State`]. An error that stands is acknowledged first. Of a line that is driven
    /// the target changes, too.
    Enter(AlState),
    /// Acknowledge an error, without another state; gives [`ServiceAnswer::State`].
    Acknowledge,
    /// Read all error counters and clear them in one go; the totals of the watch keep what stood there.
    /// Gives [`ServiceAnswer::Data`], the bytes of 0x0300 to 0x0313 as they were.
    ClearCounters,
    /// Read registers, or the memory behind them; gives [`ServiceAnswer::Data`].
    ReadRegister {
        /// From where.
        address: RegisterAddress,
        /// How many bytes, 1 to 1,486.
        len: u16,
    },
    /// Write registers; gives [`ServiceAnswer::Done`]. Whoever asks for it answers for what it does.
    WriteRegister {
        /// From where.
        address: RegisterAddress,
        /// The bytes, 1 to 1,486.
        data: Vec<u8>,
    },
    /// Read the EEPROM; gives [`ServiceAnswer::Data`].
    ReadSii {
        /// All of it, not only what is used.
        whole: bool,
    },
    /// Write words of the EEPROM that are not so yet, and read them back; gives
    /// [`ServiceAnswer::Written`].
    WriteSii {
        /// The first word.
        at: WordAddress,
        /// The bytes, two a word.
        data: Vec<u8>,
    },
}

impl Service {
    /// True if it moves a file, of which [`Event::FileProgress`](crate::Event::FileProgress) tells how far it has
    /// come.
    #[must_use]
    pub const fn moves_file(&self) -> bool {
        matches!(
            self,
            Self::Mailbox(MailboxRequest::ReadFile { .. } | MailboxRequest::WriteFile { .. })
        )
    }
}

/// What a service gives.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ServiceAnswer {
    /// It is done.
    Done,
    /// Bytes.
    Data(Vec<u8>),
    /// The state as it is now.
    State {
        /// State and error bit.
        status: AlStatus,
        /// Why, when there is an error.
        code: AlStatusCode,
    },
    /// Words of the EEPROM are as they shall be.
    Written {
        /// How many had been different.
        words: u32,
    },
}
