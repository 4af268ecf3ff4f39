//! Threads, selectors and recorders: what joins the cores to a real interface.
//!
//! [`selector`] says what a word like `eth0+eth1` means, wherever it is written; [`capture`] reads
//! files, [`drive`] runs a
//! MainDevice on cards, [`listen`] hears what is on a card,
//! [`host_watch`] asks about a card, [`serve`] puts a segment on real
//! interfaces, [`record`] writes
//! what was seen to a file, [`control`] breaks and heals it,
//! [`stop`] is the wish to stop.

pub mod capture;
pub mod control;
pub mod drive;
pub mod host_watch;
pub mod listen;
pub mod record;
pub mod selector;
pub mod serve;
pub mod stop;
pub mod wiring;
