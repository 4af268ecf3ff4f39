//! Lock of a card: one program at a time sends on it.
//!
//! The lock is a listening socket with an abstract name, made of the number of the interface
//! (unix(7)). Such names belong to the network namespace, as cards do, need no folder and no rights,
//! and are gone with the process, however it ends. Whoever is refused connects to it and is told by
//! the kernel which process holds it.

use std::fmt;
use std::fs;
use std::mem;
use std::os::fd::{AsRawFd as _, OwnedFd};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use rustix::io::Errno;
use rustix::net::{
    AddressFamily, Shutdown, SocketAddrUnix, SocketFlags, SocketType, bind, connect, listen,
    shutdown, socket_with,
};

use super::card::find;
use crate::error::LinkError;

/// Connections that are never taken stay in the queue; a full one tells nothing of the process.
const BACKLOG: i32 = 4096;
/// How often it is tried when the holder leaves at the same moment.
const TRIES: usize = 40;
/// Time between two tries: a name is free only when every copy of the socket is closed, and a child
/// that the holder has just forked keeps one until it begins its program.
const BETWEEN_TRIES: Duration = Duration::from_millis(5);
/// Longest command that is told, in characters.
const MOST_SHOWN: usize = 100;

/// The right to send on a card, for as long as it lives.
#[derive(Debug)]
pub struct CardLock {
    socket: OwnedFd,
}

impl Drop for CardLock {
    /// Refuses whoever asks from now on, even where a child that was forked a moment ago still has
    /// the socket open.
    fn drop(&mut self) {
        let _ = shutdown(&self.socket, Shutdown::Both);
    }
}

/// The process that has locked a card.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Holder {
    /// Its number; `None` where it cannot be seen from here.
    pub process: Option<i32>,
    /// Its command line, word by word; empty where it is not shown.
    pub command: Vec<String>,
    /// The folder that it works in.
    pub directory: Option<PathBuf>,
}

impl CardLock {
    /// Locks the card with this name.
    ///
    /// # Errors
    /// [`LinkError::InUse`] when another process has; or when there is no such card.
    pub fn take(interface: &str) -> Result<Self, LinkError> {
        let failed = |error: Errno| LinkError::system(interface, "locking the card", error);
        let address = address(interface)?;
        for tried in 0..TRIES {
            if tried > 0 {
                thread::sleep(BETWEEN_TRIES);
            }
            let socket = stream(SocketFlags::CLOEXEC).map_err(failed)?;
            match bind(&socket, &address) {
                Ok(()) => {
                    listen(&socket, BACKLOG).map_err(failed)?;
                    return Ok(Self { socket });
                }
                Err(Errno::ADDRINUSE) => {}
                Err(error) => return Err(failed(error)),
            }
            if let Some(holder) = ask(&address).map_err(failed)? {
                return Err(LinkError::InUse { interface: interface.to_owned(), holder });
            }
        }
        let holder = Holder::default();
        Err(LinkError::InUse { interface: interface.to_owned(), holder })
    }

    /// Who has locked the card with this name; `None`: nobody.
    ///
    /// # Errors
    /// When there is no such card, or the kernel does not answer.
    pub fn holder(interface: &str) -> Result<Option<Holder>, LinkError> {
        let failed = |error| LinkError::system(interface, "asking who has locked the card", error);
        ask(&address(interface)?).map_err(failed)
    }
}

fn address(interface: &str) -> Result<SocketAddrUnix, LinkError> {
    let name = format!("linesman/card/{}", find(interface)?.index);
    SocketAddrUnix::new_abstract_name(name.as_bytes())
        .map_err(|error| LinkError::system(interface, "naming the lock of the card", error))
}

fn stream(flags: SocketFlags) -> Result<OwnedFd, Errno> {
    socket_with(AddressFamily::UNIX, SocketType::STREAM, flags, None)
}

/// Who listens there.
fn ask(address: &SocketAddrUnix) -> Result<Option<Holder>, Errno> {
    let socket = stream(SocketFlags::CLOEXEC | SocketFlags::NONBLOCK)?;
    match connect(&socket, address) {
        Ok(()) => {}
        Err(Errno::CONNREFUSED) => return Ok(None),
        // So many were refused before that the queue is full.
        Err(Errno::AGAIN) => return Ok(Some(Holder::default())),
        Err(error) => return Err(error),
    }
    Ok(Some(process_behind(&socket).map_or_else(Holder::default, Holder::of)))
}

