//! The values of the pickle of a checkpoint.
//!
//! In: what the opcodes make. Out: [`Value`], and the Python objects ([`Global`]) that a checkpoint may name.

use crate::codec::checkpoint::tensor::{Storage, Tensor};
use crate::codec::pickle::Id;
use crate::codec::text::printable;
use std::fmt;

/// A value of a pickle.
#[derive(Debug)]
pub(crate) enum Value<'a> {
    None,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(&'a str),
    Bytes(Vec<u8>),
    Tuple(Vec<Id>),
    List(Vec<Id>),
    /// Keys and values, alternating.
    Dict(Vec<Id>),
    Global(Global),
    Storage(Storage<'a>),
    Tensor(Box<Tensor<'a>>),
    /// A numpy floating-point type, with its size in bytes.
    Dtype(usize),
    /// A Python object that is not known, or what a call of it would return.
    Inert(Name<'a>),
}

/// The name of a Python object: module and name, as in the pickle.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Name<'a> {
    pub(super) module: &'a [u8],
    pub(super) name: &'a [u8],
}

impl fmt::Display for Name<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = format!("{} {}", String::from_utf8_lossy(self.module), String::from_utf8_lossy(self.name));
        f.write_str(&printable(name.trim()))
    }
}

impl Value<'_> {
    /// Returns the kind of the value, for messages.
    pub(crate) fn kind(&self) -> &'static str {
        match self {
            Self::None => "None",
            Self::Bool(_) => "a bool",
            Self::Int(_) => "an int",
            Self::Float(_) => "a float",
            Self::Text(_) => "a text",
            Self::Bytes(_) => "bytes",
            Self::Tuple(_) => "a tuple",
            Self::List(_) => "a list",
            Self::Dict(_) => "a dictionary",
            Self::Global(_) | Self::Dtype(_) | Self::Inert(_) => "a Python object",
            Self::Storage(_) => "a storage without a tensor",
            Self::Tensor(_) => "a tensor",
        }
    }
}

/// The Python objects that a checkpoint may name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Global {
    RebuildParameter,
    RebuildTensor,
    FloatStorage,
    OrderedDict,
    NumpyScalar,
    NumpyDtype,
    Encode,
}

impl Global {
    pub(super) fn of(module: &[u8], name: &[u8]) -> Option<Self> {
        Some(match (module, name) {
            (b"torch._utils", b"_rebuild_parameter") => Self::RebuildParameter,
            (b"torch._utils", b"_rebuild_tensor_v2") => Self::RebuildTensor,
            (b"torch", b"FloatStorage") => Self::FloatStorage,
            (b"collections", b"OrderedDict") => Self::OrderedDict,
            (b"numpy.core.multiarray" | b"numpy._core.multiarray", b"scalar") => Self::NumpyScalar,
            (b"numpy", b"dtype") => Self::NumpyDtype,
            (b"_codecs", b"encode") => Self::Encode,
            _ => return None,
        })
    }
}
