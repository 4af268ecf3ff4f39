//! Mailbox gateway of a run: other programs ask SubDevices and the MainDevice by UDP and TCP.

mod objects;
mod protocols;

use std::collections::BTreeMap;
use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream, UdpSocket};
use std::process::{Command, Stdio};
use std::time::Duration;

use linesman_proto::address::StationAddress;
use linesman_proto::mailbox::coe::information::{Answer, Body, Message as Information, ObjectList};
use linesman_proto::mailbox::coe::sdo::{Abort, Initial, Request, Response};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress};
use linesman_proto::mailbox::foe::Message as FoeMessage;
use linesman_proto::mailbox::{
    Counter, ErrorReply, ErrorReplyCode, Header, MailboxType, Message, gateway,
};
use serde_json::Value;
use tempfile::TempDir;

use crate::support::bench::beside_segment;
use crate::support::running::Running;
use crate::support::{PROGRAM, Run, assert_valid, linesman};

/// A coupler without a mailbox, two SubDevices that speak CoE, one that has files.
const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"A1\"\ntype = \"EL3102\"\non = \"K1.B\"\n\
[[device]]\nname = \"M1\"\ntype = \"EL7041\"\non = \"A1.B\"\n\
[[device]]\nname = \"C1\"\ntype = \"EL6601\"\non = \"M1.B\"\n";

const COUPLER: u16 = 0x1001;
const ANALOG: u16 = 0x1002;
const STEPPER: u16 = 0x1003;
const SWITCH: u16 = 0x1004;
const NOBODY: u16 = 0x1234;

/// An address of this computer whose port nobody uses.
fn free_address() -> SocketAddr {
    TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap()
}

fn running(options: &[&str]) -> (Running, SocketAddr) {
    let address = free_address();
    let listen = address.to_string();
    let options = [&["--gateway", listen.as_str()], options].concat();
    (Running::with_options(PLANT, &options), address)
}

fn frame(kind: MailboxType, station: u16, counter: u8, body: &[u8]) -> Vec<u8> {
    let mut header = Header::new(kind, Counter::new(counter).unwrap(), 0);
    header.address = StationAddress(station);
    let mut frame = vec![0; gateway::MAX_LEN];
    let len = gateway::write(header, body, &mut frame).unwrap();
    frame.truncate(len);
    frame
}

fn coe(message: CoeMessage<'_>) -> Vec<u8> {
    let mut body = vec![0; 1_024];
    let len = message.write(&mut body).unwrap();
    body.truncate(len);
    body
}

fn upload_of(index: u16, subindex: u8) -> Vec<u8> {
    let object = ObjectAddress::new(index, subindex);
    coe(CoeMessage::SdoRequest(Request::Upload { object, complete: false }))
}

/// The number in the answer to an upload of an object.
#[track_caller]
fn uploaded(body: &[u8], index: u16, subindex: u8) -> u32 {
    let Ok(CoeMessage::SdoResponse(Response::Upload { object, initial, .. })) =
        CoeMessage::parse(body)
    else {
        panic!("{body:02x?}")
    };
    assert_eq!(object, ObjectAddress::new(index, subindex));
    initial.data().iter().rev().fold(0, |number, byte| number << 8 | u32::from(*byte))
}

/// A program that asks by datagrams.
struct UdpClient(UdpSocket);

impl UdpClient {
    fn new(gateway: SocketAddr) -> Self {
        let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
        socket.connect(gateway).unwrap();
        socket.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
        Self(socket)
    }

    fn receive(&self) -> Option<(Header, Vec<u8>)> {
        let mut buffer = [0; 2_100];
        let len = self.0.recv(&mut buffer).ok()?;
        let Message { header, data } = gateway::parse(&buffer[..len]).unwrap();
        Some((header, data.to_vec()))
    }

    fn send(&self, kind: MailboxType, station: u16, counter: u8, body: &[u8]) {
        self.0.send(&frame(kind, station, counter, body)).unwrap();
    }

    #[track_caller]
    fn ask(&self, kind: MailboxType, station: u16, counter: u8, body: &[u8]) -> Vec<u8> {
        self.send(kind, station, counter, body);
        let (header, data) = self.receive().expect("an answer");
        assert_eq!((header.address.value(), header.counter.value()), (station, counter));
        data
    }

