//! The settings of levels of detail.
//!
//! In: the choices of a caller. Out: [`DetailSettings`], with a default for each.

/// Settings of the levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DetailSettings {
    /// Number of levels, at most 8; each has a seventh of the Gaussians of the finer level. Default: 3.
    pub levels: usize,
    /// Least PSNR of a screen of 1280x720 pixels on which a level replaces all Gaussians, dB. Default: 45.
    pub min_psnr: f64,
    /// Training steps of each level; 0 leaves the merged Gaussians unchanged. Default: 2000.
    pub steps: usize,
    /// Number of directions from which each level is trained and compared. Default: 24.
    pub directions: usize,
    /// Number of times of each direction. Default: 6.
    pub times: usize,
}

impl Default for DetailSettings {
    fn default() -> Self {
        Self { levels: 3, min_psnr: 45.0, steps: 2000, directions: 24, times: 6 }
    }
}
