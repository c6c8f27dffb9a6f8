//! Coverage: how much of what is drawn at a time is there.
//!
//! In: the files that a time needs, and whether each is there. Out: [`Coverage`].

use crate::scene::ChunkFile;

/// How much of what is drawn at a time is there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Coverage {
    /// Number of files that have Gaussians of the time.
    pub files: usize,
    /// Number of those that are there.
    pub resident: usize,
    /// Number of Gaussians of all of these files.
    pub gaussians: u64,
    /// Number of Gaussians of those that are there.
    pub resident_gaussians: u64,
    /// Whether every file of layer 0 is there, which has the most important Gaussians.
    pub is_coarse: bool,
}

impl Coverage {
    /// Returns the coverage of a time from the files that it needs, each with whether it is there.
    pub(super) fn of<'a>(needed: impl IntoIterator<Item = (&'a ChunkFile, bool)>) -> Self {
        let none = Self { files: 0, resident: 0, gaussians: 0, resident_gaussians: 0, is_coarse: true };
        needed.into_iter().fold(none, |so_far, (file, is_there)| Self {
            files: so_far.files + 1,
            resident: so_far.resident + usize::from(is_there),
            gaussians: so_far.gaussians.saturating_add(file.gaussians),
            resident_gaussians: so_far.resident_gaussians.saturating_add(if is_there { file.gaussians } else { 0 }),
            is_coarse: so_far.is_coarse && (is_there || file.layer > 0),
        })
    }

    /// Returns whether every file is there.
    pub fn is_whole(&self) -> bool {
        self.resident == self.files
    }

    /// Returns the share of the Gaussians that is there, 0 to 1; 1 if there is nothing to draw.
    pub fn share(&self) -> f32 {
        if self.gaussians == 0 { 1.0 } else { (self.resident_gaussians as f64 / self.gaussians as f64) as f32 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(layer: u32, gaussians: u64) -> ChunkFile {
        ChunkFile { stretches: [0, 0], layer, gaussians, bytes: 0 }
    }

    #[test]
    fn a_time_is_coarse_with_layer_0_and_whole_with_all_files() {
        let files = [file(0, 10), file(0, 20), file(1, 70)];
        let with = |there: [bool; 3]| Coverage::of(files.iter().zip(there));
        let none = with([false; 3]);
        assert_eq!((none.files, none.resident, none.gaussians, none.share()), (3, 0, 100, 0.0), "nothing is there");
        let half = with([true, false, true]);
        assert_eq!((half.resident_gaussians, half.is_coarse), (80, false), "a file of layer 0 is missing: {half:?}");
        let coarse = with([true, true, false]);
        assert!(coarse.is_coarse && !coarse.is_whole() && coarse.share() == 0.3, "layer 0 is there: {coarse:?}");
        let whole = with([true; 3]);
        assert!(whole.is_coarse && whole.is_whole() && whole.share() == 1.0, "all is there: {whole:?}");
    }

    #[test]
    fn a_time_without_gaussians_is_whole() {
        let nothing = Coverage::of([]);
        assert!(nothing.is_coarse && nothing.is_whole() && nothing.share() == 1.0, "no file: {nothing:?}");
        let empty = file(0, 0);
        let missing = Coverage::of([(&empty, false)]);
        assert!(!missing.is_whole() && missing.share() == 1.0, "an empty file that is not there: {missing:?}");
    }
}
