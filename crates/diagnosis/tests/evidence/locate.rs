//! Damage on every hop of hand-made lines is found by the counters it leaves.
//!
//! The bench below counts as the data sheet says (S1 14: first detector, forwarded or counted again,
//! processing unit); it knows nothing of how the search works.

use linesman_config::fault::FaultName;
use linesman_diagnosis::finding::{LinkDirection, Place};
use linesman_diagnosis::locate::{LastHop, LocateInput, Located};
use linesman_diagnosis::model::{NetworkModel, Tally};
use linesman_diagnosis::observe::{HostEvent, HostObservation};
use linesman_diagnosis::rule::{View, frame_errors};
use linesman_proto::address::{DeviceId, Network, Path};
use linesman_proto::port::{Port, Port::A, Port::B, Port::C, Port::D};
use linesman_proto::register::{ErrorCounter, ErrorCounters};
use linesman_proto::time::{Instant, Span};
use linesman_proto::topology::{End, Route, Tree, Wired};
use proptest::prelude::*;

/// Controllers that count, and a diagnosis that reads them.
struct Bench {
    tree: Tree,
    /// By controller: forwarded counting, and symbols made anew.
    types: Vec<(bool, bool)>,
    real: Vec<ErrorCounters>,
    card: u64,
    model: NetworkModel,
    now: Instant,
}

fn bump(value: &mut Option<u8>, by: u64) {
    let sum = u64::from(value.unwrap_or(0)) + by;
    *value = Some(u8::try_from(sum).unwrap_or(u8::MAX));
}

impl Bench {
    fn new(tree: Tree, types: Vec<(bool, bool)>) -> Self {
        let mut model = NetworkModel::new(Network(0));
        for _ in 0..tree.len() {
            model.add_device();
        }
        model.tree = Some(tree.clone());
        let zero = ErrorCounters::from_bytes(&[0; ErrorCounters::LEN], ErrorCounters::START);
        let real = vec![zero; tree.len()];
        let mut bench = Self { tree, types, real, card: 0, model, now: Instant::ZERO };
        bench.read_all();
        bench
    }

    /// So many frames are hit on a hop of card A's way; `symbols` says whether by bad symbols.
    fn hit(&mut self, hop: usize, frames: u64, symbols: bool) {
        let route = Route::intact(&self.tree);
        for (index, check) in route.checks_from(hop).enumerate() {
            let (forwards, _) = self.types[check.node];
            let counters = &mut self.real[check.node];
            let is_first = index == 0;
            let counter = if is_first || !forwards {
                ErrorCounter::InvalidFrame(check.port)
            } else {
                ErrorCounter::Forwarded(check.port)
            };
            bump(counters.slot(counter), frames);
            let sender = route.hops()[check.hop].from.node();
            let remade = !is_first && sender.is_some_and(|sender| self.types[sender].1);
            if (is_first && symbols) || remade {
                bump(counters.slot(ErrorCounter::PhysicalLayer(check.port)), frames);
            }
        }
        self.card += frames;
    }

    fn noise(&mut self, node: usize, port: Port, symbols: u64) {
        bump(self.real[node].slot(ErrorCounter::PhysicalLayer(port)), symbols);
    }

    fn read(&mut self, node: usize) {
        self.now += Span::ms(1);
        self.model.now = self.now;
        let counters = self.real[node];
        self.model.devices[node].counters.record_counters(&counters, self.now, Some(1));
    }

    fn read_all(&mut self) {
        for node in 0..self.tree.len() {
            self.read(node);
        }
    }

    fn watch_card(&mut self) {
        self.now += Span::ms(1);
        self.model.now = self.now;
        let what = HostEvent::CardErrors { crc: std::mem::take(&mut self.card), other: 0 };
        let (network, path) = (Network(0), Path::A);
        self.model.host.record(&HostObservation { network, path, time: self.now, what });
    }

