//! `gs4d info FILE`: shows the contents of a checkpoint or a package. For the folder of a dataset see `info_dataset`.
//!
//! In: a file. Out: its properties, its bounds, and for packages the sections and whether their checksums are correct.

use super::info_dataset;
use crate::cli::args::{CheckpointArgs, Given, Need, file_size};
use crate::cli::output::failure::Failure;
use crate::cli::output::report::{Report, switches, switches_json};
use crate::cli::output::table::{Table, bytes, lines};
use crate::codec;
use crate::codec::format::Format;
use crate::codec::package::{PackageInfo, StoredForm, StoredLevel};
use crate::codec::text::printable;
use crate::gaussian::Model;
use crate::offline::dataset::{CameraOptions, Dataset};
use crate::offline::forms::convert::form_name;
use crate::scene::packed::MAX_STAGES;
use crate::scene::{
    Bounds, ChunkTable, ColorDegrees, Form, GaussianScene, Level, PlaybackHints, Runs, SceneForm, Socket, TrainedWith,
};
use glam::Vec3;
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::HashMap;
use std::fmt;
use std::iter;
use std::path::PathBuf;

/// Show the contents of a capture (a file, or the folder of a sequence) or a dataset (a folder), and verify all
/// checksums of a package.
///
/// The exit code is 2 if a checksum is wrong or a Gaussian cannot be drawn.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d info capture.gs4d
  gs4d info chkpnt30000.pth --time-interval 0,10 --json
  gs4d info dataset --cameras cameras.png")]
