//! Weights of the causes of damage on one link, a row for each thing that can be seen of it.
//!
//! References: HW-26, HW-27 and the table of `facts/esc.md` 3.4. The numbers are judgement, not
//! measurement; the weights of a row add up to less than 1, since there are other causes in the world.

use linesman_config::fault::FaultName;
use linesman_config::fault::FaultName::{
    CableDegraded, DeviceInternal, EmcNoise, HostDrops, NicDamaged, ReceiverDamaged,
    TransmitterDamaged,
};

use CauseSeat::{Host, Input, Link, Output, Sender};

/// Where a cause of a row sits, seen from the hop on which frames are damaged.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum CauseSeat {
    /// The link.
    Link,
    /// The output stage of what sends into the link: of the card it is a part of the host.
    Output,
    /// The input stage of what the link leads to: of the card it is a part of the host.
    Input,
    /// The controller that sends into the link; nowhere, if that is the card.
    Sender,
    /// The computer with its card.
    Host,
}

/// A cause, where it sits, and how sure it is, 0 to 1.
pub(super) type Weight = (FaultName, CauseSeat, f64);

/// What is seen of one link, or of the last hop.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum LinkSymptom {
    /// Frames are lost at the last hop, and the counters of the card were not read.
    LastHopUnread,
    /// Frames are damaged at the last hop alone, as the card counts.
    LastHopDamaged,
    /// Bad frames with clean symbols, and the sender is the card.
    CleanFromCard,
    /// Symbols in both directions.
    BothDirections,
    /// Symbols in one direction of a cable to a card: one of its ends no controller knows.
    OneDirectionAtCard,
    /// Many symbols in one direction, again and again, while the other direction could tell of some.
    OneDirectionSteady,
    /// Many symbols in one direction.
    OneDirectionMany,
    /// A few symbols in one direction.
    OneDirectionFew,
}

/// Share of the weight of noise on the terminal bus: a few millimetres within a row of housings, with no cable to couple into.
pub(super) const NOISE_ON_TERMINAL_BUS: f64 = 0.25;

impl LinkSymptom {
    /// The causes of the row.
    pub(super) const fn weights(self) -> &'static [Weight] {
        match self {
            Self::LastHopUnread => &[
                (CableDegraded, Link, 0.25),
                (NicDamaged, Host, 0.2),
                (HostDrops, Host, 0.2),
                (TransmitterDamaged, Link, 0.1),
                (DeviceInternal, Sender, 0.1),
                (EmcNoise, Link, 0.1),
            ],
            Self::LastHopDamaged => &[
                (CableDegraded, Link, 0.35),
                (NicDamaged, Host, 0.2),
                (TransmitterDamaged, Link, 0.15),
                (DeviceInternal, Sender, 0.15),
                (EmcNoise, Link, 0.1),
            ],
            Self::CleanFromCard => &[
                (NicDamaged, Host, 0.75),
                (CableDegraded, Link, 0.1),
                (ReceiverDamaged, Link, 0.05),
            ],
            Self::BothDirections => &[
                (CableDegraded, Link, 0.6),
                (EmcNoise, Link, 0.25),
                (TransmitterDamaged, Output, 0.05),
                (ReceiverDamaged, Input, 0.05),
            ],
            Self::OneDirectionAtCard => &[
                (CableDegraded, Link, 0.4),
                (TransmitterDamaged, Output, 0.25),
                (EmcNoise, Link, 0.15),
                (ReceiverDamaged, Input, 0.1),
            ],
            Self::OneDirectionSteady => &[
                (TransmitterDamaged, Output, 0.35),
                (ReceiverDamaged, Input, 0.25),
                (CableDegraded, Link, 0.2),
                (EmcNoise, Link, 0.1),
            ],
            Self::OneDirectionMany => &[
                (CableDegraded, Link, 0.35),
                (EmcNoise, Link, 0.25),
                (TransmitterDamaged, Output, 0.2),
                (ReceiverDamaged, Input, 0.1),
            ],
            Self::OneDirectionFew => &[
                (CableDegraded, Link, 0.45),
                (EmcNoise, Link, 0.2),
                (TransmitterDamaged, Output, 0.15),
                (ReceiverDamaged, Input, 0.1),
            ],
        }
    }

    /// Whether the row names all causes: what else is known of the link, such as ports that nobody read, adds none.
    pub(super) const fn is_complete(self) -> bool {
        match self {
            Self::LastHopUnread | Self::LastHopDamaged | Self::CleanFromCard => true,
            Self::BothDirections
            | Self::OneDirectionAtCard
            | Self::OneDirectionSteady
            | Self::OneDirectionMany
            | Self::OneDirectionFew => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_of_each_row_add_up_to_less_than_one() {
        for row in [
            LinkSymptom::LastHopUnread,
            LinkSymptom::LastHopDamaged,
            LinkSymptom::CleanFromCard,
            LinkSymptom::BothDirections,
            LinkSymptom::OneDirectionAtCard,
            LinkSymptom::OneDirectionSteady,
            LinkSymptom::OneDirectionMany,
            LinkSymptom::OneDirectionFew,
        ] {
            let sum: f64 = row.weights().iter().map(|(_, _, weight)| weight).sum();
            assert!(sum > 0.5 && sum < 1.0, "{row:?}: {sum}");
        }
    }
}
