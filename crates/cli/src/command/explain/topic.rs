//! Topics: pages of the guide about a subject, and about the causes of AL status codes.

use linesman_proto::state::AlStatusCode;

use super::page::{Kind, Page};

/// A page of the guide that `linesman explain NAME` shows.
#[derive(Clone, Copy, Debug)]
pub(super) struct Topic {
    /// Its name.
    pub(super) name: &'static str,
    /// The page, in Markdown.
    pub(super) text: &'static str,
}

impl Topic {
    /// Its title.
    pub(super) fn title(&self) -> &'static str {
        let first = self.text.lines().next().unwrap_or_default();
        first.trim_start_matches(['#', ' '])
    }

    /// The text beneath the title.
    pub(super) fn body(&self) -> &'static str {
        self.text.split_once('\n').map_or("", |(_, body)| body.trim())
    }

    /// As a page.
    pub(super) fn page(&self) -> Page {
        Page::new(Kind::Topic, self.title()).markdown(self.body())
    }
}

macro_rules! topics {
    ($($name:literal),+ $(,)?) => {
        /// All topics.
        pub(super) const ALL: &[Topic] = &[$(Topic {
            name: $name,
            text: include_str!(concat!("../../../../../docs/guide/topics/", $name, ".md")),
        }),+];
    };
}

topics! {
    "clock-start-up",
    "counter-guide",
    "interrupt-moderation",
    "lamps",
    "line-codes",
    "located",
    "lost-links",
    "no-devices-found",
    "out-of-step",
    "outputs-stayed-away",
    "own-frames",
    "running-errors",
    "start-up-errors",
    "sync-not-seen",
    "sync-settings",
    "sync-stopped",
    "two-counters",
    "uneven-cycle",
}

/// The topic that leads to the causes of an AL status code.
const OF_STATUS: &[(AlStatusCode, &str)] = &[
    (AlStatusCode::SYNCHRONIZATION_ERROR, "out-of-step"),
    (AlStatusCode::SYNC_MANAGER_WATCHDOG, "outputs-stayed-away"),
    (AlStatusCode::FATAL_SYNC_ERROR, "sync-stopped"),
    (AlStatusCode::NO_SYNC_ERROR, "sync-not-seen"),
    (AlStatusCode::INVALID_DC_SYNC_CONFIGURATION, "sync-settings"),
];

/// The topic of that name; words may be joined by spaces.
pub(super) fn find(word: &str) -> Option<&'static Topic> {
    let word = word.to_ascii_lowercase().replace([' ', '_'], "-");
    ALL.iter().find(|topic| topic.name == word)
}

/// The topic that leads to the causes of this code, if there is one.
pub(super) fn of_status(code: AlStatusCode) -> Option<&'static Topic> {
    let (_, name) = OF_STATUS.iter().find(|(of, _)| *of == code)?;
    find(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    // proves: HW-15
    #[test]
    fn the_sixteen_pairs_of_control_symbols_are_those_of_the_line_code() {
        let bits = |letter| match letter {
            'I' => "11111",
            'J' => "11000",
            'K' => "10001",
            'T' => "01101",
            'R' => "00111",
            'S' => "11001",
            'H' => "00100",
            'Q' => "00000",
            other => panic!("{other}"),
        };
        let rows = find("line codes").unwrap().text.lines().filter_map(|line| {
            let mut cells = line.split('|').map(str::trim).skip(1);
            let (pair, symbols) = (cells.next()?, cells.next()?);
            (pair.len() == 2).then_some((pair, symbols))
        });
        let rows: Vec<_> = rows.collect();
        assert_eq!(rows.len(), 16);
        for (pair, symbols) in rows {
            let expected: Vec<&str> = pair.chars().map(bits).collect();
            assert_eq!(symbols, expected.join(" "), "{pair}");
        }
    }

    #[test]
    fn every_topic_has_a_title_and_is_found_by_its_name() {
        for topic in ALL {
            assert!(topic.text.starts_with("# "), "{}", topic.name);
            assert!(find(topic.name).is_some());
        }
        for (code, name) in OF_STATUS {
            assert!(of_status(*code).is_some(), "{code}: {name}");
        }
    }
}
