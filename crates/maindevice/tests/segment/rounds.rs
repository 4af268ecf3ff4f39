//! Polls other than those of each SubDevice: rounds of AL status of all, or none.

use linesman_config::fault::FaultName;
use linesman_maindevice::{CounterPoll, Event, Options, Polling, Rounds};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use crate::bench::Bench;
use crate::mailbox::PLANT;

/// The plant in OP, polled once a second.
fn polled(polling: Polling) -> Bench {
    let options = Options {
        polling,
        watch_interval: Span::s(1),
        mailbox_interval: Span::s(3_600),
        ..Options::default()
    };
    let mut bench = Bench::with_options(PLANT, options);
    bench.start(AlState::Op);
    bench.run_for(Span::s(1));
    bench
}

/// Frames beside process data in ten seconds.
fn frames(bench: &mut Bench) -> u64 {
    let before = bench.device.statistics().queued_sent();
    bench.run_for(Span::s(10));
    bench.device.statistics().queued_sent() - before
}

#[test]
fn healthy_line_is_asked_once_in_a_round_or_not_at_all() {
    let rounds = |counters| Polling::Rounds(Rounds { links: false, counters });
    for (polling, expected) in [
        (Polling::Nothing, 0),
        (rounds(CounterPoll::None), 10),
        (rounds(CounterPoll::Read), 20),
        (rounds(CounterPoll::ReadAndCleared), 30),
    ] {
        assert_eq!(frames(&mut polled(polling)), expected, "{polling:?}");
    }
}

#[test]
fn round_finds_who_has_left_its_state_and_it_is_brought_back() {
    let mut bench = polled(Polling::Rounds(Rounds::default()));
    let entry = FaultEntry::new(FaultName::BrownOut).device("M1").with("dip_ms", 20.0);
    bench.segment.inject(bench.now, &entry).unwrap();
    let began = bench.now;
    let id = bench.id("M1");
    assert!(bench.run_until(
        Span::s(5),
        |event| matches!(event, Event::DeviceLost { id: lost } if *lost == id)
    ));
    let found_after = bench.now.since(began);
    assert!(found_after < Span::ms(1_100), "within a round: {found_after}");
    assert!(bench.run_until(Span::s(10), |event| matches!(event, Event::TargetReached { .. })));
    assert_eq!(bench.state("M1"), "OP");
}

#[test]
fn nobody_notices_a_restart_where_nothing_is_read() {
    let mut bench = polled(Polling::Nothing);
    let entry = FaultEntry::new(FaultName::BrownOut).device("M1").with("dip_ms", 20.0);
    bench.segment.inject(bench.now, &entry).unwrap();
    assert_eq!(frames(&mut bench), 0);
    assert_eq!(bench.state("M1"), "INIT");
    assert!(bench.events.iter().any(|(_, event)| matches!(event, Event::WorkingCounter { .. })));
}
