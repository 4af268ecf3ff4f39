//! `linesman explain` knows what people type and paste: each word leads to the pages that are meant, the
//! most likely first.

use std::path::Path;
use std::process::Command;

use crate::support::{PROGRAM, assert_valid, linesman, run};

/// The titles of the pages for a word.
#[track_caller]
fn titles(word: &str) -> Vec<String> {
    let run = linesman(["explain", "--json", "--", word]);
    assert_eq!(run.status, 0, "{word}: {}", run.all());
    let report = run.json();
    let readings = report["readings"].as_array().expect("readings");
    readings.iter().map(|reading| reading["title"].as_str().expect("a title").to_owned()).collect()
}

/// Fails unless the titles of the pages begin so, in this order.
#[track_caller]
fn lead_to(table: &[(&str, &[&str])]) {
    for (word, expected) in table {
        let titles = titles(word);
        let fits = titles.len() >= expected.len()
            && titles.iter().zip(*expected).all(|(title, expected)| title.starts_with(expected));
        assert!(fits, "{word}: expected {expected:?}, got {titles:?}");
    }
}

/// What the page of a word says, in one line.
#[track_caller]
fn text(word: &str) -> String {
    let run = linesman(["explain", "--", word]);
    assert_eq!(run.status, 0, "{word}: {}", run.all());
    run.stdout.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[test]
fn numbers_of_codes_lead_to_their_pages() {
    lead_to(&[
        ("0x001B", &["AL status code 0x001B: sync manager watchdog"]),
        ("001B", &["AL status code 0x001B"]),
        ("1B", &["AL status code 0x001B", "Error register 0x1B"]),
        ("1bh", &["AL status code 0x001B"]),
        ("16#001B", &["AL status code 0x001B"]),
        ("27", &["AL status code 0x001B", "AL status code 0x0027"]),
        ("AL 0x001B", &["AL status code 0x001B"]),
        ("AL status code 0x001B", &["AL status code 0x001B"]),
        ("ALstatuscode=0x001b", &["AL status code 0x001B"]),
        ("al:0x001D", &["AL status code 0x001D"]),
        ("AL status 0x14", &["AL status 0x0014: SAFEOP, error", "AL status code 0x0014"]),
        ("0x14", &["AL status code 0x0014", "AL status 0x0014"]),
        ("AL 0x0012 0x001E", &["AL status 0x0012: PREOP, error", "AL status code 0x001E"]),
        ("06010000", &["CoE abort code 0x06010000: Unsupported access"]),
        ("0x06010002", &["CoE abort code 0x06010002: Attempt to write a read only object"]),
        ("6090011", &["CoE abort code 0x06090011: Subindex does not exist"]),
        ("abort 06020000", &["CoE abort code 0x06020000"]),
        ("SDO abort code 0x06010000", &["CoE abort code 0x06010000"]),
        ("100728832", &["CoE abort code 0x06010000"]),
        (
            "8130",
            &["Emergency code 0x8130: life guard", "CoE object 0x8130", "AL status code 0x8130"],
        ),
        ("0x8611", &["Emergency code 0x8611: following error"]),
        ("2310", &["Emergency code 0x2310: continuous overcurrent", "CoE object 0x2310"]),
        ("emergency 0x8613", &["Emergency code 0x8613: monitoring (not in the specifications"]),
        ("FoE 0x8008", &["FoE error 0x8008: the file can be accessed in BOOT only"]),
        ("mailbox error 2", &["Mailbox error 0x0002"]),
        ("SoE 0x7008", &["SoE error 0x7008"]),
        ("0x4413", &["Text number 0x4413 of Beckhoff: I2t"]),
        ("1C21E000", &["Code of a diagnosis message 0x1C21E000: of the manufacturer"]),
        ("00E0211C", &["Code of a diagnosis message 0x1C21E000"]),
    ]);
}

#[test]
fn registers_objects_and_ports_are_found_in_any_spelling() {
    lead_to(&[
        ("0x0130", &["Register 0x0130: AL status"]),
        ("0130", &["Register 0x0130: AL status"]),
        ("0x0134", &["Register 0x0134: AL status code"]),
        ("0300", &["Register 0x0300: RX error counter, port A"]),
        ("0x0303", &["Register 0x0302: RX error counter, port B"]),
        ("register 0x0110", &["Register 0x0110: DL status"]),
        ("al-status", &["Register 0x0130: AL status"]),
        ("RX error counter port B", &["Register 0x0302"]),
        ("FMMU 2", &["Register 0x0620: FMMU 2"]),
        ("0x1C12", &["CoE object 0x1C12: RxPDO assignment"]),
        ("1c13", &["CoE object 0x1C13: TxPDO assignment"]),
        ("0x1C32:0B", &["CoE object 0x1C32:0B: Synchronisation of outputs, SM event missed"]),
        ("1C32.11", &["CoE object 0x1C32:0B", "CoE object 0x1C32:11"]),
        ("0x1018 sub 1", &["CoE object 0x1018:01: Identity, vendor"]),
        ("0x6041", &["CoE object 0x6041: Statusword"]),
        ("6040", &["CoE object 0x6040: Controlword"]),
        ("0x6841", &["CoE object 0x6841: Statusword of axis 2"]),
        ("Statusword", &["CoE object 0x6041: Statusword"]),
        ("0x603F", &["CoE object 0x603F: Error code"]),
        ("0x1A02", &["CoE object 0x1A02: TxPDO mapping"]),
        ("0xF030", &["CoE object 0xF030: Configured module idents"]),
        ("0x2002", &["CoE object 0x2002: objects of the manufacturer"]),
        ("60410010", &["Mapped entry 0x60410010: 0x6041:00, 16 bits"]),
        ("port B", &["Port B"]),
        ("Port 3", &["Port D"]),
        ("1002", &["Station address 1002 (0x03EA)"]),
    ]);
}

#[test]
fn states_and_words_of_other_tools_are_known() {
    lead_to(&[
        ("SAFEOP", &["State SAFEOP"]),
        ("SAFEOP+ERR", &["State SAFEOP with error"]),
        ("SAFE_OP + ERROR", &["State SAFEOP with error"]),
        ("PREOP  E", &["State PREOP with error"]),
        ("Pre-Operational", &["State PREOP"]),
        ("BOOT", &["State BOOT"]),
        ("OP LNK_MIS B", &["State word 0x2408: OP LNK_MIS B"]),
        ("0x2408", &["State word 0x2408: OP LNK_MIS B"]),
        ("State 0x4861", &["State word 0x4861: INIT VPRS INIT_ERR LNK_ADD C"]),
        ("DevState 0x0C00", &["DevState 0x0C00: Not OK - at least one device in SAFEOP"]),
        ("Frm0WcState 0x8000", &["FrmXWcState 0x8000: the whole frame"]),
        ("NO_COMM", &["TwinCAT: NO_COMM"]),
        ("LNK_MIS", &["TwinCAT: LNK_MIS"]),
        ("LNK:ADD", &["TwinCAT: LNK_ADD"]),
        ("VPRS", &["TwinCAT: VPRS"]),
        ("INIT_ERR", &["TwinCAT: INIT_ERR"]),
        ("WcState", &["TwinCAT: WcState"]),
        ("InputToggle", &["TwinCAT: InputToggle"]),
        ("WKC", &["EtherCAT: WKC"]),
        ("working counter", &["EtherCAT: WKC"]),
        ("WKC 2/3", &["Working counter 2, expected 3"]),
        ("LRW", &["Command LRW (code 12)"]),
        ("armw", &["Command ARMW (code 13)"]),
        ("cmd 0x07", &["Command BRD (code 7)"]),
        ("SKIPPED", &["IgH: SKIPPED"]),
        ("UNMATCHED", &["IgH: UNMATCHED"]),
        ("TIMED OUT", &["IgH: TIMED OUT"]),
        ("datagram UNMATCHED", &["IgH: UNMATCHED"]),
        ("no slaves found", &["SOEM: no slaves found"]),
        ("WkcError", &["SOEM: WkcError"]),
        ("WorkingCounter { expected: 3, received: 1 }", &["ethercrab: WorkingCounter"]),
        ("SyncManagerWatchdog", &["AL status code 0x001B"]),
        ("SubDevice(SyncManagerWatchdog)", &["ethercrab: SubDevice", "AL status code 0x001B"]),
        ("Invalid mailbox configuration", &["AL status code 0x0015", "AL status code 0x0016"]),
        ("Invalid output configuration", &["AL status code 0x001D"]),
        ("SYNC0", &["EtherCAT: SYNC0"]),
        ("sync unit", &["TwinCAT: Sync Unit"]),
        ("truth log", &["Glossary: truth log"]),
        ("H101", &["Finding H101 link-lost"]),
        ("c304", &["Finding C304 plugged-otherwise"]),
        ("link-open", &["Fault link-open"]),
        ("own frames", &["Own frames taken for answers"]),
    ]);
}

#[test]
fn a_line_of_a_log_leads_to_the_codes_and_messages_in_it() {
    lead_to(&[
        (
            "EtherCAT ERROR 0-0: AL status message 0x001E: \"Invalid input configuration\".",
            &["AL status code 0x001E", "IgH: AL status message"],
        ),
        ("[ 9021.334] EtherCAT WARNING 0: 17 datagrams UNMATCHED!", &["IgH: UNMATCHED"]),
        (
            "EtherCAT 0: Domain 0: Working counter changed to 2/3.",
            &["Working counter 2, expected 3", "IgH: Working counter changed"],
        ),
        (
            "EtherCAT ERROR 0-2: Failed to set SAFEOP state, slave refused state change (PREOP + ERROR).",
            &["IgH: slave refused state change", "State PREOP with error"],
        ),
        (
            "EtherCAT ERROR 0-1: SDO abort message 0x06090011: \"Subindex does not exist\".",
            &["CoE abort code 0x06090011"],
        ),
        (
            "'Term 3 (EL4102)' (1002): abnormal state change (from 'OP' to 'SAFEOP') with code 0x1b.",
            &["AL status code 0x001B", "TwinCAT: abnormal state change"],
        ),
        (
            "'Term 5' (1005): 'INIT to PREOP' failed! AL Status '0x0011' read and '0x0002' expected. AL \
             Status Code '0x0014 - No valid firmware'",
            &["AL status 0x0011: INIT, error", "AL status code 0x0014"],
        ),
        (
            "'Term 14 (EL4102)' (1002): CoE ('InitDown' 0x10f0:01) - SDO Abort ('Attempt to write a read \
             only object.', 0x06010002).",
            &["CoE abort code 0x06010002", "TwinCAT: SDO Abort", "CoE object 0x10F0:01"],
        ),
        (
            "slave 1 State=0x14 StatusCode=0x001b : Sync manager watchdog",
            &["AL status 0x0014: SAFEOP, error", "AL status code 0x001B"],
        ),
        (
            "ERROR : slave 2 is in SAFE_OP + ERROR, attempting ack.",
            &["SOEM: SAFE_OP + ERROR, attempting ack"],
        ),
    ]);
}

#[test]
fn values_are_read_bit_by_bit() {
    for (word, expected) in [
        ("DL 0x5617", &["A carrier, open", "B no carrier, closed"][..]),
        ("0x0110 = 0x5617", &["DL status (0x0110) = 0x5617"]),
        ("rx 0x0412", &["invalid frames 18", "physical-layer errors 4"]),
        ("0x6041 = 0x0237", &["State of the drive: operation enabled", "not set: fault"]),
        ("Statusword 0x1208", &["State of the drive: fault", "3: fault"]),
        ("0x1001 = 0x11", &["0: generic", "4: communication"]),
        ("0x0134 = 0x001E", &["AL status code 0x001E", "invalid input configuration"]),
        ("0x603F = 0x8611", &["Emergency code 0x8611: following error"]),
        ("0x1C32:0B = 5", &["SM event missed"]),
        ("State 0x2408", &["LNK_MIS", "port B", "Look at the cable at that port"]),
        ("Frm1WcState 0x0005", &["wrong working counter in datagram 1, 3 of the frame"]),
        ("WKC 9 expected 12", &["It is 3 too low"]),
        ("wkc 4/3", &["two SubDevices answer to one address"]),
    ] {
        let text = text(word);
        for part in expected {
            assert!(text.contains(part), "{word}: {part}: {text}");
        }
    }
}

#[test]
fn bytes_of_messages_are_read_field_by_field() {
    // The beginning of what a servo terminal notes: code of product 7201, error, text 0x8406.
    let message = "00 E0 21 1C 02 01 06 84 88 77 66 55 44 33 22 0B 05 00 3C";
    let spellings = [
        message.to_owned(),
        message.replace(' ', ""),
        format!("0x{}", message.replace(' ', "")),
        message.replace(' ', ", 0x").replacen("00", "{0x00", 1) + "}",
        format!("0x10F3:06 {message}"),
        r"b'\x00\xe0!\x1c\x02\x01\x06\x84\x88wfUD3\x22\x0b\x05\x00<'".to_owned(),
    ];
    for spelling in &spellings {
        let text = text(spelling);
        for part in [
            "code 0x1C21E000: of the manufacturer; high word 0x1C21, as a type number 7201",
            "flags 0x0102: error, 1 parameters",
            "text number 0x8406 (Beckhoff: DC link voltage too low)",
            "time: 2025-06-03T10:00:52.208940936Z",
            "parameter 1: 60",
        ] {
            assert!(text.contains(part), "{spelling}: {part}: {text}");
        }
    }
    let cut = text("00E0211C…");
    assert!(cut.contains("Only 4 of at least 16 bytes"), "{cut}");
    assert!(cut.contains("type number 7201"), "{cut}");
    let emergency = text("30 81 11 01 02 03 04 05");
    assert!(emergency.contains("error register 0x11: generic, communication"), "{emergency}");
    assert!(emergency.contains("01 02 03 04 05: as the manufacturer defines"), "{emergency}");
    let mailbox = text("0A 00 00 00 00 13 00 20 80 F0 10 01 02 00 01 06");
    assert!(mailbox.contains("CoE abort code 0x06010002"), "{mailbox}");
    assert!(mailbox.contains("CoE object 0x10F0:01: Backup parameter handling"), "{mailbox}");
}

#[test]
fn codes_of_watchdog_and_synchronisation_lead_to_their_causes_in_order() {
    let in_order = |word: &str, wanted: &[&str]| {
        let text = text(word);
        let mut rest = text.as_str();
        for words in wanted {
            let at = rest.find(words).unwrap_or_else(|| panic!("{word}: no {words:?} in: {text}"));
            rest = &rest[at + words.len()..];
        }
    };
    in_order(
        "0x001B",
        &[
            "Who else shows it",
            "Lost or damaged frames",
            "before OP is asked for",
            "cyclic task of its own",
            "watchdog long enough",
            "own frames",
            "Linesman",
            "IgH",
            "SOEM",
            "TwinCAT",
        ],
    );
    in_order(
        "0x001A",
        &[
            "Lost or damaged",
            "before OP",
            "same cycle",
            "Jitter",
            "interrupt moderation",
            "Shift",
            "left over",
        ],
    );
    in_order(
        "0x002C",
        &["Lost links", "reference clock", "switched on", "left over", "Jitter", "own frames"],
    );
    in_order(
        "0x002D",
        &[
            "switched on",
            "zero, left over, or past",
            "clocks set up",
            "while OP is asked for",
            "Jitter",
            "own frames",
        ],
    );
    in_order(
        "0x0030",
        &["by hand", "left over from another MainDevice", "0x1C32:01", "Clocks first"],
    );
    in_order("no slaves found", &["working counter 0", "Link?", "own frames"]);
    in_order("interrupt-moderation", &["ethtool -c", "ethtool -C eth0", "rx-usecs 0"]);
    in_order("own-frames", &["working counter 0", "0x02", "PACKET_OUTGOING"]);
}

#[test]
fn the_answer_as_json_fits_its_schema() {
    for words in [
        &["explain", "--json", "27"][..],
        &["explain", "--json"],
        &["explain", "DL", "0x5617", "--json"],
    ] {
        let run = linesman(words);
        assert_eq!(run.status, 0, "{words:?}: {}", run.all());
        assert_valid(&run.json(), "explain");
    }
    let report = linesman(["explain", "--json", "27"]).json();
    assert_eq!(report["asked"], "27");
    assert_eq!(report["readings"][0]["kind"], "al-status-code");
    let run = linesman(["explain", "--json", "no-such-thing"]);
    assert_eq!(run.status, 2);
    assert_valid(&run.json(), "error");
}

#[test]
fn without_a_word_it_lists_what_can_be_asked() {
    let run = linesman(["explain"]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.lines().count() < 30, "{}", run.stdout);
    for part in ["codes:", "registers:", "objects:", "values:", "bytes:", "words:", "topics:"] {
        assert!(run.stdout.contains(part), "{part}: {}", run.stdout);
    }
    // Each example in the list works.
    for word in
        ["AL 0x14", "8130", "FoE 0x8003", "60410010", "rx 0x0412", "WKC 2/3", "port B", "FPRD"]
    {
        assert!(!titles(word).is_empty());
    }
}

/// What stands between backticks in a page, cells of tables included.
fn code_spans(page: &str) -> Vec<String> {
    let outside_of_blocks = page.split("```").step_by(2).collect::<String>();
    outside_of_blocks.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

#[test]
fn every_example_and_every_reference_of_the_guide_has_an_answer() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/guide");
    let page = std::fs::read_to_string(guide.join("explain.md")).expect("the page of the guide");
    let table = page.split("## ").nth(1).expect("what can be asked");
    let table = table.split("\n\n").nth(1).expect("a table");
    let examples = code_spans(table);
    assert!(examples.len() > 40, "{examples:?}");
    let mut asked = examples;
    for folder in ["words", "topics"] {
        for entry in std::fs::read_dir(guide.join(folder)).expect("pages") {
            let text = std::fs::read_to_string(entry.expect("a page").path()).expect("a page");
            let spans = code_spans(&text.replace('\n', " "));
            let words = spans.iter().filter_map(|span| span.strip_prefix("linesman explain "));
            asked.extend(words.filter(|word| *word != "WORD").map(str::to_owned));
        }
    }
    for word in asked {
        let run = linesman(["explain", "--", &word]);
        assert_eq!(run.status, 0, "{word}: {}", run.all());
    }
}

#[test]
fn what_is_unknown_gets_the_nearest_names_and_status_2() {
    for (word, near) in [
        ("unmached", "UNMATCHED"),
        ("statuswrod", "0x6041 (Statusword)"),
        ("link-opne", "link-open"),
        ("NOCOM", "NO_COMM"),
        ("H11", "H110"),
    ] {
        let run = linesman(["explain", word]);
        assert_eq!((run.status, run.stdout.as_str()), (2, ""), "{word}");
        assert!(run.stderr.contains(near), "{word}: {}", run.stderr);
    }
}

#[test]
fn hostile_words_are_refused_or_answered_in_short_time() {
    let long = "A".repeat(100_000);
    let many = "0x1B ".repeat(20_000);
    let deep = "(".repeat(5_000) + &"[".repeat(3_000);
    let hex = "00E0".repeat(2_000);
    for word in [
        "",
        " ",
        "\t\n",
        "\u{0}",
        "\u{1b}[31m",
        "ä",
        "0x",
        "-",
        "--",
        "…",
        "0xFFFFFFFFFFFFFFFFFFFF",
        "b'",
        "{}",
        ":",
        "::",
        "0x1C32:",
        ":0B",
        "=",
        "%s%n",
        "WKC /",
        "`",
        "**",
        "\u{202e}abc",
        &long,
        &many,
        &deep,
        &hex,
    ] {
        // A command line cannot hold a zero byte.
        let word = word.replace('\u{0}', "\u{1}");
        let run = linesman(["explain", "--", &word]);
        assert!(matches!(run.status, 0 | 2), "{word:.60}: {}", run.status);
        assert!(!run.all().contains('\u{1b}') && !run.all().contains("panicked"), "{word:.60}");
        assert!(run.stderr.len() < 2_000, "{word:.60}: {}", run.stderr.len());
        assert!(run.status == 0 || run.stderr.contains("do:"), "{word:.60}: {}", run.stderr);
    }
    let run =
        run(Command::new("sh")
            .args(["-c", &format!("{PROGRAM} explain \"$(printf '\\377\\376')\"")]));
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(!run.all().contains("panicked"), "{}", run.all());
}

/// What a command writes to a terminal of this width; `None`, said aloud, where there is no `script`.
fn on_a_terminal(columns: usize, words: &str) -> Option<String> {
    let inner = format!("stty rows 50 cols {columns}; {PROGRAM} --color never explain {words}");
    let mut command = Command::new("script");
    let output = command.args(["-qec", &inner, "/dev/null"]).env_remove("COLUMNS").output();
    let Some(output) = output.ok().filter(|output| output.status.success()) else {
        eprintln!("SKIPPED: no `script` (util-linux) that makes a terminal");
        return None;
    };
    Some(String::from_utf8_lossy(&output.stdout).replace('\r', ""))
}

#[test]
fn no_line_is_wider_than_the_terminal() {
    for columns in [60, 80, 200] {
        for word in
            ["0x001B", "counter-guide", "H110", "0x1C32", "UNMATCHED", "DL 0x5617", "27", ""]
        {
            let Some(text) = on_a_terminal(columns, word) else { return };
            assert!(text.lines().count() > 5, "{word}: {text}");
            for line in text.lines() {
                let is_one_word = !line.trim_start().trim_start_matches("- ").contains(' ');
                let fits = line.chars().count() <= columns || is_one_word;
                assert!(fits, "{columns}: {word}: {line}");
            }
            for mark in ["`", "**", "](", "|--"] {
                assert!(!text.contains(mark), "{columns}: {word}: {mark} in {text}");
            }
        }
    }
}

#[test]
fn colour_is_there_when_it_is_allowed_and_not_in_a_pipe() {
    let run = linesman(["--color", "always", "explain", "0x001B"]);
    assert!(run.stdout.contains("\x1b[1m") && run.stdout.contains("\x1b[36m"), "{}", run.stdout);
    assert!(!linesman(["explain", "0x001B"]).stdout.contains('\x1b'));
}
