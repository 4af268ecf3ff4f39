//! Start-up commands of a project by EoE and SoE, carried out on a line.

use std::fs;

use crate::support::{Run, linesman};
use tempfile::TempDir;

/// Saves a scan of a line of a coupler and a device, with these commands for that device, and drives it.
fn drive(kind: &str, commands: &str) -> Run {
    let folder = TempDir::new().unwrap();
    let (segment, project) = (folder.path().join("line.toml"), folder.path().join("project.toml"));
    // Drives have cables, terminals stand beside the coupler.
    let port = if kind.starts_with("AX") { 'C' } else { 'B' };
    let line = format!(
        "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"D\"\ntype = \"{kind}\"\non = \"K1.{port}\"\n"
    );
    fs::write(&segment, line).unwrap();
    let on = format!("sim:{}", segment.display());
    let saved = linesman(["scan", &on, "--save", project.to_str().unwrap()]);
    assert_eq!(saved.status, 0, "{}", saved.all());
    let text = fs::read_to_string(&project).unwrap();
    // Behind the keys of the last device.
    let at = text.rfind("[device.description]").unwrap();
    fs::write(&project, format!("{}{commands}\n{}", &text[..at], &text[at..])).unwrap();
    let words = ["run", project.to_str().unwrap(), "--on", &on, "--seconds", "2", "--no-diagnosis"];
    linesman(words)
}

// proves: SW-12
#[test]
fn addresses_of_an_ethernet_port_are_set_at_start_up() {
    let command =
        |eoe: &str| format!("[[device.start_up]]\ntransition = \"IP\"\neoe = {{ {eoe} }}");
    let run = drive("EL6601", &command("ip = \"192.168.1.11\", mask = \"255.255.255.0\""));
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("all 2 SubDevices have reached their states"), "{}", run.all());
    // The mistake is told before anything is switched on.
    let run = drive("EL6601", &command("ip = \"192.168.1.0\""));
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("192.168.1.0 ends in .0"), "{}", run.stderr);
    // A device without Ethernet ports says so.
    let run = drive("EL3102", &command("ip = \"192.168.1.11\""));
    assert!(run.stdout.contains("it does not speak EoE"), "{}", run.all());
    assert!(run.stdout.contains("192.168.1.11"), "the command is named: {}", run.all());
}

#[test]
fn what_a_drive_refuses_is_told_with_its_code() {
    let command = "[[device.start_up]]\ntransition = \"PS\"\nidn = \"S-0-0032\"\ndata = \"0b 00\"";
    let run = drive("AX5103-0012", command);
    assert!(run.stdout.contains("0x1001 there is no such IDN"), "{}", run.all());
    assert!(run.stdout.contains("S-0-0032 of drive 0"), "{}", run.all());
    let table = [
        ("idn = \"S-0-32x\"\ndata = \"00\"", "expected one such as S-0-0032"),
        ("idn = \"S-0-0032\"\ndrive = 8\ndata = \"00\"", "drive 0 to 7"),
        ("idn = \"S-0-0032\"", "there is no `data`"),
        ("idn = \"S-0-0032\"\nindex = 0x6060\ndata = \"00\"", "expected one of"),
        ("data = \"00\"", "expected one of"),
    ];
    for (lines, expected) in table {
        let command = format!("[[device.start_up]]\ntransition = \"PS\"\n{lines}");
        let run = drive("AX5103-0012", &command);
        assert_eq!(run.status, 2, "{lines}: {}", run.all());
        assert!(run.stderr.contains(expected), "{lines}: {}", run.stderr);
    }
}
