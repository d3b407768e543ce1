//! The array format of NumPy: a header with type and shape, then the numbers.
//!
//! Format: NumPy enhancement proposal 1, versions 1.0 to 3.0. Departures: arrays are written in C order and little-endian; arrays in
//! Fortran order, big-endian numbers, and types other than those of [`Dtype`] are refused.

use std::io::Read;

use crate::printable::printable;

/// The type of an array's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Dtype {
    F64,
    F32,
    I64,
    I32,
    U64,
    /// Strings of the given number of bytes.
    Bytes(u64),
    /// Texts of the given number of characters.
    Text(u64),
}

impl Dtype {
    /// Returns NumPy's name.
    fn descr(self) -> String {
        match self {
            Self::F64 => "<f8".into(),
            Self::F32 => "<f4".into(),
            Self::I64 => "<i8".into(),
            Self::I32 => "<i4".into(),
            Self::U64 => "<u8".into(),
            Self::Bytes(n) => format!("|S{n}"),
            Self::Text(n) => format!("<U{n}"),
        }
    }

    fn from_descr(descr: &str) -> Option<Self> {
        Some(match descr {
            "<f8" => Self::F64,
            "<f4" => Self::F32,
            "<i8" => Self::I64,
            "<i4" => Self::I32,
            "<u8" => Self::U64,
            _ => match descr.strip_prefix("<U") {
                Some(length) => Self::Text(length.parse().ok()?),
                None => Self::Bytes(descr.strip_prefix("|S")?.parse().ok()?),
            },
        })
    }

    /// Returns the bytes of one element.
    pub(super) fn byte(self) -> u64 {
        match self {
            Self::F64 | Self::I64 | Self::U64 => 8,
            Self::F32 | Self::I32 => 4,
            Self::Bytes(n) => n,
            Self::Text(n) => n.saturating_mul(4),
        }
    }
}

/// The header of an array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Header {
    pub(super) dtype: Dtype,
    pub(super) shape: Vec<u64>,
}

const MAGIC: &[u8] = b"\x93NUMPY";

/// The greatest length of a header to read: those of these arrays take less than 200 bytes.
const HEADER_LIMIT: u32 = 4096;

impl Header {
    pub(super) fn new(dtype: Dtype, shape: &[usize]) -> Self {
        let shape = shape.iter().map(|&n| n as u64).collect();
        Self { dtype, shape }
    }

    /// Returns the bytes of all elements, or `None` if there are more than can be counted.
    pub(super) fn data_byte(&self) -> Option<u64> {
        let mut sizes = self.shape.iter().copied();
        sizes.try_fold(self.dtype.byte(), u64::checked_mul)
    }

    /// Returns the bytes of the header, padded so that the numbers begin at a multiple of 64 bytes.
    pub(super) fn encode(&self) -> Vec<u8> {
        let sizes: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        // A tuple of one number ends with a comma.
        let shape = sizes.join(", ") + if sizes.len() == 1 { "," } else { "" };
        let mut text = format!(
            "{{'descr': '{}', 'fortran_order': False, 'shape': ({shape}), }}",
            self.dtype.descr()
        );
        let before = MAGIC.len() + 4;
        while !(before + text.len() + 1).is_multiple_of(64) {
            text.push(' ');
        }
        text.push('\n');
        let length = u16::try_from(text.len()).expect("a header of few numbers is short");
        [MAGIC, &[1, 0], &length.to_le_bytes(), text.as_bytes()].concat()
    }

