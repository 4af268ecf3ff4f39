//! `ethercat slaves -v` and `ethercat slaves` of the IgH EtherCAT Master.
//!
//! Reference: the master's command line tool, which prints states, identities, and of each port its type, link,
//! loop, signal, the position of the neighbour behind it, and times of the delay measurement.

use linesman_proto::port::PortMap;

use super::fact::{Block, FactKind, Format, SubDeviceFact, SubDeviceRef, extent};
use super::state_word;
use super::text::{Line, between, hex, leading_number, so_many, value_of};
use crate::observation_file::ReadDevice;

/// Beginnings of lines that belong to a SubDevice, blanks taken off.
const KNOWN: [&str; 36] = [
    "Alias:",
    "Device:",
    "State:",
    "Flag:",
    "Identity:",
    "Vendor Id:",
    "Product code:",
    "Revision number:",
    "Serial number:",
    "DL information:",
    "FMMU bit operation:",
    "Distributed clocks:",
    "DC system time transmission delay:",
    "Port ",
    "Mailboxes:",
    "Bootstrap RX:",
    "Standard RX:",
    "Supported protocols:",
    "General:",
    "Group:",
    "Image name:",
    "Order number:",
    "Device name:",
    "CoE details:",
    "Enable SDO",
    "Enable PDO",
    "Enable Upload",
    "Flags:",
    "Enable SafeOp:",
    "Enable notLRW:",
    "Current consumption:",
    "Upstream",
    "Ports",
    "Transmission delay:",
    "Max ",
    "Link state:",
];

/// The header of a SubDevice: master and position.
fn header(line: &str) -> Option<(u64, u16)> {
    let rest = line.trim().strip_prefix("===")?.trim().strip_prefix("Master")?.trim();
    let (master, rest) = leading_number(rest)?;
    let rest = rest.trim().strip_prefix(',')?.trim().strip_prefix("Slave")?.trim();
    let (position, _) = leading_number(rest)?;
    Some((master, u16::try_from(position).ok()?))
}

fn is_known(line: &str) -> bool {
    let text = line.split_whitespace().collect::<Vec<_>>().join(" ");
    header(line).is_some()
        || KNOWN.iter().any(|known| text.starts_with(known))
        || port_row(line).is_some()
}

/// A row of the table of ports.
struct PortRow {
    port: usize,
    is_there: bool,
    link: bool,
    open: bool,
    signal: bool,
    next: Option<u16>,
}

fn port_row(line: &str) -> Option<PortRow> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let [port, kind, link, loop_state, signal, rest @ ..] = &words[..] else { return None };
    let port = port.parse().ok().filter(|port| *port < 4)?;
    let known = ["EBUS", "MII", "N/A", "N/C", "???"];
    if !known.contains(kind)
        || !["up", "down"].contains(link)
        || !["open", "closed"].contains(loop_state)
    {
        return None;
    }
    Some(PortRow {
        port,
        is_there: matches!(*kind, "EBUS" | "MII"),
        link: *link == "up",
        open: *loop_state == "open",
        signal: *signal == "yes",
        next: rest.first().and_then(|next| next.parse().ok()),
    })
}

/// Takes a verbose list.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let (master, _) = header(&lines.first()?.text)?;
    let mut block = Block::new(Format::IghSlaves);
    let (end, unused) = extent(lines, |line| is_known(&line.text));
    (block.lines, block.unused) = (end, unused);
    let lines = &lines[..end];
    let heads: Vec<usize> =
        (0..end).filter(|at| header(&lines[*at].text).is_some()).chain([end]).collect();
    let mut of_others = 0;
    let mut count = 0;
    for pair in heads.windows(2) {
        let [from, to] = [pair[0], pair[1]];
        match header(&lines[from].text) {
            Some((of, position)) if of == master => {
                count += 1;
                device(&mut block, position, &lines[from..to]);
            }
            Some(_) | None => of_others += 1,
        }
    }
    block.what = format!("`ethercat slaves -v` of {}", so_many(count, "SubDevice"));
    if of_others > 0 {
        block.what += &format!(" ({of_others} of another master were left aside)");
    }
    Some(block)
}

