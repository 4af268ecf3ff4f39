use std::sync::atomic::{AtomicUsize, Ordering};

use linesman_proto::address::{RegisterAddress, StationAddress, WorkingCounter};
use linesman_proto::time::Span;

use super::*;
use crate::exchange::Target;

const TARGET: Target = Target::Station(StationAddress(0x1001));
const REGISTER: RegisterAddress = RegisterAddress(0x0130);

fn reply(wkc: u16) -> Result<Reply, ExchangeError> {
    Ok(Reply { wkc: WorkingCounter(wkc), data: smallvec::smallvec![8, 0] })
}

fn submitted(executor: &Executor) -> Vec<Ticket> {
    executor.shared().submitted.drain(..).map(|(ticket, _)| ticket).collect()
}

#[test]
fn tasks_run_in_the_order_of_their_answers() {
    let mut executor = Executor::new();
    let wire = executor.group(0);
    let order = Arc::new(Mutex::new(Vec::new()));
    for name in 0..3 {
        let (wire, order) = (wire.clone(), Arc::clone(&order));
        wire.clone().spawn(async move {
            let _ = wire.read(TARGET, REGISTER, 2).await;
            lock(&order).push(name);
        });
    }
    executor.run();
    let tickets = submitted(&executor);
    for at in [2, 0, 1] {
        executor.answer(tickets[at], reply(1));
    }
    executor.run();
    assert_eq!(*lock(&order), [2, 0, 1]);
}

#[test]
fn sleepers_wake_in_the_order_of_time() {
    let mut executor = Executor::new();
    let wire = executor.group(0);
    let order = Arc::new(Mutex::new(Vec::new()));
    for millis in [3, 1, 2] {
        let (wire, order) = (wire.clone(), Arc::clone(&order));
        wire.clone().spawn(async move {
            wire.sleep(Span::ms(millis)).await;
            lock(&order).push(millis);
        });
    }
    executor.run();
    let at = |millis| Instant::ZERO + Span::ms(millis);
    assert_eq!(executor.first_timer(), at(1));
    executor.advance(at(2));
    executor.run();
    assert_eq!(*lock(&order), [1, 2]);
    assert_eq!(executor.first_timer(), at(3));
}

// proves: FRM-21
#[test]
fn a_bad_working_counter_is_asked_again_and_then_reported() {
    let mut executor = Executor::new();
    let wire = executor.group(1);
    let handle = wire.clone().spawn(async move { wire.read_one(TARGET, REGISTER, 2).await });
    let outcome = Arc::new(Mutex::new(None));
    let seen = Arc::clone(&outcome);
    let wire = executor.group(0);
    wire.spawn(async move {
        let result = handle.await;
        *lock(&seen) = Some(result);
    });
    for _ in 0..2 {
        executor.run();
        let tickets = submitted(&executor);
        assert_eq!(tickets.len(), 1);
        executor.answer(tickets[0], reply(0));
    }
    executor.run();
    let error = lock(&outcome).take().unwrap().unwrap_err();
    let text = error.to_string();
    assert!(
        text.starts_with("FPRD 0x1001:0x0130, 2 bytes: working counter 0, expected 1"),
        "{text}"
    );
}

/// Counts how often it was dropped.
struct Dropped(Arc<AtomicUsize>);

impl Drop for Dropped {
    fn drop(&mut self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

#[test]
fn a_cancelled_group_leaves_nothing_behind() {
    let mut executor = Executor::new();
    let (wire, other) = (executor.group(0), executor.group(0));
    let drops = Arc::new(AtomicUsize::new(0));
    for wire in [&wire, &other] {
        let (wire, dropped) = (wire.clone(), Dropped(Arc::clone(&drops)));
        wire.clone().spawn(async move {
            let asked = wire.read(TARGET, REGISTER, 2);
            wire.sleep(Span::ms(1)).await;
            let _ = asked.await;
            drop(dropped);
        });
    }
    executor.run();
    executor.cancel(wire.group());
    assert_eq!(drops.load(Ordering::Relaxed), 1);
    assert_eq!(executor.shared().cancelled.len(), 1);
    assert_eq!(executor.shared().timers.len(), 1);
    assert_eq!(executor.shared().answers.len(), 1);
}
