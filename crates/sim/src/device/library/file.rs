//! The files of a type, for FoE.

use linesman_proto::sii::Protocols;

use super::spec::Spec;
use crate::device::files::{File, Files, FirmwareSlot};

/// The longest firmware file that a terminal takes, in bytes.
const FIRMWARE_LIMIT: usize = 256 * 1_024;
/// The password of what is not for everybody.
const SERVICE_PASSWORD: u32 = 0x0000_4711;

/// Every type that speaks FoE takes new firmware in BOOT. The communication terminal has files of
/// its own beside it: settings that can be read and written, a log, and one behind a password.
pub(super) fn files(spec: &Spec) -> Files {
    if !Protocols(spec.protocols).has(Protocols::FOE) {
        return Files::default();
    }
    let firmware =
        FirmwareSlot { type_name: spec.name.to_owned(), limit: FIRMWARE_LIMIT, password: 0 };
    let files = match spec.name {
        "EL6601" | "EL6614" => vec![
            File::new("settings.txt", b"vlan=off\nport=auto\n", 4_096),
            File::new("log.txt", b"start\n", 0),
            File::new("service.bin", &[0; 32], 1_024).with_password(SERVICE_PASSWORD),
        ],
        _ => Vec::new(),
    };
    Files::new(files, Some(firmware))
}
