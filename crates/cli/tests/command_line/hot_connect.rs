//! Hot connect groups and rings through the command line.

use std::fs;
use std::path::PathBuf;

use crate::support::running::Running;
use crate::support::{Run, assert_valid, linesman};
use serde_json::json;
use tempfile::TempDir;

/// A line with a junction, and a tool that hangs at it.
const PLANT: &str = r#"
name = "machine with a tool"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "T1"
type = "EL2008"
on = "K1.B"
[[device]]
name = "J1"
type = "EK1122"
on = "T1.B"
[[device]]
name = "X"
type = "EK1101"
on = "J1.D"
id = 5
[[device]]
name = "X1"
type = "EL1008"
on = "X.B"
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[[device]]
name = "T2"
type = "EL1008"
on = "K2.B"
"#;

const GROUP: &str = r#"
[[group]]
name = "tool"
first = "SubDevice 4 (EK1101)"
identification = { by = "selector", value = 5 }
"#;

struct Machine {
    folder: TempDir,
}

impl Machine {
    /// The project of the whole plant, with this behind it.
    fn new(more: &str) -> Self {
        Self::of(PLANT, more)
    }

    /// The project of a plant, with this behind it.
    fn of(plant: &str, more: &str) -> Self {
        let machine = Self { folder: TempDir::new().unwrap() };
        machine.write("plant.toml", plant);
        let saved = machine.path("saved.toml");
        let on = format!("sim:{}", machine.path("plant.toml").display());
        let run = linesman(["scan", &on, "--save", saved.to_str().unwrap()]);
        assert_eq!(run.status, 0, "{}", run.all());
        let project = fs::read_to_string(saved).unwrap() + more;
        machine.write("project.toml", &project);
        machine
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.path(name), text).unwrap();
    }

    fn run(&self, plant: &str, more: &[&str]) -> Run {
        self.write("now.toml", plant);
        let project = self.path("project.toml").display().to_string();
        let on = format!("sim:{}", self.path("now.toml").display());
        let fixed = ["run", &project, "--on", &on];
        linesman(fixed.into_iter().chain(more.iter().copied()))
    }

    fn plan(&self, more: &[&str]) -> Run {
        let project = self.path("project.toml").display().to_string();
        linesman(["plan", &project].into_iter().chain(more.iter().copied()))
    }
}

#[test]
fn run_tells_that_a_group_joins_and_leaves_and_finds_nothing_wrong_with_it() {
    let machine = Machine::new(GROUP);
    for (on, place) in [("J1.D", "SubDevice 3 (EK1122)"), ("K2.C", "SubDevice 6 (EK1100)")] {
        // Out at the start, in from 2 s on, out again at 6 s.
        let out = |from_to: &str| {
            format!("[[fault]]\nkind = \"link-open\"\nat = \"{on}-X.A\"\n{from_to}\n")
        };
        let plant = PLANT.replace("on = \"J1.D\"", &format!("on = \"{on}\""))
            + &out("from_ms = 0\nto_ms = 2000")
            + &out("from_ms = 6000");
        let run = machine.run(&plant, &["--for", "7"]);
        assert_eq!(run.status, 0, "{}", run.all());
        let port = on.rsplit('.').next().unwrap();
        for said in [
            "5 SubDevices have reached their states; 2 of hot connect groups are not plugged in"
                .to_owned(),
            format!("hot connect group tool joined at port {port} of '{place}'"),
            "hot connect group tool left: its data are not valid any more".to_owned(),
            "No findings".to_owned(),
        ] {
            assert!(run.stdout.contains(&said), "{on}: {said}: {}", run.all());
        }
    }
}

#[test]
fn run_names_a_wrong_number_with_what_to_do() {
    let machine = Machine::new(GROUP);
    let run = machine.run(&PLANT.replace("id = 5", "id = 7"), &["--for", "2"]);
    for said in [
        "must be 5, found 7; it is kept in INIT",
        "Do: set the number at the device",
        "Not taken: hot connect group tool: must tell the number 5",
    ] {
        assert!(run.stdout.contains(said), "{said}: {}", run.all());
    }
    assert_eq!(run.status, 1, "a wrong number is a finding: {}", run.all());
    let run = machine.run(&PLANT.replace("id = 5", "id = 7"), &["--for", "2", "--json"]);
    let report = run.json();
    assert_valid(&report, "run");
    assert_eq!(report["not_taken"].as_array().unwrap().len(), 1, "{}", run.all());
}

