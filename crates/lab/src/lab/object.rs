//! Objects of SubDevices, read by the MainDevice of the lab.

use linesman_maindevice::Event;
use linesman_maindevice::mailbox::MailboxFailure;
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::Span;

use super::{Lab, LabError};

/// Longer than the MainDevice itself has patience for an answer, twice.
const PATIENCE: Span = Span::s(10);
const LOOK: Span = Span::us(100);

impl Lab {
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
        let (of, now) = (self.in_plan(id), self.now);
        let since = self.events.last().map(|(at, _)| *at);
        let before = self.events.iter().filter(|(at, _)| Some(*at) == since).count();
        self.main.sdo_upload(now, of, object, false);
        let answer = |lab: &Self| {
            // Those of the same instant that were there already do not count.
            let new = lab.events.iter().filter(|(at, _)| Some(*at) >= since);
            new.skip(before).find_map(|(_, event)| {
                let Event::SdoUploaded { id, object: about, result } = event else { return None };
                ((*id, *about) == (of, object)).then(|| result.clone())
            })
        };
        self.run_while(PATIENCE, LOOK, |lab| answer(lab).is_some())?;
        Ok(answer(self))
    }
}
