//! Events of a capture by time: states, transfers, working counters, counters, gaps, findings.

use linesman_capture::CaptureReport;
use linesman_capture::timing::timeline::{TimelineEvent, timeline};
use linesman_diagnosis::report::Diagnosis;
use maud::{Markup, html};

use super::wall_clock::WallClock;
use crate::drawing::time_axis;
use crate::text::names::Names;
use crate::text::quantity::{count, time};

/// Most events in the table; those without trouble are left out first.
const MOST: usize = 200;

/// The drawing of all events, and their table.
pub(super) fn section(
    capture: &CaptureReport,
    diagnosis: &Diagnosis,
    clock: WallClock,
    names: &Names,
) -> Markup {
    let told = timeline(capture, diagnosis);
    let (shown, left_out) = selected(&told.events);
    html! {
        @if !told.events.is_empty() {
            section class="events" {
                h2 { "What happened" }
                div class="picture" { (time_axis::draw(&told, capture, names, false)) }
                details {
                    summary { (count(told.events.len() as u64, "event")) " in order of time" }
                    div class="wide" {
                        table {
                            thead {
                                tr {
                                    th { "time" } th { "lasts" } th { "frame" } th { "kind" }
                                    th { "where" } th { "what" }
                                }
                            }
                            tbody { @for event in &shown { (row(event, clock, names)) } }
                        }
                    }
                    @if left_out > 0 {
                        p class="faint" {
                            (left_out) " more: `linesman capture timeline " (capture.source.trim_start_matches("capture:"))
                            "` tells all"
                        }
                    }
                }
            }
        }
    }
}

/// Events for the table, and the number of those that are left out.
fn selected(events: &[TimelineEvent]) -> (Vec<&TimelineEvent>, usize) {
    let mut shown: Vec<&TimelineEvent> = events.iter().collect();
    if shown.len() > MOST {
        let trouble = shown.iter().filter(|event| event.trouble).count();
        let mut calm = MOST.saturating_sub(trouble);
        shown.retain(|event| {
            let is_shown = event.trouble || calm > 0;
            calm -= usize::from(!event.trouble && calm > 0);
            is_shown
        });
        shown.truncate(MOST);
    }
    let left_out = events.len() - shown.len();
    (shown, left_out)
}

fn row(event: &TimelineEvent, clock: WallClock, names: &Names) -> Markup {
    let lasts = event.to_ns.map(|to| time(to.0.saturating_sub(event.at_ns.0)));
    html! {
        tr class=[event.trouble.then_some("marked")] {
            td class="number" {
                (time(event.at_ns.0))
                @if let Some(clock) = clock.time_of_day(event.at_ns.0) { br; (clock) }
            }
            td class="number" { @if let Some(lasts) = lasts { (lasts) } }
            td class="number" { @if let Some(frame) = event.frame { (frame.0) } }
            td { (event.kind.name()) }
            td { (names.place_of(event.place.as_ref(), event.no)) }
            td { (event.text) }
        }
    }
}

#[cfg(test)]
mod tests {
    use linesman_capture::timing::timeline::TimelineEventKind;
    use linesman_diagnosis::report::Number;

    use super::*;

    fn event(at: u64, trouble: bool) -> TimelineEvent {
        TimelineEvent {
            at_ns: Number(at),
            to_ns: None,
            frame: None,
            kind: TimelineEventKind::State,
            no: Some(1),
            place: None,
            trouble,
            text: String::new(),
        }
    }

    #[test]
    fn trouble_stays_where_events_are_left_out() {
        let events: Vec<_> = (0..500).map(|at| event(at, at >= 450)).collect();
        let (shown, left_out) = selected(&events);
        assert_eq!((shown.len(), left_out), (MOST, 300));
        assert_eq!(shown.iter().filter(|event| event.trouble).count(), 50);
        assert!(shown.is_sorted_by_key(|event| event.at_ns.0));
        assert_eq!(selected(&events[..7]).1, 0);
    }
}