#[test]
fn supply_that_dips_within_a_group_that_is_there_is_a_finding() {
    let machine = Machine::new(GROUP);
    let dip = "[[fault]]\nkind = \"device-off\"\ndevice = \"X1\"\nfrom_ms = 3000\nto_ms = 3200\n";
    let run = machine.run(&format!("{PLANT}{dip}"), &["--for", "7", "--json"]);
    let report = run.json();
    let findings = report["diagnosis"]["findings"].as_array().unwrap();
    // X1 is the fifth of the project, and of the line.
    let is_it =
        |finding: &serde_json::Value| finding["code"] == "H150" && finding["place"]["no"] == 5;
    assert!(findings.iter().any(is_it), "{findings:#?}");
    assert_eq!(run.status, 1, "{findings:#?}");
}

#[test]
fn fault_outside_a_group_is_told_of_the_right_subdevice_while_the_group_is_there() {
    let machine = Machine::new(GROUP);
    let off = "[[fault]]\nkind = \"device-off\"\ndevice = \"T2\"\nfrom_ms = 3000\n";
    let run = machine.run(&format!("{PLANT}{off}"), &["--for", "7", "--json"]);
    let report = run.json();
    let findings = report["diagnosis"]["findings"].as_array().unwrap();
    let told = |finding: &serde_json::Value| {
        let place = &finding["place"];
        (finding["code"].clone(), place["a"]["no"].clone(), place["b"]["no"].clone())
    };
    let told: Vec<_> = findings.iter().map(told).collect();
    assert_eq!(told, [(json!("H101"), json!(6), json!(7))], "{findings:#?}");
}

/// A ring with a tool at the junction behind its first SubDevice.
const RING: &str = r#"
name = "ring with a tool"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "J1"
type = "EK1122"
on = "K1.B"
[[device]]
name = "X"
type = "EK1101"
on = "J1.D"
id = 5
[[device]]
name = "K2"
type = "EK1100"
on = "K1.C"
[ring]
closes_at = "K2.C"
"#;

#[test]
fn healthy_ring_with_a_group_amid_the_others_has_no_findings() {
    let machine = Machine::of(RING, &GROUP.replace("SubDevice 4", "SubDevice 3"));
    let run = machine.run(RING, &["--for", "3"]);
    assert_eq!(run.status, 0, "{}", run.all());
    for said in ["the ring is closed", "hot connect group tool joined", "No findings."] {
        assert!(run.stdout.contains(said), "{said}: {}", run.all());
    }
    assert!(!run.stdout.contains("confirmed"), "{}", run.all());
}

#[test]
fn number_of_a_group_is_compared_with_those_of_its_kind() {
    let machine = Machine::new(GROUP);
    let project = machine.path("project.toml").display().to_string();
    let against = |plant: &str| {
        machine.write("now.toml", plant);
        let on = format!("sim:{}", machine.path("now.toml").display());
        let text = linesman(["id", &on, "--against", &project]);
        let report = linesman(["id", &on, "--against", &project, "--json"]);
        assert_valid(&report.json(), "numbers");
        let count = |key: &str| report.json()[key].as_array().unwrap().len();
        (text.status, text.all(), count("differences"), count("not_compared"))
    };
    let (status, said, wrong, left) = against(PLANT);
    assert!(said.contains("All numbers are as planned."), "{said}");
    assert_eq!((status, wrong, left), (0, 0, 0));
    let (status, said, wrong, left) = against(&PLANT.replace("id = 5", "id = 9"));
    assert!(
        said.contains("its selector must be 5, which nobody tells; X (EK1101) tells 9"),
        "{said}"
    );
    assert_eq!((status, wrong, left), (1, 1, 0), "{said}");
    // It may be absent; that is no number that is right.
    let tool = PLANT.find("[[device]]\nname = \"X\"").unwrap();
    let behind = PLANT.find("[[device]]\nname = \"K2\"").unwrap();
    let (status, said, wrong, left) = against(&format!("{}{}", &PLANT[..tool], &PLANT[behind..]));
    assert!(said.contains("nobody tells its selector 5: group tool is not there"), "{said}");
    assert_eq!((status, wrong, left), (0, 0, 1), "{said}");
    // A project without numbers shows nothing to be right.
    let saved = machine.path("saved.toml").display().to_string();
    let on = format!("sim:{}", machine.path("plant.toml").display());
    let run = linesman(["id", &on, "--against", &saved]);
    assert_eq!(run.status, 3, "{}", run.all());
    assert!(run.stdout.contains("Nothing was compared"), "{}", run.all());
}

