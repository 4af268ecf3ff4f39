//! Ethernet frames over a virtual segment: switch of the MainDevice, mailboxes, IP stacks of devices.

use std::collections::BTreeMap;

use linesman_maindevice::Event;
use linesman_maindevice::mailbox::MailboxRequest;
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_maindevice::virtual_switch::{SubDevicePort, SwitchLimits, SwitchPort, VirtualSwitch};
use linesman_proto::address::DeviceId;
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::eoe::IpParameters;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use crate::bench::{Bench, Fate};

/// A device with an IP stack, a terminal with one port, and one with four.
fn plant(stack: &str, one: &str, four: &str) -> String {
    format!(
        r#"
name = "office"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "W1"
type = "EL6688"
on = "K1.B"
{stack}
[[device]]
name = "S1"
type = "EL6601"
on = "W1.B"
{one}
[[device]]
name = "S4"
type = "EL6614"
on = "S1.B"
{four}
"#
    )
}

const STACK: &str = r#"ethernet = { ip = "192.168.1.11/24" }"#;
const PLUGGED: &str = r#"ethernet = { hosts = [{ port = 1, ip = "192.168.1.20/24" }] }"#;
const TWO_BY_DHCP: &str = "ethernet = { hosts = [{ port = 1 }, { port = 3 }] }";

const OWN_MAC: [u8; 6] = [0x02, 0, 0, 0, 0, 0x64];
const OWN_IP: [u8; 4] = [192, 168, 1, 100];
const ALL: [u8; 6] = [0xFF; 6];

/// A line whose SubDevices have a switch, and this computer beside it.
struct Office {
    bench: Bench,
    switch: VirtualSwitch,
    ports: BTreeMap<DeviceId, (SwitchPort, SubDevicePort)>,
    /// SubDevices that found no port.
    without_port: usize,
    repetitions: u64,
    /// Frames that came to this computer.
    came: Vec<Vec<u8>>,
}

impl Office {
    fn new(plant: &str, limits: SwitchLimits) -> Self {
        let mut bench = Bench::new(plant);
        bench.start(AlState::PreOp);
        let mut switch = VirtualSwitch::new(limits);
        let (mut ports, mut without_port) = (BTreeMap::new(), 0);
        for name in ["W1", "S1", "S4"] {
            match switch.add_port() {
                Some(port) => {
                    ports.insert(bench.id(name), (port, SubDevicePort::default()));
                }
                None => without_port += 1,
            }
        }
        bench.events.clear();
        Self { bench, switch, ports, without_port, repetitions: 0, came: Vec::new() }
    }

    /// Runs the line; frames go both ways.
    fn run(&mut self, span: Span) {
        let end = self.bench.now + span;
        while self.bench.now < end {
            for (id, (port, fragments)) in &mut self.ports {
                while let Some(frame) = self.switch.poll_transmit(*port) {
                    let (number, frame) = (fragments.next_number(), frame.to_vec());
                    let request = MailboxRequest::SendFrame { port: 0, number, frame };
                    self.bench.device.serve(self.bench.now, *id, Service::Mailbox(request));
                }
            }
            self.bench.run_for(Span::ms(1));
            for (_, event) in std::mem::take(&mut self.bench.events) {
                if let Event::Mailbox { id, kind: MailboxType::Eoe, data } = &event {
                    let Some((port, fragments)) = self.ports.get_mut(id) else { continue };
                    if let Some(frame) = fragments.handle_message(data) {
                        self.switch.handle_frame(self.bench.now, *port, frame);
                    }
                } else if let Event::Served { result, .. } = event
                    && let Ok(ServiceAnswer::Data(data)) = *result
                {
                    let again = data.get(4..8).and_then(|bytes| bytes.try_into().ok());
                    self.repetitions += u64::from(again.map_or(0, u32::from_le_bytes));
                }
            }
            while let Some(frame) = self.switch.poll_transmit(SwitchPort::HOST) {
                self.came.push(frame.to_vec());
            }
        }
    }

