use linesman_config::plan::expect::Presence;
use linesman_proto::address::{DeviceId, WorkingCounter};
use linesman_proto::state::AlState;

use super::device_table::DeviceTable;
use super::*;

fn device_table(devices: usize) -> DeviceTable {
    let tree = linesman_proto::topology::derive(&[]).unwrap();
    let device = |id| linesman_config::plan::DevicePlan {
        revision_rule: linesman_config::identity::RevisionRule::Any,
        device_emulation: true,
        ..linesman_config::plan::DevicePlan::bare(DeviceId(id))
    };
    let devices = (0..devices as u32).map(device).collect();
    DeviceTable::new(&Plan { devices, ..Plan::empty(tree) })
}

#[test]
fn lost_subdevice_serves_nothing() {
    let mut device_table = device_table(2);
    let id = DeviceId(1);
    device_table.set_found(id, Reachability::There { restarted: true });
    device_table.set_reached(id, AlState::Op);
    let (mut presence, mut most) = (Presence::none(2), Presence::none(2));
    device_table.take_changes(&mut presence, &mut most);
    assert!(presence.of(id).inputs && presence.of(id).outputs);
    assert!(!presence.of(DeviceId(0)).inputs);
    let before = device_table.version();
    assert_eq!(
        device_table.set_found(id, Reachability::Lost),
        Reachability::There { restarted: true }
    );
    assert_ne!(device_table.version(), before);
    device_table.take_changes(&mut presence, &mut most);
    assert_eq!((presence.of(id).reached_by, most.of(id).inputs), (None, false));
    assert!(!device_table.has_reached(id));
}

#[test]
fn on_the_way_there_is_a_mailbox_and_perhaps_process_data() {
    let mut device_table = device_table(1);
    let id = DeviceId(0);
    device_table.set_found(id, Reachability::There { restarted: true });
    device_table.set_moving(id, Some(AlState::PreOp));
    let (mut least, mut most) = (Presence::none(1), Presence::none(1));
    device_table.take_changes(&mut least, &mut most);
    assert!(device_table.has_mailbox(id) && !least.of(id).inputs && most.of(id).inputs);
}

#[test]
fn only_changes_of_the_broadcast_are_alerts() {
    let mut device_table = device_table(2);
    let states = |byte| AlState::from_or(byte);
    assert_eq!(device_table.broadcast(WorkingCounter(2), states(8)), None);
    assert_eq!(device_table.broadcast(WorkingCounter(2), states(8)), None);
    assert_eq!(device_table.alerts(), 0);
    assert_eq!(device_table.broadcast(WorkingCounter(1), states(8)), Some(WorkingCounter(2)));
    assert_eq!(device_table.alerts(), 1);
    assert_eq!(device_table.broadcast(WorkingCounter(1), states(0x1C)), None);
    assert_eq!(device_table.alerts(), 2);
}
