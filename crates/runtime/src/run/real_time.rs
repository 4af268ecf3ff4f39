//! Real-time requests of a run to the host, and what was granted.
//!
//! A cycle needs to go before other programs, a CPU of its own, and memory that is there. None of it
//! is needed to run at all: without the rights the cycle is as steady as the host lets it be, and the
//! report says how late it was.

use linesman_link::clock::tighten_timers;
use linesman_link::real_time::{lock_memory, pin_to_cpu, sched_fifo};

/// What is asked for.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct RealTime {
    /// Real-time priority, 1 to 99; `None`: as other programs.
    pub priority: Option<u8>,
    /// The CPU it is to stay on; `None`: whichever is free.
    pub cpu: Option<usize>,
    /// Whether memory is kept in RAM.
    pub lock_memory: bool,
}

impl Default for RealTime {
    /// Priority 80, above the kernel's interrupt threads; any CPU; memory locked.
    fn default() -> Self {
        Self { priority: Some(80), cpu: None, lock_memory: true }
    }
}

/// What was granted.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct GrantedRealTime {
    /// The priority.
    pub priority: Option<u8>,
    /// The CPU.
    pub cpu: Option<usize>,
    /// Memory is locked.
    pub memory: bool,
    /// What was not granted, each with what to do about it.
    pub refused: Vec<String>,
}

impl RealTime {
    /// Asks for it, for the calling thread.
    #[must_use]
    pub fn ask(self) -> GrantedRealTime {
        tighten_timers();
        let mut granted = GrantedRealTime::default();
        if self.lock_memory {
            match lock_memory() {
                Ok(()) => granted.memory = true,
                Err(error) => granted.refused.push(error.to_string()),
            }
        }
        if let Some(cpu) = self.cpu {
            match pin_to_cpu(cpu) {
                Ok(()) => granted.cpu = Some(cpu),
                Err(error) => granted.refused.push(error.to_string()),
            }
        }
        if let Some(priority) = self.priority {
            match sched_fifo(priority) {
                Ok(()) => granted.priority = Some(priority),
                Err(error) => granted.refused.push(error.to_string()),
            }
        }
        granted
    }
}
