//! Process data as SOEM maps them (`ecx_config_map_group`): how long they are tell the objects of a SubDevice or its
//! EEPROM; outputs of all lie before inputs of all, bits beside bits; behind them the status of each mailbox.

use std::ops::Range;

use linesman_proto::address::{LogicalAddress, RegisterAddress};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::register::{self, FmmuConfig, SmActivate};
use linesman_proto::sii::{CategoryKind, SyncManagerKind};

use super::bus::{Bus, SURELY};
use super::device::{Device, PRE_OP, SAFE_OP, SYNC_MANAGERS};
use super::eeprom::{self, Categories};
use super::{hook, mailbox, states};

/// Protocols of a mailbox: CoE.
const COE: u16 = 0x04;
/// Details of CoE: complete access.
const COMPLETE_ACCESS: u8 = 0x20;
/// Most bytes of process data in one frame: `EC_MAXLRWDATA` less `EC_FIRSTDCDATAGRAM`.
const SEGMENT: usize = 1_486 - 20;
/// Status of the `SyncManager` by which a SubDevice sends messages.
const MAILBOX_STATUS: RegisterAddress = RegisterAddress(0x080D);

/// Where process data are.
#[derive(Clone, Default, Debug)]
pub(super) struct Image {
    /// Bytes of all together.
    pub(super) len: usize,
    /// Bytes that are outputs, at the beginning.
    pub(super) outputs: usize,
    /// What one frame carries each.
    pub(super) segments: Vec<Range<usize>>,
    /// What all working counters add up to.
    pub(super) expected: u32,
}

/// Maps all SubDevices and sends them to SAFEOP.
pub(super) async fn map(bus: &Bus, devices: &mut [Device]) -> Image {
    for device in &mut *devices {
        states::reach(bus, device, PRE_OP, states::TIMEOUT).await;
        hook::run(bus, device).await;
        if device.mailbox.is_some_and(|mailbox| mailbox.protocols & COE != 0) {
            by_objects(bus, device).await;
        }
    }
    for at in 0..devices.len() {
        let (before, rest) = devices.split_at_mut(at);
        if let Some(device) = rest.first_mut() {
            by_eeprom(bus, device, before).await;
            set_up_sync_managers(bus, device).await;
        }
    }
    let mut layout = Layout::default();
    for device in &mut *devices {
        layout.place(bus, device, SyncManagerKind::Outputs).await;
    }
    layout.next_byte();
    let outputs = layout.at;
    for device in &mut *devices {
        layout.place(bus, device, SyncManagerKind::Inputs).await;
    }
    layout.next_byte();
    for device in devices.iter_mut().filter(|device| device.mailbox.is_some()) {
        let at = LogicalAddress(layout.at as u32);
        layout.add(bus, device, FmmuConfig::inputs(at, 1, MAILBOX_STATUS)).await;
        layout.at += 1;
    }
    for device in &mut *devices {
        eeprom::to_pdi(bus, device).await;
        states::request(bus, device, SAFE_OP, SURELY).await;
    }
    let expected = devices.iter().map(counted).sum();
    layout.into_image(outputs, expected)
}

/// What a SubDevice adds to the working counter of a frame that reads and writes.
fn counted(device: &Device) -> u32 {
    let any = |test: fn(&FmmuConfig) -> bool| u32::from(device.fmmus.iter().any(test));
    2 * any(|fmmu| fmmu.writes) + any(|fmmu| fmmu.reads)
}

/// Asks a SubDevice which PDOs are assigned, and how long they are (`ecx_readPDOmap`, `ecx_readPDOmapCA`).
async fn by_objects(bus: &Bus, device: &mut Device) {
    if device.coe_details & COMPLETE_ACCESS != 0 && by_whole_objects(bus, device).await {
        return;
    }
    let Some(count) = mailbox::number(bus, device, 0x1C00, 0).await else { return };
    for at in 2..SYNC_MANAGERS.min(count as usize) {
        let code = mailbox::number(bus, device, 0x1C00, at as u8 + 1).await;
        let Some(code) = code else { continue };
        let of = SyncManagerKind::from_code(code as u8);
        device.kinds[at] = of;
        if is_process_data(of) {
            let bits = assigned(bus, device, 0x1C10 + at as u16).await;
            note(device, at, bits);
        }
    }
}

