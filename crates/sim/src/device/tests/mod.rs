//! Devices as a MainDevice finds them: brought up by register writes, asked through the mailbox.

// An answer of another kind fails the test, whichever it is.
#![allow(clippy::wildcard_enum_match_arm)]

use linesman_config::profile::DeviceProfile;
use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::mailbox::coe::sdo::{Initial, Request, Response, Segment};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress};
use linesman_proto::mailbox::{Counter, Header, MailboxType, Message};
use linesman_proto::register::{FmmuConfig, SmControl, SyncManagerConfig};
use linesman_proto::sii::{Direction, Image};
use linesman_proto::time::Span;

use super::Signals;
use super::library::{Built, build};
use crate::controller::tests::rig::{Bench, logical};

mod drive;
mod files;
mod history;
mod hostile;
mod mailbox;
mod process_data;
mod recorded;
mod sdo;
mod state;
mod synchronisation;

/// Where its process data lie in the logical memory: outputs first.
const LOGICAL: u32 = 0x0001_0000;

/// A device of the library on the bench.
#[derive(Debug)]
pub(crate) struct Device {
    pub(crate) bench: Bench,
    pub(crate) profile: DeviceProfile,
    pub(crate) built: Built,
    counter: Counter,
}

impl Device {
    /// A device that has just been switched on.
    pub(crate) fn new(mut built: Built, signals: Signals) -> Self {
        let profile = DeviceProfile::from_sii(&Image::parse(&built.sii).unwrap());
        let firmware = std::mem::replace(&mut built.firmware, Box::new(super::NoFirmware));
        let mut bench = Bench::with(built.hardware.clone(), built.sii.clone(), firmware);
        bench.signals = signals;
        Self { bench, profile, built, counter: Counter::NONE }
    }

    /// A device by its type.
    pub(crate) fn of(name: &str) -> Self {
        let mut signals = Signals::default();
        let built = build(name, 4_711, &mut signals).unwrap().remove(0);
        Self::new(built, signals)
    }

    /// AL status and code.
    pub(crate) fn status(&mut self) -> (u16, u16) {
        (self.bench.word(0x0130), self.bench.word(0x0134))
    }

    /// Writes AL control and waits long enough for any answer.
    pub(crate) fn request(&mut self, control: u16) -> (u16, u16) {
        assert_eq!(self.bench.write(0x0120, &control.to_le_bytes()), 1, "AL control not taken");
        self.bench.wait(Span::ms(50));
        self.status()
    }

    /// Sets up one SyncManager as the profile has it; `len` 0 is off.
    pub(crate) fn guard(&mut self, index: u8, start: u16, len: u16, control: SmControl) {
        let mut config = SyncManagerConfig::enabled(RegisterAddress(start), len, control);
        if len == 0 {
            config.activate = Default::default();
        }
        let at = 0x0800 + 8 * u16::from(index);
        assert_eq!(self.bench.write(at, &config.to_bytes()), 1);
    }

    /// Sets up the mailbox.
    pub(crate) fn set_up_mailbox(&mut self) {
        if let Some(mailbox) = self.profile.mailbox {
            let (out, back) = (mailbox.areas.receive, mailbox.areas.send);
            self.guard(0, out.offset.0, out.size, SmControl::MAILBOX_OUT);
            self.guard(1, back.offset.0, back.size, SmControl::MAILBOX_IN);
        }
    }

    /// Sets up process data: SyncManagers and FMMUs, outputs before inputs.
    pub(crate) fn set_up_process_data(&mut self) {
        let mut address = LOGICAL;
        let mut fmmu = 0;
        for direction in [Direction::Outputs, Direction::Inputs] {
            for manager in self.profile.process.clone() {
                if manager.direction != direction {
                    continue;
                }
                if !manager.is_virtual {
                    self.guard(manager.index, manager.start.0, manager.len, manager.control);
                }
                if manager.len > 0 {
                    let read = direction == Direction::Inputs;
                    let map = FmmuConfig {
                        logical_start: LogicalAddress(address),
                        length: manager.len,
                        logical_start_bit: 0,
                        logical_stop_bit: 7,
                        physical_start: manager.start,
                        physical_start_bit: 0,
                        reads: read,
                        writes: !read,
                        active: true,
                    };
                    self.bench.map(fmmu, &map);
                    address += u32::from(manager.len);
                    fmmu += 1;
                }
            }
        }
    }

    /// From INIT to PREOP.
    pub(crate) fn enter_preop(&mut self) {
        self.set_up_mailbox();
        assert_eq!(self.request(2), (2, 0), "{}", self.profile.type_name);
    }

    /// From PREOP to SAFEOP.
    pub(crate) fn enter_safeop(&mut self) {
        self.set_up_process_data();
        assert_eq!(self.request(4), (4, 0), "{}", self.profile.type_name);
    }

    /// From INIT to OP.
    pub(crate) fn bring_up(&mut self) {
        assert_eq!(self.status(), (1, 0));
        self.enter_preop();
        self.enter_safeop();
        self.exchange(&[]);
        assert_eq!(self.request(8), (8, 0), "{}", self.profile.type_name);
    }

    /// One exchange of process data by LRW: writes `outputs` (filled up with 0), gives the inputs.
    pub(crate) fn exchange(&mut self, outputs: &[u8]) -> (Vec<u8>, u16) {
        let out_len = self.profile.process_len(Direction::Outputs);
        let len = out_len + self.profile.process_len(Direction::Inputs);
        if len == 0 {
            return (Vec::new(), 0);
        }
        let mut data = vec![0; len];
        data[..outputs.len()].copy_from_slice(outputs);
        let (answer, wkc) = self.bench.exchange(Command::Lrw, logical(LOGICAL), &data);
        (answer[out_len..].to_vec(), wkc)
    }

