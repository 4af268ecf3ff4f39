//! Application of a program, as a run calls it.

use std::cell::Cell;
use std::rc::Rc;

use linesman_maindevice::service::{ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_proto::time::Instant;
use linesman_runtime::run as running;
use linesman_runtime::run::report::RunReport;
use linesman_runtime::run::{Next, RunOutcome, StartTime};

use crate::Error;
use crate::handle::PlanId;
use crate::io::{Application, Io};
use crate::services::ServiceOrders;

/// Notes of a cycle for the run behind it.
#[derive(Default)]
pub(crate) struct Handoff {
    /// The plan of the first handle that belongs to another one; it ends the run.
    pub(crate) foreign: Cell<Option<PlanId>>,
    /// Outputs were not given in this cycle.
    pub(crate) old: Cell<bool>,
}

impl Handoff {
    /// The report of a run of this plan, or what ended it.
    pub(crate) fn report(&self, ended: RunOutcome, running: PlanId) -> Result<RunReport, Error> {
        if let Some(found) = self.foreign.get() {
            return Err(Error::OtherPlan { found, running });
        }
        match ended.error {
            Some(error) => Err(error.into()),
            None => Ok(ended.report),
        }
    }
}

/// An application that its owner keeps.
pub(crate) struct Borrowed<'a, A>(pub(crate) &'a mut A);

impl<A: Application> Application for Borrowed<'_, A> {
    fn start_time(&mut self, now: Instant) -> StartTime {
        self.0.start_time(now)
    }

    fn cycle(&mut self, io: &mut Io<'_>) -> Next {
        self.0.cycle(io)
    }

    fn after_outputs(&mut self, io: &mut Io<'_>) {
        self.0.after_outputs(io);
    }

    fn interface_gone(&mut self, io: &mut Io<'_>) {
        self.0.interface_gone(io);
    }
}

/// An application with the services that are asked for beside it.
pub(crate) struct ServedApplication<'a, A> {
    pub(crate) application: A,
    pub(crate) orders: ServiceOrders<'a>,
    pub(crate) plan: PlanId,
    pub(crate) handoff: Rc<Handoff>,
}

impl<A: Application> ServedApplication<'_, A> {
    fn call<T>(
        &mut self,
        io: &mut running::Io<'_>,
        call: impl FnOnce(&mut A, &mut Io<'_>) -> T,
    ) -> T {
        let given =
            call(&mut self.application, &mut Io::new(io.reborrow(), self.plan, &self.handoff));
        if self.handoff.old.take() {
            io.outputs_are_old();
        }
        given
    }
}

impl<A: Application> running::Application for ServedApplication<'_, A> {
    fn start_time(&mut self, now: Instant) -> StartTime {
        self.application.start_time(now)
    }

    fn cycle(&mut self, io: &mut running::Io<'_>) -> Next {
        self.orders.take(io);
        let next = self.call(io, A::cycle);
        if self.handoff.foreign.get().is_some() { Next::Stop } else { next }
    }

    fn after_outputs(&mut self, io: &mut running::Io<'_>) {
        self.call(io, A::after_outputs);
    }

    fn interface_gone(&mut self, io: &mut running::Io<'_>) {
        self.call(io, A::interface_gone);
    }

    fn served(&mut self, ticket: ServiceTicket, result: &Result<ServiceAnswer, ServiceFailure>) {
        self.orders.served(ticket, result.clone());
    }
}