    #[track_caller]
    fn number(&self, station: u16, index: u16, subindex: u8) -> u32 {
        let answer = self.ask(MailboxType::Coe, station, 3, &upload_of(index, subindex));
        uploaded(&answer, index, subindex)
    }
}

fn tcp_ask(stream: &mut TcpStream, frame: &[u8]) -> (Header, Vec<u8>) {
    stream.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    stream.write_all(frame).unwrap();
    let mut answer = vec![0; 2];
    stream.read_exact(&mut answer).unwrap();
    let len = gateway::frame_len([answer[0], answer[1]]).unwrap();
    answer.resize(len, 0);
    stream.read_exact(&mut answer[2..]).unwrap();
    let Message { header, data } = gateway::parse(&answer).unwrap();
    (header, data.to_vec())
}

/// What went through, once it is as expected.
#[track_caller]
fn counted(running: &Running, done: impl Fn(&Value) -> bool) -> Value {
    let mut last = Value::Null;
    for _ in 0..200 {
        last = running.status()["gateway"].clone();
        if done(&last) {
            return last;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    panic!("{last}")
}

// S0 L3073: UDP is mandatory, TCP an option; both are there.
#[test]
fn subdevices_answer_by_udp_and_by_tcp() {
    let (running, address) = running(&[]);
    let client = UdpClient::new(address);
    assert_eq!(client.number(ANALOG, 0x1018, 1), 2);
    assert_eq!(client.number(STEPPER, 0x1018, 2), 0x1B81_3052);
    let mut stream = TcpStream::connect(address).unwrap();
    for counter in [0, 1, 7, 7] {
        let asked = frame(MailboxType::Coe, STEPPER, counter, &upload_of(0x1018, 2));
        let (header, data) = tcp_ask(&mut stream, &asked);
        assert_eq!((header.address.value(), header.counter.value()), (STEPPER, counter));
        assert_eq!(uploaded(&data, 0x1018, 2), 0x1B81_3052);
    }
    // A download through the gateway is one that our own services see.
    let object = ObjectAddress::new(0x8010, 1);
    let initial = Initial::of(&[0xB0, 4], 128);
    let download =
        coe(CoeMessage::SdoRequest(Request::Download { object, complete: false, initial }));
    let answer = client.ask(MailboxType::Coe, STEPPER, 2, &download);
    let taken = CoeMessage::SdoResponse(Response::Download { object, complete: false });
    assert_eq!(CoeMessage::parse(&answer), Ok(taken));
    let read = linesman(["sdo", &running.socket(), "3", "read", "0x8010:01", "--json"]);
    assert_eq!(read.json()["objects"][0]["bytes"], "B0 04", "{}", read.all());
    // What the SubDevice refuses is its answer.
    let answer = client.ask(MailboxType::Coe, ANALOG, 5, &upload_of(0x5555, 0));
    let abort = Abort { object: ObjectAddress::new(0x5555, 0), code: 0x0602_0000 };
    assert_eq!(CoeMessage::parse(&answer), Ok(CoeMessage::Abort(abort)));
    // VoE reaches it as well: it says itself that it does not speak it.
    client.send(MailboxType::Voe, ANALOG, 6, &[0; 8]);
    let (header, data) = client.receive().expect("an answer");
    assert_eq!((header.kind, header.counter.value()), (MailboxType::Error, 6));
    let code = ErrorReply::parse(&data).unwrap().code;
    assert_eq!(code, ErrorReplyCode::UnsupportedProtocol);
    let gateway = counted(&running, |gateway| gateway["answers"] == 9);
    assert_eq!((&gateway["requests"], &gateway["refused"]), (&9.into(), &serde_json::json!({})));
}

#[test]
fn maindevice_shows_its_own_objects_at_address_0() {
    let (_running, address) = running(&[]);
    let client = UdpClient::new(address);
    let number = |index, subindex| client.number(0, index, subindex);
    assert_eq!(number(0xF020, 0), 4);
    assert_eq!(number(0xF040, 0), 4);
    assert_eq!((number(0x8002, 1), number(0x8002, 6)), (u32::from(STEPPER), 0x1B81_3052));
    assert_eq!((number(0x9002, 1), number(0x9002, 5)), (u32::from(STEPPER), 2));
    assert_eq!((number(0xA002, 1), number(0xA002, 2)), (8, 8));
    assert_eq!(number(0xA001, 6), u32::from(COUPLER));
    // The list of objects, and what one of them is.
    let list = Information::whole(Body::ListRequest {
        list: linesman_proto::mailbox::coe::information::ListKind::All,
    });
    let answer = client.ask(MailboxType::Coe, 0, 1, &coe(CoeMessage::Information(list)));
    let Ok(CoeMessage::Information(Information {
        incomplete: false,
        body: Body::Answer { to: Answer::List, fragment },
        ..
    })) = CoeMessage::parse(&answer)
    else {
        panic!("{answer:02x?}")
    };
    let list: Vec<u16> = ObjectList::parse(fragment).unwrap().indices().map(|one| one.0).collect();
    assert!(
        [0x1000, 0x8003, 0x9003, 0xA003, 0xF120].iter().all(|index| list.contains(index)),
        "{list:x?}"
    );
    // Nothing can be written there, and what is not there is refused with the code for it.
    let object = ObjectAddress::new(0x8002, 1);
    let initial = Initial::of(&[1, 0], 128);
    let download =
        coe(CoeMessage::SdoRequest(Request::Download { object, complete: false, initial }));
    for (body, code) in [
        (download, 0x0601_0002),
        (upload_of(0x8009, 1), 0x0602_0000),
        (upload_of(0x8002, 9), 0x0609_0011),
    ] {
        let answer = client.ask(MailboxType::Coe, 0, 4, &body);
        let Ok(CoeMessage::Abort(abort)) = CoeMessage::parse(&answer) else {
            panic!("{answer:02x?}")
        };
        assert_eq!(abort.code, code, "{body:02x?}");
    }
}

// Four programs at once ask two SubDevices with the same counters; each gets what it has asked for.
#[test]
fn clients_with_the_same_counters_are_not_mixed_up() {
    let (running, address) = running(&[]);
    let expected: BTreeMap<(u16, u8), u32> = {
        let client = UdpClient::new(address);
        let known = [ANALOG, STEPPER]
            .into_iter()
            .flat_map(|station| (0..=4).map(move |sub| (station, sub)));
        known.map(|(station, sub)| ((station, sub), client.number(station, 0x1018, sub))).collect()
    };
    assert_ne!(expected[&(ANALOG, 2)], expected[&(STEPPER, 2)]);
    std::thread::scope(|scope| {
        for who in 0..4_u8 {
            let expected = &expected;
            scope.spawn(move || {
                let client = UdpClient::new(address);
                let mut stream = TcpStream::connect(address).unwrap();
                for round in 0..25_u8 {
                    let counter = round % 7 + 1;
                    let station = if (who + round) % 2 == 0 { ANALOG } else { STEPPER };
                    let sub = (who + round) % 5;
                    let asked = frame(MailboxType::Coe, station, counter, &upload_of(0x1018, sub));
                    let (header, data) = if who % 2 == 0 {
                        client.0.send(&asked).unwrap();
                        client.receive().expect("an answer")
                    } else {
                        tcp_ask(&mut stream, &asked)
                    };
                    assert_eq!(
                        (header.address.value(), header.counter.value()),
                        (station, counter)
                    );
                    assert_eq!(uploaded(&data, 0x1018, sub), expected[&(station, sub)]);
                }
            });
        }
    });
    counted(&running, |gateway| gateway["answers"] == 110 && gateway["requests"] == 110);
}

// A file takes several messages; in between, others ask the same SubDevice and wait.
#[test]
fn transfer_of_a_client_is_not_torn_apart_by_others() {
    let (running, address) = running(&[]);
    let client = UdpClient::new(address);
    let foe = |message: FoeMessage<'_>| {
        let mut body = vec![0; 1_400];
        let len = message.write(&mut body).unwrap();
        body.truncate(len);
        body
    };
    let ask = |message| {
        let answer = client.ask(MailboxType::Foe, SWITCH, 1, &foe(message));
        let parsed = FoeMessage::parse(&answer);
        match parsed {
            Ok(FoeMessage::Ack { packet }) => (packet, Vec::new()),
            Ok(FoeMessage::Data { packet, data }) => (packet, data.to_vec()),
            other => panic!("{other:?}"),
        }
    };
    let room = {
        let stations = running.until("has a mailbox", |_| true);
        stations["devices"][3]["mailbox"]["out_size"].as_u64().unwrap() as usize - 12
    };
    let file: Vec<u8> = (0..room + 20).map(|at| at as u8).collect();
    assert_eq!(ask(FoeMessage::Write { password: 0, name: b"settings.txt" }).0, 0);
    assert_eq!(ask(FoeMessage::Data { packet: 1, data: &file[..room] }).0, 1);
    // Another one asks, and our own services ask: both get their answers, after the file.
    let other = UdpClient::new(address);
    other.send(MailboxType::Coe, SWITCH, 1, &upload_of(0x1018, 1));
    let socket = running.socket();
    std::thread::scope(|scope| {
        let own = scope.spawn(|| linesman(["sdo", &socket, "4", "read", "0x1018:01"]));
        assert_eq!(ask(FoeMessage::Data { packet: 2, data: &file[room..] }).0, 2);
        let own = own.join().unwrap();
        assert_eq!(own.status, 0, "{}", own.all());
    });
    let (_, data) = other.receive().expect("an answer");
    assert_eq!(uploaded(&data, 0x1018, 1), 2);
    // It has arrived whole.
    let mut read = Vec::new();
    let (packet, data) = ask(FoeMessage::Read { password: 0, name: b"settings.txt" });
    assert_eq!(packet, 1);
    read.extend(data);
    let (packet, data) = ask(FoeMessage::Ack { packet: 1 });
    assert_eq!(packet, 2);
    read.extend(data);
    assert_eq!(read, file);
    // The last packet is acknowledged, which nobody answers and nobody waits for.
    client.send(MailboxType::Foe, SWITCH, 2, &foe(FoeMessage::Ack { packet: 2 }));
    assert_eq!(client.number(SWITCH, 0x1018, 1), 2);
}

// S0 L3072: there is no error handling; an unknown SubDevice is not answered, nor is garbage.
#[test]
fn what_cannot_be_served_is_not_answered_and_counted() {
    let (running, address) = running(&[]);
    let client = UdpClient::new(address);
    let upload = upload_of(0x1018, 1);
    client.send(MailboxType::Coe, NOBODY, 1, &upload);
    client.send(MailboxType::Coe, COUPLER, 1, &upload);
    client.send(MailboxType::Eoe, SWITCH, 1, &upload);
    client.send(MailboxType::Reserved(9), SWITCH, 1, &upload);
    client.send(MailboxType::Foe, 0, 1, &upload);
    // Longer than the mailbox of any SubDevice here.
    client.send(MailboxType::Coe, ANALOG, 1, &[0; 1_400]);
    for garbage in
        [&[][..], &[0x10], &[0x10, 0x10, 1, 2, 3, 4, 5, 6], &[0xFF; 40], &[0x10, 0x50, 1]]
    {
        client.0.send(garbage).unwrap();
    }
    // What comes next is the answer to what was asked next.
    assert_eq!(client.number(ANALOG, 0x1018, 1), 2);
    client.0.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    assert!(client.receive().is_none());
    let expected = serde_json::json!({
        "malformed": 5, "no-mailbox": 1, "protocol": 3, "too-long": 1, "unknown-station": 1
    });
    let gateway = counted(&running, |gateway| gateway["refused"] == expected);
    assert_eq!((&gateway["requests"], &gateway["answers"]), (&12.into(), &1.into()));
    // An unknown station by TCP: nothing comes, and the connection serves the next request.
    let mut stream = TcpStream::connect(address).unwrap();
    stream.write_all(&frame(MailboxType::Coe, NOBODY, 1, &upload)).unwrap();
    let (header, _) = tcp_ask(&mut stream, &frame(MailboxType::Coe, ANALOG, 1, &upload));
    assert_eq!(header.address.value(), ANALOG);
}

#[test]
fn half_messages_floods_and_a_thousand_connections_leave_the_line_alone() {
    let (running, address) = running(&[]);
    // Half a message, then silence; half a message, then the end; no message at all.
    let asked = frame(MailboxType::Coe, ANALOG, 1, &upload_of(0x1018, 1));
    let mut half = TcpStream::connect(address).unwrap();
    half.write_all(&asked[..9]).unwrap();
    TcpStream::connect(address).unwrap().write_all(&asked[..1]).unwrap();
    let mut garbage = TcpStream::connect(address).unwrap();
    garbage.write_all(&[0xFF; 100]).unwrap();
    let mut rest = Vec::new();
    assert!(garbage.read_to_end(&mut rest).is_err() || rest.is_empty(), "it is closed");
    // In pieces it is as good as whole.
    let mut pieces = TcpStream::connect(address).unwrap();
    pieces.set_nodelay(true).unwrap();
    for byte in &asked[..asked.len() - 1] {
        pieces.write_all(&[*byte]).unwrap();
    }
    let (_, data) = tcp_ask(&mut pieces, &asked[asked.len() - 1..]);
    assert_eq!(uploaded(&data, 0x1018, 1), 2);
    let connections: Vec<TcpStream> = (0..1_000)
        .filter_map(|_| TcpStream::connect_timeout(&address, Duration::from_secs(5)).ok())
        .collect();
    let flood = UdpClient::new(address);
    for _ in 0..5_000 {
        let _ = flood.0.send(&asked);
    }
    let gateway = counted(&running, |gateway| {
        gateway["refused"]["too-many-connections"].as_u64() > Some(0)
            && gateway["refused"]["too-many-requests"].as_u64() > Some(0)
    });
    assert!(gateway["answers"].as_u64() > Some(0), "{gateway}");
    drop(connections);
    // Others are served again, and the line has run on.
    std::thread::sleep(Duration::from_millis(1_500));
    let client = UdpClient::new(address);
    assert_eq!(client.number(STEPPER, 0x1018, 1), 2);
    let mut stream = TcpStream::connect(address).unwrap();
    tcp_ask(&mut stream, &frame(MailboxType::Coe, STEPPER, 1, &upload_of(0x1018, 1)));
    let online = running.until("is shown", |_| true);
    assert!(online["devices"].as_array().unwrap().iter().all(|one| one["al_state"] == "OP"));
    let status = running.status();
    // A computer that stands still for a while loses cycles, whoever floods it: then this tells nothing.
    if status["counts"]["cycles_missed"] == 0 {
        assert_eq!(status["counts"]["working_counter_errors"], 0, "{}", status["counts"]);
    } else {
        eprintln!("the computer stood still: {}", status["counts"]);
    }
}

#[test]
fn read_only_gateway_changes_nothing() {
    let (running, address) = running(&["--gateway-read-only"]);
    let client = UdpClient::new(address);
    let before = client.number(STEPPER, 0x8010, 1);
    let object = ObjectAddress::new(0x8010, 1);
    let initial = Initial::of(&[0xB0, 4], 128);
    let download =
        coe(CoeMessage::SdoRequest(Request::Download { object, complete: false, initial }));
    let answer = client.ask(MailboxType::Coe, STEPPER, 2, &download);
    let abort = CoeMessage::Abort(Abort { object, code: 0x0601_0002 });
    assert_eq!(CoeMessage::parse(&answer), Ok(abort));
    assert_eq!(client.number(STEPPER, 0x8010, 1), before);
    // Who is not there says nothing, not even no.
    client.send(MailboxType::Coe, NOBODY, 2, &download);
    let mut body = vec![0; 64];
    let len = FoeMessage::Write { password: 0, name: b"settings.txt" }.write(&mut body).unwrap();
    let answer = client.ask(MailboxType::Foe, SWITCH, 6, &body[..len]);
    assert!(matches!(FoeMessage::parse(&answer), Ok(FoeMessage::Error { .. })), "{answer:02x?}");
    let expected = serde_json::json!({ "read-only": 3, "unknown-station": 1 });
    counted(&running, |gateway| gateway["refused"] == expected && gateway["read_only"] == true);
}

#[test]
fn gateway_for_other_computers_needs_an_allow_list() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, PLANT).unwrap();
    let on = format!("sim:{}", plant.display());
    let run =
        |options: &[&str]| linesman([&["run", "--on", &on, "--seconds", "1"], options].concat());
    let refused = run(&["--gateway", "0.0.0.0"]);
    assert_eq!(refused.status, 2, "{}", refused.all());
    assert!(refused.stderr.contains("--gateway-allow 192.168.1.0/24"), "{}", refused.stderr);
    let refused = run(&["--gateway", "eth0"]);
    assert_eq!(refused.status, 2);
    assert!(refused.stderr.contains("127.0.0.1"), "{}", refused.stderr);
    let refused = run(&["--gateway-allow", "10.0.0.0/8"]);
    assert_eq!(refused.status, 2, "it needs a gateway: {}", refused.all());
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = taken.local_addr().unwrap().to_string();
    let refused = run(&["--gateway", &address]);
    assert_eq!(refused.status, 2, "{}", refused.all());
    assert!(
        refused.stderr.contains(&address) && refused.stderr.contains("ss -lntu"),
        "{}",
        refused.stderr
    );
    let free = free_address().to_string();
    let ran = run(&["--gateway", &free, "--gateway-allow", "10.0.0.0/8"]);
    assert_eq!(ran.status, 0, "{}", ran.all());
    assert!(
        ran.stdout.contains(&format!("Mailbox gateway on {free}, UDP and TCP.")),
        "{}",
        ran.stdout
    );
    assert!(
        ran.stdout.contains("Mailbox gateway: 0 requests of 0 clients, 0 answers."),
        "{}",
        ran.stdout
    );
}

