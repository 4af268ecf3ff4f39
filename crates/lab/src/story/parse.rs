//! Reading a story: front matter, segment, steps.

use linesman_proto::state::AlState;
use linesman_proto::time::Span;

use super::step::{self, Step, StepAt};
use crate::habit::Habit;

/// A story.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Story {
    /// What stands above it.
    pub front: FrontMatter,
    /// The line it happens on.
    pub segment: SegmentText,
    /// What the MainDevice is told beyond who is where: tables of a project file.
    pub choices: Option<String>,
    /// What happens, in order.
    pub steps: Vec<StepAt>,
}

/// The front matter of a story: `key: value` lines between two lines of `---`.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct FrontMatter {
    /// What it is about, in one sentence.
    pub title: String,
    /// The requirement rows it proves, as test annotations write them.
    pub proves: String,
    /// Codes of the findings it belongs to.
    pub findings: Vec<String>,
    /// The seed of all chance.
    pub seed: u64,
    /// Cycle of the process data.
    pub cycle: Span,
    /// State the line is driven to.
    pub target: AlState,
    /// Whether the card's counters are read.
    pub host_counters: bool,
    /// Whether the diagnosis knows the project, as planned.
    pub project: bool,
    /// How the MainDevice drives the line.
    pub habit: Habit,
    /// Subject of its expectations.
    pub asserts: Asserts,
    /// Segment file to read when there is no TOML block.
    pub segment: Option<String>,
}

impl Default for FrontMatter {
    fn default() -> Self {
        Self {
            title: String::new(),
            proves: String::new(),
            findings: Vec::new(),
            seed: 1,
            cycle: Span::ms(2),
            target: AlState::Op,
            host_counters: true,
            project: true,
            habit: Habit::Own,
            asserts: Asserts::Diagnosis,
            segment: None,
        }
    }
}

/// Subject of the expectations of a story.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Asserts {
    /// The diagnosis, and what it rests on.
    Diagnosis,
    /// The segment alone: what a fault leaves in counters, links, states and frames.
    Segment,
}

/// Where the segment file is.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum SegmentText {
    /// In the story.
    Inline(String),
    /// In a file beside it.
    File(String),
}

/// A story that cannot be read.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum StoryError {
    /// A line of it.
    #[error("line {line}: {what}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong and what was expected.
        what: String,
    },
    /// The whole of it.
    #[error("{0}")]
    Whole(&'static str),
}

impl Story {
    /// Reads a story.
    ///
    /// # Errors
    /// [`StoryError`] with the line, and what was expected there.
    pub fn parse(text: &str) -> Result<Self, StoryError> {
        let mut lines = text.lines().enumerate().map(|(at, line)| (at + 1, line));
        let front = front(&mut lines)?;
        let mut toml: Option<String> = None;
        let mut choices: Option<String> = None;
        let mut steps = Vec::new();
        while let Some((line, text)) = lines.next() {
            if let Some(language) = text.strip_prefix("```") {
                let block = fenced(&mut lines);
                let (one, what) = match language.split_whitespace().collect::<Vec<_>>()[..] {
                    ["toml", "project"] => (
                        &mut choices,
                        "a second project: write all that is chosen into one ```toml project block",
                    ),
                    ["toml", ..] => (
                        &mut toml,
                        "a second TOML block: a story has one segment; what a project chooses is \
                         written into a ```toml project block",
                    ),
                    _ => continue,
                };
                if one.replace(block).is_some() {
                    return Err(StoryError::Line { line, what: what.to_owned() });
                }
            } else if let Some(item) = text.strip_prefix("- ") {
                let (at, step) =
                    step::parse(item).map_err(|what| StoryError::Line { line, what })?;
                steps.push(StepAt { line, text: item.trim().to_owned(), at, step });
            }
        }
        let segment = match (toml, &front.segment) {
            (Some(toml), None) => SegmentText::Inline(toml),
            (None, Some(file)) => SegmentText::File(file.clone()),
            (Some(_), Some(_)) => {
                return Err(StoryError::Whole(
                    "a segment file and a TOML block: choose one of them",
                ));
            }
            (None, None) => {
                return Err(StoryError::Whole(
                    "no line to play on: add a ```toml block with [[device]] entries, or \
                     `segment: FILE` to the front matter",
                ));
            }
        };
        if steps.is_empty() {
            return Err(StoryError::Whole(
                "no steps: write them as list items, `- expect healthy`",
            ));
        }
        asserts_what_it_says(front.asserts, &steps)?;
        Ok(Self { front, segment, choices, steps })
    }
}

