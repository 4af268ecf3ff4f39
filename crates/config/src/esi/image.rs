//! The SII image that belongs to a device description.
//!
//! Reference: ETG.2000 and ETG.2010, which give each element its place in the image.

use linesman_proto::address::RegisterAddress;
use linesman_proto::mailbox::coe::DataType;
use linesman_proto::sii::{
    BuildError, Category, CategoryKind, Configuration, Direction, FmmuUsage, General, GeneralFlags,
    Identity, Image, MailboxArea, MailboxPair, OpMode, Pdo, PdoEntry, PdoFlags, Protocols,
    RawCategory, Size, StringIndex, Strings, SyncManager, SyncManagerEnable, SyncManagerKind,
};

use super::clock::EsiOpMode;
use super::device::EsiDevice;
use super::pdo::{EsiEntry, EsiPdo};
use super::sync_manager::EsiSyncManager;

/// General flag: the mailbox repeats lost messages.
const DATA_LINK_LAYER: u8 = 0x04;
/// General flag: identification by AL control.
const IDENTIFICATION_BY_AL_STATUS: u8 = 0x08;
/// General flag: the identification value stands in memory.
const IDENTIFICATION_IN_MEMORY: u8 = 0x10;
/// PDO flags: mandatory, fixed, virtual.
const MANDATORY: u16 = 0x0001;
const FIXED: u16 = 0x0010;
const VIRTUAL: u16 = 0x0020;

/// What connects the processor of a device whose description says nothing of its EEPROM: SPI, the
/// commonest.
const UNSAID_PDI: u8 = 0x05;

/// What an SII image has no room for.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ImageError {
    /// The length of an entry is one byte.
    #[error("PDO 0x{pdo:04X} has an entry \"{entry}\" of {bits} bits, at most 255 fit into an SII")]
    EntryTooLong {
        /// Index of the PDO.
        pdo: u16,
        /// Name of the entry.
        entry: String,
        /// Its bits.
        bits: u16,
    },
    /// Their number is one byte.
    #[error("PDO 0x{pdo:04X} has {entries} entries, at most 255 fit into an SII")]
    TooManyEntries {
        /// Index of the PDO.
        pdo: u16,
        /// How many it has.
        entries: usize,
    },
    /// A category is too long.
    #[error(transparent)]
    Build(#[from] BuildError),
}

