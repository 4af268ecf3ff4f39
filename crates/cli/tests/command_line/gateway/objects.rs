//! Objects of the MainDevice that clients of the mailbox gateway write, and the gateway's counts in `linesman online`.

use linesman_proto::mailbox::MailboxType;
use linesman_proto::mailbox::coe::sdo::{Abort, Initial, Request, Response};
use linesman_proto::mailbox::coe::{Message as CoeMessage, ObjectAddress};

use super::{NOBODY, STEPPER, UdpClient, coe, counted, running, upload_of};
use crate::support::linesman;

/// The answer to a download.
fn download(client: &UdpClient, object: ObjectAddress, data: &[u8]) -> Vec<u8> {
    let initial = Initial::of(data, 128);
    let request = Request::Download { object, complete: false, initial };
    client.ask(MailboxType::Coe, 0, 4, &coe(CoeMessage::SdoRequest(request)))
}

/// The bytes of an object at address 0.
fn bytes(client: &UdpClient, index: u16, subindex: u8) -> Vec<u8> {
    let answer = client.ask(MailboxType::Coe, 0, 3, &upload_of(index, subindex));
    let Ok(CoeMessage::SdoResponse(Response::Upload { initial, .. })) = CoeMessage::parse(&answer)
    else {
        panic!("{answer:02x?}")
    };
    initial.data().to_vec()
}

#[test]
fn clients_detect_subdevices_and_let_counts_begin_at_0() {
    let (_running, address) = running(&[]);
    let client = UdpClient::new(address);
    assert_eq!([0, 1, 2].map(|at| client.number(0, 0x1C00, at)), [2, 1, 2]);
    assert_eq!(client.number(0, 0xF002, 2), 0, "no command was given");
    let command = ObjectAddress::new(0xF002, 1);
    let taken = |object| CoeMessage::SdoResponse(Response::Download { object, complete: false });
    let answer = download(&client, command, &[1, 0]);
    assert_eq!(CoeMessage::parse(&answer), Ok(taken(command)));
    assert_eq!(client.number(0, 0xF002, 2), 1, "done");
    assert_eq!(bytes(&client, 0xF002, 3), [1, 0, 4, 0, 0, 0], "four are there");
    // Another client sees the same.
    assert_eq!(UdpClient::new(address).number(0, 0xF002, 2), 1);
    // Each SubDevice came once: it was never away, but has changed to being there.
    let reset = ObjectAddress::new(0xF200, 16);
    let answer = download(&client, reset, &[1]);
    assert_eq!(CoeMessage::parse(&answer), Ok(taken(reset)));
    assert_eq!(client.number(0, 0xF200, 16), 0, "a command, no setting");
    assert_eq!(client.number(0, 0xF120, 1), 0);
}

#[test]
fn read_only_gateway_takes_no_commands_either() {
    let (running, address) = running(&["--gateway-read-only"]);
    let client = UdpClient::new(address);
    let object = ObjectAddress::new(0xF200, 16);
    let answer = download(&client, object, &[1]);
    let abort = CoeMessage::Abort(Abort { object, code: 0x0601_0002 });
    assert_eq!(CoeMessage::parse(&answer), Ok(abort));
    let expected = serde_json::json!({ "read-only": 1 });
    counted(&running, |gateway| gateway["refused"] == expected);
}

#[test]
fn online_shows_what_went_through_the_gateway() {
    let (running, address) = running(&[]);
    let (first, second) = (UdpClient::new(address), UdpClient::new(address));
    assert_eq!(first.number(STEPPER, 0x1018, 1), 2);
    assert_eq!(second.number(0, 0xF020, 0), 4);
    second.send(MailboxType::Coe, NOBODY, 2, &upload_of(0x1018, 1));
    counted(&running, |gateway| gateway["refused"]["unknown-station"] == 1);
    let online = linesman(["online", &running.socket(), "--json"]);
    let gateway = &online.json()["gateway"];
    assert_eq!(gateway["listen"], address.to_string(), "{}", online.all());
    assert_eq!((&gateway["clients"], &gateway["requests"]), (&2.into(), &3.into()));
    assert_eq!((&gateway["answers"], &gateway["read_only"]), (&2.into(), &false.into()));
    let text = linesman(["online", &running.socket()]);
    let line = "Mailbox gateway: 3 requests of 2 clients, 2 answers, 1 refused or not answered (unknown-station 1).";
    assert!(text.stdout.contains(line), "{}", text.all());
}
