//! The files of a device that FoE reads and writes, its firmware among them.
//!
//! Read first: ETG.1000.6, FoE. What a file may be used for, and where, is the device's own affair.
//!
//! A firmware file of a virtual device begins with one line of text, `Linesman firmware TYPE VERSION
//! CRC`, where CRC is the checksum (CRC-32 as of IEEE 802.3, eight hexadecimal digits) of all that
//! follows the line; what that is does not matter. The device keeps it beside the firmware that runs
//! and starts with it the next time, as real ones do; from then on object 0x100A tells VERSION.

mod firmware_image;

use linesman_proto::mailbox::foe::FoeErrorCode;
use linesman_proto::state::AlState;

pub use firmware_image::FirmwareImage;

/// Where a file can be accessed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Where {
    /// In BOOT only.
    Boot,
    /// In every state with a mailbox but BOOT.
    NotBoot,
}

/// A file.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct File {
    /// Its name, with extension; case counts.
    pub name: String,
    /// What is in it; `None` when it was never written.
    pub data: Option<Vec<u8>>,
    /// The longest that it can be, in bytes; 0 when it cannot be written.
    pub limit: usize,
    /// What a MainDevice has to say; 0 for nothing.
    pub password: u32,
    /// Where it can be accessed.
    pub accessible: Where,
}

impl File {
    /// A file that can be read and, up to `limit` bytes, written.
    #[must_use]
    pub fn new(name: &str, data: &[u8], limit: usize) -> Self {
        Self {
            name: name.to_owned(),
            data: Some(data.to_vec()),
            limit,
            password: 0,
            accessible: Where::NotBoot,
        }
    }

    /// The same behind a password.
    #[must_use]
    pub fn with_password(self, password: u32) -> Self {
        Self { password, ..self }
    }
}

/// The place of the firmware.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FirmwareSlot {
    /// The type that its files must be for.
    pub type_name: String,
    /// The longest file, in bytes.
    pub limit: usize,
    /// What a MainDevice has to say; 0 for nothing.
    pub password: u32,
}

/// Names of firmware files end with this, in any case.
const FIRMWARE_EXTENSION: &str = ".efw";

/// What the device keeps of a firmware update.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
enum Update {
    /// There was none.
    #[default]
    None,
    /// One began and did not come to its end.
    Broken,
    /// It waits for the next start: its version.
    Ready(String),
}

/// What becomes of a write.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Target {
    place: FilePlace,
    /// The longest file that it takes, in bytes.
    pub limit: usize,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug)]
enum FilePlace {
    File(usize),
    Firmware,
}

impl Target {
    /// Whether the flash memory has to be erased first.
    #[must_use]
    pub fn is_firmware(&self) -> bool {
        self.place == FilePlace::Firmware
    }
}

/// All files of a device.
#[derive(Clone, PartialEq, Eq, Default, Debug)]
pub struct Files {
    files: Vec<File>,
    firmware: Option<FirmwareSlot>,
    update: Update,
}

impl Files {
    /// These files, and a place for firmware if it can be updated.
    #[must_use]
    pub fn new(files: Vec<File>, firmware: Option<FirmwareSlot>) -> Self {
        Self { files, firmware, update: Update::None }
    }

