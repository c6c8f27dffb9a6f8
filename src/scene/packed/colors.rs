//! Colors coded by codebooks: a DC coefficient for each Gaussian, and the others as a sum of entries, one from each of
//! up to four codebooks.
//!
//! In: DC coefficients, and codebooks with a code for every Gaussian. Out: [`CodedColors`], the words that the GPU
//! reads; and the coefficients decoded from them. `offline::compress::codebook` trains the codebooks.

use super::additional_bits::additional_bits;
use super::codebooks::ColorCodebooks;
use super::lanes::{self, BASE_MAX, COLOR_WORDS, MAX_ENTRIES, MAX_STAGES};
use crate::gaussian::harmonics::BRIGHTEST;
use crate::gaussian::{Harmonics, harmonics};
use glam::Vec3;
use half::f16;
use rayon::prelude::*;
use std::sync::Arc;

/// Usual size of the range of DC coefficients. A larger range has more bits. Trained captures have 5 to 10.
const BASES: f32 = 16.0;

/// Colors coded by codebooks.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CodedColors {
    /// Spatial degree evaluated, 0 to 3.
    pub degree: u32,
    /// Time degree evaluated, 0 to 2.
    pub degree_t: u32,
    /// One record for each Gaussian: the DC coefficient (10 bits for each channel), then four codes of 16 bits.
    pub records: Vec<[u32; COLOR_WORDS]>,
    /// The codebooks, with [`words_per_entry`](Self::words_per_entry) words for each entry. Scenes may share them.
    pub codebooks: Arc<ColorCodebooks>,
}

impl CodedColors {
    /// Returns the number of coefficients per Gaussian and channel: 1, 4, 9, 16, 32 or 48.
    pub fn coefficients(&self) -> usize {
        harmonics::evaluated(self.degree, self.degree_t)
    }

    /// Returns the number of words of one entry of a codebook.
    pub fn words_per_entry(&self) -> usize {
        (self.coefficients() * 3).div_ceil(4)
    }

    /// Returns the bytes in memory.
    pub fn size(&self) -> usize {
        size_of_val(self.records.as_slice()) + self.codebooks.size()
    }

