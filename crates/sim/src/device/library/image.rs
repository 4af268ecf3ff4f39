//! The SII image of a type, made with the builder of `proto`.

use linesman_proto::address::RegisterAddress;
use linesman_proto::port::PortMap;
use linesman_proto::sii::{
    Category, Configuration, FmmuUsage, General, GeneralFlags, Identity, Image, MailboxArea,
    MailboxPair, OpMode, Pdo, PdoEntry, PdoFlags, PortKind as SiiPort, Protocols, Size,
    StringIndex, Strings, SyncManager, SyncManagerEnable, SyncManagerKind,
};

use super::object::{Individual, channel_name};
use super::spec::{EntrySpec, PdoSpec, Spec, Use};
use crate::hardware::PortKind;

/// PDO flags of channels that are always there: mandatory, fixed.
const ALWAYS_THERE: PdoFlags = PdoFlags(0x0011);
/// PDO flags of what can be assigned: fixed.
const FIXED: PdoFlags = PdoFlags(0x0010);
/// PDO flag: registers, not memory behind a SyncManager.
const VIRTUAL: u16 = 0x0020;
/// General flag: the mailbox repeats lost messages.
const MAILBOX_REPEATS: u8 = 0x04;
/// EEPROM of devices with a processor: 32 Kbit.
const LARGE: Size = Size(0x1F);
/// General flag: the identification value can be asked for through AL control.
const IDENTIFICATION_BY_AL_STATUS: u8 = 0x08;
/// General flag: the identification value stands in memory.
const IDENTIFICATION_IN_MEMORY: u8 = 0x10;

/// The whole image as bytes.
pub(super) fn build(spec: &Spec, individual: Individual) -> Vec<u8> {
    // The tables are in this crate and far from every limit of the format; a test builds them all.
    image(spec, individual).build().unwrap_or_default()
}

