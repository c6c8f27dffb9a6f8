//! The codebooks of coded colors.
//!
//! In: entries and their scales, from training or a file. Out: [`ColorCodebooks`], which several scenes may share: those
//! of the chunk files of a capture.

/// Codebooks of color, and the scales of their entries. [`CodedColors`](super::CodedColors) has the degrees.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ColorCodebooks {
    /// Number of entries of each codebook.
    pub entries: Vec<u32>,
    /// All codebooks: as many words for each entry as the degrees need, four signed bytes to a word, RGB innermost, DC
    /// coefficient 0.
    pub words: Vec<u32>,
    /// Value of a byte of 127: as many four-vectors for each codebook as an entry has words.
    pub scales: Vec<[f32; 4]>,
}

impl ColorCodebooks {
    /// Returns the number of entries of all codebooks.
    pub fn total(&self) -> usize {
        self.entries.iter().fold(0, |sum: usize, &entries| sum.saturating_add(entries as usize))
    }

    /// Returns the bytes in memory.
    pub fn size(&self) -> usize {
        size_of_val(self.words.as_slice()) + size_of_val(self.scales.as_slice())
    }
}
