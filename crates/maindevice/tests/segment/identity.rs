//! Who is found is compared with who is planned, place by place; and a station alias as the number of a SubDevice.

use linesman_config::identity::{Mismatch, RevisionRule};
use linesman_config::plan::{IdentificationCheck, IdentificationSource, Plan, PlanOptions};
use linesman_maindevice::service::{Service, ServiceAnswer};
use linesman_maindevice::{Event, Options};
use linesman_proto::address::DeviceId;
use linesman_proto::register::STATION_ALIAS;
use linesman_proto::sii::word::{CHECKSUM, STATION_ALIAS as ALIAS_WORD};
use linesman_proto::sii::{Identity, checksum};
use linesman_proto::state::{AlState, DeviceState};
use linesman_proto::time::Span;

use crate::bench::Bench;

const LINE: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T2"
type = "EL2008"
on = "K1.B"
[[device]]
name = "T3"
type = "EL2008"
on = "T2.B"
[[device]]
name = "T4"
type = "EL1008"
on = "T3.B"
"#;

/// The plan of the line as it is, with its numbers.
fn planned() -> Plan {
    let mut bench = Bench::new(LINE);
    let inventory = bench.scan();
    let devices = inventory.planned(AlState::Op);
    Plan::build(&devices, inventory.tree().clone(), &PlanOptions::default()).unwrap()
}

/// A bench that has tried to run a plan for a while.
fn run(plan: &Plan) -> Bench {
    let mut bench = Bench::with_options(LINE, Options::default());
    bench.device.start(bench.now, plan.clone());
    bench.run_for(Span::s(6));
    bench
}

fn wrong(bench: &Bench) -> Vec<(DeviceId, Mismatch)> {
    let wrong = bench.events.iter().filter_map(|(_, event)| {
        let Event::WrongDevice { id, mismatch, .. } = event else { return None };
        Some((*id, *mismatch))
    });
    wrong.collect()
}

// proves: HC-03 (S)
#[test]
fn another_vendor_product_revision_or_serial_number_is_refused_at_its_place() {
    let as_built = planned();
    let t3 = DeviceId(2);
    let found = as_built.device(t3).unwrap().identity;
    for (is, at_place) in [
        (None, found),
        (Some(Mismatch::Vendor), Identity { vendor_id: 3, ..found }),
        (Some(Mismatch::Product), Identity { product_code: 4711, ..found }),
        (Some(Mismatch::Revision), Identity { revision: found.revision + 1, ..found }),
        (Some(Mismatch::Serial), Identity { serial_number: found.serial_number + 1, ..found }),
    ] {
        let mut plan = as_built.clone();
        plan.devices[t3.index()].identity = at_place;
        plan.devices[t3.index()].revision_rule = RevisionRule::Equal;
        let bench = run(&plan);
        let expected: Vec<_> = is.map(|mismatch| (t3, mismatch)).into_iter().collect();
        assert_eq!(wrong(&bench), expected, "{is:?}");
        let states = ["K1", "T2", "T3", "T4"].map(|name| bench.state(name));
        let own = if is.is_some() { "INIT" } else { "OP" };
        assert_eq!(states, ["OP", "OP", own, "OP"].map(str::to_owned), "{is:?}");
        let word = bench.device.network_status().unwrap().device(t3).unwrap().state();
        assert_eq!(word.contains(DeviceState::WRONG_IDENTITY), is.is_some(), "VPRS: {word}");
    }
    // The revision by the rule that was chosen.
    let (low, high) = (1, 1 << 16);
    let revision = found.revision;
    for (rule, accepted, refused) in [
        (RevisionRule::EqualOrGreater, revision - low, revision + low),
        (RevisionRule::LowWordEqual, revision + high, revision + low),
        (RevisionRule::LowWordEqualHighWordEqualOrGreater, revision - high, revision + high),
        (RevisionRule::HighWordEqual, revision + low, revision + high),
        (RevisionRule::HighWordEqualOrGreater, revision - high + low, revision + high),
    ] {
        for (planned, fits) in [(accepted, true), (refused, false)] {
            let mut plan = as_built.clone();
            plan.devices[t3.index()].identity.revision = planned;
            plan.devices[t3.index()].revision_rule = rule;
            let bench = run(&plan);
            let expected = if fits { Vec::new() } else { vec![(t3, Mismatch::Revision)] };
            assert_eq!(wrong(&bench), expected, "{rule:?} 0x{planned:08X} 0x{revision:08X}");
            assert_eq!(bench.state("T3"), if fits { "OP" } else { "INIT" }, "{rule:?}");
        }
    }
}

