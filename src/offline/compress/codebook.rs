//! Residual vector quantization of color: each codebook codes the residuals of the previous codebooks.
//!
//! In: rows of coefficients and a weight for each row. Out: [`Centers`], with a code into each codebook for every row,
//! and the same entries as [`Codebooks`] of signed bytes. Seeds of k-means++ are refined by Lloyd's steps on a sample;
//! once every row has its codes, all entries are fitted again to all rows. The result does not depend on the number of
//! threads.

use ndarray::{Array1, Array2, ArrayView2, Axis, s};
use rayon::prelude::*;

/// Largest number of rows that a codebook is trained on.
const SAMPLE: usize = 24_576;
/// Number of Lloyd's steps.
const STEPS: usize = 8;
/// Number of times that all entries are fitted again to the residuals of their rows, which gains 0.4 to 0.6 dB without
/// any bytes.
const REFITS: usize = 2;
/// Rows assigned at a time.
const BLOCK: usize = 512;
/// Largest number of seeds drawn at a time: distances to many seeds are computed much faster together.
const SEEDS: usize = 64;

/// Codebooks whose entries add up, in single precision.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Centers {
    /// The entries of each codebook: rows.
    pub entries: Vec<Array2<f32>>,
    /// For each codebook, the index of the entry of every row of the input.
    pub codes: Vec<Vec<u32>>,
}

/// Codebooks whose entries add up, as bytes.
#[derive(Debug, Clone, Default)]
pub struct Codebooks {
    /// The entries of each codebook: rows of signed bytes.
    pub entries: Vec<Array2<i8>>,
    /// The value of a byte of 127, for each column of each codebook.
    pub scales: Vec<Array1<f32>>,
    /// For each codebook, the index of the entry of every row of the input.
    pub codes: Vec<Vec<u16>>,
}

impl Centers {
    /// Trains one codebook after another over `data`, rows × columns, with these numbers of entries (at most 65,536
    /// each). `weights` has a weight for each row, not negative. Calls `done` after each codebook.
    ///
    /// # Panics
    /// If there are fewer weights than rows.
    pub fn train(mut data: Array2<f32>, weights: &[f32], entries: &[usize], mut done: impl FnMut()) -> Self {
        // From here on, `data` contains the residuals of the rows.
        let mut stages: Vec<(Array2<f32>, Vec<u32>)> = Vec::new();
        for (stage, &count) in entries.iter().enumerate() {
            let count = count.min(data.nrows()).clamp(1, 1 << 16);
            if data.nrows() == 0 {
                break;
            }
            let centers = centers(&data, weights, count, 0x9E37_79B9 + stage as u64);
            let codes = assign(data.view(), &centers);
            subtract(&mut data, &centers, &codes);
            stages.push((centers, codes));
            done();
        }
        for _ in 0..REFITS {
            for (centers, codes) in &mut stages {
                let (left, _) = means(data.view(), weights, codes, centers.nrows());
                subtract(&mut data, &left, codes);
                *centers += &left;
            }
        }
        let (entries, codes) = stages.into_iter().unzip();
        Self { entries, codes }
    }

    /// Returns the entries as bytes.
    pub fn quantized(&self) -> Codebooks {
        let mut books = Codebooks::default();
        for (centers, codes) in self.entries.iter().zip(&self.codes) {
            let scales = centers.fold_axis(Axis(0), 0.0f32, |most, value| most.max(value.abs()));
            let scaled = |value: f32, scale: f32| if scale > 0.0 { (value / scale * 127.0).round() as i8 } else { 0 };
            let mut bytes = Array2::zeros(centers.raw_dim());
            for (mut to, from) in bytes.rows_mut().into_iter().zip(centers.rows()) {
                ndarray::Zip::from(&mut to).and(from).and(&scales).for_each(|to, &v, &scale| *to = scaled(v, scale));
            }
            books.entries.push(bytes);
            books.scales.push(scales);
            books.codes.push(codes.iter().map(|&code| code as u16).collect());
        }
        books
    }
}

/// Subtracts the entry of its code from every row.
fn subtract(data: &mut Array2<f32>, centers: &Array2<f32>, codes: &[u32]) {
    data.axis_iter_mut(Axis(0)).into_par_iter().zip(codes).for_each(|(mut row, &code)| {
        row -= &centers.row(code as usize);
    });
}

