//! Ethernet over EtherCAT with the IP stack of this computer: `run --eoe`.

use crate::support::bench::beside_segment;
use crate::support::{Run, linesman};

/// A device with an IP stack and a terminal with a computer at its port, served by a process of its own at the far end of
/// a cable, and driven at its near end, with an interface `eoe0`. All of it is in a network namespace.
const CABLE: &str = r#"
    [ -c /dev/net/tun ] || { echo "SKIPPED: no /dev/net/tun"; exit; }
    ip link set lo up
    ip link add near1 type veth peer name far1
    for card in near1 far1; do sysctl -q -w net.ipv6.conf.$card.disable_ipv6=1; ip link set $card up; done
    cat > $DIRECTORY/office.toml <<'SEGMENT_END'
name = "office"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "W1"
type = "EL6688"
on = "K1.B"
ethernet = { ip = "192.168.1.11/24", gateway = "192.168.1.100" }
[[device]]
name = "S1"
type = "EL6601"
on = "W1.B"
ethernet = { hosts = [{ port = 1, ip = "192.168.1.20/24" }] }
SEGMENT_END
    "$LINESMAN" sim $DIRECTORY/office.toml --on far1 > $DIRECTORY/office.out & office=$!
    for try in $(seq 100); do grep -q Ctrl-C $DIRECTORY/office.out && break; sleep 0.05; done
    out=$DIRECTORY/run.out
    "$LINESMAN" run --on near1 --cycle 1ms --control $DIRECTORY/line --eoe eoe0 --eoe-address 192.168.1.100/24 > $out & run=$!
    for try in $(seq 200); do grep -q 'have reached' $out && break; sleep 0.05; done
    cat > $DIRECTORY/ping.py <<'PING_END'
