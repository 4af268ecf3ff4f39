//! State machine of the questions: recognises the MainDevice, schedules each question, and decides when to stop.

use linesman_proto::address::{Position, RegisterAddress};
use linesman_proto::command::Command;
use linesman_proto::ethernet::{ASKING_DESTINATION, ASKING_SOURCE, MacAddress};
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::frame::{Datagram, FrameBuilder, FrameView};
use linesman_proto::time::{Instant, Span};

use super::carrier::{self, AskRefusal, Carrier};
use super::disturbance::{Disturbance, DisturbanceWatch, FrameOutcomes};
use super::gap::{Gaps, SendWindow};
use super::outcome::{EndReason, News};
use super::report::{AskingReport, AskingState, CarrierName};
use super::schedule::{Question, QuestionSchedule, Target};
use crate::engine::{Asked, Probe, ProbeEffect};
use crate::main_device::MainDeviceKind;
use crate::model::NetworkModel;
use crate::observe::question::is_question;
use crate::observe::{Direction, Fingerprint, FrameSeen, Pairing, companion};
use crate::report::Number;

/// So long the MainDevice is watched before the first question.
const LEARN: Span = Span::s(2);
/// And so many of its frames, at least.
const LEARN_FRAMES: u64 = 10;
/// Whoever gives orders for so long in operation does so always.
const ALWAYS: Span = Span::s(10);
/// So many frames show where the MainDevice is, or that it drives a ring.
const FEW: u64 = 8;
/// Trials of a carrier.
const TRIALS: u32 = 3;
/// A question that is not back after so many usual trips …
const LOST_TRIPS: u64 = 8;
/// … and after so long is lost.
const LOST_AFTER: Span = Span::ms(20);
/// Registers that are asked for: DL status to error counters.
const ASKED: core::ops::Range<u16> = 0x0110..0x0314;

/// What the user wants.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct AskSetup {
    /// Most questions in a second.
    pub per_s: u32,
    /// Whether to ask beside kinds of MainDevices that are refused else.
    pub is_forced: bool,
    /// Whether to ask again, after having learnt anew, when the MainDevice was in trouble that no question was near.
    pub keeps_on: bool,
}

#[derive(Clone, PartialEq, Eq, Debug)]
enum AskerPhase {
    /// The ways of the MainDevice are learnt, since this time.
    Learning(Instant),
    /// Do all controllers answer to the carrier?
    Trial { tries: u32, most: u16 },
    /// SubDevices are asked.
    Asking,
    /// It is over.
    Ended(EndReason),
}

/// A question that is under way.
#[derive(Clone, Debug)]
struct PendingQuestion {
    index: u8,
    sent: Instant,
    gives_up: Instant,
    /// What was asked; `None`: how many there are.
    question: Option<Question>,
}

/// Asks SubDevices of a line that another MainDevice drives.
#[derive(Clone, Debug)]
pub struct Asker {
    setup: AskSetup,
    phase: AskerPhase,
    carrier: Carrier,
    gaps: Gaps,
    guard: DisturbanceWatch,
    /// How frames fared before the MainDevice was learnt anew.
    before: (FrameOutcomes, FrameOutcomes),
    pairing: Pairing,
    turns: QuestionSchedule,
    out: Option<PendingQuestion>,
    next: Instant,
    look_at: Option<Instant>,
    /// When it was last looked what is due.
    looked: Instant,
    highest_index: u8,
    source: Option<MacAddress>,
    /// Frames that show that the MainDevice is elsewhere: they came in while none had been seen to leave, or answers leave.
    elsewhere: u64,
    /// Frames that came back with the address of another card than that which sends here.
    by_other_card: u64,
    /// How many have answered the latest trial that came back.
    counted: Option<u16>,
    questions: u64,
    answered: u64,
    last: Option<Instant>,
    news: Option<News>,
}

impl Asker {
    /// One that has seen nothing.
    #[must_use]
    pub fn new(setup: AskSetup) -> Self {
        Self {
            setup: AskSetup { per_s: setup.per_s.max(1), ..setup },
            phase: AskerPhase::Learning(Instant::ZERO),
            carrier: Carrier::Udp,
            gaps: Gaps::default(),
            guard: DisturbanceWatch::default(),
            before: (FrameOutcomes::default(), FrameOutcomes::default()),
            pairing: Pairing::default(),
            turns: QuestionSchedule::default(),
            out: None,
            next: Instant::ZERO,
            look_at: None,
            looked: Instant::ZERO,
            highest_index: 0,
            source: None,
            elsewhere: 0,
            by_other_card: 0,
            counted: None,
            questions: 0,
            answered: 0,
            last: None,
            news: None,
        }
    }

