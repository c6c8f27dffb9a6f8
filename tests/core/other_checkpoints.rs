//! Checkpoints of other trainers, and of torch before 1.6.
//!
//! In: small checkpoints of gsplat and of nerfstudio, made here, also with unknown and with wrong entries; checkpoints
//! of the 4DGS trainer in the format of torch before 1.6. Out: the values of their Gaussians, or why they are refused.

use crate::checkpoint_poison::read;
use crate::support::pth::{self, Pth};
use crate::support::trained::trained;
use bevy_gs4d::codec::{ReadOptions, load};
use bevy_gs4d::internal::codec::{read_beside, read_bytes};
use bevy_gs4d::scene::{GaussianScene, UpAxis};
use bevy_gs4d::view::RasterFov;
use std::fs;
use std::path::Path;

/// Number of Gaussians.
const COUNT: usize = 3;

/// A checkpoint of named tensors.
#[derive(Clone, Default)]
struct Named {
    /// Names of tensors and their fragments.
    tensors: Vec<(String, Vec<u8>)>,
    storages: Vec<Vec<f32>>,
}

impl Named {
    /// Returns the tensors of gsplat, of this degree of color.
    fn gsplat(degree: usize) -> Self {
        let mut all = Self::default();
        all.add("means", &[COUNT, 3], 1.0);
        all.add("opacities", &[COUNT], 0.25);
        all.add("quats", &[COUNT, 4], 0.5);
        all.add("scales", &[COUNT, 3], -1.5);
        all.add("sh0", &[COUNT, 1, 3], 0.75);
        all.add("shN", &[COUNT, (degree + 1).pow(2) - 1, 3], -0.25);
        all
    }

    /// Returns the tensors of splatfacto, of this degree of color.
    fn splatfacto(degree: usize) -> Self {
        let mut all = Self::default();
        for (name, shape, first) in [
            ("means", vec![COUNT, 3], 1.0),
            ("scales", vec![COUNT, 3], -1.5),
            ("quats", vec![COUNT, 4], 0.5),
            ("features_dc", vec![COUNT, 3], 0.75),
            ("features_rest", vec![COUNT, (degree + 1).pow(2) - 1, 3], -0.25),
            ("opacities", vec![COUNT, 1], 0.25),
        ] {
            all.add(&format!("_model.gauss_params.{name}"), &shape, first);
        }
        all
    }

    /// Adds a tensor whose values start at `first` and increase by 1/64.
    fn add(&mut self, name: &str, shape: &[usize], first: f32) {
        let stride: Vec<usize> = (1..=shape.len()).map(|axis| shape[axis..].iter().product()).collect();
        let values: Vec<f32> = (0..shape.iter().product()).map(|at| value(first, at)).collect();
        let fragment = pth::tensor(self.storages.len(), values.len(), 0, shape, &stride);
        self.tensors.push((name.to_owned(), fragment));
        self.storages.push(values);
    }

    /// Returns the fragment of the dictionary of the tensors, with the state that torch adds to it.
    fn dictionary(&self) -> Vec<u8> {
        let items: Vec<Vec<u8>> =
            self.tensors.iter().flat_map(|(name, tensor)| [pth::text(name), tensor.clone()]).collect();
        let state = [&b"}"[..], &pth::text("_metadata"), b"}sb"].concat();
        [&b"ccollections\nOrderedDict\n)R("[..], &items.concat(), b"u", &state].concat()
    }

    /// Returns the file: a dictionary of the step, of the tensors under a key, and of more entries.
    fn file(&self, key: &str, more: &[(&str, &[u8])]) -> Vec<u8> {
        let mut items = [pth::text("step"), pth::int(29_999), pth::text(key), self.dictionary()].concat();
        items.extend(more.iter().flat_map(|(key, fragment)| [pth::text(key), fragment.to_vec()].concat()));
        let pickle = [&b"\x80\x02}("[..], &items, b"u."].concat();
        Pth { slots: Vec::new(), storages: self.storages.clone() }.bytes_with(&pickle)
    }
}

fn value(first: f32, at: usize) -> f32 {
    first + at as f32 / 64.0
}

fn three(first: f32, row: usize) -> [f32; 3] {
    [0, 1, 2].map(|axis| value(first, row * 3 + axis))
}

/// Returns the fragment of a tensor with a storage of another class.
fn of_class(tensor: &[u8], class: &str) -> Vec<u8> {
    const FLOATS: &[u8] = b"FloatStorage";
    let at = tensor.windows(FLOATS.len()).position(|window| window == FLOATS).expect("a storage");
    [&tensor[..at], class.as_bytes(), &tensor[at + FLOATS.len()..]].concat()
}

fn refusal(bytes: &[u8]) -> String {
    read(bytes).expect_err("it is refused").to_string()
}

