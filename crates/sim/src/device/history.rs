//! The diagnosis history of a device, object 0x10F3: what it has noted of itself.
//!
//! Read first: ETG.1020, diagnosis history; behaviour as in the public SubDevice stack code.
//! Subindex 1: how many messages fit; 2: where the newest is; 3: up to where the MainDevice has read
//! (written: 0 clears all); 4: whether there is one that it has not read; 5: flags. Messages follow
//! from subindex 6 on. In the *overwrite* mode the ring goes round; in the *acknowledge* mode only
//! what was read makes room, and what finds none is discarded. Flag 5 tells that either happened.

use linesman_proto::mailbox::coe::diagnosis::{DiagnosisMessage, Parameter, Severity};
use linesman_proto::mailbox::coe::information::{Access, ObjectCode};
use linesman_proto::mailbox::coe::{DataType, ObjectAddress, ObjectIndex};

use super::dictionary::{Dictionary, Entry, Object, READ_ONLY, READ_WRITE};

/// Index of the object.
pub const HISTORY: ObjectIndex = ObjectIndex(0x10F3);
/// Subindex of the first message.
pub const FIRST_MESSAGE: u8 = 6;
/// Data type of the object.
const DIAGNOSIS_HISTORY: DataType = DataType(0x0282);
/// The longest message, in bytes.
const LONGEST: u16 = 64;
/// More messages than any device keeps.
const MOST: u8 = 250;

const NEWEST: u8 = 2;
/// Subindex that a MainDevice acknowledges by.
pub const ACKNOWLEDGED: u8 = 3;
const NEW: u8 = 4;
/// Subindex of the flags.
pub const FLAGS: u8 = 5;

/// Flags: messages are sent as emergencies as well.
pub const SENDS_EMERGENCIES: u64 = 1 << 0;
const NO_INFORMATION: u64 = 1 << 1;
const NO_WARNINGS: u64 = 1 << 2;
const NO_ERRORS: u64 = 1 << 3;
const ACKNOWLEDGE_MODE: u64 = 1 << 4;
const LOST: u64 = 1 << 5;
/// What a MainDevice may write into the flags.
pub const WRITABLE_FLAGS: u64 = 0x1F;

/// The object, with room for `capacity` messages (1 to 250).
#[must_use]
pub fn object(capacity: u8) -> Object {
    let capacity = capacity.clamp(1, MOST);
    let number = |subindex, name: &str, data_type, bits, access, value| {
        Entry::number(subindex, name, data_type, bits, access, value)
    };
    let (byte, word) = (DataType::USINT, DataType::UINT);
    let mapped = Access(READ_ONLY.0 | Access::TX_PDO);
    let mut entries = vec![
        number(1, "Maximum messages", byte, 8, READ_ONLY, u64::from(capacity)),
        number(NEWEST, "Newest message", byte, 8, READ_ONLY, 0),
        number(ACKNOWLEDGED, "Newest acknowledged message", byte, 8, READ_WRITE, 0),
        number(NEW, "New messages available", DataType::BOOL, 1, mapped, 0),
        number(FLAGS, "Flags", word, 16, READ_WRITE, 0),
    ];
    let messages = (FIRST_MESSAGE..=u8::MAX).take(usize::from(capacity));
    entries.extend((1u16..).zip(messages).map(|(no, subindex)| Entry {
        subindex,
        name: format!("Diagnosis message {no:03}"),
        data_type: DataType::OCTET_STRING,
        bits: LONGEST * 8,
        access: READ_ONLY,
        value: Vec::new(),
        maximum: None,
    }));
    let record = ObjectCode::Record;
    let mut object = Object::list(HISTORY, "Diagnosis history", record, DIAGNOSIS_HISTORY, entries);
    if let Some(count) = object.entries.first_mut() {
        count.value = vec![FIRST_MESSAGE - 1];
    }
    object
}

/// Something to be noted.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Note<'a> {
    /// How serious it is.
    pub severity: Severity,
    /// The code, as [`DiagnosisMessage::code`] has it.
    pub code: u32,
    /// Number of the text.
    pub text: u16,
    /// What goes into the text.
    pub parameters: &'a [Parameter<'a>],
}

/// When something happened.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Stamp {
    /// In ns.
    pub time_ns: u64,
    /// Whether that is the local clock, not the system time.
    pub local: bool,
}

/// The state of the ring; its content is in the dictionary.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct History {
    /// Messages that are there.
    stored: u8,
    /// Which slot gets the next one, from 0.
    next: u8,
    /// How many of those that are there have not been acknowledged.
    unread: u8,
}

