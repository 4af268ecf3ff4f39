//! The session itself: a MainDevice, and the hooks that tell it what to do and see its frames.

use linesman_diagnosis::{Direction, FrameSeen, HostEvent, HostObservation};
use linesman_maindevice::{Event, MainDevice, Transmit};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use crate::frame::{FRAME_ROOM, FrameSummary};
use crate::transport::{FrameSink, RxFrame, Transport};

/// Most frames handed out in one go; a MainDevice has far fewer out at once.
const MOST_FRAMES: usize = 1024;

/// Hooks of a session: they see a MainDevice at work, and give it its commands.
pub trait SessionHooks {
    /// A frame left a card or came back.
    fn frame(&mut self, frame: &FrameSeen<'_>);
    /// Room for the longest frame that may be sent, or come back, at `now`, where the hooks keep
    /// frames: it is built, or received, there. When it was, [`keep`](Self::keep) follows in place
    /// of [`frame`](Self::frame).
    fn room(&mut self, _now: Instant) -> Option<&mut [u8]> {
        None
    }
    /// The frame in [`room`](Self::room), so many bytes, has been sent or has come back.
    fn keep(&mut self, _passed: &FrameSummary, _len: usize) {}
    /// The host noticed something.
    fn host(&mut self, observation: &HostObservation);
    /// The MainDevice tells something.
    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice);
    /// Everything up to `now` is done: time for commands. Says whether to go on.
    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool;
    /// True while the turn is that of somebody outside, for whom the session waits: nothing is sent until
    /// [`turn`](Self::turn) is called again.
    fn is_paused(&self) -> bool {
        false
    }
    /// When [`turn`](Self::turn) has something to do.
    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
    /// Whoever drives came so late for the begin of a cycle.
    fn late(&mut self, _late: Span) {}
}

/// A MainDevice on a line, and what it does there.
pub struct Session<H> {
    main: MainDevice,
    hooks: H,
    /// Room for frames that the hooks do not keep.
    buffer: Vec<u8>,
    /// Frames that passed so far, both ways.
    frames: u64,
}

impl<H: SessionHooks> Session<H> {
    /// A MainDevice that nobody has told anything yet.
    #[must_use]
    pub fn new(main: MainDevice, hooks: H) -> Self {
        Self { main, hooks, buffer: vec![0; FRAME_ROOM], frames: 0 }
    }

    /// The MainDevice.
    #[must_use]
    pub const fn main(&self) -> &MainDevice {
        &self.main
    }

    /// The MainDevice, to give it commands.
    pub const fn main_mut(&mut self) -> &mut MainDevice {
        &mut self.main
    }

    /// The hooks.
    #[must_use]
    pub const fn hooks(&self) -> &H {
        &self.hooks
    }

    /// The hooks.
    pub const fn hooks_mut(&mut self) -> &mut H {
        &mut self.hooks
    }

    /// The hooks, and the MainDevice that they command.
    pub const fn parts_mut(&mut self) -> (&mut H, &mut MainDevice) {
        (&mut self.hooks, &mut self.main)
    }

    /// The hooks, at the end.
    #[must_use]
    pub fn into_hooks(self) -> H {
        self.hooks
    }

    /// Hands the next frame at `now` to `send`, where it lies; `None` when there is none. It counts as sent then.
    #[inline]
    pub fn poll_transmit<R>(
        &mut self,
        now: Instant,
        send: impl FnOnce(Path, &[u8]) -> R,
    ) -> Option<R> {
        if !self.main.may_transmit(now) {
            return None;
        }
        let Self { main, hooks, buffer, frames } = self;
        let mut sent = FrameSummary {
            time: now,
            number: *frames + 1,
            path: None,
            direction: Direction::Sent,
            truncated: false,
        };
        if let Some(room) = hooks.room(now) {
            let Transmit { path, len, .. } = main.poll_transmit(now, room)?;
            let result = send(path, room.get(..len).unwrap_or_default());
            *frames += 1;
            sent.path = Some(path);
            hooks.keep(&sent, len);
            return Some(result);
        }
        let Transmit { path, len, .. } = main.poll_transmit(now, buffer)?;
        let bytes = &buffer[..len];
        let result = send(path, bytes);
        *frames += 1;
        sent.path = Some(path);
        hooks.frame(&sent.seen(bytes));
        Some(result)
    }

