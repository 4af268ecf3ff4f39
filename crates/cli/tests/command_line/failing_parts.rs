//! Parts of a command that fail while it works: the command says so at once, and does not end with success.

use std::process::{Command, Stdio};

use crate::support::bench::{beside_segment, plant};
use crate::support::{PROGRAM, Run, run};
use tempfile::TempDir;

/// `told WORDS`: waits until the command under test has said that. `stopped`: ends it, and prints its status.
const FUNCTIONS: &str = r#"
    says() { for try in $(seq 200); do grep -q "$2" "$1" 2> /dev/null && return; sleep 0.05; done
             echo "$1 never said: $2"; }
    stopped() { kill -INT $job; wait $job; echo "status $?"; }
"#;

/// Runs a script beside a virtual segment's file; `$LINESMAN`, `$PLANT` and `$DIRECTORY` are set.
fn script(text: &str) -> Run {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join("plant.toml");
    std::fs::write(&path, plant("here", 1).to_toml()).unwrap();
    let mut command = Command::new("bash");
    command.args(["-c", &format!("cd $DIRECTORY; {FUNCTIONS}{text}")]).stdin(Stdio::null());
    command.env("LINESMAN", PROGRAM).env("PLANT", &path).env("DIRECTORY", directory.path());
    run(&mut command)
}

#[test]
fn an_event_log_that_is_removed_is_told_while_the_line_runs() {
    let run = script(
        r#"
        "$LINESMAN" run --on sim:$PLANT --log log > out 2> err & job=$!
        says out "have reached"
        rm log*
        says err "was logged is lost"
        kill -0 $job && echo "runs on"
        stopped
        cat err
    "#,
    );
    assert!(run.stdout.starts_with("runs on\nstatus 2\n"), "{}", run.all());
    assert!(run.stdout.contains("log: it was removed or replaced meanwhile"), "{}", run.all());
    assert!(run.stdout.contains("do: leave the file where it is"), "{}", run.all());
}

#[test]
fn a_control_socket_that_is_removed_is_told_while_the_line_runs() {
    let run = script(
        r#"
        "$LINESMAN" run --on sim:$PLANT --control socket > out 2> err & job=$!
        says out "have reached"
        rm socket
        says err "nobody can ask any more"
        kill -0 $job && echo "runs on"
        stopped
        grep -c "nobody can ask" err
    "#,
    );
    assert_eq!(run.stdout, "runs on\nstatus 2\n1\n", "{}", run.all());
}

#[test]
fn logs_and_sockets_that_stay_where_they_are_are_no_trouble() {
    let run = script(
        r#"
        "$LINESMAN" run --on sim:$PLANT --control socket --log log > out 2> err & job=$!
        says out "have reached"
        stopped
        grep -c error: err
        ls socket 2> /dev/null
    "#,
    );
    assert_eq!(run.stdout, "status 0\n0\n", "{}", run.all());
}

#[test]
fn a_recording_without_room_is_told_and_the_line_is_judged_all_the_same() {
    // No file may have more than 100 kB, as on a disk that is full.
    let run = script(
        r#"
        trap '' XFSZ
        (ulimit -f 100; exec "$LINESMAN" diagnose sim:$PLANT --record trace.pcapng > out 2> err)
        echo "status $?"
        grep -c "^HEALTHY" out
        cat err
    "#,
    );
    assert!(run.stdout.starts_with("status 2\n1\nerror: "), "{}", run.all());
    assert!(run.stdout.contains("trace.pcapng: recording the line: "), "{}", run.all());
    assert_eq!(run.stdout.matches("error:").count(), 1, "once: {}", run.all());
}

#[test]
fn an_answer_that_finds_no_room_is_no_success() {
    let run = script(
        r#"
        "$LINESMAN" diagnose sim:$PLANT > /dev/full 2> err; echo "status $?"; cat err
        "$LINESMAN" run --on sim:$PLANT --seconds 1 --json > /dev/full 2> err; echo "status $?"; cat err
    "#,
    );
    assert_eq!(run.stdout.matches("status 2\n").count(), 2, "{}", run.all());
    assert_eq!(run.stdout.matches("standard output").count(), 2, "{}", run.all());
}

#[test]
fn a_truth_log_and_a_socket_that_are_removed_are_told_while_the_segment_runs() {
    let Some(run) = beside_segment(&format!(
        r#"
        cd $DIRECTORY
        {FUNCTIONS}
        ip link add near1 type veth peer name far1; ip link set near1 up; ip link set far1 up
        "$LINESMAN" sim $PLANT --on far1 --control socket --log truth > out 2> err & job=$!
        says out Ctrl-C
        rm socket; says err "nobody can ask any more"
        rm truth
        stopped
        cat err
    "#
    )) else {
        return;
    };
    assert!(run.stdout.starts_with("status 2\n"), "{}", run.all());
    assert!(run.stdout.contains("error: socket: the control socket: "), "{}", run.all());
    assert!(run.stdout.contains("error: writing down what happened: "), "{}", run.all());
}

#[test]
fn an_interface_that_vanishes_ends_a_run_with_a_reason() {
    let Some(run) = beside_segment(&format!(
        r#"
        cd $DIRECTORY
        {FUNCTIONS}
        "$LINESMAN" run --on near0 > out 2> err & job=$!
        says out "have reached"
        ip link del near0
        wait $job; echo "status $?"
        grep -c "error: near0" err
    "#
    )) else {
        return;
    };
    assert_eq!(run.stdout, "status 2\n1\n", "{}", run.all());
}
