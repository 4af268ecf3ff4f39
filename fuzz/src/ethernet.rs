//! Ethernet frames through mailboxes (EoE): fragments of a SubDevice, frames to it, and what the diagnosis makes of them.

use linesman_diagnosis::model::ethernet::EthernetHistory;
use linesman_maindevice::virtual_switch::{
    LONGEST_FRAME, SubDevicePort, SwitchLimits, SwitchPort, VirtualSwitch,
};
use linesman_proto::ethernet::MacAddress;
use linesman_proto::mailbox::Counter;
use linesman_proto::mailbox::eoe::{Message, fragments};
use linesman_proto::time::{Instant, Span};
use linesman_sim::device::ethernet::{
    EthernetFunction, EthernetSetup, EthernetSide, HostAddress, PluggedHost,
};

/// The number of SubDevices.
const DEVICES: usize = 3;

/// Any bytes may come as a message of a SubDevice, and any frame may be for it. No frame gets longer than Ethernet frames
/// are, a frame that is sent in fragments arrives as it was, and nothing is counted twice.
pub fn ethernet(data: &[u8]) {
    let limits = SwitchLimits { macs: 4, frames: 2, ..SwitchLimits::default() };
    let mut switch = VirtualSwitch::new(limits);
    let mut devices: Vec<_> = (0..DEVICES)
        .filter_map(|_| switch.add_port())
        .map(|port| (port, SubDevicePort::default(), EthernetHistory::default()))
        .collect();
    let mut sides = sides();
    let mut rest = data;
    let mut now = Instant::ZERO;
    let mut messages = 0_u64;
    while let Some(([who, len_low, len_high, counter], behind)) = rest.split_first_chunk() {
        let len = usize::from(u16::from_le_bytes([*len_low, *len_high])) % 2_000;
        let (body, behind) = behind.split_at(len.min(behind.len()));
        rest = behind;
        now += Span::us(u64::from(*counter) * 100);
        messages += 1;
        if let Ok(Message::Fragment(fragment)) = Message::parse(body) {
            let (_, _, history) = &mut devices[usize::from(*who) % DEVICES];
            if history.count(Counter::new(*counter & 7).unwrap_or_default()) {
                history.take(&fragment, now, messages);
            }
            assert!(history.spoiled.len() as u64 <= 2 * messages);
            assert!(history.spoiled.iter().all(|seen| seen.value.fragment < 64));
        }
        let (port, fragments, _) = &mut devices[usize::from(*who) % DEVICES];
        if let Some(frame) = fragments.handle_message(body) {
            assert!(frame.len() <= LONGEST_FRAME);
            switch.handle_frame(now, *port, frame);
        }
        arrives_as_it_was(body, usize::from(*counter) * 8);
        let counts = fragments.counts();
        assert!(counts.frames + counts.lost <= counts.fragments + 1, "{counts:?}");
        switch.handle_frame(now, SwitchPort::HOST, body.to_vec());
        for (at, side) in sides.iter_mut().enumerate() {
            while let Some(frame) = switch.poll_transmit(devices[at].0) {
                side.handle_frame(&frame);
            }
            side.handle_frame(body);
            side.handle_timeout(now);
            while let Some(frame) = side.poll_transmit() {
                switch.handle_frame(now, devices[at].0, frame);
            }
            let _ = side.poll_timeout(now);
        }
        while switch.poll_transmit(SwitchPort::HOST).is_some() {}
        assert!(switch.known_addresses(now) <= limits.macs);
    }
}

/// A frame in fragments for a mailbox of this room is the same frame.
fn arrives_as_it_was(frame: &[u8], room: usize) {
    if frame.is_empty() || frame.len() > LONGEST_FRAME {
        return;
    }
    let mut port = SubDevicePort::default();
    let mut arrived = None;
    let mut count = 0;
    for fragment in fragments(frame, 3, 9, room) {
        let mut buffer = [0_u8; LONGEST_FRAME + 4];
        let len = Message::Fragment(fragment).write(&mut buffer).expect("there is room");
        assert_eq!(arrived, None, "it was not the last one");
        arrived = port.handle_message(&buffer[..len]);
        count += 1;
    }
    // Six bits count fragments.
    if count <= 64 {
        assert_eq!(arrived.as_deref(), Some(frame));
    }
}

/// A device with an IP stack, one that fetches its address, and a terminal with computers.
fn sides() -> Vec<EthernetSide> {
    let fixed = HostAddress::Fixed { ip: [192, 168, 1, 11], bits: 24, gateway: None };
    let setup = |at, address, hosts| EthernetSetup {
        name: "D".to_owned(),
        mac: MacAddress([2, 0, 0, 0, at, 0]),
        address,
        datagrams: None,
        hosts,
    };
    let hosts = vec![
        PluggedHost { port: 1, address: fixed },
        PluggedHost { port: 2, address: HostAddress::Dhcp },
    ];
    vec![
        EthernetSide::new(EthernetFunction::IpApplication, &setup(1, fixed, Vec::new())),
        EthernetSide::new(
            EthernetFunction::IpApplication,
            &setup(2, HostAddress::Dhcp, Vec::new()),
        ),
        EthernetSide::new(EthernetFunction::SwitchPorts(4), &setup(3, HostAddress::None, hosts)),
    ]
}
