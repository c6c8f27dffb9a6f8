//! The settings of `collide`.
//!
//! In: the choices of a caller. Out: [`CollideSettings`], with a default for each, checked.

use super::error::CollideError;

/// Settings of [`collide`](super::collide).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CollideSettings {
    /// Number of cells along the longest side of the box that is searched, 8 to 512. Default: 128. Memory grows with
    /// its third power: about 100 MB at 128, 6 GB at 512.
    pub cells: u32,
    /// The opacity that a straight line through a cell meets if the cell is solid, between 0 and 1. Default: 0.5.
    pub level: f32,
    /// Stretches of time in a second at speed 1, above 0. Default: 10.
    pub rate: f32,
    /// About the largest distance by which a mesh is simplified, in cells, 0 to 4. Default: 0.5.
    pub error: f32,
    /// Parts of fewer solid cells are dropped. Default: 27.
    pub smallest: usize,
    /// The smallest and the largest corner of the box that is searched, capture space; solid parts are cut off there.
    /// What has no opening to the outside of the box, as the inside of a closed room, counts as solid. Default: `None`,
    /// the box that holds 99 % of the opacity along each axis.
    pub bounds: Option<[[f32; 3]; 2]>,
}

impl Default for CollideSettings {
    fn default() -> Self {
        Self { cells: 128, level: 0.5, rate: 10.0, error: 0.5, smallest: 27, bounds: None }
    }
}

impl CollideSettings {
    /// Checks that each setting is in its range.
    ///
    /// # Errors
    /// The first that is not.
    pub(super) fn check(&self) -> Result<(), CollideError> {
        let Self { cells, level, rate, error, bounds, .. } = *self;
        let is_box = |[low, high]: [[f32; 3]; 2]| {
            low.iter().zip(&high).all(|(low, high)| low.is_finite() && high.is_finite() && low < high)
        };
        // NaN fails every comparison.
        if !(8..=512).contains(&cells) {
            Err(CollideError::Invalid("a number of cells that is not from 8 to 512"))
        } else if !(level > 0.0 && level < 1.0) {
            Err(CollideError::Invalid("a level that is not between 0 and 1"))
        } else if !(rate > 0.0 && rate.is_finite()) {
            Err(CollideError::Invalid("a rate that is not a number above 0"))
        } else if !(0.0..=4.0).contains(&error) {
            Err(CollideError::Invalid("an error that is not from 0 to 4 cells"))
        } else if !bounds.is_none_or(is_box) {
            Err(CollideError::Invalid("a box whose corners are not in order, the smallest first"))
        } else {
            Ok(())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_out_of_their_range_are_refused_by_name() {
        let good = CollideSettings { bounds: Some([[-1.0; 3], [1.0; 3]]), ..CollideSettings::default() };
        assert!(good.check().is_ok(), "a box is accepted");
        assert!(CollideSettings::default().check().is_ok(), "the defaults are accepted");
        let refused = [
            (CollideSettings { cells: 7, ..good }, "number of cells"),
            (CollideSettings { cells: 513, ..good }, "number of cells"),
            (CollideSettings { level: 0.0, ..good }, "level"),
            (CollideSettings { level: 1.0, ..good }, "level"),
            (CollideSettings { level: f32::NAN, ..good }, "level"),
            (CollideSettings { rate: 0.0, ..good }, "rate"),
            (CollideSettings { rate: f32::INFINITY, ..good }, "rate"),
            (CollideSettings { error: -0.1, ..good }, "error"),
            (CollideSettings { error: f32::NAN, ..good }, "error"),
            (CollideSettings { bounds: Some([[1.0; 3], [-1.0; 3]]), ..good }, "box"),
            (CollideSettings { bounds: Some([[0.0; 3], [1.0, 1.0, f32::INFINITY]]), ..good }, "box"),
            (CollideSettings { bounds: Some([[f32::NAN; 3], [1.0; 3]]), ..good }, "box"),
        ];
        for (settings, name) in refused {
            let error = settings.check().expect_err("must be refused").to_string();
            assert!(error.contains(name), "{settings:?} names the {name}: {error}");
        }
    }
}
