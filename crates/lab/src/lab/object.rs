//! Objects of SubDevices, read by the MainDevice of the lab.

use linesman_maindevice::Event;
use linesman_maindevice::mailbox::MailboxFailure;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::{Instant, Span};

use super::{Lab, LabError};

/// Longer than the MainDevice itself has patience for an answer, twice.
const PATIENCE: Span = Span::s(10);
const LOOK: Span = Span::us(100);

/// A place among the events so far: the instant of the last, and how many are of that instant.
#[derive(Clone, Copy, Debug)]
pub(super) struct EventMark {
    since: Option<Instant>,
    before: usize,
}

impl Lab {
    pub(super) fn event_mark(&self) -> EventMark {
        let since = self.events.last().map(|(at, _)| *at);
        let before = self.events.iter().filter(|(at, _)| Some(*at) == since).count();
        EventMark { since, before }
    }

    /// Events behind a mark.
    pub(super) fn events_since(&self, mark: EventMark) -> impl Iterator<Item = &Event> {
        let new = self.events.iter().filter(move |(at, _)| Some(*at) >= mark.since);
        new.skip(mark.before).map(|(_, event)| event)
    }

    /// Reads an object of a SubDevice of the project through its mailbox. `None` when nothing came of
    /// it in any way.
    ///
    /// # Errors
    /// [`LabError::Stuck`].
    pub fn read_object(
        &mut self,
        id: DeviceId,
        object: ObjectAddress,
    ) -> Result<Option<Result<Vec<u8>, MailboxFailure>>, LabError> {
        let of = self.in_plan(id);
        let mark = self.event_mark();
        self.upload(of, object);
        let answer = |lab: &Self| {
            lab.events_since(mark).find_map(|event| {
                let Event::SdoUploaded { id, object: about, result } = event else { return None };
                ((*id, *about) == (of, object)).then(|| result.clone())
            })
        };
        self.run_while(PATIENCE, LOOK, |lab| answer(lab).is_some())?;
        Ok(answer(self))
    }
}
