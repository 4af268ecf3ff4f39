//! The FoE server: reads and writes the files of the device.
//!
//! Read first: ETG.1000.6, FoE. One transfer is under way at a time; a new request ends it. Whoever
//! sends data waits for the acknowledgement of each packet; a packet shorter than the mailbox allows
//! is the last, be it empty.

use linesman_proto::mailbox::ErrorReplyCode;
use linesman_proto::mailbox::foe::{FOE_HEADER_LEN, FoeError, FoeErrorCode, Message, chunk_len};
use linesman_proto::mailbox::header::HEADER_LEN;
use linesman_proto::state::AlState;
use linesman_proto::time::{Instant, Span};

use super::Answers;
use crate::device::files::{Files, Target};

/// How long it takes to erase the flash memory before new firmware can be written.
const ERASE: Span = Span::ms(80);
/// What it does meanwhile, for people.
const ERASING: &[u8] = b"erasing flash";

/// How long messages can be, in bytes of their SyncManagers.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct MessageLimits {
    pub(super) requests: usize,
    pub(super) answers: usize,
}

/// The server.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub(super) struct FoeServer {
    transfer: Option<FoeTransfer>,
}

#[derive(Clone, PartialEq, Eq, Debug)]
enum FoeTransfer {
    /// The MainDevice reads: packet `packet` is out, from byte `at` on, and waits for its
    /// acknowledgement.
    Read { data: Vec<u8>, packet: u32, at: usize },
    /// The MainDevice writes: packet `next` is to come.
    Write { target: Target, data: Vec<u8>, next: u32, began: Instant },
}

impl FoeServer {
    /// Answers a message.
    pub(super) fn answer(
        &mut self,
        request: &[u8],
        files: &mut Files,
        state: AlState,
        now: Instant,
        limits: MessageLimits,
    ) -> Result<Answers, ErrorReplyCode> {
        let message = match Message::parse(request) {
            Ok(message) => message,
            Err(FoeError::CutOff { .. }) => return Err(ErrorReplyCode::SizeTooShort),
            Err(FoeError::UnknownOpcode { .. }) => {
                self.transfer = None;
                return Ok(refuse(FoeErrorCode::ILLEGAL, "unknown opcode", limits));
            }
        };
        Ok(match message {
            Message::Read { password, name } => {
                self.transfer = None;
                match files.read(name, password, state) {
                    Ok(data) => self.send(data.to_vec(), 1, 0, limits),
                    Err(code) => refuse(code, code.text(), limits),
                }
            }
            Message::Write { password, name } => {
                self.transfer = None;
                match files.begin_write(name, password, state) {
                    Ok(target) => {
                        let data = Vec::new();
                        self.transfer =
                            Some(FoeTransfer::Write { target, data, next: 1, began: now });
                        vec![write(&Message::Ack { packet: 0 }, limits)]
                    }
                    Err(code) => refuse(code, code.text(), limits),
                }
            }
            Message::Data { packet, data } => self.take(packet, data, files, now, limits),
            Message::Ack { packet } => self.go_on(packet, limits),
            // The MainDevice has no time for the packet: it gets it again.
            Message::Busy { .. } => match self.transfer.take() {
                Some(FoeTransfer::Read { data, packet, at }) => self.send(data, packet, at, limits),
                other => {
                    self.transfer = other;
                    Vec::new()
                }
            },
            Message::Error { .. } => {
                self.transfer = None;
                Vec::new()
            }
        })
    }

    /// Sends a packet of a file.
    fn send(&mut self, data: Vec<u8>, packet: u32, at: usize, limits: MessageLimits) -> Answers {
        let rest = data.get(at..).unwrap_or_default();
        let chunk = rest.get(..chunk_len(limits.answers)).unwrap_or(rest);
        let answer = write(&Message::Data { packet, data: chunk }, limits);
        self.transfer = Some(FoeTransfer::Read { data, packet, at });
        vec![answer]
    }

    /// A packet has been acknowledged: the next, if there is one.
    fn go_on(&mut self, acknowledged: u32, limits: MessageLimits) -> Answers {
        let Some(FoeTransfer::Read { data, packet, at }) = self.transfer.take() else {
            self.transfer = None;
            return refuse(FoeErrorCode::ILLEGAL, "nothing is being read", limits);
        };
        if acknowledged != packet {
            return refuse(FoeErrorCode::WRONG_PACKET, "", limits);
        }
        let chunk = chunk_len(limits.answers);
        let next = at + chunk;
        if chunk == 0 || next > data.len() {
            return Vec::new();
        }
        self.send(data, packet.wrapping_add(1), next, limits)
    }

