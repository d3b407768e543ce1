//! The page of all JSON documents, from their schema.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use serde_json::Value;

use super::cell;
use crate::program::schema::SCHEMA;

/// Returns the page: a section for each document, then one for each type that they are made of.
pub(super) fn page() -> String {
    let mut page = "# JSON\n\nThis page is generated from [`schema.json`](schema.json), the [JSON Schema](https://json-schema.org) of all that `--json` prints. \
        [Output](output.md) explains the most important keys and says when `schema_version` changes. A number that is not finite is `null`.\n\n\
        The first sections are the documents of the commands; the others are the objects inside of these.\n"
        .to_owned();
    let documents: Vec<&str> = SCHEMA["oneOf"].as_array().unwrap().iter().map(referred).collect();
    let definitions = SCHEMA["$defs"].as_object().unwrap();
    let others = definitions
        .keys()
        .map(String::as_str)
        .filter(|name| !documents.contains(name));
    for name in documents.iter().copied().chain(others) {
        let _ = write!(page, "\n## `{name}`\n\n");
        section(&mut page, &definitions[name]);
    }
    page
}

fn referred(one: &Value) -> &str {
    one["$ref"].as_str().unwrap().trim_start_matches("#/$defs/")
}

/// Writes the description of a type, its keys and its values.
fn section(page: &mut String, of: &Value) {
    if let Some(text) = description(of) {
        let _ = write!(page, "{text}\n\n");
    }
    let mut keys = String::new();
    let choices = ["oneOf", "anyOf"]
        .into_iter()
        .filter_map(|list| of[list].as_array())
        .flatten();
    for (in_part, part) in std::iter::once((false, of)).chain(choices.map(|choice| (true, choice))) {
        let required: BTreeSet<&str> = part["required"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_str)
            .collect();
        for (key, own) in part["properties"].as_object().into_iter().flatten() {
            let is_optional = in_part || !required.contains(key.as_str());
            let mark = if is_optional { " (not always there)" } else { "" };
            let text = description(own).unwrap_or_default();
            let _ = writeln!(keys, "| `{key}`{mark} | {} | {text} |", kind(own));
        }
        if in_part && part.get("properties").is_none() {
            let _ = writeln!(
                page,
                "- {}{}",
                kind(part),
                description(part).map(|text| format!(": {text}")).unwrap_or_default()
            );
        }
    }
    if !keys.is_empty() {
        let _ = write!(page, "| key | value | meaning |\n|---|---|---|\n{keys}");
    }
    if let Some(names) = of["enum"].as_array() {
        let names: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
        let _ = writeln!(page, "- {}", names.join(", "));
    }
}

/// Returns the description of a schema up to its first block of code.
fn description(of: &Value) -> Option<String> {
    let text = of["description"].as_str()?;
    Some(cell(text.split("```").next()?).replace("[`", "`").replace("`]", "`"))
}

/// Returns the type of a value in words, with links to those that have a section.
fn kind(of: &Value) -> String {
    if of.get("$ref").is_some() {
        let name = referred(of);
        return format!("[`{name}`](#{})", name.to_lowercase());
    }
    if let Some(value) = of.get("const") {
        return format!("`{value}`");
    }
    if let Some(names) = of["enum"].as_array() {
        return names
            .iter()
            .map(|name| format!("`{name}`"))
            .collect::<Vec<_>>()
            .join(", ");
    }
    for list in ["anyOf", "oneOf"] {
        if let Some(parts) = of[list].as_array() {
            return parts.iter().map(kind).collect::<Vec<_>>().join(" or ");
        }
    }
    let name = |name: &str| match name {
        "array" => match of.get("items") {
            Some(items) if items.is_object() => format!("list of {}", kind(items)),
            _ => "list".to_owned(),
        },
        "integer" => "whole number".to_owned(),
        "string" => "text".to_owned(),
        "boolean" => "true or false".to_owned(),
        other => other.to_owned(),
    };
    match &of["type"] {
        Value::String(only) => name(only),
        Value::Array(several) => several
            .iter()
            .filter_map(Value::as_str)
            .map(name)
            .collect::<Vec<_>>()
            .join(" or "),
        _ => "any".to_owned(),
    }
}

#[test]
fn the_page_has_every_key() {
    let page = page();
    let mut n_keys = 0;
    for own in SCHEMA["$defs"].as_object().unwrap().values() {
        for key in own["properties"]
            .as_object()
            .into_iter()
            .flat_map(serde_json::Map::keys)
        {
            n_keys += 1;
            assert!(page.contains(&format!("| `{key}`")), "{key}");
        }
    }
    assert!(n_keys > 300, "{n_keys}");
}
