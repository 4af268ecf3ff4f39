//! Frames that were lost beside other damage, or beside links that changed: at moments at which no controller counted
//! anything and no link changed.

use linesman_proto::address::Path;
use linesman_proto::register::ErrorCounter;
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::Route;

use super::{COMING_UP, ErrorWalk, IN_A_ROW, LastHop};
use crate::locate::Intervals;
use crate::model::counters::RISES_KEPT;
use crate::model::{CounterTrack, Tally};

/// A frame that is lost was damaged so long after it was sent at most.
const IN_FLIGHT: Span = Span::ms(10);

/// Beside links that changed, and nothing else, so many are too many for chance: a change that is noticed late costs a frame
/// or two.
const BESIDE_CHANGES: usize = 4;

/// Frames that were lost, as far as the way into one card may have to do with them.
pub(super) enum LostAtCard {
    /// In a ring, copies that did not come to it.
    Copies(Tally),
    /// Frames of which nothing came back.
    Frames(Tally),
}

impl ErrorWalk<'_, '_> {
    /// Losses that the way into a card may have to do with; none where copies were lost to the other card alone: what one
    /// card sends for itself is lost as a whole where its copies are.
    pub(super) fn losses_at(&self, card: Path) -> Option<LostAtCard> {
        let losses = &self.input.model().traffic.losses;
        let (frames, copies) = (losses.frames(), losses.copies(card));
        // In a ring one of the two copies is lost at a time; a few whole ones were lost while it came up.
        if copies.of_spell() > frames.of_spell() {
            return Some(LostAtCard::Copies(copies));
        }
        let elsewhere = losses.copies(card.other()).of_spell();
        (elsewhere <= frames.of_spell()).then_some(LostAtCard::Frames(frames))
    }

    /// Frames that were lost beside other damage or links that changed: at a time at which no controller counted anything, as
    /// readings before and after it show, and no link changed.
    pub(super) fn unknown_beside(&self, route: &Route) -> Option<LastHop> {
        let card = route.arrives_at()?;
        let hop = *route.hops().last()?;
        let model = self.input.model();
        let is_watched = model.host.is_watched || model.traffic.recording.cut() > 0;
        if !self.is_read || is_watched || model.hole.is_some() {
            return None;
        }
        let begin = model.traffic.recording.first()?;
        let losses = &model.traffic.losses;
        let (times, counted) = match self.losses_at(card)? {
            LostAtCard::Copies(_) => {
                (losses.copy_times(card), self.counting_times(std::slice::from_ref(route))?)
            }
            // Of a frame that is lost as a whole nobody knows which way it went.
            LostAtCard::Frames(_) => (losses.times(), self.counting_times(self.input.routes())?),
        };
        let mut lost: Vec<Instant> = times
            .iter()
            .copied()
            .filter(|at| {
                *at >= model.spell_began && *at <= self.horizon && *at >= begin + COMING_UP
            })
            .filter(|at| !counted.meet((at.before(IN_FLIGHT), *at + IN_FLIGHT)))
            .filter(|at| !self.input.any_link_changed(*at, *at))
            .filter(|at| !model.traffic.recording.was_bad(*at, *at))
            .collect();
        if self.carried.frames == 0 {
            // What nobody answers for a while has a cause of its own.
            let silences =
                || model.traffic.losses.silences().iter().filter(|one| one.frames >= IN_A_ROW);
            lost.retain(|at| !silences().any(|one| one.since.at <= *at && *at <= one.last.at));
        }
        lost.sort_unstable();
        if self.carried.frames == 0 && lost.len() < BESIDE_CHANGES {
            return None;
        }
        let (first, last) = (*lost.first()?, *lost.last()?);
        let is_beside = true;
        Some(LastHop::Unknown { hop, card, lost: lost.len() as u64, is_beside, first, last })
    }

    /// Times in which a controller on one of these ways counted a bad frame or symbol: between two readings.
    /// `None` where not all of them are kept.
    fn counting_times(&self, ways: &[Route]) -> Option<Intervals> {
        let checks = ways.iter().flat_map(Route::checks);
        let ports = checks.map(|check| (check.node, check.port));
        let tracks = ports.flat_map(|(node, port)| {
            let counters = [
                ErrorCounter::InvalidFrame(port),
                ErrorCounter::Forwarded(port),
                ErrorCounter::PhysicalLayer(port),
            ];
            counters.into_iter().filter_map(move |counter| self.input.track(node, counter))
        });
        let tracks: Vec<&CounterTrack> = tracks.collect();
        if tracks.iter().any(|track| {
            track.rises.len() == RISES_KEPT || (track.is_at_end() && track.spell_rise() > 0)
        }) {
            return None;
        }
        let rises = tracks.into_iter().flat_map(|track| &track.rises);
        Some(rises.map(|rise| (rise.after_time, rise.at)).collect())
    }
}
