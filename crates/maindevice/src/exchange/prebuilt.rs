//! Cyclic frames, built once: headers stay, outputs and index bytes change. A frame that is sent is put
//! together where it leaves from: what stays is copied, but for long outputs, which are written there
//! anyway.
//!
//! A reply is compared with what was sent eight bytes at a time: the first eight bytes of a datagram
//! header are command, index, address and length, which is all that tells one datagram from another
//! (ETG.1000.4, 5.4.1.2). Working counters are where they were sent, so nothing is parsed.

use std::ops::Range;

use linesman_config::plan::{DatagramPlan, FramePlan, Role};
use linesman_proto::address::Path;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{HEADER_LEN, MAX_LEN, MacAddress};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameBuilder};
use linesman_proto::sii::Direction;

use super::slot::{Copies, Slot};

/// Bits of the first eight header bytes that come back as they were sent: all but the round-trip
/// bit, which a controller may set.
const SAME: u64 = !(0x4000_u64 << 48);
/// The command.
const COMMAND: u64 = 0xFF;
/// The index byte.
const INDEX: u64 = 0xFF << 8;
/// The ADP field: controllers count it up in position and broadcast commands.
const ADP: u64 = 0xFFFF_u64 << 16;

/// Where the first datagram begins, and its index byte.
pub(super) const FIRST_HEADER: usize = HEADER_LEN + ETHERCAT_HEADER_LEN;
pub(crate) const FIRST_INDEX: usize = FIRST_HEADER + 1;
/// What of a datagram header is compared.
const HEAD_LEN: usize = 8;
/// All that is before the first of them, and it.
pub(super) const FIRST_HEAD_END: usize = FIRST_HEADER + HEAD_LEN;
/// Where the data of the first datagram begin.
const FIRST_DATA: usize = FIRST_HEADER + DATAGRAM_HEADER_LEN;

/// One datagram of a prebuilt frame.
#[derive(Clone, Copy, Debug)]
struct DatagramShape {
    /// Offset of its header.
    at: usize,
    /// The first eight bytes of its header with index 0: as planned, and with its outputs withheld.
    heads: [u64; 2],
    /// Which of their bits must come back the same, by the same two.
    masks: [u64; 2],
}

impl DatagramShape {
    /// No datagram.
    const NONE: Self = Self { at: FIRST_HEADER, heads: [0; 2], masks: [u64::MAX; 2] };

    #[inline]
    fn head(&self, index: u8, withheld: bool) -> u64 {
        self.heads[usize::from(withheld)] | u64::from(index) << 8
    }

    /// Whether a head is that of this datagram, whatever its index.
    #[inline]
    fn is_like(&self, head: u64, withheld: bool) -> bool {
        let variant = usize::from(withheld);
        (head ^ self.heads[variant]) & self.masks[variant] & !INDEX == 0
    }
}

/// Outputs of fewer bytes are copied twice: one long copy is cheaper than many short ones.
const LONG: usize = 128;
/// Where what follows the addresses of a frame begins.
const BEHIND_ADDRESSES: usize = 12;

/// A piece of a frame that is the same each time.
#[derive(Clone, Debug)]
enum FramePiece {
    /// Zeros: what is read, and working counters.
    Zeros(Range<usize>),
    /// Anything else.
    Bytes(Range<usize>),
}

/// What is otherwise in the copy of a frame that the second card of a ring sends: whether the system time is handed
/// round there, and which.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct SecondCopy {
    /// Where the data of its datagram begin in the frame, and how many bytes of a time they are.
    pub(crate) data_at: usize,
    pub(crate) len: usize,
    /// Its command.
    pub(crate) command: Command,
    /// Its time.
    pub(crate) time: [u8; 8],
}

impl SecondCopy {
    fn time(&self) -> &[u8] {
        &self.time[..self.len.min(self.time.len())]
    }

    /// Changes a copy that is about to leave.
    pub(super) fn put(&self, frame: &mut [u8]) {
        let time = self.time();
        if let Some(data) = frame.get_mut(self.data_at..self.data_at + time.len()) {
            data.copy_from_slice(time);
        }
        if let Some(code) = frame.get_mut(self.data_at.wrapping_sub(DATAGRAM_HEADER_LEN)) {
            *code = self.command.code();
        }
    }
}

