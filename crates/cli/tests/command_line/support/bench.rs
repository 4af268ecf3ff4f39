//! A virtual cable with a segment on its far end, in a network namespace of its own.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use linesman_sim::segment_file::SegmentFile;
use tempfile::TempDir;

use super::{PROGRAM, Run, run};

/// A coupler and two terminals behind it.
pub(crate) fn plant(name: &str, seed: u64) -> SegmentFile {
    let row = [("K1", "EK1100"), ("I1", "EL1008"), ("O1", "EL2008")];
    SegmentFile::in_a_row(name, seed, &row)
}

/// A virtual cable from `near0` to `far0`, with a segment on the far end while the script runs.
const BENCH: &str = r#"
set -e
ip link add near0 type veth peer name far0
for card in near0 far0; do
    sysctl -q -w net.ipv6.conf.$card.disable_ipv6=1
    ip link set $card up
done
"$LINESMAN" sim "$PLANT" --on far0 --control "$DIRECTORY/control" > "$DIRECTORY/sim.out" &
sim=$!
trap 'kill -INT $sim 2> /dev/null; wait $sim || true' EXIT
for try in $(seq 100); do
    grep -q Ctrl-C "$DIRECTORY/sim.out" 2> /dev/null && break
    sleep 0.05
done
set +e
"#;

/// Runs a script beside a segment; `None`, said aloud, where that cannot be.
pub(crate) fn beside_segment(script: &str) -> Option<Run> {
    let in_namespace = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--net", "bash", "-c", script]).stdin(Stdio::null());
        command
    };
    let probe = "ip link add near0 type veth peer name far0";
    if !in_namespace(probe).output().is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: a network namespace with a virtual cable cannot be made here");
        return None;
    }
    let directory = TempDir::new().expect("a temporary directory");
    let path: PathBuf = directory.path().join("plant.toml");
    let mut file = plant("live", 3);
    file.devices[2].group = Some("outputs".to_owned());
    std::fs::write(&path, file.to_toml()).expect("a file can be written");
    let mut command = in_namespace(&format!("{BENCH}{script}"));
    command.env("LINESMAN", PROGRAM).env("PLANT", &path).env("DIRECTORY", directory.path());
    Some(run(&mut command))
}