/// The image of a device with these PDOs: its own, and those of the modules in its slots.
///
/// # Errors
/// [`ImageError`] when the image has no room for something.
pub fn image(device: &EsiDevice, vendor_id: u32, pdos: &[EsiPdo]) -> Result<Image, ImageError> {
    let eeprom = device.eeprom.clone().unwrap_or_default();
    let mut strings = Strings::new();
    let mut categories = Vec::new();
    for (number, data) in eeprom.categories {
        let kind = CategoryKind::from_code(number);
        categories.extend(RawCategory::new(kind, data).map(Category::Raw));
    }
    let general = general(device, &mut strings);
    let op_modes: Vec<OpMode> =
        device.op_modes.iter().map(|mode| op_mode(mode, &mut strings)).collect();
    let mut of = |direction| {
        let mine = pdos.iter().filter(|pdo| pdo.direction == direction);
        mine.map(|pdo| one_pdo(pdo, &mut strings)).collect::<Result<Vec<_>, _>>()
    };
    let inputs = of(Direction::Inputs)?;
    let outputs = of(Direction::Outputs)?;
    categories.push(Category::Strings(strings));
    categories.push(Category::General(Box::new(general)));
    if !device.fmmus.is_empty() {
        let usages: Vec<FmmuUsage> = device.fmmus.iter().map(|fmmu| fmmu.usage).collect();
        categories.push(Category::Fmmu(even(usages)));
    }
    if !device.sync_managers.is_empty() {
        let records = device.sync_managers.iter().map(sync_manager);
        categories.push(Category::SyncManagers(records.collect()));
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
    let mut image = Image {
        configuration: match &device.eeprom {
            Some(eeprom) => eeprom.configuration.clone(),
            None => Configuration { pdi_control: UNSAID_PDI, ..Configuration::default() },
        },
        identity: Identity {
            vendor_id,
            product_code: device.product_code,
            revision: device.revision,
            serial_number: 0,
        },
        bootstrap_mailbox: eeprom.bootstrap,
        standard_mailbox: standard_mailbox(device),
        protocols: device.mailbox.as_ref().map_or(Protocols::default(), |one| one.protocols),
        size: match eeprom.byte_size {
            0 => Size::default(),
            bytes => Size::for_bytes(bytes as usize),
        },
        categories,
        ..Image::default()
    };
    // Some makers leave process data out of an EEPROM that is too small for them. Here it is made as
    // large as it has to be, so that every MainDevice learns of them.
    let needed = image.build()?.len();
    if needed > image.size.bytes() {
        image.size = Size::for_bytes(needed);
    }
    Ok(image)
}

/// Category FMMU fills whole words.
fn even(mut usages: Vec<FmmuUsage>) -> Vec<FmmuUsage> {
    if !usages.len().is_multiple_of(2) {
        usages.push(FmmuUsage::Unused);
    }
    usages
}

/// The mailbox is where its SyncManagers are.
fn standard_mailbox(device: &EsiDevice) -> MailboxPair {
    let area = |kind: SyncManagerKind| {
        let found = device.sync_managers.iter().find(|one| one.kind == kind);
        found
            .map_or(MailboxArea::default(), |one| MailboxArea { offset: one.start, size: one.size })
    };
    MailboxPair {
        receive: area(SyncManagerKind::MailboxOut),
        send: area(SyncManagerKind::MailboxIn),
    }
}

/// A string's number; none for a text that finds no place.
fn text(strings: &mut Strings, text: &str) -> StringIndex {
    if text.is_empty() {
        StringIndex::NONE
    } else {
        strings.intern(text).unwrap_or(StringIndex::NONE)
    }
}

fn general(device: &EsiDevice, strings: &mut Strings) -> General {
    let order = text(strings, &device.type_name);
    let group = text(strings, &device.group);
    let name = text(strings, device.name());
    let mailbox = device.mailbox.clone().unwrap_or_default();
    let mut flags = 0;
    if mailbox.data_link_layer {
        flags |= DATA_LINK_LAYER;
    }
    if device.identification_by_al_status {
        flags |= IDENTIFICATION_BY_AL_STATUS;
    }
    if device.identification_address.is_some() {
        flags |= IDENTIFICATION_IN_MEMORY;
    }
    General {
        group,
        order,
        name,
        group_again: group,
        coe: mailbox.coe,
        foe: u8::from(mailbox.protocols.has(Protocols::FOE)),
        eoe: u8::from(mailbox.protocols.has(Protocols::EOE)),
        soe_channels: mailbox.soe_channels,
        ds402_channels: mailbox.ds402_channels,
        flags: GeneralFlags(flags),
        ebus_current_ma: device.ebus_current_ma.unwrap_or(0),
        ports: device.ports,
        physical_memory_address: device.identification_address.unwrap_or(RegisterAddress(0)),
        ..General::default()
    }
}

fn sync_manager(manager: &EsiSyncManager) -> SyncManager {
    let enable = u8::from(manager.enable)
        | u8::from(manager.is_virtual) << 2
        | u8::from(manager.op_only) << 3;
    SyncManager {
        start: manager.start,
        length: manager.size,
        control: manager.control,
        status: 0,
        enable: SyncManagerEnable(enable),
        kind: manager.kind,
    }
}

fn op_mode(mode: &EsiOpMode, strings: &mut Strings) -> OpMode {
    OpMode {
        sync0_cycle_ns: mode.sync0_cycle_ns,
        sync0_shift_ns: mode.sync0_shift_ns,
        sync1_shift_ns: mode.sync1_shift_ns,
        sync1_cycle_factor: mode.sync1_cycle_factor,
        assign_activate: mode.assign_activate,
        sync0_cycle_factor: mode.sync0_cycle_factor,
        name: text(strings, &mode.name),
        description: text(strings, &mode.description),
        ..OpMode::default()
    }
}

fn one_pdo(pdo: &EsiPdo, strings: &mut Strings) -> Result<Pdo, ImageError> {
    if pdo.entries.len() > Pdo::MAX_ENTRIES {
        let entries = pdo.entries.len();
        return Err(ImageError::TooManyEntries { pdo: pdo.index, entries });
    }
    let entries = pdo.entries.iter().map(|entry| one_entry(pdo, entry, strings));
    let mut flags = 0;
    for (on, bit) in [(pdo.mandatory, MANDATORY), (pdo.fixed, FIXED), (pdo.is_virtual, VIRTUAL)] {
        if on {
            flags |= bit;
        }
    }
    Ok(Pdo {
        index: pdo.index,
        sync_manager: pdo.sync_manager,
        synchronization: 0,
        flags: PdoFlags(flags),
        entries: entries.collect::<Result<_, _>>()?,
        name: text(strings, &pdo.name),
    })
}

fn one_entry(
    pdo: &EsiPdo,
    entry: &EsiEntry,
    strings: &mut Strings,
) -> Result<PdoEntry, ImageError> {
    let bits = u8::try_from(entry.bits).map_err(|_| ImageError::EntryTooLong {
        pdo: pdo.index,
        entry: entry.name.clone(),
        bits: entry.bits,
    })?;
    Ok(PdoEntry {
        index: entry.index,
        subindex: entry.subindex,
        name: text(strings, &entry.name),
        // Types of the dictionary that do not fit into a byte are given by their length alone.
        data_type_code: entry.data_type().and_then(|one| u8::try_from(one.0).ok()).unwrap_or(0),
        bits,
        flags: 0,
    })
}

impl EsiEntry {
    /// Its type by number, when it is one that the specification names.
    #[must_use]
    pub fn data_type(&self) -> Option<DataType> {
        let name = self.data_type.split('(').next().unwrap_or_default();
        let name = if name == "BIT" { "BOOL" } else { name };
        DataType::from_name(name)
    }
}
