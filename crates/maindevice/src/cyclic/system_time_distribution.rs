//! Distribution of the system time by the cyclic frames: written to the SubDevices only while the
//! reference clock gives it.
//!
//! ARMW and FRMW at 0x0910 have the reference put its time into the datagram, and all behind it take what is
//! there (S1 9.1.3). They take it just as well when the reference has put nothing in: a controller does not
//! know who wrote. What is sent must therefore do no harm, and must not be sent for long:
//!
//! * a frame leaves with the time that the reference is expected to show when it comes by, which is what the
//!   last one brought and what has passed since. Who gets that, in the frame that finds the reference gone or
//!   because it comes before the reference, is off by the jitter of this computer, not by seconds;
//! * a frame that comes back with what was sent in it had no reference. From the next frame on the datagram
//!   is the read that goes with it, APRD or FPRD: nobody is written to, and the reference is heard at once
//!   when it answers again;
//! * then its time must be what is expected, for a reference that has started anew shows the time since. As
//!   long as those who watch the line know that it is gone, or that its clock is not set, that holds for each
//!   frame, and another one gives the time, which has followed the reference until then: FRMW names it by its
//!   station address. ARMW would name a place, to which the reference comes back with a clock that nobody has
//!   set.
//!
//! While frames may travel otherwise than the clocks were told, for somebody came or went, the reference is only asked, too: clocks go on
//! as fast as they have learnt until the delays are measured again ([`ReferenceClock::delays_known`]).
//!
//! In an open ring only one of the two copies of a frame meets the reference, and what the other one would hand round
//! reaches SubDevices by another way than the one whose delay they know. So the copy of the second card only asks for
//! the time, until it is known what is right there ([`ReferenceClock::second_card_ns`]).

use linesman_config::plan::{DatagramPlan, Role};
use linesman_proto::address::{StationAddress, WorkingCounter};
use linesman_proto::command::Command;
use linesman_proto::frame::DATAGRAM_HEADER_LEN;
use linesman_proto::time::{Instant, Span};

use crate::exchange::SecondCopy;
use crate::supervisor::ReferenceClock;

/// Where the address of a SubDevice is in a datagram header, behind command and index.
const ADP: usize = 2;
/// Frames whose contents are remembered while they are out: with more, cycles overlap more than they may.
const KEPT: usize = 4;
/// How far the time of a reference that answers again may be off what is expected: frames leave late at times.
const LATE: Span = Span::ms(1);
/// And this part of the time since it was last heard: quartzes are off by 100 ppm at most, against each other.
const DRIFT: u64 = 1_000;
/// Whoever has answered for so long is believed: if it had started anew, that would be known.
const BELIEVED: Span = Span::s(1);

/// The datagram of a frame that hands the time round.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClockDatagram {
    /// Where its data begin in the frame, and how many of them are a time.
    data_at: usize,
    len: usize,
    /// The command that only reads.
    reads: Command,
}

impl ClockDatagram {
    /// The one that is planned, if it is one whose data begin at `data_at`.
    pub(super) fn new(planned: &DatagramPlan, data_at: usize) -> Option<Self> {
        let is_time = planned.role == Role::ReferenceClock && planned.len >= size_of::<u32>();
        let reads = reading(planned.command).filter(|_| is_time)?;
        Some(Self { data_at, len: planned.len.min(size_of::<u64>()), reads })
    }

    /// Whether its data begin there.
    pub(super) const fn is_at(&self, data_at: usize) -> bool {
        self.data_at == data_at
    }

    /// Makes it a read in a frame that is about to leave.
    fn read_only(&self, frame: &mut [u8]) {
        self.set_command(self.reads, frame);
    }

    /// Makes it one of `station`, in a frame that is about to leave: a read, or one that hands its time round.
    fn name(&self, station: StationAddress, read_only: bool, frame: &mut [u8]) {
        self.set_command(if read_only { Command::Fprd } else { Command::Frmw }, frame);
        let adp = self.data_at - DATAGRAM_HEADER_LEN + ADP;
        if let Some(address) = frame.get_mut(adp..adp + size_of::<u16>()) {
            address.copy_from_slice(&station.0.to_le_bytes());
        }
    }

