//! Schedule of the questions: first a scan of the positions, then all SubDevices by turns.
//!
//! Reading DL status or AL status takes back the event that tells the MainDevice of a change, where it has asked for such
//! events (0x0200, the mask of events that are shown in the IRQ field of datagrams; 0x0210 bits 2 and 3). So the mask of
//! each SubDevice is read first, and a register whose event is wanted is left alone; unless the MainDevice is known to set
//! the mask and never to look at the field, as SOEM (`ecx_set_slaves_to_default` in `ec_config.c`; `irpt` is used nowhere).

use std::collections::VecDeque;

use linesman_proto::address::{Position, RegisterAddress, StationAddress};
use linesman_proto::register::ErrorCounters;

use crate::main_device::MainDeviceKind;
use crate::model::NetworkModel;

/// SubDevices that are asked at most.
const MOST: usize = 4096;
/// SubDevices that wait out of turn.
const MOST_URGENT: usize = 64;

/// Registers with their lengths.
pub(super) type AskedRegister = (RegisterAddress, u16);

const STATION: AskedRegister = (RegisterAddress(0x0010), 2);
const EVENT_MASK: AskedRegister = (RegisterAddress(0x0200), 2);
/// Type and revision of the controller: they tell how it counts errors.
const CONTROLLER: AskedRegister = (RegisterAddress(0x0000), 2);
const DL_STATUS: AskedRegister = (RegisterAddress(0x0110), 2);
/// AL status, and its code.
const AL_STATUS: AskedRegister = (RegisterAddress(0x0130), 6);
const AL_STATUS_CODE: AskedRegister = (RegisterAddress(0x0134), 2);
const COUNTERS: AskedRegister = (ErrorCounters::START, ErrorCounters::LEN as u16);
/// Event of a changed DL status, and of a changed AL status.
const DL_EVENT: u16 = 1 << 2;
const AL_EVENT: u16 = 1 << 3;

/// An address that reaches one SubDevice.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) enum Target {
    /// By the station address that the MainDevice uses: FPRD.
    Station(StationAddress),
    /// By its position, where it has no station address of its own: APRD.
    Position(Position),
}

/// Registers to be read from one SubDevice.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Question {
    pub(super) target: Target,
    pub(super) registers: Vec<AskedRegister>,
}

/// A SubDevice that has told who it is.
#[derive(Clone, Copy, Debug)]
struct KnownSubDevice {
    target: Target,
    mask: u16,
}

/// Whose turn it is.
#[derive(Clone, Default, Debug)]
pub(super) struct QuestionSchedule {
    /// Positions to be asked who is there.
    positions: u16,
    /// The next of them.
    position: u16,
    known: Vec<KnownSubDevice>,
    next: usize,
    /// Whether the MainDevice never looks at events.
    ignores_events: bool,
    urgent: VecDeque<StationAddress>,
}

impl QuestionSchedule {
    /// Begins anew, with so many SubDevices on the line of this MainDevice.
    pub(super) fn begin(&mut self, count: u16, kind: MainDeviceKind) {
        let ignores_events = kind == MainDeviceKind::Soem;
        *self = Self { positions: count, ignores_events, ..Self::default() };
    }

    /// SubDevices that have told who they are.
    pub(super) const fn count(&self) -> usize {
        self.known.len()
    }

    /// A SubDevice is to be asked out of turn.
    pub(super) fn hurry(&mut self, station: StationAddress) {
        if self.urgent.len() < MOST_URGENT && !self.urgent.contains(&station) {
            self.urgent.push_back(station);
        }
    }

    /// The next question; `None` while there is nobody to be asked.
    pub(super) fn next(&mut self, model: &NetworkModel) -> Option<Question> {
        if self.position < self.positions {
            let target = Target::Position(Position(self.position));
            self.position += 1;
            return Some(Question { target, registers: vec![CONTROLLER, STATION, EVENT_MASK] });
        }
        while let Some(station) = self.urgent.pop_front() {
            let target = Target::Station(station);
            if let Some(known) = self.known.iter().find(|known| known.target == target) {
                return Some(status(*known));
            }
            // Of who has not told its mask the counters alone may be read.
            if model.by_station(station).is_some() {
                return Some(Question { target, registers: vec![COUNTERS] });
            }
        }
        if self.known.is_empty() {
            return None;
        }
        self.next %= self.known.len();
        let known = self.known.get(self.next).copied();
        self.next += 1;
        known.map(status)
    }

