//! Registers that a type of controller has: the register table, less what this segment does not
//! implement.
//!
//! What is not named here is not there: a read or write of it adds nothing to the working counter,
//! as in a controller that lacks it. Reference: S2 1.3, column "availability".

use linesman_proto::register::{self as r, Access, ControllerType, Features, Register, Unit};

use super::memory::Rights;
use crate::hardware::{Hardware, PortKind};

/// What every controller has.
const ALWAYS: &[Register] = &[
    r::ESC_TYPE,
    r::ESC_REVISION,
    r::ESC_BUILD,
    r::FMMU_COUNT,
    r::SYNC_MANAGER_COUNT,
    r::RAM_SIZE,
    r::PORT_DESCRIPTOR,
    r::ESC_FEATURES,
    r::STATION_ADDRESS,
    r::STATION_ALIAS,
    r::REGISTER_WRITE_ENABLE,
    r::REGISTER_WRITE_PROTECTION,
    r::ESC_WRITE_ENABLE,
    r::ESC_WRITE_PROTECTION,
    r::ESC_RESET_ECAT,
    r::DL_CONTROL,
    r::PHYSICAL_READ_WRITE_OFFSET,
    r::DL_STATUS,
    r::AL_CONTROL,
    r::AL_STATUS,
    r::AL_STATUS_CODE,
    r::PDI_CONTROL,
    r::ESC_CONFIGURATION_A0,
    r::PDI_CONFIGURATION,
    r::SYNC_LATCH_CONFIGURATION,
    r::PDI_CONFIGURATION_EXTENDED,
    r::ECAT_EVENT_MASK,
    r::AL_EVENT_MASK,
    r::ECAT_EVENT_REQUEST,
    r::AL_EVENT_REQUEST,
    r::RX_ERROR_COUNTER,
    r::PROCESSING_UNIT_ERROR_COUNTER,
    r::PDI_ERROR_COUNTER,
    r::LOST_LINK_COUNTER,
    r::WATCHDOG_DIVIDER,
    r::WATCHDOG_TIME_PDI,
    r::WATCHDOG_TIME_PROCESS_DATA,
    r::WATCHDOG_STATUS_PROCESS_DATA,
    r::WATCHDOG_COUNTER_PROCESS_DATA,
    r::WATCHDOG_COUNTER_PDI,
    r::SII_ACCESS_ECAT,
    r::SII_ACCESS_PDI,
    r::SII_CONTROL_STATUS,
    r::SII_ADDRESS,
    r::SII_DATA,
    r::FMMU,
    r::SYNC_MANAGER,
    r::DIGITAL_OUTPUT,
    r::USER_RAM,
];

/// What the time loop control unit of distributed clocks has.
const TIME_LOOP: &[Register] = &[
    r::SYSTEM_TIME,
    r::RECEIVE_TIME_PROCESSING_UNIT,
    r::SYSTEM_TIME_OFFSET,
    r::SYSTEM_TIME_DELAY,
    r::SYSTEM_TIME_DIFFERENCE,
    r::SPEED_COUNTER_START,
    r::SPEED_COUNTER_DIFF,
    r::DIFFERENCE_FILTER_DEPTH,
    r::SPEED_FILTER_DEPTH,
];

/// What SYNC and latch unit share.
const CYCLIC_UNITS: &[Register] = &[r::CYCLIC_UNIT_CONTROL];

/// What the unit that makes SYNC0 and SYNC1 has.
const SYNC_UNIT: &[Register] = &[
    r::SYNC_ACTIVATION,
    r::SYNC_PULSE_LENGTH,
    r::SYNC0_STATUS,
    r::SYNC1_STATUS,
    r::START_TIME,
    r::NEXT_SYNC1,
    r::SYNC0_CYCLE_TIME,
    r::SYNC1_CYCLE_TIME,
];

/// What the unit that takes the times of inputs has.
const LATCH_UNIT: &[Register] = &[
    r::LATCH0_CONTROL,
    r::LATCH1_CONTROL,
    r::LATCH0_STATUS,
    r::LATCH1_STATUS,
    r::LATCH0_POSITIVE,
    r::LATCH0_NEGATIVE,
    r::LATCH1_POSITIVE,
    r::LATCH1_NEGATIVE,
];