    /// Some exchanges with the working counter that the profile lets expect.
    pub(crate) fn exchange_some(&mut self) {
        let outputs = u16::from(self.profile.process_len(Direction::Outputs) > 0);
        let inputs = u16::from(self.profile.process_len(Direction::Inputs) > 0);
        for _ in 0..3 {
            let (_, wkc) = self.exchange(&[]);
            assert_eq!(wkc, 2 * outputs + inputs, "{}", self.profile.type_name);
            self.bench.wait(Span::ms(1));
        }
        assert_eq!(self.status(), (8, 0));
    }

    // ---- mailbox ----

    /// Puts a message into the mailbox as it is, filled up; false when it is full.
    pub(crate) fn post(&mut self, message: &[u8]) -> bool {
        let area = self.profile.mailbox.unwrap().areas.receive;
        let mut data = vec![0; usize::from(area.size)];
        data[..message.len()].copy_from_slice(message);
        self.bench.write(area.offset.0, &data) == 1
    }

    /// Fetches what is in the mailbox.
    pub(crate) fn fetch(&mut self) -> Option<Vec<u8>> {
        let area = self.profile.mailbox.unwrap().areas.send;
        self.bench.read(area.offset.0, usize::from(area.size))
    }

    /// Fetches a message, waiting as long as a MainDevice would.
    pub(crate) fn fetch_soon(&mut self) -> Option<Vec<u8>> {
        for _ in 0..20 {
            self.bench.wait(Span::us(200));
            // Bit 3 of the SyncManager's status: a message is there.
            if self.bench.byte(0x080D) & 0x08 != 0 {
                return self.fetch();
            }
        }
        None
    }

    /// Sends a CoE message.
    pub(crate) fn send(&mut self, message: &CoeMessage<'_>) {
        self.counter = self.counter.next();
        let mut buffer = [0; 1_024];
        let header = Header::new(MailboxType::Coe, self.counter, 0);
        let len = header.write_message(&mut buffer, |body| message.write(body)).unwrap();
        assert!(self.post(&buffer[..len]), "mailbox full");
    }

    /// Sends an SDO request and gives the bytes of the CoE message that answers.
    pub(crate) fn ask(&mut self, request: Request<'_>) -> Vec<u8> {
        self.send(&CoeMessage::SdoRequest(request));
        let answer = self.fetch_soon().expect("no answer");
        let message = Message::parse(&answer).unwrap();
        assert_eq!(message.header.kind, MailboxType::Coe, "{:?}", message.data);
        message.data.to_vec()
    }

    fn room(&self) -> usize {
        usize::from(self.profile.mailbox.unwrap().areas.send.size)
    }

    /// Uploads an entry; the abort code when that fails.
    pub(crate) fn upload(&mut self, index: u16, subindex: u8) -> Result<Vec<u8>, u32> {
        self.upload_any(index, subindex, false)
    }

    /// Uploads an entry, or all of them.
    pub(crate) fn upload_any(
        &mut self,
        index: u16,
        subindex: u8,
        complete: bool,
    ) -> Result<Vec<u8>, u32> {
        let object = ObjectAddress::new(index, subindex);
        let answer = self.ask(Request::Upload { object, complete });
        let (mut data, size) = match CoeMessage::parse(&answer).unwrap() {
            CoeMessage::SdoResponse(Response::Upload { object: of, initial, .. }) => {
                assert_eq!(of, object);
                (initial.data().to_vec(), initial.size() as usize)
            }
            CoeMessage::Abort(abort) => return Err(abort.code),
            other => panic!("{other:?}"),
        };
        let mut toggle = false;
        while data.len() < size {
            let answer = self.ask(Request::UploadSegment { toggle });
            let CoeMessage::SdoResponse(Response::UploadSegment(segment)) =
                CoeMessage::parse(&answer).unwrap()
            else {
                panic!("{answer:02X?}");
            };
            assert_eq!(segment.toggle, toggle);
            data.extend_from_slice(segment.data);
            assert_eq!(segment.last, data.len() == size);
            toggle = !toggle;
        }
        Ok(data)
    }

    /// Downloads an entry; the abort code when that fails.
    pub(crate) fn download(&mut self, index: u16, subindex: u8, data: &[u8]) -> Result<(), u32> {
        self.download_any(index, subindex, data, false)
    }

    /// Downloads an entry, or all of them.
    pub(crate) fn download_any(
        &mut self,
        index: u16,
        subindex: u8,
        data: &[u8],
        complete: bool,
    ) -> Result<(), u32> {
        let object = ObjectAddress::new(index, subindex);
        let room = self.room();
        let initial = Initial::of(data, room);
        let mut rest = &data[initial.data().len()..];
        let answer = self.ask(Request::Download { object, complete, initial });
        match CoeMessage::parse(&answer).unwrap() {
            CoeMessage::SdoResponse(Response::Download { object: of, .. }) => {
                assert_eq!(of, object);
            }
            CoeMessage::Abort(abort) => return Err(abort.code),
            other => panic!("{other:?}"),
        }
        let mut toggle = false;
        while !rest.is_empty() {
            let segment = Segment::of(rest, toggle, room);
            rest = &rest[segment.data.len()..];
            let answer = self.ask(Request::DownloadSegment(segment));
            match CoeMessage::parse(&answer).unwrap() {
                CoeMessage::SdoResponse(Response::DownloadSegment { toggle: of }) => {
                    assert_eq!(of, toggle);
                }
                CoeMessage::Abort(abort) => return Err(abort.code),
                other => panic!("{other:?}"),
            }
            toggle = !toggle;
        }
        Ok(())
    }
}
