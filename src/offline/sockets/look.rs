//! What a point looks like: the colors around it.
//!
//! In: the colors of the Gaussians that are drawn around a point, each with its weight, at the time of the placement
//! and at another time. Out: how much of the first is there at the other time ([`Look::share`]). What is around a point
//! may go away while something else is drawn there: then the colors differ.

use glam::Vec3;

/// The distance of two colors (red, green and blue from 0 to 1) that are nearly alike.
const ALIKE: f32 = 0.15;

/// The colors around a point.
#[derive(Debug)]
pub(super) struct Look {
    colors: Vec<Colored>,
    /// The sum over all pairs of its own colors.
    own: f64,
    /// The distance within which they count, capture units: that at which a weight is lower by the root of e.
    pub radius: f64,
}

/// A color, and its weight.
#[derive(Debug, Clone, Copy)]
pub(super) struct Colored {
    /// Independent of direction and time, 0 to 1.
    pub color: Vec3,
    pub weight: f64,
}

impl Look {
    /// Returns the look of these colors, which were found with `radius`.
    pub(super) fn of(colors: Vec<Colored>, radius: f64) -> Self {
        let own = pairs(&colors, &colors);
        Self { colors, own, radius }
    }

    /// Returns the part of the colors that other ones have: 0 if none are alike, 1 if all are there again.
    pub(super) fn share(&self, others: &[Colored]) -> f64 {
        if self.own > 0.0 { pairs(&self.colors, others) / self.own } else { 1.0 }
    }
}

/// Returns the sum over all pairs of the products of their weights and of how much they are alike.
fn pairs(some: &[Colored], others: &[Colored]) -> f64 {
    let alike = |a: &Colored, b: &Colored| {
        let near = (-0.5 * a.color.distance_squared(b.color) / (ALIKE * ALIKE)).exp();
        a.weight * b.weight * f64::from(near)
    };
    some.iter().map(|a| others.iter().map(|b| alike(a, b)).sum::<f64>()).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn colors(color: Vec3, count: usize) -> Vec<Colored> {
        vec![Colored { color, weight: 0.5 }; count]
    }

    #[test]
    fn the_share_is_that_of_the_colors_that_are_there_again() {
        let (yellow, gray) = (Vec3::new(0.9, 0.8, 0.2), Vec3::splat(0.5));
        let look = Look::of(colors(yellow, 20), 1.0);
        assert!((look.share(&colors(yellow, 20)) - 1.0).abs() < 1e-9, "all are there");
        assert!((look.share(&colors(yellow, 5)) - 0.25).abs() < 1e-9, "a quarter is there");
        assert!(look.share(&colors(gray, 40)) < 0.2, "other colors are there");
        assert!(look.share(&[]) < 1e-9, "none is there");
        assert!((Look::of(Vec::new(), 1.0).share(&[]) - 1.0).abs() < 1e-9, "nothing stays nothing");
    }
}
