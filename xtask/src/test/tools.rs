//! What the steps need beside cargo: installed when it is missing and we may.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::process::Command;

use super::Context;
use super::cargo::answers;

/// A program, an argument it answers to, and the package that has it.
const PROGRAMS: &[(&str, &str, &str)] = &[
    ("tshark", "--version", "tshark"),
    ("tcpdump", "--version", "tcpdump"),
    ("ip", "-V", "iproute2"),
    ("ethtool", "--version", "ethtool"),
    ("jq", "--version", "jq"),
    ("nft", "--version", "nftables"),
    ("iperf3", "--version", "iperf3"),
    ("python3", "--version", "python3"),
];

/// Foreign MainDevices from Python's registry, and a reader of tables.
const PYTHON_PACKAGES: &[(&str, &str)] = &[
    ("pysoem", "pysoem==1.1.13"),
    ("kickcat", "kickcat==2.5"),
    ("ebpfcat", "ebpfcat==1.0.0"),
    ("pyetg1510", "pyetg1510==0.1.3"),
    ("pyads", "pyads==3.6.0"),
    ("duckdb", "duckdb==2.0.1"),
];

/// Runs as root.
pub(super) fn is_root() -> bool {
    let output = Command::new("id").arg("-u").output();
    output.is_ok_and(|output| output.stdout == b"0\n")
}

/// Where Python packages are installed.
pub(super) fn python_folder(context: &Context<'_>) -> PathBuf {
    context.target.join("interop-venv")
}

/// Installs what is missing; what still is, and why.
pub(super) fn prepare(context: &Context<'_>) -> BTreeMap<&'static str, String> {
    println!("== tools");
    let mut missing = BTreeMap::new();
    let absent: Vec<_> =
        PROGRAMS.iter().filter(|(program, argument, _)| !answers(program, argument)).collect();
    if !absent.is_empty() && !context.options.no_install {
        if is_root() {
            install(context, &absent.iter().map(|(_, _, package)| *package).collect::<Vec<_>>());
        } else {
            println!("not root, so nothing is installed");
        }
    }
    for (program, argument, package) in absent {
        if !answers(program, argument) {
            missing.insert(*program, format!("{program} is not here (package {package})"));
        }
    }
    for why in missing.values() {
        println!("{why}");
    }
    if missing.is_empty() {
        println!("all programs are here");
    }
    missing
}

fn install(context: &Context<'_>, packages: &[&str]) {
    println!("apt-get install {}", packages.join(" "));
    let mut arguments = vec!["install", "--yes", "--no-install-recommends"];
    arguments.extend(packages);
    let apt = |log: &str, arguments: &[&str]| {
        let run = context.command(log, "apt-get", arguments);
        let ran = run.env("DEBIAN_FRONTEND", "noninteractive").limit(600).run();
        ran.is_ok_and(|ran| ran.success())
    };
    if !apt("apt-install", &arguments) {
        // The lists may be old or absent.
        apt("apt-update", &["update"]);
        if !apt("apt-install", &arguments) {
            // One that the archive does not have must not keep the others away.
            for package in packages {
                apt("apt-install", &["install", "--yes", "--no-install-recommends", package]);
            }
        }
    }
}

/// A Python with the foreign MainDevices; `Err` says why there is none.
pub(super) fn python(context: &Context<'_>) -> Result<PathBuf, String> {
    if let Some(why) = context.missing.get("python3") {
        return Err(why.clone());
    }
    let folder = python_folder(context);
    let python = folder.join("bin/python");
    let there = |module: &str| {
        let output = Command::new(&python).args(["-c", &format!("import {module}")]).output();
        output.is_ok_and(|output| output.status.success())
    };
    let absent = || PYTHON_PACKAGES.iter().filter(|(module, _)| !there(module)).collect::<Vec<_>>();
    if absent().is_empty() {
        return Ok(python);
    }
    if context.options.no_install {
        return if there("pysoem") { Ok(python) } else { Err("pysoem is not installed".into()) };
    }
    if !python.exists() {
        let name = folder.to_string_lossy();
        let make = || {
            let run = context.command("venv", "python3", &["-m", "venv", &name]).limit(300).run();
            run.is_ok_and(|ran| ran.success())
        };
        if !make() && is_root() {
            install(context, &["python3-venv"]);
            make();
        }
    }
    for (module, package) in absent() {
        println!("pip install {package}");
        let arguments = ["-m", "pip", "install", "--disable-pip-version-check", package];
        let run = context.command(&format!("pip-{module}"), &python, &arguments).limit(600).run();
        match run {
            Ok(ran) if ran.success() => {}
            Ok(ran) => println!("    {}", ran.explain()),
            Err(error) => println!("    {error:#}"),
        }
    }
    // The others are tried when they are there; this one is the referee.
    if there("pysoem") { Ok(python) } else { Err("pysoem cannot be installed".into()) }
}
