use linesman_config::identity::Mismatch;
use linesman_config::plan::{
    DevicePlan, HotConnectGroup, IdentificationCheck, IdentificationSource,
};
use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::coe::{Emergency, ErrorRegister};
use linesman_proto::port::Port;
use linesman_proto::register::{AlStatus, DlStatus, ErrorCounter, ErrorCounters, PortState};
use linesman_proto::sii::Identity;
use linesman_proto::state::{AlState, AlStatusCode, DeviceState};
use linesman_proto::topology::{End, Tree, Wired};

use super::*;

/// A coupler and six terminals behind it, as in the message window of the sources.
fn watch() -> Watch {
    let names = ["EK1100", "EL1002", "EL2004", "EL7041-0001", "EL7041", "EL2252", "EL1262"];
    let wired: Vec<_> = (0..names.len())
        .map(|node| {
            let on = match node {
                0 => End::MainDevice(Path::A),
                1 => End::Controller(0, Port::B),
                node => End::Controller(node - 1, Port::B),
            };
            Wired { on, entry: Port::A }
        })
        .collect();
    let mut plan = Plan::empty(Tree::from_wiring(&wired, None).unwrap());
    for (index, kind) in names.iter().enumerate() {
        let mut device = DevicePlan::bare(DeviceId(index as u32));
        device.name = format!("Term {}", 64 + index);
        device.type_name = (*kind).to_owned();
        device.station = linesman_proto::address::StationAddress(0x1015 + index as u16);
        plan.devices.push(device);
    }
    Watch::new(Arc::new(plan))
}

/// The same, of which the terminals 65 and 66 are a group that may be absent.
fn watch_with_group() -> Watch {
    let mut plan = Plan::clone(watch().plan());
    plan.groups.push(HotConnectGroup {
        name: "tool".to_owned(),
        members: vec![DeviceId(1), DeviceId(2)],
        optional: true,
        places: Vec::new(),
    });
    Watch::new(Arc::new(plan))
}

// proves: RED-16 (U)
#[test]
fn the_state_word_names_slave_and_port_where_a_ring_is_open_whatever_port_that_is() {
    // Two junctions in a ring, wired at this port: it leads from one to the other, and from there to the second card.
    for (place, port) in [Port::B, Port::C, Port::D].into_iter().enumerate() {
        let wired = [End::MainDevice(Path::A), End::Controller(0, port)];
        let wired = wired.map(|on| Wired { on, entry: Port::A });
        let mut plan = Plan::empty(Tree::from_wiring(&wired, Some((1, port))).unwrap());
        plan.devices.extend([0, 1].map(|id| DevicePlan::bare(DeviceId(id))));
        let mut watch = Watch::new(Arc::new(plan));
        for id in [0, 1] {
            watch.handle_event(at(0), &state(id, AlState::Op, false, 0));
        }
        let words = |watch: &Watch| {
            let devices = watch.network_status().devices();
            devices.iter().map(|device| device.state().0).collect::<Vec<_>>()
        };
        let (whole, out) = ([Port::A, port], [0x2000, 0x4000, 0x8000][place]);
        let mut see = |first: &[Port], second: &[Port]| {
            watch.handle_event(at(1), &links(0, first));
            watch.handle_event(at(1), &links(1, second));
            words(&watch)
        };
        assert_eq!(see(&whole, &whole), [0x0008, 0x0008], "whole");
        assert_eq!(see(&[Port::A], &[port]), [0x0408 | out, 0x1408], "between the two");
        assert_eq!(see(&[port], &whole), [0x1408, 0x0008], "at the first card");
        assert_eq!(see(&whole, &[Port::A]), [0x0008, 0x0408 | out], "at the second card");
        // A link, and a loop that is closed; and a link where there should be none.
        let Event::Links { status, .. } = links(0, &[Port::A]) else { unreachable!() };
        let signal = PortState { link: true, closed: true, communication: false };
        let status = status.with_port(port, signal);
        watch.handle_event(at(2), &Event::Links { id: DeviceId(0), status });
        assert_eq!(words(&watch)[0], 0x0208 | out);
        let other = if port == Port::C { Port::B } else { Port::C };
        watch.handle_event(at(3), &links(0, &[Port::A, port, other]));
        assert_eq!(words(&watch)[0], 0x0808 | DeviceState::port_bit(other));
    }
}

