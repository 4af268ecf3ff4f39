//! Distributed clocks: receive times latched, delays measured, offsets set, drift compensated.
//!
//! One broadcast write to 0x0900 latches at every controller when that frame came in at each port and
//! at the processing unit. From the ports follow the delays (`proto::topology::delay`), from the unit
//! what each clock has to add to show the time of the reference clock. A burst of frames that carry
//! the reference's time then teaches each clock its speed; the cyclic frames do so for good.
//! Reference: S1 9.1; S2 2.15.

use linesman_proto::address::{Network, Path, StationAddress};
use linesman_proto::command::Command;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::port::{Port, PortMap};
use linesman_proto::register::{
    self, ControllerType, DlStatus, EscInformation, SystemTimeDifference,
};
use linesman_proto::time::{DcTime, DcTime32, Instant, Span};
use linesman_proto::topology::{DelayError, Delays, Reconstruction, SeenController};

use super::read_only_scan::{self, ReadOnlyScanError};
use super::set_up::write_all;
use crate::exchange::{DatagramData, Departure, ExchangeError, Reply, Request, Target};
use crate::executor::Wire;

/// How much longer a frame takes through a controller whose processing unit it passes (S1 9.1.2).
const THROUGH_UNIT: Span = Span::ns(20);
/// The bandwidth of the time loop (0x0930) that writing it anew resets all filters to.
const SPEED_START: u16 = 0x1000;
/// Attempts at latching receive times while a ring opens and closes.
const ATTEMPTS: u32 = 4;
/// 0x0900 to 0x090F, the receive times of all ports.
const RECEIVE_TIMES_LEN: u16 = 4 * register::RECEIVE_TIME.len;
/// From one frame that compensates drift to the next, at least.
const SPACING: Span = Span::us(50);

