//! Protocols that pass the mailbox gateway, and the gateway of a project.

use std::net::TcpStream;

use linesman_proto::mailbox::foe::Message as FoeMessage;
use linesman_proto::mailbox::{ErrorReply, ErrorReplyCode, MailboxType};
use tempfile::TempDir;

use super::{UdpClient, counted, frame, free_address, tcp_ask};
use crate::support::linesman;
use crate::support::running::Running;

/// A terminal that speaks CoE, FoE and EoE, and a drive that speaks SoE.
const PROTOCOLS: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"C1\"\ntype = \"EL6601\"\non = \"K1.B\"\n\
[[device]]\nname = \"X1\"\ntype = \"AX5103-0012\"\non = \"K1.C\"\n";

const FIRST: u16 = 0x1002;
const DRIVE: u16 = 0x1003;

// S0 L3071. The project says that there is a gateway, no option does.
// proves: MBG-02 (S)
#[test]
fn coe_soe_foe_and_voe_pass_and_eoe_does_not() {
    let address = free_address();
    let folder = TempDir::new().unwrap();
    let (plant, project) = (folder.path().join("plant.toml"), folder.path().join("machine.toml"));
    std::fs::write(&plant, PROTOCOLS).unwrap();
    let on = format!("sim:{}", plant.display());
    let saved = linesman(["scan", &on, "--save", project.to_str().unwrap()]);
    assert_eq!(saved.status, 0, "{}", saved.all());
    let text = std::fs::read_to_string(&project).unwrap();
    let at = text.find("[[device]]").unwrap();
    let table = format!("[gateway]\nlisten = \"{address}\"\nallow = [\"10.0.0.0/8\"]\n\n");
    let project = [&text[..at], &table, &text[at..]].concat();
    let running = Running::with(PROTOCOLS, &[("machine.toml", &project)]);
    let client = UdpClient::new(address);
    assert_eq!(client.number(FIRST, 0x1018, 1), 2);
    // The drive has no S-0-0052, and says so itself (SoE error 0x1001), read and written.
    let (read, written) = ([0x01, 0x40, 52, 0], [0x03, 0x40, 52, 0, 9, 9]);
    let answer = client.ask(MailboxType::Soe, DRIVE, 4, &read);
    assert_eq!(answer, [0x12, 0x40, 52, 0, 0x01, 0x10]);
    let answer = client.ask(MailboxType::Soe, DRIVE, 5, &written);
    assert_eq!(answer, [0x14, 0x40, 52, 0, 0x01, 0x10]);
    let mut stream = TcpStream::connect(address).unwrap();
    let (header, data) = tcp_ask(&mut stream, &frame(MailboxType::Soe, DRIVE, 6, &read));
    assert_eq!((header.kind, header.counter.value()), (MailboxType::Soe, 6));
    assert_eq!(data, [0x12, 0x40, 52, 0, 0x01, 0x10]);
    let mut body = vec![0; 64];
    let len = FoeMessage::Read { password: 0, name: b"nothing.txt" }.write(&mut body).unwrap();
    let answer = client.ask(MailboxType::Foe, FIRST, 2, &body[..len]);
    assert!(matches!(FoeMessage::parse(&answer), Ok(FoeMessage::Error { .. })), "{answer:02x?}");
    // It says itself that it speaks no VoE.
    client.send(MailboxType::Voe, FIRST, 6, &[0; 8]);
    let (header, data) = client.receive().expect("an answer");
    assert_eq!((header.kind, header.counter.value()), (MailboxType::Error, 6));
    assert_eq!(ErrorReply::parse(&data).unwrap().code, ErrorReplyCode::UnsupportedProtocol);
    // It speaks EoE, and is not asked.
    client.send(MailboxType::Eoe, FIRST, 1, &[0x06, 0x01, 0, 0]);
    let gateway = counted(&running, |gateway| gateway["requests"] == 7);
    assert_eq!(gateway["refused"], serde_json::json!({ "protocol": 1 }), "{gateway}");
    assert_eq!((&gateway["answers"], &gateway["read_only"]), (&6.into(), &false.into()));
}

#[test]
fn gateway_of_a_project_that_cannot_be_opened_is_refused_with_its_key() {
    let folder = TempDir::new().unwrap();
    let (plant, project) = (folder.path().join("plant.toml"), folder.path().join("machine.toml"));
    std::fs::write(&plant, PROTOCOLS).unwrap();
    let on = format!("sim:{}", plant.display());
    for (keys, told) in [
        ("listen = \"localhost\"", "`listen = \"localhost\"` in [gateway]"),
        (
            "listen = \"127.0.0.1\"\nallow = [\"10.0.0.0/33\"]",
            "`allow = \"10.0.0.0/33\"` in [gateway]",
        ),
        ("listen = \"0.0.0.0\"", "none is allowed to ask"),
        ("read_only = true", "missing field `listen`"),
    ] {
        let text = format!("name = \"m\"\n[gateway]\n{keys}\n");
        std::fs::write(&project, text).unwrap();
        let run = linesman(["run", project.to_str().unwrap(), "--on", &on, "--seconds", "1"]);
        assert_eq!(run.status, 2, "{keys}: {}", run.all());
        assert!(run.stderr.contains(told), "{keys}: {}", run.all());
    }
}