fn device(block: &mut Block, position: u16, lines: &[Line<'_>]) {
    let mut about = SubDeviceFact::default();
    let mut read = ReadDevice::default();
    let mut open = PortMap([false; 4]);
    let mut neighbours = PortMap([None; 4]);
    let mut rows = 0;
    let number = |text: &str| hex(text).and_then(|value| u32::try_from(value).ok());
    for line in lines {
        let text = line.trimmed();
        let text_of = |key| value_of(text, key);
        if let Some(row) = port_row(&line.text) {
            rows += 1;
            let port = linesman_proto::port::Port::ALL[row.port];
            open[port] = row.open;
            neighbours[port] = row.next;
            if row.is_there || row.link {
                let into = read.port_mut(port);
                (into.link, into.open) = (Some(row.link), Some(row.open));
                into.communication = Some(row.signal);
            }
        } else if let Some(value) = text_of("State") {
            read.state = state_word::read(value).and_then(|word| word.state);
        } else if let Some(value) = text_of("Flag") {
            read.configuration_failed = (value == "E").then_some(true);
        } else if let Some(value) = text_of("Alias") {
            about.alias = value.parse().ok();
        } else if let Some(value) = text_of("Vendor Id") {
            about.vendor_id = number(value);
        } else if let Some(value) = text_of("Product code") {
            about.product_code = number(value);
        } else if let Some(value) = text_of("Revision number") {
            about.revision = number(value);
        } else if let Some(value) = text_of("Serial number") {
            about.serial = number(value).filter(|serial| *serial != 0);
        } else if let Some(value) = text_of("DC system time transmission delay") {
            about.delay_ns = leading_number(value).and_then(|(ns, _)| u32::try_from(ns).ok());
        } else if let Some(value) = text_of("Order number") {
            about.type_name = Some(value.to_owned()).filter(|name| !name.is_empty());
        }
    }
    if rows == 4 {
        about.open = Some(open);
        about.neighbours = neighbours.iter().any(|(_, next)| next.is_some()).then_some(neighbours);
    }
    block.tell(FactKind::SubDeviceFact(SubDeviceRef::Position(position), Box::new(about)));
    block.tell(FactKind::Read(SubDeviceRef::Position(position), Box::new(read)));
}

/// A row of the short list.
struct ListRow<'l> {
    position: u16,
    alias: u16,
    relative: u16,
    state: String,
    failed: bool,
    name: &'l str,
}

fn list_row(line: &str) -> Option<ListRow<'_>> {
    let (position, rest) = leading_number(line.trim())?;
    let rest = rest.strip_prefix(' ')?.trim_start();
    let (alias, rest) = leading_number(rest)?;
    let (relative, rest) = leading_number(rest.strip_prefix(':')?)?;
    let rest = rest.trim_start();
    let flag = rest.find(" + ").into_iter().chain(rest.find(" E ")).min()?;
    let mut flag = flag;
    // `SAFEOP + ERROR  E  name`: the plus is of the state.
    if rest[flag..].starts_with(" + ERROR") {
        flag += 3 + rest[flag + 3..]
            .find(" + ")
            .into_iter()
            .chain(rest[flag + 3..].find(" E "))
            .min()?;
    }
    let state = state_word::read(&rest[..flag])?.state?;
    Some(ListRow {
        position: u16::try_from(position).ok()?,
        alias: u16::try_from(alias).ok()?,
        relative: u16::try_from(relative).ok()?,
        state,
        failed: rest[flag..].trim_start().starts_with('E'),
        name: rest[flag + 2..].trim(),
    })
}

