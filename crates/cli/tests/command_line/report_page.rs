//! The report page of `diagnose --html`: the words of the text, in the same order.

use std::fs;
use std::path::Path;

use crate::support::{Run, linesman};
use tempfile::TempDir;

const PLANT: &str = "seed = 7\nname = \"press\"\n\
[[device]]\nname = \"K1\"\ntype = \"EK1100\"\non = \"maindevice\"\n\
[[device]]\nname = \"T1\"\ntype = \"EL1008\"\non = \"K1.B\"\n\
[[device]]\nname = \"T2\"\ntype = \"EL2008\"\non = \"T1.B\"\n\
[[device]]\nname = \"K2\"\ntype = \"EK1100\"\non = \"K1.C\"\ncable_m = 20.0\n\
[[device]]\nname = \"T3\"\ntype = \"EL1008\"\non = \"K2.B\"\n";

/// Two faults; the one that comes first is the smaller.
const FAULTS: &str = "[[fault]]\nkind = \"emc-noise\"\nat = \"K1.C>K2.A\"\nfrom_ms = 1000\nto_ms = 2000\n\
hits_per_s = 60.0\n[[fault]]\nkind = \"device-off\"\ndevice = \"T2\"\nfrom_ms = 3500\n";

/// Runs `diagnose` with the page written; gives the run, the page, and the page's words.
fn page(folder: &Path, place: &str, more: &[&str]) -> (Run, String, String) {
    let file = folder.join("report.html");
    let _ = fs::remove_file(&file);
    let mut arguments = vec!["diagnose", place, "--html", file.to_str().unwrap()];
    arguments.extend(more);
    let ran = linesman(arguments);
    let page = fs::read_to_string(&file).unwrap_or_else(|error| panic!("{error}: {}", ran.all()));
    let words = words(&page);
    (ran, page, words)
}

fn plant(folder: &Path, text: &str) -> String {
    let file = folder.join("plant.toml");
    fs::write(&file, text).unwrap();
    format!("sim:{}", file.display())
}

/// The words of a page, one space between them, without tags and style.
fn words(page: &str) -> String {
    words_of(page.split_once("<body>").unwrap().1)
}

fn words_of(body: &str) -> String {
    let mut text = String::new();
    let mut is_tag = false;
    for letter in body.replace("<code>", "").replace("</code>", "").chars() {
        match letter {
            '<' => is_tag = true,
            '>' => {
                is_tag = false;
                text.push(' ');
            }
            _ if !is_tag => text.push(letter),
            _ => {}
        }
    }
    let text = text.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", "\"");
    even(&text.replace("&amp;", "&"))
}