#[test]
fn end_of_a_run_tells_what_went_through() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    std::fs::write(&plant, PLANT).unwrap();
    let address = free_address();
    let child = Command::new(PROGRAM)
        .args(["run", "--json", "--on", &format!("sim:{}", plant.display())])
        .args(["--gateway", &address.to_string()])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let client = UdpClient::new(address);
    client.0.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
    // Before it is up nobody answers.
    let up = (0..300).any(|_| {
        let _ = client.0.send(&frame(MailboxType::Coe, ANALOG, 1, &upload_of(0x1018, 1)));
        let answered = client.receive().is_some();
        std::thread::sleep(Duration::from_millis(20));
        answered
    });
    assert!(up);
    let ended = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(ended.success());
    let output = child.wait_with_output().unwrap();
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_valid(&report, "run");
    assert_eq!(report["gateway"]["listen"], address.to_string(), "{report}");
    assert!(report["gateway"]["answers"].as_u64() > Some(0), "{report}");
}

/// Python: a request of an object to a SubDevice, and what its answer says.
const FUNCTIONS: &str = r#"import socket, struct
def frame(station, counter, index, subindex):
    body = struct.pack("<HBHBI", 0x2000, 0x40, index, subindex, 0)
    mailbox = struct.pack("<HHBB", len(body), station, 0, 3 | counter << 4) + body
    return struct.pack("<H", len(mailbox) | 5 << 12) + mailbox
