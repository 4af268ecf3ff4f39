//! A socket that exchanges EtherCAT frames with a line.
//!
//! Reference: packet(7), sendmmsg(2).

use std::io;
use std::mem;
use std::os::fd::AsRawFd as _;

use linesman_proto::ethernet::{ETHERTYPE_ETHERCAT, HEADER_LEN, MacAddress};
use linesman_proto::time::{Instant, Span};
use rustix::io::Errno;
use rustix::net::{SendFlags, send};

use super::batch::{Batch, Wanted};
use super::packet;
use super::receiver::{RETRIES, Receiver, SocketCounters};
use super::wait::{self, Ready, Waitable};
use crate::clock::HostClock;
use crate::error::LinkError;
use crate::interface::Interface;

/// A socket that is bound to it receives nothing (packet(7)).
const NO_ETHERTYPE: u16 = 0;
/// Frames that are handed to the kernel in one call.
const SEND_BATCH: usize = 64;

/// How a [`RawSocket`] is set up.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub struct SocketOptions {
    /// Room for received frames, in bytes.
    pub receive_buffer: usize,
    /// Hand frames to the driver past the kernel's queue. It saves about a microsecond, but then a
    /// full card refuses frames at once, and listeners on this host (tcpdump, Wireshark,
    /// [`Listener`](super::Listener)) see only what comes back.
    pub bypass_queue: bool,
    /// Ask the card itself for frames for so long before waiting; rounded down to microseconds.
    /// Zero leaves it to interrupts. More than the system's setting needs `CAP_NET_ADMIN`.
    pub busy_poll: Span,
    /// Frames that are received.
    pub reception: Reception,
}

/// Frames that a [`RawSocket`] receives.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
pub enum Reception {
    /// Frames of EtherType 0x88A4.
    EtherCat,
    /// Those behind VLAN tags and in UDP, too, as controllers process them.
    EveryForm,
    /// None: it only sends.
    Nothing,
}

impl Default for SocketOptions {
    /// 4 MiB of room, through the queue, by interrupts; EtherCAT frames.
    fn default() -> Self {
        Self {
            receive_buffer: 4 * 1024 * 1024,
            bypass_queue: false,
            busy_poll: Span::ZERO,
            reception: Reception::EtherCat,
        }
    }
}

/// How much of a batch was sent.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Debug)]
#[must_use]
pub struct Sent {
    /// Frames that the kernel took: the first so many of the batch.
    pub frames: usize,
    /// Whether it refused the next one because its queue, or the card's, is full.
    pub full: bool,
}

/// An active socket on a card: sends frames, receives those that come back, as [`Reception`] says.
pub struct RawSocket {
    receiver: Receiver,
    vectors: Box<[libc::iovec]>,
    headers: Box<[libc::mmsghdr]>,
    receive_buffer: usize,
}

// SAFETY: the pointers in `vectors` and `headers` are set anew for each call of sendmmsg and never
// followed after it.
#[allow(unsafe_code)]
unsafe impl Send for RawSocket {}

impl RawSocket {
    /// Opens the interface with this name.
    ///
    /// Until the interface is [operational](crate::interface::OperationalState::Up), which may be
    /// a second after its link came up, the kernel takes frames and throws them away.
    ///
    /// # Errors
    /// When the interface is missing, down or no Ethernet one, the process lacks the right, or an
    /// option is refused.
    pub fn open(interface: &str, options: &SocketOptions) -> Result<Self, LinkError> {
        let receiver = Receiver::open(interface, Wanted::Incoming)?;
        receiver.set_receive_buffer(options.receive_buffer)?;
        // Kernels before 4.20 do not know it; their copies are told by direction and left out.
        let _ =
            packet::set_int(receiver.socket(), libc::SOL_PACKET, libc::PACKET_IGNORE_OUTGOING, 1);
        if options.bypass_queue {
            let doing = "switching on the way past the queue";
            receiver.set(doing, libc::SOL_PACKET, libc::PACKET_QDISC_BYPASS)?;
        }
        let busy_poll_us = options.busy_poll.as_nanos() / 1_000;
        if busy_poll_us > 0 {
            let value = libc::c_int::try_from(busy_poll_us).unwrap_or(libc::c_int::MAX);
            let (level, option) = (libc::SOL_SOCKET, libc::SO_BUSY_POLL);
            packet::set_int(receiver.socket(), level, option, value)
                .map_err(receiver.failed("switching on busy polling"))?;
        }
        match options.reception {
            Reception::EtherCat => receiver.bind(ETHERTYPE_ETHERCAT)?,
            Reception::EveryForm => {
                receiver.accept_every_form()?;
                receiver.bind(libc::ETH_P_ALL as u16)?;
            }
            Reception::Nothing => receiver.bind(NO_ETHERTYPE)?,
        }
        Self::around(receiver)
    }

