//! Reads of the MainDevice of the lab with each habit: which registers, of whom, how often.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};

use linesman_config::fault::FaultName;
use linesman_diagnosis::observe::Direction;
use linesman_diagnosis::report::Verdict;
use linesman_lab::habit::Habit;
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_lab::score::{CaseReport, ScoreOptions, Tally, run_case};
use linesman_lab::swarm::{SwarmOptions, run_seed};
use linesman_lab::verdict::proof::LINE;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::time::{Instant, Span};
use linesman_sim::segment_file::{FaultEntry, SegmentFile};

/// Command, station or 0, register or logical address, length.
type Asked = (Command, u16, u32, usize);

/// Datagrams by what they ask, with the times at which they left.
type Requests = Arc<Mutex<BTreeMap<Asked, Vec<Instant>>>>;

/// A line of six SubDevices that is up, and what is asked of it from then on.
fn up(habit: Habit) -> (Lab, Requests) {
    let file = SegmentFile::parse(LINE).unwrap();
    let options = LabOptions { habit, project: false, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).unwrap();
    lab.wait_up(Span::s(20)).unwrap();
    let requests = Requests::default();
    let seen = Arc::clone(&requests);
    lab.set_tap(Box::new(move |frame| {
        if frame.direction != Direction::Sent {
            return;
        }
        let view = FrameView::parse(frame.bytes).unwrap();
        for datagram in view.datagrams().map_while(Result::ok) {
            let command = datagram.command().unwrap();
            let (of, at) = match command.addressing() {
                Addressing::Logical => (0, datagram.logical().0),
                Addressing::Station
                | Addressing::Position
                | Addressing::Broadcast
                | Addressing::None => (datagram.adp(), datagram.ado().0.into()),
            };
            let asked = (command, of, at, datagram.data_len());
            seen.lock().unwrap().entry(asked).or_default().push(frame.time);
        }
    }));
    (lab, requests)
}

fn run(lab: &mut Lab, span: Span) {
    lab.run_until(lab.now() + span).unwrap();
}

/// How often each thing was asked but process data.
fn asked(requests: &Requests) -> BTreeMap<Asked, usize> {
    let requests = std::mem::take(&mut *requests.lock().unwrap());
    let is_data = |command| matches!(command, Command::Lrw | Command::Lrd | Command::Lwr);
    let others = requests.into_iter().filter(|((command, ..), _)| !is_data(*command));
    others.map(|(asked, times)| (asked, times.len())).collect()
}

fn stations(lab: &Lab) -> Vec<u16> {
    lab.plan().unwrap().devices.iter().map(|device| device.station.0).collect()
}

/// What is asked of a healthy line in four seconds, by command, register and length, of each SubDevice as often.
fn polled(habit: Habit) -> BTreeMap<(Command, u32, usize), usize> {
    let (mut lab, requests) = up(habit);
    run(&mut lab, Span::s(4));
    let mut polled: BTreeMap<(Command, u32, usize), Vec<usize>> = BTreeMap::new();
    for ((command, _, register, len), times) in asked(&requests) {
        polled.entry((command, register, len)).or_default().push(times);
    }
    let each = stations(&lab).len();
    let same = |((command, register, len), times): (_, Vec<usize>)| {
        assert!(times.iter().all(|one| *one == times[0]), "{register:#06X}: {times:?}");
        assert!(times.len() == each || command == Command::Brd || command == Command::Bwr);
        ((command, register, len), times[0])
    };
    polled.into_iter().map(same).collect()
}

#[test]
fn each_habit_asks_for_what_its_name_says_and_nothing_else() {
    let states = ((Command::Brd, 0x0130, 2), 4);
    let expected = [
        (Habit::ProcessData, vec![]),
        (Habit::States, vec![states]),
        (Habit::Links, vec![states]),
        (Habit::Counters, vec![((Command::Fprd, 0x0300, 20), 4), states]),
        (
            Habit::Clearing,
            vec![((Command::Fprd, 0x0300, 8), 4), states, ((Command::Bwr, 0x0300, 8), 4)],
        ),
    ];
    for (habit, expected) in expected {
        assert_eq!(polled(habit), expected.into_iter().collect(), "{habit}");
    }
}

#[test]
fn own_habit_reads_all_registers_of_each_every_100_ms() {
    let (mut lab, requests) = up(Habit::Own);
    run(&mut lab, Span::s(4));
    let asked = asked(&requests);
    for station in stations(&lab) {
        for (register, len) in [(0x0130, 6), (0x0110, 2), (0x0300, 20)] {
            let times = asked.get(&(Command::Fprd, station, register, len)).copied();
            assert!(times.is_some_and(|times| (35..=45).contains(&times)), "{times:?}");
        }
    }
}

/// What is asked while a SubDevice without power falls silent and comes back.
fn asked_about_a_restart(habit: Habit) -> (BTreeMap<Asked, usize>, Lab) {
    let (mut lab, requests) = up(habit);
    run(&mut lab, Span::ms(300));
    let entry = FaultEntry::new(FaultName::DeviceOff).device("T5");
    let id = lab.inject(&entry).unwrap();
    run(&mut lab, Span::ms(1_500));
    lab.heal(id);
    run(&mut lab, Span::s(6));
    (asked(&requests), lab)
}

