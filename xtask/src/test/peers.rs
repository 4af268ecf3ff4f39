//! Linesman beside other MainDevices: a table with ratios.

use anyhow::Result;

use super::cargo::cargo;
use super::{Context, Outcome, interop, product, tools};

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
    let ethercrab = interop::ethercrab(context)?;
    let ran = context
        .command("bench-peers", python, &["interop/bench_peers.py"])
        .env("LINESMAN", product::binary(context))
        .env("ETHERCRAB_PEER", ethercrab)
        .limit(1800)
        .run()?;
    for line in ran.output.lines() {
        println!("    {line}");
    }
    // What a cycle costs on a card, as a share of bare sending and receiving on the same CPU.
    let floor = ["bench", "-p", "linesman-cli", "-p", "linesman-runtime", "--bench", "round_trips"];
    let trips = context.command("round-trips", cargo(), &floor).limit(900).run()?;
    for line in trips.output.lines().filter(|line| line.contains("µs")) {
        println!("    {line}");
    }
    if !trips.success() {
        return Ok(Outcome::Failed { count: 0, why: trips.status_line() });
    }
    let measured = ran.output.lines().filter(|line| line.contains(" ms ")).count() as u64;
    Ok(match ran.success() {
        true => Outcome::Passed { count: measured, note: "rows measured".to_owned() },
        false => Outcome::Failed { count: measured, why: ran.status_line() },
    })
}