    /// Whether there is nothing that FoE could be about.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.files.is_empty() && self.firmware.is_none()
    }

    /// A file for reading.
    ///
    /// # Errors
    /// The FoE error: no such name, not in this state, wrong password, never written.
    pub fn read(&self, name: &[u8], password: u32, state: AlState) -> Result<&[u8], FoeErrorCode> {
        if self.firmware.is_some() && is_firmware_name(name) {
            return Err(FoeErrorCode::ACCESS_DENIED);
        }
        let file = &self.files[self.find(name)?];
        may(file.accessible, file.password, password, state)?;
        file.data.as_deref().ok_or(FoeErrorCode::NO_FILE)
    }

    /// A file for writing.
    ///
    /// # Errors
    /// The FoE error: no such name, not in this state, wrong password, cannot be written.
    pub fn begin_write(
        &mut self,
        name: &[u8],
        password: u32,
        state: AlState,
    ) -> Result<Target, FoeErrorCode> {
        if let Some(slot) = self.firmware.as_ref().filter(|_| is_firmware_name(name)) {
            may(Where::Boot, slot.password, password, state)?;
            self.update = Update::Broken;
            return Ok(Target { place: FilePlace::Firmware, limit: slot.limit });
        }
        let at = self.find(name)?;
        let file = &self.files[at];
        may(file.accessible, file.password, password, state)?;
        if file.limit == 0 {
            return Err(FoeErrorCode::ACCESS_DENIED);
        }
        Ok(Target { place: FilePlace::File(at), limit: file.limit })
    }

    /// The whole file has come.
    ///
    /// # Errors
    /// The FoE error: what has come is no firmware for this device, or damaged.
    pub fn finish_write(&mut self, target: Target, data: Vec<u8>) -> Result<(), FoeErrorCode> {
        match target.place {
            FilePlace::File(at) => {
                if let Some(file) = self.files.get_mut(at) {
                    file.data = Some(data);
                }
            }
            FilePlace::Firmware => {
                let image = FirmwareImage::parse(&data)?;
                let slot = self.firmware.as_ref();
                if slot.is_none_or(|slot| !slot.type_name.eq_ignore_ascii_case(image.type_name)) {
                    return Err(FoeErrorCode::WRONG_FIRMWARE);
                }
                self.update = Update::Ready(image.version.to_owned());
            }
        }
        Ok(())
    }

    /// Whether a firmware update began and did not come to its end; it is forgotten then.
    pub fn take_broken_update(&mut self) -> bool {
        let broken = self.update == Update::Broken;
        if broken {
            self.update = Update::None;
        }
        broken
    }

    /// Whether new firmware waits for the next start.
    #[must_use]
    pub fn has_new_firmware(&self) -> bool {
        matches!(self.update, Update::Ready(_))
    }

    /// The device starts: the version of new firmware, if some waits.
    pub fn start_new_firmware(&mut self) -> Option<String> {
        match std::mem::take(&mut self.update) {
            Update::Ready(version) => Some(version),
            Update::None | Update::Broken => None,
        }
    }

    fn find(&self, name: &[u8]) -> Result<usize, FoeErrorCode> {
        // Some MainDevices count the end of a C string among the letters of the name.
        let name = name.split(|letter| *letter == 0).next().unwrap_or_default();
        let found = self.files.iter().position(|file| file.name.as_bytes() == name);
        found.ok_or(FoeErrorCode::NOT_FOUND)
    }
}

fn is_firmware_name(name: &[u8]) -> bool {
    let name = name.split(|letter| *letter == 0).next().unwrap_or_default();
    let extension = FIRMWARE_EXTENSION.as_bytes();
    let end = name.len().checked_sub(extension.len()).map(|at| &name[at..]);
    end.is_some_and(|end| end.eq_ignore_ascii_case(extension))
}