/// A cyclic frame as card A sends it. Who sends it has it at hand beside what else there is to it; the
/// exchange has another for what comes back otherwise than nearly always.
#[derive(Clone, Debug)]
pub(crate) struct Prebuilt {
    /// Without outputs; in the exchange, where copies follow, the one that was sent last.
    bytes: Vec<u8>,
    /// What of these bytes, behind the first head, is copied into a frame that is sent; empty: all.
    pieces: Vec<FramePiece>,
    /// All that is before the data of the first datagram.
    beginning: [u8; FIRST_DATA],
    /// What comes back as it was sent if nobody had a hand in it, but for what
    /// [`Prebuilt::matches`] compares.
    fixed: Vec<Range<usize>>,
    /// What is otherwise in copies of the second card.
    second_copy: Option<SecondCopy>,
    /// What becomes of the copies behind the first.
    copies: Copies,
    /// Which of the plan's it is, where its only answer is waited for; else [`Slot::NONE`].
    awaited: u32,
    /// The first datagram, at hand, and all of them.
    first: DatagramShape,
    shapes: Vec<DatagramShape>,
    /// Bytes that a whole reply has at least.
    len: usize,
    /// Where the working counter of the broadcast read is that counts who is there.
    presence_at: Option<usize>,
}

/// What a datagram becomes when its outputs must not be taken for fresh: what is read goes on.
pub(crate) const fn withheld(command: Command) -> Command {
    match command {
        Command::Lrw => Command::Lrd,
        Command::Lwr => Command::Nop,
        Command::Nop
        | Command::Aprd
        | Command::Apwr
        | Command::Aprw
        | Command::Fprd
        | Command::Fpwr
        | Command::Fprw
        | Command::Brd
        | Command::Bwr
        | Command::Brw
        | Command::Lrd
        | Command::Armw
        | Command::Frmw => command,
    }
}

impl Prebuilt {
    /// The frame of a plan. What does not fit, which no plan has, is left out.
    pub(crate) fn new(index: u32, plan: &FramePlan, source: MacAddress, ring: bool) -> Self {
        let mut bytes = vec![0; MAX_LEN];
        let mut builder = FrameBuilder::new(&mut bytes, source);
        let mut at = FIRST_HEADER;
        let mut places = Vec::new();
        for datagram in &plan.datagrams {
            let DatagramPlan { command, address, len, role, .. } = datagram;
            if builder.push(*command, 0, *address, *len).is_ok() {
                places.push((at, *command, *role));
                at += len + linesman_proto::frame::DATAGRAM_OVERHEAD;
            }
        }
        let len = builder.finish();
        bytes.truncate(len);
        let shape = |(header, command, role): (usize, Command, Role)| {
            let mut head = [0; 8];
            head.copy_from_slice(&bytes[header..header + 8]);
            let variant = |command: Command| {
                head[0] = command.code();
                u64::from_le_bytes(head)
            };
            let commands = [command, withheld(command)];
            let mask = |command: Command| match command.addressing() {
                Addressing::Position | Addressing::Broadcast => SAME & !ADP,
                Addressing::Station | Addressing::Logical | Addressing::None => SAME,
            };
            // What hands the reference's time round is a mere read at times, and another one's at others.
            let free = match role {
                Role::ReferenceClock => COMMAND | ADP,
                // And nobody is led while there is no time to lead to.
                Role::ClockShift => COMMAND,
                Role::ProcessData
                | Role::Presence
                | Role::LatchedTime
                | Role::MailboxStates
                | Role::Other => 0,
            };
            let masks = commands.map(|command| mask(command) & !free);
            DatagramShape { at: header, heads: commands.map(variant), masks }
        };
        let shapes: Vec<DatagramShape> = places.into_iter().map(shape).collect();
        let outputs = || {
            let datagrams = plan.datagrams.iter().zip(data_offsets(plan));
            datagrams.flat_map(|(one, data)| {
                let outputs =
                    one.ownership.iter().filter(|own| own.direction == Direction::Outputs);
                outputs.map(move |own| (own, data + own.range.start..data + own.range.end))
            })
        };
        let whole = outputs().filter(|(own, _)| own.is_bytewise());
        let mut long = joined(whole.map(|(_, range)| range));
        long.retain(|range| range.len() >= LONG);
        let pieces = match long.is_empty() {
            true => Vec::new(),
            false => {
                let gaps = gaps(FIRST_DATA..len, long);
                gaps.into_iter().flat_map(|gap| pieces(&bytes, gap)).collect()
            }
        };
        let beginning = bytes.first_chunk().copied().unwrap_or([0; FIRST_DATA]);
        // Command and index are compared anyway.
        let heads = shapes.iter().map(|shape| shape.at..shape.at + 2);
        let clocks = plan.datagrams.iter().zip(data_offsets(plan));
        let is_clock = |role| matches!(role, Role::ReferenceClock | Role::ClockShift);
        let clocks = clocks.filter(|(one, _)| is_clock(one.role));
        let times = clocks.flat_map(|(one, data)| {
            let adp = data - DATAGRAM_HEADER_LEN + 2;
            [adp..adp + 2, data..data + one.len]
        });
        let moving = joined(outputs().map(|(_, range)| range).chain(heads).chain(times));
        let fixed = gaps(BEHIND_ADDRESSES..len, moving);
        let mut copies = Copies::new(plan.repeats.saturating_add(1), ring);
        copies.unsent -= 1;
        let awaited = if ring { Slot::NONE } else { index };
        let first = shapes.first().copied().unwrap_or(DatagramShape::NONE);
        let counted = plan.datagrams.iter().zip(data_offsets(plan));
        let mut counted = counted.filter(|(one, _)| one.role == Role::Presence);
        let presence_at = counted.next().map(|(one, data)| data + one.len);
        Self {
            bytes,
            pieces,
            beginning,
            fixed,
            second_copy: None,
            copies,
            awaited,
            first,
            shapes,
            len: at,
            presence_at,
        }
    }