    fn set_command(&self, command: Command, frame: &mut [u8]) {
        if let Some(code) = frame.get_mut(self.data_at - DATAGRAM_HEADER_LEN) {
            *code = command.code();
        }
    }

    fn put(&self, time: u64, frame: &mut [u8]) {
        if let Some(data) = frame.get_mut(self.data_at..self.data_at + self.len) {
            data.copy_from_slice(&time.to_le_bytes()[..self.len]);
        }
    }

    /// The time in a frame, and the same of a time as far as the datagram has room for it.
    fn time(&self, frame: &[u8]) -> u64 {
        let mut bytes = [0; size_of::<u64>()];
        if let Some(data) = frame.get(self.data_at..self.data_at + self.len) {
            bytes[..self.len].copy_from_slice(data);
        }
        u64::from_le_bytes(bytes)
    }

    fn cut(&self, time: u64) -> u64 {
        if self.len < size_of::<u64>() { time & (u64::MAX >> (64 - 8 * self.len)) } else { time }
    }
}

/// The command that reads from the same SubDevice, and writes to nobody.
const fn reading(command: Command) -> Option<Command> {
    match command {
        Command::Armw => Some(Command::Aprd),
        Command::Frmw => Some(Command::Fprd),
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
        | Command::Lwr
        | Command::Lrw => None,
    }
}

/// The datagram of a frame that writes a time to the reference.
#[derive(Clone, Copy, Debug)]
pub(super) struct ClockShiftDatagram {
    /// Where its data begin in the frame, and how many of them are a time.
    data_at: usize,
    len: usize,
}

impl ClockShiftDatagram {
    /// The one that is planned, if it is one whose data begin at `data_at`.
    pub(super) fn new(planned: &DatagramPlan, data_at: usize) -> Option<Self> {
        let is_time = planned.role == Role::ClockShift && planned.len >= size_of::<u32>();
        is_time.then_some(Self { data_at, len: planned.len.min(size_of::<u64>()) })
    }

    /// Puts the time into a frame that is about to leave; without one it is addressed to nobody.
    pub(super) fn write(&self, time: Option<u64>, frame: &mut [u8]) {
        let (command, time) = match time {
            Some(time) => (Command::Fpwr, time),
            None => (Command::Nop, 0),
        };
        if let Some(code) = frame.get_mut(self.data_at - DATAGRAM_HEADER_LEN) {
            *code = command.code();
        }
        if let Some(data) = frame.get_mut(self.data_at..self.data_at + self.len) {
            data.copy_from_slice(&time.to_le_bytes()[..self.len]);
        }
    }
}

/// What was sent in a frame.
#[derive(Clone, Copy, Debug, Default)]
struct SentTime {
    index: u8,
    departed: Instant,
    time: u64,
    read_only: bool,
}

/// Whether the reference gives its time.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
enum ReferenceState {
    /// It does, and that is handed round.
    #[default]
    Handed,
    /// It is only asked.
    Asked {
        /// Since when it has answered each time.
        answers: Option<Instant>,
    },
}

/// Whose time a frame brought.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Brought {
    /// That of the reference, which all others follow.
    Time,
    /// Nobody's, or that of somebody whom nobody is to follow.
    Nothing,
}

/// The time that is handed round.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SystemTimeDistribution {
    known: ReferenceClock,
    state: ReferenceState,
    sent: [SentTime; KEPT],
    next: usize,
    /// The reference's time in the latest frame that brought it, and when that frame left.
    last: Option<(Instant, u64)>,
    /// The working counter of a frame that surely brought it.
    usual: Option<WorkingCounter>,
}

