//! The values of the pickle of a dictionary that NumPy has saved.
//!
//! In: what the opcodes make. Out: [`Value`]: arrays ([`Array`]) refer to their bytes in the file, from which
//! [`Dtype::number`] makes numbers; the Python objects ([`Global`]) that such a file may name.

use crate::codec::pickle::Id;

/// A value.
#[derive(Debug)]
pub(super) enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(&'a [u8]),
    /// Bytes as characters below 256, as protocol 2 has them.
    Latin1(&'a str),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    /// Keys and values, alternating.
    Dict(Vec<Id>),
    Global(Global),
    Dtype(Dtype),
    /// An array; `None` before its contents are known.
    Array(Option<Box<Array>>),
}

/// The Python objects that such a file may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Global {
    Reconstruct,
    Ndarray,
    Scalar,
    Dtype,
    Encode,
    Bytes,
    OrderedDict,
}

impl Global {
    pub(super) fn of(module: &str, name: &str) -> Option<Self> {
        Some(match (module, name) {
            ("numpy.core.multiarray" | "numpy._core.multiarray", "_reconstruct") => Self::Reconstruct,
            ("numpy.core.multiarray" | "numpy._core.multiarray", "scalar") => Self::Scalar,
            ("numpy", "ndarray") => Self::Ndarray,
            ("numpy", "dtype") => Self::Dtype,
            ("_codecs", "encode") => Self::Encode,
            ("builtins" | "__builtin__", "bytes") => Self::Bytes,
            ("collections", "OrderedDict") => Self::OrderedDict,
            _ => return None,
        })
    }
}

/// The type of the values of an array.
#[derive(Debug, Clone, Copy)]
pub(super) struct Dtype {
    pub(super) kind: Kind,
    pub(super) is_big_endian: bool,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    Double,
    Single,
    Long,
    Int,
    /// The values are other values of the pickle.
    Object,
    /// A type whose values are not read.
    Other,
}

/// An array of any number of axes.
#[derive(Debug)]
pub(super) struct Array {
    pub(super) shape: Vec<usize>,
    pub(super) dtype: Dtype,
    pub(super) is_fortran: bool,
    /// Bytes, or a list of objects.
    pub(super) data: Id,
}

impl Value<'_> {
    /// Returns the kind of the value, for messages.
    pub(super) fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a bool",
            Self::Int(_) | Self::Float(_) => "a number",
            Self::Text(_) => "a text",
            Self::Bytes(_) | Self::Latin1(_) => "bytes",
            Self::Tuple(_) => "a tuple",
            Self::List(_) => "a list",
            Self::Dict(_) => "a dictionary",
            Self::Global(_) | Self::Dtype(_) => "a Python object",
            Self::Array(_) => "an array",
        }
    }
}

impl Array {
    pub(super) fn is_of_objects(&self) -> bool {
        matches!(self.dtype.kind, Kind::Object)
    }

    /// Returns the place in the data of a value by its index, for which the last axis changes fastest.
    pub(super) fn place(&self, index: usize, count: usize) -> usize {
        if !self.is_fortran {
            return index;
        }
        let (mut rest, mut stride, mut place) = (index, count, 0);
        for side in self.shape.iter().rev() {
            // There is an index, so that no side is 0.
            stride /= side;
            place += rest % side * stride;
            rest /= side;
        }
        place
    }
}

impl Dtype {
    /// Returns the type of this name.
    pub(super) fn of(name: &str) -> Self {
        let kind = match name {
            "f8" => Kind::Double,
            "f4" => Kind::Single,
            "i8" => Kind::Long,
            "i4" => Kind::Int,
            "O" | "O8" | "O4" => Kind::Object,
            _ => Kind::Other,
        };
        Self { kind, is_big_endian: false }
    }

    /// Returns the number of these bytes, as many as the type has.
    pub(super) fn number(self, bytes: &[u8]) -> f64 {
        let mut ordered = [0; 8];
        for (to, from) in ordered.iter_mut().zip(bytes) {
            *to = *from;
        }
        if self.is_big_endian {
            ordered[..bytes.len().min(8)].reverse();
        }
        let [a, b, c, d, ..] = ordered;
        match self.kind {
            Kind::Double => f64::from_le_bytes(ordered),
            Kind::Single => f32::from_le_bytes([a, b, c, d]).into(),
            Kind::Long => i64::from_le_bytes(ordered) as f64,
            Kind::Int | Kind::Object | Kind::Other => i32::from_le_bytes([a, b, c, d]).into(),
        }
    }
}
