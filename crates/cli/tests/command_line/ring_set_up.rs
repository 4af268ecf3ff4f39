//! A ring set up step by step, and numbers of SubDevices, by command.

use std::fs;

use crate::support::bench::beside_segment;
use crate::support::running::Running;
use crate::support::{assert_valid, linesman};
use serde_json::json;
use tempfile::TempDir;

const RING: &str = r#"name = "ring"
[[device]]
name = "B1"
type = "EP1008-0001"
on = "maindevice"
[[device]]
name = "B2"
type = "EP2308-0001"
on = "B1.B"
[[device]]
name = "B3"
type = "EP2308-0001"
on = "B2.B"
[ring]
closes_at = "B3.B"
"#;

/// Two virtual cables, of which the second one is out until the program asks for it.
// proves: RED-14
#[test]
fn a_ring_is_set_up_step_by_step_over_cables_and_what_is_wrong_is_named() {
    let script = r#"
        for n in 1 2; do
            ip link add near$n type veth peer name far$n
            for card in near$n far$n; do
                sysctl -q -w net.ipv6.conf.$card.disable_ipv6=1
                ip link set $card up
            done
        done
        printf '%s' "RING_FILE" > "$DIRECTORY/ring_plant.toml"
        "$LINESMAN" sim "$DIRECTORY/ring_plant.toml" --on far1+far2 --control "$DIRECTORY/ring" \
            > "$DIRECTORY/second.out" &
        second=$!
        for try in $(seq 100); do
            grep -q Ctrl-C "$DIRECTORY/second.out" 2> /dev/null && break
            sleep 0.05
        done
        # The far end has no carrier, and the last SubDevice no link.
        pull() {
            "$LINESMAN" fault "$DIRECTORY/ring" inject link-open --at B3.B-maindevice.B > /dev/null
            ip link set far2 down
        }
        plug() { ip link set far2 up; "$LINESMAN" fault "$DIRECTORY/ring" heal > /dev/null; }
        say() { echo "== $1"; shift; "$LINESMAN" "$@" 2>&1; echo "status $?"; }
        say closed ring near1+near2 --wait 0
        pull
        say unplugged ring near1+near2 --wait 0
        say exchanged ring near2+near1 --wait 0
        say other ring near1+near0 --wait 0
        cd "$DIRECTORY"
        "$LINESMAN" ring near1+near2 --save set_up.toml --wait 30 > steps.out 2>&1 &
        steps=$!
        for try in $(seq 200); do grep -q "Step 2" steps.out && break; sleep 0.05; done
        plug
        wait $steps; echo "== steps"; cat steps.out
        pull
        (for try in $(seq 200); do grep -q "Step 2" end.out && break; sleep 0.05; done; plug) &
        "$LINESMAN" ring near1+near2 --end 2.B --wait 30 > end.out 2>&1
        echo "== wrong end, status $?"; cat end.out
        say run run set_up.toml --on near1+near2 --seconds 3
        kill -INT $second; wait $second
    "#;
    let script = script.replace("RING_FILE", &RING.replace('"', "\\\""));
    let Some(run) = beside_segment(&script) else { return };
    let part = |name: &str| {
        let begin = run
            .stdout
            .find(&format!("== {name}"))
            .unwrap_or_else(|| panic!("{name}: {}", run.all()));
        let rest = &run.stdout[begin + 3..];
        &rest[..rest.find("\n== ").unwrap_or(rest.len())]
    };
    for (name, said) in [
        ("closed", "pull the cable out of near2"),
        ("closed", "near2: its cable is still plugged in: the ring is closed"),
        ("closed", "status 2"),
        ("unplugged", "Step 1 of 4: scan with the ring open, by near1"),
        ("unplugged", "3 SubDevices found, the last one SubDevice 3 (EP2308-0001)"),
        (
            "unplugged",
            "Step 2 of 4: plug a cable from port B of SubDevice 3 (EP2308-0001) into near2",
        ),
        ("unplugged", "near2: it has no link, the cable to it is not plugged in"),
        ("unplugged", "status 2"),
        (
            "exchanged",
            "near2 reaches nobody, and near1 reaches 3 SubDevices: the cards are exchanged",
        ),
        (
            "other",
            "near0: its cable is that of another line: 6 SubDevices answer, with the ring open 3",
        ),
        ("steps", "near2 receives what near1 sends: the ring is closed"),
        ("steps", "it closes at port B of SubDevice 3 (EP2308-0001)"),
        ("steps", "Step 4 of 4: checked"),
        ("steps", "nobody is lost when 4 cables break, one at a time"),
        ("steps", "Saved as set_up.toml."),
        ("steps", "Next: linesman run set_up.toml --on near1+near2"),
        (
            "wrong end, status 1",
            "the ring closes at port B of SubDevice 3 (EP2308-0001), expected port B of SubDevice 2",
        ),
        // A computer that is late loses frames; that it is driven is what is asked.
        ("run", "all 3 SubDevices have reached their states"),
    ] {
        assert!(part(name).contains(said), "{name}: {said}: {}", run.all());
    }
}