#[test]
fn states_of_each_are_read_when_those_of_all_differ_and_the_lost_one_is_brought_back() {
    for (habit, reads_links) in [(Habit::States, false), (Habit::Links, true)] {
        let (asked, lab) = asked_about_a_restart(habit);
        assert!(lab.is_up(), "{habit}: {:?}", lab.not_up().collect::<Vec<_>>());
        for station in stations(&lab) {
            assert!(asked.contains_key(&(Command::Fprd, station, 0x0130, 6)), "{habit} {station}");
            let read =
                asked.keys().any(|(_, of, register, _)| *of == station && *register == 0x0110);
            // Those that are lost are not asked for their links.
            assert!(read == reads_links || station == 0x1006, "{habit} {station:#06X}");
        }
        let counters = asked.keys().any(|(_, _, register, _)| (0x0300..0x0314).contains(register));
        assert!(!counters, "{habit}");
    }
}

#[test]
fn process_data_alone_bring_nothing_back_and_ask_nothing() {
    let (asked, lab) = asked_about_a_restart(Habit::ProcessData);
    assert_eq!(asked, BTreeMap::new());
    assert!(!lab.is_up());
}

#[test]
fn a_main_device_in_a_pause_sends_nothing_and_misses_nothing() {
    let (mut lab, requests) = up(Habit::States);
    run(&mut lab, Span::ms(300));
    let sent = lab.main().statistics();
    let entry = FaultEntry::new(FaultName::WatchdogStarved).at("maindevice").with("pause_ms", 60.0);
    let began = lab.now();
    let id = lab.inject(&entry).unwrap();
    run(&mut lab, Span::ms(500));
    let times: Vec<Instant> = requests.lock().unwrap().values().flatten().copied().collect();
    let within = |at: &Instant| *at > began + Span::ms(1) && *at < began + Span::ms(59);
    assert_eq!(times.iter().filter(|at| within(at)).count(), 0);
    assert!(times.iter().any(|at| *at > began + Span::ms(60)));
    let after = lab.main().statistics();
    assert_eq!(after.frames_lost, sent.frames_lost, "what was not sent cannot be lost");
    assert!(lab.truth().fault(id).unwrap().first_effect.is_some());
    assert_eq!(lab.segment().host(linesman_proto::address::Path::A).tx_dropped, 0);
}

#[test]
fn diagnosis_beside_a_habit_listens_and_asks_nothing() {
    let (mut lab, requests) = up(Habit::States);
    let entry = FaultEntry::new(FaultName::LinkOpen).at("K1.C-K2.A");
    lab.inject(&entry).unwrap();
    run(&mut lab, Span::s(3));
    let diagnosis = lab.diagnosis();
    assert_eq!(diagnosis.verdict, Verdict::Faulty);
    assert!(diagnosis.main_device.is_some(), "it says who drives the line");
    let probes = [0x0110, 0x0300];
    let asked = asked(&requests);
    assert!(asked.keys().all(|(_, _, register, _)| !probes.contains(register)), "{asked:?}");
}

#[test]
fn names_are_those_of_the_command_line() {
    for habit in Habit::ALL {
        assert_eq!(habit.name().parse(), Ok(habit));
        assert!(!habit.what().is_empty());
    }
    assert!("soft".parse::<Habit>().is_err_and(|error| error.contains("process-data")));
}

/// Seeds of a slice of the score.
const SEEDS: std::ops::Range<u64> = 1..13;

fn slice(habit: Habit) -> (Vec<CaseReport>, Tally) {
    let options = ScoreOptions { habit, ..ScoreOptions::default() };
    let cases: Vec<_> = SEEDS.map(|seed| run_case(seed, &options)).collect();
    let mut tally = Tally::new(options);
    cases.iter().for_each(|case| tally.add(case));
    (cases, tally)
}

#[test]
fn listeners_beside_each_habit_are_judged_the_same_each_time() {
    for habit in Habit::ALL.into_iter().filter(|habit| *habit != Habit::Own) {
        let (cases, tally) = slice(habit);
        let report = tally.report();
        let listened = report.listened.unwrap();
        assert!(listened.single.start.alone.no_trace.of >= 6, "{habit}");
        assert!(listened.single.during.alone.no_trace.of >= 4, "{habit}");
        assert!(listened.single.after.alone.no_trace.of >= 4, "{habit}");
        let healthy = &listened.healthy;
        assert_eq!(healthy.alarms, Vec::<String>::new(), "{habit}");
        assert!(healthy.late.with_project.silent.of >= 8, "{habit}");
        assert!(cases.iter().flat_map(|case| &case.faults).all(|fault| fault.live.is_none()));
        // One of them shows that the draw and the listeners keep to the seed: all go through the same code.
        if habit == Habit::Soem {
            let (again, _) = slice(habit);
            assert_eq!(format!("{cases:?}"), format!("{again:?}"), "{habit}");
        }
    }
}

#[test]
fn own_habit_has_no_listeners() {
    let (cases, tally) = slice(Habit::Own);
    assert!(cases.iter().all(|case| case.healthy_listened.is_none()));
    assert!(tally.report().listened.is_none());
}

#[test]
fn swarm_with_a_habit_panics_nowhere_and_holds_its_invariants() {
    for habit in [Habit::States, Habit::ProcessData] {
        let options = SwarmOptions { habit, ..SwarmOptions::default() };
        let reports: Vec<_> = (1..5).map(|seed| run_seed(seed, &options)).collect();
        let is_invariant = |violation: &&String| !violation.contains("has no fault there");
        let broken: Vec<&String> =
            reports.iter().flat_map(|seed| &seed.violations).filter(is_invariant).collect();
        assert_eq!(broken, Vec::<&String>::new(), "{habit}");
        assert!(reports.iter().all(|seed| seed.replay().ends_with(habit.name())));
    }
}
