//! The system calls on packet sockets that no safe library offers.
//!
//! Reference: packet(7), socket(7), `linux/if_packet.h`, `linux/filter.h`.
#![allow(unsafe_code)]

use std::io;
use std::mem;
use std::os::fd::{AsFd, AsRawFd as _, BorrowedFd, OwnedFd};

use rustix::net::{AddressFamily, SocketFlags, SocketType, socket_with};

/// Opens a packet socket that receives nothing until it is bound.
pub(super) fn open() -> io::Result<OwnedFd> {
    let flags = SocketFlags::CLOEXEC | SocketFlags::NONBLOCK;
    Ok(socket_with(AddressFamily::PACKET, SocketType::RAW, flags, None)?)
}

/// Binds a socket to an interface and an EtherType (or `ETH_P_ALL`), from where on it receives.
pub(super) fn bind(socket: impl AsFd, index: u32, protocol: u16) -> io::Result<()> {
    // SAFETY: an all-zero `sockaddr_ll` is a valid one: it is made of integers.
    let mut address: libc::sockaddr_ll = unsafe { mem::zeroed() };
    address.sll_family = libc::AF_PACKET as u16;
    address.sll_protocol = protocol.to_be();
    address.sll_ifindex = index.cast_signed();
    let len = mem::size_of_val(&address) as libc::socklen_t;
    let socket = socket.as_fd().as_raw_fd();
    // SAFETY: the pointer leads to `address`, of the length given, which outlives the call.
    check(unsafe { libc::bind(socket, (&raw const address).cast(), len) })
}

/// Sets an option whose value is an `int`.
pub(super) fn set_int(
    socket: impl AsFd,
    level: libc::c_int,
    name: libc::c_int,
    value: libc::c_int,
) -> io::Result<()> {
    set_option(socket.as_fd(), level, name, &value)
}

/// Has the kernel drop what `program` refuses.
pub(super) fn set_filter(socket: impl AsFd, program: &[libc::sock_filter]) -> io::Result<()> {
    let filter = libc::sock_fprog {
        len: program.len() as u16,
        // The kernel copies the program and does not write to it.
        filter: program.as_ptr().cast_mut(),
    };
    set_option(socket.as_fd(), libc::SOL_SOCKET, libc::SO_ATTACH_FILTER, &filter)
}

/// Makes the card receive every frame for as long as the socket is open.
pub(super) fn join_promiscuous(socket: impl AsFd, index: u32) -> io::Result<()> {
    let membership = libc::packet_mreq {
        mr_ifindex: index.cast_signed(),
        mr_type: libc::PACKET_MR_PROMISC as u16,
        mr_alen: 0,
        mr_address: [0; 8],
    };
    let name = libc::PACKET_ADD_MEMBERSHIP;
    set_option(socket.as_fd(), libc::SOL_PACKET, name, &membership)
}

/// Frames for which the socket had no room since this was last asked.
pub(super) fn take_drops(socket: impl AsFd) -> io::Result<u32> {
    let mut statistics = libc::tpacket_stats { tp_packets: 0, tp_drops: 0 };
    let mut len = mem::size_of_val(&statistics) as libc::socklen_t;
    let socket = socket.as_fd().as_raw_fd();
    // SAFETY: both pointers lead to live variables, and `len` is the size of the first one.
    check(unsafe {
        libc::getsockopt(
            socket,
            libc::SOL_PACKET,
            libc::PACKET_STATISTICS,
            (&raw mut statistics).cast(),
            &raw mut len,
        )
    })?;
    Ok(statistics.tp_drops)
}

fn set_option<T>(
    socket: BorrowedFd<'_>,
    level: libc::c_int,
    name: libc::c_int,
    value: &T,
) -> io::Result<()> {
    let len = mem::size_of::<T>() as libc::socklen_t;
    let socket = socket.as_raw_fd();
    // SAFETY: the pointer leads to a live value of the length given; the kernel only reads it. The
    // one value that holds a pointer itself is the filter, whose program is borrowed by the caller.
    check(unsafe { libc::setsockopt(socket, level, name, (&raw const *value).cast(), len) })
}

fn check(result: libc::c_int) -> io::Result<()> {
    if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
}
