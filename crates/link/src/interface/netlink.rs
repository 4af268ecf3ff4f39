//! Asking the kernel about interfaces: rtnetlink.
//!
//! Reference: rtnetlink(7), netlink(7), `linux/rtnetlink.h`, `linux/if_link.h`. Messages are in the
//! byte order of the machine and hold attributes: length, type, value, padded to four bytes.
//!
//! Whoever joins the group of links is told of each change without asking ([`LinkNews`]): when a carrier came,
//! that is the moment from which frames are let through to the card again (`net/core/link_watch.c` of Linux).
//! A change within a second after another may be told up to a second late.

use std::io;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};
use std::os::fd::OwnedFd;
use std::time::Duration;

use linesman_proto::ethernet::MacAddress;
use rustix::io::Errno;
use rustix::net::netlink::SocketAddrNetlink;
use rustix::net::sockopt::{Timeout, set_socket_timeout};
use rustix::net::{
    AddressFamily, RecvFlags, SendFlags, SocketFlags, SocketType, bind, recv, send, socket_with,
};

const HEADER_LEN: usize = 16;
/// Length of the fixed part of a message about a link.
const LINK_LEN: usize = 16;
/// Length of the fixed part of a message about an address.
const ADDRESS_LEN: usize = 8;
/// More than any answer's piece; the kernel fills at most this much at a time.
const BUFFER_LEN: usize = 64 * 1024;
/// As much of a message as is looked at when nothing was asked.
const NEWS_LEN: usize = 256;
/// Answers come at once; this bounds the wait where something is very wrong.
const PATIENCE: Duration = Duration::from_secs(5);

/// A connection to the kernel's table of interfaces.
pub(crate) struct Netlink {
    socket: OwnedFd,
    buffer: Box<[u8]>,
    sequence: u32,
}

/// What the kernel tells of an interface. Texts are borrowed from the answer.
#[derive(Clone, Debug, Default)]
pub(crate) struct LinkRecord<'a> {
    pub(crate) index: u32,
    /// `ARPHRD_…`.
    pub(crate) hardware_type: u16,
    /// `IFF_…`.
    pub(crate) flags: u32,
    pub(crate) name: &'a str,
    pub(crate) address: Option<MacAddress>,
    pub(crate) mtu: u32,
    /// `IF_OPER_…`.
    pub(crate) operational: u8,
    pub(crate) carrier: bool,
    pub(crate) carrier_changes: u32,
    pub(crate) statistics: LinkStatistics,
    /// Kind of a virtual interface.
    pub(crate) kind: Option<&'a str>,
    /// Index of the bridge or bond that it belongs to.
    pub(crate) master: Option<u32>,
    /// The device behind it and the bus that it is on.
    pub(crate) parent: Option<&'a str>,
    pub(crate) bus: Option<&'a str>,
}

/// Counters of an interface since its driver was loaded, `struct rtnl_link_stats64`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub(crate) struct LinkStatistics {
    pub(crate) rx_packets: u64,
    pub(crate) tx_packets: u64,
    pub(crate) rx_errors: u64,
    pub(crate) tx_errors: u64,
    pub(crate) rx_dropped: u64,
    pub(crate) tx_dropped: u64,
    pub(crate) rx_length_errors: u64,
    pub(crate) rx_crc_errors: u64,
    pub(crate) rx_frame_errors: u64,
    pub(crate) rx_fifo_errors: u64,
    pub(crate) rx_missed_errors: u64,
}

impl Netlink {
    pub(crate) fn open() -> io::Result<Self> {
        let flags = SocketFlags::CLOEXEC;
        let socket = socket_with(AddressFamily::NETLINK, SocketType::RAW, flags, None)?;
        set_socket_timeout(&socket, Timeout::Recv, Some(PATIENCE))?;
        Ok(Self { socket, buffer: vec![0; BUFFER_LEN].into_boxed_slice(), sequence: 0 })
    }

