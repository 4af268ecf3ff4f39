//! Received frames, many at a time, in buffers that are laid out once.
//!
//! Reference: recvmmsg(2), packet(7), socket(7) (`SO_TIMESTAMPNS`), `linux/if_packet.h`.

use std::io;
use std::mem;
use std::os::fd::{AsFd, AsRawFd as _};
use std::ptr;

use linesman_proto::time::Instant;

use crate::clock::{ClockReading, HostClock};
use crate::direction::FrameDirection;
use crate::unix_time::UnixTime;

/// Room in front of each frame for the VLAN tag that the kernel takes off, in bytes.
const HEADROOM: usize = 4;
/// Room for a frame, in bytes: the longest tagged one is 1518.
const FRAME_ROOM: usize = 1532;
const SLOT_LEN: usize = HEADROOM + FRAME_ROOM;
/// Room for what the kernel tells of a frame: a time stamp (32 bytes) and auxiliary data (40).
const CONTROL_LEN: usize = 128;
/// Both addresses of an Ethernet frame, in bytes; a VLAN tag stands behind them.
const ADDRESSES_LEN: usize = 12;

/// Received frames. Nothing is allocated after [`Batch::new`].
pub struct Batch {
    bytes: Box<[u8]>,
    controls: Box<[Control]>,
    senders: Box<[libc::sockaddr_ll]>,
    vectors: Box<[libc::iovec]>,
    headers: Box<[libc::mmsghdr]>,
    frames: Vec<Placed>,
    /// So many headers, from the first on, are to be laid out anew: the kernel has filled them in.
    used: usize,
}

/// A received frame, borrowed from its batch.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ReceivedFrame<'a> {
    /// When it was seen, in times of the run.
    pub at: Instant,
    /// Who took that time.
    pub stamped_by: StampSource,
    /// Which way it went: [`FrameDirection::Outgoing`] is a copy of what this host sent.
    pub direction: FrameDirection,
    /// Length of the whole frame, in bytes.
    pub original_len: u32,
    /// Whether the frame was longer than a batch has room for.
    pub truncated: bool,
    /// The Ethernet frame, without check sequence, with any VLAN tag where it was.
    pub bytes: &'a [u8],
}

/// Who took the time of a frame.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum StampSource {
    /// The kernel, when the driver handed it the frame: its wall clock, converted.
    Kernel,
    /// The receiving thread, when it fetched the batch: the kernel gave no stamp.
    Reader,
}

/// Where a frame lies, and what is known of it.
#[derive(Clone, Copy)]
struct Placed {
    start: usize,
    len: usize,
    original_len: u32,
    at: Instant,
    stamped_by: StampSource,
    direction: FrameDirection,
}

/// What the kernel tells of one frame, aligned as its headers need.
#[derive(Clone, Copy)]
#[repr(C, align(8))]
struct Control([u8; CONTROL_LEN]);

/// Which frames a socket wants.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Wanted {
    /// Those that came from the line.
    Incoming,
    /// Copies of sent ones too.
    BothWays,
}

// SAFETY: the pointers in `vectors` and `headers` lead to memory that the batch owns, which stays where
// it is when the batch moves, and are followed by recvmmsg only.
#[allow(unsafe_code)]
unsafe impl Send for Batch {}

impl Batch {
    /// A batch with room for `frames` frames; at least one.
    #[must_use]
    #[allow(unsafe_code)]
    pub fn new(frames: usize) -> Self {
        let frames = frames.max(1);
        // SAFETY: these are made of integers and raw pointers, for which zero is a valid value.
        let (sender, vector, header) = unsafe { (mem::zeroed(), mem::zeroed(), mem::zeroed()) };
        Self {
            bytes: vec![0; frames * SLOT_LEN].into_boxed_slice(),
            controls: vec![Control([0; CONTROL_LEN]); frames].into_boxed_slice(),
            senders: vec![sender; frames].into_boxed_slice(),
            vectors: vec![vector; frames].into_boxed_slice(),
            headers: vec![header; frames].into_boxed_slice(),
            frames: Vec::with_capacity(frames),
            used: frames,
        }
    }

    /// How many frames it holds.
    #[must_use]
    pub fn len(&self) -> usize {
        self.frames.len()
    }

