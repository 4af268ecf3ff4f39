//! Errors of a network card that cannot be used, or can no longer be used.

use std::io;
use std::path::PathBuf;

use crate::interface::Holder;

/// A failed use of a network card. Its text names the card, what was tried, and what to do next.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LinkError {
    /// There is no such interface.
    #[error(
        "{interface}: there is no such network interface, there are: {}. Do: choose one of them \
         (`linesman interfaces` tells which are suitable)",
        list(.present)
    )]
    Missing {
        /// The name that was asked for.
        interface: String,
        /// The names there are.
        present: Vec<String>,
    },
    /// The interface is switched off.
    #[error("{interface}: the interface is down. Do: `sudo ip link set {interface} up`")]
    Down {
        /// Its name.
        interface: String,
    },
    /// The interface went away while it was used.
    #[error(
        "{interface}: the interface is gone (unplugged, renamed, or its driver was unloaded). Do: \
         bring it back, then start again"
    )]
    Vanished {
        /// The name it had.
        interface: String,
    },
    /// The interface carries no Ethernet frames.
    #[error(
        "{interface}: no Ethernet interface (hardware type {hardware_type}, expected 1). Do: choose \
         an Ethernet card (`linesman interfaces`)"
    )]
    NotEthernet {
        /// Its name.
        interface: String,
        /// Its hardware type, `ARPHRD_…` of Linux.
        hardware_type: u16,
    },
    /// Raw sockets need a capability that this process lacks.
    #[error(
        "{interface}: no right to open a raw socket. Do: `sudo setcap cap_net_raw+ep {}` once, or \
         start with sudo",
        .binary.display()
    )]
    NoPrivilege {
        /// The name of the interface.
        interface: String,
        /// The program that needs the capability.
        binary: PathBuf,
    },
    /// Another process sends on the card.
    #[error("{interface}: {}: {holder}. Do: {}", in_use(.holder), beside(.interface, .holder))]
    InUse {
        /// The name of the interface.
        interface: String,
        /// Which process.
        holder: Holder,
    },
    /// A frame is longer than the interface can send.
    #[error(
        "{interface}: sending a frame of {len} bytes, expected at most {}: the MTU is {mtu}, \
         EtherCAT needs 1500. Do: `sudo ip link set {interface} mtu 1500`",
        .mtu + 14
    )]
    FrameTooLong {
        /// The name of the interface.
        interface: String,
        /// Length of the frame without check sequence, in bytes.
        len: usize,
        /// Longest payload of the interface, in bytes.
        mtu: u32,
    },
    /// A frame has not even an Ethernet header.
    #[error("{interface}: sending a frame of {len} bytes, expected at least 14")]
    FrameTooShort {
        /// The name of the interface.
        interface: String,
        /// Its length in bytes.
        len: usize,
    },
    /// The operating system refused something else.
    #[error("{interface}: {doing}: {source}")]
    System {
        /// The name of the interface, or `network interfaces` for all.
        interface: String,
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: io::Error,
    },
}

impl LinkError {
    pub(crate) fn system(
        interface: &str,
        doing: &'static str,
        source: impl Into<io::Error>,
    ) -> Self {
        Self::System { interface: interface.to_owned(), doing, source: source.into() }
    }

    /// For what concerns no interface in particular.
    pub(crate) fn all(doing: &'static str, source: impl Into<io::Error>) -> Self {
        Self::system("network interfaces", doing, source)
    }
}

/// Where this program lies, for those who are to give it rights.
pub(crate) fn this_program() -> PathBuf {
    std::env::current_exe().unwrap_or_else(|_| PathBuf::from("linesman"))
}

fn in_use(holder: &Holder) -> &'static str {
    if holder.is_segment() {
        "a virtual segment answers on this card already"
    } else if holder.asks() {
        "questions are asked on this card already"
    } else {
        "another MainDevice drives this line"
    }
}

fn beside(interface: &str, holder: &Holder) -> String {
    if holder.is_segment() {
        return "end it first, or name another card".to_owned();
    }
    let control = holder.path_given("--control").filter(|path| path.exists());
    let ask = control.map_or_else(String::new, |path| {
        let path = path.display();
        format!(", ask it through its socket, `linesman online {path}`")
    });
    format!("end it first{ask}, or watch without sending, `linesman diagnose listen:{interface}`")
}

fn list(names: &[String]) -> String {
    if names.is_empty() { "none".to_owned() } else { names.join(", ") }
}
