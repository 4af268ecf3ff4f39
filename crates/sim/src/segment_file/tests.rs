use std::collections::BTreeSet;

use linesman_config::fault::FaultName;
use linesman_proto::port::Port;
use linesman_proto::topology::End;

use super::*;
use crate::seed::Seed;

const PLANT: &str = r#"
name = "plant \"7\""
seed = 7
old_counters = true
counts_forwarded = false
noise_at_link_up = 2.5

[[supply]]
name = "PS1"
devices = ["K1", "K3"]

[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
cable_m = 5.0
medium = "converters"
remakes_symbol_errors = true
counters = { "A.physical" = 3, processing_unit = 1 }

[[device]]
name = "Term 2 (EL2008)"
type = "EL2008"
on = "K1.B"

[[device]]
name = "K3"
type = "EK1101"
on = "K1.C"
entry = "A"
cable_m = 12
id = 300
clock_ppm = -3.5
clock = { ramp_ppm_per_s = 0.25, ramp_s = 40.0, jitter_ns = 12 }
counts_forwarded = true

[ring]
closes_at = "K3.C"
cable_m = 30.0

[[fault]]
kind = "emc-noise"
at = ["K1.C>K3.A", "maindevice-K1.A"]
from_ms = 2000
to_ms = 5000
hits_per_s = 40.0

[[fault]]
kind = "supply-off"
devices = ["K1", "K3"]

[[fault]]
kind = "brown-out"
supply = "PS1"

[[fault]]
kind = "init-refused"
device = "Term 2 (EL2008)"
to = "OP"
code = 27

[[fault]]
kind = "link-open"
at = "K1.C-K3.A"
at_ms = [10.0, 200.5]
for_ms = 3.0
times = 7
burst = { count = 3, every_ms = 20.0 }

[[fault]]
kind = "device-off"
device = "K3"
random = { mean_ms = 500.0, for_ms = 20.0 }
"#;

#[test]
fn a_file_reads_and_writes_itself() {
    let file = SegmentFile::parse(PLANT).unwrap();
    assert_eq!(SegmentFile::parse(&file.to_toml()), Ok(file.clone()));
    assert_eq!((file.seed, file.devices.len(), file.faults.len()), (Some(7), 3, 6));
    assert_eq!(file.devices[2].cable_m, Some(12.0));
    assert_eq!(file.devices[0].counters["A.physical"], 3);
    let noise = &file.faults[0];
    assert_eq!(noise.at.as_ref().unwrap().as_slice().len(), 2);
    assert_eq!((noise.from_ms, noise.to_ms), (Some(2000.0), Some(5000.0)));
    assert_eq!(noise.parameters["hits_per_s"], Value::Number(40.0));
    assert_eq!(file.faults[3].parameters["code"], Value::Integer(27));
}

#[test]
fn mistakes_are_named() {
    let table = [
        ("cable_m = 5.0", "cabel_m = 5.0", "unknown field `cabel_m`"),
        ("seed = 7", "sead = 7", "line 3"),
        ("\"EL2008\"", "\"EL9999\"", "device `Term 2 (EL2008)`: device type \"EL9999\""),
        ("\"K1.B\"", "\"K9.B\"", "no device is called `K9`"),
        ("\"K1.B\"", "\"K1.C\"", "`K1.C` is wired twice, to `Term 2 (EL2008)` and `K3`"),
        ("\"K1.B\"", "\"K1.D\"", "device `K1` has no port D: a EK1100 has A, B, C"),
        ("on = \"K1.C\"", "on = \"K1.B\"", "wired twice"),
        ("on = \"K1.B\"", "on = \"K3.C\"", "the ring cannot close at `K3.C`"),
        ("on = \"K1.C\"", "on = \"Term 2 (EL2008).B\"", "Term 2 (EL2008).B is an E-bus contact"),
        ("entry = \"A\"", "entry = \"X\"", "`entry` is `X`, expected A, B, C or D"),
        ("cable_m = 12", "cable_m = -1", "`cable_m` is -1, expected 0 to 2000"),
        ("clock_ppm = -3.5", "clock_ppm = 300.0", "`clock_ppm` is 300"),
        ("ramp_ppm_per_s = 0.25", "ramp_ppm_per_s = 99.0", "`clock.ramp_ppm_per_s` is 99"),
        ("jitter_ns = 12", "jitter_ns = 1001", "`clock.jitter_ns` is 1001, expected 0 to 1000"),
        ("jitter_ns = 12", "jitter = 12", "unknown field `jitter`"),
        ("\"A.physical\"", "\"A.fysical\"", "no counter is called `A.fysical`"),
        ("name = \"K3\"", "name = \"K1\"", "two devices are called `K1`"),
        ("closes_at = \"K3.C\"", "closes_at = \"K3.B\"", "K3.B is an E-bus contact"),
        (
            "devices = [\"K1\", \"K3\"]\n\n[[device]]",
            "devices = [\"K7\"]\n\n[[device]]",
            "supply `PS1`: no device is called `K7`",
        ),
        ("medium = \"converters\"", "medium = \"wire\"", "unknown variant `wire`"),
    ];
    for (from, to, expected) in table {
        let error = SegmentFile::parse(&PLANT.replace(from, to)).expect_err(to).to_string();
        assert!(error.contains(expected), "{to}: {error}");
    }
}

#[test]
fn a_port_that_does_not_fit_is_told_with_the_ones_that_do() {
    let plant = |on: &str, kind: &str| {
        format!(
            "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
             [[device]]\nname = \"J1\"\ntype = \"EK1122\"\non = \"K1.B\"\n\
             [[device]]\nname = \"T1\"\ntype = \"{kind}\"\non = \"{on}\"\n"
        )
    };
    assert!(SegmentFile::parse(&plant("J1.C", "EL1008")).is_ok());
    for (on, kind, expected) in [
        // The terminal behind a junction is at its port C, not B.
        (
            "J1.B",
            "EL1008",
            "J1.B is a 100 Mbit/s port, but T1.A is an E-bus contact: no cable fits both; J1.C would be an \
             E-bus contact",
        ),
        ("J1.C", "EK1100", "no cable fits both; J1.B or J1.D would be a 100 Mbit/s port"),
    ] {
        let error = SegmentFile::parse(&plant(on, kind)).expect_err(on).to_string();
        assert!(error.contains(expected), "{error}");
    }
    // Where there is none, none is told.
    let terminal = "[[device]]\nname = \"T1\"\ntype = \"EL1008\"\non = \"maindevice\"\n";
    let error = SegmentFile::parse(terminal).unwrap_err().to_string();
    assert!(error.ends_with("no cable fits both"), "{error}");
}

#[test]
fn the_project_is_what_was_planned() {
    let mut file = SegmentFile::parse(PLANT).unwrap();
    file.faults = vec![
        FaultEntry::new(FaultName::DeviceMissing).device("Term 2 (EL2008)"),
        FaultEntry::new(FaultName::DeviceWrong).device("K3").with("type", "EK1100"),
    ];
    let project = file.project().unwrap();
    let names: Vec<&str> = project.devices.iter().map(|device| device.name.as_str()).collect();
    assert_eq!(names, ["K1", "Term 2 (EL2008)", "K3"]);
    // Vendor 2 is Beckhoff; its product codes hold the type number in the high word.
    let codes = project.devices.iter().map(|device| device.product_code.unwrap() >> 16);
    assert_eq!(codes.collect::<Vec<_>>(), [1100, 2008, 1101]);
    assert!(project.devices.iter().all(|device| device.vendor_id == Some(2)));
    let tree = project.tree().unwrap();
    assert_eq!(tree.closes_at(), Some((2, Port::C)));
    assert_eq!(tree.upstream(1), Some(End::Controller(0, Port::B)));
}

#[test]
fn plants_are_whole_and_belong_to_their_seed() {
    let (mut sizes, mut junctions, mut depths) = (BTreeSet::new(), 0, BTreeSet::new());
    for seed in 0..100 {
        let file = plant(Seed(seed), &PlantOptions::default());
        assert_eq!(file, plant(Seed(seed), &PlantOptions::default()));
        let tree = file.project().unwrap_or_else(|error| panic!("{seed}: {error}")).tree().unwrap();
        assert!((5..=60).contains(&tree.len()), "{seed}: {}", tree.len());
        assert_eq!(SegmentFile::parse(&file.to_toml()), Ok(file.clone()), "{seed}");
        sizes.insert(tree.len());
        depths.extend((0..tree.len()).map(|node| tree.depth(node)));
        junctions += usize::from(file.devices.iter().any(|device| device.name.starts_with('J')));
    }
    assert!(sizes.len() > 20, "{sizes:?}");
    assert!(junctions > 30, "{junctions}");
    assert!(depths.last().is_some_and(|deepest| *deepest >= 20), "{depths:?}");
}

#[test]
fn plants_keep_to_their_options() {
    let options = PlantOptions {
        min_devices: 25,
        max_devices: 40,
        junction: true,
        ring: true,
        all_types: true,
    };
    for seed in 0..50 {
        let file = plant(Seed(seed), &options);
        let tree = file.project().unwrap().tree().unwrap();
        assert!((25..=40).contains(&tree.len()), "{seed}: {}", tree.len());
        assert!(file.devices.iter().any(|device| device.name.starts_with('J')), "{seed}");
        assert!(tree.closes_at().is_some(), "{seed}");
    }
    let one = PlantOptions { min_devices: 0, max_devices: 1, ..PlantOptions::default() };
    assert_eq!(plant(Seed(1), &one).devices.len(), 1);
}

#[cfg(feature = "schema")]
#[test]
fn the_schema_names_what_can_be_written() {
    let schema = schemars::schema_for!(SegmentFile);
    let text = schema.as_value().to_string();
    for word in
        ["device", "closes_at", "cable_m", "from_ms", "additionalProperties", "link-flapping"]
    {
        assert!(text.contains(word), "{word}");
    }
}

#[test]
fn a_device_can_be_repeated() {
    let text = r#"
        [[device]]
        name = "K"
        type = "EK1100"
        on = "maindevice"
        repeat = 2
        cable_m = 7.0

        [[device]]
        name = "T"
        type = "EL1008"
        on = "K[2].B"
        repeat = 3
        serial = 100

        [[device]]
        name = "E"
        type = "EK1110"
        on = "T[3].B"
    "#;
    let file = SegmentFile::parse(text).unwrap();
    let project = file.project().unwrap();
    let places: Vec<_> =
        project.devices.iter().map(|it| format!("{} {}", it.name, it.on)).collect();
    let expected =
        ["K[1] maindevice", "K[2] K[1].C", "T[1] K[2].B", "T[2] T[1].B", "T[3] T[2].B", "E T[3].B"];
    assert_eq!(places, expected);
    let serials: Vec<u32> = expand(&file).unwrap().iter().map(|planned| planned.serial).collect();
    assert_eq!(serials, [1, 2, 100, 101, 102, 6]);
    assert_eq!(SegmentFile::parse(&file.to_toml()), Ok(file));

    let error =
        |from: &str, to: &str| SegmentFile::parse(&text.replace(from, to)).unwrap_err().to_string();
    assert_eq!(
        error("T[3].B\"", "T[3].B\"\nrepeat = 2"),
        "device `E` cannot be repeated: a EK1110 has no second port that is an E-bus contact, for \
         the next one to hang on"
    );
    let error = error("repeat = 3", "repeat = 70000");
    assert_eq!(error, "device `T`: `repeat` is 70000, expected 1 to 65535");
}
