//! Files of points to begin a training with.
//!
//! In: points as PLY, binary and as text, of COLMAP, of Nerfies and of `PanopticSports`. Out: files with wrong numbers,
//! names, lengths and structures. Accepted points are finite and have colors.

use super::{Outcome, Reader};
use crate::change::archive::{self, Entry};
use crate::change::{bytes, words};
use crate::support::random::Random;
use bevy_gs4d::internal::offline::dataset::PointCloud;
use bevy_gs4d::scene::Origin;
use std::fs;
use std::path::PathBuf;
use tempfile::TempDir;

/// Number of points of each seed.
const POINTS: u8 = 5;

/// The reader of one kind of file.
pub struct Points {
    _folder: TempDir,
    file: PathBuf,
    seeds: Vec<Vec<u8>>,
}

impl Points {
    /// Makes the seeds of a kind, by the name of the file.
    pub fn new(file: &str) -> Self {
        let seeds = match file {
            "points3D.bin" => vec![binary()],
            "points3D.txt" => vec![text()],
            "points.npy" => vec![npy("<f4", 3), npy(">f8", 3)],
            "init_pt_cld.npz" => vec![npy("<f4", 7), npy(">f8", 7)],
            _ => vec![ply("ascii"), ply("binary_little_endian"), ply("binary_big_endian")],
        };
        let folder = tempfile::tempdir().expect("a temporary folder");
        Self { file: folder.path().join(file), _folder: folder, seeds }
    }
}

impl Reader for Points {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (seed, other) = (random.pick(&self.seeds), random.pick(&self.seeds));
        let mut file = match (std::str::from_utf8(seed), std::str::from_utf8(other)) {
            (Ok(seed), Ok(other)) if !random.one_in(4) => words::change(seed, other, random).into_bytes(),
            _ => seed.clone(),
        };
        if file == *seed || random.one_in(16) {
            bytes::change(&mut file, other, random);
        }
        if self.file.extension().is_some_and(|extension| extension == "npz") {
            return archived(file, random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        fs::write(&self.file, bytes).expect("the folder can be written to");
        match PointCloud::load(&self.file, &Origin::default()) {
            Err(error) => Ok(Outcome::Refused(error.to_string())),
            Ok(PointCloud(points)) => {
                for point in &points {
                    let is_color = |value: f32| (0.0..=1.0).contains(&value);
                    let is_right = point.position.is_finite()
                        && point.time.is_none_or(f32::is_finite)
                        && point.color.is_none_or(|color| color.to_array().into_iter().all(is_color));
                    if !is_right {
                        return Err(format!("has the point {point:?}"));
                    }
                }
                Ok(Outcome::Accepted)
            }
        }
    }
}

/// Returns the archive of an array, with right checksums and lengths but sometimes.
fn archived(array: Vec<u8>, random: &mut Random) -> Vec<u8> {
    let mut entries = vec![Entry::new("data.npy".to_owned(), array)];
    if random.one_in(4) {
        archive::change(&mut entries, &[], random);
    }
    archive::file(&entries)
}

fn binary() -> Vec<u8> {
    let mut bytes = u64::from(POINTS).to_le_bytes().to_vec();
    for point in 0..POINTS {
        bytes.extend(u64::from(point).to_le_bytes());
        bytes.extend([0.5, -1.5, f64::from(point)].into_iter().flat_map(f64::to_le_bytes));
        bytes.extend([10, 20, point]);
        bytes.extend(0.25f64.to_le_bytes());
        bytes.extend(2u64.to_le_bytes());
        bytes.extend([0; 16]);
    }
    bytes
}

fn text() -> Vec<u8> {
    let line = |point: u8| format!("{point} 0.5 -1.5 {point} 10 20 {point} 0.25 1 0 2 7\n");
    let lines: String = (0..POINTS).map(line).collect();
    format!("# points\n{lines}").into_bytes()
}

fn npy(kind: &str, columns: u8) -> Vec<u8> {
    let header = format!("{{'descr': '{kind}', 'fortran_order': False, 'shape': ({POINTS}, {columns}), }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.bytes());
    for value in (0..columns * POINTS).map(f32::from) {
        match kind {
            "<f4" => bytes.extend(value.to_le_bytes()),
            _ => bytes.extend(f64::from(value).to_be_bytes()),
        }
    }
    bytes
}

fn ply(encoding: &str) -> Vec<u8> {
    let header = format!(
        "ply\nformat {encoding} 1.0\nelement vertex {POINTS}\nproperty float x\nproperty float y\nproperty float z\n\
         property uchar red\nproperty uchar green\nproperty uchar blue\nproperty float time\nend_header\n"
    );
    let mut bytes = header.into_bytes();
    for point in 0..POINTS {
        let numbers = [0.5, -1.5, f32::from(point)];
        match encoding {
            "ascii" => bytes.extend(format!("0.5 -1.5 {point} 10 20 {point} 0.125\n").bytes()),
            "binary_little_endian" => {
                bytes.extend(numbers.into_iter().flat_map(f32::to_le_bytes));
                bytes.extend([10, 20, point]);
                bytes.extend(0.125f32.to_le_bytes());
            }
            _ => {
                bytes.extend(numbers.into_iter().flat_map(f32::to_be_bytes));
                bytes.extend([10, 20, point]);
                bytes.extend(0.125f32.to_be_bytes());
            }
        }
    }
    bytes
}