def read(answer):
    _, _, station, _, kind, _, command, index, subindex, value = struct.unpack("<HHHBBHBHBI", answer)
    return "%04x %d %02x %04x:%d %d" % (station, kind >> 4, command, index, subindex, value)"#;

/// A line with mailboxes on a cable of its own.
const CABLE: &str = r#"
    command -v python3 > /dev/null || { echo "SKIPPED: there is no python3"; exit 0; }
    ip link set lo up
    printf '%s' "$1" > $DIRECTORY/mail.toml
    ip link add near1 type veth peer name far1
    for card in near1 far1; do
        sysctl -q -w net.ipv6.conf.$card.disable_ipv6=1
        ip link set $card up
    done
    "$LINESMAN" sim $DIRECTORY/mail.toml --on far1 > $DIRECTORY/mail.out & mail=$!
    for try in $(seq 100); do grep -q Ctrl-C $DIRECTORY/mail.out && break; sleep 0.05; done
"#;

/// That line, driven with a gateway for the address of this computer.
const ON_A_CABLE: &str = r#"
    out=$DIRECTORY/run.out
    "$LINESMAN" run --on near1 --cycle 10ms --gateway 127.0.0.1 > $out & run=$!
    for try in $(seq 200); do grep -q 'have reached' $out && break; sleep 0.05; done
    python3 - <<'EOF'
