//! Topics: what a person at the cabinet wants to read about before there is any code.

/// A page of the guide that `linesman explain NAME` shows.
pub(super) struct Topic {
    /// Its name.
    pub(super) name: &'static str,
    /// The page, in Markdown.
    pub(super) text: &'static str,
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
    "counter-guide",
    "lamps",
    "line-codes",
    "located",
    "lost-links",
    "running-errors",
    "start-up-errors",
    "two-counters",
}

/// The topic of that name; words may be joined by spaces.
pub(super) fn find(word: &str) -> Option<&'static Topic> {
    let word = word.to_ascii_lowercase().replace(' ', "-");
    ALL.iter().find(|topic| topic.name == word)
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
    fn every_topic_has_a_title_and_short_lines() {
        for topic in ALL {
            assert!(topic.text.starts_with("# "), "{}", topic.name);
            assert!(find(topic.name).is_some());
        }
    }
}
