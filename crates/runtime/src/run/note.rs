//! Notes of a run while it lasts, and errors that end it.

use std::sync::Arc;

use linesman_config::inventory::Inventory;
use linesman_config::plan::{Plan, TimeSource};
use linesman_diagnosis::HostObservation;
use linesman_link::error::LinkError;
use linesman_maindevice::Event;
use linesman_proto::time::Instant;
use linesman_session::{RunEvent, RunFailure};

use crate::part::PartFailure;

/// Something to be told while it runs.
#[derive(Clone, Debug)]
pub enum Note {
    /// What the scan found.
    Scanned(Box<Inventory>),
    /// The plan that is started.
    Planned(Arc<Plan>),
    /// The MainDevice tells something.
    Event(Instant, Box<Event>),
    /// The host has noticed something.
    Host(HostObservation),
    /// The diagnosis tells something.
    Finding(Box<linesman_diagnosis::Event>),
    /// The diagnosis does not keep up: so many frames were left out so far.
    Missed(Instant, u64),
    /// A part of this program has failed.
    Failed(PartFailure),
    /// The start waits for the time of this source, until the second time at most.
    AwaitsTime(Instant, Instant, TimeSource),
    /// The line is being stopped.
    Leaving(Instant),
}

impl From<RunEvent> for Note {
    fn from(event: RunEvent) -> Self {
        match event {
            RunEvent::Scanned(inventory) => Self::Scanned(inventory),
            RunEvent::Planned(plan) => Self::Planned(plan),
            RunEvent::MainDevice(at, event) => Self::Event(at, event),
            RunEvent::Host(observation) => Self::Host(observation),
            RunEvent::Finding(event) => Self::Finding(event),
            RunEvent::AwaitsTime(at, until, source) => Self::AwaitsTime(at, until, source),
            RunEvent::Leaving(at) => Self::Leaving(at),
        }
    }
}

/// Why a line cannot be run.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RunError {
    /// The line does not answer.
    #[error("{0}")]
    Scan(String),
    /// What is there is not what is wanted.
    #[error("{0}")]
    Plan(String),
    /// The interface.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// The system has no more threads.
    #[error("starting the diagnosis: {0}. Do: end other programs")]
    Thread(std::io::Error),
    /// A part of this program, or the application.
    #[error(transparent)]
    Failed(PartFailure),
}

impl From<RunFailure> for RunError {
    fn from(failure: RunFailure) -> Self {
        match failure {
            RunFailure::Scan(why) => Self::Scan(why),
            RunFailure::Plan(why) => Self::Plan(why),
        }
    }
}
