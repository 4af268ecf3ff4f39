//! `ethtool -S eth0`: counters of the network card, which each driver calls otherwise.
//!
//! Reference: statistics of the drivers e1000e, igb, igc, r8169, and `Documentation/networking/statistics.rst` of
//! Linux. `rx_dropped` is left aside: among it are frames that no program wanted.

use super::fact::{Block, FactKind, Format, extent};
use super::text::{Line, count};
use crate::observation_file::{Count, ObservedMainDevice};

/// Damaged frames: names that count the same are not added up.
const DAMAGED: [&[&str]; 3] = [
    &[
        "rx_crc_errors",
        "crc_errors",
        "rx_fcs_errors",
        "rx_fcs_error",
        "rx_crc_errors_phy",
        "rx_eth_crc_err",
        "mac_rx_crc_error",
        "rx_frame_check_sequence_errors",
        "rx_crc_error",
        "fcs_errors",
    ],
    &["rx_align_errors", "align_errors", "rx_alignment_errors", "rx_frame_errors"],
    &["rx_symbol_errors", "rx_symbol_err_phy", "symbol_errors"],
];
/// Frames that were dropped for want of room.
const DROPPED: [&[&str]; 3] = [
    &["rx_missed_errors", "rx_missed", "rx_out_of_buffer", "rx_discards_phy"],
    &["rx_fifo_errors", "rx_fifo_overrun", "rx_over_errors"],
    &["rx_no_buffer_count", "rx_no_dma_resources"],
];
/// Frames that could not be sent.
const UNSENT: [&[&str]; 4] = [
    &["tx_errors"],
    &["tx_aborted_errors", "tx_aborted", "tx_underrun"],
    &["tx_carrier_errors"],
    &["tx_timeout_count"],
];
const SENT: [&[&str]; 1] = [&["tx_packets", "tx_packets_phy", "tx_good_frames"]];

fn row(line: &str) -> Option<(&str, u64)> {
    let (name, value) = line.trim().split_once(':')?;
    let is_name = name.chars().all(|one| one.is_ascii_alphanumeric() || "_-.[] ".contains(one));
    let value = value.trim();
    (is_name && !name.is_empty() && !value.is_empty()).then_some(())?;
    Some((name.trim(), count(value)?))
}

/// Takes it, also where its first line is missing.
pub(super) fn take(lines: &[Line<'_>]) -> Option<Block> {
    let first = lines.first()?;
    let is_whole = first.trimmed() == "NIC statistics:";
    let is_known = |name: &str| {
        let all = DAMAGED.iter().chain(&DROPPED).chain(&UNSENT).chain(&SENT);
        all.flat_map(|names| names.iter()).any(|known| *known == name)
            || ["rx_packets", "rx_bytes", "tx_bytes", "rx_errors", "rx_dropped", "tx_dropped"]
                .contains(&name)
    };
    let is_cut = || {
        let near = lines.iter().take(4).filter_map(|line| row(&line.text));
        near.filter(|(name, _)| is_known(name)).count() >= 2 && row(&first.text).is_some()
    };
    if !is_whole && !is_cut() {
        return None;
    }
    let mut block = Block::new(Format::Ethtool);
    let mut is_first = true;
    (block.lines, block.unused) = extent(lines, |line| {
        let begins = line.trimmed() == "NIC statistics:";
        let was_first = std::mem::take(&mut is_first);
        if begins { was_first } else { row(&line.text).is_some() }
    });
    let rows: Vec<(&str, u64)> =
        lines[..block.lines].iter().filter_map(|line| row(&line.text)).collect();
    let mut main = ObservedMainDevice {
        crc: damaged(&rows),
        drops: sum(&rows, &DROPPED),
        send_errors: sum(&rows, &UNSENT),
        ..ObservedMainDevice::default()
    };
    // What else goes over the card is no matter of EtherCAT; but there is hardly anything else.
    main.sent = sum(&rows, &SENT);
    block.what = "`ethtool -S`".to_owned();
    block.tell(FactKind::Main(Box::new(main)));
    Some(block)
}

/// Damaged frames. A driver without a counter for them counts them among all errors.
fn damaged(rows: &[(&str, u64)]) -> Option<Count> {
    let (of_frames, others) = DAMAGED.split_at(1);
    if sum(rows, of_frames).is_some() {
        return sum(rows, &DAMAGED);
    }
    let all = rows.iter().find(|(name, _)| *name == "rx_errors").map(|(_, count)| Count(*count));
    all.map(|all| all.max(sum(rows, others).unwrap_or(all)))
}

/// The first known name of each kind, added up; `None` where none is there.
fn sum(rows: &[(&str, u64)], kinds: &[&[&str]]) -> Option<Count> {
    let of_kind = |names: &&[&str]| {
        names
            .iter()
            .find_map(|name| rows.iter().find(|(known, _)| known == name))
            .map(|(_, count)| *count)
    };
    kinds.iter().filter_map(of_kind).reduce(u64::saturating_add).map(Count)
}

/// The interface that a command names: `ethtool -S eth0`.
pub(super) fn interface(command: &str) -> Option<&str> {
    let (_, rest) = command.split_once("ethtool ")?;
    rest.split_whitespace().find(|word| !word.starts_with('-'))
}

#[cfg(test)]
mod tests {
    use super::super::fact::Fact;
    use super::super::text::lines;
    use super::*;

    fn main(text: &str) -> ObservedMainDevice {
        let block = take(&lines(text)).unwrap();
        let [Fact { what: FactKind::Main(main), .. }] = &block.facts[..] else { panic!() };
        *main.clone()
    }

    #[test]
    fn counters_of_several_drivers_mean_the_same() {
        let igb = main(
            "NIC statistics:\n     rx_packets: 2502804\n     tx_packets: 2502841\n     rx_crc_errors: 12\n\
             \x20    rx_missed_errors: 3\n     rx_no_buffer_count: 0\n     tx_aborted_errors: 0\n\
             \x20    tx_carrier_errors: 0\n     rx_align_errors: 1\n     rx_dropped: 77\n",
        );
        assert_eq!(
            (igb.crc, igb.drops, igb.send_errors),
            (Some(Count(13)), Some(Count(3)), Some(Count(0)))
        );
        assert_eq!(igb.sent, Some(Count(2_502_841)));
        let r8169 = main(
            "NIC statistics:\n     tx_packets: 2654\n     rx_packets: 3960\n     tx_errors: 0\n     rx_errors: 316\n\
             \x20    rx_missed: 0\n     align_errors: 9194\n     tx_underrun: 0\n",
        );
        assert_eq!((r8169.crc, r8169.drops), (Some(Count(9194)), Some(Count(0))));
    }

    #[test]
    fn what_a_driver_does_not_count_is_not_0() {
        let sparse = main("NIC statistics:\n     tx_packets: 10\n     rx_packets: 10\n");
        assert_eq!((sparse.crc, sparse.drops, sparse.send_errors), (None, None, None));
        assert!(take(&lines("rx: 3\nname: value\n")).is_none());
        assert_eq!(interface("# ethtool -S enp2s0"), Some("enp2s0"));
    }
}
