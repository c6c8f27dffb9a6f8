//! Packages.
//!
//! In: small scenes in every form. Out: packages with right checksums, lengths and compression, and a wrong header or
//! wrong sections; an index that chunk files follow, of which any may be wrong.

use super::{Outcome, Reader};
use crate::accepted::{self, DrawnBy};
use crate::change::{bytes, gaussians, numbers, text};
use crate::support::packed_scene;
use crate::support::random::Random;
use bevy_gs4d::codec::package::{
    self, Beginning, EnvironmentSize, Header, MAGIC, Section, StoredColliders, StoredFilter, StoredForm, StoredMesh,
    VERSION, WriteSettings,
};
use bevy_gs4d::gaussian::{Model, Parameters};
use bevy_gs4d::internal::codec::{FLOAT_PLANES, PACKAGE};
use bevy_gs4d::offline::compress::{CompressSettings, PackedOrder, compress};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{
    ChunkFile, ChunkTable, ColliderMesh, ColliderStretch, Colliders, Environment, FilterKind, Form, GaussianScene,
    Level, RunPart, Runs, RuntimeScene, SceneForm, TemporalFilter, Trained,
};
use std::io::Cursor;
use std::sync::Arc;

/// Most bytes of a section that is made to fit.
const FITTED: usize = 1 << 20;

/// The reader of packages.
pub struct Packages {
    seeds: Vec<Parts>,
}

/// The parts of a package.
#[derive(Clone)]
struct Parts {
    header: Header,
    /// The decompressed bytes of each section; those of a level of detail as stored.
    bodies: Vec<Vec<u8>>,
    /// The chunk files that follow an index.
    files: Vec<Self>,
}

impl Packages {
    /// Makes a seed of every form.
    pub fn new() -> Self {
        Self { seeds: scenes().iter().map(Parts::of).chain([in_one_file()]).collect() }
    }
}

impl Reader for Packages {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let (mut parts, other) = (random.pick(&self.seeds).clone(), random.pick(&self.seeds));
        for _ in 0..random.below(4) {
            parts.change(other, random);
        }
        if random.one_in(2) {
            parts.fit();
        }
        let mut file = parts.seal(&other.header, random);
        if random.one_in(16) {
            bytes::change(&mut file, &other.clone().seal(&other.header, random), random);
        }
        file
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let layers = layers(bytes)?;
        let intact = package::inspect(Cursor::new(bytes)).is_ok_and(|info| info.is_intact());
        match package::read(Cursor::new(bytes)) {
            Ok(_) if !intact => Err("is read, although inspecting it finds damage".to_owned()),
            Ok(_) if layers.iter().any(|layer| !layer) => Err("is read, although a layer of it is refused".to_owned()),
            Ok(scene) => accepted::check(scene, DrawnBy::CpuAndGpu),
            Err(error) => Ok(Outcome::Refused(error.to_string())),
        }
    }
}

/// Returns whether each layer of the beginning of a file is read.
///
/// # Errors
/// A layer that cannot be taken from the bytes up to its end.
fn layers(bytes: &[u8]) -> Result<Vec<bool>, String> {
    let Ok(Some(beginning)) = Beginning::of(bytes) else { return Ok(Vec::new()) };
    let ends = beginning.layers().iter().enumerate().filter(|(_, end)| **end <= bytes.len());
    let is_read = |(layer, &end): (usize, &usize)| {
        let part = beginning.package(&bytes[..end], layer).map_err(|error| format!("layer {layer}: {error}"))?;
        Ok(package::read(Cursor::new(part)).is_ok())
    };
    ends.map(is_read).collect()
}

