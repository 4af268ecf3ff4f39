//! Options of a MainDevice that its user chooses.

use linesman_config::plan::ethernet::ACYCLIC_FRAMES;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::state::StateTimeouts;
use linesman_proto::time::{DcTime, Span};

use crate::network_group::NetworkGroup;

/// Choices for one network.
#[derive(Clone, Debug)]
pub struct Options {
    /// Source addresses of the frames of card A and card B; they must differ, and bit 0x02 of the
    /// first byte must be clear, since controllers set it.
    pub sources: [MacAddress; 2],
    /// Whether a second card closes a ring: every frame is sent by both.
    pub ring: bool,
    /// How long a frame of procedures is waited for. Cyclic frames are waited for one cycle.
    pub patience: Span,
    /// How often a datagram is sent again after its frame was lost, or it was not executed.
    pub repeats: u8,
    /// Most frames of procedures that are out at once, without and beside a cycle.
    pub frames_at_once: usize,
    /// How many cycles in a row the application may leave its outputs as they are. Beyond that
    /// datagrams with outputs are sent without them, so that the watchdogs of SubDevices expire;
    /// `None`: it may be as late as it likes. It counts from the first outputs that it gives.
    pub allowed_misses: Option<u32>,
    /// What is read while running, to watch the SubDevices.
    pub polling: Polling,
    /// How often it is read.
    pub watch_interval: Span,
    /// Counter registers stop at 255. When one has reached this, all error counters of the SubDevice are read
    /// and cleared in one frame, and the totals go on; `None`: never, as where somebody else clears them.
    pub clear_counters_at: Option<u8>,
    /// How often mailboxes are looked into, when nothing is expected.
    pub mailbox_interval: Span,
    /// How long a SubDevice may take to answer a mailbox request.
    pub mailbox_patience: Span,
    /// How long a SubDevice may take for a step between states.
    pub state_timeouts: StateTimeouts,
    /// Whether a SubDevice that left its state on its own is brought back.
    pub restore_states: bool,
    /// Whether a SubDevice that was lost is brought up again when it answers.
    pub reinitialise: bool,
    /// No SubDevice goes beyond this state until [`MainDevice::release`](crate::MainDevice::release)
    /// is called, as for an application that is not ready yet.
    pub hold_at: Option<linesman_proto::state::AlState>,
    /// The system time of distributed clocks when the run begins (at [`Instant`] zero).
    ///
    /// [`Instant`]: linesman_proto::time::Instant
    pub clock_epoch: DcTime,
    /// The networks of this process that keep one time, if this one is to be among them: the first that starts leads,
    /// the others follow, unless the plan says whose time a network has.
    pub group: Option<NetworkGroup>,
    /// So many frames with the time of the reference clock are sent to compensate the drift of all
    /// clocks before SubDevices that use them leave PREOP.
    pub drift_frames: u32,
    /// How far the clock of a SubDevice with SyncSignals may be off before OP (0x092C).
    pub clock_limit: Span,
    /// How long it is waited for.
    pub clock_patience: Span,
    /// After a refused step: when it is tried again; the wait doubles up to the second value.
    pub retry_after: [Span; 2],
}

/// Registers that a running MainDevice reads beside process data, to watch its SubDevices.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Polling {
    /// AL status, DL status and error counters of each SubDevice, at intervals and as soon as process data
    /// show a change.
    #[default]
    EachDevice,
    /// AL status of all by one broadcast read, at intervals; only when that is not as it should be, AL status of
    /// each SubDevice.
    Rounds(Rounds),
    /// None: what process data show is all that is known.
    Nothing,
}

/// Registers that are read with AL status of all.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Rounds {
    /// DL status of each SubDevice, together with its AL status.
    pub links: bool,
    /// Error counters of each SubDevice, in each round.
    pub counters: CounterPoll,
}

/// A way to watch error counters.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum CounterPoll {
    /// They are not read.
    #[default]
    None,
    /// All of them are read, 0x0300 to 0x0313.
    Read,
    /// Those of the ports, 0x0300 to 0x0307, are read, then cleared by one broadcast write.
    ReadAndCleared,
}

impl Polling {
    /// Whether error counters are read.
    #[must_use]
    pub const fn reads_counters(self) -> bool {
        match self {
            Self::EachDevice => true,
            Self::Rounds(rounds) => !matches!(rounds.counters, CounterPoll::None),
            Self::Nothing => false,
        }
    }

    /// Whether DL status of a SubDevice is read together with its AL status.
    pub(crate) const fn reads_links(self) -> bool {
        match self {
            Self::EachDevice => true,
            Self::Rounds(rounds) => rounds.links,
            Self::Nothing => false,
        }
    }
}

impl Options {
    /// The same on a line of so many SubDevices, on which a frame is under way for so long: on one of
    /// thousands that is longer than is usually waited for, and more frames have to be out at once.
    #[must_use]
    pub fn on_line(self, devices: usize, longest_way: Span) -> Self {
        const DEVICES_A_FRAME: usize = 1_000;
        const MOST_FRAMES: usize = 64;
        Self {
            patience: self.patience.max(longest_way * 2),
            frames_at_once: self.frames_at_once.max((devices / DEVICES_A_FRAME).min(MOST_FRAMES)),
            ..self
        }
    }
}

impl Default for Options {
    fn default() -> Self {
        Self {
            // Addresses for documentation (RFC 7042); whoever has a real card gives its own.
            sources: [
                MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x0A]),
                MacAddress([0x00, 0x00, 0x5E, 0x00, 0x53, 0x0B]),
            ],
            ring: false,
            patience: Span::ms(10),
            repeats: 3,
            frames_at_once: ACYCLIC_FRAMES,
            allowed_misses: None,
            polling: Polling::default(),
            watch_interval: Span::ms(100),
            clear_counters_at: Some(128),
            mailbox_interval: Span::ms(50),
            mailbox_patience: Span::s(2),
            state_timeouts: StateTimeouts::DEFAULT,
            restore_states: true,
            reinitialise: true,
            hold_at: None,
            clock_epoch: DcTime(0),
            group: None,
            drift_frames: 15_000,
            clock_limit: Span::us(1),
            clock_patience: Span::s(10),
            retry_after: [Span::s(1), Span::s(16)],
        }
    }
}
