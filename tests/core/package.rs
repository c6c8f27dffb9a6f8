//! The package format, tested through its public functions.
//!
//! In: scenes made here, and packages taken apart, changed and sealed again. Out: proof that files store scenes without
//! loss, but for the points of colliders, which are rounded as told, that every damage is detected, and that additions
//! of a newer writer are skipped.

use crate::support::coded_scene::coded_scene;
use crate::support::package_parts::Parts;
use bevy_gs4d::codec::package::{self, Following, MAGIC, PackageError, PackageInfo, VERSION, WriteSettings};
use bevy_gs4d::codec::{Loading, ReadOptions};
use bevy_gs4d::gaussian::{Gaussian, Harmonics, Model, Parameters};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{
    ChunkFile, ChunkTable, ColliderMesh, ColliderStretch, Colliders, Environment, Form, GaussianScene, Level,
    PlaybackHints, RuntimeScene, SceneForm, Sliced, Socket, SocketSample, SoundFile, Trained, TrainedCameras,
    TrainedWith, UpAxis,
};
use bytemuck::{Zeroable, cast_slice};
use proptest::prelude::*;
use std::io::Cursor;
use std::sync::Arc;

/// The shape of a scene: counts, form and degrees, without values.
#[derive(Debug, Clone, Copy)]
struct Shape {
    /// The model of a trained form, or the runtime form.
    model: Option<Model>,
    count: usize,
    coefficients: usize,
    degrees: (u32, u32),
    environment: Option<(u32, u32)>,
}

const SMALL: Shape =
    Shape { model: Some(Model::Rotated4d), count: 3, coefficients: 2, degrees: (0, 0), environment: None };

/// Pseudo-random bits, including NaNs with payloads, infinities and subnormal numbers.
struct Bits(u64);

impl Bits {
    fn float(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        match self.0 >> 61 {
            0 => [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0][(self.0 >> 40) as usize % 4],
            _ => f32::from_bits((self.0 >> 29) as u32),
        }
    }

    fn floats<const N: usize>(&mut self, count: usize) -> Vec<[f32; N]> {
        (0..count).map(|_| [0.0; N].map(|_| self.float())).collect()
    }

    fn values(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| self.float()).collect()
    }

    fn finite(&mut self, count: usize) -> Vec<f32> {
        (0..count).map(|_| Some(self.float()).filter(|value| value.is_finite()).unwrap_or(0.5)).collect()
    }
}

fn scene(shape: &Shape, seed: u64) -> GaussianScene {
    let (mut bits, n) = (Bits(seed), shape.count);
    let harmonics = |bits: &mut Bits| Harmonics {
        coefficients: shape.coefficients,
        degree: shape.degrees.0,
        degree_t: shape.degrees.1,
        values: bits.values(n * shape.coefficients * 3),
    };
    let form = match shape.model {
        Some(model) => {
            let timed = if model == Model::Static3d { 0 } else { n };
            let pairs = if model == Model::Rotated4d { n } else { 0 };
            let parameters = Parameters {
                mean: bits.floats(n),
                mean_t: bits.values(timed),
                log_scale: bits.floats(n),
                log_scale_t: bits.values(timed),
                rotation_l: bits.floats(n),
                rotation_r: bits.floats(pairs),
                opacity_logit: bits.values(n),
            };
            SceneForm::Trained(Trained { parameters, harmonics: harmonics(&mut bits) })
        }
        None => {
            let gaussians = (0..n).map(|_| gaussian(&mut bits)).collect();
            SceneForm::Ready(Form::Sliced(Sliced { gaussians, harmonics: harmonics(&mut bits) }))
        }
    };
    GaussianScene {
        form,
        filter: None,
        environment: shape.environment.map(|(width, height)| Environment {
            width,
            height,
            texels: bits.finite((3 * width * height) as usize),
        }),
        trained_with: TrainedWith {
            time_interval: [-0.1, 2.7],
            background: [1.0, 0.3, f32::MIN_POSITIVE],
            cameras: TrainedCameras::Intrinsics,
            iteration: 30_000,
            spatial_lr_scale: 4.43 / 3.0,
            pixel: Some(0.0123),
            ..TrainedWith::default()
        },
        playback: PlaybackHints { up: UpAxis::NegY, duration_seconds: 1.0 / 3.0 },
        levels: Vec::new(),
        sockets: Vec::new(),
        colliders: None,
        sound: None,
        chunks: None,
    }
}

fn gaussian(bits: &mut Bits) -> Gaussian {
    Gaussian {
        mean: bits.floats(1)[0],
        mean_t: bits.float(),
        velocity: bits.floats(1)[0],
        sigma_t: bits.float(),
        covariance: bits.floats(1)[0],
        opacity: bits.float(),
        padding: 0.0,
    }
}

/// Returns all values of a scene as bits, so that NaNs can be compared.
fn bits(scene: &GaussianScene) -> Vec<Vec<u32>> {
    let mut all = match &scene.form {
        SceneForm::Ready(Form::Sliced(sliced)) => vec![cast_slice(&sliced.gaussians).to_vec()],
        SceneForm::Ready(Form::Packed(_)) => panic!("packed scenes are tested with compression"),
        SceneForm::Trained(Trained { parameters: p, .. }) => vec![
            cast_slice(&p.mean).to_vec(),
            cast_slice(&p.mean_t).to_vec(),
            cast_slice(&p.log_scale).to_vec(),
            cast_slice(&p.log_scale_t).to_vec(),
            cast_slice(&p.rotation_l).to_vec(),
            cast_slice(&p.rotation_r).to_vec(),
            cast_slice(&p.opacity_logit).to_vec(),
        ],
    };
    all.extend(scene.form.harmonics().map(|harmonics| cast_slice(&harmonics.values).to_vec()));
    all.extend(scene.environment.as_ref().map(|e| cast_slice(&e.texels).to_vec()));
    all
}

fn assert_same(a: &GaussianScene, b: &GaussianScene) {
    let numbers = |s: &GaussianScene| {
        let size = s.environment.as_ref().map(|e| (e.width, e.height));
        (s.len(), s.model(), s.form.color_degrees(), size)
    };
    assert_eq!(numbers(a), numbers(b), "counts, form and degrees");
    assert_eq!(a.trained_with, b.trained_with, "switches of training");
    assert_eq!(a.playback, b.playback, "playback hints");
    assert!(bits(a) == bits(b), "every value keeps its bits");
}

fn pack(scene: &GaussianScene) -> Vec<u8> {
    let mut file = Vec::new();
    package::write(&mut file, scene, &WriteSettings::default()).expect("a consistent scene can be written");
    file
}

fn read(file: &[u8]) -> Result<GaussianScene, PackageError> {
    package::read(Cursor::new(file))
}

fn inspect(file: &[u8]) -> Result<PackageInfo, PackageError> {
    package::inspect(Cursor::new(file))
}

fn refusal(file: &[u8]) -> PackageError {
    let error = read(file).expect_err("must be refused");
    let inspected = inspect(file);
    assert!(
        !inspected.is_ok_and(|info| info.is_intact()) || matches!(error, PackageError::SectionBody { .. }),
        "inspection detects the fault too, unless only decompression detects it: {error}"
    );
    error
}

