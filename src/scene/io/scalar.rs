//! Binary numbers, and the names of their types in VTK's files and PLY.

/// A number in a binary file.
pub(super) trait Binary: Sized {
    /// Its bytes.
    const BYTES: usize;

    /// Returns the number in the given bytes.
    fn of(bytes: &[u8], is_little: bool) -> Self;
}

macro_rules! binary {
    ($($number:ty),*) => {$(
        impl Binary for $number {
            const BYTES: usize = size_of::<$number>();

            fn of(bytes: &[u8], is_little: bool) -> Self {
                let mut own = [0; size_of::<$number>()];
                own.copy_from_slice(bytes);
                if is_little { Self::from_le_bytes(own) } else { Self::from_be_bytes(own) }
            }
        }
    )*};
}

binary!(i8, u8, i16, u16, i32, u32, i64, u64, f32, f64);

/// A type of numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Scalar {
    Bit,
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
    Text,
}

impl Scalar {
    /// Returns the type of that name in legacy files, in small letters or capitals.
    pub(super) fn of_legacy(name: &str) -> Option<Self> {
        Some(match name.to_ascii_lowercase().as_str() {
            "bit" => Self::Bit,
            "char" | "signed_char" | "vtktypeint8" => Self::I8,
            "unsigned_char" | "vtktypeuint8" => Self::U8,
            "short" | "vtktypeint16" => Self::I16,
            "unsigned_short" | "vtktypeuint16" => Self::U16,
            "int" | "vtkidtype" | "vtktypeint32" => Self::I32,
            "unsigned_int" | "vtktypeuint32" => Self::U32,
            "long" | "long_long" | "vtktypeint64" => Self::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Self::U64,
            "float" | "vtktypefloat32" => Self::F32,
            "double" | "vtktypefloat64" => Self::F64,
            "string" => Self::Text,
            _ => return None,
        })
    }

    /// Returns the type of that name in XML files.
    pub(super) fn of_xml(name: &str) -> Option<Self> {
        Some(match name {
            "Int8" => Self::I8,
            "UInt8" => Self::U8,
            "Int16" => Self::I16,
            "UInt16" => Self::U16,
            "Int32" => Self::I32,
            "UInt32" => Self::U32,
            "Int64" => Self::I64,
            "UInt64" => Self::U64,
            "Float32" => Self::F32,
            "Float64" => Self::F64,
            "String" => Self::Text,
            _ => return None,
        })
    }

    /// Returns the type of that name in PLY.
    pub(super) fn of_ply(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Returns the size of one number, in bytes; bits are packed.
    pub(super) fn bytes(self) -> usize {
        match self {
            Self::Bit | Self::Text | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    pub(super) fn is_whole(self) -> bool {
        !matches!(self, Self::Bit | Self::F32 | Self::F64 | Self::Text)
    }

    /// Reads a whole number, or a letter of a text, from its bytes; `None` for other types.
    pub(super) fn whole(self, own: &[u8], is_little: bool) -> Option<i64> {
        Some(match self {
            Self::I8 => i8::of(own, is_little).into(),
            Self::U8 | Self::Text => u8::of(own, is_little).into(),
            Self::I16 => i16::of(own, is_little).into(),
            Self::U16 => u16::of(own, is_little).into(),
            Self::I32 => i32::of(own, is_little).into(),
            Self::U32 => u32::of(own, is_little).into(),
            Self::I64 => i64::of(own, is_little),
            Self::U64 => i64::try_from(u64::of(own, is_little)).unwrap_or(i64::MAX),
            Self::Bit | Self::F32 | Self::F64 => return None,
        })
    }
}
