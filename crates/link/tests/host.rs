//! Host counters of cards, in a network namespace of the test's own.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

#[path = "support/namespace.rs"]
mod namespace;

use linesman_link::clock::HostClock;
use linesman_link::error::LinkError;
use linesman_link::host::{HostSampler, Wakes};
use linesman_link::interface::{self, InterfaceKind, OperationalState, Suitability};
use linesman_link::socket::{RawSocket, SocketCounters, SocketOptions};
use linesman_proto::time::Span;
use namespace::{ip, with_cable};

// proves: HW-30 partial
#[test]
fn a_sample_tells_what_changed_since_the_one_before() {
    with_cable(|| {
        let clock = HostClock::start();
        let mut socket = RawSocket::open("va", &SocketOptions::default()).unwrap();
        let frames = [[0xFF_u8; 60]; 7];
        assert_eq!(socket.send_batch(frames.iter().map(|f| &f[..])).unwrap().frames, 7);

        let mut sampler = HostSampler::open("va", &clock).unwrap();
        let quiet = sampler.sample(SocketCounters::default()).unwrap();
        assert!(quiet.carrier);
        assert_eq!(quiet.operational, OperationalState::Up);
        assert_eq!((quiet.card.tx_frames, quiet.carrier_changes), (0, 0), "history does not count");

        assert_eq!(socket.send_batch(frames.iter().map(|f| &f[..])).unwrap().frames, 7);
        ip("link set vb down");
        sampler.note_wake(Span::us(20));
        sampler.note_wakes(Wakes { count: 9, latest: Span::us(70) });
        let sample = sampler.sample(socket.counters().unwrap()).unwrap();
        assert_eq!(sample.card.tx_frames, 7);
        assert_eq!(sample.socket.sent, 14);
        assert!(!sample.carrier);
        assert_ne!(sample.operational, OperationalState::Up);
        assert_eq!(sample.carrier_changes, 1);
        assert_eq!(sample.wakes, Wakes { count: 10, latest: Span::us(70) });
        assert!(sample.at > quiet.at && sample.over > Span::ZERO);
        assert_eq!((sample.clock_step_ns, sample.suspended), (None, Span::ZERO));

        ip("link set vb up");
        ip("link set vb down");
        let sample = sampler.sample(socket.counters().unwrap()).unwrap();
        assert!(!sample.carrier, "as before, and yet");
        assert_eq!(sample.carrier_changes, 2);
        assert_eq!((sample.socket.sent, sample.wakes), (0, Wakes::default()));

        ip("link del va");
        let error = sampler.sample(SocketCounters::default()).unwrap_err();
        assert!(matches!(error, LinkError::Vanished { .. }), "{error}");
    });
}

// proves: HW-30 partial: a link that comes or goes is told without being asked for
#[test]
fn a_link_that_comes_or_goes_is_told_at_once() {
    with_cable(|| {
        ip("link add wa type veth peer name wb");
        let clock = HostClock::start();
        let mut sampler = HostSampler::open("va", &clock).unwrap();
        let is_told_soon = |sampler: &mut HostSampler| {
            // A change that follows another within a second may be told at its end.
            let until = clock.now() + Span::ms(1_500);
            while clock.now() < until {
                if sampler.has_news().unwrap() {
                    return true;
                }
                std::thread::sleep(std::time::Duration::from_millis(1));
            }
            false
        };
        // What came with the making of the cable.
        while is_told_soon(&mut sampler) {}
        ip("link set wa up");
        assert!(!is_told_soon(&mut sampler), "that was another one");
        ip("link set vb down");
        assert!(is_told_soon(&mut sampler));
        let down = sampler.sample(SocketCounters::default()).unwrap();
        assert_eq!((down.carrier, down.carrier_changes), (false, 1));
        ip("link set vb up");
        assert!(is_told_soon(&mut sampler));
        let up = sampler.sample(SocketCounters::default()).unwrap();
        assert_eq!((up.carrier, up.carrier_changes), (true, 1));
        assert_eq!(up.operational, OperationalState::Up, "and lets frames through");
    });
}

#[test]
fn a_sample_is_cheap_enough_for_ten_a_second() {
    with_cable(|| {
        let clock = HostClock::start();
        let mut sampler = HostSampler::open("va", &clock).unwrap();
        let before = clock.now();
        for _ in 0..100 {
            sampler.sample(SocketCounters::default()).unwrap();
        }
        let each = Span::ns(clock.now().since(before).as_nanos() / 100);
        println!("a sample takes {each}");
        assert!(each < Span::ms(2), "{each}");
    });
}

#[test]
fn interfaces_are_listed_with_kind_addresses_and_master() {
    with_cable(|| {
        ip("link add br0 type bridge");
        ip("link set vb master br0");
        ip("address add 192.0.2.7/24 dev va");
        ip("link set va mtu 1400");
        let all = interface::list().unwrap();
        let named = |name: &str| all.iter().find(|card| card.name == name).unwrap();
        assert_eq!(named("lo").kind, InterfaceKind::Loopback);
        assert_eq!(named("br0").kind, InterfaceKind::Bridge);
        let va = named("va");
        assert_eq!((&va.kind, va.mtu, va.up, va.carrier), (&InterfaceKind::Veth, 1400, true, true));
        assert_eq!(va.driver.as_deref(), Some("veth"));
        assert_eq!(va.addresses.len(), 1);
        assert_eq!(va.addresses[0].to_string(), "192.0.2.7/24");
        assert_eq!(va.assess().suitability, Suitability::Limited);
        let vb = named("vb");
        assert_eq!(vb.member_of.as_deref(), Some("br0"));
        assert_eq!(vb.assess().suitability, Suitability::Unsuitable);
        assert_eq!(interface::find("va").unwrap(), *va);
    });
}
