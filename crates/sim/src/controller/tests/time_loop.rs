//! The loop that follows the reference clock.

use linesman_proto::command::Command;
use linesman_proto::register::Features;
use linesman_proto::time::Span;
use proptest::prelude::*;

use super::rig::{Bench, STATION, at, hardware, sii};
use crate::device::NoFirmware;

/// A controller whose quartz is off, and a perfect reference clock beside it.
struct Follower {
    bench: Bench,
    /// What the reference shows at the start of the run.
    zero: u64,
}

impl Follower {
    fn new(ppb: i64, zero: u64) -> Self {
        let mut bench = Bench::new();
        let (now, local) = (bench.now, bench.controller.local_time(bench.now));
        bench.controller.set_drift(now, ppb, 0, Span::ZERO);
        let offset = (zero + now.as_nanos()).wrapping_sub(local);
        bench.write(0x0920, &offset.to_le_bytes());
        bench.write(0x0930, &[0x00, 0x10]);
        Self { bench, zero }
    }

    fn reference(&self) -> u64 {
        self.zero.wrapping_add(self.bench.now.as_nanos())
    }

    /// How far the local copy is ahead, in ns.
    fn ahead(&mut self) -> i64 {
        let now = self.reference();
        let shown = self.bench.read(0x0910, 8).unwrap();
        u64::from_le_bytes(shown.try_into().unwrap()).wrapping_sub(now) as i64
    }

    /// The reference time comes `times` times, one `each`.
    fn follow(&mut self, times: usize, each: Span) {
        for _ in 0..times {
            let next = self.bench.now + each;
            let now = self.reference() as u32;
            self.bench.exchange(Command::Fpwr, at(STATION, 0x0910), &now.to_le_bytes());
            let rest = next.since(self.bench.now);
            self.bench.wait(rest);
        }
    }

    /// 0x092C: how far it is ahead, as the register has it.
    fn difference(&mut self) -> i64 {
        let raw = u32::from_le_bytes(self.bench.read(0x092C, 4).unwrap().try_into().unwrap());
        let magnitude = i64::from(raw & 0x7FFF_FFFF);
        if raw >> 31 == 1 { magnitude } else { -magnitude }
    }

    fn speed_diff(&mut self) -> i16 {
        self.bench.word(0x0932) as i16
    }
}

#[test]
fn the_first_difference_is_shown_with_its_sign() {
    let mut follower = Follower::new(0, 0);
    for (ahead, expected) in [(250i64, 0x8000_00FA_u32), (-250, 0x0000_00FA), (0, 0x8000_0000)] {
        follower.bench.write(0x0930, &[0x00, 0x10]);
        let now = (follower.bench.now.as_nanos() as i64 - ahead) as u32;
        let local = follower.bench.controller.local_time(follower.bench.now);
        let offset = follower.bench.now.as_nanos().wrapping_sub(local);
        assert_eq!(offset % 10, offset, "ticks of 10 ns");
        follower.bench.write(0x0910, &now.to_le_bytes());
        let raw = follower.bench.read(0x092C, 4).unwrap();
        let shown = u32::from_le_bytes(raw.try_into().unwrap());
        assert!(shown.abs_diff(expected) <= 10, "{shown:08X}, expected {expected:08X}");
    }
    // The delay belongs to it: the reference time is that old when it comes.
    follower.bench.write(0x0928, &1_000u32.to_le_bytes());
    follower.bench.write(0x0930, &[0x00, 0x10]);
    let now = follower.bench.now.as_nanos() as u32;
    follower.bench.write(0x0910, &now.to_le_bytes());
    assert!((-1_010..=-990).contains(&follower.difference()));
}

#[test]
fn a_part_of_the_time_is_not_compared() {
    let mut follower = Follower::new(0, 0);
    follower.bench.write(0x0910, &[1, 2, 3]);
    follower.bench.write(0x0912, &[1, 2, 3, 4]);
    assert_eq!(follower.bench.read(0x092C, 4).unwrap(), [0; 4]);
}

// proves: DC-07 partial: one controller and a perfect reference
#[test]
fn fifteen_thousand_times_take_out_the_drift() {
    for ppm in [-50i64, -7, 0, 33, 50] {
        let mut follower = Follower::new(ppm * 1_000, 0);
        follower.follow(15_000, Span::us(10));
        let diff = f64::from(follower.speed_diff());
        let corrected = diff / (5.0 * (4098.0 + diff) * (4098.0 - diff)) * 1e6;
        assert!((corrected + ppm as f64).abs() < 2.5, "{ppm} ppm: corrected by {corrected}");
        let mut worst = 0;
        for _ in 0..100 {
            follower.follow(10, Span::ms(1));
            worst = worst.max(follower.ahead().abs());
        }
        assert!(worst < 100, "{ppm} ppm: {worst} ns off within the first second");
        follower.follow(5_000, Span::ms(1));
        assert!(follower.ahead().abs() <= 20, "{ppm} ppm: {}", follower.ahead());
        assert!(follower.difference().abs() <= 20);
    }
}

#[test]
fn a_short_filter_learns_the_speed_at_once() {
    let mut follower = Follower::new(40_000, 0);
    follower.bench.write(0x0935, &[0]);
    follower.follow(20, Span::ms(1));
    let diff = f64::from(follower.speed_diff());
    let corrected = diff / (5.0 * (4098.0 + diff) * (4098.0 - diff)) * 1e6;
    assert!((corrected + 40.0).abs() < 11.0, "{corrected} ppm after 20 values");
}

