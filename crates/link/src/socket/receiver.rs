//! Common part of both kinds of socket: opening on a card, receiving, waiting, failing.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use rustix::io::Errno;
use rustix::net::{RecvFlags, recv, sockopt};

use super::batch::{Batch, Wanted};
use super::{filter, packet};
use crate::clock::HostClock;
use crate::error::{LinkError, this_program};
use crate::interface::netlink::Netlink;
use crate::interface::{self, Interface, InterfaceKind};

/// How often an interrupted call is repeated before it counts as failed.
pub(super) const RETRIES: usize = 16;

/// A packet socket on an interface that receives.
pub(super) struct Receiver {
    socket: OwnedFd,
    interface: Interface,
    wanted: Wanted,
    /// Set once the interface is gone: the kernel reports it one time only.
    vanished: bool,
    /// A frame is waited for where there is none.
    waits: bool,
    pub(super) counters: SocketCounters,
}

/// What a socket has counted since it was opened.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug, Default)]
pub struct SocketCounters {
    /// Frames received, without those that were not wanted.
    pub received: u64,
    /// Frames handed over for sending.
    pub sent: u64,
    /// Frames that the kernel did not take for sending.
    pub send_failures: u64,
    /// Frames that were lost because the socket's buffer was full.
    pub drops: u64,
}

impl Receiver {
    /// Opens an unbound socket for an interface that is there, up, and an Ethernet one.
    pub(super) fn open(name: &str, wanted: Wanted) -> Result<Self, LinkError> {
        let interface = interface::find(name)?;
        let not_ethernet =
            |hardware_type| LinkError::NotEthernet { interface: name.to_owned(), hardware_type };
        match interface.kind {
            InterfaceKind::NotEthernet(number) => return Err(not_ethernet(number)),
            InterfaceKind::Loopback => return Err(not_ethernet(libc::ARPHRD_LOOPBACK)),
            InterfaceKind::Physical
            | InterfaceKind::Wireless
            | InterfaceKind::VirtualMachine
            | InterfaceKind::Veth
            | InterfaceKind::Bridge
            | InterfaceKind::Bond
            | InterfaceKind::Vlan
            | InterfaceKind::Tap
            | InterfaceKind::Virtual(_) => {}
        }
        if !interface.up {
            return Err(LinkError::Down { interface: name.to_owned() });
        }
        let socket = packet::open().map_err(|error| match error.raw_os_error() {
            Some(libc::EPERM | libc::EACCES) => {
                LinkError::NoPrivilege { interface: name.to_owned(), binary: this_program() }
            }
            _ => LinkError::system(name, "opening a packet socket", error),
        })?;
        let counters = SocketCounters::default();
        let receiver = Self { socket, interface, wanted, vanished: false, waits: false, counters };
        receiver.set("asking for time stamps", libc::SOL_SOCKET, libc::SO_TIMESTAMPNS)?;
        Ok(receiver)
    }

    /// Switches an option on that every kernel has.
    pub(super) fn set(
        &self,
        doing: &'static str,
        level: libc::c_int,
        option: libc::c_int,
    ) -> Result<(), LinkError> {
        packet::set_int(&self.socket, level, option, 1).map_err(self.failed(doing))
    }

    /// Has only EtherCAT frames received, those behind VLAN tags and in UDP included. To be set before
    /// [binding](Self::bind): nothing else slips in.
    pub(super) fn accept_every_form(&self) -> Result<(), LinkError> {
        self.set("asking for VLAN tags", libc::SOL_PACKET, libc::PACKET_AUXDATA)?;
        packet::set_filter(&self.socket, &filter::program())
            .map_err(self.failed("setting the filter for EtherCAT frames"))
    }

    /// Makes room for `bytes` bytes of received frames; more than the system's limit needs
    /// privilege, and without it the limit holds. The kernel counts its own overhead in, so that
    /// it sets aside twice as much.
    pub(super) fn set_receive_buffer(&self, bytes: usize) -> Result<(), LinkError> {
        sockopt::set_socket_recv_buffer_size_force(&self.socket, bytes)
            .or_else(|_| sockopt::set_socket_recv_buffer_size(&self.socket, bytes))
            .map_err(self.failed("setting the size of the receive buffer"))
    }