/// Where a write is a command, beside those that clear (whose access says so).
const LIVE: &[Register] = &[
    r::REGISTER_WRITE_ENABLE,
    r::ESC_WRITE_ENABLE,
    r::ESC_RESET_ECAT,
    r::SII_ACCESS_ECAT,
    r::SII_CONTROL_STATUS,
    r::RECEIVE_TIME,
    r::SYSTEM_TIME,
    r::PHY_CONTROL_STATUS,
    r::PHY_ACCESS_ECAT,
    r::PHY_ACCESS_PDI,
    r::PHY_PORT_STATUS,
];

/// Where the moment decides whether a write is taken. The other registers marked `r/(w)` in the
/// table depend on settings that this segment does not have.
const CONDITIONAL: &[Register] = &[
    r::AL_CONTROL,
    r::SII_CONTROL_STATUS,
    r::SII_ADDRESS,
    r::SII_DATA,
    r::PHY_CONTROL_STATUS,
    r::PHY_ADDRESS,
    r::PHY_REGISTER_ADDRESS,
    r::PHY_DATA,
    r::SYNC_MANAGER,
    r::SYNC_ACTIVATION,
    r::START_TIME,
    r::SYNC0_CYCLE_TIME,
    r::SYNC1_CYCLE_TIME,
    r::LATCH0_CONTROL,
    r::LATCH1_CONTROL,
];

/// Times of 64 bits, of which clocks of 32 bits have the low half.
const LONG_TIMES: &[Register] = &[
    r::SYSTEM_TIME,
    r::RECEIVE_TIME_PROCESSING_UNIT,
    r::SYSTEM_TIME_OFFSET,
    r::START_TIME,
    r::NEXT_SYNC1,
    r::LATCH0_POSITIVE,
    r::LATCH0_NEGATIVE,
    r::LATCH1_POSITIVE,
    r::LATCH1_NEGATIVE,
];

/// Which units of distributed clocks are on, beside the receive times.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub(super) struct ClockUnits {
    pub(super) time_loop: bool,
    pub(super) sync: bool,
    pub(super) latch: bool,
}

impl ClockUnits {
    /// By the configuration from the SII. ET1100 and ET1200 switch the time loop off to save power
    /// when neither SYNC nor latch unit is wanted and A5 does not ask for it; receive times are there
    /// all the same (S2 2.6.2, 2.6.3).
    pub(super) fn configured(hardware: &Hardware, a0: u8, a5: u16) -> Self {
        const SYNC_UNIT: u8 = 1 << 2;
        const LATCH_UNIT: u8 = 1 << 3;
        const TIME_LOOP_UNIT: u16 = 1 << 8;
        // The first generation has no such bits: its units are always on.
        let always = ControllerType(hardware.controller_type) == ControllerType::ESC20;
        let (sync, latch) = (always || a0 & SYNC_UNIT != 0, always || a0 & LATCH_UNIT != 0);
        let wanted = sync || latch || a5 & TIME_LOOP_UNIT != 0;
        Self { time_loop: wanted || !has_configuration_a5(hardware), sync, latch }
    }
}

/// Fills in the rights of every register byte that `hardware` has.
pub(super) fn fill(hardware: &Hardware, units: ClockUnits, rights: &mut [u8]) {
    for register in ALWAYS {
        add(register, hardware, rights);
    }
    if hardware.counting.forwarded {
        add(&r::FORWARDED_RX_ERROR_COUNTER, hardware, rights);
    }
    if has_configuration_a5(hardware) {
        add(&r::ESC_CONFIGURATION_A5, hardware, rights);
    }
    if hardware.ports.0.contains(&PortKind::Mii) {
        for register in PHY_ACCESS {
            add(register, hardware, rights);
        }
    }
    for (since, registers) in LATER {
        for register in registers.iter().filter(|_| is_since(hardware, *since)) {
            add(register, hardware, rights);
        }
    }
    if Features(hardware.features).distributed_clocks() {
        add(&r::RECEIVE_TIME, hardware, rights);
        let parts = [
            (units.time_loop, TIME_LOOP),
            (units.sync || units.latch, CYCLIC_UNITS),
            (units.sync, SYNC_UNIT),
            (units.latch, LATCH_UNIT),
        ];
        for (_, registers) in parts.into_iter().filter(|(is_on, _)| *is_on) {
            for register in registers {
                add(register, hardware, rights);
            }
        }
        let kind = ControllerType(hardware.controller_type);
        if units.time_loop && kind == ControllerType::ET1200 {
            add(&r::RECEIVE_TIME_LATCH_MODE, hardware, rights);
        }
        if units.sync && kind == ControllerType::IP_CORE {
            add(&r::SYNC_ACTIVATION_STATUS, hardware, rights);
        }
    }
}

