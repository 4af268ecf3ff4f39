//! Datagrams that wait to be packed into frames.

use linesman_proto::frame::size::frame_size;
use linesman_proto::frame::{DATAGRAM_OVERHEAD, FrameBuilder};

use super::request::{Departure, Request};

/// Names a request until its answer is fetched.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) struct Ticket(pub(crate) u64);

/// A request that waits, or is on its way.
#[derive(Debug)]
pub(crate) struct Queued {
    pub(crate) ticket: Ticket,
    pub(crate) request: Request,
    /// How many frames have carried it.
    pub(crate) frames: u32,
}

/// Packs as many of `queue` into a frame as fit, in order, at most `most` and into `room` bytes, but
/// at least one, and moves them to `packed`. The index of each datagram is told by `index`, from its
/// place in the frame.
pub(crate) fn pack(
    builder: &mut FrameBuilder<'_>,
    queue: &mut std::collections::VecDeque<Queued>,
    packed: &mut Vec<Queued>,
    most: usize,
    room: usize,
    index: impl Fn(usize) -> u8,
) {
    let mut size = frame_size([]);
    while packed.len() < most
        && let Some(next) = queue.front()
    {
        let Request { command, address, data, departure, .. } = &next.request;
        let alone = *departure != Departure::Together;
        if alone && !packed.is_empty() {
            return;
        }
        size += data.len() + DATAGRAM_OVERHEAD;
        if size > room && !packed.is_empty() {
            return;
        }
        match builder.push(*command, index(packed.len()), *address, data.len()) {
            Ok(slot) => slot.copy_from_slice(data),
            Err(_full) => return,
        }
        if let Some(mut queued) = queue.pop_front() {
            queued.frames += 1;
            packed.push(queued);
        }
        if alone {
            return;
        }
    }
}
