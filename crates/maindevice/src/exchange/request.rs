//! Request of a procedure to the line: one datagram, and what came back.

use std::fmt;

use linesman_proto::address::{Path, Position, RegisterAddress, StationAddress, WorkingCounter};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::Span;
use smallvec::SmallVec;

/// Whom a register access means.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Target {
    /// The controller at a place in the order in which frames of card A are processed. For scanning
    /// only: places move.
    Position(Position),
    /// The same for frames of card B: in a broken ring, where each card has a half of its own.
    PositionOnB(Position),
    /// The controller with this station address.
    Station(StationAddress),
    /// All controllers.
    All,
}

impl Target {
    /// The command that reads from it.
    #[must_use]
    pub const fn read_command(self) -> Command {
        match self {
            Self::Position(_) | Self::PositionOnB(_) => Command::Aprd,
            Self::Station(_) => Command::Fprd,
            Self::All => Command::Brd,
        }
    }

    /// The command that writes to it.
    #[must_use]
    pub const fn write_command(self) -> Command {
        match self {
            Self::Position(_) | Self::PositionOnB(_) => Command::Apwr,
            Self::Station(_) => Command::Fpwr,
            Self::All => Command::Bwr,
        }
    }

    /// The command that reads from it and writes to it in one go.
    #[must_use]
    pub const fn exchange_command(self) -> Command {
        match self {
            Self::Position(_) | Self::PositionOnB(_) => Command::Aprw,
            Self::Station(_) => Command::Fprw,
            Self::All => Command::Brw,
        }
    }

    /// The card whose frames reach it; `None`: either.
    #[must_use]
    pub const fn card(self) -> Option<Path> {
        match self {
            Self::Position(_) => Some(Path::A),
            Self::PositionOnB(_) => Some(Path::B),
            Self::Station(_) | Self::All => None,
        }
    }

    /// The address of one of its registers.
    #[must_use]
    pub const fn register(self, address: RegisterAddress) -> DatagramAddress {
        let adp = match self {
            Self::Position(position) | Self::PositionOnB(position) => position.auto_increment(),
            Self::Station(station) => station.0,
            Self::All => 0,
        };
        DatagramAddress::Physical(adp, address)
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Position(position) => write!(f, "position {position}"),
            Self::PositionOnB(position) => write!(f, "position {position} from card B"),
            Self::Station(station) => write!(f, "station {station}"),
            Self::All => f.write_str("all SubDevices"),
        }
    }
}

/// Bytes of a datagram. So many as a SubDevice's state and counters take are kept without a place of
/// their own in memory, so that reading them again and again allocates nothing.
pub type DatagramData = SmallVec<[u8; 24]>;

/// One datagram to be exchanged.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Request {
    /// What it asks.
    pub command: Command,
    /// Of whom.
    pub address: DatagramAddress,
    /// What is sent; zeros for a read. At most
    /// [`MAX_DATAGRAM_DATA`](linesman_proto::frame::MAX_DATAGRAM_DATA) bytes.
    pub data: DatagramData,
    /// The card whose copy of the frame carries it; `None`: both.
    pub card: Option<Path>,
    /// How often it is sent again when its frame does not come back.
    pub repeats: u8,
    /// Frames that may be on their way beside it.
    pub departure: Departure,
}

/// Whatever else may be on its way when a datagram leaves.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Departure {
    /// Anything: it shares its frame with others.
    #[default]
    Together,
    /// Other frames: it has one of its own.
    OwnFrame,
    /// Nothing: it waits until all frames are back, or given up, and has a frame of its own. Controllers of the first
    /// generation and ET1200 take the next frame that comes in at their ports for the one that latches receive times (S1
    /// 9.1.2): one that was ahead of it would give them a wrong time. Where the line is never quiet for
    /// [`QUIET_WITHIN`] it leaves all the same.
    QuietLine,
}

/// Longest wait for a quiet line: a few cycles of a slow task.
pub const QUIET_WITHIN: Span = Span::ms(20);

impl Request {
    /// Reads `len` bytes from a register on.
    #[must_use]
    pub fn read(target: Target, address: RegisterAddress, len: u16) -> Self {
        Self {
            command: target.read_command(),
            address: target.register(address),
            data: SmallVec::from_elem(0, usize::from(len)),
            card: target.card(),
            repeats: 0,
            departure: Departure::Together,
        }
    }

    /// The same on a quiet line.
    pub(crate) fn on_quiet_line(mut self) -> Self {
        self.departure = Departure::QuietLine;
        self
    }

