//! Several networks in one run: one time, which the first of them leads.

use std::fs;
use std::process::{Child, Command, Stdio};

use serde_json::Value;
use tempfile::TempDir;

use crate::support::{PROGRAM, assert_valid, linesman};

/// A coupler whose quartz is off by so much, and two terminals.
fn plant(ppm: f64) -> String {
    format!(
        "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\nclock_ppm = {ppm:.1}\n\
         [[device]]\nname = \"O1\"\ntype = \"EL4102\"\non = \"K1.B\"\nclock_ppm = 25.0\n\
         [[device]]\nname = \"I1\"\ntype = \"EL3102\"\non = \"O1.B\"\n"
    )
}

/// A folder with lines and projects of them, all called by their number.
struct Networks {
    folder: TempDir,
    count: usize,
}

impl Networks {
    /// Lines with couplers so many parts per million fast; those with `true` have clocks that are in step.
    fn new(lines: &[(f64, bool)]) -> Self {
        let networks = Self { folder: TempDir::new().unwrap(), count: lines.len() };
        for (no, (ppm, clocked)) in lines.iter().enumerate() {
            fs::write(networks.path(&format!("{no}.toml")), plant(*ppm)).unwrap();
            let (line, project) = (networks.line(no), networks.path(&format!("p{no}.toml")));
            assert_eq!(linesman(["scan", &line, "--save", &project]).status, 0);
            if *clocked {
                let saved = fs::read_to_string(&project).unwrap();
                let reference =
                    "station = 0x1001\nclock = { assign_activate = 0, reference = true }";
                let with = saved
                    .replace("station = 0x1001", reference)
                    .replace("station = 0x1002", "station = 0x1002\nclock = {}");
                assert_ne!(with, saved);
                fs::write(&project, with).unwrap();
            }
        }
        networks
    }

    fn path(&self, name: &str) -> String {
        self.folder.path().join(name).display().to_string()
    }

    fn line(&self, no: usize) -> String {
        format!("sim:{}", self.path(&format!("{no}.toml")))
    }

    /// Words of a run of all, each with its project.
    fn words(&self, more: &[&str]) -> Vec<String> {
        let mut words = vec!["run".to_owned()];
        words.extend((0..self.count).map(|no| self.path(&format!("p{no}.toml"))));
        words.extend((0..self.count).flat_map(|no| ["--on".to_owned(), self.line(no)]));
        words.push("--no-diagnosis".to_owned());
        words.extend(more.iter().map(|word| (*word).to_owned()));
        words
    }

    /// Group times of the networks at the end of a run.
    fn run(&self, seconds: &str) -> (String, Vec<Value>) {
        let run = linesman(self.words(&["--seconds", seconds, "--json"]));
        assert_eq!(run.status, 0, "{}", run.all());
        let report = run.json();
        assert_valid(&report, "runs");
        assert_eq!(report["schema"], "linesman.runs/1");
        let networks = report["networks"].as_array().unwrap();
        (run.stdout, networks.iter().map(|one| one["group"].clone()).collect())
    }
}

// S0 L809-816: the first is left to itself, the others are led to it, and nobody says so.
// proves: DC-12
#[test]
fn of_several_networks_of_a_run_the_first_leads_and_the_others_follow_without_a_setting() {
    let networks = Networks::new(&[(-40.0, true), (35.0, true), (10.0, true)]);
    let (shown, groups) = networks.run("45");
    let first = networks.line(0);
    assert_eq!(groups[0]["leads"], true);
    assert_eq!(groups[0]["ahead_ns"], Value::Null);
    for group in &groups {
        assert_eq!(group["lead"], first.as_str());
    }
    for follower in &groups[1..] {
        // By their quartzes they would be 2 ms and more apart by now.
        assert_eq!(follower["leads"], false);
        let ahead = follower["ahead_ns"].as_i64().unwrap();
        assert!(ahead.abs() < 500, "{ahead} ns: {shown}");
    }
}

#[test]
fn networks_that_share_a_time_do_the_same_in_each_run() {
    let networks = Networks::new(&[(-40.0, true), (35.0, true)]);
    let ((one, _), (other, _)) = (networks.run("3"), networks.run("3"));
    assert_eq!(one, other);
}

#[test]
fn first_network_that_has_clocks_leads() {
    let networks = Networks::new(&[(-40.0, false), (35.0, true), (10.0, true)]);
    let (_, groups) = networks.run("3");
    let leads: Vec<_> = groups.iter().map(|group| group["leads"] == true).collect();
    assert_eq!(leads, [false, true, false]);
    let text = linesman(networks.words(&["--seconds", "3"]));
    assert_eq!(text.status, 0, "{}", text.all());
    let leading = networks.line(1);
    for said in [
        "This network leads the time of all networks of the run.",
        &format!("follows that of {leading}"),
    ] {
        assert_eq!(text.stdout.matches(said).count(), 1, "{said}: {}", text.stdout);
    }
    // Whose each line is stands before it.
    assert!(text.stdout.contains(&format!("{leading}: Task ")), "{}", text.stdout);
}

