//! A `.4dgs` file with windows of time and an object that moves.
//!
//! In: nothing. Out: the bytes of the file, without the checksum of its summary.

use super::value;
use fourdgs::{GaussianSet, SceneExtras, WriteOptions, write_to_vec};

/// Gaussians of the file, and its seconds.
const COUNT: u32 = 12;
const SECONDS: f32 = 3.0;
/// The type of the record of a track.
const TRACK: u8 = 0x25;

/// Returns the file.
pub fn file() -> Vec<u8> {
    let mut set = GaussianSet { sh_coefficients: 3, sh_degree: 1, ..GaussianSet::default() };
    for index in 0..COUNT {
        let at = index as usize * 13;
        set.positions.extend([0, 1, 2].map(|axis| value(at + axis)));
        set.scales.extend([0.02, 0.03, 0.05]);
        set.rotations.extend([0.0, 0.6, 0.0, 0.8]);
        set.colors.extend([0.25, 0.5, 0.75, 0.8]);
        set.motions.extend([3, 4, 5].map(|axis| value(at + axis)));
        set.mu_t.push(index as f32 * 0.25);
        set.sigma_t.push(if index % 4 == 0 { f32::INFINITY } else { 0.4 });
        let first = (index % 3) as f32;
        set.win_lo.push(first);
        set.win_hi.push(first + 1.0);
        set.sh.get_or_insert_default().extend((0..9).map(|number| (index * 20 + number) as u8));
    }
    set.object_id = Some((0..COUNT).map(|index| index % 2).collect());
    let mut track: Vec<u8> = [&1u32.to_le_bytes()[..], &[0], &2u32.to_le_bytes()].concat();
    for sample in [[0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], [3.0, 0.0, 0.6, 0.0, 0.8, 1.0, 0.5, -1.0]] {
        track.extend(sample.into_iter().flat_map(f64::to_le_bytes));
    }
    let record = [&[TRACK][..], &(track.len() as u64).to_le_bytes(), &track].concat();
    let options = WriteOptions { extra_records: vec![record], write_crc: false, ..WriteOptions::default() };
    write_to_vec(&set, f64::from(SECONDS), &options, &SceneExtras::default()).expect("a scene that can be written")
}
