//! Our MainDevice on a responder, in virtual time.

use linesman_config::plan::Plan;
use linesman_maindevice::{Event, MainDevice, Options};
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::ethernet::MAX_LEN;
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::time::{Instant, Span};

use crate::responder::Responder;

/// How long a frame is under way.
const ROUND_TRIP: Span = Span::us(50);

pub(crate) struct Line {
    pub(crate) responder: Responder,
    pub(crate) told: Vec<String>,
    /// How often a step was refused or timed out.
    pub(crate) refused: usize,
    main: MainDevice,
    now: Instant,
    under_way: Vec<(Instant, Vec<u8>)>,
    errors_before: u64,
    uploaded: Vec<(ObjectAddress, Result<Vec<u8>, String>)>,
}

impl Line {
    pub(crate) fn new(responder: Responder) -> Self {
        Self {
            responder,
            told: Vec::new(),
            refused: 0,
            main: MainDevice::new(Network(0), Options::default()),
            now: Instant::ZERO,
            under_way: Vec::new(),
            errors_before: 0,
            uploaded: Vec::new(),
        }
    }

    /// Whether all reach their targets within ten seconds.
    pub(crate) fn start(&mut self, plan: Plan) -> bool {
        self.main.start(self.now, plan);
        self.run(Span::s(10), true)
    }

    /// A second of process data, with these outputs.
    pub(crate) fn exchange(&mut self, byte: u8) {
        self.main.outputs_mut().fill(byte);
        self.errors_before = self.main.statistics().working_counter_errors;
        self.run(Span::s(1), false);
    }

    pub(crate) fn working_counter_errors(&self) -> u64 {
        self.main.statistics().working_counter_errors - self.errors_before
    }

    /// Fetches an object; `None` when no answer comes within ten seconds.
    pub(crate) fn upload(
        &mut self,
        id: DeviceId,
        object: ObjectAddress,
        complete: bool,
    ) -> Option<Result<Vec<u8>, String>> {
        self.main.sdo_upload(self.now, id, object, complete);
        self.run(Span::s(10), true);
        self.uploaded.pop().filter(|(of, _)| *of == object).map(|(_, value)| value)
    }

    fn run(&mut self, limit: Span, until_reached: bool) -> bool {
        let end = self.now + limit;
        let mut buffer = vec![0; MAX_LEN];
        loop {
            while let Some(transmit) = self.main.poll_transmit(self.now, &mut buffer) {
                let mut frame = buffer[..transmit.len].to_vec();
                self.responder.answer(transmit.at, &mut frame);
                self.under_way.push((transmit.at + ROUND_TRIP, frame));
            }
            let mut reached = false;
            while let Some(event) = self.main.poll_event() {
                reached |= matches!(event, Event::AllReached);
                if let Event::SdoUploaded { object, result, .. } = &event {
                    let value = result.clone().map_err(|error| error.to_string());
                    self.uploaded.push((*object, value));
                    reached = true;
                }
                self.refused += usize::from(matches!(
                    event,
                    Event::Refused { .. } | Event::StepTimedOut { .. } | Event::DeviceLost { .. }
                ));
                self.told.extend(event.state_lines(|id: DeviceId| format!("{}", id.no())));
            }
            if reached && until_reached {
                return true;
            }
            let arrival = self.under_way.iter().map(|(at, _)| *at).min();
            let next = [self.main.poll_timeout(), arrival].into_iter().flatten().min();
            let Some(next) = next.filter(|next| *next <= end) else { return false };
            self.now = self.now.max(next);
            while let Some(at) = self.under_way.iter().position(|(at, _)| *at <= self.now) {
                let (_, frame) = self.under_way.remove(at);
                self.main.handle_frame(self.now, Path::A, &frame);
            }
            if self.main.poll_timeout().is_some_and(|at| at <= self.now) {
                self.main.handle_timeout(self.now);
            }
        }
    }
}