impl SystemTimeDistribution {
    /// Takes over what is known of the reference.
    pub(super) fn learn(&mut self, known: ReferenceClock) {
        let before = std::mem::replace(&mut self.known, known);
        if before.base != known.base {
            // Whatever it showed before, it shows another time now.
            self.last = None;
        }
        if known.stands && (!before.stands || before.base != known.base) {
            self.state = ReferenceState::Handed;
        }
    }

    /// Completes a frame with this index byte that leaves at `departed`. Gives what is otherwise in its copy that
    /// the second card of a ring sends.
    pub(super) fn write(
        &mut self,
        datagram: &ClockDatagram,
        index: u8,
        departed: Instant,
        frame: &mut [u8],
    ) -> Option<SecondCopy> {
        // With nobody to stand in, whoever is in the place of the reference is only asked.
        let named = self.known.named;
        let lost = !self.known.stands && named.is_none();
        let read_only = lost || self.state != ReferenceState::Handed || !self.known.delays_known;
        let time = if read_only { 0 } else { datagram.cut(self.expected(departed).unwrap_or(0)) };
        self.sent[self.next] = SentTime { index, departed, time, read_only };
        self.next = (self.next + 1) % KEPT;
        datagram.put(time, frame);
        match named {
            Some(station) => datagram.name(station, read_only, frame),
            None if read_only => datagram.read_only(frame),
            None => {}
        }
        if read_only {
            return None;
        }
        let (command, time) = match self.known.second_card_ns {
            Some(by) => (None, time.wrapping_add_signed(by)),
            None => (Some(if named.is_some() { Command::Fprd } else { datagram.reads }), 0),
        };
        let handing = frame.get(datagram.data_at - DATAGRAM_HEADER_LEN).copied();
        let command = command.or(handing.and_then(Command::from_code))?;
        let (data_at, len) = (datagram.data_at, datagram.len);
        Some(SecondCopy { data_at, len, command, time: time.to_le_bytes() })
    }

    /// A frame with this index byte came back.
    pub(super) fn read(
        &mut self,
        datagram: &ClockDatagram,
        index: u8,
        wkc: WorkingCounter,
        frame: &[u8],
    ) -> Brought {
        let Some(sent) = self.sent.iter().find(|sent| sent.index == index).copied() else {
            return Brought::Nothing;
        };
        let time = datagram.time(frame);
        let is_answered = match sent.read_only {
            true => wkc.0 > 0,
            // That it shows just what was expected happens: then as many as before have answered.
            false => wkc.0 > 0 && (time != sent.time || self.usual == Some(wkc)),
        };
        if !is_answered {
            self.state = ReferenceState::Asked { answers: None };
            return Brought::Nothing;
        }
        if !sent.read_only && time != sent.time {
            self.usual = Some(wkc);
        }
        let since = match self.state {
            ReferenceState::Asked { answers } => Some(answers.unwrap_or(sent.departed)),
            ReferenceState::Handed => (!self.known.stands).then_some(sent.departed),
        };
        if let Some(since) = since {
            if !self.is_right(datagram, &sent, time, since) {
                self.state = ReferenceState::Asked { answers: Some(since) };
                return Brought::Nothing;
            }
            self.state = ReferenceState::Handed;
        }
        self.last = Some((sent.departed, time));
        Brought::Time
    }

    /// True while the reference gives its time, which was set, and all others follow it.
    pub(super) fn is_handed(&self) -> bool {
        self.known.stands && self.known.base.is_some() && self.state == ReferenceState::Handed
    }

    /// When the latest frame left that brought the reference's time.
    pub(super) fn departed(&self) -> Option<Instant> {
        self.last.map(|(departed, _)| departed)
    }

    /// What the reference shows in a frame that leaves at `departed`.
    fn expected(&self, departed: Instant) -> Option<u64> {
        let of_base = self.known.base.map(|(_, epoch)| epoch.0.wrapping_add(departed.as_nanos()));
        let later = |(at, time): (Instant, u64)| time.wrapping_add(departed.since(at).as_nanos());
        self.last.map(later).or(of_base)
    }