/// Replaces the body of a section; length and checksum in the header are right.
fn replace_body(mut parts: Parts, index: usize, body: Vec<u8>) -> Parts {
    let old = std::mem::replace(&mut parts.bodies[index], body);
    let entry =
        |body: &[u8], raw| format!("length: {}, raw_length: {raw}, crc32: {}", body.len(), crc32fast::hash(body));
    let raw = zstd::bulk::decompress(&old, 1 << 20).expect("an unchanged body").len();
    let (from, to) = (entry(&old, raw), entry(&parts.bodies[index], raw));
    parts.swap(&from, &to)
}

/// Replaces all sections of a name by one of `count` rows.
fn put(mut parts: Parts, name: &str, count: usize, raw: &[u8]) -> Parts {
    let body = zstd::bulk::compress(raw, 1).expect("compressible");
    let (length, raw_length, crc32) = (body.len(), raw.len(), crc32fast::hash(&body));
    let mut lines: Vec<String> = parts.header.lines().map(str::to_owned).collect();
    let first = lines.iter().position(|line| line.contains("sections: [")).expect("a table of sections") + 1;
    let start = format!("(name: {name:?}, ");
    let place = lines.iter().position(|line| line.contains(&start)).expect("a section of that name");
    while let Some(more) = lines[place + 1..].iter().position(|line| line.contains(&start)) {
        lines.remove(place + 1 + more);
        parts.bodies.remove(place + 1 + more - first);
    }
    lines[place] = format!(
        "{start}encoding: \"f32-planes-zstd\", first: 0, count: {count}, length: {length}, raw_length: {raw_length}, \
         crc32: {crc32}),"
    );
    parts.bodies[place - first] = body;
    Parts { header: lines.join("\n"), ..parts }
}

fn shapes() -> impl Strategy<Value = Shape> {
    let model = prop_oneof![
        Just(None),
        Just(Some(Model::Static3d)),
        Just(Some(Model::Unrotated4d)),
        Just(Some(Model::Rotated4d)),
    ];
    let degrees = prop_oneof![(0..=3u32, Just(0u32)), (Just(3u32), 0..=2u32)];
    let environment = proptest::option::of((1..5u32, 1..4u32));
    // An empty scene does not have the model of a trained form.
    (model, 1..70usize, degrees, 0..5usize, environment).prop_map(|(model, count, degrees, spare, environment)| {
        let evaluated = Harmonics { degree: degrees.0, degree_t: degrees.1, ..Harmonics::default() }.evaluated();
        Shape { model, count, coefficients: (evaluated + spare).min(48), degrees, environment }
    })
}

proptest! {
    #[test]
    fn scenes_are_read_back_bit_for_bit(shape in shapes(), seed: u64) {
        let scene = scene(&shape, seed);
        let file = pack(&scene);
        assert_same(&scene, &read(&file).expect("a package just written can be read"));
        let info = inspect(&file).expect("a package just written can be inspected");
        prop_assert!(info.is_intact(), "all checksums hold");
    }

    #[test]
    fn random_bytes_never_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..400), with_magic: bool) {
        if with_magic {
            // The first 16 bytes of a package with a header of 40 bytes.
            bytes.splice(..bytes.len().min(4), MAGIC);
            bytes.splice(4..bytes.len().min(16), [1, 0, 0, 0, 40, 0, 0, 0, 0, 0, 0, 0]);
        }
        prop_assert!(read(&bytes).is_err() && inspect(&bytes).is_err(), "random bytes are not a package");
    }

    #[test]
    fn changed_headers_never_panic(
        at: prop::sample::Index,
        with in proptest::collection::vec(32..127u8, 0..4),
        drop in 0..4usize,
    ) {
        let mut parts = Parts::of(&pack(&scene(&SMALL, 1)));
        let at = at.index(parts.header.len());
        let end = parts.header.len().min(at + drop);
        parts.header.replace_range(at..end, &String::from_utf8(with).expect("ASCII"));
        let file = parts.seal();
        // A package with a changed number may still be valid: then reading and inspecting it agree.
        let agree = read(&file).is_err() || inspect(&file).is_ok_and(|info| info.is_intact());
        prop_assert!(agree, "inspecting accepts every package that can be read");
    }

    #[test]
    fn changed_bodies_never_panic(section in 0..9usize, at: prop::sample::Index, with: u8) {
        let parts = Parts::of(&pack(&scene(&SMALL, 1)));
        let mut body = parts.bodies[section].clone();
        let at = at.index(body.len());
        body[at] ^= with;
        match read(&replace_body(parts, section, body).seal()) {
            Ok(scene) => prop_assert_eq!(scene.len(), SMALL.count, "the number of Gaussians is unchanged"),
            Err(error) => prop_assert!(matches!(error, PackageError::SectionBody { .. }), "{error}"),
        }
    }
}

#[test]
fn long_scenes_are_split_into_sections_and_read_without_loss() {
    for (model, count) in [(None, 70_000), (Some(Model::Rotated4d), 16_384), (Some(Model::Static3d), 16_385)] {
        let shape = Shape { model, count, coefficients: 5, degrees: (1, 0), environment: Some((151, 77)) };
        let scene = scene(&shape, 3);
        let file = pack(&scene);
        assert_same(&scene, &read(&file).expect("readable"));
        let info = inspect(&file).expect("readable");
        let means = info.header.sections.iter().filter(|s| s.name == "mean").count();
        assert_eq!(means, count.div_ceil(16_384), "sections of at most 16384 Gaussians");
    }
}

#[test]
fn geometry_comes_before_color_and_the_environment_map() {
    let info = inspect(&pack(&scene(&Shape { environment: Some((2, 1)), ..SMALL }, 4))).expect("readable");
    let names: Vec<_> = info.header.sections.iter().map(|s| s.name.as_str()).collect();
    let geometry = ["mean", "mean_t", "log_scale", "log_scale_t", "rotation_l", "rotation_r", "opacity_logit"];
    assert_eq!(names[..7], geometry, "geometry first");
    assert_eq!(names[7..], ["sh_dc", "sh_rest", "environment"], "then color, then the environment map");
}

#[test]
fn an_empty_scene_is_read_without_loss() {
    for model in [None, Some(Model::Static3d)] {
        let scene = scene(&Shape { model, count: 0, environment: Some((1, 1)), ..SMALL }, 5);
        assert_same(&scene, &read(&pack(&scene)).expect("readable"));
    }
}

#[test]
fn the_same_scene_gives_the_same_bytes() {
    let scene = scene(&Shape { count: 40_000, ..SMALL }, 6);
    assert!(pack(&scene) == pack(&scene), "writing is deterministic");
}