    /// Reads a header, and returns it with its length in bytes; an error describes the fault.
    pub(super) fn read(reader: &mut impl Read) -> Result<(Self, u64), String> {
        let mut fill = |bytes: &mut [u8]| reader.read_exact(bytes).map_err(|e| format!("no array header: {e}"));
        let mut start = [0; 8];
        fill(&mut start)?;
        if &start[..6] != MAGIC {
            return Err("not a NumPy array".into());
        }
        let (length, before) = match start[6] {
            1 => {
                let mut length = [0; 2];
                fill(&mut length)?;
                (u32::from(u16::from_le_bytes(length)), 10)
            }
            2 | 3 => {
                let mut length = [0; 4];
                fill(&mut length)?;
                (u32::from_le_bytes(length), 12)
            }
            version => return Err(format!("a NumPy array of version {version}")),
        };
        if length > HEADER_LIMIT {
            return Err(format!("an array header of {length} bytes"));
        }
        let mut text = vec![0; length as usize];
        fill(&mut text)?;
        let text = String::from_utf8(text).map_err(|_| "an array header that is no text")?;
        // Arbitrary content is cut to the length of a line.
        let shown = || printable(&text.trim().chars().take(100).collect::<String>());
        let header = Self::parse(&text);
        let header = header.ok_or_else(|| format!("the array header `{}`, not of little-endian rows", shown()))?;
        Ok((header, before + u64::from(length)))
    }

    /// Parses the dictionary of a header whose array this program can read.
    fn parse(text: &str) -> Option<Self> {
        let value = |key: &str| {
            let (_, after) = text.split_once(&format!("'{key}':"))?;
            Some(after.trim_start())
        };
        let descr = value("descr")?.strip_prefix('\'')?.split_once('\'')?.0;
        if !value("fortran_order")?.starts_with("False") {
            return None;
        }
        let (shape, _) = value("shape")?.strip_prefix('(')?.split_once(')')?;
        let sizes = shape.split(',').map(str::trim).filter(|size| !size.is_empty());
        Some(Self {
            dtype: Dtype::from_descr(descr)?,
            shape: sizes.map(|size| size.parse().ok()).collect::<Option<_>>()?,
        })
    }
}

/// A type of numbers in arrays.
pub(super) trait Element: Copy {
    const DTYPE: Dtype;
    /// Adds the number's little-endian bytes.
    fn push_to(self, bytes: &mut Vec<u8>);
}

macro_rules! element {
    ($($type:ty, $dtype:ident;)*) => {$(
        impl Element for $type {
            const DTYPE: Dtype = Dtype::$dtype;
            fn push_to(self, bytes: &mut Vec<u8>) {
                bytes.extend_from_slice(&self.to_le_bytes());
            }
        }
    )*};
}

element! { f64, F64; f32, F32; i64, I64; i32, I32; u64, U64; }

/// Appends numbers of type `dtype`, read from their bytes, to `numbers`; returns false if it is not a type of real numbers.
pub(super) fn push_reals(dtype: Dtype, bytes: &[u8], numbers: &mut Vec<f64>) -> bool {
    match dtype {
        Dtype::F64 => numbers.extend(bytes.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b))),
        Dtype::F32 => numbers.extend(bytes.as_chunks().0.iter().map(|b| f64::from(f32::from_le_bytes(*b)))),
        _ => return false,
    }
    true
}