/// The process at the other end of a connection; `None` where it cannot be seen from here.
#[allow(unsafe_code)]
fn process_behind(socket: &OwnedFd) -> Option<i32> {
    // The function of rustix has no room for 0, which stands for a process of another namespace.
    let mut peer = libc::ucred { pid: 0, uid: 0, gid: 0 };
    let mut len = mem::size_of::<libc::ucred>() as libc::socklen_t;
    // SAFETY: `peer` has room for the `len` bytes that the kernel writes at most.
    let result = unsafe {
        libc::getsockopt(
            socket.as_raw_fd(),
            libc::SOL_SOCKET,
            libc::SO_PEERCRED,
            (&raw mut peer).cast(),
            &raw mut len,
        )
    };
    (result == 0 && peer.pid > 0).then_some(peer.pid)
}

impl Holder {
    fn of(process: i32) -> Self {
        let proc = PathBuf::from(format!("/proc/{process}"));
        let words = fs::read(proc.join("cmdline")).unwrap_or_default();
        let words = words.split(|byte| *byte == 0).filter(|word| !word.is_empty());
        let command = words.map(|word| String::from_utf8_lossy(word).into_owned()).collect();
        let directory = fs::read_link(proc.join("cwd")).ok();
        Self { process: Some(process), command, directory }
    }

    /// Whether it is a virtual segment that answers, not a MainDevice.
    #[must_use]
    pub fn is_segment(&self) -> bool {
        self.command.get(1).is_some_and(|word| word == "sim")
    }

    /// Whether it asks beside a MainDevice, and is none.
    #[must_use]
    pub fn asks(&self) -> bool {
        self.command.iter().any(|word| word == "--ask")
    }

    /// What it was given for an option; a path as seen from the folder that it works in.
    #[must_use]
    pub fn path_given(&self, option: &str) -> Option<PathBuf> {
        let after = self.command.iter().skip_while(|word| *word != option).nth(1);
        let joined =
            self.command.iter().find_map(|word| word.strip_prefix(option)?.strip_prefix('='));
        let path = after.map(String::as_str).or(joined)?;
        Some(self.directory.clone().unwrap_or_default().join(path))
    }
}

impl fmt::Display for Holder {
    /// `process 812 (linesman run --on eth0)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Some(process) = self.process else { return f.write_str("another process") };
        write!(f, "process {process}")?;
        let Some((program, words)) = self.command.split_first() else { return Ok(()) };
        let program = program.rsplit('/').next().unwrap_or(program);
        let command = [program].into_iter().chain(words.iter().map(String::as_str));
        let command = command.collect::<Vec<_>>().join(" ");
        match command.char_indices().nth(MOST_SHOWN) {
            None => write!(f, " (`{command}`)"),
            Some((end, _)) => write!(f, " (`{} …`)", &command[..end]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn holder(words: &[&str]) -> Holder {
        Holder {
            process: Some(812),
            command: words.iter().map(|word| (*word).to_owned()).collect(),
            directory: Some("/srv".into()),
        }
    }

    #[test]
    fn a_holder_is_told_by_its_command() {
        let run = holder(&["/usr/bin/linesman", "run", "--on", "eth0", "--control", "c.sock"]);
        let text = "process 812 (`linesman run --on eth0 --control c.sock`)";
        assert_eq!(run.to_string(), text);
        assert_eq!(run.path_given("--control"), Some("/srv/c.sock".into()));
        assert_eq!(run.path_given("--image"), None);
        assert!(!run.is_segment() && holder(&["linesman", "sim", "a.toml"]).is_segment());
        assert!(!run.asks() && holder(&["linesman", "diagnose", "listen:eth0", "--ask"]).asks());
        assert_eq!(holder(&["x", "--control=/a"]).path_given("--control"), Some("/a".into()));
        assert_eq!(Holder::default().to_string(), "another process");
        assert!(holder(&["x", &"y".repeat(200)]).to_string().ends_with("y …`)"));
    }
}
