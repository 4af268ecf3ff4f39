//! TAP interfaces: network interfaces of this computer whose cable is this program.
//!
//! Reference: `Documentation/networking/tuntap.rst` of Linux; netdevice(7) for addresses. The interface is there as
//! long as the [`TapInterface`]: the kernel removes it when the program ends, however it ends.

use std::fs::{File, OpenOptions};
use std::io::{self, Read as _, Write as _};
use std::mem;
use std::net::Ipv4Addr;
use std::os::fd::{AsFd as _, AsRawFd as _, RawFd};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::PathBuf;

use rustix::net::{AddressFamily, SocketFlags, SocketType, socket_with};

use super::wait::{Waitable, sealed};
use crate::error::this_program;

/// Where TAP interfaces are made.
const DEVICE: &str = "/dev/net/tun";
/// The longest name of an interface, in bytes.
const NAME_MAX: usize = 15;
/// Tries to write a frame while the interface is being taken down give this.
const NOT_UP: i32 = libc::EIO;

/// Why there is no TAP interface.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TapError {
    /// No interface can be called so.
    #[error(
        "TAP interface \"{name}\": expected a name of 1 to 15 letters without `/`, `:`, `%` and white space, such as eoe0"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// An interface is called so already.
    #[error(
        "TAP interface {name}: there is an interface of that name already. Do: choose another name, or remove it \
         (`sudo ip link delete {name}`)"
    )]
    Taken {
        /// The name.
        name: String,
    },
    /// This process may not make one.
    #[error(
        "TAP interface {name}: no right to make it, which needs the capability CAP_NET_ADMIN and access to {DEVICE}. \
         Do: `sudo setcap cap_net_admin,cap_net_raw,cap_sys_nice,cap_ipc_lock+ep {}` once, or start with sudo",
        .binary.display()
    )]
    NoPrivilege {
        /// The name.
        name: String,
        /// The program that needs the capability.
        binary: PathBuf,
    },
    /// The kernel has no TAP interfaces.
    #[error(
        "TAP interface {name}: {DEVICE}: {source}. Do: `sudo modprobe tun`; in a container, hand {DEVICE} to it"
    )]
    NoDevice {
        /// The name.
        name: String,
        /// Why not.
        source: io::Error,
    },
    /// The system refused something else.
    #[error("TAP interface {name}: {doing}: {source}. Do: `ip address show dev {name}`")]
    System {
        /// The name.
        name: String,
        /// What was tried.
        doing: &'static str,
        /// Why not.
        source: io::Error,
    },
}

/// A TAP interface. It is removed when this is dropped.
#[derive(Debug)]
pub struct TapInterface {
    name: String,
    file: File,
}