/// Returns a small scene of every form, with and without each optional part.
fn scenes() -> Vec<GaussianScene> {
    let forty = SynthSettings { count: 40, ..SynthSettings::default() };
    let synth = |degree, degree_t| synthesize(&SynthSettings { degree, degree_t, ..forty });
    let (rotated, mut moving, mut still, mut surrounded) = (synth(1, 0), synth(0, 0), synth(0, 0), synth(3, 1));
    if let SceneForm::Trained(Trained { parameters, .. }) = &mut moving.form {
        parameters.rotation_r.clear();
    }
    if let SceneForm::Trained(Trained { parameters, .. }) = &mut still.form {
        let Parameters { mean_t, log_scale_t, rotation_r, .. } = parameters;
        mean_t.clear();
        log_scale_t.clear();
        rotation_r.clear();
    }
    let texels = (0..24).map(|at| at as f32 / 24.0).collect();
    surrounded.environment = Some(Environment { width: 4, height: 2, texels });
    surrounded.colliders = Some(Arc::new(colliders()));
    let sliced = packed_scene::scene(40, 0, 0);
    // Forty segments are smaller as intervals.
    let mut interval = packed_scene::scene(40, 1, 0);
    let support = TemporalFilter::support(interval.iter(), interval.trained_with.time_interval, 0.05, 40);
    interval.filter = Some(support);
    let pack = |degree, degree_t, codebooks: &[usize]| {
        let scene = packed_scene::scene(40, degree, degree_t);
        compress(scene, &packed_scene::settings(codebooks)).expect("a synthetic scene can be compressed").0
    };
    let settings = CompressSettings { order: PackedOrder::Progressive, ..packed_scene::settings(&[3]) };
    let layered = compress(packed_scene::scene(700, 1, 0), &settings).expect("a synthetic scene can be compressed").0;
    let mut detailed = packed_scene::scene(40, 0, 0);
    detailed.levels = [(64.0, 9), (8.0, 3)]
        .map(|(pixels, count)| {
            let scene = RuntimeScene { filter: None, ..packed_scene::scene(count, 0, 0) };
            Level { pixels, scene: Arc::new(scene) }
        })
        .to_vec();
    detailed.colliders = Some(Arc::new(colliders()));
    vec![
        detailed.into(),
        rotated,
        moving,
        still,
        surrounded,
        sliced.into(),
        interval.into(),
        pack(3, 0, &[4, 4]),
        pack(1, 0, &[3]),
        pack(0, 0, &[]),
        layered,
        cut(),
        synthesize(&SynthSettings { count: 0, ..SynthSettings::default() }),
        index(),
    ]
}

/// Returns packed Gaussians in the order of chunk files.
fn cut() -> GaussianScene {
    let packed = compress(packed_scene::scene(700, 1, 0), &packed_scene::settings(&[3]));
    let mut scene = packed.expect("a synthetic scene can be compressed").0;
    let SceneForm::Ready(Form::Packed(packed)) = &mut scene.form else { panic!("the scene is packed") };
    let part = |first, layer, end| RunPart { stretches: [first, 3], layer, end };
    packed.layers = vec![512];
    packed.runs = Some(Runs { stretches: 4, parts: vec![part(0, 0, 256), part(2, 0, 512), part(0, 1, packed.len())] });
    scene
}

/// Returns the index of a capture in chunk files.
fn index() -> GaussianScene {
    let file = |first, last, layer| ChunkFile { stretches: [first, last], layer, gaussians: 300, bytes: 9_000 };
    let files = vec![file(0, 0, 0), file(0, 3, 0), file(0, 3, 1), file(2, 3, 0)];
    let table = ChunkTable { stretches: 4, gaussian_bytes: 88, files, utilities: Vec::new(), first_byte: None };
    let empty = synthesize(&SynthSettings { count: 0, ..SynthSettings::default() });
    GaussianScene { chunks: Some(Arc::new(table)), ..empty }
}

/// Returns an index that chunk files follow.
fn in_one_file() -> Parts {
    let chunk = |seed| synthesize(&SynthSettings { count: 40, seed, ..SynthSettings::default() });
    let file = |layer| ChunkFile { stretches: [0, 3], layer, gaussians: 40, bytes: 0 };
    let mut table = (*index().chunks.expect("an index has a table")).clone();
    table.files = vec![file(0), file(1)];
    let mut parts = Parts::of(&GaussianScene { chunks: Some(Arc::new(table)), ..index() });
    parts.header.chunks_follow = true;
    parts.header.requires.push("chunks_follow".to_owned());
    parts.files = [1, 2].map(|seed| Parts::of(&chunk(seed))).into();
    parts
}