/// Bits of the PDOs that an object lists.
async fn assigned(bus: &Bus, device: &mut Device, object: u16) -> u32 {
    let count = mailbox::number(bus, device, object, 0).await.unwrap_or(0);
    let mut bits = 0;
    for at in 1..=count.min(0xFF) {
        let pdo = mailbox::number(bus, device, object, at as u8).await.unwrap_or(0) as u16;
        if pdo == 0 {
            continue;
        }
        let entries = mailbox::number(bus, device, pdo, 0).await.unwrap_or(0);
        for entry in 1..=entries.min(0xFF) {
            bits += mailbox::number(bus, device, pdo, entry as u8).await.unwrap_or(0) & 0xFF;
        }
    }
    bits
}

/// The same with one request for each object; says whether anything came of it.
async fn by_whole_objects(bus: &Bus, device: &mut Device) -> bool {
    let whole = |index| ObjectAddress::new(index, 0);
    let Some(uses) = mailbox::upload(bus, device, whole(0x1C00), true).await else { return false };
    let count = uses.first().map_or(0, |count| usize::from(*count));
    for at in 2..SYNC_MANAGERS.min(count) {
        let of = SyncManagerKind::from_code(uses.get(2 + at).copied().unwrap_or(0));
        device.kinds[at] = of;
        if !is_process_data(of) {
            continue;
        }
        let list = mailbox::upload(bus, device, whole(0x1C10 + at as u16), true).await;
        let list = list.unwrap_or_default();
        let pdos = list.first().map_or(0, |count| usize::from(*count));
        let mut bits = 0;
        for pdo in list.get(2..).unwrap_or_default().chunks_exact(2).take(pdos) {
            let index = u16::from_le_bytes([pdo[0], pdo[1]]);
            let Some(entries) = mailbox::upload(bus, device, whole(index), true).await else {
                continue;
            };
            let count = entries.first().map_or(0, |count| usize::from(*count));
            let entries = entries.get(2..).unwrap_or_default().chunks_exact(4).take(count);
            bits += entries.map(|entry| u32::from(entry[0])).sum::<u32>();
        }
        note(device, at, bits);
    }
    device.output_bits + device.input_bits > 0
}

const fn is_process_data(kind: SyncManagerKind) -> bool {
    matches!(kind, SyncManagerKind::Outputs | SyncManagerKind::Inputs)
}

fn note(device: &mut Device, at: usize, bits: u32) {
    if bits == 0 {
        return;
    }
    device.sync_managers[at].length = bits.div_ceil(8) as u16;
    match device.kinds[at] {
        SyncManagerKind::Outputs => device.output_bits += bits,
        SyncManagerKind::Inputs => device.input_bits += bits,
        SyncManagerKind::Unused
        | SyncManagerKind::MailboxOut
        | SyncManagerKind::MailboxIn
        | SyncManagerKind::Other(_) => {}
    }
}

/// Looks into the EEPROM for process data of a SubDevice that has told of none (`ecx_map_sii`).
async fn by_eeprom(bus: &Bus, device: &mut Device, before: &[Device]) {
    if device.output_bits + device.input_bits > 0 {
        return;
    }
    let has_data = |one: &&Device| one.is_like(device) && one.output_bits + one.input_bits > 0;
    if let Some(twin) = before.iter().find(has_data) {
        device.sync_managers = twin.sync_managers;
        device.kinds = twin.kinds;
        (device.output_bits, device.input_bits) = (twin.output_bits, twin.input_bits);
        return;
    }
    let mut categories = Categories::default();
    let directions = [
        (CategoryKind::TxPdos, SyncManagerKind::Inputs),
        (CategoryKind::RxPdos, SyncManagerKind::Outputs),
    ];
    for (kind, of) in directions {
        let mapping = categories.pdos(bus, device, kind).await;
        for (at, bits) in mapping.into_iter().enumerate().filter(|(_, bits)| *bits > 0) {
            device.kinds[at] = of;
            note(device, at, bits);
        }
    }
}

/// Writes the `SyncManager`s of process data; one without data is switched off (`ecx_map_sm`).
async fn set_up_sync_managers(bus: &Bus, device: &mut Device) {
    let first = if device.mailbox.is_some() { 2 } else { 0 };
    for at in first..SYNC_MANAGERS {
        let mut manager = device.sync_managers[at];
        if manager.start == RegisterAddress(0) {
            continue;
        }
        if at >= 2 {
            let on = u8::from(manager.length > 0);
            manager.activate = SmActivate(manager.activate.0 & !1 | on);
            device.sync_managers[at] = manager;
        }
        write_sync_manager(bus, device, at).await;
    }
}