    /// Creates colors of these degrees, without codebooks, from the DC coefficient of each Gaussian, RGB, quantized to
    /// `bits` bits for each channel, 1 to 10; a large range has more, up to 10. Also returns the range (low, high) of
    /// the DC coefficients.
    pub fn of_base(degree: u32, degree_t: u32, base: &[[f32; 3]], bits: u32) -> (Self, [f32; 2]) {
        let values = base.as_flattened().iter();
        let (low, high) = values.fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &v| (l.min(v), h.max(v)));
        let (low, size) = if low > high { (0.0, 0.0) } else { (low, high - low) };
        // With fewer bits, a subset of the 1024 values is used, with the first and the last value.
        let bits = bits.saturating_add(additional_bits(f64::from(size), f64::from(BASES))).clamp(1, 10);
        let levels = ((1u32 << bits) - 1) as f32;
        let place = |value: f32| {
            let level = if size > 0.0 { ((value - low) / size * levels).round() } else { 0.0 };
            (level * (BASE_MAX / levels)).round() as u32
        };
        let records = base.iter().map(|&rgb| lanes::pack_base(rgb.map(place))).collect();
        (Self { degree, degree_t, records, ..Self::default() }, [low, low + size])
    }

    /// Adds a codebook. A row holds every coefficient but the DC coefficient, RGB innermost: `entries` are rows of
    /// signed bytes, one after the other, `scales` is one row with the values of a byte of 127, and `codes` has the
    /// entry of each Gaussian.
    ///
    /// # Panics
    /// If there are four codebooks already, or if `scales` is empty or longer than a row.
    pub fn push_codebook(&mut self, entries: &[i8], scales: &[f32], codes: &[u16]) {
        let words = self.words_per_entry();
        let (rows, codebooks) = (entries.chunks_exact(scales.len()), Arc::make_mut(&mut self.codebooks));
        let stage = codebooks.entries.len();
        codebooks.entries.push(rows.len() as u32);
        for row in rows {
            let fours = padded(row, words);
            codebooks.words.extend(fours.iter().map(|&four| u32::from_le_bytes(four.map(i8::cast_unsigned))));
        }
        codebooks.scales.extend(padded(scales, words));
        for (record, &code) in self.records.iter_mut().zip(codes) {
            lanes::pack_code(record, stage, code);
        }
    }

    /// Returns the code of a Gaussian in the codebook with the index `stage`.
    ///
    /// # Panics
    /// If `index` or `stage` is out of range.
    pub fn code(&self, index: usize, stage: usize) -> u32 {
        lanes::unpack_code(self.records[index], stage)
    }

    /// Returns the colors of the Gaussians at these indices, in this order, with the same codebooks.
    ///
    /// # Panics
    /// If an index is out of range.
    pub(super) fn select(&self, keep: &[u32]) -> Self {
        let records = keep.iter().map(|&index| self.records[index as usize]).collect();
        Self { records, codebooks: self.codebooks.clone(), ..*self }
    }

    /// Returns the sum of a Gaussian's entries in all codebooks, RGB innermost, padded to whole words. The codebooks
    /// written here have 0 in place of the DC coefficient; other values there are added to the DC coefficient.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn rest(&self, index: usize) -> Vec<f32> {
        let words = self.words_per_entry();
        let mut rest = vec![0.0; words * 4];
        let mut first = 0;
        for (stage, &entries) in self.codebooks.entries.iter().enumerate() {
            let entry = (first + self.code(index, stage) as usize) * words;
            let scales = &self.codebooks.scales[stage * words..][..words];
            for ((four, &word), scale) in rest.chunks_exact_mut(4).zip(&self.codebooks.words[entry..]).zip(scales) {
                for (value, add) in four.iter_mut().zip(Self::values(word, scale)) {
                    *value += add.to_f32();
                }
            }
            first += entries as usize;
        }
        rest
    }

    /// Returns the values of the four bytes of a word of an entry; `scale` is the value of a byte of 127. They have
    /// half precision, which is finer than the bytes; a GPU stores them, and does not compute them for each color.
    pub fn values(word: u32, scale: &[f32; 4]) -> [f16; 4] {
        let bytes = word.to_le_bytes();
        std::array::from_fn(|i| {
            let value = f32::from(bytes[i].cast_signed()) * (scale[i] / 127.0);
            f16::from_f32(value.clamp(f16::MIN.to_f32(), f16::MAX.to_f32()))
        })
    }

    /// Returns the words of each entry of all codebooks, with their scales.
    pub fn all_entries(&self) -> impl Iterator<Item = (&[u32], &[[f32; 4]])> {
        let (words, codebooks) = (self.words_per_entry(), &*self.codebooks);
        let stages = codebooks.entries.iter().enumerate();
        let scales = stages.flat_map(move |(stage, &count)| {
            std::iter::repeat_n(&codebooks.scales[stage * words..][..words], count as usize)
        });
        codebooks.words.chunks_exact(words).zip(scales)
    }

    /// Returns the DC coefficient of a Gaussian; `low` and `size` are its range.
    fn base(&self, index: usize, [low, size]: [f32; 2]) -> Vec3 {
        Vec3::from(lanes::unpack_base(self.records[index]).map(|place| low + place as f32 / BASE_MAX * size))
    }

    /// Returns the color of one Gaussian, whose DC coefficient is in the range `base`; see [`Harmonics::color`].
    pub(super) fn color(&self, index: usize, base: [f32; 2], direction: Vec3, tau: f32, time_span: f32) -> Vec3 {
        let basis = harmonics::basis(direction);
        let rest = self.rest(index);
        let block = |first: usize, count: usize| {
            (0..count).fold(Vec3::ZERO, |sum, k| sum + basis[k] * Vec3::from_slice(&rest[(first + k) * 3..]))
        };
        let mut color = self.base(index, base) * basis[0] + block(0, (self.degree as usize + 1).pow(2));
        if self.degree == 3 {
            for n in 1..=self.degree_t as usize {
                color += harmonics::time_cosine(n, tau, time_span) * block(16 * n, 16);
            }
        }
        (color + 0.5).max(Vec3::ZERO).min(Vec3::splat(BRIGHTEST))
    }

    /// Returns all coefficients of all Gaussians, whose DC coefficients are in the range `base`.
    pub(super) fn harmonics(&self, base: [f32; 2]) -> Harmonics {
        let coefficients = self.coefficients();
        let mut values = Vec::with_capacity(self.records.len() * coefficients * 3);
        for index in 0..self.records.len() {
            let rest = self.rest(index);
            values.extend((self.base(index, base) + Vec3::from_slice(&rest)).to_array());
            values.extend_from_slice(&rest[3..coefficients * 3]);
        }
        Harmonics { coefficients, degree: self.degree, degree_t: self.degree_t, values }
    }

    /// Checks that the parts fit together for `count` Gaussians and every code has an entry.
    pub(super) fn check(&self, count: usize) -> Result<(), &'static str> {
        if self.degree > 3 || self.degree_t > 2 {
            return Err("a degree of color that does not exist");
        }
        let (words, ColorCodebooks { entries, words: all, scales }) = (self.words_per_entry(), &*self.codebooks);
        let total: u64 = entries.iter().map(|&entries| u64::from(entries)).sum();
        if self.records.len() != count {
            return Err("its colors are those of another number of Gaussians");
        }
        if entries.len() > MAX_STAGES || entries.iter().any(|&entries| entries > MAX_ENTRIES) {
            return Err("more codebooks, or more entries in one, than a record has codes for");
        }
        if all.len() as u64 != total * words as u64 || scales.len() != words * entries.len() {
            return Err("the codebooks do not have the size that their entries need");
        }
        if !scales.as_flattened().iter().all(|value| value.is_finite()) {
            return Err("a scale of a codebook that is not finite");
        }
        let fits = |&record: &[u32; COLOR_WORDS]| {
            entries.iter().enumerate().all(|(stage, &entries)| lanes::unpack_code(record, stage) < entries)
        };
        if self.records.par_iter().all(fits) { Ok(()) } else { Err("a code beyond its codebook") }
    }

    /// Lowers the degrees to at most the degrees given and removes the coefficients that are no longer evaluated from
    /// the codebooks. At degree 0 the codebooks would be empty, and are removed too.
    pub fn truncate(&mut self, degree: u32, degree_t: u32) {
        let (all, before) = (self.coefficients(), self.words_per_entry());
        self.degree = self.degree.min(degree);
        self.degree_t = if self.degree == 3 { self.degree_t.min(degree_t) } else { 0 };
        let (kept, after) = (self.coefficients(), self.words_per_entry());
        if kept == all {
            return;
        }
        if kept == 1 {
            self.codebooks = Arc::default();
            self.records.iter_mut().for_each(|record| record[1..].fill(0));
            return;
        }
        // The unused bytes of the last word of an entry are 0.
        let used = 4 - (after * 4 - kept * 3);
        let codebooks = Arc::make_mut(&mut self.codebooks);
        let mut entries = Vec::with_capacity(codebooks.words.len() / before * after);
        for entry in codebooks.words.chunks_exact(before) {
            entries.extend_from_slice(&entry[..after - 1]);
            entries.push(entry[after - 1] & u32::MAX >> (8 * (4 - used)));
        }
        let mut scales = Vec::with_capacity(codebooks.scales.len() / before * after);
        for row in codebooks.scales.chunks_exact(before) {
            scales.extend_from_slice(&row[..after]);
            if let Some(last) = scales.last_mut() {
                last[used..].fill(0.0);
            }
        }
        (codebooks.words, codebooks.scales) = (entries, scales);
    }
}

/// Returns a row after a DC coefficient of 0, padded to whole words.
fn padded<T: Copy + Default>(row: &[T], words: usize) -> Vec<[T; 4]> {
    let mut fours = vec![[T::default(); 4]; words];
    fours.as_flattened_mut()[3..][..row.len()].copy_from_slice(row);
    fours
}