    /// Whether whoever answers since `since` shows the time that all have.
    fn is_right(
        &self,
        datagram: &ClockDatagram,
        sent: &SentTime,
        time: u64,
        since: Instant,
    ) -> bool {
        let Some(expected) = self.expected(sent.departed) else { return true };
        let away = self.last.map_or(0, |(at, _)| sent.departed.since(at).as_nanos());
        // The low half alone goes round; a clock of 32 bits answers the other one with zeros.
        let off = match datagram.len {
            8.. if time >> 32 != 0 => time.abs_diff(expected),
            _ => u64::from((time.wrapping_sub(expected) as u32 as i32).unsigned_abs()),
        };
        off <= LATE.as_nanos() + away / DRIFT
            || (self.known.stands && sent.departed.since(since) >= BELIEVED)
    }
}

#[cfg(test)]
mod tests {
    use linesman_proto::frame::builder::DatagramAddress;
    use linesman_proto::register::SYSTEM_TIME;
    use linesman_proto::time::DcTime;

    use super::*;

    const DATA_AT: usize = 26;
    const COMMAND_AT: usize = 16;
    const EPOCH: u64 = 850_000_000_000_000_000;
    const REFERENCE: StationAddress = StationAddress(0x1001);
    const STAND_IN: StationAddress = StationAddress(0x1002);
    const ALL: WorkingCounter = WorkingCounter(4);
    const ALL_BUT_ONE: WorkingCounter = WorkingCounter(3);

    /// A cycle of 1 ms, in which the reference answers or does not.
    struct TestLine {
        datagram: ClockDatagram,
        distribution: SystemTimeDistribution,
        cycle: u64,
        len: usize,
        known: ReferenceClock,
        /// Whom the latest frame named.
        named: StationAddress,
        /// What was otherwise in its copy of the second card.
        second: Option<SecondCopy>,
    }

    impl TestLine {
        fn new(command: Command, len: usize) -> Self {
            let address = DatagramAddress::Physical(REFERENCE.0, SYSTEM_TIME.address);
            let role = Role::ReferenceClock;
            let (sync_unit, ownership) = (None, Vec::new());
            let planned = DatagramPlan { command, address, len, role, sync_unit, ownership };
            let datagram = ClockDatagram::new(&planned, DATA_AT).unwrap();
            let known = ReferenceClock {
                base: Some((1, DcTime(EPOCH))),
                stands: true,
                named: None,
                second_card_ns: None,
                delays_known: true,
            };
            let mut distribution = SystemTimeDistribution::default();
            distribution.learn(known);
            Self { datagram, distribution, cycle: 0, len, known, named: REFERENCE, second: None }
        }

        fn learn(&mut self, change: impl FnOnce(&mut ReferenceClock)) {
            change(&mut self.known);
            self.distribution.learn(self.known);
        }

        /// What the reference shows if nothing happens to it: it is 20 ppm fast.
        fn shown(&self) -> u64 {
            EPOCH + self.cycle * 1_000_020
        }

        /// One frame: command and time with which it leaves, and what it brings. `shows` is what the
        /// reference puts in.
        fn pass(&mut self, shows: Option<u64>) -> (u8, u64, Brought) {
            self.cycle += 1;
            let mut frame = vec![0; DATA_AT + self.len + 2];
            frame[COMMAND_AT] = Command::Frmw.code();
            let adp = COMMAND_AT + ADP;
            frame[adp..adp + 2].copy_from_slice(&REFERENCE.0.to_le_bytes());
            let departed = Instant::from_nanos(self.cycle * 1_000_000);
            let index = self.cycle as u8;
            self.second = self.distribution.write(&self.datagram, index, departed, &mut frame);
            let (command, sent) = (frame[COMMAND_AT], self.datagram.time(&frame));
            self.named = StationAddress(u16::from_le_bytes([frame[adp], frame[adp + 1]]));
            if let Some(time) = shows {
                self.datagram.put(time, &mut frame);
            }
            let wkc = match (Command::from_code(command), shows) {
                (Some(Command::Frmw), Some(_)) => ALL,
                (Some(Command::Frmw), None) => ALL_BUT_ONE,
                (_, shows) => WorkingCounter(shows.is_some().into()),
            };
            let brought = self.distribution.read(&self.datagram, index, wkc, &frame);
            (command, sent, brought)
        }