    /// Shows each interface to `each`.
    pub(crate) fn links(&mut self, mut each: impl FnMut(&LinkRecord<'_>)) -> io::Result<()> {
        self.request(libc::RTM_GETLINK, Asked::All, &[0; LINK_LEN], |kind, body| {
            if let (libc::RTM_NEWLINK, Some(record)) = (kind, LinkRecord::read(body)) {
                each(&record);
            }
        })
    }

    /// Shows one interface to `each`. An error of kind `ENODEV` says that there is none.
    pub(crate) fn link<T>(
        &mut self,
        index: u32,
        each: impl FnOnce(&LinkRecord<'_>) -> T,
    ) -> io::Result<T> {
        let mut body = [0; LINK_LEN];
        body[4..8].copy_from_slice(&index.to_ne_bytes());
        let (mut each, mut found) = (Some(each), None);
        self.request(libc::RTM_GETLINK, Asked::One, &body, |kind, body| {
            if let (libc::RTM_NEWLINK, Some(record)) = (kind, LinkRecord::read(body)) {
                found = each.take().map(|each| each(&record));
            }
        })?;
        found.ok_or_else(|| io::Error::from_raw_os_error(libc::ENODEV))
    }

    /// Shows each address with the index of its interface and its prefix length to `each`.
    pub(crate) fn addresses(&mut self, mut each: impl FnMut(u32, IpAddr, u8)) -> io::Result<()> {
        self.request(libc::RTM_GETADDR, Asked::All, &[0; ADDRESS_LEN], |kind, body| {
            if let (libc::RTM_NEWADDR, Some((index, address, prefix))) = (kind, read_address(body))
            {
                each(index, address, prefix);
            }
        })
    }

    /// Sends a request and shows each message of the answer to `each`.
    fn request(
        &mut self,
        kind: u16,
        asked: Asked,
        body: &[u8],
        mut each: impl FnMut(u16, &[u8]),
    ) -> io::Result<()> {
        self.sequence = self.sequence.wrapping_add(1);
        let flags = match asked {
            Asked::One => libc::NLM_F_REQUEST,
            Asked::All => libc::NLM_F_REQUEST | libc::NLM_F_DUMP,
        };
        let len = HEADER_LEN + body.len();
        let mut message = [0; HEADER_LEN + LINK_LEN];
        message[0..4].copy_from_slice(&(len as u32).to_ne_bytes());
        message[4..6].copy_from_slice(&kind.to_ne_bytes());
        message[6..8].copy_from_slice(&(flags as u16).to_ne_bytes());
        message[8..12].copy_from_slice(&self.sequence.to_ne_bytes());
        message[HEADER_LEN..len].copy_from_slice(body);
        send(&self.socket, &message[..len], SendFlags::empty())?;
        loop {
            let (len, _) = recv(&self.socket, &mut self.buffer[..], RecvFlags::empty())?;
            for message in Messages(&self.buffer[..len]) {
                if message.sequence != self.sequence {
                    continue;
                }
                match i32::from(message.kind) {
                    libc::NLMSG_DONE => return Ok(()),
                    libc::NLMSG_ERROR => return error(message.body),
                    _ => each(message.kind, message.body),
                }
                if matches!(asked, Asked::One) {
                    return Ok(());
                }
            }
        }
    }
}

/// What the kernel tells of links to all who listen.
pub(crate) struct LinkNews {
    socket: OwnedFd,
    buffer: [u8; NEWS_LEN],
}

impl LinkNews {
    /// Begins to listen.
    pub(crate) fn listen() -> io::Result<Self> {
        let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
        let socket = socket_with(AddressFamily::NETLINK, SocketType::RAW, flags, None)?;
        let groups = libc::RTMGRP_LINK.cast_unsigned();
        bind(&socket, &SocketAddrNetlink::new(0, groups))?;
        Ok(Self { socket, buffer: [0; NEWS_LEN] })
    }

    /// Whether an interface was spoken of since it was asked last. Does not wait.
    pub(crate) fn about(&mut self, index: u32) -> io::Result<bool> {
        let mut is_told = false;
        loop {
            match recv(&self.socket, &mut self.buffer[..], RecvFlags::empty()) {
                Ok((len, _)) => {
                    // The head of a message tells of whom it is; its end may be cut off.
                    let message = &self.buffer[..len];
                    is_told |= u32_at(message, HEADER_LEN + 4) == Some(index);
                }
                Err(Errno::AGAIN) => return Ok(is_told),
                Err(Errno::INTR) => {}
                // There was more than fits: some of it may have been about this one.
                Err(Errno::NOBUFS) => is_told = true,
                Err(error) => return Err(error.into()),
            }
        }
    }
}

#[derive(Clone, Copy)]
enum Asked {
    One,
    All,
}

fn error(body: &[u8]) -> io::Result<()> {
    match body.first_chunk().map(|code| i32::from_ne_bytes(*code)) {
        Some(0) => Ok(()),
        Some(code) => Err(io::Error::from_raw_os_error(-code)),
        None => Err(io::ErrorKind::InvalidData.into()),
    }
}

struct Message<'a> {
    kind: u16,
    sequence: u32,
    body: &'a [u8],
}

struct Messages<'a>(&'a [u8]);

