//! ADS server of a run: what other programs read and write by it.

use std::io::{Read as _, Write as _};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::time::{Duration, Instant};

use linesman_proto::ads::{AMS_TCP_HEADER_LEN, AdsRequest, AmsAddress, AmsHeader, AmsNetId, index};
use serde_json::Value;

use crate::support::linesman;
use crate::support::running::{Running, project_of};

/// A coupler without a mailbox, two SubDevices that speak CoE, a drive.
const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"A1\"\ntype = \"EL3102\"\non = \"K1.B\"\n\
[[device]]\nname = \"M1\"\ntype = \"EL7041\"\non = \"A1.B\"\n\
[[device]]\nname = \"X1\"\ntype = \"AX5103-0012\"\non = \"K1.C\"\n";

const MAIN: u16 = AmsAddress::MAIN_DEVICE_PORT;
const COUPLER: u16 = 0x1001;
const STEPPER: u16 = 0x1003;
const DRIVE: u16 = 0x1004;
const NET_ID: AmsNetId = AmsNetId([127, 0, 0, 1, 2, 1]);

fn running(options: &[&str]) -> (Running, SocketAddr) {
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let listen = address.to_string();
    let options = [&["--ads", listen.as_str()], options].concat();
    (Running::with_options(PLANT, &options), address)
}

/// A program that asks.
struct Client {
    stream: TcpStream,
    invoke_id: u32,
    net_id: AmsNetId,
}

impl Client {
    fn new(address: SocketAddr) -> Self {
        let stream = TcpStream::connect(address).unwrap();
        stream.set_read_timeout(Some(Duration::from_secs(30))).unwrap();
        Self { stream, invoke_id: 0, net_id: NET_ID }
    }

    /// The error of the AMS header, and the data behind it.
    fn ask(&mut self, port: u16, command: u16, data: &[u8]) -> (u32, Vec<u8>) {
        self.invoke_id += 1;
        let target = AmsAddress { net_id: self.net_id, port };
        let source = AmsAddress { net_id: AmsNetId([10, 0, 0, 7, 1, 1]), port: 0x8089 };
        let request = AmsHeader::request(target, source, command, self.invoke_id);
        self.stream.write_all(&request.frame(data)).unwrap();
        let mut head = [0; AMS_TCP_HEADER_LEN];
        self.stream.read_exact(&mut head).unwrap();
        let mut message = vec![0; AmsHeader::announced(head).unwrap()];
        self.stream.read_exact(&mut message).unwrap();
        let (header, data) = AmsHeader::parse(&message).unwrap();
        assert_eq!((header.target, header.source), (source, target));
        assert_eq!((header.invoke_id, header.command), (self.invoke_id, command));
        (header.error.0, data.to_vec())
    }

    /// The result, and what is behind it.
    #[track_caller]
    fn result(&mut self, port: u16, request: &AdsRequest<'_>) -> (u32, Vec<u8>) {
        let (command, data) = request.to_bytes();
        let (error, answer) = self.ask(port, command, &data);
        assert_eq!(error, 0, "{request:?}");
        let (result, rest) = answer.split_first_chunk().unwrap();
        (u32::from_le_bytes(*result), rest.to_vec())
    }

    /// The bytes read, or the code by which it is refused.
    #[track_caller]
    fn read(&mut self, port: u16, group: u32, offset: u32, len: u32) -> Result<Vec<u8>, u32> {
        let (result, data) = self.result(port, &AdsRequest::Read { group, offset, len });
        let (count, bytes) = data.split_first_chunk().unwrap();
        assert_eq!(u32::from_le_bytes(*count) as usize, bytes.len());
        if result == 0 { Ok(bytes.to_vec()) } else { Err(result) }
    }

    #[track_caller]
    fn words(&mut self, group: u32, offset: u32) -> Vec<u16> {
        let bytes = self.read(MAIN, group, offset, 1_000).unwrap();
        bytes.chunks(2).map(|pair| u16::from_le_bytes(pair.try_into().unwrap())).collect()
    }

    #[track_caller]
    fn numbers(&mut self, group: u32, offset: u32) -> Vec<u32> {
        let bytes = self.read(MAIN, group, offset, 1_000).unwrap();
        bytes.chunks(4).map(|four| u32::from_le_bytes(four.try_into().unwrap())).collect()
    }

    /// The code: 0 when it was written.
    #[track_caller]
    fn write(&mut self, port: u16, group: u32, offset: u32, data: &[u8]) -> u32 {
        self.result(port, &AdsRequest::Write { group, offset, data }).0
    }
}

