//! Information of each SubDevice for programs, as the vendor's tool puts it beside the process data (`InfoData`).
//!
//! A calculation from the plan: addresses by which other programs reach the SubDevice, its drive channels, and the
//! times by which a program compensates the dead time of its process data. Its state is no part of it: that changes
//! while the network runs ([`linesman_proto::state::DeviceState`]).
//!
//! Reference: seed S1 L116-123; Beckhoff Information System, Tc3 I/O, EtherCAT SubDevice, "General Behavior", and TF5065,
//! "Dead time compensation".

use linesman_proto::ads::{AmsAddress, AmsNetId};
use linesman_proto::sii::{Direction, Protocols};
use linesman_proto::time::Span;

use super::shift::signed;
use super::{DevicePlan, Plan};
use crate::profile::DeviceProfile;

/// Controlword of the first axis of a drive (CiA 402).
const CONTROLWORD: u16 = 0x6040;
/// Distance between the objects of two axes (ETG.6010).
const AXIS_OBJECTS: u16 = 0x800;
/// Axes of CiA 402 that have room between 0x6000 and 0x9FFF, and drives that an SoE message can address.
const MAX_CHANNELS: u8 = 8;
/// First object of the configuration of a SubDevice in the dictionary of a MainDevice, and how many there are
/// (ETG.1510).
const CONFIGURATION: u16 = 0x8000;
const CONFIGURATIONS: usize = 0x1000;

/// Information of a SubDevice.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct InfoData {
    /// Address of the SubDevice for programs that speak ADS: the NetId of the network, and its station address as port.
    /// `None`: no NetId is given.
    pub ads_address: Option<AmsAddress>,
    /// NetId of the SubDevice itself, by which messages by AoE are addressed: the one that its configuration gives it, else
    /// a proposal. `None`: it does not speak AoE, or no NetId is given.
    pub aoe_net_id: Option<AmsNetId>,
    /// Numbers of its drive channels, from 0; empty for all but drives.
    pub channels: Vec<u8>,
    /// Shift of SYNC0 against the begin of the cycle of its task, in ns. `None`: it has no SYNC0.
    pub sync0_shift_ns: Option<i64>,
    /// From the begin of the cycle, when its outputs leave, to the SYNC0 that makes them effective. `None`: it has no
    /// SYNC0, or no outputs.
    pub output_shift: Option<Span>,
    /// From the SYNC0 that takes its inputs to the begin of the cycle that fetches them. `None`: it has no SYNC0, or no
    /// inputs.
    pub input_shift: Option<Span>,
    /// Index of the object that describes it in the dictionary of the MainDevice (ETG.1510): 0x8000 for the first.
    /// `None`: there is no index left for it.
    pub object: Option<u16>,
}

impl Plan {
    /// Information of a SubDevice of this plan, in a network with this NetId.
    ///
    /// The NetId for AoE is the configured one, else that of the network with the station address in place of the last two
    /// bytes. The times leave out what the SubDevice needs itself.
    #[must_use]
    pub fn info_data(&self, device: &DevicePlan, net_id: Option<AmsNetId>) -> InfoData {
        let speaks_aoe = device.mailbox.is_some_and(|one| one.protocols.has(Protocols::AOE));
        let own_net_id = |net_id: AmsNetId| {
            let own = net_id.of_sub_device(device.station);
            (own != net_id && speaks_aoe).then_some(own)
        };
        let shifts = self.dead_times(device);
        InfoData {
            ads_address: net_id.map(|net_id| AmsAddress { net_id, port: device.station.0 }),
            aoe_net_id: device.net_id().or_else(|| net_id.and_then(own_net_id)),
            channels: device.channels.clone(),
            sync0_shift_ns: shifts.is_some().then(|| self.sync0_shift_ns(device)),
            output_shift: shifts.map(|one| one.0).filter(|_| !device.outputs.is_empty()),
            input_shift: shifts.map(|one| one.1).filter(|_| !device.inputs.is_empty()),
            object: configuration_object(device.id.index()),
        }
    }