    /// How many bytes it has.
    #[inline]
    pub(crate) fn len(&self) -> usize {
        self.bytes.len()
    }

    /// Puts the frame with this number together in `sent`, which is as long, but for its outputs, of
    /// which only those are zero that are short.
    #[inline]
    pub(crate) fn write(&mut self, number: u32, sent: &mut [u8]) {
        let [first, ..] = number.to_le_bytes();
        if self.pieces.is_empty() && sent.len() == self.bytes.len() {
            if let Some(index) = self.bytes.get_mut(FIRST_INDEX) {
                *index = first;
            }
            sent.copy_from_slice(&self.bytes);
        } else {
            self.beginning[FIRST_INDEX] = first;
            self.write_pieces(sent);
        }
        if self.shapes.len() > 1 {
            self.write_others(number, sent);
        }
    }

    #[inline]
    fn write_pieces(&self, sent: &mut [u8]) {
        if let Some(beginning) = sent.first_chunk_mut() {
            *beginning = self.beginning;
        }
        for piece in &self.pieces {
            match piece {
                FramePiece::Zeros(range) => {
                    if let Some(to) = sent.get_mut(range.clone()) {
                        to.fill(0);
                    }
                }
                FramePiece::Bytes(range) => {
                    if let (Some(to), Some(from)) =
                        (sent.get_mut(range.clone()), self.bytes.get(range.clone()))
                    {
                        to.copy_from_slice(from);
                    }
                }
            }
        }
    }

    /// Index bytes of the datagrams behind the first.
    #[inline(never)]
    fn write_others(&self, number: u32, sent: &mut [u8]) {
        let [_, others, ..] = number.to_le_bytes();
        for shape in self.shapes.iter().skip(1) {
            if let Some(index) = sent.get_mut(shape.at + 1) {
                *index = others;
            }
        }
    }

    /// Turns datagrams that carry outputs into such that do not, or back.
    #[cold]
    pub(crate) fn withhold(&mut self, withheld: bool) {
        for shape in &self.shapes {
            self.bytes[shape.at] = shape.head(0, withheld).to_le_bytes()[0];
        }
        if let Some(beginning) = self.bytes.first_chunk() {
            self.beginning = *beginning;
        }
    }

    /// Keeps the frame as it was sent, for the copies that follow, and what of them is otherwise.
    #[cold]
    pub(super) fn keep(&mut self, sent: &[u8], second_copy: Option<SecondCopy>) {
        self.bytes.copy_from_slice(sent);
        self.second_copy = second_copy;
    }

    /// What is otherwise in copies of the second card.
    #[inline]
    pub(super) const fn second_copy(&self) -> Option<&SecondCopy> {
        self.second_copy.as_ref()
    }

    /// Data as this card has sent them.
    pub(super) fn sent_by(&self, card: Path, data: Range<usize>) -> Option<&[u8]> {
        let is_other = |it: &&SecondCopy| card == Path::B && it.data_at == data.start;
        let other = self.second_copy.as_ref().filter(is_other);
        other.map(SecondCopy::time).or_else(|| self.bytes.get(data))
    }

    /// Whether copies of it are to follow.
    #[inline]
    pub(crate) const fn is_copied(&self) -> bool {
        self.copies.unsent > 0
    }

    #[inline]
    pub(super) const fn copies(&self) -> &Copies {
        &self.copies
    }

    #[inline]
    pub(super) const fn awaited(&self) -> u32 {
        self.awaited
    }

