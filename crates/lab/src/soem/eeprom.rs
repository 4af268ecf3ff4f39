//! The EEPROM of a SubDevice, read as SOEM does: the words that tell who it is, each asked of all SubDevices before the
//! answers are fetched; categories byte by byte as they are needed, with a copy of what came.

use std::collections::BTreeMap;

use linesman_proto::register::{
    SII_ACCESS_ECAT, SII_CONTROL_STATUS, SII_DATA, SiiCommand, SiiControl, SmControl,
    SyncManagerConfig,
};
use linesman_proto::sii::{CategoryKind, WordAddress, word};
use linesman_proto::time::Span;

use super::bus::{Bus, RETURN, SHORTLY, SURELY};
use super::device::{Device, SYNC_MANAGERS};

/// How long an EEPROM is waited for: `EC_TIMEOUTEEP`.
const BUSY: Span = Span::ms(20);
/// What failed is tried again: `EC_DEFAULTRETRIES`.
const RETRIES: usize = 3;
/// Most bytes of an image: `EC_MAXEEPBUF`.
const BYTES: u16 = 1024 << 2;
/// Most PDOs: `EC_MAXEEPDO`.
const PDOS: u16 = 0x200;

/// Bits of process data in each `SyncManager`.
pub(super) type Mapping = [u32; SYNC_MANAGERS];

/// The EEPROM belongs to the MainDevice from now on.
pub(super) async fn to_main_device(bus: &Bus, device: &mut Device) {
    if device.eeprom_at_pdi {
        // Taken by force, then held.
        for access in [2, 0] {
            write(bus, device, SII_ACCESS_ECAT.address.0, &[access]).await;
        }
        device.eeprom_at_pdi = false;
    }
}

/// The EEPROM belongs to the SubDevice's processor from now on.
pub(super) async fn to_pdi(bus: &Bus, device: &mut Device) {
    if !device.eeprom_at_pdi {
        write(bus, device, SII_ACCESS_ECAT.address.0, &[1]).await;
        device.eeprom_at_pdi = true;
    }
}

async fn write(bus: &Bus, device: &Device, at: u16, data: &[u8]) -> bool {
    for _ in 0..=RETRIES {
        if bus.write(device.target(), at, data, RETURN).await {
            return true;
        }
    }
    false
}

async fn fetch(bus: &Bus, device: &Device, len: usize) -> Option<Vec<u8>> {
    for _ in 0..=RETRIES {
        let reply = bus.read(device.target(), SII_DATA.address.0, len, RETURN).await;
        if reply.answered() {
            return Some(reply.data.into_vec());
        }
    }
    None
}

/// Waits until no command runs: what the control register says then.
async fn not_busy(bus: &Bus, device: &Device) -> Option<SiiControl> {
    let end = bus.now() + BUSY;
    loop {
        let reply = bus.read(device.target(), SII_CONTROL_STATUS.address.0, 2, RETURN).await;
        let control = SiiControl(reply.word(0));
        if reply.answered() && !control.busy() {
            return Some(control);
        }
        if bus.now() >= end {
            return None;
        }
        bus.sleep(SHORTLY).await;
    }
}

async fn command(bus: &Bus, device: &Device, at: WordAddress) -> bool {
    let [a, b] = SiiControl::start(SiiCommand::Read).to_bytes();
    let [c, d, e, f] = at.value().to_le_bytes();
    write(bus, device, SII_CONTROL_STATUS.address.0, &[a, b, c, d, e, f]).await
}

async fn clear_errors(bus: &Bus, device: &Device, control: SiiControl) {
    if control.checksum_error() || control.not_loaded() || control.command_failed() {
        let at = SII_CONTROL_STATUS.address.0;
        bus.write(device.target(), at, &[0, 0], SURELY).await;
    }
}

/// Asks for a word, whose answer [`answer`] fetches later (`ecx_readeeprom1`).
pub(super) async fn ask(bus: &Bus, device: &mut Device, at: WordAddress) {
    to_main_device(bus, device).await;
    if let Some(control) = not_busy(bus, device).await {
        clear_errors(bus, device, control).await;
        command(bus, device, at).await;
    }
}

/// What was asked for; 0 when nothing came (`ecx_readeeprom2`).
pub(super) async fn answer(bus: &Bus, device: &Device) -> u32 {
    if not_busy(bus, device).await.is_none() {
        return 0;
    }
    let bytes = fetch(bus, device, 4).await.unwrap_or_default();
    bytes.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes))
}

/// Reads four or eight bytes (`ecx_readeepromFP`).
async fn read(bus: &Bus, device: &Device, at: WordAddress) -> Option<Vec<u8>> {
    let control = not_busy(bus, device).await?;
    clear_errors(bus, device, control).await;
    for _ in 0..RETRIES {
        if !command(bus, device, at).await {
            return None;
        }
        bus.sleep(SHORTLY).await;
        let control = not_busy(bus, device).await?;
        if !control.acknowledge_error() {
            return fetch(bus, device, control.read_len()).await;
        }
        bus.sleep(SHORTLY * 5).await;
    }
    None
}

/// One word of a SubDevice, read at once.
pub(super) async fn word(bus: &Bus, device: &mut Device, at: WordAddress) -> u32 {
    to_main_device(bus, device).await;
    let bytes = read(bus, device, at).await.unwrap_or_default();
    bytes.first_chunk().map_or(0, |bytes| u32::from_le_bytes(*bytes))
}