const fn object(index: u16, subindex: u8) -> u32 {
    (index as u32) << 16 | subindex as u32
}

// S4 L51: what is seen online can be reached by the remote protocol, functions too.
// proves: PLC-19
#[test]
fn what_is_seen_online_is_read_and_written_by_ads() {
    let (running, address) = running(&[]);
    let report = running.until("has read its counters", |report| {
        let devices = report["devices"].as_array().unwrap();
        devices.iter().all(|one| !one["ports"][0]["invalid_frames"].is_null())
    });
    let devices = report["devices"].as_array().unwrap();
    let of_each = |value: fn(&Value) -> &Value| -> Vec<u64> {
        devices.iter().map(|one| value(one).as_u64().unwrap()).collect()
    };
    let mut client = Client::new(address);
    let wide = |words: Vec<u16>| words.into_iter().map(u64::from).collect::<Vec<_>>();
    assert_eq!(client.words(index::DEVICE_COUNT, 0), [4]);
    assert_eq!(wide(client.words(index::STATION_ADDRESSES, 0)), of_each(|one| &one["station"]));
    assert_eq!(wide(client.words(index::DEVICE_STATES, 0)), of_each(|one| &one["state"]["word"]));
    assert_eq!(client.words(index::MASTER_STATE, 0x100), [8]);
    assert_eq!(client.words(index::NETWORK_STATE, 0), [0]);
    assert_eq!(client.numbers(index::IDENTITY, STEPPER.into())[..2], [2, 0x1B81_3052]);
    assert_eq!(client.numbers(index::CRC_COUNTS, 0), [0; 4]);
    assert_eq!(client.numbers(index::CRC_COUNTS, COUPLER.into()), [0; 4], "four ports");
    assert_eq!(client.numbers(index::ABNORMAL_CHANGES, 0), [0; 4]);
    assert_eq!(client.numbers(index::PRESENCE_CHANGES, 0), [1; 4]);
    let frames = client.numbers(index::FRAME_COUNT, 0);
    assert_eq!(frames, [report["frames"].as_array().unwrap().len() as u32]);
    // 64 bytes each: own address first; at port B of the coupler is the second, at C the drive.
    let topology = client.read(MAIN, index::TOPOLOGY, 0, 1_000).unwrap();
    assert_eq!(topology.len(), 4 * 64);
    assert_eq!(topology[..2], COUPLER.to_le_bytes());
    assert_eq!(topology[6..10], [0x02, 0x10, 0x04, 0x10]);
    // Counts of frames go on, until they are cleared.
    let before = client.numbers(index::FRAME_COUNTS, 0);
    assert_eq!((before.len(), before[2]), (5, 0), "none was lost");
    assert!(before[1] > 10 && before[0] > 0, "{before:?}");
    assert_eq!(client.write(MAIN, index::FRAME_COUNTS, 0, &[]), 0);
    let after = client.numbers(index::FRAME_COUNTS, 0);
    assert!(after[3] < before[3], "{before:?} {after:?}");
    assert_eq!(client.write(MAIN, index::CRC_COUNTS, 0, &[]), 0);
    // Objects: of a SubDevice, which our own services see as well, and of the MainDevice.
    assert_eq!(
        client.read(STEPPER, index::SDO, object(0x1018, 2), 4),
        Ok(vec![0x52, 0x30, 0x81, 0x1B])
    );
    assert_eq!(client.write(STEPPER, index::SDO, object(0x8010, 1), &[0xB0, 4]), 0);
    let read = linesman(["sdo", &running.socket(), "3", "read", "0x8010:01", "--json"]);
    assert_eq!(read.json()["objects"][0]["bytes"], "B0 04", "{}", read.all());
    assert_eq!(client.read(MAIN, index::SDO, object(0xF020, 0), 2), Ok(vec![4]));
    let configured = client.read(MAIN, index::SDO, object(0x8002, 0) | 0x100, 80).unwrap();
    assert_eq!((configured.len(), &configured[2..4]), (80, &STEPPER.to_le_bytes()[..]));
    // What a SubDevice refuses: a code, and its abort code apart.
    assert_eq!(client.read(STEPPER, index::SDO, object(0x5555, 0), 4), Err(0x70C));
    let last = client.read(STEPPER, index::LAST_SDO_ERROR, 0, 276).unwrap();
    assert_eq!((last.len(), &last[16..20]), (276, &0x0602_0000_u32.to_le_bytes()[..]));
    assert_eq!(client.read(COUPLER, index::SDO, object(0x1018, 1), 4), Err(0x701), "no mailbox");
    // The drive: its name of S-0-0001 has a length, and no IDN 0x1001 is there.
    assert_eq!(client.read(DRIVE, index::IDN, 0x0040_1001, 4), Err(0x700));
    // Registers, by datagrams: who is at the third place.
    let mut datagram = vec![1, 0xFF, 0xFE, 0xFF, 0x10, 0, 2, 0, 0, 0, 0, 0, 0, 0];
    let asked =
        AdsRequest::ReadWrite { group: index::DATAGRAM, offset: 0, len: 14, data: &datagram };
    let (result, data) = client.result(MAIN, &asked);
    datagram[2..4].copy_from_slice(&2_u16.to_le_bytes());
    datagram[10..].copy_from_slice(&[0x03, 0x10, 1, 0]);
    assert_eq!((result, &data[4..]), (0, &datagram[..]));
    // A state: to SAFEOP and back.
    for state in [4_u8, 8] {
        assert_eq!(client.write(MAIN, index::DEVICE_STATES, STEPPER.into(), &[state, 0]), 0);
        // States are those of the latest look at the network, which may have been before the change.
        let until = Instant::now() + Duration::from_secs(5);
        let mut shown = client.words(index::DEVICE_STATES, STEPPER.into());
        while shown != [u16::from(state)] && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(20));
            shown = client.words(index::DEVICE_STATES, STEPPER.into());
        }
        assert_eq!(shown, [u16::from(state)]);
    }
    let (result, data) = client.result(MAIN, &AdsRequest::DeviceInfo);
    assert_eq!((result, &data[4..12]), (0, &b"Linesman"[..]));
    assert_eq!(client.result(MAIN, &AdsRequest::State), (0, vec![5, 0, 8, 0]));
    let counts = running.status()["ads"].clone();
    assert_eq!(counts["net_id"], "127.0.0.1.2.1");
    // The address by which this SubDevice was asked stands in its information.
    let shown = running.until("is shown", |report| report["devices"][2]["station"] == STEPPER);
    let info = &shown["devices"][2]["info"];
    assert_eq!(info["ads_address"], format!("127.0.0.1.2.1:{STEPPER}"), "{info}");
    assert_eq!(counts["requests"], counts["answers"], "{counts}");
    let expected = serde_json::json!({
        "0x700 general device error": 1, "0x701 service not supported": 1, "0x70C not found": 1,
    });
    assert_eq!(counts["refused"], expected);
    let table = linesman(["online", &running.socket()]);
    assert!(
        table.stdout.contains("ADS: ") && table.stdout.contains("of 1 client"),
        "{}",
        table.all()
    );
}