FUNCTIONS
def client():
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.connect(("127.0.0.1", 34980))
    one.settimeout(10)
    return one
udp, other, tcp = client(), client(), socket.create_connection(("127.0.0.1", 34980), 10)
udp.send(frame(0x1002, 5, 0x1018, 1))
print("udp", read(udp.recv(2048)))
tcp.sendall(frame(0x1002, 5, 0x1018, 1))
print("tcp", read(tcp.recv(2048)))
# Both at once, with the same counters, each about a SubDevice and an object of its own.
mixed = 0
for turn in range(70):
    counter = turn % 7 + 1
    udp.send(frame(0x1002, counter, 0x1018, 2))
    other.send(frame(0x1003, counter, 0x1018, 4))
    mixed += read(udp.recv(2048)) != "1002 %d 43 1018:2 203305042" % counter
    mixed += read(other.recv(2048)) != "1003 %d 43 1018:4 3" % counter
print("mixed", mixed)
# Nobody has that address; the third message is too long for the mailbox.
udp.send(frame(0x1234, 1, 0x1018, 1))
long = struct.pack("<HHBB", 1000, 0x1002, 0, 3) + bytes([0, 0x20, 0x40]) + bytes(997)
udp.send(struct.pack("<H", len(long) | 5 << 12) + long)
udp.settimeout(1)
try:
    print("answered", udp.recv(2048).hex())
