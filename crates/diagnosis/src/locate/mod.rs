//! Location of damaged frames: the counters of all controllers, in the order in which the ports check frames.
//!
//! A controller checks a frame where it comes in from outside, and counts a bad one; whether later
//! controllers count it again depends on their type. But all of them lie *behind* the damage: the
//! first port in the order of [`Route::checks`](linesman_proto::topology::Route::checks) that counts
//! is the far end of the hop on which frames are damaged. [`damage`] finds these hops; [`cause`] asks
//! what can do such damage.
//! References: S1 14 (error counters); how to find an error, `REQUIREMENTS` HW-18, HW-22 to HW-28.

pub mod cause;
mod cause_weights;
pub mod cut_distance;
pub mod damage;
pub mod input;
pub mod intervals;
pub mod link_losses;
pub mod probe_places;
mod rhythm;

pub use cause::{Suspect, Suspicion};
pub use damage::{Damage, LastHop, Located};
pub use input::LocateInput;
pub use intervals::Intervals;
pub use link_losses::{LinkLoss, LinkLosses};
