//! The configuration of a SyncManager: eight bytes at 0x0800 + 8 n.
//!
//! Reference: S2 2.14; what buffered and mailbox mode do is in S1, SyncManager.

use std::fmt;

use super::bits::bits;
use crate::address::RegisterAddress;

/// The eight bytes of a SyncManager.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct SyncManagerConfig {
    /// First byte that is guarded. Any access must begin here.
    pub start: RegisterAddress,
    /// Bytes of one buffer. 0 acts like switched off; 1 is not buffered.
    pub length: u16,
    /// Mode, direction, events, watchdog.
    pub control: SmControl,
    /// What it is doing; read-only.
    pub status: SmStatus,
    /// On or off, and the repeat request of a mailbox.
    pub activate: SmActivate,
    /// The SubDevice's side; read-only for a MainDevice.
    pub pdi_control: SmPdiControl,
}

impl SyncManagerConfig {
    /// Length of the configuration in bytes.
    pub const LEN: usize = 8;

    /// A SyncManager that is switched on.
    #[must_use]
    pub const fn enabled(start: RegisterAddress, length: u16, control: SmControl) -> Self {
        Self {
            start,
            length,
            control,
            status: SmStatus(0),
            activate: SmActivate(1),
            pdi_control: SmPdiControl(0),
        }
    }

    /// From the eight bytes.
    #[must_use]
    pub const fn from_bytes(bytes: [u8; Self::LEN]) -> Self {
        let [start_0, start_1, length_0, length_1, control, status, activate, pdi_control] = bytes;
        Self {
            start: RegisterAddress(u16::from_le_bytes([start_0, start_1])),
            length: u16::from_le_bytes([length_0, length_1]),
            control: SmControl(control),
            status: SmStatus(status),
            activate: SmActivate(activate),
            pdi_control: SmPdiControl(pdi_control),
        }
    }

    /// The eight bytes. A MainDevice may write them all: status and PDI control ignore it.
    #[must_use]
    pub const fn to_bytes(self) -> [u8; Self::LEN] {
        let [start_0, start_1] = self.start.0.to_le_bytes();
        let [length_0, length_1] = self.length.to_le_bytes();
        [
            start_0,
            start_1,
            length_0,
            length_1,
            self.control.0,
            self.status.0,
            self.activate.0,
            self.pdi_control.0,
        ]
    }

    /// Whether it guards anything: switched on, not switched off by the SubDevice, not empty.
    #[must_use]
    pub const fn is_active(&self) -> bool {
        self.activate.enable() && !self.pdi_control.deactivated() && self.length > 0
    }

    /// Bytes of memory it takes: three buffers in buffered mode, one otherwise. Controllers that
    /// are wider inside than a byte want the next range to begin at a multiple of 8.
    #[must_use]
    pub const fn memory_len(&self) -> u32 {
        match self.control.mode() {
            SmMode::Buffered if self.length > 1 => self.length as u32 * 3,
            SmMode::Buffered | SmMode::Mailbox | SmMode::Reserved(_) => self.length as u32,
        }
    }

    /// Whether a range of memory has a byte in common with the buffer that accesses go to.
    #[must_use]
    pub const fn touches(&self, start: RegisterAddress, length: u16) -> bool {
        let (from, to) = (self.start.0 as u32, self.start.0 as u32 + self.length as u32);
        let (other_from, other_to) = (start.0 as u32, start.0 as u32 + length as u32);
        from < other_to && other_from < to
    }
}

impl fmt::Display for SyncManagerConfig {
    /// `0x1000, 128 bytes, mailbox, MainDevice writes, on`; `off` for one that was never set up.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.length == 0 && !self.activate.enable() {
            return f.write_str("off");
        }
        let bytes = if self.length == 1 { "byte" } else { "bytes" };
        let (mode, direction) = (self.control.mode(), self.control.direction());
        write!(f, "{}, {} {bytes}, {mode}, {direction}, ", self.start, self.length)?;
        f.write_str(match (self.activate.enable(), self.pdi_control.deactivated()) {
            (false, _) => "off",
            (true, false) => "on",
            (true, true) => "locked by the SubDevice",
        })
    }
}