    #[allow(unsafe_code)]
    fn around(receiver: Receiver) -> Result<Self, LinkError> {
        let receive_buffer = receiver.receive_buffer()?;
        // SAFETY: both are made of integers and raw pointers, for which zero is a valid value.
        let (vector, header) = unsafe { (mem::zeroed(), mem::zeroed()) };
        Ok(Self {
            receiver,
            vectors: vec![vector; SEND_BATCH].into_boxed_slice(),
            headers: vec![header; SEND_BATCH].into_boxed_slice(),
            receive_buffer,
        })
    }

    /// The interface as it was when the socket was opened.
    #[must_use]
    pub fn interface(&self) -> &Interface {
        self.receiver.interface()
    }

    /// The card's own address.
    #[must_use]
    pub fn mac(&self) -> Option<MacAddress> {
        self.interface().mac
    }

    /// Room for received frames that the kernel has set aside, in bytes, its own overhead
    /// included; less than twice what was asked for where the system's limit holds.
    #[must_use]
    pub fn receive_buffer(&self) -> usize {
        self.receive_buffer
    }

    /// Sends whole Ethernet frames without check sequence, in order, without waiting.
    ///
    /// # Errors
    /// [`LinkError::FrameTooLong`] and [`LinkError::FrameTooShort`] for a frame that cannot be
    /// sent, [`LinkError::Down`] and [`LinkError::Vanished`] for an interface that cannot send.
    /// Frames before the one that failed were sent.
    pub fn send_batch<'f>(
        &mut self,
        frames: impl IntoIterator<Item = &'f [u8]>,
    ) -> Result<Sent, LinkError> {
        self.receiver.check_presence()?;
        let mut frames = frames.into_iter();
        let mut total = Sent { frames: 0, full: false };
        loop {
            let (count, unfit) = self.gather(&mut frames);
            let sent = self.flush(count)?;
            total.frames += sent.frames;
            total.full = sent.full;
            if let (false, Some(error)) = (sent.full, unfit) {
                self.receiver.counters.send_failures += 1;
                return Err(error);
            }
            if sent.full || count < SEND_BATCH {
                return Ok(total);
            }
        }
    }

    /// Sends one frame, without waiting: as [`send_batch`](Self::send_batch), with less work.
    ///
    /// # Errors
    /// As there.
    pub fn send_one(&mut self, frame: &[u8]) -> Result<Sent, LinkError> {
        self.receiver.check_presence()?;
        for _ in 0..RETRIES {
            match send(self.receiver.socket(), frame, SendFlags::DONTWAIT) {
                Ok(_) => {
                    self.receiver.counters.sent += 1;
                    return Ok(Sent { frames: 1, full: false });
                }
                Err(Errno::INTR) => {}
                Err(Errno::AGAIN | Errno::NOBUFS) => break,
                // The whole story is told there.
                Err(_) => return self.send_batch([frame]),
            }
        }
        self.receiver.counters.send_failures += 1;
        Ok(Sent { frames: 0, full: true })
    }

    /// Fetches one frame that has come back, without waiting, and without the time that the kernel
    /// put on it; a VLAN tag is left out. Gives its length, which is more than `buffer` has when it
    /// did not fit.
    ///
    /// # Errors
    /// As [`recv_batch`](Self::recv_batch).
    pub fn recv_one(&mut self, buffer: &mut [u8]) -> Result<Option<usize>, LinkError> {
        self.receiver.receive_one(buffer)
    }

    /// Has [`recv_one`](Self::recv_one) wait for a frame without end, or not: for who has nothing else
    /// to do, such as a far end that answers, or a measurement of what bare receiving takes.
    ///
    /// # Errors
    /// When the kernel refuses it.
    pub fn set_waiting(&mut self, waits: bool) -> Result<(), LinkError> {
        self.receiver.set_waiting(waits)
    }

    /// Fetches what has come back, as much as `batch` has room for, without waiting; gives how
    /// many frames that were. Copies of sent frames are not among them.
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

    /// Puts frames into the headers, up to one call's worth, or up to one that cannot be sent.
    #[allow(unsafe_code)]
    fn gather<'f>(
        &mut self,
        frames: &mut impl Iterator<Item = &'f [u8]>,
    ) -> (usize, Option<LinkError>) {
        let vectors = self.vectors.as_mut_ptr();
        for slot in 0..SEND_BATCH {
            let Some(frame) = frames.next() else { return (slot, None) };
            if frame.len() < HEADER_LEN {
                let interface = self.receiver.name().to_owned();
                return (slot, Some(LinkError::FrameTooShort { interface, len: frame.len() }));
            }
            let header = &mut self.headers[slot].msg_hdr;
            // SAFETY: there are SEND_BATCH vectors, and `slot` is below that.
            unsafe {
                *vectors.add(slot) = libc::iovec {
                    iov_base: frame.as_ptr().cast_mut().cast(),
                    iov_len: frame.len(),
                };
                header.msg_iov = vectors.add(slot);
            }
            header.msg_iovlen = 1;
        }
        (SEND_BATCH, None)
    }

    /// Hands the first `count` headers to the kernel.
    fn flush(&mut self, count: usize) -> Result<Sent, LinkError> {
        let (mut done, mut interrupts) = (0, 0);
        while done < count {
            let error = match self.hand_over(done, count) {
                Ok(taken) => {
                    done += taken;
                    self.receiver.counters.sent += taken as u64;
                    continue;
                }
                Err(error) => error,
            };
            let errno = error.raw_os_error();
            if errno == Some(libc::EINTR) && interrupts < RETRIES {
                interrupts += 1;
                continue;
            }
            self.receiver.counters.send_failures += 1;
            return match errno {
                Some(libc::EAGAIN | libc::ENOBUFS) => Ok(Sent { frames: done, full: true }),
                Some(libc::EMSGSIZE) => Err(LinkError::FrameTooLong {
                    interface: self.receiver.name().to_owned(),
                    len: self.vectors[done].iov_len,
                    mtu: self.receiver.mtu(),
                }),
                _ => Err(self.receiver.explain("sending frames", error)),
            };
        }
        Ok(Sent { frames: done, full: false })
    }

    /// Hands the headers from `first` up to `end` over; gives how many the kernel took, one at
    /// least.
    #[allow(unsafe_code)]
    fn hand_over(&mut self, first: usize, end: usize) -> io::Result<usize> {
        let headers = &mut self.headers[first..end];
        let socket = self.receiver.socket().as_raw_fd();
        let len = headers.len() as libc::c_uint;
        // SAFETY: `len` headers are there. `gather` has pointed each at one vector, and that at a
        // frame which the caller of `send_batch` lends for longer than this call; the kernel only
        // reads them.
        let result =
            unsafe { libc::sendmmsg(socket, headers.as_mut_ptr(), len, libc::MSG_DONTWAIT as _) };
        usize::try_from(result).map_err(|_| io::Error::last_os_error())
    }
}

impl wait::sealed::Pollable for RawSocket {
    fn polled(&self) -> wait::sealed::Polled<'_> {
        wait::sealed::Polled::new(self.receiver.socket(), self.receiver.name())
    }
}

impl Waitable for RawSocket {}
