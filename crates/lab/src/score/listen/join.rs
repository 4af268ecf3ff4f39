//! Moments at which listeners join a line that somebody drives.

use linesman_proto::time::{Instant, Span};
use linesman_sim::seed::Stream;
use linesman_sim::truth::{Effect, Entry, FaultId, FaultRecord, TruthLog};

/// A fault that acts for a shorter time is over before anybody could join.
const SHORTEST: Span = Span::ms(5);
/// How long after a fault a listener joins at most.
const SOON_AFTER: Span = Span::s(1);
/// How long a listener listens at least.
const LISTENS: Span = Span::ms(2_500);

/// When a fault acted, and when listeners join.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(in crate::score) struct Joins {
    /// While it acts.
    pub(in crate::score) during: Option<Instant>,
    /// After it.
    pub(in crate::score) after: Option<Instant>,
}

impl Joins {
    /// Draws them for a fault of a run that has been up since `up` and ended at `end`.
    pub(in crate::score) fn draw(
        log: &TruthLog,
        fault: &FaultRecord,
        (up, end): (Instant, Instant),
        stream: &mut Stream,
    ) -> Self {
        // Both numbers are drawn, whatever becomes of them, so that one does not depend on the other.
        let mut share = || stream.below(1_000_000) as f64 / 1e6;
        let (into, behind) = (share(), share());
        let Some(first) = fault.first_effect else { return Self::default() };
        let from = first.max(up);
        let to = acts_until(log, fault.id, end);
        let last = to.min(end.before(LISTENS));
        let within = |from: Instant, span: Span, share: f64| {
            from + Span::ns((span.as_nanos() as f64 * share) as u64)
        };
        let acts = last.since(from);
        let during = (last > from && acts >= SHORTEST).then(|| within(from, acts, into));
        let is_over = fault.ended.is_some() && to < end.before(LISTENS);
        let after =
            is_over.then(|| within(to, SOON_AFTER.min(end.before(LISTENS).since(to)), behind));
        Self { during, after }
    }
}

/// When a fault acts no more: when what it has begun is over, or at its last effect.
fn acts_until(log: &TruthLog, id: FaultId, end: Instant) -> Instant {
    let (mut until, mut lasts) = (Instant::ZERO, false);
    for entry in log.entries() {
        let Entry::Effect { at, fault: Some(fault), effect, .. } = entry else { continue };
        if *fault == id {
            until = until.max(*at);
            lasts = (lasts || begins_a_state(*effect)) && !ends_a_state(*effect);
        }
    }
    let ended = log.fault(id).and_then(|fault| fault.ended).unwrap_or(end);
    if lasts { until.max(ended) } else { until }.min(end)
}

/// Whether an effect is the beginning of something that lasts until it is taken back, or until the fault ends.
const fn begins_a_state(effect: Effect) -> bool {
    leaves_a_state(effect)
        || matches!(effect, Effect::WorkTakes { .. } | Effect::WatchdogSet { time: Some(_) })
}

/// Whether an effect takes back what another one has begun.
const fn ends_a_state(effect: Effect) -> bool {
    matches!(
        effect,
        Effect::SignalBack
            | Effect::PowerBack
            | Effect::ProcessorRuns
            | Effect::ClockRestored
            | Effect::SyncBack
            | Effect::WorkRestored
            | Effect::WatchdogSet { time: None }
    )
}

/// Whether an effect is the beginning of something that lasts until the fault ends.
pub(in crate::score) const fn leaves_a_state(effect: Effect) -> bool {
    match effect {
        Effect::SignalLost
        | Effect::PowerLost
        | Effect::StateRefused { .. }
        | Effect::Misbehaves(_)
        | Effect::ProcessorStopped
        | Effect::ClockDrifts { .. }
        | Effect::ClockStopped
        | Effect::SyncCut
        | Effect::SyncBounces
        | Effect::WrongDevice
        | Effect::MissingDevice
        | Effect::ExtraDevice
        | Effect::SwappedDevice
        | Effect::SharedAddress { .. }
        | Effect::WrongPort => true,
        Effect::SymbolError
        | Effect::FrameSpoiled { .. }
        | Effect::FrameLost { .. }
        | Effect::StrangerSent { .. }
        | Effect::ContentRefused { .. }
        | Effect::SignalBack
        | Effect::PowerBack
        | Effect::ProcessorRuns
        | Effect::ProcessorRestarted
        | Effect::CardSilent
        | Effect::WatchdogSet { .. }
        | Effect::WatchdogExpired { .. }
        | Effect::EmergencySent { .. }
        | Effect::ClockRestarted
        | Effect::ClockRestored
        | Effect::SyncBack
        | Effect::WorkTakes { .. }
        | Effect::WorkRestored
        | Effect::FrameHeldBack { .. }
        | Effect::OldCounters => false,
    }
}
