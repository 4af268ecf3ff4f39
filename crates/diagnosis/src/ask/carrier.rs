//! Forms in which a question travels, and the MainDevices beside which one may be sent at all.
//!
//! Controllers process datagrams in frames of EtherType 0x88A4 and in UDP alike (S1 chapter 2.1). MainDevices on Linux open
//! a packet socket for EtherType 0x88A4, so that the kernel never shows them a frame in UDP, whatever is in it. Only
//! where a controller of the line does not process UDP a plain frame comes into question, and only beside a MainDevice that
//! throws away frames whose index it does not use, at no cost. How each of them filters stands in `docs/guide/ask.md`, with
//! the places in their sources.

use core::fmt;

use crate::main_device::{Certainty, MainDeviceKind, Mark, Recognised};

/// The form of a question.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Carrier {
    /// In UDP over IPv4.
    Udp,
    /// EtherType 0x88A4, with datagram indexes from this one on.
    Plain {
        /// The lowest index.
        first_index: u8,
    },
}

impl Carrier {
    /// The index of question number `number`: each is another one than that before it.
    #[must_use]
    pub fn index(self, number: u64) -> u8 {
        let first = match self {
            Self::Udp => 0,
            Self::Plain { first_index } => first_index,
        };
        let count = u64::from(u8::MAX - first) + 1;
        first + (number % count) as u8
    }

    /// What people call it.
    #[must_use]
    pub const fn words(self) -> &'static str {
        match self {
            Self::Udp => "in UDP",
            Self::Plain { .. } => "as plain frames",
        }
    }
}

/// Buffers of SOEM for received frames, `EC_MAXBUF`: an index from there on is thrown away (`nicdrv.c`, `ecx_inframe`).
const SOEM_BUFFERS: u8 = 16;

/// The carrier for a line on which not all controllers process UDP: a plain frame with an index that the MainDevice,
/// whose highest one is given, never uses. `None` where it would take such a frame for one of its own, or lose one.
#[must_use]
pub const fn plain(kind: MainDeviceKind, highest_index: u8) -> Option<Carrier> {
    match kind {
        MainDeviceKind::Soem if highest_index < SOEM_BUFFERS => {
            Some(Carrier::Plain { first_index: 0x80 })
        }
        MainDeviceKind::Soem
        | MainDeviceKind::Igh
        | MainDeviceKind::Ethercrab
        | MainDeviceKind::Kickcat
        | MainDeviceKind::Twincat
        | MainDeviceKind::Linesman
        | MainDeviceKind::Unknown => None,
    }
}

/// Why no question is sent beside this MainDevice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum AskRefusal {
    /// Its frames come in by the card: it sends them from another computer.
    Elsewhere,
    /// It drives a ring: two cards, of which this is one.
    Ring,
    /// It was not recognised, or by a weak mark alone.
    Unrecognised,
    /// This kind is not to be asked beside.
    Kind(MainDeviceKind),
}

impl AskRefusal {
    /// Why a MainDevice of this kind is not asked beside, unless the user insists; `None`: it may be.
    #[must_use]
    pub fn of(recognised: Option<&Recognised>) -> Option<Self> {
        let Some(recognised) = recognised else { return Some(Self::Unrecognised) };
        let has_source = recognised.marks.iter().any(|mark| matches!(mark, Mark::Source(_)));
        let is_known = match recognised.certainty {
            Certainty::Likely => true,
            Certainty::Perhaps => has_source,
            Certainty::None => false,
        };
        match recognised.kind {
            _ if !is_known => Some(Self::Unrecognised),
            MainDeviceKind::Soem | MainDeviceKind::Igh | MainDeviceKind::Kickcat => None,
            MainDeviceKind::Unknown => Some(Self::Unrecognised),
            kind @ (MainDeviceKind::Ethercrab
            | MainDeviceKind::Twincat
            | MainDeviceKind::Linesman) => Some(Self::Kind(kind)),
        }
    }

    /// Whether the user may insist.
    #[must_use]
    pub const fn may_be_forced(self) -> bool {
        match self {
            Self::Unrecognised | Self::Kind(_) => true,
            Self::Elsewhere | Self::Ring => false,
        }
    }

