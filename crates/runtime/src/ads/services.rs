//! Index groups: what each means on this network, in requests to the MainDevice.

use std::sync::Arc;

use linesman_proto::ads::{AdsAnswer, AdsCode, AdsRequest, AmsAddress, AmsNetId, index};
use linesman_proto::mailbox::abort_code::SdoAbortCode;
use linesman_proto::state::AlState;

use super::datagram::{RegisterDatagram, RegisterTarget};
use crate::gateway::own_objects;
use crate::online::report::{OnlineDevice, OnlineIdentity, OnlineReport};
use crate::service::message::{Answer, Asked, Request, from_hex, to_hex};

/// Bytes of a state of a SubDevice.
const STATE_LEN: usize = 2;
/// Bit of a wanted state: acknowledge the error first.
const ACKNOWLEDGE: u16 = 0x10;
/// Objects of the MainDevice that describe SubDevices as planned; the vendor's structure of one ends at four bytes.
const CONFIGURED: std::ops::RangeInclusive<u16> = 0x8000..=0x8FFF;

/// Access of the services to the network.
pub(super) trait AdsNetwork {
    /// State of the line now; `None` before a plan is run.
    fn report(&self) -> Option<Arc<OnlineReport>>;

    /// Answers of the MainDevice, one to each request.
    fn ask(&self, requests: Vec<Request>) -> Vec<Result<Answer, AdsCode>>;

    /// The topology list in the vendor's form; `None` before a plan is run.
    fn topology(&self) -> Option<Vec<u8>>;

    /// Abort code of the last access to an object of this station; 0: it was good.
    fn last_abort(&self, station: u16) -> u32;

    /// An access to an object of this station has ended.
    fn set_last_abort(&self, station: u16, code: u32);
}

/// The services of a network.
pub(super) struct AdsServices<'a, N> {
    pub(super) network: &'a N,
    /// NetId by which it was asked.
    pub(super) net_id: AmsNetId,
    /// Requests that change something are refused.
    pub(super) read_only: bool,
}

/// Answer to a service, or the code by which it is refused.
pub(super) type AdsOutcome<T> = Result<T, AdsCode>;