#[test]
fn every_flipped_bit_is_detected() {
    let mut file = pack(&scene(&Shape { model: None, environment: Some((1, 1)), ..SMALL }, 7));
    for bit in 0..file.len() * 8 {
        file[bit / 8] ^= 1 << (bit % 8);
        assert!(read(&file).is_err(), "bit {} of byte {} while reading", bit % 8, bit / 8);
        let detected = !inspect(&file).is_ok_and(|info| info.is_intact());
        assert!(detected, "bit {} of byte {} while inspecting", bit % 8, bit / 8);
        file[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(read(&file).is_ok(), "the unchanged file is read");
}

#[test]
fn truncation_at_every_length_is_detected() {
    let file = pack(&scene(&SMALL, 8));
    for length in 0..file.len() {
        let error = refusal(&file[..length]);
        let right = if length < 4 {
            matches!(error, PackageError::NotAPackage)
        } else {
            matches!(error, PackageError::Truncated { found, .. } if found == length as u64)
        };
        assert!(right, "cut to {length} bytes: {error}");
    }
}

#[test]
fn trailing_bytes_are_detected() {
    let mut file = pack(&scene(&SMALL, 9));
    file.push(0);
    assert!(matches!(refusal(&file), PackageError::TrailingBytes { count: 1 }), "one byte too many");
}

#[test]
fn damaged_sections_are_named() {
    let scene = scene(&SMALL, 10);
    let mut file = pack(&scene);
    let last = file.len() - 1;
    file[last] ^= 0x10;
    assert!(matches!(refusal(&file), PackageError::SectionChecksum { name } if name == "sh_rest"), "the last section");
    let info = inspect(&file).expect("the header is intact");
    assert_eq!(info.damaged, [info.header.sections.len() - 1], "only the last section is damaged");
}

#[test]
fn additions_of_a_newer_writer_are_skipped() {
    let scene = scene(&SMALL, 11);
    let field = "mood: bright(hue: Some((0.5, -1e-3)), tags: [\"a\", 'b'], more: {1: inf}),";
    // The checksum is that of "123456789" in every CRC-32 table.
    let section =
        "(name: \"masks\", encoding: \"bits\", first: 0, count: 9, length: 9, raw_length: 7, crc32: 3421780262),";
    let mut parts = Parts::of(&pack(&scene))
        .swap("gaussians:", &format!("{field} gaussians:"))
        .swap("(name: \"sh_dc\",", &format!("{section} (name: \"sh_dc\", time: (0.0, 1.0),"));
    parts.bodies.insert(7, b"123456789".to_vec());
    let mut file = parts.seal();
    assert_same(&scene, &read(&file).expect("unknown fields and sections are skipped"));
    let info = inspect(&file).expect("readable");
    assert!(info.is_intact() && info.header.sections[7].name == "masks", "the unknown section is listed and intact");

    let at = file.windows(9).position(|w| w == b"123456789").expect("the body is in the file");
    file[at] ^= 1;
    assert!(
        matches!(refusal(&file), PackageError::SectionChecksum { name } if name == "masks"),
        "the checksum of the unknown section is verified"
    );
}

#[test]
fn unknown_versions_features_and_encodings_are_refused_by_name() {
    let file = pack(&scene(&SMALL, 12));
    let mut newer = file.clone();
    newer[4] = 2;
    let error = refusal(&newer);
    assert!(matches!(error, PackageError::UnsupportedVersion { found: 2, known: VERSION }), "{error}");

    let parts = Parts::of(&file);
    let feature = parts.clone().swap("requires: []", "requires: [\"codebook\"]").swap("trained(", "packed(");
    let error = refusal(&feature.seal());
    assert!(matches!(&error, PackageError::UnknownFeature { name } if name == "codebook"), "{error}");

    let encoded = parts.swap("f32-planes-zstd", "f16-planes-zstd");
    let error = refusal(&encoded.seal());
    assert!(matches!(&error, PackageError::UnknownEncoding { name, .. } if name == "mean"), "{error}");
}

#[test]
fn other_files_are_refused() {
    for file in [&b""[..], b"GS4", b"PK\x03\x04 and so on, as a zip file starts", &[0; 64]] {
        assert!(matches!(refusal(file), PackageError::NotAPackage), "{file:?}");
    }
}

#[test]
fn huge_numbers_are_refused_before_anything_is_allocated() {
    let parts = Parts::of(&pack(&scene(&Shape { environment: Some((2, 3)), ..SMALL }, 13)));
    let refused = |from: &str, to: &str| refusal(&parts.clone().swap(from, to).seal());
    for count in ["4000000000", "9223372036854775807", "18446744073709551615"] {
        let error = refused("gaussians: 3", &format!("gaussians: {count}"));
        assert!(matches!(error, PackageError::TooLarge { .. }), "{count} Gaussians: {error}");
        let error = refused("count: 3,", &format!("count: {count},"));
        assert!(matches!(error, PackageError::SectionRange { .. }), "{count} in a section: {error}");
        let error = refused("first: 0,", &format!("first: {count},"));
        assert!(matches!(error, PackageError::SectionRange { .. }), "from {count} on: {error}");
        let error = refused("raw_length: 36", &format!("raw_length: {count}"));
        assert!(matches!(error, PackageError::SectionLength { .. }), "{count} bytes raw: {error}");
        let length = Parts::of(&parts.seal()).bodies[0].len();
        let error = refused(&format!("length: {length},"), &format!("length: {count},"));
        assert!(matches!(error, PackageError::Truncated { .. }), "{count} bytes: {error}");
    }
    let error = refused("width: 2", "width: 4294967295");
    assert!(matches!(error, PackageError::Inconsistent(_)), "a map of too many texels: {error}");
    let error = refused("width: 2", "width: 1431655765");
    assert!(matches!(error, PackageError::TooLarge { .. }), "a map larger than the file: {error}");
    let error = refused("coefficients: 2", "coefficients: 4611686018427387904");
    assert!(matches!(error, PackageError::Inconsistent(_)), "far too many coefficients: {error}");
}

#[test]
fn decompression_bombs_are_refused() {
    let parts = Parts::of(&pack(&scene(&SMALL, 14)));
    for length in [35, 37, 100_000_000] {
        let bomb = zstd::bulk::compress(&vec![0; length], 3).expect("compressible");
        let error = refusal(&replace_body(parts.clone(), 0, bomb).seal());
        assert!(matches!(&error, PackageError::SectionBody { name, .. } if name == "mean"), "{length} bytes: {error}");
    }
    let gaussians = vec![Gaussian::zeroed(); 3_000_000];
    let harmonics = Harmonics { coefficients: 1, values: vec![0.0; 9_000_000], ..Harmonics::default() };
    let identical = SceneForm::Ready(Form::Sliced(Sliced { gaussians, harmonics }));
    let vast = GaussianScene { form: identical, ..scene(&SMALL, 15) };
    let error = package::write(Vec::new(), &vast, &WriteSettings { level: 1 }).expect_err("readers would refuse it");
    assert!(
        matches!(error, PackageError::TooLarge { .. }),
        "a package that readers refuse as a bomb is not written: {error}"
    );
}

#[test]
fn the_memory_limit_counts_a_section_and_the_scene_together() {
    let count = 90_000;
    let harmonics = Harmonics { coefficients: 48, values: vec![0.0; count * 144], ..Harmonics::default() };
    let sliced = Sliced { gaussians: vec![Gaussian::zeroed(); count], harmonics };
    let scene = GaussianScene { form: SceneForm::Ready(Form::Sliced(sliced)), ..scene(&SMALL, 19) };
    let mut file = Vec::new();
    package::write(&mut file, &scene, &WriteSettings { level: 1 }).expect("small sections are within the limit");
    assert_eq!(read(&file).expect("the package can be read").len(), count, "every Gaussian");
    // One section with all coefficients would need its memory twice.
    let error = refusal(&put(Parts::of(&file), "sh_rest", count, &vec![0; count * 47 * 12]).seal());
    assert!(matches!(error, PackageError::TooLarge { .. }), "{error}");
}

#[test]
fn too_many_sections_are_refused() {
    let mut parts = Parts::of(&pack(&scene(&SMALL, 20)));
    let nothing = "(name: \"x\", encoding: \"y\", first: 0, count: 0, length: 0, raw_length: 0, crc32: 0),\n";
    parts.bodies.splice(0..0, vec![Vec::new(); 1 << 16]);
    let file = parts.swap("sections: [\n", &format!("sections: [\n{}", nothing.repeat(1 << 16))).seal();
    assert!(matches!(refusal(&file), PackageError::TooManySections { .. }), "more sections than any scene needs");
}

#[test]
fn codebooks_have_the_coefficients_of_their_degrees() {
    let scene = GaussianScene::from(coded_scene(40, 3, 0));
    let parts = Parts::of(&pack(&scene));
    assert!(read(&parts.seal()).expect("the unchanged package") == scene, "the same scene");
    // Seventeen coefficients for sixteen, in sections of the right length: thirteen words in place of twelve.
    let parts = parts.swap("coefficients: 16", "coefficients: 17");
    let parts = put(parts, "codebooks", 10, &[0; 10 * 13 * 4]);
    let parts = put(parts, "codebook_scales", 2 * 13, &[0; 2 * 13 * 16]);
    let message = refusal(&parts.seal()).to_string();
    assert!(message.contains("`codebooks`") && message.contains("17") && message.contains("16"), "{message}");
}

#[test]
fn codebooks_have_no_more_entries_than_codes() {
    let parts = Parts::of(&pack(&GaussianScene::from(coded_scene(40, 1, 0))));
    let parts = parts.swap("codebooks: Some((5, 5, 0, 0))", "codebooks: Some((65537, 5, 0, 0))");
    let parts = put(parts, "codebooks", 65542, &vec![0; 65542 * 3 * 4]);
    let error = refusal(&parts.seal());
    assert!(matches!(error, PackageError::Inconsistent(_)), "{error}");
}

#[test]
fn environment_maps_are_finite() {
    let scene = scene(&Shape { environment: Some((2, 3)), ..SMALL }, 21);
    let file = put(Parts::of(&pack(&scene)), "environment", 18, &[0xff; 72]).seal();
    let message = read(&file).expect_err("texels of NaN").to_string();
    assert!(message.contains("environment"), "{message}");
    let mut bad = scene;
    bad.environment.as_mut().expect("a map").texels[4] = f32::INFINITY;
    let error = package::write(Vec::new(), &bad, &WriteSettings::default())
        .expect_err("a map that is not finite is not written");
    assert!(matches!(error, PackageError::Inconsistent(_)), "{error}");
}

#[test]
fn a_duration_of_zero_is_read_without_loss() {
    let mut still = scene(&SMALL, 22);
    still.playback.duration_seconds = 0.0;
    let read = read(&pack(&still)).expect("a package just written can be read");
    assert_eq!(read.playback.duration_seconds, 0.0, "the written duration");
}

#[test]
fn names_from_the_file_are_shown_escaped() {
    let parts = Parts::of(&pack(&scene(&SMALL, 23)));
    let name = r#""\u{1b}[2Jfake\nerror""#;
    let section = format!("(name: {name}, encoding: \"y\", first: 0, count: 0, length: 0, raw_length: 0, crc32: 1)");
    let mut unknown = parts.clone().swap("(name: \"sh_dc\",", &format!("{section}, (name: \"sh_dc\","));
    unknown.bodies.insert(7, Vec::new());
    let files = [
        parts.clone().swap("requires: []", &format!("requires: [{name}]")),
        parts.clone().swap("\"f32-planes-zstd\"", name),
        parts.swap("model: Rotated4d", "model: r#\u{1b}"),
        unknown,
    ];
    for parts in files {
        let message = read(&parts.seal()).expect_err("must be refused").to_string();
        assert!(!message.contains(['\u{1b}', '\n']), "no control characters: {message:?}");
    }
}

#[test]
fn sections_must_contain_every_gaussian_once() {
    let parts = Parts::of(&pack(&scene(&SMALL, 16)));
    let error = refusal(&parts.clone().swap("name: \"mean_t\"", "name: \"mean_x\"").seal());
    assert!(matches!(&error, PackageError::MissingSection { name } if name == "mean_t"), "{error}");
    let error = refusal(&parts.clone().swap("name: \"log_scale\"", "name: \"mean\"").seal());
    assert!(matches!(&error, PackageError::SectionRange { name, .. } if name == "mean"), "{error}");
    let error = refusal(&parts.swap("gaussians: 3", "gaussians: 4").seal());
    assert!(matches!(&error, PackageError::MissingSection { name } if name == "mean"), "{error}");
}

#[test]
fn invalid_training_settings_are_refused() {
    let parts = Parts::of(&pack(&scene(&SMALL, 17)));
    for (from, to) in [
        ("time_interval: (-0.1, 2.7)", "time_interval: (2.7, 2.7)"),
        ("time_interval: (-0.1, 2.7)", "time_interval: (NaN, 2.7)"),
        ("prefilter_var: -1.0", "prefilter_var: inf"),
        ("background: (1.0, ", "background: (NaN, "),
        ("duration_seconds: 0.", "duration_seconds: -0."),
        ("time_interval: (-0.1, 2.7)", "time_interval: (-3e38, 3e38)"),
        ("spatial_lr_scale: 1.", "spatial_lr_scale: -1."),
        ("pixel: Some(0.0123)", "pixel: Some(0.0)"),
        ("pixel: Some(0.0123)", "pixel: Some(NaN)"),
        ("spatial_lr_scale: 1.", "near: 0.0, spatial_lr_scale: 1."),
        ("spatial_lr_scale: 1.", "near: -0.2, spatial_lr_scale: 1."),
        ("spatial_lr_scale: 1.", "near: NaN, spatial_lr_scale: 1."),
        ("spatial_lr_scale: 1.", "near: inf, spatial_lr_scale: 1."),
        ("degree: 0", "degree: 4"),
    ] {
        let error = refusal(&parts.clone().swap(from, to).seal());
        assert!(matches!(error, PackageError::Inconsistent(_)), "{to}: {error}");
    }
    for (from, to) in [("degree: 0", "degree: 1"), ("coefficients: 2", "coefficients: 0")] {
        let error = refusal(&parts.clone().swap(from, to).seal());
        assert!(matches!(error, PackageError::Coefficients { .. }), "{to}: {error}");
    }
    let error = refusal(&parts.swap("gaussians: 3", "gaussians: -3").seal());
    assert!(matches!(error, PackageError::Header(_)), "a negative count: {error}");
}

#[test]
fn near_limits_and_filters_are_stored_and_required_unless_they_are_those_of_the_original() {
    let plain = scene(&SMALL, 20);
    let header = Parts::of(&pack(&plain)).header;
    assert!(!header.contains("near") && !header.contains("mip_filter"), "left out: {header}");
    let mut other = plain;
    (other.trained_with.near, other.trained_with.mip_filter) = (0.003, true);
    let parts = Parts::of(&pack(&other));
    assert!(parts.header.contains("\"near\"") && parts.header.contains("\"mip_filter\""), "required: {}", parts.header);
    assert_same(&read(&parts.seal()).expect("a readable package"), &other);
}

#[test]
fn inconsistent_scenes_are_not_written() {
    let good = scene(&SMALL, 18);
    let SceneForm::Trained(Trained { parameters, harmonics }) = good.form.clone() else { panic!("a trained form") };
    let short = Parameters { log_scale: Vec::new(), ..parameters.clone() };
    let mixed = Parameters { mean_t: Vec::new(), log_scale_t: Vec::new(), ..parameters.clone() };
    let few = Harmonics { values: vec![0.0; 5], ..harmonics.clone() };
    let with = |parameters, harmonics| GaussianScene {
        form: SceneForm::Trained(Trained { parameters, harmonics }),
        ..good.clone()
    };
    for bad in [
        with(short, harmonics.clone()),
        with(mixed, harmonics),
        with(parameters, few),
        GaussianScene { environment: Some(Environment { width: 2, height: 2, texels: vec![0.0; 11] }), ..good },
    ] {
        let error = package::write(Vec::new(), &bad, &WriteSettings::default()).expect_err("must be refused");
        assert!(matches!(error, PackageError::Inconsistent(_)), "{error}");
    }
}

/// Returns a scene with two levels of detail, of two Gaussians and of one.
fn detailed() -> GaussianScene {
    let level = |pixels, count| {
        let shape = Shape { model: None, count, ..SMALL };
        let scene = scene(&shape, 30 + count as u64);
        let SceneForm::Ready(form) = scene.form else { panic!("the runtime form") };
        let GaussianScene {
            environment,
            filter,
            trained_with,
            playback,
            levels,
            sockets,
            colliders,
            sound,
            chunks,
            ..
        } = scene;
        let scene = RuntimeScene {
            form,
            environment,
            filter,
            trained_with,
            playback,
            levels,
            sockets,
            colliders,
            sound,
            chunks,
        };
        Level { pixels, scene: Arc::new(scene) }
    };
    GaussianScene { levels: vec![level(64.0, 2), level(8.0, 1)], ..scene(&SMALL, 31) }
}

#[test]
fn levels_of_detail_are_read_without_loss() {
    let scene = detailed();
    let file = pack(&scene);
    let again = read(&file).expect("readable");
    assert_same(&scene, &again);
    assert_eq!(again.levels.len(), 2, "both levels");
    for (a, b) in scene.levels.iter().zip(&again.levels) {
        assert_eq!(a.pixels, b.pixels, "the largest size of a level");
        let [a, b] = [a, b].map(|level| GaussianScene::from(level.scene.as_ref().clone()));
        assert_same(&a, &b);
    }
    assert!(file == pack(&again), "writing them again gives the same file");
    let info = inspect(&file).expect("readable");
    assert_eq!(
        info.header.sections.iter().filter(|section| section.name == "level").count(),
        2,
        "one section for each level"
    );
    assert!(info.header.requires.is_empty(), "readers without levels of detail can read the scene");
}

#[test]
fn readers_without_levels_of_detail_skip_them() {
    let mut parts = Parts::of(&pack(&detailed()));
    // To an older reader, sections and fields of levels are unknown.
    while parts.header.contains("\"level\"") {
        parts = parts.swap("\"level\"", "\"later\"");
    }
    let parts = parts.swap("    levels: [", "    later: [");
    let scene = read(&parts.seal()).expect("readable");
    assert!(scene.levels.is_empty(), "no levels");
    assert_same(&scene, &GaussianScene { levels: Vec::new(), ..detailed() });
}

#[test]
fn damaged_levels_are_refused() {
    let good = Parts::of(&pack(&detailed()));
    let last = good.bodies.len() - 1;
    let with_level = |body: Vec<u8>| {
        let mut parts = good.clone();
        let entry = |body: &[u8]| {
            format!("length: {}, raw_length: {}, crc32: {}", body.len(), body.len(), crc32fast::hash(body))
        };
        let (old, new) = (entry(&parts.bodies[last]), entry(&body));
        parts.bodies[last] = body;
        parts.swap(&old, &new).seal()
    };
    assert!(read(&with_level(good.bodies[last].clone())).is_ok(), "the unchanged level is read");
    let nested = pack(&GaussianScene::from(RuntimeScene {
        levels: vec![detailed().levels[1].clone()],
        ..detailed().levels[0].scene.as_ref().clone()
    }));
    let other = TrainedWith { time_interval: [0.0, 9.0], ..TrainedWith::default() };
    let other = GaussianScene { trained_with: other, ..scene(&Shape { model: None, count: 1, ..SMALL }, 5) };
    let bodies = [
        (nested, "levels"),
        (pack(&scene(&SMALL, 5)), "trained form"),
        (pack(&other), "time interval"),
        (b"GS4D".to_vec(), "cut off"),
        (Vec::new(), "not a .gs4d package"),
    ];
    for (body, expected) in bodies {
        let message = read(&with_level(body)).expect_err("must be refused").to_string();
        assert!(message.contains(expected), "{expected}: {message}");
    }
    let headers = [
        ("(pixels: 64.0)", "(pixels: 8.0)"),
        ("(pixels: 64.0)", "(pixels: inf)"),
        ("(pixels: 8.0)", "(pixels: 0.0)"),
        ("encoding: \"package\", first: 0", "encoding: \"package\", first: 1"),
        ("encoding: \"package\", first: 0, count: 1", "encoding: \"package\", first: 0, count: 2"),
        ("encoding: \"package\"", "encoding: \"parcel\""),
        ("name: \"level\"", "name: \"gone\""),
        ("    levels: [", "    gone: ["),
    ];
    for (from, to) in headers {
        assert!(read(&good.clone().swap(from, to).seal()).is_err(), "{from} as {to}");
    }
}

/// Returns a scene with two sockets, whose values have many decimals.
fn with_sockets() -> GaussianScene {
    let sample = |time: f32| SocketSample {
        time,
        position: [-0.0, 0.1 * time, f32::MIN_POSITIVE],
        rotation: [0.6, 0.0, 0.0, -0.8],
        error: time / 3.0,
    };
    let socket = |name: &str, times: &[f32]| Socket {
        name: name.to_owned(),
        samples: times.iter().map(|&time| sample(time)).collect(),
    };
    GaussianScene {
        sockets: vec![socket("hand", &[0.25, 0.5, 2.7]), socket("\"left\" foot", &[1.0])],
        ..scene(&SMALL, 33)
    }
}

#[test]
fn sockets_are_read_without_loss() {
    let scene = with_sockets();
    let file = pack(&scene);
    let again = read(&file).expect("readable");
    assert_same(&scene, &again);
    assert_eq!(again.sockets, scene.sockets, "all sockets");
    let zero = again.sockets[0].samples[0].position[0];
    assert!(zero == 0.0 && zero.is_sign_negative(), "the sign of a zero");
    assert!(file == pack(&again), "writing them again gives the same file");
    let info = inspect(&file).expect("readable");
    assert!(info.header.requires.is_empty(), "readers without sockets can read the scene");
    let without = read(&Parts::of(&file).swap("    sockets: [", "    later: [").seal()).expect("readable");
    assert!(without.sockets.is_empty(), "an older reader skips them");
    assert_same(&scene, &without);
    let plain = GaussianScene { sockets: Vec::new(), ..scene };
    assert!(!Parts::of(&pack(&plain)).header.contains("sockets"), "a package without sockets is as before");
}

#[test]
fn bad_sockets_are_neither_read_nor_written() {
    let good = Parts::of(&pack(&with_sockets()));
    for (from, to) in [
        ("name: \"hand\"", "name: \"\""),
        ("time: 0.25", "time: 0.5"),
        ("time: 0.25", "time: inf"),
        ("rotation: (0.6", "rotation: (6.0"),
    ] {
        let error = read(&good.clone().swap(from, to).seal()).expect_err("must be refused");
        assert!(matches!(error, PackageError::Inconsistent(_)), "{from} as {to}: {error}");
    }
    let mut twice = with_sockets();
    twice.sockets.extend(with_sockets().sockets);
    let sockets = with_sockets().sockets;
    let mut nested = detailed();
    let level = RuntimeScene { sockets, ..nested.levels[1].scene.as_ref().clone() };
    nested.levels[1].scene = Arc::new(level);
    for bad in [twice, nested] {
        let error = package::write(Vec::new(), &bad, &WriteSettings::default()).expect_err("must be refused");
        assert!(matches!(error, PackageError::Inconsistent(_)), "{error}");
    }
}

/// Returns a scene with colliders: a tetrahedron at rest, and two of other sizes, one after the other.
fn with_colliders() -> GaussianScene {
    let tetrahedron = |size: f32| ColliderMesh {
        points: vec![[0.1; 3], [size, 0.1, 0.1], [0.1, size, 0.1], [0.1, 0.1, size]],
        triangles: vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]],
    };
    let stretch = |from, to, size| ColliderStretch { from, to, mesh: tetrahedron(size) };
    let stretches = vec![stretch(-0.1, 0.25, 1.0 / 3.0), stretch(0.25, 2.7, -2.0)];
    solid(Colliders { standing: tetrahedron(3.7), stretches })
}

