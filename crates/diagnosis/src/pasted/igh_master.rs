//! `ethercat master` of the IgH EtherCAT Master: phase, devices with their links, frames, losses.

use super::fact::{Block, FactKind, Format, extent};
use super::igh_slaves::reference;
use super::text::{Line, decimal, leading_number, value_of};
use crate::observation_file::{Count, ObservedMainDevice};

const KNOWN: [&str; 21] = [
    "Phase:",
    "Active:",
    "Slaves:",
    "Ethernet devices:",
    "Main:",
    "Backup:",
    "Link:",
    "Tx frames:",
    "Tx bytes:",
    "Rx frames:",
    "Rx bytes:",
    "Tx errors:",
    "Tx frame rate",
    "Tx rate",
    "Rx frame rate",
    "Rx rate",
    "Common:",
    "Lost frames:",
    "Loss rate",
    "Frame loss",
    "Distributed clocks:",
];

fn is_known(line: &Line<'_>) -> bool {
    let text = line.trimmed();
    let others = ["Reference clock:", "DC reference clock:", "Application time:"];
    KNOWN.iter().chain(&others).any(|known| text.starts_with(known)) || is_date(text)
}

/// `2026-11-20 10:00:00.000000000`, beneath the application time.
fn is_date(text: &str) -> bool {
    text.len() > 18 && text.as_bytes().get(4) == Some(&b'-') && super::stamp::date(text).is_some()
}

fn is_header(text: &str) -> bool {
    text.strip_prefix("Master").is_some_and(|rest| rest.trim().parse::<u32>().is_ok())
}

/// Takes it, also where its first line is missing.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let first = lines.first()?.trimmed();
    let next = lines.iter().skip(1).find(|line| !line.is_blank())?;
    let begins = is_header(first) && next.trimmed().starts_with("Phase:");
    let is_cut = first.starts_with("Phase:") && next.trimmed().starts_with("Active:");
    let from_frames = first.starts_with("Common:") && next.trimmed().starts_with("Tx frames:");
    if !begins && !is_cut && !from_frames {
        return None;
    }
    let mut block = Block::new(Format::IghMaster);
    let mut is_first = true;
    (block.lines, block.unused) = extent(lines, |line| {
        // Another master begins with its own line.
        let is_new =
            (is_header(line.trimmed()) || line.trimmed().starts_with("Phase:")) && !is_first;
        let was_header = is_first && is_header(line.trimmed());
        is_first = was_header;
        (is_known(line) && !(is_new && is_header(line.trimmed()))) || was_header
    });
    let mut main = ObservedMainDevice::default();
    let mut is_common = from_frames;
    // Which device the lines are about, and whether it is attached at all.
    let mut is_main = true;
    let mut own = ObservedMainDevice::default();
    for line in &lines[..block.lines] {
        let text = line.trimmed();
        let count = |key| {
            value_of(text, key).and_then(|value| leading_number(value)).map(|(n, _)| Count(n))
        };
        if text.starts_with("Common:") {
            is_common = true;
        } else if text.starts_with("Main:") || text.starts_with("Backup:") {
            is_main = text.starts_with("Main:");
        } else if let Some(link) = value_of(text, "Link").filter(|_| is_main) {
            main.link = match link {
                "UP" => Some(true),
                "DOWN" => Some(false),
                _ => None,
            };
        } else if let Some(slaves) = count("Slaves") {
            main.answering = u16::try_from(slaves.0).ok();
        } else if let Some(errors) = count("Tx errors").filter(|_| is_main) {
            main.send_errors = Some(errors);
        } else if let Some(frames) = count("Tx frames") {
            if is_common || is_main {
                own.sent = Some(frames);
            }
        } else if let Some(lost) = count("Lost frames") {
            main.lost = Some(lost);
        } else if let Some(rates) = rates(text, "Loss rate [1/s]") {
            main.lost_per_s = rates.first().copied();
        } else if let Some(clock) = value_of(text, "Reference clock") {
            // Known, and of no use: which SubDevice it is says its position.
            let _: Option<u16> = reference(clock);
        }
    }
    main.sent = own.sent;
    let phase =
        lines[..block.lines].iter().find_map(|line| value_of(&line.text, "Phase")).unwrap_or("");
    block.what = match phase {
        "" => "`ethercat master`".to_owned(),
        phase => format!("`ethercat master`, phase {phase}"),
    };
    // Nobody has scanned a line without a link.
    if phase.starts_with("Waiting") {
        main.answering = None;
    }
    block.tell(FactKind::Main(Box::new(main)));
    Some(block)
}

fn rates(text: &str, key: &str) -> Option<Vec<f64>> {
    let rest = text.strip_prefix(key)?.trim_start().strip_prefix(':')?;
    Some(rest.split_whitespace().map_while(decimal).collect())
}

#[cfg(test)]
mod tests {
    use super::super::text::lines;
    use super::*;

    const TEXT: &str = "\
Master0
  Phase: Operation
  Active: yes
  Slaves: 4
  Ethernet devices:
    Main: 00:1b:21:aa:bb:cc (attached)
      Link: UP
      Tx frames:   2502841
      Tx bytes:    240272736
      Rx frames:   2502804
      Rx bytes:    240269184
      Tx errors:   2
      Tx frame rate [1/s]:   1000   1000   1000
      Tx rate [KByte/s]:     93.8   93.8   93.8
      Rx frame rate [1/s]:    998   1000   1000
      Rx rate [KByte/s]:     93.6   93.8   93.8
    Common:
      Tx frames:   2502841
      Tx bytes:    240272736
      Rx frames:   2502804
      Rx bytes:    240269184
      Lost frames: 37
      Tx frame rate [1/s]:   1000   1000   1000
      Tx rate [KByte/s]:     93.8   93.8   93.8
      Rx frame rate [1/s]:    998   1000   1000
      Rx rate [KByte/s]:     93.6   93.8   93.8
      Loss rate [1/s]:          2      0      0
      Frame loss [%]:         0.2    0.0    0.0
  Distributed clocks:
    Reference clock:   Slave 0
    DC reference clock: Slave 0
    Application time:   649335600000000000
                        2020-07-28 10:20:00.000000000
";

    fn main(block: &Block) -> &ObservedMainDevice {
        let [super::super::fact::Fact { what: FactKind::Main(main), .. }] = &block.facts[..] else {
            panic!()
        };
        main
    }

    #[test]
    fn frames_losses_link_and_slaves_are_read() {
        let block = take(&lines(TEXT)).unwrap();
        assert_eq!((block.lines, block.unused.len()), (33, 0));
        let main = main(&block);
        assert_eq!((main.sent, main.lost), (Some(Count(2_502_841)), Some(Count(37))));
        assert_eq!(
            (main.link, main.answering, main.send_errors),
            (Some(true), Some(4), Some(Count(2)))
        );
        assert_eq!(
            (main.lost_per_s, main.crc),
            (Some(2.0), None),
            "it does not know the card's counters"
        );
    }

    #[test]
    fn a_text_without_its_first_line_or_its_end_is_read_as_far_as_it_goes() {
        let cut: String = TEXT.lines().skip(1).take(8).map(|line| format!("{line}\n")).collect();
        let block = take(&lines(&cut)).unwrap();
        assert_eq!(main(&block).lost, None, "what is not there is not 0");
        assert!(take(&lines("Master0\nsomething else\n")).is_none());
    }
}
