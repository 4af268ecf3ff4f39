//! State word of the network as a program sees it: bring-up, a lock after a link error, and its reset.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on fails")]

use linesman::prelude::*;
use linesman::{FaultEntry, FaultName, NetworkState};
use linesman_config::project::Project;

const DEVICES: [(&str, &str); 3] = [("K1", "EK1100"), ("Lamps", "EL2008"), ("Buttons", "EL1008")];
const LOCKED_IN_SAFEOP: u16 = NetworkState::LOCKED | NetworkState::SOME_SAFEOP;

/// A line whose only link is open from the second second to the third, and its plan.
fn machine(locks: bool) -> (Segment, Plan) {
    let mut segment = Segment::simulated(&SegmentFile::in_a_row("machine", 1, &DEVICES)).unwrap();
    let mut project = Project::from_inventory("machine", segment.scan().unwrap().inventory());
    project.network.lock_after_link_error = locks;
    // So that the plan is made of the project in both cases.
    project.network.sync_window_ns = Some(500);
    let name = format!("linesman-word-{}-{locks}.toml", std::process::id());
    let path = std::env::temp_dir().join(name);
    std::fs::write(&path, project.to_toml()).unwrap();
    let plan = segment.load(&path);
    std::fs::remove_file(&path).unwrap();
    let open = FaultEntry::new(FaultName::LinkOpen).at("maindevice-K1.A");
    segment.inject(&open.from_to(2_000.0, Some(3_000.0))).unwrap();
    (segment, plan.unwrap())
}

/// A word, and how many cycles in a row had it.
type Words = Vec<(u16, u32)>;

/// Words of a run of so many cycles, in which the network is reset at this one; and whether outputs were withheld at its end.
fn words(locks: bool, reset_at: u32, cycles: u32) -> (Words, bool) {
    let (mut segment, plan) = machine(locks);
    let lamp: Output<bool> = plan.output("EL2008/1").unwrap();
    let mut seen: Words = Vec::new();
    let (mut cycle, mut withheld) = (0, false);
    segment
        .run(plan, RunOptions::us(1_000), |io| {
            let word = io.network_state().0;
            match seen.last_mut() {
                Some((last, count)) if *last == word => *count += 1,
                _ => seen.push((word, 1)),
            }
            io.set(lamp, cycle % 2 == 0);
            withheld = io.frame_status(0, 0).is_some_and(|frame| frame.not_sent != 0);
            cycle += 1;
            if cycle == reset_at {
                io.reset();
            }
            if cycle < cycles { Next::Continue } else { Next::Stop }
        })
        .unwrap();
    (seen, withheld)
}

// S0 L2573-2593. What a ring, a late application and clocks add is asserted where those are tested.
// proves: PLC-07
#[test]
fn outputs_are_locked_after_a_link_error_until_the_network_is_reset() {
    let (seen, withheld) = words(true, 8_000, 7_500);
    assert!(withheld, "outputs are withheld while it is locked: {seen:x?}");
    assert_eq!(seen.last().unwrap().0, LOCKED_IN_SAFEOP, "{seen:x?}");
    assert!(seen.last().unwrap().1 > 1_000, "nothing goes on by itself: {seen:x?}");
    let (seen, withheld) = words(true, 8_000, 10_000);
    assert!(!withheld, "{seen:x?}");
    let up = seen.iter().position(|(word, _)| *word == 0).unwrap();
    // Bring-up: a reset is under way from the first cycle until all are in OP.
    assert!(up > 0 && seen[..up].iter().all(|(word, _)| word & NetworkState::RESET != 0));
    let after = &seen[up + 1..];
    let link_error = NetworkState::LINK_ERROR | NetworkState::LOCKED;
    assert!(after[0].0 & link_error == link_error, "{seen:x?}");
    let back = after.iter().find(|(word, _)| word & NetworkState::LINK_ERROR == 0).unwrap();
    assert!(back.0 & NetworkState::LOCKED != 0, "{seen:x?}");
    let waits = after.iter().position(|(word, _)| *word == LOCKED_IN_SAFEOP).unwrap();
    let reset = &after[waits + 1..];
    assert!(reset.iter().all(|(word, _)| word & NetworkState::LOCKED == 0), "{seen:x?}");
    assert!(reset[0].0 & NetworkState::RESET != 0, "{seen:x?}");
    assert_eq!(reset.last().unwrap().0, 0, "{seen:x?}");
}

#[test]
fn network_goes_on_by_itself_after_a_link_error_unless_a_lock_is_chosen() {
    let (seen, withheld) = words(false, 9_000, 8_000);
    assert!(seen.iter().any(|(word, _)| word & NetworkState::LINK_ERROR != 0), "{seen:x?}");
    assert!(seen.iter().all(|(word, _)| word & NetworkState::LOCKED == 0), "{seen:x?}");
    assert!(!withheld && seen.last().unwrap().0 == 0, "{seen:x?}");
}
