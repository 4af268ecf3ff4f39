//! A MainDevice as programs with SOEM are: a script of its calls, one after another, beside the lab's own MainDevice.
//!
//! Its start-up, the numbers of its frames and what it does about SubDevices that leave OP are its own, and are held
//! against recordings of SOEM (`crates/lab/tests/soem.rs`). What is written once for all, it takes from where it is: frames,
//! registers, mailbox messages, object requests, the codes of EEPROM categories, the tree and its delays.
//!
//! [`bus`] sends and awaits; [`start_up`], [`mapping`] and [`clocks`] bring the line up, with [`eeprom`], [`mailbox`] and
//! [`hook`]; [`process_data`] exchanges; [`states`] and [`recovery`] look after states. Process data and the look at states
//! are two threads, as in SOEM's `simple_test`. The engine polls both whenever a frame comes or time is up: a script that
//! waits is a future, and needs no waker.

mod bus;
mod clocks;
mod device;
mod eeprom;
mod hook;
mod mailbox;
mod mapping;
mod orders;
mod process_data;
mod recovery;
mod start_up;
mod states;

use std::future::poll_fn;
use std::pin::{Pin, pin};
use std::task::{Context, Waker};

use linesman_maindevice::{Event, Transmit};
use linesman_proto::address::Path;
use linesman_proto::time::{Instant, Span};

use self::bus::Bus;
pub(crate) use self::bus::is_companion;
pub(crate) use self::device::Hook;
use self::device::{Device, OP, SAFE_OP};
pub(crate) use self::orders::Order;
use self::orders::Orders;
use self::process_data::{ProcessData, Shared};

/// How soon a program that has found no SubDevice is started again.
const RESTART: Span = Span::s(1);
/// How often the states of all are read.
const STATES: Span = Span::ms(50);
/// How often the working counter is looked at.
const LOOK: Span = Span::ms(10);
/// How long OP is waited for at a time.
const STEP: Span = Span::ms(50);
/// How often, until the program goes on without: `chk` of `simple_test`.
const STEPS: usize = 200;
/// Cycles before OP is asked for, and so many where the clocks have to come into step first.
const CYCLES: [u64; 2] = [10, 2_000];

/// What the program is set up with.
#[derive(Clone, Debug)]
pub(crate) struct Settings {
    /// Cycle of process data.
    pub(crate) cycle: Span,
    /// A second card closes a ring.
    pub(crate) ring: bool,
    /// What is done to each SubDevice, by its place.
    pub(crate) hooks: Vec<Hook>,
}

/// The MainDevice.
pub(crate) struct Soem {
    settings: Settings,
    bus: Bus,
    image: Shared,
    orders: Orders,
    script: Option<Pin<Box<dyn Future<Output = ()> + Send>>>,
}

impl Soem {
    /// A program that starts now.
    pub(crate) fn new(now: Instant, settings: Settings) -> Self {
        let bus = Bus::new(now, settings.ring);
        let (image, orders) = (Shared::default(), Orders::default());
        let mut soem = Self { settings, bus, image, orders, script: None };
        soem.start(now);
        soem
    }

    /// The program is started, after it has ended.
    pub(crate) fn start(&mut self, now: Instant) {
        self.bus = Bus::new(now, self.settings.ring);
        let script = Script {
            bus: self.bus.clone(),
            image: self.image.clone(),
            orders: self.orders.clone(),
            settings: self.settings.clone(),
        };
        self.script = Some(Box::pin(script.run()));
        self.poll();
    }

    /// Tells the program to do something.
    pub(crate) fn order(&self, order: Order) {
        self.orders.give(order);
    }

    /// Outputs of the process image.
    pub(crate) fn change_outputs(&self, mut change: impl FnMut(&mut u8)) {
        let mut image = self.image.lock();
        let outputs = image.outputs;
        image.bytes.iter_mut().take(outputs).for_each(&mut change);
    }

    /// The next frame, written into `buffer`.
    pub(crate) fn poll_transmit(&self, now: Instant, buffer: &mut [u8]) -> Option<Transmit> {
        let (path, frame) = self.bus.take_outgoing()?;
        let len = frame.len();
        buffer.get_mut(..len)?.copy_from_slice(&frame);
        Some(Transmit { at: now, path, len })
    }

    /// When [`Soem::handle_timeout`] is to be called.
    pub(crate) fn poll_timeout(&self) -> Option<Instant> {
        self.script.as_ref().and_then(|_| self.bus.next())
    }

    /// Takes a frame that has arrived at a card.
    pub(crate) fn handle_frame(&mut self, now: Instant, path: Path, frame: &[u8]) {
        self.bus.advance(now);
        self.bus.take(path, frame);
        self.poll();
    }

    /// Time has come to `now`.
    pub(crate) fn handle_timeout(&mut self, now: Instant) {
        if self.poll_timeout().is_some_and(|at| at <= now) {
            self.bus.advance(now);
            self.poll();
        }
    }

    /// What came of an order.
    pub(crate) fn poll_event(&self) -> Option<Event> {
        self.orders.poll_event()
    }

    fn poll(&mut self) {
        let mut context = Context::from_waker(Waker::noop());
        let over =
            self.script.as_mut().is_some_and(|run| run.as_mut().poll(&mut context).is_ready());
        if over {
            self.script = None;
        }
    }
}

/// The program.
struct Script {
    bus: Bus,
    image: Shared,
    orders: Orders,
    settings: Settings,
}

impl Script {
    async fn run(self) {
        let mut devices = self.find().await;
        let follows = devices.iter().any(|device| device.hook.clock.is_some());
        // SYNC0 is started by the time that all share.
        let mut leader = if follows { clocks::configure(&self.bus, &devices).await } else { None };
        let image = mapping::map(&self.bus, &mut devices).await;
        if !follows {
            leader = clocks::configure(&self.bus, &devices).await;
        }
        states::reach_all(&self.bus, SAFE_OP, states::TIMEOUT * 4).await;
        let (cycle, expected) = (self.settings.cycle, image.expected);
        let data = ProcessData::new(&self.bus, &self.image, image, cycle, leader, follows);
        let cycles = CYCLES[usize::from(follows)];
        let (mut data, mut watch) =
            (pin!(data.run()), pin!(self.watch(devices, expected, cycle * cycles)));
        // Two threads; the program ends with the second.
        poll_fn(|context| {
            let _endless = data.as_mut().poll(context);
            watch.as_mut().poll(context)
        })
        .await;
    }

    /// SubDevices in PREOP; without any the program ends, and is started again.
    async fn find(&self) -> Vec<Device> {
        loop {
            let devices = start_up::configure(&self.bus, &self.settings.hooks).await;
            if !devices.is_empty() {
                return devices;
            }
            self.bus.sleep(RESTART).await;
        }
    }

    /// Brings all to OP after some process data, and keeps them there until it is told to stop.
    async fn watch(&self, mut devices: Vec<Device>, expected: u32, first: Span) {
        let bus = &self.bus;
        bus.sleep(first).await;
        states::request_all(bus, OP).await;
        for _ in 0..STEPS {
            if states::reach_all(bus, OP, STEP).await {
                break;
            }
        }
        let mut is_well = true;
        let mut states_at = bus.now() + STATES;
        loop {
            bus.sleep(LOOK).await;
            if self.orders.follow(bus, &mut devices).await.is_break() {
                return;
            }
            let is_short = self.image.lock().wkc < expected;
            if is_short || !is_well || bus.now() >= states_at {
                is_well = recovery::check(bus, &mut devices, |at| self.orders.holds(at)).await;
                states_at = bus.now() + STATES;
            }
        }
    }
}