    /// From the begin of the cycle to SYNC0, and from SYNC0 to the begin of the next one.
    fn dead_times(&self, device: &DevicePlan) -> Option<(Span, Span)> {
        let clock = device.settings.clock.filter(|clock| clock.sync0())?;
        let task = self.clocked_task(device)?;
        // Where SYNC0 comes several times in a cycle, the first one makes the outputs effective and the last one takes
        // the inputs; where it comes in every n-th cycle only, the frames around it count.
        let period = match clock.sync0_cycle {
            Span::ZERO => task.cycle,
            sync0_cycle => sync0_cycle.min(task.cycle),
        };
        let after = self.sync0_shift_ns(device).checked_rem_euclid(signed(period))?;
        let after = Span::ns(after.unsigned_abs());
        Some((after, period.saturating_sub(after)))
    }
}

/// Index of the object that describes the SubDevice at this place of the plan, counted from 0, in the dictionary of the
/// MainDevice (ETG.1510).
#[must_use]
pub fn configuration_object(place: usize) -> Option<u16> {
    let place = u16::try_from(place).ok().filter(|_| place < CONFIGURATIONS)?;
    Some(CONFIGURATION + place)
}

/// Numbers of the drive channels of a SubDevice: as many as its description states, else those that its protocols and
/// PDOs show.
pub(super) fn drive_channels(profile: &DeviceProfile) -> Vec<u8> {
    let stated = profile.drive_channels.min(MAX_CHANNELS);
    let speaks_soe = profile.mailbox.is_some_and(|one| one.protocols.has(Protocols::SOE));
    if stated > 0 || speaks_soe {
        return (0..stated.max(1)).collect();
    }
    let has_controlword = |axis: &u8| {
        let index = CONTROLWORD + AXIS_OBJECTS * u16::from(*axis);
        let outputs = profile.pdos.iter().filter(|pdo| pdo.direction == Direction::Outputs);
        outputs.flat_map(|pdo| &pdo.entries).any(|entry| entry.index == index)
    };
    // Without a first axis 0x7040 is an output of the fifth channel of a terminal (ETG.5001).
    (0..MAX_CHANNELS).take_while(has_controlword).collect()
}

#[cfg(test)]
mod tests {
    use linesman_proto::address::{Path, RegisterAddress, StationAddress};
    use linesman_proto::port::Port;
    use linesman_proto::register::SmControl;
    use linesman_proto::sii::{Identity, MailboxPair};
    use linesman_proto::state::AlState;
    use linesman_proto::topology::{End, Tree, Wired};
    use proptest::prelude::*;

    use super::*;
    use crate::identity::RevisionRule;
    use crate::plan::{ClockSettings, DeviceSettings, PlanOptions, PlannedDevice};
    use crate::profile::{Mailbox, MappedEntry, MappedPdo, ProcessSyncManager};

    const NET_ID: AmsNetId = AmsNetId([169, 254, 215, 231, 2, 1]);

    /// A SubDevice with this station address that speaks these protocols.
    fn planned(station: u16, protocols: u16) -> PlannedDevice {
        let mailbox = Mailbox {
            areas: MailboxPair::default(),
            bootstrap: None,
            protocols: Protocols(protocols),
            complete_access: false,
        };
        PlannedDevice {
            name: format!("{station:04X}"),
            station: StationAddress(station),
            identity: Identity::default(),
            revision_rule: RevisionRule::Any,
            profile: DeviceProfile {
                mailbox: Some(mailbox).filter(|_| protocols != 0),
                ..DeviceProfile::default()
            },
            target: AlState::Op,
            start_up: Vec::new(),
            settings: DeviceSettings::default(),
        }
    }

    fn process(index: u8, direction: Direction) -> ProcessSyncManager {
        let start = RegisterAddress(0x1000 + 0x100 * u16::from(index));
        let control = SmControl::OUTPUTS;
        ProcessSyncManager { index, direction, start, len: 4, control, is_virtual: false, bits: 0 }
    }

