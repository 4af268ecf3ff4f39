//! The PHY management interface and the PHYs behind it.

use linesman_proto::port::Port;
use linesman_proto::register::{PhyCommand, PhyControl};
use linesman_proto::time::Span;

use super::rig::{Bench, hardware, sii};
use crate::controller::{PHY_ACCESS_TIME, PhyAction};
use crate::device::NoFirmware;
use crate::hardware::{Hardware, PortKind};
use linesman_proto::address::RegisterAddress;

/// An IP core, which has access states and port status, with PHYs at ports A and B.
fn ip_core() -> Hardware {
    let mut hardware = hardware();
    (hardware.controller_type, hardware.revision, hardware.build) = (0x04, 2, 0x0030);
    hardware.ports.0 = [PortKind::Mii, PortKind::Mii, PortKind::Absent, PortKind::Absent];
    hardware
}

fn bench(hardware: Hardware) -> Bench {
    Bench::with(hardware, sii(false), Box::new(NoFirmware))
}

fn control(bench: &mut Bench) -> PhyControl {
    PhyControl(bench.word(0x0510))
}

/// Control, PHY, register and data in one access, as drivers do it.
fn start(bench: &mut Bench, command: PhyCommand, phy: u8, register: u8, data: u16) -> u16 {
    let mut bytes = PhyControl::start(command).0.to_le_bytes().to_vec();
    bytes.extend([phy, register]);
    bytes.extend(data.to_le_bytes());
    bench.write(0x0510, &bytes)
}

fn read(bench: &mut Bench, phy: u8, register: u8) -> u16 {
    assert_eq!(start(bench, PhyCommand::Read, phy, register, 0), 1);
    bench.wait(PHY_ACCESS_TIME);
    bench.word(0x0514)
}

// S2 2.12; IEEE 802.3 clause 22.
#[test]
fn basic_registers_say_what_the_link_is() {
    let mut bench = bench(hardware());
    assert_eq!(read(&mut bench, 0, 1), 0x7809, "no link");
    assert_eq!(read(&mut bench, 0, 5), 0, "no partner");
    bench.link(Port::A, true);
    assert_eq!(read(&mut bench, 0, 1) & 0x0024, 0x0020, "the link bit holds its loss once");
    assert_eq!(read(&mut bench, 0, 1) & 0x0024, 0x0024);
    assert_eq!((read(&mut bench, 0, 2), read(&mut bench, 0, 3)), (0x0022, 0x1560));
    assert_eq!(read(&mut bench, 0, 0), 0x3100);
    assert_eq!(read(&mut bench, 0, 5), 0x45E1);
    bench.link(Port::A, false);
    bench.link(Port::A, true);
    assert_eq!(read(&mut bench, 0, 1) & 0x0004, 0, "a loss nobody saw is still told");
    assert_eq!(read(&mut bench, 0, 1) & 0x0004, 4);
}

// S2 2.12.1: busy, errors, write enable in the same frame.
#[test]
fn commands_take_their_time_and_tell_their_errors() {
    let mut bench = bench(hardware());
    let idle = control(&mut bench);
    assert_eq!(idle, PhyControl(0));
    assert_eq!(start(&mut bench, PhyCommand::Read, 0, 2, 0), 1);
    assert!(control(&mut bench).busy());
    assert_eq!(bench.write(0x0512, &[1]), 0, "blocked while busy");
    bench.wait(PHY_ACCESS_TIME);
    assert_eq!(control(&mut bench), idle);
    // Port B is an E-bus port: there is no PHY.
    assert_eq!(read(&mut bench, 1, 2), 0xFFFF);
    assert!(control(&mut bench).read_error());
    assert_eq!(bench.write(0x0510, &[0, 0]), 1);
    assert!(!control(&mut bench).read_error(), "cleared by no command");
    assert_eq!(bench.write(0x0511, &[2]), 1);
    assert!(control(&mut bench).command_error(), "a write without write enable");
    assert_eq!(bench.write(0x0511, &[7]), 1);
    assert!(control(&mut bench).command_error(), "no such command");
    assert_eq!(read(&mut bench, 0x80, 2), 0x0022, "the PHY's own address, without translation");
    assert!(!control(&mut bench).command_error());
}