fn solid(colliders: Colliders) -> GaussianScene {
    GaussianScene { colliders: Some(Arc::new(colliders)), ..scene(&SMALL, 34) }
}

fn colliders(scene: &GaussianScene) -> &Colliders {
    scene.colliders.as_deref().expect("the scene has colliders")
}

#[test]
fn colliders_are_read_as_they_are_rounded() {
    let scene = with_colliders();
    let file = pack(&scene);
    let again = read(&file).expect("readable");
    assert_same(&scene, &again);
    let (plain, found) = (colliders(&scene), colliders(&again));
    let rounded = plain.clone().rounded();
    assert_eq!(*found, rounded, "the rounded colliders");
    assert_ne!(*found, *plain, "a third and a tenth are no steps of the box");
    let points = |all: &Colliders| all.meshes().flat_map(|mesh| mesh.points.clone()).collect::<Vec<_>>();
    let half = 0.5 * (3.7 + 2.0) / 65535.0;
    for (before, after) in points(plain).iter().flatten().zip(points(found).iter().flatten()) {
        assert!((before - after).abs() <= half + 1e-6, "{before} and {after} are at most half a step apart");
    }
    let bits = |all: &Colliders| points(all).iter().map(|point| point.map(f32::to_bits)).collect::<Vec<_>>();
    assert_eq!(bits(found), bits(&rounded), "every bit of every point");
    assert_eq!(bits(found), bits(&rounded.clone().rounded()), "rounding again changes none");
    assert!(file == pack(&again), "writing them again gives the same file");
    assert!(file == pack(&solid(rounded)), "rounded colliders give the same file");
}