    fn located(&self, has_ended: bool) -> Located {
        Located::on(&LocateInput::of(&self.model, has_ended).unwrap())
    }

    fn conditions(&self) -> Vec<linesman_diagnosis::finding::Condition> {
        let view = View { model: &self.model, now: self.now, has_ended: false };
        let mut conditions = Vec::new();
        (frame_errors::RULE.judge)(&view, &mut conditions);
        conditions
    }
}

fn on(no: usize, port: Port) -> Wired {
    Wired { on: End::Controller(no - 1, port), entry: A }
}

/// The fifteen-SubDevice line of the sources.
fn fifteen() -> Tree {
    let mut wired = vec![Wired { on: End::MainDevice(Path::A), entry: A }];
    wired.extend((1..9).map(|no| on(no, B)));
    wired.extend([on(9, D), on(9, C), on(11, B), on(12, B), on(6, C), on(1, C)]);
    Tree::from_wiring(&wired, None).unwrap()
}

// proves: HW-18 partial, HW-22 partial, HW-23 partial, HW-28 partial, HW-29
#[test]
fn every_hop_is_found_with_every_way_of_counting() {
    let tree = fifteen();
    let hops = Route::intact(&tree).hops().len();
    for types in [(false, false), (true, false), (false, true), (true, true)] {
        for hop in 0..hops - 1 {
            for frames in [1, 10, 1_000] {
                for symbols in [false, true] {
                    let mut bench = Bench::new(tree.clone(), vec![types; 15]);
                    bench.hit(hop, frames, symbols);
                    bench.read_all();
                    bench.read_all();
                    let located = bench.located(false);
                    let case = format!("hop {hop}, {frames} frames, {types:?}, {symbols}");
                    assert_eq!(located.hops.len(), 1, "{case}: {located:?}");
                    let damage = &located.hops[0];
                    assert_eq!(damage.hop, Route::intact(&tree).hops()[hop], "{case}");
                    assert_eq!(damage.frames, frames.min(255), "{case}");
                    assert_eq!(damage.is_lower_bound, frames >= 255, "{case}");
                    assert_eq!(damage.symbols == Some(0), !symbols, "{case}");
                }
            }
        }
    }
}

// proves: HW-24 partial
#[test]
fn damage_in_both_directions_is_told_apart_by_count() {
    for forwards in [false, true] {
        let tree = fifteen();
        let mut bench = Bench::new(tree.clone(), vec![(forwards, false); 15]);
        let route = Route::intact(&tree);
        let out = route.hop_to(13, A).unwrap();
        bench.hit(out, 5, true);
        bench.hit(route.opposite(out).unwrap(), 13, true);
        bench.read_all();
        bench.read_all();
        let located = bench.located(false);
        let counts: Vec<_> = located.hops.iter().map(|d| (d.hop.to, d.frames)).collect();
        let expected = [(End::Controller(13, A), 5), (End::Controller(5, C), 13)];
        assert_eq!(counts, expected, "forwards: {forwards}");
        let conditions = bench.conditions();
        assert_eq!(conditions.len(), 1);
        assert_eq!(conditions[0].cause, FaultName::CableDegraded);
        let Place::Link { a, b, direction, .. } = conditions[0].place else { panic!() };
        assert_eq!(a, End::Controller(DeviceId(5), C));
        assert_eq!(b, Some(End::Controller(DeviceId(13), A)));
        assert_eq!(direction, Some(LinkDirection::Both));
    }
}

#[test]
fn a_judgement_waits_until_all_earlier_ports_were_read() {
    let tree = fifteen();
    let mut bench = Bench::new(tree.clone(), vec![(false, false); 15]);
    bench.read(0);
    bench.read(1);
    // The damage lies before SubDevice 2, but the reading went past it already.
    bench.hit(1, 3, true);
    for node in 2..15 {
        bench.read(node);
    }
    assert_eq!(bench.located(false).hops, [], "SubDevice 3 counts first so far, but not for sure");
    bench.read(0);
    bench.read(1);
    assert_eq!(bench.located(false).hops, [], "SubDevice 1 may have counted since it was read");
    bench.read(0);
    let located = bench.located(false);
    let places: Vec<_> = located.hops.iter().map(|damage| damage.hop.to).collect();
    assert_eq!(places, [End::Controller(1, A)]);
}

