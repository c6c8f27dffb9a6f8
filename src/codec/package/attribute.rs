//! Attributes: the columns of a scene that sections hold.
//!
//! In: the place of a column in a table of words. Out: its [`Attribute`], with its sizes, its runs of rows, and its
//! rows of the first Gaussians.

use crate::scene::PackedScene;
use std::ops::Range;

/// Fewest rows of which one byte of each component is compressed as a block of its own.
const ROWS_OF_A_BLOCK: usize = 256;

/// One attribute of all Gaussians, or of another part of a scene: a column of a table of words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Attribute {
    /// Name of its sections.
    pub name: &'static str,
    /// Rows of the table: Gaussians, values of the environment map, points or triangles of colliders, words of the
    /// sound file.
    pub rows: usize,
    /// Number of words from one row to the next in memory.
    pub stride: usize,
    /// First word of the attribute within a row.
    pub offset: usize,
    /// Number of words of the attribute in a row.
    pub width: usize,
}

impl Attribute {
    /// Returns the bytes of its table in memory, which are counted for the first of the attributes in that table.
    pub(super) fn memory(&self) -> u64 {
        if self.offset > 0 { 0 } else { (self.rows as u64).saturating_mul(self.stride as u64).saturating_mul(4) }
    }

    /// Returns the uncompressed bytes of `rows` rows.
    pub(super) fn raw_length(&self, rows: usize) -> u64 {
        (rows as u64).saturating_mul(self.width as u64 * 4)
    }

    /// Returns the number of bytes after which a block of the compressed planes of `rows` rows ends: those of one byte
    /// of one component, or all where a code for each costs more than it saves: of few rows, and of tables.
    pub(super) fn block_length(&self, rows: usize) -> usize {
        let is_table = matches!(self.name, "packed_ranges" | "codebooks" | "codebook_scales");
        if is_table || rows < ROWS_OF_A_BLOCK { usize::MAX } else { rows }
    }

    /// Returns some of its rows in runs of at most `length`.
    pub(super) fn runs(self, rows: Range<usize>, length: usize) -> impl Iterator<Item = (Self, Range<usize>)> {
        rows.clone().step_by(length).map(move |first| (self, first..rows.end.min(first.saturating_add(length))))
    }

    /// Returns the number of its rows that the first `gaussians` Gaussians have, if a picture in plain color needs it.
    pub(super) fn rows_of(&self, gaussians: usize) -> Option<usize> {
        match self.name {
            "packed_mean" | "packed_motion" | "packed_shape" | "color_base" | "sh_dc" => Some(gaussians),
            "packed_ranges" => Some(PackedScene::range_count(gaussians)),
            _ => None,
        }
    }
}
