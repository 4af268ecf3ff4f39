//! Groups plugged out and in while the line runs.

use linesman_proto::time::Span;

use super::rig::Bench;

// proves: JCT-11 partial, JCT-12 partial
#[test]
fn a_group_comes_off_and_on_again_and_fits_nowhere_else_here() {
    let mut bench = Bench::plant();
    assert_eq!(bench.count(), Some(8));
    bench.segment.unplug(bench.now, "K8").unwrap();
    bench.wait(Span::ms(1));
    assert_eq!(bench.count(), Some(7));
    assert_eq!(bench.counters(), ["K6.C lost 1", "K8.A lost 1"]);
    // K1's port C is taken; its own port C is its own.
    let plug = |bench: &mut Bench, device: &str, on: &str| {
        let on = on.parse().unwrap();
        bench.segment.plug(bench.now, device, Some(&on)).map_err(|error| error.to_string())
    };
    for (device, on, expected) in [
        ("K8", "K1.C", "something is plugged in there"),
        ("K8", "K8.C", "it would hang on itself"),
        ("K8", "T5.B", "no cable fits both ports"),
        ("K8", "K9.C", "no device or group is called `K9`"),
        ("K6", "K6.C", "unplug it first"),
    ] {
        let error = plug(&mut bench, device, on).unwrap_err();
        assert!(error.contains(expected), "{on}: {error}");
    }
    let name = "K8";
    bench.segment.plug(bench.now, name, None).unwrap();
    bench.wait(Span::s(3));
    assert_eq!(bench.count(), Some(8));
    bench.assert_audit();
}