        fn pass_well(&mut self) -> (u8, u64, Brought) {
            let shows = EPOCH + (self.cycle + 1) * 1_000_020;
            self.pass(Some(shows))
        }
    }

    fn test_lines() -> [TestLine; 2] {
        let mut test_lines = [4, 8].map(|len| TestLine::new(Command::Frmw, len));
        for test_line in &mut test_lines {
            for _ in 0..5 {
                let (command, _, brought) = test_line.pass_well();
                assert_eq!((command, brought), (Command::Frmw.code(), Brought::Time));
            }
        }
        test_lines
    }

    const FRMW: u8 = Command::Frmw.code();
    const FPRD: u8 = Command::Fprd.code();

    #[test]
    fn the_frame_that_finds_nobody_carries_the_time_and_the_next_ones_write_nothing() {
        for mut test_line in test_lines() {
            let (command, sent, brought) = test_line.pass(None);
            assert_eq!((command, brought), (FRMW, Brought::Nothing));
            let expected = test_line.datagram.cut(test_line.shown());
            assert!(expected.abs_diff(sent) <= 20, "{sent}, but it would have shown {expected}");
            for _ in 0..3 {
                assert_eq!(test_line.pass(None), (FPRD, 0, Brought::Nothing));
            }
            // It answers again, and is believed by what it shows.
            assert_eq!(test_line.pass_well(), (FPRD, 0, Brought::Time));
            assert_eq!(test_line.pass_well().0, FRMW);
        }
    }

    #[test]
    fn while_delays_are_not_known_the_reference_is_asked_and_still_followed() {
        for mut test_line in test_lines() {
            test_line.learn(|known| known.delays_known = false);
            for _ in 0..40 {
                assert_eq!(test_line.pass_well(), (FPRD, 0, Brought::Time));
                assert!(test_line.distribution.is_handed());
            }
            test_line.learn(|known| known.delays_known = true);
            assert_eq!(test_line.pass_well().0, FRMW);
        }
    }

    #[test]
    fn a_reference_that_has_started_anew_is_not_handed_round_until_it_is_set() {
        for mut test_line in test_lines() {
            test_line.pass(None);
            for ms in 1..500 {
                let started = 7_000 + ms * 1_000_020;
                assert_eq!(test_line.pass(Some(started)), (FPRD, 0, Brought::Nothing));
            }
            test_line.learn(|known| known.stands = false);
            for ms in 500..3_000 {
                let started = 7_000 + ms * 1_000_020;
                let brought = test_line.pass(Some(started));
                assert_eq!(brought, (FPRD, 0, Brought::Nothing), "nobody has set it");
            }
            test_line.learn(|known| {
                known.stands = true;
                known.base = Some((2, DcTime(EPOCH)));
            });
            assert_eq!(test_line.pass_well().0, FRMW);
        }
    }

    #[test]
    fn another_one_gives_the_time_by_its_station_address_while_the_reference_is_lost() {
        for mut test_line in test_lines() {
            test_line.pass(None);
            test_line.learn(|known| {
                known.stands = false;
                known.named = Some(STAND_IN);
            });
            // It is heard first: it must show the time.
            let (command, _, brought) = test_line.pass_well();
            assert_eq!((command, brought), (FPRD, Brought::Time));
            assert_eq!(test_line.named, STAND_IN);
            for _ in 0..5 {
                let (command, _, brought) = test_line.pass_well();
                assert_eq!((command, brought, test_line.named), (FRMW, Brought::Time, STAND_IN));
            }
            // It has started anew before anybody knew.
            let (command, _, brought) = test_line.pass(Some(5_000_000));
            assert_eq!((command, brought), (FRMW, Brought::Nothing));
            for _ in 0..2_000 {
                assert_eq!(test_line.pass(Some(5_000_000)), (FPRD, 0, Brought::Nothing));
            }
            test_line.learn(|known| {
                known.stands = true;
                known.named = None;
            });
            let (command, _, brought) = test_line.pass_well();
            assert_eq!((command, brought, test_line.named), (FRMW, Brought::Time, REFERENCE));
        }
    }

