//! The fifteen datagram commands: who is addressed, what each does to data, address and working
//! counter.
//!
//! Reference: ETG.1000.4 as cited in S1 chapter 2. [`Command::effect`] is the table; everything
//! else in this file reads it.

use std::fmt;

/// A datagram command. The discriminant is the code on the wire.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
#[repr(u8)]
pub enum Command {
    /// No operation: passes every controller untouched.
    Nop = 0,
    /// Auto-increment physical read.
    Aprd = 1,
    /// Auto-increment physical write.
    Apwr = 2,
    /// Auto-increment physical read, then write.
    Aprw = 3,
    /// Configured-address (station) physical read.
    Fprd = 4,
    /// Configured-address physical write.
    Fpwr = 5,
    /// Configured-address physical read, then write.
    Fprw = 6,
    /// Broadcast read: every controller ORs its memory into the data.
    Brd = 7,
    /// Broadcast write.
    Bwr = 8,
    /// Broadcast read by OR, then write of what came in.
    Brw = 9,
    /// Logical read through FMMUs.
    Lrd = 10,
    /// Logical write through FMMUs.
    Lwr = 11,
    /// Logical read and write through FMMUs.
    Lrw = 12,
    /// Auto-increment physical read, multiple write: one gives, all others take.
    Armw = 13,
    /// Configured-address physical read, multiple write.
    Frmw = 14,
}

/// How a command says whom it means.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Addressing {
    /// Nobody.
    None,
    /// The controller that sees ADP = 0; each adds one on the way.
    Position,
    /// The controller whose station address (or enabled alias) equals ADP.
    Station,
    /// All; each adds one to ADP on the way.
    Broadcast,
    /// Whoever has an FMMU on the logical address.
    Logical,
}

/// One row of the command table.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Effect {
    /// Whom it means.
    pub addressing: Addressing,
    /// An addressed controller puts its memory into the data.
    pub reads: bool,
    /// An addressed controller takes the data into its memory.
    pub writes: bool,
    /// What is read is ORed into the data instead of replacing it.
    pub ors: bool,
    /// The addressed controller only reads, every other one writes.
    pub multiple_write: bool,
}

impl Command {
    /// All fifteen, by code.
    pub const ALL: [Self; 15] = [
        Self::Nop,
        Self::Aprd,
        Self::Apwr,
        Self::Aprw,
        Self::Fprd,
        Self::Fpwr,
        Self::Fprw,
        Self::Brd,
        Self::Bwr,
        Self::Brw,
        Self::Lrd,
        Self::Lwr,
        Self::Lrw,
        Self::Armw,
        Self::Frmw,
    ];

    /// The command with this code on the wire; `None` for the reserved codes 15..=255.
    #[must_use]
    #[inline]
    pub const fn from_code(code: u8) -> Option<Self> {
        if (code as usize) < Self::ALL.len() { Some(Self::ALL[code as usize]) } else { None }
    }

