//! `linesman diagnose FILE` with texts of other tools, pasted into a file: one or several, in any encoding, cut off.

use std::path::{Path, PathBuf};

use crate::support::{Run, assert_valid, linesman};
use serde_json::{Value, json};
use tempfile::TempDir;

/// Runs `diagnose` on a file with this content.
fn diagnose(name: &str, content: &[u8], options: &[&str]) -> Run {
    let directory = TempDir::new().unwrap();
    let path = directory.path().join(name);
    std::fs::write(&path, content).unwrap();
    let mut arguments = vec!["diagnose".to_owned(), path.display().to_string()];
    arguments.extend(options.iter().map(|option| (*option).to_owned()));
    linesman(arguments)
}

fn as_json(name: &str, content: &[u8]) -> Value {
    let run = diagnose(name, content, &["--json"]);
    let diagnosis = run.json();
    assert_valid(&diagnosis, "diagnosis");
    diagnosis
}

fn codes(diagnosis: &Value) -> Vec<&str> {
    let findings = diagnosis["findings"].as_array().unwrap();
    findings.iter().map(|finding| finding["code"].as_str().unwrap()).collect()
}

const ONLINE: &str = "\
No\tAddr\tName\tState\tCRC
1\t1001\tTerm 1 (EK1100)\tOP\t0, 0
2\t1002\tTerm 2 (EL1008)\tOP\t0, 0
3\t1003\tTerm 3 (EK1110)\tOP LNK_MIS B\t0
4\t1004\tTerm 4 (EK1100)\tINIT NO_COMM\t0
5\t1005\tTerm 5 (EL2008)\tINIT NO_COMM\t0
";

const MASTER: &str = "\
root@box:~# ethercat master
Master0
  Phase: Operation
  Active: yes
  Slaves: 2
  Ethernet devices:
    Main: 00:1b:21:aa:bb:cc (attached)
      Link: UP
      Tx frames:   2502841
      Tx errors:   0
    Common:
      Tx frames:   2502841
      Rx frames:   2499804
      Lost frames: 3037
      Loss rate [1/s]:          2      0      0
      Frame loss [%]:         0.2    0.0    0.0
";

const CARD: &str = "\
root@box:~# ethtool -S enp2s0
NIC statistics:
     rx_packets: 2499804
     tx_packets: 2502841
     rx_crc_errors: 0
     rx_missed_errors: 0
";

const SLAVES: &str = "\
root@box:~# ethercat slaves
0  0:0  OP  +  EK1100 EtherCAT-Koppler (2A E-Bus)
1  0:1  OP  +  EL2008 8K. Dig. Ausgang 24V, 0.5A
";

#[test]
fn an_online_list_leads_to_the_link_and_says_what_was_assumed() {
    let run = diagnose("online.csv", ONLINE.as_bytes(), &[]);
    assert_eq!(run.status, 1, "{}", run.all());
    let head: Vec<&str> = run.stdout.lines().take(2).collect();
    assert_eq!(head[0], "understood  lines 1-6: TwinCAT Online list of 5 SubDevices");
    assert!(head[1].starts_with("assumed     the wiring is not told"), "{}", run.stdout);
    let diagnosis = as_json("online.csv", ONLINE.as_bytes());
    assert_eq!(codes(&diagnosis), ["H101"]);
    let place = &diagnosis["findings"][0]["place"];
    assert_eq!(
        (&place["a"], &place["b"]),
        (&json!({ "no": 3, "port": "B" }), &json!({ "no": 4, "port": "A" }))
    );
    assert!(run.stdout.contains("Term 4 (EK1100)"), "{}", run.stdout);
}

#[test]
fn every_encoding_and_delimiter_gives_the_same_finding() {
    let expected = as_json("online.txt", ONLINE.as_bytes())["findings"].clone();
    let wide: Vec<u8> = ONLINE.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let marked: Vec<u8> = [0xFF, 0xFE].into_iter().chain(wide.iter().copied()).collect();
    let windows =
        [b"Gr\xF6\xDFe der Anlage\r\n".as_slice(), ONLINE.replace('\n', "\r\n").as_bytes()]
            .concat();
    let quoted: String = ONLINE
        .lines()
        .map(|line| {
            line.split('\t').map(|cell| format!("\"{cell}\"")).collect::<Vec<_>>().join(",") + "\n"
        })
        .collect();
    let texts = [
        ("UTF-16 without a mark", wide),
        ("UTF-16", marked),
        ("Windows code page, CRLF", windows),
        ("semicolons", ONLINE.replace('\t', ";").into_bytes()),
        ("quoted commas", quoted.into_bytes()),
        ("blanks", ONLINE.replace('\t', "   ").into_bytes()),
    ];
    for (name, content) in texts {
        assert_eq!(as_json("online.log", &content)["findings"], expected, "{name}");
    }
}