impl<'a> Iterator for Messages<'a> {
    type Item = Message<'a>;

    fn next(&mut self) -> Option<Message<'a>> {
        let len = u32_at(self.0, 0)? as usize;
        let body = self.0.get(HEADER_LEN..len)?;
        let (kind, sequence) = (u16_at(self.0, 4)?, u32_at(self.0, 8)?);
        self.0 = self.0.get(len.next_multiple_of(4)..).unwrap_or_default();
        Some(Message { kind, sequence, body })
    }
}

/// Attributes: type, without its flag bits, and value.
struct Attributes<'a>(&'a [u8]);

impl<'a> Iterator for Attributes<'a> {
    type Item = (u16, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        const TYPE_MASK: u16 = 0x3FFF;
        let len = usize::from(u16_at(self.0, 0)?);
        let kind = u16_at(self.0, 2)? & TYPE_MASK;
        let value = self.0.get(4..len)?;
        self.0 = self.0.get(len.next_multiple_of(4)..).unwrap_or_default();
        Some((kind, value))
    }
}

impl<'a> LinkRecord<'a> {
    /// Whether it is switched on.
    pub(crate) const fn is_up(&self) -> bool {
        self.flags & libc::IFF_UP as u32 != 0
    }

    fn read(body: &'a [u8]) -> Option<Self> {
        let mut record = Self {
            hardware_type: u16_at(body, 2)?,
            index: u32_at(body, 4)?,
            flags: u32_at(body, 8)?,
            ..Self::default()
        };
        for (kind, value) in Attributes(body.get(LINK_LEN..)?) {
            match kind {
                libc::IFLA_IFNAME => record.name = text(value).unwrap_or_default(),
                libc::IFLA_ADDRESS => record.address = value.try_into().ok().map(MacAddress),
                libc::IFLA_MTU => record.mtu = u32_at(value, 0)?,
                libc::IFLA_MASTER => record.master = u32_at(value, 0),
                libc::IFLA_OPERSTATE => record.operational = *value.first()?,
                libc::IFLA_CARRIER => record.carrier = *value.first()? != 0,
                libc::IFLA_CARRIER_CHANGES => record.carrier_changes = u32_at(value, 0)?,
                libc::IFLA_STATS64 => record.statistics = LinkStatistics::read(value),
                libc::IFLA_PARENT_DEV_NAME => record.parent = text(value),
                libc::IFLA_PARENT_DEV_BUS_NAME => record.bus = text(value),
                libc::IFLA_LINKINFO => {
                    let info = Attributes(value).find(|(kind, _)| *kind == libc::IFLA_INFO_KIND);
                    record.kind = info.and_then(|(_, value)| text(value));
                }
                _ => {}
            }
        }
        Some(record)
    }
}