/// Whether a file may be accessed in this state with this password.
fn may(accessible: Where, password: u32, given: u32, state: AlState) -> Result<(), FoeErrorCode> {
    match (accessible, state == AlState::Boot) {
        (Where::Boot, false) => Err(FoeErrorCode::BOOTSTRAP_ONLY),
        (Where::NotBoot, true) => Err(FoeErrorCode::NOT_IN_BOOTSTRAP),
        (Where::Boot, true) | (Where::NotBoot, false) => {
            if password == 0 || password == given {
                Ok(())
            } else {
                Err(FoeErrorCode::NO_RIGHTS)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files() -> Files {
        let slot = FirmwareSlot { type_name: "EL6601".to_owned(), limit: 1_000, password: 0xBEEF };
        let files = vec![
            File::new("settings.txt", b"a=1\n", 64),
            File::new("log.txt", b"", 0),
            File::new("secret.bin", &[1], 8).with_password(7),
            File { data: None, ..File::new("empty.bin", &[], 8) },
        ];
        Files::new(files, Some(slot))
    }

    #[test]
    fn files_are_readable_by_password_and_state() {
        use AlState::{Boot, PreOp};
        type Case<'a> = (&'a str, u32, AlState, Result<&'a [u8], u32>);
        let table: [Case<'_>; 9] = [
            ("settings.txt", 0, PreOp, Ok(b"a=1\n")),
            ("settings.txt\0", 9, PreOp, Ok(b"a=1\n")),
            ("settings.txt", 0, Boot, Err(0x8009)),
            ("Settings.txt", 0, PreOp, Err(0x8001)),
            ("settings", 0, PreOp, Err(0x8001)),
            ("secret.bin", 6, PreOp, Err(0x800A)),
            ("secret.bin", 7, PreOp, Ok(&[1])),
            ("empty.bin", 0, PreOp, Err(0x800F)),
            ("x.EFW", 0xBEEF, Boot, Err(0x8002)),
        ];
        for (name, password, state, expected) in table {
            let read = files().read(name.as_bytes(), password, state).map(<[u8]>::to_vec);
            let expected = expected.map(<[u8]>::to_vec).map_err(FoeErrorCode);
            assert_eq!(read, expected, "{name:?} {password} {state}");
        }
    }

    #[test]
    fn files_are_writable_by_password_and_state() {
        use AlState::{Boot, Op, PreOp};
        let table: [(&str, u32, AlState, Result<usize, u32>); 7] = [
            ("settings.txt", 0, Op, Ok(64)),
            ("log.txt", 0, Op, Err(0x8002)),
            ("new.txt", 0, Op, Err(0x8001)),
            ("secret.bin", 0, PreOp, Err(0x800A)),
            ("a.efw", 0xBEEF, PreOp, Err(0x8008)),
            ("a.efw", 0, Boot, Err(0x800A)),
            ("a.efw", 0xBEEF, Boot, Ok(1_000)),
        ];
        for (name, password, state, expected) in table {
            let target = files().begin_write(name.as_bytes(), password, state);
            let limit = target.map(|target| target.limit);
            assert_eq!(limit, expected.map_err(FoeErrorCode), "{name} {password} {state}");
        }
    }

    #[test]
    fn new_firmware_waits_for_the_next_start() {
        let mut files = files();
        let target = files.begin_write(b"a.efw", 0xBEEF, AlState::Boot).unwrap();
        let image = FirmwareImage::build("el6601", "02", &[7; 100]);
        files.finish_write(target, image).unwrap();
        assert!(!files.take_broken_update());
        assert_eq!(files.start_new_firmware().as_deref(), Some("02"));
        assert_eq!(files.start_new_firmware(), None);
    }

    #[test]
    fn what_is_no_firmware_for_it_is_refused_and_leaves_a_broken_update() {
        let good = FirmwareImage::build("EL6601", "02", &[7; 100]);
        let mut damaged = good.clone();
        *damaged.last_mut().unwrap() ^= 1;
        for (data, code) in [
            (FirmwareImage::build("EL3104", "02", &[]), 0x800D),
            (damaged, 0x800C),
            (b"anything".to_vec(), 0x800B),
        ] {
            let mut files = files();
            let target = files.begin_write(b"a.efw", 0xBEEF, AlState::Boot).unwrap();
            assert_eq!(files.finish_write(target, data), Err(FoeErrorCode(code)));
            assert_eq!(files.start_new_firmware(), None);
            let target = files.begin_write(b"a.efw", 0xBEEF, AlState::Boot).unwrap();
            assert!(target.is_firmware() && files.take_broken_update());
            assert!(!files.take_broken_update());
        }
    }
}