    /// The receive buffer that is in force, in bytes, the kernel's overhead counted in.
    pub(super) fn receive_buffer(&self) -> Result<usize, LinkError> {
        sockopt::socket_recv_buffer_size(&self.socket)
            .map_err(self.failed("asking for the size of the receive buffer"))
    }

    /// Has [`Receiver::receive_one`] wait for a frame, or not.
    pub(super) fn set_waiting(&mut self, waits: bool) -> Result<(), LinkError> {
        rustix::io::ioctl_fionbio(&self.socket, !waits)
            .map_err(self.failed("choosing whether to wait for frames"))?;
        self.waits = waits;
        Ok(())
    }

    /// Starts receiving frames of this EtherType.
    pub(super) fn bind(&self, protocol: u16) -> Result<(), LinkError> {
        packet::bind(&self.socket, self.interface.index, protocol)
            .map_err(self.failed("binding a packet socket"))
    }

    pub(super) fn interface(&self) -> &Interface {
        &self.interface
    }

    pub(super) fn name(&self) -> &str {
        &self.interface.name
    }

    pub(super) fn socket(&self) -> BorrowedFd<'_> {
        self.socket.as_fd()
    }

    pub(super) fn receive(
        &mut self,
        batch: &mut Batch,
        clock: &HostClock,
    ) -> Result<usize, LinkError> {
        batch.clear();
        self.check_presence()?;
        for _ in 0..RETRIES {
            match batch.receive(&self.socket, clock, self.wanted) {
                Ok(_) => {
                    self.counters.received += batch.len() as u64;
                    return Ok(batch.len());
                }
                Err(error) => match Errno::from_io_error(&error) {
                    Some(Errno::INTR) => {}
                    Some(Errno::AGAIN) => return Ok(0),
                    _ => return Err(self.explain("receiving frames", error)),
                },
            }
        }
        Ok(0)
    }

    pub(super) fn receive_one(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, LinkError> {
        self.check_presence()?;
        let flags = match self.waits {
            true => RecvFlags::TRUNC,
            false => RecvFlags::DONTWAIT | RecvFlags::TRUNC,
        };
        for _ in 0..RETRIES {
            match recv(&self.socket, &mut *buffer, flags) {
                Ok((_, len)) => {
                    self.counters.received += 1;
                    return Ok(Some(len));
                }
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN) => return Ok(None),
                Err(error) => return Err(self.explain("receiving frames", error.into())),
            }
        }
        Ok(None)
    }

    /// The counters, with the drops that the kernel has counted up to now.
    pub(super) fn counters(&mut self) -> Result<SocketCounters, LinkError> {
        let drops = packet::take_drops(&self.socket)
            .map_err(self.failed("reading the statistics of a packet socket"))?;
        self.counters.drops += u64::from(drops);
        Ok(self.counters)
    }

    pub(super) fn check_presence(&self) -> Result<(), LinkError> {
        if self.vanished {
            return Err(LinkError::Vanished { interface: self.name().to_owned() });
        }
        Ok(())
    }

    /// What an error of a call on an open socket means. The kernel reports `ENETDOWN` both when the
    /// interface was switched off and when it was removed.
    pub(super) fn explain(&mut self, doing: &'static str, error: io::Error) -> LinkError {
        let interface = self.name().to_owned();
        match error.raw_os_error() {
            Some(libc::ENETDOWN | libc::ENXIO | libc::ENODEV) => {
                if self.is_present() {
                    LinkError::Down { interface }
                } else {
                    self.vanished = true;
                    LinkError::Vanished { interface }
                }
            }
            _ => LinkError::system(&interface, doing, error),
        }
    }

    fn is_present(&self) -> bool {
        let name = |mut netlink: Netlink| {
            netlink.link(self.interface.index, |record| record.name == self.interface.name)
        };
        Netlink::open().and_then(name).unwrap_or(false)
    }

    /// The longest payload that the interface takes now, in bytes.
    pub(super) fn mtu(&self) -> u32 {
        let ask = |mut netlink: Netlink| netlink.link(self.interface.index, |record| record.mtu);
        Netlink::open().and_then(ask).unwrap_or(self.interface.mtu)
    }

    pub(super) fn failed<E: Into<io::Error>>(
        &self,
        doing: &'static str,
    ) -> impl Fn(E) -> LinkError + use<'_, E> {
        move |error| LinkError::system(self.name(), doing, error)
    }
}