    fn clock(sync0_cycle: Span, sync0_shift_ns: i64) -> Option<ClockSettings> {
        Some(ClockSettings {
            assign_activate: 0x0300,
            sync0_cycle,
            sync0_shift_ns,
            ..ClockSettings::default()
        })
    }

    fn plan(devices: &[PlannedDevice], cycle: Span) -> Plan {
        let wired = (0..devices.len()).map(|node| Wired {
            on: match node.checked_sub(1) {
                Some(before) => End::Controller(before, Port::B),
                None => End::MainDevice(Path::A),
            },
            entry: Port::A,
        });
        let tree = Tree::from_wiring(&wired.collect::<Vec<_>>(), None).unwrap();
        let options = PlanOptions { cycle, clock_datagrams: true, ..PlanOptions::default() };
        Plan::build(devices, tree, &options).unwrap()
    }

    fn of(plan: &Plan, place: usize, net_id: Option<AmsNetId>) -> InfoData {
        plan.info_data(&plan.devices[place], net_id)
    }

    // proves: PLC-09 (U)
    #[test]
    fn subdevices_of_a_plan_have_addresses_channels_shifts_and_objects() {
        let coupler = planned(0x1001, 0);
        let mut terminal = planned(0x1002, Protocols::COE | Protocols::AOE);
        terminal.profile.process = vec![process(3, Direction::Inputs)];
        terminal.settings.clock = clock(Span::ms(2), 0);
        let mut drive = planned(0x0201, Protocols::SOE | Protocols::FOE);
        drive.profile.drive_channels = 2;
        drive.profile.process = vec![process(2, Direction::Outputs), process(3, Direction::Inputs)];
        drive.settings.clock = clock(Span::ms(2), 25_000);
        let plan = plan(&[coupler, terminal, drive], Span::ms(2));

        let coupler = of(&plan, 0, Some(NET_ID));
        let address = |port| Some(AmsAddress { net_id: NET_ID, port });
        let expected =
            InfoData { ads_address: address(0x1001), object: Some(0x8000), ..InfoData::default() };
        assert_eq!(coupler, expected, "no mailbox, no process data, no clock");

        // SYNC0 of a SubDevice with inputs only comes 10 % of the cycle before the next frames (SYN-11).
        let terminal = of(&plan, 1, Some(NET_ID));
        let expected = InfoData {
            ads_address: address(0x1002),
            aoe_net_id: Some(AmsNetId([169, 254, 215, 231, 0x10, 0x02])),
            channels: Vec::new(),
            sync0_shift_ns: Some(-200_000),
            output_shift: None,
            input_shift: Some(Span::us(200)),
            object: Some(0x8001),
        };
        assert_eq!(terminal, expected);

        // 30 % of the cycle behind the frames, and 25 µs of its own (SYN-10, SYN-11).
        let drive = of(&plan, 2, Some(NET_ID));
        let expected = InfoData {
            ads_address: address(0x0201),
            aoe_net_id: None,
            channels: vec![0, 1],
            sync0_shift_ns: Some(625_000),
            output_shift: Some(Span::us(625)),
            input_shift: Some(Span::us(1_375)),
            object: Some(0x8002),
        };
        assert_eq!(drive, expected);
        let without = of(&plan, 1, None);
        assert_eq!((without.ads_address, without.aoe_net_id), (None, None));
        assert_eq!(
            without.input_shift,
            Some(Span::us(200)),
            "addresses are needed for addresses only"
        );
    }

    #[test]
    fn net_id_for_aoe_is_never_that_of_the_network() {
        // 0x0201 is 2.1, the end of the MainDevice's own NetId.
        let plan =
            plan(&[planned(0x0201, Protocols::AOE), planned(0x0202, Protocols::AOE)], Span::ms(1));
        assert_eq!(of(&plan, 0, Some(NET_ID)).aoe_net_id, None);
        assert_eq!(
            of(&plan, 1, Some(NET_ID)).aoe_net_id.unwrap().to_string(),
            "169.254.215.231.2.2"
        );
    }