pub(crate) struct Info {
    #[command(flatten)]
    given: Given,
    /// The capture, or the folder of a dataset.
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Draw the cameras of a dataset into this picture, from above and from the side.
    #[arg(long, value_name = "PICTURE.png")]
    cameras: Option<PathBuf>,
    /// Read every view of a dataset at time 0, as of a scene at rest; images in subfolders of a COLMAP dataset are then
    /// no frames of cameras.
    #[arg(id = "static", long = "static")]
    is_static: bool,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

/// The contents of a file, without its Gaussians.
struct Facts {
    gaussians: usize,
    form: &'static str,
    model: Option<Model>,
    color: ColorDegrees,
    /// Number of entries of each color codebook; `None` if coefficients are not coded.
    codebooks: Option<Vec<u32>>,
    environment: Option<[u32; 2]>,
    trained_with: TrainedWith,
    playback: PlaybackHints,
    levels: Vec<LevelFacts>,
    sockets: Vec<SocketFacts>,
    colliders: Option<ColliderFacts>,
    /// Bytes of the sound file.
    sound: Option<usize>,
    /// Of the index of a capture in chunk files.
    chunks: Option<ChunkFacts>,
    /// Of packed Gaussians in the order of chunk files.
    runs: Option<RunFacts>,
}

/// A level of detail, without its Gaussians.
#[derive(Serialize)]
struct LevelFacts {
    /// The largest size on the screen at which it is drawn, pixels.
    pixels: f32,
    /// Number of Gaussians; `None` if the package is damaged.
    gaussians: Option<usize>,
}

/// A socket, without its samples.
#[derive(Serialize)]
struct SocketFacts {
    name: String,
    /// The first and the last time of its track, timestamp units.
    from: f32,
    to: f32,
}

/// Colliders, without their meshes.
#[derive(Serialize)]
struct ColliderFacts {
    /// Number of stretches of time.
    stretches: usize,
    /// Numbers of points and triangles of all meshes.
    points: usize,
    triangles: usize,
}

/// The chunk files of a capture, all together.
#[derive(Serialize)]
struct ChunkFacts {
    files: usize,
    /// Number of stretches of time.
    stretches: u32,
    layers: u32,
    gaussians: u64,
    /// The length of all files.
    bytes: u64,
    /// Where the first is in the file of the index, bytes from its start; `None`: they are beside it.
    first_byte: Option<u64>,
    /// What each layer adds to the PSNR of held-out views, dB per megabyte; empty if that was not measured.
    decibels_per_megabyte: Vec<f32>,
}

/// The order of chunk files.
#[derive(Serialize)]
struct RunFacts {
    files: usize,
    /// Number of stretches of time.
    stretches: u32,
    layers: usize,
}

/// Bounds of the Gaussians, capture units.
struct Extent {
    /// Bounds of all Gaussians over the whole time interval.
    all: Bounds,
    /// Bounds of the core ([`Bounds::core`]).
    core: Bounds,
}

impl Info {
    /// Reads the file and describes it.
    ///
    /// # Errors
    /// The file cannot be read. If sections are damaged or a Gaussian cannot be drawn, the result is a report with a
    /// failure.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        if self.file.is_dir() && (Dataset::format(&self.file).is_some() || codec::inspect(&self.file).is_err()) {
            self.given.require(Need::Capture, false)?;
            let options = CameraOptions { is_static: self.is_static, ..CameraOptions::default() };
            return info_dataset::run(&self.file, &options, self.cameras.as_deref());
        }
        self.given.require(Need::Dataset, false)?;
        let size = file_size(&self.file)?;
        let (format, package) = codec::inspect(&self.file)?;
        if let Some((info, damage)) = package.as_ref().and_then(|info| Some((info, info.damage()?))) {
            let failure = Failure::about(&self.file, &format!("{damage}; copy or download the package again"));
            return Ok(self.report(size, format, &Facts::of_package(info), package.as_ref(), None, Some(failure)));
        }
        let scene = self.checkpoint.load_to_describe(&self.file)?;
        let mut facts = Facts::of_scene(&scene);
        if let Some(info) = package.as_ref().filter(|info| info.header.chunks_follow) {
            facts.chunks = info.header.chunks.as_ref().map(ChunkFacts::of);
        }
        let (extent, failure) = match scene.into_runtime() {
            Ok(scene) => {
                let TrainedWith { time_interval, marginal_cutoff, .. } = facts.trained_with;
                let all = Bounds::of(scene.iter(), time_interval, marginal_cutoff, scene.filter.as_ref());
                let core = Bounds::core(scene.iter());
                (all.zip(core).map(|(all, core)| Extent { all, core }), None)
            }
            Err(error) => (None, Some(Failure::at(&self.file, &error))),
        };
        Ok(self.report(size, format, &facts, package.as_ref(), extent, failure))
    }

    fn report(
        &self,
        size: u64,
        format: Format,
        facts: &Facts,
        package: Option<&PackageInfo>,
        extent: Option<Extent>,
        failure: Option<Failure>,
    ) -> Report {
        let version = package.map(|info| format!(", version {}", info.version)).unwrap_or_default();
        let name = format!("{}{version}", format.id);
        let mut pairs = vec![("file", self.file.display().to_string()), ("format", name), ("size", bytes(size))];
        pairs.extend(facts.pairs());
        if let Some(shares) = package.and_then(shares_of_layers) {
            pairs.push(("drawn coarsely", format!("after {shares} of the file")));
        }
        // An index is played with its chunk files, which may be beside it.
        let beside = facts.chunks.as_ref().filter(|chunks| chunks.first_byte.is_none());
        let chunks = beside.map_or(0, |chunks| chunks.bytes);
        let rate = bit_rate(size.saturating_add(chunks), &facts.playback);
        if let Some(rate) = rate {
            pairs.push(("bit rate", format!("{rate:.1} Mbit/s")));
        }
        if let Some(Extent { all, core }) = &extent {
            pairs.extend([("bounds", corners(all)), ("middle", corners(core))]);
        }
        let mut text = lines(&pairs);
        if let Some(info) = package {
            text += &format!("\n{}", section_table(info));
        }
        let json = json!({
            "file": self.file.display().to_string(),
            "format": format.id,
            "bytes": size,
            "gaussians": facts.gaussians,
            "form": facts.form,
            "model": facts.model,
            "coefficients": facts.color.coefficients,
            "degree": facts.color.degree,
            "degree_t": facts.color.degree_t,
            "codebooks": facts.codebooks,
            "environment": facts.environment,
            "switches": switches_json(&facts.trained_with, &facts.playback),
            "levels": facts.levels,
            "sockets": facts.sockets,
            "colliders": facts.colliders,
            "sound": facts.sound.map(|bytes| json!({ "bytes": bytes })),
            "chunks": facts.chunks,
            "runs": facts.runs,
            "megabits_per_second": rate,
            "bounds": extent.as_ref().map(|extent| box_json(&extent.all)),
            "core": extent.as_ref().map(|extent| box_json(&extent.core)),
            "package": package.map(package_json),
            "error": failure.as_ref().map(Failure::message),
        });
        Report { failure, ..Report::new(json, text) }
    }
}

