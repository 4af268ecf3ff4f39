//! A socket that only listens: beside another MainDevice, or before becoming one.
//!
//! It has no way to send: no method, and no access to the socket beneath.

use linesman_proto::time::Instant;

use super::batch::{Batch, Wanted};
use super::packet;
use super::receiver::{Receiver, SocketCounters};
use super::wait::{self, Ready, Waitable};
use crate::clock::HostClock;
use crate::error::LinkError;
use crate::interface::Interface;

/// Room for received frames, in bytes: two seconds of a busy line.
const RECEIVE_BUFFER: usize = 16 * 1024 * 1024;

/// What a [`Listener`] hears.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum ListenFilter {
    /// EtherCAT frames, tagged or in UDP too.
    EtherCat,
    /// Every frame: what else is on the line?
    Everything,
}

/// A passive listener on an interface. It sees both directions and never sends.
///
/// The card receives all frames (promiscuous mode) for as long as the listener lives. Frames that
/// a program on this host sends past the queue ([`SocketOptions::bypass_queue`]), or through a
/// driver of its own, are not shown by the kernel; their answers are.
///
/// It cannot send, and does not hand out its socket:
///
/// ```compile_fail,E0599
/// # fn listening(listener: &mut linesman_link::socket::Listener) {
/// listener.send_batch([&[0_u8; 60][..]]);
/// # }
/// ```
/// ```compile_fail,E0277
/// # fn listening(listener: &linesman_link::socket::Listener) {
/// fn socket_of(_: impl std::os::fd::AsFd) {}
/// socket_of(listener);
/// # }
/// ```
///
/// [`SocketOptions::bypass_queue`]: super::SocketOptions::bypass_queue
pub struct Listener {
    receiver: Receiver,
}

impl Listener {
    /// Listens on the interface with this name.
    ///
    /// # Errors
    /// When the interface is missing, down or no Ethernet one, or the process lacks the right.
    pub fn open(interface: &str, filter: ListenFilter) -> Result<Self, LinkError> {
        let receiver = Receiver::open(interface, Wanted::BothWays)?;
        receiver.set_receive_buffer(RECEIVE_BUFFER)?;
        match filter {
            ListenFilter::Everything => {
                receiver.set("asking for VLAN tags", libc::SOL_PACKET, libc::PACKET_AUXDATA)?;
            }
            ListenFilter::EtherCat => receiver.accept_every_form()?,
        }
        packet::join_promiscuous(receiver.socket(), receiver.interface().index)
            .map_err(receiver.failed("switching on promiscuous mode"))?;
        receiver.bind(libc::ETH_P_ALL as u16)?;
        Ok(Self { receiver })
    }

    /// The interface as it was when the listener was opened.
    #[must_use]
    pub fn interface(&self) -> &Interface {
        self.receiver.interface()
    }

    /// Fetches what was heard, as much as `batch` has room for, without waiting; gives how many
    /// frames that were.
    ///
    /// # Errors
    /// [`LinkError::Down`] when the interface was switched off (once; it may come up again),
    /// [`LinkError::Vanished`] when it was removed.
    pub fn recv_batch(&mut self, batch: &mut Batch, clock: &HostClock) -> Result<usize, LinkError> {
        self.receiver.receive(batch, clock)
    }

    /// Waits until there is something to fetch, at most until `deadline`.
    ///
    /// # Errors
    /// When the kernel refuses to wait.
    pub fn wait(&self, clock: &HostClock, deadline: Instant) -> Result<Ready, LinkError> {
        wait::wait_any([self], clock, deadline)
    }

    /// What was counted so far.
    ///
    /// # Errors
    /// When the kernel does not answer.
    pub fn counters(&mut self) -> Result<SocketCounters, LinkError> {
        self.receiver.counters()
    }
}

impl wait::sealed::Pollable for Listener {
    fn polled(&self) -> wait::sealed::Polled<'_> {
        wait::sealed::Polled::new(self.receiver.socket(), self.receiver.name())
    }
}

impl Waitable for Listener {}
