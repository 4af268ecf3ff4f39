//! Our bring-up before devices that answer as real ones did: every reply is taken from a recording, or
//! follows from what was recorded in one of the ways that [`responder`] lists. No segment is involved.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a test reads files")]

mod device;
mod line;
mod responder;
mod tape;

use std::path::{Path, PathBuf};

use linesman_config::identity::RevisionRule;
use linesman_config::plan::{DeviceSettings, Plan, PlanOptions, PlannedDevice};
use linesman_config::profile::DeviceProfile;
use linesman_config::start_up::{StartUpAction, StartUpCommand, Transition};
use linesman_diagnosis::{Direction, FrameSeen};
use linesman_lab::replay::compare::{Outcome, compare};
use linesman_lab::replay::recording::datagrams;
use linesman_lab::replay::{Learned, Recorder, Recording, learn};
use linesman_link::capture::{CaptureReader, RunClock};
use linesman_proto::address::{self, DeviceId, Network, StationAddress};
use linesman_proto::mailbox::Message;
use linesman_proto::mailbox::coe::sdo::{Request, Response};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress};
use linesman_proto::port::Port;
use linesman_proto::sii::Image;
use linesman_proto::state::AlState;
use linesman_proto::topology::{End, Tree, Wired};

use line::Line;
use responder::Responder;
use tape::{Tape, tapes};

const OUTPUTS: &str = "ec-replay-ek1100-el2828-el2889";
const ANALOG: &str = "ec-replay-ek1914-el3004-configure";

fn recorded(path: &Path) -> (Recording, Learned) {
    let mut clock = RunClock::for_file(path).unwrap();
    let mut reader = CaptureReader::open(path).unwrap();
    let mut recorder = Recorder::default();
    while let Some(frame) = reader.next_frame() {
        let moment = clock.place(frame.interface, frame.time);
        recorder.take(&FrameSeen {
            network: Network::default(),
            path: None,
            direction: Direction::Unknown,
            time: moment.at,
            number: frame.number.0,
            fcs: frame.fcs,
            truncated: frame.truncated,
            probe: None,
            bytes: frame.bytes,
        });
    }
    let recording = recorder.finish();
    let learned = learn(&recording);
    (recording, learned)
}

fn capture(name: &str) -> Option<PathBuf> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let data = std::env::var("LINESMAN_DATA").unwrap_or(root.to_owned());
    let path = PathBuf::from(format!("{data}/pcap/{name}.pcapng"));
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: no {}; set LINESMAN_DATA", path.display());
    None
}

/// The plan that follows from the SII words that were recorded; one device behind the other.
fn plan(tapes: &[Tape], targets: &[AlState]) -> Plan {
    let planned: Vec<PlannedDevice> = (tapes.iter().zip(targets).enumerate())
        .map(|(at, (tape, target))| {
            let words = tape.sii.keys().max().map_or(0x40, |last| last + 1).max(0x40);
            let bytes: Vec<u8> = (0..words)
                .flat_map(|word| tape.sii.get(&word).copied().unwrap_or(0).to_le_bytes())
                .collect();
            let image = Image::parse(&bytes).unwrap();
            PlannedDevice {
                name: format!("{} ({})", at + 1, image.order().unwrap_or("?")),
                station: StationAddress(0x1001 + at as u16),
                identity: image.identity,
                revision_rule: RevisionRule::Equal,
                profile: DeviceProfile {
                    device_emulation: tape.mirrors(),
                    ..DeviceProfile::from_sii(&image)
                },
                target: *target,
                start_up: downloads(tape),
                settings: DeviceSettings::default(),
            }
        })
        .collect();
    let wired = (0..planned.len()).map(|node| Wired {
        on: match node.checked_sub(1) {
            Some(before) => End::Controller(before, Port::B),
            None => End::MainDevice(address::Path::A),
        },
        entry: Port::A,
    });
    let tree = Tree::from_wiring(&wired.collect::<Vec<_>>(), None).unwrap();
    Plan::build(&planned, tree, &PlanOptions::default()).unwrap()
}

