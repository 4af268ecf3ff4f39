//! Registers as people paste them.

use super::super::text::lines;
use super::*;
use crate::observation_file::Count;
use linesman_proto::port::Port;

fn read(block: &Block, position: u16) -> &ReadDevice {
    let is_it = |fact: &&super::super::fact::Fact| matches!(&fact.what, FactKind::Read(SubDeviceRef::Position(at), _) if *at == position);
    let FactKind::Read(_, read) = &block.facts.iter().find(is_it).unwrap().what else { panic!() };
    read
}

fn frames(block: &Block, position: u16, port: Port) -> Option<u64> {
    let ports = read(block, position).ports.all();
    ports[port].as_ref()?.frame.map(|Count(count)| count)
}

const TWENTY: &str = "0x00 0x00 0x05 0x09 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x00 0x02 0x00 0x00";

#[test]
fn commands_of_igh_are_read_as_they_were_typed() {
    let command = |text: &str| command(text).unwrap();
    let typed = command("user@host:~$ ethercat reg_read -p 3 0x0300 20");
    assert_eq!(
        (typed.asked, typed.start, typed.size),
        (CommandTarget::One(ReadingSubject::Position(3)), 0x0300, Some(20))
    );
    let typed = command("# sudo ethercat -m 0 reg_read --position=2 -tuint16 0x110");
    assert_eq!(
        (typed.asked, typed.start),
        (CommandTarget::One(ReadingSubject::Position(2)), 0x0110)
    );
    assert_eq!(typed.kind.as_deref(), Some("uint16"));
    let typed = command("$ ethercat reg_read -a 1001 768 0x14");
    assert_eq!(
        (typed.asked, typed.start, typed.size),
        (CommandTarget::One(ReadingSubject::Alias(1001)), 768, Some(20))
    );
    for (list, expected) in
        [("$(seq 0 2)", vec![0, 1, 2]), ("{1..2}", vec![1, 2]), ("0 4", vec![0, 4])]
    {
        let text = format!("$ for i in {list}; do ethercat reg_read -p $i 0x0300 20; done");
        assert_eq!(command(&text).asked, CommandTarget::Each(expected), "{text}");
    }
    assert_eq!(command("$ ethercat reg_read -p $N 0x0300 20").asked, CommandTarget::Counting);
    for text in ["reg_read", "ethercat reg_read 0x0300 20", "we ran reg_read -p 1", ""] {
        assert_eq!(super::command(text), None, "{text}");
    }
}

#[test]
fn several_commands_are_one_round_until_one_is_repeated() {
    let text = format!(
        "$ ethercat reg_read -p 0 0x0300 20\n{TWENTY}\n$ ethercat reg_read -p 1 0x0300 20\n{TWENTY}\n$ ethercat reg_read -p \
         1 -t uint16 0x0110\n0x5a37 23095\n$ sleep 60\n$ ethercat reg_read -p 0 0x0300 20\n{TWENTY}\n"
    );
    let all = lines(&text);
    let block = take(&all).unwrap();
    assert_eq!((block.lines, block.what.as_str()), (6, "`ethercat reg_read` of 2 SubDevices"));
    assert_eq!(frames(&block, 0, Port::B), Some(5));
    let ports = read(&block, 1).ports.all();
    let b = ports[Port::B].as_ref().unwrap();
    assert_eq!((b.physical, b.lost_link, b.link), (Some(Count(9)), Some(Count(2)), Some(true)));
    let FactKind::SubDeviceFact(_, about) = &block.facts[2].what else {
        panic!("{:?}", block.facts)
    };
    assert!(about.open.unwrap()[Port::A], "the wiring follows from the open ports");
    assert_eq!(block.kind, Some(MainDeviceKind::Igh));
    assert_eq!(take(&all[7..]).unwrap().lines, 2, "a minute later");
}

#[test]
fn loop_of_the_shell_reads_one_after_the_other() {
    let text = format!(
        "$ for i in 0 1 2; do ethercat reg_read -p $i 0x0300 20; done\n{TWENTY}\n{TWENTY}\n{TWENTY}\n"
    );
    let block = take(&lines(&text)).unwrap();
    assert_eq!((block.lines, block.facts.len()), (4, 6));
    assert_eq!(frames(&block, 2, Port::B), Some(5));
}

#[test]
fn command_that_failed_tells_nothing() {
    let text = format!(
        "$ ethercat reg_read -p 0 0x0300 20\nFailed to read register: Input/output error\n$ ethercat reg_read -p 1 0x0300 \
         20\n{TWENTY}\n"
    );
    let block = take(&lines(&text)).unwrap();
    assert_eq!((block.facts.len(), block.unused.len()), (2, 2));
    assert_eq!(frames(&block, 1, Port::B), Some(5));
}

#[test]
fn lines_of_programs_name_the_subdevice_and_the_register() {
    let bytes = "00 00 05 09 00 00 00 00 00 00 00 00 00 00 00 00 00 02 00 00";
    for (first, second) in [
        (format!("slave 1 0x0300: {bytes}"), format!("slave 2 0x0300: {bytes}")),
        (
            format!("SubDevice 1: 0x0300 = [{}]", bytes.replace(' ', ", ")),
            format!("SubDevice 2: 0x0300 = {bytes}"),
        ),
        (
            format!("slave 0 reg 0x0300: {}", bytes.replace(' ', "")),
            format!("slave 1 reg 0x0300: {bytes}"),
        ),
        (format!("position 0 0x0300: {bytes}"), format!("position 1 0x0300: {bytes}")),
        (format!("1 0x0300: {bytes}"), format!("2 0x0300: {bytes}")),
    ] {
        let block =
            take(&lines(&format!("{first}\n{second}\n"))).unwrap_or_else(|| panic!("{first}"));
        assert_eq!((block.lines, block.facts.len()), (2, 4), "{first}");
        assert_eq!(frames(&block, 1, Port::B), Some(5), "{first}");
        assert_eq!(block.kind, None);
    }
    let block = take(&lines(&format!("0x1002 0x0300: {bytes}"))).unwrap();
    assert!(matches!(
        &block.facts[1].what,
        FactKind::Read(SubDeviceRef::Named(_, Some(0x1002)), _)
    ));
    let python = "slave 2 0x0300: b'\\x00\\x00\\x05\\t\\x00\\x00\\x00\\x00'";
    assert_eq!(frames(&take(&lines(python)).unwrap(), 1, Port::B), Some(5));
}

#[test]
fn other_texts_are_no_registers() {
    for text in [
        "0  0:0  PREOP  +  EK1100 EtherCAT-Koppler",
        "Slave:1",
        "1;1001;Term 1 (EK1100);OP;0, 15",
        "[ 12.5] EtherCAT 0: Domain 0: Working counter changed to 2/3.",
        "slave 1 0x0300: nothing",
        "slave 1: 00 00",
        "rx_crc_errors: 0",
        "$ ethercat slaves",
        "$ ethercat reg_read -p 0 0x0300 20",
    ] {
        assert!(take(&lines(text)).is_none(), "{text}");
    }
}
