//! Every type of the library, brought to OP: what its process data and objects do.

use linesman_config::plan::{Plan, PlanOptions};
use linesman_maindevice::{Event, Options};
use linesman_proto::mailbox::coe::ObjectAddress;
use linesman_proto::state::AlState;
use linesman_proto::time::Span;
use linesman_sim::device::library::{LibraryType, find, passive, types};
use linesman_sim::segment_file::SegmentFile;

use crate::bench::Bench;
use crate::mailbox::{get, put, upload};

/// What the library has to have at least.
const NAMED: &[&str] = &[
    "EK1100",
    "EK1101",
    "EK1110",
    "EK1122",
    "EK1521",
    "EK1814",
    "EK1828",
    "EK1101-0080",
    "EK1122-0080",
    "CU1123",
    "CU1124",
    "CU1128",
    "EL1004",
    "EL1008",
    "EL1014",
    "EL1252",
    "EL2004",
    "EL2008",
    "EL2014",
    "EL3102",
    "EL3104",
    "EL3154",
    "EL3162",
    "EL4102",
    "EL4112",
    "EL4732",
    "EL6601",
    "EL6614",
    "EL6688",
    "EL6692",
    "EL6695",
    "EL7041",
    "EL9410",
    "EP1008",
    "EP2308",
    "EP4174",
    "AX5103",
    "CiA402",
];

#[test]
fn the_library_has_what_it_has_to_have() {
    for name in NAMED {
        assert!(find(name).is_some(), "{name}");
    }
    assert!(passive("EL9011").is_some(), "an end cap");
}

/// A type alone, or wherever it fits.
fn place(name: &str) -> SegmentFile {
    let device = |on: &str| format!("[[device]]\nname = \"D\"\ntype = \"{name}\"\non = \"{on}\"\n");
    let before = |name: &str, type_name: &str| {
        format!("[[device]]\nname = \"{name}\"\ntype = \"{type_name}\"\non = \"maindevice\"\n")
    };
    let junction = "[[device]]\nname = \"J\"\ntype = \"EK1122-0080\"\non = \"K.B\"\n";
    let places = [
        device("maindevice"),
        format!("{}{}", before("K", "EK1100"), device("K.B")),
        format!("{}{junction}{}", before("K", "EK1100"), device("J.B")),
        format!("{}{junction}{}", before("K", "EK1100"), device("J.D")),
    ];
    let mut errors = Vec::new();
    for text in places {
        match SegmentFile::parse(&text) {
            Ok(file) => return file,
            Err(error) => errors.push(error.to_string()),
        }
    }
    panic!("{name} fits nowhere: {errors:?}")
}

/// What moves only once it is enabled, or at its SYNC0; other tests do so.
fn waits_for_more(kind: &LibraryType) -> bool {
    matches!(kind.name(), "EL7041" | "AX5103-0012" | "CiA402-Drive")
}

#[test]
fn every_type_exchanges_process_data_both_ways() {
    let (mut driven, mut taken) = (0, 0);
    for kind in types() {
        let name = kind.name();
        let mut bench = Bench::of(&place(name), Options::default());
        let plan = bench.start(AlState::Op);
        let parts: Vec<_> = bench.segment.devices().collect();
        let mine: Vec<_> =
            parts.into_iter().filter(|id| bench.segment.name(*id).starts_with('D')).collect();
        let outputs: Vec<_> =
            mine.iter().flat_map(|id| bench.segment.outputs(*id)).copied().collect();
        let inputs: Vec<_> =
            mine.iter().flat_map(|id| bench.segment.inputs(*id)).copied().collect();
        let ranges: Vec<_> = plan
            .devices
            .iter()
            .filter(|device| mine.contains(&device.id))
            .map(|device| (device.outputs.clone(), device.inputs.clone()))
            .collect();
        if !outputs.is_empty()
            && !waits_for_more(kind)
            && ranges.iter().any(|one| !one.0.is_empty())
        {
            for (range, _) in &ranges {
                bench.device.outputs_mut()[range.clone()].fill(0x55);
            }
            bench.run_for(Span::ms(30));
            let high = outputs.iter().filter(|one| bench.segment.signals().value(**one) != 0);
            assert!(high.count() > 0, "{name}: no output is driven");
            driven += 1;
        }
        if !inputs.is_empty() && ranges.iter().any(|one| !one.1.is_empty()) {
            let now: Vec<_> =
                ranges.iter().map(|one| bench.device.inputs()[one.1.clone()].to_vec()).collect();
            for signal in &inputs {
                bench.segment.signals_mut().set(*signal, 1_000);
            }
            bench.run_for(Span::ms(30));
            let then: Vec<_> =
                ranges.iter().map(|one| bench.device.inputs()[one.1.clone()].to_vec()).collect();
            assert_ne!(now, then, "{name}: inputs stay as they are");
            taken += 1;
        }
        assert_eq!(bench.state("D"), "OP", "{name}");
        assert_eq!(bench.segment.audit(), [], "{name}");
    }
    assert!(driven >= 8 && taken >= 15, "{driven} drive, {taken} take");
}