#[test]
fn all_subdevices_are_taken_to_a_state_at_once() {
    let (_running, address) = running(&[]);
    let mut client = Client::new(address);
    for state in [2_u16, 8] {
        assert_eq!(client.write(MAIN, index::MASTER_STATE, state.into(), &[]), 0);
        assert_eq!(client.words(index::DEVICE_STATES, 0), [state; 4]);
        assert_eq!(client.words(index::MASTER_STATE, 0x100), [state]);
    }
    assert_eq!(client.write(MAIN, index::MASTER_STATE, 5, &[]), 0x706);
}

#[test]
fn what_is_not_there_is_refused_by_its_code() {
    let (running, address) = running(&["--ads-net-id", "5.1.2.3.2.1"]);
    let mut client = Client::new(address);
    let (command, data) = AdsRequest::Read { group: 6, offset: 0, len: 2 }.to_bytes();
    assert_eq!(client.ask(MAIN, command, &data), (7, Vec::new()), "another NetId");
    client.net_id = AmsNetId([5, 1, 2, 3, 2, 1]);
    assert_eq!(client.words(index::DEVICE_COUNT, 0), [4]);
    assert_eq!(client.ask(851, command, &data).0, 6, "no such port");
    assert_eq!(client.ask(MAIN, 77, &data).0, 8, "no such command");
    for (group, offset, code) in
        [(0xF080, 1, 0x702), (0x99, 0, 0x702), (6, 1, 0x703), (9, 0x4321, 0x703), (0x11, 0, 0x703)]
    {
        assert_eq!(client.read(MAIN, group, offset, 4), Err(code), "{group:x}:{offset:x}");
    }
    assert_eq!(client.read(STEPPER, 0xF020, 0, 4), Err(0x702));
    assert_eq!(client.write(MAIN, 6, 0, &[1, 0]), 0x704);
    assert_eq!(client.write(MAIN, 9, STEPPER.into(), &[8]), 0x705);
    assert_eq!(client.write(MAIN, 9, STEPPER.into(), &[5, 0]), 0x706);
    // Notifications.
    assert_eq!(client.ask(MAIN, 6, &[0; 40]), (0, vec![0x01, 0x07, 0, 0, 0, 0, 0, 0]));
    // The data announced are not those that are there; the connection goes on.
    assert_eq!(client.ask(MAIN, command, &data[..8]).1[..4], [0x05, 0x07, 0, 0]);
    assert_eq!(client.words(index::DEVICE_COUNT, 0), [4]);
    assert_eq!(running.status()["ads"]["refused"]["0x702 invalid index group"], 3);
}