impl Facts {
    fn of_scene(scene: &GaussianScene) -> Self {
        Self {
            gaussians: scene.len(),
            form: form_name(&scene.form),
            // Without Gaussians a scene does not have the model of its chunk files.
            model: scene.model().filter(|_| scene.chunks.is_none()),
            color: scene.form.color_degrees(),
            codebooks: scene.form.codebooks().map(|codebooks| codebooks.entries.clone()),
            environment: scene.environment.as_ref().map(|map| [map.width, map.height]),
            trained_with: scene.trained_with.clone(),
            playback: scene.playback,
            levels: scene.levels.iter().map(LevelFacts::of_level).collect(),
            sockets: scene.sockets.iter().map(SocketFacts::of_socket).collect(),
            colliders: scene.colliders.as_ref().map(|colliders| {
                let meshes = colliders.meshes().map(|mesh| [mesh.points.len(), mesh.triangles.len()]);
                ColliderFacts::of_meshes(colliders.stretches.len(), meshes)
            }),
            sound: scene.sound.as_ref().map(|sound| sound.bytes().len()),
            chunks: scene.chunks.as_deref().map(ChunkFacts::of),
            runs: match &scene.form {
                SceneForm::Ready(Form::Packed(packed)) => packed.runs.as_ref().map(RunFacts::of),
                SceneForm::Trained(_) | SceneForm::Ready(Form::Sliced(_)) => None,
            },
        }
    }

    fn of_package(info: &PackageInfo) -> Self {
        let header = &info.header;
        let (model, codebooks) = match header.form {
            StoredForm::Trained { model } => (Some(model), None),
            StoredForm::Sliced => (None, None),
            StoredForm::Packed { codebooks } => (None, codebooks),
        };
        let used = |all: [u32; MAX_STAGES]| all.into_iter().filter(|&entries| entries > 0).collect::<Vec<_>>();
        Self {
            gaussians: header.gaussians,
            form: header.form.name(),
            model: model.filter(|_| header.chunks.is_none()),
            color: ColorDegrees { coefficients: header.coefficients, degree: header.degree, degree_t: header.degree_t },
            codebooks: codebooks.map(used),
            environment: header.environment.map(|map| [map.width, map.height]),
            trained_with: header.trained_with.clone(),
            playback: header.playback,
            levels: header
                .levels
                .iter()
                .map(|&StoredLevel { pixels }| LevelFacts { pixels, gaussians: None })
                .collect(),
            sockets: header.sockets.iter().map(SocketFacts::of_socket).collect(),
            colliders: header.colliders.as_ref().map(|colliders| {
                let moving = colliders.stretches.iter().map(|stretch| &stretch.mesh);
                let meshes = iter::once(&colliders.standing).chain(moving).map(|mesh| [mesh.points, mesh.triangles]);
                ColliderFacts::of_meshes(colliders.stretches.len(), meshes)
            }),
            sound: header.sound,
            chunks: header.chunks.as_ref().map(ChunkFacts::of),
            runs: header.runs.as_ref().map(RunFacts::of),
        }
    }

