//! Texts with commands in backticks as HTML.

use maud::{Markup, html};

/// A text whose parts in backticks are set as code.
pub(super) fn prose(text: &str) -> Markup {
    let parts = text.split('`').enumerate();
    html! {
        @for (index, part) in parts {
            @if index % 2 == 1 { code { (part) } } @else { (part) }
        }
    }
}

/// A text without backticks, for titles.
pub(super) fn plain(text: &str) -> String {
    text.replace('`', "")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn backticks_become_code_and_markup_is_escaped() {
        let set = prose("run `linesman scan <eth0>` & look").into_string();
        assert_eq!(set, "run <code>linesman scan &lt;eth0&gt;</code> &amp; look");
        assert_eq!(plain("`listen:` only"), "listen: only");
    }
}
