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
        let why = format!("{failed} failed{}; {}", failures(&ran.output), ran.explain());
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

/// The checks that failed, each with the last line of its reason, which is the error of a program that a check ran.
fn failures(output: &str) -> String {
    let mut told = String::new();
    let mut last: Option<&str> = None;
    for line in output.lines() {
        if let Some(check) = line.strip_prefix("FAIL ") {
            told.extend(last.take().into_iter().map(|line| format!(" … {line}")));
            told += if told.is_empty() { ": " } else { "; " };
            told += check;
        } else if ["ok ", "skip "].iter().any(|word| line.starts_with(word))
            || line.contains(" checks passed, ")
        {
            told.extend(last.take().into_iter().map(|line| format!(" … {line}")));
        } else if !told.is_empty() {
            last = Some(line.trim()).filter(|line| !line.is_empty()).or(last);
        }
    }
    told
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

#[cfg(test)]
mod tests {
    #[test]
    fn failed_check_is_told_with_the_last_line_of_its_reason() {
        let output = "\
            ok one: 12 packets, 1.0 s\n\
            FAIL two: AssertionError: Traceback (most recent call last):\n  File \"two.py\"\nWkcError: 0\n\
            ok three: 3 packets, 1.0 s\n\
            FAIL four: RuntimeError: no line\n\
            2 checks passed, 2 failed, 0 were left out\n";
        assert_eq!(
            super::failures(output),
            ": two: AssertionError: Traceback (most recent call last): … WkcError: 0; four: RuntimeError: no line"
        );
    }
}
