//! A line of devices that answer from a recording.
//!
//! What a register reads is what it read on the real line before anything had written it, or what was
//! written since. Beyond that, this follows from what was recorded:
//!
//! * positions and station addresses: who is there, in which order, and which address was given;
//! * which registers are there: those that answered alone, and those that all or none answered. Where
//!   only some answered a broadcast it is not known who, and nobody is taken to have the register;
//! * numbers of FMMUs and SyncManagers (0x0004, 0x0005): as many as each device has for sure;
//! * AL status: the real status, after the real time. Where AL status mirrored AL control, error bit
//!   included, it does so here. A step is made with the SyncManagers and the mapped memory with which the real
//!   device made it, else it is a breach. INIT is heard in every state (ETG.1000.6);
//! * AL status code and the word before it, where only AL status was recorded: 0 without an error;
//! * SII commands: the recorded words after the recorded times, busy until then. A command to an EEPROM
//!   that is busy, or that was handed to the processor, is a breach, and so is a word never recorded;
//! * the EEPROM's address register (0x0504 to 0x0507), which no recording reads: what was written to it
//!   last, 0 at first (S2 2.8);
//! * the mailbox: the recorded answer to the same request, with a counter that goes on, after the
//!   recorded times. A request that was never recorded is a breach;
//! * SyncManagers: locked while they are on, status bits but "full" as 0;
//! * FMMUs: as S2 says, bit by bit. Outputs are kept, inputs were never recorded;
//! * other bytes of 0x0000 to 0x0009: 0.
//!
//! Everything else that is asked and was never recorded is not answered, and is listed. It cannot judge
//! what no recording shows: EK1914 and EL3004 beyond PREOP, receive times and clocks, lost frames;
//! EEPROMs are read only.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::FrameView;
use linesman_proto::register as r;
use linesman_proto::time::Instant;

use crate::device::{Device, Remarks};
use crate::tape::Tape;

/// The first byte of the source address, which a controller marks.
const SOURCE: usize = 6;

pub(crate) struct Responder {
    devices: Vec<Device>,
    pub(crate) remarks: Remarks,
}

/// One datagram, cut out of its frame.
struct Access {
    command: Command,
    adp: u16,
    ado: u16,
    logical: u32,
    data: std::ops::Range<usize>,
    /// Where the address is in the frame.
    address_at: usize,
}

impl Responder {
    pub(crate) fn of(tapes: Vec<Tape>) -> Self {
        let devices = tapes.into_iter().enumerate().map(|(at, tape)| Device::new(at + 1, tape));
        Self { devices: devices.collect(), remarks: Remarks::default() }
    }

    pub(crate) fn states(&self) -> Vec<u8> {
        self.devices.iter().map(|device| device.word(r::AL_STATUS.address.0) as u8).collect()
    }

    /// What lies in the memory of the device `at`.
    pub(crate) fn memory(&self, at: usize, address: u16) -> u8 {
        self.devices[at].byte(address)
    }

    /// Turns a frame into what comes back.
    pub(crate) fn answer(&mut self, now: Instant, frame: &mut [u8]) {
        let accesses: Vec<Access> = FrameView::parse(frame)
            .unwrap()
            .datagrams()
            .map(|datagram| {
                let datagram = datagram.unwrap();
                Access {
                    command: datagram.command().unwrap(),
                    adp: datagram.adp(),
                    ado: datagram.ado().0,
                    logical: datagram.logical().0,
                    data: datagram.data_range(),
                    address_at: datagram.offset() + 2,
                }
            })
            .collect();
        frame[SOURCE] |= 0x02;
        for access in accesses {
            let sent = frame[access.data.clone()].to_vec();
            let mut data = sent.clone();
            let mut position = access.adp;
            let mut wkc = 0_u16;
            for device in &mut self.devices {
                let remarks = &mut self.remarks;
                wkc += pass(device, now, &access, position, &sent, &mut data, remarks);
                if access.command.increments_position() {
                    position = position.wrapping_add(1);
                }
            }
            frame[access.data.clone()].copy_from_slice(&data);
            if access.command.increments_position() {
                frame[access.address_at..access.address_at + 2]
                    .copy_from_slice(&position.to_le_bytes());
            }
            let at = access.data.end;
            frame[at..at + 2].copy_from_slice(&wkc.to_le_bytes());
        }
    }
}

/// A datagram passes a device; gives what it adds to the working counter.
fn pass(
    device: &mut Device,
    now: Instant,
    access: &Access,
    position: u16,
    sent: &[u8],
    data: &mut [u8],
    remarks: &mut Remarks,
) -> u16 {
    let station = device.word(r::STATION_ADDRESS.address.0);
    let effect = access.command.effect();
    let meant = match access.command.addressing() {
        Addressing::Position => position == 0,
        Addressing::Station => station != 0 && access.adp == station,
        Addressing::Broadcast => true,
        Addressing::Logical => {
            let both = (effect.reads, effect.writes);
            let (reads, writes) = device.map(now, access.logical, sent, data, both, remarks);
            return access.command.increment(reads, writes);
        }
        Addressing::None => false,
    };
    // Of those that read in one and write in the others, a device does one of both.
    let (reads, writes) = match effect.multiple_write {
        true => (meant, !meant),
        false => (meant && effect.reads, meant && effect.writes),
    };
    let broadcast = access.command.addressing() == Addressing::Broadcast;
    let mut did = (false, false);
    if reads && let Some(bytes) = device.read(now, access.ado, data.len(), remarks) {
        did.0 = true;
        for (byte, value) in data.iter_mut().zip(bytes) {
            *byte = if broadcast { *byte | value } else { value };
        }
    }
    if writes {
        let written = if effect.multiple_write { data.to_vec() } else { sent.to_vec() };
        let alone = !broadcast && !effect.multiple_write;
        did.1 = device.write(now, access.ado, &written, alone, remarks);
    }
    match effect.multiple_write {
        // One for either, S1, commands.
        true => u16::from(did.0 || did.1),
        false => access.command.increment(did.0, did.1),
    }
}