/// The objects that were written in the recording, as start-up commands.
fn downloads(tape: &Tape) -> Vec<StartUpCommand> {
    let one = |request: &[u8]| {
        let message = Message::parse(request).ok()?;
        let CoeMessage::SdoRequest(Request::Download { object, complete, initial }) =
            CoeMessage::parse(message.data).ok()?
        else {
            return None;
        };
        let data = initial.data().to_vec();
        Some(StartUpCommand {
            transition: Transition::INIT_TO_PRE_OP,
            action: StartUpAction::CoeDownload { object, complete_access: complete, data },
            comment: String::new(),
        })
    };
    tape.dialogues.iter().filter_map(|dialogue| one(&dialogue.request)).collect()
}

/// What was asked for in the recording, and the value where it came in one answer.
fn uploads(tape: &Tape) -> Vec<(ObjectAddress, bool, Option<Vec<u8>>)> {
    let coe = |buffer: &[u8]| Message::parse(buffer).map(|message| message.data.to_vec());
    let one = |request: &[u8], answer: &[u8]| {
        let (request, answer) = (coe(request).ok()?, coe(answer).ok()?);
        let CoeMessage::SdoRequest(Request::Upload { object, complete }) =
            CoeMessage::parse(&request).ok()?
        else {
            return None;
        };
        let parsed = CoeMessage::parse(&answer).ok()?;
        let mut value = None;
        if let CoeMessage::SdoResponse(Response::Upload { initial, .. }) = parsed
            && initial.data().len() == initial.size() as usize
        {
            value = Some(initial.data().to_vec());
        }
        Some((object, complete, value))
    };
    tape.dialogues.iter().filter_map(|one_| one(&one_.request, &one_.answer)).collect()
}

/// Brings the devices of a recording to `targets`; all that was asked must be as recorded.
fn judged(name: &str, targets: &[AlState]) -> Option<Line> {
    let (recording, learned) = recorded(&capture(name)?);
    let tapes = tapes(&recording, &learned);
    assert_eq!(tapes.len(), targets.len(), "{name}: devices");
    let asked: Vec<_> = tapes.iter().map(uploads).collect();
    let plan = plan(&tapes, targets);
    let mut line = Line::new(Responder::of(tapes));
    let up = line.start(plan);
    assert!(up, "{name}: {:#?}\n{:#?}", line.told, line.responder.remarks);
    let wanted: Vec<_> = targets.iter().map(|state| state.bits()).collect();
    assert_eq!(line.responder.states(), wanted, "{name}");
    assert_eq!(line.refused, 0, "{name}: {:#?}", line.told);
    for (at, asked) in asked.into_iter().enumerate() {
        for (object, complete, value) in asked {
            let got = line.upload(DeviceId(at as u32), object, complete);
            match (got, value) {
                (Some(Ok(got)), Some(value)) => assert_eq!(got, value, "{name}: {object}"),
                // Segments, or a refusal: that an answer came tells that it was understood.
                (Some(_), None) => {}
                (got, value) => panic!("{name}: {object}: {got:?}, recorded {value:?}"),
            }
        }
    }
    let remarks = &line.responder.remarks;
    assert!(remarks.breaches.is_empty(), "{name}: {:#?}", remarks.breaches);
    // Nothing that was never recorded was needed, beyond counters, which are only watched.
    let counters = 0x0300..0x0314;
    let others: Vec<_> =
        remarks.unrecorded.iter().filter(|(_, address)| !counters.contains(address)).collect();
    assert!(others.is_empty(), "{name}: {others:x?}");
    Some(line)
}

#[test]
fn recorded_outputs_accept_our_bring_up() {
    let Some(mut line) = judged(OUTPUTS, &[AlState::Op; 3]) else { return };
    line.exchange(0xA5);
    assert_eq!(line.working_counter_errors(), 0);
    // Where the real terminals had them: eight outputs, sixteen outputs.
    let outputs = [(1, 0x0F00), (2, 0x0F00), (2, 0x0F01)];
    assert!(outputs.iter().all(|(at, address)| line.responder.memory(*at, *address) == 0xA5));
    assert!(line.responder.remarks.breaches.is_empty(), "{:?}", line.responder.remarks);
}

