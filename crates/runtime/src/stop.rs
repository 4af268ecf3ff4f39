//! The wish to stop: a signal, or an end that was asked for.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use linesman_link::signal;
use linesman_link::socket::WakeHandle;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

/// Signals by which somebody asks for the end; the second of them ends the program at once.
const ASKED: [i32; 2] = [SIGINT, SIGTERM];

/// Set once somebody wants the program to stop. Copies are the same wish.
#[derive(Clone, Debug, Default)]
pub struct Stop {
    wish: Arc<AtomicBool>,
    wake_handles: Arc<Mutex<Vec<WakeHandle>>>,
    /// The signals that are this wish.
    signals: Vec<i32>,
}

impl Stop {
    /// Set by Ctrl-C (SIGINT), SIGTERM and SIGHUP. The second Ctrl-C ends the program at once, as if
    /// it were not asked for.
    ///
    /// SIGHUP says that the terminal is gone. It never ends the program at once: a connection that
    /// breaks brings it twice, from the kernel and from the shell, and maybe a SIGTERM behind. It is
    /// left alone where it was ignored at the start, as by `nohup`.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn on_signals() -> io::Result<Self> {
        let mut stop = Self { signals: ASKED.to_vec(), ..Self::default() };
        let asked = Arc::new(AtomicBool::new(false));
        for signal in ASKED {
            // In this order: the default of the second signal, then the note of the first.
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&asked))?;
            signal_hook::flag::register(signal, Arc::clone(&asked))?;
            signal_hook::flag::register(signal, Arc::clone(&stop.wish))?;
        }
        if !signal::is_ignored(SIGHUP)? {
            signal_hook::flag::register(SIGHUP, Arc::clone(&stop.wish))?;
            stop.signals.push(SIGHUP);
        }
        Ok(stop)
    }

    /// Whether to stop.
    #[must_use]
    pub fn is_set(&self) -> bool {
        self.wish.load(Ordering::Relaxed)
    }

    /// Asks to stop.
    pub fn set(&self) {
        self.wish.store(true, Ordering::Relaxed);
        for wake_handle in self.wake_handles().iter() {
            wake_handle.wake();
        }
    }

    /// Wakes through this handle when the wish comes, for a thread that waits without end.
    ///
    /// # Errors
    /// When the system refuses.
    pub fn wakes(&self, wake_handle: &WakeHandle) -> io::Result<()> {
        for signal in &self.signals {
            signal_hook::low_level::pipe::register(*signal, wake_handle.for_signals()?)?;
        }
        self.wake_handles().push(wake_handle.clone());
        if self.is_set() {
            wake_handle.wake();
        }
        Ok(())
    }

    fn wake_handles(&self) -> std::sync::MutexGuard<'_, Vec<WakeHandle>> {
        self.wake_handles.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use linesman_link::socket::Waker;

    use super::*;

    #[test]
    fn a_wish_rings_those_who_wait() {
        let (stop, early, late) = (Stop::default(), Waker::new().unwrap(), Waker::new().unwrap());
        stop.wakes(&early.wake_handle()).unwrap();
        assert!(!early.take() && !stop.is_set());
        stop.clone().set();
        assert!(early.take() && stop.is_set());
        stop.wakes(&late.wake_handle()).unwrap();
        assert!(late.take(), "the wish was there before");
    }
}
