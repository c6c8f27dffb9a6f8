//! Checkpoints.
//!
//! In: crafted checkpoints of every model. Out: archives with a right directory and right checksums, and wrong pickles
//! and tensors.

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::archive::{self, Entry};
use crate::change::{bytes, numbers, pickle};
use crate::support::pth::{self, Pth};
use crate::support::random::Random;
use bevy_gs4d::codec::ReadOptions;
use bevy_gs4d::codec::checkpoint;
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// One accepted checkpoint of this many is drawn by the GPU: their Gaussians pass through the same slice as those of
/// packages.
const DRAWN_BY_GPU: u32 = 4;

/// The reader of checkpoints.
pub struct Checkpoints {
    seeds: Vec<Vec<Entry>>,
}

impl Checkpoints {
    /// Makes a seed of every model, with and without an environment map, and one of gsplat.
    pub fn new() -> Self {
        let native = checkpoints().into_iter().map(|pth| pth.bytes());
        Self { seeds: native.chain([gsplat()]).map(|file| entries(&file)).collect() }
    }
}

impl Reader for Checkpoints {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (mut entries, other) = (random.pick(&self.seeds).clone(), random.pick(&self.seeds));
        for _ in 0..=random.below(3) {
            change(&mut entries, other, random);
        }
        let mut file = archive::file(&entries);
        if random.one_in(16) {
            bytes::change(&mut file, &archive::file(other), random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        match checkpoint::read(Cursor::new(bytes), &ReadOptions::default(), None) {
            Ok(scene) => {
                let drawn = crc32fast::hash(bytes).is_multiple_of(DRAWN_BY_GPU);
                accepted::check(scene, if drawn { DrawnBy::CpuAndGpu } else { DrawnBy::Cpu })
            }
            Err(error) => Ok(Outcome::Refused(error.to_string())),
        }
    }
}

/// Returns a checkpoint of the rotated 4D model, one with an environment map and few coefficients, one of the unrotated
/// 4D model, and one of the static model.
pub fn checkpoints() -> Vec<Pth> {
    let rotating = Pth::rotating(5, 48);
    let mut surrounded = Pth::rotating(3, 16);
    surrounded.slots[18] = pth::int(0);
    surrounded.set(17, &[3, 2, 2], (0..12).map(|at| at as f32 / 12.0).collect());
    let mut moving = Pth::rotating(4, 1);
    moving.slots[0] = pth::int(0);
    moving.slots[16] = pth::flag(false);
    moving.slots[18] = pth::int(0);
    let mut still = moving.clone();
    // The state of the 3D model ends with the factor of its rates.
    still.slots[11] = pth::float(5.5);
    still.slots.truncate(12);
    vec![rotating, surrounded, moving, still]
}

/// Returns a checkpoint of gsplat with color of degree 1.
fn gsplat() -> Vec<u8> {
    let shapes: [(&str, &[usize]); 6] = [
        ("means", &[4, 3]),
        ("quats", &[4, 4]),
        ("scales", &[4, 3]),
        ("opacities", &[4]),
        ("sh0", &[4, 1, 3]),
        ("shN", &[4, 3, 3]),
    ];
    let mut pth = Pth { slots: vec![pth::NONE.to_vec()], storages: Vec::new() };
    let mut items = Vec::new();
    for (name, shape) in shapes {
        let values = (0..shape.iter().product()).map(|at: usize| (at as f32 * 0.37).sin() * 0.5).collect();
        pth.set(0, shape, values);
        items.extend([pth::text(name), pth.slots[0].clone()].concat());
    }
    let pickle = [&b"\x80\x02}("[..], &pth::text("splats"), b"}(", &items, b"uu."].concat();
    pth.bytes_with(&pickle)
}

/// Returns the entries of an archive.
fn entries(file: &[u8]) -> Vec<Entry> {
    let mut zip = ZipArchive::new(Cursor::new(file)).expect("a zip archive");
    let count = zip.len();
    let read = |at: usize| {
        let mut entry = zip.by_index(at).expect("an entry");
        let mut body = Vec::new();
        entry.read_to_end(&mut body).expect("a whole entry");
        Entry::new(entry.name().expect("a name").into_owned(), body)
    };
    (0..count).map(read).collect()
}

/// Changes the pickle, the values of a tensor, or the archive.
fn change(entries: &mut Vec<Entry>, other: &[Entry], random: &mut Random) {
    let at = random.below(entries.len());
    match random.below(8) {
        0..=3 => {
            let other = other.iter().find(|entry| is_pickle(entry)).map_or(&[][..], |entry| &entry.body[..]);
            if let Some(entry) = entries.iter_mut().find(|entry| is_pickle(entry)) {
                entry.body = pickle::change(&entry.body, other, random);
            }
        }
        4..=6 => {
            if let Some(entry) = entries.get_mut(at).filter(|entry| entry.name.contains("/data/")) {
                change_values(&mut entry.body, random);
            }
        }
        _ => archive::change(entries, other, random),
    }
}

fn is_pickle(entry: &Entry) -> bool {
    entry.name.ends_with("data.pkl")
}

/// Changes one value of a tensor, a few, or all.
fn change_values(body: &mut [u8], random: &mut Random) {
    let count = body.len() / 4;
    let (first, changed, value) = (random.below(count), *random.pick(&[1, 1, 3, count]), numbers::float(random));
    for four in body.chunks_exact_mut(4).skip(first).take(changed) {
        four.copy_from_slice(&value.to_le_bytes());
    }
}