/// Does a service for a SubDevice.
fn serve(bench: &mut Bench, id: DeviceId, service: Service) -> ServiceAnswer {
    bench.device.serve(bench.now, id, service);
    let mut answer = None;
    bench.run_until(Span::s(20), |event| {
        let Event::Served { result, .. } = event else { return false };
        answer = Some(result.as_ref().clone());
        true
    });
    answer.expect("it ends").expect("it succeeds")
}

fn alias_in_use(bench: &mut Bench, id: DeviceId) -> Vec<u8> {
    let read = Service::ReadRegister { address: STATION_ALIAS.address, len: 2 };
    let answer = serve(bench, id, read);
    let ServiceAnswer::Data(bytes) = answer else { panic!("{answer:?}") };
    bytes
}

/// Two equal terminals, told apart by the alias that the MainDevice has written into one of them.
// proves: HC-07
#[test]
fn an_alias_that_the_maindevice_has_written_tells_a_subdevice_after_the_next_power_on() {
    let off = "[[fault]]\nkind = \"device-off\"\ndevice = \"T3\"\nfrom_ms = 15000\nto_ms = 16000\n";
    let mut bench = Bench::new(&format!("{LINE}{off}"));
    let as_built = planned();
    assert!(
        as_built.devices.iter().all(|device| device.settings.identification.is_none()),
        "none unless set"
    );
    let with_number = |value: u32| {
        let mut plan = as_built.clone();
        let check =
            IdentificationCheck { source: IdentificationSource::Alias, value, compulsory: true };
        plan.devices[2].settings.identification = Some(check);
        plan
    };
    let t3 = DeviceId(2);
    bench.device.start(bench.now, as_built.clone());
    assert!(bench.run_until(Span::s(5), |event| matches!(event, Event::AllReached)));
    assert_eq!(alias_in_use(&mut bench, t3), [0, 0]);
    // The alias, and the checksum that guards the words before it.
    let ServiceAnswer::Data(mut image) = serve(&mut bench, t3, Service::ReadSii { whole: false })
    else {
        panic!("no image")
    };
    let at = ALIAS_WORD;
    image[at.byte()..at.byte() + 2].copy_from_slice(&300_u16.to_le_bytes());
    let checksum = checksum(image.first_chunk().unwrap());
    for (at, data) in [(at, 300_u16), (CHECKSUM, checksum.into())] {
        let written =
            serve(&mut bench, t3, Service::WriteSii { at, data: data.to_le_bytes().to_vec() });
        assert!(matches!(written, ServiceAnswer::Written { words: 1 }), "{written:?}");
    }
    assert_eq!(alias_in_use(&mut bench, t3), [0, 0], "it is loaded at power-on");
    bench.run_for(Span::s(20));
    assert_eq!(alias_in_use(&mut bench, t3), 300_u16.to_le_bytes());
    for (value, state) in [(300, "OP"), (301, "INIT")] {
        bench.device.stop(bench.now, AlState::Init);
        assert!(bench.run_until(Span::s(10), |event| matches!(event, Event::Stopped)));
        bench.events.clear();
        bench.device.start(bench.now, with_number(value));
        bench.run_for(Span::s(6));
        assert_eq!(bench.state("T3"), state, "{value}");
        let told: Vec<_> = (bench.events.iter())
            .filter_map(|(_, event)| {
                let Event::WrongIdentification { id, found, .. } = event else { return None };
                Some((*id, *found))
            })
            .collect();
        assert_eq!(told, if value == 300 { vec![] } else { vec![(t3, Some(300))] });
    }
}
