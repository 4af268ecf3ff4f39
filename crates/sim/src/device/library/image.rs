//! The SII image of a type, made with the builder of `proto`.

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::PortMap;
use linesman_proto::sii::{
    Category, Configuration, FmmuUsage, General, GeneralFlags, Identity, Image, Pdo, PdoEntry,
    PdoFlags, PortKind as SiiPort, StringIndex, Strings, SyncManager, SyncManagerEnable,
    SyncManagerKind,
};

use super::spec::{EntrySpec, PdoSpec, Spec, Use};
use crate::hardware::PortKind;

/// Who makes all types of this library.
const VENDOR: u32 = 2;
/// PDO flags of channels that are always there: mandatory, fixed.
const ALWAYS_THERE: PdoFlags = PdoFlags(0x0011);
/// General flag: the identification value stands in memory.
const IDENTIFICATION_IN_MEMORY: u8 = 0x10;

/// The whole image as bytes.
pub(super) fn build(spec: &Spec, serial: u32) -> Vec<u8> {
    // The tables are in this crate and far from every limit of the format; a test builds them all.
    image(spec, serial).build().unwrap_or_default()
}

fn image(spec: &Spec, serial: u32) -> Image {
    let mut strings = Strings::new();
    let mut categories = Vec::new();
    let general = general(spec, &mut strings);
    let outputs = pdos(spec, true, &mut strings);
    let inputs = pdos(spec, false, &mut strings);
    categories.push(Category::Strings(strings));
    categories.push(Category::General(Box::new(general)));
    if !spec.sync_managers.is_empty() {
        categories.push(Category::Fmmu(fmmus(spec)));
        categories.push(Category::SyncManagers(sync_managers(spec)));
    }
    if !inputs.is_empty() {
        categories.push(Category::TxPdos(inputs));
    }
    if !outputs.is_empty() {
        categories.push(Category::RxPdos(outputs));
    }
    Image {
        configuration: Configuration {
            pdi_control: spec.pdi_control,
            esc_configuration: spec.esc_configuration,
            pdi_configuration_2: spec.pdi_configuration_2,
            ..Configuration::default()
        },
        identity: Identity {
            vendor_id: VENDOR,
            product_code: spec.product,
            revision: spec.revision,
            serial_number: serial,
        },
        categories,
        ..Image::default()
    }
}

/// A string's number; none for a text that finds no place.
fn text(strings: &mut Strings, text: &str) -> StringIndex {
    strings.intern(text).unwrap_or(StringIndex::NONE)
}

fn general(spec: &Spec, strings: &mut Strings) -> General {
    let order = text(strings, spec.name);
    let group = text(strings, spec.group);
    let name = text(strings, spec.title);
    let memory = spec.identification_switch;
    General {
        group,
        order,
        name,
        group_again: group,
        flags: GeneralFlags(memory.map_or(0, |_| IDENTIFICATION_IN_MEMORY)),
        physical_memory_address: memory.unwrap_or(RegisterAddress(0)),
        ebus_current_ma: spec.ebus_current_ma,
        ports: PortMap(spec.ports.map(|port| match port {
            PortKind::Absent => SiiPort::None,
            PortKind::Ebus => SiiPort::EBus,
            PortKind::Mii => SiiPort::Mii,
        })),
        ..General::default()
    }
}

fn fmmus(spec: &Spec) -> Vec<FmmuUsage> {
    let usages = spec.sync_managers.iter().map(|manager| match manager.kind {
        Use::Outputs => FmmuUsage::Outputs,
        Use::Inputs => FmmuUsage::Inputs,
    });
    let mut usages: Vec<_> = usages.collect();
    usages.dedup();
    usages
}

fn sync_managers(spec: &Spec) -> Vec<SyncManager> {
    let records = spec.sync_managers.iter().map(|manager| SyncManager {
        start: RegisterAddress(manager.start),
        length: manager.length,
        control: manager.control.0,
        status: 0,
        enable: SyncManagerEnable(manager.enable),
        kind: match manager.kind {
            Use::Outputs => SyncManagerKind::Outputs,
            Use::Inputs => SyncManagerKind::Inputs,
        },
    });
    records.collect()
}

fn pdos(spec: &Spec, outputs: bool, strings: &mut Strings) -> Vec<Pdo> {
    let mine = spec.pdos.iter().filter(|pdo| pdo.is_output() == outputs);
    mine.flat_map(|pdo| (0..pdo.channels).map(move |channel| (pdo, channel)))
        .map(|(pdo, channel)| one_pdo(pdo, channel, strings))
        .collect()
}

fn one_pdo(pdo: &PdoSpec, channel: u8, strings: &mut Strings) -> Pdo {
    let name = if pdo.channels > 1 {
        format!("{} {}", pdo.name, channel + 1)
    } else {
        pdo.name.to_owned()
    };
    let entries = pdo.entries.iter().map(|entry| one_entry(entry, channel, strings)).collect();
    Pdo {
        index: pdo.index + pdo.step * u16::from(channel),
        sync_manager: Some(pdo.sync_manager),
        synchronization: 0,
        name: text(strings, &name),
        flags: ALWAYS_THERE,
        entries,
    }
}

fn one_entry(entry: &EntrySpec, channel: u8, strings: &mut Strings) -> PdoEntry {
    let padding = entry.index == 0;
    PdoEntry {
        index: if padding { 0 } else { entry.index + 0x10 * u16::from(channel) },
        subindex: entry.subindex,
        name: if padding { StringIndex::NONE } else { text(strings, entry.name) },
        data_type_code: if padding { 0 } else { entry.data_type.0 as u8 },
        bits: entry.bits,
        flags: 0,
    }
}
