//! Devices that are not the planned ones, by what a hand-made line says of itself.

use linesman_config::fault::FaultName;
use linesman_config::project::Project;
use linesman_diagnosis::model::{NetworkModel, Seen, SeenIdentity};
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::report::{FindingReport, PlaceReport};
use linesman_diagnosis::{Diagnosis, Engine, Setup};
use linesman_proto::address::{DeviceId, Network};
use linesman_proto::port::Port;
use linesman_proto::register::{DlStatus, PortState};
use linesman_proto::time::{Instant, Span};

/// A line of devices with these product codes, as a project or as an observation file.
fn text(products: &[u32], state: &str) -> String {
    let mut text = String::new();
    for (index, product) in products.iter().enumerate() {
        let no = index + 1;
        let on = if index == 0 { "maindevice".to_owned() } else { format!("D{index}.B") };
        text += &format!(
            "[[device]]\nname = \"D{no}\"\non = \"{on}\"\nvendor_id = 2\nproduct_code = {product}\n\
             revision = 0x00120000\n{state}\n"
        );
    }
    text
}

fn judge(planned: &[u32], found: &[u32]) -> Diagnosis {
    let project = Project::parse(&text(planned, "")).unwrap();
    let file = ObservationFile::parse(&text(found, "state = \"OP\"")).unwrap();
    file.diagnosis(Setup { project: Some(project), ..Setup::default() })
}

fn no(finding: &FindingReport) -> u32 {
    device(&finding.place)
}

fn device(place: &PlaceReport) -> u32 {
    let PlaceReport::Device { no, .. } = place else { panic!("{place:?}") };
    *no
}

#[test]
fn the_planned_devices_are_no_finding() {
    assert_eq!(judge(&[1, 2, 3, 4], &[1, 2, 3, 4]).findings, []);
}

#[test]
fn another_device_is_named_with_both_identities() {
    let diagnosis = judge(&[1, 2, 3, 4], &[1, 2, 0x99, 4]);
    assert_eq!(diagnosis.findings.len(), 1, "{:#?}", diagnosis.findings);
    let finding = &diagnosis.findings[0];
    assert_eq!((no(finding), finding.cause), (3, FaultName::DeviceWrong));
    let text = &finding.evidence[0].text;
    assert!(text.contains("0x00000099") && text.contains("0x00000003"), "{text}");
}

/// What a scan by positions has found: products in the order of processing, and on a line the ports in use,
/// where they were read.
fn scanned(planned: &[u32], found: &[u32], has_ports: bool) -> Diagnosis {
    let project = Project::parse(&text(planned, "")).unwrap();
    let mut model = NetworkModel::planned(Network(0), &project);
    let at = Instant::ZERO + Span::ms(1);
    while model.devices.len() < found.len() {
        model.add_device();
    }
    for (index, product) in found.iter().enumerate() {
        let device = model.device_mut(DeviceId(index as u32)).unwrap();
        let read = |value| Some(Seen::new(value, at, None));
        device.identity = SeenIdentity {
            vendor_id: read(2),
            product_code: read(*product),
            revision: read(0x0012_0000),
            serial: read(0),
        };
        if has_ports {
            let ports = if index + 1 < found.len() { &[Port::A, Port::B][..] } else { &[Port::A] };
            let status = ports.iter().fold(DlStatus::default(), |status, port| {
                status.with_port(*port, PortState::IN_USE)
            });
            device.dl.record(status, at, None);
        }
        device.answers(at, None);
    }
    model.traffic.broadcasts.record_positions(found.len() as u16);
    model.now = at;
    model.touch();
    Engine::with_line(Setup { project: Some(project), ..Setup::default() }, model).diagnosis()
}

/// Findings by place, code and cause.
fn said(diagnosis: &Diagnosis) -> Vec<(u32, &str, FaultName)> {
    diagnosis.findings.iter().map(|one| (no(one), one.code.as_str(), one.cause)).collect()
}

/// Where nothing is known of ports, those behind have moved up.
// fires: C302
// silent: C301
#[test]
fn one_too_few_is_one_finding_and_not_all_that_moved_up() {
    let diagnosis = scanned(&[1, 2, 3, 4, 5], &[1, 3, 4, 5], false);
    assert_eq!(said(&diagnosis), [(2, "C302", FaultName::DeviceMissing)]);
}

/// Where nothing is known of ports, those behind are further on than planned.
// fires: C303
// silent: C301
#[test]
fn one_too_many_is_one_finding_and_not_all_that_moved_on() {
    let diagnosis = scanned(&[1, 3, 4, 5], &[1, 2, 3, 4, 5], false);
    assert_eq!(said(&diagnosis), [(2, "C303", FaultName::DeviceExtra)]);
}

/// Of equal ones in a row anyone may be missing: the finding names all of them, equally sure, and none beyond
/// the row.
// fires: C302
#[test]
fn of_equals_in_a_row_any_may_be_missing() {
    let diagnosis = scanned(&[1, 2, 2, 2, 3, 2], &[1, 2, 2, 3, 2], true);
    let [(first, "C302", FaultName::DeviceMissing)] = said(&diagnosis)[..] else {
        panic!("{:#?}", diagnosis.findings);
    };
    let finding = &diagnosis.findings[0];
    let others =
        finding.alternatives.iter().filter(|other| other.cause == FaultName::DeviceMissing);
    let places: Vec<u32> =
        others.clone().map(|other| device(other.place.as_ref().unwrap())).collect();
    let mut all = places;
    all.push(first);
    all.sort_unstable();
    assert_eq!(all, [2, 3, 4]);
    for other in others {
        assert!((other.confidence - finding.confidence).abs() < 0.011, "{finding:#?}");
    }
}

#[test]
fn two_devices_in_each_others_place_are_swapped() {
    let diagnosis = judge(&[1, 2, 3, 4], &[1, 4, 3, 2]);
    let causes: Vec<_> = diagnosis.findings.iter().map(|f| (no(f), f.cause)).collect();
    assert_eq!(causes, [(2, FaultName::DevicesSwapped), (4, FaultName::DevicesSwapped)]);
}
