//! Cyclic frames, built once: headers stay, outputs and index bytes change.
//!
//! A reply is compared with what was sent eight bytes at a time: the first eight bytes of a datagram
//! header are command, index, address and length, which is all that tells one datagram from another
//! (ETG.1000.4, 5.4.1.2). Working counters are where they were sent, so nothing is parsed.

use linesman_config::plan::{DatagramPlan, FramePlan};
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{HEADER_LEN, MAX_LEN, MacAddress};
use linesman_proto::frame::{DATAGRAM_HEADER_LEN, ETHERCAT_HEADER_LEN, FrameBuilder};

/// Bits of the first eight header bytes that come back as they were sent: all but the round-trip
/// bit, which a controller may set.
const SAME: u64 = !(0x4000_u64 << 48);
/// The ADP field: controllers count it up in position and broadcast commands.
const ADP: u64 = 0xFFFF_u64 << 16;

/// Where the first datagram begins, and its index byte.
const FIRST_HEADER: usize = HEADER_LEN + ETHERCAT_HEADER_LEN;
pub(super) const FIRST_INDEX: usize = FIRST_HEADER + 1;

/// One datagram of a prebuilt frame.
#[derive(Clone, Copy, Debug)]
struct Shape {
    /// Offset of its header.
    at: usize,
    /// The first eight bytes of its header with index 0: as planned, and with its outputs withheld.
    heads: [u64; 2],
    /// Which of their bits must come back the same, by the same two.
    masks: [u64; 2],
}

/// A cyclic frame as card A sends it.
#[derive(Debug)]
pub(crate) struct Prebuilt {
    bytes: Vec<u8>,
    shapes: Vec<Shape>,
    /// Bytes that a whole reply has at least.
    len: usize,
    withheld: bool,
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
    pub(crate) fn new(plan: &FramePlan, source: MacAddress) -> Self {
        let mut bytes = vec![0; MAX_LEN];
        let mut builder = FrameBuilder::new(&mut bytes, source);
        let mut at = FIRST_HEADER;
        let mut places = Vec::new();
        for datagram in &plan.datagrams {
            let DatagramPlan { command, address, len, .. } = datagram;
            if builder.push(*command, 0, *address, *len).is_ok() {
                places.push((at, *command));
                at += len + linesman_proto::frame::DATAGRAM_OVERHEAD;
            }
        }
        let len = builder.finish();
        bytes.truncate(len);
        let shape = |(header, command): (usize, Command)| {
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
            Shape { at: header, heads: commands.map(variant), masks: commands.map(mask) }
        };
        let shapes = places.into_iter().map(shape).collect();
        Self { shapes, bytes, len: at, withheld: false }
    }

    /// The frame, for filling in outputs.
    #[inline]
    pub(crate) fn bytes_mut(&mut self) -> &mut [u8] {
        &mut self.bytes
    }

    #[inline]
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// Turns datagrams that carry outputs into such that do not, or back.
    #[inline]
    pub(crate) fn withhold(&mut self, withheld: bool) {
        if self.withheld == withheld {
            return;
        }
        self.withheld = withheld;
        for shape in &self.shapes {
            self.bytes[shape.at] = shape.heads[usize::from(withheld)].to_le_bytes()[0];
        }
    }

    /// Marks the datagrams with the number of the frame.
    #[inline]
    pub(super) fn number(&mut self, number: u32) {
        let [first, others, ..] = number.to_le_bytes();
        if let Some(index) = self.bytes.get_mut(FIRST_INDEX) {
            *index = first;
        }
        for shape in self.shapes.iter().skip(1) {
            self.bytes[shape.at + 1] = others;
        }
    }

    /// The same as [`Prebuilt::matches`] telling that it is as sent, quicker for one datagram.
    #[inline]
    pub(super) fn is_like(&self, reply: &[u8], number: u32, withheld: bool) -> bool {
        let head = reply.get(FIRST_HEADER..).and_then(|rest| rest.first_chunk());
        let (Some(head), [shape, others @ ..]) = (head, self.shapes.as_slice()) else {
            return false;
        };
        let variant = usize::from(withheld);
        let [index, ..] = number.to_le_bytes();
        let expected = shape.heads[variant] | u64::from(index) << 8;
        (u64::from_le_bytes(*head) ^ expected) & shape.masks[variant] == 0
            && reply.len() >= self.len
            && (others.is_empty() || self.matches(reply, number, withheld) == Shaped::AsSent)
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
            let expected = shape.heads[variant] | u64::from(index) << 8;
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

/// Where the data of each datagram of a plan's frame begin, in order.
pub(crate) fn data_offsets(plan: &FramePlan) -> impl Iterator<Item = usize> {
    plan.datagrams.iter().scan(FIRST_HEADER, |at, datagram| {
        let data = *at + DATAGRAM_HEADER_LEN;
        *at += datagram.len + linesman_proto::frame::DATAGRAM_OVERHEAD;
        Some(data)
    })
}
