//! The end of a run: outputs to zero, then the exchange ends, then the states; whatever has failed before.

use linesman_link::error::LinkError;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::{FrameBuilder, builder::DatagramAddress};
use linesman_proto::register;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::super::io::Application;
use super::super::note::{Note, RunError};
use super::RunSession;
use crate::drive::Driver;
use crate::part::{PartFailure, guard};
use crate::stop::Stop;
use crate::transport::Transport;

/// How long SubDevices may take to go down at the end.
const LEAVE_PATIENCE: Span = Span::s(5);
/// So many cycles carry zeros before the exchange ends.
const SAFE_CYCLES: u64 = 3;
/// The MainDevice in messages.
const PART: &str = "the MainDevice or its application";
/// So often all SubDevices are ordered to INIT where nothing else works: a frame may be lost.
const ORDERS: u8 = 3;

impl<A: Application> RunSession<A> {
    /// Drives the line until its end. A panic on the way, of the application or of the MainDevice, is told, and the
    /// SubDevices are left as after any other end.
    pub(super) fn drive<L: Transport>(
        &mut self,
        driver: &mut Driver<L>,
        until: Instant,
        stop: &Stop,
    ) -> Result<(), RunError> {
        const EFFECT: &str = "the line is stopped: outputs to zero, SubDevices back";
        match guard(PART, EFFECT, || driver.run(until, stop, self)) {
            Ok(ended) => Ok(ended?),
            Err(failure) => {
                self.note(Note::Failed(failure.clone()));
                Err(RunError::Failed(failure))
            }
        }
    }

    /// Leaves the SubDevices in a state. Where that fails, too, all are ordered to INIT.
    pub(super) fn leave<L: Transport>(
        &mut self,
        driver: &mut Driver<L>,
        to: AlState,
    ) -> Result<(), RunError> {
        const EFFECT: &str =
            "all SubDevices were ordered to INIT at once, without waiting for their answers";
        match guard(PART, EFFECT, || self.leave_in_order(driver, to)) {
            Ok(left) => Ok(left?),
            Err(failure) => {
                self.note(Note::Failed(failure.clone()));
                order_init(driver).map_err(|_| RunError::Failed(unordered(&failure)))?;
                Err(RunError::Failed(failure))
            }
        }
    }

    /// Outputs to zero, then the exchange ends, then the states.
    fn leave_in_order<L: Transport>(
        &mut self,
        driver: &mut Driver<L>,
        to: AlState,
    ) -> Result<(), LinkError> {
        let Some(plan) = self.plan.clone() else { return Ok(()) };
        // A second wish ends the program at once; until then it takes the time it takes.
        let nobody = Stop::default();
        (self.leaving, self.ended) = (true, false);
        let now = driver.now();
        self.note(Note::Leaving(now));
        let cycle = plan.tasks.iter().map(|task| task.cycle).max().unwrap_or_default();
        for count in 1..=SAFE_CYCLES {
            driver.main_mut().outputs_mut().fill(0);
            driver.run(now + cycle * count, &nobody, self)?;
        }
        let now = driver.now();
        driver.main_mut().stop(now, to);
        driver.run(now + LEAVE_PATIENCE, &nobody, self)
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
fn order_init<L: Transport>(driver: &mut Driver<L>) -> Result<(), LinkError> {
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
        driver.line_mut().send(Path::A, &buffer[..len])?;
        let soon = driver.now() + Span::ms(2);
        driver.line_mut().wait(soon)?;
    }
    Ok(())
}
