//! Files of other makes.
//!
//! In: files of each format, written by the exporters or by hand. Out: the same with changed bytes, changed entries of archives, and changed data behind
//! compression.

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::archive::{self, Entry};
use crate::change::{bytes, text};
use crate::support::packed_scene;
use crate::support::random::Random;
use bevy_gs4d::internal::codec::export::{Export, Exporter};
use bevy_gs4d::internal::codec::read_bytes;
use bevy_gs4d::scene::GaussianScene;
use flate2::Compression;
use flate2::read::GzDecoder;
use flate2::write::GzEncoder;
use half::f16;
use std::io::{Cursor, Read, Write};
use std::path::PathBuf;
use zip::ZipArchive;

/// The reader of one format.
pub struct Imports {
    path: PathBuf,
    seeds: Vec<Seed>,
}

/// A file, and how it is changed.
enum Seed {
    Bytes(Vec<u8>),
    /// A header as text, then bytes.
    Headed(String, Vec<u8>),
    /// Bytes in gzip.
    Zipped(Vec<u8>),
    Archive(Vec<Entry>),
}

impl Seed {
    fn of(file: Vec<u8>) -> Self {
        if file.starts_with(b"PK\x03\x04") {
            return Self::Archive(entries(&file));
        }
        if file.starts_with(b"ply\n") {
            const END: &[u8] = b"end_header\n";
            let end = file.windows(END.len()).position(|window| window == END).expect("a header") + END.len();
            let header = String::from_utf8(file[..end].to_vec()).expect("text");
            return Self::Headed(header, file[end..].to_vec());
        }
        if file.starts_with(&[0x1f, 0x8b]) {
            let mut inner = Vec::new();
            GzDecoder::new(&file[..]).read_to_end(&mut inner).expect("whole gzip");
            return Self::Zipped(inner);
        }
        Self::Bytes(file)
    }

    fn file(&self) -> Vec<u8> {
        match self {
            Self::Bytes(file) => file.clone(),
            Self::Headed(header, body) => [header.as_bytes(), body].concat(),
            Self::Zipped(inner) => gzip(inner),
            Self::Archive(entries) => archive::file(entries),
        }
    }

    fn changed(&self, other: &[u8], random: &mut Random) -> Vec<u8> {
        let mut file = match self {
            Self::Bytes(file) => return change(file.clone(), other, random),
            Self::Headed(header, body) => {
                let header = if random.one_in(2) { text::change(header, header, random) } else { header.clone() };
                let body = if random.one_in(2) { change(body.clone(), other, random) } else { body.clone() };
                [header.as_bytes(), &body].concat()
            }
            Self::Zipped(inner) => gzip(&change(inner.clone(), other, random)),
            Self::Archive(entries) => {
                let mut entries = entries.clone();
                for _ in 0..=random.below(2) {
                    let at = random.below(entries.len());
                    match (random.below(4), entries.get_mut(at)) {
                        (0, _) | (_, None) => archive::change(&mut entries, &[], random),
                        (1, Some(entry)) => bytes::change(&mut entry.body, other, random),
                        (_, Some(_)) => change_json(&mut entries, random),
                    }
                }
                archive::file(&entries)
            }
        };
        if random.one_in(16) {
            file = change(file, other, random);
        }
        file
    }
}

impl Imports {
    /// Makes the reader of the files with this extension.
    pub fn new(extension: &'static str) -> Self {
        let mut seeds = match extension {
            "npz" => vec![npz()],
            "splatv" => vec![splatv(1.0), splatv(0.0)],
            "ply" => vec![spacetime(), compressed()],
            _ => Vec::new(),
        };
        for id in exports(extension) {
            seeds.extend([0, 1].map(|degree| exported(id, degree)));
        }
        Self { path: PathBuf::from(format!("a.{extension}")), seeds: seeds.into_iter().map(Seed::of).collect() }
    }
}

