//! Online lists in all the forms in which they are copied.

#![allow(clippy::wildcard_enum_match_arm, reason = "helpers of tests")]

use super::super::text::lines;
use super::*;

fn read(block: &Block) -> Vec<(SubDeviceRef, ReadDevice)> {
    let read = block.facts.iter().filter_map(|fact| match &fact.what {
        FactKind::Read(whom, read) => Some((whom.clone(), (**read).clone())),
        _ => None,
    });
    read.collect()
}

fn about(block: &Block) -> Vec<SubDeviceFact> {
    let about = block.facts.iter().filter_map(|fact| match &fact.what {
        FactKind::SubDeviceFact(_, about) => Some((**about).clone()),
        _ => None,
    });
    about.collect()
}

fn frames(read: &ReadDevice) -> Vec<Option<u64>> {
    let all = read.ports.all();
    let of = |port: Port| all[port].as_ref().and_then(|port| port.frame).map(|count| count.0);
    Port::ALL.into_iter().map(of).collect()
}

#[test]
fn text_csv_and_single_blanks_give_the_same_list() {
    let expected = OnlineRow {
        no: Some(2),
        address: Some(1002),
        name: "Term 2 (EL4102)".to_owned(),
        state: state_word::read("ERR SAFEOP"),
        crc: vec![0, 15],
        is_partial: true,
        ..OnlineRow::default()
    };
    for row in [
        "2\t1002\tTerm 2 (EL4102)\tERR SAFEOP\t0, 15 (18)",
        "2;1002;Term 2 (EL4102);ERR SAFEOP;0, 15 (18)",
        "\"2\",\"1002\",\"Term 2 (EL4102)\",\"ERR SAFEOP\",\"0, 15 (18)\"",
        "2  1002  Term 2 (EL4102)  ERR SAFEOP  0, 15 (18)",
        "2 1002 Term 2 (EL4102) ERR SAFEOP 0, 15 (18)",
    ] {
        assert_eq!(plain_row(row), Some(expected.clone()), "{row}");
    }
    for row in ["2 1002 Term 2", "hello 1002 x OP", "2 x Term OP 0", "12 34 56 78", "1 2 OP"] {
        assert_eq!(plain_row(row), None, "{row}");
    }
}

#[test]
fn a_list_gives_names_types_states_and_errors_of_each_port() {
    let text = "No\tAddr\tName\tState\tCRC\n\
        1\t1001\tTerm 1 (EK1100)\tOP\t0, 0, 154656\n\
        2\t1002\tTerm 2 (EL1008)\tOP LNK MIS B\t0, 3\n\
        3\t1003\tTerm 3 (EK1521)\tINIT NO_COMM\t1, 2, 3\n\
        4\t1004\tBox 4 (EP2308-0002)\tLNK_MIS B\t0\n\
        \nsomething else\n";
    let block = take(&lines(text)).unwrap();
    assert_eq!((block.lines, block.what.as_str()), (5, "TwinCAT Online list of 4 SubDevices"));
    let read = read(&block);
    assert_eq!(frames(&read[0].1), [Some(0), Some(0), Some(154_656), None]);
    assert!(read[0].1.ports.c.as_ref().unwrap().total, "added up by the tool");
    assert_eq!(read[1].1.state.as_deref(), Some("OP LNK_MIS B"));
    assert_eq!(frames(&read[2].1), [Some(1), None, Some(2), Some(3)], "it has no port B");
    assert_eq!(
        (read[3].1.state.clone(), read[3].1.ports.b.as_ref().unwrap().link),
        (None, Some(false))
    );
    let about = about(&block);
    assert_eq!(about[0].name.as_deref(), Some("Term 1 (EK1100)"));
    assert_eq!((about[0].type_name.as_deref(), about[0].station), (Some("EK1100"), Some(1001)));
}

#[test]
fn a_list_with_registers_is_read_by_its_columns() {
    let text = "No;Addr;Name;State;Reg:0300;Reg:0302;Reg:0308;Reg:0310\n\
        1;1001;Term 1 (EK1101);OP;0x0412 (1042);0x0000 (0);0x0201 (513);0x0005 (5)\n\
        2;1002;Term 2 (EL1004);OP;0x0000 (0);--;--;--\n";
    let block = take(&lines(text)).unwrap();
    let read = read(&block);
    let a = read[0].1.ports.a.clone().unwrap();
    assert_eq!(
        (a.frame, a.physical, a.forwarded, a.lost_link),
        (Some(Count(0x12)), Some(Count(4)), Some(Count(1)), Some(Count(5)))
    );
    assert!(!a.total, "a register stops at 255");
    assert_eq!(
        read[0].1.ports.b.clone().unwrap().forwarded,
        Some(Count(2)),
        "words hold two ports"
    );
    assert_eq!(read[1].1.ports.b, None, "a register that is not there says nothing");
}

#[test]
fn tables_of_registers_without_names_are_read() {
    let text = "\tReg: 0300\tReg: 0302\tReg: 0304\nslave 1\t✓ 0x0000\t0x0000\t0x0000\nslave 2\t0xA05\t0x0012\t0x0412\n";
    let block = take(&lines(text)).unwrap();
    let registers = read(&block);
    assert_eq!(registers[1].0, SubDeviceRef::Position(1));
    assert_eq!(frames(&registers[1].1), [Some(5), Some(0x12), Some(0x12), None]);
    let ports = "\tCRC port 0\tCRC port 1\tCRC port 2\tCRC port 3\nslave 6\t0x00\t0x00\t0x13\t\n";
    let by_port = read(&take(&lines(ports)).unwrap());
    assert_eq!(
        (by_port[0].0.clone(), frames(&by_port[0].1)),
        (SubDeviceRef::Position(5), vec![Some(0), Some(0), Some(0x13), None])
    );
}

#[test]
fn changes_are_counted_from_the_first_time_it_was_there() {
    let text = "No\tAddr\tName\tState\tCRC\tChanges\n1\t1001\tTerm 1 (EK1101)\tOP\t0, 0\t2, 4\n2\t1002\tTerm 2 (EL1004)\tOP\t0\t0,1\n";
    let read = read(&take(&lines(text)).unwrap());
    assert_eq!((read[0].1.state_changes, read[0].1.absences), (Some(Count(2)), Some(Count(3))));
    assert_eq!((read[1].1.state_changes, read[1].1.absences), (Some(Count(0)), Some(Count(0))));
}

#[test]
fn frames_beneath_the_list_are_read_with_both_kinds() {
    let text = "Actual State:\tOP\nCounter\tCyclic\tQueued\nSend Frames\t19738\t+ 1272\nFrames / sec\t500\t+ 19\n\
        Lost Frames\t3 (9)\t+ 2\nTx/Rx Errors\t0\t/ 12\n";
    let block = take_frames(&lines(text)).unwrap();
    let FactKind::Main(main) = &block.facts[0].what else { panic!() };
    assert_eq!((main.sent, main.lost), (Some(Count(21_010)), Some(Count(5))));
    assert_eq!((main.send_errors, main.crc), (Some(Count(0)), Some(Count(12))));
    assert_eq!(block.lines, 6);
    assert!(take_frames(&lines("Actual State: OP\n")).is_none(), "it tells of no frame");
}
