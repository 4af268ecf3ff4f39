//! Services for single SubDevices beside a running MainDevice, asked for through a socket in the file
//! system.
//!
//! What can be asked is in [`message`]: a [`Service`] of the MainDevice with the number of a
//! SubDevice. [`ask`] is for whoever asks; the run takes requests from its [`ServiceDesk`] between two
//! frames, gives them to the MainDevice, and answers when that is done. Neither waits for the other,
//! and the cycle waits for nobody.

pub mod message;

use std::io;
use std::os::unix::net::UnixStream;
use std::path::Path;
use std::time::Duration;

use linesman_link::socket::Bell;
use linesman_maindevice::service::{Service, ServiceAnswer, ServiceFailure, ServiceTicket};
use linesman_maindevice::MainDevice;
use linesman_proto::address::DeviceId;
use linesman_proto::time::Instant;

use self::message::{Answer, Asked as AskedService, Request};
use crate::desk::{Asked, Desk, Protocol, ask_line};
use crate::run::report::RunReport;

/// How long a service may take: a file of a slow SubDevice.
const PATIENCE: Duration = Duration::from_secs(120);

/// What a MainDevice is asked.
struct Serving;

impl Protocol for Serving {
    type Request = Request;
    type Answer = Answer;
    const WHO: &'static str = "MainDevice";
    const EXAMPLE: &'static str = "{\"do\":\"status\"}";
    const PATIENCE: Duration = PATIENCE;

    fn refusal(&self, why: String) -> Answer {
        Answer::refusal(why)
    }

    fn keep(&self, _: &Request, _: &Answer, _: &UnixStream) -> io::Result<bool> {
        Ok(false)
    }
}

/// The socket of a MainDevice that runs. It is removed at the end.
pub struct ServiceDesk {
    desk: Desk<Serving>,
    /// Services that are being done, and who waits for them.
    pending: Vec<(ServiceTicket, Asked<Serving>)>,
}

impl ServiceDesk {
    /// Begins to listen at `path`. What an earlier run left there is replaced. `bell` wakes the thread
    /// that calls [`ServiceDesk::turn`].
    ///
    /// # Errors
    /// When somebody listens there already, something else is there, or the system refuses.
    pub fn open(path: &Path, bell: Bell) -> io::Result<Self> {
        Ok(Self { desk: Desk::open(path, bell, Serving)?, pending: Vec::new() })
    }

    /// Takes what is asked for. `report` tells how the run goes.
    pub(crate) fn turn(
        &mut self,
        now: Instant,
        main: &mut MainDevice,
        report: impl Fn(&MainDevice) -> RunReport,
    ) {
        while let Some(asked) = self.desk.poll() {
            match asked.request.clone() {
                Request::Status => {
                    let answer = Answer::status(report(main));
                    asked.answer(answer);
                }
                Request::Serve { no, service } => match prepared(main, no, service) {
                    Ok((id, service)) => {
                        let ticket = main.serve(now, id, service);
                        self.pending.push((ticket, asked));
                    }
                    Err(why) => asked.answer(Answer::refusal(why)),
                },
            }
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

/// Whom a request means, and what.
fn prepared(
    main: &MainDevice,
    no: u32,
    service: AskedService,
) -> Result<(DeviceId, Service), String> {
    let plan = main.plan().ok_or("the line is not up yet. Do: ask again")?;
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

fn request(path: &Path, request: &Request) -> io::Result<Answer> {
    let line = ask_line(path, request, PATIENCE)?;
    Ok(serde_json::from_str(&line)?)
}
