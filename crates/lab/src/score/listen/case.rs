//! The listeners of one case.

use std::sync::PoisonError;

use linesman_diagnosis::report::{Diagnosis, Verdict};
use linesman_proto::address::DeviceId;
use linesman_proto::time::{Instant, Span};
use linesman_sim::truth::FaultRecord;

use super::super::judge::Accusations;
use super::super::play::Play;
use super::super::recorder::Recording;
use super::super::trace;
use super::join::Joins;
use super::judge::judge_listener;
use super::play::Listener;
use super::{HealthyListened, HealthySaid, Heard, Listeners, Pair};
use crate::verdict::judge::JudgedFault;
use crate::verdict::{Naming, Scene, Truth};

/// Who joins a healthy run listens for the last part of it: two of three.
const LATE_PART: u64 = 3;

impl Play<'_> {
    fn listener<'a>(&'a self, recording: &'a Recording, with_project: bool) -> Listener<'a> {
        Listener {
            recording,
            project: with_project.then(|| self.lab.project()),
            host_counters: self.case.host_counters,
        }
    }

    /// What listeners say of the run so far, in which nothing was wrong; `None` where nobody listens.
    pub(in crate::score) fn healthy_listened(&self) -> Option<HealthyListened> {
        let shared_recording = self.shared_recording.as_ref()?;
        let recording = shared_recording.lock().unwrap_or_else(PoisonError::into_inner);
        let now = self.lab.now();
        let late = self.late();
        let said = |(from, with_project)| {
            let said = self.listener(&recording, with_project).says(from, now);
            HealthySaid {
                alarms: said.as_ref().map(Accusations::of).unwrap_or_default().alarms,
                is_healthy: said.is_some_and(|said| said.verdict == Verdict::Healthy),
            }
        };
        let columns = [(None, false), (None, true), (Some(late), false), (Some(late), true)];
        Some(HealthyListened { columns: columns.map(said) })
    }

    /// When a listener joins a healthy run late.
    fn late(&self) -> Instant {
        let mut stream = self.case.seed.stream("score late and healthy");
        let part = self.lab.now().since(self.up).as_nanos() / LATE_PART;
        self.up + Span::ns(stream.between(0, part.max(1)))
    }

    /// When listeners join beside a fault.
    fn joins(&self, record: &FaultRecord) -> Joins {
        let mut stream = self.case.seed.stream("score listeners");
        Joins::draw(self.lab.truth(), record, (self.up, self.lab.now()), &mut stream)
    }

    /// What listeners hear of the run so far, beside a fault or on a healthy line.
    pub(in crate::score) fn heard(&self, record: Option<&FaultRecord>) -> Vec<Heard> {
        let Some(shared_recording) = &self.shared_recording else { return Vec::new() };
        let recording = shared_recording.lock().unwrap_or_else(PoisonError::into_inner);
        let joins = record.map(|record| self.joins(record));
        let joined = match joins {
            None => [None, None, Some(("late", Some(self.late())))],
            Some(joins) => [
                Some(("start", None)),
                joins.during.map(|at| ("during", Some(at))),
                joins.after.map(|at| ("after", Some(at))),
            ],
        };
        let listener = self.listener(&recording, false);
        let hears = |(joined, from): (&'static str, Option<Instant>)| {
            let range = listener.hears(from, self.lab.now());
            Heard { joined, frames: recording.frames[range].to_vec() }
        };
        joined.into_iter().flatten().map(hears).collect()
    }

    /// What listeners say of a fault of the run; `None` where nobody listens.
    pub(in crate::score) fn listened(
        &self,
        record: &FaultRecord,
        truth: &Truth,
        all: &[Truth],
        scene: &Scene<'_>,
    ) -> Option<Listeners> {
        let shared_recording = self.shared_recording.as_ref()?;
        let recording = shared_recording.lock().unwrap_or_else(PoisonError::into_inner);
        let joins = self.joins(record);
        let judging = Judging {
            play: self,
            recording: &recording,
            truth,
            all,
            scene,
            context: JudgedFault::of(self.lab.truth(), record),
        };
        Some(Listeners {
            start: judging.pair(None),
            during: joins.during.map(|at| judging.pair(Some(at))),
            after: joins.after.map(|at| judging.pair(Some(at))),
        })
    }
}

/// The listeners of a case, held against one fault.
struct Judging<'a, 'p> {
    play: &'a Play<'p>,
    recording: &'a Recording,
    truth: &'a Truth,
    all: &'a [Truth],
    scene: &'a Scene<'a>,
    context: JudgedFault,
}

impl Judging<'_, '_> {
    /// Those who listen from an instant on, or from before the start.
    fn pair(&self, from: Option<Instant>) -> Pair {
        let Play { lab, case, .. } = self.play;
        let until = lab.now();
        let frames = &self.recording.frames;
        let range = self.play.listener(self.recording, false).hears(from, until);
        // Where the first frame is one that comes back, it is not known to be of this computer.
        let is_local = frames.get(range.start).is_some_and(|first| first.is_sent);
        let scene = Scene { host_counters: self.scene.host_counters && is_local, ..*self.scene };
        let traces = trace::heard(frames, &frames[range], case.cycle, from.is_none());
        let by_position = |id: DeviceId| lab.of_plan(id);
        let as_planned = |id: DeviceId| id;
        let judge = |with_project: bool| {
            let said: Option<Diagnosis> =
                self.play.listener(self.recording, with_project).says(from, until);
            let naming: Naming<'_> = if with_project { &as_planned } else { &by_position };
            judge_listener(
                said.as_ref(),
                self.truth,
                self.all,
                &scene,
                self.context,
                naming,
                &traces,
            )
        };
        Pair { alone: judge(false), with_project: judge(true) }
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::case::{Case, ScoreOptions};
    use super::*;
    use crate::habit::Habit;

    #[test]
    fn frames_of_a_calm_line_show_no_trace_of_trouble() {
        for habit in Habit::ALL.into_iter().filter(|habit| *habit != Habit::Own) {
            let options = ScoreOptions { habit, healthy: true, ..ScoreOptions::default() };
            let drawn = (1..60).map(|seed| Case::draw(seed, 0, &options));
            // While the clocks of a ring are set, copies of a few frames do not come back one for one, which the trace takes
            // for losses; whoever listens to such a start is judged as if there were some.
            for case in drawn.filter(|case| case.file.ring.is_none() || !case.clocks).take(12) {
                let seed = case.seed.0;
                let Ok(play) = Play::calm(&case, &options) else { panic!("seed {seed}") };
                let shared_recording = play
                    .shared_recording
                    .as_ref()
                    .map(|shared_recording| shared_recording.lock().unwrap().clone())
                    .unwrap();
                for from in [None, Some(play.up + Span::ms(100))] {
                    let range = play.listener(&shared_recording, false).hears(from, play.lab.now());
                    let heard = &shared_recording.frames[range];
                    assert!(heard.len() > 100, "{habit}, seed {seed}");
                    let mut traces =
                        trace::heard(&shared_recording.frames, heard, case.cycle, from.is_none());
                    // On its way up a long line, or one whose clocks are set, sends unevenly.
                    traces.retain(|trace| from.is_some() || *trace != trace::Trace::Late);
                    assert_eq!(traces, [], "{habit}, seed {seed}, {from:?}");
                }
            }
        }
    }
}
