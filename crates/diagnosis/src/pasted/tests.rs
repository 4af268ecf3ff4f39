//! Pasted texts of several tools as one observation.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use super::*;
use crate::engine::Setup;
use crate::report::{Diagnosis, PlaceReport};

const LIST: &str = "\
No\tAddr\tName\tState\tCRC
1\t1001\tTerm 1 (EK1100)\tOP\t0, 0, 0
2\t1002\tTerm 2 (EL1008)\tOP\t0, 0
3\t1003\tTerm 3 (EL4102)\tOP\t0
";

fn judged(text: &str) -> (Diagnosis, Understood) {
    let Pasted { file, understood } = read(text).unwrap();
    (file.diagnosis(Setup::default()), understood)
}

fn codes(text: &str) -> Vec<String> {
    judged(text).0.findings.into_iter().map(|finding| finding.code).collect()
}

#[test]
fn several_texts_are_one_observation_of_the_same_subdevices() {
    let text = format!(
        "{LIST}\nSend Frames\t19738\t+ 1272\nLost Frames\t0\t+ 0\nTx/Rx Errors\t0\t/ 0\n\nremember the milk\n\
         24/07/2015 10:36:32 840 ms\t'Term 3 (EL4102)' (1003): abnormal state change (from 'OP' to 'SAFEOP') with code 0x1b.\n"
    );
    let (diagnosis, understood) = judged(&text);
    let what: Vec<_> =
        understood.blocks.iter().map(|block| (block.from, block.to, block.what.as_str())).collect();
    assert_eq!(
        what,
        [
            (1, 4, "TwinCAT Online list of 3 SubDevices"),
            (6, 8, "TwinCAT counters of frames"),
            (11, 11, "1 TwinCAT message"),
        ]
    );
    assert_eq!((understood.ignored_count, understood.ignored[0].line), (1, 10));
    assert_eq!(diagnosis.network.devices.0, 3, "the message is about the third of the list");
    let finding = &diagnosis.findings[0];
    assert_eq!(
        (finding.code.as_str(), &finding.place),
        ("S202", &PlaceReport::Device { network: 0, no: 3 })
    );
    assert!(finding.closed_ns.is_some(), "the list was printed later, and has it in OP");
}

#[test]
fn what_a_text_does_not_give_stays_unknown() {
    let Pasted { file, .. } = read(LIST).unwrap();
    assert_eq!(file.maindevice, None);
    let model = file.model(None);
    assert!(
        model.host.card(linesman_proto::address::Path::A).carrier.is_none()
            && !model.host.is_watched
    );
    assert!(model.reported.lost.is_none() && model.reported.answering.is_none());
    let third = &model.devices[2];
    assert!(third.error_sum.is_none() && third.delay.is_none());
    let b = linesman_proto::register::ErrorCounter::InvalidFrame(linesman_proto::port::Port::B);
    assert!(third.counters.track(b).is_none(), "the list has no second count of it");
}

#[test]
fn a_later_list_of_the_same_kind_is_a_later_reading() {
    let later = LIST.replace("EL1008)\tOP\t0, 0", "EL1008)\tOP\t12, 0");
    let Pasted { file, understood } = read(&format!("{LIST}\n{later}")).unwrap();
    assert_eq!((understood.blocks.len(), file.readings.len()), (2, 3));
    let model = file.model(None);
    let a = linesman_proto::register::ErrorCounter::InvalidFrame(linesman_proto::port::Port::A);
    let track = model.devices[1].counters.track(a).unwrap();
    assert_eq!((track.total.rise(), track.may_be_old), (12, false));
    assert_eq!(
        codes(&format!("{later}\n{later}")),
        [""; 0],
        "old errors that do not rise are history"
    );
}