#[test]
fn noise_that_goes_on_while_counters_are_read_stays_one_place() {
    let tree = fifteen();
    let mut bench = Bench::new(tree.clone(), vec![(false, false); 15]);
    let hop = Route::intact(&tree).hop_to(13, A).unwrap();
    for round in 0..10 {
        for node in 0..15 {
            bench.read(node);
            bench.hit(hop, 1, true);
            let located = bench.located(false);
            let places: Vec<_> = located.hops.iter().map(|damage| damage.hop.to).collect();
            let expected = [End::Controller(13, A)];
            assert!(
                places == expected || ((round, node) < (1, 12) && places.is_empty()),
                "round {round}, reading {node}: {places:?}"
            );
        }
    }
}

#[test]
fn the_last_hop_is_told_by_the_card() {
    let tree = fifteen();
    let last = Route::intact(&tree).hops().len() - 1;
    let mut bench = Bench::new(tree.clone(), vec![(false, false); 15]);
    bench.hit(last, 1, true);
    bench.watch_card();
    bench.read_all();
    let located = bench.located(false);
    assert_eq!(located.hops, []);
    assert!(matches!(located.last_hops[..], [LastHop::Damaged { frames: 1, .. }]), "{located:?}");
    let conditions = bench.conditions();
    assert_eq!(conditions.len(), 1);
    let Place::Link { a, direction, .. } = conditions[0].place else { panic!() };
    assert_eq!((a, direction), (End::MainDevice(Path::A), Some(LinkDirection::BToA)));
    let causes: Vec<_> = conditions[0].alternatives.iter().map(|other| other.cause).collect();
    assert!(causes.contains(&FaultName::NicDamaged), "{causes:?}");
    // Frames that a SubDevice found bad before are not the last hop's.
    let mut bench = Bench::new(tree, vec![(true, false); 15]);
    bench.hit(last - 1, 7, true);
    bench.watch_card();
    bench.read_all();
    bench.read_all();
    let located = bench.located(false);
    assert_eq!((located.hops.len(), located.last_hops.len()), (1, 0), "{located:?}");
}

#[test]
fn without_the_cards_counters_the_last_hop_is_a_set() {
    let mut bench = Bench::new(fifteen(), vec![(true, false); 15]);
    let mut lost = Tally::default();
    lost.add(3, bench.now);
    bench.model.traffic.losses.report(lost);
    bench.read_all();
    let conditions = bench.conditions();
    assert_eq!(conditions.len(), 1, "{conditions:?}");
    let condition = &conditions[0];
    assert_eq!(condition.page.code, "H112");
    assert!(!condition.is_confirmed);
    let causes: Vec<_> = condition.alternatives.iter().map(|other| other.cause).collect();
    for cause in [FaultName::NicDamaged, FaultName::HostDrops, FaultName::DeviceInternal] {
        assert!(causes.contains(&cause), "{cause}");
    }
    // With the card's counters at 0, the frames were not damaged there.
    bench.watch_card();
    assert_eq!(bench.conditions().len(), 0);
}