impl TapInterface {
    /// Makes the interface; it is down, and has no address.
    ///
    /// # Errors
    /// When the name is taken or cannot be one, or this process may not make interfaces.
    pub fn open(name: &str) -> Result<Self, TapError> {
        let fits = |byte: u8| byte.is_ascii_graphic() && !matches!(byte, b'/' | b':' | b'%');
        let is_dots = matches!(name, "." | "..");
        if name.is_empty() || name.len() > NAME_MAX || !name.bytes().all(fits) || is_dots {
            return Err(TapError::Name { name: name.to_owned() });
        }
        let name = name.to_owned();
        let no_privilege = |name: String| TapError::NoPrivilege { name, binary: this_program() };
        let mut options = OpenOptions::new();
        options.read(true).write(true).custom_flags(libc::O_NONBLOCK | libc::O_CLOEXEC);
        let file = match options.open(DEVICE) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                return Err(no_privilege(name));
            }
            Err(source) => return Err(TapError::NoDevice { name, source }),
        };
        let mut request = InterfaceRequest::new(&name);
        let flags = libc::IFF_TAP | libc::IFF_NO_PI | libc::IFF_TUN_EXCL;
        request.0.ifr_ifru.ifru_flags = flags as libc::c_short;
        match request.call(file.as_raw_fd(), libc::TUNSETIFF) {
            Ok(()) => Ok(Self { name, file }),
            Err(error) => Err(match error.raw_os_error() {
                Some(libc::EPERM | libc::EACCES) => no_privilege(name),
                Some(libc::EBUSY | libc::EEXIST) => TapError::Taken { name },
                _ => TapError::System { name, doing: "making it", source: error },
            }),
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Gives it an IPv4 address with a subnet of `bits` bits, 0 to 32.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn set_address(&self, address: Ipv4Addr, bits: u8) -> Result<(), TapError> {
        let mask = u32::MAX.checked_shl(32 - u32::from(bits.min(32))).unwrap_or(0);
        let calls = [
            (libc::SIOCSIFADDR, address, "setting its address"),
            (libc::SIOCSIFNETMASK, Ipv4Addr::from(mask), "setting its subnet mask"),
        ];
        for (call, address, doing) in calls {
            let mut request = InterfaceRequest::new(&self.name);
            request.set_address(address);
            self.configure(&mut request, call, doing)?;
        }
        Ok(())
    }

    /// Switches it on.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn bring_up(&self) -> Result<(), TapError> {
        let mut request = InterfaceRequest::new(&self.name);
        self.configure(&mut request, libc::SIOCGIFFLAGS, "reading its flags")?;
        request.add_flags((libc::IFF_UP | libc::IFF_RUNNING) as libc::c_short);
        self.configure(&mut request, libc::SIOCSIFFLAGS, "switching it on")
    }

    fn configure(
        &self,
        request: &mut InterfaceRequest,
        call: libc::Ioctl,
        doing: &'static str,
    ) -> Result<(), TapError> {
        // Any socket serves to reach the interfaces of a namespace.
        let socket =
            socket_with(AddressFamily::INET, SocketType::DGRAM, SocketFlags::CLOEXEC, None);
        let called = socket.map_err(io::Error::from);
        called.and_then(|socket| request.call(socket.as_raw_fd(), call)).map_err(|source| {
            if source.raw_os_error() == Some(libc::EPERM) {
                TapError::NoPrivilege { name: self.name.clone(), binary: this_program() }
            } else {
                TapError::System { name: self.name.clone(), doing, source }
            }
        })
    }

    /// The next frame that this computer sends by it; how many bytes of `buffer` it takes, `None` when there is none. A
    /// longer one is cut off.
    ///
    /// # Errors
    /// When the interface is gone.
    pub fn receive(&self, buffer: &mut [u8]) -> io::Result<Option<usize>> {
        match (&self.file).read(buffer) {
            Ok(len) => Ok(Some(len)),
            Err(error) if is_for_later(&error) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Gives a frame to this computer. False when it was not taken: the interface is down, or its buffer full.
    ///
    /// # Errors
    /// When the interface is gone.
    pub fn send(&self, frame: &[u8]) -> io::Result<bool> {
        match (&self.file).write(frame) {
            Ok(len) => Ok(len == frame.len()),
            Err(error) if is_for_later(&error) || error.raw_os_error() == Some(NOT_UP) => Ok(false),
            Err(error) => Err(error),
        }
    }
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

impl sealed::Pollable for TapInterface {
    fn polled(&self) -> sealed::Polled<'_> {
        sealed::Polled::new(self.file.as_fd(), &self.name)
    }
}

impl Waitable for TapInterface {}

/// What the kernel is told of an interface: `struct ifreq`.
struct InterfaceRequest(libc::ifreq);

impl InterfaceRequest {
    /// About the interface of this name, of at most 15 bytes.
    #[allow(unsafe_code)]
    fn new(name: &str) -> Self {
        // SAFETY: an all-zero `ifreq` is a valid one: integers, and a union of plain data.
        let mut request: libc::ifreq = unsafe { mem::zeroed() };
        for (to, from) in request.ifr_name.iter_mut().zip(name.bytes().take(NAME_MAX)) {
            *to = from as libc::c_char;
        }
        Self(request)
    }

    fn set_address(&mut self, address: Ipv4Addr) {
        let mut data = [0; 14];
        // Port 0, then the address in the order of the network.
        for (to, from) in data[2..6].iter_mut().zip(address.octets()) {
            *to = from as libc::c_char;
        }
        self.0.ifr_ifru.ifru_addr =
            libc::sockaddr { sa_family: libc::AF_INET as libc::sa_family_t, sa_data: data };
    }

    #[allow(unsafe_code)]
    fn add_flags(&mut self, flags: libc::c_short) {
        // SAFETY: every bit pattern of the union's first bytes is a valid integer.
        let before = unsafe { self.0.ifr_ifru.ifru_flags };
        self.0.ifr_ifru.ifru_flags = before | flags;
    }

    #[allow(unsafe_code)]
    fn call(&mut self, descriptor: RawFd, call: libc::Ioctl) -> io::Result<()> {
        // SAFETY: the descriptor is open during the call, and every call that is made takes an `ifreq` that it reads, and
        // may write.
        let result = unsafe { libc::ioctl(descriptor, call, &raw mut self.0) };
        if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_no_interface_has_are_refused() {
        for name in ["", "a name", "a/b", "..", "0123456789abcdef", "ä"] {
            let error = TapInterface::open(name).unwrap_err();
            assert!(matches!(error, TapError::Name { .. }), "{name}: {error}");
        }
    }

    #[test]
    fn missing_right_is_told_with_the_capability_and_the_device() {
        let error = TapError::NoPrivilege { name: "eoe0".to_owned(), binary: "bin".into() };
        let text = error.to_string();
        assert!(text.contains("CAP_NET_ADMIN") && text.contains("/dev/net/tun"), "{text}");
    }
}
