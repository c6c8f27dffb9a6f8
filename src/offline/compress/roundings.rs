//! What packing changes of each Gaussian.
//!
//! In: Gaussians and the bits of the packed form. Out: the difference between each Gaussian and its packed form.

use super::CompressError;
use crate::gaussian::{Gaussian, Harmonics};
use crate::scene::packed::Rounding;
use crate::scene::packed::order::{is_filler, morton_order};
use crate::scene::packed::pack::{check_each, encode_ordered};
use crate::scene::{Bits, PackedColors};
use rayon::prelude::*;

/// Returns how [`compress`](super::compress) would change the geometry of each Gaussian. `reach` is the length of the
/// time interval, timestamp units.
///
/// # Errors
/// A Gaussian that the packed form cannot hold.
pub fn roundings(gaussians: &[Gaussian], bits: &Bits, reach: f32) -> Result<Vec<Rounding>, CompressError> {
    let order = morton_order(gaussians);
    let packed = encode_ordered(gaussians, &order, bits, PackedColors::Whole(Harmonics::default()), [0.0; 2], reach);
    check_each(&packed, &order)?;
    let mut places = vec![0; gaussians.len()];
    let own = (0..order.len()).filter(|&place| !is_filler(&order, place));
    own.for_each(|place| places[order[place] as usize] = place);
    Ok(places.par_iter().zip(gaussians).map(|(&place, gaussian)| packed.rounding(place, gaussian)).collect())
}
