//! Error counters as `toString(error_counters)` of `KickCAT` prints them, with what the program writes above: `slave 3`, or
//! nothing, so that they follow one another.
//!
//! Reference: `protocol.cc`, `toString(ErrorCounters const&)`.

use linesman_proto::register::ErrorCounters;

use super::fact::{Block, FactKind, Format, SubDeviceRef};
use super::register_values;
use super::text::{Line, so_many};
use crate::observation_file::ReadDevice;

/// Ports that it prints.
const PORTS: usize = 4;

/// Takes the counters of all SubDevices, each once.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let mut block = Block::new(Format::KickcatCounters);
    let mut all: Vec<(Option<u16>, [u8; ErrorCounters::LEN])> = Vec::new();
    let (mut port, mut number, mut pending) = (None::<usize>, None, 0);
    for (at, line) in lines.iter().enumerate() {
        let text = line.trimmed();
        if line.is_blank() {
            continue;
        }
        if let Some(told) = text.strip_prefix("Port ").and_then(|rest| rest.trim().parse().ok()) {
            if told == 0 {
                let is_again = number.is_some() && all.iter().any(|(known, _)| *known == number);
                if is_again {
                    break;
                }
                all.push((number.take(), [0; ErrorCounters::LEN]));
                pending = 0;
            }
            port = (told < PORTS && !all.is_empty()).then_some(told);
        } else if let (Some(port), Some((name, value)), Some((_, counters))) =
            (port, text.split_once(':'), all.last_mut())
            && let Ok(value) = value.trim().parse::<u8>()
        {
            match name.trim() {
                "invalid frame" => counters[2 * port] = value,
                "physical layer" => counters[2 * port + 1] = value,
                "forwarded" => counters[8 + port] = value,
                "lost link" => counters[16 + port] = value,
                _ => break,
            }
        } else {
            // A line above the next counters: its last number says whose they are.
            number = last_number(text);
            pending += 1;
            if pending > 2 || (all.is_empty() && number.is_none()) {
                break;
            }
            continue;
        }
        block.lines = at + 1;
    }
    if block.lines == 0 || all.is_empty() {
        return None;
    }
    block.what = format!("KickCAT error counters of {}", so_many(all.len(), "SubDevice"));
    let counts_from_0 = all.iter().any(|(number, _)| *number == Some(0));
    for (index, (number, counters)) in all.into_iter().enumerate() {
        let position = match number {
            Some(number) if counts_from_0 => number,
            Some(number) => number.checked_sub(1)?,
            None => u16::try_from(index).ok()?,
        };
        let mut read = ReadDevice::default();
        // What it does not print stays unknown: the processing unit and the application.
        register_values::fill(&mut read, ErrorCounters::START.0, &counters[..12]);
        register_values::fill(&mut read, ErrorCounters::START.0 + 16, &counters[16..]);
        block.tell(FactKind::SubDeviceFact(SubDeviceRef::Position(position), Box::default()));
        block.tell(FactKind::Read(SubDeviceRef::Position(position), Box::new(read)));
    }
    Some(block)
}

fn last_number(text: &str) -> Option<u16> {
    let digits = text.trim_end_matches(|one: char| !one.is_ascii_digit());
    let begin = digits.rfind(|one: char| !one.is_ascii_digit()).map_or(0, |at| at + 1);
    digits.get(begin..)?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::super::text::lines;
    use super::*;

    fn counters(bad: u8) -> String {
        (0..4)
            .map(|port| {
                format!(
                    "Port {port} \n  invalid frame:  {bad} \n  physical layer: 0 \n  forwarded:      0 \n  lost link:      {port} \n"
                )
            })
            .collect::<String>()
            + " \n"
    }

    #[test]
    fn counters_follow_one_another_or_bear_numbers() {
        let text = counters(0) + &counters(7);
        let block = take(&lines(&text)).unwrap();
        assert_eq!(block.what, "KickCAT error counters of 2 SubDevices");
        let numbered =
            format!("slave 1\n{}slave 2\n{}slave 1\n{}", counters(0), counters(3), counters(9));
        let block = take(&lines(&numbered)).unwrap();
        assert_eq!(block.facts.len(), 4, "the second round is a block of its own");
        let FactKind::Read(SubDeviceRef::Position(1), read) = &block.facts[3].what else {
            panic!()
        };
        let ports = read.ports.all();
        let port = ports[linesman_proto::port::Port::D].as_ref().unwrap();
        assert_eq!((port.frame.unwrap().0, port.lost_link.unwrap().0), (3, 3));
        assert_eq!(read.processing_unit, None, "it is not printed");
        assert!(take(&lines("Port 0\nopen")).is_none_or(|block| block.lines == 1));
        assert!(take(&lines("Dear colleague 7,\nPort 1")).is_none());
    }
}
