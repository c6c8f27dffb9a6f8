//! Scenes with inconsistent parts, and colors by codebook with lowered degrees.
//!
//! In: scenes made here, consistent and inconsistent. Out: proof that `RuntimeScene::check` refuses every inconsistent
//! scene, so that no index is out of range, and that lowering degrees changes no other coefficient.

use crate::support::coded_scene::coded_scene;
use bevy_gs4d::codec::package::{self, PackageError, WriteSettings};
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::internal::scene::RECORD_WORDS;
use bevy_gs4d::scene::{ActiveSets, CodedColors, ColorCodebooks, Environment, Form, GaussianScene, RuntimeScene};
use bevy_gs4d::scene::{PackedColors, PackedScene};
use std::io::Cursor;
use std::sync::Arc;

const COUNT: usize = 600;

fn good() -> RuntimeScene {
    let environment = Environment { width: 3, height: 2, texels: vec![0.25; 18] };
    RuntimeScene { environment: Some(environment), ..coded_scene(COUNT, 2, 0) }
}

fn packed(scene: &mut RuntimeScene) -> &mut PackedScene {
    let Form::Packed(packed) = &mut scene.form else { panic!("the scene is packed") };
    packed
}

fn colors(scene: &mut RuntimeScene) -> &mut CodedColors {
    let PackedColors::Coded(colors) = &mut packed(scene).colors else { panic!("the colors are coded") };
    colors
}

fn codebooks(scene: &mut RuntimeScene) -> &mut ColorCodebooks {
    Arc::make_mut(&mut colors(scene).codebooks)
}

fn sets(scene: &mut RuntimeScene, change: impl FnOnce(&mut Vec<u32>)) {
    match &mut scene.filter.as_mut().expect("a filter").sets {
        ActiveSets::Bits(words) | ActiveSets::Intervals(words) => change(words),
    }
}

fn shorten<T>(values: &mut Vec<T>) {
    values.pop();
}

/// Replaces the sets of the filter by intervals; the last Gaussian has the given interval.
fn interval(scene: &mut RuntimeScene, first: u32, last: u32) {
    let filter = scene.filter.as_mut().expect("a filter");
    let mut intervals = vec![0; COUNT];
    intervals[COUNT - 1] = first | last << 16;
    filter.sets = ActiveSets::Intervals(intervals);
}

fn whole(scene: &mut RuntimeScene, coefficients: usize, degree: u32, values: usize) {
    let harmonics = Harmonics { coefficients, degree, degree_t: 0, values: vec![0.0; values] };
    packed(scene).colors = PackedColors::Whole(harmonics);
}

