#![doc = include_str!("../docs/notation.md")]