impl History {
    /// Notes something. False when the flags suppress it, there is no room, or the device keeps no
    /// history.
    pub fn note(&mut self, note: Note<'_>, stamp: Stamp, dictionary: &mut Dictionary) -> bool {
        let Some(capacity) = capacity(dictionary) else { return false };
        let flags = get(dictionary, FLAGS);
        let suppressed = match note.severity {
            Severity::Information => NO_INFORMATION,
            Severity::Warning => NO_WARNINGS,
            Severity::Error => NO_ERRORS,
            Severity::Reserved(_) => 0,
        };
        if flags & suppressed != 0 {
            return false;
        }
        let keeps = flags & ACKNOWLEDGE_MODE != 0;
        if self.stored == capacity && (!keeps || self.unread == capacity) {
            set(dictionary, FLAGS, flags | LOST);
            if keeps {
                return false;
            }
        }
        let mut parameters = Vec::new();
        for parameter in note.parameters {
            parameter.push_to(&mut parameters);
        }
        let message = DiagnosisMessage {
            code: note.code,
            severity: note.severity,
            local_time: stamp.local,
            text: note.text,
            time_ns: stamp.time_ns,
            count: note.parameters.len() as u8,
            parameters: &parameters,
        };
        let mut bytes = vec![0; usize::from(LONGEST)];
        let Ok(len) = message.write(&mut bytes) else { return false };
        bytes.truncate(len);
        let subindex = FIRST_MESSAGE + self.next;
        dictionary.set_bytes(ObjectAddress { index: HISTORY, subindex }, bytes);
        self.next = (self.next + 1) % capacity;
        self.stored = (self.stored + 1).min(capacity);
        self.unread = (self.unread + 1).min(capacity);
        set(dictionary, NEWEST, u64::from(subindex));
        self.publish(dictionary);
        true
    }

    /// The MainDevice wrote subindex 3, which the dictionary has checked.
    pub fn acknowledged(&mut self, dictionary: &mut Dictionary) {
        let Some(capacity) = capacity(dictionary) else { return };
        let to = get(dictionary, ACKNOWLEDGED) as u8;
        let Some(slot) = to.checked_sub(FIRST_MESSAGE).filter(|slot| *slot < self.stored) else {
            *self = Self::default();
            for subindex in (FIRST_MESSAGE..=u8::MAX).take(usize::from(capacity)) {
                dictionary.set_bytes(ObjectAddress { index: HISTORY, subindex }, Vec::new());
            }
            set(dictionary, NEWEST, 0);
            let flags = get(dictionary, FLAGS);
            set(dictionary, FLAGS, flags & !LOST);
            self.publish(dictionary);
            return;
        };
        // Newer than the acknowledged one are those between it and the next to be written.
        let ahead = (self.next + capacity - 1 - slot) % capacity;
        self.unread = self.unread.min(ahead);
        let flags = get(dictionary, FLAGS);
        if self.unread == 0 {
            set(dictionary, FLAGS, flags & !LOST);
        }
        self.publish(dictionary);
    }

    fn publish(&self, dictionary: &mut Dictionary) {
        set(dictionary, 0, u64::from(FIRST_MESSAGE - 1 + self.stored));
        set(dictionary, NEW, u64::from(self.unread > 0));
    }
}

fn at(subindex: u8) -> ObjectAddress {
    ObjectAddress { index: HISTORY, subindex }
}

fn get(dictionary: &Dictionary, subindex: u8) -> u64 {
    dictionary.number_at(at(subindex))
}

fn set(dictionary: &mut Dictionary, subindex: u8, value: u64) {
    if let Some(entry) = dictionary.find(at(subindex)) {
        dictionary.set_number(entry, value);
    }
}