/// Copy of the categories of one SubDevice, as far as they were needed.
#[derive(Default)]
pub(super) struct Categories {
    bytes: BTreeMap<u16, u8>,
}

impl Categories {
    /// The byte at an address, read if it is not there yet; 0xFF when it cannot be (`ecx_siigetbyte`).
    async fn byte(&mut self, bus: &Bus, device: &mut Device, at: u16) -> u8 {
        if at >= BYTES {
            return 0xFF;
        }
        if let Some(byte) = self.bytes.get(&at) {
            return *byte;
        }
        to_main_device(bus, device).await;
        let from = at & !1;
        let words = WordAddress(u32::from(from / 2));
        let bytes = read(bus, device, words).await.unwrap_or_default();
        self.bytes.extend((from..).zip(bytes));
        // One that does not answer is not asked for the same again.
        *self.bytes.entry(at).or_insert(0xFF)
    }

    async fn word(&mut self, bus: &Bus, device: &mut Device, at: u16) -> u16 {
        let low = self.byte(bus, device, at).await;
        let high = self.byte(bus, device, at.saturating_add(1)).await;
        u16::from_le_bytes([low, high])
    }

    /// Where a category is: the address of its length (`ecx_siifind`).
    async fn find(&mut self, bus: &Bus, device: &mut Device, kind: CategoryKind) -> Option<u16> {
        let was_at_pdi = device.eeprom_at_pdi;
        let mut at = word::FIRST_CATEGORY.byte() as u16;
        let mut code = self.word(bus, device, at).await;
        at += 2;
        while code != kind.code() && code != CategoryKind::End.code() && at < BYTES {
            let words = self.word(bus, device, at).await;
            at = at.saturating_add(2).saturating_add(words.saturating_mul(2));
            code = self.word(bus, device, at).await;
            at = at.saturating_add(2);
        }
        if was_at_pdi {
            to_pdi(bus, device).await;
        }
        (code == kind.code()).then_some(at)
    }

    /// Details of CoE, and the name, which is read and forgotten.
    pub(super) async fn general(&mut self, bus: &Bus, device: &mut Device) {
        if let Some(at) = self.find(bus, device, CategoryKind::General).await {
            device.coe_details = self.byte(bus, device, at + 7).await;
            for further in [8, 9, 10, 13, 14, 15] {
                self.byte(bus, device, at + further).await;
            }
        }
        if self.find(bus, device, CategoryKind::Strings).await.is_some() {
            self.first_string(bus, device).await;
        }
    }

    async fn first_string(&mut self, bus: &Bus, device: &mut Device) {
        let Some(at) = self.find(bus, device, CategoryKind::Strings).await else { return };
        if self.byte(bus, device, at + 2).await == 0 {
            return;
        }
        let len = self.byte(bus, device, at + 3).await;
        for letter in 0..u16::from(len) {
            self.byte(bus, device, at + 4 + letter).await;
        }
    }

    /// `SyncManager`s as the EEPROM describes them.
    pub(super) async fn sync_managers(&mut self, bus: &Bus, device: &mut Device) {
        let Some(start) = self.find(bus, device, CategoryKind::SyncManagers).await else { return };
        let count = self.word(bus, device, start).await / 4;
        for at in 0..usize::from(count).min(SYNC_MANAGERS) {
            let mut bytes = [0; 8];
            for (byte, address) in bytes.iter_mut().zip(start + 2 + 8 * at as u16..) {
                *byte = self.byte(bus, device, address).await;
            }
            let [s0, s1, l0, l1, control, _, activate, _] = bytes;
            let written = SyncManagerConfig::from_bytes([s0, s1, l0, l1, control, 0, activate, 0]);
            device.sync_managers[at] = SyncManagerConfig { control: SmControl(control), ..written };
        }
    }

    /// What FMMUs are for, which is read and not used further.
    pub(super) async fn fmmus(&mut self, bus: &Bus, device: &mut Device) {
        let Some(start) = self.find(bus, device, CategoryKind::Fmmu).await else { return };
        let count = self.word(bus, device, start).await * 2;
        let read = if count > 2 { 4 } else { 2 };
        for at in 0..read {
            self.byte(bus, device, start + 2 + at).await;
        }
    }

    /// Bits of the PDOs of one direction in each `SyncManager` (`ecx_siiPDO`).
    pub(super) async fn pdos(
        &mut self,
        bus: &Bus,
        device: &mut Device,
        kind: CategoryKind,
    ) -> Mapping {
        let mut mapping = Mapping::default();
        let was_at_pdi = device.eeprom_at_pdi;
        let Some(start) = self.find(bus, device, kind).await else { return mapping };
        let words = self.word(bus, device, start).await;
        let (mut at, mut taken) = (start + 2, 1);
        for _ in 1..PDOS {
            self.word(bus, device, at).await;
            let entries = u16::from(self.byte(bus, device, at + 2).await);
            let in_sm = usize::from(self.byte(bus, device, at + 3).await);
            at = at.saturating_add(8);
            if let Some(bits) = mapping.get_mut(in_sm) {
                for entry in 0..entries {
                    *bits +=
                        u32::from(self.byte(bus, device, at.saturating_add(8 * entry + 5)).await);
                }
            }
            at = at.saturating_add(8 * entries);
            taken += 4 + 4 * entries;
            if taken >= words || at >= BYTES {
                break;
            }
        }
        if was_at_pdi {
            to_pdi(bus, device).await;
        }
        mapping
    }
}