#[test]
fn a_scan_without_the_group_or_with_it_elsewhere_is_as_planned() {
    let machine = Machine::new(GROUP);
    let project = machine.path("project.toml").display().to_string();
    let tool = PLANT.find("[[device]]\nname = \"X\"").unwrap();
    let behind = PLANT.find("[[device]]\nname = \"K2\"").unwrap();
    let without = format!("{}{}", &PLANT[..tool], &PLANT[behind..]);
    for plant in [without, PLANT.replace("on = \"J1.D\"", "on = \"K2.C\"")] {
        machine.write("now.toml", &plant);
        let on = format!("sim:{}", machine.path("now.toml").display());
        let run = linesman(["scan", &on, "--against", &project]);
        assert!(run.stdout.contains("All is as planned."), "{}", run.all());
    }
}

#[test]
fn plan_lists_groups_and_refuses_what_cannot_work() {
    let machine = Machine::new(GROUP);
    let run = machine.plan(&[]);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("selector, read at 0x1000"), "{}", run.all());
    let report = machine.plan(&["--json"]).json();
    assert_valid(&report, "plan");
    let expected = json!([{
        "name": "tool", "members": [4, 5], "source": "selector, read at 0x1000", "number": 5,
        "places": [], "optional": true
    }]);
    assert_eq!(report["groups"], expected);
    let whole = GROUP.replace("SubDevice 4 (EK1101)", "SubDevice 1 (EK1100)");
    let machine = Machine::new(&whole.replace("\"selector\"", "\"alias\""));
    let run = machine.plan(&[]);
    assert_eq!(run.status, 1, "{}", run.all());
    assert!(run.stdout.contains("the first SubDevice of the line"), "{}", run.all());
}

// proves: PLC-10 (S) partial: neighbours and groups as JSON
#[test]
fn online_tells_groups_that_join_and_leave_and_lists_them_last() {
    let machine = Machine::new(GROUP);
    let project = fs::read_to_string(machine.path("project.toml")).unwrap();
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"J1.D-X.A\"\nfrom_ms = 8000\n";
    let running = Running::with(&format!("{PLANT}{cut}"), &[("project.toml", &project)]);
    let report = running.until("joins", |report| report["groups"][0]["joined"] == true);
    assert_valid(&report, "online");
    let tool = |present: u32, joined: bool, place: Option<&str>| json!([{ "name": "tool", "devices": [4, 5], "present": present, "joined": joined, "place": place }]);
    assert_eq!(report["groups"], tool(2, true, Some("3.D")));
    assert_eq!(report["topology"], json!([1, 2, 3, 6, 7, 4, 5]));
    let text = linesman(["online", &running.socket()]).stdout;
    let said = "Hot connect group tool: joined at port 3.D; 2 of 2 SubDevices there.";
    assert!(text.contains(said), "{text}");
    let report = running.until("leaves", |report| report["groups"][0]["present"] == 0);
    assert_eq!(report["groups"], tool(0, false, None));
    let text = linesman(["online", &running.socket()]).stdout;
    assert!(text.contains("Hot connect group tool: absent; 0 of 2 SubDevices there."), "{text}");
}

// proves: RED-08 (S)
#[test]
fn plan_lists_the_cables_of_a_ring_whose_break_costs_subdevices() {
    let machine = Machine::new("\n[ring]\ncloses_at = \"SubDevice 6 (EK1100).C\"\n");
    let report = machine.plan(&["--json"]).json();
    assert_valid(&report, "plan");
    let cable = |from: &str, to: &str, lost: &[u32]| json!({ "from": from, "to": to, "may_break": lost.is_empty(), "lost": lost });
    let [k1, j1, x, k2] = [
        "SubDevice 1 (EK1100)",
        "SubDevice 3 (EK1122)",
        "SubDevice 4 (EK1101)",
        "SubDevice 6 (EK1100)",
    ];
    let cables = report["cables"].as_array().unwrap();
    assert_eq!(cables.len(), 4, "{cables:?}");
    for expected in [
        cable("maindevice", &format!("{k1}.A"), &[]),
        cable(&format!("{k1}.C"), &format!("{k2}.A"), &[]),
        cable(&format!("{j1}.D"), &format!("{x}.A"), &[4, 5]),
        cable(&format!("{k2}.C"), "maindevice.B", &[]),
    ] {
        assert!(cables.contains(&expected), "{expected}: {cables:?}");
    }
    let run = machine.plan(&[]);
    assert!(run.stdout.contains("may break"), "{}", run.all());
}
