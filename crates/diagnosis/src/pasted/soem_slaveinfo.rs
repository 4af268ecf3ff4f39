//! `slaveinfo` of SOEM: SubDevices with states, open ports, delays, and the errors on the way there.
//!
//! Reference: the sample program, which prints states and sizes in decimal, addresses, identities and AL status
//! codes in hexadecimal without a prefix.

use linesman_proto::port::{Port, PortMap};

use super::fact::{Block, FactKind, Format, SubDeviceFact, SubDeviceRef, extent};
use super::state_word;
use super::text::{Line, between, decimal, hex, leading_number, so_many, value_of};
use crate::observation_file::{ObservedMainDevice, ReadDevice, Word};

const KNOWN: [&str; 34] = [
    "SOEM (",
    "Slaveinfo",
    "Starting slaveinfo",
    "ec_init on",
    "ecx_init on",
    "Calculated workcounter",
    "Not all slaves reached",
    "Slave:",
    "Name:",
    "Output size:",
    "Input size:",
    "State:",
    "Delay:",
    "Has DC:",
    "DCParentport:",
    "Activeports:",
    "Configured address:",
    "Man:",
    "SM",
    "FMMU",
    "MBX length",
    "CoE details:",
    "Ebus current:",
    "only LRD/LWR:",
    "End slaveinfo",
    "End program",
    "No slaves found!",
    "No socket connection",
    "Excecute as root",
    "Time:",
    "PDO mapping",
    "addr b",
    "[0x",
    "CoE Object Description",
];

fn found(line: &str) -> Option<u16> {
    let (count, rest) = leading_number(line.trim())?;
    rest.trim().starts_with("slaves found").then_some(())?;
    u16::try_from(count).ok()
}

fn is_known(line: &Line<'_>) -> bool {
    let text = line.trimmed();
    found(text).is_some()
        || KNOWN.iter().any(|known| text.starts_with(known))
        || failure(text).is_some()
        || text.starts_with("0x")
}

/// `Slave 2 State=12 StatusCode=  1a : Synchronization error`, all in hexadecimal.
fn failure(text: &str) -> Option<(u16, u64, u16)> {
    let rest = text.trim().strip_prefix("Slave ")?;
    let (number, rest) = leading_number(rest)?;
    let state = between(rest, "State=", "StatusCode")?;
    let code = between(rest, "StatusCode=", ":")
        .map_or_else(|| rest.split_once("StatusCode=").map(|(_, code)| code), Some)?;
    let position = u16::try_from(number).ok()?.checked_sub(1)?;
    Some((position, hex(state)?, u16::try_from(hex(code)?).ok()?))
}

/// `Time:    7245.107 SDO slave:2 index:160d.00 error:06020000 …` and `… EMERGENCY slave:2 error:8130`.
fn logged(text: &str) -> Option<FactKind> {
    let rest = text.strip_prefix("Time:")?;
    let (number, _) = leading_number(rest.split_once("slave:")?.1)?;
    let whom = SubDeviceRef::Position(u16::try_from(number).ok()?.checked_sub(1)?);
    let error = rest.split_once("error:")?.1;
    let error = hex(error.split_whitespace().next()?)?;
    if rest.contains(" EMERGENCY ") {
        let code = u16::try_from(error).ok()?;
        return Some(FactKind::Emergency { whom, code, register: None, data: Vec::new() });
    }
    if !rest.contains(" SDO ") {
        return None;
    }
    let (index, subindex) = rest.split_once("index:")?.1.split_once('.')?;
    Some(FactKind::Abort {
        whom,
        index: u16::try_from(hex(index)?).ok()?,
        subindex: u8::try_from(hex(subindex.split_whitespace().next()?)?).ok()?,
        code: u32::try_from(error).ok()?,
    })
}