/// Returns the weighted mean of the rows of each code, zero if the sum of their weights is zero, and that sum.
fn means(data: ArrayView2<'_, f32>, weights: &[f32], codes: &[u32], count: usize) -> (Array2<f32>, Vec<f64>) {
    let mut sums = Array2::<f64>::zeros((count, data.ncols()));
    let mut totals = vec![0.0f64; count];
    for ((row, &code), &weight) in data.rows().into_iter().zip(codes).zip(weights) {
        let weight = f64::from(weight);
        totals[code as usize] += weight;
        let mut sum = sums.row_mut(code as usize);
        ndarray::Zip::from(&mut sum).and(row).for_each(|sum, &value| *sum += weight * f64::from(value));
    }
    for (mut sum, &total) in sums.rows_mut().into_iter().zip(&totals) {
        if total > 0.0 {
            sum.mapv_inplace(|sum| sum / total);
        }
    }
    (sums.mapv(|mean| mean as f32), totals)
}

/// Returns the nearest center of every row.
fn assign(data: ArrayView2<'_, f32>, centers: &Array2<f32>) -> Vec<u32> {
    nearest_centers(data, centers).into_iter().map(|(index, _)| index).collect()
}

/// Returns the nearest center c of every row x, and `x·c − |c|²/2`.
fn nearest_centers(data: ArrayView2<'_, f32>, centers: &Array2<f32>) -> Vec<(u32, f32)> {
    let half_norms: Vec<f32> = centers.rows().into_iter().map(|center| 0.5 * center.dot(&center)).collect();
    let transposed = centers.t().as_standard_layout().into_owned();
    data.axis_chunks_iter(Axis(0), BLOCK)
        .into_par_iter()
        .flat_map_iter(|block| {
            // |x − c|² is smallest where x·c − |c|²/2 is largest.
            let products = block.dot(&transposed);
            products.rows().into_iter().map(|row| nearest(row.iter().copied(), &half_norms)).collect::<Vec<_>>()
        })
        .collect()
}

fn nearest(products: impl Iterator<Item = f32>, half_norms: &[f32]) -> (u32, f32) {
    let (mut best, mut most) = (0, f32::NEG_INFINITY);
    for (index, (product, half_norm)) in products.zip(half_norms).enumerate() {
        if product - half_norm > most {
            (best, most) = (index as u32, product - half_norm);
        }
    }
    (best, most)
}

/// Returns centers by k-means over a sample of the rows.
fn centers(data: &Array2<f32>, weights: &[f32], count: usize, seed: u64) -> Array2<f32> {
    let mut random = Random(seed);
    let (sample, weights) = sample(data, weights, &mut random);
    let mut centers = seeds(&sample, &weights, count, &mut random);
    for _ in 0..STEPS {
        let codes = assign(sample.view(), &centers);
        let (means, totals) = means(sample.view(), &weights, &codes, count);
        for (index, total) in totals.into_iter().enumerate() {
            // A center without rows does not move.
            if total > 0.0 {
                centers.row_mut(index).assign(&means.row(index));
            }
        }
    }
    centers
}

/// Returns rows to train on with their weights: all rows, or a random row of each of [`SAMPLE`] equal ranges.
fn sample(data: &Array2<f32>, weights: &[f32], random: &mut Random) -> (Array2<f32>, Vec<f32>) {
    let rows = data.nrows();
    if rows <= SAMPLE {
        return (data.clone(), weights.to_vec());
    }
    let chosen: Vec<usize> = (0..SAMPLE)
        .map(|i| {
            let (first, last) = (i * rows / SAMPLE, (i + 1) * rows / SAMPLE);
            first + (random.unit() * (last - first) as f64) as usize
        })
        .collect();
    (data.select(Axis(0), &chosen), chosen.iter().map(|&row| weights[row]).collect())
}

