//! Images of real devices. They are not part of the project: the tests look for them where
//! `LINESMAN_DATA` points, else beside the project, and say so when they are not there.

use std::path::PathBuf;

use crate::address::{RegisterAddress, StationAlias};
use crate::port::PortMap;
use crate::sii::*;

/// The content of a file of the collection of real data; `None`, and a word about it, when the
/// collection is not there.
#[expect(
    clippy::disallowed_methods,
    clippy::disallowed_macros,
    reason = "a test of real data has to get at them, and must not be silent when it cannot"
)]
pub(crate) fn real_data(path: &str) -> Option<Vec<u8>> {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data");
    let root = PathBuf::from(std::env::var("LINESMAN_DATA").unwrap_or_else(|_| beside.to_owned()));
    if !root.is_dir() {
        eprintln!("SKIPPED: no real data in {} (set LINESMAN_DATA)", root.display());
        return None;
    }
    let file = root.join(path);
    Some(std::fs::read(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display())))
}

/// What a real image says.
struct Known {
    file: &'static str,
    /// Vendor, product, revision, serial number.
    identity: [u32; 4],
    order: &'static str,
    name: &'static str,
    group: &'static str,
    ebus_current_ma: i16,
    ports: [PortKind; 4],
    /// Receive offset and size, send offset and size.
    mailbox: Option<[u16; 4]>,
    protocols: &'static [&'static str],
    /// SyncManager, direction, bits, bytes.
    process_data: &'static [(u8, Direction, u32, u32)],
    /// Bytes of the image up to and including the end marker.
    used: usize,
    /// Bytes that come out differently when it is built again: padding of Strings.
    padding: &'static [usize],
}

const NO_PORTS: [PortKind; 4] = [PortKind::None; 4];
const TWO_E_BUS: [PortKind; 4] = [PortKind::EBus, PortKind::EBus, PortKind::None, PortKind::None];
const TWO_MII: [PortKind; 4] = [PortKind::Mii, PortKind::Mii, PortKind::None, PortKind::None];
const NOTHING_YET: &[(u8, Direction, u32, u32)] =
    &[(2, Direction::Outputs, 0, 0), (3, Direction::Inputs, 0, 0)];