#[test]
fn several_texts_in_one_file_are_one_observation() {
    let text = format!("Hello,\nthis is all I have.\n\n{SLAVES}\n{MASTER}\n{CARD}");
    let run = diagnose("notes.txt", text.as_bytes(), &[]);
    for line in [
        "understood  lines 5-6: `ethercat slaves` of 2 SubDevices",
        "            lines 9-23: `ethercat master`, phase Operation",
        "            lines 26-30: `ethtool -S` of enp2s0",
        "not understood  2 lines: 1, 2",
        "  1: \"Hello,\"",
    ] {
        assert!(run.stdout.lines().any(|one| one == line), "{line}:\n{}", run.stdout);
    }
    let diagnosis = as_json("notes.txt", text.as_bytes());
    let understood = &diagnosis["understood"];
    assert_eq!(understood["ignored_count"], 2);
    assert_eq!(understood["blocks"][1]["from"], 9);
    // The card is clean and has dropped nothing: the frames were not damaged.
    assert_eq!(codes(&diagnosis), ["H114"], "{diagnosis:#}");
    assert_eq!(diagnosis["findings"][0]["place"]["kind"], "host");
    assert_eq!(diagnosis["network"]["lost"], 3037);
}

#[test]
fn frames_lost_of_a_start_long_ago_are_a_note() {
    let master = MASTER
        .replace("Lost frames: 3037", "Lost frames: 9")
        .replace("  2      0      0", "  0      0      0");
    let diagnosis = as_json("master.txt", master.as_bytes());
    assert_eq!(codes(&diagnosis), ["H114"]);
    assert_eq!(diagnosis["findings"][0]["severity"], "info");
}

#[test]
fn a_kernel_log_tells_times_links_and_codes() {
    let log = "\
[  100.000000] EtherCAT 0: Link state of ecm0 changed to UP.
[  100.200000] EtherCAT 0: 3 slave(s) responding on main device.
[  101.000000] EtherCAT WARNING 0: 2 datagrams TIMED OUT!
[  105.000000] EtherCAT 0: Domain 0: Working counter changed to 3/3.
[ 9000.000000] EtherCAT WARNING 0: 12 datagrams UNMATCHED!
[ 9000.500000] EtherCAT 0: Domain 0: Working counter changed to 1/3.
[ 9000.600000] EtherCAT ERROR 0-2: AL status message 0x001B: \"Sync manager watchdog\".
";
    let run = diagnose("dmesg.log", log.as_bytes(), &[]);
    assert_eq!(run.status, 1, "{}", run.all());
    assert!(run.stdout.contains("1 count of a start"), "{}", run.stdout);
    assert!(run.stdout.contains("at 9000.600 s"), "the times of the log:\n{}", run.stdout);
    let diagnosis = as_json("dmesg.log", log.as_bytes());
    let codes = codes(&diagnosis);
    assert!(codes.contains(&"S202") && codes.contains(&"T412"), "{codes:?}");
    let watchdog = &diagnosis["findings"]
        .as_array()
        .unwrap()
        .iter()
        .find(|one| one["code"] == "S202")
        .unwrap();
    assert_eq!(watchdog["place"]["no"], 3);
    assert_eq!(watchdog["consequences"][0]["code"], "S210", "{watchdog:#}");
}

