use super::*;

fn entry(run: i64, s: i64, severity: Severity, kind: EntryKind, no: u32) -> StoredEntry {
    StoredEntry {
        run,
        at: time(s * 1_000_000_000),
        severity,
        kind,
        device_no: Some(no),
        device_name: Some(format!("Term {no}")),
        text: format!("'Term {no} (EL1008)' Something at {s}"),
        finding: None,
    }
}

fn seconds(entries: &[StoredEntry]) -> Vec<i128> {
    entries.iter().map(|entry| entry.at.as_nanos() / 1_000_000_000).collect()
}

// proves: SW-07 partial: a file of our own instead of the system's, filtered after the program has ended
#[test]
fn entries_outlive_the_program_and_are_found_by_each_property() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.sqlite");
    for round in 0..2 {
        let mut log = EventLog::create(&path).unwrap();
        let run = log.begin(time(round * 100_000_000_000), "eth0", "plant", "linesman 1").unwrap();
        let base = round * 100;
        log.append(&[
            entry(run, base + 1, Severity::Info, EntryKind::State, 1),
            entry(run, base + 2, Severity::Error, EntryKind::Communication, 2),
            entry(run, base + 3, Severity::Warning, EntryKind::Counter, 2),
        ])
        .unwrap();
        log.end(run, time((base + 9) * 1_000_000_000)).unwrap();
    }
    let log = EventLog::open(&path).unwrap();
    assert_eq!(log.count().unwrap(), 6);
    let runs = log.runs().unwrap();
    assert_eq!((runs.len(), runs[1].line.as_str()), (2, "eth0"));
    assert_eq!(runs[1].ended, Some(time(109_000_000_000)));
    let found = |filter: Filter| seconds(&log.entries(&filter).unwrap());
    let all = Filter::default();
    assert_eq!(found(all.clone()), [1, 2, 3, 101, 102, 103]);
    assert_eq!(found(Filter { limit: Some(2), ..all.clone() }), [102, 103], "the newest, in order");
    assert_eq!(found(Filter { run: Some(2), ..all.clone() }), [101, 102, 103]);
    assert_eq!(
        found(Filter { severity: Some(Severity::Warning), ..all.clone() }),
        [2, 3, 102, 103]
    );
    let kinds = vec![EntryKind::State, EntryKind::Counter];
    assert_eq!(found(Filter { kinds, ..all.clone() }), [1, 3, 101, 103]);
    assert_eq!(found(Filter { device_no: Some(1), ..all.clone() }), [1, 101]);
    assert_eq!(found(Filter { device_name: Some("Term 2".into()), ..all.clone() }).len(), 4);
    let since = Some(time(3_000_000_000));
    let until = Some(time(102_000_000_000));
    assert_eq!(found(Filter { since, until, ..all.clone() }), [3, 101, 102]);
    assert_eq!(found(Filter { text: Some("EL1008)' SOMETHING AT 10".into()), ..all }).len(), 3);
}

#[test]
fn what_is_no_log_is_refused_and_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    let missing = EventLog::open(&folder.path().join("none")).unwrap_err();
    assert!(missing.to_string().contains("no such event log"), "{missing}");
    let text = folder.path().join("notes.txt");
    std::fs::write(
        &text,
        "these are my notes, and they are longer than a header of SQLite would be",
    )
    .unwrap();
    for error in [EventLog::open(&text).unwrap_err(), EventLog::create(&text).unwrap_err()] {
        assert!(error.to_string().contains("no event log of Linesman"), "{error}");
    }
    assert!(std::fs::read_to_string(&text).unwrap().starts_with("these are my notes"));
    let other = folder.path().join("other.sqlite");
    Connection::open(&other).unwrap().execute_batch("CREATE TABLE mine (a)").unwrap();
    let error = EventLog::create(&other).unwrap_err();
    assert!(error.to_string().contains("no event log of Linesman"), "{error}");
    let newer = folder.path().join("newer.sqlite");
    EventLog::create(&newer).unwrap().pragma("user_version", 9).unwrap();
    let error = EventLog::open(&newer).unwrap_err();
    assert!(error.to_string().contains("newer Linesman"), "{error}");
}

#[test]
fn one_writes_while_another_reads() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.sqlite");
    let mut log = EventLog::create(&path).unwrap();
    let run = log.begin(time(0), "eth0", "", "linesman 1").unwrap();
    let reader = EventLog::open(&path).unwrap();
    log.append(&[entry(run, 1, Severity::Info, EntryKind::State, 1)]).unwrap();
    assert_eq!(reader.count().unwrap(), 1);
    assert_eq!(reader.runs().unwrap()[0].ended, None);
}

#[test]
fn a_log_without_findings_is_read_and_takes_findings_when_it_is_written_on() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.sqlite");
    // As the first version wrote it.
    let old = Connection::open(&path).unwrap();
    old.execute_batch(&TABLES.replace("NOT NULL,\n        finding TEXT", "NOT NULL")).unwrap();
    old.pragma_update(None, "application_id", APPLICATION).unwrap();
    old.pragma_update(None, "user_version", WITHOUT_FINDINGS).unwrap();
    let values = "INSERT INTO run VALUES (1, 0, NULL, 'eth0', '', 'linesman');
        INSERT INTO entry VALUES (1, 1, 5, 0, 'state', 1, NULL, 'old');";
    old.execute_batch(values).unwrap();
    drop(old);
    let read = || EventLog::open(&path).unwrap().entries(&Filter::default()).unwrap();
    assert_eq!((read().len(), read()[0].text.as_str()), (1, "old"));
    let finding = LoggedFinding {
        id: "F1".to_owned(),
        event: "opened".to_owned(),
        code: "H300".to_owned(),
        name: "link-open".to_owned(),
        place: "link".to_owned(),
        cause: "cable-broken".to_owned(),
        follows_from: None,
    };
    let mut new = entry(1, 1, Severity::Error, EntryKind::Finding, 1);
    new.finding = Some(finding.clone());
    EventLog::create(&path).unwrap().append(&[new]).unwrap();
    assert_eq!(read().len(), 2);
    assert_eq!((read()[0].finding.clone(), read()[1].finding.clone()), (None, Some(finding)));
}
