//! The dissection of tshark beside ours, on every real capture: states, SDO transfers, words of SIIs, datagrams by
//! command. What tshark shows of a frame is put together here, without any code of ours.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command as Program;

use crate::capture_info::info;
use crate::captures::captures;
use crate::support::linesman;
use serde_json::Value;

/// Fields that tshark is asked for, one column each.
const FIELDS: [&str; 27] = [
    "frame.number",
    "eth.src",
    "ecat.cmd",
    "ecat.adp",
    "ecat.ado",
    "ecat.cnt",
    "ecat.data",
    "ecat.reg.alctrl",
    "ecat.reg.alstatus",
    "ecat.reg.ctrlstat",
    "ecat.reg.addrl",
    "ecat.reg.addrh",
    "ecat.reg.data0",
    "ecat.reg.data1",
    "ecat.reg.data2",
    "ecat.reg.data3",
    "ecat_mailbox.coe.sdoreq",
    "ecat_mailbox.coe.sdores",
    "ecat_mailbox.coe.sdoidx",
    "ecat_mailbox.coe.sdosub",
    "ecat_mailbox.coe.sdodata",
    "ecat_mailbox.coe.dsoldata",
    "ecat_mailbox.coe.abortcode",
    "ecat_mailbox.coe.sdolength",
    "ecat_mailbox.coe.type",
    "ecat.reg.physaddr",
    "ecat.reg.dlstatus2",
];

/// A frame as tshark shows it: the values of each field.
struct Row(Vec<Vec<String>>);

impl Row {
    fn texts(&self, field: &str) -> &[String] {
        &self.0[FIELDS.iter().position(|name| *name == field).unwrap()]
    }

    fn all(&self, field: &str) -> Vec<u64> {
        self.texts(field).iter().map(|text| number(text)).collect()
    }

    fn one(&self, field: &str) -> Option<u64> {
        self.all(field).first().copied()
    }

    fn number(&self) -> u64 {
        self.one("frame.number").unwrap()
    }

    /// True if the first controller has marked it: it is on its way back.
    fn is_return(&self) -> bool {
        let first = &self.texts("eth.src")[0][..2];
        u8::from_str_radix(first, 16).unwrap() & 2 != 0
    }

    /// A register of a state. tshark names it where both of its bytes are there, and shows the data of a single byte.
    fn state(&self, field: &str) -> Vec<u64> {
        let named = self.all(field);
        match self.texts("ecat.data") {
            [byte] if named.is_empty() && byte.len() == 2 => {
                vec![u64::from_str_radix(byte, 16).unwrap()]
            }
            _ => named,
        }
    }

    /// Datagrams: command, ADP, ADO, working counter.
    fn datagrams(&self) -> Vec<(u64, u64, u64, u64)> {
        // Logical commands have no ADP and ADO: what they address must not shift those of others.
        let (commands, counters) = (self.all("ecat.cmd"), self.all("ecat.cnt"));
        let (mut adp, mut ado) =
            (self.all("ecat.adp").into_iter(), self.all("ecat.ado").into_iter());
        let address = |command: u64, from: &mut std::vec::IntoIter<u64>| match command {
            10..=12 => 0,
            _ => from.next().unwrap_or(0),
        };
        commands
            .into_iter()
            .zip(counters)
            .map(|(command, wkc)| {
                (command, address(command, &mut adp), address(command, &mut ado), wkc)
            })
            .collect()
    }
}

fn number(text: &str) -> u64 {
    match text.strip_prefix("0x") {
        Some(digits) => u64::from_str_radix(digits, 16).unwrap_or(0),
        None => text.parse().unwrap_or(0),
    }
}

/// All frames of a capture; `None`, said aloud, without tshark.
fn dissected(path: &Path) -> Option<Vec<Row>> {
    let mut tshark = Program::new("tshark");
    tshark.arg("-r").arg(path).args(["-Y", "ecat", "-T", "fields", "-E", "separator=|"]);
    for field in FIELDS {
        tshark.args(["-e", field]);
    }
    let Ok(output) = tshark.output() else {
        eprintln!("SKIPPED: tshark is not here to judge what a capture holds");
        return None;
    };
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let split =
        |column: &str| column.split(',').filter(|it| !it.is_empty()).map(str::to_owned).collect();
    Some(text.lines().map(|line| Row(line.split('|').map(split).collect())).collect())
}

/// By command: how many datagrams, in all frames.
fn commands(rows: &[Row]) -> BTreeMap<u64, u64> {
    let mut counts = BTreeMap::new();
    for command in rows.iter().flat_map(|row| row.all("ecat.cmd")) {
        *counts.entry(command).or_default() += 1;
    }
    counts
}

