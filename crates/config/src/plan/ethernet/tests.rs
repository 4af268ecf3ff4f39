//! Tests of Ethernet of a plan.

use linesman_proto::address::{DeviceId, LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::mailbox::eoe::{ADDRESS_LEN, IpParameters};
use linesman_proto::sii::{MailboxArea, MailboxPair};
use linesman_proto::time::Span;
use linesman_proto::topology::Tree;

use super::*;
use crate::plan::{DatagramPlan, FramePlan, Role, Task};
use crate::profile::Mailbox;
use crate::start_up::{StartUpCommand, Transition};

fn device(no: u32, address: Option<([u8; 4], [u8; 4])>, mailbox: u16) -> DevicePlan {
    let area = |offset| MailboxArea { offset: RegisterAddress(offset), size: mailbox };
    let areas = MailboxPair { receive: area(0x1000), send: area(0x1800) };
    let start_up = address.map(|(ip, mask)| {
        let mut bytes = [0; ADDRESS_LEN];
        let parameters = IpParameters { ip: Some(ip), mask: Some(mask), ..IpParameters::default() };
        let len = parameters.write(&mut bytes).unwrap();
        StartUpCommand {
            transition: Transition::INIT_TO_PRE_OP,
            action: StartUpAction::SetAddresses { port: 0, parameters: bytes[..len].to_vec() },
            comment: String::new(),
        }
    });
    DevicePlan {
        name: format!("W{no}"),
        mailbox: Some(Mailbox {
            areas,
            bootstrap: None,
            protocols: Protocols(Protocols::EOE | Protocols::COE),
            complete_access: false,
        }),
        start_up: start_up.into_iter().collect(),
        ..DevicePlan::bare(DeviceId(no - 1))
    }
}

fn plan(devices: Vec<DevicePlan>) -> Plan {
    Plan { devices, ..Plan::empty(Tree::from_wiring(&[], None).unwrap()) }
}

const MASK: [u8; 4] = [255, 255, 255, 0];

fn names(doubts: &[Doubt]) -> Vec<&'static str> {
    doubts.iter().map(|doubt| doubt.name).collect()
}

// S0 L2873-2881.
// proves: EOE-04
#[test]
fn switch_needs_a_port_for_each_sub_device_and_an_address_for_each_end_point() {
    let plan = plan((1..=5).map(|no| device(no, None, 1_024)).collect());
    let doubts = |ports, macs, end_points| {
        names(&plan.switch_doubts(&SwitchSizes { ports, macs, end_points }))
    };
    assert_eq!(doubts(5, 6, None), Vec::<&str>::new());
    assert_eq!(doubts(4, 6, None), ["eoe-ports"]);
    assert_eq!(doubts(5, 5, None), ["eoe-macs"]);
    assert_eq!(doubts(5, 20, Some(20)), Vec::<&str>::new());
    assert_eq!(doubts(4, 20, Some(21)), ["eoe-ports", "eoe-macs"]);
    let mut off = plan.clone();
    off.devices[0].settings.keeping.forward_ethernet = false;
    let sizes = SwitchSizes { ports: 4, macs: 5, end_points: None };
    assert_eq!(off.switch_doubts(&sizes), [], "one that is switched off needs no port");
}

// S0 L2981.
// proves: EOE-12
#[test]
fn link_local_addresses_are_doubted() {
    let of = |ip| {
        let plan = plan(vec![device(1, Some((ip, [255, 255, 0, 0])), 1_024)]);
        names(&plan.doubts())
    };
    assert_eq!(of([169, 254, 0, 1]), ["eoe-link-local"]);
    assert_eq!(of([169, 254, 255, 254]), ["eoe-link-local"]);
    assert_eq!(of([169, 253, 0, 1]), Vec::<&str>::new());
    let own = plan(Vec::new()).host_doubts(Some("169.254.3.4/16".parse().unwrap()), None);
    assert_eq!(names(&own), ["eoe-link-local"]);
}

#[test]
fn addresses_that_no_device_can_have_and_subnets_that_overlap_are_doubted() {
    let of = |ip, mask| names(&plan(vec![device(1, Some((ip, mask)), 1_024)]).doubts());
    assert_eq!(of([192, 168, 1, 255], MASK), ["eoe-host-address"]);
    assert_eq!(of([10, 1, 0, 0], [255, 255, 0, 0]), ["eoe-host-address"]);
    assert_eq!(of([192, 168, 1, 64], [255, 255, 255, 192]), ["eoe-host-address"]);
    assert_eq!(of([224, 0, 0, 5], MASK), ["eoe-host-address"]);
    assert_eq!(of([192, 168, 1, 65], [255, 255, 255, 192]), Vec::<&str>::new());
    let two = |one, other| {
        let plan = plan(vec![device(1, Some(one), 1_024), device(2, Some(other), 1_024)]);
        names(&plan.doubts())
    };
    let first = ([192, 168, 1, 11], MASK);
    assert_eq!(two(first, ([192, 168, 1, 12], MASK)), Vec::<&str>::new());
    assert_eq!(two(first, first), ["eoe-same-address"]);
    assert_eq!(two(first, ([192, 168, 2, 11], [255, 255, 0, 0])), ["eoe-overlap"]);
    assert_eq!(two(first, ([192, 168, 2, 11], MASK)), Vec::<&str>::new());
    let one = plan(vec![device(1, Some(first), 1_024)]);
    let host = |own: &str, lan: &str| {
        names(&one.host_doubts(Some(own.parse().unwrap()), Some(lan.parse().unwrap())))
    };
    assert_eq!(host("192.168.1.100/24", "172.16.4.205/16"), Vec::<&str>::new());
    assert_eq!(host("192.168.2.100/24", "192.168.3.1/16"), ["eoe-other-subnet", "eoe-overlap"]);
}

