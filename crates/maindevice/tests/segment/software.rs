//! SubDevices whose software fails while their controllers work: what a MainDevice meets.

use crate::bench::{Bench, Fate};
use crate::mailbox::{PLANT, get, put, upload};
use linesman_config::fault::FaultName;
use linesman_maindevice::Event;
use linesman_maindevice::mailbox::Why;
use linesman_proto::address::{Path, RegisterAddress};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::seed::Seed;
use linesman_sim::segment_file::FaultEntry;
use linesman_sim::truth::{Effect, Entry, FaultId};

fn running() -> Bench {
    let mut bench = Bench::new(PLANT);
    bench.start(AlState::Op);
    bench
}

fn inject(bench: &mut Bench, entry: &FaultEntry) -> FaultId {
    let fault = bench.segment.inject(bench.now, entry).unwrap_or_else(|error| panic!("{error}"));
    bench.run_for(Span::ms(5));
    fault
}

fn heal(bench: &mut Bench, fault: FaultId) {
    bench.segment.heal(bench.now, fault);
    bench.run_for(Span::ms(5));
}

fn effects(bench: &Bench, fault: FaultId) -> Vec<Effect> {
    let entries = bench.segment.truth().entries().iter();
    entries
        .filter_map(|entry| match entry {
            Entry::Effect { fault: by, effect, .. } if *by == Some(fault) => Some(*effect),
            Entry::Effect { .. } | Entry::Begin { .. } | Entry::End { .. } => None,
        })
        .collect()
}

fn register(bench: &Bench, name: &str, address: u16) -> u8 {
    bench
        .segment
        .controller(bench.id(name))
        .expect("it is there")
        .register(RegisterAddress(address))
}

#[test]
fn complete_access_gives_subindex_0_two_bytes() {
    let mut bench = running();
    let all = get(&mut bench, "M1", ObjectAddress::new(0x1C13, 0), true).unwrap();
    assert_eq!(all, [2, 0, 0x00, 0x1A, 0x03, 0x1A], "two bytes for the number of entries");
    let from_one = get(&mut bench, "M1", ObjectAddress::new(0x1C13, 1), true).unwrap();
    assert_eq!(from_one, all[2..]);
    // Read entry by entry subindex 0 is one byte.
    assert_eq!(upload(&mut bench, "M1", 0x1C13, 0).unwrap(), [2]);
}

// proves: SW-10 partial: complete access unsupported
#[test]
fn device_without_complete_access_refuses_it() {
    let mut bench = running();
    let error = get(&mut bench, "A1", ObjectAddress::new(0x1018, 0), true).unwrap_err();
    assert!(error.to_string().contains("0x06010004 Complete access not supported"), "{error}");
}

// proves: SW-09 partial: states stay, the error is an answer of its own
#[test]
fn requests_that_are_refused_by_a_fault_are_aborted_and_states_stay() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::MailboxError)
        .device("M1")
        .with("code", 0x0606_0000)
        .with("first_index", 0x8000)
        .with("last_index", 0x8FFF);
    let fault = inject(&mut bench, &entry);
    let error = upload(&mut bench, "M1", 0x8010, 1).unwrap_err();
    assert!(error.to_string().contains("0x06060000"), "{error}");
    assert!(put(&mut bench, "M1", 0x8010, 1, &[1, 0]).is_err());
    assert!(upload(&mut bench, "M1", 0x1018, 1).is_ok(), "other objects");
    assert!(upload(&mut bench, "A1", 0x1018, 1).is_ok(), "other SubDevices");
    assert_eq!(bench.state("M1"), "OP");
    heal(&mut bench, fault);
    assert!(upload(&mut bench, "M1", 0x8010, 1).is_ok());

    let entry = FaultEntry::new(FaultName::MailboxError).device("M1").with("answer", "error-reply");
    inject(&mut bench, &entry);
    let error = upload(&mut bench, "M1", 0x8010, 1).unwrap_err();
    assert!(matches!(error.why, Why::Mailbox { .. }), "{error}");
}

