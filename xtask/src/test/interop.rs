//! Foreign MainDevices against the virtual segment, each in network namespaces of its own.

use std::path::PathBuf;

use anyhow::Result;

use super::cargo::cargo;
use super::{Context, Outcome, product, tools};

pub(super) fn run(context: &Context<'_>) -> Result<Outcome> {
    if !tools::is_root() {
        return Ok(Outcome::Skipped("not root: network namespaces cannot be made".into()));
    }
    if let Some(why) = context.missing.get("ip") {
        return Ok(Outcome::Skipped(why.clone()));
    }
    let python = match tools::python(context) {
        Ok(python) => python,
        Err(why) => return Ok(Outcome::Skipped(why)),
    };
    if let failed @ (Outcome::Failed { .. } | Outcome::Skipped(_)) = product::release(context)? {
        return Ok(failed);
    }
    let ethercrab = ethercrab(context)?;
    let wanted = &context.options.checks;
    let arguments: Vec<&str> =
        ["interop/run.py"].into_iter().chain(wanted.iter().map(String::as_str)).collect();
    let ran = context
        .command("interop", python, &arguments)
        .env("LINESMAN", product::binary(context))
        .env("ETHERCRAB_PEER", ethercrab)
        .limit(1500)
        .run()?;
    let mut counts = [0_u64; 3];
    for line in ran.output.lines() {
        let kind = ["ok ", "FAIL ", "skip "].iter().position(|word| line.starts_with(word));
        if let Some(kind) = kind {
            counts[kind] += 1;
            println!("    {line}");
            if line.starts_with("skip ") {
                context.note_skip(line);
            }
        }
    }
    let [passed, failed, skipped] = counts;
    if !ran.success() || failed > 0 || passed == 0 {
        let why = format!("{failed} failed; {}", ran.explain());
        return Ok(Outcome::Failed { count: passed, why });
    }
    if wanted.is_empty() {
        latency(context)?;
    }
    let mut note = "checks with foreign MainDevices".to_owned();
    if skipped > 0 {
        note += &format!(", {skipped} skipped");
    }
    Ok(Outcome::Passed { count: passed, note })
}

/// Builds the peer made with ethercrab; where it is, if it could be built.
pub(super) fn ethercrab(context: &Context<'_>) -> Result<PathBuf> {
    let target = context.target.join("interop");
    let arguments = ["build", "--release", "--manifest-path=interop/ethercrab/Cargo.toml"];
    let ran = context
        .command("interop-ethercrab", cargo(), &arguments)
        .env("CARGO_TARGET_DIR", &target)
        .run()?;
    if !ran.success() {
        println!("    ethercrab cannot be built: {}", ran.explain());
    }
    Ok(target.join("release/ethercrab-peer"))
}

/// Prints how the segment's answer compares with that of a bare reflector. What the benchmark makes of it depends on what
/// else this host does, so nothing fails by it.
fn latency(context: &Context<'_>) -> Result<()> {
    // With the binary's package, so that cargo takes the libraries that it built for the binary.
    let arguments =
        ["bench", "-p", "linesman-cli", "-p", "linesman-runtime", "--bench", "answer_over_veth"];
    let ran = context.command("interop-latency", cargo(), &arguments).limit(900).run()?;
    for line in ran.output.lines().filter(|line| line.contains("of the reflector")) {
        println!("    {line}");
    }
    if !ran.success() {
        println!(
            "    the latency is not what it should be, or was not measured: {}",
            ran.status_line()
        );
    }
    Ok(())
}