    /// Takes a packet of a file.
    fn take(
        &mut self,
        packet: u32,
        new: &[u8],
        files: &mut Files,
        now: Instant,
        limits: MessageLimits,
    ) -> Answers {
        let Some(FoeTransfer::Write { target, mut data, next, began }) = self.transfer.take()
        else {
            return refuse(FoeErrorCode::ILLEGAL, "nothing is being written", limits);
        };
        if packet != next {
            return refuse(FoeErrorCode::WRONG_PACKET, "", limits);
        }
        let elapsed = now.since(began);
        if target.is_firmware() && elapsed < ERASE {
            let done = (elapsed.as_nanos() * 100 / ERASE.as_nanos()) as u16;
            self.transfer = Some(FoeTransfer::Write { target, data, next, began });
            return vec![write(&Message::Busy { done, total: 100, text: ERASING }, limits)];
        }
        data.extend_from_slice(new);
        if data.len() > target.limit {
            let text = format!("no more than {} bytes", target.limit);
            return refuse(FoeErrorCode::DISK_FULL, &text, limits);
        }
        if new.len() < chunk_len(limits.requests) {
            if let Err(code) = files.finish_write(target, data) {
                return refuse(code, code.text(), limits);
            }
        } else {
            let next = next.wrapping_add(1);
            self.transfer = Some(FoeTransfer::Write { target, data, next, began });
        }
        vec![write(&Message::Ack { packet }, limits)]
    }
}

/// The end of a transfer.
fn refuse(code: FoeErrorCode, text: &str, limits: MessageLimits) -> Answers {
    vec![write(&Message::Error { code, text: text.as_bytes() }, limits)]
}

