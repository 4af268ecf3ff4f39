//! State words that an application sees in its cycle of a line that fails, through the library.

use linesman::prelude::*;
use linesman::{DeviceState, FrameStatus};
use tempfile::TempDir;

#[allow(dead_code, unreachable_pub, reason = "it is a program of its own, too")]
#[path = "../../../linesman/examples/watched.rs"]
mod watched;

/// Three terminals share one datagram; the last one loses its supply after a second.
const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
[[device]]\nname = \"T3\"\ntype = \"EL1008\"\non = \"T2.B\"\n\
[[device]]\nname = \"T4\"\ntype = \"EL1008\"\non = \"T3.B\"\n\
[[fault]]\nkind = \"device-off\"\ndevice = \"T4\"\nfrom_ms = 1000\n";

/// Whether their working counter was wrong, their states, the frame's bits, the network, who is there.
type Seen = ([bool; 3], [DeviceState; 3], u16, u16, usize);

// S0 L2518-2532: one who does not answer makes the counter of the datagram wrong, and with it the WcState of
// all that share it; the state word says who it is.
// proves: PLC-02, PLC-03, PLC-04, PLC-18 partial: the example does the same
#[test]
fn the_counter_accuses_all_and_the_state_the_one() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("plant.toml");
    std::fs::write(&file, PLANT).unwrap();
    let mut segment = linesman::open(&format!("sim:{}", file.display())).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    let terminals = ["2", "3", "4"].map(|no| plan.device(no).unwrap());
    let mut seen: Vec<Seen> = Vec::new();
    segment
        .run(plan, RunOptions::us(1000), |io| {
            let settled = io.is_settled();
            let frame = io.frame_status(0, 0).unwrap();
            let now = (
                terminals.map(|terminal| io.wc_state(terminal)),
                terminals.map(|terminal| io.state(terminal)),
                frame.wrong_counter,
                io.network_state().0,
                io.present(),
            );
            if (settled || !seen.is_empty()) && seen.last() != Some(&now) {
                seen.push(now);
            }
            if io.now() < linesman::Instant::ZERO + linesman::Span::s(3) {
                Next::Continue
            } else {
                Next::Stop
            }
        })
        .unwrap();
    let (wc, states, wrong, network, present) = seen[0];
    assert_eq!((wc, wrong, network, present), ([false; 3], 0, 0, 4), "{seen:?}");
    assert_eq!(states, [DeviceState::OP; 3]);
    // The first that is otherwise: in that cycle nobody knows yet who it is.
    let (wc, states, wrong, ..) = seen[1];
    assert_eq!(wc, [true; 3], "{seen:?}");
    assert_eq!(wrong.count_ones(), 1, "the bit of its datagram");
    assert_eq!(states, [DeviceState::OP; 3]);
    // The last: the others go on, one is not there, and its neighbour misses a link.
    let (wc, states, wrong, network, present) = *seen.last().unwrap();
    assert_eq!((wc, wrong, present), ([false, false, true], 0, 3), "{seen:?}");
    assert_eq!(states.map(|state| state.to_string()), ["OP", "OP LNK_MIS B", "INIT NO_COMM"]);
    assert_eq!(states[1].0, 0x2408);
    assert_eq!(network, 0x0900, "one in INIT, one in error");
}

/// The card spoils one frame in forty of those that come back.
const SPOILED: &str = "[[fault]]\nkind = \"nic-damaged\"\nat = \"maindevice\"\npart = \"receiver\"\nhits_per_s = 4000\nfrom_ms = 500\n";

// S0 L2168, L2580-2583.
// proves: HW-31, PLC-08
#[test]
fn lost_frame_fails_all_its_datagrams_and_subdevices_and_the_input_toggle_stays() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("plant.toml");
    let (devices, _) = PLANT.split_once("[[fault]]").unwrap();
    std::fs::write(&file, format!("{devices}{SPOILED}")).unwrap();
    let mut segment = linesman::open(&format!("sim:{}", file.display())).unwrap();
    let plan = segment.scan().unwrap().plan().unwrap();
    let terminals = ["2", "3", "4"].map(|no| plan.device(no).unwrap());
    let mut cycles = Vec::new();
    segment
        .run(plan, RunOptions::us(1000), |io| {
            if io.is_settled() {
                let frame = io.frame_status(0, 0).unwrap();
                let wc_states = terminals.map(|terminal| io.wc_state(terminal));
                cycles.push((frame.wrong_counter, frame.input_toggle, wc_states, io.present()));
            }
            if cycles.len() < 1_500 { Next::Continue } else { Next::Stop }
        })
        .unwrap();
    let lost = cycles.iter().filter(|(wrong, ..)| *wrong == FrameStatus::WHOLE).count();
    assert!((5..500).contains(&lost), "{lost} of {} frames were lost", cycles.len());
    for pair in cycles.windows(2) {
        let [(_, before, ..), (wrong, toggle, wc_states, present)] = pair else { unreachable!() };
        assert_eq!(*present, 4, "nobody is gone");
        match *wrong {
            0 => {
                assert_ne!(toggle, before, "new inputs");
                assert_eq!(*wc_states, [false; 3]);
            }
            // Not one datagram of it is left out, and none of the SubDevices in it.
            wrong => {
                assert_eq!((wrong, toggle), (FrameStatus::WHOLE, before), "no new inputs");
                assert_eq!(*wc_states, [true; 3]);
            }
        }
    }
}

// S0 L2504: the least that a program should watch is WcState and State of every SubDevice; the example does
// that, and it is enough to know that data are missing and who is to blame.
// proves: PLC-18
#[test]
fn the_example_tells_by_the_two_words_that_data_are_missing_and_who_is_to_blame() {
    let folder = TempDir::new().unwrap();
    let file = folder.path().join("plant.toml");
    std::fs::write(&file, PLANT).unwrap();
    let mut told = Vec::new();
    let mut segment = linesman::open(&format!("sim:{}", file.display())).unwrap();
    watched::watch(&mut segment, |line| told.push(line)).unwrap();
    // First all that share the datagram, then the one, and its neighbour at whose port it was.
    for terminal in ["SubDevice 2 (EL1008)", "SubDevice 3 (EL1008)", "SubDevice 4 (EL1008)"] {
        assert!(told.contains(&format!("{terminal}: data missing, OP")), "{told:#?}");
    }
    let last = |name: &str| told.iter().rfind(|line| line.starts_with(name)).unwrap().as_str();
    assert_eq!(last("SubDevice 2 (EL1008)"), "SubDevice 2 (EL1008): data good, OP");
    assert_eq!(last("SubDevice 3 (EL1008)"), "SubDevice 3 (EL1008): data good, OP LNK_MIS B");
    assert_eq!(last("SubDevice 4 (EL1008)"), "SubDevice 4 (EL1008): data missing, INIT NO_COMM");
}