    /// What to do instead.
    #[must_use]
    pub const fn next_step(self) -> &'static str {
        match self {
            Self::Elsewhere => {
                "run it on the computer of the MainDevice, on the card by which that one sends; here listen without \
                 `--ask`"
            }
            Self::Ring => "listen without `--ask`: `linesman diagnose listen:CARD+CARD`",
            Self::Unrecognised => {
                "listen without `--ask`; who knows that its program does not mind frames which are not its own adds \
                 `--force`"
            }
            Self::Kind(MainDeviceKind::Linesman) => {
                "look at the verdict of that run: it reads the same registers itself"
            }
            Self::Kind(_) => {
                "listen without `--ask`, and have its program read the counters: the lines for it stand beneath the verdict; \
                 `--force` asks all the same"
            }
        }
    }
}

impl fmt::Display for AskRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Elsewhere => f.write_str(
                "the MainDevice does not send from this computer: its frames come in by this card, as at a tap",
            ),
            Self::Ring => f.write_str("the MainDevice drives a ring by two cards"),
            Self::Unrecognised => f.write_str(
                "the MainDevice was not recognised, so it is not known what it does with frames that are not its own",
            ),
            Self::Kind(MainDeviceKind::Ethercrab) => f.write_str(
                "ethercrab ends as soon as its socket gives it a frame that is not its own",
            ),
            Self::Kind(MainDeviceKind::Twincat) => {
                f.write_str("how TwinCAT takes frames that are not its own is not published")
            }
            Self::Kind(MainDeviceKind::Linesman) => {
                f.write_str("the MainDevice is Linesman, which reads all of this itself")
            }
            Self::Kind(kind) => write!(f, "the MainDevice is {}", kind.name()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn recognised(kind: MainDeviceKind, certainty: Certainty, marks: &[Mark]) -> Recognised {
        Recognised { kind, certainty, marks: marks.to_vec() }
    }

    #[test]
    fn weak_mark_alone_is_not_recognised() {
        let weak = [Mark::FirstStation(1)];
        let igh = recognised(MainDeviceKind::Igh, Certainty::Perhaps, &weak);
        assert_eq!(AskRefusal::of(Some(&igh)), Some(AskRefusal::Unrecognised));
        let igh = recognised(MainDeviceKind::Igh, Certainty::Likely, &weak);
        assert_eq!(AskRefusal::of(Some(&igh)), None);
        let source = [Mark::Source(linesman_proto::ethernet::MacAddress([1; 6]))];
        let soem = recognised(MainDeviceKind::Soem, Certainty::Perhaps, &source);
        assert_eq!(AskRefusal::of(Some(&soem)), None);
        assert_eq!(AskRefusal::of(None), Some(AskRefusal::Unrecognised));
    }

    #[test]
    fn kinds_that_mind_other_frames_are_refused_with_reason_and_step() {
        for kind in [MainDeviceKind::Ethercrab, MainDeviceKind::Twincat, MainDeviceKind::Linesman] {
            let found = recognised(kind, Certainty::Likely, &[]);
            let refusal = AskRefusal::of(Some(&found)).unwrap();
            assert_eq!(refusal, AskRefusal::Kind(kind));
            assert!(refusal.may_be_forced() && !refusal.next_step().is_empty());
            assert!(refusal.to_string().contains(kind.name()), "{refusal}");
        }
    }

    #[test]
    fn plain_questions_have_indexes_that_soem_never_uses() {
        let carrier = plain(MainDeviceKind::Soem, 15).unwrap();
        let indexes: Vec<u8> = (0..300).map(|number| carrier.index(number)).collect();
        assert!(indexes.iter().all(|index| *index >= 0x80), "{indexes:?}");
        assert!(indexes.windows(2).all(|two| two[0] != two[1]));
        assert_eq!(plain(MainDeviceKind::Soem, 16), None, "it was built with more buffers");
        assert_eq!(plain(MainDeviceKind::Kickcat, 3), None);
        assert_eq!((Carrier::Udp.index(255), Carrier::Udp.index(256)), (255, 0));
    }
}