#[test]
fn every_type_with_coe_shows_its_objects() {
    for kind in types().filter(|kind| kind.has_mailbox()) {
        let name = kind.name();
        let mut bench = Bench::of(&place(name), Options::default());
        bench.start(AlState::Op);
        let id = bench.id("D");
        let found = bench.segment.controller(id).expect("it is there").sii().to_vec();
        let image = linesman_proto::sii::Image::parse(&found).expect("an image");
        // A drive of SoE has no objects.
        if !image.protocols.has(linesman_proto::sii::Protocols::COE) {
            continue;
        }
        let mut read = |index: u16, subindex: u8| {
            let value = upload(&mut bench, "D", index, subindex);
            value.unwrap_or_else(|error| panic!("{name} 0x{index:04X}:{subindex:02X}: {error}"))
        };
        assert_eq!(read(0x1000, 0).len(), 4, "{name}");
        assert_eq!(read(0x1008, 0), name.as_bytes());
        let identity = image.identity;
        for (subindex, value) in
            [(1, identity.vendor_id), (2, identity.product_code), (3, identity.revision)]
        {
            assert_eq!(read(0x1018, subindex), value.to_le_bytes(), "{name}");
        }
        for list in [0x1C12, 0x1C13] {
            for place in 1..=read(list, 0)[0] {
                let pdo = read(list, place);
                let pdo = u16::from_le_bytes([pdo[0], pdo[1]]);
                for entry in 1..=read(pdo, 0)[0] {
                    let mapped = read(pdo, entry);
                    let [bits, subindex, low, high] = mapped[..] else { panic!("{mapped:?}") };
                    let index = u16::from_le_bytes([low, high]);
                    if index != 0 {
                        let value = read(index, subindex);
                        assert!(8 * value.len() >= usize::from(bits), "{name} 0x{index:04X}");
                    }
                }
            }
        }
    }
}

/// The two sides of a bridge, each in a network of its own.
struct TwoSides {
    primary: Bench,
    secondary: Bench,
}

impl TwoSides {
    fn step(&mut self) {
        for side in [&mut self.primary, &mut self.secondary] {
            side.run_for(Span::ms(1));
        }
        let values = |side: &Bench| {
            let outputs = side.segment.outputs(side.id("D")).to_vec();
            outputs.iter().map(|one| side.segment.signals().driven(*one)).collect::<Vec<_>>()
        };
        let (there, back) = (values(&self.primary), values(&self.secondary));
        for (side, values) in [(&mut self.secondary, there), (&mut self.primary, back)] {
            let inputs = side.segment.inputs(side.id("D")).to_vec();
            for (input, value) in inputs.iter().zip(values) {
                match value {
                    Some(value) => side.segment.signals_mut().set(*input, value),
                    None => side.segment.signals_mut().release(*input),
                }
            }
        }
    }

    fn run(&mut self, ms: u32) {
        (0..ms).for_each(|_| self.step());
    }
}

/// Maps values to the user data of a bridge, and starts it with a plan that knows so.
fn map_and_start(bench: &mut Bench, pdos: [u16; 2], values: u8) -> Plan {
    bench.start(AlState::PreOp);
    for (pdo, object) in pdos.into_iter().zip([0x7000_u32, 0x6000]) {
        put(bench, "D", pdo, 0, &[0]).unwrap();
        for value in 1..=values {
            let mapped = object << 16 | u32::from(value) << 8 | 32;
            put(bench, "D", pdo, value, &mapped.to_le_bytes()).unwrap();
        }
        put(bench, "D", pdo, 0, &[values]).unwrap();
    }
    let mut inventory = bench.scan();
    let profile = &mut inventory.devices.last_mut().expect("a device").profile;
    for manager in profile.process.iter_mut() {
        manager.len += 4 * u16::from(values);
    }
    let tree = inventory.tree().clone();
    let planned = inventory.planned(AlState::Op);
    let plan = Plan::build(&planned, tree, &PlanOptions::default()).expect("a plan");
    bench.device.start(bench.now, plan.clone());
    let up = bench.run_until(Span::s(5), |event| matches!(event, Event::AllReached));
    assert!(up, "{}: {:#?}", bench.state("D"), bench.events.last());
    plan
}

