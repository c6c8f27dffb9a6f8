//! PLY files for tests.
//!
//! In: names and values of properties. Out: the bytes of files, in each encoding.

use super::read;
use crate::codec::import::source::{InMemory, Source};
use crate::codec::import::{ImportError, Imported};
use crate::codec::options::ReadOptions;

/// A file with one element.
#[derive(Debug, Clone, Default)]
pub(crate) struct File {
    /// Lines of comments.
    pub comments: Vec<String>,
    /// The name of each property.
    pub names: Vec<String>,
    /// The values of each row.
    pub rows: Vec<Vec<f32>>,
}

impl File {
    /// Returns a file of `count` Gaussians of 3DGS, no two values alike.
    pub(crate) fn splats(count: usize, rest: usize) -> Self {
        let mut names: Vec<String> = ["x", "y", "z", "nx", "ny", "nz"].map(str::to_owned).into();
        for (stem, count) in [("f_dc", 3), ("f_rest", rest)] {
            names.extend((0..count).map(|i| format!("{stem}_{i}")));
        }
        names.push("opacity".to_owned());
        for (stem, count) in [("scale", 3), ("rot", 4)] {
            names.extend((0..count).map(|i| format!("{stem}_{i}")));
        }
        let value = |row: usize, column: usize| ((row * names.len() + column) as f32 * 0.37).sin() - 0.1;
        let rows = (0..count).map(|row| (0..names.len()).map(|column| value(row, column)).collect()).collect();
        Self { comments: Vec::new(), names, rows }
    }

    /// Adds a property with these values.
    pub(crate) fn with(mut self, name: &str, values: impl Fn(usize) -> f32) -> Self {
        self.names.push(name.to_owned());
        self.rows.iter_mut().enumerate().for_each(|(row, own)| own.push(values(row)));
        self
    }

    /// Adds a comment.
    pub(crate) fn comment(mut self, comment: &str) -> Self {
        self.comments.push(comment.to_owned());
        self
    }

    /// Returns the value of a property in a row.
    pub(crate) fn value(&self, name: &str, row: usize) -> f32 {
        let column = self.names.iter().position(|found| found == name);
        self.rows[row][column.unwrap_or_else(|| panic!("the file has {name}"))]
    }

    fn header(&self, format: &str, scalar: &str) -> String {
        let comments: String = self.comments.iter().map(|comment| format!("comment {comment}\n")).collect();
        let properties: String = self.names.iter().map(|name| format!("property {scalar} {name}\n")).collect();
        let count = self.rows.len();
        format!("ply\nformat {format} 1.0\n{comments}element vertex {count}\n{properties}end_header\n")
    }

    /// Returns a binary little-endian file.
    pub(crate) fn little(&self) -> Vec<u8> {
        let values = self.rows.iter().flatten().flat_map(|value| value.to_le_bytes());
        self.header("binary_little_endian", "float").into_bytes().into_iter().chain(values).collect()
    }

    /// Returns a binary big-endian file.
    pub(crate) fn big(&self) -> Vec<u8> {
        let values = self.rows.iter().flatten().flat_map(|value| value.to_be_bytes());
        self.header("binary_big_endian", "float32").into_bytes().into_iter().chain(values).collect()
    }

    /// Returns a file of doubles.
    pub(crate) fn doubles(&self) -> Vec<u8> {
        let values = self.rows.iter().flatten().flat_map(|&value| f64::from(value).to_le_bytes());
        self.header("binary_little_endian", "double").into_bytes().into_iter().chain(values).collect()
    }

    /// Returns an ASCII file.
    pub(crate) fn ascii(&self) -> Vec<u8> {
        let mut text = self.header("ascii", "float");
        for row in &self.rows {
            text += &row.iter().map(|value| format!("{value} ")).collect::<String>();
            text += "\n";
        }
        text.into_bytes()
    }
}

/// Reads a file from memory.
pub(crate) fn read_bytes(bytes: &[u8], options: &ReadOptions) -> Result<Imported, ImportError> {
    read(&Source { bytes, beside: &InMemory::default() }, options)
}

/// Returns the message about a file that is refused.
pub(crate) fn refusal(bytes: &[u8]) -> String {
    read_bytes(bytes, &ReadOptions::default()).expect_err("the file is refused").to_string()
}