/// No recording of these two goes beyond PREOP; their mailboxes answer as recorded.
#[test]
fn a_recorded_analog_input_accepts_our_bring_up() {
    judged(ANALOG, &[AlState::PreOp; 2]);
    judged("ec-replay-ek1914-el3004-mailbox", &[AlState::PreOp; 2]);
}

#[test]
fn other_recordings_accept_our_bring_up() {
    judged("ec-replay-ek1100-alias-address", &[AlState::PreOp; 3]);
    judged("ec-replay-ek1914-segmented-upload", &[AlState::PreOp; 2]);
    judged("echist-replay-el2828-el2889-202405", &[AlState::Op; 3]);
}

/// A referee that accepts everything judges nothing.
#[test]
fn what_the_real_devices_were_not_told_is_not_accepted() {
    let Some(path) = capture(OUTPUTS) else { return };
    let (recording, learned) = recorded(&path);
    let tapes = tapes(&recording, &learned);
    let wrong = |change: &dyn Fn(&mut Plan)| {
        let mut plan = plan(&tapes, &[AlState::Op; 3]);
        change(&mut plan);
        let mut line = Line::new(Responder::of(tapes.clone()));
        let up = line.start(plan);
        (up, format!("{:?} {:?}", line.responder.remarks.breaches, line.told))
    };
    let (_, told) = wrong(&|plan| plan.devices[1].sync_managers[0].1.length = 2);
    assert!(told.contains("2: asks for state 4"), "{told}");
    let (_, told) = wrong(&|plan| plan.devices[2].fmmus.clear());
    assert!(told.contains("3: asks for state 4"), "{told}");
    let (up, told) = wrong(&|plan| plan.devices[1].identity.product_code += 1);
    assert!(!up && told.contains("product code"), "{told}");
}

/// The recording's own requests get the recording's own answers, at the recorded times.
#[test]
fn each_recording_is_answered_as_it_was() {
    let names = [
        OUTPUTS,
        ANALOG,
        "ec-replay-ek1914-el3004-mailbox",
        "ec-replay-ek1914-segmented-upload",
        "echist-replay-el2828-el2889-202405",
    ];
    for name in names {
        let Some(path) = capture(name) else { return };
        let (recording, learned) = recorded(&path);
        let mut responder = Responder::of(tapes(&recording, &learned));
        let (mut compared, mut unknown, mut different) = (0_usize, 0_usize, Vec::new());
        for turn in &recording.turns {
            let Some(reply) = &turn.reply else { continue };
            let mut frame = turn.request.bytes.clone();
            responder.remarks.guessed = false;
            responder.answer(turn.request.at, &mut frame);
            if responder.remarks.guessed {
                unknown += reply.datagrams().len();
                continue;
            }
            for (recorded, ours) in reply.datagrams().iter().zip(datagrams(&frame)) {
                compared += 1;
                // Of the status of a SyncManager the bit "full" alone follows from what was recorded.
                const FULL: u8 = 1 << 3;
                let is_status = matches!(recorded.ado.0, 0x0805 | 0x080D) && ours.data.len() == 1;
                let full = |data: &[u8]| data[0] & FULL;
                if is_status && recorded.wkc == ours.wkc && full(recorded.data) == full(ours.data) {
                    continue;
                }
                if let Outcome::Differs(difference) = compare(recorded, &ours, None) {
                    different.push((reply.number, recorded.ado, difference));
                }
            }
        }
        println!("{name}: {} of {compared} differ, {unknown} not known", different.len());
        assert!(different.is_empty(), "{name}: {:#?}", &different[..different.len().min(20)]);
        assert!(unknown * 10 < compared, "{name}: {unknown} are not known");
    }
}