#[test]
fn read_only_server_changes_nothing() {
    let (running, address) = running(&["--ads-read-only"]);
    let mut client = Client::new(address);
    assert_eq!(client.words(index::DEVICE_COUNT, 0), [4]);
    assert_eq!(client.read(STEPPER, index::SDO, object(0x1018, 1), 4), Ok(vec![2, 0, 0, 0]));
    let station = u32::from(STEPPER);
    for (port, group, offset, data) in [
        (MAIN, index::MASTER_STATE, 2, &[][..]),
        (MAIN, index::DEVICE_STATES, station, &[2, 0]),
        (MAIN, index::FRAME_COUNTS, 0, &[]),
        (MAIN, index::CRC_COUNTS, 0, &[]),
        (STEPPER, index::SDO, object(0x8010, 1), &[1, 0]),
        (DRIVE, index::IDN, 0x0040_0020, &[1, 0]),
    ] {
        assert_eq!(client.write(port, group, offset, data), 0x704, "{group:x}:{offset:x}");
    }
    let register = [5, 0xFF, 0x03, 0x10, 0x20, 1, 2, 0, 0, 0, 1, 0, 0, 0];
    let write =
        AdsRequest::ReadWrite { group: index::DATAGRAM, offset: 0, len: 14, data: &register };
    assert_eq!(client.result(MAIN, &write).0, 0x704);
    assert_eq!(client.words(index::DEVICE_STATES, 0), [8; 4]);
    assert_eq!(running.status()["ads"]["read_only"], true);
}

/// A bridge that speaks AoE.
pub(crate) const BRIDGE: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"B1\"\ntype = \"EL6692\"\non = \"K1.B\"\n";
/// The NetId that a project gives it.
pub(crate) const BRIDGE_NET_ID: &str =
    "[[device.start_up]]\ntransition = \"IP\"\nnet_id = \"10.0.0.7.3.1\"\n";

#[test]
fn subdevice_with_a_net_id_is_reached_by_it_and_by_the_command_line() {
    for read_only in [false, true] {
        let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let listen = address.to_string();
        let options = ["--ads", &listen, "--ads-read-only"];
        let project = project_of(BRIDGE, BRIDGE_NET_ID);
        let options = &options[..2 + usize::from(read_only)];
        let running = Running::with_files(BRIDGE, &[("project.toml", &project)], options);
        let mut client = Client::new(address);
        client.net_id = AmsNetId([10, 0, 0, 7, 3, 1]);
        assert_eq!(client.read(MAIN, index::SDO, object(0x1018, 1), 4), Ok(vec![2, 0, 0, 0]));
        assert_eq!(client.read(0x1000, index::SDO, object(0x1008, 0), 4), Ok(b"EL66".to_vec()));
        assert_eq!(client.result(MAIN, &AdsRequest::State), (0, vec![5, 0, 8, 0]));
        let (result, info) = client.result(MAIN, &AdsRequest::DeviceInfo);
        assert_eq!((result, &info[4..10]), (0, &b"EL6692"[..]));
        assert_eq!(client.read(MAIN, index::SDO, object(0x5555, 0), 4), Err(0x70C));
        assert_eq!(client.read(851, index::SDO, object(0x1018, 1), 4), Err(0x6));
        let written = client.write(MAIN, index::SDO, object(0x10F1, 2), &[8, 0]);
        assert_eq!(written, if read_only { 0x704 } else { 0 });
        // Notifications are not passed on.
        assert_eq!(client.ask(MAIN, 6, &[0; 40]).1[..4], [0x01, 0x07, 0, 0]);
        client.net_id = AmsNetId([10, 0, 0, 7, 4, 1]);
        let (command, data) = AdsRequest::Read { group: 6, offset: 0, len: 2 }.to_bytes();
        assert_eq!(client.ask(MAIN, command, &data), (7, Vec::new()), "nobody's NetId");
        running.until("tells its NetId", |report| report["devices"][1]["net_id"] == "10.0.0.7.3.1");
        let socket = running.socket();
        let read = linesman(["aoe", &socket, "2", "read", "0xF302", "0x10180001", "--json"]);
        assert_eq!(read.json()["data"], "02000000", "{}", read.all());
        crate::support::assert_valid(&read.json(), "ads");
        let refused = linesman([
            "aoe",
            &socket,
            "2",
            "read",
            "0x99",
            "0",
            "--net-id",
            "1.2.3.4.5.6",
            "--json",
        ]);
        assert_eq!((refused.status, &refused.json()["kind"]), (1, &"ads-error".into()));
        assert_eq!(refused.json()["code"], 7, "{}", refused.all());
    }
}