/// Words with one space between them, and none of the marks that set code apart.
fn even(text: &str) -> String {
    text.replace('`', "").split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The statements of a text between the verdict and the first finding: heading, words.
fn statements(text: &str) -> Vec<(String, String)> {
    let mut all: Vec<(String, String)> = Vec::new();
    for line in text.lines().skip(1).take_while(|line| !line.is_empty()) {
        let (heading, words) = line.split_at(11);
        let is_heading = heading.starts_with("  ") && !heading.trim().is_empty();
        if is_heading && heading.ends_with(' ') {
            all.push((heading.trim().to_owned(), words.to_owned()));
        } else if let (true, Some(words)) = (heading.trim().is_empty(), words.strip_prefix("do: "))
        {
            all.push(("do".to_owned(), words.to_owned()));
        } else if let Some((_, last)) = all.last_mut().filter(|_| heading.trim().is_empty()) {
            last.push_str(&format!(" {words}"));
        }
    }
    all.retain(|(heading, _)| ["missing", "do", "judged", "in part", "not"].contains(&&**heading));
    all
}

/// The words of the verdict: behind the source, up to the numbers.
fn verdict(text: &str) -> (String, String) {
    let (word, rest) = text.split_once("  ").unwrap();
    let (_, told) = rest.lines().next().unwrap().split_once(": ").unwrap();
    (word.to_owned(), told.to_owned())
}

#[test]
fn page_says_verdict_and_coverage_in_the_words_of_the_text() {
    let folder = TempDir::new().unwrap();
    let faulty = format!("{PLANT}{FAULTS}");
    let rows = [
        ("HEALTHY", PLANT, &[][..]),
        ("FAULTY", &faulty, &[]),
        ("INCONCLUSIVE", PLANT, &["--to", "init"]),
    ];
    for (expected, text, more) in rows {
        let place = plant(folder.path(), text);
        let (ran, page, words) = page(folder.path(), &place, more);
        let (word, told) = verdict(&ran.stdout);
        assert_eq!(word, expected, "{}", ran.stdout);
        assert!(words.starts_with(&format!("{word} {told} ")), "{word}: {words}");
        let statements = statements(&ran.stdout);
        let headings: Vec<&str> = statements.iter().map(|(heading, _)| heading.as_str()).collect();
        assert!(headings.contains(&"judged") && headings.contains(&"not"), "{headings:?}");
        assert_eq!(headings.contains(&"missing"), expected == "INCONCLUSIVE", "{headings:?}");
        assert_eq!(headings.contains(&"do"), expected == "INCONCLUSIVE", "{headings:?}");
        for (heading, said) in &statements {
            let said = even(&format!("{heading} {said}"));
            assert!(words.contains(&said), "{said}\nis not in\n{words}");
        }
        assert!(!page.contains('`'), "{expected}: raw Markdown");
    }
}

#[test]
fn findings_stand_in_the_order_of_the_text() {
    let folder = TempDir::new().unwrap();
    let place = plant(folder.path(), &format!("{PLANT}{FAULTS}"));
    let (ran, page, words) = page(folder.path(), &place, &[]);
    let is_head = |line: &&str| {
        ["ERROR ", "WARNING ", "INFO "].iter().any(|severity| line.starts_with(severity))
    };
    let told: Vec<String> = ran
        .stdout
        .lines()
        .filter(is_head)
        .map(|line| even(line).split(' ').skip(1).take(2).collect::<Vec<_>>().join(" "))
        .collect();
    assert!(told.len() >= 2, "{}", ran.stdout);
    let articles: Vec<String> = page
        .split("<article ")
        .skip(1)
        .map(|article| {
            let head = article.split_once("<h3>").unwrap().1.split_once("</h3>").unwrap().0;
            let words = words_of(head);
            words.split(' ').skip(2).take(2).collect::<Vec<_>>().join(" ")
        })
        .collect();
    assert_eq!(articles, told);
    // What to do, in the same order.
    let ids: Vec<&str> = page
        .split("<article id=\"")
        .skip(1)
        .map(|article| article.split_once('"').unwrap().0)
        .collect();
    let links = page.split("<a href=\"#").skip(1);
    let links: Vec<&str> = links.map(|link| link.split_once('"').unwrap().0).collect();
    assert_eq!(links, ids);
    assert!(words.contains("Time line"));
}

#[test]
fn clock_times_stand_beside_the_time_since_the_start() {
    let folder = TempDir::new().unwrap();
    let place = plant(folder.path(), &format!("{PLANT}{FAULTS}"));
    let record = folder.path().join("trace.pcapng");
    let record = record.to_str().unwrap();
    // A virtual run has no date.
    let (_, without, _) = page(folder.path(), &place, &["--record", record]);
    assert!(!without.contains("<th>clock</th>") && !without.contains("1970"));
    let (ran, page, words) = page(folder.path(), record, &[]);
    let begun = ran.stdout.lines().find_map(|line| line.trim().strip_prefix("begun ")).unwrap();
    assert!(words.contains(&format!("Begun {begun}")), "{begun}\n{words}");
    assert!(
        words.contains("since the start clock, 1970-01-01 +00:00 0 ns 00:00:00.000"),
        "{words}"
    );
    assert!(words.contains(" 2.000 s 00:00:02.000 "), "{words}");
    assert!(page.contains("<th>clock</th>"));
    assert!(words.contains("When from 3.50") && words.contains(" s (00:00:03.50"), "{words}");
}

#[test]
fn machine_and_author_are_named_at_the_head_and_need_a_page() {
    let folder = TempDir::new().unwrap();
    let place = plant(folder.path(), PLANT);
    let more = ["--machine", "Press 4 <hall B>", "--author", "A. Engineer"];
    let (ran, page, words) = page(folder.path(), &place, &more);
    assert_eq!(ran.status, 0, "{}", ran.all());
    let expected = "judged Machine Press 4 <hall B> Author A. Engineer Input plant.toml";
    assert!(words.contains(expected), "{words}");
    assert!(page.contains("<title>Press 4 &lt;hall B&gt;: HEALTHY</title>"));
    for option in ["--machine", "--author"] {
        let ran = linesman(["diagnose", &place, option, "X"]);
        assert_eq!(ran.status, 2, "{}", ran.all());
        assert!(ran.stderr.contains("--html"), "{}", ran.stderr);
    }
}
