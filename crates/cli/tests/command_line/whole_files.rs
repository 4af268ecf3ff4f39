//! Files that do not fit on the disk: none of them stays half written. Needs root for a small disk.

use std::fs;
use std::process::Command;

use crate::support::{PROGRAM, Run, run};
use tempfile::TempDir;

/// Runs a script beside a disk of 12 KiB at `small`, with a plant; `None`, said aloud,
/// where that cannot be.
fn on_a_small_disk(script: &str) -> Option<Run> {
    let folder = TempDir::new().unwrap();
    let path = folder.path();
    let mut plant = String::from("name = \"wide\"\n");
    for no in 1..=60 {
        let on = if no == 1 { "maindevice".to_owned() } else { format!("T{}.B", no - 1) };
        let kind = if no == 1 { "EK1100" } else { "EL2008" };
        plant
            .push_str(&format!("[[device]]\nname = \"T{no}\"\ntype = \"{kind}\"\non = \"{on}\"\n"));
    }
    fs::write(path.join("plant.toml"), plant).unwrap();
    fs::create_dir(path.join("small")).unwrap();
    let mount = "mount -t tmpfs -o size=12k none small";
    let script = format!("cd {}; {mount} || exit 77\n{script}", path.display());
    let mut command = Command::new("unshare");
    command.args(["--mount", "bash", "-c", &script]).env("LINESMAN", PROGRAM);
    let run = run(&mut command);
    if matches!(run.status, 77 | 1) && run.stdout.is_empty() {
        eprintln!("SKIPPED: no disk of its own can be had here: {}", run.stderr);
        return None;
    }
    Some(run)
}

#[test]
fn no_half_written_file_stays_on_a_full_disk() {
    let Some(run) = on_a_small_disk(
        r#"
        "$LINESMAN" diagnose sim:plant.toml --seconds 1 --html small/page.html > /dev/null; echo "html $?"
        "$LINESMAN" diagnose sim:plant.toml --seconds 1 --svg small/line.svg > /dev/null; echo "svg $?"
        "$LINESMAN" scan sim:plant.toml --save small/machine.toml > /dev/null; echo "save $?"
        "$LINESMAN" scan sim:plant.toml --save machine.toml > /dev/null || exit 9
        "$LINESMAN" plan machine.toml --export small/eni.xml > /dev/null; echo "export $?"
        "$LINESMAN" plan machine.toml --segment small/again.toml > /dev/null; echo "segment $?"
        "$LINESMAN" counters sim:plant.toml --for 3 --csv small/read.csv > /dev/null; echo "csv $?"
        ls -A small
    "#,
    ) else {
        return;
    };
    let lines: Vec<&str> = run.stdout.lines().collect();
    assert_eq!(lines.len(), 6, "a file stays: {}", run.all());
    assert_eq!(run.stderr.matches("No space left on device").count(), 6, "{}", run.all());
}

#[test]
fn what_fits_on_the_disk_is_written() {
    let Some(run) = on_a_small_disk(
        r#"
        "$LINESMAN" plan plant.toml > /dev/null
        "$LINESMAN" sii sim:plant.toml T2 read --save small/T2.bin > /dev/null; echo "sii $?"
        ls -A small
    "#,
    ) else {
        return;
    };
    assert_eq!(run.stdout, "sii 0\nT2.bin\n", "{}", run.all());
}