#[test]
fn a_message_of_an_interruption_silences_those_between() {
    let text = format!(
        "{LIST}\n20.11.2026 10:00:00\t'Term 2 (EL1008)' (1002) - 'Term 3 (EL4102)' (1003) Communication interrupted\n"
    );
    let Pasted { file, .. } = read(&text).unwrap();
    let model = file.model(None);
    let absences: Vec<usize> = model.devices.iter().map(|device| device.absences.len()).collect();
    assert_eq!(absences, [0, 1, 1]);
    assert!(
        model.devices.iter().all(|device| device.silent.is_none()),
        "the list has them in OP again"
    );
    // Without the list they are still gone.
    let message = text.lines().last().unwrap();
    let (diagnosis, understood) = judged(message);
    assert!(understood.assumed[0].contains("by their addresses"), "{understood:?}");
    assert!(
        diagnosis.findings.iter().any(|finding| finding.code == "H102"),
        "{:#?}",
        diagnosis.findings
    );
}

#[test]
fn places_on_an_assumed_wiring_are_less_sure() {
    let register = |ports: &str| {
        format!("\tReg: 0300\tReg: 0302\nslave 1\t0x0000\t0x0000\nslave 2\t{ports}\n")
    };
    let (assumed, understood) = judged(&register("0x0A05\t0x0000"));
    assert!(understood.assumed[0].contains("assumed a line in order"), "{understood:?}");
    let finding = &assumed.findings[0];
    assert_eq!(finding.code, "H110");
    assert!(finding.confidence < 0.4, "{finding:#?}");
    assert!(
        finding.evidence.iter().any(|one| one.text.contains("wiring is assumed")),
        "{finding:#?}"
    );
}

#[test]
fn a_text_cut_anywhere_and_in_any_order_is_read_without_panic() {
    let whole = format!(
        "{LIST}\n=== Master 0, Slave 0 ===\nState: OP\nFlag: E\nPort  Type  Link  Loop    Signal  NextSlave\n   0  MII   \
         up    open    yes  -\n   1  EBUS  up    open    yes  1\n   2  N/A  down  closed  no  -\n   3  N/A  down  closed  no  \
         -\nMaster0\n  Phase: Idle\n  Slaves: 9\nDomain0: LogBaseAddr 0x0, Size 6, WorkingCounter 0/1\n[ 1.5] EtherCAT 0: 3 \
         slave(s) responding on main device.\nNIC statistics:\n  rx_crc_errors: 3\n3 slaves found and configured.\nSlave:1\n \
         Name:EK1100\n State: 18\n Activeports:1.1.0.0\nTimestamp;Device;Code\n20.11.2026 10:00:00;Term 3;0x8611\n"
    );
    for end in (0..whole.len()).filter(|end| whole.is_char_boundary(*end)) {
        for text in [&whole[..end], &whole[end..]] {
            if let Ok(Pasted { file, .. }) = read(text) {
                let _ = file.diagnosis(Setup::default());
            }
        }
    }
    let mut lines: Vec<&str> = whole.lines().collect();
    lines.reverse();
    let (_, understood) = judged(&lines.join("\n"));
    assert!(understood.ignored_count > 0, "what stands alone is shown as not understood");
}

#[test]
fn neighbours_that_contradict_each_other_still_give_a_line() {
    let slave = |no: u32, next: [&str; 2]| {
        format!(
            "=== Master 0, Slave {no} ===\nState: OP\n   0  MII  up  open  yes  {}\n   1  MII  up  open  yes  {}\n   2  N/C  \
             down  closed  no  -\n   3  N/C  down  closed  no  -\n",
            next[0], next[1]
        )
    };
    let text = slave(0, ["-", "1"]) + &slave(1, ["0", "-"]) + &slave(2, ["0", "-"]);
    let Pasted { file, understood } = read(&text).unwrap();
    assert!(file.project().tree().is_ok());
    assert_eq!((file.devices.len(), understood.blocks.len()), (3, 1));
}

#[test]
fn nothing_understood_names_the_formats_and_the_first_line() {
    let error = read("\n\nDear colleague,\nthe machine stands still.\n").unwrap_err().to_string();
    for part in [
        "from line 3 (\"Dear colleague,\")",
        "`ethercat slaves -v`",
        "SOEM `slaveinfo`",
        "ethtool",
        "1;1001;Term 1",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
    assert!(read("").is_err() && read("\u{0}\u{1}\u{2}").is_err());
}