// proves: HC-15 (U)
#[test]
fn groups_stand_last_in_the_topology_list_with_planned_and_present_counts() {
    let mut watch = watch_with_group();
    let order = watch.network_status().topology_order();
    assert_eq!(order, [0, 3, 4, 5, 6, 1, 2].map(DeviceId));
    assert_eq!(watch.network_status().hot_connect_counts(), (2, 0));
    for id in 0..7 {
        if id != 2 {
            watch.handle_event(at(1), &state(id, AlState::Op, false, 0));
        }
    }
    assert_eq!(watch.network_status().hot_connect_counts(), (2, 1));
    assert_eq!(watch.network_status().topology_order(), order);
}

// proves: PLC-10 (U)
#[test]
fn the_topology_list_has_64_bytes_each_with_neighbours_state_and_counts_of_groups() {
    let mut watch = watch_with_group();
    let list = |watch: &Watch| watch.network_status().topology(watch.plan());
    for id in [0, 1, 3] {
        watch.handle_event(at(1), &state(id, AlState::Op, false, 0));
    }
    let all = list(&watch);
    assert_eq!(all.iter().map(|one| one.id.0).collect::<Vec<_>>(), [0, 3, 4, 5, 6, 1, 2]);
    let words = |entry: &TopologyEntry| {
        let bytes = entry.to_bytes();
        assert_eq!(bytes.len(), 64);
        let words = bytes.chunks_exact(2).map(|word| u16::from_le_bytes([word[0], word[1]]));
        words.collect::<Vec<u16>>()
    };
    // Own addresses; station addresses at A to D; places at A to D; reserved; status; counts; reserved.
    let coupler = [0x1015, 0, 0, 0x1016, 0, 0, 0, 0xFFFF, 0, 0];
    assert_eq!(words(&all[0])[..10], coupler);
    assert_eq!(words(&all[0])[18..22], [4, 0, 2, 1], "there; two planned in groups, one there");
    let first_of_group = [0x1016, 0xFFFF, 0x1015, 0x1017, 0, 0, 0, 0xFFFE, 0, 0];
    assert_eq!(words(&all[5])[..10], first_of_group);
    assert_eq!(words(&all[5])[18], 4 | 8 | 16, "there, first of a group, in a group");
    assert_eq!(words(&all[6])[18..22], [16, 0, 2, 1], "not there, in a group");
    assert!(words(&all[6])[10..18].iter().chain(&words(&all[6])[22..]).all(|word| *word == 0));
}

// proves: PLC-10 (U) partial: clocks of 64 bits, and groups at wrong ports
#[test]
fn the_topology_list_tells_clocks_of_64_bits_and_ports_at_which_a_group_may_not_be() {
    let mut watch = watch_with_group();
    let status = |watch: &Watch, id: u32| {
        let list = watch.network_status().topology(watch.plan());
        list.iter().find(|entry| entry.id == DeviceId(id)).map(|entry| entry.status & 0b1110_0010)
    };
    watch.handle_event(at(1), &Event::ClockSet { id: DeviceId(3), is_wide: true });
    watch.handle_event(at(1), &Event::ClockSet { id: DeviceId(4), is_wide: false });
    assert_eq!([3, 4].map(|id| status(&watch, id)), [Some(2), Some(0)]);
    for (port, bits) in [(Port::B, 1 << 5), (Port::C, 1 << 6), (Port::D, 1 << 7)] {
        let place = Some((DeviceId(6), port));
        watch.handle_event(at(2), &Event::GroupMisplaced { group: 0, place });
        assert_eq!(status(&watch, 6), Some(bits));
    }
    let group = |watch: &Watch| watch.network_status().groups()[0].refusal();
    assert_eq!(group(&watch), Some(GroupRefusal::Place(Some((DeviceId(6), Port::D)))));
    // It is pulled; then it is where it may be.
    watch.handle_event(at(3), &links(6, &[Port::A]));
    assert_eq!((status(&watch, 6), group(&watch)), (Some(0), None));
    let (source, compulsory) = (IdentificationSource::AlStatus, true);
    let check = IdentificationCheck { source, value: 5, compulsory };
    let (found, belongs_to) = (Some(7), None);
    let wrong = Event::WrongIdentification { id: DeviceId(1), check, found, belongs_to };
    watch.handle_event(at(4), &wrong);
    assert_eq!(group(&watch), Some(GroupRefusal::Number { check, found }));
    watch.handle_event(at(5), &Event::GroupJoined { group: 0, place: None });
    assert_eq!(group(&watch), None);
}

