//! Network cards: which there are, what they are like, whether they suit EtherCAT, who has locked them.
//!
//! Everything comes from rtnetlink and ethtool, which tell of the network namespace of the calling
//! thread; sysfs may tell of another one, and is asked only whether a card is wireless.

mod card;
mod ethtool;
mod lock;
pub(crate) mod netlink;
mod suitability;

pub use card::{Duplex, Interface, InterfaceAddress, InterfaceKind, OperationalState};
pub use card::{driver_settings, find, list};
pub use lock::{CardLock, Holder};
pub use suitability::{Assessment, Note, NoteWeight, Suitability};