fn our_commands(info: &Value) -> BTreeMap<u64, u64> {
    let all = info["commands"].as_array().unwrap().iter();
    all.map(|one| (one["code"].as_u64().unwrap(), one["recorded"].as_u64().unwrap())).collect()
}

/// State values by whom they are of (station address; 0x1_0000 for all), those equal to the one before left out.
type States = BTreeMap<u64, Vec<u64>>;

/// Everybody, as a key.
const ALL: u64 = 0x1_0000;
/// State and error bit.
const STATE: u64 = 0x1F;

/// States that were asked for, as sent, and read, as they came back.
fn states(rows: &[Row]) -> (States, States) {
    let (mut asked, mut read) = (States::new(), States::new());
    for row in rows {
        let whom = |command: u64, adp: u64| match command {
            4 | 5 => Some(adp),
            7 | 8 => Some(ALL),
            _ => None,
        };
        let datagrams = row.datagrams();
        let at = |ado: u64| datagrams.iter().filter(move |one| one.2 == ado);
        for (value, (command, adp, _, _)) in
            row.state("ecat.reg.alctrl").into_iter().zip(at(0x0120))
        {
            if let (Some(whom), false) = (whom(*command, *adp), row.is_return()) {
                asked.entry(whom).or_default().push(value & STATE);
            }
        }
        for (value, (command, adp, _, wkc)) in
            row.state("ecat.reg.alstatus").into_iter().zip(at(0x0130))
        {
            if let (Some(whom), true, 1..) = (whom(*command, *adp), row.is_return(), *wkc) {
                push_changed(read.entry(whom).or_default(), value & STATE);
            }
        }
    }
    (asked, read)
}

fn push_changed(values: &mut Vec<u64>, value: u64) {
    if values.last() != Some(&value) {
        values.push(value);
    }
}

fn our_states(info: &Value) -> (States, States) {
    let (mut asked, mut read) = (States::new(), States::new());
    for one in info["states"].as_array().unwrap() {
        if !one["position_no"].is_null() {
            continue;
        }
        let whom = one["station"].as_u64().unwrap_or(ALL);
        let value = one["value"].as_u64().unwrap() & STATE;
        match one["what"].as_str().unwrap() {
            "asked" => asked.entry(whom).or_default().push(value),
            "read" => push_changed(read.entry(whom).or_default(), value),
            _ => {}
        }
    }
    (asked, read)
}

/// An SDO transfer: frame of the request, station, object, subindex, whether it is read, data or abort code.
type Sdo = (u64, u64, u64, u64, bool, String);

/// Transfers that were asked for, with what came of them.
fn sdos(rows: &[Row]) -> Vec<Sdo> {
    let mut all: Vec<Sdo> = Vec::new();
    let mut open: BTreeMap<u64, usize> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.is_return()) {
        let [(command, station, _, 1..)] = row.datagrams()[..] else { continue };
        let object = (row.one("ecat_mailbox.coe.sdoidx"), row.one("ecat_mailbox.coe.sdosub"));
        match (command, row.one("ecat_mailbox.coe.sdoreq"), row.one("ecat_mailbox.coe.sdores")) {
            (5, Some(kind @ (1 | 2)), _) => {
                open.insert(station, all.len());
                let (index, subindex) = (object.0.unwrap(), object.1.unwrap());
                all.push((row.number(), station, index, subindex, kind == 2, payload(row)));
            }
            (4, _, Some(kind)) => {
                let Some(one) = open.get(&station).map(|at| &mut all[*at]) else { continue };
                if kind == 2 && one.4 || kind == 0 {
                    one.5.push_str(&payload(row));
                }
            }
            (4, _, None) => {
                if let Some(code) = row.one("ecat_mailbox.coe.abortcode")
                    && let Some(at) = open.remove(&station)
                {
                    all[at].5 = format!("abort {code:08x}");
                }
            }
            _ => {}
        }
    }
    all
}

/// The data of a message as hexadecimal digits: a number of up to four bytes, or bytes.
fn payload(row: &Row) -> String {
    if let Some(bytes) = row.texts("ecat_mailbox.coe.dsoldata").first() {
        return bytes.replace(':', "");
    }
    let Some(text) = row.texts("ecat_mailbox.coe.sdodata").first() else { return String::new() };
    let digits = text.trim_start_matches("0x");
    let pairs = digits.as_bytes().rchunks(2);
    pairs.map(|pair| std::str::from_utf8(pair).unwrap()).collect()
}

