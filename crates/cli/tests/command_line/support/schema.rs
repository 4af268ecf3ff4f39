//! Holds JSON against a JSON schema: the part of the language that our schemas use. A keyword that
//! it does not know is a fault too, so that nothing goes unchecked.

use serde_json::{Map, Value};

/// Keywords that say nothing about a value.
const SILENT: [&str; 7] =
    ["$schema", "$defs", "title", "description", "format", "default", "examples"];

/// What is wrong with `value`, one line each.
pub(crate) fn faults(value: &Value, schema: &Value) -> Vec<String> {
    let mut check = Check { root: schema, faults: Vec::new() };
    check.value(value, schema, "$");
    check.faults
}

struct Check<'a> {
    root: &'a Value,
    faults: Vec<String>,
}

impl Check<'_> {
    fn fault(&mut self, at: &str, what: impl AsRef<str>) {
        self.faults.push(format!("{at}: {}", what.as_ref()));
    }

    fn value(&mut self, value: &Value, schema: &Value, at: &str) {
        let Some(keywords) = schema.as_object() else {
            if schema == &Value::Bool(false) {
                self.fault(at, "must not be there");
            }
            return;
        };
        for (keyword, says) in keywords {
            self.keyword(value, keyword, says, keywords, at);
        }
    }

    fn keyword(
        &mut self,
        value: &Value,
        keyword: &str,
        says: &Value,
        all: &Map<String, Value>,
        at: &str,
    ) {
        match keyword {
            "$ref" => {
                let pointer = says.as_str().unwrap_or_default().trim_start_matches('#');
                match self.root.pointer(pointer) {
                    Some(target) => self.value(value, &target.clone(), at),
                    None => self.fault(at, format!("{says} leads nowhere")),
                }
            }
            "type" => {
                let several = says.as_array().into_iter().flatten();
                let names: Vec<&str> = several.chain([says]).filter_map(Value::as_str).collect();
                if !names.iter().any(|name| is(value, name)) {
                    self.fault(at, format!("{value} is not {names:?}"));
                }
            }
            "const" if value != says => self.fault(at, format!("{value} is not {says}")),
            "enum" if !says.as_array().is_some_and(|list| list.contains(value)) => {
                self.fault(at, format!("{value} is none of {says}"));
            }
            "const" | "enum" => {}
            "properties" => {
                let properties = says.as_object().expect("properties are an object");
                for (name, schema) in properties {
                    if let Some(inner) = value.get(name) {
                        self.value(inner, schema, &format!("{at}.{name}"));
                    }
                }
            }
            "required" => {
                for name in says.as_array().into_iter().flatten().filter_map(Value::as_str) {
                    if value.is_object() && value.get(name).is_none() {
                        self.fault(at, format!("`{name}` is missing"));
                    }
                }
            }
            "additionalProperties" => {
                let known = all.get("properties").and_then(Value::as_object);
                for (name, inner) in value.as_object().into_iter().flatten() {
                    if !known.is_some_and(|known| known.contains_key(name)) {
                        self.value(inner, says, &format!("{at}.{name}"));
                    }
                }
            }
            "items" => {
                for (index, item) in value.as_array().into_iter().flatten().enumerate() {
                    self.value(item, says, &format!("{at}[{index}]"));
                }
            }
            "minItems" | "maxItems" => {
                let len = value.as_array().map_or(0, Vec::len) as u64;
                let says = says.as_u64().unwrap_or_default();
                let bad = if keyword == "minItems" { len < says } else { len > says };
                if value.is_array() && bad {
                    self.fault(at, format!("{value} has {len} items"));
                }
            }
            "anyOf" | "oneOf" => self.some_of(value, keyword, says, at),
            "allOf" => {
                for schema in says.as_array().into_iter().flatten() {
                    self.value(value, schema, at);
                }
            }
            "minimum" if value.as_f64() < says.as_f64() && value.is_number() => {
                self.fault(at, format!("{value} is below {says}"));
            }
            "maximum" if value.as_f64() > says.as_f64() && value.is_number() => {
                self.fault(at, format!("{value} is above {says}"));
            }
            "minimum" | "maximum" => {}
            "minLength" | "maxLength" => {
                let len = value.as_str().map_or(0, |text| text.chars().count() as u64);
                let says = says.as_u64().unwrap_or_default();
                let bad = if keyword == "minLength" { len < says } else { len > says };
                if value.is_string() && bad {
                    self.fault(at, format!("{value} has {len} characters"));
                }
            }
            "pattern" => {
                let digits =
                    |text: &str| !text.is_empty() && text.bytes().all(|b| b.is_ascii_digit());
                assert_eq!(says, "^[0-9]+$", "the only pattern that is known here");
                if value.as_str().is_some_and(|text| !digits(text)) {
                    self.fault(at, format!("{value} does not match {says}"));
                }
            }
            _ if SILENT.contains(&keyword) => {}
            _ => self.fault(at, format!("the schema's keyword `{keyword}` is not known here")),
        }
    }

    fn some_of(&mut self, value: &Value, keyword: &str, says: &Value, at: &str) {
        let mut fits = 0;
        let mut reasons = Vec::new();
        for schema in says.as_array().into_iter().flatten() {
            let mut check = Check { root: self.root, faults: Vec::new() };
            check.value(value, schema, at);
            if check.faults.is_empty() {
                fits += 1;
            }
            reasons.append(&mut check.faults);
        }
        if fits == 0 || (fits > 1 && keyword == "oneOf") {
            self.fault(at, format!("{fits} of {keyword} fit ({})", reasons.join(" / ")));
        }
    }
}

fn is(value: &Value, name: &str) -> bool {
    match name {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_i64() || value.is_u64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        _ => false,
    }
}
