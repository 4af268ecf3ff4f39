//! The reference of the segment file, made from its JSON schema: no key can be missing in it.

use std::fmt::Write as _;

use linesman_sim::segment_file::SegmentFile;
use serde_json::{Map, Value};

const HEAD: &str = "# The segment file

Generated from the schema (`linesman schema segment`), which editors understand too. A segment file is TOML; keys that it does not know are
errors, with line and column. Ports are always A to D; places are written as in `K1.C` (port C of the device K1), `K1.C-B3.A` (a link) and
`K1.C>B3.A` (one direction of it).

```toml
name = \"plant\"
seed = 7

[[device]]
name = \"K1\"
type = \"EK1100\"
on = \"maindevice\"
cable_m = 5.0

[[device]]
name = \"I1\"
type = \"EL1008\"
on = \"K1.B\"

[[fault]]
kind = \"emc-noise\"
at = \"maindevice.A>K1.A\"
from_ms = 2000
to_ms = 5000
hits_per_s = 40.0
```

The types of the library, with their ports, are in [devices.md](devices.md); the kinds of faults, with their parameters, in
[faults.md](faults.md). How to put a segment on a network card is in [virtual-segment.md](virtual-segment.md).
";

/// The page.
pub(crate) fn page() -> String {
    let schema = serde_json::to_value(schemars::schema_for!(SegmentFile)).unwrap();
    let empty = Map::new();
    let definitions = schema["$defs"].as_object().unwrap_or(&empty);
    let mut text = HEAD.to_owned();
    let mut waiting = vec![("At the top".to_owned(), schema.clone())];
    let mut told = Vec::new();
    while !waiting.is_empty() {
        let (title, table) = waiting.remove(0);
        write!(text, "\n## {title}\n\n").unwrap();
        if title != "At the top" {
            writeln!(text, "{}\n", description(&table)).unwrap();
        }
        text.push_str("| key | what may stand there | meaning |\n|---|---|---|\n");
        for (key, value) in table["properties"].as_object().unwrap_or(&empty) {
            let required = table["required"].as_array();
            let needed = required.is_some_and(|keys| keys.iter().any(|one| one == key));
            let (shape, inner) = shape(value, definitions);
            let must = if needed { ", must be there" } else { "" };
            let meaning = description(value);
            writeln!(text, "| `{key}` | {shape}{must} | {meaning} |").unwrap();
            if let Some(name) = inner
                && !told.contains(&name)
            {
                waiting.push((heading(key, value), definitions[&name].clone()));
                told.push(name);
            }
        }
        if let Some(more) = table.get("additionalProperties").filter(|more| more.is_object()) {
            let (shape, _) = self::shape(more, definitions);
            writeln!(text, "| any other | {shape} | The parameters of its kind. |").unwrap();
        }
    }
    text
}

/// `[[device]]`, `[ring]`, `clock`.
fn heading(key: &str, value: &Value) -> String {
    let many = value["type"] == "array" || value["items"].is_object();
    match (many, key) {
        (true, _) => format!("`[[{key}]]`"),
        (false, "ring") => format!("`[{key}]`"),
        (false, _) => format!("`{key} = {{ … }}`"),
    }
}

/// A description on one line.
fn description(value: &Value) -> String {
    let text = value["description"].as_str().unwrap_or_default();
    text.split_whitespace().collect::<Vec<_>>().join(" ").replace('|', "\\|")
}

/// What may stand there in words, and the definition of a table if it is one.
fn shape(value: &Value, definitions: &Map<String, Value>) -> (String, Option<String>) {
    if let Some(name) = value["$ref"].as_str().and_then(|path| path.rsplit('/').next()) {
        let definition = &definitions[name];
        if definition["properties"].is_object() {
            return ("table".to_owned(), Some(name.to_owned()));
        }
        return shape(definition, definitions);
    }
    for choice in ["anyOf", "oneOf"] {
        if let Some(all) = value[choice].as_array() {
            let some = all.iter().filter(|one| one["type"] != "null");
            let shapes: Vec<_> = some.map(|one| shape(one, definitions)).collect();
            let inner = shapes.iter().find_map(|(_, inner)| inner.clone());
            let mut words: Vec<String> = shapes.into_iter().map(|(words, _)| words).collect();
            words.dedup();
            return (words.join(" or "), inner);
        }
    }
    let kind = match value["type"].as_array() {
        Some(kinds) => kinds.iter().find(|kind| *kind != "null").unwrap_or(&Value::Null),
        None => &value["type"],
    };
    match kind.as_str() {
        Some("boolean") => ("true or false".to_owned(), None),
        Some("integer") => (format!("whole number{}", range(value)), None),
        Some("number") => (format!("number{}", range(value)), None),
        Some("array") => {
            let (of, inner) = shape(&value["items"], definitions);
            (format!("list of: {of}"), inner)
        }
        Some("object") => {
            let (of, _) = shape(&value["additionalProperties"], definitions);
            (format!("table of: {of}"), None)
        }
        Some("string") => match value["enum"].as_array() {
            Some(words) if words.len() > 8 => ("a name".to_owned(), None),
            Some(words) => {
                let words: Vec<_> = words.iter().filter_map(Value::as_str).collect();
                (words.join(", "), None)
            }
            None if value["pattern"] == "^[A-D]$" => ("A, B, C or D".to_owned(), None),
            None => ("text".to_owned(), None),
        },
        _ => match value["const"].as_str() {
            Some(word) => (word.to_owned(), None),
            None => ("anything".to_owned(), None),
        },
    }
}

fn range(value: &Value) -> String {
    match (value["minimum"].as_f64(), value["maximum"].as_f64()) {
        (Some(low), Some(high)) => format!(", {low} to {high}"),
        (Some(low), None) => format!(", from {low}"),
        (None, Some(high)) => format!(", to {high}"),
        (None, None) => String::new(),
    }
}