    fn pairs(&self) -> Vec<(&'static str, String)> {
        let model = match self.model {
            Some(Model::Static3d) => "trained form, static 3D",
            Some(Model::Unrotated4d) => "trained form, 4D without 4D rotation",
            Some(Model::Rotated4d) => "trained form, native 4D",
            None => self.form,
        };
        let ColorDegrees { coefficients, degree, degree_t } = self.color;
        let stored = match &self.codebooks {
            None => format!("{coefficients} coefficients stored"),
            Some(entries) => format!("{coefficients} coefficients, coded by {} codebooks", entries.len()),
        };
        let environment = self.environment.map_or("none".to_owned(), |[width, height]| format!("{width} x {height}"));
        let mut pairs = vec![
            ("Gaussians", format!("{} ({model})", self.gaussians)),
            ("color", format!("degree {degree}, time degree {degree_t}, {stored}")),
            ("environment", environment),
        ];
        pairs.extend(switches(&self.trained_with, &self.playback));
        if !self.levels.is_empty() {
            let levels: Vec<String> = self.levels.iter().map(LevelFacts::to_string).collect();
            pairs.push(("levels of detail", levels.join(", ")));
        }
        if !self.sockets.is_empty() {
            let sockets = self.sockets.iter().map(|SocketFacts { name, from, to }| format!("{name} ({from} to {to})"));
            pairs.push(("sockets", sockets.collect::<Vec<_>>().join(", ")));
        }
        if let Some(ColliderFacts { stretches, points, triangles }) = &self.colliders {
            let what = format!("{points} points, {triangles} triangles, {stretches} stretches of time");
            pairs.push(("colliders", what));
        }
        if let Some(length) = self.sound {
            pairs.push(("sound", format!("a file of {}", bytes(length as u64))));
        }
        if let Some(chunks) = &self.chunks {
            let ChunkFacts { files, stretches, layers, gaussians, bytes: length, first_byte, decibels_per_megabyte } =
                chunks;
            let length = bytes(*length);
            let of = format!("{gaussians} Gaussians in {layers} layers over {stretches} stretches of time, {length}");
            let place = match first_byte {
                None => "the index of".to_owned(),
                Some(first) => format!("an index of {} and", bytes(*first)),
            };
            pairs.push(("chunks", format!("{place} {files} chunk files: {of}")));
            let utilities: Vec<String> = decibels_per_megabyte.iter().map(|own| format!("{own:.1}")).collect();
            if !utilities.is_empty() {
                pairs.push(("layers", format!("{} dB per MB, on held-out views", utilities.join(", "))));
            }
        }
        if let Some(RunFacts { files, stretches, layers }) = &self.runs {
            let of = format!("{files} chunk files in {layers} layers over {stretches} stretches of time");
            pairs.push(("order", format!("that of {of}, into which gs4d split cuts it")));
        }
        pairs
    }
}

impl LevelFacts {
    fn of_level(level: &Level) -> Self {
        Self { pixels: level.pixels, gaussians: Some(level.scene.len()) }
    }
}

impl SocketFacts {
    fn of_socket(socket: &Socket) -> Self {
        let [from, to] = socket.reach().unwrap_or_default();
        Self { name: socket.name.clone(), from, to }
    }
}

impl ColliderFacts {
    /// Returns the facts of meshes with these numbers of points and triangles.
    fn of_meshes(stretches: usize, meshes: impl Iterator<Item = [usize; 2]>) -> Self {
        // A damaged package may have any numbers.
        let [points, triangles] = meshes.fold([0usize; 2], |[points, triangles], [more_points, more_triangles]| {
            [points.saturating_add(more_points), triangles.saturating_add(more_triangles)]
        });
        Self { stretches, points, triangles }
    }
}