/// How the register table writes this register.
pub(super) fn view(offset: u16, data: &[u8]) -> Option<String> {
    let bytes = data.first_chunk().filter(|_| offset == 0)?;
    Some(SyncManagerConfig::from_bytes(*bytes).to_string())
}

/// The control byte, offset 4. It can be written only while the SyncManager is off.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct SmControl(pub u8);

impl SmControl {
    /// Mailbox from MainDevice to SubDevice: mailbox, MainDevice writes, AL event.
    pub const MAILBOX_OUT: Self = Self(0x26);
    /// Mailbox from SubDevice to MainDevice: mailbox, MainDevice reads, AL event.
    pub const MAILBOX_IN: Self = Self(0x22);
    /// Outputs with watchdog and AL event.
    pub const OUTPUTS: Self = Self(0x64);
    /// Outputs with AL event, without watchdog.
    pub const OUTPUTS_WITHOUT_WATCHDOG: Self = Self(0x24);
    /// Outputs with watchdog, without AL event: controllers that drive outputs themselves.
    pub const OUTPUTS_WITHOUT_EVENT: Self = Self(0x44);
    /// Inputs with AL event.
    pub const INPUTS: Self = Self(0x20);
    /// Inputs without AL event: controllers that read inputs themselves.
    pub const INPUTS_WITHOUT_EVENT: Self = Self(0x00);

    /// The mode, bits 1 and 0.
    #[must_use]
    pub const fn mode(self) -> SmMode {
        match self.0 & 0b11 {
            0 => SmMode::Buffered,
            2 => SmMode::Mailbox,
            reserved => SmMode::Reserved(reserved),
        }
    }

    /// The direction, bits 3 and 2.
    #[must_use]
    pub const fn direction(self) -> SmDirection {
        match self.0 >> 2 & 0b11 {
            0 => SmDirection::MainDeviceReads,
            1 => SmDirection::MainDeviceWrites,
            reserved => SmDirection::Reserved(reserved),
        }
    }

    bits! {
        u8;
        /// Whether its events appear in the ECAT event request.
        4 ecat_event with_ecat_event;
        /// Whether its events appear in the AL event request.
        5 al_event with_al_event;
        /// Whether a complete write starts the process data watchdog anew.
        6 watchdog with_watchdog;
        /// Whether a MainDevice must write it from start to end in order.
        7 sequential with_sequential;
    }
}

/// How a SyncManager exchanges data.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum SmMode {
    /// Three buffers: the writer is never held up, the reader gets the last complete one.
    Buffered,
    /// One buffer that is full or empty: nothing is lost, both sides take turns.
    Mailbox,
    /// A value without a meaning: 1 or 3.
    Reserved(u8),
}

impl fmt::Display for SmMode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Buffered => f.write_str("buffered"),
            Self::Mailbox => f.write_str("mailbox"),
            Self::Reserved(bits) => write!(f, "unknown mode ({bits})"),
        }
    }
}

/// Who writes into a SyncManager.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum SmDirection {
    /// The SubDevice writes, the MainDevice reads: inputs, mailbox in.
    MainDeviceReads,
    /// The MainDevice writes, the SubDevice reads: outputs, mailbox out.
    MainDeviceWrites,
    /// A value without a meaning: 2 or 3.
    Reserved(u8),
}

impl fmt::Display for SmDirection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::MainDeviceReads => f.write_str("MainDevice reads"),
            Self::MainDeviceWrites => f.write_str("MainDevice writes"),
            Self::Reserved(bits) => write!(f, "unknown direction ({bits})"),
        }
    }
}

/// The status byte, offset 5.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct SmStatus(pub u8);

impl SmStatus {
    /// The value after a reset: no buffer written.
    pub const RESET: Self = Self(0x30);

    bits! {
        u8;
        /// Whether it was written completely and not yet read.
        0 written with_written;
        /// Whether it was read completely and not yet written.
        1 read with_read;
        /// Whether it was written out of order, in sequential mode.
        2 sequence_violation with_sequence_violation;
        /// Whether the mailbox holds a message.
        3 mailbox_full with_mailbox_full;
        /// Whether a buffer is being read.
        6 read_open with_read_open;
        /// Whether a buffer is being written.
        7 write_open with_write_open;
    }

