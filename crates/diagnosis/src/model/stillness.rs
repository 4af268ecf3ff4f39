//! Stillness at the end: process data were exchanged, and then nothing at all was sent until the input ended.

use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::NetworkModel;

/// Time without any frame that is no wait of a program, and the cycles that it lasts at least.
const LEAST: Span = Span::ms(300);
const LEAST_CYCLES: u64 = 50;
/// An orderly end asks SubDevices for a lower state, not longer before.
const ORDERLY: Span = Span::s(1);

/// Time at the end in which nothing was sent, although process data had been exchanged up to there.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stillness {
    /// The last frame.
    pub since: Instant,
    /// Until the input ended.
    pub lasted: Span,
    /// The cycle in which process data had been exchanged.
    pub cycle: Span,
}

impl Stillness {
    /// The stillness of a network whose input has ended; none where its MainDevice took the SubDevices out of the exchange before.
    pub(super) fn of(model: &NetworkModel) -> Option<Self> {
        let recording = &model.traffic.recording;
        let (since, lasted) = recording.last().zip(recording.still())?;
        let cycle_at_end = |sent: &super::CycleTiming| {
            let (cycle, last) = sent.cycle().zip(sent.last())?;
            (last + cycle * 2 >= since).then_some(cycle)
        };
        let cycle = model.cyclic.iter().filter_map(|cyclic| cycle_at_end(&cyclic.sent)).min()?;
        let was_ended = model.devices.iter().any(|device| {
            let to = device.al.requested.filter(|asked| asked.at + ORDERLY >= since);
            to.and_then(|asked| asked.value.state()).is_some_and(|state| state < AlState::SafeOp)
        });
        let is_long = lasted >= LEAST && lasted >= cycle * LEAST_CYCLES;
        (is_long && !was_ended).then_some(Self { since, lasted, cycle })
    }
}