    fn send(&mut self, frame: Vec<u8>) {
        self.switch.handle_frame(self.bench.now, SwitchPort::HOST, frame);
    }

    /// The hardware address behind an IP address.
    fn resolve(&mut self, ip: [u8; 4]) -> Option<[u8; 6]> {
        self.came.clear();
        self.send(arp_request(ip));
        self.run(Span::ms(200));
        let answer = self.came.iter().find(|frame| {
            frame[12..14] == [0x08, 0x06] && frame[20..22] == [0, 2] && frame[28..32] == ip
        })?;
        answer[22..28].try_into().ok()
    }

    /// True if a ping with so many bytes comes back as it went.
    fn ping(&mut self, ip: [u8; 4], len: usize) -> bool {
        let Some(mac) = self.resolve(ip) else { return false };
        let payload: Vec<u8> = (0..len).map(|at| at as u8).collect();
        self.came.clear();
        self.send(echo_request(mac, ip, &payload));
        self.run(Span::ms(300));
        self.came.iter().any(|frame| {
            frame[12..14] == [0x08, 0x00]
                && frame[23] == 1
                && frame[26..30] == ip
                && frame[34] == 0
                && frame[42..42 + len] == payload[..]
        })
    }

    fn set(&mut self, name: &str, parameters: IpParameters) {
        let id = self.bench.id(name);
        let mut bytes = [0; 64];
        let len = parameters.write(&mut bytes).unwrap();
        let request = MailboxRequest::SetAddresses { port: 0, parameters: bytes[..len].to_vec() };
        self.bench.device.serve(self.bench.now, id, Service::Mailbox(request));
        let done = |event: &Event| matches!(event, Event::Served { result, .. } if result.is_ok());
        assert!(self.bench.run_until(Span::s(1), done), "{name} takes the addresses");
    }
}

fn ethernet(to: [u8; 6], kind: u16, payload: &[u8]) -> Vec<u8> {
    let mut frame = [&to[..], &OWN_MAC, &kind.to_be_bytes(), payload].concat();
    frame.resize(frame.len().max(60), 0);
    frame
}

fn arp_request(ip: [u8; 4]) -> Vec<u8> {
    let head = [0, 1, 8, 0, 6, 4, 0, 1];
    ethernet(ALL, 0x0806, &[&head[..], &OWN_MAC, &OWN_IP, &[0; 6], &ip].concat())
}

fn checksum(bytes: &[u8]) -> [u8; 2] {
    let words = bytes
        .chunks(2)
        .map(|two| u32::from(u16::from_be_bytes([two[0], two.get(1).copied().unwrap_or(0)])));
    let mut sum: u32 = words.sum();
    while sum >> 16 != 0 {
        sum = (sum & 0xFFFF) + (sum >> 16);
    }
    (!(sum as u16)).to_be_bytes()
}

fn ipv4(protocol: u8, from: [u8; 4], to: [u8; 4], payload: &[u8]) -> Vec<u8> {
    let len = (20 + payload.len()) as u16;
    let [high, low] = len.to_be_bytes();
    let mut header = vec![0x45, 0, high, low, 0, 1, 0, 0, 64, protocol, 0, 0];
    header.extend_from_slice(&from);
    header.extend_from_slice(&to);
    let sum = checksum(&header);
    header[10..12].copy_from_slice(&sum);
    [header, payload.to_vec()].concat()
}

fn echo_request(mac: [u8; 6], ip: [u8; 4], payload: &[u8]) -> Vec<u8> {
    let mut message = [&[8, 0, 0, 0, 0x12, 0x34, 0, 1][..], payload].concat();
    let sum = checksum(&message);
    message[2..4].copy_from_slice(&sum);
    ethernet(mac, 0x0800, &ipv4(1, OWN_IP, ip, &message))
}

