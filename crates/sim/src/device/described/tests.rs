use linesman_proto::address::RegisterAddress;
use linesman_proto::sii::{
    Category, CoeDetails, Configuration, General, Image, MailboxArea, MailboxPair, Pdo, PdoEntry,
    Protocols, Strings, SyncManager, SyncManagerEnable, SyncManagerKind,
};

use super::*;

fn sync_manager(start: u16, length: u16, control: u8, kind: SyncManagerKind) -> SyncManager {
    SyncManager {
        start: RegisterAddress(start),
        length,
        control,
        status: 0,
        enable: SyncManagerEnable(1),
        kind,
    }
}

fn entry(index: u16, subindex: u8, bits: u8) -> PdoEntry {
    PdoEntry { index, subindex, bits, ..PdoEntry::default() }
}

fn pdo(index: u16, sync_manager: u8, entries: Vec<PdoEntry>) -> Pdo {
    Pdo { index, sync_manager: Some(sync_manager), entries, ..Pdo::default() }
}

/// A device with mailbox: 24 bits of outputs, 64 and 12 bits of inputs.
fn with_mailbox() -> Image {
    let mut strings = Strings::new();
    let order = strings.intern("PUMP-3").unwrap();
    let area = |offset, size| MailboxArea { offset: RegisterAddress(offset), size };
    Image {
        configuration: Configuration { pdi_control: 0x05, ..Configuration::default() },
        standard_mailbox: MailboxPair { receive: area(0x1000, 128), send: area(0x1080, 128) },
        protocols: Protocols(Protocols::COE),
        categories: vec![
            Category::Strings(strings),
            Category::General(Box::new(General {
                order,
                coe: CoeDetails(0x07),
                ..General::default()
            })),
            Category::SyncManagers(vec![
                sync_manager(0x1000, 128, 0x26, SyncManagerKind::MailboxOut),
                sync_manager(0x1080, 128, 0x22, SyncManagerKind::MailboxIn),
                sync_manager(0x1100, 3, 0x64, SyncManagerKind::Outputs),
                sync_manager(0x1180, 10, 0x20, SyncManagerKind::Inputs),
            ]),
            Category::RxPdos(vec![pdo(0x1600, 2, vec![entry(0x7000, 1, 16), entry(0x7000, 2, 8)])]),
            Category::TxPdos(vec![pdo(
                0x1A00,
                3,
                vec![entry(0x6000, 1, 64), entry(0, 0, 4), entry(0x6041, 0, 12)],
            )]),
        ],
        ..Image::default()
    }
}

#[test]
fn an_image_becomes_a_device_with_signals_and_objects() {
    let described = DescribedType::from_sii(&with_mailbox().build().unwrap()).unwrap();
    assert_eq!((described.name.as_str(), described.channels()), ("PUMP-3", (2, 3)));
    assert_eq!(described.ports().0[..2], [PortKind::Mii, PortKind::Mii]);
    let dictionary = objects::dictionary(&described, described.identity());
    let value = |index, subindex| {
        dictionary.number_at(linesman_proto::mailbox::coe::ObjectAddress::new(index, subindex))
    };
    assert_eq!(value(0x1000, 0), 0x0002_0192, "it maps a status word");
    assert_eq!([value(0x1C12, 0), value(0x1C12, 1)], [1, 0x1600]);
    assert_eq!([value(0x1A00, 0), value(0x1A00, 2), value(0x1A00, 3)], [3, 4, 0x6041_000C]);
    assert_eq!([value(0x1C00, 1), value(0x1C00, 4)], [1, 4]);
    let mut signals = Signals::default();
    let built = described.build(None, 77, &mut signals);
    assert_eq!((built.outputs.len(), built.inputs.len(), signals.len()), (2, 3, 5));
    let image = Image::parse(&built.sii).unwrap();
    assert_eq!(image.identity.serial_number, 77);
    assert!(image.oddities.is_empty(), "{:?}", image.oddities);
}

#[test]
fn an_image_without_pdos_has_as_many_bytes_as_its_sync_managers() {
    let mut image = with_mailbox();
    image.categories.truncate(3);
    let described = DescribedType::from_sii(&image.build().unwrap()).unwrap();
    let bits = |pdo: &DescribedPdo| pdo.entries.iter().map(|entry| entry.bits).sum::<u16>();
    let pdos: Vec<_> = described.pdos.iter().map(|pdo| (pdo.index, bits(pdo))).collect();
    assert_eq!(pdos, [(0x1600, 24), (0x1A00, 80)]);
    assert_eq!(described.channels(), (3, 10));
}

/// A bus of 16 bits has a line for single bytes: the software of a maker that begins a SyncManager at
/// an odd address uses it, any other refuses such an address.
#[test]
fn a_device_reaches_the_odd_addresses_that_its_own_data_have() {
    let up_to_safeop = |own: u16, used: u16| {
        let mut image = with_mailbox();
        image.configuration.pdi_control = 0x08;
        if let Category::SyncManagers(records) = &mut image.categories[2] {
            records[3].start = RegisterAddress(own);
        }
        let described = DescribedType::from_sii(&image.build().unwrap()).unwrap();
        let mut signals = Signals::default();
        let built = described.build(None, 1, &mut signals);
        let mut device = crate::device::tests::Device::new(built, signals);
        device.enter_preop();
        device.profile.process.iter_mut().filter(|one| one.start.0 == own).for_each(|one| {
            one.start = RegisterAddress(used);
        });
        device.set_up_process_data();
        device.request(4)
    };
    assert_eq!(up_to_safeop(0x1181, 0x1181), (4, 0));
    assert_eq!(up_to_safeop(0x1180, 0x1180), (4, 0));
    assert_eq!(up_to_safeop(0x1180, 0x1181), (0x12, 0x0017));
}

#[test]
fn the_smallest_controller_that_has_it_all_is_taken() {
    let hardware = |change: fn(&mut Image)| {
        let mut image = with_mailbox();
        change(&mut image);
        DescribedType::from_sii(&image.build().unwrap()).map(|described| described.hardware)
    };
    assert_eq!(hardware(|_| {}).unwrap().controller_type, 0x11);
    assert_eq!(
        hardware(|image| image.configuration.pdi_control = 0x80).unwrap().controller_type,
        4
    );
    let large = hardware(|image| image.standard_mailbox.send.offset = RegisterAddress(0x8000));
    let large = large.unwrap();
    assert_eq!((large.controller_type, large.ram_kib), (4, 29));
    let beyond = hardware(|image| image.standard_mailbox.send.offset = RegisterAddress(0xFFF0));
    assert_eq!(
        beyond.unwrap_err().to_string(),
        "memory: up to address 0x10070, expected at most 0xFFFF"
    );
}
