//! Application layer states: what they are, which transitions exist, what the status codes mean.
//!
//! [`al_state`] names the five states and reads them out of registers and out of broadcast data;
//! [`transition`] is the table of steps with its refusals and time limits; [`status_code`] explains
//! a refusal; [`device_state`] and [`network_state`] are the state words that control programs know
//! from the vendor interface.

pub mod al_state;
pub mod device_state;
pub mod network_state;
pub mod status_code;
pub mod transition;

pub use al_state::{AlState, OredStates, StateValue};
pub use device_state::DeviceState;
pub use network_state::NetworkState;
pub use status_code::{AlStatusCode, StatusCode};
pub use transition::{Answer, Refusal, StateTimeouts};
