//! Sockets over a virtual cable in a network namespace of their own: exchange, listening, waiting,
//! and every way in which a card can fail.

#![allow(clippy::unwrap_used, reason = "a test that fails may panic")]

#[path = "support/namespace.rs"]
mod namespace;

use linesman_link::clock::HostClock;
use linesman_link::direction::FrameDirection::{Incoming, Outgoing};
use linesman_link::error::LinkError;
use linesman_link::interface::CardLock;
use linesman_link::socket::{
    Batch, ListenFilter, Listener, RawSocket, Ready, Reception, SocketOptions, StampSource,
    wait_any,
};
use linesman_proto::address::RegisterAddress;
use linesman_proto::command::Command;
use linesman_proto::ethernet::MacAddress;
use linesman_proto::frame::FrameBuilder;
use linesman_proto::frame::builder::DatagramAddress;
use linesman_proto::time::{Instant, Span};
use namespace::{await_operation, ip, with_cable};

fn frame(ethertype: [u8; 2], number: u16, len: usize) -> Vec<u8> {
    let mut frame = vec![0xFF; 6];
    frame.extend([0, 1, 2, 3, 4, 5]);
    frame.extend(ethertype);
    frame.extend(number.to_be_bytes());
    frame.resize(len, 0xA5);
    frame
}

fn ethercat(number: u16) -> Vec<u8> {
    frame([0x88, 0xA4], number, 60)
}

fn raw(interface: &str) -> RawSocket {
    RawSocket::open(interface, &SocketOptions::default()).unwrap()
}

fn borrowed(frames: &[Vec<u8>]) -> impl Iterator<Item = &[u8]> {
    frames.iter().map(Vec::as_slice)
}

fn soon(clock: &HostClock) -> Instant {
    clock.now() + Span::s(2)
}

/// Fetches exactly `count` frames, the last batch of which stays in `batch`.
fn fetch(socket: &mut RawSocket, batch: &mut Batch, clock: &HostClock, count: usize) {
    let deadline = soon(clock);
    let mut left = count;
    while left > 0 {
        assert_eq!(socket.wait(clock, deadline).unwrap(), Ready::Readable, "{left} frames missing");
        left -= socket.recv_batch(batch, clock).unwrap();
    }
}

#[test]
fn frames_cross_the_cable_in_order_with_their_times() {
    with_cable(|| {
        let clock = HostClock::start();
        let (mut near, mut far) = (raw("va"), raw("vb"));
        let frames: Vec<_> = (0..200).map(ethercat).collect();
        let before = clock.now();
        let sent = near.send_batch(borrowed(&frames)).unwrap();
        assert_eq!((sent.frames, sent.full), (200, false));
        let after = clock.now();

        let mut batch = Batch::new(64);
        let mut seen = Vec::new();
        while seen.len() < 200 {
            assert_eq!(far.wait(&clock, soon(&clock)).unwrap(), Ready::Readable);
            assert!(far.recv_batch(&mut batch, &clock).unwrap() <= 64);
            for frame in batch.iter() {
                assert_eq!(frame.direction, Incoming);
                assert_eq!(frame.stamped_by, StampSource::Kernel);
                // The kernel's stamp is its wall clock; converting it costs microseconds.
                let slack = Span::ms(1);
                assert!(frame.at + slack >= before && frame.at <= after + slack, "{}", frame.at);
                assert!(!frame.truncated);
                seen.push(frame.bytes.to_vec());
            }
        }
        assert_eq!(seen, frames);
        assert_eq!(near.recv_batch(&mut batch, &clock).unwrap(), 0, "no copies of its own");
        // Nor of what another socket on the same card sends.
        assert_eq!(raw("va").send_batch([&ethercat(7)[..]]).unwrap().frames, 1);
        fetch(&mut far, &mut batch, &clock, 1);
        assert_eq!(near.recv_batch(&mut batch, &clock).unwrap(), 0);
        assert_eq!(near.counters().unwrap().sent, 200);
        assert_eq!(far.counters().unwrap().received, 201);
        assert_eq!(near.mac(), near.interface().mac);
        assert!(near.mac().is_some());
    });
}

