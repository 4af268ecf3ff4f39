//! The state machine of a device with a processor.

use linesman_proto::register::SmControl;
use linesman_proto::state::{AlState, AlStatusCode};
use linesman_proto::time::Span;

use super::Device;
use crate::device::library::build;
use crate::device::{Refusal, Signals, SoftwareFault};

#[test]
fn it_takes_its_time() {
    let mut device = Device::of("EL3104");
    device.set_up_mailbox();
    device.bench.write(0x0120, &[2, 0]);
    device.bench.wait(Span::ms(11));
    assert_eq!(device.status(), (1, 0), "still at work");
    device.bench.wait(Span::ms(1));
    assert_eq!(device.status(), (2, 0));
}

// proves: SW-01 partial: what one virtual device does
#[test]
fn steps_that_do_not_exist_are_refused_with_their_codes() {
    // from INIT: request, status, code
    let table = [
        (4, 0x11, 0x0011),
        (8, 0x11, 0x0011),
        (5, 0x11, 0x0012),
        (2, 0x11, 0x0016),
        (3, 0x11, 0x0015),
    ];
    for (request, status, code) in table {
        let mut device = Device::of("EL4102");
        assert_eq!(device.request(request), (status, code), "request {request}");
        assert_eq!(device.request(request), (status, code), "not heard any more");
        assert_eq!(device.request(0x11), (1, 0), "acknowledged");
    }
    let mut device = Device::of("EL4102");
    device.enter_preop();
    assert_eq!(device.request(8), (0x12, 0x0011));
    assert_eq!(device.request(3), (0x12, 0x0011));
    assert_eq!(device.request(1), (1, 0), "INIT is always heard");
}

#[test]
fn acknowledgement_and_the_next_state_may_come_in_one() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    assert_eq!(device.request(4), (0x12, 0x001D));
    device.set_up_process_data();
    assert_eq!(device.request(4), (0x12, 0x001D), "not acknowledged");
    assert_eq!(device.request(0x14), (4, 0));
}

#[test]
fn a_mailbox_that_does_not_fit_is_refused() {
    let out = SmControl::MAILBOX_OUT;
    let back = SmControl::MAILBOX_IN;
    // SyncManager 0, SyncManager 1: start, length, control
    let table = [
        ("too short", (0x1000, 0x21, out), (0x1080, 128, back)),
        ("too long", (0x1000, 129, out), (0x1100, 128, back)),
        ("off", (0x1000, 0, out), (0x1080, 128, back)),
        ("overlapping", (0x1000, 128, out), (0x107F, 128, back)),
        ("wrong direction", (0x1000, 128, back), (0x1080, 128, back)),
        ("buffered", (0x1000, 128, out), (0x1080, 128, SmControl::INPUTS)),
        ("outside the RAM", (0x1000, 128, out), (0x2FC0, 128, back)),
    ];
    for (what, first, second) in table {
        let mut device = Device::of("EL3104");
        device.guard(0, first.0, first.1, first.2);
        device.guard(1, second.0, second.1, second.2);
        assert_eq!(device.request(2), (0x11, 0x0016), "{what}");
    }
}

#[test]
fn without_its_sii_it_stays_in_init() {
    let mut signals = Signals::default();
    let mut built = build("EL3104", 1, &mut signals).unwrap().remove(0);
    // The checksum does not fit any more.
    built.sii[0] ^= 0x01;
    let mut device = Device::new(built, signals);
    device.set_up_mailbox();
    assert_eq!(device.request(2), (0x11, 0x0051));
}

#[test]
fn process_data_that_do_not_fit_are_refused() {
    // SyncManager, start, length, control, code
    let table = [
        (3, 0x1180, 7, SmControl::INPUTS, 0x001E),
        (3, 0x1180, 9, SmControl::INPUTS, 0x001E),
        (3, 0x1180, 0, SmControl::INPUTS, 0x001E),
        (3, 0x1180, 8, SmControl::OUTPUTS, 0x001E),
        (3, 0x1040, 8, SmControl::INPUTS, 0x001E),
        (3, 0x2FF0, 8, SmControl::INPUTS, 0x001E),
        (2, 0x1100, 6, SmControl::OUTPUTS, 0x001D),
        (2, 0x1100, 8, SmControl::INPUTS, 0x001D),
        (2, 0x1178, 8, SmControl::OUTPUTS, 0x001D),
        (2, 0x1100, 8, SmControl::MAILBOX_OUT, 0x001D),
    ];
    for (index, start, len, control, code) in table {
        let mut device = Device::of("EL7041");
        device.enter_preop();
        device.set_up_process_data();
        device.bench.write(0x0800 + 8 * u16::from(index) + 6, &[0]);
        device.guard(index, start, len, control);
        assert_eq!(device.request(4), (0x12, code), "SM{index} 0x{start:04X} {len} {control:?}");
    }
}

#[test]
fn a_watchdog_of_no_time_is_refused_where_one_is_wanted() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    device.set_up_process_data();
    device.bench.write(0x0420, &[0, 0]);
    assert_eq!(device.request(4), (0x12, 0x001F));
}