    /// Whether a frame with the datagrams that were sent is as it left the card: nobody had a hand in it.
    pub(super) fn is_echo(&self, frame: &[u8]) -> bool {
        self.fixed.iter().all(|range| frame.get(range.clone()) == self.bytes.get(range.clone()))
    }

    /// How many counted in the broadcast read of a copy that has the datagrams which were sent; 0 where it has none.
    pub(super) fn counted(&self, copy: &[u8]) -> u16 {
        let counter = self.presence_at.and_then(|at| copy.get(at..)?.first_chunk());
        counter.map_or(0, |bytes| u16::from_le_bytes(*bytes))
    }

    /// True if it has a broadcast read that counts who is there.
    pub(super) const fn has_presence(&self) -> bool {
        self.presence_at.is_some()
    }

    #[inline]
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The same as [`Prebuilt::matches`] telling that it is as sent, quicker for one datagram. That the
    /// first index byte names the slot of this number is known.
    #[inline]
    pub(crate) fn is_like(&self, reply: &[u8], number: u32, withheld: bool) -> bool {
        let head = reply.get(FIRST_HEADER..FIRST_HEAD_END).and_then(|rest| rest.first_chunk());
        head.is_some_and(|head| self.first.is_like(u64::from_le_bytes(*head), withheld))
            && reply.len() >= self.len
            && (self.shapes.len() == 1 || self.matches(reply, number, withheld) == Shaped::AsSent)
    }

    /// Whether a reply has the datagrams that were sent with this number.
    pub(super) fn matches(&self, reply: &[u8], number: u32, withheld: bool) -> Shaped {
        let [first, others, ..] = number.to_le_bytes();
        let mut index = first;
        let variant = usize::from(withheld);
        for shape in &self.shapes {
            let Some(head) = reply.get(shape.at..).and_then(|rest| rest.first_chunk()) else {
                return Shaped::CutOff;
            };
            let expected = shape.head(index, withheld);
            if (u64::from_le_bytes(*head) ^ expected) & shape.masks[variant] != 0 {
                return Shaped::Otherwise;
            }
            index = others;
        }
        if reply.len() < self.len { Shaped::CutOff } else { Shaped::AsSent }
    }
}

/// How a frame compares with one that was sent.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Shaped {
    /// The same datagrams.
    AsSent,
    /// Its beginning is the same, but its end is missing.
    CutOff,
    /// Other datagrams, or other marks.
    Otherwise,
}

/// Ranges in order, each one joined with those that it touches or overlaps.
fn joined(ranges: impl Iterator<Item = Range<usize>>) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = ranges.filter(|range| !range.is_empty()).collect();
    ranges.sort_by_key(|range| range.start);
    let mut joined: Vec<Range<usize>> = Vec::new();
    for range in ranges {
        match joined.last_mut() {
            Some(last) if range.start <= last.end => last.end = last.end.max(range.end),
            Some(_) | None => joined.push(range),
        }
    }
    joined
}

/// What of `all` is in none of `taken`, which are in order and apart.
fn gaps(all: Range<usize>, taken: Vec<Range<usize>>) -> Vec<Range<usize>> {
    let mut at = all.start;
    let mut gaps = Vec::new();
    for range in taken.into_iter().chain(std::iter::once(all.end..all.end)) {
        if range.start > at {
            gaps.push(at..range.start.min(all.end));
        }
        at = at.max(range.end);
    }
    gaps
}

/// A gap between long outputs as pieces: its zeros, as far as they are many, and the bytes before them.
/// What is read lies behind the outputs, and a working counter behind that.
fn pieces(bytes: &[u8], gap: Range<usize>) -> impl Iterator<Item = FramePiece> {
    let same = bytes.get(gap.clone()).unwrap_or_default();
    let zeros = same.iter().rev().take_while(|byte| **byte == 0).count();
    let split = if zeros >= LONG { gap.end - zeros } else { gap.end };
    let (before, behind) = (gap.start..split, split..gap.end);
    let before = (!before.is_empty()).then_some(FramePiece::Bytes(before));
    before.into_iter().chain((!behind.is_empty()).then_some(FramePiece::Zeros(behind)))
}

/// Where the data of each datagram of a plan's frame begin, in order.
pub(crate) fn data_offsets(plan: &FramePlan) -> impl Iterator<Item = usize> {
    plan.datagrams.iter().scan(FIRST_HEADER, |at, datagram| {
        let data = *at + DATAGRAM_HEADER_LEN;
        *at += datagram.len + linesman_proto::frame::DATAGRAM_OVERHEAD;
        Some(data)
    })
}
