//! `linesman sim` on virtual cables: what it costs, how it ends, what it tells. Needs root and `ip`.

use crate::support::assert_valid;
use crate::support::bench::beside_segment;

#[test]
fn an_idle_segment_costs_no_time() {
    // Fields 14 and 15 of /proc/PID/stat count 10 ms of user and system time.
    let script = r#"
        sleep 0.5
        ticks() { awk '{ print $14 + $15 }' /proc/$sim/stat; }
        switches() { awk '/^voluntary/ { n += $2 } END { print n }' /proc/$sim/task/*/status; }
        time=$(ticks); woken=$(switches)
        sleep 3
        echo "$(( $(ticks) - time )) $(( $(switches) - woken ))"
    "#;
    let Some(run) = beside_segment(script) else { return };
    let numbers: Vec<u32> = run.stdout.split_whitespace().map(|one| one.parse().unwrap()).collect();
    let [ticks, woken] = numbers.as_slice() else { panic!("{}", run.all()) };
    assert!(*ticks <= 1, "{ticks}0 ms of CPU in 3 s");
    assert!(*woken <= 30, "woken {woken} times in 3 s without a frame");
}

#[test]
fn a_segment_tells_what_it_served_and_whether_the_host_was_late() {
    let script = r#"
        "$LINESMAN" scan near0 > /dev/null || exit 8
        "$LINESMAN" fault "$DIRECTORY/control" status --json
    "#;
    let Some(run) = beside_segment(script) else { return };
    assert_eq!(run.status, 0, "{}", run.all());
    let status = run.json();
    assert_valid(&status, "sim");
    let number = |path: &str| status.pointer(path).unwrap().as_u64().unwrap();
    assert!(number("/frames/received") > 10, "{status}");
    assert_eq!(number("/frames/received"), number("/frames/answered"), "{status}");
    for what in ["pickup", "answer"] {
        let at = |field: &str| number(&format!("/host/{what}/{field}"));
        assert_eq!(at("frames"), number("/frames/received"), "{status}");
        assert!(at("p50_ns") <= at("p99_ns") && at("p99_ns") <= at("max_ns"), "{status}");
        assert!(at("max_ns") > 0, "{status}");
    }
    let busy = status["host"]["busy_share"].as_f64().unwrap();
    assert!(busy > 0.0 && busy < 1.0, "{status}");
}

#[test]
fn two_segments_in_one_process_end_cleanly() {
    let script = r#"
        ip link add near1 type veth peer name far1
        ip link set near1 up; ip link set far1 up
        kill -INT $sim; wait $sim; echo "first $?"
        "$LINESMAN" sim "$PLANT" --on far0 "$PLANT" --on far1 --control "$DIRECTORY/a" \
            --control "$DIRECTORY/b" --log "$DIRECTORY/la" --log "$DIRECTORY/lb" --json \
            > "$DIRECTORY/end.json" &
        both=$!
        for try in $(seq 100); do [ -S "$DIRECTORY/b" ] && break; sleep 0.05; done
        "$LINESMAN" fault "$DIRECTORY/b" inject link-open --at K1.B-I1.A > /dev/null || exit 7
        for card in near0 near1; do
            "$LINESMAN" scan $card --json | grep -c '"product_code"'
        done
        kill -TERM $both; wait $both; echo "both $?"
        wc -l < "$DIRECTORY/end.json"
        [ -e "$DIRECTORY/a" ] || [ -e "$DIRECTORY/b" ] || echo "sockets gone"
        wc -l < "$DIRECTORY/la"; grep -c '"begin"' "$DIRECTORY/lb"
    "#;
    let Some(run) = beside_segment(script) else { return };
    let lines: Vec<&str> = run.stdout.lines().map(str::trim).collect();
    let expected = ["first 0", "3", "1", "both 0", "2", "sockets gone", "0", "1"];
    assert_eq!(lines, expected, "{}", run.all());
}

#[test]
fn an_interface_that_goes_is_told_with_what_was_served() {
    let script = r#"ip link delete near0; wait $sim; echo "status $?"; cat "$DIRECTORY/sim.out""#;
    let Some(run) = beside_segment(script) else { return };
    assert!(run.stdout.starts_with("status 2\n"), "{}", run.all());
    assert!(run.stdout.contains("live ran for"), "{}", run.all());
    assert!(run.stderr.contains("far0: the interface is gone"), "{}", run.all());
}

// proves: JCT-11 partial: the line as a MainDevice on a card sees it
#[test]
fn devices_and_groups_are_plugged_out_and_in_while_it_runs() {
    let script = r#"
        ask() { "$LINESMAN" fault "$DIRECTORY/control" "$@" 2>&1; }
        devices() { "$LINESMAN" scan near0 --json | grep -c '"product_code"'; }
        devices
        ask unplug I1 | grep -c link-open; devices
        ask unplug I1 | grep -o 'unplugged already'
        ask plug I1 > /dev/null; sleep 0.2; devices
        ask unplug outputs > /dev/null; devices
        ask plug group:outputs --on K1.C | grep -o 'no cable fits both ports'
        ask plug group:outputs --on here | grep -c 'here'
        ask plug group:outputs --on I1.B > /dev/null; sleep 0.2; devices
        ask plug outputs | grep -o 'is plugged in'
        ask unplug nobody | grep -o 'no device or group is called `nobody`'
        ask events | grep -c 'link-open: \(begins\|ends\)'
        # What `heal` ends is plugged in, too.
        ask unplug O1 > /dev/null; ask heal > /dev/null; sleep 0.2; devices
        ask unplug O1 > /dev/null; devices
    "#;
    let Some(run) = beside_segment(script) else { return };
    let lines: Vec<&str> = run.stdout.lines().map(str::trim).collect();
    let expected = [
        "3",
        "1",
        "1",
        "unplugged already",
        "3",
        "2",
        "no cable fits both ports",
        "1",
        "3",
        "is plugged in",
        "no device or group is called `nobody`",
        "4",
        "3",
        "2",
    ];
    assert_eq!(lines, expected, "{}", run.all());
}