const KNOWN: [Known; 10] = [
    Known {
        file: "ec-EK1100.bin",
        identity: [2, 0x044C_2C52, 0x0012_0000, 0],
        order: "EK1100",
        name: "EK1100 EtherCAT-Koppler (2A E-Bus)",
        group: "SystemBk",
        ebus_current_ma: -2000,
        ports: [PortKind::Mii, PortKind::EBus, PortKind::Mii, PortKind::None],
        mailbox: None,
        protocols: &[],
        process_data: &[],
        used: 0xEE,
        padding: &[],
    },
    Known {
        file: "ec-EL2004.bin",
        identity: [2, 0x07D4_3052, 0x0010_0000, 0],
        order: "EL2004",
        name: "EL2004 4K. Dig. Ausgang 24V, 0.5A",
        group: "DigOut",
        ebus_current_ma: 100,
        ports: TWO_E_BUS,
        mailbox: None,
        protocols: &[],
        process_data: &[(0, Direction::Outputs, 4, 1)],
        used: 0x188,
        padding: &[],
    },
    Known {
        file: "ec-EL2828.bin",
        identity: [2, 0x0B0C_3052, 0x0011_0000, 0],
        order: "EL2828",
        name: "EL2828 8K. Dig. Ausgang 24V, 2A",
        group: "DigOut",
        ebus_current_ma: 110,
        ports: TWO_E_BUS,
        mailbox: None,
        protocols: &[],
        process_data: &[(0, Direction::Outputs, 8, 1)],
        used: 0x23A,
        padding: &[],
    },
    Known {
        file: "dls-NI9144-rev1.bin",
        identity: [0x01F9, 0x23B8, 1, 0],
        order: "NI 9144",
        name: "NI 9144",
        group: "Fixed",
        ebus_current_ma: 0,
        ports: TWO_MII,
        mailbox: Some([0x1F00, 0x100, 0x1C00, 0x300]),
        protocols: &["AoE", "CoE", "FoE"],
        process_data: &[(2, Direction::Outputs, 0, 0), (3, Direction::Inputs, 64, 8)],
        used: 0x19E,
        padding: &[],
    },
    Known {
        file: "kickcat-EasyCAT-arduino-due.bin",
        identity: [0x079A, 0x00DE_FEDE, 0x5A01, 0],
        order: "EasyCAT 32+32 rev 1",
        name: "Generic 32+32 bytes rev 1",
        group: "SSC_Device",
        ebus_current_ma: 0,
        ports: TWO_MII,
        mailbox: None,
        protocols: &[],
        process_data: &[(0, Direction::Outputs, 256, 32), (1, Direction::Inputs, 256, 32)],
        used: 0x450,
        padding: &[],
    },
    Known {
        file: "pairs/kickcat-xmc4800-relax.bin",
        identity: [0x1337, 0x4800, 0, 0],
        order: "xmc48ecatslv",
        name: "xmc48slave",
        group: "xmc48slave_t",
        ebus_current_ma: 0,
        ports: NO_PORTS,
        mailbox: Some([0x1000, 0x200, 0x1200, 0x200]),
        protocols: &["CoE"],
        process_data: NOTHING_YET,
        used: 0xFC,
        padding: &[],
    },
    Known {
        file: "pairs/soes-linux_lan9252demo.bin",
        identity: [0x1337, 0x04D2, 0, 0],
        order: "evb9252_dig",
        name: "lan9252",
        group: "lan9252_spi",
        ebus_current_ma: 0,
        ports: NO_PORTS,
        mailbox: Some([0x1000, 0x80, 0x1080, 0x80]),
        protocols: &["CoE", "FoE"],
        process_data: NOTHING_YET,
        used: 0xF6,
        padding: &[0xA5],
    },
    Known {
        file: "pairs/soes-rtl_slavedemo.bin",
        identity: [0x1337, 0x1278_3456, 1, 0],
        order: "DASA ATO SPI-Slave",
        name: "ATEN-ATO output slave",
        group: "ATENSLAVE",
        ebus_current_ma: 0,
        ports: NO_PORTS,
        mailbox: Some([0x1000, 0x80, 0x1080, 0x80]),
        protocols: &["CoE"],
        process_data: NOTHING_YET,
        used: 0x128,
        padding: &[],
    },
    Known {
        file: "pairs/soes-rtl_xmc4_dynpdo.bin",
        identity: [0x1337, 0x4800, 0, 0],
        order: "xmc48relax",
        name: "xmc48relax",
        group: "xmc4",
        ebus_current_ma: 0,
        ports: NO_PORTS,
        mailbox: Some([0x1000, 0x200, 0x1200, 0x200]),
        protocols: &["CoE"],
        process_data: NOTHING_YET,
        used: 0xE8,
        padding: &[0x95],
    },
    Known {
        file: "pairs/soes-tiesc_am335x.bin",
        identity: [0x1337, 0x9876, 0, 0],
        order: "am335xice",
        name: "slave",
        group: "am335xice_t",
        ebus_current_ma: 0,
        ports: NO_PORTS,
        mailbox: Some([0x1000, 0x200, 0x1200, 0x200]),
        protocols: &["CoE"],
        process_data: NOTHING_YET,
        used: 0xF4,
        padding: &[0xA1],
    },
];

/// Runs a check over all real images that are there.
fn for_each_image(check: impl Fn(&Known, &[u8], Image)) {
    for known in &KNOWN {
        let Some(bytes) = real_data(&format!("sii/{}", known.file)) else { return };
        let image = Image::parse(&bytes).unwrap_or_else(|error| panic!("{}: {error}", known.file));
        check(known, &bytes, image);
    }
}

// proves: HW-04 partial, HC-03 partial
#[test]
fn real_images_say_who_the_device_is() {
    for_each_image(|known, _, image| {
        let file = known.file;
        let [vendor_id, product_code, revision, serial_number] = known.identity;
        let identity = Identity { vendor_id, product_code, revision, serial_number };
        assert_eq!(image.identity, identity, "{file}");
        assert_eq!(image.order(), Some(known.order), "{file}");
        assert_eq!(image.name(), Some(known.name), "{file}");
        assert_eq!(image.group(), Some(known.group), "{file}");
        assert_eq!(image.ebus_current_ma(), Some(known.ebus_current_ma), "{file}");
        assert_eq!(image.general().unwrap().ports, PortMap(known.ports), "{file}");
        assert_eq!(image.configuration.station_alias, StationAlias(0), "{file}");
        assert_eq!(image.checksum, Checksum::Valid, "{file}");
        assert_eq!(image.oddities, [], "{file}");
    });
}

