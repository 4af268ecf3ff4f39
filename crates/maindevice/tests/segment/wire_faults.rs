//! Faults on the wire, 2,000 cycles each: exactly the faulty cycles are bad, what is doubled or stray
//! costs none, each kind is counted under its own name, and the MainDevice runs on.

use linesman_maindevice::{Options, Statistics};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use crate::bench::{Bench, Fate};

const PLANT: &str = r#"
name = "two"
seed = 3
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "T2"
type = "EL2004"
on = "T1.B"
"#;

const CYCLES: u64 = 2_000;

/// What 2,000 cycles with a fault have counted, and how many cycles were bad.
struct Tally {
    counted: Statistics,
    bad: u64,
}

/// Every `every`th cyclic frame suffers `fate` on its way back.
fn run(every: u64, fate: Fate) -> Tally {
    // Nothing but the cycle, so that every frame is a cycle's.
    let quiet = Span::s(1_000);
    let options = Options { watch_interval: quiet, mailbox_interval: quiet, ..Options::default() };
    let mut bench = Bench::with_options(PLANT, options);
    let plan = bench.start(AlState::Op);
    let sensor = plan.device(bench.id("T1")).unwrap().id;
    bench.run_for(Span::ms(300));
    let before = bench.device.statistics();
    let mut number = 0;
    bench.tamper = Some(Box::new(move |_| {
        number += 1;
        if number % every == 0 { fate } else { Fate::Arrives }
    }));
    bench.device.take_exchanged(0);
    bench.judged = Some(sensor);
    bench.run_for(Span::ms(1) * CYCLES);
    bench.judged = None;
    let bad = bench.bad_cycles;
    assert!(bench.cycles.abs_diff(CYCLES) <= 1, "{fate:?}: {} cycles were judged", bench.cycles);
    bench.tamper = None;
    bench.run_for(Span::ms(100));
    assert!(bench.device.is_settled(), "{fate:?}: it runs on");
    assert!(bench.device.quality(sensor).valid, "{fate:?}: and recovers");
    assert_eq!(bench.state("T2"), "OP", "{fate:?}");
    let after = bench.device.statistics();
    let counted = Statistics {
        frames_lost: after.frames_lost - before.frames_lost,
        frames_late: after.frames_late - before.frames_late,
        frames_duplicate: after.frames_duplicate - before.frames_duplicate,
        frames_stray: after.frames_stray - before.frames_stray,
        frames_truncated: after.frames_truncated - before.frames_truncated,
        frames_foreign: after.frames_foreign - before.frames_foreign,
        working_counter_errors: after.working_counter_errors - before.working_counter_errors,
        ..Statistics::default()
    };
    Tally { counted, bad }
}

/// Exactly so many, but for the one at the begin or at the end.
fn about(number: u64, expected: u64) -> bool {
    number.abs_diff(expected) <= 1
}

#[test]
fn doubled_frames_cost_nothing_and_are_counted() {
    let Tally { counted, bad } = run(50, Fate::Doubled);
    assert_eq!(bad, 0);
    assert!(about(counted.frames_duplicate, 40), "{counted:?}");
    let rest = Statistics { frames_duplicate: 0, ..counted };
    assert_eq!(rest, Statistics::default(), "nothing else is counted");
}

#[test]
fn frames_with_an_unknown_index_cost_nothing_and_are_counted() {
    let Tally { counted, bad } = run(50, Fate::Accompanied);
    assert_eq!(bad, 0);
    assert!(about(counted.frames_stray, 40), "{counted:?}");
    let rest = Statistics { frames_stray: 0, ..counted };
    assert_eq!(rest, Statistics::default());
}

#[test]
fn truncated_frames_cost_their_cycle_and_are_counted() {
    let Tally { counted, bad } = run(50, Fate::Truncated(30));
    assert!(about(bad, 40), "{bad} bad cycles");
    assert!(about(counted.frames_truncated, 40), "{counted:?}");
    let rest = Statistics { frames_truncated: 0, ..counted };
    assert_eq!(rest, Statistics::default(), "they are not lost as well");
}

#[test]
fn lost_frames_cost_their_cycle_and_are_counted() {
    let Tally { counted, bad } = run(50, Fate::Lost);
    assert!(about(bad, 40), "{bad} bad cycles");
    assert!(about(counted.frames_lost, 40), "{counted:?}");
    let rest = Statistics { frames_lost: 0, ..counted };
    assert_eq!(rest, Statistics::default());
}

#[test]
fn late_frames_cost_their_cycle_and_are_counted() {
    let Tally { counted, bad } = run(500, Fate::Late(Span::ms(10)));
    assert!(about(bad, 4), "{bad} bad cycles");
    assert!(about(counted.frames_late, 4), "{counted:?}");
    assert_eq!(counted.frames_lost, counted.frames_late, "given up at first");
    let rest = Statistics { frames_late: 0, frames_lost: 0, ..counted };
    assert_eq!(rest, Statistics::default());
}
