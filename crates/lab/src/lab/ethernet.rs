//! Virtual switch of a lab: SubDevices that speak EoE reach each other, as in a run without an interface of the computer.

use std::collections::BTreeMap;

use linesman_config::plan::Plan;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{Service, ServiceTicket};
use linesman_maindevice::virtual_switch::{SubDevicePort, SwitchLimits, SwitchPort, VirtualSwitch};
use linesman_maindevice::{Event, MainDevice};
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::MailboxType;
use linesman_proto::time::Instant;

/// Frames of one SubDevice that the MainDevice has at once, as in a run.
const AT_ONCE: usize = 2;

/// The switch, and its ports.
pub(super) struct LabSwitch {
    switch: VirtualSwitch,
    devices: BTreeMap<DeviceId, ConnectedPort>,
    pending: Vec<(ServiceTicket, DeviceId)>,
}

struct ConnectedPort {
    port: SwitchPort,
    fragments: SubDevicePort,
    under_way: usize,
}

impl LabSwitch {
    /// A switch for the SubDevices of a plan that speak EoE; `None` where there are none.
    pub(super) fn of_plan(plan: &Plan) -> Option<Self> {
        let mut switch = VirtualSwitch::new(SwitchLimits::default());
        let mut devices = BTreeMap::new();
        for device in plan.ethernet_devices() {
            let Some(port) = switch.add_port() else { break };
            let fragments = SubDevicePort::default();
            devices.insert(device.id, ConnectedPort { port, fragments, under_way: 0 });
        }
        (!devices.is_empty()).then(|| Self { switch, devices, pending: Vec::new() })
    }

    /// Takes what the MainDevice tells: fragments, and frames that are done. What is due goes on.
    pub(super) fn handle_event(&mut self, now: Instant, event: &Event, main: &mut MainDevice) {
        #[expect(clippy::wildcard_enum_match_arm, reason = "all else is none of Ethernet")]
        match event {
            Event::Mailbox { id, kind: MailboxType::Eoe, data } => {
                if let Some(device) = self.devices.get_mut(id)
                    && let Some(frame) = device.fragments.handle_message(data)
                {
                    self.switch.handle_frame(now, device.port, frame);
                }
            }
            Event::Served { ticket, .. } => {
                let Some(at) = self.pending.iter().position(|(known, _)| known == ticket) else {
                    return;
                };
                let (_, id) = self.pending.swap_remove(at);
                if let Some(device) = self.devices.get_mut(&id) {
                    device.under_way = device.under_way.saturating_sub(1);
                }
            }
            _ => return,
        }
        // This computer has no interface there.
        while self.switch.poll_transmit(SwitchPort::HOST).is_some() {}
        for (id, device) in &mut self.devices {
            while device.under_way < AT_ONCE
                && let Some(frame) = self.switch.poll_transmit(device.port)
            {
                let number = device.fragments.next_number();
                let request = MailboxRequest::SendFrame { port: 0, number, frame: frame.to_vec() };
                device.under_way += 1;
                self.pending.push((main.serve(now, *id, Service::Mailbox(request)), *id));
            }
        }
    }
}
