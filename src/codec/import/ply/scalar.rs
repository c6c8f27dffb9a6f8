//! The scalar types of PLY.
//!
//! In: the name of a type in a header; its bytes, or its digits, in a body. Out: a [`Scalar`]; its values.

/// A scalar type.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    /// Returns the type of a name in a header.
    pub(super) fn named(name: &str) -> Option<Self> {
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

    /// Returns the number of bytes of a value.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Returns the value at the start of `bytes`; 0 if they are too short, which tables exclude.
    #[inline]
    pub(super) fn value(self, bytes: &[u8], is_big: bool) -> f64 {
        fn first<const N: usize>(bytes: &[u8], is_big: bool) -> [u8; N] {
            let mut value = bytes.first_chunk().copied().unwrap_or([0; N]);
            if is_big {
                value.reverse();
            }
            value
        }
        match self {
            Self::I8 => i8::from_le_bytes(first(bytes, is_big)).into(),
            Self::U8 => u8::from_le_bytes(first(bytes, is_big)).into(),
            Self::I16 => i16::from_le_bytes(first(bytes, is_big)).into(),
            Self::U16 => u16::from_le_bytes(first(bytes, is_big)).into(),
            Self::I32 => i32::from_le_bytes(first(bytes, is_big)).into(),
            Self::U32 => u32::from_le_bytes(first(bytes, is_big)).into(),
            Self::F32 => f32::from_le_bytes(first(bytes, is_big)).into(),
            Self::F64 => f64::from_le_bytes(first(bytes, is_big)),
        }
    }

    /// Appends the value of a word of an ASCII body, little-endian. Returns `None` if the word is no such number.
    pub(super) fn push_word(self, word: &str, to: &mut Vec<u8>) -> Option<()> {
        match self {
            Self::I8 => to.extend(word.parse::<i8>().ok()?.to_le_bytes()),
            Self::U8 => to.extend(word.parse::<u8>().ok()?.to_le_bytes()),
            Self::I16 => to.extend(word.parse::<i16>().ok()?.to_le_bytes()),
            Self::U16 => to.extend(word.parse::<u16>().ok()?.to_le_bytes()),
            Self::I32 => to.extend(word.parse::<i32>().ok()?.to_le_bytes()),
            Self::U32 => to.extend(word.parse::<u32>().ok()?.to_le_bytes()),
            Self::F32 => to.extend(word.parse::<f32>().ok()?.to_le_bytes()),
            Self::F64 => to.extend(word.parse::<f64>().ok()?.to_le_bytes()),
        }
        Some(())
    }
}