    /// The same for a SubDevice that has no station address, if it is of one that stands in this list: by
    /// the place where it is.
    pub(crate) fn placed(mut self, places: &[(StationAddress, Target)]) -> Self {
        let DatagramAddress::Physical(adp, register) = self.address else { return self };
        let command = |target: Target| match self.command {
            Command::Fprd => Some(target.read_command()),
            Command::Fpwr => Some(target.write_command()),
            Command::Fprw => Some(target.exchange_command()),
            Command::Frmw => Some(Command::Armw),
            Command::Nop
            | Command::Aprd
            | Command::Apwr
            | Command::Aprw
            | Command::Brd
            | Command::Bwr
            | Command::Brw
            | Command::Lrd
            | Command::Lwr
            | Command::Lrw
            | Command::Armw => None,
        };
        let place = places.iter().find(|(station, _)| station.0 == adp).map(|(_, place)| *place);
        if let Some((place, command)) = place.and_then(|place| Some((place, command(place)?))) {
            (self.command, self.address) = (command, place.register(register));
            self.card = place.card();
        }
        self
    }

    /// Writes bytes from a register on.
    #[must_use]
    pub fn write(target: Target, address: RegisterAddress, data: &[u8]) -> Self {
        Self {
            command: target.write_command(),
            address: target.register(address),
            data: SmallVec::from_slice(data),
            card: target.card(),
            repeats: 0,
            departure: Departure::Together,
        }
    }

    /// Reads bytes from a register on and writes others there, in one go: nothing can happen in between.
    #[must_use]
    pub fn exchange(target: Target, address: RegisterAddress, data: &[u8]) -> Self {
        Self { command: target.exchange_command(), ..Self::write(target, address, data) }
    }

    /// The same, sent again up to `repeats` times when its frame is lost.
    #[must_use]
    pub fn repeated(self, repeats: u8) -> Self {
        Self { repeats, ..self }
    }

    /// The same, carried by the frames of one card only.
    #[must_use]
    pub fn by_card(self, card: Path) -> Self {
        Self { card: Some(card), ..self }
    }

    /// What it asks, without the data: for messages.
    #[must_use]
    pub fn access(&self) -> Access {
        Access { command: self.command, address: self.address, len: self.data.len() }
    }
}

/// A datagram without its data, as messages name it: "FPRD 0x1001:0x0130, 2 bytes".
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Access {
    /// What was asked.
    pub command: Command,
    /// Of whom.
    pub address: DatagramAddress,
    /// Bytes of data.
    pub len: usize,
}

impl fmt::Display for Access {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { command, address, len } = self;
        match (address, command.increments_position()) {
            (DatagramAddress::Physical(_, ado), _) if matches!(command.name(), "BRD" | "BWR") => {
                write!(f, "{command} {ado}, {len} bytes")
            }
            (DatagramAddress::Physical(adp, ado), true) => {
                let position = Position::from_auto_increment(*adp);
                write!(f, "{command} position {position}:{ado}, {len} bytes")
            }
            (DatagramAddress::Physical(adp, ado), false) => {
                write!(f, "{command} {}:{ado}, {len} bytes", StationAddress(*adp))
            }
            (DatagramAddress::Logical(logical), _) => {
                write!(f, "{command} {logical}, {len} bytes")
            }
        }
    }
}

/// What came back.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Reply {
    /// How many accesses succeeded.
    pub wkc: WorkingCounter,
    /// The data as they came back.
    pub data: DatagramData,
}

impl Reply {
    /// Whether at least one controller answered.
    #[must_use]
    pub const fn answered(&self) -> bool {
        self.wkc.0 > 0
    }

    /// `N` bytes of the data from `at` on; zeros where there are none.
    #[must_use]
    pub fn bytes<const N: usize>(&self, at: usize) -> [u8; N] {
        let slice = self.data.get(at..).and_then(|rest| rest.first_chunk());
        slice.copied().unwrap_or([0; N])
    }

    /// A word of the data; 0 where there is none.
    #[must_use]
    pub fn word(&self, at: usize) -> u16 {
        u16::from_le_bytes(self.bytes(at))
    }
}

/// A datagram that was not delivered.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ExchangeError {
    /// No frame with it came back.
    #[error(
        "{access}: sent {frames} times, no frame came back within {patience}; check carrier, cable \
         and supply between the network card and the first SubDevice"
    )]
    NoReply {
        /// What was asked.
        access: Access,
        /// How many frames were sent.
        frames: u32,
        /// How long each was waited for.
        patience: Span,
    },
    /// It came back, but was not executed by as many controllers as expected.
    #[error(
        "{access}: working counter {received}, expected {expected}, sent {frames} times; the \
         SubDevice is not there, has lost its address, or denies the access"
    )]
    WorkingCounter {
        /// What was asked.
        access: Access,
        /// What the working counter should have been.
        expected: WorkingCounter,
        /// What it was.
        received: WorkingCounter,
        /// How many frames were sent.
        frames: u32,
    },
}
