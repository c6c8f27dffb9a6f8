//! The outer product of two vectors, of which covariances are sums.
//!
//! In: two vectors of three. Out: the 3x3 matrix of the products of their entries, in double precision.

use glam::{DMat3, DVec3};

/// Returns `a bᵀ`.
pub(crate) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_multiples_of_the_first_vector() {
        let product = outer(DVec3::new(1.0, 2.0, 3.0), DVec3::new(4.0, 5.0, 6.0));
        let expected = [[4.0, 8.0, 12.0], [5.0, 10.0, 15.0], [6.0, 12.0, 18.0]];
        assert_eq!(product.to_cols_array_2d(), expected, "column j is a times entry j of b");
    }
}
