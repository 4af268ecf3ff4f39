//! Read-only scan of a line: nothing is written.
//!
//! A broadcast read counts who is there; then each SubDevice is read by its position, since station
//! addresses may be missing or doubled. Reading AL status and DL status clears their event request
//! bits in a controller (0x0210): do not look at a line that another MainDevice drives.

use linesman_proto::address::{
    Network, Path, Position, RegisterAddress, StationAddress, StationAlias,
};
use linesman_proto::register::{self, AlStatus, DlStatus, ErrorCounters, EscInformation};
use linesman_proto::state::{AlStatusCode, OredStates};
use linesman_proto::time::{Instant, Span};

use crate::exchange::{ExchangeError, Reply, Request, Target};
use crate::executor::Wire;

/// What a look at a line has shown.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ReadOnlyScan {
    /// Which network.
    pub network: Network,
    /// When it was done.
    pub at: Instant,
    /// States of all, ORed together as the broadcast read brings them.
    pub states: OredStates,
    /// Who is there, in the order of processing.
    pub devices: Vec<DeviceReading>,
}

/// One SubDevice as it was read. What it did not answer is `None`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct DeviceReading {
    /// Its place in the order of processing; in a broken ring those of card B follow those of card A.
    pub position: Position,
    /// How it was addressed.
    pub target: Target,
    /// Its controller, 0x0000.
    pub information: Option<EscInformation>,
    /// Its station address, 0x0010; 0 if it has none.
    pub station: Option<StationAddress>,
    /// Its alias, 0x0012; 0 if it has none.
    pub alias: Option<StationAlias>,
    /// Its ports, 0x0110.
    pub dl_status: Option<DlStatus>,
    /// Its state, 0x0130.
    pub al_status: Option<AlStatus>,
    /// Its AL status code, 0x0134; it means something when the error bit of the state is set.
    pub al_code: Option<AlStatusCode>,
    /// Its error counters, 0x0300 to 0x0313.
    pub counters: Option<ErrorCounters>,
}

/// Nothing to look at.
#[derive(Clone, Copy, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ReadOnlyScanError {
    /// No frame came back.
    #[error("the line does not answer: {0}")]
    Silent(ExchangeError),
    /// Frames come back, but no SubDevice has processed them.
    #[error(
        "network {network}: frames come back with working counter 0, so no SubDevice processes \
         them; is this the card of an EtherCAT line, and is its cable in the IN port?"
    )]
    Nobody {
        /// Which network.
        network: Network,
    },
}

/// AL status, reserved word, AL status code: 0x0130 to 0x0135, read at once so that they agree.
pub(crate) const AL_LEN: u16 = register::AL_STATUS_CODE.end().0 - register::AL_STATUS.address.0;

/// State and code out of [`AL_LEN`] bytes from 0x0130.
pub(crate) fn al_of(reply: &Reply) -> (AlStatus, AlStatusCode) {
    (AlStatus(reply.word(0)), AlStatusCode(reply.word(4)))
}

/// Error counters as they were read, those left out that the controller is known not to have.
pub(crate) fn counters_of(reply: &Reply, information: Option<EscInformation>) -> ErrorCounters {
    let counters = ErrorCounters::from_bytes(&reply.data, ErrorCounters::START);
    match information.is_none_or(|known| known.features.separate_forwarded_errors()) {
        true => counters,
        false => counters.without_forwarded(),
    }
}

/// How many SubDevices process frames, and their states.
///
/// # Errors
/// [`ReadOnlyScanError`] when there are none.
pub async fn count(wire: &Wire, network: Network) -> Result<(u16, OredStates), ReadOnlyScanError> {
    let status = register::AL_STATUS;
    let reply = wire
        .read(Target::All, status.address, status.len)
        .await
        .map_err(ReadOnlyScanError::Silent)?;
    match reply.wkc.0 {
        0 => Err(ReadOnlyScanError::Nobody { network }),
        count => Ok((count, linesman_proto::state::AlState::from_or(reply.bytes::<1>(0)[0]))),
    }
}