/// Returns a tetrahedron at rest, one that grows, and nothing afterwards.
fn colliders() -> Colliders {
    let tetrahedron = |size: f32| ColliderMesh {
        points: vec![[0.0; 3], [size, 0.0, 0.0], [0.0, size, 0.0], [0.0, 0.0, size]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let meshes = [(0.0, tetrahedron(0.3)), (0.25, tetrahedron(0.7)), (0.5, ColliderMesh::default())];
    let stretches = meshes.map(|(from, mesh)| ColliderStretch { from, to: from + 0.25, mesh });
    Colliders { standing: tetrahedron(-1.0), stretches: stretches.into() }
}

impl Parts {
    fn of(scene: &GaussianScene) -> Self {
        let mut file = Vec::new();
        package::write(&mut file, scene, &WriteSettings::default()).expect("seeds can be written");
        let header = package::inspect(Cursor::new(&file)).expect("a package just written can be read").header;
        let length: usize = header.sections.iter().map(|section| 8 + section.length).sum();
        let mut rest = &file[file.len() - length..];
        let mut bodies = Vec::new();
        for section in &header.sections {
            let (body, after) = rest[8..].split_at(section.length);
            bodies.push(match section.encoding == PACKAGE {
                true => body.to_vec(),
                false => zstd::bulk::decompress(body, section.raw_length).expect("a package just written can be read"),
            });
            rest = after;
        }
        Self { header, bodies, files: Vec::new() }
    }

    /// Changes one value, section or number, or a chunk file.
    fn change(&mut self, other: &Self, random: &mut Random) {
        let number = random.below(self.files.len());
        if let Some(file) = self.files.get_mut(number).filter(|_| random.one_in(2)) {
            return file.change(other, random);
        }
        let sections = &mut self.header.sections;
        let at = random.below(sections.len());
        match random.below(20) {
            0..=4 => self.change_value(random),
            5..=8 => change_number(&mut self.header, random),
            9 => change_switch(&mut self.header, random),
            10 if !sections.is_empty() => {
                sections.remove(at);
                self.bodies.remove(at);
            }
            11 if !sections.is_empty() => {
                let with = random.below(sections.len());
                sections.swap(at, with);
                self.bodies.swap(at, with);
            }
            12 if !sections.is_empty() => {
                sections.insert(at, sections[at].clone());
                self.bodies.insert(at, self.bodies[at].clone());
            }
            13 if !other.bodies.is_empty() => {
                let from = random.below(other.bodies.len());
                sections.insert(at, other.header.sections[from].clone());
                self.bodies.insert(at, other.bodies[from].clone());
            }
            14 if !sections.is_empty() => {
                let section = &mut sections[at];
                match random.below(4) {
                    0 => section.first = numbers::whole(random) as usize,
                    1 => section.count = numbers::whole(random) as usize,
                    2 => section.name = random.pick(&["mean", "sh_rest", "filter", "x", "", "\u{1b}[2J"]).to_string(),
                    _ => section.encoding = random.pick(&["", "f16-planes-zstd", "\u{1b}[2J\nerror:"]).to_string(),
                }
            }
            15 => self.add_unknown(random),
            _ => self.change_gaussians(random),
        }
    }

    /// Changes some words of a section: to the ends of their type, or by a power of ten.
    fn change_value(&mut self, random: &mut Random) {
        let at = random.below(self.bodies.len());
        let Some(planes) = self.bodies.get_mut(at).filter(|planes| planes.len() >= 4) else { return };
        let words = planes.len() / 4;
        let (first, count) = (random.below(words), *random.pick(&[1, 1, 3, words]));
        let float = numbers::float(random);
        let whole = numbers::whole(random) as u32;
        let factor = 10.0f32.powi(random.below(80) as i32 - 40);
        let way = random.below(4);
        for word in first..words.min(first.saturating_add(count)) {
            let old = u32::from_le_bytes([0, 1, 2, 3].map(|plane| planes[plane * words + word]));
            let new = match way {
                0 | 1 => float.to_bits(),
                2 => whole,
                _ => (f32::from_bits(old) * factor).to_bits(),
            };
            for (plane, byte) in new.to_le_bytes().into_iter().enumerate() {
                planes[plane * words + word] = byte;
            }
        }
    }

    /// Changes one Gaussian, a few, or all, in each section of Gaussians or in every second.
    fn change_gaussians(&mut self, random: &mut Random) {
        let rows = *random.pick(&[1, 1, 5, usize::MAX]);
        let (first, every) = (random.below(self.header.gaussians), random.one_in(3));
        for (section, planes) in self.header.sections.iter().zip(&mut self.bodies) {
            let words = planes.len() / 4;
            let width = words.checked_div(section.count).unwrap_or_default();
            if width == 0 || !gaussians::has(&section.name) || !(every || random.one_in(2)) {
                continue;
            }
            let count = words / width;
            // The header may name any number of Gaussians.
            for row in (0..count).cycle().skip(first % count).take(rows.min(count)) {
                let of = |word: usize| [0, 1, 2, 3].map(|plane| planes[plane * words + word]);
                let mut values: Vec<f32> =
                    (row * width..(row + 1) * width).map(|word| f32::from_le_bytes(of(word))).collect();
                gaussians::change(&section.name, &mut values, random);
                for (word, value) in (row * width..).zip(values) {
                    for (plane, byte) in value.to_le_bytes().into_iter().enumerate() {
                        planes[plane * words + word] = byte;
                    }
                }
            }
        }
    }

    /// Adds sections of unknown names: a few, or very many.
    fn add_unknown(&mut self, random: &mut Random) {
        for number in 0..*random.pick(&[1, 3, 10_000]) {
            let name = format!("x{number}");
            self.header.sections.push(section(name, 0));
            self.bodies.push(Vec::new());
        }
    }

    /// Replaces the sections by those that the header requires, with the required sizes, so that a reader reads their
    /// contents.
    fn fit(&mut self) {
        self.files.iter_mut().for_each(Self::fit);
        let needed = layout(&self.header);
        if needed.iter().any(|&(_, rows, width)| rows.saturating_mul(width).saturating_mul(4) > FITTED) {
            return;
        }
        let sections = std::mem::take(&mut self.header.sections);
        let bodies = std::mem::take(&mut self.bodies);
        let levels = sections.iter().zip(&bodies).filter(|(section, _)| section.encoding == PACKAGE);
        let levels: Vec<_> = levels.map(|(section, body)| (section.clone(), body.clone())).collect();
        for (name, rows, width) in needed {
            let known = sections.iter().zip(&bodies).find(|(section, _)| section.name == name);
            let mut body = known.map(|(_, body)| body.clone()).unwrap_or_default();
            body.resize(rows * width * 4, 0);
            self.header.sections.push(section(name.to_owned(), rows));
            self.bodies.push(body);
        }
        for (section, body) in levels {
            self.header.sections.push(section);
            self.bodies.push(body);
        }
    }

    /// Returns the file: with compressed bodies, mostly right lengths and checksums, and sometimes a changed text of
    /// the header.
    fn seal(mut self, other: &Header, random: &mut Random) -> Vec<u8> {
        let mut sections = Vec::new();
        for (section, planes) in self.header.sections.iter_mut().zip(&self.bodies) {
            let mut body = Vec::new();
            if section.encoding == PACKAGE {
                body.clone_from(planes);
            } else if !planes.is_empty() {
                body = zstd::bulk::compress(planes, 1).expect("memory can be written to");
            }
            if random.one_in(100) {
                bytes::change(&mut body, &[], random);
            }
            section.raw_length = if random.one_in(100) { numbers::whole(random) as usize } else { planes.len() };
            section.length = body.len();
            section.crc32 = crc32fast::hash(&body);
            sections.extend((body.len() as u64).to_le_bytes());
            sections.extend(body);
        }
        let mut files = Vec::new();
        for (number, file) in std::mem::take(&mut self.files).into_iter().enumerate() {
            let file = file.seal(other, random);
            let table = self.header.chunks.as_mut().filter(|_| !random.one_in(100));
            if let Some(listed) = table.and_then(|table| table.files.get_mut(number)) {
                listed.bytes = file.len() as u64;
            }
            files.extend(file);
        }
        let mut header = in_words(&self.header);
        if random.one_in(3) {
            header = text::change(&header, &in_words(other), random);
        }
        let mut start = MAGIC.to_vec();
        start.extend(VERSION.to_le_bytes());
        start.extend((header.len() as u64).to_le_bytes());
        let checksum = crc32fast::hash(&[&start[..], header.as_bytes()].concat());
        [&start[..], &checksum.to_le_bytes(), header.as_bytes(), &sections, &files].concat()
    }
}

/// Returns an entry of the table of sections, whose lengths are set when the file is written.
fn section(name: String, count: usize) -> Section {
    Section { name, encoding: FLOAT_PLANES.to_owned(), first: 0, count, length: 0, raw_length: 0, crc32: 0 }
}

/// Returns the text of a header.
fn in_words(header: &Header) -> String {
    let config = ron::ser::PrettyConfig::new().depth_limit(2).new_line("\n");
    ron::ser::to_string_pretty(header, config).expect("a header can be written as text")
}

/// Changes a number that determines the size of the scene, or its form.
fn change_number(header: &mut Header, random: &mut Random) {
    const COUNTS: [usize; 12] = [0, 1, 2, 31, 32, 33, 39, 41, 255, 256, 257, 1000];
    const COEFFICIENTS: [usize; 14] = [0, 1, 2, 4, 5, 9, 10, 15, 16, 17, 32, 33, 48, 49];
    let any = random.one_in(5).then(|| numbers::whole(random));
    let small = |random: &mut Random| any.map_or(random.below(5) as u32, |any| any as u32);
    match random.below(15) {
        14 => header.chunks_follow ^= true,
        13 => header.codebooks_in_index ^= true,
        12 => change_runs(&mut header.runs, random),
        11 => change_chunks(&mut header.chunks, random),
        10 => header.layers = (0..random.below(4)).map(|_| *random.pick(&[0, 256, 512, 100, usize::MAX])).collect(),
        9 => change_colliders(&mut header.colliders, random),
        8 => {
            let at = random.below(header.levels.len());
            if let Some(level) = header.levels.get_mut(at) {
                level.pixels = numbers::float(random);
            }
        }
        0 => header.gaussians = any.map_or(*random.pick(&COUNTS), |any| any as usize),
        1 | 2 => header.coefficients = any.map_or(*random.pick(&COEFFICIENTS), |any| any as usize),
        3 => header.degree = small(random),
        4 => header.degree_t = small(random),
        5 => {
            let size = EnvironmentSize { width: small(random), height: random.below(5) as u32 };
            header.environment = Some(size).filter(|_| !random.one_in(3));
        }
        6 => {
            let kind = *random.pick(&[FilterKind::KeyFrame, FilterKind::Interval, FilterKind::Support]);
            let segments = *random.pick(&[0, 1, 9, 40, 65_535, 65_536, u32::MAX]);
            let filter = StoredFilter { kind, segments, bits: random.one_in(2) };
            header.filter = Some(filter).filter(|_| !random.one_in(3));
        }
        _ => header.form = form(random),
    }
}

/// Changes one number of the order of chunk files, or takes it away.
fn change_runs(runs: &mut Option<Runs>, random: &mut Random) {
    let Some(Runs { stretches, parts }) = runs else { return };
    let at = random.below(parts.len());
    let small = random.below(5) as u32;
    let any = if random.one_in(3) { numbers::whole(random) as u32 } else { small };
    match (random.below(6), parts.get_mut(at)) {
        (0, _) => *stretches = any,
        (1, Some(part)) => part.stretches[random.below(2)] = any,
        (2, Some(part)) => part.layer = any,
        (3, Some(part)) => part.end = *random.pick(&[0, 255, 256, 512, 700, usize::MAX]),
        (4, Some(_)) => drop(parts.remove(at)),
        _ => *runs = None,
    }
}

/// Changes one number of colliders, or takes them away.
fn change_colliders(colliders: &mut Option<StoredColliders>, random: &mut Random) {
    let Some(StoredColliders { low, high, standing, stretches }) = colliders else { return };
    let (at, axis, any) = (random.below(stretches.len()), random.below(3), numbers::float(random));
    let count = random.below(9);
    let count = if random.one_in(3) { numbers::whole(random) as usize } else { count };
    match (random.below(8), stretches.get_mut(at)) {
        (0, _) => low[axis] = any,
        (1, _) => high[axis] = any,
        (2, Some(stretch)) => stretch.from = any,
        (3, Some(stretch)) => stretch.to = any,
        (4, Some(stretch)) => stretch.mesh = StoredMesh { points: count, ..stretch.mesh },
        (5, Some(stretch)) => stretch.mesh = StoredMesh { triangles: count, ..stretch.mesh },
        (6, _) => *standing = StoredMesh { points: count, ..*standing },
        _ => *colliders = None,
    }
}

/// Changes one number of a table of chunk files, or takes it away.
fn change_chunks(chunks: &mut Option<ChunkTable>, random: &mut Random) {
    let Some(table) = chunks else { return };
    let (at, small) = (random.below(table.files.len()), random.below(6) as u64);
    let any = if random.one_in(2) { numbers::whole(random) } else { small };
    match (random.below(7), table.files.get_mut(at)) {
        (0, _) => table.stretches = any as u32,
        (1, _) => table.gaussian_bytes = any as u32,
        (2, Some(file)) => file.stretches[random.below(2)] = any as u32,
        (3, Some(file)) => file.layer = any as u32,
        (4, Some(file)) => file.gaussians = any,
        (5, Some(file)) => file.bytes = any,
        _ => *chunks = None,
    }
}

fn form(random: &mut Random) -> StoredForm {
    match random.below(6) {
        0 => StoredForm::Trained { model: Model::Rotated4d },
        1 => StoredForm::Trained { model: Model::Unrotated4d },
        2 => StoredForm::Trained { model: Model::Static3d },
        3 => StoredForm::Sliced,
        4 => StoredForm::Packed { codebooks: None },
        _ => {
            let mut entries = || *random.pick(&[0, 0, 1, 3, 4, 65_536, 65_537, u32::MAX]);
            StoredForm::Packed { codebooks: Some([entries(), entries(), entries(), entries()]) }
        }
    }
}

/// Changes the training settings, the playback hints or the required features.
fn change_switch(header: &mut Header, random: &mut Random) {
    let trained = &mut header.trained_with;
    match random.below(9) {
        0 => trained.time_interval[random.below(2)] = numbers::float(random),
        1 => trained.time_interval = [f32::MIN, f32::MAX],
        2 => trained.background[random.below(3)] = numbers::float(random),
        3 => trained.prefilter_var = numbers::float(random),
        4 => trained.spatial_lr_scale = f64::from(numbers::float(random)),
        5 => trained.iteration = numbers::whole(random),
        6 => trained.force_sh_3d = !trained.force_sh_3d,
        7 => header.playback.duration_seconds = numbers::float(random),
        _ => {
            let feature = *random.pick(&["packed", "filter", "more", "\u{1b}[2J\nerror: more"]);
            header.requires.push(feature.to_owned());
        }
    }
}

/// Returns the sections that a header needs, in order: name, rows, words of a row. `docs/format.md` describes them.
fn layout(header: &Header) -> Vec<(&'static str, usize, usize)> {
    let (count, coefficients) = (header.gaussians, header.coefficients);
    let mut sections: Vec<(&'static str, usize, usize)> = match header.form {
        StoredForm::Trained { model } => {
            let (timed, rotated) = (model != Model::Static3d, model == Model::Rotated4d);
            let all = [
                (true, "mean", 3),
                (timed, "mean_t", 1),
                (true, "log_scale", 3),
                (timed, "log_scale_t", 1),
                (true, "rotation_l", 4),
                (rotated, "rotation_r", 4),
                (true, "opacity_logit", 1),
            ];
            all.into_iter().filter(|(has, ..)| *has).map(|(_, name, width)| (name, count, width)).collect()
        }
        StoredForm::Sliced => vec![
            ("mean", count, 3),
            ("mean_t", count, 1),
            ("velocity", count, 3),
            ("sigma_t", count, 1),
            ("covariance", count, 6),
            ("opacity", count, 1),
        ],
        StoredForm::Packed { .. } => vec![
            ("packed_mean", count, 2),
            ("packed_motion", count, 2),
            ("packed_shape", count, 4),
            ("packed_ranges", 3 + 2 * count.div_ceil(256), 4),
        ],
    };
    if let StoredForm::Packed { codebooks: Some(entries) } = header.form {
        let stages = entries.iter().filter(|&&entries| entries > 0).count();
        let words = coefficients.saturating_mul(3).div_ceil(4);
        sections.push(("color_base", count, 1));
        if stages > 0 {
            sections.push(("color_codes", count, stages.div_ceil(2)));
            sections.push(("codebooks", entries.iter().map(|&entries| entries as usize).sum(), words));
            sections.push(("codebook_scales", stages.saturating_mul(words), 4));
        }
    } else {
        sections.push(("sh_dc", count, 3));
        if coefficients > 1 {
            sections.push(("sh_rest", count, coefficients.saturating_mul(3) - 3));
        }
    }
    if let Some(filter) = header.filter {
        let bits = count.div_ceil(32).saturating_mul(filter.segments as usize);
        sections.push(("filter", if filter.bits { bits } else { count }, 1));
    }
    if let Some(size) = header.environment {
        sections.push(("environment", (size.width as usize).saturating_mul(size.height as usize).saturating_mul(3), 1));
    }
    if let Some(StoredColliders { standing, stretches, .. }) = &header.colliders {
        let meshes = || stretches.iter().map(|stretch| stretch.mesh).chain([*standing]);
        let sum = |count: fn(StoredMesh) -> usize| meshes().map(count).fold(0, usize::saturating_add);
        sections.push(("collider_points", sum(|mesh| mesh.points), 2));
        sections.push(("collider_triangles", sum(|mesh| mesh.triangles), 3));
    }
    sections
}