impl<N: AdsNetwork> AdsServices<'_, N> {
    /// The answer of a port.
    ///
    /// # Errors
    /// The code for the AMS header, when there is no such port.
    pub(super) fn answer(&self, port: u16, request: &AdsRequest<'_>) -> AdsOutcome<AdsAnswer> {
        let report = self.network.report();
        let outcome = match (port, report.as_deref()) {
            (AmsAddress::MAIN_DEVICE_PORT, report) => self.of_main_device(report, request),
            (_, None) => Err(AdsCode::NOT_READY),
            (station, Some(report)) => {
                let device = by_station(report, station).ok_or(AdsCode::PORT_NOT_FOUND)?;
                self.of_device(device, request)
            }
        };
        Ok(match outcome {
            // A client takes no more than it has room for.
            Ok(AdsAnswer::Read(mut data)) => {
                data.truncate(room(request));
                AdsAnswer::Read(data)
            }
            Ok(answer) => answer,
            Err(code) => AdsAnswer::Refused(code),
        })
    }

    fn of_main_device(
        &self,
        report: Option<&OnlineReport>,
        request: &AdsRequest<'_>,
    ) -> AdsOutcome<AdsAnswer> {
        match *request {
            AdsRequest::DeviceInfo => return Ok(device_info("Linesman")),
            AdsRequest::Other(_) => return Err(AdsCode::SERVICE_NOT_SUPPORTED),
            AdsRequest::State => {
                let (ads, device) = match report {
                    Some(report) => (AdsAnswer::RUN, main_state(report).bits().into()),
                    None => (AdsAnswer::INIT, AlState::Init.bits().into()),
                };
                return Ok(AdsAnswer::State { ads, device });
            }
            AdsRequest::Read { .. } | AdsRequest::Write { .. } | AdsRequest::ReadWrite { .. } => {}
        }
        let report = report.ok_or(AdsCode::NOT_READY)?;
        match *request {
            AdsRequest::Read { group, offset, .. } => {
                self.read(report, group, offset).map(AdsAnswer::Read)
            }
            AdsRequest::Write { group, offset, data } => {
                self.write(report, group, offset, data).map(|()| AdsAnswer::Done)
            }
            AdsRequest::ReadWrite { group, data, .. } => match group {
                index::DATAGRAM | index::DATAGRAM_OF_BLOCKS => {
                    self.datagram(report, data).map(AdsAnswer::Read)
                }
                _ => Err(AdsCode::BAD_INDEX_GROUP),
            },
            AdsRequest::DeviceInfo | AdsRequest::State | AdsRequest::Other(_) => {
                Err(AdsCode::SERVICE_NOT_SUPPORTED)
            }
        }
    }

    fn read(&self, report: &OnlineReport, group: u32, offset: u32) -> AdsOutcome<Vec<u8>> {
        let of_each = |value: fn(&OnlineDevice) -> u32| -> Vec<u8> {
            report.devices.iter().flat_map(|device| value(device).to_le_bytes()).collect()
        };
        let of_all =
            |data: Vec<u8>| if offset == 0 { Ok(data) } else { Err(AdsCode::BAD_INDEX_OFFSET) };
        match group {
            index::MASTER_STATE if offset == index::MASTER_STATE_OFFSET => {
                Ok(u16::from(main_state(report).bits()).to_le_bytes().to_vec())
            }
            index::MASTER_STATE => Err(AdsCode::BAD_INDEX_OFFSET),
            index::DEVICE_COUNT => of_all((report.devices.len() as u16).to_le_bytes().to_vec()),
            index::STATION_ADDRESSES => {
                of_all(report.devices.iter().flat_map(|one| one.station.to_le_bytes()).collect())
            }
            index::DEVICE_STATES if offset == 0 => {
                Ok(report.devices.iter().flat_map(|one| one.state.word.to_le_bytes()).collect())
            }
            index::DEVICE_STATES => Ok(at(report, offset)?.state.word.to_le_bytes().to_vec()),
            index::FRAME_COUNTS => of_all(frame_counts(report)),
            index::IDENTITY => Ok(identity(at(report, offset)?)),
            index::CRC_COUNTS if offset == 0 => {
                Ok(of_each(|one| damaged_frames(one).fold(0, u32::wrapping_add)))
            }
            index::CRC_COUNTS => {
                Ok(damaged_frames(at(report, offset)?).flat_map(u32::to_le_bytes).collect())
            }
            index::ABNORMAL_CHANGES => of_all(of_each(|one| one.abnormal_changes as u32)),
            index::PRESENCE_CHANGES => of_all(of_each(|one| one.presence_changes as u32)),
            index::TOPOLOGY => of_all(self.network.topology().ok_or(AdsCode::NOT_READY)?),
            index::NETWORK_STATE => of_all(report.state.word.to_le_bytes().to_vec()),
            index::FRAME_COUNT => of_all((report.frames.len() as u32).to_le_bytes().to_vec()),
            index::SDO => self.own_object(report, offset),
            index::LAST_SDO_ERROR => Ok(self.last_error(AmsAddress::MAIN_DEVICE_PORT)),
            _ => Err(AdsCode::BAD_INDEX_GROUP),
        }
    }

    fn write(&self, report: &OnlineReport, group: u32, offset: u32, data: &[u8]) -> AdsOutcome<()> {
        let request = match (group, offset, data) {
            (index::MASTER_STATE, state, []) => {
                self.may_write()?;
                let state = wanted(u16::try_from(state).map_err(|_| AdsCode::BAD_DATA)?)?;
                let there = report.devices.iter().filter(|one| one.present == Some(true));
                let asked = there.map(|one| serve(one, Asked::Enter { state: state.bits() }));
                let answers = self.network.ask(asked.collect());
                return answers.iter().try_for_each(|answer| given(answer.as_ref()).map(drop));
            }
            (index::DEVICE_STATES, station, data) if station != 0 => {
                let device = at(report, station)?;
                return self.enter(device, data);
            }
            (index::FRAME_COUNTS, 0, []) => Request::Clear { errors: false, frames: true },
            (index::CRC_COUNTS, 0, []) => Request::Clear { errors: true, frames: false },
            (index::MASTER_STATE | index::FRAME_COUNTS | index::CRC_COUNTS, ..) => {
                return Err(if data.is_empty() {
                    AdsCode::BAD_INDEX_OFFSET
                } else {
                    AdsCode::BAD_SIZE
                });
            }
            (index::DEVICE_STATES, ..) => return Err(AdsCode::BAD_INDEX_OFFSET),
            // What is there, but is only read.
            (index::SDO, ..) => return Err(AdsCode::NOT_PERMITTED),
            _ if self.read(report, group, offset).is_ok() => return Err(AdsCode::NOT_PERMITTED),
            _ => return Err(AdsCode::BAD_INDEX_GROUP),
        };
        self.may_write()?;
        self.one(request).map(drop)
    }

    /// Takes a SubDevice to the state that was written.
    fn enter(&self, device: &OnlineDevice, data: &[u8]) -> AdsOutcome<()> {
        self.may_write()?;
        let word: [u8; STATE_LEN] = data.try_into().map_err(|_| AdsCode::BAD_SIZE)?;
        let word = u16::from_le_bytes(word);
        let state = wanted(word & !ACKNOWLEDGE)?;
        if word & ACKNOWLEDGE != 0 {
            self.one(serve(device, Asked::Acknowledge))?;
        }
        self.one(serve(device, Asked::Enter { state: state.bits() })).map(drop)
    }

    fn of_device(&self, device: &OnlineDevice, request: &AdsRequest<'_>) -> AdsOutcome<AdsAnswer> {
        match *request {
            AdsRequest::DeviceInfo => Ok(device_info(&device.name)),
            AdsRequest::State => {
                let state =
                    AlState::ALL.into_iter().find(|one| is_named(*one, device.al_state.as_deref()));
                let device = state.map_or(0, |state| state.bits().into());
                Ok(AdsAnswer::State { ads: AdsAnswer::RUN, device })
            }
            AdsRequest::Read { group: index::SDO, offset, .. } => {
                let (object, complete) = index::object(offset);
                let (index, subindex) = (object.index.0, object.subindex);
                let upload = Asked::Upload { index, subindex, complete };
                self.access(device, upload).map(AdsAnswer::Read)
            }
            AdsRequest::Write { group: index::SDO, offset, data } => {
                self.may_write()?;
                let (object, complete) = index::object(offset);
                let (index, subindex) = (object.index.0, object.subindex);
                let download = Asked::Download { index, subindex, complete, data: to_hex(data) };
                self.access(device, download).map(|_| AdsAnswer::Done)
            }
            AdsRequest::Read { group: index::LAST_SDO_ERROR, .. } => {
                Ok(AdsAnswer::Read(self.last_error(device.station)))
            }
            AdsRequest::Read { group: index::IDN, offset, .. } => {
                let (drive, idn, elements) = identification_number(offset);
                let read = Asked::ReadIdn { drive, idn, elements };
                self.mailbox(device, read).map(AdsAnswer::Read)
            }
            AdsRequest::Write { group: index::IDN, offset, data } => {
                self.may_write()?;
                let (drive, idn, elements) = identification_number(offset);
                let write = Asked::WriteIdn { drive, idn, elements, data: to_hex(data) };
                self.mailbox(device, write).map(|_| AdsAnswer::Done)
            }
            AdsRequest::Other(_) => Err(AdsCode::SERVICE_NOT_SUPPORTED),
            AdsRequest::Read { .. } | AdsRequest::Write { .. } | AdsRequest::ReadWrite { .. } => {
                Err(AdsCode::BAD_INDEX_GROUP)
            }
        }
    }

    /// An access to an object, whose abort code is kept.
    fn access(&self, device: &OnlineDevice, asked: Asked) -> AdsOutcome<Vec<u8>> {
        self.has_mailbox(device)?;
        let answer = self.first(serve(device, asked));
        let abort = answer.as_ref().ok().and_then(|answer| answer.refusal.as_ref());
        let abort = abort.filter(|refusal| refusal.kind == SDO_ABORT).map_or(0, |one| one.code);
        self.network.set_last_abort(device.station, abort);
        given(answer.as_ref())
    }

    pub(super) fn mailbox(&self, device: &OnlineDevice, asked: Asked) -> AdsOutcome<Vec<u8>> {
        self.has_mailbox(device)?;
        self.one(serve(device, asked))
    }

    #[allow(clippy::unused_self, reason = "a step of the services")]
    fn has_mailbox(&self, device: &OnlineDevice) -> AdsOutcome<()> {
        if device.mailbox.is_none() {
            return Err(AdsCode::SERVICE_NOT_SUPPORTED);
        }
        match device.al_state.as_deref() {
            Some("PREOP" | "SAFEOP" | "OP" | "BOOT") => Ok(()),
            _ => Err(AdsCode::INVALID_STATE),
        }
    }

    /// An object of the MainDevice itself.
    fn own_object(&self, report: &OnlineReport, offset: u32) -> AdsOutcome<Vec<u8>> {
        let objects = own_objects(report);
        let (object, complete) = index::object(offset);
        let read = if complete {
            objects.upload_all(object, AlState::Op).map(|mut data| {
                if CONFIGURED.contains(&object.index.0) {
                    data.resize(data.len().next_multiple_of(4), 0);
                }
                data
            })
        } else {
            objects.upload(object, AlState::Op)
        };
        let abort = read.as_ref().err().map_or(0, |code| code.value());
        self.network.set_last_abort(AmsAddress::MAIN_DEVICE_PORT, abort);
        read.map_err(AdsCode::of_abort)
    }

    /// The vendor's `ST_EcLastProtErrInfo`: who was asked, twice, and the code; nothing is told beside it.
    fn last_error(&self, port: u16) -> Vec<u8> {
        let asked = AmsAddress { net_id: self.net_id, port }.to_bytes();
        let code = self.network.last_abort(port).to_le_bytes();
        [&asked[..], &asked, &code, &[0; 256]].concat()
    }

    /// A datagram to one SubDevice, as the service for registers sends it.
    fn datagram(&self, report: &OnlineReport, bytes: &[u8]) -> AdsOutcome<Vec<u8>> {
        let datagram = RegisterDatagram::parse(bytes).ok_or(AdsCode::BAD_DATA)?;
        if datagram.writes {
            self.may_write()?;
        }
        let device = report.devices.iter().find(|one| match datagram.target {
            RegisterTarget::Place(place) => one.auto_increment == place,
            RegisterTarget::Station(station) => one.station == station,
        });
        let passed = report.present as u16;
        // Nobody is there: it comes back as it went.
        let Some(device) = device else { return Ok(datagram.returned(passed, None, false)) };
        let address = datagram.register.0;
        let asked = if datagram.writes {
            Asked::WriteRegister { address, data: to_hex(datagram.data()) }
        } else {
            Asked::ReadRegister { address, len: datagram.data().len() as u16 }
        };
        Ok(match self.one(serve(device, asked)) {
            Ok(read) => datagram.returned(passed, Some(&read), true),
            Err(code @ (AdsCode::BUSY | AdsCode::TIMEOUT)) => return Err(code),
            Err(_) => datagram.returned(passed, None, false),
        })
    }

    pub(super) const fn may_write(&self) -> AdsOutcome<()> {
        if self.read_only { Err(AdsCode::NOT_PERMITTED) } else { Ok(()) }
    }

    fn first(&self, request: Request) -> AdsOutcome<Answer> {
        self.network.ask(vec![request]).pop().unwrap_or(Err(AdsCode::BUSY))
    }

    fn one(&self, request: Request) -> AdsOutcome<Vec<u8>> {
        given(self.first(request).as_ref())
    }
}