#[test]
fn the_sound_file_is_read_byte_for_byte_and_skipped_by_older_readers() {
    for length in [1, 2, 3, 4, 1000] {
        let bytes: Vec<u8> = (0..length).map(|index| (index * 31 % 251) as u8 + 1).collect();
        let sound = Some(Arc::new(SoundFile::new(&bytes).expect("a file has bytes")));
        let file = pack(&GaussianScene { sound, ..scene(&SMALL, 35) });
        let again = read(&file).expect("the package is good");
        assert_eq!(again.sound.as_ref().map(|sound| sound.bytes()), Some(bytes.as_slice()), "{length} bytes come back");
        let info = inspect(&file).expect("the package is good");
        assert!(info.is_intact() && info.header.requires.is_empty(), "readers without sounds can read the scene");
        let older = Parts::of(&file).swap("    sound: Some(", "    later: Some(").swap("\"sound\"", "\"later\"");
        let without = read(&older.seal()).expect("an older reader reads the scene");
        assert!(without.sound.is_none(), "an older reader skips the sound");
    }
}

#[test]
fn readers_without_colliders_skip_them() {
    let scene = with_colliders();
    let file = pack(&scene);
    let info = inspect(&file).expect("readable");
    assert!(info.is_intact() && info.header.requires.is_empty(), "readers without colliders can read the scene");
    let mut older = Parts::of(&file).swap("    colliders: Some(", "    later: Some(");
    for name in ["\"collider_points\"", "\"collider_triangles\""] {
        older = older.swap(name, "\"later\"");
    }
    let without = read(&older.seal()).expect("readable");
    assert!(without.colliders.is_none(), "an older reader skips them");
    assert_same(&scene, &without);
    let plain = GaussianScene { colliders: None, ..scene };
    assert!(!Parts::of(&pack(&plain)).header.contains("collider"), "a package without colliders is as before");
}

