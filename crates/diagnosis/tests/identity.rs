//! Devices that are not the planned ones, by what a hand-made line says of itself.

#![allow(clippy::unwrap_used, reason = "helpers of tests")]

use linesman_config::fault::FaultName;
use linesman_config::project::Project;
use linesman_diagnosis::observation_file::ObservationFile;
use linesman_diagnosis::report::{FindingReport, PlaceReport};
use linesman_diagnosis::{Diagnosis, Setup};

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
    let PlaceReport::Device { no, .. } = finding.place else { panic!("{finding:?}") };
    no
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

#[test]
fn two_devices_in_each_others_place_are_swapped() {
    let diagnosis = judge(&[1, 2, 3, 4], &[1, 4, 3, 2]);
    let causes: Vec<_> = diagnosis.findings.iter().map(|f| (no(f), f.cause)).collect();
    assert_eq!(causes, [(2, FaultName::DevicesSwapped), (4, FaultName::DevicesSwapped)]);
}
