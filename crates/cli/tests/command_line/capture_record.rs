//! `linesman capture record`: a ring of files beside a line at work, and the end by a finding.

use crate::support::bench::beside_segment;
use crate::support::linesman;

/// A run that drives the line to OP while the script goes on.
const DRIVING: &str = r#"
    out=$DIRECTORY/run.out
    "$LINESMAN" run --on near0 --cycle 10ms > $out & run=$!
    for try in $(seq 200); do grep -q 'have reached' $out && break; sleep 0.05; done
"#;

// proves: WS-12 (V)
#[test]
fn ring_of_files_beside_a_run_keeps_the_last_ones_and_frames_of_it_are_saved_by_a_condition() {
    let script = r#"
        "$LINESMAN" capture record near0 -o "$DIRECTORY/trace.pcapng" --every 500ms --keep 3 --for 3s --mask
        echo "status $?"
        kill -TERM $run; wait $run
        ls "$DIRECTORY" | grep -c '^trace_0000[0-9]_[0-9]*.pcapng$'
        ls "$DIRECTORY" | grep -c '^trace_00001'
        "$LINESMAN" capture filter "$DIRECTORY"/trace_*.pcapng 'ecat.cmd == "LRW"' -o "$DIRECTORY/selected.pcapng"
        echo "filter $?"
        "$LINESMAN" capture list "$DIRECTORY/selected.pcapng" | grep -c LRW
        "$LINESMAN" diagnose "$DIRECTORY"/trace_*.pcapng > "$DIRECTORY/judged"; grep -o 'OP, ' "$DIRECTORY/judged"
    "#;
    let Some(run) = beside_segment(&format!("{DRIVING}{script}")) else { return };
    let lines: Vec<&str> = run.stdout.lines().map(str::trim).collect();
    let files = lines.iter().take_while(|line| line.contains("trace_")).count();
    assert_eq!(files, 3, "{}", run.all());
    let told = lines[files];
    assert!(told.contains("frames in 6 files, 3 older files removed"), "{}", run.all());
    assert_eq!(lines[files + 1], "status 0", "{}", run.all());
    assert_eq!(lines[files + 2..files + 4], ["3", "0"], "{}", run.all());
    assert!(lines.contains(&"filter 0"), "{}", run.all());
    let filtered = lines.iter().find(|line| line.contains("frames meet it")).unwrap();
    let saved = filtered.split(' ').next().unwrap();
    assert!(saved.parse::<u32>().unwrap() > 50, "{}", run.all());
    assert!(lines.contains(&saved), "each has its datagram: {}", run.all());
    assert_eq!(lines.last(), Some(&"OP,"), "{}", run.all());
}

// proves: WS-12 (V) partial: the end by a finding
#[test]
fn recording_ends_after_the_first_finding_and_holds_what_led_to_it() {
    let script = r#"
        "$LINESMAN" capture record near0 -o "$DIRECTORY/found.pcapng" --until-finding 500ms --for 30s > "$DIRECTORY/told" & record=$!
        sleep 1.5
        "$LINESMAN" fault "$DIRECTORY/control" inject link-open --at I1.B-O1.A > /dev/null || exit 8
        wait $record; echo "status $?" >&2
        cat "$DIRECTORY/told" >&2
        kill -TERM $run; wait $run
        "$LINESMAN" diagnose "$DIRECTORY"/found_*.pcapng --json
    "#;
    let Some(run) = beside_segment(&format!("{DRIVING}{script}")) else { return };
    assert!(run.stderr.contains("status 1"), "{}", run.all());
    let verdict = run.json();
    assert_eq!(verdict["verdict"], "faulty", "{}", run.all());
    assert!(run.stderr.contains("link-open; the recording ends 500"), "{}", run.all());
    let findings = verdict["findings"].as_array().unwrap();
    assert!(findings.iter().any(|finding| finding["cause"] == "link-open"), "{verdict:#}");
}

// proves: WS-12 (V) partial: the end by a condition
#[test]
fn recording_ends_after_the_first_frame_that_meets_a_condition_and_holds_the_chosen_frames() {
    let script = r#"
        "$LINESMAN" capture record near0 -o "$DIRECTORY/met.pcapng" --until 'ecat.cmd == "LRW" && wkc.wrong' \
            --after 300ms --only 'cyclic' --for 30s > "$DIRECTORY/told" & record=$!
        sleep 1.5
        "$LINESMAN" fault "$DIRECTORY/control" inject link-open --at I1.B-O1.A > /dev/null || exit 8
        wait $record; echo "status $?"
        cat "$DIRECTORY/told"
        kill -TERM $run; wait $run
        "$LINESMAN" capture filter "$DIRECTORY"/met_*.pcapng '!cyclic'
        "$LINESMAN" capture filter "$DIRECTORY"/met_*.pcapng 'ecat.cnt == 0'
    "#;
    let Some(run) = beside_segment(&format!("{DRIVING}{script}")) else { return };
    assert!(run.stdout.contains("status 1"), "{}", run.all());
    assert!(run.stdout.contains("the recording ends 300"), "{}", run.all());
    let met: Vec<&str> = run.stdout.lines().filter(|line| line.contains("meet")).collect();
    assert!(
        met.iter().any(|line| line.starts_with("0 of")),
        "frames without process data: {met:?}"
    );
}

#[test]
fn what_cannot_be_recorded_is_refused_before_anything_is_heard() {
    for (arguments, words) in [
        (["sim:plant.toml", "-o", "trace.pcapng"], "--record trace.pcapng"),
        (["trace.pcapng", "-o", "other.pcapng"], "recorded already"),
        (["eth0", "-o", "no/such/folder/trace.pcapng"], "no such folder"),
        (["eth0", "-o", "trace.pcap"], "end in .pcapng"),
    ] {
        let run = linesman([&["capture", "record"], &arguments[..]].concat());
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
    for (condition, words) in [
        (["--until", "ecat.cnt = (3"], "--until, column"),
        (["--only", "subdevice == \"K1\""], "known at the end alone"),
    ] {
        let run =
            linesman([&["capture", "record", "lo", "-o", "t.pcapng"], &condition[..]].concat());
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains(words), "{words}: {}", run.stderr);
    }
}
