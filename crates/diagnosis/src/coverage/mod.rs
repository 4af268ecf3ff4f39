//! Coverage of a verdict: the kinds of fault that the input allowed to judge, and those that it did not.
//!
//! A line is called healthy only where the evidence would have shown otherwise. Each [`Subject`] is a group of
//! faults that show in the same evidence; for each the assessment says how far it was judged, and each [`Gap`]
//! says what was missing, where, and the next step that would get it. [`Coverage::suffices`] is the one place that
//! decides whether silence of the rules may be called healthy.

mod presence;
mod process_data;
mod rest;
mod signal;
mod state;
mod traffic;

use linesman_config::fault::FaultName;
use linesman_proto::time::Instant;
use serde::{Deserialize, Serialize};

use crate::ask::{AskRefusal, AskingReport};
use crate::finding::Place;
use crate::main_device::{MainDeviceKind, next_step};
use crate::model::NetworkModel;

/// The step that has what a MainDevice does not read be read by questions.
const ASK: &str =
    "on its own computer, have it read beside its cycle: `linesman diagnose WHERE --ask`";

/// A way by which evidence came in: it decides which next steps there are.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum InputKind {
    /// This program drives the line, or reads it while nobody drives it.
    Driven,
    /// This program listens beside another MainDevice.
    Listened,
    /// A capture file.
    #[default]
    Recorded,
    /// Registers that were read out, without the frames: `counters`, `probe`.
    ReadOut,
    /// Values that a person copied from another tool.
    Typed,
}

/// Faults that show in the same evidence.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Subject {
    /// Frames that do not come back, or come back damaged.
    Frames,
    /// SubDevices that are there and answer.
    Presence,
    /// States of SubDevices and their AL status codes.
    States,
    /// Working counters of the process data.
    ProcessData,
    /// Signal quality: error counters of each link and direction.
    SignalQuality,
    /// Links that come and go.
    LinkStatus,
    /// Identity of the SubDevices.
    Identity,
    /// Wiring and order of the SubDevices.
    Wiring,
    /// Mailboxes and their messages.
    Mailboxes,
    /// Distributed clocks.
    Clocks,
    /// Times at which frames leave and come back.
    Timing,
    /// This computer, its card and its sockets.
    Host,
}

impl Subject {
    /// All subjects, the essential ones first.
    pub const ALL: [Self; 12] = [
        Self::Frames,
        Self::Presence,
        Self::States,
        Self::ProcessData,
        Self::SignalQuality,
        Self::LinkStatus,
        Self::Identity,
        Self::Wiring,
        Self::Mailboxes,
        Self::Clocks,
        Self::Timing,
        Self::Host,
    ];

    /// The subject that shows a kind of fault.
    #[must_use]
    pub const fn of(fault: FaultName) -> Self {
        use FaultName as F;
        match fault {
            F::FalseLink | F::NicDamaged | F::HostDrops | F::ForeignFrames => Self::Frames,
            F::LinkOpen
            | F::RingOpen
            | F::DeviceOff
            | F::SupplyOff
            | F::DeviceMissing
            | F::DuplicateAddress => Self::Presence,
            F::BrownOut
            | F::EbusOverload
            | F::InitRefused
            | F::ConfigMismatch
            | F::WatchdogStarved
            | F::SyncLost
            | F::CycleTooFast
            | F::SecondMainDevice => Self::States,
            F::FirmwareFault => Self::ProcessData,
            F::CableDegraded
            | F::EmcNoise
            | F::TransmitterDamaged
            | F::ReceiverDamaged
            | F::DeviceInternal => Self::SignalQuality,
            F::LinkFlapping | F::EarlyLink => Self::LinkStatus,
            F::DeviceExtra | F::DeviceWrong | F::DevicesSwapped | F::TwinsSwapped => Self::Identity,
            F::PortsSwapped | F::MainDeviceWrongPort => Self::Wiring,
            F::MailboxError | F::MailboxSlow | F::MailboxStuck | F::EoeFault | F::Emergency => {
                Self::Mailboxes
            }
            F::ClockDrift | F::ReferenceClockLost => Self::Clocks,
            F::LateFrames => Self::Timing,
            F::HostJitter | F::OneSidedRecording => Self::Host,
        }
    }

