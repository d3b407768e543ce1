//! Tables and vectors of TOML files, read strictly.
//!
//! Derived deserialisers of structs accept a list for a table, by position, and ignore surplus elements, as those of arrays do.

use std::fmt;
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{Deserializer, Error as _, MapAccess, SeqAccess, Visitor};

/// The content of a table, for the message of a value that is none.
pub(crate) trait Content {
    /// The text that completes "expected".
    const EXPECTED: &'static str;
}

/// A value that must be written as a table.
#[derive(Clone, Debug)]
pub(crate) struct Table<T>(pub(crate) T);

impl<'de, T: Deserialize<'de> + Content> Deserialize<'de> for Table<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct OfTable<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de> + Content> Visitor<'de> for OfTable<T> {
            type Value = T;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(T::EXPECTED)
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map))
            }
        }
        deserializer.deserialize_map(OfTable(PhantomData)).map(Self)
    }
}

/// Reads a list of three numbers.
pub(crate) fn three<'de, D: Deserializer<'de>>(deserializer: D) -> Result<[f64; 3], D::Error> {
    struct OfThree;
    impl<'de> Visitor<'de> for OfThree {
        type Value = [f64; 3];

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("three numbers, as in [1.0, 2.5, 0.0]")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut numbers: A) -> Result<[f64; 3], A::Error> {
            let mut vector = [0.0; 3];
            let mut n = 0;
            while let Some(number) = numbers.next_element()? {
                if let Some(place) = vector.get_mut(n) {
                    *place = number;
                }
                n += 1;
            }
            if n == vector.len() {
                Ok(vector)
            } else {
                Err(A::Error::invalid_length(n, &self))
            }
        }
    }
    deserializer.deserialize_seq(OfThree)
}

/// Reads an optional list of three numbers.
pub(crate) fn three_if_given<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<[f64; 3]>, D::Error> {
    three(deserializer).map(Some)
}
