//! Layouts by hand and by chance.

use super::super::{DeviceSettings, PathView, Presence, expect};
use super::*;
use crate::identity::RevisionRule;
use crate::profile::DeviceProfile;
use linesman_proto::address::RegisterAddress;
use linesman_proto::address::{Path, StationAddress, WorkingCounter};
use linesman_proto::port::Port;
use linesman_proto::register::SmControl;
use linesman_proto::sii::Identity;
use linesman_proto::state::AlState;
use linesman_proto::topology::{End, Wired};
use proptest::prelude::*;

fn manager(index: u8, direction: Direction, start: u16, len: u16) -> ProcessSyncManager {
    let control = SmControl(0x20);
    let (start, is_virtual) = (RegisterAddress(start), false);
    ProcessSyncManager { index, direction, start, len, control, is_virtual, bits: 0 }
}

fn planned(process: Vec<ProcessSyncManager>, no_lrw: bool) -> PlannedDevice {
    PlannedDevice {
        name: format!("{} managers", process.len()),
        station: StationAddress(0x1001),
        identity: Identity::default(),
        revision_rule: RevisionRule::Equal,
        profile: DeviceProfile { process, no_lrw, ..DeviceProfile::default() },
        target: AlState::Op,
        start_up: Vec::new(),
        settings: DeviceSettings::default(),
    }
}

fn line(len: usize) -> Tree {
    let wired = (0..len).map(|node| Wired {
        on: match node.checked_sub(1) {
            Some(before) => End::Controller(before, Port::B),
            None => End::MainDevice(Path::A),
        },
        entry: Port::A,
    });
    Tree::from_wiring(&wired.collect::<Vec<_>>(), None).unwrap()
}

#[test]
fn outputs_first_then_inputs_in_one_lrw() {
    let devices = [
        planned(vec![], false),
        planned(vec![manager(0, Direction::Outputs, 0x0F00, 1)], false),
        planned(
            vec![
                manager(2, Direction::Outputs, 0x1100, 8),
                manager(3, Direction::Inputs, 0x1180, 6),
            ],
            false,
        ),
    ];
    let plan = Plan::build(&devices, line(3), &PlanOptions::default()).unwrap();
    assert_eq!((plan.outputs_len, plan.inputs_len), (9, 6));
    let [frame] = plan.tasks[0].frames.as_slice() else { panic!("one frame") };
    let [process, monitor] = frame.datagrams.as_slice() else { panic!("two datagrams") };
    assert_eq!((process.command, process.len), (Command::Lrw, 15));
    assert_eq!(monitor.command, Command::Brd);
    let wkc = expect::expect(process, &Presence::full(3), PathView::Merged);
    assert_eq!(wkc, WorkingCounter(2 + 3));
    let fmmu = plan.devices[2].fmmus[1].1;
    assert_eq!(fmmu.logical_start, LogicalAddress(LOGICAL_START.0 + 9));
    assert_eq!(plan.devices[2].inputs, 0..6);
    assert_eq!(plan.devices[2].outputs, 1..9);
}

#[test]
fn neighbouring_byte_buffers_share_an_fmmu() {
    let managers =
        vec![manager(0, Direction::Outputs, 0x0F00, 1), manager(1, Direction::Outputs, 0x0F01, 1)];
    let plan = Plan::build(&[planned(managers, false)], line(1), &PlanOptions::default()).unwrap();
    assert_eq!(plan.devices[0].fmmus.len(), 1);
    assert_eq!(plan.devices[0].fmmus[0].1.length, 2);
    assert_eq!(plan.devices[0].sync_managers.len(), 2);
}

// proves: FRM-26
#[test]
fn a_device_without_lrw_gets_lwr_and_lrd() {
    let both = || {
        vec![manager(2, Direction::Outputs, 0x1100, 4), manager(3, Direction::Inputs, 0x1180, 4)]
    };
    let devices = [planned(both(), true), planned(both(), false)];
    let plan = Plan::build(&devices, line(2), &PlanOptions::default()).unwrap();
    let commands: Vec<(Command, u16)> = plan
        .datagrams()
        .map(|(_, _, datagram)| {
            let wkc = expect::expect(datagram, &Presence::full(2), PathView::Merged);
            (datagram.command, wkc.0)
        })
        .collect();
    let expected = [(Command::Lwr, 1), (Command::Lrd, 1), (Command::Lrw, 3), (Command::Brd, 2)];
    assert_eq!(commands, expected);
}

#[test]
fn process_data_longer_than_a_datagram_are_refused() {
    let devices = [planned(vec![manager(2, Direction::Outputs, 0x1100, 1_487)], false)];
    let error = Plan::build(&devices, line(1), &PlanOptions::default()).unwrap_err();
    assert!(matches!(error, PlanError::TooMuchProcessData { len: 1_487, .. }));
    let error = Plan::build(&devices, line(2), &PlanOptions::default()).unwrap_err();
    assert_eq!(error, PlanError::WiringDiffers { wired: 2, planned: 1 });
}

proptest! {
    #[test]
    fn nothing_overlaps_and_everything_is_mapped(
        sizes in prop::collection::vec((0u16..300, 0u16..300, any::<bool>()), 1..60)
    ) {
        let devices: Vec<PlannedDevice> = sizes.iter().map(|(out, inp, no_lrw)| {
            planned(vec![
                manager(2, Direction::Outputs, 0x1100, *out),
                manager(3, Direction::Inputs, 0x1800, *inp),
            ], *no_lrw)
        }).collect();
        let plan =
            Plan::build(&devices, line(devices.len()), &PlanOptions::default()).unwrap();
        let mut logical = std::collections::BTreeMap::new();
        let (mut outputs, mut inputs) = (0, 0);
        for (_, _, datagram) in plan.datagrams() {
            prop_assert!(datagram.len <= MAX_DATAGRAM_DATA);
            let DatagramAddress::Logical(start) = datagram.address else { continue };
            let mut covered = 0;
            for owned in &datagram.ownership {
                prop_assert_eq!(owned.range.start, covered);
                covered = owned.range.end;
                for byte in owned.range.clone() {
                    let address = start.0 + byte as u32;
                    prop_assert!(logical.insert(address, owned.device).is_none());
                }
                match owned.direction {
                    Direction::Outputs => outputs += owned.range.len(),
                    Direction::Inputs => inputs += owned.range.len(),
                }
            }
            prop_assert_eq!(covered, datagram.len);
        }
        prop_assert_eq!((outputs, inputs), (plan.outputs_len, plan.inputs_len));
        for device in &plan.devices {
            for (_, fmmu) in &device.fmmus {
                for byte in 0..u32::from(fmmu.length) {
                    let owner = logical.get(&(fmmu.logical_start.0 + byte));
                    prop_assert_eq!(owner, Some(&device.id));
                }
            }
        }
        for frame in plan.tasks.iter().flat_map(|task| &task.frames) {
            prop_assert!(frame.size() <= MAX_LEN);
        }
    }
}
