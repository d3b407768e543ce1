//! Documents against the JSON Schema of `docs/schema.json`, and no key beside those that it lists.
//!
//! It reads the keywords that the schema has; another one is a failure, so that nothing passes unchecked.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use serde_json::{Map, Value};

/// The schema as it is in the repository.
pub(crate) static SCHEMA: LazyLock<Value> = LazyLock::new(|| {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/schema.json");
    let text = std::fs::read_to_string(file).expect("docs/schema.json is there");
    serde_json::from_str(&text).expect("docs/schema.json is JSON")
});

/// What of a document a schema covers: the keys of the object that is looked at.
type Covered = BTreeSet<String>;

/// Checks a document against the schemas of its command: it has to meet exactly one.
pub(crate) fn check(document: &Value) -> Result<(), String> {
    let all = SCHEMA["oneOf"].as_array().expect("a list of schemas");
    let names = all.iter().filter_map(|one| one["$ref"].as_str());
    let met: Vec<Result<(), String>> = names.map(|name| instance(referred(name), document, "")).collect();
    match met.iter().filter(|result| result.is_ok()).count() {
        1 => Ok(()),
        0 => {
            let command = document["command"].as_str().unwrap_or("failure");
            let other = |error: &String| error.starts_with("/command:") || error.starts_with(": no `error`");
            let errors: Vec<String> = met.into_iter().filter_map(Result::err).filter(|e| !other(e)).collect();
            Err(format!("no schema of `{command}` fits: {}", errors.join("; ")))
        }
        n => Err(format!("{n} schemas fit")),
    }
}

fn referred(reference: &str) -> &'static Value {
    let found = SCHEMA.pointer(reference.trim_start_matches('#'));
    found.unwrap_or_else(|| panic!("{reference} is not defined"))
}

/// Checks a value and, of an object, that the schema covers all of its keys.
fn instance(schema: &Value, value: &Value, at: &str) -> Result<(), String> {
    let covered = apply(schema, value, at)?;
    let keys = value.as_object().into_iter().flat_map(Map::keys);
    match keys.into_iter().find(|key| !covered.contains(*key)) {
        Some(key) => Err(format!("{at}: `{key}` is not in the schema")),
        None => Ok(()),
    }
}

fn apply(schema: &Value, value: &Value, at: &str) -> Result<Covered, String> {
    let all_keys = || value.as_object().into_iter().flat_map(Map::keys).cloned();
    let Some(keywords) = schema.as_object() else {
        return match schema.as_bool() {
            Some(true) => Ok(all_keys().collect()),
            _ => Err(format!("{at}: nothing is allowed here")),
        };
    };
    let mut covered = Covered::new();
    for (keyword, rule) in keywords {
        match keyword.as_str() {
            "$ref" => covered.extend(apply(referred(rule.as_str().unwrap_or_default()), value, at)?),
            "const" if rule == value => {}
            "const" => return Err(format!("{at}: {value} is not {rule}")),
            "enum" if list(rule).contains(value) => {}
            "enum" => return Err(format!("{at}: {value} is none of {rule}")),
            "type" if is_of_type(rule, value) => {}
            "type" => return Err(format!("{at}: {value} is no {rule}")),
            "minimum" if value.as_f64() >= rule.as_f64() || value.is_null() => {}
            "maximum" if value.as_f64() <= rule.as_f64() || value.is_null() => {}
            "minItems"
                if value
                    .as_array()
                    .is_none_or(|a| a.len() as u64 >= rule.as_u64().unwrap_or(0)) => {}
            "maxItems"
                if value
                    .as_array()
                    .is_none_or(|a| a.len() as u64 <= rule.as_u64().unwrap_or(0)) => {}
            "minLength" | "maxLength" if value.is_string() => {}
            "minimum" | "maximum" | "minItems" | "maxItems" => {
                return Err(format!("{at}: {value} is off {keyword} {rule}"));
            }
            "allOf" => {
                for part in list(rule) {
                    covered.extend(apply(part, value, at)?);
                }
            }
            "anyOf" | "oneOf" => covered.extend(alternatives(keyword, list(rule), value, at)?),
            "required" => {
                let missing = list(rule)
                    .iter()
                    .filter_map(Value::as_str)
                    .find(|key| value.get(*key).is_none());
                if let Some(key) = missing.filter(|_| value.is_object()) {
                    return Err(format!("{at}: no `{key}`"));
                }
            }
            "properties" => {
                for (key, own) in rule.as_object().into_iter().flatten() {
                    if let Some(member) = value.get(key) {
                        instance(own, member, &format!("{at}/{key}"))?;
                        covered.insert(key.clone());
                    }
                }
            }
            "additionalProperties" => {
                let named = schema["properties"].as_object();
                for (key, member) in value.as_object().into_iter().flatten() {
                    if named.is_none_or(|named| !named.contains_key(key)) {
                        anything_or(rule, member, &format!("{at}/{key}"))?;
                        covered.insert(key.clone());
                    }
                }
            }
            "items" => {
                let first = schema["prefixItems"].as_array().map_or(0, Vec::len);
                for (k, item) in value.as_array().into_iter().flatten().enumerate().skip(first) {
                    instance(rule, item, &format!("{at}/{k}"))?;
                }
            }
            "prefixItems" => {
                for (k, (own, item)) in list(rule)
                    .iter()
                    .zip(value.as_array().into_iter().flatten())
                    .enumerate()
                {
                    instance(own, item, &format!("{at}/{k}"))?;
                }
            }
            "title" | "description" | "format" | "default" => {}
            other => panic!("the check knows no keyword `{other}`, at {at}"),
        }
    }
    Ok(covered)
}

/// A schema `true` allows whatever is inside of a member, too.
fn anything_or(rule: &Value, member: &Value, at: &str) -> Result<(), String> {
    if rule == &Value::Bool(true) {
        Ok(())
    } else {
        instance(rule, member, at)
    }
}

fn alternatives(keyword: &str, rules: &[Value], value: &Value, at: &str) -> Result<Covered, String> {
    let (mut met, mut errors) = (Vec::new(), Vec::new());
    for rule in rules {
        match apply(rule, value, at) {
            Ok(covered) => met.push(covered),
            Err(error) => errors.push(error),
        }
    }
    if met.is_empty() || (keyword == "oneOf" && met.len() > 1) {
        return Err(format!("{at}: {} of {keyword} fit: {}", met.len(), errors.join("; ")));
    }
    Ok(met.into_iter().flatten().collect())
}

fn list(rule: &Value) -> &[Value] {
    rule.as_array().map_or(&[], Vec::as_slice)
}

fn is_of_type(rule: &Value, value: &Value) -> bool {
    let is = |name: &Value| match name.as_str().unwrap_or_default() {
        "null" => value.is_null(),
        "boolean" => value.is_boolean(),
        "integer" => value.is_u64() || value.is_i64(),
        "number" => value.is_number(),
        "string" => value.is_string(),
        "array" => value.is_array(),
        "object" => value.is_object(),
        other => panic!("the check knows no type `{other}`"),
    };
    rule.as_array().map_or_else(|| is(rule), |any| any.iter().any(is))
}