/// Takes a list with a line for each SubDevice.
pub(super) fn take_list(lines: &[Line<'_>]) -> Option<Block> {
    list_row(&lines.first()?.text)?;
    let mut block = Block::new(Format::IghSlaves);
    let mut last = None;
    (block.lines, block.unused) = extent(lines, |line| {
        if line.trimmed() == "xxx LINK FAILURE xxx" {
            return true;
        }
        // Positions rise; a second list begins anew.
        let position = list_row(&line.text).map(|row| row.position);
        let is_next = position.is_some() && position > last;
        last = if is_next { position } else { last };
        is_next
    });
    let mut count = 0;
    for line in &lines[..block.lines] {
        let Some(row) = list_row(&line.text) else { continue };
        count += 1;
        // Without a name in the EEPROM the list has vendor and product.
        let numbers = row.name.split_once(':').and_then(|(vendor, product)| {
            let both =
                [vendor, product].map(|text| text.starts_with("0x").then(|| hex(text)).flatten());
            Some((both[0]?, both[1]?))
        });
        let type_name =
            row.name.split_whitespace().next().filter(|word| numbers.is_none() && is_type(word));
        let about = SubDeviceFact {
            type_name: type_name.map(str::to_owned),
            vendor_id: numbers.and_then(|(vendor, _)| u32::try_from(vendor).ok()),
            product_code: numbers.and_then(|(_, product)| u32::try_from(product).ok()),
            alias: Some(row.alias).filter(|alias| *alias != 0 && row.relative == 0),
            ..SubDeviceFact::default()
        };
        let read = ReadDevice {
            state: Some(row.state),
            configuration_failed: row.failed.then_some(true),
            ..ReadDevice::default()
        };
        block.tell(FactKind::SubDeviceFact(SubDeviceRef::Position(row.position), Box::new(about)));
        block.tell(FactKind::Read(SubDeviceRef::Position(row.position), Box::new(read)));
    }
    block.what = format!("`ethercat slaves` of {}", so_many(count, "SubDevice"));
    Some(block)
}

/// Whether a word looks like an order designation.
fn is_type(word: &str) -> bool {
    word.chars().any(|one| one.is_ascii_digit())
        && word.chars().any(|one| one.is_ascii_alphabetic())
}

/// The SubDevice of a configuration such as `1001:0`: by alias, or by position where there is none.
pub(super) fn configured(text: &str) -> Option<SubDeviceRef> {
    let (alias, relative) = text.trim().split_once(':')?;
    let (alias, relative) = (alias.trim().parse().ok()?, relative.trim().parse().ok()?);
    Some(if alias == 0 {
        SubDeviceRef::Position(relative)
    } else {
        SubDeviceRef::Alias(alias, relative)
    })
}

/// The number between `Slave ` and the end.
pub(super) fn reference(text: &str) -> Option<u16> {
    between(&format!("{text}\n"), "Slave ", "\n")?.trim().parse().ok()
}

#[cfg(test)]
#[allow(clippy::wildcard_enum_match_arm, reason = "helpers of tests")]
mod tests {
    use super::super::text::lines;
    use super::*;

    const VERBOSE: &str = "\
=== Master 0, Slave 0 ===
Device: Main
State: OP
Flag: +
Identity:
  Vendor Id:       0x00000002
  Product code:    0x044c2c52
  Revision number: 0x00120000
  Serial number:   0x00000000
DL information:
  FMMU bit operation: no
  Distributed clocks: yes, 64 bit
  DC system time transmission delay: 0 ns
Port  Type  Link  Loop    Signal  NextSlave  RxTime [ns]  Diff [ns]   NextDc [ns]
   0  MII   up    open    yes             -   3101          0           0
   1  EBUS  up    open    yes             1   3401        300         150
   2  MII   down  closed  no              -      -          -           -
   3  N/A   down  closed  no              -      -          -           -
General:
  Group: SystemBk
  Image name:
  Order number: EK1100
  Device name: EK1100 EtherCAT coupler
  Flags:
    Enable SafeOp: no
  Current consumption: -2000 mA

=== Master 0, Slave 1 ===
Alias: 17
Device: Main
State: SAFEOP+ERROR
Flag: E
Port  Type  Link  Loop    Signal  NextSlave
   0  EBUS  up    open    yes             0
   1  EBUS  down  closed  no              -
   2  N/C   down  closed  no              -
   3  N/C   down  closed  no              -
a line of another program
";

    #[test]
    fn verbose_list_gives_states_links_neighbours_and_identity() {
        let block = take(&lines(VERBOSE)).unwrap();
        assert_eq!(
            (block.lines, block.what.as_str()),
            (37, "`ethercat slaves -v` of 2 SubDevices")
        );
        let [
            FactKind::SubDeviceFact(first, about),
            FactKind::Read(_, read),
            FactKind::SubDeviceFact(_, second),
            FactKind::Read(_, other),
        ] = &block.facts.iter().map(|fact| fact.what.clone()).collect::<Vec<_>>()[..]
        else {
            panic!("{:?}", block.facts);
        };
        assert_eq!(first, &SubDeviceRef::Position(0));
        assert_eq!((about.vendor_id, about.type_name.as_deref()), (Some(2), Some("EK1100")));
        assert_eq!(about.neighbours, Some(PortMap([None, Some(1), None, None])));
        assert_eq!(read.state.as_deref(), Some("OP"));
        assert_eq!(read.ports.c.as_ref().unwrap().link, Some(false));
        assert_eq!(read.ports.d, None, "there is no such port");
        assert_eq!(
            (second.alias, second.open),
            (Some(17), Some(PortMap([true, false, false, false])))
        );
        assert_eq!(other.state.as_deref(), Some("ERR SAFEOP"));
        assert_eq!(other.configuration_failed, Some(true));
    }

    #[test]
    fn short_list_gives_positions_states_and_flags() {
        let text = "0     0:0  OP              +  EK1100 EtherCAT-Koppler (2A E-Bus)\n\
                    1     0:1  PREOP           E  EL1008 8K. Dig. Eingang\n\
                    2  1001:0  SAFEOP + ERROR  +  0x00000539:0x00001000\n\
                    \n0     0:0  OP  +  EK1100\n";
        let read = lines(text);
        let block = take_list(&read).unwrap();
        assert_eq!(block.lines, 3, "the second list is another one");
        let told: Vec<_> = block
            .facts
            .iter()
            .filter_map(|fact| match &fact.what {
                FactKind::Read(whom, read) => {
                    Some((whom.clone(), read.state.clone(), read.configuration_failed))
                }
                _ => None,
            })
            .collect();
        let state = |text: &str| Some(text.to_owned());
        assert_eq!(
            told,
            [
                (SubDeviceRef::Position(0), state("OP"), None),
                (SubDeviceRef::Position(1), state("PREOP"), Some(true)),
                (SubDeviceRef::Position(2), state("ERR SAFEOP"), None),
            ]
        );
        let FactKind::SubDeviceFact(_, about) = &block.facts[4].what else { panic!() };
        assert_eq!(
            (about.vendor_id, about.product_code, about.alias),
            (Some(0x539), Some(0x1000), Some(1001))
        );
    }

    #[test]
    fn other_text_is_left_alone() {
        for text in [
            "",
            "=== Slave 1 ===",
            "=== Master x, Slave 0 ===",
            "0 0:0 what + ever",
            "12:30 OP + late",
        ] {
            let read = lines(text);
            assert!(take(&read).is_none() && take_list(&read).is_none(), "{text}");
        }
    }
}
