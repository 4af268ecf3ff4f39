//! Service client of a line that a MainDevice drives: services go through its control socket,
//! beside the cycle.

use std::io::{self, IsTerminal as _};
use std::os::unix::fs::FileTypeExt as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use linesman_diagnosis::Diagnosis;
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_proto::address::DeviceId;
use linesman_proto::sii::Identity;
use linesman_proto::time::Span;
use linesman_runtime::service;
use linesman_runtime::service::message::Answer;

use super::known::KnownDevice;
use super::{ServiceClient, ServiceRefused};
use crate::failure::Failure;
use crate::output::Progress;

/// Between two looks at a file that is under way.
const LOOK_EVERY: Duration = Duration::from_millis(200);

/// A running MainDevice.
pub(super) struct SocketClient {
    path: PathBuf,
}

/// Whether there is a socket of that name.
pub(crate) fn is_one(place: &str) -> bool {
    std::fs::metadata(place).is_ok_and(|found| found.file_type().is_socket())
}

/// Asks the MainDevice for its SubDevices.
pub(super) fn open(place: &str) -> Result<(SocketClient, Vec<KnownDevice>), Failure> {
    let path = PathBuf::from(place);
    let answer = service::status(&path).map_err(|error| silent(&path, &error))?;
    let Some(run) = answer.run else {
        let why = answer.error.unwrap_or_else(|| "it does not say how the run goes".to_owned());
        return Err(Failure::new(format!("{place}: {why}"), "ask again once the line is up"));
    };
    if run.devices.is_empty() {
        let reason = format!("{place}: the MainDevice does not know its SubDevices yet");
        return Err(Failure::new(reason, "ask again in a moment"));
    }
    // Who they are stands in what is seen online; without it they are served all the same.
    let online = service::online(&path).ok().and_then(|answer| answer.online);
    let seen = |no: u32| {
        let devices = online.iter().flat_map(|report| &report.devices);
        devices.into_iter().find(|device| device.no == no)
    };
    let known = |device: &linesman_runtime::run::report::DeviceReport| {
        let seen = seen(device.no);
        let identity = seen.and_then(|seen| seen.found.or(seen.planned));
        KnownDevice {
            id: DeviceId(device.no.saturating_sub(1)),
            station: device.station,
            alias: 0,
            name: Some(device.name.clone()),
            type_name: seen.map_or_else(String::new, |seen| seen.r#type.clone()),
            identity: identity.map(|one| Identity {
                vendor_id: one.vendor_id,
                product_code: one.product_code,
                revision: one.revision,
                serial_number: one.serial,
            }),
            mailbox: true,
            needs_cycle: false,
            boot: true,
        }
    };
    Ok((SocketClient { path }, run.devices.iter().map(known).collect()))
}

impl ServiceClient for SocketClient {
    fn ask(
        &mut self,
        id: DeviceId,
        service: Service,
    ) -> Result<Result<ServiceAnswer, ServiceRefused>, Failure> {
        let asked = match service.moves_file() && io::stderr().is_terminal() {
            true => ask_showing_progress(&self.path, id, &service),
            false => service::ask(&self.path, id.no(), &service),
        };
        let answer = asked.map_err(|error| silent(&self.path, &error))?;
        Ok(answer
            .given()
            .map_err(|(why, refusal)| ServiceRefused { told: Failure::from_text(&why), refusal }))
    }

    fn wait(&mut self, span: Span) -> Result<bool, Failure> {
        std::thread::sleep(std::time::Duration::from_nanos(span.as_nanos()));
        Ok(true)
    }

    fn diagnosis(&mut self) -> Option<Diagnosis> {
        // Its frames are seen by the other process alone.
        None
    }

    fn take_emergencies(&mut self) -> Vec<(DeviceId, String)> {
        // The run tells them itself.
        Vec::new()
    }
}

/// Asks for a file to be moved, and meanwhile how far it has come.
fn ask_showing_progress(path: &Path, id: DeviceId, service: &Service) -> io::Result<Answer> {
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let watcher = scope.spawn(|| {
            let mut progress = Progress::new();
            while !done.load(Ordering::Acquire) {
                std::thread::park_timeout(LOOK_EVERY);
                // Who does not tell how far it has come moves the file all the same.
                let Ok(answer) = service::files(path) else { continue };
                let files = answer.files.unwrap_or_default();
                if let Some(file) = files.into_iter().find(|file| file.no == id.no()) {
                    progress.show(|| file.text);
                }
            }
        });
        let answer = service::ask(path, id.no(), service);
        done.store(true, Ordering::Release);
        watcher.thread().unpark();
        answer
    })
}

pub(crate) fn silent(path: &Path, error: &std::io::Error) -> Failure {
    Failure::new(
        format!("{}: asking the MainDevice behind this socket: {error}", path.display()),
        format!(
            "is it still running? `linesman run --on NIC --control {}` opens one",
            path.display()
        ),
    )
}