impl Reader for Imports {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let other = random.pick(&self.seeds).file();
        let seed = &self.seeds[random.below(self.seeds.len())];
        seed.changed(&other, random)
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        match read_bytes(&self.path, bytes) {
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

/// Returns the exports whose files have this extension in the end.
fn exports(extension: &str) -> &'static [&'static str] {
    match extension {
        "ply" => &["ply", "free-time"],
        "splat" => &["splat"],
        "4dgs" => &["4dgs"],
        "sog" => &["sog", "sogst"],
        "spz" => &["spz"],
        "glb" => &["gltf"],
        _ => &[],
    }
}

fn exported(id: &str, degree: u32) -> Vec<u8> {
    let scene = GaussianScene::from(packed_scene::scene(20, degree, 0));
    let format = Export::of_id(id).unwrap_or_else(|| panic!("{id} is an export"));
    let exporter = Exporter::new(scene, format, 30.0).expect("a scene that can be exported");
    let mut file = Vec::new();
    exporter.write(0.5, &mut file).expect("memory can be written to");
    file
}

fn change(mut file: Vec<u8>, other: &[u8], random: &mut Random) -> Vec<u8> {
    bytes::change(&mut file, other, random);
    file
}

/// Changes the text of an entry in JSON, or the bytes of another entry if there is none.
fn change_json(entries: &mut [Entry], random: &mut Random) {
    let at = random.below(entries.len());
    let found = entries.iter().position(|entry| entry.name.ends_with(".json")).unwrap_or(at);
    let Some(entry) = entries.get_mut(found) else { return };
    match std::str::from_utf8(&entry.body) {
        Ok(json) => entry.body = text::change(json, json, random).into_bytes(),
        Err(_) => bytes::change(&mut entry.body, &[], random),
    }
}

fn gzip(inner: &[u8]) -> Vec<u8> {
    let mut writer = GzEncoder::new(Vec::new(), Compression::fast());
    writer.write_all(inner).expect("memory can be written to");
    writer.finish().expect("memory can be written to")
}

fn entries(file: &[u8]) -> Vec<Entry> {
    let mut zip = ZipArchive::new(Cursor::new(file)).expect("a zip archive");
    let read = |at: usize| {
        let mut entry = zip.by_index(at).expect("an entry");
        let mut body = Vec::new();
        entry.read_to_end(&mut body).expect("a whole entry");
        Entry::new(entry.name().expect("a name").into_owned(), body)
    };
    (0..file_count(file)).map(read).collect()
}

fn file_count(file: &[u8]) -> usize {
    ZipArchive::new(Cursor::new(file)).expect("a zip archive").len()
}

/// Returns values that differ from each other, around 0.
fn value(at: usize) -> f32 {
    (at as f32 * 0.37).sin() * 0.5
}

/// Returns the parameters of three Gaussians in five frames.
fn npz() -> Vec<u8> {
    let shapes = [
        ("means3D", vec![5, 3, 3]),
        ("unnorm_rotations", vec![5, 3, 4]),
        ("rgb_colors", vec![5, 3, 3]),
        ("logit_opacities", vec![3, 1]),
        ("log_scales", vec![3, 3]),
    ];
    let array = |shape: &[usize]| {
        let sides: Vec<String> = shape.iter().map(usize::to_string).collect();
        let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}\n", sides.join(", "));
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes.extend((0..shape.iter().product()).flat_map(|at| value(at + 1).to_le_bytes()));
        bytes
    };
    let all: Vec<Entry> = shapes.iter().map(|(name, shape)| Entry::new(format!("{name}.npy"), array(shape))).collect();
    archive::file(&all)
}

/// Returns a capture of splaTV of six splats.
fn splatv(curve: f32) -> Vec<u8> {
    let parts = r#"[{"type":"splat","size":384,"texwidth":4096,"texheight":1,"cameras":[{"id":0}]}]"#;
    let mut file = 0x674b_u32.to_le_bytes().to_vec();
    file.extend((parts.len() as u32).to_le_bytes());
    file.extend(parts.bytes());
    for splat in 0..6 {
        file.extend((0..3).flat_map(|at| value(splat * 7 + at).to_le_bytes()));
        let halves = |first: usize, count: usize, factor: f32| {
            (first..first + count).flat_map(move |at| f16::from_f32(value(splat * 40 + at) * factor).to_le_bytes())
        };
        file.extend(halves(0, 4, 1.0));
        file.extend([0.05, 0.1, 0.2, 0.0].into_iter().flat_map(|scale| f16::from_f32(scale).to_le_bytes()));
        file.extend([200, 100, 50, 40 * splat as u8]);
        file.extend(halves(8, 14, curve));
        file.extend([0.5, 0.25].into_iter().flat_map(|time| f16::from_f32(time).to_le_bytes()));
    }
    file
}

/// Returns a PLY with these properties and values for four Gaussians.
fn ply(names: &[&str], kind: &str, elements: &str, body: Vec<u8>) -> Vec<u8> {
    let mut header = format!("ply\nformat binary_little_endian 1.0\ncomment made for a test\n{elements}");
    header.extend(names.iter().map(|name| format!("property {kind} {name}\n")));
    [header.as_bytes(), b"end_header\n", &body].concat()
}

/// Returns Spacetime Gaussians on cubic paths.
fn spacetime() -> Vec<u8> {
    let names: Vec<String> = ["x", "y", "z", "trbf_center", "trbf_scale", "nx", "ny", "nz"].map(str::to_owned).into();
    let counted = |stem: &str, count: usize| (0..count).map(|at| format!("{stem}_{at}")).collect::<Vec<_>>();
    let names = [names, counted("motion", 9), counted("f_dc", 3), vec!["opacity".to_owned()]].concat();
    let names = [names, counted("scale", 3), counted("rot", 4), counted("omega", 4)].concat();
    let body = (0..names.len() * 4).flat_map(|at| value(at + 1).to_le_bytes()).collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    ply(&names, "float", "element vertex 4\n", body)
}

/// Returns a compressed PLY of four Gaussians in one chunk.
fn compressed() -> Vec<u8> {
    const BOUNDS: [&str; 12] = [
        "min_x",
        "min_y",
        "min_z",
        "max_x",
        "max_y",
        "max_z",
        "min_scale_x",
        "min_scale_y",
        "min_scale_z",
        "max_scale_x",
        "max_scale_y",
        "max_scale_z",
    ];
    let chunk: String = BOUNDS.iter().map(|name| format!("property float {name}\n")).collect();
    let names = ["packed_position", "packed_rotation", "packed_scale", "packed_color"];
    let bounds = [-1.0f32, -1.0, -1.0, 1.0, 1.0, 1.0, -4.0, -4.0, -4.0, -2.0, -2.0, -2.0];
    let words = (0..16u32).flat_map(|at| at.wrapping_mul(0x9e37_79b9).to_le_bytes());
    let body = bounds.into_iter().flat_map(f32::to_le_bytes).chain(words).collect();
    ply(&names, "uint", &format!("element chunk 1\n{chunk}element vertex 4\n"), body)
}
