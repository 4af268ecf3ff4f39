//! Admitted sets: causes that no evidence can tell apart, each with the reason and a proof.
//!
//! This is the one place where it is said what an honest diagnosis may confuse. A set holds at most
//! four names. Which set applies to a fault, and at which places, says [`super::admit`]; it follows
//! from physics, never from what the diagnosis likes to say.
//!
//! A set cannot be written down without its proof: one and the same line is played with each of its
//! causes in turn, and every frame and every observation of the host must be the same, byte for byte and
//! nanosecond for nanosecond ([`super::proof`]).

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
    /// What shows that they are the same.
    pub proof: Proof,
}

/// A line that is played once with each cause: what the MainDevice and its computer see is the same.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Proof {
    /// What is shown of the plays.
    pub visibility: Visibility,
    /// How long after the begin of the line nothing tells the plays apart, in ms.
    pub until_ms: u64,
    /// The plays.
    pub plays: &'static [Play],
    /// What parts them.
    pub separated: Separation,
}

/// What a diagnosis is given to see.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Visibility {
    /// Frames, and all that the computer tells of its card.
    All,
    /// Without what the card has counted.
    WithoutCounters,
}

/// One cause, as it is put into the line of [`super::proof::LINE`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub struct Play {
    /// The cause; `None` for a line on which nothing is wrong.
    pub cause: Option<FaultName>,
    /// What is added to the segment file; of a line whose equal devices are exchanged before, if it begins so
    /// ([`super::proof::EXCHANGED`]), or in which another device was planned ([`super::proof::OTHER`]). The fault is there
    /// from the start if it says so first (`from_ms`).
    pub file: &'static str,
}

/// How the causes of a set come to differ: a check on the proof, which could not fail otherwise.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Separation {
    /// All faults are healed, and the line is watched for another two seconds.
    ByHealing,
    /// What the computer tells of its card is shown.
    ByHost,
    /// The devices tell who they are.
    ByAlias,
    /// By nothing that frames or the host could show: parts are to be exchanged or measured.
    ByExchange,
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
    causes: &[LinkOpen, DeviceOff, SupplyOff],
    while_so: "what fell silent has not answered again, and all of it hangs behind one link that is not \
               part of a ring",
    why: "whoever hangs behind a cut and whoever has no power are equally silent, and the \
          neighbour's port sees no signal in both cases",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play { cause: Some(LinkOpen), file: "kind = 'link-open'\nat = 'K1.C-K2.A'" },
            Play { cause: Some(DeviceOff), file: "kind = 'device-off'\ndevice = 'K2'" },
            Play {
                cause: Some(SupplyOff),
                file: "kind = 'supply-off'\ndevices = ['K2', 'T4']\nspread_us = 0",
            },
        ],
        separated: Separation::ByHealing,
    },
};