/// Clocks that could not be set.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum ClockError {
    /// There is nobody.
    #[error(transparent)]
    Line(#[from] ReadOnlyScanError),
    /// One does not answer.
    #[error(transparent)]
    Exchange(#[from] ExchangeError),
    /// The receive times do not give delays.
    #[error("propagation delays cannot be measured: {0}")]
    Delay(#[from] DelayError),
    /// Somebody came or went, or a ring opened or closed.
    #[error("the line changed while receive times were latched")]
    LineChanged,
    /// In a whole ring a port does not keep the time of the copy that card B sends.
    #[error(
        "station {station}: 0x0900 of port {port} does not keep the time of the frame of card B; the ring has to be open to be measured"
    )]
    OneWay {
        /// Whose port it is.
        station: StationAddress,
        /// The port that leads on round the ring.
        port: Port,
    },
    /// Nobody has a clock that could be the reference.
    #[error("no reference clock: {0}")]
    NoReference(&'static str),
}

/// One controller as a latch found it.
#[derive(Clone, Debug)]
pub(crate) struct SeenClock {
    pub(crate) station: StationAddress,
    /// It has a clock.
    pub(crate) has_clock: bool,
    /// It counts 64 bits, and not 32.
    pub(crate) is_wide: bool,
    /// Its ports take the time of the next frame that comes in, whichever it is (S1 9.1.2).
    takes_next: bool,
    /// Local time at which its processing unit saw the latching frame.
    pub(crate) latched: u64,
    /// How long after the first clock of its line it did. `None` without a clock.
    pub(crate) delay: Option<Span>,
    /// The card whose frame it was: of an open ring each card latches its half.
    pub(crate) card: Path,
}

/// What a latch found, in the order of processing.
#[derive(Clone, Debug)]
pub(crate) struct Latch {
    /// When the latching frame left.
    pub(crate) at: Instant,
    pub(crate) clocks: Vec<SeenClock>,
}

/// Latches receive times and measures the delays of all that are there. In a whole ring the times of both copies of the frame are
/// taken, and it stays whole.
///
/// # Errors
/// [`ClockError`].
pub(crate) async fn latch(wire: &Wire, network: Network) -> Result<Latch, ClockError> {
    let mut attempt = 1;
    loop {
        match latch_once(wire, network).await {
            Err(ClockError::LineChanged) if attempt < ATTEMPTS => attempt += 1,
            outcome => return outcome,
        }
    }
}

async fn latch_once(wire: &Wire, network: Network) -> Result<Latch, ClockError> {
    let (places, _) = read_only_scan::places(wire, network).await?;
    let ring_intact = wire.ring_intact();
    let reading: Vec<_> = (places.iter())
        .map(|place| {
            let len = EscInformation::LEN as u16;
            [
                wire.read(*place, register::ESC_TYPE.address, len),
                wire.read(*place, register::STATION_ADDRESS.address, 2),
                wire.read(*place, register::DL_STATUS.address, 2),
            ]
        })
        .collect();
    let times_before: Vec<_> = (places.iter().filter(|_| ring_intact == Some(true)))
        .map(|place| wire.read(*place, register::RECEIVE_TIME.address, RECEIVE_TIMES_LEN))
        .collect();
    let mut seen = Vec::with_capacity(places.len());
    for [information, station, dl_status] in reading {
        let information = EscInformation::from_bytes(information.await?.bytes(0));
        let station = StationAddress(station.await?.word(0));
        let dl_status = DlStatus(dl_status.await?.word(0));
        let takes_next =
            matches!(information.controller, ControllerType::ESC20 | ControllerType::ET1200);
        seen.push((information.features, station, dl_status, takes_next));
    }
    let mut before = Vec::with_capacity(times_before.len());
    for times in times_before {
        before.push(times.await?);
    }
    let at = wire.now();
    let all = register::RECEIVE_TIME.address;
    wire.ask(Request::write(Target::All, all, &[0; 4]).on_quiet_line()).await?;
    let reading: Vec<_> = (places.iter().zip(&seen))
        .map(|(place, (features, ..))| {
            features.distributed_clocks().then(|| {
                [
                    wire.read(*place, register::RECEIVE_TIME.address, RECEIVE_TIMES_LEN),
                    wire.read(*place, register::RECEIVE_TIME_PROCESSING_UNIT.address, 8),
                ]
            })
        })
        .collect();
    let (mut clocks, mut controllers) = (Vec::new(), Vec::new());
    for (reading, (features, station, dl_status, takes_next)) in reading.into_iter().zip(seen) {
        let open = PortMap::from_fn(|port| dl_status.port_state(port).is_active());
        let (mut times, mut latched) = (None, 0);
        if let Some([ports, unit]) = reading {
            let (ports, unit) = (ports.await?, unit.await?);
            latched = u64::from_le_bytes(unit.bytes(0));
            times = Some(ports).filter(Reply::answered);
        }
        let has_clock = features.distributed_clocks() && times.is_some();
        let is_wide = features.clock_64_bit();
        let received =
            |port: Port| times.as_ref().filter(|_| open[port]).map(|times| time_of(times, port));
        controllers.push(SeenController { open, received: PortMap::from_fn(received) });
        let (delay, card) = (None, Path::A);
        clocks.push(SeenClock { station, has_clock, is_wide, takes_next, latched, delay, card });
    }
    if wire.ring_intact() != ring_intact {
        // Of a frame that one half processed nothing follows for the other one.
        return Err(ClockError::LineChanged);
    }
    if ring_intact == Some(true) {
        let delays = around(&controllers, &clocks, &before)?;
        for (node, clock) in clocks.iter_mut().enumerate() {
            clock.delay = delays.of(node).map(|delay| delay.from_reference);
        }
        return Ok(Latch { at, clocks });
    }
    let half = places.iter().position(|place| place.card() == Some(Path::B));
    let half = half.filter(|_| ring_intact == Some(false)).unwrap_or(places.len());
    for (path, range) in [(Path::A, 0..half), (Path::B, half..places.len())] {
        if range.is_empty() {
            continue;
        }
        let seen = &controllers[range.clone()];
        let received: Vec<_> = seen.iter().map(|seen| seen.received).collect();
        let tree = Reconstruction::of(path, seen).tree;
        let delays = Delays::measure(&tree, path, &received, THROUGH_UNIT)?;
        for (node, clock) in clocks[range].iter_mut().enumerate() {
            clock.delay = delays.of(node).map(|delay| delay.from_reference);
            clock.card = path;
        }
    }
    Ok(Latch { at, clocks })
}

/// The receive time of a port, from 0x0900 and what follows.
fn time_of(times: &Reply, port: Port) -> DcTime32 {
    DcTime32(u32::from_le_bytes(times.bytes(4 * port.index())))
}

/// The delays in a whole ring. `before` is what stood in 0x0900 when the frame left: where the time of a port that leads on is still
/// the same, nothing was kept there.
fn around(
    controllers: &[SeenController],
    clocks: &[SeenClock],
    before: &[Reply],
) -> Result<Delays, ClockError> {
    // Times of two copies do not tell where frames come in.
    let seen: Vec<_> = controllers
        .iter()
        .map(|seen| SeenController { received: PortMap::default(), ..*seen })
        .collect();
    let tree = Reconstruction::of(Path::A, &seen).tree;
    if tree.closes_at().is_none() {
        // Somebody came or went meanwhile.
        return Err(DelayError::RingClosed.into());
    }
    for node in tree.ring_nodes() {
        let Some(port) = tree.open_ports(node).last() else { continue };
        let kept = controllers[node].received[port];
        // The copy of card B may have come by before it was told to take the next one.
        let takes_next = kept.is_some() && clocks[node].takes_next;
        if takes_next || kept.is_some_and(|time| time == time_of(&before[node], port)) {
            return Err(ClockError::OneWay { station: clocks[node].station, port });
        }
    }
    let received: Vec<_> = controllers.iter().map(|seen| seen.received).collect();
    Ok(Delays::measure_whole_ring(&tree, &received, THROUGH_UNIT)?)
}

/// Sets the clock of one SubDevice: what it has to add to its local time, and how far it is from the
/// reference.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub(crate) async fn set(
    wire: &Wire,
    station: StationAddress,
    offset: u64,
    delay: Span,
) -> Result<(), ExchangeError> {
    let delay = u32::try_from(delay.as_nanos()).unwrap_or(u32::MAX);
    let writes = vec![
        (register::SYSTEM_TIME_OFFSET.address, offset.to_le_bytes().to_vec()),
        (register::SYSTEM_TIME_DELAY.address, delay.to_le_bytes().to_vec()),
        (register::SPEED_COUNTER_START.address, SPEED_START.to_le_bytes().to_vec()),
    ];
    write_all(wire, Target::Station(station), writes).await
}