/// A story of the segment alone expects something of it, and nothing of the diagnosis.
fn asserts_what_it_says(asserts: Asserts, steps: &[StepAt]) -> Result<(), StoryError> {
    let mut expectations = steps.iter().filter_map(|step| {
        if let Step::Expect { what, .. } = &step.step { Some((step.line, what)) } else { None }
    });
    match asserts {
        Asserts::Diagnosis => Ok(()),
        Asserts::Segment => match expectations.clone().find(|(_, what)| !what.is_of_segment()) {
            Some((line, _)) => {
                let what = "it expects something of the diagnosis, and the front matter says `asserts: segment`";
                Err(StoryError::Line { line, what: what.to_owned() })
            }
            None if expectations.next().is_none() => Err(StoryError::Whole(
                "`asserts: segment`, but no step expects anything of the segment",
            )),
            None => Ok(()),
        },
    }
}

/// The lines of a fenced block whose opening was read.
fn fenced<'a>(lines: &mut impl Iterator<Item = (usize, &'a str)>) -> String {
    let inside = lines.take_while(|(_, line)| !line.starts_with("```"));
    inside.map(|(_, line)| format!("{line}\n")).collect()
}

fn front<'a>(
    lines: &mut impl Iterator<Item = (usize, &'a str)>,
) -> Result<FrontMatter, StoryError> {
    let mut front = FrontMatter::default();
    if lines.next().is_none_or(|(_, line)| line.trim() != "---") {
        return Err(StoryError::Whole("a story begins with `---`, `title: …`, `---`"));
    }
    for (line, text) in lines {
        let text = text.trim();
        if text == "---" {
            if front.title.is_empty() {
                return Err(StoryError::Whole("the front matter has no `title: …`"));
            }
            return Ok(front);
        }
        if !text.is_empty() {
            entry(&mut front, text).map_err(|what| StoryError::Line { line, what })?;
        }
    }
    Err(StoryError::Whole("the front matter does not end: a second line of `---` is missing"))
}

fn entry(front: &mut FrontMatter, text: &str) -> Result<(), String> {
    let (key, value) =
        text.split_once(':').ok_or_else(|| format!("`{text}` is no `key: value`"))?;
    let value = value.trim();
    match key.trim() {
        "title" => front.title = value.to_owned(),
        "proves" => front.proves = value.to_owned(),
        "findings" => {
            front.findings = value.split(',').map(|code| code.trim().to_owned()).collect();
        }
        "seed" => front.seed = value.parse().map_err(|_| format!("`{value}` is no seed"))?,
        "cycle" => {
            let ms = value.strip_suffix("ms").and_then(|ms| ms.trim().parse().ok());
            let ms = ms.filter(|ms| (1..=100).contains(ms));
            let ms = ms.ok_or_else(|| format!("`{value}` is no cycle: 1 ms to 100 ms"))?;
            front.cycle = Span::ms(ms);
        }
        "target" => {
            front.target =
                AlState::from_name(value).ok_or_else(|| format!("`{value}` is no state"))?;
        }
        "host-counters" => front.host_counters = yes(value)?,
        "project" => front.project = yes(value)?,
        "habit" => front.habit = value.parse()?,
        "asserts" => {
            front.asserts = match value {
                "diagnosis" => Asserts::Diagnosis,
                "segment" => Asserts::Segment,
                other => return Err(format!("`{other}`: expected diagnosis or segment")),
            };
        }
        "segment" => front.segment = Some(value.to_owned()),
        other => {
            return Err(format!(
                "`{other}` is no key of a story: expected title, proves, findings, seed, cycle, \
                 target, host-counters, project, habit, asserts or segment"
            ));
        }
    }
    Ok(())
}