    /// Whether it holds none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.frames.is_empty()
    }

    /// The frames, in the order in which they were received.
    pub fn iter(&self) -> impl Iterator<Item = ReceivedFrame<'_>> {
        self.frames.iter().map(|placed| ReceivedFrame {
            at: placed.at,
            stamped_by: placed.stamped_by,
            direction: placed.direction,
            original_len: placed.original_len,
            truncated: (placed.len as u64) < u64::from(placed.original_len),
            bytes: &self.bytes[placed.start..placed.start + placed.len],
        })
    }

    /// Forgets its frames.
    pub fn clear(&mut self) {
        self.frames.clear();
    }

    /// Fetches what a packet socket has received, as much as there is room for, without waiting.
    /// Gives how many frames the kernel handed over, those that are not wanted included.
    pub(super) fn receive(
        &mut self,
        socket: impl AsFd,
        clock: &HostClock,
        wanted: Wanted,
    ) -> io::Result<usize> {
        self.frames.clear();
        let count = self.fetch(socket)?;
        let reading = clock.read();
        for slot in 0..count {
            let placed = self.place(slot, reading);
            if wanted == Wanted::BothWays || placed.direction != FrameDirection::Outgoing {
                self.frames.push(placed);
            }
        }
        Ok(count)
    }

    #[allow(unsafe_code)]
    fn fetch(&mut self, socket: impl AsFd) -> io::Result<usize> {
        self.point();
        let count = self.headers.len() as libc::c_uint;
        // With MSG_TRUNC the kernel tells the whole length of a frame that was cut.
        let flags = libc::MSG_DONTWAIT | libc::MSG_TRUNC;
        let socket = socket.as_fd().as_raw_fd();
        // SAFETY: `count` headers are there, and each leads to memory of this batch of the length
        // that it tells (see `point`); the borrow of `self` lasts beyond the call.
        let result = unsafe {
            libc::recvmmsg(socket, self.headers.as_mut_ptr(), count, flags as _, ptr::null_mut())
        };
        let count = usize::try_from(result).map_err(|_| io::Error::last_os_error())?;
        self.used = count;
        Ok(count)
    }

    /// Sets the pointers and lengths of the headers that were used since they were set last. Each array is borrowed once, so that all its pointers stay
    /// valid together.
    #[allow(unsafe_code)]
    fn point(&mut self) {
        let bytes = self.bytes.as_mut_ptr();
        let controls = self.controls.as_mut_ptr();
        let senders = self.senders.as_mut_ptr();
        let vectors = self.vectors.as_mut_ptr();
        let used = std::mem::take(&mut self.used);
        for (slot, message) in self.headers.iter_mut().take(used).enumerate() {
            let header = &mut message.msg_hdr;
            // SAFETY: every array has one element for each header, and `bytes` SLOT_LEN bytes, so
            // that all offsets stay inside their arrays.
            unsafe {
                let frame = bytes.add(slot * SLOT_LEN + HEADROOM);
                *vectors.add(slot) = libc::iovec { iov_base: frame.cast(), iov_len: FRAME_ROOM };
                header.msg_iov = vectors.add(slot);
                header.msg_name = senders.add(slot).cast();
                header.msg_control = controls.add(slot).cast();
            }
            header.msg_iovlen = 1;
            header.msg_namelen = mem::size_of::<libc::sockaddr_ll>() as libc::socklen_t;
            header.msg_controllen = CONTROL_LEN as _;
            header.msg_flags = 0;
        }
    }

    fn place(&mut self, slot: usize, reading: ClockReading) -> Placed {
        let message = &self.headers[slot];
        let whole = message.msg_len as usize;
        #[allow(clippy::unnecessary_cast, reason = "another type with other C libraries")]
        let told_len = (message.msg_hdr.msg_controllen as usize).min(CONTROL_LEN);
        let told = Told::read(&self.controls[slot].0[..told_len]);
        let (at, stamped_by) = match told.stamp {
            Some(stamp) => (reading.instant_of(stamp), StampSource::Kernel),
            None => (reading.at, StampSource::Reader),
        };
        let direction = match self.senders[slot].sll_pkttype {
            libc::PACKET_OUTGOING => FrameDirection::Outgoing,
            _ => FrameDirection::Incoming,
        };
        let (mut start, mut len) = (slot * SLOT_LEN + HEADROOM, whole.min(FRAME_ROOM));
        let mut original_len = whole as u32;
        if let Some([a, b, c, d]) = told.tag
            && len >= ADDRESSES_LEN
        {
            self.bytes.copy_within(start..start + ADDRESSES_LEN, start - HEADROOM);
            start -= HEADROOM;
            let tag = start + ADDRESSES_LEN;
            self.bytes[tag..tag + 4].copy_from_slice(&[a, b, c, d]);
            len += HEADROOM;
            original_len += HEADROOM as u32;
        }
        Placed { start, len, original_len, at, stamped_by, direction }
    }
}

/// What the kernel tells beside a frame.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
struct Told {
    stamp: Option<UnixTime>,
    /// The VLAN tag that was taken off, as on the wire.
    tag: Option<[u8; 4]>,
}