/// What controllers with Ethernet PHYs have.
const PHY_ACCESS: &[Register] =
    &[r::PHY_CONTROL_STATUS, r::PHY_ADDRESS, r::PHY_REGISTER_ADDRESS, r::PHY_DATA];

/// Registers that came later: since which version of the IP core, and in the ET1150.
const LATER: &[((u8, u8), &[Register])] = &[
    ((2, 0), &[r::PHY_ACCESS_ECAT, r::PHY_ACCESS_PDI, r::PHY_PORT_STATUS]),
    ((2, 2), &[r::ESC_RESET_PDI]),
    ((2, 3), &[r::RUN_LED_OVERRIDE, r::ERR_LED_OVERRIDE, r::PDI_ERROR_CODE]),
    ((4, 0), &[r::EXTENDED_RX_ERROR_COUNTER, r::RX_ERROR_CODE]),
];

/// Whether the hardware is an ET1150, or an IP core of at least this version. An IP core tells its
/// version as revision (0x0001) and the high half of the build's low byte (S2 2.1.2, 2.1.3).
fn is_since(hardware: &Hardware, version: (u8, u8)) -> bool {
    const ET1150_REVISION: u8 = 0x50;
    match ControllerType(hardware.controller_type) {
        ControllerType::ET1100 => hardware.revision == ET1150_REVISION,
        ControllerType::IP_CORE => (hardware.revision, (hardware.build as u8) >> 4) >= version,
        _ => false,
    }
}

/// Whether the controller has extended receive error counters and codes (0x0314, 0x0320).
pub(super) fn keeps_reasons(hardware: &Hardware) -> bool {
    is_since(hardware, (4, 0))
}

/// Whether the controller reads the link from its PHYs' registers, and shows it at 0x0518.
pub(super) fn watches_links_by_phy(hardware: &Hardware) -> bool {
    is_since(hardware, (2, 0)) && hardware.ports.0.contains(&PortKind::Mii)
}

/// Whether SII word 5 goes to 0x0142.
pub(super) fn has_configuration_a5(hardware: &Hardware) -> bool {
    matches!(
        ControllerType(hardware.controller_type),
        ControllerType::ET1100 | ControllerType::ET1200
    )
}

fn add(register: &Register, hardware: &Hardware, rights: &mut [u8]) {
    let among = |list: &[Register]| list.iter().any(|other| other.address == register.address);
    let (live, conditional) = (among(LIVE), among(CONDITIONAL));
    for index in (0..register.count()).filter(|index| has_member(register, *index, hardware)) {
        let Some(address) = register.at(index) else { continue };
        for offset in 0..width(register, hardware) {
            let access = register.ecat_access(offset);
            let mut byte = 0;
            if access.reads() {
                byte |= Rights::READ;
            }
            if access.writes() {
                byte |= Rights::WRITE;
                if conditional && access == Access::ReadWriteIf {
                    byte |= Rights::CONDITIONAL;
                }
                if live || access == Access::ReadClear {
                    byte |= Rights::LIVE;
                }
            }
            rights[usize::from(address.0 + offset)] |= byte;
        }
    }
}