/// Returns the index of a capture in chunk files.
fn index(files: usize) -> GaussianScene {
    let file = |number: usize| {
        let [layer, bytes] = [number % 3, 1_234_567 + number];
        let stretches = [number / 3, 3_599].map(|stretch| stretch as u32);
        ChunkFile { stretches, layer: layer as u32, gaussians: 12_345, bytes: bytes as u64 }
    };
    let files = (0..files).map(file).collect();
    let table = ChunkTable { stretches: 3_600, gaussian_bytes: 88, files, utilities: Vec::new(), first_byte: None };
    let shape = Shape { model: None, count: 0, ..SMALL };
    GaussianScene { chunks: Some(Arc::new(table)), ..scene(&shape, 35) }
}

#[test]
fn the_table_of_an_index_is_read_as_it_was_written() {
    let scene = index(10_800);
    let file = pack(&scene);
    let again = read(&file).expect("readable");
    assert_eq!(again, scene, "the same table");
    assert!(file == pack(&again), "writing it again gives the same file");
    let each = (file.len() - pack(&index(0)).len()) / 10_800;
    assert!((25..=35).contains(&each), "{each} bytes for each chunk file");
    let lines = Parts::of(&file).header.lines().filter(|line| line.contains("12345")).count();
    assert_eq!(lines, 1, "all files are on one line");
    let info = inspect(&file).expect("readable");
    assert!(info.is_intact() && info.header.requires.is_empty(), "older readers read an empty scene");
    let older = read(&Parts::of(&file).swap("    chunks: Some(", "    later: Some(").seal()).expect("readable");
    assert_eq!(older, GaussianScene { chunks: None, ..scene.clone() }, "an older reader skips the table");
    assert!(!Parts::of(&pack(&older)).header.contains("chunks"), "a package without chunk files is as before");
    let runtime = scene.into_runtime().expect("no Gaussian that cannot be drawn");
    assert_eq!(runtime.chunks, again.chunks, "the scene that is drawn has the table");
    let mut loading = Loading::new("index.gs4d", file, &ReadOptions::default()).expect("a package");
    while loading.advance(5_000).expect("readable") {}
    assert_eq!(loading.finish().expect("the scene can be drawn").chunks, again.chunks, "also if it is read in steps");
}