pub(super) async fn write_sync_manager(bus: &Bus, device: &Device, at: usize) {
    let address = register::SYNC_MANAGER.address.0 + 8 * at as u16;
    bus.write(device.target(), address, &device.sync_managers[at].to_bytes(), SURELY).await;
}

pub(super) async fn write_fmmu(bus: &Bus, device: &Device, at: usize) {
    let Some(fmmu) = device.fmmus.get(at) else { return };
    let address = register::FMMU.address.0 + FmmuConfig::LEN as u16 * at as u16;
    bus.write(device.target(), address, &fmmu.to_bytes(), SURELY).await;
}

/// Logical addresses as they are given away.
#[derive(Default)]
struct Layout {
    at: usize,
    bit: u8,
    /// Where each SubDevice's data end: a frame may end there.
    ends: Vec<usize>,
}

impl Layout {
    fn next_byte(&mut self) {
        if self.bit > 0 {
            self.at += 1;
            self.bit = 0;
        }
    }

    /// Maps the outputs or the inputs of a SubDevice.
    async fn place(&mut self, bus: &Bus, device: &mut Device, of: SyncManagerKind) {
        let (bits, bytes) = match of {
            SyncManagerKind::Outputs => (device.output_bits, device.output_bytes()),
            SyncManagerKind::Inputs => (device.input_bits, device.input_bytes()),
            SyncManagerKind::Unused
            | SyncManagerKind::MailboxOut
            | SyncManagerKind::MailboxIn
            | SyncManagerKind::Other(_) => (0, 0),
        };
        let (mut left_bits, mut left_bytes) = (bits, bytes);
        for at in 0..SYNC_MANAGERS {
            let manager = device.sync_managers[at];
            if device.kinds[at] != of || manager.length == 0 || left_bits == 0 {
                continue;
            }
            let fmmu = if bytes == 0 {
                let fmmu = self.bits(left_bits as u8, manager.start);
                left_bits = 0;
                fmmu
            } else {
                let len = left_bytes.min(manager.length.into());
                left_bytes -= len;
                left_bits = left_bits.saturating_sub(8 * len as u32);
                self.bytes(len, manager.start)
            };
            let fmmu = FmmuConfig {
                reads: of == SyncManagerKind::Inputs,
                writes: of == SyncManagerKind::Outputs,
                ..fmmu
            };
            self.add(bus, device, fmmu).await;
        }
        self.ends.push(self.at + usize::from(self.bit > 0));
    }

    async fn add(&mut self, bus: &Bus, device: &mut Device, fmmu: FmmuConfig) {
        device.fmmus.push(fmmu);
        write_fmmu(bus, device, device.fmmus.len() - 1).await;
    }

    /// Fewer than eight bits, beside those of others.
    fn bits(&mut self, bits: u8, start: RegisterAddress) -> FmmuConfig {
        let (from, first) = (self.at, self.bit);
        let last = first + bits - 1;
        let fmmu = FmmuConfig {
            logical_start_bit: first,
            logical_stop_bit: last % 8,
            ..FmmuConfig::inputs(LogicalAddress(from as u32), u16::from(last / 8) + 1, start)
        };
        let end = first + bits;
        self.at += usize::from(end / 8);
        self.bit = end % 8;
        fmmu
    }

    fn bytes(&mut self, len: usize, start: RegisterAddress) -> FmmuConfig {
        self.next_byte();
        let fmmu = FmmuConfig::inputs(LogicalAddress(self.at as u32), len as u16, start);
        self.at += len;
        fmmu
    }

    fn into_image(mut self, outputs: usize, expected: u32) -> Image {
        self.ends.push(self.at);
        let mut segments = Vec::new();
        let (mut from, mut to) = (0, 0);
        for end in self.ends {
            if end - from > SEGMENT && to > from {
                segments.push(from..to);
                from = to;
            }
            to = to.max(end);
        }
        if to > from {
            segments.push(from..to);
        }
        Image { len: self.at, outputs, segments, expected }
    }
}
