//! The live view: a table that is drawn again and again on a terminal, lines of what changes elsewhere.

use std::io::{self, IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use crossterm::event::{self, Event, KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use crossterm::terminal::{
    self, Clear, ClearType, DisableLineWrap, EnableLineWrap, EnterAlternateScreen,
    LeaveAlternateScreen,
};
use crossterm::{cursor, execute, queue};
use linesman_config::inventory::label;
use linesman_proto::address::DeviceId;
use linesman_runtime::online::report::{OnlineDevice, OnlineReport};

use super::table;
use crate::failure::Failure;
use crate::output::Output;
use crate::text::quantity::time;

/// How often something is shown, and for how long.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pace {
    pub(super) interval: Duration,
    pub(super) lasts: Option<Duration>,
}

/// A live view. The terminal is given back when it is dropped.
pub(super) struct Live {
    kind: Kind,
    pace: Pace,
    began: Instant,
    last: Option<OnlineReport>,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Json,
    /// A terminal that is drawn on.
    Screen,
    /// A line for each change.
    Lines,
}

impl Live {
    /// Takes the terminal, if there is one.
    pub(super) fn start(json: bool, pace: Pace, output: &Output) -> Result<Self, Failure> {
        // A key that ends it can be pressed only where standard input is a terminal, too.
        let is_terminal = io::stdout().is_terminal() && io::stdin().is_terminal();
        let kind = match (json, is_terminal && !output.is_closed()) {
            (true, _) => Kind::Json,
            (false, true) => Kind::Screen,
            (false, false) => Kind::Lines,
        };
        if kind == Kind::Screen {
            terminal::enable_raw_mode().map_err(|error| screen(&error))?;
            execute!(io::stdout(), EnterAlternateScreen, DisableLineWrap, cursor::Hide)
                .map_err(|error| screen(&error))?;
        }
        Ok(Self { kind, pace, began: Instant::now(), last: None })
    }

    /// Time between two looks.
    pub(super) const fn interval(&self) -> Duration {
        self.pace.interval
    }

    /// Shows how the line is now.
    pub(super) fn show(
        &mut self,
        report: &OnlineReport,
        output: &mut Output,
    ) -> Result<(), Failure> {
        match self.kind {
            Kind::Json => output.json_line(report),
            Kind::Screen => {
                let text = table::text(report, self.last.as_ref(), output);
                draw(&text).map_err(|error| screen(&error))?;
            }
            Kind::Lines => {
                let lines = match &self.last {
                    Some(last) => changes(last, report),
                    None => table::text(report, None, output).lines().map(str::to_owned).collect(),
                };
                for line in lines {
                    output.line(&line);
                }
            }
        }
        self.last = Some(report.clone());
        Ok(())
    }

    /// Waits until the next look is due. False when nobody wants one.
    pub(super) fn wait(&self, output: &Output) -> Result<bool, Failure> {
        let until = Instant::now() + self.pace.interval;
        loop {
            let rest = until.saturating_duration_since(Instant::now());
            if !self.goes_on(output)? {
                return Ok(false);
            }
            if rest.is_zero() {
                return Ok(true);
            }
            let nap = rest.min(Duration::from_millis(50));
            if self.kind == Kind::Screen {
                event::poll(nap).map_err(|error| screen(&error))?;
            } else {
                std::thread::sleep(nap);
            }
        }
    }

    /// Whether it is wanted any longer.
    pub(super) fn goes_on(&self, output: &Output) -> Result<bool, Failure> {
        if self.pace.lasts.is_some_and(|lasts| self.began.elapsed() >= lasts) || output.is_closed()
        {
            return Ok(false);
        }
        if self.kind != Kind::Screen {
            return Ok(true);
        }
        while event::poll(Duration::ZERO).map_err(|error| screen(&error))? {
            if let Event::Key(key) = event::read().map_err(|error| screen(&error))?
                && ends(key)
            {
                return Ok(false);
            }
        }
        Ok(true)
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        if self.kind == Kind::Screen {
            // There is nobody to tell when the terminal is gone.
            let _ = execute!(io::stdout(), EnableLineWrap, LeaveAlternateScreen, cursor::Show);
            let _ = terminal::disable_raw_mode();
        }
    }
}

/// q, Escape or Ctrl-C, which a terminal in this mode gives as a key.
fn ends(key: KeyEvent) -> bool {
    let control = key.modifiers.contains(KeyModifiers::CONTROL);
    let is_end = matches!(key.code, KeyCode::Char('q') | KeyCode::Esc)
        || (key.code == KeyCode::Char('c') && control);
    key.kind == KeyEventKind::Press && is_end
}

fn screen(error: &io::Error) -> Failure {
    Failure::new(
        format!("drawing on the terminal: {error}"),
        "leave `--live` out, or pipe through `cat`",
    )
}

/// As much of a text as fits on the terminal.
fn draw(text: &str) -> io::Result<()> {
    let (_, height) = terminal::size()?;
    let height = usize::from(height);
    let mut stdout = io::stdout().lock();
    queue!(stdout, cursor::MoveTo(0, 0))?;
    let lines: Vec<&str> = text.lines().collect();
    let fits = lines.len() < height;
    let shown = if fits { lines.len() } else { height.saturating_sub(2) };
    for line in lines.iter().take(shown) {
        write!(stdout, "{line}")?;
        queue!(stdout, Clear(ClearType::UntilNewLine))?;
        write!(stdout, "\r\n")?;
    }
    if !fits {
        write!(stdout, "... {} lines more; q ends", lines.len() - shown)?;
    }
    queue!(stdout, Clear(ClearType::FromCursorDown))?;
    stdout.flush()
}

/// What is otherwise than before, a line each.
fn changes(before: &OnlineReport, now: &OnlineReport) -> Vec<String> {
    let at = format!("{:>12}", time(now.time_ns));
    let mut lines = Vec::new();
    if before.state != now.state {
        lines.push(format!("{at}  network: {}, was {}", now.state.text, before.state.text));
    }
    for device in &now.devices {
        let Some(old) = before.devices.iter().find(|old| old.no == device.no) else { continue };
        let what = changed(old, device);
        if !what.is_empty() {
            let id = DeviceId(device.no.saturating_sub(1));
            let called = label(id, &device.name, &device.r#type);
            lines.push(format!("{at}  {called}: {}", what.join("; ")));
        }
    }
    for (what, old, new) in [
        ("cyclic", before.cyclic.lost, now.cyclic.lost),
        ("queued", before.queued.lost, now.queued.lost),
    ] {
        if new > old {
            lines.push(format!("{at}  {what} frames lost: {} more, {new} in all", new - old));
        }
    }
    lines
}

fn changed(old: &OnlineDevice, new: &OnlineDevice) -> Vec<String> {
    let mut what = Vec::new();
    if old.state != new.state {
        what.push(format!("{}, was {}", new.state.text, old.state.text));
    }
    if let (Some(text), true) = (&new.al_code_text, old.al_code != new.al_code) {
        what.push(format!("AL 0x{:04X} {text}", new.al_code));
    }
    if old.wc_state != new.wc_state {
        let is_wrong = new.wc_state == Some(true);
        what.push(format!("working counter {}", if is_wrong { "wrong" } else { "right" }));
    }
    if new.errors > old.errors {
        what.push(format!("{} errors more, {} in all", new.errors - old.errors, new.errors));
    }
    let lost = |device: &OnlineDevice| -> u64 {
        device.ports.iter().filter_map(|port| port.lost_links).map(|count| count.total).sum()
    };
    if lost(new) > lost(old) {
        what.push(format!("{} links lost", lost(new) - lost(old)));
    }
    let failed = |device: &OnlineDevice| device.mailbox.as_ref().map_or(0, |one| one.errors);
    if failed(new) > failed(old) {
        let text = new.mailbox.iter().flat_map(|one| &one.standing).next_back();
        what.push(text.map_or_else(|| "mailbox error".to_owned(), |one| one.text.clone()));
    }
    what
}

#[cfg(test)]
mod tests {
    use super::*;
    use linesman_runtime::online::report::{Count, FrameCounts, OnlinePort, Word};

    fn word(word: u16, text: &str) -> Word {
        Word { word, text: text.to_owned() }
    }

    #[test]
    fn only_what_changes_is_told() {
        let port = |total| OnlinePort {
            lost_links: Some(Count { register: 7, total }),
            ..OnlinePort::default()
        };
        let device = OnlineDevice {
            no: 3,
            name: "T3".to_owned(),
            state: word(8, "OP"),
            wc_state: Some(false),
            ports: vec![port(0), port(1)],
            ..OnlineDevice::default()
        };
        let before = OnlineReport {
            time_ns: 1_000_000_000,
            state: word(0, "OK"),
            devices: vec![device.clone()],
            ..OnlineReport::default()
        };
        assert_eq!(changes(&before, &before), Vec::<String>::new());
        let now = OnlineReport {
            time_ns: 2_000_000_000,
            state: word(0x0C00, "Not OK - at least one device in SAFEOP"),
            devices: vec![OnlineDevice {
                state: word(0x14, "ERR SAFEOP"),
                al_code: 0x1B,
                al_code_text: Some("sync manager watchdog".to_owned()),
                wc_state: Some(true),
                errors: 5,
                ports: vec![port(0), port(3)],
                ..device
            }],
            cyclic: FrameCounts { sent: 9, lost: 2, per_second: None },
            ..before.clone()
        };
        assert_eq!(
            changes(&before, &now),
            [
                "     2.000 s  network: Not OK - at least one device in SAFEOP, was OK",
                "     2.000 s  T3: ERR SAFEOP, was OP; AL 0x001B sync manager watchdog; working \
                 counter wrong; 5 errors more, 5 in all; 2 links lost",
                "     2.000 s  cyclic frames lost: 2 more, 2 in all",
            ]
        );
    }
}