/// Returns seeds by k-means++: each seed is drawn by weight times squared distance to the previous seeds. Many seeds
/// are drawn in groups; distances between the seeds of a group are ignored.
fn seeds(sample: &Array2<f32>, weights: &[f32], count: usize, random: &mut Random) -> Array2<f32> {
    let mut seeds = Array2::zeros((count, sample.ncols()));
    let group = (count / 32).clamp(1, SEEDS);
    let norms: Vec<f32> = sample.rows().into_iter().map(|row| row.dot(&row)).collect();
    let mut distances = vec![f32::INFINITY; sample.nrows()];
    let mut odds = weights.to_vec();
    for first in (0..count).step_by(group) {
        let last = count.min(first + group);
        for index in first..last {
            let chosen = draw(odds.iter().copied(), random);
            odds[chosen] = 0.0;
            seeds.row_mut(index).assign(&sample.row(chosen));
        }
        let nearest = nearest_centers(sample.view(), &seeds.slice(s![first..last, ..]).to_owned());
        for (row, (_, score)) in nearest.into_iter().enumerate() {
            distances[row] = distances[row].min((norms[row] - 2.0 * score).max(0.0));
            odds[row] = distances[row] * weights[row];
        }
    }
    seeds
}

/// Returns an index, drawn by weight; 0 if all weights are zero.
fn draw(weights: impl Iterator<Item = f32> + Clone, random: &mut Random) -> usize {
    let total: f64 = weights.clone().map(f64::from).sum();
    let mut left = random.unit() * total;
    for (index, weight) in weights.enumerate() {
        left -= f64::from(weight);
        if left < 0.0 {
            return index;
        }
    }
    0
}

/// SplitMix64.
struct Random(u64);

impl Random {
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn data(rows: usize, columns: usize) -> Array2<f32> {
        let mut random = Random(7);
        Array2::from_shape_fn((rows, columns), |(row, _)| (row % 13) as f32 + random.unit() as f32 * 0.3)
    }

    fn error(data: &Array2<f32>, books: &Codebooks) -> f64 {
        let mut left = data.clone();
        for stage in 0..books.codes.len() {
            for (mut row, &code) in left.rows_mut().into_iter().zip(&books.codes[stage]) {
                let entry = books.entries[stage].row(code as usize).mapv(f32::from) * &books.scales[stage] / 127.0;
                row -= &entry;
            }
        }
        left.iter().map(|v| f64::from(v * v)).sum::<f64>() / left.len() as f64
    }

    #[test]
    fn every_further_codebook_lowers_the_error() {
        let data = data(3_000, 9);
        let weights = vec![1.0; 3_000];
        let errors: Vec<f64> = (1..=3)
            .map(|n| error(&data, &Centers::train(data.clone(), &weights, &vec![16; n], || {}).quantized()))
            .collect();
        assert!(errors[0] < 0.02, "sixteen entries find thirteen clusters: {errors:?}");
        assert!(
            errors[1] < 0.9 * errors[0] && errors[2] < 0.9 * errors[1],
            "further codebooks code the residuals: {errors:?}"
        );
    }

    #[test]
    fn training_is_the_same_on_every_run() {
        let weights: Vec<f32> = (0..2_000).map(|i| (i % 5) as f32).collect();
        let train = || Centers::train(data(2_000, 12), &weights, &[32, 32], || {}).quantized();
        let (a, b) = (train(), train());
        assert!(
            a.codes == b.codes && a.entries == b.entries && a.scales == b.scales,
            "both runs give the same codebooks"
        );
    }

    #[test]
    fn rows_of_more_weight_fit_better() {
        let data = data(2_600, 6);
        let heavy = |row: usize| row % 13 == 4;
        let weights: Vec<f32> = (0..2_600).map(|row| if heavy(row) { 100.0 } else { 0.01 }).collect();
        let books = Centers::train(data.clone(), &weights, &[4], || {}).quantized();
        let mut errors = [0.0, 0.0];
        for (row, &code) in books.codes[0].iter().enumerate() {
            let entry = books.entries[0].row(code as usize).mapv(f32::from) * &books.scales[0] / 127.0;
            let apart = &data.row(row) - &entry;
            errors[usize::from(heavy(row))] += f64::from(apart.dot(&apart)) / if heavy(row) { 200.0 } else { 2_400.0 };
        }
        assert!(errors[1] < 0.2 * errors[0], "the heavy cluster has an entry of its own: {errors:?}");
    }

    #[test]
    fn no_rows_and_equal_rows_are_coded() {
        let none = Centers::train(Array2::zeros((0, 5)), &[], &[8, 8], || {}).quantized();
        assert!(none.codes.is_empty(), "no rows give no codebook");
        let equal = Centers::train(Array2::zeros((3, 5)), &[0.0; 3], &[8], || {}).quantized();
        assert!(
            equal.codes[0].len() == 3 && equal.entries[0].nrows() == 3,
            "a codebook has at most one entry for each row"
        );
    }
}