/// Takes the whole output, or a part of it.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let first = lines.first()?.trimmed();
    let begins = [
        "SOEM (",
        "Slaveinfo",
        "Starting slaveinfo",
        "Slave:",
        "Not all slaves reached",
        "No slaves found!",
    ];
    let is_first = begins.iter().any(|begin| first.starts_with(begin))
        || found(first).is_some()
        || failure(first).is_some()
        || logged(first).is_some();
    if !is_first {
        return None;
    }
    let mut block = Block::new(Format::SlaveInfo);
    let mut is_over = false;
    (block.lines, block.unused) = extent(lines, |line| {
        let is_known = !is_over && is_known(line);
        is_over |= line.trimmed().starts_with("End program");
        is_known
    });
    let lines = &lines[..block.lines];
    let heads: Vec<usize> = (0..lines.len())
        .filter(|at| lines[*at].trimmed().starts_with("Slave:"))
        .chain([lines.len()])
        .collect();
    let mut answering = None;
    for line in &lines[..heads.first().copied().unwrap_or(lines.len())] {
        let text = line.trimmed();
        answering = found(text).or(answering);
        if text.starts_with("No slaves found!") {
            answering = Some(0);
        }
        if let Some((position, state, code)) = failure(text) {
            let read = ReadDevice {
                state: state_word::of_status(state),
                al_code: Some(Word(code)).filter(|code| code.0 != 0),
                ..ReadDevice::default()
            };
            block.tell(FactKind::Read(SubDeviceRef::Position(position), Box::new(read)));
        }
        if let Some(what) = logged(text) {
            block.tell(what);
        }
    }
    let count = heads.len() - 1;
    for pair in heads.windows(2) {
        device(&mut block, &lines[pair[0]..pair[1]]);
    }
    block.what = match answering {
        Some(0) => "SOEM `slaveinfo`, which found no SubDevice".to_owned(),
        Some(_) | None => {
            let count = answering.map_or(count, usize::from);
            format!("SOEM `slaveinfo` of {}", so_many(count, "SubDevice"))
        }
    };
    if let Some(answering) = answering {
        let main =
            ObservedMainDevice { answering: Some(answering), ..ObservedMainDevice::default() };
        block.tell(FactKind::Main(Box::new(main)));
    }
    Some(block)
}

