//! Observation files, texts of other tools, and members of bundles.

use linesman_fuzz::{BETWEEN_MEMBERS, packed};
use linesman_runtime::bundle::MEMBERS;

use super::Made;

/// Counters and states, typed in.
pub(crate) fn observation_files() -> Made {
    let counters = "[[device]]\nno = 1\nname = \"K1\"\non = \"maindevice\"\nstate = \"OP\"\n\
        ports.A = { link = true, open = true, rx = \"0x0000\" }\n\
        ports.B = { link = true, open = true, frame = 0, physical = 0 }\n\
        [[device]]\nno = 2\nname = \"T2\"\non = \"K1.B\"\nstate = \"OP\"\n\
        ports.A = { link = true, open = true, rx = \"0x0412\", forwarded = 3, lost_link = 1 }\n";
    let refused = "[[device]]\nno = 1\nname = \"K1\"\non = \"maindevice\"\n\
        state = \"ERR PREOP\"\nal_code = 0x001E\n";
    let readings = "[[device]]\nname = \"K1\"\non = \"maindevice\"\ncontroller = \"fpga\"\ncrc = 154656\n\
        [maindevice]\nsent = 1000\nlost = 3\ncrc = 0\ntimed_out = 3\nunmatched = 1\nanswering = 0\nstates = 0x1C\n\
        [[working_counter]]\nname = \"d\"\nexpected = 9\nreceived = 6\ndevices = [\"K1\"]\n\
        [[reading]]\nat_s = 12.5\n[[reading.device]]\nno = 1\nstate = \"OP\"\nports.A = { frame = 300 }\n\
        [[reading]]\nat_s = 99.0\n[[reading.device]]\nno = 1\nstate = \"ERR SAFEOP\"\nal_code = 0x1B\nports.A = { frame = 9 }\n\
        [[exchange]]\nwhat = \"cable\"\nat = \"maindevice-K1.A\"\nmoved = true\n\
        [[emergency]]\ndevice = \"K1\"\ncode = \"0x8611\"\n";
    let text = |text: &str| text.as_bytes().to_vec();
    vec![
        ("counters.toml", text(counters)),
        ("refused.toml", text(refused)),
        ("readings.toml", text(readings)),
    ]
}

/// What other tools print.
pub(crate) fn pasted_texts() -> Made {
    let online = "No\tAddr\tName\tState\tCRC\tChanges\n1\t1001\tTerm 1 (EK1100)\tOP LNK_MIS C\t0, 15 (18), 0\t0, 1\n\
        2\t1002\tTerm 2 (EL1008)\tERR SAFEOP\t0\t2, 3\n3\t1003\tTerm 3 (EK1828)\tINIT NO_COMM\t0\t0, 1\n\
        Send Frames\t19738\t+ 1272\nLost Frames\t3 (9)\t+ 2\nTx/Rx Errors\t0\t/ 12\n";
    let registers =
        "No;Addr;Name;State;Reg:0300;Reg:0308;Reg:0110\n1;1001;Box 1;OP;0x0412 (1042);--;0x5530\n";
    let slaves = "=== Master 0, Slave 0 ===\nState: OP\nFlag: +\n  Vendor Id:       0x00000002\n\
        Port  Type  Link  Loop    Signal  NextSlave\n   0  MII   up    open    yes             -\n   1  EBUS  up    open    \
        yes             1\n   2  N/A   down  closed  no              -\n   3  N/C   down  closed  no              -\n\
        === Master 0, Slave 1 ===\nState: PREOP+ERROR\nFlag: E\n   0  EBUS  up    open    yes             0\n";
    let list = "0  0:0  OP     +  EK1100\n1  0:1  PREOP  E  0x00000539:0x00001000\n";
    let master = "Master0\n  Phase: Operation\n  Active: yes\n  Slaves: 4\n    Main: 00:00:00:00:00:00 (attached)\n      \
        Link: UP\n    Common:\n      Tx frames:   25028\n      Lost frames: 37\n      Loss rate [1/s]:  2  0  0\n";
    let domains = "Domain0: LogBaseAddr 0x00000000, Size   6, WorkingCounter 2/3\n  SlaveConfig 0:1, SM3 ( Input), \
        LogAddr 0x00000000, Size 6\n    00 1f\n";
    let log = "[   10.5] EtherCAT 0: Link state of ecm0 changed to DOWN.\n[   10.6] EtherCAT WARNING 0: 3 datagrams \
        UNMATCHED!\n[   10.7] EtherCAT ERROR 0-1: AL status message 0x001B: \"x\".\n[   10.8] EtherCAT 0: Domain 0: \
        Working counter changed to 1/3.\n[   11.0] usb 1-1: other\nNov 20 10:00:00 box kernel: EtherCAT 0: 1 slave(s) \
        responding on main device.\n";
    let soem = "3 slaves found and configured.\nNot all slaves reached safe operational state.\nSlave 2 State=12 StatusCode=  \
        1d : Invalid\nSlave:1\n Name:EK1100\n State: 4\n Delay: 0[ns]\n Activeports:1.1.0.0\n Configured address: 1001\n \
        Man: 00000002 ID: 044c2c52 Rev: 00120000\nTime:  1.5 EMERGENCY slave:1 error:8130\n";
    let card = "NIC statistics:\n     rx_crc_errors: 12\n     rx_missed_errors: 3\n     tx_packets: 1000\n";
    let messages = "'Term 3 (EL4102)' (1003): abnormal state change (from 'OP' to 'SAFEOP') with code 0x1b.\n\
        'A (B1)' (1001) - 'C (D2)' (1002) Communication interrupted\n20.11.2026 10:00:00\t'A (B1)' (1001): CoE - Emergency \
        (Hex: 8611, 20, '29 00')\nTimestamp;Device;Code\n20.11.2026 10:00:00;Drive 3;0x8611\n";
    let all =
        [online, registers, slaves, list, master, domains, log, soem, card, messages].concat();
    let wide: Vec<u8> = online.encode_utf16().flat_map(u16::to_le_bytes).collect();
    let text = |text: &str| text.as_bytes().to_vec();
    vec![
        ("online.txt", text(online)),
        ("registers.csv", text(registers)),
        ("slaves.txt", text(slaves)),
        ("list.txt", text(list)),
        ("master.txt", text(&[master, domains].concat())),
        ("dmesg.txt", text(log)),
        ("slaveinfo.txt", text(soem)),
        ("ethtool.txt", text(card)),
        ("messages.txt", text(messages)),
        ("all.txt", text(&all)),
        ("online-utf-16.txt", wide),
    ]
}

