//! Observations of a bundle: what the host noticed between two frames, one JSON object a line.

use linesman_diagnosis::report::Number;
use linesman_diagnosis::{Engine, HostEvent, HostObservation};
use linesman_proto::address::{Network, Path};
use linesman_proto::time::{Instant, Span};
use serde::{Deserialize, Serialize};

/// A line of `observations.jsonl`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub struct ObservationLine {
    /// Its place: behind so many frames of `frames.pcapng`.
    pub after_frame: Number,
    /// When, in ns since the start of the run.
    pub at_ns: Number,
    /// The network.
    pub network: u8,
    /// What was noticed.
    pub noticed: Noticed,
}

/// What was noticed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Noticed {
    /// A card has a link, or has none any more.
    Carrier {
        /// The card, A or B.
        card: char,
        /// Whether there is a link.
        link: bool,
    },
    /// A card dropped damaged frames.
    CardErrors {
        /// The card, A or B.
        card: char,
        /// Frames whose check sequence was wrong.
        crc: Number,
        /// Other receive errors.
        other: Number,
    },
    /// A card dropped frames for want of room.
    CardDrops {
        /// The card, A or B.
        card: char,
        /// How many.
        frames: Number,
    },
    /// A socket dropped frames for want of room.
    SocketDrops {
        /// The card, A or B.
        card: char,
        /// How many.
        frames: Number,
    },
    /// Frames could not be sent.
    SendFailures {
        /// The card, A or B.
        card: char,
        /// How many.
        frames: Number,
    },
    /// A cycle began late.
    Late {
        /// The card, A or B.
        card: char,
        /// By how much, in ns.
        late_ns: Number,
    },
    /// The clock was set.
    ClockStep {
        /// The card, A or B.
        card: char,
        /// By how much, in ns.
        step_ns: i64,
    },
    /// Frames passed that the diagnosis was not shown, because it did not keep up.
    NotShown {
        /// How many.
        frames: Number,
    },
    /// The diagnosis was shown frames that are not in the bundle.
    LeftOut {
        /// How many.
        frames: Number,
    },
}

impl ObservationLine {
    /// An observation of the host behind so many frames.
    #[must_use]
    pub(super) fn of_host(after_frame: u64, seen: &HostObservation) -> Self {
        let card = letter(seen.path);
        let noticed = match seen.what {
            HostEvent::Carrier(link) => Noticed::Carrier { card, link },
            HostEvent::CardErrors { crc, other } => {
                Noticed::CardErrors { card, crc: Number(crc), other: Number(other) }
            }
            HostEvent::CardDrops(frames) => Noticed::CardDrops { card, frames: Number(frames) },
            HostEvent::SocketDrops(frames) => Noticed::SocketDrops { card, frames: Number(frames) },
            HostEvent::SendFailures(frames) => {
                Noticed::SendFailures { card, frames: Number(frames) }
            }
            HostEvent::Late(late) => Noticed::Late { card, late_ns: Number(late.as_nanos()) },
            HostEvent::ClockStep(step_ns) => Noticed::ClockStep { card, step_ns },
        };
        let (after_frame, at_ns) = (Number(after_frame), Number(seen.time.as_nanos()));
        Self { after_frame, at_ns, network: seen.network.0, noticed }
    }

    /// When it was noticed.
    #[must_use]
    pub const fn at(&self) -> Instant {
        Instant::from_nanos(self.at_ns.0)
    }

    /// Shows it to a diagnosis.
    pub fn show(&self, engine: &mut Engine) {
        let (at, network) = (self.at(), Network(self.network));
        let (card, what) = match self.noticed {
            Noticed::NotShown { frames } | Noticed::LeftOut { frames } => {
                engine.handle_missed(network, frames.0, at);
                return;
            }
            Noticed::Carrier { card, link } => (card, HostEvent::Carrier(link)),
            Noticed::CardErrors { card, crc, other } => {
                (card, HostEvent::CardErrors { crc: crc.0, other: other.0 })
            }
            Noticed::CardDrops { card, frames } => (card, HostEvent::CardDrops(frames.0)),
            Noticed::SocketDrops { card, frames } => (card, HostEvent::SocketDrops(frames.0)),
            Noticed::SendFailures { card, frames } => (card, HostEvent::SendFailures(frames.0)),
            Noticed::Late { card, late_ns } => (card, HostEvent::Late(Span::ns(late_ns.0))),
            Noticed::ClockStep { card, step_ns } => (card, HostEvent::ClockStep(step_ns)),
        };
        let path = if card == 'B' { Path::B } else { Path::A };
        engine.handle_host(&HostObservation { network, path, time: at, what });
    }
}

/// The letter of a card.
pub(super) const fn letter(path: Path) -> char {
    match path {
        Path::A => 'A',
        Path::B => 'B',
    }
}
