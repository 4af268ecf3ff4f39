//! Status of a running network: mailboxes by their mapped bits, error counters through clears,
//! state words.

use crate::bench::Bench;
use crate::mailbox::{PLANT, upload};
use linesman_config::fault::FaultName;
use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::mailbox::{MOST_WAITING, Why};
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_maindevice::{Event, Options};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::port::Port;
use linesman_proto::register::{ErrorCounter, ErrorCounters};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::Entry;

/// Runs the plant with or without the bits of mailboxes in the cycle; nothing else is read often.
fn running(mailbox_states: bool) -> Bench {
    let quiet = Options { watch_interval: Span::s(60), ..Options::default() };
    let mut bench = Bench::with_options(PLANT, quiet);
    let inventory = bench.scan();
    let options = PlanOptions { mailbox_states, ..PlanOptions::default() };
    let plan = Plan::build(&inventory.planned(AlState::Op), inventory.tree().clone(), &options);
    let plan = plan.unwrap();
    let mapped = plan.devices.iter().filter(|device| device.mailbox_state.is_some()).count();
    assert_eq!(mapped, if mailbox_states { 2 } else { 0 });
    bench.device.start(bench.now, plan);
    assert!(bench.run_until(Span::s(30), |event| matches!(event, Event::AllReached)));
    bench.run_for(Span::s(1));
    bench
}

#[test]
fn mailboxes_whose_bits_the_cycle_reads_are_not_polled() {
    let queued_in_ten_seconds = |mailbox_states| {
        let mut bench = running(mailbox_states);
        let before = bench.device.statistics().queued_sent();
        bench.run_for(Span::s(10));
        bench.device.statistics().queued_sent() - before
    };
    let (polled, mapped) = (queued_in_ten_seconds(false), queued_in_ten_seconds(true));
    assert!(polled > 150, "every 50 ms: {polled}");
    assert!(mapped < 40, "once a second, in case cyclic frames are lost: {mapped}");
}

#[test]
fn what_a_subdevice_says_is_heard_by_its_bit() {
    let mut bench = running(true);
    let entry = FaultEntry::new(FaultName::Emergency).device("M1").with("code", 0x8611);
    bench.segment.inject(bench.now, &entry).unwrap();
    let began = bench.now;
    assert!(bench.run_until(Span::s(2), |event| matches!(event, Event::Emergency { .. })));
    let took = bench.now.since(began);
    assert!(took < Span::ms(20), "a few cycles, not a poll of one second: {took}");
    let before = bench.device.statistics().queued_sent();
    for _ in 0..50 {
        assert_eq!(upload(&mut bench, "M1", 0x1018, 1).unwrap(), [2, 0, 0, 0]);
    }
    let frames = (bench.device.statistics().queued_sent() - before) / 50;
    assert!(frames <= 4, "written, fetched, seen to be empty: {frames} frames for each object");
    // A bit that nobody may look at does not keep anybody busy: the mailbox closes while it is full.
    bench.segment.inject(bench.now, &entry.clone().with("every_ms", 1)).unwrap();
    let id = bench.id("M1");
    assert!(bench.device.request_state(bench.now, Some(id), AlState::Init));
    bench.run_for(Span::s(2));
    assert_eq!(bench.state("M1"), "INIT");
    assert!(bench.device.request_state(bench.now, Some(id), AlState::Op));
    bench.run_for(Span::s(5));
    assert_eq!(bench.state("M1"), "OP");
}

// proves: DIA-09, HW-19
#[test]
fn no_count_is_lost_when_counters_are_cleared_while_they_rise() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    // A first reading is history: what happens before it counts for nothing.
    bench.run_for(Span::ms(200));
    let entry = FaultEntry::new(FaultName::EmcNoise)
        .at("A1.B>M1.A")
        .with("hits_per_s", 400.0)
        .with("bursts_per_s", 20.0);
    let fault = bench.segment.inject(bench.now, &entry).unwrap();
    let id = bench.id("M1");
    let mut clears = 0;
    for _ in 0..40 {
        bench.run_for(Span::ms(50));
        bench.device.serve(bench.now, id, Service::ClearCounters);
        let mut stood = None;
        bench.run_until(Span::s(1), |event| {
            let Event::Served { result, .. } = event else { return false };
            stood = result.as_ref().as_ref().ok().cloned();
            true
        });
        if let Some(ServiceAnswer::Data(bytes)) = stood {
            assert_eq!(bytes.len(), ErrorCounters::LEN);
            clears += 1;
        }
    }
    assert_eq!(clears, 40, "none of their frames was hit; else what it cleared would be lost");
    bench.segment.heal(bench.now, fault);
    bench.run_for(Span::ms(500));
    let hits = bench.segment.truth().faults()[0].symbol_errors;
    assert!(hits > 300, "more than a register can hold: {hits}");
    let status = bench.device.network_status().unwrap();
    let totals = status.device(id).unwrap().counters();
    assert_eq!(totals.count(ErrorCounter::PhysicalLayer(Port::A)), Some(hits));
    assert!(!totals.is_lower_bound(), "we cleared them ourselves");
    let registers = totals.registers().unwrap();
    assert!(registers.value(ErrorCounter::PhysicalLayer(Port::A)) < Some(255));
    assert_eq!(status.error_sums().nth(id.index()), Some(totals.sum()));
    assert!(bench.segment.audit().is_empty());
}