/// A link that one end alone has lost.
pub static ONE_END: AdmittedSet = AdmittedSet {
    name: "one-end",
    causes: &[LinkOpen, FalseLink],
    while_so: "one end of a link has lost it, and the other one has it all the time",
    why: "with one of two pairs of contacts or fibres open the sender keeps its link and its frames \
          vanish: so they do in something between that shows it one",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play { cause: Some(LinkOpen), file: "kind = 'link-open'\nat = 'K1.B>T1.A'" },
            Play {
                cause: Some(FalseLink),
                file: "kind = 'false-link'\nat = 'K1.B>T1.A'\nfar = 'without-link'",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// An overloaded E-bus.
pub static OVERLOAD: AdmittedSet = AdmittedSet {
    name: "overload",
    causes: &[EbusOverload, BrownOut],
    while_so: "terminals of one coupler fall and start anew",
    why: "terminals that lose their E-bus voltage start anew, whether their load took it or a contact",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 8_000,
        plays: &[
            Play {
                cause: Some(EbusOverload),
                file: "kind = 'ebus-overload'\ndevice = 'K1'\nsupply_ma = 1\noff_ms = 200\non_ms = 1800",
            },
            Play {
                cause: Some(BrownOut),
                file: "kind = 'brown-out'\ndevices = ['T1', 'T2']\ndip_ms = 200\nevery_ms = 2000",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// Symbol errors on one direction of a link.
pub static SYMBOLS: AdmittedSet = AdmittedSet {
    name: "symbols",
    causes: &[CableDegraded, EmcNoise, TransmitterDamaged, ReceiverDamaged],
    while_so: "one direction of one link is hit",
    why: "a receiver sees symbol errors; whether the sender, the cable, the plug, its own input or \
          interference made them is not in the symbols: their rhythm is a hint only",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play {
                cause: Some(CableDegraded),
                file: "kind = 'cable-degraded'\nat = 'K2.A>K1.C'\nhits = 7",
            },
            Play { cause: Some(EmcNoise), file: "kind = 'emc-noise'\nat = 'K2.A>K1.C'\nhits = 7" },
            Play {
                cause: Some(TransmitterDamaged),
                file: "kind = 'transmitter-damaged'\nat = 'K2.A>K1.C'\nhits = 7",
            },
            Play {
                cause: Some(ReceiverDamaged),
                file: "kind = 'receiver-damaged'\nat = 'K2.A>K1.C'\nhits = 7",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// Symbol errors on both directions: of the same four, those that can do so.
pub static BOTH_WAYS: AdmittedSet = AdmittedSet {
    name: "both-ways",
    causes: &[CableDegraded, EmcNoise],
    while_so: "both directions of one link are hit",
    why: "a worn cable and interference hit both directions of a link alike: their rhythm is a hint only",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play {
                cause: Some(CableDegraded),
                file: "kind = 'cable-degraded'\nat = 'K2.A>K1.C'\nhits = 4\n\
                       [[fault]]\nfrom_ms = 4000\nto_ms = 4000.001\n\
                       kind = 'cable-degraded'\nat = 'K1.C>K2.A'\nhits = 1",
            },
            Play {
                cause: Some(EmcNoise),
                file: "kind = 'emc-noise'\nat = 'K2.A>K1.C'\nhits = 4\n\
                       [[fault]]\nfrom_ms = 4000\nto_ms = 4000.001\n\
                       kind = 'emc-noise'\nat = 'K1.C>K2.A'\nhits = 1",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// The way out of the card.
pub static FIRST_HOP: AdmittedSet = AdmittedSet {
    name: "first-hop",
    causes: &[NicDamaged, CableDegraded, EmcNoise, ReceiverDamaged],
    while_so: "the way from the card to the first SubDevice is hit",
    why: "one direction of a link like any other, but that its transmitter is a part of the card",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play {
                cause: Some(NicDamaged),
                file: "kind = 'nic-damaged'\nat = 'maindevice'\npart = 'transmitter'\nhits = 1",
            },
            Play {
                cause: Some(CableDegraded),
                file: "kind = 'cable-degraded'\nat = 'maindevice>K1.A'\nhits = 1",
            },
            Play {
                cause: Some(EmcNoise),
                file: "kind = 'emc-noise'\nat = 'maindevice>K1.A'\nhits = 1",
            },
            Play {
                cause: Some(ReceiverDamaged),
                file: "kind = 'receiver-damaged'\nat = 'maindevice>K1.A'\nhits = 1",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// The way into the card.
pub static LAST_HOP: AdmittedSet = AdmittedSet {
    name: "last-hop",
    causes: &[NicDamaged, CableDegraded, EmcNoise, TransmitterDamaged],
    while_so: "the way from the first SubDevice to the card is hit",
    why: "one direction of a link like any other, but that its receiver is a part of the card",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play {
                cause: Some(NicDamaged),
                file: "kind = 'nic-damaged'\nat = 'maindevice'\npart = 'receiver'\nhits = 5",
            },
            Play {
                cause: Some(CableDegraded),
                file: "kind = 'cable-degraded'\nat = 'K1.A>maindevice'\nhits = 5",
            },
            Play {
                cause: Some(EmcNoise),
                file: "kind = 'emc-noise'\nat = 'K1.A>maindevice'\nhits = 5",
            },
            Play {
                cause: Some(TransmitterDamaged),
                file: "kind = 'transmitter-damaged'\nat = 'K1.A>maindevice'\nhits = 5",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// The last hop, uncounted.
pub static UNCOUNTED: AdmittedSet = AdmittedSet {
    name: "uncounted",
    causes: &[CableDegraded, EmcNoise, NicDamaged, HostDrops],
    while_so: "frames get lost on the last hop, and the card's counters are not known",
    why: "frames that the card or the computer drops just do not come back, and no SubDevice counts",
    proof: Proof {
        visibility: Visibility::WithoutCounters,
        until_ms: 6_000,
        plays: &[
            Play {
                cause: Some(CableDegraded),
                file: "kind = 'cable-degraded'\nat = 'K1.A>maindevice'\nhits = 1\n\
                       at_ms = [0, 30, 70, 110, 130, 180, 250, 300, 330, 390, 440, 500]\nfor_ms = 0.001",
            },
            Play {
                cause: Some(EmcNoise),
                file: "kind = 'emc-noise'\nat = 'K1.A>maindevice'\nhits = 1\n\
                       at_ms = [0, 30, 70, 110, 130, 180, 250, 300, 330, 390, 440, 500]\nfor_ms = 0.001",
            },
            Play {
                cause: Some(NicDamaged),
                file: "kind = 'nic-damaged'\nat = 'maindevice'\npart = 'receiver'\nhits = 1\n\
                       at_ms = [0, 30, 70, 110, 130, 180, 250, 300, 330, 390, 440, 500]\nfor_ms = 0.001",
            },
            Play {
                cause: Some(HostDrops),
                file: "kind = 'host-drops'\nat = 'maindevice'\nhits = 1\n\
                       at_ms = [0, 30, 70, 110, 130, 180, 250, 300, 330, 390, 440, 500]\nfor_ms = 0.001",
            },
        ],
        separated: Separation::ByHost,
    },
};

/// Twins that do not say who they are: nothing may be said.
pub static TWINS: AdmittedSet = AdmittedSet {
    name: "twins",
    causes: &[TwinsSwapped],
    while_so: "the project knows neither alias nor serial number of the two",
    why: "two devices of one type in each other's place are the line that was planned, to everyone who \
          does not know them by name",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 4_000,
        plays: &[
            Play {
                cause: Some(TwinsSwapped),
                file: "kind = 'twins-swapped'\ndevices = ['T4', 'T5']",
            },
            Play { cause: None, file: "" },
        ],
        separated: Separation::ByAlias,
    },
};

/// One of several equal devices in a row: the others have moved up.
pub static EQUALS: AdmittedSet = AdmittedSet {
    name: "equals",
    causes: &[DeviceMissing],
    while_so: "the missing one stands in a row of equal ones, of which the project knows neither alias nor \
               serial number",
    why: "whichever of two equal devices in a row is taken out, one of them is left, and stands at the same \
          place of the line",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 4_000,
        plays: &[
            Play { cause: Some(DeviceMissing), file: "kind = 'device-missing'\ndevice = 'T4'" },
            // T5 stays in both: what is missing stands before it here, and behind it there.
            Play {
                cause: Some(DeviceMissing),
                file: "# exchanged\nkind = 'device-missing'\ndevice = 'T4'",
            },
        ],
        separated: Separation::ByAlias,
    },
};

/// One too many in a row of equal devices.
pub static EXTRAS: AdmittedSet = AdmittedSet {
    name: "one-too-many",
    causes: &[DeviceExtra],
    while_so: "the extra one stands in a row of equal ones, of which the project knows neither alias nor serial \
               number",
    why: "of equal devices in a row there is one more than planned: whichever was put in, the row is the same",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 4_000,
        plays: &[
            // In the row stand T4, X and T5, one behind the other.
            Play {
                cause: Some(DeviceExtra),
                file: "kind = 'device-extra'\ndevice = 'X'\ntype = 'EL2004'\non = 'T4.B'\nserial = 7",
            },
            Play {
                cause: Some(DeviceExtra),
                file: "# other T4 X 7\n\
                       kind = 'device-extra'\ndevice = 'T4'\ntype = 'EL2004'\non = 'K2.B'\nserial = 104",
            },
            Play {
                cause: Some(DeviceExtra),
                file: "# other T5 X 7\n\
                       kind = 'device-extra'\ndevice = 'T5'\ntype = 'EL2004'\non = 'X.B'\nserial = 105",
            },
        ],
        separated: Separation::ByAlias,
    },
};

/// Nobody there from the start.
pub static NOBODY: AdmittedSet = AdmittedSet {
    name: "nobody",
    causes: &[LinkOpen, DeviceOff, SupplyOff, DeviceMissing],
    while_so: "the card never had a link, and nothing has ever answered",
    why: "whoever was never seen may have no power, no cable, or not be there: the card has no link either way",
    proof: Proof {
        visibility: Visibility::All,
        until_ms: 6_000,
        plays: &[
            Play {
                cause: Some(LinkOpen),
                file: "# alone\nfrom_ms = 0\nkind = 'link-open'\nat = 'maindevice-K1.A'",
            },
            Play {
                cause: Some(DeviceOff),
                file: "# alone\nfrom_ms = 0\nkind = 'device-off'\ndevice = 'K1'",
            },
            Play {
                cause: Some(SupplyOff),
                file: "# alone\nfrom_ms = 0\nkind = 'supply-off'\ndevices = ['K1', 'T1']\nspread_us = 0",
            },
            Play {
                cause: Some(DeviceMissing),
                file: "# alone\nkind = 'device-missing'\ndevice = 'K1'",
            },
        ],
        separated: Separation::ByExchange,
    },
};

/// All of them.
pub static ALL: &[&AdmittedSet] = &[
    &SILENT, &ONE_END, &OVERLOAD, &SYMBOLS, &BOTH_WAYS, &FIRST_HOP, &LAST_HOP, &UNCOUNTED, &TWINS,
    &EQUALS, &EXTRAS, &NOBODY,
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_has_at_most_four_names_and_says_why() {
        for set in ALL {
            assert!((1..=4).contains(&set.causes.len()), "{}", set.name);
            assert!(!set.why.is_empty() && !set.while_so.is_empty(), "{}", set.name);
            let same = ALL.iter().filter(|other| other.name == set.name).count();
            assert_eq!(same, 1, "{} twice", set.name);
        }
    }
}
