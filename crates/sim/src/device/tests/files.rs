//! FoE through the mailbox of a device: files, BOOT, firmware.

use linesman_proto::mailbox::foe::{FoeErrorCode, Message as FoeMessage, chunk_len};
use linesman_proto::mailbox::{ErrorReply, Header, MailboxType, Message};
use linesman_proto::time::Span;

use super::Device;
use crate::device::files::FirmwareImage;

/// A MainDevice that reads and writes files.
impl Device {
    /// Takes it from INIT to BOOT with the mailbox that its SII describes for that.
    fn enter_boot(&mut self) {
        let words = &self.built.sii[0x28..0x30];
        let word = |at: usize| u16::from_le_bytes([words[2 * at], words[2 * at + 1]]);
        let mut mailbox = self.profile.mailbox.unwrap();
        (mailbox.areas.receive.offset.0, mailbox.areas.receive.size) = (word(0), word(1));
        (mailbox.areas.send.offset.0, mailbox.areas.send.size) = (word(2), word(3));
        self.profile.mailbox = Some(mailbox);
        self.set_up_mailbox();
        assert_eq!(self.request(3), (3, 0));
    }

    fn tell(&mut self, message: &FoeMessage<'_>) {
        self.counter = self.counter.next();
        let mut buffer = [0; 1_024];
        let header = Header::new(MailboxType::Foe, self.counter, 0);
        let len = header.write_message(&mut buffer, |body| message.write(body)).unwrap();
        assert!(self.post(&buffer[..len]), "mailbox full");
    }

    /// The next FoE message, or the code of an error reply of the mailbox.
    fn hear(&mut self) -> Result<Vec<u8>, u16> {
        let answer = self.fetch_soon().expect("no answer");
        let message = Message::parse(&answer).unwrap();
        match message.header.kind {
            MailboxType::Foe => Ok(message.data.to_vec()),
            MailboxType::Error => Err(ErrorReply::parse(message.data).unwrap().code.code()),
            other => panic!("{other}"),
        }
    }

    fn read_file(&mut self, name: &str, password: u32) -> Result<Vec<u8>, FoeErrorCode> {
        self.tell(&FoeMessage::Read { password, name: name.as_bytes() });
        let chunk = chunk_len(usize::from(self.profile.mailbox.unwrap().areas.send.size));
        let mut file = Vec::new();
        for no in 1.. {
            let answer = self.hear().unwrap();
            match FoeMessage::parse(&answer).unwrap() {
                FoeMessage::Data { packet, data } => {
                    assert_eq!(packet, no);
                    file.extend_from_slice(data);
                    self.tell(&FoeMessage::Ack { packet });
                    if data.len() < chunk {
                        self.bench.wait(Span::ms(2));
                        return Ok(file);
                    }
                }
                FoeMessage::Error { code, .. } => return Err(code),
                other => panic!("{other:?}"),
            }
        }
        unreachable!()
    }

    /// Writes a file; gives how often the device was busy.
    fn write_file(
        &mut self,
        name: &str,
        password: u32,
        file: &[u8],
    ) -> Result<usize, FoeErrorCode> {
        self.tell(&FoeMessage::Write { password, name: name.as_bytes() });
        let chunk = chunk_len(usize::from(self.profile.mailbox.unwrap().areas.receive.size));
        let (mut sent, mut at, mut busy) = (0, 0, 0);
        loop {
            let answer = self.hear().unwrap();
            match FoeMessage::parse(&answer).unwrap() {
                FoeMessage::Ack { packet } => {
                    assert_eq!(packet, sent);
                    if sent > 0 {
                        let len = chunk.min(file.len() - at);
                        at += len;
                        if len < chunk {
                            return Ok(busy);
                        }
                    }
                    sent += 1;
                }
                FoeMessage::Busy { done, total, .. } => {
                    assert!(done <= total);
                    busy += 1;
                    self.bench.wait(Span::ms(10));
                }
                FoeMessage::Error { code, .. } => return Err(code),
                other => panic!("{other:?}"),
            }
            let data = &file[at..file.len().min(at + chunk)];
            self.tell(&FoeMessage::Data { packet: sent, data });
        }
    }

    fn version(&mut self) -> Vec<u8> {
        self.upload(0x100A, 0).unwrap()
    }
}