#[test]
fn a_listener_hears_both_directions_and_only_ethercat() {
    with_cable(|| {
        let clock = HostClock::start();
        let mut listener = Listener::open("va", ListenFilter::EtherCat).unwrap();
        let mut curious = Listener::open("va", ListenFilter::Everything).unwrap();
        let (mut near, mut far) = (raw("va"), raw("vb"));
        let mut udp = frame([0x08, 0x00], 0, 60);
        udp[14] = 0x45;
        udp[23] = 17;
        udp[36..38].copy_from_slice(&[0x88, 0xA4]);
        let mut tagged = frame([0x81, 0x00], 0x6005, 64);
        tagged[16..18].copy_from_slice(&[0x88, 0xA4]);
        let arp = frame([0x08, 0x06], 1, 60);
        let steps = [
            (true, ethercat(1)),
            (false, ethercat(2)),
            (true, arp.clone()),
            (false, arp),
            (false, udp),
            (true, tagged.clone()),
            (false, tagged),
        ];
        for (from_near, bytes) in &steps {
            let socket = if *from_near { &mut near } else { &mut far };
            assert_eq!(socket.send_batch([&bytes[..]]).unwrap().frames, 1);
        }
        let mut batch = Batch::new(16);
        let mut hear = |listener: &mut Listener, count: usize| {
            let mut heard = Vec::new();
            while heard.len() < count {
                assert_eq!(listener.wait(&clock, soon(&clock)).unwrap(), Ready::Readable);
                listener.recv_batch(&mut batch, &clock).unwrap();
                let frames = batch.iter();
                heard.extend(
                    frames.map(|frame| (frame.direction == Outgoing, frame.bytes.to_vec())),
                );
            }
            heard
        };
        assert_eq!(hear(&mut curious, 7), steps);
        let ethercat: Vec<_> =
            steps.into_iter().filter(|(_, bytes)| bytes[12..14] != [0x08, 0x06]).collect();
        assert_eq!(hear(&mut listener, 5), ethercat, "tags stand where they were");
        assert_eq!(listener.counters().unwrap().received, 5);
    });
}

#[test]
fn promiscuous_mode_ends_with_the_listener() {
    with_cable(|| {
        let clock = HostClock::start();
        let promiscuous = || ip("-d link show va").contains("promiscuity 1");
        assert!(!promiscuous());
        let listener = Listener::open("va", ListenFilter::EtherCat).unwrap();
        assert!(promiscuous());
        drop(listener);
        // A child that another test starts just now holds a copy of the socket until it runs `ip`.
        let deadline = clock.now() + Span::s(5);
        while promiscuous() {
            assert!(clock.now() < deadline, "still promiscuous");
            clock.sleep_until(clock.now() + Span::ms(10));
        }
        let socket = raw("va");
        assert!(!promiscuous(), "an active socket needs none");
        drop(socket);
    });
}

#[test]
fn frames_past_the_queue_arrive_but_are_not_heard_at_home() {
    with_cable(|| {
        let clock = HostClock::start();
        let options = SocketOptions { bypass_queue: true, ..SocketOptions::default() };
        let mut near = RawSocket::open("va", &options).unwrap();
        let mut far = raw("vb");
        let mut listener = Listener::open("va", ListenFilter::EtherCat).unwrap();
        assert_eq!(near.send_batch([&ethercat(1)[..]]).unwrap().frames, 1);
        let mut batch = Batch::new(4);
        fetch(&mut far, &mut batch, &clock, 1);
        assert_eq!(listener.recv_batch(&mut batch, &clock).unwrap(), 0);
    });
}

/// EtherCAT in UDP.
fn udp(number: u8) -> Vec<u8> {
    let mut buffer = [0; 60];
    let (source, destination) = (MacAddress([0, 1, 2, 3, 4, 5]), MacAddress([0x4E, 0, 0, 0, 0, 9]));
    let mut builder = FrameBuilder::in_udp(&mut buffer, source, destination);
    let address = DatagramAddress::Physical(0, RegisterAddress(0));
    builder.push(Command::Brd, number, address, 1).unwrap();
    let len = builder.finish();
    buffer[..len].to_vec()
}

#[test]
fn frames_in_udp_reach_only_sockets_that_ask_for_every_form() {
    with_cable(|| {
        let clock = HostClock::start();
        let sender = SocketOptions { reception: Reception::Nothing, ..SocketOptions::default() };
        let every = SocketOptions { reception: Reception::EveryForm, ..SocketOptions::default() };
        let mut near = RawSocket::open("va", &sender).unwrap();
        let (mut far, mut plain) = (RawSocket::open("vb", &every).unwrap(), raw("vb"));
        let mut batch = Batch::new(8);
        let frames = [udp(1), ethercat(2), frame([0x08, 0x00], 3, 60), udp(4)];
        assert_eq!(near.send_batch(borrowed(&frames)).unwrap().frames, 4);
        fetch(&mut far, &mut batch, &clock, 3);
        fetch(&mut plain, &mut batch, &clock, 1);
        assert_eq!(batch.iter().next().unwrap().bytes, frames[1]);
        assert_eq!(plain.recv_batch(&mut batch, &clock).unwrap(), 0);
        // What comes back goes to nobody who only sends.
        assert_eq!(far.send_batch(borrowed(&frames)).unwrap().frames, 4);
        assert_eq!(near.wait(&clock, clock.now() + Span::ms(50)).unwrap(), Ready::Deadline);
        assert_eq!(near.recv_batch(&mut batch, &clock).unwrap(), 0);
    });
}