    /// The buffer that was last written, 0..=2; `None` before the first. For buffered mode.
    #[must_use]
    pub const fn last_buffer(self) -> Option<u8> {
        match self.0 >> 4 & 0b11 {
            3 => None,
            buffer => Some(buffer),
        }
    }

    /// This status with another last buffer; a number above 2 means none.
    #[must_use]
    pub const fn with_last_buffer(self, buffer: Option<u8>) -> Self {
        let bits = match buffer {
            Some(buffer) if buffer < 3 => buffer,
            Some(_) | None => 3,
        };
        Self(self.0 & !0x30 | bits << 4)
    }
}

impl Default for SmStatus {
    fn default() -> Self {
        Self::RESET
    }
}

/// The activate byte, offset 6.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct SmActivate(pub u8);

impl SmActivate {
    bits! {
        u8;
        /// Whether the SyncManager is switched on.
        0 enable with_enable;
        /// Toggled by a MainDevice that lost a mailbox message and wants it again.
        1 repeat_request with_repeat_request;
        /// Whether a buffer exchange by the MainDevice is time-stamped.
        6 latch_ecat with_latch_ecat;
        /// Whether a buffer exchange by the SubDevice is time-stamped.
        7 latch_pdi with_latch_pdi;
    }
}

/// The PDI control byte, offset 7.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default, Debug)]
pub struct SmPdiControl(pub u8);