fn yes(value: &str) -> Result<bool, String> {
    match value {
        "yes" => Ok(true),
        "no" => Ok(false),
        other => Err(format!("`{other}`: expected yes or no")),
    }
}

#[cfg(test)]
mod tests {
    use super::super::step::{Expectation, Step};
    use super::*;

    const STORY: &str = "---\n\
        title: Nothing happens\n\
        proves: LAB-01 partial\n\
        host-counters: no\n\
        cycle: 4 ms\n\
        ---\n\
        A line on which nothing happens.\n\
        \n\
        ```toml\n\
        name = \"one\"\n\
        ```\n\
        - at 1 s expect healthy\n\
        \n\
        And so it stays.\n\
        - expect exit 0\n";

    #[test]
    fn front_segment_and_steps_are_found() {
        let story = Story::parse(STORY).unwrap();
        assert_eq!(story.front.title, "Nothing happens");
        assert!(!story.front.host_counters);
        assert_eq!(story.front.cycle, Span::ms(4));
        assert_eq!(story.segment, SegmentText::Inline("name = \"one\"\n".to_owned()));
        let steps: Vec<_> = story.steps.iter().map(|step| (step.line, step.at)).collect();
        assert_eq!(steps, [(12, Some(Span::s(1))), (15, None)]);
        let exit = Step::Expect { what: Expectation::Exit(0), within: Span::ZERO };
        assert_eq!(story.steps[1].step, exit);
    }

    #[test]
    fn story_of_the_segment_alone_expects_nothing_of_the_diagnosis() {
        let text = STORY.replace("cycle: 4 ms\n", "asserts: segment\n");
        let error = Story::parse(&text).unwrap_err().to_string();
        assert!(error.contains("line 12: it expects something of the diagnosis"), "{error}");
        let of_segment = text.replace("expect healthy", "expect answered");
        let error = Story::parse(&of_segment).unwrap_err().to_string();
        assert!(error.contains("line 15"), "what it exits with, too: {error}");
        let of_segment = of_segment.replace("- expect exit 0\n", "");
        assert_eq!(Story::parse(&of_segment).unwrap().front.asserts, Asserts::Segment);
        let nothing = of_segment.replace("- at 1 s expect answered", "- at 1 s heal");
        assert!(Story::parse(&nothing).unwrap_err().to_string().contains("no step expects"));
        let other = text.replace("asserts: segment", "asserts: all");
        assert!(Story::parse(&other).unwrap_err().to_string().contains("`all`"));
    }

    #[test]
    fn what_the_project_chooses_has_a_block_of_its_own() {
        let block = "```toml project\n[network]\nsync_window_ns = 500\n```\n";
        let story = Story::parse(&format!("{STORY}{block}")).unwrap();
        assert_eq!(story.choices.as_deref(), Some("[network]\nsync_window_ns = 500\n"));
        assert_eq!(story.segment, Story::parse(STORY).unwrap().segment);
        let error = Story::parse(&format!("{STORY}{block}{block}")).unwrap_err().to_string();
        assert!(error.contains("line 20: a second project"), "{error}");
    }

    #[test]
    fn what_is_wrong_has_its_line() {
        for (from, to, expected) in [
            ("cycle: 4 ms", "cycle: 4", "line 5: `4` is no cycle"),
            ("cycle: 4 ms", "pace: 4 ms", "line 5: `pace` is no key"),
            ("- expect exit 0", "- hope", "line 15: `hope` is no step"),
            ("```toml", "```text", "no line to play on"),
            ("title: Nothing happens", "", "no `title"),
            ("---\ntitle", "title", "begins with `---`"),
        ] {
            let error = Story::parse(&STORY.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        assert!(Story::parse("").is_err());
    }
}
