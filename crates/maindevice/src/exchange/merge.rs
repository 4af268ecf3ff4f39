//! Two copies of a frame, one sent by each card of a ring, become one answer.
//!
//! In an intact ring one copy is processed by all and the other by none; in a broken one each half
//! of the line processes one. Datagrams are merged one by one:
//!
//! * working counters and events add up;
//! * broadcast reads are ORed, as the controllers themselves do;
//! * logical reads are ORed byte by byte: what is read is sent as zeros, so the bytes of a SubDevice
//!   are zero in the copy that did not reach it, and outputs are the same in both;
//! * addressed reads come from the copy that was answered; what is read from one SubDevice and written to the
//!   others (ARMW, FRMW), from the copy that met the one that is read, and from that of card A if neither did.

use std::ops::Range;

use linesman_proto::address::Path;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::{FrameView, WKC_LEN};

/// Merges the datagrams of `second` into `first`, which card `card` had sent. Both are frames that match the one that
/// was sent, so that their datagrams lie at the same places. `sent` gives the data that a card sent at some place.
pub(crate) fn merge<'a>(
    first: &mut [u8],
    card: Path,
    second: &[u8],
    sent: impl Fn(Path, Range<usize>) -> Option<&'a [u8]>,
) {
    let Ok(view) = FrameView::parse(second) else { return };
    for datagram in view.datagrams().map_while(Result::ok) {
        let data = datagram.data_range();
        let at = datagram.offset();
        if first.len() < data.end + WKC_LEN {
            return;
        }
        for irq in at + 8..at + 10 {
            first[irq] |= second[irq];
        }
        let ours = word(first, data.end);
        let theirs = datagram.wkc().0;
        // In the copy of card B, positions are masked as NOP: the command of either copy counts.
        let command = [first[at], datagram.code()].into_iter().max().and_then(Command::from_code);
        first[at] = command.map_or(first[at], Command::code);
        let ors = command.is_some_and(|command| {
            matches!(command.addressing(), Addressing::Broadcast | Addressing::Logical)
        });
        let is_seconds = match command.is_some_and(hands_round) {
            true => {
                let met = |card, bytes: &[u8]| sent(card, data.clone()) != bytes.get(data.clone());
                let by_first = met(card, first);
                !by_first && (card == Path::B || met(card.other(), second))
            }
            false => theirs > 0 && ours == 0,
        };
        if ors && ours > 0 && theirs > 0 {
            for (mine, other) in first[data.clone()].iter_mut().zip(datagram.data()) {
                *mine |= other;
            }
        } else if is_seconds {
            first[data.clone()].copy_from_slice(datagram.data());
            first[at + 2..at + 4].copy_from_slice(&second[at + 2..at + 4]);
        }
        let sum = ours.wrapping_add(theirs).to_le_bytes();
        first[data.end..data.end + WKC_LEN].copy_from_slice(&sum);
    }
}

/// Whether it reads from one SubDevice and writes that to all others: those count, too.
fn hands_round(command: Command) -> bool {
    matches!(command, Command::Armw | Command::Frmw)
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

#[cfg(test)]
mod tests {
    use linesman_proto::ethernet::MacAddress;
    use linesman_proto::frame::FrameBuilder;
    use linesman_proto::frame::builder::DatagramAddress;
    use linesman_proto::register::SYSTEM_TIME;

    use super::*;

    /// A frame of one FRMW with this time and working counter.
    fn frame(time: [u8; 4], wkc: u16) -> Vec<u8> {
        let mut bytes = vec![0; 64];
        let mut builder = FrameBuilder::new(&mut bytes, MacAddress([2, 0, 0, 0, 0, 1]));
        let address = DatagramAddress::Physical(0x1001, SYSTEM_TIME.address);
        builder.push(Command::Frmw, 1, address, 4).unwrap().copy_from_slice(&time);
        let len = builder.finish();
        bytes.truncate(len);
        bytes[30..32].copy_from_slice(&wkc.to_le_bytes());
        bytes
    }

    /// In a broken ring the reference is in one half; the other half took what was sent, and counted it. The second card
    /// may have sent another time than the first one.
    #[test]
    fn the_reference_time_comes_from_the_half_where_the_reference_is() {
        let time = [9, 8, 0, 0];
        for sent in [[[7, 0, 0, 0], [7, 0, 0, 0]], [[7, 0, 0, 0], [5, 0, 0, 0]]] {
            let by = |card: Path, _| Some(&sent[card.index()][..]);
            for first in Path::ALL {
                let second = first.other();
                for met in Path::ALL {
                    let data = |card: Path| if card == met { time } else { sent[card.index()] };
                    let mut merged = frame(data(first), 2);
                    merge(&mut merged, first, &frame(data(second), 3), by);
                    assert_eq!(
                        merged[26..32],
                        [9, 8, 0, 0, 5, 0],
                        "{first:?} back first, {met:?} met it"
                    );
                }
                let mut merged = frame(sent[first.index()], 2);
                merge(&mut merged, first, &frame(sent[second.index()], 3), by);
                assert_eq!(
                    merged[26..32],
                    [7, 0, 0, 0, 5, 0],
                    "{first:?} back first, nobody met it"
                );
            }
        }
    }
}