#[test]
fn waiting_ends_at_the_deadline_or_with_a_frame_on_either_card() {
    with_cable(|| {
        ip("link add wa type veth peer name wb");
        for card in ["wa", "wb"] {
            ip(&format!("link set {card} addrgenmode none up"));
        }
        await_operation("wb");
        let clock = HostClock::start();
        let (a, b, mut far) = (raw("va"), raw("wa"), raw("wb"));
        let deadline = clock.now() + Span::ms(5);
        assert_eq!(wait_any([&a, &b], &clock, deadline).unwrap(), Ready::Deadline);
        assert!(clock.now() >= deadline);
        assert_eq!(wait_any([&a, &b], &clock, Instant::ZERO).unwrap(), Ready::Deadline);
        assert_eq!(far.send_batch([&ethercat(1)[..]]).unwrap().frames, 1);
        assert_eq!(wait_any([&a, &b], &clock, Instant::MAX).unwrap(), Ready::Readable);
        assert_eq!(a.wait(&clock, clock.now()).unwrap(), Ready::Deadline);
    });
}

#[test]
fn a_full_receive_buffer_counts_what_it_drops() {
    with_cable(|| {
        let clock = HostClock::start();
        let options = SocketOptions { receive_buffer: 16 * 1024, ..SocketOptions::default() };
        let mut far = RawSocket::open("vb", &options).unwrap();
        assert_eq!(far.receive_buffer(), 32 * 1024);
        let mut near = raw("va");
        let frames: Vec<_> = (0..500).map(ethercat).collect();
        let mut sent = 0;
        while sent < frames.len() {
            sent += near.send_batch(borrowed(&frames[sent..])).unwrap().frames;
        }
        let mut batch = Batch::new(32);
        let mut received = 0;
        while far.wait(&clock, clock.now() + Span::ms(50)).unwrap() == Ready::Readable {
            received += far.recv_batch(&mut batch, &clock).unwrap() as u64;
        }
        let counters = far.counters().unwrap();
        assert!(counters.drops > 0, "{counters:?}");
        assert_eq!((counters.received, counters.received + counters.drops), (received, 500));
        assert_eq!(far.counters().unwrap(), counters, "asking again counts nothing twice");
    });
}

#[test]
fn frames_that_do_not_fit_are_told_and_those_before_them_sent() {
    with_cable(|| {
        let clock = HostClock::start();
        let (mut near, mut far) = (raw("va"), raw("vb"));
        let mut batch = Batch::new(8);
        let long = frame([0x88, 0xA4], 2, 1514);
        assert_eq!(near.send_batch([&ethercat(1)[..], &long[..]]).unwrap().frames, 2);
        fetch(&mut far, &mut batch, &clock, 2);
        assert_eq!(batch.iter().last().unwrap().bytes, long);

        ip("link set va mtu 1400");
        let error = near.send_batch([&ethercat(1)[..], &long[..], &ethercat(3)[..]]).unwrap_err();
        assert!(matches!(error, LinkError::FrameTooLong { len: 1514, mtu: 1400, .. }), "{error}");
        let text = error.to_string();
        assert!(text.contains("at most 1414") && text.contains("mtu 1500"), "{text}");
        fetch(&mut far, &mut batch, &clock, 1);

        let error = near.send_batch([&ethercat(1)[..], &[0; 13][..]]).unwrap_err();
        assert!(matches!(error, LinkError::FrameTooShort { len: 13, .. }), "{error}");
        fetch(&mut far, &mut batch, &clock, 1);
        assert_eq!(near.counters().unwrap().send_failures, 2);
    });
}

#[test]
fn a_card_that_goes_down_says_so_once_and_may_come_back() {
    with_cable(|| {
        let clock = HostClock::start();
        let (mut near, mut far) = (raw("va"), raw("vb"));
        let mut batch = Batch::new(8);
        ip("link set va down");
        assert_eq!(near.wait(&clock, soon(&clock)).unwrap(), Ready::Readable);
        let error = near.recv_batch(&mut batch, &clock).unwrap_err();
        assert!(matches!(error, LinkError::Down { .. }), "{error}");
        assert!(error.to_string().contains("sudo ip link set va up"), "{error}");
        assert!(matches!(near.send_batch([&ethercat(1)[..]]), Err(LinkError::Down { .. })));
        ip("link set va up");
        await_operation("va");
        assert_eq!(near.recv_batch(&mut batch, &clock).unwrap(), 0);
        assert_eq!(near.send_batch([&ethercat(2)[..]]).unwrap().frames, 1);
        fetch(&mut far, &mut batch, &clock, 1);
    });
}