except TimeoutError:
    print("silence")
EOF
    kill -INT $run; wait $run
    grep -o 'Mailbox gateway: .*' $out
    kill -INT $mail; wait $mail
"#;

/// The same line, with a gateway for an office in another subnet, and a client of it that is on the list and one that
/// is not.
const FROM_AN_OFFICE: &str = r#"
    unshare -n sleep 100 > /dev/null 2>&1 & office=$!
    for try in $(seq 100); do
        [ "$(readlink /proc/$office/ns/net)" != "$(readlink /proc/self/ns/net)" ] && break; sleep 0.05
    done
    ip link add wall type veth peer name desk
    ip link set desk netns $office
    ip addr add 10.77.1.1/24 dev wall
    ip link set wall up
    ip addr add 10.77.2.1/32 dev lo
    inside() { nsenter -t $office -n "$@"; }
    inside ip link set lo up
    inside ip addr add 10.77.1.7/24 dev desk
    inside ip addr add 10.77.3.7/24 dev desk
    inside ip link set desk up
    inside ip route add 10.77.2.0/24 via 10.77.1.1
    ip route add 10.77.3.0/24 dev wall
    out=$DIRECTORY/run.out
    "$LINESMAN" run --on near1 --cycle 10ms --gateway 10.77.2.1 --gateway-allow 10.77.1.0/24 > $out & run=$!
    for try in $(seq 200); do grep -q 'have reached' $out && break; sleep 0.05; done
    inside python3 - <<'EOF'