#[test]
fn copies_that_a_card_of_a_ring_misses_are_lost_on_its_last_hop_whatever_was_lost_before() {
    let wired = [Wired { on: End::MainDevice(Path::A), entry: A }, on(1, B), on(2, B)];
    let ring = Tree::from_wiring(&wired, Some((2, B))).unwrap();
    let mut bench = Bench::new(ring, vec![(true, false); 3]);
    bench.model.traffic.recording.record_frame(bench.now);
    // Two frames while the line came up; then those alone that come back to card A.
    let mut lost = Tally::default();
    lost.add(1, bench.now);
    lost.add(1, bench.now + Span::ms(1));
    bench.model.traffic.losses.report(lost);
    bench.read_all();
    bench.now += Span::s(2);
    for _ in 0..9 {
        bench.model.traffic.losses.record_copy(Path::A, bench.now);
        bench.now += Span::ms(7);
    }
    bench.read_all();
    let found = bench.located(false).last_hops;
    let card = found.iter().map(LastHop::card).collect::<Vec<_>>();
    assert_eq!((card, found[0].frames()), (vec![Path::A], 9));
}

#[test]
fn frames_that_are_lost_as_a_whole_beside_copies_to_one_card_accuse_no_other_card() {
    let wired = [Wired { on: End::MainDevice(Path::A), entry: A }, on(1, B), on(2, B)];
    let ring = Tree::from_wiring(&wired, Some((2, B))).unwrap();
    let mut bench = Bench::new(ring, vec![(true, false); 3]);
    bench.model.traffic.recording.record_frame(bench.now);
    bench.read_all();
    bench.now += Span::s(2);
    // What card A alone sends is lost where its copies are.
    let mut lost = Tally::default();
    for cycle in 0..9 {
        bench.model.traffic.losses.record_copy(Path::B, bench.now);
        if cycle % 3 == 0 {
            lost.add(1, bench.now);
        }
        bench.now += Span::ms(7);
    }
    bench.model.traffic.losses.report(lost);
    bench.read_all();
    let found = bench.located(false).last_hops;
    let card = found.iter().map(LastHop::card).collect::<Vec<_>>();
    assert_eq!((card, found[0].frames()), (vec![Path::B], 9));
}

// proves: HW-26, HW-27
#[test]
fn clean_symbols_point_inside_a_device_and_several_links_to_interference() {
    let tree = fifteen();
    let mut bench = Bench::new(tree.clone(), vec![(true, false); 15]);
    let route = Route::intact(&tree);
    // SubDevice 4 spoils frames on the way out and on the way back.
    bench.hit(route.hop_from(3, B).unwrap(), 4, false);
    bench.hit(route.hop_from(3, A).unwrap(), 2, false);
    bench.read_all();
    bench.read_all();
    let conditions = bench.conditions();
    assert_eq!(conditions.len(), 1, "{conditions:?}");
    assert_eq!(conditions[0].cause, FaultName::DeviceInternal);
    assert_eq!(conditions[0].place, Place::device(Network(0), DeviceId(3)));

    let mut bench = Bench::new(tree, vec![(true, false); 15]);
    for burst in [3, 0, 9, 1, 0, 12, 4, 0, 7, 2, 11, 1] {
        bench.noise(4, A, 2 * burst + 1);
        bench.noise(10, A, burst);
        bench.noise(0, C, burst + 1);
        bench.now += Span::ms(100);
        bench.read_all();
    }
    bench.read_all();
    let conditions = bench.conditions();
    let causes: Vec<_> = conditions.iter().map(|condition| condition.cause).collect();
    assert_eq!(causes, [FaultName::EmcNoise; 3]);
    let sum: f64 = conditions[0].alternatives.iter().map(|other| other.confidence).sum();
    assert!(sum + conditions[0].confidence <= 1.0);
    // One leads, the others follow from it.
    assert!(!conditions[0].explains.is_empty());
    assert!(conditions[1].symptoms.iter().all(|s| conditions[0].explains.contains(s)));
}

/// What is said of two noisy links: symbols by reading, at port A of SubDevice 5 and at port C of SubDevice 1.
fn two_noisy(every: Span, readings: &[(u64, u64)]) -> Vec<FaultName> {
    let mut bench = Bench::new(fifteen(), vec![(true, false); 15]);
    for (one, other) in readings {
        bench.noise(4, A, *one);
        bench.noise(0, C, *other);
        bench.now += every;
        bench.read_all();
    }
    bench.now += every;
    bench.read_all();
    bench.conditions().iter().map(|condition| condition.cause).collect()
}