impl Told {
    /// Walks over control messages: length, level, type, data, aligned to a machine word.
    fn read(mut bytes: &[u8]) -> Self {
        const WORD: usize = mem::size_of::<usize>();
        const HEADER: usize = mem::size_of::<libc::cmsghdr>();
        let mut told = Self::default();
        while let Some((header, _)) = bytes.split_first_chunk::<HEADER>() {
            let Some(len) = header.first_chunk().map(|len| usize::from_ne_bytes(*len)) else {
                break;
            };
            let Some(data) = bytes.get(HEADER..len) else { break };
            let (level, kind) = (i32_at(header, WORD), i32_at(header, WORD + 4));
            match (level, kind) {
                (Some(libc::SOL_SOCKET), Some(libc::SCM_TIMESTAMPNS)) => told.stamp = stamp(data),
                (Some(libc::SOL_PACKET), Some(libc::PACKET_AUXDATA)) => told.tag = tag(data),
                _ => {}
            }
            bytes = bytes.get(len.next_multiple_of(WORD)..).unwrap_or_default();
        }
        told
    }
}

/// A `timespec`: seconds and nanoseconds, each a machine word.
fn stamp(data: &[u8]) -> Option<UnixTime> {
    const WORD: usize = mem::size_of::<isize>();
    let word = |at: usize| {
        let bytes = data.get(at..)?.first_chunk()?;
        i128::try_from(isize::from_ne_bytes(*bytes)).ok()
    };
    Some(UnixTime::from_nanos(word(0)? * 1_000_000_000 + word(WORD)?))
}

/// A `tpacket_auxdata`: status at 0, tag at 16, its EtherType at 18.
fn tag(data: &[u8]) -> Option<[u8; 4]> {
    let status = i32_at(data, 0)?.cast_unsigned();
    if status & libc::TP_STATUS_VLAN_VALID == 0 {
        return None;
    }
    let half = |at: usize| Some(u16::from_ne_bytes(*data.get(at..)?.first_chunk()?));
    let told = status & libc::TP_STATUS_VLAN_TPID_VALID != 0;
    let ethertype = if told { half(18)? } else { linesman_proto::ethernet::ETHERTYPE_VLAN };
    let ([a, b], [c, d]) = (ethertype.to_be_bytes(), half(16)?.to_be_bytes());
    Some([a, b, c, d])
}

fn i32_at(bytes: &[u8], at: usize) -> Option<i32> {
    Some(i32::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(level: i32, kind: i32, data: &[u8]) -> Vec<u8> {
        let len = mem::size_of::<libc::cmsghdr>() + data.len();
        let mut bytes = len.to_ne_bytes().to_vec();
        bytes.extend(level.to_ne_bytes());
        bytes.extend(kind.to_ne_bytes());
        bytes.extend(data);
        bytes.resize(len.next_multiple_of(mem::size_of::<usize>()), 0);
        bytes
    }

    #[test]
    fn stamp_and_tag_are_found_among_what_the_kernel_tells() {
        let time = [1_700_000_000_isize, 77].map(isize::to_ne_bytes).concat();
        let mut auxiliary = [0; 20];
        let status = libc::TP_STATUS_VLAN_VALID | libc::TP_STATUS_VLAN_TPID_VALID;
        auxiliary[..4].copy_from_slice(&status.to_ne_bytes());
        auxiliary[16..18].copy_from_slice(&0x6005_u16.to_ne_bytes());
        auxiliary[18..].copy_from_slice(&0x88A8_u16.to_ne_bytes());
        let told = [
            message(libc::SOL_PACKET, libc::PACKET_AUXDATA, &auxiliary),
            message(libc::SOL_SOCKET, 1, &[1, 2, 3]),
            message(libc::SOL_SOCKET, libc::SCM_TIMESTAMPNS, &time),
        ]
        .concat();
        let expected = Told {
            stamp: Some(UnixTime::from_nanos(1_700_000_000_000_000_077)),
            tag: Some([0x88, 0xA8, 0x60, 0x05]),
        };
        assert_eq!(Told::read(&told), expected);
        for len in 0..told.len() {
            let cut = Told::read(&told[..len]);
            assert!(cut.stamp.is_none() || len >= told.len() - 8, "cut at {len}");
        }
        // A length of 0 would never come to an end.
        assert_eq!(Told::read(&[0; CONTROL_LEN]), Told::default());
        auxiliary[..4].copy_from_slice(&1_u32.to_ne_bytes());
        let untagged = message(libc::SOL_PACKET, libc::PACKET_AUXDATA, &auxiliary);
        assert_eq!(Told::read(&untagged), Told::default());
    }
}
