//! Fingerprint of a frame: the fields that stay the same on its way through the line.
//!
//! Controllers keep command, index, length and, but for positions, the address of each datagram;
//! they change working counters, positions and data. The former pair a frame with its request, the
//! latter tell the two apart where the capture does not.

use linesman_proto::command::{Addressing, Command};
use linesman_proto::frame::{CutHeader, FrameView};
use linesman_proto::register::SYSTEM_TIME;

/// Both halves of a frame, hashed.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Fingerprint {
    /// What stays: equal for a request and its return.
    pub lasting: u64,
    /// Working counters and positions: a frame that any controller answered differs from its
    /// request.
    pub changing: u64,
    /// What the copies of a request for both cards of a ring have in common, though one of them has some
    /// commands replaced by NOP.
    pub skeleton: u64,
    /// Datagrams that are no NOP.
    pub commands: u32,
    /// Whether any working counter is above 0.
    pub is_answered: bool,
    /// Datagrams that could be read.
    pub datagrams: u32,
    /// Index of the first datagram.
    pub first_index: u8,
    /// Whether the walk over the datagrams ended too early.
    pub is_cut: bool,
}

/// A command code as it is compared. In a ring one of the two copies of a frame may only ask the reference clock for the
/// time that the other one hands round.
fn without_handing(code: u8, address: u32) -> u8 {
    if address >> 16 != u32::from(SYSTEM_TIME.address.0) {
        return code;
    }
    match Command::from_code(code) {
        Some(Command::Armw) => Command::Aprd.code(),
        Some(Command::Frmw) => Command::Fprd.code(),
        _ => code,
    }
}

impl Fingerprint {
    /// Of an Ethernet frame; `None` for one without datagrams.
    #[must_use]
    pub fn of_frame(frame: &[u8]) -> Option<Self> {
        FrameView::parse(frame).ok().map(|view| Self::of(&view))
    }

    /// Of the datagrams of a frame.
    #[must_use]
    pub fn of(view: &FrameView<'_>) -> Self {
        let mut print = Self {
            lasting: 0,
            changing: 0,
            skeleton: 0,
            commands: 0,
            is_answered: false,
            datagrams: 0,
            first_index: 0,
            is_cut: false,
        };
        let mut datagrams = view.datagrams();
        for datagram in datagrams.by_ref() {
            let Ok(datagram) = datagram else {
                print.is_cut = true;
                break;
            };
            if print.datagrams == 0 {
                print.first_index = datagram.index();
            }
            let command = datagram.command();
            let is_position = command.is_some_and(|command| {
                matches!(command.addressing(), Addressing::Position | Addressing::Broadcast)
            });
            let address = u64::from(datagram.logical().0);
            let (lasting, changing) =
                if is_position { (address >> 16, address & 0xFFFF) } else { (address, 0) };
            let tail = u64::from(datagram.index()) << 48 | (datagram.data_len() as u64) << 32;
            let head =
                u64::from(without_handing(datagram.code(), datagram.logical().0)) << 56 | tail;
            let wkc = u64::from(datagram.wkc().0);
            print.skeleton = mix(print.skeleton, tail | address);
            print.commands += u32::from(command != Some(Command::Nop));
            print.lasting = mix(print.lasting, head | lasting);
            print.changing = mix(print.changing, changing << 16 | wkc);
            print.is_answered |= wkc > 0;
            print.datagrams += 1;
        }
        if let Some(header) = datagrams.cut_header().filter(|_| print.is_cut) {
            if print.datagrams == 0 {
                print.first_index = header.index;
            }
            print.add_cut(header);
        }
        print
    }

    /// Adds what is left of a datagram that the recorder cut off: enough to tell frames apart.
    fn add_cut(&mut self, header: CutHeader) {
        let addressing = Command::from_code(header.code).map(Command::addressing);
        let address = match addressing {
            Some(Addressing::Position | Addressing::Broadcast) => header.address >> 16,
            Some(Addressing::Station | Addressing::Logical | Addressing::None) | None => {
                header.address
            }
        };
        let tail = u64::from(header.index) << 48 | u64::from(header.len) << 32;
        let code = without_handing(header.code, header.address);
        self.lasting = mix(self.lasting, u64::from(code) << 56 | tail | u64::from(address));
        self.changing = mix(self.changing, u64::from(header.address ^ address));
        self.skeleton = mix(self.skeleton, tail | u64::from(address));
    }
}

/// Multiply and fold: fast, and good enough to tell a few hundred frames apart. An odd factor keeps
/// all bits of the product in play.
const fn mix(state: u64, word: u64) -> u64 {
    const FACTOR: u128 = 0x9E37_79B9_7F4A_7C15;
    let product = (state.rotate_left(23) ^ word ^ 0xF39C_C060_5CED_C835) as u128 * FACTOR;
    (product as u64) ^ ((product >> 64) as u64)
}