#[test]
fn a_log_that_only_shows_a_good_start_accuses_nobody() {
    let log = "\
[  100.000000] ec_igb 0000:02:00.0 eth0: Link is Down
[  102.000000] EtherCAT 0: Link state of ecm0 changed to UP.
[  102.200000] EtherCAT 0: 3 slave(s) responding on main device.
[  102.300000] EtherCAT 0: Slave states on main device: INIT.
[  102.310000] EtherCAT 0: Scanning bus.
[  102.320000] EtherCAT WARNING 0: 1 datagram TIMED OUT!
[  102.500000] EtherCAT 0: Bus scanning completed in 190 ms.
[  102.600000] EtherCAT 0: Slave states on main device: PREOP.
[  110.000000] EtherCAT 0: Domain 0: Working counter changed to 1/3.
[  111.000000] EtherCAT 0: Domain 0: 2 working counter changes - now 3/3.
[  111.100000] EtherCAT 0: Slave states on main device: OP.
";
    let diagnosis = as_json("dmesg.log", log.as_bytes());
    assert_eq!(codes(&diagnosis), [""; 0], "{diagnosis:#}");
}

#[test]
fn a_file_without_an_ending_is_told_by_its_content() {
    let run = diagnose("online", ONLINE.as_bytes(), &[]);
    assert_eq!(run.status, 1, "{}", run.all());
    // An observation file under any name.
    let run = diagnose(
        "typed.txt",
        b"[[device]]\nname = \"K1\"\non = \"maindevice\"\nsate = \"OP\"\n",
        &[],
    );
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("sate") && run.stderr.contains("line 4"), "{}", run.stderr);
    // A text that was saved as TOML.
    let run = diagnose("pasted.toml", ONLINE.as_bytes(), &[]);
    assert_eq!(run.status, 1, "{}", run.all());
}

#[test]
fn nothing_understood_ends_with_2_and_names_what_is_taken() {
    for (name, content) in [
        ("letter.txt", b"Dear colleague,\nthe machine stands still.\n".as_slice()),
        ("empty.txt", b""),
        ("noise.log", b"\x00\xFF\x13\x37\n\xC0\xC0"),
    ] {
        let run = diagnose(name, content, &[]);
        assert_eq!(run.status, 2, "{name}: {}", run.all());
        for part in [
            name,
            "nothing",
            "`ethercat slaves -v`",
            "ethtool",
            "TwinCAT Online list",
            "linesman schema observations",
        ] {
            assert!(run.stderr.contains(part), "{name}: {part}: {}", run.stderr);
        }
    }
    let run = linesman(["diagnose", "there-is-no-such-file.txt"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("there is no such file"), "{}", run.stderr);
}

#[test]
fn a_page_is_written_of_a_pasted_text() {
    let directory = TempDir::new().unwrap();
    let page = directory.path().join("page.html");
    let run = diagnose("online.txt", ONLINE.as_bytes(), &["--html", page.to_str().unwrap()]);
    assert_eq!(run.status, 1, "{}", run.all());
    let page = std::fs::read_to_string(page).unwrap();
    assert!(
        page.contains("Term 4 (EK1100)") && page.contains("TwinCAT Online list of 5 SubDevices"),
        "{page}"
    );
}

fn real_logs() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("LINESMAN_DATA").map_or(beside, PathBuf::from);
    let folder = data.join("sii/textlogs");
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no logs in {}; set LINESMAN_DATA", folder.display());
    None
}

#[test]
fn real_logs_are_understood_to_their_last_line() {
    let Some(folder) = real_logs() else { return };
    let rows = [
        ("ec-soem-slaveinfo-2xEL2004.txt", 3, 0, "SAFEOP"),
        ("ec-soem-slaveinfo-2xLAN9252.txt", 2, 0, "SAFEOP"),
        // A remark of whoever wrote it down.
        ("igh-slaves-v-EL3255-EK1110-ebus.txt", 2, 1, "PREOP"),
    ];
    for (name, devices, ignored, state) in rows {
        let path = folder.join(name);
        let run = linesman(["diagnose".as_ref(), path.as_os_str(), "--json".as_ref()]);
        let diagnosis = run.json();
        assert_eq!(diagnosis["network"]["devices"], devices, "{name}");
        assert_eq!(diagnosis["network"]["al_state_highest"], state, "{name}");
        assert_eq!(diagnosis["understood"]["ignored_count"], ignored, "{name}: {diagnosis:#}");
        assert_eq!(
            diagnosis["understood"]["assumed"],
            json!([]),
            "{name}: the texts tell the wiring"
        );
        let errors = diagnosis["findings"]
            .as_array()
            .unwrap()
            .iter()
            .filter(|one| one["severity"] != "info");
        assert_eq!(errors.count(), 0, "{name}: {diagnosis:#}");
    }
}