#[test]
fn real_images_say_what_the_device_exchanges() {
    for_each_image(|known, _, image| {
        let file = known.file;
        let mailbox = known.mailbox.map(MailboxPair::from_words);
        assert_eq!(image.mailbox(), mailbox.as_ref(), "{file}");
        assert_eq!(image.protocols.names().collect::<Vec<_>>(), known.protocols, "{file}");
        let process_data: Vec<(u8, Direction, u32, u32)> = image
            .process_data()
            .map(|data| (data.sync_manager, data.direction, data.bits, data.bytes))
            .collect();
        assert_eq!(process_data, known.process_data, "{file}");
    });
}

#[test]
fn real_images_come_out_as_they_went_in() {
    for_each_image(|known, bytes, image| {
        let file = known.file;
        let built = image.build().unwrap();
        assert_eq!(built.len(), bytes.len(), "{file}");
        let pairs = bytes.iter().zip(&built).enumerate();
        let differing: Vec<usize> =
            pairs.filter(|(_, (was, is))| was != is).map(|(at, _)| at).collect();
        assert_eq!(differing, known.padding, "{file}");
        assert_eq!(Image::parse(&built), Ok(image), "{file}");
    });
}

#[test]
fn reading_over_the_wire_takes_the_used_part_only() {
    for_each_image(|known, bytes, image| {
        for chunk in [4, 8] {
            let mut reader = Reader::new();
            let mut commands = 0;
            while let Some(words) = reader.needs() {
                let at = words.start.byte();
                reader.supply(&bytes[at..at + chunk]);
                commands += 1;
            }
            let least = known.used.div_ceil(chunk);
            // The walk may read the word behind the end marker.
            assert!((least..=least + 1).contains(&commands), "{}: {commands}", known.file);
            assert_eq!(reader.finish().as_ref(), Ok(&image), "{}", known.file);
        }
    });
}

#[test]
fn details_of_single_images() {
    for_each_image(|known, _, image| match known.file {
        "ec-EL2004.bin" => {
            assert_eq!(image.fmmu_usages(), [FmmuUsage::Outputs, FmmuUsage::Unused]);
            let [outputs] = image.sync_managers() else { panic!("one SyncManager") };
            assert_eq!(outputs.start, RegisterAddress(0x0F00));
            assert_eq!((outputs.control, outputs.enable.0), (0x44, 0x09));
            assert_eq!(outputs.kind, SyncManagerKind::Outputs);
            let pdos: Vec<u16> = image.pdos(Direction::Outputs).map(|pdo| pdo.index).collect();
            assert_eq!(pdos, [0x1600, 0x1601, 0x1602, 0x1603]);
            assert_eq!(image.pdos(Direction::Inputs).count(), 0);
            let entries = image.pdos(Direction::Outputs).flat_map(|pdo| &pdo.entries);
            let entry = entries.last().unwrap();
            assert_eq!((entry.index, entry.subindex, entry.bits), (0x7030, 1, 1));
            assert_eq!(image.text(entry.name), Some("Output"));
        }
        "ec-EL2828.bin" => {
            // Type 3, device specific: kept as it is, in front of the texts.
            let Some(Category::Raw(raw)) = image.categories.first() else { panic!("type 3") };
            assert_eq!((raw.kind(), raw.data().len()), (CategoryKind::Other(3), 72));
            assert_eq!(&raw.data()[..8], b"1P079107");
        }
        "dls-NI9144-rev1.bin" => {
            let kinds: Vec<u16> = image.categories.iter().map(|it| it.kind().code()).collect();
            assert_eq!(kinds, [10, 30, 40, 41, 42, 50, 60]);
            let modes: Vec<(Option<&str>, u16)> = image
                .op_modes()
                .map(|mode| (image.text(mode.name), mode.assign_activate))
                .collect();
            assert_eq!(modes, [(Some("DcOff"), 0), (Some("DcSync"), 0x0300)]);
            assert!(image.general().unwrap().coe.complete_access());
            let boot = image.bootstrap_mailbox.to_words();
            assert_eq!(boot, [0x1C00, 0x400, 0x1800, 0x400]);
        }
        _ => {}
    });
}