// proves: SW-11 partial: one virtual device; its errors by name, password, size and state
#[test]
fn files_are_read_and_written_in_preop() {
    let mut device = Device::of("EL6601");
    device.enter_preop();
    assert_eq!(device.read_file("settings.txt", 0).unwrap(), b"vlan=off\nport=auto\n");
    // Shorter than a packet, exactly one, and several.
    for len in [0, 1, 1_011, 1_012, 1_013, 4_096] {
        let file: Vec<u8> = (0..len).map(|at| at as u8).collect();
        assert_eq!(device.write_file("settings.txt", 0, &file), Ok(0), "{len}");
        assert_eq!(device.read_file("settings.txt", 0).unwrap(), file, "{len}");
    }
    // name, password, length; code
    let table = [
        ("settings", 0, 1, FoeErrorCode::NOT_FOUND),
        ("settings.txt", 0, 4_097, FoeErrorCode::DISK_FULL),
        ("log.txt", 0, 1, FoeErrorCode::ACCESS_DENIED),
        ("service.bin", 1, 1, FoeErrorCode::NO_RIGHTS),
        ("EL6601.efw", 0, 1, FoeErrorCode::BOOTSTRAP_ONLY),
    ];
    for (name, password, len, code) in table {
        assert_eq!(device.write_file(name, password, &vec![0; len]), Err(code), "{name}");
    }
    assert_eq!(device.read_file("service.bin", 0x4711).unwrap(), [0; 32]);
    assert_eq!(device.read_file("nothing.txt", 0), Err(FoeErrorCode::NOT_FOUND));
    assert_eq!(device.status(), (2, 0), "errors of files are no errors of states");
}

#[test]
fn new_firmware_takes_effect_after_boot() {
    let mut device = Device::of("EL3104");
    device.enter_boot();
    let image = FirmwareImage::build("EL3104", "77", &[0xA5; 5_000]);
    let busy = device.write_file("EL3104_77.efw", 0, &image).unwrap();
    assert!(busy > 2, "the flash is erased first");
    assert_eq!(device.write_file("settings.txt", 0, b"x"), Err(FoeErrorCode::NOT_FOUND));
    device.bench.write(0x0120, &[1, 0]);
    device.bench.wait(Span::ms(300));
    assert_eq!(device.status(), (3, 0), "it starts anew, and that takes its time");
    device.bench.wait(Span::ms(200));
    assert_eq!(device.status(), (1, 0));
    let mut again = restarted(device);
    assert_eq!(again.version(), b"77");
    // It stays, whatever happens to the supply.
    let now = again.bench.now;
    again.bench.controller.power_off(now);
    again.bench.wait(Span::ms(1));
    let now = again.bench.now;
    again.bench.controller.power_on(now);
    again.bench.wait(Span::ms(200));
    again.enter_preop();
    assert_eq!(again.version(), b"77");
}

#[test]
fn an_update_that_broke_off_leaves_the_old_firmware() {
    let mut device = Device::of("EL3104");
    device.enter_boot();
    let other = FirmwareImage::build("EL3102", "77", &[0xA5; 500]);
    let wrong = device.write_file("a.efw", 0, &other);
    assert_eq!(wrong, Err(FoeErrorCode::WRONG_FIRMWARE));
    assert_eq!(device.request(1), (0x11, 0x0007));
    assert_eq!(device.request(0x11), (1, 0));
    let mut again = restarted(device);
    assert_ne!(again.version(), b"77");
}

#[test]
fn in_boot_a_mailbox_that_does_not_fit_is_refused() {
    let mut device = Device::of("EL3104");
    device.guard(0, 0x1000, 0x21, linesman_proto::register::SmControl::MAILBOX_OUT);
    device.guard(1, 0x10F4, 244, linesman_proto::register::SmControl::MAILBOX_IN);
    assert_eq!(device.request(3), (0x11, 0x0015));
}

/// Goes to PREOP with the mailbox of its profile.
fn restarted(mut device: Device) -> Device {
    for manager in 0..2 {
        device.bench.write(0x0806 + 8 * manager, &[0]);
    }
    let image = linesman_proto::sii::Image::parse(&device.built.sii).unwrap();
    device.profile = linesman_config::profile::DeviceProfile::from_sii(&image);
    device.enter_preop();
    device
}
