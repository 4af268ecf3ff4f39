//! Badges: the names of findings where they are.

use linesman_diagnosis::report::DirectionReport;
use maud::{Markup, html};

use super::scene::{Mark, direction};
use crate::text::finding::severity_word;

/// Height of a badge, and the pixels from one to the next.
pub(super) const HEIGHT: usize = 16;
const STEP: usize = HEIGHT + 2;

/// Arrows along the drawn wire: away from the MainDevice, towards it, both.
pub(super) type Arrows = [&'static str; 3];

/// Arrows of a wire that runs to the right, to the left, and down.
pub(super) const RIGHT: Arrows = ["→", "←", "↔"];
pub(super) const LEFT: Arrows = ["←", "→", "↔"];
pub(super) const DOWN: Arrows = ["↓", "↑", "↕"];

/// The place and the direction of a group of badges.
#[derive(Clone, Copy, Debug)]
pub(super) enum Group {
    /// One above the other, around a point.
    Stack { x: usize, y: usize, most: usize },
    /// Beside each other from the first, which is centred on a point.
    Row { x: usize, y: usize },
    /// Beside each other, to the left of a point.
    Before { x: usize, y: usize },
}

/// A badge as it is drawn: of a finding, or of those for which there is no room.
struct Badge {
    text: String,
    title: String,
    class: &'static str,
}

impl Badge {
    fn width(&self) -> usize {
        10 + 13 * self.text.chars().count() / 2
    }
}

/// The names of findings, each with an arrow for its direction.
pub(super) fn badges(marks: &[&Mark], group: Group, arrows: Arrows) -> Markup {
    let all = shown(marks, group, arrows);
    let mut places: Vec<(usize, usize)> = Vec::new();
    match group {
        Group::Stack { x, y, .. } => {
            let top = y - (all.len().saturating_sub(1) * STEP) / 2;
            places.extend(
                all.iter()
                    .enumerate()
                    .map(|(nth, badge)| (x - badge.width() / 2, top + nth * STEP - HEIGHT / 2)),
            );
        }
        Group::Row { x, y } => {
            let mut left = x - all.first().map_or(0, |first| first.width() / 2);
            for badge in &all {
                places.push((left, y - HEIGHT / 2));
                left += badge.width() + 2;
            }
        }
        Group::Before { x, y } => {
            let mut right = x;
            for badge in &all {
                places.push((right - badge.width(), y - HEIGHT / 2));
                right -= badge.width() + 2;
            }
        }
    }
    html! {
        @for (badge, (x, y)) in all.iter().zip(places) {
            g {
                title { (badge.title) }
                rect class={ "badge-" (badge.class) } x=(x) y=(y) rx="8"
                    width=(badge.width()) height=(HEIGHT) {}
                text class="badge" x=(x + badge.width() / 2) y=(y + 12) { (badge.text) }
            }
        }
    }
}

/// The badges that there is room for; the last stands for the rest. The worst come first.
fn shown(marks: &[&Mark], group: Group, arrows: Arrows) -> Vec<Badge> {
    let most = match group {
        Group::Stack { most, .. } => most,
        Group::Row { .. } | Group::Before { .. } => 2,
    };
    let mut sorted = marks.to_vec();
    sorted.sort_by_key(|mark| std::cmp::Reverse(mark.severity));
    let whole = if sorted.len() > most { most - 1 } else { sorted.len() };
    let (first, rest) = sorted.split_at(whole);
    let badge = |mark: &&Mark| Badge {
        text: match (arrow(mark, arrows), mark.id.len()) {
            ("", _) => mark.id.clone(),
            (arrow, ..4) => format!("{} {arrow}", mark.id),
            (arrow, _) => format!("{}{arrow}", mark.id),
        },
        title: mark.title.clone(),
        class: severity_word(mark.severity),
    };
    let mut all: Vec<Badge> = first.iter().map(badge).collect();
    if let Some(worst) = rest.first() {
        let titles: Vec<&str> = rest.iter().map(|mark| mark.title.as_str()).collect();
        all.push(Badge {
            text: format!("+{}", rest.len()),
            title: titles.join("\n"),
            class: severity_word(worst.severity),
        });
    }
    all
}

fn arrow(mark: &Mark, [away, towards, both]: Arrows) -> &'static str {
    match direction(mark) {
        None => "",
        Some(DirectionReport::AToB) => away,
        Some(DirectionReport::BToA) => towards,
        Some(DirectionReport::Both) => both,
    }
}
