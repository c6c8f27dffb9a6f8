//! A table of a PLY file: one of its elements, whose properties are scalars.
//!
//! In: rows of equal length. Out: [`Table`], its columns by name.

use super::scalar::Scalar;
use crate::codec::import::error::ImportError;
use std::borrow::Cow;

/// A table, whose `bytes` have every row.
#[derive(Debug, Clone)]
pub(crate) struct Table<'a> {
    pub(super) name: String,
    /// Number of rows.
    pub(super) count: usize,
    /// Number of bytes of a row.
    pub(super) stride: usize,
    pub(super) bytes: Cow<'a, [u8]>,
    /// Whether its numbers are big-endian.
    pub(super) is_big: bool,
    /// Name, type and offset in a row of each property.
    pub(super) properties: Vec<(String, Scalar, usize)>,
}

/// A column of a table.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Column<'a> {
    /// The table from the first value on.
    bytes: &'a [u8],
    stride: usize,
    scalar: Scalar,
    is_big: bool,
}

impl Table<'_> {
    /// Returns the number of rows.
    pub(crate) fn len(&self) -> usize {
        self.count
    }

    /// Returns the names of its properties.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.properties.iter().map(|(name, ..)| name.as_str())
    }

    /// Returns whether it has a property.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.names().any(|found| found == name)
    }

    /// Returns the number of properties `stem_0`, `stem_1` and so on without a gap, counted from 0.
    pub(crate) fn counted(&self, stem: &str) -> usize {
        let numbers = self.names().filter_map(|name| name.strip_prefix(stem)?.strip_prefix('_')?.parse().ok());
        let numbers: std::collections::HashSet<usize> = numbers.collect();
        (0..).take_while(|number| numbers.contains(number)).count()
    }

    /// Returns the property of a name.
    pub(crate) fn column(&self, name: &str) -> Option<Column<'_>> {
        let &(_, scalar, offset) = self.properties.iter().find(|(found, ..)| found == name)?;
        Some(Column { bytes: self.bytes.get(offset..)?, stride: self.stride, scalar, is_big: self.is_big })
    }

    /// Returns the property of a name.
    ///
    /// # Errors
    /// A table without it.
    pub(crate) fn required(&self, name: &str) -> Result<Column<'_>, ImportError> {
        let missing =
            || ImportError::damaged(format!("its element {} has no property {name}", self.name.escape_debug()));
        // An empty table has no bytes, and no value of its columns is read.
        let empty = Column { bytes: &[], stride: 0, scalar: Scalar::F32, is_big: false };
        self.column(name).or((self.count == 0 && self.has(name)).then_some(empty)).ok_or_else(missing)
    }

    /// Returns the properties of these names.
    ///
    /// # Errors
    /// A table without one of them.
    pub(crate) fn all<const N: usize>(&self, names: [&str; N]) -> Result<[Column<'_>; N], ImportError> {
        let found = names.iter().map(|name| self.required(name)).collect::<Result<Vec<_>, _>>()?;
        found.try_into().map_err(|_| ImportError::damaged("its properties have no columns"))
    }

    /// Returns the properties `stem_0` to `stem_(N − 1)`.
    ///
    /// # Errors
    /// A table without one of them.
    pub(crate) fn numbered<const N: usize>(&self, stem: &str) -> Result<[Column<'_>; N], ImportError> {
        let names: [String; N] = std::array::from_fn(|number| format!("{stem}_{number}"));
        self.all(std::array::from_fn(|number| names[number].as_str()))
    }
}

impl Column<'_> {
    /// Returns the value of a row; 0 beyond the last.
    #[inline]
    pub(crate) fn f32(&self, row: usize) -> f32 {
        let at = self.bytes.get(row * self.stride..).unwrap_or(&[]);
        match (self.scalar, at.first_chunk()) {
            // The usual type, whose bits stay as they are.
            (Scalar::F32, Some(&bytes)) if !self.is_big => f32::from_le_bytes(bytes),
            (Scalar::F32, Some(&bytes)) => f32::from_be_bytes(bytes),
            _ => self.scalar.value(at, self.is_big) as f32,
        }
    }

    /// Returns the value of a row in double precision; 0 beyond the last.
    #[inline]
    pub(crate) fn f64(&self, row: usize) -> f64 {
        self.scalar.value(self.bytes.get(row * self.stride..).unwrap_or(&[]), self.is_big)
    }

    /// Returns whether the values of the file are in double precision.
    pub(super) fn is_double(&self) -> bool {
        self.scalar == Scalar::F64
    }

    /// Returns the largest value of the integers of the file; `None` if they are not bytes or words of 16 bits.
    pub(super) fn largest(&self) -> Option<f64> {
        match self.scalar {
            Scalar::U8 => Some(255.0),
            Scalar::U16 => Some(65_535.0),
            _ => None,
        }
    }

    /// Returns the value of a row as a share of 255 for a byte, of 65 535 for 16 bits, else as stored; 0 beyond the
    /// last.
    pub(crate) fn share(&self, row: usize) -> f32 {
        self.f32(row) / self.largest().unwrap_or(1.0) as f32
    }

    /// Returns the value of a row as a word of 32 bits; 0 beyond the last, and for values that are no such integer.
    #[inline]
    pub(crate) fn u32(&self, row: usize) -> u32 {
        self.scalar.value(self.bytes.get(row * self.stride..).unwrap_or(&[]), self.is_big) as u32
    }
}

/// Returns the values of a row.
#[inline]
pub(crate) fn row<const N: usize>(columns: &[Column<'_>; N], row: usize) -> [f32; N] {
    std::array::from_fn(|column| columns[column].f32(row))
}
