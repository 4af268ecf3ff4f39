//! Interfaces of a run to other programs: the process image and states in shared memory, the log of
//! the system.

use std::fs;
use std::process::{Command, Stdio};

use crate::support::{PROGRAM, run};
use tempfile::TempDir;

/// Three terminals; the last one loses its supply after two seconds, for good.
const PLANT: &str = "\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
[[device]]\nname = \"T3\"\ntype = \"EL1008\"\non = \"T2.B\"\n\
[[device]]\nname = \"T4\"\ntype = \"EL1008\"\non = \"T3.B\"\n\
[[fault]]\nkind = \"device-off\"\ndevice = \"T4\"\nfrom_ms = 2000\n";

fn has_python() -> bool {
    let found = Command::new("python3").arg("--version").output().is_ok();
    if !found {
        eprintln!("SKIPPED: there is no python3 to be the other program");
    }
    found
}

/// Reads the image by its documented layout, until a state is other than it was.
const READER: &str = r#"
import struct, sys, time
def read(path):
    data = open(path, "rb").read()
    word = lambda at: struct.unpack_from("<Q", data, at * 8)[0]
    assert data[:8] == b"LINESMAN", data[:8]
    version, header = word(1) & 0xFFFFFFFF, word(1) >> 32
    assert (version, header) == (2, 72), (version, header)
    inputs, outputs = word(2) & 0xFFFFFFFF, word(2) >> 32
    devices, network = word(8) & 0xFFFFFFFF, word(8) >> 32
    whole = lambda count: (count + 7) // 8 * 8
    at = header + whole(inputs) + whole(outputs)
    states = struct.unpack_from(f"<{devices}H", data, at)
    return word(3), word(7), network, states
seen = []
end = time.time() + 30
while time.time() < end:
    try:
        before, flags, network, states = read(sys.argv[1])
        after = read(sys.argv[1])[0]
    except (FileNotFoundError, AssertionError):
        if seen: break
        time.sleep(0.01)
        continue
    if before != after or before % 2 or not flags & 1 and not seen:
        continue
    line = " ".join(f"{state:04x}" for state in states) + f" network {network:04x}"
    if not seen or seen[-1] != line:
        seen.append(line)
    if len(seen) > 1 and line.endswith("network 0900"):
        break
    time.sleep(0.002)
print("\n".join(seen))
"#;

// S0 L2548-2593.
// proves: PLC-05 partial: in shared memory, PLC-06 partial: in shared memory, PLC-07 partial: in shared memory
#[test]
fn another_program_reads_the_states_of_network_and_subdevices() {
    if !has_python() {
        return;
    }
    let folder = TempDir::new().unwrap();
    let (plant, image) = (folder.path().join("plant.toml"), folder.path().join("image"));
    let reader = folder.path().join("reader.py");
    fs::write(&plant, PLANT).unwrap();
    fs::write(&reader, READER).unwrap();
    let mut driving = Command::new(PROGRAM)
        .args(["run", "--on", &format!("sim:{}", plant.display()), "--no-diagnosis", "--image"])
        .arg(&image)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let seen = run(Command::new("python3").arg(&reader).arg(&image));
    let _ = driving.kill();
    let _ = driving.wait();
    let lines: Vec<&str> = seen.stdout.lines().collect();
    assert_eq!(lines.first(), Some(&"0008 0008 0008 0008 network 0000"), "{}", seen.all());
    // One that is not there, and its neighbour misses a link at port B.
    assert_eq!(lines.last(), Some(&"0008 0008 2408 0101 network 0900"), "{}", seen.all());
}

/// A journal that writes down what it is sent, where the real one would be; and a run beside it.
const JOURNAL: &str = r#"
set -e
mount -t tmpfs none /run
mkdir -p /run/systemd/journal
python3 - "$FOLDER/entries" <<'EOF' &
import socket, struct, sys
def fields(data):
    """Lines KEY=value, or KEY, the length of the value in 8 bytes, and the value."""
    while data:
        line, _, rest = data.partition(b"\n")
        if b"=" in line:
            yield line
            data = rest
        else:
            count, = struct.unpack_from("<Q", rest)
            yield line + b"=" + rest[8:8 + count]
            data = rest[8 + count + 1:]
journal = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
journal.bind("/run/systemd/journal/socket")
journal.settimeout(20)
with open(sys.argv[1], "wb", buffering=0) as file:
    while True:
        try:
            file.write(b"\n".join(fields(journal.recv(65536))) + b"\n----\n")
        except TimeoutError:
            break
EOF
journal=$!
trap 'kill $journal 2> /dev/null || true' EXIT
for try in $(seq 100); do [ -S /run/systemd/journal/socket ] && break; sleep 0.05; done
"$LINESMAN" run --on "sim:$PLANT" --seconds 3 --no-diagnosis --system-log > "$FOLDER/out" 2>&1
sleep 0.2
cat "$FOLDER/entries"
"#;

// S0 L2272-2390: events are in the log of the system after the tool has ended.
// proves: SW-07 partial: what is sent to journald; its filters are its own
#[test]
fn what_happens_is_told_to_the_log_of_the_system() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    fs::write(&plant, PLANT).unwrap();
    // Without a journal that is told, and nothing is run.
    let on = format!("sim:{}", plant.display());
    let script =
        format!("mount -t tmpfs none /run && \"$LINESMAN\" run --on {on} --seconds 1 --system-log");
    let in_namespace = |script: &str| {
        let mut command = Command::new("unshare");
        command.args(["--mount", "bash", "-c", script]).stdin(Stdio::null());
        command.env("LINESMAN", PROGRAM).env("PLANT", &plant).env("FOLDER", folder.path());
        command
    };
    let may = in_namespace("mount -t tmpfs none /run").output();
    if !may.is_ok_and(|output| output.status.success()) || !has_python() {
        eprintln!("SKIPPED: a mount namespace cannot be made here");
        return;
    }
    let refused = run(&mut in_namespace(&script));
    assert_eq!(refused.status, 2, "{}", refused.all());
    assert!(
        refused.stderr.contains("journald") && refused.stderr.contains("do: "),
        "{}",
        refused.stderr
    );
    let logged = run(&mut in_namespace(JOURNAL));
    let entries: Vec<&str> = logged.stdout.split("\n----\n").collect();
    let about_t4 = entries.iter().find(|entry| {
        entry.contains("LINESMAN_DEVICE=4") && entry.contains("LINESMAN_KIND=communication")
    });
    let entry = about_t4.unwrap_or_else(|| panic!("{}", logged.all()));
    assert!(entry.contains("SYSLOG_IDENTIFIER=linesman"), "{entry}");
    assert!(entry.contains("PRIORITY=3"), "an error: {entry}");
    assert!(entry.contains("Communication interrupted"), "{entry}");
    assert!(entry.contains(&format!("LINESMAN_LINE={on}")), "{entry}");
}