fn device(block: &mut Block, lines: &[Line<'_>]) {
    let number = lines.first().and_then(|line| value_of(&line.text, "Slave")?.parse::<u16>().ok());
    let Some(position) = number.and_then(|number| number.checked_sub(1)) else { return };
    let mut about = SubDeviceFact::default();
    let mut read = ReadDevice::default();
    let word = |text: &str| {
        text.split_whitespace().next().and_then(hex).and_then(|value| u32::try_from(value).ok())
    };
    for line in lines {
        let text = line.trimmed();
        if let Some(name) = value_of(text, "Name") {
            about.type_name = Some(name.to_owned()).filter(|name| !name.is_empty() && name != "?");
        } else if let Some(state) = value_of(text, "State") {
            read.state = state.parse().ok().and_then(state_word::of_status);
        } else if let Some(delay) = value_of(text, "Delay") {
            let ns = delay.split('[').next().and_then(decimal).filter(|ns| (0.0..4e9).contains(ns));
            about.delay_ns = ns.map(|ns| ns as u32);
        } else if let Some(ports) = value_of(text, "Activeports") {
            let open: Vec<bool> = ports.split('.').map(|port| port.trim() == "1").collect();
            if let [a, b, c, d] = open[..] {
                about.open = Some(PortMap([a, b, c, d]));
                for (port, open) in
                    Port::ALL.into_iter().zip([a, b, c, d]).filter(|(_, open)| *open)
                {
                    read.port_mut(port).open = Some(open);
                }
            }
        } else if let Some(station) = value_of(text, "Configured address") {
            about.station = hex(station).and_then(|station| u16::try_from(station).ok());
        } else if let Some(rest) = text.strip_prefix("Man:") {
            about.vendor_id = word(rest);
            about.product_code = rest.split_once("ID:").and_then(|(_, rest)| word(rest));
            about.revision = rest.split_once("Rev:").and_then(|(_, rest)| word(rest));
        }
    }
    block.tell(FactKind::SubDeviceFact(SubDeviceRef::Position(position), Box::new(about)));
    // States in the list are read last; what was refused before is told by its code.
    block.tell(FactKind::Read(SubDeviceRef::Position(position), Box::new(read)));
}

#[cfg(test)]
#[allow(clippy::wildcard_enum_match_arm, reason = "helpers of tests")]
mod tests {
    use super::super::text::lines;
    use super::*;

    const TEXT: &str = "\
SOEM (Simple Open EtherCAT Master)
Slaveinfo
Starting slaveinfo
ecx_init on eth0 succeeded.
Time:    7245.107 SDO slave:2 index:1c12.01 error:06010002 Attempt to write a read only object
Time:    7245.119 EMERGENCY slave:2 error:8130
2 slaves found and configured.
Calculated workcounter 4
Not all slaves reached safe operational state.
Slave 2 State=12 StatusCode=  1d : Invalid output configuration

Slave:1
 Name:EK1100
 Output size: 0bits
 Input size: 0bits
 State: 4
 Delay: 0[ns]
 Has DC: 1
 DCParentport:0
 Activeports:1.1.0.0
 Configured address: 1001
 Man: 00000002 ID: 044c2c52 Rev: 00120000
 FMMUfunc 0:0 1:0 2:0 3:0
 MBX length wr: 0 rd: 0 MBX protocols : 00
 CoE details: 00 FoE details: 00 EoE details: 00 SoE details: 00
 Ebus current: -2000[mA]
 only LRD/LWR:0

Slave:2
 Name:EL2004
 State: 18
 Delay: 144[ns]
 Activeports:1.0.0.0
 Configured address: 1002
 SM0 A:0f00 L:   1 F:00090044 Type:3
End slaveinfo, close socket
End program
";

    #[test]
    fn subdevices_states_ports_and_errors_are_read() {
        let block = take(&lines(TEXT)).unwrap();
        assert_eq!((block.lines, block.what.as_str()), (37, "SOEM `slaveinfo` of 2 SubDevices"));
        let read: Vec<_> = block
            .facts
            .iter()
            .filter_map(|fact| match &fact.what {
                FactKind::Read(SubDeviceRef::Position(at), read) => {
                    Some((*at, read.state.clone().unwrap(), read.al_code))
                }
                _ => None,
            })
            .collect();
        assert_eq!(
            read,
            [
                (1, "ERR PREOP".to_owned(), Some(Word(0x1D))),
                (0, "SAFEOP".to_owned(), None),
                (1, "ERR PREOP".to_owned(), None),
            ]
        );
        let about: Vec<_> = block
            .facts
            .iter()
            .filter_map(|fact| match &fact.what {
                FactKind::SubDeviceFact(_, about) => {
                    Some((about.station, about.delay_ns, about.open.unwrap()))
                }
                _ => None,
            })
            .collect();
        assert_eq!(
            about,
            [
                (Some(0x1001), Some(0), PortMap([true, true, false, false])),
                (Some(0x1002), Some(144), PortMap([true, false, false, false])),
            ]
        );
        assert!(block.facts.iter().any(|fact| matches!(
            fact.what,
            FactKind::Abort {
                whom: SubDeviceRef::Position(1),
                index: 0x1C12,
                subindex: 1,
                code: 0x0601_0002
            }
        )));
        assert!(
            block
                .facts
                .iter()
                .any(|fact| matches!(fact.what, FactKind::Emergency { code: 0x8130, .. }))
        );
    }

    #[test]
    fn a_line_without_subdevices_is_told() {
        let block = take(&lines(
            "Starting slaveinfo\nec_init on eth0 succeeded.\nNo slaves found!\nEnd program\n",
        ))
        .unwrap();
        assert!(block.what.contains("found no SubDevice"), "{}", block.what);
        let FactKind::Main(main) = &block.facts[0].what else { panic!() };
        assert_eq!(main.answering, Some(0));
        assert!(take(&lines("3 apples found\n")).is_none());
    }
}