/// How many messages the object has room for; `None` when there is no such object, or one of another
/// make.
fn capacity(dictionary: &Dictionary) -> Option<u8> {
    let object = dictionary.object(HISTORY)?;
    let first = object.entries.iter().position(|entry| entry.subindex == FIRST_MESSAGE)?;
    let messages = object.entries.len() - first;
    u8::try_from(messages).ok().map(|messages| messages.min(MOST)).filter(|count| *count > 0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use linesman_proto::state::AlState;

    struct Rig {
        history: History,
        dictionary: Dictionary,
    }

    impl Rig {
        fn new(capacity: u8, flags: u64) -> Self {
            let mut dictionary = Dictionary::new(vec![object(capacity)], true);
            set(&mut dictionary, FLAGS, flags);
            Self { history: History::default(), dictionary }
        }

        fn note(&mut self, no: u16, severity: Severity) -> bool {
            let parameter = no.to_le_bytes();
            let parameters = [Parameter::Value(DataType::UINT, &parameter)];
            let note = Note { severity, code: 0xE000, text: no, parameters: &parameters };
            let stamp = Stamp { time_ns: 1_000, local: true };
            self.history.note(note, stamp, &mut self.dictionary)
        }

        fn notes(&mut self, numbers: std::ops::RangeInclusive<u16>) {
            for no in numbers {
                self.note(no, Severity::Error);
            }
        }

        fn acknowledge(&mut self, to: u8) -> Result<(), u32> {
            let written = self.dictionary.download(at(ACKNOWLEDGED), &[to], AlState::PreOp);
            written.map_err(|code| code.value())?;
            self.history.acknowledged(&mut self.dictionary);
            Ok(())
        }

        /// Subindex 0, newest, whether there are new ones, whether some were lost.
        fn state(&self) -> (u64, u64, bool, bool) {
            let read = |subindex| get(&self.dictionary, subindex);
            (read(0), read(NEWEST), read(NEW) != 0, read(FLAGS) & LOST != 0)
        }

        fn texts(&self) -> Vec<u16> {
            let read = |subindex| self.dictionary.upload(at(subindex), AlState::Op).ok();
            (FIRST_MESSAGE..)
                .map_while(read)
                .map(|bytes| DiagnosisMessage::parse(&bytes).unwrap().text)
                .collect()
        }
    }

    #[test]
    fn a_message_is_these_bytes() {
        let mut rig = Rig::new(4, 0);
        rig.notes(0x0102..=0x0102);
        let bytes = rig.dictionary.upload(at(6), AlState::PreOp).unwrap();
        let expected =
            [0x00, 0xE0, 0, 0, 0x12, 1, 2, 1, 0xE8, 3, 0, 0, 0, 0, 0, 0, 0x06, 0, 0x02, 0x01];
        assert_eq!(bytes, expected);
        let missing = rig.dictionary.upload(at(7), AlState::PreOp).unwrap_err();
        assert_eq!(missing.value(), 0x0609_0011, "only what is there can be read");
        let whole = rig.dictionary.upload_all(at(0), AlState::PreOp).unwrap_err();
        assert_eq!(whole.value(), 0x0601_0004);
    }

    #[test]
    fn the_overwrite_mode_goes_round() {
        let mut rig = Rig::new(3, 0);
        assert_eq!(rig.state(), (5, 0, false, false));
        rig.notes(1..=3);
        assert_eq!(rig.state(), (8, 8, true, false));
        rig.acknowledge(8).unwrap();
        assert_eq!(rig.state(), (8, 8, false, false));
        rig.notes(4..=4);
        assert_eq!((rig.state(), rig.texts()), ((8, 6, true, true), vec![4, 2, 3]));
        rig.acknowledge(7).unwrap();
        assert!(rig.state().2, "the oldest is read, the newest is not");
        rig.acknowledge(6).unwrap();
        assert_eq!(rig.state(), (8, 6, false, false));
        for wrong in [5, 1, 9, 255] {
            assert_eq!(rig.acknowledge(wrong), Err(0x0609_0030), "{wrong}");
        }
        rig.acknowledge(0).unwrap();
        assert_eq!((rig.state(), rig.texts()), ((5, 0, false, false), vec![]));
    }

    #[test]
    fn the_acknowledge_mode_keeps_what_was_not_read() {
        let mut rig = Rig::new(3, ACKNOWLEDGE_MODE);
        rig.notes(1..=5);
        assert_eq!((rig.state(), rig.texts()), ((8, 8, true, true), vec![1, 2, 3]));
        rig.acknowledge(7).unwrap();
        rig.notes(6..=8);
        assert_eq!(rig.texts(), [6, 7, 3], "two were read, so two found room");
        assert_eq!(rig.state(), (8, 7, true, true));
        rig.acknowledge(7).unwrap();
        assert_eq!(rig.state(), (8, 7, false, false));
    }

    #[test]
    fn flags_suppress_what_nobody_wants() {
        for (flags, kept) in [
            (0, [true, true, true]),
            (NO_INFORMATION, [false, true, true]),
            (NO_WARNINGS | NO_ERRORS, [true, false, false]),
        ] {
            let mut rig = Rig::new(9, flags);
            let all = [Severity::Information, Severity::Warning, Severity::Error];
            assert_eq!(all.map(|severity| rig.note(1, severity)), kept, "{flags:#x}");
        }
        let mut rig = Rig::new(1, 0);
        for (flags, taken) in [(0x1Fu16, true), (0x20, false), (0x100, false)] {
            let written = rig.dictionary.download(at(FLAGS), &flags.to_le_bytes(), AlState::Op);
            assert_eq!(written.is_ok(), taken, "{flags:#x}");
        }
        let mut none = Rig { history: History::default(), dictionary: Dictionary::default() };
        assert!(!none.note(1, Severity::Error));
    }
}
