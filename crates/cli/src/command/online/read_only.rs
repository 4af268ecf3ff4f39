//! Online view of a line that nobody drives, with nothing but reads.

use std::path::Path;

use linesman_diagnosis::{FrameSeen, HostObservation};
use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_maindevice::procedure::counters::read_and_clear;
use linesman_maindevice::{Event, MainDevice, Target};
use linesman_proto::address::Position;
use linesman_proto::time::{Instant, Span};
use linesman_runtime::drive::Driver;
use linesman_runtime::online::ReadOnlyPoller;
use linesman_runtime::online::report::OnlineReport;
use linesman_runtime::transport::{Cards, Pace as VirtualPace, Transport};
use linesman_session::SessionHooks;

use super::live::{Live, Pace};
use super::{Arguments, interval, lasts};
use crate::command::line_access;
use crate::failure::Failure;
use crate::output::Output;

/// A look takes milliseconds; a line that is silent for so long is.
const PATIENCE: Span = Span::s(5);

/// Looks at the line on these cards.
pub(super) fn cards(
    names: &[String],
    place: &str,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<OnlineReport, Failure> {
    line_access::refuse(names)?;
    let line = Cards::open(names, HostClock::start())?;
    look(line, ReadOnlyPoller::new(place, Vec::new()), place, arguments, output)
}

/// Looks at the segment of a file; nobody brings it up.
pub(super) fn segment(
    path: &Path,
    place: &str,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<OnlineReport, Failure> {
    let pace = if arguments.live { VirtualPace::Host } else { VirtualPace::Free };
    let line = line_access::virtual_line(path, pace)?;
    let segment = line.segment();
    let names = segment.devices().map(|id| segment.name(id).to_owned()).collect();
    look(line, ReadOnlyPoller::new(place, names), place, arguments, output)
}

fn look<L: Transport<Error = LinkError>>(
    line: L,
    poller: ReadOnlyPoller,
    place: &str,
    arguments: &Arguments,
    output: &mut Output,
) -> Result<OnlineReport, Failure> {
    let stop = line_access::stop()?;
    let options = line.options();
    let lasts = lasts(arguments);
    let span = lasts.map(|lasts| Span::ns(lasts.as_nanos() as u64));
    let poller = if arguments.live || lasts.is_some() { poller } else { poller.once() };
    let until = match (span, arguments.live) {
        (Some(span), _) => line.now() + span,
        (None, true) => Instant::MAX,
        (None, false) => line.now() + PATIENCE,
    };
    let live = match arguments.live {
        true => Some(Live::start(
            arguments.json,
            Pace { interval: interval(arguments), lasts },
            output,
        )?),
        false => None,
    };
    let clears = arguments.clear.is_some_and(super::What::errors);
    let looking =
        ReadOnlyView { poller, live, output, clears, show_at: Instant::ZERO, failure: None };
    let mut driver = Driver::new(line, options, looking);
    let result = driver.run(until, &stop);
    let now = driver.now();
    let ReadOnlyView { poller, live, failure, .. } = driver.into_hooks();
    // The terminal is given back before anything else is told.
    drop(live);
    result?;
    if let Some(failure) = failure {
        return Err(failure);
    }
    poller.report(now).ok_or_else(|| {
        let why = poller.failure().unwrap_or("nobody has answered yet");
        line_access::nobody_since(why).at(place)
    })
}

/// Looks, and shows what was seen.
struct ReadOnlyView<'a> {
    poller: ReadOnlyPoller,
    live: Option<Live>,
    output: &'a mut Output,
    /// The registers are to be cleared, once it is known who is there.
    clears: bool,
    show_at: Instant,
    failure: Option<Failure>,
}

impl ReadOnlyView<'_> {
    fn show(&mut self, now: Instant) -> Result<bool, Failure> {
        let Some(live) = &mut self.live else { return Ok(true) };
        if now < self.show_at {
            return Ok(true);
        }
        let Some(report) = self.poller.report(now) else { return Ok(true) };
        self.show_at = now + Span::ns(live.interval().as_nanos() as u64);
        live.show(&report, self.output)?;
        live.goes_on(self.output)
    }
}

impl SessionHooks for ReadOnlyView<'_> {
    fn frame(&mut self, frame: &FrameSeen<'_>) {
        self.poller.frame(frame);
    }

    fn host(&mut self, observation: &HostObservation) {
        self.poller.host(observation);
    }

    fn event(&mut self, now: Instant, event: Event, main: &mut MainDevice) {
        self.poller.event(now, event, main);
    }

    fn turn(&mut self, now: Instant, main: &mut MainDevice) -> bool {
        if self.clears
            && let Some(report) = self.poller.report(now)
        {
            self.clears = false;
            for place in 0..report.planned as u16 {
                let target = Target::Position(Position(place));
                // Who does not answer shows in the next look.
                drop(main.perform(now, |wire| async move { read_and_clear(&wire, target).await }));
            }
        }
        let goes_on = self.poller.turn(now, main);
        match self.show(now) {
            Ok(shown) => goes_on && shown && !self.output.is_closed(),
            Err(failure) => {
                self.failure = Some(failure);
                false
            }
        }
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let show = self.live.is_some().then_some(self.show_at).filter(|at| *at > Instant::ZERO);
        [self.poller.poll_timeout(), show].into_iter().flatten().min()
    }
}