/// Kind of a refusal: an abort of an SDO transfer.
const SDO_ABORT: &str = "sdo-abort";

/// Kind of a refusal: a return code of ADS.
const ADS_ERROR: &str = "ads-error";

/// The data that a service gave.
fn given(answer: Result<&Answer, &AdsCode>) -> AdsOutcome<Vec<u8>> {
    let answer = answer.map_err(|code| *code)?;
    if let Some(refusal) = &answer.refusal {
        return Err(match refusal.kind.as_str() {
            ADS_ERROR => AdsCode(refusal.code),
            SDO_ABORT => AdsCode::of_abort(SdoAbortCode(refusal.code)),
            "al-status" => AdsCode::INVALID_STATE,
            _ => AdsCode::GENERAL,
        });
    }
    if answer.error.is_some() {
        return Err(AdsCode::GENERAL);
    }
    answer
        .data
        .as_deref()
        .map_or_else(|| Ok(Vec::new()), |data| from_hex(data).map_err(|_| AdsCode::GENERAL))
}

/// Bytes that a request has room for.
fn room(request: &AdsRequest<'_>) -> usize {
    match *request {
        AdsRequest::Read { len, .. } | AdsRequest::ReadWrite { len, .. } => {
            usize::try_from(len).unwrap_or(usize::MAX)
        }
        AdsRequest::DeviceInfo
        | AdsRequest::State
        | AdsRequest::Write { .. }
        | AdsRequest::Other(_) => 0,
    }
}