// proves: DC-15 partial: the user data of the two sides
#[test]
fn user_data_cross_a_bridge_from_one_network_to_the_other() {
    for (primary, secondary, pdos, values) in [
        ("EL6692", "EL6692-0002", [0x1600, 0x1A00], 3u8),
        ("EL6695", "EL6695-0002", [0x1608, 0x1A08], 20),
    ] {
        let bench = |name| Bench::of(&place(name), Options::default());
        let mut sides = TwoSides { primary: bench(primary), secondary: bench(secondary) };
        let there = map_and_start(&mut sides.primary, pdos, values);
        let back = map_and_start(&mut sides.secondary, pdos, values);
        sides.run(20);
        let range =
            |plan: &Plan| plan.devices.last().map(|one| (one.outputs.clone(), one.inputs.clone()));
        let (there, back) = (range(&there).unwrap(), range(&back).unwrap());
        let user = usize::from(values) * 4;
        assert_eq!((there.0.len(), there.1.len()), (user, user + 2), "{primary}");
        let (out, answer): (Vec<u8>, Vec<u8>) =
            (0..user).map(|at| (at as u8 + 1, 0xA0 ^ at as u8)).unzip();
        sides.primary.device.outputs_mut()[there.0.clone()].copy_from_slice(&out);
        sides.secondary.device.outputs_mut()[back.0.clone()].copy_from_slice(&answer);
        sides.run(20);
        let taken = |side: &Bench, range: &std::ops::Range<usize>| {
            side.device.inputs()[range.clone()].to_vec()
        };
        let (here, over) = (taken(&sides.primary, &there.1), taken(&sides.secondary, &back.1));
        assert_eq!(over[2..], out, "{primary} to {secondary}");
        assert_eq!(here[2..], answer, "{secondary} to {primary}");
        // Bit 15 of the status: the other side is not connected.
        assert_eq!([here[1] & 0x80, over[1] & 0x80], [0, 0], "{primary}");
        assert_eq!(sides.primary.state("D"), "OP");
        assert_eq!(
            get(&mut sides.secondary, "D", ObjectAddress::new(0x6000, 1), false).unwrap(),
            out[..4]
        );
    }
}

/// Both sides in one file: their wires are a table of it.
#[test]
fn a_file_wires_outputs_to_inputs() {
    let text = r#"
[[device]]
name = "K"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O"
type = "EL2008"
on = "K.B"
[[device]]
name = "I"
type = "EL1008"
on = "O.B"
[[wire]]
from = "O"
to = "I"
"#;
    let file = SegmentFile::parse(text).unwrap();
    assert_eq!(SegmentFile::parse(&file.to_toml()).unwrap(), file);
    let mut bench = Bench::of(&file, Options::default());
    let plan = bench.start(AlState::Op);
    let (outputs, inputs) = (plan.devices[1].outputs.clone(), plan.devices[2].inputs.clone());
    for value in [0x5A, 0xFF, 0x01] {
        bench.device.outputs_mut()[outputs.clone()].fill(value);
        bench.run_for(Span::ms(20));
        assert_eq!(bench.device.inputs()[inputs.clone()], [value]);
    }
    let wrong = |wire: &str| {
        let file = SegmentFile::parse(&text.replace("from = \"O\"\nto = \"I\"", wire)).unwrap();
        linesman_sim::segment::Segment::build(&file).map(|_| ()).unwrap_err().to_string()
    };
    let error = wrong("from = \"O\"\noutput = 9\nto = \"I\"");
    assert!(error.contains("wire 1") && error.contains("it has 8 outputs, from 1 up"), "{error}");
    let error = wrong("from = \"X\"\nto = \"I\"");
    assert!(error.contains("there is no device `X`"), "{error}");
    let error = wrong("from = \"O\"\nto = \"I\"\n[[wire]]\nfrom = \"O\"\nto = \"I\"");
    assert!(error.contains("wire 2") && error.contains("has a wire already"), "{error}");
}

/// A device whose software reads the EEPROM wants it left to it; one that plays it works like any
/// other; one without a processor can do neither.
#[test]
fn the_sii_may_lie_elsewhere() {
    let file = |type_name: &str, place: &str| {
        let text = format!(
            "[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
             [[device]]\nname = \"D\"\ntype = \"{type_name}\"\non = \"K.B\"\nsii = \"{place}\"\n"
        );
        SegmentFile::parse(&text).unwrap()
    };
    for place in ["emulated", "shared"] {
        let mut bench = Bench::of(&file("EL3102", place), Options::default());
        bench.start(AlState::Op);
        assert_eq!(upload(&mut bench, "D", 0x1008, 0).unwrap(), b"EL3102", "{place}");
    }
    let error = linesman_sim::segment::Segment::build(&file("EL1008", "emulated")).map(|_| ());
    let error = error.unwrap_err().to_string();
    assert!(error.contains("needs a processor, and a EL1008 has none"), "{error}");
}