/// Sends the reference's time to all in `frames` frames of their own, one after another. Closer
/// together than [`SPACING`] clocks that count in steps of 10 ns learn nothing of their speed. What they
/// carry is the time that the reference was set to, which was `epoch` when the run began: should it not
/// answer any more, nobody is led further astray than by the jitter of this computer.
///
/// A reference that is led (`is_led`) is taught its speed, too: that time is written to it before.
pub(crate) async fn compensate(
    wire: &Wire,
    reference: StationAddress,
    frames: u32,
    is_led: bool,
    epoch: impl Fn() -> DcTime + Send,
) {
    let address = DatagramAddress::Physical(reference.0, register::SYSTEM_TIME.address);
    for _ in 0..frames {
        let now = wire.now();
        let next_at = now + SPACING;
        let expected = epoch().0.wrapping_add(now.as_nanos());
        let request = |command| Request {
            command,
            address,
            data: DatagramData::from_slice(&expected.to_le_bytes()),
            card: None,
            repeats: 0,
            departure: Departure::OwnFrame,
        };
        let led = is_led.then(|| wire.submit(request(Command::Fpwr)));
        // A lost one is one less.
        let _ = wire.submit(request(Command::Frmw)).await;
        if let Some(led) = led {
            let _ = led.await;
        }
        wire.sleep_until(next_at).await;
    }
}

/// How far a clock is off, from 0x092C.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub(crate) async fn difference(
    wire: &Wire,
    station: StationAddress,
) -> Result<Span, ExchangeError> {
    let address = register::SYSTEM_TIME_DIFFERENCE.address;
    let reply = wire.read_one(Target::Station(station), address, 4).await?;
    Ok(SystemTimeDifference::from(reply.bytes(0)).magnitude())
}

/// A register of eight bytes of the time loop.
///
/// # Errors
/// [`ExchangeError`] when it does not answer.
pub(crate) async fn time(
    wire: &Wire,
    station: StationAddress,
    register: &register::Register,
) -> Result<u64, ExchangeError> {
    let reply = wire.read_one(Target::Station(station), register.address, 8).await?;
    Ok(u64::from_le_bytes(reply.bytes(0)))
}
