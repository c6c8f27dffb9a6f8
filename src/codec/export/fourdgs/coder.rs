//! The numbers of a `.4dgs` file: multiples of its steps.
//!
//! In: Gaussians in the units of the format. Out: [`Coder`]: the streams of a chunk, and the Gaussians decoded from it.

use super::rows::Row;
use super::steps::{Times, sigma, sigma_multiple, steps, velocity_class};
use crate::codec::import::fourdgs::exact::LEVEL;
use fourdgs::chunk::{DecodedChunk, decode_streams};
use fourdgs::opcode as op;
use fourdgs::quantization::{Steps, motion_step, mu_step, quantize_rotation, rct_forward, rint};
use fourdgs::stream::encode_stream;
use std::cmp::Ordering;
use std::collections::BTreeMap;

/// Relative rounding of single precision, to which players decode.
const SINGLE: f64 = f32::EPSILON as f64;

/// The encoding of the numbers of a file.
#[derive(Debug, Clone)]
pub(super) struct Coder {
    pub steps: Steps,
    /// The smallest coordinates, from which means are counted.
    pub origin: [f64; 3],
    /// The windows of the Gaussians, each once, in ascending order.
    pub windows: Vec<(f64, f64)>,
    pub times: Times,
}

impl Coder {
    /// Chooses steps, origin and windows for Gaussians.
    pub(super) fn of(rows: &[Row], times: Times) -> Self {
        let smallest = |axis: usize| rows.iter().map(|row| row.mean[axis]).reduce(f64::min).unwrap_or_default();
        let mut windows: Vec<(f64, f64)> = rows.iter().map(|row| row.window.into()).collect();
        windows.sort_unstable_by(order);
        windows.dedup();
        Self { steps: steps(rows, times), origin: [0, 1, 2].map(smallest), windows, times }
    }

    /// Returns the attributes of Gaussians as the streams of a chunk.
    ///
    /// # Errors
    /// A number that needs more than 32 bits.
    pub(super) fn streams<'r>(&self, rows: impl Iterator<Item = &'r Row> + Clone) -> fourdgs::Result<Vec<u8>> {
        let mut streams = Vec::new();
        for attribute in op::REQUIRED_ATTRIBUTES {
            let (mut values, mut count) = (Vec::new(), 0);
            for row in rows.clone() {
                self.push(attribute, row, &mut values);
                count += 1;
            }
            let channels = values.len() / usize::max(count, 1);
            streams.extend(encode_stream(attribute, &values, channels, fourdgs::codec::DEFLATE, LEVEL, true)?);
        }
        Ok(streams)
    }

    /// Returns the largest differences of decoded numbers from the originals, by their names in the format.
    pub(super) fn bounds(&self, rows: &[Row]) -> BTreeMap<String, String> {
        let steps = &self.steps;
        let largest = |values: &dyn Fn(&Row) -> [f64; 3]| {
            rows.iter().flat_map(values).fold(0.0_f64, |most, value| most.max(value.abs()))
        };
        let linear = |step: f64, largest: f64| step / 2.0 + SINGLE * largest;
        let shortened = rows.iter().fold(0.0_f64, |most, row| most.max((sigma(row, steps) / row.sigma_t).ln()));
        let bounds = [
            ("pos", linear(steps.pos, largest(&|row| row.mean))),
            ("scale_rel", linear(steps.scale_log, 1.0).exp_m1()),
            ("rot", linear(steps.rot, 1.0)),
            ("rgb", linear(steps.rgb, 1.0)),
            ("alpha", linear(steps.alpha, 1.0)),
            ("motion", linear(steps.motion, largest(&|row| row.velocity))),
            ("time", linear(steps.time, largest(&|row| [row.mean_t; 3]))),
            ("sigma_rel", (linear(steps.sigma_log, 1.0) + shortened).exp_m1()),
            ("sh", 0.0),
        ];
        bounds.into_iter().map(|(name, bound)| (name.to_owned(), format!("{bound:?}"))).collect()
    }

    /// Returns the color of degree 0 as it is decoded.
    pub(super) fn color(&self, row: &Row) -> [f64; 3] {
        self.color_multiples(row).map(|multiple| multiple as f64 * self.steps.rgb)
    }

    /// Returns the first and the last time, in seconds, at which a decoded Gaussian may be visible.
    pub(super) fn life(&self, row: &Row) -> [f64; 2] {
        let mean_t = row.mean_t;
        // The margins are wider than the rounding to steps and to single precision.
        let half = self.times.reach() * row.sigma_t * (1.0 + 1e-5) + 2.0 * self.steps.time + 1e-6 * mean_t.abs();
        let half = if row.never_fades() { f64::INFINITY } else { half };
        [(mean_t - half).max(row.window[0]), (mean_t + half).min(row.window[1])]
    }

    /// Decodes the streams of a chunk of `count` Gaussians.
    ///
    /// # Errors
    /// Streams of another file.
    pub(super) fn decode(&self, streams: &[u8], count: usize) -> fourdgs::Result<DecodedChunk> {
        decode_streams(streams, count, &self.steps, &self.origin, &self.windows, self.times.cutoff)
    }

    /// Appends an attribute of a Gaussian.
    fn push(&self, attribute: u8, row: &Row, to: &mut Vec<i64>) {
        let steps = &self.steps;
        match attribute {
            op::A_POSITION => {
                // The center at the decoded temporal mean: rounding the time does not move the path.
                let step = self.time_step(row);
                let mean = row.center(f64::from((rint(row.mean_t / step) as f64 * step) as f32));
                to.extend([0, 1, 2].map(|axis| rint((mean[axis] - self.origin[axis]) / steps.pos)));
            }
            op::A_SCALE => to.extend(row.log_scale.map(|scale| rint(scale / steps.scale_log))),
            op::A_ROTATION_INDEX => to.push(quantize_rotation(row.rotation, steps.rot).0),
            op::A_ROTATION => to.extend(quantize_rotation(row.rotation, steps.rot).1),
            op::A_COLOR => to.extend(rct_forward(self.color_multiples(row))),
            op::A_OPACITY => to.push(rint(row.opacity / steps.alpha)),
            op::A_MOTION => {
                let step = motion_step(velocity_class(row, steps, self.times), steps.motion);
                to.extend(row.velocity.map(|velocity| rint(velocity / step)));
            }
            op::A_MU_T => to.push(rint(row.mean_t / self.time_step(row))),
            op::A_SIGMA_T => to.push(sigma_multiple(row, steps)),
            op::A_FLAGS => to.push(if row.never_fades() { op::FLAG_NEVER_FADES } else { 0 }),
            _ => to.push(self.window(row)),
        }
    }

    fn time_step(&self, row: &Row) -> f64 {
        mu_step(sigma_multiple(row, &self.steps), self.steps.sigma_log, row.never_fades(), self.steps.time)
    }

    fn color_multiples(&self, row: &Row) -> [i64; 3] {
        row.color.map(|channel| rint(channel.clamp(0.0, 1.0) / self.steps.rgb))
    }

    /// Returns the index of the window of a Gaussian in `windows`.
    fn window(&self, row: &Row) -> i64 {
        self.windows.partition_point(|window| order(window, &row.window.into()).is_lt()) as i64
    }
}

/// Compares two windows.
fn order(a: &(f64, f64), b: &(f64, f64)) -> Ordering {
    a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
}