#[test]
fn a_storm_of_objects_delays_no_cycle_and_is_bounded() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    let id = bench.id("M1");
    bench.judged = Some(id);
    bench.run_for(Span::ms(100));
    (bench.cycles, bench.bad_cycles) = (0, 0);
    let (before, began) = (bench.device.statistics(), bench.now);
    let asked = MOST_WAITING + 500;
    for _ in 0..asked {
        bench.device.sdo_upload(bench.now, id, ObjectAddress::new(0x1018, 1), false);
    }
    let (mut answered, mut refused) = (0, 0);
    bench.run_until(Span::s(120), |event| {
        if let Event::SdoUploaded { result, .. } = event {
            match result {
                Ok(data) => answered += usize::from(*data == [2, 0, 0, 0]),
                Err(failure) => {
                    refused += usize::from(matches!(failure.why, Why::Crowded { .. }));
                }
            }
        }
        answered + refused == asked
    });
    // One is at work when the queue is full.
    assert!((MOST_WAITING..=MOST_WAITING + 1).contains(&answered), "{answered} answered");
    assert_eq!(answered + refused, asked);
    let counts = bench.device.statistics();
    let cycles = bench.now.since(began).as_nanos() / 1_000_000;
    assert!((counts.cycles - before.cycles).abs_diff(cycles) <= 1, "every cycle at its time");
    assert_eq!((counts.cycles_missed, counts.cyclic_lost, counts.cyclic_unsent), (0, 0, 0));
    assert_eq!(bench.bad_cycles, 0, "of {}", bench.cycles);
}

#[test]
fn a_state_that_is_asked_for_makes_no_working_counter_wrong() {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    for name in ["M1", "A1"] {
        let id = bench.id(name);
        for to in [AlState::PreOp, AlState::Op, AlState::Init, AlState::SafeOp, AlState::Op] {
            assert!(bench.device.request_state(bench.now, Some(id), to));
            let reached = |event: &Event| matches!(event, Event::TargetReached { id: of, state } if *of == id && *state == to);
            assert!(bench.run_until(Span::s(5), reached), "{name} to {to}");
            bench.run_for(Span::ms(300));
            assert_eq!(bench.device.wanted_states()[id.index()], to);
        }
    }
    let wrong: Vec<_> = (bench.events.iter())
        .filter(|(_, event)| matches!(event, Event::WorkingCounter { .. }))
        .collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

// S3 L82-83: a drive fails, the working counter of its datagram tells in the same cycle, the other axes
// stop with the next frame.
// proves: DIA-04
#[test]
fn a_drive_that_fails_is_known_in_its_cycle_and_the_other_stops_with_the_next() {
    let mut bench = Bench::new(
        "[[device]]\nname = \"D1\"\ntype = \"CiA402\"\non = \"maindevice\"\n\
         [[device]]\nname = \"D2\"\ntype = \"CiA402\"\non = \"D1.B\"\n",
    );
    let plan = bench.start(AlState::Op);
    let (one, other) = (bench.id("D1"), bench.id("D2"));
    let control = plan.device(one).unwrap().outputs.start;
    let status = plan.device(one).unwrap().inputs.start;
    let is_ready = |bench: &Bench| bench.device.inputs()[status] & 0x6F == 0x21;
    // Shutdown: the drive is ready to be switched on.
    bench.device.outputs_mut()[control..control + 2].copy_from_slice(&[0x06, 0]);
    bench.run_for(Span::ms(200));
    assert!(bench.device.quality(other).valid && is_ready(&bench));
    bench.segment.inject(bench.now, &FaultEntry::new(FaultName::DeviceOff).device("D2")).unwrap();
    // An application that looks at the quality of all axes in each cycle, and stops the others.
    let mut stopped_at = None;
    for _ in 0..200 {
        bench.run_for(Span::us(100));
        if !bench.device.quality(other).valid {
            bench.device.outputs_mut()[control..control + 2].copy_from_slice(&[0, 0]);
            stopped_at = Some(bench.now);
            break;
        }
    }
    let began = bench.segment.truth().entries().iter().find_map(|entry| match entry {
        Entry::Begin { at, .. } => Some(*at),
        Entry::End { .. } | Entry::Effect { .. } => None,
    });
    let took = stopped_at.expect("it is seen").since(began.expect("it has begun"));
    assert!(took <= Span::us(1_100), "with the first frame of 1 ms after it: {took}");
    bench.run_for(Span::ms(5));
    assert!(!is_ready(&bench), "disabling the voltage has arrived");
    assert_eq!(bench.state("D1"), "OP", "the other axis is not torn down with it");
}