    /// Takes a frame that was seen on the card; questions and answers, too.
    pub fn handle_frame(&mut self, frame: &FrameSeen<'_>) {
        let Ok(view) = FrameView::parse(frame.bytes) else { return };
        if is_question(&view) {
            if frame.direction == Direction::Received {
                self.take_answer(frame.time, &view);
            }
            return;
        }
        if companion::processed(&view).is_some() {
            self.by_other_card += 1;
            return;
        }
        let print = Fingerprint::of(&view);
        match frame.direction {
            Direction::Unknown => self.elsewhere += 1,
            // Whoever answers here is the line, not the MainDevice.
            Direction::Sent if print.is_answered => self.elsewhere += 1,
            Direction::Sent => {
                self.source = Some(view.source());
                let indexes = view.datagrams().map_while(Result::ok).map(|one| one.index());
                self.highest_index = indexes.fold(self.highest_index, u8::max);
                self.gaps.sent(frame.time, &view);
                self.guard.sent(frame.time, &view);
            }
            Direction::Received => {
                let is_other =
                    self.source.is_some_and(|source| source.marked() != view.source().marked());
                self.by_other_card += u64::from(is_other);
            }
        }
        if self.source.is_none() {
            return;
        }
        let Self { pairing, gaps, guard, .. } = self;
        pairing.take(frame, &view, print, &mut |exchange| {
            if let (Some(request), Some(reply)) = (&exchange.request, &exchange.reply) {
                gaps.returned(request.time, reply.time);
            }
            guard.exchanged(exchange);
        });
    }

    /// Frames passed that were not seen: nothing is said of those under way.
    pub fn handle_missed(&mut self) {
        self.pairing.forget();
        self.gaps.forget();
    }

    /// Has a SubDevice asked out of turn, where the diagnosis would like to have its status or its counters read. Whatever
    /// else it would like is left aside.
    pub fn want(&mut self, probe: &Probe) {
        if let (Asked::Register { address, .. }, ProbeEffect::Reads) = (probe.what, probe.effect)
            && ASKED.contains(&address.0)
        {
            self.turns.hurry(probe.station);
        }
    }

    /// The question that leaves now, as a frame in `buffer`: its length. `model` is what is known of the line.
    pub fn poll_transmit(
        &mut self,
        now: Instant,
        model: &NetworkModel,
        buffer: &mut [u8],
    ) -> Option<usize> {
        self.settle(now, model);
        self.look_at = None;
        let is_ready = match self.phase {
            AskerPhase::Learning(_) | AskerPhase::Ended(_) => false,
            AskerPhase::Trial { .. } | AskerPhase::Asking => {
                self.out.is_none() && !self.guard.is_in_doubt()
            }
        };
        if !is_ready {
            return None;
        }
        if now < self.next {
            self.look_at = Some(self.next);
            return None;
        }
        match self.gaps.look(now) {
            SendWindow::Open => self.ask(now, model, buffer),
            SendWindow::Until(at) => {
                self.look_at = Some(at);
                None
            }
            SendWindow::Closed => None,
        }
    }