fn our_sdos(info: &Value) -> Vec<Sdo> {
    let transfers = info["transfers"].as_array().unwrap().iter();
    let asked = transfers.filter(|one| {
        matches!(one["what"].as_str(), Some("upload" | "download")) && !one["asked_frame"].is_null()
    });
    asked
        .map(|one| {
            let number = |key: &str| one[key].as_u64().unwrap();
            let data = match (one["outcome"].as_str().unwrap(), one["code"].as_u64()) {
                ("refused", Some(code)) => format!("abort {code:08x}"),
                _ => one["data"].as_str().unwrap().to_owned(),
            };
            let is_read = one["what"] == "upload";
            (
                number("asked_frame"),
                number("station"),
                number("index"),
                number("subindex"),
                is_read,
                data,
            )
        })
        .collect()
}

/// Words of SIIs, by station address and word.
type Words = BTreeMap<(u64, u64), u64>;

fn sii_words(rows: &[Row]) -> Words {
    let mut words = Words::new();
    // The address that a read was ordered of, and whether eight bytes come at once.
    let mut ordered: BTreeMap<u64, (Option<u64>, bool)> = BTreeMap::new();
    for row in rows.iter().filter(|row| row.is_return()) {
        let [(command, station, ado, 1..)] = row.datagrams()[..] else { continue };
        let read = ordered.entry(station).or_default();
        let control = row.one("ecat.reg.ctrlstat");
        match (command, ado) {
            (5, 0x0502) => {
                let is_read = control.is_some_and(|control| control & 0x0700 == 0x0100);
                let address = row.one("ecat.reg.addrl").unwrap_or(0);
                let high = row.one("ecat.reg.addrh").unwrap_or(0);
                read.0 = is_read.then_some(high << 16 | address);
            }
            (4, 0x0502) => read.1 = control.is_some_and(|control| control & 0x0040 != 0),
            (4, 0x0508) => {
                let Some(address) = read.0 else { continue };
                let count = if read.1 { 4 } else { 2 };
                let fields =
                    ["ecat.reg.data0", "ecat.reg.data1", "ecat.reg.data2", "ecat.reg.data3"];
                for (offset, field) in (0..).zip(&fields[..count]) {
                    if let Some(word) = row.one(field) {
                        words.insert((station, address + offset), word);
                    }
                }
            }
            _ => {}
        }
    }
    words
}

fn our_sii_words(info: &Value) -> Words {
    let mut words = Words::new();
    for device in info["devices"].as_array().unwrap() {
        let Some(station) = device["station"].as_u64() else { continue };
        for stretch in device["sii"].as_array().unwrap() {
            let first = stretch["word"].as_u64().unwrap();
            for (offset, word) in (0..).zip(stretch["words"].as_array().unwrap()) {
                words.insert((station, first + offset), word.as_u64().unwrap());
            }
        }
    }
    words
}

/// Links: number and port of the end nearer the MainDevice, number and port of the other one; 0 is the MainDevice.
type Links = Vec<(u64, char, u64, char)>;

/// The tree as the ports of DL status tell it, read by station address; `None` unless all that got a station address were
/// read, and where they were read differently later.
fn links(rows: &[Row]) -> Option<Links> {
    let (mut stations, mut ports) = (BTreeMap::new(), BTreeMap::<u64, Vec<u64>>::new());
    for row in rows {
        let datagrams = row.datagrams();
        let at = |ado: u64| datagrams.iter().filter(move |one| one.2 == ado);
        let addresses = row.all("ecat.reg.physaddr");
        // The frame on its way out alone holds the positions that were asked for.
        if !row.is_return() && addresses.len() == at(0x0010).count() {
            for ((command, adp, _, _), station) in at(0x0010).zip(&addresses) {
                if *command == 2 {
                    stations.insert(adp.wrapping_neg() & 0xFFFF, *station);
                }
            }
        }
        let statuses = row.all("ecat.reg.dlstatus2");
        if row.is_return() && statuses.len() == at(0x0110).count() {
            for ((command, station, _, wkc), status) in at(0x0110).zip(&statuses) {
                if (*command, *wkc) == (4, 1) {
                    push_changed(ports.entry(*station).or_default(), *status);
                }
            }
        }
    }
    // Two bits for each port: 2 is an open port that communicates.
    let is_active = |status: u64, port: u64| status >> (2 * port) & 3 == 2;
    let mut links = Links::new();
    // Ends that frames come to next, the nearest last: from A they go to D, B, C.
    let mut ends = vec![(0, 'A')];
    for (no, (position, station)) in (1..).zip(stations) {
        let [status] = ports.get(&station)?[..] else { return None };
        if position + 1 != no || !is_active(status, 0) {
            return None;
        }
        let (upstream, port) = ends.pop()?;
        links.push((upstream, port, no, 'A'));
        let further = [(2, 'C'), (1, 'B'), (3, 'D')].into_iter();
        ends.extend(
            further.filter(|(port, _)| is_active(status, *port)).map(|(_, name)| (no, name)),
        );
    }
    (!links.is_empty() && ends.is_empty()).then_some(links)
}