fn rates(mailbox: u16, cycle: Span, frames: &[usize]) -> Vec<EthernetRate> {
    let mut plan = plan(vec![device(1, None, mailbox)]);
    let frame = |len: &usize| {
        FramePlan::new(vec![DatagramPlan {
            command: Command::Lrw,
            address: DatagramAddress::Logical(LogicalAddress(0)),
            len: *len,
            role: Role::ProcessData,
            sync_unit: None,
            ownership: Vec::new(),
        }])
    };
    plan.tasks = vec![Task {
        name: "t".to_owned(),
        cycle,
        io_at: crate::plan::IoAt::default(),
        sync_units: Vec::new(),
        frames: frames.iter().map(frame).collect(),
    }];
    plan.ethernet_rates()
}

// S0 L2899-2925: some hundred kB/s up to 2-3 MB/s.
// proves: EOE-08 (U), EOE-09
#[test]
fn throughput_follows_from_mailbox_cycle_and_free_bandwidth() {
    let rate = |mailbox, us, frames: &[usize]| {
        let rates = rates(mailbox, Span::us(us), frames);
        assert_eq!(rates.len(), 2, "to it and from it");
        (rates[0].bytes_per_second, rates[0].limit)
    };
    // Two fragments: limited by the 600 µs that the SubDevice is taken to need for each; from it two a cycle.
    let (to, limit) = rate(1_024, 1_000, &[60]);
    assert_eq!(limit, RateLimit::SubDevice);
    assert!((1_200_000..1_220_000).contains(&to), "{to}");
    let from = rates(1_024, Span::us(1_000), &[60])[1];
    assert_eq!((from.bytes_per_second / 10_000, from.limit), (146, RateLimit::Cycle));
    assert_eq!(from.tcp_bytes_per_second(), Some(from.bytes_per_second * 8 / 9));
    assert_eq!(rates(1_024, Span::us(1_000), &[60])[0].tcp_bytes_per_second(), None);
    for (mailbox, us) in [(512, 500), (1_024, 1_000), (1_024, 500), (1_024, 250), (1_486, 250)] {
        let (bytes, _) = rate(mailbox, us, &[60]);
        assert!((300_000..=3_000_000).contains(&bytes), "{mailbox} bytes, {us} µs: {bytes}");
    }
    // A larger mailbox, a shorter cycle: more. A wire that is nearly full: less.
    assert!(rate(256, 1_000, &[60]).0 < rate(512, 1_000, &[60]).0);
    assert!(rate(1_024, 2_000, &[60]).0 < rate(1_024, 1_000, &[60]).0);
    let (full, limit) = rate(1_024, 250, &[1_400, 1_400]);
    assert_eq!(limit, RateLimit::Bandwidth);
    assert!(full < rate(1_024, 250, &[60]).0);
    // 32 bytes are the least that a fragment has; a mailbox that does not hold them carries no frames.
    assert_eq!(rates(41, Span::ms(1), &[60]), []);
    assert_eq!(rates(42, Span::ms(1), &[60])[0].fragments, 48);
}

// S0 L2941-2979.
// proves: EOE-11 (U)
#[test]
fn worked_route_of_the_sources_is_printed() {
    let subnet = |text: &str| text.parse::<Subnet>().unwrap();
    let route = EthernetRoute {
        lan: subnet("172.16.4.205/16"),
        lan_host: Some(subnet("172.16.8.31/16")),
        own: subnet("192.168.1.100/24"),
        device: Some(subnet("192.168.1.11/24")),
    };
    assert_eq!(route.doubt(), None);
    let steps = route.steps();
    let commands: Vec<_> = steps.iter().flat_map(|step| &step.commands).collect();
    let expected = [
        "sysctl -w net.ipv4.ip_forward=1",
        "ip route add 192.168.1.0/24 via 172.16.4.205",
        "ip route add 172.16.0.0/16 via 192.168.1.100",
    ];
    assert_eq!(commands, expected);
    assert!(steps[1].remark.contains("route add 192.168.1.0 mask 255.255.255.0 172.16.4.205 -p"));
    let overlapping = EthernetRoute { own: subnet("172.16.9.1/24"), device: None, ..route };
    assert!(overlapping.doubt().unwrap().contains("overlap"));
    let elsewhere = EthernetRoute { device: Some(subnet("10.0.0.1/8")), ..route };
    assert!(elsewhere.doubt().unwrap().contains("10.0.0.1/8"));
}
