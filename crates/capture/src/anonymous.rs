//! Anonymising of frames, so that a recording can be given away without saying whose machine it shows.
//!
//! Process data, parameters and files become zeros; serial numbers and addresses of network cards become others, the same
//! one always the same. Lengths, addresses, working counters, states and error counters stay: what they tell of the line
//! stays true.

use std::collections::BTreeMap;

use linesman_diagnosis::main_device::kind::is_fixed_source;
use linesman_proto::command::{Addressing, Command};
use linesman_proto::ethernet::{self, MacAddress, Wrapping};
use linesman_proto::frame::FrameView;
use linesman_proto::mailbox::{Header, MailboxType};
use linesman_proto::register;

/// Length of the header of a datagram, and of its working counter.
const DATAGRAM_HEADER: usize = 10;
const WORKING_COUNTER: usize = 2;
/// Registers of the SII interface (ETG.1000.4 §6.4): its control, the address of a word, and data.
const SII_CONTROL: usize = register::SII_CONTROL_STATUS.address.0 as usize;
const SII_ADDRESS: usize = register::SII_ADDRESS.address.0 as usize;
const SII_DATA: usize = register::SII_DATA.address.0 as usize;
const SII_END: usize = SII_DATA + 8;
/// Bit of the control register: a read gives eight bytes, else four.
const READS_EIGHT_BYTES: u8 = 0x40;
/// Bit of its upper byte: it is at work.
const BUSY: u8 = 0x80;
/// The words with the serial number (ETG.2010, table 2).
const SERIAL_WORDS: [u32; 2] = [0x0E, 0x0F];
/// Digital inputs and outputs and user memory begin here; all registers that a diagnosis reads lie before.
const USER_MEMORY: usize = 0x0F00;
/// Memory with mailboxes and process data begins here.
const MEMORY: usize = 0x1000;
/// Identity object (ETG.1000.6 §5.6.7.4), and the entry with the serial number.
const IDENTITY: u16 = 0x1018;
const SERIAL_ENTRY: u8 = 4;
/// Place of the serial number in all of the identity object: behind the number of entries, and three entries.
const SERIAL_IN_IDENTITY: usize = 14;
/// Modules that are configured and detected: identities of types.
const MODULES: [u16; 2] = [0xF030, 0xF050];
/// Block of MAC addresses that nobody has: 00-00-5E-53.
const NOBODY: [u8; 4] = [0x00, 0x00, 0x5E, 0x53];

/// Counts of what was replaced.
#[derive(Clone, Copy, PartialEq, Eq, Default, Debug)]
pub struct Replaced {
    /// Datagrams whose process data became zeros.
    pub process_data: u64,
    /// Mailbox messages whose contents became zeros.
    pub mailbox_messages: u64,
    /// Frames without EtherCAT whose contents became zeros.
    pub foreign_frames: u64,
}

/// Replacement of what tells whose machine it is, in the frames of one recording.
#[derive(Default, Debug)]
pub struct FrameAnonymiser {
    serials: BTreeMap<u32, u32>,
    macs: BTreeMap<[u8; 6], u16>,
    /// The SII word that was asked for last, by the kind of address and the address.
    sii: BTreeMap<(u8, u16), u32>,
    /// The object of the SDO transfer that was begun last.
    objects: BTreeMap<(u8, u16), u16>,
    replaced: Replaced,
}

/// Whom a datagram means.
type Addressee = (u8, u16);

impl FrameAnonymiser {
    /// The number for a serial number; 0, which says that there is none, stays.
    pub fn serial(&mut self, serial: u32) -> u32 {
        if serial == 0 {
            return 0;
        }
        let next = self.serials.len() as u32 + 1;
        *self.serials.entry(serial).or_insert(next)
    }

    /// Different serial numbers so far.
    #[must_use]
    pub fn serials(&self) -> u64 {
        self.serials.len() as u64
    }

    /// Different addresses of network cards so far.
    #[must_use]
    pub fn macs(&self) -> u64 {
        self.macs.len() as u64
    }

    /// Counts so far.
    #[must_use]
    pub const fn replaced(&self) -> Replaced {
        self.replaced
    }