/// Hits in the readings of these numbers.
fn hits_at(readings: u64, numbers: &[u64]) -> Vec<u64> {
    (0..readings).map(|number| u64::from(numbers.contains(&number))).collect()
}

// proves: HW-26 partial
#[test]
fn seldom_hits_of_two_links_at_the_same_moments_are_interference() {
    let one = hits_at(60, &[0, 7, 16, 31, 40, 52]);
    let other = hits_at(60, &[7, 16, 40, 59]);
    let readings: Vec<_> = one.into_iter().zip(other).collect();
    assert_eq!(two_noisy(Span::ms(5), &readings), [FaultName::EmcNoise; 2]);
}

// proves: HW-26 partial
#[test]
fn hits_of_two_links_each_in_its_own_time_are_two_faults() {
    let one = hits_at(60, &[0, 7, 16, 31, 40, 52]);
    let other = hits_at(60, &[3, 16, 24, 47, 59]);
    let readings: Vec<_> = one.into_iter().zip(other).collect();
    assert_eq!(two_noisy(Span::ms(5), &readings), [FaultName::CableDegraded; 2]);
    // Both all the time: nothing tells, but that one of them began later and ended earlier.
    let steady: Vec<_> = (0..60).map(|at| (2, if (9..50).contains(&at) { 3 } else { 0 })).collect();
    assert!(!two_noisy(Span::ms(5), &steady).contains(&FaultName::EmcNoise));
}

// proves: HW-26 partial
#[test]
fn noise_of_two_links_that_begins_and_ends_together_is_interference() {
    let mut readings = vec![(0, 0), (0, 0)];
    readings.extend([(9, 4); 30]);
    assert_eq!(two_noisy(Span::ms(5), &readings), [FaultName::EmcNoise; 2]);
}

// proves: HW-26 partial
#[test]
fn links_hit_between_nearly_any_two_readings_are_told_apart_by_what_coincides() {
    let is_hit = |at: u64, salt: u64| (at * at * salt + at * 3) % 11 < 6;
    // Neither begins nor ends with the other.
    let readings = |salt: [u64; 2]| -> Vec<(u64, u64)> {
        let hit = |at, salt| u64::from(is_hit(at, salt));
        let middle = (4..96).map(|at| (hit(at, salt[0]), hit(at, salt[1])));
        [(1, 0); 4].into_iter().chain(middle).chain([(0, 1); 4]).collect()
    };
    assert_eq!(two_noisy(Span::ms(5), &readings([7, 7])), [FaultName::EmcNoise; 2]);
    assert_eq!(two_noisy(Span::ms(5), &readings([7, 5])), [FaultName::CableDegraded; 2]);
}

/// Causes that are named for three noisy links: symbols of each hit, and the readings with one.
fn three_noisy(hits: [(u64, &[u64]); 3]) -> Vec<FaultName> {
    let mut bench = Bench::new(fifteen(), vec![(true, false); 15]);
    for at in 0..100_u64 {
        for ((node, port), (symbols, readings)) in [(4, A), (10, A), (0, C)].into_iter().zip(hits) {
            if readings.contains(&at) {
                bench.noise(node, port, symbols);
            }
        }
        bench.now += Span::ms(5);
        bench.read_all();
    }
    bench.conditions().iter().map(|condition| condition.cause).collect()
}