/// Gaussians of each chunk file in one file.
const CHUNK: usize = 300;

/// Returns two chunk files of a capture, and the file of their index and both.
fn in_one_file() -> ([GaussianScene; 2], Vec<u8>) {
    let scenes = [1, 2].map(|seed| synthesize(&SynthSettings { count: CHUNK, seed, ..SynthSettings::default() }));
    let bodies = scenes.each_ref().map(pack);
    let file = |layer: usize| ChunkFile {
        stretches: [0, 0],
        layer: layer as u32,
        gaussians: CHUNK as u64,
        bytes: bodies[layer].len() as u64,
    };
    let table = ChunkTable { files: vec![file(0), file(1)], ..(*index(0).chunks.expect("a table")).clone() };
    let mut whole = Vec::new();
    let empty = synthesize(&SynthSettings { count: 0, ..SynthSettings::default() });
    let index = GaussianScene { chunks: Some(Arc::new(table)), ..empty };
    package::write_index(&mut whole, &index, &WriteSettings::default()).expect("the index can be written");
    bodies.iter().for_each(|body| whole.extend_from_slice(body));
    (scenes, whole)
}

#[test]
fn an_index_and_the_chunk_files_after_it_are_one_capture() {
    let (scenes, whole) = in_one_file();
    let first = whole.len() - scenes.iter().map(|scene| pack(scene).len()).sum::<usize>();
    let of = |length: usize| Following::of(&whole[..length]);
    assert_eq!([of(0), of(100)], [Following::Undecided; 2], "the header decides");
    assert_eq!([of(first), of(whole.len())], [Following::From(first as u64); 2], "they follow the index");
    assert_eq!(Following::of(&pack(&scenes[0])), Following::Nothing, "nothing follows another package");
    assert_eq!(Following::of(b"ply"), Following::Nothing, "nor another file");

    let united = read(&whole).expect("readable");
    assert_eq!((united.len(), &united.chunks), (2 * CHUNK, &None), "the Gaussians of both, and no table");
    let both = bits(&scenes[0]).into_iter().zip(bits(&scenes[1])).map(|(first, second)| [first, second].concat());
    assert!(bits(&united) == both.collect::<Vec<_>>(), "those of the second after those of the first");
    for size in [1_000, usize::MAX] {
        let mut loading = Loading::new("take.gs4d", whole.clone(), &ReadOptions::default()).expect("a package");
        let mut before = 0.0;
        while loading.advance(size).expect("readable") {
            assert!((before..=1.0).contains(&loading.progress()), "the progress does not go back");
            before = loading.progress();
        }
        assert_eq!(loading.finish().expect("readable").len(), 2 * CHUNK, "in steps of {size}");
    }
    let options = ReadOptions::default();
    let alone = Loading::of_index("take.gs4d", whole[..first].to_vec(), &options).expect("an index").finish();
    let alone = alone.expect("readable");
    let table = alone.chunks.expect("a table");
    assert_eq!((alone.form.len(), table.range(0).map(|range| range.start)), (0, Some(first as u64)), "the index alone");
    assert_eq!(table.range(1).map(|range| range.end), Some(whole.len() as u64), "and where each file is");
    assert!(Loading::of_index("take.gs4d", whole[..first - 1].to_vec(), &options).is_err(), "an index that is cut off");

    let info = inspect(&whole).expect("readable");
    assert!(info.is_intact() && info.header.requires.contains(&"chunks_follow".to_owned()), "older readers refuse it");
}

#[test]
fn faults_of_chunk_files_in_one_file_are_named() {
    let (_, whole) = in_one_file();
    assert!(refusal(&whole[..whole.len() - 1]).to_string().contains("cut off"), "the end is missing");
    assert!(refusal(&[&whole[..], b"!"].concat()).to_string().contains("too many"), "a byte more");
    let mut damaged = whole.clone();
    *damaged.last_mut().expect("bytes") ^= 1;
    assert!(refusal(&damaged).to_string().starts_with("chunk file 2: "), "by its number: {}", refusal(&damaged));
    let info = inspect(&damaged).expect("the index is intact");
    assert_eq!((info.damaged.len(), info.damaged_files), (0, vec![1]), "by its number, from 0");

    // An index whose table says something else than its files.
    let start = whole.len() - in_one_file().0.iter().map(|scene| pack(scene).len()).sum::<usize>();
    let (head, files) = whole.split_at(start);
    let with = |from: &str, to: &str, files: &[u8]| [&Parts::of(head).swap(from, to).seal(), files].concat();
    let count = CHUNK;
    let other = with(&format!("(0, 0, 1, {count}, "), &format!("(0, 0, 1, {}, ", count + 1), files);
    assert!(refusal(&other).to_string().contains("another number of Gaussians"), "{}", refusal(&other));
    let alone = with("chunks: Some(", "later: Some(", &[]);
    assert!(refusal(&alone).to_string().contains("without a table"), "{}", refusal(&alone));
    let nested = {
        let inner = pack(&index(0));
        let [first, second] = in_one_file().0.map(|scene| pack(&scene).len());
        let table = format!("(0, 0, 1, {count}, {second})");
        let files = [&files[..first], &inner].concat();
        with(&table, &format!("(0, 0, 1, {count}, {})", inner.len()), &files)
    };
    assert!(refusal(&nested).to_string().contains("chunk files itself"), "{}", refusal(&nested));
    assert_eq!(inspect(&nested).expect("the index is intact").damaged_files, [1], "an index is no chunk file");
}

