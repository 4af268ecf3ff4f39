//! Two copies of a frame, one sent by each card of a ring, become one answer.
//!
//! In an intact ring one copy is processed by all and the other by none; in a broken one each half
//! of the line processes one. Datagrams are merged one by one:
//!
//! * working counters and events add up;
//! * broadcast reads are ORed, as the controllers themselves do;
//! * logical reads are ORed byte by byte: what is read is sent as zeros, so the bytes of a SubDevice
//!   are zero in the copy that did not reach it, and outputs are the same in both;
//! * addressed reads come from the copy that was answered.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::{FrameView, WKC_LEN};

/// Merges the datagrams of `second` into `first`. Both are frames that match the one that was sent,
/// so that their datagrams lie at the same places.
pub(crate) fn merge(first: &mut [u8], second: &[u8]) {
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
        if ors && ours > 0 && theirs > 0 {
            for (mine, other) in first[data.clone()].iter_mut().zip(datagram.data()) {
                *mine |= other;
            }
        } else if ours == 0 && theirs > 0 {
            first[data.clone()].copy_from_slice(datagram.data());
            first[at + 2..at + 4].copy_from_slice(&second[at + 2..at + 4]);
        }
        let sum = ours.wrapping_add(theirs).to_le_bytes();
        first[data.end..data.end + WKC_LEN].copy_from_slice(&sum);
    }
}

fn word(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}