// proves: HW-26 partial
#[test]
fn three_links_hit_in_the_same_stretch_of_time_have_one_source() {
    let [one, other, third] = [&[2, 20, 61][..], &[10, 44, 70], &[5, 33, 66]];
    let causes = three_noisy([(1, one), (1, other), (1, third)]);
    assert_eq!(causes, [FaultName::EmcNoise; 3]);
    // One that is hit only after the others, or far more often, is a fault of its own, and two may be two faults.
    for hits in
        [[(1, one), (1, other), (1, &[80, 88, 94][..])], [(1, one), (60, other), (1, third)]]
    {
        assert_eq!(three_noisy(hits), [FaultName::CableDegraded; 3], "{hits:?}");
    }
}

// proves: HW-26 partial
#[test]
fn a_link_that_falls_together_with_one_of_several_belongs_to_all() {
    let mut bench = Bench::new(fifteen(), vec![(true, false); 15]);
    // The first and the last never meet; the one between them meets both.
    for at in 0..80_u64 {
        let hit = |numbers: &[u64]| u64::from(numbers.contains(&at));
        bench.noise(4, A, hit(&[2, 9, 23, 31, 40]));
        bench.noise(10, A, hit(&[9, 23, 40, 52, 66, 71]));
        bench.noise(0, C, hit(&[52, 66, 71, 78]));
        bench.now += Span::ms(5);
        bench.read_all();
    }
    let conditions = bench.conditions();
    let causes: Vec<_> = conditions.iter().map(|condition| condition.cause).collect();
    assert_eq!(causes, [FaultName::EmcNoise; 3]);
    let leaders = conditions.iter().filter(|condition| !condition.explains.is_empty());
    assert_eq!(leaders.count(), 1);
}

// proves: HW-28 partial
#[test]
fn symbols_made_anew_come_with_bad_frames_and_others_are_damage_of_their_own() {
    let tree = fifteen();
    let route = Route::intact(&tree);
    let hop = route.hop_from(3, B).unwrap();
    for is_later in [false, true] {
        let mut bench = Bench::new(tree.clone(), vec![(true, false); 15]);
        bench.hit(hop, 3, true);
        if is_later {
            bench.read_all();
            bench.read_all();
        }
        // As many symbols at another port that the bad frames pass.
        bench.noise(6, A, 3);
        bench.read_all();
        bench.read_all();
        let found = bench.located(false).hops;
        let nodes: Vec<_> = found.iter().filter_map(|damage| damage.hop.to.node()).collect();
        assert_eq!(nodes, if is_later { vec![4, 6] } else { vec![4] });
    }
}

// proves: HW-26 partial
#[test]
fn one_reading_after_a_long_time_says_nothing_of_the_same_moment() {
    assert!(!two_noisy(Span::s(10), &[(9, 4)]).contains(&FaultName::EmcNoise));
}

// proves: HW-23 partial
#[test]
fn old_counters_are_history() {
    let tree = fifteen();
    let mut model = NetworkModel::new(Network(0));
    for _ in 0..15 {
        model.add_device();
    }
    model.tree = Some(tree);
    let old = ErrorCounters::from_bytes(&[200; ErrorCounters::LEN], ErrorCounters::START);
    for round in 0..5 {
        for device in &mut model.devices {
            model.now = Instant::ZERO + Span::ms(10 * round);
            device.counters.record_counters(&old, model.now, Some(round));
        }
    }
    let input = LocateInput::of(&model, true).unwrap();
    assert_eq!(Located::on(&input), Located::default());
}

#[test]
fn errors_of_a_plug_being_pulled_are_no_damage() {
    let tree = fifteen();
    let mut bench = Bench::new(tree, vec![(true, false); 15]);
    bench.noise(5, C, 12);
    bump(bench.real[5].slot(ErrorCounter::LostLink(C)), 1);
    bench.read_all();
    bench.read_all();
    assert_eq!(bench.located(false), Located::default());
    // What comes later is.
    for _ in 0..3 {
        bench.now += Span::s(1);
        bench.read_all();
    }
    bench.noise(5, C, 2);
    bench.read_all();
    bench.read_all();
    let located = bench.located(false);
    assert_eq!(located.hops.iter().map(|d| d.symbols).collect::<Vec<_>>(), [Some(2)]);
}