#[test]
fn bad_tables_of_chunk_files_are_neither_read_nor_written() {
    let good = Parts::of(&pack(&index(2)));
    for (from, to, expected) in [
        ("stretches: 3600", "stretches: 0", "stretches"),
        ("stretches: 3600", "stretches: 3599", "stretches"),
        ("gaussian_bytes: 88", "gaussian_bytes: 0", "no bytes"),
        ("gaussian_bytes: 88", "gaussian_bytes: 16385", "more than 16384 bytes"),
        ("(0, 3599, 1, 12345, ", "(0, 3599, 1, 0, ", "without Gaussians"),
        ("(0, 3599, 1, ", "(0, 3599, 16, ", "a layer above 15"),
        ("(0, 3599, 1, ", "(0, 3599, -1, ", "cannot be understood"),
    ] {
        let message = refusal(&good.clone().swap(from, to).seal()).to_string();
        assert!(message.contains(expected), "{from} as {to}: {message}");
    }
    let table =
        ChunkTable { stretches: 0, gaussian_bytes: 88, files: Vec::new(), utilities: Vec::new(), first_byte: None };
    let bad = GaussianScene { chunks: Some(Arc::new(table)), ..index(0) };
    let mut nested = detailed();
    let level = nested.levels[1].scene.as_ref().clone();
    nested.levels[1].scene = Arc::new(RuntimeScene { chunks: index(1).chunks, ..level });
    let full = GaussianScene { chunks: index(1).chunks, ..scene(&SMALL, 35) };
    let leveled = GaussianScene { levels: detailed().levels, ..index(1) };
    let itself = "with Gaussians or levels of detail itself";
    let all = [(bad, "stretches"), (nested, "in chunk files itself"), (full, itself), (leveled, itself)];
    for (bad, expected) in all {
        let error = package::write(Vec::new(), &bad, &WriteSettings::default()).expect_err("must be refused");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

#[test]
fn colliders_of_any_size_are_read_at_once_and_in_steps() {
    let count = 20_000;
    let mesh = |count: u32| ColliderMesh {
        points: (0..count).map(|index| [index as f32, (index % 7) as f32 / 10.0, -3.0]).collect(),
        triangles: (0..count).map(|index| [index, (index + 1) % count, index * 7 % count]).collect(),
    };
    let stretch = ColliderStretch { from: 0.0, to: 1.0, mesh: mesh(9) };
    let large = Colliders { standing: mesh(count), stretches: vec![stretch] };
    for all in [Colliders::default(), large] {
        let synthetic = synthesize(&SynthSettings { count: 9, ..SynthSettings::default() });
        let scene = GaussianScene { colliders: Some(Arc::new(all.clone())), ..synthetic };
        let file = pack(&scene);
        let rounded = all.rounded();
        assert_eq!(*colliders(&read(&file).expect("readable")), rounded, "at once");
        let sections = inspect(&file).expect("readable").header.sections;
        let parts = sections.iter().filter(|section| section.name == "collider_points").count();
        assert_eq!(parts, rounded.standing.points.len().div_ceil(16_384), "sections of at most 16384 points");
        let mut loading = Loading::new("scene.gs4d", file, &ReadOptions::default()).expect("a package");
        while loading.advance(5_000).expect("readable") {}
        let runtime = loading.finish().expect("the scene can be drawn");
        assert_eq!(runtime.colliders.as_deref(), Some(&rounded), "in steps, and in the scene that is drawn");
    }
}

#[test]
fn damaged_colliders_are_refused() {
    let good = Parts::of(&pack(&with_colliders()));
    let many = format!("stretches: [{}", "(from: 0.0, to: 1.0, mesh: (points: 0, triangles: 0)), ".repeat(4096));
    let headers = [
        ("standing: (points: 4", "standing: (points: 5", "`collider_points` is missing, or ends early"),
        ("standing: (points: 4", "standing: (points: 3", "`collider_points` starts at 0 and holds 12"),
        ("standing: (points: 4", "standing: (points: 1048568", "`collider_points` is missing, or ends early"),
        ("standing: (points: 4", "standing: (points: 1048569", "1048576 points"),
        ("standing: (points: 4", "standing: (points: 18446744073709551615", "1048576 points"),
        ("standing: (points: 4", "standing: (points: -4", "cannot be understood"),
        ("triangles: 4", "triangles: 5", "`collider_triangles` is missing, or ends early"),
        ("triangles: 4", "triangles: 3", "`collider_triangles` starts at 0 and holds 12"),
        ("triangles: 4", "triangles: 18446744073709551615", "2097152 triangles"),
        ("stretches: [", many.as_str(), "4096 stretches"),
        ("from: -0.1", "from: 0.25", "ascending"),
        ("from: -0.1", "from: NaN", "not finite"),
        ("to: 0.25", "to: 0.5", "does not begin"),
        ("to: 2.7", "to: inf", "not finite"),
        ("low: (-2.0", "low: (4.0", "corners"),
        ("low: (-2.0", "low: (-inf", "not finite"),
        ("high: (3.7", "high: (NaN", "not finite"),
        ("name: \"collider_points\"", "name: \"gone\"", "`collider_points` is missing"),
        ("name: \"collider_triangles\"", "name: \"gone\"", "`collider_triangles` is missing"),
    ];
    for (from, to, expected) in headers {
        let message = refusal(&good.clone().swap(from, to).seal()).to_string();
        assert!(message.contains(expected), "{from}: {message}");
    }
    let shifted = good.clone().swap("standing: (points: 4", "standing: (points: 3");
    let shifted = shifted.swap("mesh: (points: 4", "mesh: (points: 5");
    let wild = put(good.clone(), "collider_triangles", 12, &[0xff; 12 * 12]);
    for parts in [shifted, wild] {
        let message = read(&parts.seal()).expect_err("must be refused").to_string();
        assert!(message.contains("a point that does not exist"), "{message}");
    }
    let corner = read(&put(good, "collider_points", 12, &[0xff; 12 * 8]).seal()).expect("every position is in the box");
    let mut points = colliders(&corner).meshes().flat_map(|mesh| &mesh.points);
    assert!(points.all(|point| *point == [3.7; 3]), "the last position is the corner of the box");
}

#[test]
fn bad_colliders_are_not_written() {
    let changed = |change: fn(&mut Colliders)| {
        let mut bad = colliders(&with_colliders()).clone();
        change(&mut bad);
        solid(bad)
    };
    let mut nested = detailed();
    let level = nested.levels[1].scene.as_ref().clone();
    nested.levels[1].scene = Arc::new(RuntimeScene { colliders: with_colliders().colliders, ..level });
    for (bad, expected) in [
        (changed(|all| all.standing.points[2][1] = f32::NAN), "a point of colliders that is not finite"),
        (changed(|all| all.standing.points[2][1] = f32::INFINITY), "not finite"),
        (changed(|all| all.stretches[1].mesh.triangles[3][2] = 4), "a point that does not exist"),
        (changed(|all| all.stretches[0].to = 0.0), "does not begin"),
        (nested, "sockets, colliders or a sound itself"),
    ] {
        let error = package::write(Vec::new(), &bad, &WriteSettings::default()).expect_err("must be refused");
        let message = error.to_string();
        assert!(matches!(error, PackageError::Inconsistent(_)), "{message}");
        assert!(message.contains(expected), "{expected}: {message}");
    }
}
