//! The frame tables of the sources, from the project files that the command line's tests read, too.

use linesman_proto::time::Span;

use super::{FramePlan, PathView, Plan, Presence, expect};
use crate::project::Project;

macro_rules! plan {
    ($file:literal) => {
        plan(include_str!(concat!("../../../cli/tests/data/plan/", $file)))
    };
}

fn plan(text: &str) -> Plan {
    Project::parse(text).unwrap().plan(&mut |_| Ok(None)).unwrap()
}

fn frames(plan: &Plan) -> Vec<(&FramePlan, Span)> {
    let tasks = plan.tasks.iter();
    tasks.flat_map(|task| task.frames.iter().map(|frame| (frame, task.cycle))).collect()
}

/// A row: command, length, and the working counter where it is judged.
fn rows(plan: &Plan, frame: &FramePlan) -> Vec<(String, usize, Option<u16>)> {
    let present = Presence::full(plan.devices.len());
    let counter = |datagram| expect::expect(datagram, &present, PathView::Merged).0;
    let datagrams = frame.datagrams.iter();
    datagrams
        .map(|one| {
            let judged = one.role.is_judged().then(|| counter(one));
            (one.command.name().to_owned(), one.len, judged)
        })
        .collect()
}

// proves: FRM-12 partial: the same files through the planner, without the command line
#[test]
fn frame_tables_of_the_sources() {
    let of_387 = plan!("387-bytes.toml");
    let of_452 = plan!("452-bytes.toml");
    let of_153 = plan!("153-and-58-bytes.toml");
    let of_195 = plan!("195-bytes.toml");
    let of_110 = plan!("110-bytes.toml");
    let of_44 = plan!("44-bytes.toml");
    let of_49 = plan!("49-44-50-bytes.toml");
    let of_516 = plan!("516-bytes.toml");
    // Plan, frame, bytes, ns of all copies, ms of the cycle, percent as printed.
    for (plan, number, size, wire_ns, cycle_ms, percent) in [
        (&of_387, 0, 387, 32_880, 2, 1.64),
        (&of_452, 0, 452, 38_080, 2, 1.90),
        (&of_153, 0, 153, 14_160, 2, 0.70),
        (&of_153, 1, 58, 13_440, 2, 0.67),
        (&of_195, 0, 195, 17_520, 2, 0.87),
        (&of_110, 0, 110, 10_720, 4, 0.27),
        (&of_44, 0, 44, 6_720, 2, 0.33),
        (&of_49, 0, 49, 6_720, 2, 0.33),
        (&of_49, 1, 44, 6_720, 5, 0.13),
        (&of_49, 2, 50, 6_720, 10, 0.07),
        (&of_516, 0, 516, 43_200, 2, 2.16),
    ] {
        let (frame, cycle) = frames(plan)[number];
        assert_eq!((frame.size(), cycle), (size, Span::ms(cycle_ms)), "{size}");
        assert_eq!(frame.wire_time(), Span::ns(wire_ns), "{size}");
        let load = wire_ns as f64 * 100.0 / cycle.as_nanos() as f64;
        assert!((load - percent).abs() <= 0.01, "{size}: {load}");
    }
    let row = |command: &str, len, counter| (command.to_owned(), len, counter);
    let expected = [
        row("NOP", 4, None),
        row("ARMW", 4, None),
        row("LRD", 3, None),
        row("LRW", 150, Some(21)),
        row("LWR", 33, Some(17)),
        row("LRD", 220, Some(19)),
        row("BRD", 2, Some(46)),
    ];
    assert_eq!(rows(&of_516, frames(&of_516)[0].0), expected);
    let expected = [
        row("LRD", 1, None),
        row("LRW", 48, Some(6)),
        row("LWR", 18, Some(5)),
        row("LRD", 13, Some(5)),
        row("LRW", 282, Some(9)),
        row("BRD", 2, Some(16)),
    ];
    assert_eq!(rows(&of_452, frames(&of_452)[0].0), expected);
    let expected = [row("LRD", 2, Some(4)), row("LWR", 2, Some(2)), row("BRD", 2, Some(11))];
    assert_eq!(rows(&of_153, frames(&of_153)[1].0), expected);
    let doubtful = |plan: &Plan| {
        let bad = |doubt: &super::Doubt| doubt.severity >= super::Severity::Warning;
        plan.doubts().into_iter().filter(bad).collect::<Vec<_>>()
    };
    for plan in [&of_387, &of_452, &of_153, &of_195, &of_110, &of_44, &of_49, &of_516] {
        assert_eq!(doubtful(plan), []);
    }
}

// proves: SYN-15
#[test]
fn separate_inputs_come_first_and_earlier() {
    let plan = plan!("separate-inputs.toml");
    let frames = frames(&plan);
    let row = |command: &str, len, counter| (command.to_owned(), len, counter);
    assert_eq!(rows(&plan, frames[0].0), [row("LRD", 1, Some(1))]);
    assert_eq!(rows(&plan, frames[1].0), [row("LWR", 1, Some(1)), row("BRD", 2, Some(3))]);
    assert_eq!((frames[0].0.ahead, frames[1].0.ahead), (Span::ms(3), Span::ZERO));
}

// proves: HW-04 partial: the planner, without the command line
#[test]
fn the_e_bus_is_overloaded_from_terminal_20_on() {
    let plan = plan!("ebus.toml");
    let groups = plan.ebus_groups();
    let left: Vec<i32> = groups[0].members.iter().map(|member| member.remaining_ma).collect();
    assert_eq!(&left[17..], [120, -40, -200, -360, -520, -680, -840, -1000]);
    assert_eq!(groups[0].first_negative().map(|id| id.no()), Some(20));
    let doubt = &plan.doubts()[0];
    assert!(doubt.advice.contains("EL94xx) before Term 20"), "{}", doubt.advice);
}