#[test]
fn half_of_the_requests_may_be_refused() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::MailboxError).device("M1").with("share", 0.5);
    inject(&mut bench, &entry);
    let failed = (0..40).filter(|_| upload(&mut bench, "M1", 0x1018, 1).is_err()).count();
    assert!((10..=30).contains(&failed), "{failed}");
}

#[test]
fn a_slow_mailbox_answers_late_but_rightly() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::MailboxSlow).device("M1").with("by_ms", 300.0);
    let fault = inject(&mut bench, &entry);
    let before = bench.now;
    assert_eq!(upload(&mut bench, "M1", 0x1018, 1).unwrap(), [2, 0, 0, 0]);
    let took = bench.now.since(before);
    assert!((Span::ms(300)..Span::ms(320)).contains(&took), "{took}");
    heal(&mut bench, fault);
    let entry = FaultEntry::new(FaultName::MailboxSlow).device("M1").with("by_ms", 3_000.0);
    inject(&mut bench, &entry);
    let error = upload(&mut bench, "M1", 0x1018, 1).unwrap_err();
    assert!(matches!(error.why, Why::NoAnswer { .. }), "{error}");
    assert_eq!(bench.state("M1"), "OP");
}

#[test]
fn a_stuck_mailbox_stays_full_or_empty() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::MailboxStuck).device("M1");
    let fault = inject(&mut bench, &entry);
    let first = upload(&mut bench, "M1", 0x1018, 1).unwrap_err();
    assert!(matches!(first.why, Why::NoAnswer { .. }), "{first}");
    assert_eq!(register(&bench, "M1", 0x0805) & 0x08, 0x08, "the request lies there");
    let second = upload(&mut bench, "M1", 0x1018, 1).unwrap_err();
    assert!(matches!(second.why, Why::MailboxFull { .. }), "{second}");
    assert_eq!(bench.state("M1"), "OP");
    heal(&mut bench, fault);
    bench.run_for(Span::ms(100));
    assert_eq!(upload(&mut bench, "M1", 0x1018, 1).unwrap(), [2, 0, 0, 0]);

    let entry = FaultEntry::new(FaultName::MailboxStuck).device("M1").with("side", "answers");
    inject(&mut bench, &entry);
    let error = upload(&mut bench, "M1", 0x1018, 1).unwrap_err();
    assert!(matches!(error.why, Why::NoAnswer { .. }), "{error}");
    assert_eq!(register(&bench, "M1", 0x0805) & 0x08, 0, "the request was taken");
    assert_eq!(register(&bench, "M1", 0x080D) & 0x08, 0, "nothing is there to be fetched");
}

#[test]
fn emergencies_come_with_code_register_and_data_and_are_taken_back() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::Emergency)
        .device("A1")
        .with("code", 0x4310)
        .with("register", 8)
        .with("data", "01 02 03")
        .with("every_ms", 50.0);
    let fault = inject(&mut bench, &entry);
    bench.run_for(Span::ms(120));
    heal(&mut bench, fault);
    bench.run_for(Span::ms(100));
    let id = bench.id("A1");
    let told: Vec<(u16, u8, [u8; 5])> = bench
        .events
        .iter()
        .filter_map(|(_, event)| {
            let Event::Emergency { id: by, emergency } = event else { return None };
            assert_eq!(*by, id);
            Some((emergency.code, emergency.register.0, emergency.data))
        })
        .collect();
    let error = (0x4310, 8, [1, 2, 3, 0, 0]);
    assert_eq!(told, [error, error, error, (0, 0, [0; 5])]);
    let codes: Vec<u16> = effects(&bench, fault)
        .into_iter()
        .map(|effect| {
            let Effect::EmergencySent { code } = effect else { panic!("{effect:?}") };
            code
        })
        .collect();
    assert_eq!(codes, [0x4310, 0x4310, 0x4310, 0], "the log has each");
}

