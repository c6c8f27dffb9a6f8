//! The difference of the Gaussians of a written `.4dgs` file from their originals.
//!
//! In: the bytes of the file, the Gaussians. Out: [`Deviation`], and a sentence with its numbers.

use super::coder::Coder;
use super::rows::Row;
use fourdgs::chunk::DecodedChunk;
use fourdgs::opcode::CHUNK;
use fourdgs::records::parse_chunk;
use fourdgs::serialization::{MAGIC, Records};
use glam::{DQuat, DVec3};

/// The largest differences of a file.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Deviation {
    /// Distance of a center from its place at the first or the last visible time, in middle scales of its Gaussian.
    pub place: f64,
    /// The sum of these distances; each Gaussian counts once.
    sum: f64,
    count: usize,
    /// Relative difference of a scale.
    pub scale: f64,
    /// Angle between two rotations, degrees.
    pub angle: f64,
    /// Difference of an opacity.
    pub opacity: f64,
    /// Relative difference of a lifespan.
    pub lifespan: f64,
}

impl Deviation {
    /// Decodes the chunks of a file, and compares their Gaussians. `order` has the index of each Gaussian of the file.
    ///
    /// # Errors
    /// A file that cannot be decoded.
    pub(super) fn of(file: &[u8], coder: &Coder, rows: &[Row], order: &[usize]) -> fourdgs::Result<Self> {
        let mut deviation = Self::default();
        let mut places = order.iter();
        for record in Records::new(file, MAGIC.len()) {
            let record = record?;
            if record.opcode != CHUNK {
                continue;
            }
            let (head, streams) = parse_chunk(record.content)?;
            let chunk = coder.decode(streams, head.count as usize)?;
            for (at, &index) in (0..chunk.count).zip(&mut places) {
                deviation.add(&decoded(&chunk, at, coder), &rows[index], coder);
            }
        }
        Ok(deviation)
    }

    /// Returns the sentence about what a file rounds.
    pub(super) fn sentence(&self) -> String {
        let [place, mean] = [self.place, self.sum / self.count.max(1) as f64].map(percent);
        format!(
            "The file was read back: a Gaussian is at most {place} of its size from its place ({mean} on average), its scales differ by at most {}, \
             its rotation by {:.4} degrees, its opacity by {}, its lifespan by {}.",
            percent(self.scale),
            self.angle,
            percent(self.opacity),
            percent(self.lifespan),
        )
    }

    fn add(&mut self, found: &Row, expected: &Row, coder: &Coder) {
        let mut scales = expected.log_scale;
        scales.sort_unstable_by(f64::total_cmp);
        let size = scales[1].exp();
        if let Some(times) = expected.visible(coder.times.duration, coder.times.reach()) {
            let distance = |time: f64| DVec3::from(found.center(time)).distance(expected.center(time).into());
            let place = times.map(distance).into_iter().fold(0.0, f64::max) / size;
            self.place = self.place.max(place);
            self.sum += place;
            self.count += 1;
        }
        for (found, expected) in found.log_scale.iter().zip(expected.log_scale) {
            self.scale = self.scale.max((found - expected).abs().exp_m1());
        }
        let [a, b] = [found.rotation, expected.rotation].map(DQuat::from_array);
        // The vector part has the length of the sine of half the angle; the scalar part is imprecise for small angles.
        let sine = (a.normalize() * b.normalize().conjugate()).xyz().length().min(1.0);
        self.angle = self.angle.max(2.0 * sine.asin().to_degrees());
        self.opacity = self.opacity.max((found.opacity - expected.opacity).abs());
        if !expected.never_fades() {
            self.lifespan = self.lifespan.max((found.sigma_t / expected.sigma_t).ln().abs().exp_m1());
        }
    }
}

/// Returns a Gaussian of a chunk, without its color and its window.
fn decoded(chunk: &DecodedChunk, at: usize, coder: &Coder) -> Row {
    let three = |values: &[f32]| [0, 1, 2].map(|axis| f64::from(values[at * 3 + axis]));
    let four = |values: &[f32]| [0, 1, 2, 3].map(|axis| f64::from(values[at * 4 + axis]));
    let (opens, closes) = coder.windows[chunk.window_index[at] as usize];
    Row {
        mean: three(&chunk.positions),
        log_scale: three(&chunk.scales).map(f64::ln),
        rotation: four(&chunk.rotations),
        color: [0.0; 3],
        opacity: four(&chunk.colors)[3],
        velocity: three(&chunk.motions),
        mean_t: f64::from(chunk.mu_t[at]),
        sigma_t: f64::from(chunk.sigma_t[at]),
        window: [opens, closes],
    }
}

/// Returns a share in percent, with four places.
fn percent(share: f64) -> String {
    if share < 5e-7 { "less than 0.0001 %".to_owned() } else { format!("{:.4} %", 100.0 * share) }
}
