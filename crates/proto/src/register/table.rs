//! The register table: every register that a MainDevice can see, in order of addresses.
//!
//! Read first: S2 (ESC data sheet, section II, version 3.3), chapter 1 for the overview; each entry
//! names its own chapter. One file of this room per group of chapters. To add a register, add one
//! entry there: the text above it is its meaning, in the table and in these pages alike.
//!
//! ```
//! use linesman_proto::register;
//!
//! assert_eq!(register::AL_STATUS.address.value(), 0x0130);
//! assert_eq!(register::describe(register::AL_STATUS.address).unwrap().title(), "AL status");
//! ```

use super::entry::Register;
use crate::address::RegisterAddress;

/// Declares the registers of one chapter: a constant for each, whose documentation is its meaning,
/// and the list of them all.
macro_rules! registers {
    ($list:ident: $group:literal; $($(#[doc = $doc:literal])+ $name:ident = $register:expr;)+) => {
        $($(#[doc = $doc])+
        pub const $name: Register =
            $register.described($group, concat!($($doc),+).trim_ascii());)+

        /// The registers of this chapter, in order of addresses.
        pub(super) const $list: &[Register] = &[$($name),+];
    };
}

mod application;
mod distributed_clock;
mod error_counter;
mod event;
mod information;
mod link;
mod mapping;
mod pdi;
mod phy;
mod sii;
mod specific;
mod watchdog;

pub use application::*;
pub use distributed_clock::*;
pub use error_counter::*;
pub use event::*;
pub use information::*;
pub use link::*;
pub use mapping::*;
pub use pdi::*;
pub use phy::*;
pub use sii::*;
pub use specific::*;
pub use watchdog::*;

/// All registers, in order of addresses.
pub const ALL: &[Register] = &TABLE;

/// From here up a controller writes the bytes of a datagram at once. Registers below are shadowed:
/// what is written there takes effect only when the frame's check sequence was good (S1).
pub const RAM_START: RegisterAddress = USER_RAM.address;

/// Where the process data RAM starts: process data and mailboxes, guarded by SyncManagers.
pub const PROCESS_RAM_START: RegisterAddress = RegisterAddress(0x1000);

const GROUPS: &[&[Register]] = &[
    information::INFORMATION,
    information::STATION,
    information::PROTECTION,
    link::LINK,
    application::APPLICATION,
    pdi::PDI0,
    pdi::PDI1,
    event::EVENTS,
    error_counter::COUNTERS,
    watchdog::WATCHDOGS,
    sii::SII,
    phy::PHY,
    mapping::FMMUS,
    mapping::SYNC_MANAGERS,
    distributed_clock::RECEIVE_TIMES,
    distributed_clock::TIME_LOOP,
    distributed_clock::CYCLIC,
    distributed_clock::LATCH,
    distributed_clock::EVENT_TIMES,
    specific::SPECIFIC,
    specific::IO,
    specific::RAM,
];

const COUNT: usize = {
    let mut count = 0;
    let mut group = 0;
    while group < GROUPS.len() {
        count += GROUPS[group].len();
        group += 1;
    }
    count
};

static TABLE: [Register; COUNT] = {
    let mut table = [GROUPS[0][0]; COUNT];
    let (mut filled, mut group) = (0, 0);
    while group < GROUPS.len() {
        let mut index = 0;
        while index < GROUPS[group].len() {
            table[filled] = GROUPS[group][index];
            filled += 1;
            index += 1;
        }
        group += 1;
    }
    table
};

#[cfg(test)]
mod tests;
