//! Two programs on one card. Needs root and `ip`.

use crate::support::bench::beside_segment;

#[test]
fn a_card_that_a_run_drives_is_refused_at_once_and_free_when_it_is_killed() {
    let Some(run) = beside_segment(
        r#"
        socket=$DIRECTORY/socket
        "$LINESMAN" run --on near0 --control $socket > $DIRECTORY/run.out & run=$!
        for try in $(seq 200); do grep -q 'have reached' $DIRECTORY/run.out && break; sleep 0.05; done
        for command in "run --on near0" "scan near0" "state near0" "diagnose near0" \
                "counters near0" "probe near0"; do
            began=$(date +%s%N)
            "$LINESMAN" $command > $DIRECTORY/out 2> $DIRECTORY/err
            echo "${command%% *} $? $(( ($(date +%s%N) - began) / 200000000 ))"
            grep -c "another MainDevice drives this line: process $run (.linesman run --on near0 --con" \
                $DIRECTORY/err
            grep -c "linesman online $socket.*linesman diagnose listen:near0" $DIRECTORY/err
        done
        "$LINESMAN" diagnose listen:near0 --seconds 0.5 > /dev/null; echo "listen $?"
        kill -KILL $run; wait $run 2> /dev/null
        "$LINESMAN" state near0 > /dev/null; echo "state $?"
    "#,
    ) else {
        return;
    };
    let mut expected = Vec::new();
    for command in ["run", "scan", "state", "diagnose", "counters", "probe"] {
        expected.extend([format!("{command} 2 0"), "1".to_owned(), "1".to_owned()]);
    }
    expected.extend(["listen 0".to_owned(), "state 0".to_owned()]);
    assert_eq!(run.stdout.lines().collect::<Vec<_>>(), expected, "{}", run.all());
}

#[test]
fn a_second_segment_on_one_card_is_refused() {
    let Some(run) = beside_segment(
        r#"
        "$LINESMAN" sim "$PLANT" --on far0 --seconds 1; echo "sim $? $sim"
        kill -KILL $sim; wait $sim 2> /dev/null
        "$LINESMAN" sim "$PLANT" --on far0 --seconds 0.1 > /dev/null; echo "sim $?"
    "#,
    ) else {
        return;
    };
    let lines: Vec<&str> = run.stdout.lines().collect();
    let [refused, "sim 0"] = lines[..] else { panic!("{}", run.all()) };
    let process = refused.strip_prefix("sim 2 ").unwrap_or_else(|| panic!("{}", run.all()));
    let said = format!("far0: a virtual segment answers on this card already: process {process} (");
    assert!(run.stderr.contains(&said), "{}", run.stderr);
}