FUNCTIONS
def client(own):
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    one.bind((own, 0))
    one.connect(("10.77.2.1", 34980))
    one.settimeout(10)
    return one
udp, tcp = client("10.77.1.7"), socket.create_connection(("10.77.2.1", 34980), 10)
udp.send(frame(0x1002, 5, 0x1018, 1))
print("udp", read(udp.recv(2048)))
tcp.sendall(frame(0x1003, 5, 0x1018, 4))
print("tcp", read(tcp.recv(2048)))
stranger = client("10.77.3.7")
stranger.send(frame(0x1002, 5, 0x1018, 1))
stranger.settimeout(1)
try:
    print("answered", stranger.recv(2048).hex())
except TimeoutError:
    print("silence")
EOF
    kill -INT $run; wait $run
    grep -o 'Mailbox gateway: .*' $out
    kill -INT $mail; wait $mail
    kill $office
"#;

/// What a script beside the line says; `None` where it cannot run here.
fn beside_line(script: &str) -> Option<Run> {
    let script = [CABLE, script].concat();
    let script = script.replace("\"$1\"", &format!("'{PLANT}'")).replace("FUNCTIONS", FUNCTIONS);
    let run = beside_segment(&script)?;
    if run.stdout.contains("SKIPPED") {
        eprintln!("{}", run.stdout);
        return None;
    }
    Some(run)
}

// proves: MBG-01 partial: the client is a program of this test, not of another make
#[test]
fn client_in_another_subnet_is_served_and_one_that_is_not_on_the_list_is_not() {
    let Some(run) = beside_line(FROM_AN_OFFICE) else { return };
    let expected = [
        "udp 1002 5 43 1018:1 2",
        "tcp 1003 5 43 1018:4 3",
        "silence",
        "Mailbox gateway: 3 requests of 2 clients, 2 answers, 1 refused or not answered (not-allowed 1).",
    ];
    assert_eq!(run.stdout.lines().collect::<Vec<_>>(), expected, "{}", run.all());
}

// proves: MBG-03, MBG-04, MBG-05
#[test]
fn programs_of_others_ask_a_line_on_a_cable() {
    let Some(run) = beside_line(ON_A_CABLE) else { return };
    let expected = [
        "udp 1002 5 43 1018:1 2",
        "tcp 1002 5 43 1018:1 2",
        "mixed 0",
        "silence",
        "Mailbox gateway: 144 requests of 3 clients, 142 answers, 2 refused or not answered (too-long 1, unknown-station 1).",
    ];
    assert_eq!(run.stdout.lines().collect::<Vec<_>>(), expected, "{}", run.all());
}
