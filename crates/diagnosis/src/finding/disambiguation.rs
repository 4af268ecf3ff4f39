//! Measurements that tell two causes apart which the evidence so far does not.

use linesman_config::fault::FaultName::{self, *};

/// What to look at, exchange or measure to tell two causes apart; `None` where no single observation
/// does.
#[must_use]
pub fn told_apart_by(one: FaultName, other: FaultName) -> Option<&'static str> {
    step(one, other).or_else(|| step(other, one))
}

fn step(one: FaultName, other: FaultName) -> Option<&'static str> {
    Some(match (one, other) {
        (LinkOpen | LinkFlapping, DeviceOff | SupplyOff) => {
            "the lamps of the device behind; and, when it answers again, whether it kept its state and \
             station address"
        }
        (LinkOpen | LinkFlapping, BrownOut) => {
            "whether the device kept its state and station address: a dip clears both"
        }
        (LinkOpen, LinkFlapping) => "the next opening",
        (LinkOpen, RingOpen) => "whether all others still answer, through the other card",
        (LinkOpen, FalseLink) => "the link lamps at both ends",
        (LinkFlapping, CableDegraded) => "the symbol errors between two openings",
        (DeviceMissing, LinkOpen | DeviceOff | SupplyOff) => {
            "a look whether the device is there, and at its lamps"
        }
        (WatchdogStarved, FalseLink) => {
            "the computer's own count of frames that its card did not take"
        }
        (DeviceOff, SupplyOff) => "whether other devices of the same supply are dark, too",
        (EbusOverload, BrownOut | DeviceOff | SupplyOff) => {
            "the sum of the E-bus currents against what the coupler supplies, and the E-bus voltage \
             measured under load"
        }
        (BrownOut, DeviceOff | SupplyOff) => "how long the supply was gone, measured at the device",
        (BrownOut, FirmwareFault) => {
            "the links of its neighbours: a processor that starts anew keeps them"
        }
        (
            HostDrops,
            NicDamaged | CableDegraded | EmcNoise | TransmitterDamaged | DeviceInternal,
        ) => "the card's own counters: damaged frames are counted as errors, dropped ones as drops",
        (NicDamaged, CableDegraded | EmcNoise | TransmitterDamaged | ReceiverDamaged) => {
            "another card, then another cable: the errors go with the damaged part"
        }
        (NicDamaged | CableDegraded, DeviceInternal) => "exchanging the device, then the cable",
        (CableDegraded, EmcNoise) => {
            "another cable, laid elsewhere; and what is switched at the moments of the errors"
        }
        (CableDegraded | EmcNoise, TransmitterDamaged | ReceiverDamaged) => {
            "another cable, then another device: the errors go with the damaged part"
        }
        (TransmitterDamaged, ReceiverDamaged) => {
            "exchanging one of the two devices: the errors go with it or stay"
        }
        (EmcNoise | TransmitterDamaged | ReceiverDamaged, DeviceInternal) => {
            "the symbol counter of the receiving port: frames that are spoiled inside come in clean symbols"
        }
        (InitRefused, ConfigMismatch) => "the settings against the device's own, object by object",
        (CycleTooFast, FirmwareFault | SyncLost) => {
            "the counters of object 0x1C32: 0x0C counts cycles that were too short for its work"
        }
        (SyncLost | WatchdogStarved, HostJitter | LateFrames) => {
            "the beat of the process data at the moment of the error"
        }
        (SyncLost, ClockDrift) => "the difference to the system time, 0x092C",
        (HostJitter, LateFrames) => "the computer's own note of when it handed each frame over",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_two_causes_does_not_matter() {
        for one in FaultName::ALL {
            for other in FaultName::ALL {
                assert_eq!(told_apart_by(*one, *other), told_apart_by(*other, *one));
            }
            assert_eq!(told_apart_by(*one, *one), None);
        }
        assert!(told_apart_by(DeviceOff, LinkOpen).is_some_and(|text| text.contains("lamps")));
        assert_eq!(told_apart_by(TwinsSwapped, Emergency), None);
    }
}
