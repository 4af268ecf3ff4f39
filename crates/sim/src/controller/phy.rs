//! The Ethernet PHYs of a controller and the interface that reaches their registers.
//!
//! Read first: S2 2.12 (MII management); registers 0 to 6 and the frames of the management interface
//! are those of IEEE 802.3, clause 22. What a MainDevice writes to a PHY does what it does on real
//! hardware: a PHY that is reset, negotiates anew or sleeps has no link, and so has its partner.

use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{self as r, PhyCommand, PhyControl};
use linesman_proto::time::{Instant, Span};

use super::core::Core;
use super::implemented;
use super::memory::{Memory, at};
use crate::hardware::{Hardware, PortKind};

/// One read or write: 64 bits (preamble, opcode, addresses, data) at 2.5 MHz, the fastest clock that
/// clause 22 allows.
pub const PHY_ACCESS_TIME: Span = Span::ns(25_600);

/// Register 0 after a reset: 100 Mbit/s, auto-negotiation, full duplex.
const CONTROL_RESET: u16 = 0x3100;
/// Bits of register 0.
const RESET: u16 = 1 << 15;
const LOOPBACK: u16 = 1 << 14;
const POWER_DOWN: u16 = 1 << 11;
const ISOLATE: u16 = 1 << 10;
const RESTART: u16 = 1 << 9;
/// What changes the way the link is made: speed, negotiation, duplex.
const LINK_SETTINGS: u16 = 1 << 13 | 1 << 12 | 1 << 8;
/// Register 1 without a link: 100BASE-TX and 10BASE-T in both duplexes, negotiates, has more
/// registers.
const STATUS_IDLE: u16 = 0x7809;
/// Bits of register 1 with a link: it stands, and the negotiation is complete.
const LINK_STATUS: u16 = 1 << 2;
const NEGOTIATED: u16 = 1 << 5;
/// Registers 2 and 3: a part that often sits beside such controllers.
const IDENTIFIER: [u16; 2] = [0x0022, 0x1560];
/// Register 4: all four modes of 100BASE-TX and 10BASE-T.
const ADVERTISED: u16 = 0x01E1;
/// Register 5 with a link: the partner can do the same, and has acknowledged.
const PARTNER: u16 = 0x45E1;

/// What a PHY does to its link, because it was told to.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum PhyAction {
    /// It drops the link and makes a new one.
    Restart,
    /// It falls asleep.
    Sleep,
    /// It wakes up, and makes a link.
    Wake,
}

/// The management interface with the PHYs behind it.
#[derive(Clone, Debug)]
pub(super) struct Phys {
    phys: PortMap<Option<Phy>>,
    running: Option<PhyAccess>,
    write_enabled: bool,
    /// For the wires: what PHYs are going to do to their links, and when.
    actions: Vec<(Instant, Port, PhyAction)>,
}

#[derive(Clone, Copy, Debug)]
struct Phy {
    control: u16,
    advertised: u16,
    /// The link was lost since register 1 was read: its link bit is low once more.
    link_missed: bool,
}

#[derive(Clone, Copy, Debug)]
struct PhyAccess {
    done_at: Instant,
    port: Option<Port>,
    register: u8,
    write: Option<u16>,
}

impl Phy {
    const fn new() -> Self {
        Self { control: CONTROL_RESET, advertised: ADVERTISED, link_missed: true }
    }

    fn read(&mut self, register: u8, link: bool) -> u16 {
        match register {
            0 => self.control,
            1 => {
                let shown = link && !std::mem::take(&mut self.link_missed);
                let bits = if shown { LINK_STATUS } else { 0 };
                STATUS_IDLE | bits | if link { NEGOTIATED } else { 0 }
            }
            2 | 3 => IDENTIFIER[usize::from(register) - 2],
            4 => self.advertised,
            5 if link => PARTNER,
            6 if link => 1,
            _ => 0,
        }
    }

