use linesman_config::plan::expect::Presence;
use linesman_proto::address::{DeviceId, WorkingCounter};
use linesman_proto::state::AlState;

use super::line::Line;
use super::*;

fn line(devices: usize) -> Line {
    let tree = linesman_proto::topology::derive(&[]).unwrap();
    let device = |id| linesman_config::plan::DevicePlan {
        revision_rule: linesman_config::identity::RevisionRule::Any,
        device_emulation: true,
        ..linesman_config::plan::DevicePlan::bare(DeviceId(id))
    };
    let devices = (0..devices as u32).map(device).collect();
    Line::new(&Plan { devices, ..Plan::empty(tree) })
}

#[test]
fn who_is_lost_serves_nothing() {
    let mut line = line(2);
    let id = DeviceId(1);
    line.set_found(id, Found::There { restarted: true });
    line.set_reached(id, AlState::Op);
    let (mut presence, mut most) = (Presence::none(2), Presence::none(2));
    line.take_changes(&mut presence, &mut most);
    assert!(presence.of(id).inputs && presence.of(id).outputs);
    assert!(!presence.of(DeviceId(0)).inputs);
    let before = line.version();
    assert_eq!(line.set_found(id, Found::Lost), Found::There { restarted: true });
    assert_ne!(line.version(), before);
    line.take_changes(&mut presence, &mut most);
    assert_eq!((presence.of(id).reached_by, most.of(id).inputs), (None, false));
    assert!(!line.has_reached(id));
}

#[test]
fn on_the_way_there_is_a_mailbox_and_perhaps_process_data() {
    let mut line = line(1);
    let id = DeviceId(0);
    line.set_found(id, Found::There { restarted: true });
    line.set_moving(id, Some(AlState::PreOp));
    let (mut least, mut most) = (Presence::none(1), Presence::none(1));
    line.take_changes(&mut least, &mut most);
    assert!(line.has_mailbox(id) && !least.of(id).inputs && most.of(id).inputs);
}

#[test]
fn only_changes_of_the_broadcast_are_alerts() {
    let mut line = line(2);
    let states = |byte| AlState::from_or(byte);
    assert_eq!(line.broadcast(WorkingCounter(2), states(8)), None);
    assert_eq!(line.broadcast(WorkingCounter(2), states(8)), None);
    assert_eq!(line.alerts(), 0);
    assert_eq!(line.broadcast(WorkingCounter(1), states(8)), Some(WorkingCounter(2)));
    assert_eq!(line.alerts(), 1);
    assert_eq!(line.broadcast(WorkingCounter(1), states(0x1C)), None);
    assert_eq!(line.alerts(), 2);
}