#[test]
fn each_emergency_comes_once_while_frames_get_lost() {
    // One that is lost on its way back has left the mailbox, and the next one may be in it.
    for seed in 1..20 {
        let mut bench = running();
        let mut chance = Seed(seed).stream("lost frames");
        bench.tamper =
            Some(Box::new(move |_| if chance.chance(0.1) { Fate::Lost } else { Fate::Arrives }));
        let entry = FaultEntry::new(FaultName::Emergency).device("A1").with("every_ms", 20.0);
        let fault = inject(&mut bench, &entry);
        bench.run_for(Span::s(2));
        heal(&mut bench, fault);
        bench.tamper = None;
        bench.run_for(Span::s(1));
        let told =
            bench.events.iter().filter(|(_, e)| matches!(e, Event::Emergency { .. })).count();
        let sent = effects(&bench, fault).len();
        assert!(sent > 100, "{sent}");
        assert_eq!(told, sent, "losses of seed {seed}");
    }
}

#[test]
fn a_processor_that_hangs_keeps_its_state_and_loses_its_watchdog() {
    let mut bench = running();
    let fault = inject(&mut bench, &FaultEntry::new(FaultName::FirmwareFault).device("A1"));
    bench.run_for(Span::ms(300));
    // S2 2.10: the PDI watchdog ran out, once; AL status is what it was.
    assert_eq!(register(&bench, "A1", 0x0110) & 0x02, 0);
    assert_eq!(register(&bench, "A1", 0x0443), 1);
    assert_eq!(bench.state("A1"), "OP");
    let inputs = bench.segment.inputs(bench.id("A1")).to_vec();
    // Those of A1: the other one goes on.
    const ITS: std::ops::Range<usize> = 0..8;
    let before = bench.device.inputs()[ITS].to_vec();
    bench.segment.signals_mut().set(inputs[0], 5_000);
    bench.run_for(Span::ms(50));
    assert_eq!(bench.device.inputs()[ITS], before, "inputs stay as they were written last");
    assert!(upload(&mut bench, "A1", 0x1018, 1).is_err());
    assert_eq!(effects(&bench, fault), [Effect::ProcessorStopped]);
    heal(&mut bench, fault);
    bench.run_for(Span::ms(50));
    assert_eq!(register(&bench, "A1", 0x0110) & 0x02, 0x02);
    assert_ne!(bench.device.inputs()[ITS], before);
    assert!(upload(&mut bench, "A1", 0x1018, 1).is_ok());
    assert_eq!(bench.segment.audit(), []);
}

#[test]
fn an_application_that_stops_freezes_its_inputs_alone() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::FirmwareFault).device("A1").with("how", "inputs-frozen");
    let fault = inject(&mut bench, &entry);
    let inputs = bench.segment.inputs(bench.id("A1")).to_vec();
    let before = bench.device.inputs().to_vec();
    bench.segment.signals_mut().set(inputs[0], 5_000);
    bench.run_for(Span::ms(300));
    assert_eq!(bench.device.inputs(), before);
    assert!(upload(&mut bench, "A1", 0x1018, 1).is_ok(), "the mailbox works");
    assert_eq!(register(&bench, "A1", 0x0443), 0, "the controller is served");
    heal(&mut bench, fault);
    bench.run_for(Span::ms(50));
    assert_ne!(bench.device.inputs(), before);
}

// proves: SW-03 partial: seen by the MainDevice
#[test]
fn a_crash_leads_to_init_with_its_own_code_and_back() {
    let mut bench = running();
    assert!(upload(&mut bench, "M1", 0x1018, 1).is_ok());
    let entry = FaultEntry::new(FaultName::FirmwareFault)
        .device("M1")
        .with("how", "restarts")
        .with("boot_ms", 40.0);
    let fault = inject(&mut bench, &entry);
    let id = bench.id("M1");
    let crashed = bench.run_until(Span::s(2), |event| {
        matches!(event, Event::DeviceState { id: of, status, code }
            if *of == id && status.error() && code.value() == 0x0060)
    });
    assert!(crashed, "{:?}", bench.events.last());
    assert_eq!(
        effects(&bench, fault),
        [Effect::ProcessorStopped, Effect::ProcessorRestarted],
        "no more and no less"
    );
    let back = bench.run_until(
        Span::s(10),
        |event| matches!(event, Event::TargetReached { id: of, .. } if *of == id),
    );
    assert!(back && bench.state("M1") == "OP", "{}", bench.state("M1"));
    // Both ends count their messages anew: the first answer is no repetition.
    assert!(upload(&mut bench, "M1", 0x1018, 1).is_ok());
}