/// The answer of a DHCP server on this computer: it offers and confirms one address.
fn dhcp_answer(frame: &[u8], ip: [u8; 4]) -> Option<Vec<u8>> {
    let message = frame.get(42..).filter(|_| frame[23] == 17 && frame[36..38] == [0, 67])?;
    let options = message.get(240..)?;
    let asked = options.windows(3).find(|three| three[..2] == [53, 1])?[2];
    let kind = match asked {
        1 => 2,
        3 => 5,
        _ => return None,
    };
    let mut answer = vec![0; 240];
    answer[..4].copy_from_slice(&[2, 1, 6, 0]);
    answer[4..8].copy_from_slice(&message[4..8]);
    answer[16..20].copy_from_slice(&ip);
    answer[28..34].copy_from_slice(&message[28..34]);
    answer[236..240].copy_from_slice(&[99, 130, 83, 99]);
    answer.extend_from_slice(&[53, 1, kind, 54, 4]);
    answer.extend_from_slice(&OWN_IP);
    answer.extend_from_slice(&[51, 4, 0, 0, 14, 16, 1, 4, 255, 255, 255, 0, 255]);
    let len = (8 + answer.len()) as u16;
    let udp = [&[0, 67, 0, 68][..], &len.to_be_bytes(), &[0, 0], &answer].concat();
    Some(ethernet(ALL, 0x0800, &ipv4(17, OWN_IP, [255; 4], &udp)))
}

const DEVICE_IP: [u8; 4] = [192, 168, 1, 11];
const PLUGGED_IP: [u8; 4] = [192, 168, 1, 20];

// S0 L2849-2863, L2883-2886.
// proves: EOE-01 (S), EOE-05 (S)
#[test]
fn ping_reaches_an_ip_application_and_a_computer_at_a_switch_terminal() {
    let mut office = Office::new(&plant(STACK, PLUGGED, ""), SwitchLimits::default());
    for len in [0, 56, 1_000, 1_472] {
        assert!(office.ping(DEVICE_IP, len), "{len} bytes to the device");
        assert!(office.ping(PLUGGED_IP, len), "{len} bytes to the computer");
    }
    assert!(!office.ping([192, 168, 1, 12], 10), "nobody has that address");
    // Each is behind its own port: what is for one does not come to the other.
    let sent = |office: &Office, name: &str| {
        office.switch.counts(office.ports[&office.bench.id(name)].0).sent
    };
    let before = sent(&office, "S1");
    assert!(office.ping(DEVICE_IP, 100));
    assert_eq!(sent(&office, "S1"), before + 1, "the question to all, and nothing else");
    for (_, fragments) in office.ports.values() {
        assert_eq!(fragments.counts().lost, 0);
    }
}

// S0 L2865-2869.
// proves: EOE-02 (S)
#[test]
fn switch_holds_to_its_ports_its_addresses_and_its_buffers() {
    let limits = SwitchLimits { ports: 2, macs: 2, frames: 5, ..SwitchLimits::default() };
    let mut office = Office::new(&plant(STACK, PLUGGED, ""), limits);
    assert_eq!((office.ports.len(), office.without_port), (2, 1), "two ports for three SubDevices");
    // This computer and the device are known; the third finds no room, and is reached all the same.
    assert!(office.ping(DEVICE_IP, 10));
    assert_eq!(office.switch.known_addresses(office.bench.now), 2);
    assert!(office.ping(PLUGGED_IP, 10));
    assert_eq!(office.switch.known_addresses(office.bench.now), 2);
    let plugged = office.ports[&office.bench.id("S1")].0;
    assert!(office.switch.counts(plugged).not_learned > 0);
    // Old ones make room.
    office.run(Span::s(300));
    assert_eq!(office.switch.known_addresses(office.bench.now), 0);
    // Nine frames at once, of which five find room.
    let mac = office.resolve(DEVICE_IP).unwrap();
    let device = office.ports[&office.bench.id("W1")].0;
    let before = office.switch.counts(device);
    for _ in 0..9 {
        office.send(echo_request(mac, DEVICE_IP, &[0; 100]));
    }
    office.came.clear();
    office.run(Span::ms(300));
    let counts = office.switch.counts(device);
    assert_eq!((counts.sent - before.sent, counts.dropped_full), (5, 4));
    assert_eq!(office.came.len(), 5, "what was passed on was answered");
}