impl ChunkFacts {
    fn of(table: &ChunkTable) -> Self {
        Self {
            files: table.files.len(),
            stretches: table.stretches,
            layers: table.layers(),
            gaussians: table.files.iter().map(|file| file.gaussians).sum(),
            bytes: table.files.iter().map(|file| file.bytes).sum(),
            first_byte: table.first_byte,
            decibels_per_megabyte: table.utilities.clone(),
        }
    }
}

impl RunFacts {
    fn of(runs: &Runs) -> Self {
        Self { files: runs.parts.len(), stretches: runs.stretches, layers: runs.layers().len() + 1 }
    }
}

impl fmt::Display for LevelFacts {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.gaussians {
            Some(gaussians) => write!(f, "{gaussians} Gaussians up to {} pixels", self.pixels),
            None => write!(f, "up to {} pixels", self.pixels),
        }
    }
}

/// All sections of one name.
#[derive(Default)]
struct Sections {
    parts: usize,
    bytes: u64,
    unpacked: u64,
    damaged: usize,
}

/// Returns the parts of a package after which a layer can be drawn; `None` if there is none before its end.
fn shares_of_layers(info: &PackageInfo) -> Option<String> {
    let share = |&bytes: &usize| format!("{:.0} %", 100.0 * bytes as f64 / info.file_length.max(1) as f64);
    let shares: Vec<String> = info.layers.iter().map(share).collect();
    (!shares.is_empty()).then(|| shares.join(", "))
}

/// Returns the bit rate of a link that brings some bytes during one pass, Mbit/s; `None` for a still.
pub(super) fn bit_rate(size: u64, playback: &PlaybackHints) -> Option<f64> {
    let seconds = playback.duration_seconds;
    (seconds > 0.0).then(|| size as f64 * 8e-6 / f64::from(seconds))
}

/// Returns a table with one row for all sections of the same name, in the order of the file.
fn section_table(info: &PackageInfo) -> Table {
    let mut rows: Vec<(&str, Sections)> = Vec::new();
    let mut places = HashMap::new();
    for (index, section) in info.header.sections.iter().enumerate() {
        let place = *places.entry(section.name.as_str()).or_insert(rows.len());
        if place == rows.len() {
            rows.push((section.name.as_str(), Sections::default()));
        }
        let all = &mut rows[place].1;
        all.parts += 1;
        all.bytes += section.length as u64;
        // Sections with unknown names may have any number.
        all.unpacked = all.unpacked.saturating_add(section.raw_length as u64);
        all.damaged += usize::from(info.damaged.binary_search(&index).is_ok());
    }
    let mut table = Table::new(&["section", "parts", "bytes", "unpacked", "checksums"]);
    for (name, Sections { parts, bytes, unpacked, damaged }) in rows {
        table.row([
            printable(name),
            parts.to_string(),
            bytes.to_string(),
            unpacked.to_string(),
            if damaged == 0 { "hold".to_owned() } else { format!("{damaged} BROKEN") },
        ]);
    }
    table
}

fn package_json(info: &PackageInfo) -> Value {
    json!({
        "version": info.version,
        "generator": info.header.generator,
        "intact": info.is_intact(),
        "damaged": info.damaged,
        "damaged_files": info.damaged_files,
        "layers": info.layers,
        "sections": info.header.sections,
    })
}

/// Returns the corners of a box with three decimals, and with more of a box smaller than a tenth of a unit.
pub(super) fn corners(bounds: &Bounds) -> String {
    let side = (bounds.max - bounds.min).max_element();
    let smaller = if side > 0.0 { (-side.log10()).clamp(0.0, 9.0) as usize } else { 0 };
    let decimals = 3 + smaller;
    let corner = |Vec3 { x, y, z }: Vec3| format!("({x:.decimals$}, {y:.decimals$}, {z:.decimals$})");
    format!("{} to {}", corner(bounds.min), corner(bounds.max))
}

/// Returns the corners of a box, for programs.
pub(super) fn box_json(bounds: &Bounds) -> Value {
    json!({ "min": bounds.min.to_array(), "max": bounds.max.to_array() })
}
