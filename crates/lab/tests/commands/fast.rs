//! Latency of the diagnosis: the first flag in the cycle of the event, the cause of a hard fault
//! within 100 ms.

use std::sync::{Arc, Mutex};

use linesman_config::fault::FaultName;
use linesman_diagnosis::Event;
use linesman_diagnosis::observe::{Direction, HostEvent};
use linesman_diagnosis::report::Severity;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_lab::verdict::proof::LINE;
use linesman_lab::verdict::{Claim, Scene, matches};
use linesman_proto::address::{LogicalAddress, Path};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

const CYCLE: Span = Span::ms(1);
/// Longer than a frame takes to come back, with the time that the MainDevice waits for it.
const SOON: Span = Span::ms(100);

fn entry(text: &str) -> FaultEntry {
    let file = SegmentFile::parse(&format!("{LINE}\n[[fault]]\n{text}")).unwrap();
    file.faults[0].clone()
}

/// When which process data came back, and with which working counter.
type Returns = Arc<Mutex<Vec<(Instant, LogicalAddress, u16)>>>;

/// Puts a fault into a line that runs; gives its first effect, and what was said from then on.
fn broken(text: &str, offset: Span) -> (Lab, Instant, Vec<Event>) {
    let (lab, began, events, _) = watched(text, offset, false);
    (lab, began, events)
}

/// The same with the returns of process data; with `news`, the diagnosis has learnt something else just
/// before.
fn watched(text: &str, offset: Span, news: bool) -> (Lab, Instant, Vec<Event>, Returns) {
    let file = SegmentFile::parse(LINE).unwrap();
    let options = LabOptions { cycle: CYCLE, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).unwrap();
    lab.wait_up(Span::s(20)).unwrap();
    let returns = Returns::default();
    let seen = Arc::clone(&returns);
    lab.set_tap(Box::new(move |frame| {
        let view = FrameView::parse(frame.bytes).unwrap();
        for datagram in view.datagrams().map_while(Result::ok) {
            let addressing = datagram.command().map(Command::addressing);
            if frame.direction == Direction::Received && addressing == Some(Addressing::Logical) {
                seen.lock().unwrap().push((frame.time, datagram.logical(), datagram.wkc().0));
            }
        }
    }));
    lab.run_until(lab.now() + Span::s(1) + offset).unwrap();
    while lab.poll_finding_event().is_some() {}
    if news {
        lab.observe_host(Path::B, HostEvent::Carrier(false));
    }
    let id = lab.inject(&entry(text)).unwrap();
    lab.run_until(lab.now() + Span::s(1)).unwrap();
    let began = lab.truth().fault(id).unwrap().first_effect.unwrap();
    let events = std::iter::from_fn(|| lab.poll_finding_event()).collect();
    (lab, began, events, returns)
}

/// Faults after which working counters are short at once.
const HARD: [&str; 5] = [
    "kind = 'link-open'\nat = 'K1.C-K2.A'",
    "kind = 'link-open'\nat = 'T1.B-T2.A'",
    "kind = 'device-off'\ndevice = 'T4'",
    "kind = 'supply-off'\ndevices = ['K2', 'T4']",
    "kind = 'brown-out'\ndevices = ['T4']\ndip_ms = 40",
];

// proves: DIA-03 partial: that something is wrong is known within the cycle, and the cause soon after; EMC, device and firmware are told apart elsewhere
#[test]
fn something_is_flagged_in_the_cycle_of_the_first_frame_that_shows_it() {
    for text in HARD {
        for offset in [0, 130, 470, 810].map(Span::us) {
            for news in [false, true] {
                let (_, began, events, returns) = watched(text, offset, news);
                let first = events.iter().find(|event| event.finding.severity != Severity::Info);
                let first = first.map(|event| event.at);
                let returns = returns.lock().unwrap();
                let full = |start| {
                    let same = returns.iter().filter(|(_, other, _)| *other == start);
                    same.map(|(.., wkc)| *wkc).max()
                };
                let is_short = |start, wkc| Some(wkc) < full(start);
                let mut after = returns.iter().filter(|(at, ..)| *at >= began);
                let shown = after.find(|(_, start, wkc)| is_short(*start, *wkc));
                let shown = shown.map(|(at, ..)| *at);
                // A frame that is under way may vanish, and ports take their time to close.
                let after = first.map(|at| at.since(began));
                assert!(
                    after.is_some_and(|after| after <= CYCLE + CYCLE),
                    "{text} at {offset}: {after:?}"
                );
                let in_its_cycle =
                    shown.zip(first).is_some_and(|(shown, first)| first < shown + CYCLE);
                assert!(in_its_cycle, "{text} at {offset}: {shown:?} {first:?}");
            }
        }
    }
}

#[test]
fn the_cause_of_a_hard_fault_is_named_within_100_ms() {
    for text in HARD {
        let (lab, began, events) = broken(text, Span::us(300));
        let id = lab.truth().faults().last().unwrap().id;
        let mut truth = lab.truth_of(id).unwrap();
        if truth.name == FaultName::BrownOut {
            // While it lasts, a dip is a device without power.
            truth.name = FaultName::DeviceOff;
        }
        let scene = Scene { tree: lab.tree(), host_counters: true, answered_again: false };
        let right = events.iter().find(|event| {
            event.at >= began && matches(&truth, &scene, Claim::of(&event.finding)).is_right()
        });
        let after = right.map(|event| event.at.since(began));
        let said: Vec<String> = events
            .iter()
            .map(|e| format!("{} {} {}", e.at.since(began), e.finding.code, e.finding.cause))
            .collect();
        assert!(after.is_some_and(|after| after <= SOON), "{text}: {after:?}\n{}", said.join("\n"));
    }
}