    /// Takes a frame that came back at `at` on a card, when it is `now`.
    pub fn handle_frame(&mut self, now: Instant, at: Instant, path: Path, frame: &[u8]) {
        let mut intake = self.intake(now);
        let room = intake.room();
        let len = frame.len().min(room.len());
        room[..len].copy_from_slice(&frame[..len]);
        intake.frame_received(RxFrame { at, path, len, truncated: len < frame.len() });
    }

    /// Intake for frames that came back up to `now`, which are received in place.
    pub const fn intake(&mut self, now: Instant) -> Intake<'_, H> {
        Intake { session: self, now }
    }

    /// Takes what the host noticed.
    pub fn handle_host(&mut self, observation: &HostObservation) {
        match observation.what {
            HostEvent::Carrier(carrier) => self.main.handle_carrier(observation.path, carrier),
            HostEvent::SendFailures(_) => self.main.handle_send_failure(observation.time),
            HostEvent::CardErrors { .. }
            | HostEvent::CardDrops(_)
            | HostEvent::SocketDrops(_)
            | HostEvent::Late(_)
            | HostEvent::ClockStep(_) => {}
        }
        self.hooks.host(observation);
    }

    /// Does what is due at `now`; says whether the session goes on.
    pub fn handle_timeout(&mut self, now: Instant) -> bool {
        self.main.handle_timeout(now);
        while let Some(event) = self.main.poll_event() {
            self.hooks.event(now, event, &mut self.main);
        }
        self.hooks.turn(now, &mut self.main)
    }

    /// When [`Session::handle_timeout`] has something to do.
    #[inline]
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let due = [self.main.poll_timeout(), self.hooks.poll_timeout()];
        due.into_iter().flatten().min()
    }

    /// Takes in from a line what came back and what the host noticed, and does what is due; says whether the session
    /// goes on.
    ///
    /// # Errors
    /// Those of the line.
    pub fn take_in<L: Transport>(&mut self, now: Instant, line: &mut L) -> Result<bool, L::Error> {
        // Frames are judged at the time at which they are taken in, not at that of their stamp.
        line.receive(now, &mut self.intake(now))?;
        line.look_at_host(now, &mut |observation| self.handle_host(observation))?;
        if let Some(due) = self.main.poll_cycle_timeout()
            && due <= now
            && !self.hooks.is_paused()
        {
            let late = now.since(due);
            line.note_late(late);
            self.hooks.late(late);
        }
        Ok(self.handle_timeout(now))
    }

    /// Sends what there is to be sent at `now`, which may be a little ago.
    ///
    /// # Errors
    /// Those of the line.
    pub fn send<L: Transport>(&mut self, now: Instant, line: &mut L) -> Result<(), L::Error> {
        for _ in 0..MOST_FRAMES {
            // Clocks of hosts are not read for nothing.
            if !self.main.may_transmit(now) {
                break;
            }
            let now = line.now();
            match self.poll_transmit(now, |path, frame| line.send(path, frame)) {
                Some(sent) => sent?,
                None => break,
            }
        }
        Ok(())
    }
}

/// Intake of frames into a session.
pub struct Intake<'a, H> {
    session: &'a mut Session<H>,
    now: Instant,
}

impl<H: SessionHooks> FrameSink for Intake<'_, H> {
    fn room(&mut self) -> &mut [u8] {
        match self.session.hooks.room(self.now) {
            Some(room) => room,
            None => &mut self.session.buffer,
        }
    }

    fn frame_received(&mut self, frame_received: RxFrame) {
        let RxFrame { at, path, len, truncated } = frame_received;
        let Session { main, hooks, buffer, frames } = &mut *self.session;
        *frames += 1;
        let (number, direction) = (*frames, Direction::Received);
        let passed = FrameSummary { time: at, number, path: Some(path), direction, truncated };
        let at_once = at.max(self.now);
        match hooks.room(self.now) {
            Some(room) => {
                if !truncated && let Some(bytes) = room.get(..len) {
                    main.handle_frame(at_once, path, bytes);
                }
                hooks.keep(&passed, len);
            }
            None => {
                let Some(bytes) = buffer.get(..len) else { return };
                hooks.frame(&passed.seen(bytes));
                if !truncated {
                    main.handle_frame(at_once, path, bytes);
                }
            }
        }
    }
}
