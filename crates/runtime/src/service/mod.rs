//! Services for single SubDevices beside a running MainDevice, asked for through a socket in the file
//! system.
//!
//! What can be asked is in [`message`]: a [`Service`] of the MainDevice with the number of a
//! SubDevice. [`ask`] is for whoever asks; the run takes requests from its [`ServiceSocket`] between two
//! frames, gives them to the MainDevice, and answers when that is done. Neither waits for the other,
//! and the cycle waits for nobody.

pub mod message;

use std::io;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use linesman_link::socket::WakeHandle;
use linesman_maindevice::mailbox::FileProgress;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::{MainDevice, Statistics};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use self::message::{Answer, Asked as AskedService, FileUnderWay, Request};
pub use crate::control_socket::ControlSocketWatch;
use crate::control_socket::{
    self, Asked, ControlSocket, Protocol, Requester, ask_line, foreign_answer,
};
use crate::online::{OnlineState, Rates, Snapshot};
use crate::run::report::RunReport;

/// How long a service may take: a file of a slow SubDevice.
const PATIENCE: Duration = Duration::from_secs(120);

/// What a MainDevice is asked.
pub(crate) struct ServiceProtocol {
    pub(crate) online: OnlineState,
}

/// Longest file that is brought through the socket, in bytes: more than any SubDevice holds.
pub const LONGEST_FILE: u64 = 64 << 20;

/// Request as the thread that runs the line takes it.
pub(crate) enum PreparedRequest {
    Status,
    Online,
    Errors,
    Clear {
        errors: bool,
        frames: bool,
    },
    Files,
    Reset,
    Serve {
        /// Number of the SubDevice in the plan, from 1.
        no: u32,
        /// The service, or the reason why it cannot be read.
        service: Result<Service, String>,
    },
}

/// What the thread that runs the line gives.
pub(crate) enum ServiceReply {
    Answer(Box<Answer>),
    /// Result of a service.
    Served(Box<Result<ServiceAnswer, ServiceFailure>>),
    /// The line as it is now.
    Snapshot(Box<Snapshot>),
    /// Errors are asked for, which are known without it.
    Errors,
    /// Counts begin anew.
    Clear {
        errors: bool,
        /// Where counts of frames begin, if they do.
        frames: Option<Statistics>,
    },
}

impl Protocol for ServiceProtocol {
    type Request = Request;
    type Order = PreparedRequest;
    type Reply = ServiceReply;
    type Answer = Answer;
    const WHO: &'static str = "MainDevice";
    const EXAMPLE: &'static str = "{\"do\":\"status\"}";
    const PATIENCE: Duration = PATIENCE;
    // Two digits for each byte of a file, and what stands around it.
    const LONGEST: u64 = 2 * LONGEST_FILE + control_socket::MOST;

    fn order(request: Request) -> PreparedRequest {
        match request {
            Request::Status => PreparedRequest::Status,
            Request::Online => PreparedRequest::Online,
            Request::Errors => PreparedRequest::Errors,
            Request::Clear { errors, frames } => PreparedRequest::Clear { errors, frames },
            Request::Files => PreparedRequest::Files,
            Request::Reset => PreparedRequest::Reset,
            Request::Serve { no, service } => {
                PreparedRequest::Serve { no, service: service.service() }
            }
        }
    }

    fn answer(&self, reply: ServiceReply) -> Answer {
        match reply {
            ServiceReply::Answer(answer) => *answer,
            ServiceReply::Served(result) => Answer::of(&result),
            ServiceReply::Snapshot(snapshot) => {
                self.online.report(&snapshot).map_or_else(too_early, Answer::online)
            }
            ServiceReply::Errors => self.online.error_sums().map_or_else(too_early, Answer::errors),
            ServiceReply::Clear { errors, frames } => {
                if errors {
                    self.online.clear_errors();
                }
                if let Some(statistics) = frames {
                    self.online.clear_frames(statistics);
                }
                Answer::done()
            }
        }
    }

    fn refusal(&self, why: String) -> Answer {
        Answer::refusal(why)
    }

    fn keep(&self, _: &Request, _: &Answer, _: &UnixStream) -> io::Result<bool> {
        Ok(false)
    }
}

fn too_early() -> Answer {
    Answer::refusal(NOT_UP.to_owned())
}

const NOT_UP: &str = "the line is not up yet. Do: ask again";

/// The socket of a MainDevice that runs. It is removed at the end.
pub struct ServiceSocket {
    socket: ControlSocket<ServiceProtocol>,
    services: PendingServices,
}

impl ServiceSocket {
    /// Begins to listen at `path`. What an earlier run left there is replaced. `wake_handle` wakes the thread
    /// that calls [`ServiceSocket::turn`]; `online` knows what has happened.
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub fn open(path: &Path, wake_handle: WakeHandle, online: OnlineState) -> io::Result<Self> {
        let socket = ControlSocket::open(path, wake_handle, ServiceProtocol { online })?;
        Ok(Self { socket, services: PendingServices::default() })
    }

    /// For whoever tells that nobody can ask any more.
    #[must_use]
    pub fn watch(&self) -> ControlSocketWatch {
        self.socket.watch()
    }

    /// Takes what is asked for. `report` tells how the run goes.
    pub(crate) fn turn(
        &mut self,
        now: Instant,
        main: &mut MainDevice,
        report: impl Fn(&MainDevice) -> RunReport,
    ) {
        self.services.turn(now, main);
        while let Some(asked) = self.socket.poll() {
            self.services.take(asked, now, main, &report);
        }
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: &Result<ServiceAnswer, ServiceFailure>,
    ) {
        self.services.served(ticket, result);
    }