#[test]
fn a_wrong_start_is_worked_off_at_the_bandwidth() {
    let mut follower = Follower::new(0, 0);
    // 100 µs ahead.
    let offset = u64::from_le_bytes(follower.bench.read(0x0920, 8).unwrap().try_into().unwrap());
    follower.bench.write(0x0920, &offset.wrapping_add(100_000).to_le_bytes());
    follower.bench.write(0x0930, &[0x00, 0x10]);
    let before = follower.ahead();
    follower.follow(1_000, Span::ms(1));
    let worked_off = before - follower.ahead();
    // 1 ns in 4098 ticks: 24.4 µs a second.
    assert!((23_000..25_000).contains(&worked_off), "{worked_off} ns in a second");
    // With a quarter of the start it goes four times as fast.
    follower.bench.write(0x0930, &[0x00, 0x04]);
    let before = follower.ahead();
    follower.follow(500, Span::ms(1));
    let worked_off = before - follower.ahead();
    assert!((45_000..50_000).contains(&worked_off), "{worked_off} ns in half a second");
}

#[test]
fn writing_the_start_forgets_what_was_learned() {
    let mut follower = Follower::new(30_000, 0);
    follower.follow(15_000, Span::us(10));
    assert!(follower.speed_diff() < -1_800, "{}", follower.speed_diff());
    follower.bench.write(0x0930, &[0x00, 0x10]);
    assert_eq!((follower.speed_diff(), follower.difference()), (0, 0));
    let before = follower.ahead();
    follower.bench.wait(Span::ms(100));
    let drifted = follower.ahead() - before;
    assert!((2_900..3_100).contains(&drifted), "{drifted} ns in 100 ms: the quartz alone");
}

#[test]
fn a_quartz_beyond_the_reach_is_not_held() {
    let mut follower = Follower::new(1_200_000, 0);
    follower.follow(30_000, Span::us(20));
    // 1200 ppm, less 762 of the speed and 24 of the bandwidth.
    assert_eq!(follower.speed_diff(), -(0x1000 - 0x7F));
    let before = follower.ahead();
    follower.follow(100, Span::ms(1));
    let drifted = follower.ahead() - before;
    assert!((38_000..45_000).contains(&drifted), "{drifted} ns in 100 ms");
}

// proves: DC-02 partial: the low half wraps
#[test]
fn the_loop_does_not_notice_the_wrap_of_32_bits() {
    // 100 ms before the low half is round.
    let zero = (7 << 32) - 100_000_000;
    let mut follower = Follower::new(20_000, zero);
    follower.follow(9_000, Span::us(10));
    for _ in 0..30 {
        follower.follow(1, Span::ms(1));
        assert!(follower.ahead().abs() < 150, "{} ns", follower.ahead());
        assert!(follower.difference().abs() < 150);
    }
    assert_eq!(follower.reference() >> 32, 7, "it has wrapped meanwhile");
}

#[test]
fn a_clock_of_32_bits_follows_as_well() {
    let mut narrow = hardware();
    narrow.features = Features(narrow.features).with_clock_64_bit(false).0;
    let mut bench = Bench::with(narrow, sii(false), Box::new(NoFirmware));
    bench.controller.set_drift(bench.now, -25_000, 0, Span::ZERO);
    for _ in 0..15_000 {
        let now = bench.now.as_nanos() as u32;
        bench.write(0x0910, &now.to_le_bytes());
        bench.wait(Span::us(10));
    }
    let now = bench.now.as_nanos() as u32;
    let shown = u32::from_le_bytes(bench.read(0x0910, 4).unwrap().try_into().unwrap());
    assert!((shown.wrapping_sub(now) as i32).abs() < 100);
    assert_eq!(bench.read(0x0914, 4), None);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    // Whatever the quartz and the cycle, from any start it comes nearer and stays.
    #[test]
    fn it_is_stable(ppb in -50_000i64..50_000, zero: u64, cycle_us in 200u64..4_000, depth in 0u8..6) {
        let mut follower = Follower::new(ppb, zero >> 1);
        follower.bench.write(0x0934, &[depth]);
        follower.follow(12_000, Span::us(15));
        follower.follow(300, Span::us(cycle_us));
        let bound = 60 + 4 * (1 << depth) * (cycle_us as i64) * 5 / 2_000;
        for _ in 0..20 {
            follower.follow(20, Span::us(cycle_us));
            prop_assert!(follower.ahead().abs() < bound, "{} ns, bound {bound}", follower.ahead());
        }
    }

    // From a first difference on the clock is slewed against it.
    #[test]
    fn it_slews_the_right_way(start in 1_000i64..1_000_000, ahead: bool) {
        let mut follower = Follower::new(0, 1 << 40);
        let wrong = if ahead { start } else { -start };
        let offset = u64::from_le_bytes(follower.bench.read(0x0920, 8).unwrap().try_into().unwrap());
        follower.bench.write(0x0920, &offset.wrapping_add_signed(wrong).to_le_bytes());
        follower.bench.write(0x0930, &[0x00, 0x10]);
        let mut before = follower.ahead().abs();
        for _ in 0..5 {
            follower.follow(5, Span::us(500));
            let now = follower.ahead().abs();
            prop_assert!(now < before, "{now} ns, {before} before");
            before = now;
        }
    }
}