#[test]
fn frames_to_all_are_limited_and_senders_that_cannot_be_are_refused() {
    let limits = SwitchLimits { flooded_per_second: 20, ..SwitchLimits::default() };
    let mut switch = VirtualSwitch::new(limits);
    let port = switch.add_port().unwrap();
    let mut now = linesman_proto::time::Instant::ZERO;
    for _ in 0..1_000 {
        now += Span::ms(1);
        switch.handle_frame(now, SwitchPort::HOST, arp_request(DEVICE_IP));
    }
    let sent = std::iter::from_fn(|| switch.poll_transmit(port)).count();
    assert!((20..=41).contains(&sent), "{sent}");
    assert_eq!(switch.counts(SwitchPort::HOST).dropped_flood as usize, 1_000 - sent);
    let ending_here = [&[0x01, 0x80, 0xC2, 0, 0, 0][..], &OWN_MAC, &[0; 48]].concat();
    switch.handle_frame(now + Span::s(1), SwitchPort::HOST, ending_here);
    assert!(switch.poll_transmit(port).is_none(), "it ends at the next switch");
    let from_a_group = [&ALL[..], &ALL, &[0; 48]].concat();
    for frame in [from_a_group, vec![0; 13], vec![0; 1_519], Vec::new()] {
        switch.handle_frame(now + Span::s(1), SwitchPort::HOST, frame);
    }
    assert!(switch.poll_transmit(port).is_none());
    assert_eq!(switch.counts(SwitchPort::HOST).malformed, 4);
}

// S0 L2890-2892.
// proves: EOE-06 (S)
#[test]
fn device_has_no_address_the_one_it_was_given_or_the_one_it_fetches() {
    let mut office = Office::new(&plant("", "", ""), SwitchLimits::default());
    assert!(!office.ping(DEVICE_IP, 10), "none was set");
    let parameters =
        |ip, mask| IpParameters { ip: Some(ip), mask: Some(mask), ..IpParameters::default() };
    office.set("W1", parameters(DEVICE_IP, [255, 255, 255, 0]));
    assert!(office.ping(DEVICE_IP, 10), "it was set");
    let lent = [192, 168, 1, 55];
    office.set("W1", parameters([0; 4], [0; 4]));
    office.came.clear();
    for _ in 0..100 {
        office.run(Span::ms(200));
        for frame in std::mem::take(&mut office.came) {
            if let Some(answer) = dhcp_answer(&frame, lent) {
                office.send(answer);
            }
        }
    }
    assert!(office.ping(lent, 10), "it was fetched");
    assert!(!office.ping(DEVICE_IP, 10), "the former one is gone");
}

// S0 L2891-2897.
// proves: EOE-07 (S)
#[test]
fn switch_terminal_lends_its_address_to_the_first_computer_at_its_ports() {
    let one = r#"ethernet = { hosts = [{ port = 1 }] }"#;
    let mut office = Office::new(&plant("", one, TWO_BY_DHCP), SwitchLimits::default());
    let (at_one, at_four) = ([192, 168, 1, 61], [192, 168, 1, 64]);
    assert!(!office.ping(at_one, 10) && !office.ping(at_four, 10), "no address was set");
    let parameters = |ip| IpParameters {
        ip: Some(ip),
        mask: Some([255, 255, 255, 0]),
        ..IpParameters::default()
    };
    office.set("S1", parameters(at_one));
    office.set("S4", parameters(at_four));
    office.came.clear();
    office.run(Span::s(40));
    // The second computer at the EL6614 still asks, and its question goes out into the network.
    let asks = office.came.iter().rfind(|frame| frame[36..38] == [0, 67]).cloned();
    let asks = asks.expect("the second one asks on");
    assert!(office.ping(at_one, 10), "the one at the EL6601 has it");
    let mac = office.resolve(at_four).expect("one of two has it");
    assert!(office.ping(at_four, 10));
    assert_ne!(asks[6..12], mac, "the one that asks is another");
}