    /// Takes a value, and says what becomes of the link.
    fn write(&mut self, register: u8, value: u16) -> Option<PhyAction> {
        match register {
            0 if value & RESET != 0 => {
                let asleep = self.control & POWER_DOWN != 0;
                *self = Self::new();
                Some(if asleep { PhyAction::Wake } else { PhyAction::Restart })
            }
            0 => {
                let before = self.control;
                let kept = LINK_SETTINGS | LOOPBACK | POWER_DOWN | ISOLATE;
                self.control = value & kept;
                let changed = before ^ self.control;
                if changed & POWER_DOWN != 0 {
                    let sleeps = self.control & POWER_DOWN != 0;
                    return Some(if sleeps { PhyAction::Sleep } else { PhyAction::Wake });
                }
                let anew = value & RESTART != 0 || changed & LINK_SETTINGS != 0;
                (anew && self.control & POWER_DOWN == 0).then_some(PhyAction::Restart)
            }
            4 => {
                self.advertised = value;
                None
            }
            _ => None,
        }
    }
}

impl Phys {
    pub(super) fn new(hardware: &Hardware) -> Self {
        let phy = |port| (hardware.ports[port] == PortKind::Mii).then_some(Phy::new());
        Self {
            phys: PortMap::from_fn(phy),
            running: None,
            write_enabled: false,
            actions: Vec::new(),
        }
    }

    /// When the running command ends.
    pub(super) fn done_at(&self) -> Option<Instant> {
        self.running.map(|running| running.done_at)
    }

    /// Whether the EtherCAT side may write to the interface now.
    pub(super) fn is_free(&self, memory: &Memory) -> bool {
        self.running.is_none() && memory.u8(&r::PHY_ACCESS_PDI) & 1 == 0
    }

    pub(super) fn link_lost(&mut self, port: Port) {
        if let Some(phy) = &mut self.phys[port] {
            phy.link_missed = true;
        }
    }

    pub(super) fn take_actions(&mut self) -> Vec<(Instant, Port, PhyAction)> {
        std::mem::take(&mut self.actions)
    }

    pub(super) fn has_actions(&self) -> bool {
        !self.actions.is_empty()
    }

    /// The frame has ended: write enable was for it alone.
    pub(super) fn end_frame(&mut self) {
        self.write_enabled = false;
    }

    /// Which PHY the address register means.
    fn addressed(&self, memory: &Memory) -> Option<Port> {
        /// The address is the PHY's own, not a port's number.
        const NO_TRANSLATION: u8 = 1 << 7;
        let address = memory.u8(&r::PHY_ADDRESS);
        let offset = PhyControl(memory.u16(&r::PHY_CONTROL_STATUS)).address_offset();
        let index = if address & NO_TRANSLATION == 0 {
            address & 0x1F
        } else {
            (address & 0x1F).wrapping_sub(offset) & 0x1F
        };
        Port::ALL.get(usize::from(index)).copied().filter(|port| self.phys[*port].is_some())
    }

    /// Bytes of 0x0510 were written, `low` or `high` or both, in a frame that ended at `at`.
    fn control(&mut self, low: Option<u8>, high: Option<u8>, at: Instant, memory: &mut Memory) {
        if let Some(low) = low {
            self.write_enabled = PhyControl(u16::from(low)).write_enable();
        }
        let Some(high) = high.filter(|_| self.running.is_none()) else { return };
        let command = PhyCommand::from_bits(high);
        let control = PhyControl(memory.u16(&r::PHY_CONTROL_STATUS))
            .with_read_error(false)
            .with_command_error(false);
        let write = match command {
            PhyCommand::None => return put(control.with_command(command), memory),
            PhyCommand::Read => None,
            PhyCommand::Write if self.write_enabled => Some(memory.u16(&r::PHY_DATA)),
            PhyCommand::Write | PhyCommand::Reserved(_) => {
                return put(control.with_command_error(true), memory);
            }
        };
        let register = memory.u8(&r::PHY_REGISTER_ADDRESS) & 0x1F;
        let port = self.addressed(memory);
        let done_at = at + PHY_ACCESS_TIME;
        if let (Some(port), Some(value)) = (port, write) {
            // What the PHY does to its link is told ahead: the wires must know before it is.
            if let Some(phy) = &mut self.phys[port]
                && let Some(action) = phy.write(register, value)
            {
                self.actions.push((done_at, port, action));
            }
        }
        self.running = Some(PhyAccess { done_at, port, register, write });
        put(control.with_busy(true).with_command(command), memory);
    }

