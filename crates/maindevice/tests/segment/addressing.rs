//! SubDevices that are reached otherwise than by position first and station address then (FRM-28).

use crate::bench::Bench;
use linesman_config::plan::{AddressingChoice, Plan, PlanOptions};
use linesman_maindevice::Event;
use linesman_proto::address::{StationAddress, StationAlias};
use linesman_proto::state::AlState;
use linesman_proto::time::Span;

const LINE: &str = r#"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL1008"
on = "K1.B"
[[device]]
name = "T2"
type = "EL3102"
on = "T1.B"
alias = 4711
[[device]]
name = "T3"
type = "EL2008"
on = "T2.B"
"#;

/// The plan of the line in which T2, which has a mailbox, is addressed so.
fn plan(addressing: AddressingChoice) -> Plan {
    let mut bench = Bench::new(LINE);
    let inventory = bench.scan();
    let mut planned = inventory.planned(AlState::Op);
    planned[2].settings.addressing = addressing;
    planned[2].settings.alias = Some(StationAlias(4711));
    Plan::build(&planned, inventory.tree().clone(), &PlanOptions::default()).unwrap()
}

fn all_reached(bench: &mut Bench) -> bool {
    bench.run_until(Span::s(10), |event| matches!(event, Event::AllReached))
}

#[test]
fn by_position_only_no_station_address_is_given() {
    let mut bench = Bench::new(&format!(
        "{LINE}[[fault]]\nkind = \"device-off\"\ndevice = \"T3\"\nfrom_ms = 3000\nto_ms = 4000\n"
    ));
    bench.device.start(bench.now, plan(AddressingChoice::Position));
    assert!(all_reached(&mut bench), "{:#?}", bench.events);
    let station =
        |bench: &Bench, name| bench.segment.controller(bench.id(name)).unwrap().station_address();
    assert_eq!(station(&bench, "T2"), StationAddress(0));
    assert_eq!(station(&bench, "T1"), StationAddress(0x1002));
    assert_eq!(bench.state("T2"), "OP");
    // Another one goes and comes back: places were looked at anew, and it runs all the same.
    bench.run_for(Span::s(8));
    assert_eq!(["T1", "T2", "T3"].map(|name| bench.state(name)), ["OP"; 3].map(str::to_owned));
    assert_eq!(station(&bench, "T2"), StationAddress(0));
    assert!(bench.device.is_settled());
    assert!(bench.device.quality(bench.id("T2")).valid);
}

#[test]
fn by_alias_it_is_found_again_after_it_was_without_power() {
    let mut bench = Bench::new(&format!(
        "{LINE}[[fault]]\nkind = \"device-off\"\ndevice = \"T2\"\nfrom_ms = 3000\nto_ms = 4000\n"
    ));
    bench.device.start(bench.now, plan(AddressingChoice::Alias));
    assert!(all_reached(&mut bench), "{:#?}", bench.events);
    let t2 = bench.id("T2");
    bench.run_for(Span::s(8));
    assert!(
        bench.device.is_settled(),
        "{:#?}",
        bench.events.iter().rev().take(30).collect::<Vec<_>>()
    );
    assert!(bench.device.quality(t2).valid);
    let controller = bench.segment.controller(t2).unwrap();
    assert_eq!(controller.station_address(), StationAddress(0x1003));
    // Nobody answers to aliases beyond the search.
    let alias_in_use = controller.register(linesman_proto::address::RegisterAddress(0x0103)) & 1;
    assert_eq!(alias_in_use, 0);
}