    /// Replaces in a frame. What cannot be taken apart becomes zeros.
    pub fn frame(&mut self, frame: &mut [u8]) {
        for at in [0, 6] {
            self.mac(frame, at);
        }
        let located = ethernet::locate(frame);
        if let Some((Wrapping::Udp, at)) = located {
            anonymise_ip(frame, at);
        }
        let Ok(view) = FrameView::parse(frame) else {
            self.replaced.foreign_frames += 1;
            if let Some(payload) = frame.get_mut(16..) {
                payload.fill(0);
            }
            return;
        };
        let mut parts = Vec::new();
        let mut rest = located.map_or(14, |(_, at)| at) + 2;
        let mut is_whole = true;
        for datagram in view.datagrams() {
            let Ok(datagram) = datagram else {
                is_whole = false;
                break;
            };
            let data = datagram.data_range();
            rest = data.end + WORKING_COUNTER;
            let addressing = datagram.command().map(Command::addressing);
            parts.push((addressing, datagram.adp(), usize::from(datagram.ado().0), data));
        }
        // Of a datagram that is cut off the header stays.
        let rest = if is_whole { rest } else { rest + DATAGRAM_HEADER };
        for (addressing, adp, ado, data) in parts {
            let Some(data) = frame.get_mut(data) else { continue };
            match addressing {
                Some(Addressing::Logical) => self.process_data(data),
                Some(Addressing::Position) => self.physical((0, adp), ado, data),
                Some(Addressing::Station) => self.physical((1, adp), ado, data),
                Some(Addressing::Broadcast) => self.physical((2, adp), ado, data),
                Some(Addressing::None) | None => data.fill(0),
            }
        }
        if let Some(rest) = frame.get_mut(rest..) {
            rest.fill(0);
        }
    }

    fn mac(&mut self, frame: &mut [u8], at: usize) {
        let Some(bytes) = frame.get_mut(at..at + 6).and_then(|bytes| bytes.first_chunk_mut())
        else {
            return;
        };
        let address = MacAddress(*bytes);
        if address.0[0] & 1 != 0 || address.0 == [0; 6] || is_fixed_source(address) {
            return;
        }
        let next = u16::try_from(self.macs.len()).unwrap_or(u16::MAX);
        let number = *self.macs.entry(address.marked().0).or_insert(next);
        let [high, low] = number.to_be_bytes();
        let [a, b, c, d] = NOBODY;
        let new = MacAddress([a, b, c, d, high, low]);
        *bytes = if address.is_marked() { new.marked().0 } else { new.0 };
    }

    fn process_data(&mut self, data: &mut [u8]) {
        data.fill(0);
        self.replaced.process_data += 1;
    }

    /// Data at an address of a controller.
    fn physical(&mut self, key: Addressee, ado: usize, data: &mut [u8]) {
        if ado < SII_END && ado + data.len() > SII_CONTROL {
            self.sii(key, ado, data);
        }
        if ado >= MEMORY {
            self.memory(key, data);
        } else if let Some(user) = data.get_mut(USER_MEMORY.saturating_sub(ado)..) {
            user.fill(0);
        }
    }

    /// Registers of the SII interface.
    fn sii(&mut self, key: Addressee, ado: usize, data: &mut [u8]) {
        let at = |register: usize| register.checked_sub(ado);
        // A request to read holds nothing yet.
        let is_filled = data.iter().any(|byte| *byte != 0);
        let stated = at(SII_ADDRESS).and_then(|at| data.get(at..)?.first_chunk());
        let stated = stated.filter(|_| is_filled);
        if let Some(word) = stated.map(|bytes| u32::from_le_bytes(*bytes)) {
            self.sii.insert(key, word);
        }
        let asked = self.sii.get(&key).copied();
        let control = at(SII_CONTROL).and_then(|at| data.get(at)).copied();
        let is_short = control.is_some_and(|control| control & READS_EIGHT_BYTES == 0);
        if let Some(behind) =
            at(SII_DATA + 4).and_then(|at| data.get_mut(at..)).filter(|_| is_short)
        {
            behind.fill(0);
        }
        // While it works on the next words, the data are those of the last ones.
        let is_busy =
            at(SII_CONTROL + 1).and_then(|at| data.get(at)).is_some_and(|high| high & BUSY != 0);
        if let Some(last) = at(SII_DATA).and_then(|at| data.get_mut(at..)).filter(|_| is_busy) {
            last.fill(0);
        }
        let from = at(SII_DATA).unwrap_or(0).min(data.len());
        let until = (SII_END - ado).min(data.len());
        let first = ado + from - SII_DATA.min(ado + from);
        let Some(words) = data.get_mut(from..until) else { return };
        let Some(asked) = asked else {
            words.fill(0);
            return;
        };
        let place = |index: usize| asked.saturating_add(((first + index) / 2) as u32);
        let is_serial = |index: &usize| SERIAL_WORDS.contains(&place(*index));
        let found: Vec<usize> = (0..words.len()).filter(is_serial).collect();
        let whole = found.first().and_then(|first| words.get_mut(*first..)?.first_chunk_mut());
        match whole {
            Some(bytes) if found.len() == 4 => {
                *bytes = self.serial(u32::from_le_bytes(*bytes)).to_le_bytes();
            }
            // Half a number tells half of it.
            Some(_) | None => found.iter().for_each(|index| words[*index] = 0),
        }
    }

