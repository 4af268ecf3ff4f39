//! One line at work: a MainDevice, the diagnosis of what it sees, and the application it runs.
//!
//! A [`Session`] does no I/O and reads no clock. Whoever has a line gives it frames
//! ([`Session::handle_frame`]), what the host noticed ([`Session::handle_host`]) and the time
//! ([`Session::handle_timeout`]), takes frames to send ([`Session::poll_transmit`]), and asks when to come
//! again ([`Session::poll_timeout`]). With a [`transport::Transport`] these are [`Session::take_in`] and
//! [`Session::send`]: the same two for network cards and for a virtual segment, on a machine and in the lab.
//!
//! - [`session`]: the session itself, and [`session::SessionHooks`], what it is told to do;
//! - [`run`]: the hooks that run a plan: scan, plan, start, application, diagnosis, end;
//! - [`application`]: the application and its process data, [`image`] its variables by name;
//! - [`diagnosis`]: how frames come to the diagnosis, [`probe`] how its questions come to the MainDevice;
//! - [`card`]: what a card counts, as observations of the host;
//! - [`transport`]: where frames go; [`segment_line`] is a virtual segment in virtual time.

pub mod application;
pub mod card;
pub mod diagnosis;
pub mod frame;
pub mod image;
pub mod probe;
pub mod run;
pub mod segment_line;
pub mod session;
pub mod transport;

pub use application::{Application, Idle, Io, Next, StartTime};
pub use diagnosis::DiagnosisInput;
pub use run::{MakePlan, PlanRun, PlanSource, RunEvent, RunFailure, TIME_PATIENCE};
pub use session::{Session, SessionHooks};