fn image(spec: &Spec, individual: Individual) -> Image {
    let mut strings = Strings::new();
    let mut categories = Vec::new();
    let has_mailbox = spec.mailbox().is_present();
    let general = general(spec, &mut strings);
    let op_modes = op_modes(spec, &mut strings);
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
    if !op_modes.is_empty() {
        categories.push(Category::OpModes(op_modes));
    }
    Image {
        configuration: Configuration {
            pdi_control: spec.pdi_control,
            esc_configuration: spec.esc_configuration,
            sync_impulse: spec.sync_impulse,
            pdi_configuration_2: spec.pdi_configuration_2,
            ..Configuration::default()
        },
        identity: Identity {
            vendor_id: spec.vendor,
            product_code: spec.product,
            revision: individual.revision,
            serial_number: individual.serial,
        },
        bootstrap_mailbox: bootstrap(spec),
        standard_mailbox: spec.mailbox(),
        protocols: Protocols(spec.protocols),
        size: if has_mailbox { LARGE } else { Size::default() },
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
    let memory = spec.coding_switch();
    let in_memory = memory.map_or(0, |_| IDENTIFICATION_IN_MEMORY);
    let has_mailbox = spec.mailbox().is_present();
    let repeats = if has_mailbox { MAILBOX_REPEATS | IDENTIFICATION_BY_AL_STATUS } else { 0 };
    General {
        group,
        order,
        name,
        group_again: group,
        coe: spec.coe,
        foe: u8::from(Protocols(spec.protocols).has(Protocols::FOE)),
        flags: GeneralFlags(in_memory | repeats),
        physical_memory_address: memory.unwrap_or(RegisterAddress(0)),
        ebus_current_ma: spec.ebus_current_ma,
        ports: PortMap(spec.ports.map(|port| match port {
            PortKind::Absent => SiiPort::None,
            PortKind::Ebus => SiiPort::EBus,
            PortKind::Mii if spec.chip.fast_hot_connect() => SiiPort::FastHotConnect,
            PortKind::Mii => SiiPort::Mii,
        })),
        ..General::default()
    }
}

fn op_modes(spec: &Spec, strings: &mut Strings) -> Vec<OpMode> {
    let modes = spec.op_modes.iter().map(|mode| OpMode {
        sync0_cycle_factor: mode.sync0_factor,
        assign_activate: mode.assign_activate,
        name: text(strings, mode.name),
        ..OpMode::default()
    });
    modes.collect()
}

/// The mailbox in BOOT: as large as all devices of this vendor have it.
pub(super) fn bootstrap(spec: &Spec) -> MailboxPair {
    const BOOTSTRAP: MailboxPair = MailboxPair {
        receive: MailboxArea { offset: RegisterAddress(0x1000), size: 244 },
        send: MailboxArea { offset: RegisterAddress(0x10F4), size: 244 },
    };
    if spec.mailbox().is_present() { BOOTSTRAP } else { MailboxPair::default() }
}

/// An FMMU for each stretch of process data, outputs first, and one for the state of the mailbox.
fn fmmus(spec: &Spec) -> Vec<FmmuUsage> {
    let stretches = |kind| {
        let mut end = None;
        let managers = spec.sync_managers.iter().filter(move |manager| manager.kind == kind);
        managers
            .filter(|manager| manager.length > 0 || manager.is_virtual())
            .filter(move |manager| {
                // Bytes side by side are one stretch.
                let joins = end == Some(manager.start);
                end = Some(manager.start + manager.length);
                !joins
            })
            .count()
    };
    let mut usages = vec![FmmuUsage::Outputs; stretches(Use::Outputs)];
    usages.extend(vec![FmmuUsage::Inputs; stretches(Use::Inputs)]);
    if spec.mailbox().is_present() {
        usages.push(FmmuUsage::MailboxState);
    }
    usages
}

fn sync_managers(spec: &Spec) -> Vec<SyncManager> {
    let records = spec.sync_managers.iter().map(|manager| SyncManager {
        start: RegisterAddress(manager.start),
        length: manager.length,
        control: manager.control.0,
        status: 0,
        enable: SyncManagerEnable(manager.enable),
        kind: sync_manager_kind(manager.kind),
    });
    records.collect()
}

/// How the specification calls the use of a SyncManager.
pub(super) const fn sync_manager_kind(kind: Use) -> SyncManagerKind {
    match kind {
        Use::MailboxOut => SyncManagerKind::MailboxOut,
        Use::MailboxIn => SyncManagerKind::MailboxIn,
        Use::Outputs => SyncManagerKind::Outputs,
        Use::Inputs => SyncManagerKind::Inputs,
    }
}

fn pdos(spec: &Spec, outputs: bool, strings: &mut Strings) -> Vec<Pdo> {
    let mine = spec.pdos.iter().filter(|pdo| pdo.is_output() == outputs);
    mine.flat_map(|pdo| (0..pdo.channels).map(move |channel| (pdo, channel)))
        .map(|(pdo, channel)| one_pdo(spec, pdo, channel, strings))
        .collect()
}

fn one_pdo(spec: &Spec, pdo: &PdoSpec, channel: u8, strings: &mut Strings) -> Pdo {
    let manager = pdo.sync_manager.and_then(|index| spec.sync_managers.get(usize::from(index)));
    let flags = match manager {
        Some(manager) if manager.is_virtual() => PdoFlags(FIXED.0 | VIRTUAL),
        Some(_) => ALWAYS_THERE,
        None => FIXED,
    };
    let name = channel_name(pdo.name, channel, pdo.channels);
    let entries = pdo.entries.iter().map(|entry| one_entry(entry, channel, strings)).collect();
    Pdo {
        index: pdo.index_of(channel),
        sync_manager: pdo.sync_manager,
        synchronization: 0,
        name: text(strings, &name),
        flags,
        entries,
    }
}

fn one_entry(entry: &EntrySpec, channel: u8, strings: &mut Strings) -> PdoEntry {
    let padding = entry.index == 0;
    PdoEntry {
        index: entry.index_of(channel),
        subindex: entry.subindex,
        name: if padding { StringIndex::NONE } else { text(strings, entry.name) },
        data_type_code: if padding { 0 } else { entry.data_type.0 as u8 },
        bits: entry.bits,
        flags: 0,
    }
}