/// Manifest of a bundle of a ring that was cut.
const BUNDLE_MANIFEST: &str = r#"{"schema": "linesman.bundle/1", "tool": "corpus", "source": "sim:ring.toml",
"start": null, "start_unix_ns": 0, "clock": "virtual", "end_ns": 4003017190, "has_ended": true, "input": "driven",
"host_counters": true, "probes": true, "active": false,
"triggers": [{"id": "F1", "at_ns": 1506148532, "finding": {"code": "H101", "cause": "ring-open",
"place": {"kind": "link", "network": 0, "a": {"no": 2, "port": "B"}, "b": {"no": 3, "port": "A"}, "direction": "both"}}}],
"findings": [], "stretches": [{"from_ns": 0, "to_ns": 4003017190, "frames": 4, "left_out_before": 0}], "left_out": [],
"exchange": {"datagrams": [{"command": 12, "start": 16777216, "len": 2, "working_counter": 3}], "fmmus": []},
"anonymised": null}
"#;

/// Observations of a bundle.
const BUNDLE_OBSERVATIONS: &str = r#"{"after_frame":0,"at_ns":0,"network":0,"noticed":{"kind":"carrier","card":"A","link":true}}
{"after_frame":1,"at_ns":7,"network":0,"noticed":{"kind":"card-errors","card":"B","crc":1,"other":0}}
{"after_frame":2,"at_ns":9,"network":0,"noticed":{"kind":"left-out","frames":3}}
{"after_frame":3,"at_ns":10,"network":0,"noticed":{"kind":"clock-step","card":"A","step_ns":-5}}
"#;

/// Bundles: members of one, in their order, and archives of them that are whole and cut off.
pub(crate) fn bundles(captures: &Made) -> Made {
    let find = |name: &str| captures.iter().find(|(other, _)| other.starts_with(name));
    let frames = find("two-interfaces").map(|(_, bytes)| bytes.clone()).unwrap_or_default();
    let members: [&[u8]; 4] = [
        BUNDLE_MANIFEST.as_bytes(),
        &frames,
        BUNDLE_OBSERVATIONS.as_bytes(),
        b"name = \"line\"\n\n[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n",
    ];
    let named: Vec<(&str, &[u8])> = MEMBERS.into_iter().zip(members).collect();
    let archive = packed(&named);
    vec![
        ("cut-link.bin", members.join(BETWEEN_MEMBERS)),
        ("manifest-alone.bin", BUNDLE_MANIFEST.as_bytes().to_vec()),
        ("cut-off.bin", archive[..archive.len() - 30].to_vec()),
        ("archive.bin", archive),
    ]
}