    #[test]
    fn shifts_count_to_the_nearest_sync0_where_it_has_another_cycle_than_the_task() {
        let shifts = |sync0_cycle, own| {
            let mut drive = planned(0x1001, Protocols::COE);
            drive.profile.process =
                vec![process(2, Direction::Outputs), process(3, Direction::Inputs)];
            drive.settings.clock = clock(sync0_cycle, own);
            let plan = plan(&[drive], Span::ms(1));
            let info = of(&plan, 0, None);
            (info.output_shift.unwrap(), info.input_shift.unwrap())
        };
        assert_eq!(shifts(Span::us(250), 0), (Span::us(75), Span::us(175)), "four times a cycle");
        assert_eq!(shifts(Span::ms(4), 0), (Span::us(300), Span::us(700)), "every fourth cycle");
        assert_eq!(
            shifts(Span::ms(1), -400_000),
            (Span::us(900), Span::us(100)),
            "before the frames"
        );
        assert_eq!(shifts(Span::ms(1), -300_000), (Span::ZERO, Span::ms(1)), "with the frames");
    }

    #[test]
    fn drive_channels_are_those_stated_else_those_of_protocols_and_controlwords() {
        let pdo = |direction, objects: &[u16]| MappedPdo {
            sync_manager: 2,
            direction,
            index: 0x1600,
            name: String::new(),
            entries: objects
                .iter()
                .map(|index| MappedEntry {
                    index: *index,
                    subindex: 0,
                    bits: 16,
                    name: String::new(),
                    data_type: "UINT".to_owned(),
                })
                .collect(),
        };
        let channels = |protocols, stated, pdos: Vec<MappedPdo>| {
            let mut profile = planned(0x1001, protocols).profile;
            profile.drive_channels = stated;
            profile.pdos = pdos;
            drive_channels(&profile)
        };
        let (outputs, inputs) = (Direction::Outputs, Direction::Inputs);
        assert_eq!(channels(Protocols::COE, 0, vec![pdo(outputs, &[0x7000])]), [0_u8; 0]);
        let terminal = pdo(outputs, &[0x7000, 0x7010, 0x7020, 0x7030, 0x7040]);
        assert_eq!(channels(Protocols::COE, 0, vec![terminal]), [0_u8; 0], "digital outputs");
        assert_eq!(channels(Protocols::COE, 0, vec![pdo(outputs, &[0x6040, 0x607A])]), [0]);
        assert_eq!(channels(Protocols::COE, 0, vec![pdo(outputs, &[0x6840, 0x6040])]), [0, 1]);
        assert_eq!(
            channels(Protocols::COE, 0, vec![pdo(inputs, &[0x6040])]),
            [0_u8; 0],
            "read back"
        );
        assert_eq!(channels(Protocols::COE, 3, vec![pdo(outputs, &[0x6040])]), [0, 1, 2], "stated");
        assert_eq!(channels(Protocols::SOE, 0, vec![]), [0], "a drive has one at least");
        assert_eq!(
            channels(Protocols::SOE, 255, vec![]).len(),
            8,
            "as many as a message can address"
        );
    }

    proptest! {
        // Output and input shift make a whole cycle, whatever the shift.
        #[test]
        fn shifts_of_both_directions_add_up_to_the_cycle(own in -10_000_000_i64..10_000_000) {
            let mut drive = planned(0x1001, Protocols::COE);
            drive.profile.process = vec![process(2, Direction::Outputs), process(3, Direction::Inputs)];
            drive.settings.clock = clock(Span::ms(2), own);
            let plan = plan(&[drive], Span::ms(2));
            let info = of(&plan, 0, None);
            let (output, input) = (info.output_shift.unwrap(), info.input_shift.unwrap());
            prop_assert_eq!(output + input, Span::ms(2));
            let shift = info.sync0_shift_ns.unwrap();
            prop_assert_eq!(shift.rem_euclid(2_000_000).unsigned_abs(), output.as_nanos());
        }
    }

    #[test]
    fn objects_end_with_the_range_of_the_specification() {
        assert_eq!(configuration_object(0xFFF), Some(0x8FFF));
        assert_eq!(configuration_object(0x1000), None);
        assert_eq!(configuration_object(usize::MAX), None);
    }
}
