//! Orders to the program while it runs: registers and objects that a person looks at, states, and
//! to stop.

use std::collections::{BTreeSet, VecDeque};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use linesman_maindevice::mailbox::{MailboxFailure, MailboxOperation, Step, Why};
use linesman_maindevice::{Event, ExchangeError, ProbeRequest, Request};
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::bus::{Bus, SURELY};
use super::device::Device;
use super::{mailbox, states};

/// How long an object is waited for, as the failure tells it.
const PATIENCE: Span = Span::ms(700);

/// An order.
#[derive(Clone, Debug)]
pub(crate) enum Order {
    /// Read or write registers: [`Event::Probed`] tells what came of it.
    Probe(ProbeRequest),
    /// Read an object: [`Event::SdoUploaded`].
    Upload(DeviceId, ObjectAddress),
    /// Bring one SubDevice, by its place, or all to a state and leave them there; OP: keep them there again.
    State(Option<DeviceId>, AlState),
    /// Bring all to a state and end.
    Stop(AlState),
}

#[derive(Default)]
struct OrderQueue {
    given: VecDeque<Order>,
    events: VecDeque<Event>,
    held: BTreeSet<usize>,
}

/// Orders and what came of them.
#[derive(Clone, Default)]
pub(super) struct Orders(Arc<Mutex<OrderQueue>>);

impl Orders {
    fn lock(&self) -> MutexGuard<'_, OrderQueue> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn give(&self, order: Order) {
        self.lock().given.push_back(order);
    }

    pub(super) fn poll_event(&self) -> Option<Event> {
        self.lock().events.pop_front()
    }

    /// Whether a SubDevice is left in another state than OP.
    pub(super) fn holds(&self, at: usize) -> bool {
        self.lock().held.contains(&at)
    }

    /// Does what was ordered. Breaks when the program is to end.
    pub(super) async fn follow(&self, bus: &Bus, devices: &mut [Device]) -> ControlFlow<()> {
        loop {
            let Some(order) = self.lock().given.pop_front() else {
                return ControlFlow::Continue(());
            };
            match order {
                Order::Probe(request) => self.probe(bus, request).await,
                Order::Upload(id, object) => self.upload(bus, devices, id, object).await,
                Order::State(of, state) => self.bring(bus, devices, of, state).await,
                Order::Stop(state) => {
                    states::request_all(bus, u16::from(state.bits())).await;
                    self.lock().held.clear();
                    return ControlFlow::Break(());
                }
            }
        }
    }

    async fn probe(&self, bus: &Bus, request: ProbeRequest) {
        let ProbeRequest { target, register, len, .. } = request;
        let asked = match &request.write {
            None => Request::read(target, register, len),
            Some(data) => Request::write(target, register, data),
        };
        let access = asked.access();
        let reply = bus.ask_together(&[asked], SURELY).await.pop();
        let result = reply.ok_or(ExchangeError::NoReply { access, frames: 3, patience: SURELY });
        self.lock().events.push_back(Event::Probed { request, result });
    }

    async fn upload(&self, bus: &Bus, devices: &mut [Device], id: DeviceId, object: ObjectAddress) {
        let data = match devices.get_mut(id.index()) {
            Some(device) => mailbox::upload(bus, device, object, false).await,
            None => None,
        };
        let failure = || MailboxFailure {
            id,
            operation: MailboxOperation::Read { object, complete: false },
            step: Step::Request,
            why: Why::NoAnswer { patience: PATIENCE, rubbish: None },
        };
        let result = data.ok_or_else(failure);
        self.lock().events.push_back(Event::SdoUploaded { id, object, result });
    }

    /// Whoever is to be in OP again is brought there step by step, as one that has left it by itself.
    async fn bring(&self, bus: &Bus, devices: &[Device], of: Option<DeviceId>, state: AlState) {
        let range = of.map_or(0..devices.len(), |id| id.index()..id.index() + 1);
        if state == AlState::Op {
            range.for_each(|at| {
                self.lock().held.remove(&at);
            });
            return;
        }
        self.lock().held.extend(range);
        let bits = u16::from(state.bits());
        match of.map(|id| devices.get(id.index())) {
            None => states::request_all(bus, bits).await,
            Some(device) => {
                if let Some(device) = device {
                    states::request(bus, device, bits, SURELY).await;
                }
            }
        }
    }
}