// IEEE 802.3 22.2.4.1: reset, restart and power down drop the link.
#[test]
fn what_a_phy_is_told_it_does() {
    let mut bench = bench(hardware());
    bench.link(Port::C, true);
    let actions = |bench: &mut Bench| {
        let actions = bench.controller.take_phy_actions();
        actions.into_iter().map(|(_, port, action)| (port, action)).collect::<Vec<_>>()
    };
    let rows = [
        (0x3300, Some(PhyAction::Restart), "negotiate anew"),
        (0x3900, Some(PhyAction::Sleep), "power down"),
        (0x3B00, None, "asleep, it negotiates nothing"),
        (0x3100, Some(PhyAction::Wake), "power up"),
        (0x3100, None, "no change"),
        (0x2100, Some(PhyAction::Restart), "without negotiation"),
        (0x8000, Some(PhyAction::Restart), "reset"),
    ];
    for (value, expected, why) in rows {
        assert_eq!(start(&mut bench, PhyCommand::Write, 2, 0, value), 1);
        bench.wait(Span::us(60));
        let expected: Vec<_> = expected.map(|action| (Port::C, action)).into_iter().collect();
        assert_eq!(actions(&mut bench), expected, "{why}");
    }
    assert_eq!(read(&mut bench, 2, 0), 0x3100, "as after a reset");
    start(&mut bench, PhyCommand::Write, 2, 4, 0x0101);
    bench.wait(Span::us(60));
    assert_eq!(read(&mut bench, 2, 4), 0x0101);
    start(&mut bench, PhyCommand::Write, 2, 2, 0x1234);
    bench.wait(Span::us(60));
    assert_eq!(read(&mut bench, 2, 2), 0x0022, "read only");
}

// S2 2.12.5 to 2.12.7.
#[test]
fn one_side_has_the_interface() {
    let mut bench = bench(ip_core());
    assert!(control(&mut bench).pdi_control_possible() && control(&mut bench).link_detection());
    let take =
        |bench: &mut Bench| bench.pdi(|pdi| pdi.write_register(RegisterAddress(0x0517), &[1]));
    assert!(take(&mut bench));
    assert_eq!(bench.byte(0x0517), 1);
    assert_eq!(start(&mut bench, PhyCommand::Read, 0, 1, 0), 0, "the processor has it");
    let mut access =
        |bytes: &[u8]| bench.pdi(|pdi| pdi.write_register(RegisterAddress(0x0512), bytes));
    assert!(access(&[1, 2]));
    assert!(bench.pdi(|pdi| pdi.write_register(RegisterAddress(0x0511), &[1])));
    bench.wait(PHY_ACCESS_TIME);
    assert_eq!(bench.word(0x0514), 0x0022);
    assert_eq!(bench.write(0x0517, &[2]), 1, "force");
    assert_eq!(bench.byte(0x0517) & 1, 0);
    assert_eq!(start(&mut bench, PhyCommand::Read, 0, 1, 0), 1);
    bench.wait(PHY_ACCESS_TIME);
    assert_eq!(bench.write(0x0516, &[1]), 1);
    assert!(!take(&mut bench), "the MainDevice keeps it to itself");
}

#[test]
fn port_status_follows_the_links() {
    let mut bench = bench(ip_core());
    assert_eq!(bench.read(0x0518, 2).unwrap(), [0, 0]);
    bench.link(Port::B, true);
    assert_eq!(bench.read(0x0518, 2).unwrap(), [0, 3]);
    bench.link(Port::B, false);
    assert_eq!(bench.read(0x0518, 2).unwrap(), [0, 0]);
    let mut ebus = hardware();
    ebus.ports.0[0] = PortKind::Ebus;
    ebus.ports.0[2] = PortKind::Ebus;
    let mut bench = Bench::with(ebus, sii(false), Box::new(NoFirmware));
    assert_eq!(bench.read(0x0510, 2), None, "no PHY, no interface");
}
