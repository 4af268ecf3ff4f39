//! Process data: each logical datagram with its working counter and times.

use linesman_proto::address::{DeviceId, LogicalAddress};
use linesman_proto::command::Command;
use linesman_proto::time::Instant;

use super::input_activity::InputActivity;
use super::{CycleTiming, Seen, WorkingCounterHistory};

/// A logical datagram that is sent again and again.
#[derive(Clone, Debug)]
pub struct Cyclic {
    /// LRD, LWR or LRW.
    pub command: Command,
    /// What another program calls it, where nobody saw the datagram itself.
    pub name: Option<String>,
    /// Where it begins.
    pub start: LogicalAddress,
    /// Its length in bytes.
    pub len: u16,
    /// The working counter it comes back with.
    pub wkc: WorkingCounterHistory,
    /// When it was sent.
    pub sent: CycleTiming,
    /// When it came back.
    pub returned: CycleTiming,
    /// Which of its inputs move.
    pub motion: InputActivity,
}

/// Who has an FMMU on a logical datagram.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Owner {
    /// The controller.
    pub device: DeviceId,
    /// It puts inputs there.
    pub reads: bool,
    /// It takes outputs from there.
    pub writes: bool,
}

impl Cyclic {
    /// A datagram that came back for the first time, with the working counter that was planned for it.
    #[must_use]
    pub fn new(
        command: Command,
        start: LogicalAddress,
        len: u16,
        wkc: Seen<u16>,
        planned: Option<u16>,
    ) -> Self {
        Self {
            command,
            name: None,
            start,
            len,
            wkc: WorkingCounterHistory::new(wkc, planned),
            sent: CycleTiming::default(),
            returned: CycleTiming::default(),
            motion: InputActivity::default(),
        }
    }

    /// What it is called in messages.
    #[must_use]
    pub fn label(&self) -> String {
        match &self.name {
            Some(name) => format!("{} `{name}`", self.command),
            None => format!("{} at {}, {} bytes", self.command, self.start, self.len),
        }
    }

    /// Notes that FMMUs of this datagram were set otherwise at `at`.
    pub fn lay_out_anew(&mut self, at: Instant) {
        self.wkc.lay_out_anew(at);
        self.set_up_again();
    }

    /// Notes that FMMUs of this datagram were set again: while SubDevices are brought up frames come unevenly.
    pub fn set_up_again(&mut self) {
        self.motion.forget();
        self.sent.learn_again();
        self.returned.learn_again();
    }
}