    /// The file of a SubDevice has come so far.
    pub(crate) fn file_moved(&mut self, id: DeviceId, progress: FileProgress) {
        self.services.file_moved(id, progress);
    }
}

/// Services that are being done by the thread that runs the line, and who waits for them.
#[derive(Default)]
pub(crate) struct PendingServices {
    pending: Vec<PendingService>,
    rates: Rates,
}

struct PendingService {
    ticket: ServiceTicket,
    id: DeviceId,
    requester: Requester<ServiceProtocol>,
    moves_file: bool,
    /// State of its file, if it moves one.
    file: Option<FileProgress>,
}

impl PendingServices {
    /// Time has passed.
    pub(crate) fn turn(&mut self, now: Instant, main: &MainDevice) {
        self.rates.turn(now, || main.statistics());
    }

    /// Does what is asked, or begins to. `report` tells how the run goes.
    pub(crate) fn take(
        &mut self,
        asked: Asked<ServiceProtocol>,
        now: Instant,
        main: &mut MainDevice,
        report: impl Fn(&MainDevice) -> RunReport,
    ) {
        let Asked { order, requester } = asked;
        match order {
            PreparedRequest::Status => requester.answer(Answer::status(report(main))),
            PreparedRequest::Online => {
                let snapshot = Snapshot::of(main, now, &self.rates);
                requester.give(ServiceReply::Snapshot(Box::new(snapshot)));
            }
            PreparedRequest::Errors => requester.give(ServiceReply::Errors),
            PreparedRequest::Files => requester.answer(Answer::files(self.files())),
            PreparedRequest::Clear { errors, frames } => {
                if errors {
                    main.clear_counts();
                }
                let frames = frames.then(|| main.statistics());
                requester.give(ServiceReply::Clear { errors, frames });
            }
            PreparedRequest::Reset => requester.answer(match main.reset() {
                true => Answer::done(),
                false => Answer::refusal(NOT_UP.to_owned()),
            }),
            PreparedRequest::Serve { no, service } => match prepared(main, no, service) {
                Ok((id, service)) => {
                    let moves_file = service.moves_file();
                    let ticket = main.serve(now, id, service);
                    self.pending.push(PendingService {
                        ticket,
                        id,
                        requester,
                        moves_file,
                        file: None,
                    });
                }
                Err(why) => requester.answer(Answer::refusal(why)),
            },
        }
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: &Result<ServiceAnswer, ServiceFailure>,
    ) {
        if let Some(at) = self.pending.iter().position(|pending| pending.ticket == ticket) {
            let result = ServiceReply::Served(Box::new(result.clone()));
            // In their order: of two files of a SubDevice the first one is under way.
            self.pending.remove(at).requester.give(result);
        }
    }

    /// The file of a SubDevice has come so far. A SubDevice moves one after the other.
    fn file_moved(&mut self, id: DeviceId, progress: FileProgress) {
        let mut of_it = self.pending.iter_mut().filter(|pending| pending.id == id);
        if let Some(pending) = of_it.find(|pending| pending.moves_file) {
            pending.file = Some(progress);
        }
    }

    fn files(&self) -> Vec<FileUnderWay> {
        let under_way = |pending: &PendingService| {
            pending.file.as_ref().map(|file| FileUnderWay::of(pending.id.no(), file))
        };
        self.pending.iter().filter_map(under_way).collect()
    }
}

impl Requester<ServiceProtocol> {
    fn answer(self, answer: Answer) {
        self.give(ServiceReply::Answer(Box::new(answer)));
    }
}

/// Whom a request means, and what.
fn prepared(
    main: &MainDevice,
    no: u32,
    service: Result<Service, String>,
) -> Result<(DeviceId, Service), String> {
    let plan = main.plan().ok_or(NOT_UP)?;
    let count = plan.devices.len();
    let device = plan.devices.iter().find(|device| device.id.no() == no);
    let device = device.ok_or_else(|| format!("there is no SubDevice {no}, there are {count}"))?;
    Ok((device.id, service?))
}

/// Asks the MainDevice whose socket is at `path` for a service.
///
/// # Errors
/// When nobody listens there, or the answer cannot be read; what the MainDevice or the SubDevice
/// refuses is in the answer.
pub fn ask(path: &Path, no: u32, service: &Service) -> io::Result<Answer> {
    request(path, &Request::Serve { no, service: AskedService::from(service) })
}

/// Asks how the run goes.
///
/// # Errors
/// As [`ask`].
pub fn status(path: &Path) -> io::Result<Answer> {
    request(path, &Request::Status)
}

/// Asks how the line is now.
///
/// # Errors
/// As [`ask`].
pub fn online(path: &Path) -> io::Result<Answer> {
    request(path, &Request::Online)
}

/// Asks which files are under way, asked for here.
///
/// # Errors
/// As [`ask`].
pub fn files(path: &Path) -> io::Result<Answer> {
    request(path, &Request::Files)
}

/// Lets counts begin at 0 again: those of errors and changes, those of frames, or both. No register is
/// touched; that is [`Service::ClearCounters`].
///
/// # Errors
/// As [`ask`].
pub fn clear(path: &Path, errors: bool, frames: bool) -> io::Result<Answer> {
    request(path, &Request::Clear { errors, frames })
}

/// Resets the network: outputs that are locked after a link error are sent again.
///
/// # Errors
/// As [`ask`].
pub fn reset(path: &Path) -> io::Result<Answer> {
    request(path, &Request::Reset)
}

fn request(path: &Path, request: &Request) -> io::Result<Answer> {
    let line = ask_line(path, request, PATIENCE)?;
    serde_json::from_str(&line).map_err(|error| foreign_answer("a run", "a segment", &error))
}
