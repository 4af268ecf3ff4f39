//! Orders for services: taken between two cycles, answered when the MainDevice has done them.

use std::sync::mpsc::{Receiver, Sender};

use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_proto::state::{AlState, DeviceState, StateValue};
use linesman_proto::time::{Instant, Span};
use linesman_runtime::run::Io;

use super::RequestError;
use crate::handle::{DeviceHandle, PlanId};

/// Orders that are taken in one cycle at most.
const A_CYCLE: usize = 16;
/// An order for a SubDevice that is not up yet waits so long for it; then the refusal tells.
const COMES_UP: Span = Span::s(5);

/// The end of a service that somebody waits for.
type AnswerTo = Sender<Result<ServiceAnswer, RequestError>>;

/// A service that somebody waits for.
#[derive(Debug)]
pub(crate) struct ServiceOrder {
    pub(crate) device: DeviceHandle,
    pub(crate) service: Service,
    pub(crate) answer: AnswerTo,
}

/// Orders of a run: those that are not taken, those that wait for their SubDevice, those that are being done.
pub(crate) struct ServiceOrders<'a> {
    new: &'a Receiver<ServiceOrder>,
    early: Vec<(Instant, ServiceOrder)>,
    pending: Vec<(ServiceTicket, AnswerTo)>,
    plan: PlanId,
}

impl<'a> ServiceOrders<'a> {
    pub(crate) const fn new(new: &'a Receiver<ServiceOrder>, plan: PlanId) -> Self {
        Self { new, early: Vec::new(), pending: Vec::new(), plan }
    }

    /// Gives what can be done to the MainDevice.
    pub(crate) fn take(&mut self, io: &mut Io<'_>) {
        let until = io.now() + COMES_UP;
        for order in self.new.try_iter().take(A_CYCLE) {
            if order.device.plan == self.plan {
                self.early.push((until, order));
            } else {
                let (found, running) = (order.device.plan, self.plan);
                // Nobody may wait for it any more, here and below.
                let _ = order.answer.send(Err(RequestError::OtherPlan { found, running }));
            }
        }
        let due = |(until, order): &mut (Instant, ServiceOrder)| {
            *until <= io.now() || is_up(io.state(order.device.id), &order.service)
        };
        let due: Vec<_> = self.early.extract_if(.., due).collect();
        for (_, ServiceOrder { device, service, answer }) in due {
            self.pending.push((io.serve(device.id, service), answer));
        }
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: Result<ServiceAnswer, ServiceFailure>,
    ) {
        if let Some(at) = self.pending.iter().position(|(pending, _)| *pending == ticket) {
            let (_, answer) = self.pending.swap_remove(at);
            let _ = answer.send(result.map_err(RequestError::Failed));
        }
    }
}

/// True for a SubDevice that can do the service: it has its address, and its mailbox for what goes through that.
fn is_up(state: DeviceState, service: &Service) -> bool {
    let has_mailbox = match state.state() {
        StateValue::Known(AlState::PreOp | AlState::Boot | AlState::SafeOp | AlState::Op) => true,
        StateValue::Known(AlState::Init) | StateValue::Unknown(_) => false,
    };
    let needs_mailbox = matches!(service, Service::Mailbox(_));
    !state.contains(DeviceState::NOT_PRESENT) && (has_mailbox || !needs_mailbox)
}
