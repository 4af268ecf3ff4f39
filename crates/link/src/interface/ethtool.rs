//! Asking a driver about its card: the ethtool calls.
//!
//! Reference: `linux/ethtool.h`. All are reading calls that need no privilege. A driver may know
//! none of them.

use std::io;
use std::mem;
use std::os::fd::{AsRawFd as _, OwnedFd};

use rustix::net::{AddressFamily, SocketFlags, SocketType, socket_with};

use super::card::Duplex;
use crate::host_check::DriverSettings;

const GET_DRIVER_INFO: u32 = 0x03;
const GET_COALESCE: u32 = 0x0E;
const GET_RING: u32 = 0x10;
const GET_FLAGS: u32 = 0x25;
const GET_GENERIC_RECEIVE_OFFLOAD: u32 = 0x2B;
const GET_ENERGY_EFFICIENT: u32 = 0x44;
/// Large receive offload in the word of flags.
const FLAG_LARGE_RECEIVE_OFFLOAD: u32 = 1 << 15;
const GET_LINK_SETTINGS: u32 = 0x4C;
/// Words in front of the bit masks of link settings.
const LINK_SETTINGS_WORDS: usize = 12;
/// Most words that the three bit masks can need.
const LINK_MASK_WORDS: usize = 3 * 127;

/// A socket to ask drivers through.
pub(super) struct Ethtool {
    socket: OwnedFd,
}

/// Speed and duplex as the driver tells them; `None` where it does not know.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(super) struct LinkSettings {
    pub(super) speed_mbit: Option<u32>,
    pub(super) duplex: Option<Duplex>,
}

impl Ethtool {
    pub(super) fn open() -> io::Result<Self> {
        let flags = SocketFlags::CLOEXEC;
        // Any socket serves to reach the interfaces of a namespace.
        let socket = socket_with(AddressFamily::INET, SocketType::DGRAM, flags, None)?;
        Ok(Self { socket })
    }

    /// The name of the driver.
    pub(super) fn driver(&self, interface: &str) -> Option<String> {
        let mut info = [0; 49];
        info[0] = GET_DRIVER_INFO;
        self.query(interface, &mut info).ok()?;
        let name = info[1..9].iter().flat_map(|word| word.to_ne_bytes());
        let name: Vec<u8> = name.take_while(|byte| *byte != 0).collect();
        String::from_utf8(name).ok().filter(|name| !name.is_empty())
    }

    pub(super) fn link_settings(&self, interface: &str) -> LinkSettings {
        self.try_link_settings(interface).unwrap_or_default()
    }

    fn try_link_settings(&self, interface: &str) -> Option<LinkSettings> {
        let mut settings = [0; LINK_SETTINGS_WORDS + LINK_MASK_WORDS];
        settings[0] = GET_LINK_SETTINGS;
        // Asked without bit masks, the driver answers how many words it wants, negated.
        self.query(interface, &mut settings).ok()?;
        let wanted = settings[3].to_ne_bytes()[3].cast_signed();
        let words = u8::try_from(-i16::from(wanted)).ok().filter(|words| *words > 0)?;
        settings.fill(0);
        settings[0] = GET_LINK_SETTINGS;
        settings[3] = u32::from_ne_bytes([0, 0, 0, words]);
        self.query(interface, &mut settings).ok()?;
        let (speed, duplex) = (settings[1], settings[2].to_ne_bytes()[0]);
        Some(LinkSettings {
            speed_mbit: (speed != 0 && speed != u32::MAX).then_some(speed),
            duplex: match duplex {
                0 => Some(Duplex::Half),
                1 => Some(Duplex::Full),
                _ => None,
            },
        })
    }

    /// How long the card waits before it reports a received frame, in µs.
    pub(super) fn receive_delay_us(&self, interface: &str) -> Option<u32> {
        Some(self.ask::<23>(interface, GET_COALESCE)?[1])
    }

    /// All that matters to frames in time.
    pub(super) fn settings(&self, interface: &str) -> DriverSettings {
        let coalesce = self.ask::<23>(interface, GET_COALESCE);
        let ring = self.ask::<9>(interface, GET_RING);
        let offload = self.ask::<2>(interface, GET_GENERIC_RECEIVE_OFFLOAD);
        let flags = self.ask::<2>(interface, GET_FLAGS);
        let energy = self.ask::<10>(interface, GET_ENERGY_EFFICIENT);
        DriverSettings {
            receive_delay_us: coalesce.map(|words| words[1]),
            adaptive_receive_delay: coalesce.map(|words| words[10] != 0),
            send_delay_us: coalesce.map(|words| words[5]),
            generic_receive_offload: offload.map(|words| words[1] != 0),
            large_receive_offload: flags.map(|words| words[1] & FLAG_LARGE_RECEIVE_OFFLOAD != 0),
            energy_efficient: energy.map(|words| words[5] != 0),
            receive_ring: ring.map(|words| (words[5], words[1])).filter(|(_, most)| *most > 0),
        }
    }

    /// The words of the structure of a command; `None` where the driver does not know it.
    fn ask<const N: usize>(&self, interface: &str, command: u32) -> Option<[u32; N]> {
        let mut words = [0; N];
        words[0] = command;
        self.query(interface, &mut words).ok()?;
        Some(words)
    }

    /// Has the driver fill `words`, whose first one is the command.
    #[allow(unsafe_code)]
    fn query(&self, interface: &str, words: &mut [u32]) -> io::Result<()> {
        // SAFETY: an all-zero `ifreq` is a valid one: integers, and a union of plain data.
        let mut request: libc::ifreq = unsafe { mem::zeroed() };
        // The last byte stays zero: it ends the name.
        let room = request.ifr_name.len() - 1;
        if interface.len() > room {
            return Err(io::ErrorKind::InvalidInput.into());
        }
        for (to, from) in request.ifr_name.iter_mut().zip(interface.bytes()) {
            *to = from as libc::c_char;
        }
        request.ifr_ifru.ifru_data = words.as_mut_ptr().cast();
        // SAFETY: the socket is open; `request` is valid for the call, and its data pointer leads
        // to `words`, which every caller sizes for the structure of its command.
        let result = unsafe { libc::ioctl(self.socket.as_raw_fd(), libc::SIOCETHTOOL, &request) };
        if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }
}
