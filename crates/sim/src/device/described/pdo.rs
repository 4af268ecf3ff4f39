//! Process data objects with everything that is known about them.

use linesman_proto::mailbox::coe::DataType;
use linesman_proto::sii::{Direction, Image, Pdo, SyncManagerKind};

/// Most entries of a PDO, as their count is one byte.
const MOST_ENTRIES: usize = 255;

/// A process data object.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DescribedPdo {
    /// Index of its mapping object.
    pub index: u16,
    /// Which way it flows.
    pub direction: Direction,
    /// The SyncManager it is assigned to after power-on.
    pub sync_manager: Option<u8>,
    /// Its name.
    pub name: String,
    /// Its entries cannot be changed.
    pub fixed: bool,
    /// PDOs that cannot be assigned together with it.
    pub excludes: Vec<u16>,
    /// It is there several times in each cycle, once for each sample.
    pub oversampled: bool,
    /// What it consists of.
    pub entries: Vec<DescribedEntry>,
}

/// A piece of a PDO.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DescribedEntry {
    /// Index of its object; 0 for padding.
    pub index: u16,
    /// Its subindex.
    pub subindex: u8,
    /// Its name.
    pub name: String,
    /// Its type.
    pub data_type: DataType,
    /// Its bits.
    pub bits: u16,
}

/// The PDOs of an SII image.
pub(super) fn of_image(image: &Image) -> Vec<DescribedPdo> {
    let mut pdos = Vec::new();
    for direction in [Direction::Outputs, Direction::Inputs] {
        pdos.extend(image.pdos(direction).map(|pdo| of_pdo(image, pdo, direction)));
    }
    pdos
}

/// The same with what is missing. Data that have no PDO in a direction, as those of small firmware
/// kits, say no more of those process data than how long each SyncManager is: then there are PDOs of
/// so many bytes, outputs from object 0x7000 on and inputs from object 0x6000 on (ETG.5001).
pub(super) fn complete(image: &Image, mut pdos: Vec<DescribedPdo>) -> Vec<DescribedPdo> {
    let described = [Direction::Outputs, Direction::Inputs]
        .map(|direction| image.pdos(direction).next().is_some());
    for (sync_manager, record) in (0u8..).zip(image.sync_managers()) {
        let direction = match record.kind {
            SyncManagerKind::Outputs => Direction::Outputs,
            SyncManagerKind::Inputs => Direction::Inputs,
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => continue,
        };
        let known = match direction {
            Direction::Outputs => described[0],
            Direction::Inputs => described[1],
        };
        if !known && !record.enable.is_virtual() {
            bytes(direction, sync_manager, record.length, &mut pdos);
        }
    }
    pdos
}

fn of_pdo(image: &Image, pdo: &Pdo, direction: Direction) -> DescribedPdo {
    let text = |index| image.text(index).unwrap_or_default().to_owned();
    let entries = pdo.entries.iter().map(|entry| DescribedEntry {
        index: entry.index,
        subindex: entry.subindex,
        name: text(entry.name),
        data_type: DataType(u16::from(entry.data_type_code)),
        bits: u16::from(entry.bits),
    });
    DescribedPdo {
        index: pdo.index,
        direction,
        sync_manager: pdo.sync_manager,
        name: text(pdo.name),
        fixed: pdo.flags.fixed(),
        excludes: Vec::new(),
        oversampled: false,
        entries: entries.collect(),
    }
}

/// PDOs of nothing but bytes. A PDO has at most 255 entries, and an object as many; what is more goes
/// on in the next.
fn bytes(direction: Direction, sync_manager: u8, length: u16, pdos: &mut Vec<DescribedPdo>) {
    let (pdo, object) = match direction {
        Direction::Outputs => (0x1600, 0x7000),
        Direction::Inputs => (0x1A00, 0x6000),
    };
    let places: Vec<u16> = (0..length).collect();
    for places in places.chunks(MOST_ENTRIES) {
        let before = pdos.iter().filter(|pdo| pdo.direction == direction).count() as u16;
        let entries = (1u8..=255).zip(places).map(|(subindex, place)| DescribedEntry {
            index: object + 0x10 * before,
            subindex,
            name: format!("Byte {place}"),
            data_type: DataType::USINT,
            bits: 8,
        });
        pdos.push(DescribedPdo {
            index: pdo + before,
            direction,
            sync_manager: Some(sync_manager),
            name: "Bytes".to_owned(),
            fixed: true,
            excludes: Vec::new(),
            oversampled: false,
            entries: entries.collect(),
        });
    }
}

impl DescribedEntry {
    /// Whether it only fills up.
    #[must_use]
    pub fn is_padding(&self) -> bool {
        self.index == 0
    }
}
