use std::cell::RefCell;
use std::sync::Arc;

use linesman_proto::ads::{AdsAnswer, AdsCode, AdsRequest, AmsAddress, AmsNetId, index};

use super::own_net_id;
use super::services::{AdsNetwork, AdsServices};
use crate::online::report::{OnlineDevice, OnlineMailbox, OnlineReport};
use crate::service::message::{Answer, Asked, RefusalCode, Request};

const MAIN: u16 = AmsAddress::MAIN_DEVICE_PORT;

/// A network that answers each service as it is told, and keeps what was asked.
#[derive(Default)]
struct Network {
    report: Option<Arc<OnlineReport>>,
    answer: Answer,
    asked: RefCell<Vec<Request>>,
    abort: RefCell<u32>,
}

impl AdsNetwork for Network {
    fn report(&self) -> Option<Arc<OnlineReport>> {
        self.report.clone()
    }

    fn ask(&self, requests: Vec<Request>) -> Vec<Result<Answer, AdsCode>> {
        let answers = requests.iter().map(|_| Ok(self.answer.clone())).collect();
        self.asked.borrow_mut().extend(requests);
        answers
    }

    fn topology(&self) -> Option<Vec<u8>> {
        None
    }

    fn last_abort(&self, _: u16) -> u32 {
        *self.abort.borrow()
    }

    fn set_last_abort(&self, _: u16, code: u32) {
        *self.abort.borrow_mut() = code;
    }
}

fn device(no: u32, state: &str, present: bool) -> OnlineDevice {
    OnlineDevice {
        no,
        station: 0x1000 + no as u16,
        auto_increment: 1_u16.wrapping_sub(no as u16),
        al_state: Some(state.to_owned()),
        present: Some(present),
        mailbox: Some(OnlineMailbox::default()),
        ..OnlineDevice::default()
    }
}

fn network(devices: Vec<OnlineDevice>) -> Network {
    let present = devices.len() as u32;
    let report = OnlineReport { devices, present, ..OnlineReport::default() };
    Network { report: Some(Arc::new(report)), ..Network::default() }
}

fn answer(network: &Network, port: u16, request: &AdsRequest<'_>) -> Result<AdsAnswer, AdsCode> {
    let net_id = AmsNetId([1, 2, 3, 4, 2, 1]);
    AdsServices { network, net_id, read_only: false }.answer(port, request)
}

#[test]
fn one_subdevice_that_fell_back_does_not_take_the_state_of_the_network_with_it() {
    let read = AdsRequest::Read { group: index::MASTER_STATE, offset: 0x100, len: 2 };
    for (devices, state) in [
        (vec![device(1, "OP", true), device(2, "PREOP", true)], 8),
        (vec![device(1, "SAFEOP", true), device(2, "OP", false)], 4),
        (vec![OnlineDevice { target: Some("OP".to_owned()), ..device(1, "INIT", false) }], 8),
        (vec![], 1),
    ] {
        let told = answer(&network(devices), MAIN, &read);
        assert_eq!(told, Ok(AdsAnswer::Read(vec![state, 0])));
    }
}

#[test]
fn before_the_line_is_up_it_says_so() {
    let early = Network::default();
    let read = AdsRequest::Read { group: index::DEVICE_COUNT, offset: 0, len: 2 };
    let refused = Ok(AdsAnswer::Refused(AdsCode::NOT_READY));
    assert_eq!(answer(&early, MAIN, &read), refused);
    assert_eq!(answer(&early, 0x1001, &read), refused);
    let state = AdsAnswer::State { ads: AdsAnswer::INIT, device: 1 };
    assert_eq!(answer(&early, MAIN, &AdsRequest::State), Ok(state));
}

#[test]
fn no_more_is_given_than_the_client_has_room_for() {
    let network = network(vec![device(1, "OP", true), device(2, "OP", true)]);
    let read = |len| {
        let read = AdsRequest::Read { group: index::STATION_ADDRESSES, offset: 0, len };
        answer(&network, MAIN, &read)
    };
    assert_eq!(read(u32::MAX), Ok(AdsAnswer::Read(vec![1, 0x10, 2, 0x10])));
    assert_eq!(read(3), Ok(AdsAnswer::Read(vec![1, 0x10, 2])));
    assert_eq!(read(0), Ok(AdsAnswer::Read(Vec::new())));
}

