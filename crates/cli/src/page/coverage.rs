//! Coverage of the verdict: what was judged, what was not, and the next step.

use linesman_diagnosis::report::Diagnosis;
use maud::{Markup, html};

use super::prose::prose;
use crate::text::coverage::{Kind, rows};
use crate::text::finding::Writer;

/// The coverage, in the words of the text.
pub(super) fn section(diagnosis: &Diagnosis, writer: &Writer<'_>) -> Markup {
    let rows = rows(diagnosis, writer);
    html! {
        @if !rows.is_empty() {
            section class="coverage" {
                h2 { "What was judged" }
                dl {
                    @for row in &rows {
                        dt class=[(row.kind == Kind::Missing).then_some("missing")] { (row.kind.heading()) }
                        dd {
                            @if row.kind == Kind::NextStep { span class="tick" {} }
                            (prose(&row.words))
                        }
                    }
                }
            }
        }
    }
}