    /// When [`Asker::poll_transmit`] has something to do though no frame comes.
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let out = self.out.as_ref().map(|out| out.gives_up);
        let [learnt, steady] = match self.phase {
            AskerPhase::Learning(since) => [Some(since), self.guard.last_order()],
            AskerPhase::Trial { .. } | AskerPhase::Asking | AskerPhase::Ended(_) => [None, None],
        }
        .map(|from| from.map(|from| from + LEARN));
        let all = [out, learnt, steady, self.look_at, self.pairing.timeout(), self.guard.timeout()];
        // What is past and left something to be waited for is looked at with the next frame.
        all.into_iter().flatten().filter(|at| *at > self.looked).min()
    }

    /// News since this was last asked.
    pub const fn poll_news(&mut self) -> Option<News> {
        self.news.take()
    }

    /// How it stands.
    #[must_use]
    pub fn report(&self, now: Instant) -> AskingReport {
        let (reason, next_step) = self.reason(now).unzip();
        let sum = |one: FrameOutcomes, other: FrameOutcomes| FrameOutcomes {
            frames: one.frames + other.frames,
            lost: one.lost + other.lost,
            late: one.late + other.late,
        };
        AskingReport {
            state: match &self.phase {
                AskerPhase::Learning(_) => AskingState::Learning,
                AskerPhase::Trial { .. } | AskerPhase::Asking => AskingState::Asking,
                AskerPhase::Ended(over) => over.state(),
            },
            carrier: (self.questions > 0).then_some(match self.carrier {
                Carrier::Udp => CarrierName::Udp,
                Carrier::Plain { .. } => CarrierName::Plain,
            }),
            per_s: self.setup.per_s,
            questions: Number(self.questions),
            answered: Number(self.answered),
            devices: Number(self.turns.count() as u64),
            last_ns: self.last.map(|last| Number(last.as_nanos())),
            reason,
            next_step: next_step.filter(|step| !step.is_empty()),
            near: sum(self.before.0, self.guard.near).into(),
            others: sum(self.before.1, self.guard.others).into(),
        }
    }

    /// Why no question is sent, and what to do about it.
    fn reason(&self, now: Instant) -> Option<(String, String)> {
        if let AskerPhase::Ended(over) = &self.phase {
            return Some((over.reason(), over.next_step().to_owned()));
        }
        if !self.gaps.is_driven(now) {
            let step = "where nobody drives the line, `linesman diagnose CARD` reads it";
            return Some(("nobody drives the line now".to_owned(), step.to_owned()));
        }
        if !self.gaps.has_room() {
            let cycle = self.gaps.cycle().unwrap_or_default();
            let reason = format!(
                "its cycle of {cycle} leaves no gap in which a question could go round the line"
            );
            return Some((
                reason,
                "have the program of the MainDevice read the counters".to_owned(),
            ));
        }
        if matches!(self.phase, AskerPhase::Learning(_)) {
            let reason = format!("the MainDevice did not run steadily for {LEARN}");
            return Some((reason, "listen longer, `--seconds 60`".to_owned()));
        }
        None
    }

    /// Gives up what is lost, and goes on to the next phase.
    fn settle(&mut self, now: Instant, model: &NetworkModel) {
        self.looked = now;
        let Self { pairing, guard, .. } = self;
        pairing.expire(now, &mut |exchange| guard.exchanged(exchange));
        if let Some(out) = self.out.take_if(|out| out.gives_up <= now) {
            let usual = self.gaps.usual_trip().unwrap_or_default();
            self.guard.question(out.sent, out.sent + usual);
            self.tried(0, model);
        }
        if let Some(counted) = self.counted.take() {
            self.tried(counted, model);
        }
        self.guard.look(now, self.gaps.cycle());
        match self.phase {
            AskerPhase::Learning(since) => self.learn(since, now, model),
            AskerPhase::Trial { .. } | AskerPhase::Asking => {
                if let Some((disturbance, is_near)) = self.guard.take_found() {
                    self.disturbed(disturbance, is_near, now);
                }
            }
            AskerPhase::Ended(_) => {}
        }
    }

    fn disturbed(&mut self, disturbance: Disturbance, is_near: bool, now: Instant) {
        if is_near || !self.setup.keeps_on {
            self.end(EndReason::Stopped(disturbance));
            return;
        }
        let guard = std::mem::take(&mut self.guard);
        for (before, fared) in
            [(&mut self.before.0, guard.near), (&mut self.before.1, guard.others)]
        {
            before.frames += fared.frames;
            before.lost += fared.lost;
            before.late += fared.late;
        }
        self.out = None;
        self.phase = AskerPhase::Learning(now);
        self.news = Some(News::Again(disturbance));
    }

    fn learn(&mut self, since: Instant, now: Instant, model: &NetworkModel) {
        if self.source.is_none() && self.elsewhere >= FEW {
            return self.end(EndReason::Refused(AskRefusal::Elsewhere));
        }
        if self.by_other_card >= FEW {
            return self.end(EndReason::Refused(AskRefusal::Ring));
        }
        // What was learnt while it was set up says nothing of its operation.
        let last_order = self
            .guard
            .last_order()
            .filter(|_| self.gaps.cycle().is_none() || now.since(since) < ALWAYS);
        let is_steady = last_order.is_none_or(|order| now.since(order) >= LEARN);
        if !self.gaps.is_driven(now) {
            self.phase = AskerPhase::Learning(now);
            return;
        }
        if now.since(since) < LEARN || !is_steady || self.guard.others.frames < LEARN_FRAMES {
            return;
        }
        let recognised = model.habits.recognised();
        let refusal = AskRefusal::of(recognised.as_ref()).filter(|_| !self.setup.is_forced);
        if let Some(refusal) = refusal {
            return self.end(EndReason::Refused(refusal));
        }
        self.guard.begin(self.gaps.cycle());
        self.phase = AskerPhase::Trial { tries: 0, most: 0 };
        self.next = now;
    }

    fn end(&mut self, over: EndReason) {
        self.out = None;
        self.phase = AskerPhase::Ended(over.clone());
        self.news = Some(News::Ended(over));
    }

    /// A trial of the carrier has ended: so many controllers answered.
    fn tried(&mut self, answered: u16, model: &NetworkModel) {
        let AskerPhase::Trial { tries, most } = &mut self.phase else { return };
        (*tries, *most) = (*tries + 1, (*most).max(answered));
        let (tries, most) = (*tries, *most);
        let kind = model.habits.recognised().map_or(MainDeviceKind::Unknown, |found| found.kind);
        let counted = model.traffic.broadcasts.now().map(|count| count.value);
        let present =
            counted.unwrap_or_else(|| u16::try_from(model.device_count()).unwrap_or(u16::MAX));
        if most > 0 && most >= present {
            self.turns.begin(most, kind);
            self.phase = AskerPhase::Asking;
            self.news = Some(News::Begun(self.carrier));
            return;
        }
        if tries < TRIALS {
            return;
        }
        match carrier::plain(kind, self.highest_index).filter(|_| self.carrier == Carrier::Udp) {
            Some(plain) => {
                self.carrier = plain;
                self.phase = AskerPhase::Trial { tries: 0, most: 0 };
            }
            None => self.end(EndReason::NoCarrier { answered: most, present, kind }),
        }
    }

    fn ask(&mut self, now: Instant, model: &NetworkModel, buffer: &mut [u8]) -> Option<usize> {
        let question = match self.phase {
            AskerPhase::Asking => Some(self.turns.next(model)?),
            AskerPhase::Trial { .. } | AskerPhase::Learning(_) | AskerPhase::Ended(_) => None,
        };
        let index = self.carrier.index(self.questions);
        let len = build(self.carrier, index, question.as_ref(), buffer)?;
        let lost_after = LOST_AFTER.max(self.gaps.usual_trip().unwrap_or_default() * LOST_TRIPS);
        self.out = Some(PendingQuestion { index, sent: now, gives_up: now + lost_after, question });
        self.questions += 1;
        self.last = Some(now);
        self.next = now + Span::ns(1_000_000_000 / u64::from(self.setup.per_s));
        Some(len)
    }

    fn take_answer(&mut self, at: Instant, view: &FrameView<'_>) {
        let datagrams: Vec<Datagram<'_>> = view.datagrams().map_while(Result::ok).collect();
        let index = datagrams.first().map(|datagram| datagram.index());
        let Some(out) = self.out.take_if(|out| Some(out.index) == index) else { return };
        self.answered += 1;
        self.guard.question(out.sent, at);
        match &out.question {
            None => self.counted = Some(datagrams.first().map_or(0, |datagram| datagram.wkc().0)),
            Some(question) => {
                let answers: Vec<Option<&[u8]>> = datagrams
                    .iter()
                    .map(|datagram| (datagram.wkc().0 == 1).then(|| datagram.data()))
                    .collect();
                self.turns.answered(question, &answers);
            }
        }
    }
}

/// A question as a frame; `None` where it does not fit, which the longest one does.
fn build(
    carrier: Carrier,
    index: u8,
    question: Option<&Question>,
    buffer: &mut [u8],
) -> Option<usize> {
    let mut builder = match carrier {
        Carrier::Udp => FrameBuilder::in_udp(buffer, ASKING_SOURCE, ASKING_DESTINATION),
        Carrier::Plain { .. } => FrameBuilder::new(buffer, ASKING_SOURCE),
    };
    let Some(question) = question else {
        // How many are there: one byte that nobody minds being read.
        let address = DatagramAddress::Physical(0, RegisterAddress(0x0000));
        builder.push(Command::Brd, index, address, 1).ok()?;
        return Some(builder.finish());
    };
    let (command, adp) = match question.target {
        Target::Station(station) => (Command::Fprd, station.0),
        Target::Position(position) => (Command::Aprd, Position::auto_increment(position)),
    };
    for (register, len) in &question.registers {
        let address = DatagramAddress::Physical(adp, *register);
        builder.push(command, index, address, usize::from(*len)).ok()?;
    }
    Some(builder.finish())
}