    /// The faults that show in this evidence.
    pub fn faults(self) -> impl Iterator<Item = FaultName> {
        FaultName::ALL.iter().copied().filter(move |fault| Self::of(*fault) == self)
    }

    /// The subject in the words of a sentence: "judged: lost frames, …".
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Frames => "lost frames",
            Self::Presence => "presence of the SubDevices",
            Self::States => "states",
            Self::ProcessData => "working counters",
            Self::SignalQuality => "error counters",
            Self::LinkStatus => "link status",
            Self::Identity => "identities",
            Self::Wiring => "wiring",
            Self::Mailboxes => "mailboxes",
            Self::Clocks => "clocks",
            Self::Timing => "timing",
            Self::Host => "this computer",
        }
    }
}

/// How far a subject was judged.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Extent {
    /// Not at all: a fault of this kind would not have shown.
    NotJudged,
    /// In part: such a fault may have stayed unseen, as the gaps say.
    InPart,
    /// Everywhere, all the time: such a fault would have shown.
    Judged,
}

/// Why a subject, or a part of it, was not judged.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Reason {
    /// No frame was seen: registers alone were read, or copied from a tool.
    NoFrames,
    /// Too few frames to say anything.
    TooFewFrames,
    /// Frames of one direction only.
    OneDirection,
    /// Frames were cut off by the recorder before their working counters.
    FramesCut,
    /// Frames did not come back, and nothing tells why.
    FramesLost,
    /// The recording ended while frames were on their way, or with them.
    EndOpen,
    /// Nothing was sent any more for a while before the end, where process data had been exchanged in a cycle.
    EndsStill,
    /// Frames came back a second time.
    FramesDoubled,
    /// Frames passed, and the diagnosis was too slow to look at them.
    FramesMissed,
    /// Time stamps run backwards.
    ClockJumpsBack,
    /// Nothing was sent, or recorded, for a long time in between.
    LongGap,
    /// Nobody sent process data, or not yet often enough.
    NoProcessData,
    /// The bring-up was not seen, so what was set up is not known.
    NoBringUp,
    /// The working counter that belongs to a datagram is not known.
    ExpectedWorkingCounterUnknown,
    /// How many SubDevices there are is not known.
    NumberUnknown,
    /// A SubDevice was asked and did not answer.
    NoAnswer,
    /// AL status was never read.
    StatesNotRead,
    /// A state was asked for and not reached by the end, or an error was acknowledged that was not read.
    StateUnsettled,
    /// AL status was read long before the end.
    StatesOld,
    /// DL status was never read.
    LinkStatusNotRead,
    /// A port had no link at first and has one now: why was not seen.
    LinkCameUp,
    /// Error counters were never read.
    CountersNotRead,
    /// Error counters were read once: what they hold may be history.
    CountersReadOnce,
    /// A counter stands at its end, 255, and counts no more.
    CounterFull,
    /// The card's own counters are not known.
    HostCountersMissing,
    /// The wiring is not known.
    WiringUnknown,
    /// What was planned is not known.
    NoProject,
    /// Nobody asked through a mailbox, or not every SubDevice.
    NoMailboxRequests,
    /// Questions beside the MainDevice were not sent, or no longer.
    NotAsked,
    /// No clock's difference to the reference clock was read.
    ClocksNotRead,
    /// A value was not given.
    NotGiven,
}

/// Something that was missing.
#[derive(Clone, PartialEq, Debug)]
pub struct Gap {
    /// Why.
    pub reason: Reason,
    /// Where: links with the direction, SubDevices; empty for the network as a whole.
    pub places: Vec<Place>,
    /// The same in words.
    pub text: String,
    /// The next step that would get it; empty where there is none.
    pub next_step: String,
    /// Whether the line cannot be called healthy because of it.
    pub is_essential: bool,
}