#[test]
fn ports_that_nobody_read_share_the_suspicion() {
    let tree = fifteen();
    let mut bench = Bench::new(tree, vec![(false, false); 15]);
    bench.model.devices[2].counters = Default::default();
    bench.hit(3, 2, true);
    for node in (0..15).filter(|node| *node != 2).chain((0..15).filter(|node| *node != 2)) {
        bench.read(node);
    }
    let located = bench.located(false);
    assert_eq!(located.hops[0].hop.to, End::Controller(3, A));
    let earlier: Vec<_> = located.hops[0].or_earlier.iter().map(|hop| hop.to).collect();
    assert_eq!(earlier, [End::Controller(2, A)]);
}

fn trees() -> impl Strategy<Value = Tree> {
    proptest::collection::vec((any::<prop::sample::Index>(), 0..3usize), 0..30).prop_map(|picks| {
        let mut wired = vec![Wired { on: End::MainDevice(Path::A), entry: A }];
        let mut free: Vec<(usize, Port)> = vec![(0, D), (0, B), (0, C)];
        for (pick, _) in picks {
            let (node, port) = free.swap_remove(pick.index(free.len()));
            let new = wired.len();
            wired.push(Wired { on: End::Controller(node, port), entry: A });
            free.extend([(new, D), (new, B), (new, C)]);
        }
        Tree::from_wiring(&wired, None).unwrap()
    })
}

proptest! {
    /// On any tree with any mix of types, one damaged hop is found, whatever the order of reading.
    #[test]
    fn one_damaged_hop_on_any_tree_is_found(
        tree in trees(),
        kinds in proptest::collection::vec((any::<bool>(), any::<bool>()), 31),
        pick in any::<prop::sample::Index>(),
        frames in prop_oneof![Just(1u64), 2..20u64, Just(1_000)],
        symbols in any::<bool>(),
        interrupted in any::<prop::sample::Index>(),
    ) {
        let route = Route::intact(&tree);
        let hop = pick.index(route.hops().len() - 1);
        let len = tree.len();
        let mut bench = Bench::new(tree, kinds[..len].to_vec());
        for node in 0..len {
            if node == interrupted.index(len) {
                bench.hit(hop, frames, symbols);
            }
            bench.read(node);
            for damage in bench.located(false).hops {
                prop_assert_eq!(damage.hop, route.hops()[hop]);
            }
        }
        bench.read_all();
        bench.read_all();
        let located = bench.located(false);
        prop_assert_eq!(located.hops.len(), 1);
        prop_assert_eq!(located.hops[0].hop, route.hops()[hop]);
        prop_assert_eq!(located.hops[0].frames, frames.min(255));
    }
}

#[test]
fn counters_at_their_end_are_as_good_as_none() {
    let tree = fifteen();
    let mut bench = Bench::new(tree.clone(), vec![(true, false); 15]);
    // Somebody's old errors: port A of SubDevice 14 counts no more.
    *bench.real[13].slot(ErrorCounter::InvalidFrame(A)) = Some(255);
    *bench.real[13].slot(ErrorCounter::PhysicalLayer(A)) = Some(255);
    bench.model = NetworkModel::new(Network(0));
    for _ in 0..15 {
        bench.model.add_device();
    }
    bench.model.tree = Some(tree.clone());
    bench.read_all();
    let route = Route::intact(&tree);
    bench.hit(route.hop_to(13, A).unwrap(), 4, true);
    bench.read_all();
    bench.read_all();
    let located = bench.located(false);
    assert_eq!(located.hops.len(), 1, "{located:?}");
    // The next port got them marked as bad already: they were found bad at the port that is worn out.
    let damage = &located.hops[0];
    assert_eq!((damage.hop.to, damage.frames, damage.symbols), (End::Controller(13, A), 4, None));
}
