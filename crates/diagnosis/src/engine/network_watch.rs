//! Diagnosis of one network: its model, and the times at which its rules run.

use linesman_proto::address::Path;
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};

use super::Probe;
use super::background_poll::BackgroundPoll;
use super::bisect::{self, Bisect};
use super::fast_poll::FastPoll;
use crate::finding::Condition;
use crate::model::{Learner, NetworkModel, Silence};
use crate::observe::capture_probe::ProbePassages;
use crate::observe::{Exchange, Fingerprint, FrameSeen, LatestFrame, Pairing};

/// For so long after its last rise a counter is watched in this way.
const WATCHED_AFTER_RISE: Span = Span::s(15);

/// So long after a frame was lost the counters are awaited that tell where, or where not.
const WATCHED_AFTER_LOSS: Span = Span::s(2);

/// Between two questions how DL control stands, to those of whom it is not known.
const CONTROLS_EVERY: Span = Span::ms(500);

/// So many frames lost one after the other are no accident.
const FEW_LOST: u64 = 3;

/// One network.
#[derive(Clone, Debug)]
pub(super) struct NetworkWatch {
    pub(super) model: NetworkModel,
    pub(super) learner: Learner,
    pub(super) pairing: Pairing,
    /// Role of the latest frame.
    pub(super) latest: LatestFrame,
    /// Copies of frames that a capture probe has recorded.
    pub(super) capture_probe: ProbePassages,
    /// Questions that are under way.
    pub(super) questions: Pairing,
    pub(super) judged: u64,
    /// What had gone wrong when the rules were last asked.
    pub(super) judged_alarms: (u64, u64),
    /// When to ask the rules again, though nothing new was learnt.
    pub(super) again: Option<Instant>,
    pub(super) conditions: Vec<Condition>,
    pub(super) probed: Option<Instant>,
    pub(super) probed_for: (u64, u64),
    /// A search for where frames vanish, while it goes on.
    pub(super) bisect: Option<Bisect>,
    /// When controllers were last asked how DL control stands.
    pub(super) controls_asked: Option<Instant>,
    pub(super) background_poll: BackgroundPoll,
    pub(super) close: FastPoll,
}

impl NetworkWatch {
    pub(super) fn new(model: NetworkModel) -> Self {
        let learner = Learner::new(&model);
        let capture_probe = ProbePassages::on_line(model.tree_is_planned);
        Self {
            model,
            learner,
            pairing: Pairing::default(),
            latest: LatestFrame::default(),
            capture_probe,
            questions: Pairing::default(),
            judged: 0,
            judged_alarms: (0, 0),
            again: None,
            conditions: Vec::new(),
            probed: None,
            probed_for: (0, 0),
            bisect: None,
            controls_asked: None,
            background_poll: BackgroundPoll::default(),
            close: FastPoll::default(),
        }
    }

    /// Takes a question, or what came back of one.
    pub(super) fn take_question(&mut self, frame: &FrameSeen<'_>, view: &FrameView<'_>) {
        let Self { model, learner, questions, .. } = self;
        let print = Fingerprint::of(view);
        questions.take(frame, view, print, &mut |exchange| learner.learn_answer(model, exchange));
    }

    /// Gives up what does not come back: by `now`, or all of it, as the input has ended.
    pub(super) fn expire(
        &mut self,
        now: Instant,
        has_ended: bool,
        observe: &mut impl FnMut(&NetworkModel, &Exchange<'_>),
    ) {
        let Self { model, learner, pairing, questions, .. } = self;
        let mut settle = |exchange: &Exchange<'_>| {
            learner.learn(model, exchange);
            observe(model, exchange);
        };
        if has_ended {
            pairing.finish(now, &mut settle);
            model.traffic.recording.record_end(now);
            questions.finish(now, &mut |exchange| learner.learn_answer(model, exchange));
        } else {
            pairing.expire(now, &mut settle);
            questions.expire(now, &mut |exchange| learner.learn_answer(model, exchange));
        }
    }

    /// Whether the rules have something to do at `now`.
    pub(super) fn is_due(&self, now: Instant) -> bool {
        self.model.revision() != self.judged || self.again.is_some_and(|again| again <= now)
    }

    /// Whether time alone can change what the rules say.
    pub(super) fn is_watched(&self, now: Instant) -> bool {
        let is_open = self.conditions.iter().any(|condition| condition.ended.is_none());
        // Counters that are read after a frame was lost tell by standing still.
        let is_recent = |at: Option<Instant>| at.is_some_and(|at| now < at + WATCHED_AFTER_LOSS);
        is_open
            || self.model.devices.iter().any(|device| device.mailbox.is_open())
            || is_recent(self.model.traffic.losses.frames().last)
            || Path::ALL.iter().any(|card| is_recent(self.model.traffic.losses.copies(*card).last))
            || self.model.devices.iter().any(|device| {
                device.counters.last_rise().is_some_and(|at| now < at + WATCHED_AFTER_RISE)
            })
    }

    /// Whether nothing comes back at the moment.
    pub(super) fn is_silent(&self) -> bool {
        let latest = self.model.traffic.losses.silences().back();
        let swallowed = self.model.traffic.losses.swallowed().back();
        let lasts = |silence: &Silence| silence.ended.is_none() && silence.frames >= FEW_LOST;
        latest.is_some_and(lasts) || swallowed.is_some_and(lasts) || self.bisect.is_some()
    }

    /// Whether it is not known of all that answer how DL control stands.
    pub(super) fn lacks_controls(&self) -> bool {
        let mut devices = self.model.devices.iter();
        devices.any(|device| device.answered.is_some() && device.dl_control.is_none())
    }

    /// Looks for the place where frames vanish, where that is allowed. Gives what to write or read next.
    pub(super) fn search(&mut self, now: Instant) -> Vec<Probe> {
        let model = &mut self.model;
        if self.bisect.is_none() {
            self.bisect = Bisect::begin(model, now);
        }
        if let Some(bisect) = &mut self.bisect {
            let probe = bisect.go_on(model, now);
            if model.hole.is_none_or(|hole| hole.ended.is_some()) {
                self.bisect = None;
            }
            return probe.into_iter().collect();
        }
        let is_due = self.controls_asked.is_none_or(|at| now >= at + CONTROLS_EVERY);
        if self.is_silent() || !is_due {
            return Vec::new();
        }
        let model = &self.model;
        self.controls_asked = Some(now);
        let unknown = model.devices.iter().filter(|device| {
            device.dl_control.is_none() && device.answered.is_some() && device.silent.is_none()
        });
        unknown.filter_map(|device| bisect::ask(model.network, device, now)).collect()
    }

    /// What makes it worth asking: frames lost, and working counters that fell.
    pub(super) fn alarms(&self) -> (u64, u64) {
        let deficits =
            self.model.cyclic.iter().map(|cyclic| cyclic.wkc.deficits().len() as u64).sum();
        (self.model.traffic.losses.frames().times, deficits)
    }
}