impl LinkStatistics {
    /// The fields stand in the order of the header file; newer kernels add some at the end.
    fn read(value: &[u8]) -> Self {
        let counter = |field: usize| {
            let bytes = value.get(field * 8..).and_then(|rest| rest.first_chunk());
            bytes.map_or(0, |bytes| u64::from_ne_bytes(*bytes))
        };
        Self {
            rx_packets: counter(0),
            tx_packets: counter(1),
            rx_errors: counter(4),
            tx_errors: counter(5),
            rx_dropped: counter(6),
            tx_dropped: counter(7),
            rx_length_errors: counter(10),
            rx_crc_errors: counter(12),
            rx_frame_errors: counter(13),
            rx_fifo_errors: counter(14),
            rx_missed_errors: counter(15),
        }
    }
}

fn read_address(body: &[u8]) -> Option<(u32, IpAddr, u8)> {
    let (prefix, index) = (*body.get(1)?, u32_at(body, 4)?);
    // The local address is told apart only on point-to-point links.
    let (mut address, mut local) = (None, None);
    for (kind, value) in Attributes(body.get(ADDRESS_LEN..)?) {
        match kind {
            libc::IFA_ADDRESS => address = ip(value),
            libc::IFA_LOCAL => local = ip(value),
            _ => {}
        }
    }
    Some((index, local.or(address)?, prefix))
}

fn ip(value: &[u8]) -> Option<IpAddr> {
    let v4 = <[u8; 4]>::try_from(value).map(|bytes| Ipv4Addr::from(bytes).into());
    let v6 = || <[u8; 16]>::try_from(value).map(|bytes| Ipv6Addr::from(bytes).into());
    v4.or_else(|_| v6()).ok()
}

fn text(value: &[u8]) -> Option<&str> {
    let end = value.iter().position(|byte| *byte == 0).unwrap_or(value.len());
    str::from_utf8(&value[..end]).ok().filter(|text| !text.is_empty())
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_ne_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_loopback_interface_is_found_with_its_address() {
        let mut netlink = Netlink::open().unwrap();
        let mut loopback = None;
        netlink
            .links(|record| {
                if record.name == "lo" {
                    loopback = Some((record.index, record.hardware_type, record.flags));
                }
            })
            .unwrap();
        let (index, hardware_type, flags) = loopback.expect("every namespace has lo");
        assert_eq!(hardware_type, libc::ARPHRD_LOOPBACK);
        assert_ne!(flags & libc::IFF_LOOPBACK as u32, 0);
        assert_eq!(netlink.link(index, |record| record.name.to_owned()).unwrap(), "lo");
        let error = netlink.link(0x7FFF_FFF0, |_| ()).unwrap_err();
        assert_eq!(error.raw_os_error(), Some(libc::ENODEV));
        let mut addresses = Vec::new();
        netlink
            .addresses(|on, address, prefix| {
                if on == index {
                    addresses.push((address, prefix));
                }
            })
            .unwrap();
        let up = flags & libc::IFF_UP as u32 != 0;
        assert_eq!(up, addresses.contains(&(Ipv4Addr::LOCALHOST.into(), 8)), "{addresses:?}");
    }

    #[test]
    fn cut_off_messages_and_attributes_end_the_walk() {
        let mut bytes = Vec::new();
        bytes.extend(24_u32.to_ne_bytes());
        bytes.extend([0; 12]);
        bytes.extend(8_u16.to_ne_bytes());
        bytes.extend(libc::IFLA_MTU.to_ne_bytes());
        bytes.extend(1500_u32.to_ne_bytes());
        for len in 0..24 {
            assert_eq!(Messages(&bytes[..len]).count(), 0);
        }
        let body = Messages(&bytes).next().unwrap().body;
        assert_eq!(Attributes(body).count(), 1);
        assert_eq!(Attributes(&body[..7]).count(), 0);
        // A length below the header's own would never come to an end.
        assert_eq!(Attributes(&[0, 0, 0, 0, 0, 0, 0, 0]).count(), 0);
        assert_eq!(Messages(&[0; 64]).count(), 0);
    }
}