impl Gap {
    fn new(reason: Reason, text: impl Into<String>) -> Self {
        let (places, next_step) = (Vec::new(), String::new());
        Self { reason, places, text: text.into(), next_step, is_essential: false }
    }

    fn essential(mut self) -> Self {
        self.is_essential = true;
        self
    }

    fn essential_if(mut self, is_essential: bool) -> Self {
        self.is_essential = is_essential;
        self
    }

    fn at(mut self, places: Vec<Place>) -> Self {
        self.places = places;
        self
    }

    fn step(mut self, next_step: impl Into<String>) -> Self {
        self.next_step = next_step.into();
        self
    }
}

/// How far one subject was judged, and what was missing.
#[derive(Clone, PartialEq, Debug)]
pub struct Assessment {
    /// The subject.
    pub subject: Subject,
    /// How far.
    pub extent: Extent,
    /// What was missing.
    pub gaps: Vec<Gap>,
}

impl Assessment {
    fn judged(subject: Subject) -> Self {
        Self { subject, extent: Extent::Judged, gaps: Vec::new() }
    }

    fn lacks(&mut self, extent: Extent, gap: Gap) {
        self.extent = self.extent.min(extent);
        self.gaps.push(gap);
    }
}

/// How far each kind of fault was judged on all networks.
#[derive(Clone, PartialEq, Default, Debug)]
pub struct Coverage {
    /// In the order of [`Subject::ALL`]; none before anything was seen.
    pub assessments: Vec<Assessment>,
}

impl Coverage {
    /// Assesses one network.
    #[must_use]
    pub fn of(model: &NetworkModel, input: InputKind) -> Self {
        let basis = Basis::of(model, input);
        let assess = |subject| match subject {
            Subject::Frames => traffic::frames(&basis),
            Subject::Presence => presence::assess(&basis),
            Subject::States => state::assess(&basis),
            Subject::ProcessData => process_data::assess(&basis),
            Subject::SignalQuality => signal::quality(&basis),
            Subject::LinkStatus => signal::link_status(&basis),
            Subject::Identity => rest::identity(&basis),
            Subject::Wiring => rest::wiring(&basis),
            Subject::Mailboxes => rest::mailboxes(&basis),
            Subject::Clocks => rest::clocks(&basis),
            Subject::Timing => traffic::timing(&basis),
            Subject::Host => rest::host(&basis),
        };
        Self { assessments: Subject::ALL.map(assess).into() }
    }

    /// Both together: a subject is judged as far as on the network where it was judged least.
    pub fn merge(&mut self, other: Self) {
        if self.assessments.is_empty() {
            *self = other;
            return;
        }
        for (mine, its) in self.assessments.iter_mut().zip(other.assessments) {
            mine.extent = mine.extent.min(its.extent);
            mine.gaps.extend(its.gaps);
        }
    }

    /// Says of what questions are to read that they were not asked to the end.
    pub fn note_asking(&mut self, asking: &AskingReport) {
        let Some(reason) = &asking.reason else { return };
        let text = match asking.last_ns {
            None => format!("no question was asked: {reason}"),
            Some(last) => {
                format!("no question was asked after {}: {reason}", Instant::from_nanos(last.0))
            }
        };
        let step = asking.next_step.clone().unwrap_or_default();
        let subjects = [Subject::SignalQuality, Subject::LinkStatus];
        for one in self.assessments.iter_mut().filter(|one| subjects.contains(&one.subject)) {
            one.lacks(Extent::InPart, Gap::new(Reason::NotAsked, text.as_str()).step(step.clone()));
        }
    }

    /// Whether enough was judged to call a line healthy of which no rule says anything.
    #[must_use]
    pub fn suffices(&self) -> bool {
        !self.assessments.is_empty() && self.essential_gaps().next().is_none()
    }