#[test]
fn a_card_that_vanishes_stays_vanished() {
    with_cable(|| {
        let clock = HostClock::start();
        let mut near = raw("va");
        let mut listener = Listener::open("va", ListenFilter::EtherCat).unwrap();
        let mut idle = raw("va");
        let mut batch = Batch::new(8);
        ip("link del va");
        for _ in 0..3 {
            let error = near.recv_batch(&mut batch, &clock).unwrap_err();
            assert!(matches!(error, LinkError::Vanished { .. }), "{error}");
            let error = listener.recv_batch(&mut batch, &clock).unwrap_err();
            assert!(matches!(error, LinkError::Vanished { .. }), "{error}");
            let error = idle.send_batch([&ethercat(1)[..]]).unwrap_err();
            assert!(matches!(error, LinkError::Vanished { .. }), "{error}");
        }
    });
}

#[test]
fn cards_that_cannot_be_opened_are_refused_with_reason_and_way_out() {
    with_cable(|| {
        ip("link set vb down");
        let open = |name: &str| RawSocket::open(name, &SocketOptions::default()).err().unwrap();
        let missing = open("eth9");
        assert!(matches!(missing, LinkError::Missing { .. }), "{missing}");
        let text = missing.to_string();
        for name in ["lo", "va", "vb"] {
            assert!(text.contains(name), "{text}");
        }
        let rows = [
            (open("vb"), "vb: the interface is down. Do: `sudo ip link set vb up`"),
            (open("lo"), "lo: no Ethernet interface (hardware type 772, expected 1)"),
            (open(""), ": there is no such network interface"),
            (open("a name/that is far too long for one"), "there is no such network interface"),
        ];
        for (error, expected) in rows {
            assert!(error.to_string().contains(expected), "{error}");
        }
        let error = Listener::open("vb", ListenFilter::EtherCat).err().unwrap();
        assert!(matches!(error, LinkError::Down { .. }), "{error}");
    });
}

#[test]
fn without_privilege_the_way_to_get_it_is_told() {
    with_cable(|| {
        // Only this thread loses its capabilities.
        let none = rustix::thread::CapabilitySets {
            effective: rustix::thread::CapabilitySet::empty(),
            permitted: rustix::thread::CapabilitySet::empty(),
            inheritable: rustix::thread::CapabilitySet::empty(),
        };
        rustix::thread::set_capabilities(None, none).unwrap();
        let error = RawSocket::open("va", &SocketOptions::default()).err().unwrap();
        assert!(matches!(error, LinkError::NoPrivilege { .. }), "{error}");
        let binary = std::env::current_exe().unwrap();
        let line = format!("sudo setcap cap_net_raw+ep {}", binary.display());
        assert!(error.to_string().contains(&line), "{error}");
    });
}

#[test]
#[allow(unsafe_code, reason = "no program that is begun leaves a forked child behind")]
fn a_lock_that_is_dropped_is_free_though_a_child_was_just_forked() {
    with_cable(|| {
        let lock = CardLock::take("va").unwrap();
        // A copy of the socket in a child that lives on for a while, as between fork and exec.
        // SAFETY: the child calls nothing but functions that are safe after a fork, and ends.
        let child = unsafe { libc::fork() };
        assert!(child >= 0);
        if child == 0 {
            // SAFETY: as above.
            unsafe {
                libc::usleep(60_000);
                libc::_exit(0);
            }
        }
        drop(lock);
        assert_eq!(CardLock::holder("va").unwrap(), None);
        CardLock::take("va").unwrap();
        // SAFETY: the child is ours, and nobody else waits for it.
        unsafe { libc::waitpid(child, std::ptr::null_mut(), 0) };
    });
}

#[test]
fn a_card_is_locked_once_until_the_lock_is_dropped() {
    with_cable(|| {
        let lock = CardLock::take("va").unwrap();
        let process = i32::try_from(std::process::id()).unwrap();
        let error = CardLock::take("va").unwrap_err();
        let LinkError::InUse { interface, holder } = &error else { panic!("{error}") };
        assert_eq!((interface.as_str(), holder.process), ("va", Some(process)));
        assert_eq!(CardLock::holder("va").unwrap().as_ref(), Some(holder));
        // The other end of the cable is another card.
        let other = CardLock::take("vb").unwrap();
        drop(lock);
        assert_eq!(CardLock::holder("va").unwrap(), None);
        CardLock::take("va").unwrap();
        drop(other);
        assert!(matches!(CardLock::take("nobody"), Err(LinkError::Missing { .. })));
    });
}
