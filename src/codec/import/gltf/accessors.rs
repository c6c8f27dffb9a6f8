//! Accessors: rows of numbers in buffers.
//!
//! In: the index of an accessor. Out: its rows, as single-precision numbers, each of which is finite.

use super::buffers::Buffers;
use super::document::{Accessor, Document};
use crate::codec::import::error::ImportError;

/// The accessors of a document.
pub(super) struct Accessors<'a> {
    pub document: &'a Document,
    pub buffers: Buffers<'a>,
}

/// An accessor and the bytes of its rows.
pub(super) struct Rows<'a> {
    pub accessor: &'a Accessor,
    /// Components in a row.
    pub components: usize,
    index: usize,
    name: String,
    bytes: &'a [u8],
    stride: usize,
    width: usize,
}

impl Accessors<'_> {
    /// Returns the rows of an accessor that holds the attribute `name`. The buffer is checked to hold all rows.
    ///
    /// # Errors
    /// An accessor that does not exist, has no buffer view, is sparse, of an unknown type, or exceeds its buffer view.
    pub(super) fn rows(&self, index: usize, name: &str) -> Result<Rows<'_>, ImportError> {
        let name = name.escape_debug().to_string();
        let reason = |reason: &str| format!("accessor {index} ({name}) {reason}");
        let damaged = |text: &str| ImportError::damaged(reason(text));
        let accessor = self.document.accessors.get(index).ok_or_else(|| damaged("does not exist"))?;
        if accessor.sparse.is_some() {
            return Err(ImportError::unsupported(reason("is sparse: export the file with plain accessors")));
        }
        let Some(view_index) = accessor.buffer_view else {
            return Err(ImportError::unsupported(reason("has no buffer view: its numbers are in no known extension")));
        };
        let components = match &*accessor.shape {
            "SCALAR" => 1,
            "VEC2" => 2,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => return Err(damaged("is neither a scalar nor a vector")),
        };
        let width = match accessor.component_type {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            5126 => 4,
            _ => return Err(damaged("is of a component type that no attribute has")),
        };
        let bytes = self.buffers.view(view_index)?;
        let row = components * width;
        let stride = self.document.buffer_views.get(view_index).and_then(|view| view.byte_stride).unwrap_or(row);
        if stride < row {
            return Err(damaged("has rows that overlap"));
        }
        // The last row need not fill its stride.
        let end = accessor.count.checked_sub(1).map_or(Some(0), |last| last.checked_mul(stride)?.checked_add(row));
        let end = end.and_then(|end| end.checked_add(accessor.byte_offset));
        let bytes = end.and_then(|end| bytes.get(accessor.byte_offset..end));
        let bytes = bytes.ok_or_else(|| damaged(&format!("exceeds its buffer view with {} rows", accessor.count)))?;
        Ok(Rows { accessor, components, index, name, bytes, stride, width })
    }
}

impl Rows<'_> {
    /// Returns the error about these rows.
    pub(super) fn damaged(&self, reason: &str) -> ImportError {
        ImportError::damaged(format!("accessor {} ({}) {reason}", self.index, self.name))
    }

    /// Returns whether a component has a sign.
    pub(super) fn is_signed(&self) -> bool {
        matches!(self.accessor.component_type, 5120 | 5122 | 5126)
    }

    /// Returns whether components are integers.
    pub(super) fn is_integer(&self) -> bool {
        self.accessor.component_type != 5126
    }

    /// Returns the first `N` components of a row; `None` if there are fewer rows or components.
    pub(super) fn row<const N: usize>(&self, row: usize) -> Option<[f32; N]> {
        let bytes = self.bytes.chunks(self.stride).nth(row)?;
        self.components.checked_sub(N)?;
        Some(self.values(bytes, self.component()))
    }

    /// Calls `put` with the number and the first `N` components of each row.
    ///
    /// # Errors
    /// Rows with fewer components; a number that is not finite.
    pub(super) fn read<const N: usize>(&self, mut put: impl FnMut(usize, [f32; N])) -> Result<(), ImportError> {
        if self.components < N {
            return Err(self.damaged(&format!("has {} components in a row instead of {N}", self.components)));
        }
        let component = self.component();
        for (index, row) in self.bytes.chunks(self.stride).enumerate() {
            let values = self.values(row, component);
            if !values.iter().all(|value| value.is_finite()) {
                return Err(self.damaged(&format!("has a number in row {index} that is not finite")));
            }
            put(index, values);
        }
        Ok(())
    }

    /// Returns the components in the bytes of a row.
    fn values<const N: usize>(&self, row: &[u8], component: fn(&[u8]) -> f32) -> [f32; N] {
        let mut values = [0.0; N];
        for (value, bytes) in values.iter_mut().zip(row.chunks_exact(self.width)) {
            *value = component(bytes);
        }
        values
    }

    /// Returns the function that reads a component from its bytes.
    fn component(&self) -> fn(&[u8]) -> f32 {
        match (self.accessor.component_type, self.accessor.normalized) {
            (5120, false) => |b| f32::from(b[0] as i8),
            (5120, true) => |b| (f32::from(b[0] as i8) / 127.0).max(-1.0),
            (5121, false) => |b| f32::from(b[0]),
            (5121, true) => |b| f32::from(b[0]) / 255.0,
            (5122, false) => |b| f32::from(i16::from_le_bytes([b[0], b[1]])),
            (5122, true) => |b| (f32::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0),
            (5123, false) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])),
            (5123, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
            _ => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        }
    }
}