#[test]
fn a_group_that_joins_and_leaves_is_told_and_its_absence_is_no_error() {
    let mut watch = watch_with_group();
    for id in [0, 3, 4, 5, 6] {
        watch.handle_event(at(1), &state(id, AlState::Op, false, 0));
    }
    assert_eq!(watch.network_status().network_state(), NetworkState::default());
    watch.handle_event(at(1), &Event::AllReached);
    let place = Some((DeviceId(0), Port::C));
    watch.handle_event(at(2), &Event::GroupJoined { group: 0, place });
    let group = watch.network_status().groups()[0].clone();
    assert_eq!((group.has_joined(), group.place()), (true, place));
    watch.handle_event(at(3), &Event::DeviceLost { id: DeviceId(1) });
    watch.handle_event(at(3), &Event::GroupLeft { group: 0 });
    watch.handle_event(at(4), &Event::GroupMisplaced { group: 0, place: None });
    watch.handle_timeout(at(1_000));
    let said = texts(&mut watch);
    assert_eq!(
        said[0],
        "5 SubDevices have reached their states; 2 of hot connect groups are not plugged in"
    );
    assert!(said[1].starts_with("hot connect group tool joined at port C of "), "{said:?}");
    assert_eq!(said[2], "hot connect group tool left: its data are not valid any more");
    assert!(said[3].contains("at an unknown port, where it may not be"), "{said:?}");
    assert_eq!(said.len(), 4, "{said:?}");
    assert!(!watch.network_status().groups()[0].has_joined());
}

fn at(ms: u64) -> Instant {
    Instant::ZERO + Span::ms(ms)
}

fn texts(watch: &mut Watch) -> Vec<String> {
    std::iter::from_fn(|| watch.poll_entry()).map(|entry| entry.text).collect()
}

fn state(id: u32, state: AlState, error: bool, code: u16) -> Event {
    let status = AlStatus::new(state).with_error(error);
    Event::DeviceState { id: DeviceId(id), status, code: AlStatusCode(code) }
}

fn links(id: u32, ports: &[Port]) -> Event {
    let mut status = DlStatus(0);
    for port in Port::ALL {
        let open = ports.contains(&port);
        let state = PortState { link: open, closed: !open, communication: open };
        status = status.with_port(port, state);
    }
    Event::Links { id: DeviceId(id), status }
}

fn counters(values: [u8; ErrorCounters::LEN]) -> Event {
    let counters = ErrorCounters::from_bytes(&values, ErrorCounters::START);
    Event::Counters { id: DeviceId(1), counters }
}

// The message window of S1 L412-422.
// proves: DIA-13 partial: the words; the file is tested with the log
#[test]
fn a_cable_that_is_pulled_and_plugged_is_told_as_the_sources_do() {
    let mut watch = watch();
    for id in 0..7 {
        watch.handle_event(at(0), &state(id, AlState::Op, false, 0));
        watch.handle_event(at(0), &Event::TargetReached { id: DeviceId(id), state: AlState::Op });
    }
    texts(&mut watch);
    for id in 0..7 {
        watch.handle_event(at(182 + u64::from(id)), &Event::DeviceLost { id: DeviceId(id) });
    }
    assert_eq!(texts(&mut watch), Vec::<String>::new(), "waits whether more get lost");
    assert_eq!(watch.poll_timeout(), Some(at(202)));
    watch.handle_timeout(at(202));
    let entry = watch.poll_entry().unwrap();
    assert_eq!(entry.at, at(182));
    assert_eq!(
        entry.text,
        "'Term 64 (EK1100)' (1015) - 'Term 70 (EL1262)' (101b) Communication interrupted"
    );
    for (id, ms) in (0..7).zip((5274..).step_by(2)) {
        let event = Event::DeviceBack { id: DeviceId(id), restarted: false };
        watch.handle_event(at(ms), &event);
    }
    let back = texts(&mut watch);
    assert_eq!(back.len(), 7);
    assert_eq!(back[6], "'Term 70 (EL1262)' (101b) Communication re-established");
}