/// Checks the values of all Gaussians but their colors.
fn check(scene: &GaussianScene) {
    let parameters = &trained(scene).parameters;
    assert_eq!(parameters.mean, [0, 1, 2].map(|row| three(1.0, row)), "means");
    assert_eq!(parameters.log_scale, [0, 1, 2].map(|row| three(-1.5, row)), "logarithms of scales");
    assert_eq!(parameters.opacity_logit, [0, 1, 2].map(|row| value(0.25, row)), "logits of opacities");
    let rotation = |row: usize| [0, 1, 2, 3].map(|lane| value(0.5, row * 4 + lane));
    assert_eq!(parameters.rotation_l, [0, 1, 2].map(rotation), "rotations w, x, y, z");
    assert_eq!(scene.playback.up, UpAxis::NegY, "as files of 3DGS");
    assert_eq!(scene.trained_with.raster_fov, RasterFov::Corrected, "the true field of view");
    assert_eq!(scene.trained_with.iteration, 29_999, "the step of the training");
}

#[test]
fn a_checkpoint_of_gsplat_has_its_gaussians() {
    for degree in 0..=3 {
        let scene = read(&Named::gsplat(degree).file("splats", &[])).expect("a checkpoint of gsplat");
        check(&scene);
        let harmonics = &trained(&scene).harmonics;
        assert_eq!(harmonics.degree as usize, degree, "degree of color");
        for row in 0..COUNT {
            assert_eq!(harmonics.of(row)[..3], three(0.75, row), "coefficients of degree 0");
            let rest = harmonics.of(row).len() - 3;
            let expected: Vec<f32> = (0..rest).map(|at| value(-0.25, row * rest + at)).collect();
            assert_eq!(harmonics.of(row)[3..], expected, "the others, degree {degree}");
        }
    }
}

#[test]
fn a_checkpoint_of_nerfstudio_has_its_gaussians_whatever_else_is_in_it() {
    // Objects of other libraries, an int that is too large, storages of other types.
    let foreign = [&b"cnerfstudio.configs\nConfig\n)\x81}b"[..], b"0"].concat();
    let lambda = [&b"ctorch.optim.lr_scheduler\nLambdaLR\n"[..], &pth::tuple(&[pth::int(1)]), b"R"].concat();
    let count = of_class(&pth::tensor(0, 9, 0, &[1], &[1]), "LongStorage");
    let more: [(&str, &[u8]); 4] = [
        ("optimizers", &[&b"N"[..], &foreign].concat()),
        ("schedulers", &lambda),
        ("scalers", b"\x8a\x09\0\0\0\0\0\0\0\0\x02"),
        ("counts", &count),
    ];
    for degree in 1..=3 {
        let scene = read(&Named::splatfacto(degree).file("pipeline", &more)).expect("a checkpoint of nerfstudio");
        check(&scene);
        let harmonics = &trained(&scene).harmonics;
        assert_eq!(
            (harmonics.degree as usize, harmonics.of(1)[..3].to_vec()),
            (degree, three(0.75, 1).to_vec()),
            "colors"
        );
        assert_eq!(harmonics.of(0)[3..6], three(-0.25, 0), "the first coefficient of degree 1");
    }
    let mut older = Named::splatfacto(2);
    older.tensors.iter_mut().for_each(|(name, _)| *name = name.replace("gauss_params.", ""));
    check(&read(&older.file("pipeline", &[])).expect("an older checkpoint"));
}

#[test]
fn without_coefficients_splatfacto_learns_logits_of_colors() {
    let scene = read(&Named::splatfacto(0).file("pipeline", &[])).expect("a checkpoint of nerfstudio");
    check(&scene);
    let harmonics = &trained(&scene).harmonics;
    for row in 0..COUNT {
        let expected = three(0.75, row).map(|logit| (1.0 / (1.0 + (-logit).exp()) - 0.5) / 0.282_094_8);
        assert_eq!((harmonics.degree, harmonics.of(row)), (0, &expected[..]), "colors of Gaussian {row}");
    }
}

#[test]
fn parts_of_other_checkpoints_that_a_scene_does_not_show_are_stated() {
    let said = |bytes: &[u8]| read_bytes(Path::new("a.pt"), bytes).expect("a checkpoint").1.join(" ");
    let mut fourth = Named::gsplat(4);
    let lost = said(&fourth.file("splats", &[("app_module", b"}")]));
    for part in ["degree 4, 9 coefficients of each of 3", "-y", "--up +z", "single pictures"] {
        assert!(lost.contains(part), "{part}: {lost}");
    }
    assert_eq!(
        trained(&read(&fourth.file("splats", &[])).expect("degree 4")).harmonics.coefficients,
        16,
        "degree 3 is kept"
    );
    fourth.tensors.truncate(4);
    fourth.add("colors", &[COUNT, 3], 0.75);
    let bytes = fourth.file("splats", &[]);
    assert!(said(&bytes).contains("network of appearance"), "colors before the network");
    let color = trained(&read(&bytes).expect("colors")).harmonics.of(0)[0] * 0.282_094_8 + 0.5;
    assert!((color - 1.0 / (1.0 + (-0.75_f32).exp())).abs() < 1e-6, "{color} is the sigmoid of its logit");
    let mut odd = Named::gsplat(0);
    odd.storages[0][4] = f32::NAN;
    let lost = said(&odd.file("splats", &[]));
    assert!(lost.contains("1 of 3 Gaussians have values that cannot be drawn"), "{lost}");
    let bytes = Named::gsplat(0).file("splats", &[]);
    let beside = vec![("ckpt_9_rank1.pt".to_owned(), bytes.clone())];
    let (_, lost) = read_beside(Path::new("ckpt_9_rank0.pt"), &bytes, beside).expect("a part");
    assert!(lost.iter().any(|lost| lost.contains("ckpt_9_rank1.pt has others")), "another part is named: {lost:?}");
}