    #[test]
    fn the_copy_of_the_second_card_only_asks_until_it_is_known_what_is_right_there() {
        for mut test_line in test_lines() {
            test_line.pass_well();
            let second = test_line.second.unwrap();
            assert_eq!((second.command, second.time), (Command::Fprd, [0; 8]));
            test_line.learn(|known| known.second_card_ns = Some(-500));
            let (_, sent, _) = test_line.pass_well();
            let second = test_line.second.unwrap();
            let time = test_line.datagram.cut(u64::from_le_bytes(second.time));
            assert_eq!((second.command, time), (Command::Frmw, sent - 500));
            // Where the first one only asks, so does the second.
            test_line.pass(None);
            test_line.pass(None);
            assert_eq!(test_line.second, None);
        }
    }

    #[test]
    fn nobody_is_written_to_while_the_reference_is_lost_and_nobody_can_stand_in() {
        for mut test_line in test_lines() {
            test_line.learn(|known| known.stands = false);
            for _ in 0..5 {
                let (command, sent, brought) = test_line.pass_well();
                assert_eq!((command, sent, brought), (FPRD, 0, Brought::Time));
                assert_eq!(test_line.named, REFERENCE);
            }
        }
    }

    /// A clock that was wrong before it was away for a moment is so after it, too: that is told by others.
    #[test]
    fn reference_that_answers_for_a_second_is_believed() {
        for mut test_line in test_lines() {
            test_line.pass(None);
            let shows = |test_line: &TestLine| Some(test_line.shown() + 5_000_000);
            let asked =
                (0..2_000).take_while(|_| test_line.pass(shows(&test_line)).0 == FPRD).count();
            assert!((1_000..1_010).contains(&asked), "{asked}");
        }
    }

    #[test]
    fn a_reference_that_shows_just_what_was_expected_has_answered() {
        for mut test_line in test_lines() {
            for _ in 0..10 {
                let expected = test_line
                    .distribution
                    .expected(Instant::from_nanos((test_line.cycle + 1) * 1_000_000));
                let (command, _, brought) = test_line.pass(expected);
                assert_eq!((command, brought), (FRMW, Brought::Time));
            }
        }
    }

    /// Frames have room for 64 bits, and the upper half comes back as zeros.
    #[test]
    fn a_reference_of_32_bits_that_comes_round_while_it_is_away_is_known_again() {
        let mut test_line = TestLine::new(Command::Frmw, 8);
        let low =
            |test_line: &TestLine| Some((EPOCH + (test_line.cycle + 1) * 1_000_020) & 0xFFFF_FFFF);
        for _ in 0..5_000 {
            assert_eq!(test_line.pass(low(&test_line)).2, Brought::Time);
        }
        for _ in 0..4_000 {
            test_line.pass(None);
        }
        assert_eq!(test_line.pass(low(&test_line)), (FPRD, 0, Brought::Time));
    }

    #[test]
    fn before_clocks_are_set_whatever_the_reference_shows_is_handed_round() {
        let mut test_line = TestLine::new(Command::Armw, 4);
        test_line.distribution = SystemTimeDistribution::default();
        assert_eq!(test_line.pass(None), (FRMW, 0, Brought::Nothing));
        let aprd = Command::Aprd.code();
        assert_eq!(test_line.pass(None), (aprd, 0, Brought::Nothing));
        let (command, sent, brought) = test_line.pass(Some(123));
        assert_eq!((command, sent, brought), (aprd, 0, Brought::Time));
        assert_eq!(test_line.pass(Some(1_000_123)).0, FRMW);
    }
}
