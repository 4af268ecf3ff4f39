//! Ways in which a person goes away from a command at work. Needs root and `ip`.

use crate::support::bench::beside_segment;

/// What every script does: a run that drives the line to OP, and the states it has left behind.
const DRIVING: &str = r#"
    out=$DIRECTORY/run.out
    up() { for try in $(seq 200); do grep -q 'have reached' $out && return; sleep 0.05; done; }
    gone() { for try in $(seq 200); do kill -0 $1 2> /dev/null || return; sleep 0.05; done; }
    states() { "$LINESMAN" state near0 --json | grep -o '"al_state": "[A-Z]*"' | sort | uniq -c; }
"#;

/// A long cycle and either status of a run that ended by itself: a busy host that leaves cycles out is a finding.
fn driven(script: &str) -> Option<crate::support::Run> {
    beside_segment(&format!("{DRIVING}{script}"))
}

const ALL_IN_INIT: &str = "3 \"al_state\": \"INIT\"";

#[test]
fn a_lost_terminal_that_is_told_twice_brings_the_devices_down() {
    // The kernel and the shell both tell it; whoever ends the session sends SIGTERM behind.
    let Some(run) = driven(
        r#"
        "$LINESMAN" run --on near0 --cycle 20ms > $out & run=$!
        up
        kill -HUP $run; kill -HUP $run; sleep 0.01; kill -TERM $run
        wait $run; [ $? -le 1 ] && echo "ended by itself"
        grep -o 'outputs to zero$' $out
        states
    "#,
    ) else {
        return;
    };
    let expected = ["ended by itself", "outputs to zero", ALL_IN_INIT];
    assert_eq!(run.stdout.lines().map(str::trim).collect::<Vec<_>>(), expected, "{}", run.all());
}

#[test]
fn a_run_under_nohup_outlives_its_terminal() {
    let Some(run) = driven(
        r#"
        nohup "$LINESMAN" run --on near0 --cycle 20ms > $out 2> /dev/null & run=$!
        up
        kill -HUP $run; sleep 0.5; kill -0 $run && echo "runs on"
        kill -TERM $run; wait $run; [ $? -le 1 ] && echo "ended by itself"
        states
    "#,
    ) else {
        return;
    };
    let expected = ["runs on", "ended by itself", ALL_IN_INIT];
    assert_eq!(run.stdout.lines().map(str::trim).collect::<Vec<_>>(), expected, "{}", run.all());
}

#[test]
fn a_reader_that_goes_away_brings_the_devices_down() {
    // As `ssh HOST linesman run …` without a terminal: nothing but the pipe tells.
    for json in ["", "--json"] {
        let Some(run) = driven(&format!(
            r#"
            mkfifo $DIRECTORY/pipe
            "$LINESMAN" run --on near0 --control $DIRECTORY/socket {json} > $DIRECTORY/pipe & run=$!
            exec 5< $DIRECTORY/pipe
            for try in $(seq 200); do
                "$LINESMAN" state $DIRECTORY/socket 2> /dev/null | grep -c ' OP$' | grep -q 3 && break
                sleep 0.05
            done
            exec 5<&-
            gone $run; kill -0 $run 2> /dev/null && echo "runs on"
            states
        "#
        )) else {
            return;
        };
        assert_eq!(run.stdout.trim(), ALL_IN_INIT, "{}", run.all());
        assert!(run.stderr.contains("nobody reads standard output any more"), "{}", run.stderr);
    }
}

#[test]
fn a_lost_terminal_ends_a_watch_with_what_was_seen() {
    let Some(run) = driven(
        r#"
        for command in "diagnose near0" "diagnose listen:near0" "counters near0 --for 600"; do
            "$LINESMAN" $command > $out & watch=$!
            [ "$command" = "diagnose listen:near0" ] && "$LINESMAN" state near0 > /dev/null
            sleep 1.2; kill -HUP $watch; kill -HUP $watch; wait $watch
            status=$?
            [ -s $out ] && echo "${command%% *} $status"
        done
        kill -HUP $sim; kill -HUP $sim; wait $sim; echo "sim $?"
        grep -c 'live ran for' $DIRECTORY/sim.out
    "#,
    ) else {
        return;
    };
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert_eq!(lines.len(), 5, "{}", run.all());
    assert!(lines.iter().all(|line| !line.contains("129")), "{}", run.all());
    assert_eq!(lines[3..], ["sim 0", "1"], "{}", run.all());
}
