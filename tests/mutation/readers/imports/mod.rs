//! Files of other makes.
//!
//! In: files of each format, written by the exporters or by hand. Out: the same with changed bytes, changed entries of
//! archives, changed numbers and texts, and changed data behind compression.
//!
//! `seed` changes files by their structure; `exported`, `gltf`, `ply`, `sog`, `tracks` and `others` make them.

mod exported;
mod gltf;
mod others;
mod ply;
mod seed;
mod sog;
mod tracks;

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::archive::{self, Entry};
use crate::support::random::Random;
use bevy_gs4d::codec::CodecErrorKind;
use bevy_gs4d::internal::codec::{read_beside, read_bytes, read_frames};
use bevy_gs4d::scene::GaussianScene;
use exported::exported;
use seed::Seed;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use zip::ZipArchive;

/// The reader of one format.
pub struct Imports {
    path: PathBuf,
    read: Read,
    seeds: Vec<Seed>,
}

/// What an input is.
#[derive(Clone, Copy)]
enum Read {
    /// A file.
    File,
    /// A zip archive of a folder, in which the file of this name is read.
    Beside(&'static str),
    /// A zip archive of the files of a sequence.
    Frames,
}

impl Imports {
    /// Makes the reader of the kind of this name, and checks that every seed is accepted.
    pub fn new(name: &'static str) -> Self {
        let (extension, read, files) = match name {
            "ply" => ("ply", Read::File, [ply::still(), exported("ply", &[0, 1, 3])].concat()),
            "moving-ply" => ("ply", Read::File, ply::moving()),
            "free-time" => ("ply", Read::File, exported("free-time", &[0, 1])),
            "spacetime" => ("ply", Read::File, vec![ply::spacetime()]),
            "compressed-ply" => ("ply", Read::File, vec![ply::compressed(0), ply::compressed(9)]),
            "ply4d" => ("ply4d", Read::File, vec![ply::native(1), ply::native(32)]),
            "sequence" => ("", Read::Frames, vec![ply::sequence()]),
            "splat" => ("splat", Read::File, exported("splat", &[0])),
            "ksplat" => ("ksplat", Read::File, [0, 1, 2].map(others::ksplat).to_vec()),
            "splatv" => ("splatv", Read::File, vec![others::splatv(1.0), others::splatv(0.0)]),
            "npz" => ("npz", Read::File, vec![others::npz()]),
            "4dgs" => ("4dgs", Read::File, [exported("4dgs", &[0, 1]), vec![tracks::file()]].concat()),
            "sog" => ("sog", Read::File, [exported("sog", &[0, 1]), vec![sog::first()]].concat()),
            "sogst" => ("sogst", Read::File, [exported("sogst", &[0, 1]), vec![sog::curved()]].concat()),
            "sog4d" => ("sog4d", Read::File, sog::sog4d()),
            "tsog" => ("tsog", Read::File, sog::tsog()),
            "streamed-sog" => ("json", Read::Beside("lod-meta.json"), vec![sog::streamed()]),
            "spz" => ("spz", Read::File, exported("spz", &[0, 1])),
            "glb" => ("glb", Read::File, gltf::files()),
            "gltf" => ("gltf", Read::File, gltf::files()),
            _ => panic!("{name} is no kind of import"),
        };
        let mut seeds: Vec<Seed> = files.into_iter().map(Seed::of).collect();
        match name {
            "spz" => seeds.extend(seeds.iter().flat_map(Seed::other_versions).collect::<Vec<_>>()),
            "gltf" => seeds = seeds.into_iter().map(Seed::into_text).collect(),
            _ => {}
        }
        let all = Self { path: Path::new("a").with_extension(extension), read, seeds };
        for (number, seed) in all.seeds.iter().enumerate() {
            if let Err(error) = all.scene(&seed.file()) {
                panic!("seed {number} of {name} is accepted: {error}");
            }
        }
        all
    }

    /// Reads an input: the scene, and what it does not show.
    fn scene(&self, bytes: &[u8]) -> Result<(GaussianScene, Vec<String>), CodecErrorKind> {
        match self.read {
            Read::File => read_bytes(&self.path, bytes),
            Read::Frames => read_frames(unpacked(bytes)),
            Read::Beside(name) => {
                let mut files = unpacked(bytes);
                let at = files.iter().position(|(found, _)| found == name);
                let (_, main) = at.map(|at| files.swap_remove(at)).unwrap_or_default();
                read_beside(&self.path, &main, files)
            }
        }
    }
}

impl Reader for Imports {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let other = random.pick(&self.seeds).file();
        random.pick(&self.seeds).changed(&other, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        match self.scene(bytes) {
            Ok((scene, lost)) => {
                if let Some(sentence) = lost.iter().find(|sentence| sentence.chars().any(char::is_control)) {
                    return Err(format!("states a control character: {sentence:?}"));
                }
                accepted::check(scene, DrawnBy::Cpu)
            }
            Err(error) => Ok(Outcome::Refused(error.to_string())),
        }
    }
}

/// Returns the files in an archive that can be unpacked.
fn unpacked(bytes: &[u8]) -> Vec<(String, Vec<u8>)> {
    let Ok(mut zip) = ZipArchive::new(Cursor::new(bytes)) else { return Vec::new() };
    (0..zip.len())
        .filter_map(|at| {
            let mut entry = zip.by_index(at).ok()?;
            let mut body = Vec::new();
            std::io::Read::read_to_end(&mut entry, &mut body).ok()?;
            Some((entry.name().ok()?.into_owned(), body))
        })
        .collect()
}

/// Returns the archive of files.
fn packed(files: Vec<(String, Vec<u8>)>) -> Vec<u8> {
    let entries: Vec<Entry> = files.into_iter().map(|(name, body)| Entry::new(name, body)).collect();
    archive::file(&entries)
}

/// Returns values that differ from each other, around 0.
fn value(at: usize) -> f32 {
    (at as f32 * 0.37).sin() * 0.5
}