    /// The running command ends.
    fn finish(&mut self, link: &PortMap<bool>, memory: &mut Memory) {
        let Some(running) = self.running.take() else { return };
        let control = PhyControl(memory.u16(&r::PHY_CONTROL_STATUS)).with_busy(false);
        let phy = running.port.and_then(|port| Some((self.phys[port].as_mut()?, link[port])));
        let control = match (phy, running.write) {
            (Some((phy, link)), None) => {
                memory.set_u16(&r::PHY_DATA, phy.read(running.register, link));
                control
            }
            (None, None) => {
                // Nobody drives the line: all ones.
                memory.set_u16(&r::PHY_DATA, 0xFFFF);
                control.with_read_error(true)
            }
            (_, Some(_)) => control,
        };
        put(control.with_command(PhyCommand::None), memory);
    }
}

fn put(control: PhyControl, memory: &mut Memory) {
    memory.set_u16(&r::PHY_CONTROL_STATUS, control.0);
}

impl Core {
    /// The interface as after power-on.
    pub(super) fn start_phys(&mut self) {
        self.phys = Phys::new(&self.hardware);
        let watches = implemented::watches_links_by_phy(&self.hardware);
        let control =
            PhyControl::default().with_pdi_control_possible(watches).with_link_detection(watches);
        put(control, &mut self.memory);
        self.refresh_phy_status();
    }

    /// Registers of the interface were written from the EtherCAT side.
    pub(super) fn phy_written(&mut self, low: Option<u8>, high: Option<u8>, end: Instant) {
        self.phys.control(low, high, end, &mut self.memory);
    }

    /// 0x0516 was written: with bit 0 the SubDevice's processor cannot take the interface.
    pub(super) fn phy_reserved(&mut self, value: u8) {
        self.memory.set_u8(&r::PHY_ACCESS_ECAT, value & 1);
    }

    /// 0x0517 was written from the EtherCAT side: bit 1 takes the interface back.
    pub(super) fn phy_released(&mut self, value: u8) {
        const FORCE: u8 = 1 << 1;
        let taken = self.memory.u8(&r::PHY_ACCESS_PDI) & 1;
        let taken = if value & FORCE != 0 { 0 } else { taken };
        self.memory.set_u8(&r::PHY_ACCESS_PDI, value & FORCE | taken);
    }

    /// Any of 0x0518 to 0x051B was written: read error and configuration update are cleared.
    pub(super) fn phy_status_written(&mut self) {
        const KEPT: u8 = !(1 << 3 | 1 << 5);
        for port in Port::ALL {
            let address = usize::from(r::PHY_PORT_STATUS.of_port(port).0);
            let value = self.memory.bytes()[address];
            self.memory.put(address, &[value & KEPT]);
        }
    }

    pub(super) fn finish_phy(&mut self) {
        let link = self.ports.loops.links();
        self.phys.finish(&link, &mut self.memory);
    }

    /// 0x0518 to 0x051B follow the links, where the controller watches them over PHY registers.
    pub(super) fn refresh_phy_status(&mut self) {
        const LINK: u8 = 0b11;
        const OFF: u8 = 1 << 6;
        if !implemented::watches_links_by_phy(&self.hardware) {
            return;
        }
        let links = self.ports.loops.links();
        for port in Port::ALL {
            let address = usize::from(r::PHY_PORT_STATUS.of_port(port).0);
            let value = match (self.hardware.ports[port], links[port]) {
                (PortKind::Mii, true) => LINK,
                (PortKind::Mii, false) => 0,
                (PortKind::Absent | PortKind::Ebus, _) => OFF,
            };
            self.memory.put(address, &[value]);
        }
    }
}

/// Where the interface's control register is.
pub(super) const CONTROL: usize = at(&r::PHY_CONTROL_STATUS);
