//! Repair of recordings: frames that a recorder lost or put in another order.
//!
//! A return that was recorded before its request belongs to it all the same. A return whose request is
//! missing tells what the request was: controllers change data only where something was read, count
//! the working counter up from 0, and add one to a position each.

use linesman_diagnosis::observe::Fingerprint;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;

use super::{Frame, Recording, Turn, datagrams};

/// A return stands at most so many frames before its request.
const APART: u64 = 8;
/// The mark of the first controller in the source address, and where that stands.
const MARK: (usize, u8) = (6, 0x02);
/// Length of a datagram's header, and of the counter behind its data, in bytes.
const HEADER: usize = 10;
const COUNTER: usize = 2;

/// Puts returns without a request where they belong; `turns` are in order.
pub(super) fn repair(recording: &mut Recording, alone: Vec<Frame>) {
    let mut rebuilt = Vec::new();
    let count = passed(recording);
    for reply in alone {
        let print = lasting(&reply.bytes);
        let from =
            recording.turns.partition_point(|turn| turn.request.number + APART < reply.number);
        let late = recording.turns[from..]
            .iter_mut()
            .take_while(|turn| turn.request.number <= reply.number + APART)
            .find(|turn| turn.reply.is_none() && lasting(&turn.request.bytes) == print);
        match late {
            Some(turn) => turn.reply = Some(reply),
            None => {
                recording.alone += 1;
                recording.gap(reply.number);
                if let Some(request) = count.and_then(|count| request_of(&reply, count)) {
                    rebuilt.push(Turn { request, reply: Some(reply), is_rebuilt: true });
                }
            }
        }
    }
    let lost = recording.turns.iter().find(|turn| turn.reply.is_none());
    // The last requests may be on their way when a recording ends.
    if let Some(number) = lost.map(|turn| turn.request.number) {
        recording.gap(number);
    }
    recording.turns.extend(rebuilt);
    recording.turns.sort_by_key(|turn| turn.request.number);
}

fn lasting(frame: &[u8]) -> u64 {
    FrameView::parse(frame).map_or(0, |view| Fingerprint::of(&view).lasting)
}

/// How many controllers a frame passes, where an exchange shows it.
fn passed(recording: &Recording) -> Option<u16> {
    recording.turns.iter().flat_map(Turn::pairs).find_map(|(request, reply)| {
        let counts =
            matches!(request.command?.addressing(), Addressing::Position | Addressing::Broadcast);
        let passed = reply.adp.wrapping_sub(request.adp);
        (counts && reply.wkc > 0 && passed > 0).then_some(passed)
    })
}

/// The request that a return was; `None` where that does not follow from it.
fn request_of(reply: &Frame, count: u16) -> Option<Frame> {
    let mut bytes = reply.bytes.clone();
    let base = reply.bytes.as_ptr() as usize;
    for datagram in datagrams(&reply.bytes) {
        let effect = datagram.command?.effect();
        // What it wrote is replaced by what it read.
        if effect.reads && effect.writes && datagram.command != Some(Command::Lrw) {
            return None;
        }
        let data = datagram.data.as_ptr() as usize - base;
        let header = data.checked_sub(HEADER)?;
        if matches!(effect.addressing, Addressing::Position | Addressing::Broadcast) {
            let adp = datagram.adp.wrapping_sub(count).to_le_bytes();
            bytes.get_mut(header + 2..header + 4)?.copy_from_slice(&adp);
        }
        // The event field, and the mark of a frame that goes round.
        bytes.get_mut(header + 8..header + 10)?.fill(0);
        let end = data + datagram.data.len();
        if effect.reads && !effect.writes {
            bytes.get_mut(data..end)?.fill(0);
        }
        bytes.get_mut(end..end + COUNTER)?.fill(0);
    }
    *bytes.get_mut(MARK.0)? &= !MARK.1;
    Some(Frame { number: reply.number, at: reply.at, bytes })
}
