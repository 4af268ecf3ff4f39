//! Admitted sets: causes that no evidence can tell apart, each with the reason.
//!
//! This is the one place where it is said what an honest diagnosis may confuse. A set holds at most
//! four names. Which set applies to a fault, and at which places, says [`super::admit`]; it follows
//! from physics, never from what the diagnosis likes to say.

use linesman_config::fault::FaultName::{self, *};

/// Causes that look the same, while a condition holds.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct AdmittedSet {
    /// What it is called in tables and tests.
    pub name: &'static str,
    /// The causes, at most four.
    pub causes: &'static [FaultName],
    /// While what holds they are the same.
    pub while_so: &'static str,
    /// Why nobody can tell them apart.
    pub why: &'static str,
    /// What would tell them apart.
    pub told_apart_by: &'static str,
}

impl AdmittedSet {
    /// Whether a cause belongs to it.
    #[must_use]
    pub fn has(&self, cause: FaultName) -> bool {
        self.causes.contains(&cause)
    }
}

/// Silence behind a place.
pub static SILENT: AdmittedSet = AdmittedSet {
    name: "silent",
    causes: &[LinkOpen, DeviceOff, SupplyOff, LinkFlapping],
    while_so: "what fell silent has not answered again, and the link was lost once",
    why: "whoever hangs behind a cut and whoever has no power are equally silent, and the \
          neighbour's port sees no signal in both cases",
    told_apart_by: "the lamps of the device behind; when it answers again, whether it kept its state",
};

/// A dip that lasts.
pub static DIP_LASTS: AdmittedSet = AdmittedSet {
    name: "dip-lasts",
    causes: &[BrownOut, DeviceOff, SupplyOff, LinkOpen],
    while_so: "the supply has not come back",
    why: "a dip is over by its nature: while it lasts it is a failure, and looks like a cut",
    told_apart_by: "its end",
};

/// One opening.
pub static ONE_OPENING: AdmittedSet = AdmittedSet {
    name: "one-opening",
    causes: &[LinkOpen, LinkFlapping],
    while_so: "the link was lost once, and is back",
    why: "an opening that is over may have been the first of many",
    told_apart_by: "the next opening",
};

/// A cut in a ring.
pub static RING_CUT: AdmittedSet = AdmittedSet {
    name: "ring-cut",
    causes: &[RingOpen, LinkOpen, LinkFlapping],
    while_so: "a link of a ring was lost once, and both its ends answer",
    why: "a ring that is open at one place is a link that is open at one place",
    told_apart_by: "nothing: they are one thing by two names; flapping by the next opening",
};

/// One pair of wires.
pub static ONE_PAIR: AdmittedSet = AdmittedSet {
    name: "one-pair",
    causes: &[LinkOpen, FalseLink],
    while_so: "one direction is interrupted, and the sender keeps its link",
    why: "a port that has a link sends where nothing arrives, whatever is between",
    told_apart_by: "the medium: what is between the two ports",
};

/// A restart of one device, or of what one device feeds.
pub static RESTART: AdmittedSet = AdmittedSet {
    name: "restart",
    causes: &[BrownOut, DeviceOff, SupplyOff, EbusOverload],
    while_so: "the device has answered again, and one supply feeds all that fell",
    why: "a dip of a supply and a short time without power are the same to a device, and a device \
          of a supply of its own is a supply of one device",
    told_apart_by: "measuring the supply; an overload comes back with its load",
};

/// A restart of several devices.
pub static SHARED_RESTART: AdmittedSet = AdmittedSet {
    name: "shared-restart",
    causes: &[BrownOut, SupplyOff],
    while_so: "several devices that do not feed each other fell together and have answered again",
    why: "a short failure of a supply is a dip of it",
    told_apart_by: "measuring the supply",
};

/// An overloaded E-bus.
pub static OVERLOAD: AdmittedSet = AdmittedSet {
    name: "overload",
    causes: &[EbusOverload, BrownOut, SupplyOff, DeviceOff],
    while_so: "terminals of one coupler fell",
    why: "terminals that lose their E-bus voltage start anew, whatever took it",
    told_apart_by: "the sum of the currents; measuring the E-bus voltage",
};

/// Symbol errors on one direction of a link.
pub static SYMBOLS: AdmittedSet = AdmittedSet {
    name: "symbols",
    causes: &[CableDegraded, EmcNoise, TransmitterDamaged, ReceiverDamaged],
    while_so: "one direction of one link is hit",
    why: "a receiver sees symbol errors; whether the sender, the cable, the plug, its own input or \
          interference made them is not in the symbols: their rhythm is a hint only",
    told_apart_by: "exchanging cable and devices one by one",
};

/// Symbol errors on more than one direction.
pub static BOTH_WAYS: AdmittedSet = AdmittedSet {
    name: "both-ways",
    causes: &[CableDegraded, EmcNoise],
    while_so: "both directions of a link are hit",
    why: "a worn cable and interference hit both directions of a link alike",
    told_apart_by: "exchanging the cable; what is switched at the moments of the errors",
};

/// The way out of the card.
pub static FIRST_HOP: AdmittedSet = AdmittedSet {
    name: "first-hop",
    causes: &[NicDamaged, CableDegraded, EmcNoise, ReceiverDamaged],
    while_so: "the way from the card to the first SubDevice is hit",
    why: "the way begins in the card: its output stage is a transmitter like any other",
    told_apart_by: "another card, another cable",
};

/// The card's output stage.
pub static CARD_OUTPUT: AdmittedSet = AdmittedSet {
    name: "card-output",
    causes: &[TransmitterDamaged, NicDamaged, CableDegraded, EmcNoise],
    while_so: "the output stage of the card is damaged",
    why: "the transmitter of this hop is a part of the card",
    told_apart_by: "another card, another cable",
};