/// A message as bytes; a text that is too long for the mailbox is cut.
fn write(message: &Message<'_>, limits: MessageLimits) -> Vec<u8> {
    let room = chunk_len(limits.answers);
    let cut = |text| <[u8]>::get(text, ..room).unwrap_or(text);
    let message = match *message {
        Message::Error { code, text } => Message::Error { code, text: cut(text) },
        Message::Busy { done, total, text } => Message::Busy { done, total, text: cut(text) },
        other @ (Message::Read { .. }
        | Message::Write { .. }
        | Message::Data { .. }
        | Message::Ack { .. }) => other,
    };
    let mut bytes = vec![0; limits.answers.saturating_sub(HEADER_LEN).max(FOE_HEADER_LEN)];
    let len = message.write(&mut bytes).unwrap_or(0);
    bytes.truncate(len);
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::files::{File, FirmwareImage, FirmwareSlot};

    /// A mailbox of 20 bytes each way: 8 bytes of a file in a packet.
    const LIMITS: MessageLimits = MessageLimits { requests: 20, answers: 20 };

    struct Rig {
        server: FoeServer,
        files: Files,
        state: AlState,
        now: Instant,
    }

    impl Rig {
        fn new() -> Self {
            let slot = FirmwareSlot { type_name: "T".to_owned(), limit: 60, password: 0x1234 };
            let files = vec![
                File::new("eight", b"12345678", 0),
                File::new("nine", b"123456789", 16),
                File::new("none", b"", 0),
            ];
            Self {
                server: FoeServer::default(),
                files: Files::new(files, Some(slot)),
                state: AlState::PreOp,
                now: Instant::ZERO,
            }
        }

        fn ask(&mut self, request: &[u8]) -> Vec<u8> {
            let answers =
                self.server.answer(request, &mut self.files, self.state, self.now, LIMITS).unwrap();
            assert!(answers.len() <= 1);
            answers.concat()
        }
    }

    #[test]
    fn reading_is_this_dialogue() {
        // request, answer
        let table: [(&[u8], &[u8]); 9] = [
            (b"\x01\0\0\0\0\0eight", b"\x03\0\x01\0\0\x0012345678"),
            // All is there, but only an empty packet says so.
            (b"\x04\0\x01\0\0\0", b"\x03\0\x02\0\0\0"),
            (b"\x04\0\x02\0\0\0", b""),
            (b"\x01\0\0\0\0\0nine", b"\x03\0\x01\0\0\x0012345678"),
            // Busy: again. Then the rest, and nothing behind it.
            (b"\x06\0\0\0\0\0", b"\x03\0\x01\0\0\x0012345678"),
            (b"\x04\0\x01\0\0\0", b"\x03\0\x02\0\0\x009"),
            (b"\x04\0\x02\0\0\0", b""),
            (b"\x01\0\0\0\0\0none", b"\x03\0\x01\0\0\0"),
            (b"\x04\0\x01\0\0\0", b""),
        ];
        let mut rig = Rig::new();
        for (request, answer) in table {
            assert_eq!(rig.ask(request), answer, "{request:?}");
        }
    }

    #[test]
    fn writing_is_this_dialogue() {
        let mut rig = Rig::new();
        assert_eq!(rig.ask(b"\x02\0\0\0\0\0nine"), b"\x04\0\0\0\0\0");
        assert_eq!(rig.ask(b"\x03\0\x01\0\0\0abcdefgh"), b"\x04\0\x01\0\0\0");
        assert_eq!(rig.ask(b"\x03\0\x02\0\0\0ij"), b"\x04\0\x02\0\0\0");
        assert_eq!(rig.files.read(b"nine", 0, AlState::PreOp), Ok(&b"abcdefghij"[..]));
        // Exactly two packets need an empty third.
        assert_eq!(rig.ask(b"\x02\0\0\0\0\0nine"), b"\x04\0\0\0\0\0");
        for packet in 1..=2 {
            rig.ask(&[3, 0, packet, 0, 0, 0, b'x', b'x', b'x', b'x', b'x', b'x', b'x', b'x']);
        }
        assert_eq!(rig.files.read(b"nine", 0, AlState::PreOp).unwrap().len(), 10, "not yet");
        assert_eq!(rig.ask(b"\x03\0\x03\0\0\0"), b"\x04\0\x03\0\0\0");
        assert_eq!(rig.files.read(b"nine", 0, AlState::PreOp).unwrap().len(), 16);
    }

    #[test]
    fn what_goes_wrong_has_its_code_and_ends_the_transfer() {
        // what comes before, the request, the code
        let begin: &[u8] = b"\x02\0\0\0\0\0nine";
        let read: &[u8] = b"\x01\0\0\0\0\0nine";
        let full: &[u8] = b"\x03\0\x01\0\0\0abcdefgh";
        type Case<'a> = (&'a [&'a [u8]], &'a [u8], u16);
        let table: [Case<'_>; 9] = [
            (&[], b"\x01\0\0\0\0\0nowhere", 0x8001),
            (&[], b"\x02\0\0\0\0\0eight", 0x8002),
            (&[], b"\x02\0\0\0\0\0a.efw", 0x8008),
            (&[], b"\x03\0\x01\0\0\0abc", 0x8004),
            (&[], b"\x04\0\x01\0\0\0", 0x8004),
            (&[], b"\x07\0\0\0\0\0", 0x8004),
            (&[begin], b"\x03\0\x02\0\0\0abc", 0x8005),
            (&[read], b"\x04\0\x02\0\0\0", 0x8005),
            (&[begin, full, b"\x03\0\x02\0\0\0abcdefgh"], b"\x03\0\x03\0\0\0a", 0x8003),
        ];
        for (before, request, code) in table {
            let mut rig = Rig::new();
            for request in before {
                assert_ne!(rig.ask(request)[0], 5, "{request:?}");
            }
            let answer = rig.ask(request);
            assert_eq!(answer[..6], [5, 0, code as u8, (code >> 8) as u8, 0, 0], "{request:?}");
            assert!(answer.len() <= 14, "the text fits");
            assert_eq!(rig.ask(b"\x04\0\x01\0\0\0")[2], 4, "nothing is under way");
        }
        let mut rig = Rig::new();
        let short = rig.server.answer(&[1, 0, 0], &mut rig.files, rig.state, rig.now, LIMITS);
        assert_eq!(short, Err(ErrorReplyCode::SizeTooShort));
    }

    #[test]
    fn firmware_waits_until_the_flash_is_erased() {
        let mut rig = Rig::new();
        rig.state = AlState::Boot;
        let image = FirmwareImage::build("T", "2", b"code");
        assert_eq!(rig.ask(b"\x02\0\0\0\0\0T.efw")[..4], [5, 0, 0x0A, 0x80], "password");
        assert_eq!(rig.ask(b"\x02\0\x34\x12\0\0T.efw"), b"\x04\0\0\0\0\0");
        let first = [b"\x03\0\x01\0\0\0", &image[..8]].concat();
        rig.now += Span::ms(20);
        assert_eq!(rig.ask(&first), b"\x06\0\x19\0\x64\0erasing ");
        assert_eq!(rig.ask(&first)[0], 6);
        rig.now += Span::ms(60);
        for (packet, chunk) in (1..).zip(image.chunks(8)) {
            let data = [&[3, 0, packet, 0, 0, 0], chunk].concat();
            assert_eq!(rig.ask(&data), [4, 0, packet, 0, 0, 0]);
        }
        assert_eq!(rig.files.start_new_firmware().as_deref(), Some("2"));
    }
}