impl SmPdiControl {
    bits! {
        u8;
        /// Whether the SubDevice locked the guarded memory: accesses add nothing to the working
        /// counter.
        0 deactivated with_deactivated;
        /// Equal to the repeat request once the message is in the mailbox again.
        1 repeat_acknowledge with_repeat_acknowledge;
        /// Whether the SubDevice may finish reading after the SyncManager is switched off.
        6 deactivation_delay with_deactivation_delay;
        /// Whether it is off and the SubDevice still reads.
        7 deactivation_pending with_deactivation_pending;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::register::table::SYNC_MANAGER;
    use proptest::prelude::*;

    #[test]
    fn the_usual_control_bytes_mean_what_their_names_say() {
        use SmDirection::{MainDeviceReads, MainDeviceWrites};
        use SmMode::{Buffered, Mailbox};
        // control, mode, direction, AL event, watchdog
        let table = [
            (SmControl::MAILBOX_OUT, Mailbox, MainDeviceWrites, true, false),
            (SmControl::MAILBOX_IN, Mailbox, MainDeviceReads, true, false),
            (SmControl::OUTPUTS, Buffered, MainDeviceWrites, true, true),
            (SmControl::OUTPUTS_WITHOUT_WATCHDOG, Buffered, MainDeviceWrites, true, false),
            (SmControl::OUTPUTS_WITHOUT_EVENT, Buffered, MainDeviceWrites, false, true),
            (SmControl::INPUTS, Buffered, MainDeviceReads, true, false),
            (SmControl::INPUTS_WITHOUT_EVENT, Buffered, MainDeviceReads, false, false),
        ];
        for (control, mode, direction, al_event, watchdog) in table {
            assert_eq!(control.mode(), mode, "{control:?}");
            assert_eq!(control.direction(), direction, "{control:?}");
            assert_eq!(control.al_event(), al_event, "{control:?}");
            assert_eq!(control.watchdog(), watchdog, "{control:?}");
            assert!(!control.ecat_event() && !control.sequential(), "{control:?}");
        }
        assert_eq!(SmControl(0x01).mode(), SmMode::Reserved(1));
        assert_eq!(SmControl(0x0C).direction(), SmDirection::Reserved(3));
    }

    #[test]
    fn a_mailbox_as_a_drive_describes_it() {
        // SyncManager 0 of a drive's SII: 0x1800, 1024 bytes, control 0x26.
        let config =
            SyncManagerConfig::enabled(RegisterAddress(0x1800), 1024, SmControl::MAILBOX_OUT);
        assert_eq!(config.to_bytes(), [0x00, 0x18, 0x00, 0x04, 0x26, 0x00, 0x01, 0x00]);
        assert!(config.is_active());
        assert_eq!(config.memory_len(), 1024);
        assert_eq!(config.to_string(), "0x1800, 1024 bytes, mailbox, MainDevice writes, on");
        assert_eq!(SyncManagerConfig::default().to_string(), "off");
        let outputs = SyncManagerConfig::enabled(RegisterAddress(0x1100), 6, SmControl::OUTPUTS);
        assert_eq!(outputs.memory_len(), 18);
        let bit = SyncManagerConfig::enabled(RegisterAddress(0x0F00), 1, SmControl::OUTPUTS);
        assert_eq!(bit.memory_len(), 1);
    }

    #[test]
    fn sync_manager_is_inactive_without_activation_or_length() {
        let on = SyncManagerConfig::enabled(RegisterAddress(0x1000), 8, SmControl::INPUTS);
        assert!(on.is_active());
        assert!(!SyncManagerConfig { activate: SmActivate(0), ..on }.is_active());
        assert!(!SyncManagerConfig { length: 0, ..on }.is_active());
        let locked = on.pdi_control.with_deactivated(true);
        assert!(!SyncManagerConfig { pdi_control: locked, ..on }.is_active());
    }

    #[test]
    fn it_guards_its_first_buffer_only() {
        let config = SyncManagerConfig::enabled(RegisterAddress(0x1000), 8, SmControl::INPUTS);
        let touches = |start, length| config.touches(RegisterAddress(start), length);
        assert!(touches(0x1000, 8) && touches(0x1007, 1) && touches(0x0FFF, 2));
        assert!(!touches(0x1008, 8) && !touches(0x0FF8, 8) && !touches(0x1000, 0));
        let last = SyncManagerConfig::enabled(RegisterAddress(0xFFFF), 1, SmControl::INPUTS);
        assert!(last.touches(RegisterAddress(0xFFFF), 1));
    }

    #[test]
    fn status_after_reset_has_no_buffer() {
        assert_eq!(SmStatus::default().last_buffer(), None);
        let status = SmStatus::RESET.with_last_buffer(Some(2)).with_mailbox_full(true);
        assert_eq!(status, SmStatus(0x28));
        assert_eq!(status.last_buffer(), Some(2));
        assert_eq!(status.with_last_buffer(None), SmStatus(0x38));
    }

    /// The register table and these types number the bits alike.
    #[test]
    fn bits_agree_with_the_register_table() {
        let byte = |offset: u16, name: &str| {
            let low = SYNC_MANAGER.field(name).unwrap().low;
            1u8 << (low - 8 * offset)
        };
        let control = SmControl(0);
        assert_eq!(control.with_ecat_event(true).0, byte(4, "ECAT interrupt"));
        assert_eq!(control.with_al_event(true).0, byte(4, "PDI interrupt"));
        assert_eq!(control.with_watchdog(true).0, byte(4, "watchdog trigger"));
        assert_eq!(control.with_sequential(true).0, byte(4, "sequential mode"));
        let status = SmStatus(0);
        assert_eq!(status.with_written(true).0, byte(5, "written"));
        assert_eq!(status.with_read(true).0, byte(5, "read"));
        assert_eq!(status.with_sequence_violation(true).0, byte(5, "sequence violation"));
        assert_eq!(status.with_mailbox_full(true).0, byte(5, "mailbox full"));
        assert_eq!(status.with_read_open(true).0, byte(5, "read buffer open"));
        assert_eq!(status.with_write_open(true).0, byte(5, "write buffer open"));
        let activate = SmActivate(0);
        assert_eq!(activate.with_enable(true).0, byte(6, "enabled"));
        assert_eq!(activate.with_repeat_request(true).0, byte(6, "repeat request"));
        assert_eq!(activate.with_latch_ecat(true).0, byte(6, "latch event ECAT"));
        assert_eq!(activate.with_latch_pdi(true).0, byte(6, "latch event PDI"));
        let pdi = SmPdiControl(0);
        assert_eq!(pdi.with_deactivated(true).0, byte(7, "deactivated by PDI"));
        assert_eq!(pdi.with_repeat_acknowledge(true).0, byte(7, "repeat acknowledge"));
        assert_eq!(pdi.with_deactivation_delay(true).0, byte(7, "deactivation delay"));
        assert_eq!(pdi.with_deactivation_pending(true).0, byte(7, "deactivation pending"));
    }

    proptest! {
        #[test]
        fn any_eight_bytes_go_both_ways(bytes: [u8; 8]) {
            prop_assert_eq!(SyncManagerConfig::from_bytes(bytes).to_bytes(), bytes);
        }
    }
}