/// How each SubDevice is reached by position, in the order of processing.
///
/// # Errors
/// [`ReadOnlyScanError`] when there are none.
pub async fn places(
    wire: &Wire,
    network: Network,
) -> Result<(Vec<Target>, OredStates), ReadOnlyScanError> {
    let (count, states) = self::count(wire, network).await?;
    if wire.ring_intact().is_none() {
        let places = (0..count).map(|position| Target::Position(Position(position)));
        return Ok((places.collect(), states));
    }
    // A half for each card; that of card B is processed from the break outwards, so it follows. In a closed
    // ring card A has all of them, but for those that are plugged in the wrong way round.
    let mut places = Vec::with_capacity(usize::from(count));
    for card in Path::ALL {
        let status = register::AL_STATUS;
        let half = Request::read(Target::All, status.address, status.len).by_card(card);
        let reply = wire.ask(half).await.map_err(ReadOnlyScanError::Silent)?;
        places.extend((0..reply.wkc.0).map(|position| match card {
            Path::A => Target::Position(Position(position)),
            Path::B => Target::PositionOnB(Position(position)),
        }));
    }
    Ok((places, states))
}

/// Looks at a line, with or without error counters.
///
/// # Errors
/// [`ReadOnlyScanError`] when nobody is there. A single SubDevice that does not answer is no error.
pub async fn scan(
    wire: Wire,
    network: Network,
    counters: bool,
) -> Result<ReadOnlyScan, ReadOnlyScanError> {
    let (places, states) = patient_places(&wire, network).await?;
    let read = |target, position| read_device(wire.clone(), target, Position(position), counters);
    let reading: Vec<_> = (places.into_iter().zip(0..))
        .map(|(target, position)| wire.spawn(read(target, position)))
        .collect();
    let mut devices = Vec::with_capacity(reading.len());
    for device in reading {
        devices.push(device.await);
    }
    Ok(ReadOnlyScan { network, at: wire.now(), states, devices })
}

/// [`places`], asked for a few times: a host that is busy with something else may be silent for longer
/// than a frame is waited for, and nobody else has been heard yet who could tell a dead line from that.
async fn patient_places(
    wire: &Wire,
    network: Network,
) -> Result<(Vec<Target>, OredStates), ReadOnlyScanError> {
    const LOOKS: u32 = 3;
    const RETRY_AFTER: Span = Span::ms(100);
    for _ in 1..LOOKS {
        match places(wire, network).await {
            Err(ReadOnlyScanError::Silent(_)) => wire.sleep(RETRY_AFTER).await,
            seen @ (Ok(_) | Err(ReadOnlyScanError::Nobody { .. })) => return seen,
        }
    }
    places(wire, network).await
}

async fn read_device(
    wire: Wire,
    target: Target,
    position: Position,
    counters: bool,
) -> DeviceReading {
    // All at once, so that they share frames; what was not answered is asked for again.
    let asked = [
        (register::ESC_TYPE.address, EscInformation::LEN as u16),
        (register::STATION_ADDRESS.address, 4),
        (register::DL_STATUS.address, register::DL_STATUS.len),
        (register::AL_STATUS.address, AL_LEN),
        (ErrorCounters::START, ErrorCounters::LEN as u16),
    ];
    let asked = if counters { &asked[..] } else { &asked[..asked.len() - 1] };
    let first = asked.iter().map(|(address, len)| wire.read(target, *address, *len));
    let first: Vec<_> = first.collect();
    let mut replies = Vec::with_capacity(asked.len());
    for (first, (address, len)) in first.into_iter().zip(asked) {
        replies.push(answered(&wire, target, *address, *len, first.await).await);
    }
    let mut replies = replies.into_iter();
    let mut next = || replies.next().flatten();
    let information = next().map(|reply| EscInformation::from_bytes(reply.bytes(0)));
    let addresses = next();
    let dl_status = next().map(|reply| DlStatus(reply.word(0)));
    let al = next().map(|reply| al_of(&reply));
    let counters = next().map(|reply| counters_of(&reply, information));
    DeviceReading {
        position,
        target,
        information,
        station: addresses.as_ref().map(|reply| StationAddress(reply.word(0))),
        alias: addresses.as_ref().map(|reply| StationAlias(reply.word(2))),
        dl_status,
        al_status: al.map(|(status, _)| status),
        al_code: al.map(|(_, code)| code),
        counters,
    }
}

async fn answered(
    wire: &Wire,
    target: Target,
    address: RegisterAddress,
    len: u16,
    first: Result<Reply, ExchangeError>,
) -> Option<Reply> {
    match first {
        Ok(reply) if reply.answered() => Some(reply),
        Ok(_) => wire.read_one(target, address, len).await.ok(),
        Err(_) => None,
    }
}
