//! What each fault does to frames and counters.

use linesman_config::fault::FaultName;
use linesman_proto::time::Span;
use linesman_sim::segment_file::FaultEntry;

use super::rig::Bench;

#[test]
fn an_open_link_cuts_off_what_is_behind_it() {
    let mut bench = Bench::plant();
    assert_eq!(bench.count(), Some(8));
    let fault = bench.inject(&FaultEntry::new(FaultName::LinkOpen).at("K1.C-K6.A"));
    bench.wait(Span::ms(1));
    assert_eq!(bench.count(), Some(5), "the loop has closed");
    assert_eq!(bench.counters(), ["K1.C lost 1", "K6.A lost 1"]);
    bench.heal(fault);
    bench.wait(Span::ms(10));
    assert_eq!(bench.count(), Some(5), "the link is not up yet");
    bench.wait(Span::s(3));
    assert_eq!(bench.count(), Some(8));
    assert_eq!(bench.counters(), ["K1.C lost 1", "K6.A lost 1"]);
    bench.assert_audit();
    let record = bench.segment.truth().fault(fault).unwrap();
    assert_eq!((record.links_lost, record.frames_lost), (2, 0));
    assert!(!record.is_active());
}