#[test]
fn frames_arrive_whole_though_ethercat_frames_are_lost() {
    let mut office = Office::new(&plant(STACK, PLUGGED, ""), SwitchLimits::default());
    assert!(office.ping(DEVICE_IP, 1_472));
    office.bench.tamper =
        Some(Box::new(|number| if number % 23 == 0 { Fate::Lost } else { Fate::Arrives }));
    let came = (0..40).filter(|_| office.ping(DEVICE_IP, 1_472)).count();
    // A fragment that got lost when the next one was in the mailbox already cannot be fetched again.
    assert!(came >= 34, "{came} of 40");
    assert!(office.repetitions > 0);
}

// S0 L2883-2886.
// proves: EOE-05 (S)
#[test]
fn two_devices_at_an_el6614_that_are_outside_the_segment_are_each_reached_by_its_own_port() {
    let mut office = Office::new(&plant(STACK, PLUGGED, ""), SwitchLimits::default());
    let segment = &mut office.bench.segment;
    let id = segment.open_ethernet_port("S4.1").expect("a port of an EL6614").0;
    segment.open_ethernet_port("S4.3").expect("another one");
    for place in ["S4.1", "S4.5", "S4", "S4.x", "S1.1", "W1.1", "K1.1", "S9.1", ""] {
        assert!(segment.open_ethernet_port(place).is_err(), "{place}");
    }
    let macs = [[2, 1, 1, 1, 1, 1], [2, 3, 3, 3, 3, 3]];
    let from = |port: usize, to: [u8; 6]| {
        let mut frame = [&to[..], &macs[port], &[0x88, 0xB5]].concat();
        frame.resize(200, port as u8);
        frame
    };
    let left = |office: &mut Office| {
        let mut frames = Vec::new();
        while let Some(frame) = office.bench.segment.poll_ethernet_frame(id) {
            frames.push(frame);
        }
        frames
    };
    let put = |office: &mut Office, port: u8, frame: &[u8]| {
        let now = office.bench.now;
        office.bench.segment.handle_ethernet_frame(now, id, port, frame);
        office.run(Span::ms(100));
    };
    // To all: the other port, and the network.
    for (at, (port, other)) in [(1, 3), (3, 1)].into_iter().enumerate() {
        let frame = from(at, ALL);
        office.came.clear();
        put(&mut office, port, &frame);
        assert_eq!(left(&mut office), [(other, frame.clone())]);
        assert_eq!(office.came, [frame]);
    }
    // To one of them: by its port alone; an address that nobody knows is looked for at both.
    for (at, port) in [(0, 1), (1, 3)] {
        let frame = ethernet(macs[at], 0x88B5, &[7; 400]);
        office.send(frame.clone());
        office.run(Span::ms(100));
        assert_eq!(left(&mut office), [(port, frame)]);
    }
    office.send(ethernet([2, 5, 5, 5, 5, 5], 0x88B5, &[7; 400]));
    office.run(Span::ms(100));
    assert_eq!(left(&mut office).iter().map(|(port, _)| *port).collect::<Vec<_>>(), [1, 3]);
    // From one to the other: it stays at the terminal. What comes by no open port goes nowhere.
    office.came.clear();
    let frame = from(0, macs[1]);
    put(&mut office, 1, &frame);
    assert_eq!(left(&mut office), [(3, frame)]);
    put(&mut office, 2, &from(0, ALL));
    assert_eq!((left(&mut office), &office.came), (Vec::new(), &Vec::<Vec<u8>>::new()));
    assert!(office.ping(DEVICE_IP, 100), "others are not concerned");
}
