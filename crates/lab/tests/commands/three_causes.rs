//! One symptom, three causes: what is told apart although it looks the same at first.

use linesman_config::fault::FaultName;
use linesman_diagnosis::report::{Diagnosis, Severity};
use linesman_lab::lab::Lab;
use linesman_lab::options::LabOptions;
use linesman_proto::address::Network;
use linesman_proto::time::Span;
use linesman_sim::segment_file::SegmentFile;

const LINE: &str = r#"
name = "press"
seed = 5

[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
cable_m = 5.0

[[device]]
name = "T1"
type = "EL3102"
on = "K1.B"

[[device]]
name = "T2"
type = "EL4102"
on = "T1.B"

[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
cable_m = 20.0

[[device]]
name = "T3"
type = "EL2008"
on = "K2.B"
"#;

/// A line with a fault that has lasted for three seconds: whether two places go together takes ten readings.
fn broken(text: &str, clocks: bool) -> Lab {
    let file = SegmentFile::parse(&format!("{LINE}\n[[fault]]\n{text}")).unwrap();
    let fault = file.faults[0].clone();
    let file = SegmentFile { faults: Vec::new(), ..file };
    let options = LabOptions { clocks, ..LabOptions::default() };
    let mut lab = Lab::new(&file, options).unwrap();
    lab.wait_up(Span::s(30)).unwrap();
    lab.run_until(lab.now() + Span::s(1)).unwrap();
    let id = lab.inject(&fault).unwrap();
    lab.run_until(lab.now() + Span::s(3)).unwrap();
    assert!(lab.truth().fault(id).unwrap().first_effect.is_some(), "{text}");
    lab
}

/// What is said of it.
fn said(text: &str, clocks: bool) -> Diagnosis {
    broken(text, clocks).diagnosis()
}

fn first_cause(diagnosis: &Diagnosis) -> Option<FaultName> {
    let warned = diagnosis.findings.iter().find(|f| f.severity != Severity::Info);
    warned.map(|finding| finding.cause)
}

// S3 L4-8: interference from outside, a device that spoils frames, firmware that fails.
// proves: DIA-03 partial: that it is known within the cycle is shown in fast.rs
#[test]
fn interference_device_and_firmware_are_told_apart() {
    for (text, cause) in [
        (
            "kind = 'emc-noise'\nat = ['maindevice-K1.A', 'K1.C-K2.A']\nhits_per_s = 400",
            FaultName::EmcNoise,
        ),
        ("kind = 'device-internal'\ndevice = 'K2'\nhits_per_s = 40", FaultName::DeviceInternal),
        ("kind = 'firmware-fault'\ndevice = 'T2'\nhow = 'restarts'", FaultName::FirmwareFault),
    ] {
        assert_eq!(first_cause(&said(text, false)), Some(cause), "{text}");
    }
}

// S3 L76: off or disconnected, firmware that fails, a cycle that firmware cannot follow.
// proves: FRM-20
#[test]
fn who_is_gone_whose_firmware_fails_and_whose_cycle_is_too_fast_are_told_apart() {
    use FaultName::{CycleTooFast, DeviceOff, FirmwareFault, LinkOpen, SupplyOff};
    for (text, causes, lowers) in [
        // Nobody can tell these apart as long as it is gone.
        ("kind = 'device-off'\ndevice = 'T2'", &[DeviceOff, LinkOpen, SupplyOff][..], true),
        ("kind = 'firmware-fault'\ndevice = 'T2'\nhow = 'memory-blocked'", &[FirmwareFault], true),
        ("kind = 'cycle-too-fast'\ndevice = 'T2'\nneeds_us = 9000.0", &[CycleTooFast], true),
        // Without the symptom: buffers that were left open go on being served by the controller.
        ("kind = 'firmware-fault'\ndevice = 'T2'\nhow = 'hangs'", &[FirmwareFault], false),
    ] {
        let lab = broken(text, true);
        let line = lab.engine().model(Network(0)).unwrap();
        let is_low = line.cyclic.iter().any(|cyclic| !cyclic.wkc.deficits().is_empty());
        let diagnosis = lab.diagnosis();
        let said: Vec<_> =
            diagnosis.findings.iter().map(|f| (&f.code, f.cause, &f.place)).collect();
        assert_eq!(is_low, lowers, "{text}: {said:?}");
        let first = first_cause(&diagnosis);
        assert!(first.is_some_and(|cause| causes.contains(&cause)), "{text}: {said:?}");
    }
}