    /// The code on the wire.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The four-letter name of the specification.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nop => "NOP",
            Self::Aprd => "APRD",
            Self::Apwr => "APWR",
            Self::Aprw => "APRW",
            Self::Fprd => "FPRD",
            Self::Fpwr => "FPWR",
            Self::Fprw => "FPRW",
            Self::Brd => "BRD",
            Self::Bwr => "BWR",
            Self::Brw => "BRW",
            Self::Lrd => "LRD",
            Self::Lwr => "LWR",
            Self::Lrw => "LRW",
            Self::Armw => "ARMW",
            Self::Frmw => "FRMW",
        }
    }

    /// What it does in one sentence, for people.
    #[must_use]
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Nop => "No operation: no controller acts on it.",
            Self::Aprd => "Reads from the controller at a position.",
            Self::Apwr => "Writes to the controller at a position.",
            Self::Aprw => "Reads from the controller at a position, then writes to it.",
            Self::Fprd => "Reads from the controller with a station address.",
            Self::Fpwr => "Writes to the controller with a station address.",
            Self::Fprw => "Reads from the controller with a station address, then writes to it.",
            Self::Brd => "Reads from all controllers; their data are ORed together.",
            Self::Bwr => "Writes to all controllers.",
            Self::Brw => "Reads from all controllers by OR, and writes to them what came in.",
            Self::Lrd => "Reads the inputs that FMMUs map into the logical address range.",
            Self::Lwr => "Writes the outputs that FMMUs map into the logical address range.",
            Self::Lrw => "Writes outputs and reads inputs mapped into the logical address range.",
            Self::Armw => "The controller at a position supplies the data, all others take them.",
            Self::Frmw => {
                "The controller with a station address supplies the data, all others take them."
            }
        }
    }

    /// The command's row of the table.
    #[must_use]
    #[inline]
    pub const fn effect(self) -> Effect {
        use Addressing::{Broadcast, Logical, None, Position, Station};
        const fn row(addressing: Addressing, reads: bool, writes: bool) -> Effect {
            Effect { addressing, reads, writes, ors: false, multiple_write: false }
        }
        match self {
            Self::Nop => row(None, false, false),
            Self::Aprd => row(Position, true, false),
            Self::Apwr => row(Position, false, true),
            Self::Aprw => row(Position, true, true),
            Self::Fprd => row(Station, true, false),
            Self::Fpwr => row(Station, false, true),
            Self::Fprw => row(Station, true, true),
            Self::Brd => Effect { ors: true, ..row(Broadcast, true, false) },
            Self::Bwr => row(Broadcast, false, true),
            Self::Brw => Effect { ors: true, ..row(Broadcast, true, true) },
            Self::Lrd => row(Logical, true, false),
            Self::Lwr => row(Logical, false, true),
            Self::Lrw => row(Logical, true, true),
            Self::Armw => Effect { multiple_write: true, ..row(Position, true, true) },
            Self::Frmw => Effect { multiple_write: true, ..row(Station, true, true) },
        }
    }

    /// Whom it means.
    #[must_use]
    #[inline]
    pub const fn addressing(self) -> Addressing {
        self.effect().addressing
    }

    /// Whether every controller that processes it adds one to ADP, addressed or not.
    #[must_use]
    #[inline]
    pub const fn increments_position(self) -> bool {
        matches!(self.addressing(), Addressing::Position | Addressing::Broadcast)
    }

    /// What one controller adds to the working counter when its read and its write succeeded.
    ///
    /// At most once a direction, however many FMMUs hit. Reads and writes add 1; the combined
    /// commands (APRW, FPRW, BRW, LRW) add 1 for the read and 2 for the write; ARMW and FRMW add 1
    /// either way, since a controller does only one of the two.
    #[must_use]
    pub const fn increment(self, read: bool, write: bool) -> u16 {
        let effect = self.effect();
        let read = effect.reads && read;
        let write = effect.writes && write;
        if effect.reads && effect.writes && !effect.multiple_write {
            read as u16 + 2 * write as u16
        } else {
            (read || write) as u16
        }
    }
}

impl fmt::Display for Command {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: FRM-02
    #[test]
    fn fifteen_commands_with_their_codes() {
        let codes: Vec<(u8, &str)> =
            Command::ALL.iter().map(|command| (command.code(), command.name())).collect();
        assert_eq!(
            codes,
            [
                (0, "NOP"),
                (1, "APRD"),
                (2, "APWR"),
                (3, "APRW"),
                (4, "FPRD"),
                (5, "FPWR"),
                (6, "FPRW"),
                (7, "BRD"),
                (8, "BWR"),
                (9, "BRW"),
                (10, "LRD"),
                (11, "LWR"),
                (12, "LRW"),
                (13, "ARMW"),
                (14, "FRMW"),
            ]
        );
        for code in 0..=255 {
            assert_eq!(Command::from_code(code).is_some(), code < 15);
        }
    }

    // proves: FRM-15
    #[test]
    fn working_counter_increments() {
        use Command::*;
        // command, read only, write only, both
        let table = [
            (Nop, 0, 0, 0),
            (Aprd, 1, 0, 1),
            (Apwr, 0, 1, 1),
            (Aprw, 1, 2, 3),
            (Fprd, 1, 0, 1),
            (Fpwr, 0, 1, 1),
            (Fprw, 1, 2, 3),
            (Brd, 1, 0, 1),
            (Bwr, 0, 1, 1),
            (Brw, 1, 2, 3),
            (Lrd, 1, 0, 1),
            (Lwr, 0, 1, 1),
            (Lrw, 1, 2, 3),
            (Armw, 1, 1, 1),
            (Frmw, 1, 1, 1),
        ];
        for (command, read, write, both) in table {
            assert_eq!(command.increment(false, false), 0, "{command}: not addressed");
            assert_eq!(command.increment(true, false), read, "{command}: read");
            assert_eq!(command.increment(false, true), write, "{command}: write");
            assert_eq!(command.increment(true, true), both, "{command}: both");
        }
    }

    #[test]
    fn positions_move_for_ap_b_and_armw_only() {
        use Command::*;
        let moving: Vec<Command> =
            Command::ALL.into_iter().filter(|command| command.increments_position()).collect();
        assert_eq!(moving, [Aprd, Apwr, Aprw, Brd, Bwr, Brw, Armw]);
    }
}