    /// A SubDevice has answered.
    pub(super) fn answered(&mut self, question: &Question, answers: &[Option<&[u8]>]) {
        let word = |register: AskedRegister| {
            let index = question.registers.iter().position(|one| *one == register)?;
            let bytes = answers.get(index).copied().flatten()?;
            bytes.try_into().ok().map(u16::from_le_bytes)
        };
        let (Some(station), Some(mask)) = (word(STATION), word(EVENT_MASK)) else { return };
        let mask = if self.ignores_events { 0 } else { mask };
        let target =
            if station == 0 { question.target } else { Target::Station(StationAddress(station)) };
        // Two with one address would answer together: what they say is mixed.
        let is_shared = self.known.iter().any(|known| known.target == target);
        let target = if is_shared { question.target } else { target };
        if self.known.len() < MOST {
            self.known.push(KnownSubDevice { target, mask });
        }
    }
}

/// Status and counters of a SubDevice, as far as reading them takes no event from anybody.
fn status(known: KnownSubDevice) -> Question {
    let wants = |event: u16| known.mask & event != 0;
    let dl = Some(DL_STATUS).filter(|_| !wants(DL_EVENT));
    let al = if wants(AL_EVENT) { AL_STATUS_CODE } else { AL_STATUS };
    let registers = dl.into_iter().chain([al, COUNTERS]).collect();
    Question { target: known.target, registers }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn addresses(question: &Question) -> Vec<u16> {
        question.registers.iter().map(|(register, _)| register.0).collect()
    }

    fn tell(turns: &mut QuestionSchedule, question: &Question, station: u16, mask: u16) {
        let (station, mask) = (station.to_le_bytes(), mask.to_le_bytes());
        turns.answered(question, &[Some(&[0x11, 2]), Some(&station), Some(&mask)]);
    }

    #[test]
    fn all_are_asked_by_turns_once_they_have_told_who_they_are() {
        let model = NetworkModel::default();
        let mut turns = QuestionSchedule::default();
        turns.begin(2, MainDeviceKind::Kickcat);
        for (position, station) in [(0, 0x1001), (1, 0x1002)] {
            let question = turns.next(&model).unwrap();
            assert_eq!(question.target, Target::Position(Position(position)));
            assert_eq!(addresses(&question), [0x0000, 0x0010, 0x0200]);
            tell(&mut turns, &question, station, 0);
        }
        let targets: Vec<Target> = (0..4).map(|_| turns.next(&model).unwrap().target).collect();
        let expected =
            [0x1001, 0x1002, 0x1001, 0x1002].map(|one| Target::Station(StationAddress(one)));
        assert_eq!(targets, expected);
        turns.hurry(StationAddress(0x1001));
        assert_eq!(turns.next(&model).unwrap().target, expected[0]);
        assert_eq!(addresses(&turns.next(&model).unwrap()), [0x0110, 0x0130, 0x0300]);
    }

    #[test]
    fn register_whose_event_the_main_device_wants_is_left_alone() {
        let model = NetworkModel::default();
        for (mask, expected) in [
            (0b0100, [0x0130, 0x0300].as_slice()),
            (0b1000, &[0x0110, 0x0134, 0x0300]),
            (0b1100, &[0x0134, 0x0300]),
            (0b0011, &[0x0110, 0x0130, 0x0300]),
        ] {
            let mut turns = QuestionSchedule::default();
            turns.begin(1, MainDeviceKind::Kickcat);
            let question = turns.next(&model).unwrap();
            tell(&mut turns, &question, 0x1001, mask);
            assert_eq!(addresses(&turns.next(&model).unwrap()), expected, "mask {mask:b}");
        }
        let mut turns = QuestionSchedule::default();
        turns.begin(1, MainDeviceKind::Soem);
        let question = turns.next(&model).unwrap();
        tell(&mut turns, &question, 0x1001, 0b0100);
        assert_eq!(
            addresses(&turns.next(&model).unwrap()),
            [0x0110, 0x0130, 0x0300],
            "never looks"
        );
    }

    #[test]
    fn without_an_address_of_its_own_a_subdevice_is_asked_by_position() {
        let model = NetworkModel::default();
        let mut turns = QuestionSchedule::default();
        turns.begin(3, MainDeviceKind::Kickcat);
        for station in [0, 0x1001, 0x1001] {
            let question = turns.next(&model).unwrap();
            tell(&mut turns, &question, station, 0);
        }
        let targets: Vec<Target> = (0..3).map(|_| turns.next(&model).unwrap().target).collect();
        let expected = [
            Target::Position(Position(0)),
            Target::Station(StationAddress(0x1001)),
            Target::Position(Position(2)),
        ];
        assert_eq!(targets, expected);
    }
}