/// Appends numbers of type `dtype`, read from their bytes, to `numbers`; returns false if it is not a type of whole numbers,
/// or one of them is negative.
pub(super) fn push_counts(dtype: Dtype, bytes: &[u8], numbers: &mut Vec<u64>) -> bool {
    let before = numbers.len();
    match dtype {
        Dtype::U64 => numbers.extend(bytes.as_chunks().0.iter().map(|b| u64::from_le_bytes(*b))),
        Dtype::I64 => {
            let values = bytes.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b));
            numbers.extend(values.map_while(|k| u64::try_from(k).ok()));
        }
        Dtype::I32 => {
            let values = bytes.as_chunks().0.iter().map(|b| i32::from_le_bytes(*b));
            numbers.extend(values.map_while(|k| u64::try_from(k).ok()));
        }
        _ => return false,
    }
    (numbers.len() - before) as u64 * dtype.byte() == bytes.len() as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A case that the fuzzer found.
    #[test]
    fn a_header_of_many_lines_is_told_in_one() {
        let text = format!("{{'descr',\n\r\u{7}{}", "x".repeat(500));
        let length = u16::try_from(text.len()).expect("a short text").to_le_bytes();
        let bytes = [MAGIC, &[1, 0], &length, text.as_bytes()].concat();
        let message = Header::read(&mut bytes.as_slice()).expect_err("no header");
        assert!(
            message.starts_with("the array header `{'descr',\u{fffd}\u{fffd}\u{fffd}x"),
            "{message}"
        );
        assert!(message.len() < 200 && !message.contains(char::is_control), "{message}");
    }

    #[test]
    fn headers_read_back_and_are_those_of_numpy() {
        for (dtype, shape, text) in [
            (
                Dtype::F64,
                &[3, 4][..],
                "{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }",
            ),
            (
                Dtype::I32,
                &[7],
                "{'descr': '<i4', 'fortran_order': False, 'shape': (7,), }",
            ),
            (
                Dtype::Bytes(3),
                &[],
                "{'descr': '|S3', 'fortran_order': False, 'shape': (), }",
            ),
            (
                Dtype::Text(9),
                &[],
                "{'descr': '<U9', 'fortran_order': False, 'shape': (), }",
            ),
        ] {
            let header = Header::new(dtype, shape);
            let bytes = header.encode();
            assert_eq!((&bytes[10..10 + text.len()], bytes.len() % 64), (text.as_bytes(), 0));
            assert_eq!(bytes.last(), Some(&b'\n'));
            assert_eq!(Header::read(&mut bytes.as_slice()), Ok((header, bytes.len() as u64)));
        }
    }

    #[test]
    fn headers_that_cannot_be_read_are_refused() {
        let with = |text: &str| {
            let length = u16::try_from(text.len()).expect("short");
            [MAGIC, &[1, 0], &length.to_le_bytes(), text.as_bytes()].concat()
        };
        for (bytes, reason) in [
            (b"PK\x03\x04abcdefgh".to_vec(), "not a NumPy array"),
            (b"\x93NUMPY\x01\x00\xff\xff".to_vec(), "bytes"),
            (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "4294967295 bytes"),
            (b"\x93NUMPY\x09\x00\x02\x00{}".to_vec(), "version 9"),
            (
                with("{'descr': '<f8', 'fortran_order': True, 'shape': (3, 4), }"),
                "header",
            ),
            (
                with("{'descr': '>f8', 'fortran_order': False, 'shape': (3, 4), }"),
                "header",
            ),
            (
                with("{'descr': '|O', 'fortran_order': False, 'shape': (3, 4), }"),
                "header",
            ),
            (
                with("{'descr': '<f8', 'fortran_order': False, 'shape': (-3, 4), }"),
                "header",
            ),
            (
                with("{'descr': '<f8', 'fortran_order': False, 'shape': (3, 4"),
                "header",
            ),
            (with(""), "header"),
        ] {
            let error = Header::read(&mut bytes.as_slice()).expect_err("refused");
            assert!(error.contains(reason), "{error}");
        }
        let huge = with("{'descr': '<f8', 'fortran_order': False, 'shape': (9999999999, 9999999999), }");
        let (header, _) = Header::read(&mut huge.as_slice()).expect("a header");
        assert_eq!(header.data_byte(), None);
    }

    #[test]
    fn counts_are_never_negative() {
        let mut numbers = Vec::new();
        assert!(push_counts(Dtype::I32, &[1, 0, 0, 0], &mut numbers));
        assert!(!push_counts(Dtype::I32, &[255; 4], &mut numbers));
        assert!(!push_counts(Dtype::I64, &[255; 8], &mut numbers));
        assert!(push_counts(Dtype::U64, &[255; 8], &mut numbers));
        assert!(!push_counts(Dtype::F64, &[0; 8], &mut numbers));
        assert_eq!(numbers, [1, u64::MAX]);
    }
}