#[test]
fn errors_of_other_checkpoints_name_the_fault() {
    let changed = |change: fn(&mut Named)| {
        let mut all = Named::gsplat(1);
        change(&mut all);
        refusal(&all.file("splats", &[]))
    };
    let cases: [(fn(&mut Named), &[&str]); 5] = [
        (|all| all.tensors[4].0 = "sh".to_owned(), &["have no sh0", "features_dc"]),
        (|all| all.add("means", &[4, 3], 0.0), &["scales has shape [3, 3], expected [4, 3]"]),
        (|all| all.tensors[3].1 = pth::int(3), &["scales is an int", "float32"]),
        (|all| all.add("shN", &[COUNT, 5, 3], 0.0), &["shN has shape [3, 5, 3]", "0, 3, 8, 15 or 24"]),
        (
            |all| all.tensors[2].1 = of_class(&all.tensors[2].1, "HalfStorage"),
            &["quats is the Python object `torch HalfStorage`", ".float()"],
        ),
    ];
    for (change, parts) in cases {
        let message = changed(change);
        assert!(parts.iter().all(|part| message.contains(part)), "{parts:?}: {message}");
    }
    let other = Named::default().file("state_dict", &[("epoch", b"K\x01")]);
    let message = refusal(&other);
    let parts = ["a dictionary of step, state_dict, epoch", "gsplat", "as PLY"];
    assert!(parts.iter().all(|part| message.contains(part)), "another dictionary: {message}");
}

/// Returns a checkpoint as torch before 1.6 wrote it.
fn legacy(pth: &Pth) -> Vec<u8> {
    let mut bytes = b"\x80\x02\x8a\x0a\x6c\xfc\x9c\x46\xf9\x20\x6a\xa8\x50\x19.\x80\x02M\xe9\x03.".to_vec();
    bytes.extend([&b"\x80\x02}("[..], &pth::text("little_endian"), b"\x88", &pth::text("type_sizes"), b"}u."].concat());
    // The id of a storage ends with its view of another storage: none here.
    let pickle = pth.pickle();
    let tail = [pth::text("cuda:0"), b"J".to_vec()].concat();
    let mut rest = &pickle[..];
    while let Some(at) = rest.windows(tail.len()).position(|window| window == tail) {
        let (before, after) = rest.split_at(at + tail.len() + 4);
        bytes.extend([before, b"N"].concat());
        rest = after;
    }
    bytes.extend(rest);
    let keys: Vec<Vec<u8>> = (0..pth.storages.len()).map(|key| pth::text(&key.to_string())).collect();
    bytes.extend([&b"\x80\x02]("[..], &keys.concat(), b"e."].concat());
    for values in &pth.storages {
        bytes.extend((values.len() as u64).to_le_bytes());
        bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    }
    bytes
}

#[test]
fn a_checkpoint_of_torch_before_1_6_is_the_same_checkpoint() {
    let mut still = Pth::rotating(4, 1);
    (still.slots[0], still.slots[11]) = (pth::int(0), pth::float(5.5));
    still.slots.truncate(12);
    still.storages.truncate(6);
    for pth in [Pth::rotating(3, 48), still] {
        assert!(read(&legacy(&pth)).expect("the old format") == read(&pth.bytes()).expect("valid"), "every value");
    }
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("old");
    fs::write(&path, legacy(&Pth::rotating(3, 48))).expect("the folder can be written to");
    assert_eq!(load(&path, &ReadOptions::default()).expect("by its contents").len(), 3, "a file without extension");
}

#[test]
fn damaged_files_of_torch_before_1_6_are_refused() {
    let whole = legacy(&Pth::rotating(3, 48));
    for cut in [22, 40, 300, whole.len() / 2, whole.len() - 1] {
        assert!(read(&whole[..cut]).is_err(), "cut after {cut} bytes");
    }
    assert!(refusal(&whole[..whole.len() - 1]).contains("no room for them"), "the values of the last storage are cut");
    let at = whole.windows(13).position(|window| window == b"little_endian").expect("the order of bytes") + 13;
    let mut big = whole.clone();
    big[at] = 0x89;
    assert!(refusal(&big).contains("byte order"), "another order of bytes");
}
