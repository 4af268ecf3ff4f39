//! Events that controllers report in the event field of datagrams that pass them.
//!
//! A controller ORs what its mask (0x0200) lets through of its events (0x0210) into each datagram, until the register
//! is read that tells of the event. A bit that stands says that something has happened which nobody has looked up
//! since, however long ago; a bit that comes says that it has happened just now. Neither says where: the field is
//! one for all controllers. Reference: S2 2.8.

use linesman_proto::register::EcatEvents;
use linesman_proto::time::Instant;

use super::Seen;

/// So many frames one after the other have an event, or have it no longer, before it counts: a single odd frame proves
/// nothing.
const STEADY: u32 = 8;

/// Events in the frames of one network.
#[derive(Clone, Copy, Default, Debug)]
pub struct EventField {
    /// DL status (0x0110) of some SubDevice has changed: a link came or went.
    pub dl_status: EventTrack,
    /// AL status (0x0130) of some SubDevice has changed.
    pub al_status: EventTrack,
}

/// One event over time.
#[derive(Clone, Copy, Default, Debug)]
pub struct EventTrack {
    /// Since when it stands; `None` while it does not.
    pub since: Option<Seen<()>>,
    /// When it came for the first time after frames without it.
    pub first_came: Option<Seen<()>>,
    /// When it came for the last time after frames without it.
    pub came: Option<Seen<()>>,
    /// How often it came so.
    pub times: u64,
    /// Whether frames without it were seen.
    was_clear: bool,
    /// The first of the latest frames that say otherwise than is known, and how many of them there are.
    otherwise: Option<(Seen<()>, u32)>,
}

impl EventField {
    /// Takes the events that controllers have added to a datagram. Says whether it is news.
    pub fn record(&mut self, added: u16, at: Instant, frame: u64) -> bool {
        let added = EcatEvents(added);
        let seen = Seen::new((), at, Some(frame));
        let is_dl = self.dl_status.record(added.contains(EcatEvents::DL_STATUS), seen);
        let is_al = self.al_status.record(added.contains(EcatEvents::AL_STATUS), seen);
        is_dl || is_al
    }
}

impl EventTrack {
    fn record(&mut self, is_set: bool, seen: Seen<()>) -> bool {
        if is_set == self.since.is_some() {
            self.otherwise = None;
            self.was_clear |= !is_set;
            return false;
        }
        let (first, count) = self.otherwise.map_or((seen, 0), |known| known);
        self.otherwise = Some((first, count + 1));
        if count + 1 < STEADY {
            return false;
        }
        self.otherwise = None;
        self.since = is_set.then_some(first);
        if is_set && self.was_clear {
            self.first_came.get_or_insert(first);
            self.came = Some(first);
            self.times += 1;
        }
        self.was_clear |= !is_set;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn play(events: &[(u16, u32)]) -> EventField {
        let mut field = EventField::default();
        let mut frame = 0;
        for (added, times) in events {
            for _ in 0..*times {
                frame += 1;
                field.record(*added, Instant::from_nanos(frame * 1_000), frame);
            }
        }
        field
    }

    #[test]
    fn event_that_comes_while_frames_pass_is_told_with_its_first_frame() {
        let dl = play(&[(0, 100), (0x0004, 50)]).dl_status;
        assert_eq!(dl.since.and_then(|seen| seen.frame), Some(101));
        assert_eq!((dl.came, dl.times), (dl.since, 1));
        let gone = play(&[(0, 100), (0x0004, 50), (0, 50), (0x0004, 50)]).dl_status;
        assert_eq!((gone.times, gone.first_came.and_then(|seen| seen.frame)), (2, Some(101)));
        assert_eq!(gone.came.and_then(|seen| seen.frame), Some(201));
    }

    #[test]
    fn event_that_stands_from_the_first_frame_on_has_not_come() {
        let dl = play(&[(0x0004, 50)]).dl_status;
        assert_eq!(dl.since.and_then(|seen| seen.frame), Some(1));
        assert_eq!((dl.came, dl.times), (None, 0));
        let cleared = play(&[(0x0004, 50), (0, 20)]).dl_status;
        assert_eq!((cleared.since, cleared.times), (None, 0));
    }

    #[test]
    fn single_frame_with_an_event_proves_nothing() {
        let field = play(&[(0, 100), (0x000C, 7), (0, 100)]);
        assert_eq!((field.dl_status.since, field.al_status.times), (None, 0));
    }
}
