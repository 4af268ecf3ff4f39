//! Frames that leave ahead of others, and frames that are sent twice.

use linesman_config::plan::layout::TaskOptions;
use linesman_config::plan::{Plan, PlanOptions, ProcessAccess};
use linesman_maindevice::Options;
use linesman_proto::address::Path;
use linesman_proto::command::Command;
use linesman_proto::frame::FrameView;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use crate::bench::{Bench, Fate};

const LINE: &str = r#"
name = "tasks"
seed = 8
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "I1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "O1"
type = "EL2008"
on = "I1.B"
"#;

/// Everything in OP, in one task that is as `options` say.
fn started(options: TaskOptions) -> (Bench, Plan) {
    // Nothing but the cycle: where every third frame is lost, a SubDevice may be taken for lost, too.
    let quiet = Span::s(1_000);
    let choices = Options { watch_interval: quiet, mailbox_interval: quiet, ..Options::default() };
    let mut bench = Bench::with_options(LINE, choices);
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    for device in &mut planned {
        device.settings.access = ProcessAccess::Separate;
        device.settings.frame_repeat = true;
    }
    let options = PlanOptions { tasks: vec![options], ..PlanOptions::default() };
    let plan = Plan::build(&planned, inventory.tree().clone(), &options).expect("a plan");
    bench.device.start(bench.now, plan.clone());
    bench.run_for(Span::s(1));
    assert!(bench.device.is_settled());
    (bench, plan)
}

/// When frames with a datagram of this command left within the next `lasts`.
fn departures(bench: &mut Bench, lasts: Span, command: Command) -> Vec<Instant> {
    let (mut buffer, mut arrival, mut seen) = (vec![0; 1514], Vec::new(), Vec::new());
    let end = bench.now + lasts;
    while bench.now < end {
        let due = [bench.device.poll_timeout(), bench.segment.poll_timeout()];
        bench.now = bench.now.max(due.into_iter().flatten().min().expect("a cycle"));
        bench.segment.advance(bench.now);
        while bench.segment.poll_arrival(&mut arrival).is_some() {
            bench.device.handle_frame(bench.now, Path::A, &arrival);
        }
        bench.device.handle_timeout(bench.now);
        while let Some(transmit) = bench.device.poll_transmit(bench.now, &mut buffer) {
            let frame = &buffer[..transmit.len];
            let view = FrameView::parse(frame).expect("a frame of ours");
            let mut datagrams = view.datagrams().map_while(Result::ok);
            if datagrams.any(|datagram| datagram.command() == Some(command)) {
                seen.push(transmit.at);
            }
            bench.segment.handle_frame(transmit.at, transmit.path, frame);
        }
        while bench.device.poll_event().is_some() {}
    }
    seen
}

// proves: SYN-15 partial: on a running line
#[test]
fn inputs_that_are_fetched_separately_leave_so_much_earlier() {
    let ahead = Span::us(300);
    let task =
        TaskOptions { separate_inputs: Some(ahead), ..TaskOptions::new("ahead", Span::ms(2)) };
    let (mut bench, plan) = started(task);
    assert_eq!(plan.tasks[0].frames.len(), 2);
    let inputs = departures(&mut bench, Span::ms(200), Command::Lrd);
    let outputs = departures(&mut bench, Span::ms(200), Command::Lwr);
    assert!(inputs.len().abs_diff(100) <= 1 && outputs.len().abs_diff(100) <= 1);
    let phase = |at: Instant| at.as_nanos() % 2_000_000;
    let (early, late) = (phase(inputs[0]), phase(outputs[0]));
    assert!(inputs.iter().all(|at| phase(*at) == early));
    assert!(outputs.iter().all(|at| phase(*at) == late));
    assert_eq!((late + 2_000_000 - early) % 2_000_000, ahead.as_nanos());
    assert_eq!(bench.device.statistics().working_counter_errors, 0);
}

// proves: FRM-27 partial: on a running line
#[test]
fn of_frames_that_are_sent_twice_either_copy_will_do() {
    let task = TaskOptions { repeats: 1, ..TaskOptions::new("twice", Span::ms(1)) };
    let (mut bench, plan) = started(task);
    assert!(plan.tasks[0].frames.iter().all(|frame| frame.repeats == 1));
    let sensor = bench.id("I1");
    let before = bench.device.statistics();
    bench.run_for(Span::ms(500));
    let quiet = bench.device.statistics();
    assert!((quiet.frames_spare - before.frames_spare).abs_diff(500) <= 1, "{quiet:?}");
    assert_eq!(quiet.frames_duplicate, before.frames_duplicate);
    let mut number = 0_u64;
    bench.tamper = Some(Box::new(move |_| {
        number += 1;
        if number.is_multiple_of(3) { Fate::Lost } else { Fate::Arrives }
    }));
    bench.device.take_exchanged(0);
    bench.judged = Some(sensor);
    bench.run_for(Span::ms(500));
    let after = bench.device.statistics();
    assert_eq!(bench.bad_cycles, 0, "of {}: {after:?}, before {quiet:?}", bench.cycles);
    assert_eq!(after.cyclic_lost, quiet.cyclic_lost);
}