#[test]
fn without_outputs_it_does_not_go_to_op() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    device.enter_safeop();
    assert_eq!(device.request(8), (4, 0), "it waits");
    device.bench.wait(Span::s(1));
    assert_eq!(device.status(), (0x14, 0x001B));
    assert_eq!(device.request(0x14), (4, 0));
    device.bench.write(0x0120, &[8, 0]);
    device.bench.wait(Span::ms(20));
    device.exchange(&[1]);
    assert_eq!(device.status(), (8, 0), "as soon as they came");
}

#[test]
fn while_it_waits_for_outputs_it_hears_another_request() {
    let mut device = Device::of("EL4102");
    device.enter_preop();
    device.enter_safeop();
    assert_eq!(device.request(8), (4, 0));
    assert_eq!(device.request(1), (1, 0));
}

#[test]
fn a_switched_off_sync_manager_takes_the_state_away() {
    let mut device = Device::of("EL7041");
    device.bring_up();
    device.bench.write(0x081E, &[0]);
    device.bench.wait(Span::ms(1));
    assert_eq!(device.status(), (0x12, 0x001E));
    let mut device = Device::of("EL7041");
    device.bring_up();
    device.bench.write(0x0806, &[0]);
    device.bench.wait(Span::ms(1));
    assert_eq!(device.status(), (0x11, 0x0016));
}

#[test]
fn mailbox_that_is_taken_away_while_init_is_ordered_is_no_error() {
    let mut device = Device::of("EL7041");
    device.enter_preop();
    // As ethercrab resets a line: the order, and in the next frames all SyncManagers.
    device.bench.write(0x0120, &[0x11, 0]);
    device.bench.write(0x0800, &[0; 16]);
    device.bench.wait(Span::ms(20));
    assert_eq!(device.status(), (1, 0));
    assert_eq!(device.request(2), (0x11, 0x0016), "without a mailbox it goes no further");
}

#[test]
fn boot_has_a_mailbox_of_its_own() {
    let mut device = Device::of("EL3104");
    device.guard(0, 0x1000, 244, SmControl::MAILBOX_OUT);
    device.guard(1, 0x10F4, 244, SmControl::MAILBOX_IN);
    assert_eq!(device.request(3), (3, 0));
    assert_eq!(device.request(2), (0x13, 0x0011));
    assert_eq!(device.request(1), (1, 0));
    assert_eq!(device.request(2), (0x11, 0x0016), "too long for PREOP");
}

#[test]
fn it_goes_down_step_by_step_or_at_once() {
    let mut device = Device::of("EL7041");
    device.bring_up();
    assert_eq!(device.request(4), (4, 0));
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    assert_eq!(device.request(2), (2, 0));
    assert_eq!(device.request(4), (4, 0));
    device.exchange(&[]);
    assert_eq!(device.request(8), (8, 0));
    assert_eq!(device.request(1), (1, 0));
}

/// An application that has not run since the start gives no values: AL status codes 0x0018, 0x0019
/// and 0x002B, by what there is to exchange.
#[test]
fn without_an_application_there_are_no_valid_values() {
    for (name, code) in [("EL3104", 0x0018), ("EL4102", 0x0019), ("EL7041", 0x002B)] {
        let mut device = Device::of(name);
        let stands = SoftwareFault::FrozenApplication;
        let now = device.bench.now;
        device.bench.controller.software_fault(now, stands, true);
        device.enter_preop();
        device.enter_safeop();
        device.exchange(&[]);
        assert_eq!(device.request(8), (0x14, code), "{name}");
        assert_eq!(device.request(0x14), (4, 0), "{name}");
        let now = device.bench.now;
        device.bench.controller.software_fault(now, stands, false);
        device.exchange(&[]);
        assert_eq!(device.request(8), (8, 0), "{name}: it runs");
        // One that stops later has values: they stay as they are.
        let now = device.bench.now;
        device.bench.controller.software_fault(now, stands, true);
        device.exchange(&[]);
        assert_eq!(device.status(), (8, 0), "{name}");
    }
}

/// A device that reads its EEPROM itself needs it: AL status code 0x0050.
#[test]
fn software_that_reads_the_eeprom_wants_it_left_to_it() {
    let mut device = Device::of("EL3104");
    device.bench.controller.firmware_mut().read_sii();
    device.bench.write(0x0500, &[0]);
    device.set_up_mailbox();
    assert_eq!(device.request(2), (0x11, 0x0050));
    assert_eq!(device.request(0x11), (1, 0));
    device.bench.write(0x0500, &[1]);
    assert_eq!(device.request(2), (2, 0));
}

#[test]
fn told_to_refuse_every_type_refuses() {
    for known in crate::device::library::types() {
        let mut device = Device::of(known.name());
        let code = AlStatusCode(0x8001);
        let refusal = Refusal { transition_to: AlState::SafeOp, code, times: None };
        let now = device.bench.now;
        device.bench.controller.refuse(now, Some(refusal));
        device.enter_preop();
        device.set_up_process_data();
        assert_eq!(device.request(4), (0x12, 0x8001), "{}", known.name());
        assert_eq!(device.request(0x12), (2, 0), "{}", known.name());
        let now = device.bench.now;
        device.bench.controller.refuse(now, None);
        assert_eq!(device.request(4), (4, 0), "{}", known.name());
    }
}
