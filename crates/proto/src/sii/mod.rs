//! The SII image, the content of a SubDevice's EEPROM: parse it, build it, read it over the wire.
//!
//! [`image`] is the whole, [`category`] what follows the fixed words, [`reader`] tells which words
//! to read next so that only the used part crosses the wire. Read first: ETG.1000.6 §5.4 for the
//! fixed words, ETG.2010 for the categories; addresses are in *words* of 16 bits ([`word`]).

pub mod category;
pub mod clock;
pub mod configuration;
pub mod fmmu;
pub mod general;
pub mod image;
pub mod lookup;
pub mod mailbox;
pub mod oddity;
pub mod pdo;
pub mod reader;
pub mod strings;
pub mod sync_manager;
pub mod word;

mod build;
mod parse;
mod walk;

#[cfg(test)]
pub(crate) mod tests;

pub use build::BuildError;
pub use category::{Category, CategoryKind, RawCategory};
pub use clock::OpMode;
pub use configuration::{Checksum, Configuration, checksum};
pub use fmmu::FmmuUsage;
pub use general::{CoeDetails, General, GeneralFlags, Identification, PortKind};
pub use image::{Identity, Image, Size};
pub use lookup::ProcessData;
pub use mailbox::{MailboxArea, MailboxPair, Protocols};
pub use oddity::{Oddity, OddityKind, SiiError};
pub use pdo::{Direction, Pdo, PdoEntry, PdoFlags};
pub use reader::Reader;
pub use strings::{SiiString, StringIndex, Strings, StringsError};
pub use sync_manager::{SyncManager, SyncManagerEnable, SyncManagerKind};
pub use word::WordAddress;