import os, socket, struct, sys
def checksum(data):
    data += b"\0" * (len(data) % 2)
    total = sum(struct.unpack("!%dH" % (len(data) // 2), data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return ~total & 0xFFFF
def ping(address, number, size):
    one = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_ICMP)
    one.settimeout(2)
    body = os.urandom(size)
    head = struct.pack("!BBHHH", 8, 0, 0, 77, number)
    head = struct.pack("!BBHHH", 8, 0, checksum(head + body), 77, number)
    one.sendto(head + body, (address, 0))
    for answer in range(100):
        try:
            data = one.recv(65536)[20:]
        except TimeoutError:
            return 0
        if data[0] == 0 and data[6:] == struct.pack("!H", number) + body:
            return 1
    return 0
for address in sys.argv[1:]:
    came = sum(ping(address, number, size) for number, size in enumerate([0, 56, 1000, 1472]))
    print("ping", address, came, "of 4")
PING_END
"#;

const END: &str = r#"
    kill -INT $run; wait $run
    grep -q 'Ethernet over EtherCAT: .* frames to 2 SubDevices .* back' $out && echo "counted"
    ip link show eoe0 > /dev/null 2>&1 && echo "the interface is still there"
    kill -INT $office; wait $office
"#;

/// What a script beside the line says; `None` where it cannot run here.
fn beside_office(script: &str) -> Option<Run> {
    let run = beside_segment(&[CABLE, script, END].concat())?;
    if run.stdout.contains("SKIPPED") {
        eprintln!("{}", run.stdout);
        return None;
    }
    Some(run)
}

// S0 L2849-2863.
// proves: EOE-01
#[test]
fn ping_and_a_web_page_come_through_the_segment() {
    let script = r#"
    python3 $DIRECTORY/ping.py 192.168.1.11 192.168.1.20
    python3 - <<'PAGE_END'
import urllib.request
urllib.request.install_opener(urllib.request.build_opener(urllib.request.ProxyHandler({})))
page = urllib.request.urlopen("http://192.168.1.11/", timeout=10).read().decode()
print("page", page.splitlines()[1])
print("bytes", len(urllib.request.urlopen("http://192.168.1.20/bytes/200000", timeout=20).read()))
PAGE_END
    "$LINESMAN" online $DIRECTORY/line --json | python3 -c '
import json, sys
report = json.load(sys.stdin)["ethernet"]
print(report["interface"], report["addresses"], [port["no"] for port in report["ports"]])
print(all(port["frames_to"] > 0 and port["fragments_from"] > 0 for port in report["ports"]))'
"#;
    let Some(run) = beside_office(script) else { return };
    let expected = [
        "ping 192.168.1.11 4 of 4",
        "ping 192.168.1.20 4 of 4",
        "page <title>W1</title>",
        "bytes 200000",
        "eoe0 3 [2, 3]",
        "True",
        "counted",
    ];
    assert_eq!(run.stdout.lines().collect::<Vec<_>>(), expected, "{}", run.all());
}

/// A computer in the plant's LAN, in a network namespace of its own, with a cable to this one: the addresses are those
/// of the worked route (S0 L2941-2979).
const LAN: &str = r#"
    unshare -n sleep 100 > /dev/null 2>&1 & lan=$!
    for try in $(seq 100); do
        [ "$(readlink /proc/$lan/ns/net)" != "$(readlink /proc/self/ns/net)" ] && break; sleep 0.05
    done
    ip link add wall type veth peer name desk
    ip link set desk netns $lan
    ip addr add 172.16.4.205/16 dev wall
    ip link set wall up
    inside() { nsenter -t $lan -n "$@"; }
    inside ip link set lo up
    inside ip addr add 172.16.8.31/16 dev desk
    inside ip link set desk up
"#;

/// The commands that `plan` prints for the router and for the computer in the LAN.
const ROUTES: &str = r#"
    "$LINESMAN" scan sim:$DIRECTORY/office.toml --save $DIRECTORY/machine.toml > /dev/null
    "$LINESMAN" plan $DIRECTORY/machine.toml --ethernet --eoe-address 192.168.1.100/24 \
        --lan-address 172.16.4.205/16 --lan-host 172.16.8.31/16 --json > $DIRECTORY/plan.json
    printed() {
        python3 -c '
import json, sys
for command in json.load(open(sys.argv[1]))["ethernet"]["routes"][int(sys.argv[2])]["commands"]:
    print(command)' $DIRECTORY/plan.json $1
    }
"#;

// S0 L2927-2979.
// proves: EOE-10, EOE-11 (V)
#[test]
fn computer_in_another_subnet_reaches_a_device_by_the_routes_that_are_printed() {
    let script = r#"
    echo 0 > /proc/sys/net/ipv4/ip_forward
    python3 $DIRECTORY/ping.py 192.168.1.11
    inside python3 $DIRECTORY/ping.py 192.168.1.11 2> /dev/null || echo "no route"
    sh -c "$(printed 0)"
    inside sh -c "$(printed 1)"
    inside python3 $DIRECTORY/ping.py 192.168.1.11
    kill $lan
"#;
    let Some(run) = beside_office(&[LAN, ROUTES, script].concat()) else { return };
    let expected = [
        "ping 192.168.1.11 4 of 4",
        "no route",
        "net.ipv4.ip_forward = 1",
        "ping 192.168.1.11 4 of 4",
        "counted",
    ];
    assert_eq!(run.stdout.lines().collect::<Vec<_>>(), expected, "{}", run.all());
}

// S0 L2985-3067.
// proves: EOE-13
#[test]
fn host_is_checked_for_what_ethernet_over_ethercat_needs() {
    let script = r#"
    check() {
        "$LINESMAN" host --eoe $1 --json | python3 -c '
import json, sys
checks = {check["name"]: check for check in json.load(sys.stdin)["checks"] if check["area"] == "network"}
for name in sys.argv[1:]:
    print(name, checks[name]["outcome"], (checks[name]["mend"] or ["-"])[0].split("   #")[0])
print("firewall" in checks)' $2 $3 $4 $5 $6
    }
    echo 0 > /proc/sys/net/ipv4/ip_forward
    echo 1 > /proc/sys/net/ipv4/icmp_echo_ignore_all
    check eoe0 interface-rights tap-interfaces forwarding ping-answers routes
    echo 1 > /proc/sys/net/ipv4/ip_forward
    echo 0 > /proc/sys/net/ipv4/icmp_echo_ignore_all
    check eoe0 forwarding ping-answers
    check eoe7 routes
    # A rule that drops pings, tried: the ping fails, the check names the rule, and without it both are well.
    if command -v nft > /dev/null && nft list ruleset > /dev/null 2>&1; then
        ip link set lo up
        nft add table inet tried
        nft add chain inet tried input '{ type filter hook input priority 0; }'
        nft add rule inet tried input icmp type echo-request drop
        check eoe0 firewall
        python3 $DIRECTORY/ping.py 127.0.0.1
        nft delete table inet tried
        check eoe0 firewall
        python3 $DIRECTORY/ping.py 127.0.0.1
    else
        echo "no nft"
    fi
"#;
    let Some(run) = beside_office(script) else { return };
    let mut expected = vec![
        "interface-rights good -",
        "tap-interfaces good -",
        "forwarding doubtful sudo sysctl -w net.ipv4.ip_forward=1",
        "ping-answers doubtful sudo sysctl -w net.ipv4.icmp_echo_ignore_all=0",
        "routes good -",
        "True",
        "forwarding good -",
        "ping-answers good -",
        "True",
        "routes doubtful sudo ip address add 192.168.1.100/24 dev eoe7",
        "True",
    ];
    match run.stdout.contains("no nft") {
        true => {
            eprintln!("SKIPPED: nft cannot be asked here, so no rule of a firewall is tried");
            expected.push("no nft");
        }
        false => expected.extend([
            "firewall doubtful sudo nft list ruleset",
            "True",
            "ping 127.0.0.1 0 of 4",
            "firewall good -",
            "True",
            "ping 127.0.0.1 4 of 4",
        ]),
    }
    expected.push("counted");
    assert_eq!(run.stdout.lines().collect::<Vec<_>>(), expected, "{}", run.all());
}

const OFFICE: &str = r#"
name = "office"
[[device]]
name = "K1"
type = "EK1100"
on = "maindevice"
[[device]]
name = "W1"
type = "EL6688"
on = "K1.B"
[[device]]
name = "S1"
type = "EL6601"
on = "W1.B"
"#;

/// The SubDevices that have a port of the virtual switch in a run of this project, or of what is there, by number.
fn ports(folder: &std::path::Path, project: Option<&str>) -> Vec<u64> {
    let segment = format!("sim:{}", folder.join("office.toml").display());
    let mut arguments = vec!["run".to_owned()];
    if let Some(project) = project {
        let path = folder.join("machine.toml");
        std::fs::write(&path, project).expect("a file can be written");
        arguments.push(path.display().to_string());
    }
    arguments.extend(["--on".to_owned(), segment]);
    arguments.extend(["--seconds", "1", "--json"].map(str::to_owned));
    let run = linesman(arguments);
    assert_eq!(run.status, 0, "{}", run.all());
    let report = run.json();
    let ports = report["ethernet"]["ports"].as_array().cloned().unwrap_or_default();
    ports.iter().filter_map(|port| port["no"].as_u64()).collect()
}

// S0 L2873.
// proves: EOE-03
#[test]
fn switch_is_active_for_each_sub_device_that_speaks_eoe_unless_it_is_switched_off() {
    let folder = tempfile::tempdir().expect("a temporary directory");
    let segment = folder.path().join("office.toml");
    std::fs::write(&segment, OFFICE).expect("a file can be written");
    assert_eq!(ports(folder.path(), None), [2, 3]);
    let saved = folder.path().join("saved.toml");
    let place = format!("sim:{}", segment.display());
    let scan = linesman(["scan", &place, "--save", &saved.display().to_string()]);
    assert_eq!(scan.status, 0, "{}", scan.all());
    let project = std::fs::read_to_string(&saved).expect("it was saved");
    assert_eq!(ports(folder.path(), Some(&project)), [2, 3]);
    let off = |at: usize| {
        let mut parts: Vec<_> = project.split("[[device]]\n").map(str::to_owned).collect();
        parts[at].insert_str(0, "eoe = false\n");
        parts.join("[[device]]\n")
    };
    assert_eq!(ports(folder.path(), Some(&off(2))), [3]);
    let none = format!("{project}\n[network]\neoe = false\n");
    assert_eq!(ports(folder.path(), Some(&none)), Vec::<u64>::new());
}
