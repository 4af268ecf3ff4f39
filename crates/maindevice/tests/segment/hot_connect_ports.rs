//! Hot connect groups at one port one after another, at once, and twice.

use linesman_maindevice::Event;
use linesman_proto::port::Port;
use linesman_proto::time::Span;

use crate::bench::Bench;
use crate::hot_connect::{PLANT, TOOLS, first, joined, place, plan, plug, running, story};

// proves: HC-02 (S)
#[test]
fn groups_join_one_port_one_after_another_and_all_at_once() {
    let plan = plan(PLANT, &TOOLS);
    let mut bench = running(PLANT, &plan, &["X", "Y"]);
    bench.judged = Some(bench.id("T2"));
    let groups = [("X", 0, &["X", "X1", "X2"][..]), ("Y", 1, &["Y", "Y1"])];
    for round in 0..3 {
        for (name, group, members) in groups {
            plug(&mut bench, name, Some("K2.C"));
            assert!(bench.run_until(Span::s(10), joined(group)), "{round}: {}", story(&bench));
            assert_eq!(place(&bench, group), Some((bench.id("K2"), Port::C)));
            assert_eq!(place(&bench, 1 - group), None, "{round}");
            for member in members {
                assert_eq!(bench.state(member), "OP", "{member}");
            }
            bench.segment.unplug(bench.now, name).unwrap();
            bench.run_for(Span::ms(300));
            // Its own port is free again for the next one.
            let home = if name == "X" { "J1.D" } else { "J1.B" };
            plug(&mut bench, name, Some(home));
            bench.segment.unplug(bench.now, name).unwrap();
            bench.run_for(Span::ms(300));
        }
    }
    // Both cables at the same moment.
    plug(&mut bench, "X", None);
    plug(&mut bench, "Y", None);
    bench.run_for(Span::s(6));
    for name in ["X", "X1", "X2", "Y", "Y1"] {
        assert_eq!(bench.state(name), "OP", "{name}: {}", story(&bench));
    }
    assert_eq!(bench.bad_cycles, 0);
}

/// A copy of the tool X with the same number, which the plan does not have.
const COPY: &str = r#"
[[device]]
name = "C"
type = "EK1101"
on = "K2.C"
id = 5
[[device]]
name = "C1"
type = "EL1008"
on = "C.B"
[[device]]
name = "C2"
type = "EL3104"
on = "C1.B"
"#;

#[test]
fn of_two_copies_of_a_group_the_one_that_runs_goes_on_and_no_newcomer_is_driven() {
    let plan = plan(PLANT, &TOOLS);
    let doubled = format!("{PLANT}{COPY}");
    let named = |bench: &Bench| {
        first(bench, |event| {
            let Event::IdentificationShared { id, count, .. } = event else { return None };
            Some((*id, *count))
        })
    };
    // Both from the start: which one is meant cannot be known.
    let mut bench = Bench::new(&doubled);
    bench.judged = Some(bench.id("T2"));
    bench.device.start(bench.now, plan.clone());
    bench.run_for(Span::s(8));
    assert_eq!(named(&bench), Some((bench.id("X"), 2)), "{}", story(&bench));
    for name in ["X", "X1", "X2", "C", "C1", "C2"] {
        assert_eq!(bench.state(name), "INIT", "{name}");
    }
    for name in ["K1", "T1", "Y1", "T2"] {
        assert_eq!(bench.state(name), "OP", "{name}");
    }
    // One runs, and the other one comes.
    let mut bench = running(&doubled, &plan, &["C"]);
    bench.judged = Some(bench.id("T2"));
    bench.judged_too = vec![bench.id("X1")];
    plug(&mut bench, "C", None);
    bench.run_for(Span::s(6));
    assert_eq!(named(&bench), Some((bench.id("X"), 2)), "{}", story(&bench));
    for (name, state) in [("X", "OP"), ("X2", "OP"), ("C", "INIT"), ("C1", "INIT"), ("C2", "INIT")]
    {
        assert_eq!(bench.state(name), state, "{name}");
    }
    assert_eq!(bench.bad_cycles, 0);
}