fn our_links(info: &Value) -> Links {
    let end = |end: &Value| {
        let port = end["port"].as_str().unwrap().chars().next().unwrap();
        (end["no"].as_u64().unwrap(), port)
    };
    let links = info["links"].as_array().unwrap().iter();
    let mut all: Links = links
        .map(|link| {
            let ((a, a_port), (b, b_port)) = (end(&link["a"]), end(&link["b"]));
            (a, a_port, b, b_port)
        })
        .collect();
    all.sort_unstable_by_key(|link| link.2);
    all
}

pub(crate) fn files(directory: &Path) -> Vec<PathBuf> {
    let mut all: Vec<PathBuf> =
        fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()).collect();
    all.retain(|path| path.extension().is_some_and(|end| end == "pcapng" || end == "pcap"));
    all.sort();
    all
}

/// Sums of what was compared, so that a comparison of nothing cannot pass.
#[derive(Default, Debug)]
struct Compared {
    captures: usize,
    datagrams: u64,
    asked: usize,
    read: usize,
    sdos: usize,
    words: usize,
    links: usize,
}

fn count(states: &States) -> usize {
    states.values().map(Vec::len).sum()
}

#[test]
fn dissection_of_tshark_agrees_on_states_sdos_sii_words_and_commands() {
    let Some(directory) = captures() else { return };
    let mut compared = Compared::default();
    for path in files(&directory) {
        let Some(rows) = dissected(&path) else { return };
        let (info, name) = (info(&path), path.display());
        let theirs = commands(&rows);
        assert_eq!(our_commands(&info), theirs, "{name}: datagrams by command");
        let (asked, read) = states(&rows);
        let (our_asked, our_read) = our_states(&info);
        assert_eq!(our_asked, asked, "{name}: states that were asked for");
        assert_eq!(our_read, read, "{name}: states that were read");
        let transfers = sdos(&rows);
        assert_eq!(our_sdos(&info), transfers, "{name}: SDO transfers");
        let words = sii_words(&rows);
        assert_eq!(our_sii_words(&info), words, "{name}: SII words");
        if let Some(links) = links(&rows) {
            assert_eq!(our_links(&info), links, "{name}: links");
            compared.links += links.len();
        }
        compared.captures += 1;
        compared.datagrams += theirs.values().sum::<u64>();
        compared.asked += count(&asked);
        compared.read += count(&read);
        compared.sdos += transfers.len();
        compared.words += words.len();
    }
    eprintln!("{compared:?}");
    assert!(compared.captures >= 17 && compared.datagrams > 30_000, "{compared:?}");
    assert!(compared.asked > 50 && compared.read > 50, "{compared:?}");
    assert!(compared.sdos > 40 && compared.words > 1_000, "{compared:?}");
    assert!(compared.links >= 25, "{compared:?}");
}

/// A line that branches at the junctions of both kinds of ports.
const BRANCHING: &str = r#"
name = "branching"
seed = 1
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "O1"
type = "EL2008"
on = "K1.B"
[[device]]
name = "J1"
type = "EK1122"
on = "O1.B"
[[device]]
name = "K2"
type = "EK1100"
on = "J1.B"
[[device]]
name = "I2"
type = "EL1008"
on = "K2.B"
[[device]]
name = "K3"
type = "EK1100"
on = "J1.D"
[[device]]
name = "I1"
type = "EL1008"
on = "J1.C"
"#;

#[test]
fn tree_of_a_branching_line_of_our_own_is_that_of_tshark() {
    let folder = tempfile::tempdir().unwrap();
    let (plant, path) = (folder.path().join("plant.toml"), folder.path().join("own.pcapng"));
    fs::write(&plant, BRANCHING).unwrap();
    let place = format!("sim:{}", plant.display());
    let run = linesman(["diagnose", &place, "--seconds", "2", "--record", path.to_str().unwrap()]);
    assert!(run.status <= 1, "{}", run.all());
    let Some(rows) = dissected(&path) else { return };
    let info = info(&path);
    let links = links(&rows).expect("all were read");
    assert_eq!(links.len(), 7, "{links:?}");
    assert_eq!(our_links(&info), links);
}