#[test]
fn objects_are_asked_by_index_subindex_and_completeness_of_the_offset() {
    let mut network = network(vec![device(1, "OP", true), device(2, "INIT", true)]);
    network.answer.data = Some("0a00".to_owned());
    let read = AdsRequest::Read { group: index::SDO, offset: 0x1018_0102, len: 8 };
    assert_eq!(answer(&network, 0x1001, &read), Ok(AdsAnswer::Read(vec![10, 0])));
    let service = Asked::Upload { index: 0x1018, subindex: 2, complete: true };
    assert_eq!(*network.asked.borrow(), [Request::Serve { no: 1, service }]);
    // Its mailbox is closed: nothing is asked.
    let refused = AdsAnswer::Refused(AdsCode::INVALID_STATE);
    assert_eq!(answer(&network, 0x1002, &read), Ok(refused));
    assert_eq!(answer(&network, 0x1003, &read), Err(AdsCode::PORT_NOT_FOUND));
    assert_eq!(network.asked.borrow().len(), 1);
    // An abort is kept until an access is good.
    let last = AdsRequest::Read { group: index::LAST_SDO_ERROR, offset: 0, len: 20 };
    let aborted = |network: &Network| match answer(network, 0x1001, &last) {
        Ok(AdsAnswer::Read(data)) => data[16..20].to_vec(),
        other => panic!("{other:?}"),
    };
    let good = network.answer.clone();
    network.answer.error = Some("aborted".to_owned());
    let code = 0x0609_0011;
    network.answer.refusal = Some(RefusalCode { kind: "sdo-abort".to_owned(), code });
    let refused = AdsAnswer::Refused(AdsCode::BAD_INDEX_OFFSET);
    assert_eq!(answer(&network, 0x1001, &read), Ok(refused));
    assert_eq!(aborted(&network), code.to_le_bytes());
    network.answer = good;
    answer(&network, 0x1001, &read).unwrap();
    assert_eq!(aborted(&network), [0; 4]);
}

#[test]
fn datagrams_to_one_subdevice_become_services_for_registers() {
    let mut network = network(vec![device(1, "OP", true), device(2, "OP", true)]);
    network.answer.data = Some("3412".to_owned());
    let ask = |data: &[u8]| {
        let asked = AdsRequest::ReadWrite { group: index::DATAGRAM, offset: 0, len: 99, data };
        answer(&network, MAIN, &asked)
    };
    // FPRD 0x1002:0x0130, two bytes.
    let read = [4, 0xFF, 2, 0x10, 0x30, 1, 2, 0, 0, 0, 0, 0, 0, 0];
    let mut back = read;
    back[10..].copy_from_slice(&[0x34, 0x12, 1, 0]);
    assert_eq!(ask(&read), Ok(AdsAnswer::Read(back.to_vec())));
    let service = Asked::ReadRegister { address: 0x130, len: 2 };
    assert_eq!(*network.asked.borrow(), [Request::Serve { no: 2, service }]);
    // APRD of a place where nobody is: counted on by the two that are there, and not answered.
    let nobody = [1, 0xFF, 0xF0, 0xFF, 0, 0, 1, 0, 0, 0, 7, 0, 0];
    let mut back = nobody;
    back[2] = 0xF2;
    assert_eq!(ask(&nobody), Ok(AdsAnswer::Read(back.to_vec())));
    let refused = Ok(AdsAnswer::Refused(AdsCode::BAD_DATA));
    let brd = [7, 0xFF, 0, 0, 0x30, 1, 2, 0, 0, 0, 0, 0, 0, 0];
    for wrong in [&brd[..], &read[..13], &[], &[4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]] {
        assert_eq!(ask(wrong), refused, "{wrong:?}");
    }
}

#[test]
fn main_device_has_the_net_id_of_its_address() {
    for (address, net_id) in [
        ("192.168.1.5", "192.168.1.5.2.1"),
        ("::ffff:10.0.0.1", "10.0.0.1.2.1"),
        ("0.0.0.0", "127.0.0.1.2.1"),
        ("fe80::1", "127.0.0.1.2.1"),
    ] {
        assert_eq!(own_net_id(address.parse().unwrap()).to_string(), net_id, "{address}");
    }
}