#[test]
fn those_who_are_no_neighbours_are_told_of_apart() {
    let mut watch = watch();
    for id in [1, 4, 5] {
        watch.handle_event(at(1), &Event::DeviceLost { id: DeviceId(id) });
    }
    watch.handle_timeout(at(30));
    assert_eq!(
        texts(&mut watch),
        [
            "'Term 65 (EL1002)' (1016) Communication interrupted",
            "'Term 68 (EL7041)' (1019) - 'Term 69 (EL2252)' (101a) Communication interrupted"
        ]
    );
}

// S0 L2230-2233 and L2240-2245.
// proves: SW-02 partial: the words, SW-03 partial: the words
#[test]
fn aborted_and_abnormal_state_changes_read_as_in_the_sources() {
    let mut watch = watch();
    let status = AlStatus::new(AlState::Init).with_error(true);
    let refused = Event::Refused {
        id: DeviceId(1),
        from: Some(AlState::Init),
        to: AlState::PreOp,
        status,
        code: AlStatusCode(0x0014),
    };
    watch.handle_event(at(1), &refused);
    let lines = texts(&mut watch);
    assert_eq!(
        lines[0],
        "'Term 65 (EL1002)' (1016): state change aborted (requested PREOP, back to INIT)"
    );
    assert!(
        lines[1].starts_with(
            "'Term 65 (EL1002)' (1016): INIT to PREOP failed, read 0x0011, expected 0x0002, AL 0x0014 "
        ),
        "{}",
        lines[1]
    );
    watch.handle_event(at(2), &state(2, AlState::Op, false, 0));
    watch.handle_event(at(2), &Event::TargetReached { id: DeviceId(2), state: AlState::Op });
    texts(&mut watch);
    watch.handle_event(at(3), &state(2, AlState::SafeOp, true, 0x001B));
    let fell = Event::AbnormalState {
        id: DeviceId(2),
        from: AlState::Op,
        status: AlStatus::new(AlState::SafeOp).with_error(true),
        code: AlStatusCode(0x001B),
    };
    watch.handle_event(at(3), &fell);
    let lines = texts(&mut watch);
    assert!(
        lines[0].starts_with(
            "'Term 66 (EL2004)' (1017): abnormal state change (from OP to SAFEOP), AL 0x001B"
        ),
        "{lines:?}"
    );
    let device = watch.network_status().device(DeviceId(2)).unwrap();
    assert_eq!(device.state().to_string(), "ERR SAFEOP");
    assert_eq!((device.abnormal_changes(), device.presence_changes()), (1, 1));
    assert_eq!(device.history().next().unwrap().code, AlStatusCode(0x001B));
}

// proves: HW-12, PLC-16 partial: the numbers
#[test]
fn the_change_counters_begin_at_nought_and_one() {
    let mut watch = watch();
    let changes = |watch: &Watch| {
        let device = watch.network_status().device(DeviceId(3)).unwrap();
        (device.abnormal_changes(), device.presence_changes())
    };
    // Not found at first, then found: that is how each start looks.
    watch.handle_event(at(0), &Event::DeviceLost { id: DeviceId(3) });
    watch.handle_event(at(1), &state(3, AlState::Init, false, 0));
    assert_eq!(changes(&watch), (0, 1));
    for time in [2, 4] {
        watch.handle_event(at(time), &Event::DeviceLost { id: DeviceId(3) });
        let back = Event::DeviceBack { id: DeviceId(3), restarted: true };
        watch.handle_event(at(time + 1), &back);
    }
    assert_eq!(changes(&watch), (0, 3));
    // It left OP by itself.
    watch.handle_event(at(6), &state(3, AlState::Op, false, 0));
    let fell = Event::AbnormalState {
        id: DeviceId(3),
        from: AlState::Op,
        status: AlStatus::new(AlState::SafeOp).with_error(true),
        code: AlStatusCode(0x001B),
    };
    watch.handle_event(at(7), &fell);
    assert_eq!(changes(&watch), (1, 3));
    watch.clear();
    assert_eq!(changes(&watch), (0, 1));
}

