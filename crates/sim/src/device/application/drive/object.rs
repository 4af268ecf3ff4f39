//! The objects of CiA 402 that the drive reads and writes.

use linesman_proto::time::Span;

use crate::device::application::ChannelValue;
use crate::device::application::motion::Limits;
use crate::device::dictionary::Dictionary;

/// Where they are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Objects {
    pub(super) controlword: ChannelValue,
    pub(super) statusword: ChannelValue,
    quick_stop: ChannelValue,
    pub(super) mode: ChannelValue,
    pub(super) mode_display: ChannelValue,
    pub(super) position: ChannelValue,
    pub(super) demand: ChannelValue,
    pub(super) velocity: ChannelValue,
    pub(super) following_error: ChannelValue,
    pub(super) window: ChannelValue,
    pub(super) window_time: ChannelValue,
    position_window: ChannelValue,
    pub(super) target_position: ChannelValue,
    pub(super) target_velocity: ChannelValue,
    pub(super) home_offset: ChannelValue,
    pub(super) homing_method: ChannelValue,
    maximal_velocity: ChannelValue,
    maximal_acceleration: ChannelValue,
    pub(super) profile_velocity: ChannelValue,
    pub(super) acceleration: ChannelValue,
    pub(super) deceleration: ChannelValue,
    pub(super) quick_stop_deceleration: ChannelValue,
    pub(super) digital_inputs: ChannelValue,
    pub(super) error_code: ChannelValue,
    interpolation: [ChannelValue; 2],
}

impl Objects {
    pub(super) fn of(dictionary: &Dictionary) -> Self {
        let value = |index| ChannelValue::of(dictionary, index, 0);
        Self {
            controlword: value(0x6040),
            statusword: value(0x6041),
            quick_stop: value(0x605A),
            mode: value(0x6060),
            mode_display: value(0x6061),
            demand: value(0x6062),
            position: value(0x6064),
            window: value(0x6065),
            window_time: value(0x6066),
            position_window: value(0x6067),
            velocity: value(0x606C),
            target_position: value(0x607A),
            home_offset: value(0x607C),
            maximal_velocity: value(0x607F),
            profile_velocity: value(0x6081),
            acceleration: value(0x6083),
            deceleration: value(0x6084),
            quick_stop_deceleration: value(0x6085),
            homing_method: value(0x6098),
            maximal_acceleration: value(0x60C5),
            following_error: value(0x60F4),
            digital_inputs: value(0x60FD),
            target_velocity: value(0x60FF),
            error_code: value(0x603F),
            interpolation: [1, 2].map(|subindex| ChannelValue::of(dictionary, 0x60C2, subindex)),
        }
    }

    /// What the axis can do.
    pub(super) fn limits(&self, dictionary: &Dictionary) -> Limits {
        Limits {
            velocity: self.maximal_velocity.unsigned(dictionary),
            acceleration: self.maximal_acceleration.rate(dictionary),
        }
    }

    /// What a quick stop ends in.
    pub(super) fn quick_stop(&self, dictionary: &Dictionary) -> i16 {
        self.quick_stop.get(dictionary) as u16 as i16
    }

    /// How near its target the axis is there.
    pub(super) fn near(&self, dictionary: &Dictionary) -> f64 {
        self.position_window.unsigned(dictionary)
    }

    /// How long the way to a cyclic target takes: at least 1 µs, at most 1 s.
    pub(super) fn interpolation_time(&self, dictionary: &Dictionary) -> Span {
        let [value, index] = self.interpolation.map(|value| value.get(dictionary));
        let exponent = (index as u8 as i8).clamp(-6, 0);
        let nanos = value.saturating_mul(10u64.pow((9 + i32::from(exponent)).unsigned_abs()));
        Span::ns(nanos.clamp(1_000, 1_000_000_000))
    }
}

impl ChannelValue {
    /// A number without a sign.
    pub(super) fn unsigned(self, dictionary: &Dictionary) -> f64 {
        self.get(dictionary) as u32 as f64
    }

    /// An acceleration: never 0, or nothing would ever come to rest.
    pub(super) fn rate(self, dictionary: &Dictionary) -> f64 {
        self.unsigned(dictionary).max(1.0)
    }

    /// A number of 32 bits with a sign.
    pub(super) fn signed(self, dictionary: &Dictionary) -> f64 {
        self.get(dictionary) as u32 as i32 as f64
    }
}
