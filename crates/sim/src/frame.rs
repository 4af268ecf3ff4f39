//! A frame on its way through the segment: its bytes and what has happened to them.

use linesman_proto::ethernet::MIN_LEN;
use linesman_proto::frame::size::BYTE_NS;
use linesman_proto::time::Span;

/// Preamble and start delimiter in front of a frame, in bytes.
pub const PREAMBLE_LEN: usize = 8;
/// Frame check sequence behind a frame, in bytes.
pub const FCS_LEN: usize = 4;

/// A frame between two points of the segment.
///
/// The check sequence itself is not carried: [`Damage`] says whether it would be right.
#[derive(Clone, Debug, Default)]
pub struct WireFrame {
    /// The Ethernet frame without its check sequence, as it is at this point of the way.
    pub bytes: Vec<u8>,
    /// What has been done to it so far.
    pub damage: Damage,
    /// Running number over all frames that entered the segment, for latches that belong to "this
    /// frame" and for the truth log.
    pub number: u64,
}

impl WireFrame {
    /// Time from the first bit of the preamble to the last bit of the check sequence.
    #[must_use]
    #[inline]
    pub fn duration(&self) -> Span {
        let len = self.bytes.len().max(MIN_LEN) + PREAMBLE_LEN + FCS_LEN;
        Span::ns(len as u64 * BYTE_NS)
    }

    /// Offset in [`WireFrame::bytes`] of the byte that is on the wire `since_start` after the first
    /// bit of the preamble; `None` while the preamble is, the frame's length while the check
    /// sequence is.
    #[must_use]
    pub fn byte_at(&self, since_start: Span) -> Option<usize> {
        let byte = (since_start.as_nanos() / BYTE_NS) as usize;
        byte.checked_sub(PREAMBLE_LEN).map(|offset| offset.min(self.bytes.len()))
    }
}

/// What happened to a frame on its way.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Damage {
    /// The check sequence no longer fits: the next receiver sees a bad frame.
    ///
    /// From the first spoiled byte on, [`WireFrame::bytes`] already holds what was received.
    pub fcs_bad: bool,
    /// A controller found it bad and appended the odd nibble: later ones count it as forwarded.
    pub marked: bool,
    /// The frame was cut off: its bytes end early, without check sequence.
    pub cut_off: bool,
}

impl Damage {
    /// Whether a receiver would accept the frame.
    #[must_use]
    #[inline]
    pub const fn is_intact(self) -> bool {
        !self.fcs_bad && !self.marked && !self.cut_off
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_takes_its_time_on_the_wire() {
        let frame = WireFrame { bytes: vec![0; 60], ..WireFrame::default() };
        assert_eq!(frame.duration(), Span::ns(5_760), "64 bytes and preamble, without gap");
        assert_eq!(frame.byte_at(Span::ns(639)), None, "the preamble");
        assert_eq!(frame.byte_at(Span::ns(640)), Some(0));
        assert_eq!(frame.byte_at(Span::ns(720)), Some(1));
        assert_eq!(frame.byte_at(Span::ns(5_759)), Some(60), "the check sequence");
    }
}