/// The way into the card.
pub static LAST_HOP: AdmittedSet = AdmittedSet {
    name: "last-hop",
    causes: &[NicDamaged, CableDegraded, EmcNoise, TransmitterDamaged],
    while_so: "the way from the first SubDevice to the card is hit, and the card counts it",
    why: "the last hop is checked by the card only, which counts bad frames and no symbols",
    told_apart_by: "another card, another cable",
};

/// The card's input stage.
pub static CARD_INPUT: AdmittedSet = AdmittedSet {
    name: "card-input",
    causes: &[ReceiverDamaged, NicDamaged, CableDegraded, EmcNoise],
    while_so: "the input stage of the card is damaged",
    why: "the receiver of this hop is a part of the card",
    told_apart_by: "another card, another cable",
};

/// A first device that spoils what it sends to the card.
pub static LAST_HOP_CLEAN: AdmittedSet = AdmittedSet {
    name: "last-hop-clean",
    causes: &[DeviceInternal, CableDegraded, NicDamaged, TransmitterDamaged],
    while_so: "the first SubDevice spoils frames, and only on the way to the card",
    why: "on the last hop a card counts bad frames but no symbols",
    told_apart_by: "exchanging the first SubDevice",
};

/// The last hop, uncounted.
pub static UNCOUNTED: AdmittedSet = AdmittedSet {
    name: "uncounted",
    causes: &[CableDegraded, EmcNoise, NicDamaged, HostDrops],
    while_so: "frames get lost on the last hop, and the card's counters are not known",
    why: "frames that the card or the computer drops just do not come back, and no SubDevice counts",
    told_apart_by: "the counters of the card",
};

/// The same, with a transmitter.
pub static UNCOUNTED_OUTPUT: AdmittedSet = AdmittedSet {
    name: "uncounted-output",
    causes: &[TransmitterDamaged, CableDegraded, NicDamaged, HostDrops],
    ..UNCOUNTED
};

/// The same, with the inside of the first device.
pub static UNCOUNTED_INSIDE: AdmittedSet = AdmittedSet {
    name: "uncounted-inside",
    causes: &[DeviceInternal, CableDegraded, NicDamaged, HostDrops],
    ..UNCOUNTED
};

/// Bad frames, and nobody knows whether in clean symbols.
pub static BLIND: AdmittedSet = AdmittedSet {
    name: "blind",
    causes: &[DeviceInternal, CableDegraded, EmcNoise, TransmitterDamaged],
    while_so: "the receiver's symbol counter stands at its end",
    why: "nobody knows whether the symbols were clean",
    told_apart_by: "clearing the counters, and waiting for the next bad frame",
};

/// Bad frames with symbol errors made anew.
pub static REMADE: AdmittedSet = AdmittedSet {
    name: "remade",
    while_so: "the sender is built in programmable logic",
    why: "such a sender makes a symbol error anew for each bad frame, as if the frame had been hit \
          on the wire",
    told_apart_by: "exchanging the sender",
    ..BLIND
};

/// A refusal for what was configured.
pub static REFUSAL: AdmittedSet = AdmittedSet {
    name: "refusal",
    causes: &[InitRefused, ConfigMismatch],
    while_so: "the AL status code blames settings",
    why: "whether the settings are wrong or the device is, its code does not say",
    told_apart_by: "comparing the settings with the device's own, object by object",
};

/// A refusal for the watchdog.
pub static WATCHDOG_CODE: AdmittedSet = AdmittedSet {
    name: "watchdog-code",
    causes: &[InitRefused, WatchdogStarved],
    while_so: "the AL status code is that of an expired watchdog",
    why: "the status code that the device gives says so itself",
    told_apart_by: "watching when its outputs come",
};

/// A device that does not keep up.
pub static OVERRUN: AdmittedSet = AdmittedSet {
    name: "overrun",
    causes: &[FirmwareFault, CycleTooFast],
    while_so: "nobody has read 0x1C32 of the device",
    why: "software that fails and software that has too little time leave their state alike",
    told_apart_by: "the counter of exceeded cycles, 0x1C32:12",
};

/// Frames that leave late.
pub static LATE: AdmittedSet = AdmittedSet {
    name: "late",
    causes: &[HostJitter, LateFrames],
    while_so: "frames leave the card late",
    why: "whether the computer was late or the card, the frame left late",
    told_apart_by: "the computer's own note of when it handed the frame over",
};

/// All of them.
pub static ALL: &[&AdmittedSet] = &[
    &SILENT,
    &DIP_LASTS,
    &ONE_OPENING,
    &RING_CUT,
    &ONE_PAIR,
    &RESTART,
    &SHARED_RESTART,
    &OVERLOAD,
    &SYMBOLS,
    &BOTH_WAYS,
    &FIRST_HOP,
    &CARD_OUTPUT,
    &LAST_HOP,
    &CARD_INPUT,
    &LAST_HOP_CLEAN,
    &UNCOUNTED,
    &UNCOUNTED_OUTPUT,
    &UNCOUNTED_INSIDE,
    &BLIND,
    &REMADE,
    &REFUSAL,
    &WATCHDOG_CODE,
    &OVERRUN,
    &LATE,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_two_to_four_names_and_says_why() {
        for set in ALL {
            assert!((2..=4).contains(&set.causes.len()), "{}", set.name);
            assert!(!set.why.is_empty() && !set.told_apart_by.is_empty(), "{}", set.name);
            let same = ALL.iter().filter(|other| other.name == set.name).count();
            assert_eq!(same, 1, "{} twice", set.name);
        }
    }
}