fn device_info(name: &str) -> AdsAnswer {
    let mut numbers =
        env!("CARGO_PKG_VERSION").split('.').map(|part| part.parse().unwrap_or(0_u16));
    let mut next = || numbers.next().unwrap_or(0);
    let (major, minor, build) = (next() as u8, next() as u8, next());
    AdsAnswer::DeviceInfo { major, minor, build, name: name.to_owned() }
}

/// Drive, number and elements of an offset.
const fn identification_number(offset: u32) -> (u8, u16, u8) {
    let [low, high, elements, drive] = offset.to_le_bytes();
    (drive & 7, u16::from_le_bytes([low, high]), elements)
}

fn serve(device: &OnlineDevice, service: Asked) -> Request {
    Request::Serve { no: device.no, service }
}

/// A state that can be asked for.
fn wanted(word: u16) -> AdsOutcome<AlState> {
    let all = AlState::ALL.into_iter();
    all.clone().find(|state| u16::from(state.bits()) == word).ok_or(AdsCode::BAD_DATA)
}

fn is_named(state: AlState, name: Option<&str>) -> bool {
    name.is_some_and(|name| state.to_string() == name)
}

fn by_station(report: &OnlineReport, station: u16) -> Option<&OnlineDevice> {
    report.devices.iter().find(|device| device.station == station)
}