    /// Memory with a mailbox, or with process data.
    fn memory(&mut self, key: Addressee, data: &mut [u8]) {
        if data.iter().all(|byte| *byte == 0) {
            return;
        }
        let header = Header::parse(data).ok();
        let end = header.map(|header| 6 + usize::from(header.length));
        let (Some(header), Some(end)) = (header, end.filter(|end| *end <= data.len())) else {
            return self.process_data(data);
        };
        // Behind the message lies what came before it.
        let (message, behind) = data.split_at_mut(end);
        behind.fill(0);
        let body = &mut message[6..];
        let kept = match header.kind {
            MailboxType::Error => return,
            MailboxType::Coe => return self.coe(key, body),
            MailboxType::Eoe | MailboxType::Soe => 4,
            MailboxType::Foe => 6,
            MailboxType::Aoe | MailboxType::Voe => 0,
            MailboxType::Reserved(_) => return self.process_data(data),
        };
        self.blank(body, kept);
    }

    /// Contents of a message behind its header of so many bytes.
    fn blank(&mut self, body: &mut [u8], header: usize) {
        if let Some(contents) = body.get_mut(header..).filter(|contents| !contents.is_empty()) {
            contents.fill(0);
            self.replaced.mailbox_messages += 1;
        }
    }

    /// A message of CoE (ETG.1000.6 §5.6.1): its service in the upper four bits of its header.
    fn coe(&mut self, key: Addressee, body: &mut [u8]) {
        const EMERGENCY: u8 = 1;
        const SDO_REQUEST: u8 = 2;
        const SDO_RESPONSE: u8 = 3;
        const INFORMATION: u8 = 8;
        let Some(service) = body.get(1).map(|byte| byte >> 4) else { return };
        match service {
            EMERGENCY | INFORMATION => {}
            SDO_REQUEST | SDO_RESPONSE => self.sdo(key, service == SDO_RESPONSE, body),
            _ => self.blank(body, 2),
        }
    }

    fn sdo(&mut self, key: Addressee, is_response: bool, body: &mut [u8]) {
        const SEGMENT: u8 = 0;
        const ABORT: u8 = 4;
        let Some([command, low, high, entry]) =
            body.get(2..).and_then(|sdo| sdo.first_chunk()).copied()
        else {
            return;
        };
        let specifier = command >> 5;
        let carries = if is_response { 2 } else { 1 };
        if specifier == SEGMENT {
            // A segment: its data begin behind the command.
            if !self.objects.get(&key).is_some_and(|object| is_kept(*object)) {
                self.blank(body, 3);
            }
            return;
        }
        if specifier == ABORT || (specifier != carries && is_response) {
            return;
        }
        let object = u16::from_le_bytes([low, high]);
        self.objects.insert(key, object);
        if specifier != carries {
            return;
        }
        let is_expedited = command & 0x02 != 0;
        let is_complete = command & 0x10 != 0;
        let data = if is_expedited { 6 } else { 10 };
        if object == IDENTITY {
            self.identity(body, data, is_complete, entry);
        } else if !is_kept(object) {
            self.blank(body, data);
        }
    }

    fn identity(&mut self, body: &mut [u8], data: usize, is_complete: bool, entry: u8) {
        let at = match (is_complete, entry) {
            (false, SERIAL_ENTRY) => data,
            (false, _) => return,
            (true, 0) => data + SERIAL_IN_IDENTITY,
            (true, _) => data + SERIAL_IN_IDENTITY - 2,
        };
        match body.get_mut(at..).and_then(|bytes| bytes.first_chunk_mut()) {
            Some(bytes) => *bytes = self.serial(u32::from_le_bytes(*bytes)).to_le_bytes(),
            None => {
                if let Some(rest) = body.get_mut(at..) {
                    rest.fill(0);
                }
            }
        }
    }
}

/// True if an object is about the device's type and its communication: the communication area (ETG.1000.6, table 66),
/// and the modules.
fn is_kept(object: u16) -> bool {
    (0x1000..0x2000).contains(&object) || MODULES.contains(&object)
}

/// Replaces the IP addresses of a frame of EtherCAT over UDP by those for documentation. Its EtherCAT data
/// begin at `at`.
fn anonymise_ip(frame: &mut [u8], at: usize) {
    const IP_AND_UDP: usize = 28;
    let start = at.saturating_sub(IP_AND_UDP);
    let Some(headers) = frame.get_mut(start..at).and_then(|bytes| bytes.first_chunk_mut()) else {
        return;
    };
    let headers: &mut [u8; IP_AND_UDP] = headers;
    for (from, last) in [(12, 1), (16, 2)] {
        // Broadcasts and multicasts are nobody's.
        if headers[from] < 224 {
            headers[from..from + 4].copy_from_slice(&[192, 0, 2, last]);
        }
    }
    headers[10..12].fill(0);
    let words = headers[..20].as_chunks::<2>().0;
    let sum: u32 = words.iter().map(|word| u32::from(u16::from_be_bytes(*word))).sum();
    let folded = (sum & 0xFFFF) + (sum >> 16);
    let checksum = !(((folded & 0xFFFF) + (folded >> 16)) as u16);
    headers[10..12].copy_from_slice(&checksum.to_be_bytes());
    // 0: none was computed.
    headers[26..28].fill(0);
}

#[cfg(test)]
mod tests;
