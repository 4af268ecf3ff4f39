//! Frames of one SubDevice, put together from their fragments.

use std::collections::BTreeMap;

use linesman_proto::mailbox::eoe::{Assembly, FragmentPlace, Message};

/// What came from a SubDevice.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct FragmentCounts {
    /// Fragments of frames.
    pub fragments: u64,
    /// Frames that came whole.
    pub frames: u64,
    /// Frames of which a fragment is missing, came twice, out of its order, or not in its place; and frames of which none
    /// came, by their numbers.
    pub lost: u64,
}

/// Frames in a row that are numbered one after the other before a number that is left out counts as a frame lost:
/// not every SubDevice numbers its frames.
const NUMBERED: u8 = 4;
/// Numbers of frames, from 0 on.
const NUMBERS: u8 = 16;
/// The most frames that are taken to be missing between two; more look like a SubDevice that begins anew.
const MOST_MISSING: u8 = NUMBERS / 2;

/// A SubDevice as the switch sees it: fragments of its Ethernet ports, and the numbers of frames to it.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct SubDevicePort {
    /// By the port of the SubDevice, of which there are 16.
    assemblies: BTreeMap<u8, Assembly>,
    /// The frame that was lost last, by port and number: the rest of its fragments is no further loss.
    lost: Option<(u8, u8)>,
    counts: FragmentCounts,
    /// Port and number of the latest frame of which something came.
    latest: Option<(u8, u8)>,
    /// Frames in a row that had the number behind the one before, up to [`NUMBERED`].
    in_row: u8,
    next_number: u8,
}

impl SubDevicePort {
    /// Takes what follows the mailbox header of an EoE message that came unasked; gives the frame when that was its last
    /// fragment. Time stamps and late answers are of no interest.
    pub fn handle_message(&mut self, data: &[u8]) -> Option<Vec<u8>> {
        let Ok(Message::Fragment(fragment)) = Message::parse(data) else { return None };
        self.counts.fragments += 1;
        self.note_number(fragment.port, fragment.frame & (NUMBERS - 1));
        let is_first = matches!(fragment.place, FragmentPlace::First { .. });
        let assembly = self.assemblies.entry(fragment.port).or_default();
        if is_first {
            self.counts.lost += u64::from(assembly.is_begun());
            self.lost = None;
        }
        match assembly.take(&fragment) {
            Ok(frame) => {
                self.counts.frames += u64::from(frame.is_some());
                frame
            }
            Err(_) => {
                let broken = (fragment.port, fragment.frame);
                if self.lost.replace(broken) != Some(broken) {
                    self.counts.lost += 1;
                }
                None
            }
        }
    }

    /// Counts frames of which no fragment came. One whose number is 0 may be the first of a SubDevice that begins anew.
    fn note_number(&mut self, port: u8, number: u8) {
        let Some((former_port, former)) = self.latest.replace((port, number)) else { return };
        if (former_port, former) == (port, number) {
            return;
        }
        let missing = number.wrapping_sub(former + 1) & (NUMBERS - 1);
        if former_port != port || missing > MOST_MISSING {
            self.in_row = 0;
        } else if missing == 0 {
            self.in_row = (self.in_row + 1).min(NUMBERED);
        } else if number != 0 && self.in_row == NUMBERED {
            self.counts.lost += u64::from(missing);
        } else {
            self.in_row = 0;
        }
    }

    /// The number of the next frame to it, 0 to 15.
    pub fn next_number(&mut self) -> u8 {
        let number = self.next_number;
        self.next_number = (number + 1) & 0x0F;
        number
    }

    /// What came so far.
    #[must_use]
    pub const fn counts(&self) -> FragmentCounts {
        self.counts
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::mailbox::eoe::fragments;

    use super::*;

    fn messages(frame: &[u8], number: u8) -> Vec<Vec<u8>> {
        let write = |fragment| {
            let mut bytes = vec![0; 256];
            let len = Message::Fragment(fragment).write(&mut bytes).unwrap();
            bytes.truncate(len);
            bytes
        };
        fragments(frame, 0, number, 132).map(write).collect()
    }

    #[test]
    fn frames_come_whole_or_are_counted_as_lost_once() {
        let frame = vec![7; 500];
        let mut port = SubDevicePort::default();
        let take = |port: &mut SubDevicePort, pieces: &[Vec<u8>]| -> usize {
            pieces.iter().filter(|piece| port.handle_message(piece) == Some(frame.clone())).count()
        };
        let whole = messages(&frame, 3);
        assert_eq!(whole.len(), 4);
        assert_eq!(take(&mut port, &whole), 1);
        let counts = |frames, lost, fragments| FragmentCounts { fragments, frames, lost };
        assert_eq!(port.counts(), counts(1, 0, 4));
        // The second fragment is lost: one frame, though two fragments of it are refused.
        let pieces = messages(&frame, 4);
        assert_eq!(take(&mut port, &[pieces[0].clone(), pieces[2].clone(), pieces[3].clone()]), 0);
        assert_eq!(port.counts(), counts(1, 1, 7));
        // The last one is lost: seen when the next frame begins.
        assert_eq!(take(&mut port, &messages(&frame, 5)[..3]), 0);
        assert_eq!(take(&mut port, &messages(&frame, 6)), 1);
        assert_eq!(port.counts(), counts(2, 2, 14));
        // One comes twice, and two change places.
        let pieces = messages(&frame, 7);
        let twice = [&pieces[..2], &pieces[1..]].concat();
        assert_eq!(take(&mut port, &twice), 0);
        let mut swapped = messages(&frame, 8);
        swapped.swap(1, 2);
        assert_eq!(take(&mut port, &swapped), 0);
        assert_eq!((port.counts().frames, port.counts().lost), (2, 4));
        assert_eq!(take(&mut port, &messages(&frame, 9)), 1);
    }

    #[test]
    fn frames_of_which_nothing_came_are_counted_by_their_numbers() {
        let lost = |numbers: &[u8]| {
            let mut port = SubDevicePort::default();
            for number in numbers {
                port.handle_message(&messages(&[7; 60], *number)[0]);
            }
            port.counts().lost
        };
        assert_eq!(lost(&[3, 4, 5, 6, 7, 8]), 0);
        assert_eq!(lost(&[13, 14, 15, 0, 1, 3, 4, 7]), 3);
        assert_eq!(lost(&[12, 13, 14, 15, 0, 2, 3, 2, 3]), 1, "no frame is lost backwards");
        assert_eq!(lost(&[5; 20]), 0, "it numbers none");
        assert_eq!(lost(&[1, 5, 2, 9, 3, 11, 7, 8, 10, 12]), 0, "nor does this one");
        assert_eq!(lost(&[3, 4, 5, 6, 7, 8, 0, 1]), 0, "it may have begun anew");
    }

    #[test]
    fn whatever_comes_is_borne() {
        let mut port = SubDevicePort::default();
        let mut bytes = vec![0_u8; 300];
        for seed in 0..20_000_u32 {
            for (at, byte) in bytes.iter_mut().enumerate().take(4) {
                *byte = (seed.wrapping_mul(2_654_435_761) >> (at * 8)) as u8;
            }
            let len = seed as usize % bytes.len();
            if let Some(frame) = port.handle_message(&bytes[..len]) {
                assert!(frame.len() <= 1_518);
            }
        }
        let numbers: Vec<u8> = (0..17).map(|_| port.next_number()).collect();
        assert_eq!((numbers[0], numbers[15], numbers[16]), (0, 15, 0));
    }
}