// proves: PLC-05 partial: from events, PLC-06 partial: from events
#[test]
fn state_words_follow_from_plan_and_ports() {
    let mut watch = watch();
    let text = |watch: &Watch, id| {
        watch.network_status().device(DeviceId(id)).unwrap().state().to_string()
    };
    assert_eq!(text(&watch, 0), "INIT NO_COMM", "nobody has seen it");
    for id in 0..7 {
        watch.handle_event(at(0), &state(id, AlState::Op, false, 0));
    }
    watch.handle_event(at(1), &links(0, &[Port::A, Port::B]));
    watch.handle_event(at(1), &links(6, &[Port::A]));
    assert_eq!((text(&watch, 0), text(&watch, 6)), ("OP".into(), "OP".into()));
    watch.handle_event(at(2), &links(0, &[Port::A, Port::C]));
    assert_eq!(text(&watch, 0), "OP LNK_MIS LNK_ADD B C");
    watch.handle_event(at(2), &links(0, &[Port::A]));
    assert_eq!(text(&watch, 0), "OP LNK_MIS B");
    assert_eq!(watch.network_status().device(DeviceId(0)).unwrap().state().0, 0x2408);
    watch.handle_event(at(3), &state(6, AlState::Init, true, 0x0014));
    let refused = Event::Refused {
        id: DeviceId(6),
        from: Some(AlState::Init),
        to: AlState::PreOp,
        status: AlStatus::new(AlState::Init).with_error(true),
        code: AlStatusCode(0x0014),
    };
    watch.handle_event(at(3), &refused);
    let stranger = Event::WrongDevice {
        id: DeviceId(6),
        mismatch: Mismatch::Product,
        expected: Identity::default(),
        found: Identity::default(),
    };
    watch.handle_event(at(4), &stranger);
    assert_eq!(text(&watch, 6), "ERR INIT VPRS INIT_ERR");
    assert_eq!(watch.network_status().device(DeviceId(6)).unwrap().state().0, 0x0071);
}

// proves: PLC-07 partial: from events
#[test]
fn the_network_word_sums_up() {
    let mut watch = watch();
    for id in 0..7 {
        watch.handle_event(at(0), &state(id, AlState::Op, false, 0));
    }
    assert_eq!(watch.network_status().network_state().to_string(), "OK");
    watch.handle_event(at(1), &state(4, AlState::SafeOp, true, 0x001B));
    assert_eq!(watch.network_status().network_state().0, 0x0C00);
    watch.handle_carrier(at(2), Path::A, false);
    watch.handle_event(at(2), &Event::Ring { intact: false });
    assert_eq!(watch.network_status().network_state().0, 0x0C09);
    watch.handle_carrier(at(3), Path::A, true);
    watch.handle_event(at(3), &Event::Ring { intact: true });
    watch.handle_event(at(3), &Event::OutputsWithheld { task: 0 });
    let clock = |difference, apart| {
        let (id, window) = (DeviceId(2), Span::us(1));
        Event::ClockDifference { id, difference, window, apart }
    };
    watch.handle_event(at(3), &clock(Span::us(2), true));
    watch.handle_send_failure(true);
    assert_eq!(watch.network_status().network_state().0, 0x1C30);
    watch.handle_event(at(4), &clock(Span::ns(300), false));
    assert_eq!(watch.network_status().network_state().0, 0x0C30);
    assert_eq!(
        watch.network_status().device(DeviceId(2)).unwrap().clock_difference(),
        Some(Span::ns(300))
    );
}

// proves: PLC-07 partial: from events
#[test]
fn reset_is_under_way_until_each_subdevice_is_up_or_has_refused() {
    let mut watch = watch();
    let word = |watch: &Watch| watch.network_status().network_state().0;
    let reset = NetworkState::RESET;
    watch.begin_reset();
    assert_eq!(word(&watch) & reset, reset, "nothing is known yet");
    for id in 0..6 {
        watch.handle_event(at(0), &state(id, AlState::Op, false, 0));
        assert_eq!(word(&watch) & reset, reset);
    }
    watch.handle_event(at(1), &Event::DeviceLost { id: DeviceId(6) });
    assert_eq!(word(&watch) & reset, 0, "the last one is not there");
    for id in 0..6 {
        watch.handle_event(at(2), &Event::DeviceLost { id: DeviceId(id) });
    }
    watch.handle_event(at(2), &Event::OutputsLocked);
    assert_eq!(word(&watch) & (reset | NetworkState::LOCKED), NetworkState::LOCKED);
    watch.handle_event(at(3), &state(0, AlState::PreOp, false, 0));
    assert_eq!(word(&watch) & reset, reset, "the first after all were lost");
    watch.handle_event(at(4), &Event::AllReached);
    assert_eq!(word(&watch) & reset, 0);
    watch.handle_event(at(5), &Event::ResetBegun);
    assert_eq!(word(&watch) & (reset | NetworkState::LOCKED), reset, "a program asked for it");
}