/// Ended with the test.
struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Writes whose time the network of a project has.
fn set_time_source(networks: &Networks, no: usize, source: &str) {
    let project = networks.path(&format!("p{no}.toml"));
    let saved = fs::read_to_string(&project).unwrap();
    let network = format!("[network]\ntime_source = \"{source}\"\n\n[[device]]");
    let with = saved.replacen("[[device]]", &network, 1);
    fs::write(&project, with).unwrap();
}

// proves: DC-18
#[test]
fn network_below_an_upper_one_waits_for_its_time_and_begins_in_it_wherever_it_is_named() {
    for (below, upper) in [(0, 1), (1, 0)] {
        let networks = Networks::new(&[(-40.0, true), (35.0, true)]);
        set_time_source(&networks, below, "upper-network");
        let (shown, groups) = networks.run("45");
        let lead = networks.line(upper);
        assert_eq!(
            (&groups[upper]["leads"], &groups[below]["leads"]),
            (&true.into(), &false.into())
        );
        assert_eq!(groups[below]["lead"], lead.as_str());
        let ahead = groups[below]["ahead_ns"].as_i64().unwrap();
        assert!(ahead.abs() < 500, "{ahead} ns: {shown}");
        // It begins in that time, and does not drift into it.
        let (shown, groups) = networks.run("3");
        let ahead = groups[below]["ahead_ns"].as_i64().unwrap();
        assert!(ahead.abs() < 5_000, "{ahead} ns: {shown}");
        let text = linesman(networks.words(&["--seconds", "3"]));
        let waits = "waits for the time of the upper network to begin in it, 60.000 s at most";
        let of = format!("{}: ", networks.line(below));
        let told: Vec<_> = text.stdout.lines().filter(|line| line.contains(waits)).collect();
        assert!(told.len() == 1 && told[0].starts_with(&of), "{}", text.stdout);
    }
}

#[test]
fn network_below_an_upper_one_that_never_tells_its_time_is_not_started() {
    // The other one has no clocks.
    let networks = Networks::new(&[(-40.0, false), (35.0, true)]);
    set_time_source(&networks, 1, "upper-network");
    let run = linesman(networks.words(&["--seconds", "100"]));
    assert_eq!(run.status, 2, "{}", run.all());
    let told = "the upper network has told no time for 60 s";
    assert!(run.stderr.contains(told), "{}", run.all());
    assert!(run.stderr.contains("look whether the network that leads is up"), "{}", run.stderr);
    // Alone there is none above it.
    let (project, on) = (networks.path("p1.toml"), networks.line(1));
    let alone = linesman(["run", &project, "--on", &on, "--seconds", "3"]);
    assert_eq!(alone.status, 2, "{}", alone.all());
    assert!(alone.stderr.contains("this run has no other network"), "{}", alone.stderr);
}

// proves: DC-12
#[test]
fn online_tells_which_network_leads_and_how_far_the_others_are_ahead() {
    let networks = Networks::new(&[(-40.0, true), (35.0, true)]);
    let sockets = ["socket0", "socket1"].map(|name| networks.path(name));
    let words = networks.words(&["--control", &sockets[0], "--control", &sockets[1]]);
    let mut command = Command::new(PROGRAM);
    command.args(words).stdout(Stdio::null()).stderr(Stdio::null());
    let _running = Ended(command.spawn().unwrap());
    let until = |socket: &str, done: &dyn Fn(&Value) -> bool| {
        let mut last = String::new();
        for _ in 0..600 {
            let run = linesman(["online", socket, "--json"]);
            if run.status < 2 && done(&run.json()) {
                assert_valid(&run.json(), "online");
                return;
            }
            last = run.all();
            std::thread::sleep(std::time::Duration::from_millis(50));
        }
        panic!("{last}");
    };
    let first = networks.line(0);
    until(&sockets[0], &|report| report["group"]["leads"] == true);
    until(&sockets[1], &|report| {
        let group = &report["group"];
        group["lead"] == first.as_str() && group["leads"] == false && group["ahead_ns"].is_i64()
    });
    let shown = linesman(["online", &sockets[1]]).stdout;
    assert!(shown.contains(&format!("Its time follows that of {first}; it is ")), "{shown}");
}

#[test]
fn several_networks_are_refused_where_it_is_not_clear_what_belongs_to_which() {
    let networks = Networks::new(&[(0.0, false), (0.0, false)]);
    let [first, second] = [networks.line(0), networks.line(1)];
    let project = networks.path("p0.toml");
    let on = ["--on", &first, "--on", &second];
    let cases: [(&[&str], &str); 6] = [
        (
            &[&on[..], &[&project]].concat(),
            "project or ENI file: expected none or one for each of 2 networks (--on), got 1",
        ),
        (
            &[&on[..], &["--control", "x"]].concat(),
            "--control: expected none or one for each of 2 networks",
        ),
        (
            &[&on[..], &["--log", "x"]].concat(),
            "--log: expected none or one for each of 2 networks",
        ),
        (&["--on", &first, "--on", &first], "this line is named twice"),
        (&["--on", &first, "--on", "eth7"], "have no common time"),
        (
            &[&on[..], &["--bundles", "x"]].concat(),
            "--bundles: expected one network, got 2 networks",
        ),
    ];
    for (words, expected) in cases {
        let run = linesman([&["run"], words].concat());
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains(expected) && run.stderr.contains("do: "), "{}", run.stderr);
    }
}
