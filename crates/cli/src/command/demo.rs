//! `linesman demo`: a plant drawn by chance, broken and healed, with the truth beside the verdict.

use std::hash::{BuildHasher as _, RandomState};
use std::path::PathBuf;

use linesman_lab::demo::{Demo, DemoEpisode, DemoVerdict};
use linesman_lab::lab::LabError;
use linesman_lab::verdict::Grade;
use linesman_proto::time::Span;

use crate::exit::Status;
use crate::failure::Failure;
use crate::files;
use crate::output::{Output, Paint, wrapped};
use crate::text::quantity::{count, grouped, time};

/// Seeds that are drawn for people have few digits.
const SEEDS: u64 = 10_000;
/// Actions that are shown; the first are the most promising.
const ACTIONS: usize = 2;

/// What can be asked.
#[derive(clap::Args, Debug)]
pub(crate) struct Arguments {
    /// Which plant and which faults; by chance unless said
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Write the plant as a segment file, for `sim` and `diagnose sim:`
    #[arg(long, value_name = "plant.toml")]
    save: Option<PathBuf>,
}

/// Shows it.
pub(crate) fn run(arguments: &Arguments, output: &mut Output) -> Result<Status, Failure> {
    // Which demo is shown is the one thing that is left to real chance; all else hangs on the seed.
    let seed = arguments.seed.unwrap_or_else(|| RandomState::new().hash_one(0_u8) % SEEDS);
    let failed = |error: LabError| {
        let again = format!("play it again with `linesman demo --seed {seed}` and report it");
        Failure::new(format!("demo {seed}: {error}"), again)
    };
    let mut demo = Demo::new(seed).map_err(failed)?;
    introduce(&demo, seed, output);
    if let Some(path) = &arguments.save {
        files::write_new(path, "the plant", &demo.file().to_toml())?;
    }
    let took = demo.bring_up().map_err(failed)?;
    output.line(&format!("\nAll in OP after {} of its time.", span(took)));
    let (mut right, mut number) = (0, 0);
    while let Some(episode) = demo.next_episode().map_err(failed)? {
        number += 1;
        right += u32::from(episode.held());
        let heading = format!("{number} of {}", demo.episodes());
        output.text(&text(&heading, &episode, output.paint(), output.width()));
        if output.is_closed() {
            break;
        }
    }
    let (frames, ran) = (demo.lab().frames(), demo.lab().now());
    output.line(&format!(
        "\n{right} of {number} faults were told rightly and healed. {} in {} of virtual time.",
        count(frames, "frame"),
        time(ran.as_nanos())
    ));
    output.line(&format!(
        "Again: `linesman demo --seed {seed}`. Another: `linesman demo --seed {}`.",
        seed.wrapping_add(1)
    ));
    Ok(if right == number && number > 0 { Status::Good } else { Status::Findings })
}

fn introduce(demo: &Demo, seed: u64, output: &mut Output) {
    let devices = demo.lab().project().devices.len() as u64;
    let title = format!(
        "Demo {seed}: a virtual line of {}, cycle {}",
        count(devices, "SubDevice"),
        span(demo.cycle())
    );
    output.line(&format!("{}\n", output.paint().bold(&title)));
    for row in demo.drawing() {
        output.line(row.text.trim_end());
    }
}

/// One fault: truth, verdict, recovery.
fn text(heading: &str, episode: &DemoEpisode, paint: Paint, width: usize) -> String {
    let add = |text: &mut String, name: &str, words: &str| {
        text.push_str(&wrapped(&format!("  {}", paint.faint(&format!("{name:<9}"))), words, width));
    };
    let mut text = format!("\n{}\n", paint.bold(&format!("Fault {heading}")));
    add(&mut text, "injected", &episode.entry);
    match &episode.verdict {
        Some(verdict) => {
            for (name, words) in verdict_lines(verdict, paint) {
                add(&mut text, name, &words);
            }
        }
        None => add(&mut text, "verdict", &paint.bad("WRONG: nothing was said that fits")),
    }
    let healed = match episode.healed_in {
        Some(after) => format!("back in OP, with nothing left to report, after {}", span(after)),
        None => paint.bad("WRONG: the line did not come back"),
    };
    add(&mut text, "healed", &healed);
    text
}

fn verdict_lines(verdict: &DemoVerdict, paint: Paint) -> Vec<(&'static str, String)> {
    let DemoVerdict { finding, place, fits, cycles, others } = verdict;
    let grade = match fits.cause {
        Grade::Exact => paint.good("RIGHT"),
        Grade::Admitted(_) => paint.good("RIGHT"),
        Grade::Wrong => paint.bad("WRONG"),
    };
    let mut lines = vec![
        (
            "verdict",
            format!("{grade}  {} {}: {} at {place}", finding.code, finding.name, finding.cause),
        ),
        (
            "after",
            format!("{} {}", grouped(*cycles), if *cycles == 1 { "cycle" } else { "cycles" }),
        ),
    ];
    if let Grade::Admitted(why) = fits.cause {
        lines.push(("since", why.to_owned()));
    }
    if *others > 0 {
        lines.push((
            "beside",
            format!("{} that are not among its consequences", count(*others as u64, "finding")),
        ));
    }
    for (index, action) in finding.actions.iter().take(ACTIONS).enumerate() {
        lines.push((if index == 0 { "do" } else { "" }, format!("{}. {action}", index + 1)));
    }
    lines
}

fn span(span: Span) -> String {
    time(span.as_nanos())
}
