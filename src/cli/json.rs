//! The JSON document of a command.

use serde::ser::{Serialize, SerializeMap as _, SerializeSeq as _, Serializer};
use serde_json::Value;

/// A document with its members in the order of their names.
///
/// A list is converted item by item as it is written: the times of a sun path would take gigabytes as JSON values.
#[derive(Default)]
pub(super) struct JsonDocument {
    values: Value,
    list: Option<(&'static str, Box<dyn Items>)>,
}

/// The items of a list.
trait Items: Send {
    fn n_items(&self) -> usize;

    fn item(&self, k: usize) -> Value;
}

impl<T: Serialize + Send> Items for Vec<T> {
    fn n_items(&self) -> usize {
        self.len()
    }

    fn item(&self, k: usize) -> Value {
        in_order(&self[k])
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
            list: Some((key, Box::new(items))),
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
                map.serialize_entry(name, &List(&**items))?;
            } else {
                map.serialize_entry(name, value)?;
            }
        }
        map.end()
    }
}

struct List<'a>(&'a dyn Items);

impl Serialize for List<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let n = self.0.n_items();
        let mut list = serializer.serialize_seq(Some(n))?;
        for k in 0..n {
            list.serialize_element(&self.0.item(k))?;
        }
        list.end()
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