#[test]
fn a_virtual_ring_is_set_up_and_planned() {
    let folder = TempDir::new().unwrap();
    let plant = folder.path().join("plant.toml");
    let branch = "[[device]]\nname = \"K\"\ntype = \"EK1100\"\non = \"B3.B\"\n\
                  [[device]]\nname = \"J\"\ntype = \"EK1122\"\non = \"K.B\"\n\
                  [[device]]\nname = \"X\"\ntype = \"EK1100\"\non = \"J.D\"\n";
    fs::write(
        &plant,
        RING.replace(
            "[ring]\ncloses_at = \"B3.B\"",
            &format!("{branch}[ring]\ncloses_at = \"K.C\""),
        ),
    )
    .unwrap();
    let saved = folder.path().join("saved.toml");
    let on = format!("sim:{}", plant.display());
    let run = linesman(["ring", &on, "--end", "4.C", "--save", saved.to_str().unwrap()]);
    assert_eq!(run.status, 0, "{}", run.all());
    for said in
        ["it closes at port C of SubDevice 4 (EK1100)", "without it SubDevice 6 (EK1100) is lost"]
    {
        assert!(run.stdout.contains(said), "{said}: {}", run.all());
    }
    let run = linesman(["plan", saved.to_str().unwrap(), "--json"]);
    assert_eq!(run.json()["cables"].as_array().unwrap().len(), 6, "{}", run.all());
    let run = linesman(["ring", &on, "--end", "4.C", "--json"]);
    let report = run.json();
    assert_valid(&report, "ring");
    assert_eq!((run.status, &report["wrong"], &report["end"]), (0, &json!(null), &json!("4.C")));
    let cables = report["cables"].as_array().unwrap();
    let lost: Vec<_> = cables.iter().filter(|one| one["may_break"] == false).collect();
    assert_eq!(lost, [&json!({ "may_break": false, "lost": [6] })]);
    assert!(run.stderr.contains("Step 2 of 4: plug a cable"), "{}", run.all());
    let run = linesman(["ring", &on, "--end", "3.B", "--json"]);
    let report = run.json();
    assert_valid(&report, "ring");
    assert_eq!((run.status, &report["expected_end"]), (1, &json!("3.B")), "{}", run.all());
    let reason = report["wrong"]["reason"].as_str().unwrap();
    assert!(reason.contains("closes at port C of SubDevice 4"), "{reason}");
    let run = linesman(["ring", &on, "--end", "9.Q"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(
        run.stderr.contains("--end 9.Q: expected a number and a port, 1.A to 6.D"),
        "{}",
        run.all()
    );
    let run = linesman(["ring", "eth0"]);
    assert_eq!(run.status, 2, "{}", run.all());
    assert!(run.stderr.contains("expected two"), "{}", run.all());
}

/// Two tools with a coding switch, a terminal that is asked by AL control, one with an alias, and one with nothing.
fn numbered(first: u16, second: u16) -> String {
    format!(
        "[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
         [[device]]\nname = \"T2\"\ntype = \"EL3104\"\non = \"K1.B\"\nid = 9\n\
         [[device]]\nname = \"T3\"\ntype = \"EL1008\"\non = \"T2.B\"\nalias = 30\n\
         [[device]]\nname = \"T4\"\ntype = \"EL1008\"\non = \"T3.B\"\n\
         [[device]]\nname = \"X5\"\ntype = \"EK1101\"\non = \"K1.C\"\nid = {first}\n\
         [[device]]\nname = \"X6\"\ntype = \"EK1101\"\non = \"X5.C\"\nid = {second}\n"
    )
}

#[test]
fn numbers_are_read_in_three_ways_proposed_compared_and_set() {
    let folder = TempDir::new().unwrap();
    let on = |text: &str| {
        fs::write(folder.path().join("plant.toml"), text).unwrap();
        format!("sim:{}", folder.path().join("plant.toml").display())
    };
    let place = on(&numbered(5, 6));
    let run = linesman(["id", &place]);
    assert_eq!(run.status, 0, "{}", run.all());
    for said in [
        "X5 (EK1101): identification = { by = \"selector\", value = 5 }",
        "X6 (EK1101): identification = { by = \"selector\", value = 6 }",
        "T2 (EL3104): identification = { by = \"selector\", value = 9 }",
        "T3 (EL1008): identification = { by = \"alias\", value = 30 }",
        "by AL control",
        "at 0x1000",
    ] {
        assert!(run.stdout.contains(said), "{said}: {}", run.all());
    }
    let report = linesman(["id", &place, "--json"]).json();
    assert_valid(&report, "numbers");
    let number = |no: usize, key: &str| report["devices"][no - 1][key].clone();
    assert_eq!(number(5, "selector"), 5);
    assert_eq!(
        (number(5, "read"), number(2, "read")),
        (json!("at 0x1000"), json!("by AL control"))
    );
    assert_eq!((number(3, "alias"), number(4, "alias")), (json!(30), json!(null)));
    assert_eq!(report["differences"], json!(null));
    // As proposed, in a project.
    let saved = folder.path().join("saved.toml");
    let scan = linesman(["scan", &place, "--save", saved.to_str().unwrap()]);
    assert_eq!(scan.status, 0, "{}", scan.all());
    let mut text = fs::read_to_string(&saved).unwrap();
    for (name, by, value) in [
        ("SubDevice 2 (EL3104)", "selector", 9),
        ("SubDevice 3 (EL1008)", "alias", 30),
        ("SubDevice 5 (EK1101)", "selector", 5),
        ("SubDevice 6 (EK1101)", "selector", 6),
    ] {
        let line = format!("name = \"{name}\"\n");
        assert!(text.contains(&line), "{text}");
        let with = format!("{line}identification = {{ by = \"{by}\", value = {value} }}\n");
        text = text.replacen(&line, &with, 1);
    }
    let project = folder.path().join("project.toml");
    fs::write(&project, text).unwrap();
    let against =
        |plant: &str| linesman(["id", &on(plant), "--against", project.to_str().unwrap()]);
    let run = against(&numbered(5, 6));
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("All numbers are as planned."), "{}", run.all());
    for (plant, expected) in [
        (
            numbered(6, 5),
            "SubDevice 5 (EK1101): its selector 5 is told by X6 (EK1101), at another place",
        ),
        (numbered(5, 5), "its selector 5 is told by X5 (EK1101) and X6 (EK1101)"),
        (numbered(5, 7), "SubDevice 6 (EK1101): its selector must be 6, but X6 (EK1101) tells 7"),
        (
            numbered(5, 6).replace("alias = 30", ""),
            "its alias must be 30, but T3 (EL1008) tells none",
        ),
    ] {
        let run = against(&plant);
        assert_eq!(run.status, 1, "{}", run.all());
        assert!(run.stderr.contains(expected), "{expected}: {}", run.all());
    }
    let path = project.to_str().unwrap();
    let run = linesman(["id", &on(&numbered(5, 7)), "--against", path, "--json"]);
    let report = run.json();
    assert_valid(&report, "numbers");
    let differences = report["differences"].as_array().unwrap();
    assert_eq!((run.status, differences.len()), (1, 1), "{}", run.all());
    let backup = folder.path().join("backup.bin");
    let words = ["id", &place, "T4", "--set", "31", "--backup", backup.to_str().unwrap()];
    let run = linesman(words);
    assert_eq!(run.status, 0, "{}", run.all());
    assert!(run.stdout.contains("alias 31") && backup.exists(), "{}", run.all());
    for (device, value, expected) in [
        ("X5", "31", "has a selector, which no frame can set"),
        ("T4", "30", "alias 30 is that of T3"),
    ] {
        let run = linesman(["id", &on(&numbered(5, 6)), device, "--set", value]);
        assert_eq!(run.status, 2, "{}", run.all());
        assert!(run.stderr.contains(expected), "{expected}: {}", run.all());
    }
}

#[test]
fn online_tells_what_each_card_of_a_ring_counts() {
    let cut = "[[fault]]\nkind = \"link-open\"\nat = \"B1.B-B2.A\"\nfrom_ms = 6000\n";
    let running = Running::start(&format!("{RING}{cut}"));
    let report = running.until("counts", |report| !report["responding_by_card"].is_null());
    assert_eq!(report["responding_by_card"], json!([0, 3]));
    let text = linesman(["online", &running.socket()]).stdout;
    let said =
        "Ring: 0 SubDevices counted in what card A receives, 3 in that of card B: it is whole.";
    assert!(text.contains(said), "{text}");
    running.until("is open", |report| report["responding_by_card"] == json!([1, 2]));
    let text = linesman(["online", &running.socket()]).stdout;
    let said =
        "Ring: 1 SubDevice counted in what card A receives, 2 in that of card B: it is open.";
    assert!(text.contains(said), "{text}");
}