/// An inconsistent scene: a word of the error, and the change.
type Wrong = (&'static str, fn(&mut RuntimeScene));

const WRONG: [Wrong; 27] = [
    ("code", |scene| colors(scene).records[COUNT - 1][1] |= 0xffff),
    ("code", |scene| colors(scene).records[300][1] |= 5 << 16),
    ("codebook", |scene| codebooks(scene).entries[1] -= 1),
    ("codebook", |scene| codebooks(scene).entries[0] = u32::MAX),
    ("codebook", |scene| codebooks(scene).entries = vec![1; 5]),
    ("codebook", |scene| shorten(&mut codebooks(scene).words)),
    ("codebook", |scene| codebooks(scene).words.clear()),
    ("codebook", |scene| shorten(&mut codebooks(scene).scales)),
    ("finite", |scene| codebooks(scene).scales[3][1] = f32::NAN),
    ("colors", |scene| shorten(&mut colors(scene).records)),
    ("codebook", |scene| colors(scene).degree = 3),
    ("degree", |scene| colors(scene).degree = 4),
    ("degree", |scene| colors(scene).degree_t = 3),
    ("ranges", |scene| packed(scene).ranges.truncate(3)),
    ("ranges", |scene| packed(scene).ranges.clear()),
    ("ranges", |scene| packed(scene).records.extend([[0; RECORD_WORDS]; 256])),
    ("range", |scene| packed(scene).ranges[4][2] = f32::INFINITY),
    ("rotation", |scene| packed(scene).records[COUNT - 1][RECORD_WORDS - 1] |= 4 << 16),
    ("colors", |scene| whole(scene, 4, 1, COUNT * 12 - 1)),
    ("colors", |scene| whole(scene, 4, 2, COUNT * 12)),
    ("filter", |scene| sets(scene, shorten)),
    ("filter", |scene| scene.filter.as_mut().expect("a filter").count += 1),
    ("filter", |scene| scene.filter.as_mut().expect("a filter").segments = 0),
    ("interval", |scene| interval(scene, 3, 9)),
    ("texels", |scene| shorten(&mut scene.environment.as_mut().expect("a map").texels)),
    ("texels", |scene| scene.environment.as_mut().expect("a map").width = 0),
    ("finite", |scene| scene.environment.as_mut().expect("a map").texels[17] = f32::NEG_INFINITY),
];

#[test]
fn consistent_scenes_are_accepted() {
    assert_eq!(good().check(), Ok(()), "a compressed scene");
    let edits: [fn(&mut RuntimeScene); 4] = [
        |scene| interval(scene, 3, 8),
        |scene| interval(scene, 1, 0),
        |scene| whole(scene, 9, 2, COUNT * 27),
        |scene| scene.filter = None,
    ];
    for edit in edits {
        let mut scene = good();
        edit(&mut scene);
        assert_eq!(scene.check(), Ok(()), "a changed scene that is consistent");
    }
    let empty = RuntimeScene::sliced(Vec::new(), Harmonics { coefficients: 1, ..Harmonics::default() });
    assert_eq!(empty.check(), Ok(()), "no Gaussians");
}

#[test]
fn inconsistent_scenes_are_refused() {
    for (index, (word, change)) in WRONG.into_iter().enumerate() {
        let mut scene = good();
        change(&mut scene);
        let reason = scene.check().expect_err(word);
        assert!(reason.contains(word), "{index}: {word} is not in: {reason}");
        let written = package::write(Vec::new(), &GaussianScene::from(scene), &WriteSettings::default());
        assert!(written.is_err(), "{index}: the scene is not written: {reason}");
    }
}

#[test]
fn numbers_that_overflow_when_they_are_decoded_are_named() {
    let mut scene = good();
    // The second block begins with Gaussian 256; ranges are finite, but not their sum.
    packed(&mut scene).ranges[5] = [f32::MAX; 4];
    packed(&mut scene).ranges[6] = [f32::MAX; 4];
    assert_eq!(scene.check(), Ok(()), "the parts are consistent");
    let error = GaussianScene::from(scene).into_runtime().expect_err("some Gaussian cannot be drawn");
    assert!((256..512).contains(&error.index), "{error}");
}

#[test]
fn lower_degrees_keep_the_other_coefficients() {
    for (degree, degree_t) in [(3, 2), (3, 1), (3, 0), (2, 0), (1, 0)] {
        let scene = GaussianScene::from(coded_scene(70, degree, degree_t));
        for (low, low_t) in [(3, 2), (3, 1), (3, 0), (2, 2), (1, 0), (0, 0)] {
            let mut lowered = scene.clone();
            lowered.form.truncate_colors(low, low_t);
            assert_eq!(lowered.check(), Ok(()), "{degree} and {degree_t} to {low} and {low_t}");
            let mut file = Vec::new();
            package::write(&mut file, &lowered, &WriteSettings { level: 1 }).expect("the package can be written");
            assert!(package::read(Cursor::new(&file)).expect("the package can be read") == lowered, "every bit");
            let mut expected = scene.clone().unpacked();
            expected.form.truncate_colors(low, low_t);
            assert!(
                lowered.unpacked() == expected,
                "{degree} and {degree_t} to {low} and {low_t}: the other coefficients are unchanged"
            );
        }
    }
}

#[test]
fn inconsistent_packages_are_not_written() {
    let mut scene = good();
    packed(&mut scene).ranges[0][1] = f32::INFINITY;
    let error = package::write(Vec::new(), &GaussianScene::from(scene), &WriteSettings::default());
    assert!(matches!(error, Err(PackageError::Inconsistent(_))), "{error:?}");
}