/// Whether the hardware has this member of a family.
fn has_member(register: &Register, index: u16, hardware: &Hardware) -> bool {
    match register.repeat.map(|repeat| repeat.unit) {
        None => true,
        Some(Unit::Fmmu) => index < u16::from(hardware.fmmus),
        Some(Unit::SyncManager) => index < u16::from(hardware.sync_managers),
        // Receive times are read for all four, whatever is in them.
        Some(Unit::Port) if register.address == r::RECEIVE_TIME.address => true,
        Some(Unit::Port) => hardware.ports.0[usize::from(index)] != PortKind::Absent,
    }
}

/// Bytes of the register: clocks of 32 bits have the low half of long times only.
fn width(register: &Register, hardware: &Hardware) -> u16 {
    let long_time = LONG_TIMES.iter().any(|other| other.address == register.address);
    if long_time && !Features(hardware.features).clock_64_bit() { 4 } else { register.len }
}

#[cfg(test)]
mod tests {
    use super::super::tests::rig;
    use super::*;

    const ALL_UNITS: ClockUnits = ClockUnits { time_loop: true, sync: true, latch: true };
    const LOOP: ClockUnits = ClockUnits { time_loop: true, sync: false, latch: false };

    fn right(hardware: &Hardware, address: usize) -> u8 {
        Rights::of(hardware, ALL_UNITS).byte(address)
    }

    // proves: HW-29 partial
    #[test]
    fn registers_come_with_the_hardware() {
        let full = rig::hardware();
        assert_eq!(right(&full, 0x0000), Rights::READ);
        assert_eq!(right(&full, 0x0010), Rights::READ | Rights::WRITE);
        assert_eq!(right(&full, 0x0300), Rights::READ | Rights::WRITE | Rights::LIVE);
        assert_eq!(right(&full, 0x000A), 0, "reserved");
        assert_ne!(right(&full, 0x0510), 0);
        assert_eq!(right(&full, 0x0518), 0, "an ET1100");
        assert_eq!(right(&full, 0x092C), Rights::READ, "the difference cannot be written");
        assert_eq!(right(&full, 0x0984), 0, "not in an ET1100");
        assert_eq!(right(&full, 0x0936), 0, "an ET1200 has it");
        for gone in [0x0980, 0x0981, 0x0990, 0x09AE] {
            assert_ne!(right(&full, gone), 0, "0x{gone:04X}");
            assert_eq!(Rights::of(&full, LOOP).byte(gone), 0, "0x{gone:04X}: its unit is off");
        }

        let mut small = full.clone();
        small.counting.forwarded = false;
        small.ports.0[0] = PortKind::Ebus;
        small.ports.0[2] = PortKind::Absent;
        small.ports.0[3] = PortKind::Absent;
        small.fmmus = 3;
        small.sync_managers = 4;
        small.features = 0;
        for gone in [0x0510, 0x0308, 0x0304, 0x0307, 0x0312, 0x0630, 0x0820, 0x0900, 0x0910] {
            assert_ne!(right(&full, gone), 0, "0x{gone:04X}");
            assert_eq!(right(&small, gone), 0, "0x{gone:04X}");
        }
        assert_ne!(
            Rights::of(&full, ClockUnits::default()).byte(0x090C),
            0,
            "receive times are always there"
        );
        assert_eq!(
            Rights::of(&full, ClockUnits::default()).byte(0x0910),
            0,
            "the time loop is switched off"
        );
        small.features = 0x0004;
        assert_ne!(right(&small, 0x0913), 0);
        assert_eq!(right(&small, 0x0914), 0, "a 32-bit clock");
        assert_ne!(right(&full, 0x0917), 0);
    }

    #[test]
    fn a_sync_manager_is_written_by_its_rules() {
        let rights = Rights::of(&rig::hardware(), ALL_UNITS);
        let both = Rights::READ | Rights::WRITE;
        for offset in 0..5 {
            assert_eq!(rights.byte(0x0810 + offset), both | Rights::CONDITIONAL);
        }
        assert_eq!(rights.byte(0x0815), Rights::READ, "status");
        assert_eq!(rights.byte(0x0816), both, "activate");
        assert_eq!(rights.byte(0x0817), Rights::READ, "PDI control");
    }
}
