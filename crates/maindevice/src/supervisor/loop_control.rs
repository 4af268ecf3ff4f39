//! Loop control: ports that open only when the MainDevice orders it (JCT-12, ESC-06).
//!
//! A controller closes the loop of a port within microseconds when its link is lost, and by itself opens it as
//! soon as the link is back, ready or not: what comes up too early, or flaps, costs all frames each time. In
//! a network with `ports_open_by_order` the loops towards planned SubDevices stay closed instead. When a port
//! reports its link again, the section behind it is made ready: those in it that were lost are looked for, and set
//! up anew once they answer, so that their process data are taken up again; and the link must have stayed up for a
//! while, which is looked at closely: a contact that flaps is up at most looks. Then the port is ordered to open.
//! All other traffic goes on.
//!
//! The cables of a ring are left as they are: a closed loop there is what keeps it alive.
//!
//! Reference: S4, "Reconnection"; S2 2.4.1 (0x0101, loop mode "auto close": opened again by writing it).

use linesman_config::plan::{DevicePlan, Plan};
use linesman_proto::address::{DeviceId, RegisterAddress};
use linesman_proto::port::Port;
use linesman_proto::register::{self, DlControl, DlStatus, EcatEvents, LoopMode};
use linesman_proto::time::Span;
use linesman_proto::topology::{End, Tree};

use super::{Context, Reachability};
use crate::event::Event;
use crate::exchange::{Reply, Target};
use crate::executor::{Wire, lock};

/// A link that came back must stay so long before its port opens.
const STEADY: Span = Span::ms(100);
/// How often it is looked at meanwhile. What comes and goes between two looks is kept as an event (0x0210 bit 2).
const LOOK: Span = Span::ms(10);

/// The second byte of DL control: the loop modes, two bits for each port. Writing it does not touch the rest.
const LOOPS: RegisterAddress = RegisterAddress(register::DL_CONTROL.address.0 + 1);

/// The ports of one SubDevice that open by order.
pub(super) struct LoopControl {
    /// Those with a planned SubDevice behind.
    ports: Vec<Port>,
    is_set: bool,
}

impl LoopControl {
    pub(super) fn new(context: &Context, device: &DevicePlan) -> Self {
        let is_wanted = context.plan.ports_open_by_order;
        let ports = if is_wanted { towards(&context.plan.tree, device) } else { Vec::new() };
        Self { ports, is_set: false }
    }

    /// The SubDevice starts anew: its controller may have forgotten all.
    pub(super) fn forget(&mut self) {
        self.is_set = false;
    }

    /// Sets the ports to open by order, or by themselves again.
    pub(super) async fn set(&mut self, context: &Context, device: &DevicePlan, by_order: bool) {
        if self.ports.is_empty() || self.is_set == by_order {
            return;
        }
        let mode = if by_order { LoopMode::AutoClose } else { LoopMode::Auto };
        // If it fails, the next reading tries again.
        let modes: Vec<_> = self.ports.iter().map(|port| (*port, mode)).collect();
        if write(&context.wire, device, modes).await {
            self.is_set = by_order;
        }
    }

    /// Whether ports wait to be opened by order.
    pub(super) const fn are_set(&self) -> bool {
        self.is_set
    }

    /// Acts upon how the ports stand: opens those that are ready.
    pub(super) async fn tend(&self, context: &Context, device: &DevicePlan, status: DlStatus) {
        if !self.is_set {
            return;
        }
        for port in &self.ports {
            let is_ready = waits(status, *port) && is_prepared(context, device, *port);
            if !is_ready || !is_steady(&context.wire, device, *port).await {
                continue;
            }
            // Written again, the mode opens the loop.
            if write(&context.wire, device, [(*port, LoopMode::AutoClose)]).await {
                context.wire.emit(Event::PortOpened { id: device.id, port: *port });
            }
        }
    }
}

/// Whether a port has its link again and is closed.
fn waits(status: DlStatus, port: Port) -> bool {
    let state = status.port_state(port);
    state.link && state.closed
}

/// Whether the link of a closed port stays up for a while: it is at each look, and nothing has changed in between.
async fn is_steady(wire: &Wire, device: &DevicePlan, port: Port) -> bool {
    let target = Target::Station(device.station);
    let (events, status) = (register::ECAT_EVENT_REQUEST, register::DL_STATUS);
    let until = wire.now() + STEADY;
    while wire.now() < until {
        wire.sleep(LOOK).await;
        // In this order: reading the status clears its event.
        let events = wire.read(target, events.address, events.len);
        let status = wire.read(target, status.address, status.len);
        let (Ok(events), Ok(status)) = (events.await, status.await) else { return false };
        let has_changed = EcatEvents(events.word(0)).contains(EcatEvents::DL_STATUS);
        let has_answered = events.answered() && status.answered();
        if !has_answered || has_changed || !waits(DlStatus(status.word(0)), port) {
            return false;
        }
    }
    true
}

/// Lets the ports of a SubDevice open by themselves again, where they opened by order: the line is left.
pub(crate) async fn release(wire: &Wire, plan: &Plan, device: &DevicePlan) {
    if plan.ports_open_by_order {
        let modes = towards(&plan.tree, device).into_iter().map(|port| (port, LoopMode::Auto));
        // Who does not answer any more is left all the same.
        let _ = write(wire, device, modes).await;
    }
}

/// Writes loop modes of some ports; of the others they stay as they are. False when it did not come off.
async fn write(
    wire: &Wire,
    device: &DevicePlan,
    modes: impl IntoIterator<Item = (Port, LoopMode)>,
) -> bool {
    let target = Target::Station(device.station);
    let control = register::DL_CONTROL;
    let reply = wire.read_one(target, control.address, control.len).await;
    let Some(reply) = reply.ok().filter(Reply::answered) else { return false };
    let before = DlControl::from_bytes(reply.bytes(0));
    let set = |control: DlControl, (port, mode)| control.with_loop_mode(port, mode);
    let after = modes.into_iter().fold(before, set);
    let written = wire.write_one(target, LOOPS, &after.to_bytes()[1..2]).await;
    written.is_ok_and(|reply| reply.answered())
}

/// The ports towards SubDevices that are planned behind this one, but for those of a ring.
fn towards(tree: &Tree, device: &DevicePlan) -> Vec<Port> {
    let node = device.id.index();
    let leads_on = |port: &Port| {
        let end = End::Controller(node, *port);
        tree.link_at(end)
            .is_some_and(|link| tree.links()[link].upstream == end && !tree.is_on_ring(link))
    };
    Port::ALL.into_iter().filter(leads_on).collect()
}

/// Whether all behind a port are taken for lost: then they are looked for, and set up anew as soon as they answer.
fn is_prepared(context: &Context, device: &DevicePlan, port: Port) -> bool {
    let tree = &context.plan.tree;
    let Some(End::Controller(first, _)) = tree.opposite(End::Controller(device.id.index(), port))
    else {
        return false;
    };
    // Groups come and go: what is plugged in there may be another one, or be there already elsewhere.
    if context.plan.group_of(DeviceId(first as u32)).is_some() {
        return true;
    }
    let is_behind = |node: usize| node == first || tree.is_downstream_of(node, first);
    let mut section = context.plan.devices.iter().filter(|other| is_behind(other.id.index()));
    let device_table = lock(&context.device_table);
    section.all(|other| device_table.found(other.id) == Reachability::Lost)
}