#[test]
fn garbage_half_messages_and_floods_leave_the_line_alone() {
    let (running, address) = running(&[]);
    let mut last = Vec::new();
    for bytes in [
        &[0xFF; 200][..],
        &[0, 0x10, 2, 0, 0, 0, 0, 0],
        &[0, 0, 0xFF, 0xFF, 0xFF, 0xFF, 1],
        &[0, 0, 31, 0, 0, 0],
        &[0, 0, 32, 0],
        &[0, 0, 32, 0, 0, 0, 1, 2, 3],
    ] {
        let mut stream = TcpStream::connect(address).unwrap();
        stream.write_all(bytes).unwrap();
        last.push(stream);
    }
    // An answer is not answered, and a message that is cut short within is.
    let mut client = Client::new(address);
    let target = AmsAddress { net_id: NET_ID, port: MAIN };
    let answer = AmsHeader { flags: 5, ..AmsHeader::request(target, target, 2, 1) };
    client.stream.write_all(&answer.frame(&[0; 12])).unwrap();
    let mut short = AmsHeader::request(target, target, 2, 1).frame(&[0; 12]);
    short[26] = 200;
    client.stream.write_all(&short).unwrap();
    let mut refused = [0; 38];
    client.stream.read_exact(&mut refused).unwrap();
    assert_eq!(refused[30..34], [0x0E, 0, 0, 0]);
    assert_eq!(client.words(index::DEVICE_COUNT, 0), [4]);
    // Faster than is allowed: refused as busy, and each is answered.
    let flood: Vec<u8> = (0..3_000_u32)
        .flat_map(|number| {
            let (command, data) = AdsRequest::Read { group: 6, offset: 0, len: 2 }.to_bytes();
            AmsHeader::request(target, target, command, number).frame(&data)
        })
        .collect();
    let mut reader = client.stream.try_clone().unwrap();
    let answers = std::thread::spawn(move || {
        let mut busy = 0;
        for number in 0..3_000_u32 {
            let mut head = [0; 46];
            reader.read_exact(&mut head).unwrap();
            assert_eq!(head[34..38], number.to_le_bytes());
            let result = u32::from_le_bytes(head[38..42].try_into().unwrap());
            let len = u32::from_le_bytes(head[42..46].try_into().unwrap());
            reader.read_exact(&mut vec![0; len as usize]).unwrap();
            assert!([0, 0x708].contains(&result), "{result:x}");
            busy += u32::from(result == 0x708);
        }
        busy
    });
    client.stream.write_all(&flood).unwrap();
    assert!(answers.join().unwrap() > 0);
    let report = running.until("is still up", |report| report["state"]["word"] == 0);
    assert_eq!(report["cyclic"]["lost"], 0);
    let malformed = report["ads"]["refused"]["malformed"].as_u64().unwrap();
    assert!(malformed >= 5, "{}", report["ads"]);
}

#[test]
fn server_for_other_computers_names_whom_it_serves() {
    let refused = linesman(["run", "--on", "sim:none.toml", "--ads", "0.0.0.0"]);
    assert_eq!(refused.status, 2, "{}", refused.all());
    let wrong =
        linesman(["run", "--on", "sim:none.toml", "--ads", "127.0.0.1", "--ads-net-id", "1.2.3"]);
    assert!(wrong.all().contains("192.168.1.5.2.1"), "{}", wrong.all());
}