// proves: DIA-09 partial: totals, HW-19 partial: totals
#[test]
fn counters_are_summed_up_through_clears_and_restarts() {
    let mut watch = watch();
    let mut values = [0; ErrorCounters::LEN];
    values[0] = 200;
    watch.handle_event(at(0), &counters(values));
    let count = |watch: &Watch| {
        let totals = watch.network_status().device(DeviceId(1)).unwrap().counters();
        (totals.count(ErrorCounter::InvalidFrame(Port::A)).unwrap(), totals.is_lower_bound())
    };
    assert_eq!(count(&watch), (0, false), "what the power-on brought counts for nothing");
    values[0] = 203;
    watch.handle_event(at(1), &counters(values));
    assert_eq!(count(&watch), (3, false));
    assert_eq!(
        texts(&mut watch),
        ["'Term 65 (EL1002)' (1016): error counters rose: invalid frames, port A +3"]
    );
    // Another tool clears, then two more happen.
    values[0] = 2;
    watch.handle_event(at(2), &counters(values));
    assert_eq!(count(&watch), (5, true), "what was between is lost, and that is said");
    // A restart: 1 more.
    watch.handle_event(at(3), &Event::DeviceBack { id: DeviceId(1), restarted: true });
    values[0] = 1;
    watch.handle_event(at(4), &counters(values));
    assert_eq!(count(&watch).0, 6);
    watch.clear();
    assert_eq!(count(&watch).0, 0);
    values[0] = 4;
    watch.handle_event(at(5), &counters(values));
    assert_eq!(count(&watch).0, 3);
    let totals = watch.network_status().device(DeviceId(1)).unwrap().counters();
    assert_eq!(totals.at_port(Port::A), Some(3));
    assert_eq!(totals.registers().unwrap().value(ErrorCounter::InvalidFrame(Port::A)), Some(4));
}

#[test]
fn an_emergency_is_told_with_its_class() {
    let mut watch = watch();
    let emergency = Emergency { code: 0x8611, register: ErrorRegister(0x20), data: [0; 5] };
    watch.handle_event(at(0), &Event::Emergency { id: DeviceId(4), emergency });
    let lines = texts(&mut watch);
    assert!(lines[0].starts_with("'Term 68 (EL7041)' (1019): emergency 0x8611 ("), "{lines:?}");
}

#[test]
fn notifications_and_emergencies_of_a_drive_are_told() {
    // Header: operation and drive in the first byte, elements, IDN; then the data.
    for (data, severity, expected) in [
        (
            &[0x05, 0x01, 99, 0, 0x03, 0][..],
            Severity::Info,
            "drive 0 notifies: procedure command S-0-0099: done",
        ),
        (
            &[0x25, 0x01, 99, 0, 0x0F, 0],
            Severity::Warning,
            "drive 1 notifies: procedure command S-0-0099: error",
        ),
        (
            &[0x05, 0x40, 51, 0, 1, 0xAB],
            Severity::Info,
            "drive 0 notifies: value of S-0-0051: 01 AB",
        ),
        (&[0x06, 0, 0, 0, 7], Severity::Error, "emergency of drive 0: 07"),
    ] {
        let mut watch = watch();
        let (id, kind, data) = (DeviceId(4), MailboxType::Soe, data.to_vec());
        watch.handle_event(at(0), &Event::Mailbox { id, kind, data });
        let entry = watch.poll_entry().unwrap();
        assert_eq!(entry.severity, severity, "{entry:?}");
        assert!(entry.text.ends_with(expected), "{entry:?}");
    }
    // Neither an answer that nobody waits for nor what is no message is worth a line.
    for data in [&[0x02, 0x40, 51, 0, 1][..], &[5, 0]] {
        let mut watch = watch();
        let (id, kind, data) = (DeviceId(4), MailboxType::Soe, data.to_vec());
        watch.handle_event(at(0), &Event::Mailbox { id, kind, data });
        assert!(texts(&mut watch).is_empty());
    }
}

#[test]
fn a_log_that_nobody_reads_does_not_grow_without_end() {
    let mut watch = watch();
    for round in 0..WAITING_ENTRIES as u64 + 5 {
        watch.handle_carrier(at(round), Path::A, round % 2 == 1);
    }
    assert_eq!(watch.dropped(), 5);
    assert_eq!(texts(&mut watch).len(), WAITING_ENTRIES);
}
