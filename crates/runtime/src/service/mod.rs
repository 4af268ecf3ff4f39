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
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::{MainDevice, Statistics};
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use self::message::{Answer, Asked as AskedService, Request};
pub use crate::control_socket::ControlSocketWatch;
use crate::control_socket::{Asked, ControlSocket, Protocol, ask_line};
use crate::online::{OnlineState, Rates, Snapshot};
use crate::run::report::RunReport;

/// How long a service may take: a file of a slow SubDevice.
const PATIENCE: Duration = Duration::from_secs(120);

/// What a MainDevice is asked.
pub(crate) struct ServiceProtocol {
    pub(crate) online: OnlineState,
}

/// What the thread that runs the line gives.
pub(crate) enum ServiceReply {
    Answer(Box<Answer>),
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
    type Reply = ServiceReply;
    type Answer = Answer;
    const WHO: &'static str = "MainDevice";
    const EXAMPLE: &'static str = "{\"do\":\"status\"}";
    const PATIENCE: Duration = PATIENCE;

    fn answer(&self, reply: ServiceReply) -> Answer {
        match reply {
            ServiceReply::Answer(answer) => *answer,
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
}

/// Services that are being done by the thread that runs the line, and who waits for them.
#[derive(Default)]
pub(crate) struct PendingServices {
    pending: Vec<(ServiceTicket, Asked<ServiceProtocol>)>,
    rates: Rates,
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
        match asked.request.clone() {
            Request::Status => asked.answer(Answer::status(report(main))),
            Request::Online => {
                let snapshot = Snapshot::of(main, now, &self.rates);
                asked.give(ServiceReply::Snapshot(Box::new(snapshot)));
            }
            Request::Errors => asked.give(ServiceReply::Errors),
            Request::Clear { errors, frames } => {
                if errors {
                    main.clear_counts();
                }
                let frames = frames.then(|| main.statistics());
                asked.give(ServiceReply::Clear { errors, frames });
            }
            Request::Reset => asked.answer(match main.reset() {
                true => Answer::done(),
                false => Answer::refusal(NOT_UP.to_owned()),
            }),
            Request::Serve { no, service } => match prepared(main, no, service) {
                Ok((id, service)) => {
                    let ticket = main.serve(now, id, service);
                    self.pending.push((ticket, asked));
                }
                Err(why) => asked.answer(Answer::refusal(why)),
            },
        }
    }

    /// A service is done.
    pub(crate) fn served(
        &mut self,
        ticket: ServiceTicket,
        result: &Result<ServiceAnswer, ServiceFailure>,
    ) {
        if let Some(at) = self.pending.iter().position(|(pending, _)| *pending == ticket) {
            let (_, asked) = self.pending.swap_remove(at);
            asked.answer(Answer::of(result));
        }
    }
}

impl Asked<ServiceProtocol> {
    fn answer(self, answer: Answer) {
        self.give(ServiceReply::Answer(Box::new(answer)));
    }
}

/// Whom a request means, and what.
fn prepared(
    main: &MainDevice,
    no: u32,
    service: AskedService,
) -> Result<(DeviceId, Service), String> {
    let plan = main.plan().ok_or(NOT_UP)?;
    let count = plan.devices.len();
    let device = plan.devices.iter().find(|device| device.id.no() == no);
    let device = device.ok_or_else(|| format!("there is no SubDevice {no}, there are {count}"))?;
    Ok((device.id, service.service()?))
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
    Ok(serde_json::from_str(&line)?)
}
