//! The end of a run on a machine, whatever has failed before.

use linesman_link::error::LinkError;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::{FrameBuilder, builder::DatagramAddress};
use linesman_proto::register;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};
use linesman_session::Application;

use super::super::note::{Note, RunError};
use super::RunSession;
use crate::drive::Driver;
use crate::part::{PartFailure, guard};
use crate::stop::Stop;
use crate::transport::Transport;

/// The MainDevice in messages.
const PART: &str = "the MainDevice or its application";
/// So often all SubDevices are ordered to INIT where nothing else works: a frame may be lost.
const ORDERS: u8 = 3;

impl<L: Transport<Error = LinkError>, A: Application> Driver<L, RunSession<A>> {
    /// Drives the line until its end. A panic on the way, of the application or of the MainDevice, is told, and the
    /// SubDevices are left as after any other end.
    pub(super) fn drive(&mut self, until: Instant, stop: &Stop) -> Result<(), RunError> {
        const EFFECT: &str = "the line is stopped: outputs to zero, SubDevices back";
        match guard(PART, EFFECT, || self.run(until, stop)) {
            Ok(ended) => Ok(ended?),
            Err(failure) => {
                self.session().hooks().note(Note::Failed(failure.clone()));
                Err(RunError::Failed(failure))
            }
        }
    }

    /// Leaves the SubDevices in a state. Where that fails, too, all are ordered to INIT.
    pub(super) fn leave(&mut self, to: AlState) -> Result<(), RunError> {
        const EFFECT: &str =
            "all SubDevices were ordered to INIT at once, without waiting for their answers";
        match guard(PART, EFFECT, || self.leave_in_order(to)) {
            Ok(left) => Ok(left?),
            Err(failure) => {
                self.session().hooks().note(Note::Failed(failure.clone()));
                order_init(self.line_mut()).map_err(|_| RunError::Failed(unordered(&failure)))?;
                Err(RunError::Failed(failure))
            }
        }
    }

    /// Outputs to zero, then the exchange ends, then the states.
    fn leave_in_order(&mut self, to: AlState) -> Result<(), LinkError> {
        let now = self.now();
        let (hooks, main) = self.session_mut().parts_mut();
        hooks.run.leave(now, main, to);
        hooks.tell();
        // A second wish ends the program at once; until then it takes the time it takes.
        self.run(Instant::MAX, &Stop::default())
    }
}

/// The same failure where not even that could be done.
fn unordered(failure: &PartFailure) -> PartFailure {
    PartFailure {
        effect: "the SubDevices could not be ordered to INIT: their watchdogs switch outputs off",
        ..failure.clone()
    }
}

/// Orders all SubDevices to INIT by broadcast, past the MainDevice.
fn order_init<L: Transport>(line: &mut L) -> Result<(), L::Error> {
    /// INIT, and whatever error is shown acknowledged.
    const INIT: [u8; 2] = [0x11, 0];
    let mut buffer = [0; 60];
    let mut builder = FrameBuilder::new(&mut buffer, MacAddress([2, 0, 0, 0, 0, 1]));
    let address = DatagramAddress::Physical(0, register::AL_CONTROL.address);
    if let Ok(data) = builder.push(Command::Bwr, 0, address, INIT.len()) {
        data.copy_from_slice(&INIT);
    }
    let len = builder.finish();
    for _ in 0..ORDERS {
        line.send(Path::A, &buffer[..len])?;
        let soon = line.now() + Span::ms(2);
        line.wait(soon)?;
    }
    Ok(())
}