    /// What keeps the line from being called healthy, the most important first.
    pub fn essential_gaps(&self) -> impl Iterator<Item = &Gap> {
        self.assessments.iter().flat_map(|one| &one.gaps).filter(|gap| gap.is_essential)
    }

    /// How far a kind of fault was judged.
    #[must_use]
    pub fn extent_of(&self, fault: FaultName) -> Extent {
        let subject = Subject::of(fault);
        let found = self.assessments.iter().find(|one| one.subject == subject);
        found.map_or(Extent::NotJudged, |one| one.extent)
    }
}

/// Facts that several subjects are judged by.
struct Basis<'a> {
    model: &'a NetworkModel,
    input: InputKind,
    /// Whether frames were seen: else registers were read out, or typed in.
    has_frames: bool,
    /// Whether every SubDevice is known to be in a state in which it exchanges process data, as far as it has any, by
    /// readings of AL status.
    states_read: bool,
    /// Whether the working counter that belongs to each cyclic datagram is known.
    expectations_known: bool,
    /// Whether every port of every link told of errors, all the time.
    counters_tell: bool,
}

impl<'a> Basis<'a> {
    fn of(model: &'a NetworkModel, input: InputKind) -> Self {
        let has_frames = model.traffic.recording.frames() > 0;
        let states_read = state::all_read(model);
        let expectations_known = process_data::all_known(model);
        let counters_tell = signal::all_tell(model);
        Self { model, input, has_frames, states_read, expectations_known, counters_tell }
    }

    /// The next step that gets a longer look at the line.
    fn look_longer(&self) -> &'static str {
        match self.input {
            InputKind::Driven => "look longer, `--seconds 30`",
            InputKind::Listened => "listen longer, `--seconds 30`",
            InputKind::Recorded => {
                "record some seconds of the running line, both directions, whole frames"
            }
            InputKind::ReadOut => "watch longer, `--for 60`",
            InputKind::Typed => "read the values again after some minutes, and give both readings",
        }
    }

    /// The next step that gets error counters read.
    fn read_counters(&self) -> String {
        let kind = self.model.main_device_kind();
        match self.input {
            InputKind::Driven | InputKind::ReadOut => {
                "clear and watch them: `linesman counters WHERE --clear --for 60`".to_owned()
            }
            InputKind::Listened
                if AskRefusal::of(self.model.habits.recognised().as_ref()).is_none() =>
            {
                format!("{ASK}; or {}", next_step::error_counters(kind))
            }
            InputKind::Typed if kind == MainDeviceKind::Unknown => {
                "clear the error counters, wait, read them again, and give both readings".to_owned()
            }
            InputKind::Listened | InputKind::Recorded | InputKind::Typed => {
                next_step::error_counters(kind).to_owned()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_has_a_subject_and_every_subject_a_fault() {
        let count: usize = Subject::ALL.into_iter().map(|subject| subject.faults().count()).sum();
        assert_eq!(count, FaultName::ALL.len());
        for subject in Subject::ALL {
            assert!(subject.faults().next().is_some(), "{subject:?}");
        }
    }

    #[test]
    fn nothing_seen_is_not_enough() {
        assert!(!Coverage::default().suffices());
        let coverage = Coverage::of(&NetworkModel::default(), InputKind::Recorded);
        assert!(!coverage.suffices());
        let first = coverage.essential_gaps().next().unwrap();
        assert!(!first.next_step.is_empty(), "{first:?}");
    }

    #[test]
    fn two_networks_are_judged_as_far_as_the_worse_one() {
        let coverage = |extent| Coverage {
            assessments: vec![Assessment { extent, ..Assessment::judged(Subject::Frames) }],
        };
        let mut both = Coverage::default();
        both.merge(coverage(Extent::Judged));
        both.merge(coverage(Extent::InPart));
        assert_eq!(both.extent_of(FaultName::HostDrops), Extent::InPart);
    }
}
