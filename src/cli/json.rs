//! The JSON document of a command.

use serde::ser::{Serialize, SerializeMap as _, Serializer};
use serde_json::Value;

/// A document with its members in the order of their names.
///
/// A list is converted item by item as it is written: the times of a sun path would take gigabytes as JSON values.
#[derive(Default)]
pub(super) struct JsonDocument {
    values: Value,
    list: Option<(&'static str, Items)>,
}

/// The items of a list, by their numbers.
struct Items(Box<dyn Fn(usize) -> Option<Value> + Send>);

impl Serialize for Items {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq((0..).map_while(&self.0))
    }
}

/// Returns a document with its members in the order of their names.
pub(super) fn in_order(document: &impl Serialize) -> Value {
    serde_json::to_value(document).expect("keys are text")
}

impl JsonDocument {
    /// Replaces the member `key` by a list.
    pub(super) fn with_list(self, key: &'static str, items: Vec<impl Serialize + Send + 'static>) -> Self {
        Self {
            list: Some((key, Items(Box::new(move |k| items.get(k).map(in_order))))),
            ..self
        }
    }
}

impl From<Value> for JsonDocument {
    fn from(values: Value) -> Self {
        Self { values, list: None }
    }
}

impl Serialize for JsonDocument {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (Value::Object(members), Some((key, items))) = (&self.values, &self.list) else {
            return self.values.serialize(serializer);
        };
        let mut map = serializer.serialize_map(Some(members.len()))?;
        for (name, value) in members {
            if name == key {
                map.serialize_entry(name, items)?;
            } else {
                map.serialize_entry(name, value)?;
            }
        }
        map.end()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_written_as_if_it_were_among_the_values() {
        for items in [vec![], vec![serde_json::json!({"b": 1, "a": [0.1]}), Value::Null]] {
            let whole = serde_json::json!({"z": 2, "steps": items, "a": "text"});
            let mut without = whole.clone();
            without["steps"] = Value::Array(Vec::new());
            let document = JsonDocument::from(without).with_list("steps", items);
            let [expected, found] = [
                serde_json::to_string_pretty(&whole).unwrap(),
                serde_json::to_string_pretty(&document).unwrap(),
            ];
            assert_eq!(found, expected);
        }
    }
}