#[test]
fn a_dead_state_machine_answers_no_request_and_works_on() {
    let mut bench = running();
    let entry =
        FaultEntry::new(FaultName::FirmwareFault).device("A1").with("how", "state-machine-dead");
    let fault = inject(&mut bench, &entry);
    bench.device.stop(bench.now, AlState::PreOp);
    assert!(bench.run_until(Span::s(10), |event| matches!(event, Event::Stopped)));
    assert_eq!(register(&bench, "A1", 0x0120), 2, "the request lies there");
    assert_eq!((bench.state("A1").as_str(), bench.state("M1").as_str()), ("OP", "PREOP"));
    heal(&mut bench, fault);
    bench.run_for(Span::ms(50));
    assert_eq!(bench.state("A1"), "PREOP");
}

#[test]
fn a_step_up_may_be_refused_a_few_times() {
    let mut bench = Bench::new(PLANT);
    let entry = FaultEntry::new(FaultName::InitRefused)
        .device("M1")
        .with("to", "OP")
        .with("code", 0x0052)
        .with("refusals", 2);
    inject(&mut bench, &entry);
    bench.start(AlState::Op);
    let refused = bench.events.iter().filter(|(_, event)| {
        matches!(event, Event::Refused { to: AlState::Op, code, .. } if code.value() == 0x0052)
    });
    assert_eq!(refused.count(), 2);
}

// proves: SW-03 partial: the MainDevice's own silence as the cause
#[test]
fn outputs_that_do_not_come_let_every_watchdog_expire() {
    let mut bench = running();
    let dropped = bench.segment.host(Path::A).tx_dropped;
    let entry = FaultEntry::new(FaultName::WatchdogStarved).with("pause_ms", 150.0);
    let fault = inject(&mut bench, &entry);
    let starved = bench.run_until(Span::s(2), |event| {
        matches!(event, Event::DeviceState { status, code, .. }
            if status.error() && code.value() == 0x001B)
    });
    assert!(starved);
    assert_eq!(register(&bench, "M1", 0x0442), 1, "the process data watchdog expired once");
    assert_eq!(register(&bench, "A1", 0x0442), 0, "who has no outputs has nothing to miss");
    assert!(bench.segment.host(Path::A).tx_dropped > dropped);
    let record = bench.segment.truth().fault(fault).unwrap();
    assert!(record.frames_lost > 50, "{}", record.frames_lost);
    assert_eq!(bench.segment.audit(), []);
}

#[test]
fn a_watchdog_shorter_than_the_cycle_expires_by_itself() {
    let mut bench = running();
    let entry = FaultEntry::new(FaultName::WatchdogStarved).device("M1").with("watchdog_ms", 0.3);
    let fault = inject(&mut bench, &entry);
    assert_eq!(register(&bench, "M1", 0x0420), 3);
    bench.run_for(Span::ms(30));
    assert!(register(&bench, "M1", 0x0442) > 0);
    heal(&mut bench, fault);
    assert_eq!((register(&bench, "M1", 0x0420), register(&bench, "M1", 0x0421)), (0xE8, 0x03));
    bench.run_for(Span::s(8));
    assert_eq!(bench.state("M1"), "OP");
}

#[test]
fn faults_of_software_need_software() {
    let mut bench = running();
    for (name, words) in [
        (FaultName::MailboxStuck, "`K1` has no mailbox"),
        (FaultName::FirmwareFault, "`K1` has no processor"),
        (FaultName::Emergency, "`K1` has no mailbox"),
    ] {
        let entry = FaultEntry::new(name).device("K1");
        let error = bench.segment.inject(bench.now, &entry).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let entry = FaultEntry::new(FaultName::Emergency).device("M1").with("data", "xyz");
    let error = bench.segment.inject(bench.now, &entry).unwrap_err().to_string();
    assert!(error.contains("`data` is \"xyz\""), "{error}");
}