fn at(report: &OnlineReport, offset: u32) -> AdsOutcome<&OnlineDevice> {
    let station = u16::try_from(offset).ok();
    station.and_then(|one| by_station(report, one)).ok_or(AdsCode::BAD_INDEX_OFFSET)
}

/// State of the MainDevice: the highest of those SubDevices that answer (one that fell back does not take the network
/// with it), or the highest that it drives them to when none answers.
fn main_state(report: &OnlineReport) -> AlState {
    let there = report.devices.iter().filter(|device| device.present == Some(true));
    let of = |name: Option<&str>| AlState::ALL.into_iter().find(|one| is_named(*one, name));
    let highest = there.filter_map(|device| of(device.al_state.as_deref())).max();
    let target = || report.devices.iter().filter_map(|device| of(device.target.as_deref())).max();
    highest.or_else(target).unwrap_or(AlState::Init)
}

/// The vendor's `ST_EcMasterStatistic`: time in µs, cyclic frames and those lost, queued frames and those lost. The
/// numbers wrap at 32 bits.
fn frame_counts(report: &OnlineReport) -> Vec<u8> {
    let (cyclic, queued) = (report.cyclic, report.queued);
    let counts = [report.time_ns / 1_000, cyclic.sent, cyclic.lost, queued.sent, queued.lost];
    counts.iter().flat_map(|count| (*count as u32).to_le_bytes()).collect()
}

/// Identity that it has told; the planned one before it was asked.
fn identity(device: &OnlineDevice) -> Vec<u8> {
    let OnlineIdentity { vendor_id, product_code, revision, serial } =
        device.found.or(device.planned).unwrap_or_default();
    [vendor_id, product_code, revision, serial].into_iter().flat_map(u32::to_le_bytes).collect()
}

/// Damaged frames by port, A to D.
fn damaged_frames(device: &OnlineDevice) -> impl Iterator<Item = u32> {
    device.ports.iter().map(|port| port.invalid_frames.map_or(0, |count| count.total as u32))
}
