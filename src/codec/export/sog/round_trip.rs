//! Tests of the SOG family: what is written is read again.
//!
//! In: Gaussians made here. Out: proof that the scene of their file has them, within the steps of the codes; the file.

use super::archive::Entry;
use crate::codec::export::clip::Clip;
use crate::codec::export::table::{Export, What};
use crate::codec::import::columns::{Columns, Motion, logit};
use crate::codec::import::source::{InMemory, Source};
use crate::codec::import::testing::gaussians_of_columns;
use crate::codec::import::{Imported, sog};
use crate::codec::options::ReadOptions;
use crate::gaussian::{Gaussian, Harmonics, SMALLEST_CUTOFF};
use crate::scene::random::Random;
use crate::scene::{Form, GaussianScene, SceneForm, Sliced, UpAxis};
use glam::Vec3;
use serde_json::Value;
use std::io::{Cursor, Read};
use zip::ZipArchive;

/// Gaussians in three clumps, most of them short, one in 50 at rest and always there.
pub(super) fn columns(count: usize, degree: u32) -> Columns {
    let mut random = Random::new(7);
    let mut number = |size: f32| (random.unit() - 0.5) * size;
    let coefficients = (degree as usize + 1).pow(2);
    let mut columns = Columns {
        harmonics: Harmonics { coefficients, degree, degree_t: 0, values: Vec::new() },
        ..Columns::default()
    };
    for index in 0..count {
        let is_always = index % 50 == 0;
        columns.mean.push([number(1.0) + (index % 3) as f32 * 4.0, number(1.0), number(1.0) - 30.0]);
        columns.log_scale.push([0, 1, 2].map(|_| number(3.0) - 4.0));
        columns.rotation.push([0, 1, 2, 3].map(|_| number(2.0)));
        columns.opacity_logit.push(logit(0.5 + number(0.9)));
        columns.harmonics.values.extend((0..coefficients * 3).map(|at| number(if at < 3 { 2.0 } else { 0.4 })));
        columns.motion.push(if is_always {
            Motion { velocity: [0.0; 3], mean_t: 0.0, sigma_t: f32::INFINITY }
        } else {
            Motion {
                velocity: [0, 1, 2].map(|_| number(2.0)),
                mean_t: number(5.0) + 12.0,
                sigma_t: (number(2.0) - 2.0).exp(),
            }
        });
    }
    columns
}

fn clip() -> Clip {
    Clip {
        time_interval: [10.0, 14.0],
        duration_seconds: 2.0,
        fps: 30.0,
        up: UpAxis::NegY,
        marginal_cutoff: SMALLEST_CUTOFF,
    }
}

pub(super) fn written(id: &str, columns: &Columns) -> Vec<u8> {
    let export = Export::of_id(id).expect("in the table");
    let (What::Instant(write) | What::Moving(write)) = export.what else { panic!("{id} is written from columns") };
    let mut bytes = Vec::new();
    write(columns, &clip(), &mut bytes).expect("memory can be written");
    bytes
}

pub(super) fn read(bytes: &[u8]) -> Result<Imported, String> {
    let source = Source { bytes, beside: &InMemory::default() };
    sog::read(&source, &ReadOptions::default()).map_err(|error| error.to_string())
}

fn sliced(scene: GaussianScene) -> Sliced {
    match scene.form {
        SceneForm::Ready(Form::Sliced(sliced)) => sliced,
        form => panic!("moving Gaussians are sliced: {form:?}"),
    }
}

#[test]
fn a_sogst_is_read_with_its_motion() {
    let columns = columns(6000, 2);
    let before = gaussians_of_columns(&columns);
    let Imported { scene, lost } = read(&written("sogst", &columns)).expect("intact");
    assert_eq!(lost, [""; 0], "nothing is lost");
    assert_eq!(scene.trained_with.time_interval, [0.0, 2.0], "seconds from 0, since timestamps are no seconds");
    assert_eq!((scene.playback.duration_seconds, scene.playback.up), (2.0, UpAxis::NegY), "as players show it");
    let Sliced { gaussians: after, harmonics } = sliced(scene);
    assert_eq!((after.len(), harmonics.degree), (before.len(), 2), "all Gaussians with their color");
    let (mut envelope, mut colors) = (0.0, 0.0);
    for (index, own) in after.iter().enumerate() {
        let second = own.mean_t;
        // Gaussians are told apart by where they are; a second is two timestamp units.
        let distance = |other: &Gaussian| other.mean_at(10.0 + 2.0 * second).distance(Vec3::from(own.mean));
        let (nearest, other) =
            before.iter().enumerate().min_by(|a, b| distance(a.1).total_cmp(&distance(b.1))).expect("there are some");
        assert!(distance(other) < 2e-3, "Gaussian {index}: {} from its path", distance(other));
        let later = second + 0.5;
        let moved = other.mean_at(10.0 + 2.0 * later).distance(own.mean_at(later));
        assert!(moved < 4e-3, "Gaussian {index}: {moved} from its path half a second later");
        assert!((other.opacity - own.opacity).abs() < 0.003, "Gaussian {index}: opacity");
        let volume = |gaussian: &Gaussian| {
            let [xx, _, _, yy, _, zz] = gaussian.covariance;
            xx + yy + zz
        };
        assert!((volume(other) / volume(own) - 1.0).abs() < 0.05, "Gaussian {index}: scales");
        if other.sigma_t.is_infinite() {
            assert!(own.marginal(0.0) == 1.0 && own.marginal(2.0) == 1.0, "Gaussian {index} is always there");
        } else {
            envelope += f64::from(other.mean_t - (10.0 + 2.0 * second)).abs() / f64::from(other.sigma_t);
            assert!((other.sigma_t / (2.0 * own.sigma_t) - 1.0).abs() < 0.02, "Gaussian {index}: lifespan");
        }
        let color = |harmonics: &Harmonics, index: usize| harmonics.color(index, Vec3::new(0.48, -0.6, 0.64), 0.0, 1.0);
        colors += f64::from(color(&columns.harmonics, nearest).distance_squared(color(&harmonics, index)));
    }
    let count = after.len() as f64;
    assert!(envelope / count < 0.05, "lifespans move by {} of their deviation", envelope / count);
    assert!((colors / count).sqrt() < 0.15, "colors differ by {}", (colors / count).sqrt());
}

#[test]
fn a_sog_is_read_with_its_attributes() {
    let mut columns = columns(3000, 3);
    columns.motion.clear();
    let bytes = written("sog", &columns);
    let Imported { scene, lost } = read(&bytes).expect("intact");
    assert_eq!(lost, [""; 0], "nothing is lost");
    let SceneForm::Trained(trained) = scene.form else { panic!("Gaussians at rest are in the trained form") };
    let after = trained.parameters;
    assert_eq!((after.len(), trained.harmonics.degree), (3000, 3), "all Gaussians with their color");
    for index in 0..after.len() {
        let distance = |other: &[f32; 3]| Vec3::from(*other).distance(Vec3::from(after.mean[index]));
        let nearest = (0..3000).min_by(|&a, &b| distance(&columns.mean[a]).total_cmp(&distance(&columns.mean[b])));
        let nearest = nearest.expect("there are some");
        assert!(distance(&columns.mean[nearest]) < 1e-3, "Gaussian {index}: mean");
        for (a, b) in after.log_scale[index].into_iter().zip(columns.log_scale[nearest]) {
            assert!((a - b).abs() < 0.01, "Gaussian {index}: scale {a} is {b}");
        }
        let unit = |q: [f32; 4]| glam::Vec4::from(q).normalize();
        let cosine = unit(after.rotation_l[index]).dot(unit(columns.rotation[nearest])).abs();
        assert!(cosine > 0.9999, "Gaussian {index}: rotation, cosine {cosine}");
    }
    assert_eq!(written("sog", &columns), bytes, "the same Gaussians always give the same file");
}

#[test]
fn a_capture_without_gaussians_is_written_and_read() {
    let none = columns(0, 1);
    for id in ["sog", "sogst"] {
        let scene = read(&written(id, &none)).map(|imported| imported.scene);
        assert_eq!(scene.map(|scene| scene.len()), Ok(0), "{id}");
    }
}

#[test]
fn offsets_of_a_stream_are_those_of_its_entries() {
    let bytes = written("sogst", &columns(2000, 1));
    let (meta, entries) = unpacked(&bytes);
    assert_eq!(entries[0].name, "meta.json", "a player needs it first");
    let mut offset = 0;
    let ends: Vec<(&str, usize)> = entries
        .iter()
        .map(|entry| {
            offset += entry.size();
            (&*entry.name, offset)
        })
        .collect();
    let colors = ends.iter().position(|(name, _)| name.contains("shN")).expect("has coefficients");
    assert!(ends[colors..].iter().all(|(name, _)| name.contains("shN")), "view-dependent color is last");
    assert_eq!(meta["streams"]["geometry_bytes"], ends[colors - 1].1, "the end of everything else");
    let first = meta["streams"]["segments"].as_array().and_then(|names| names.iter().find_map(Value::as_str));
    let first = first.expect("has segments");
    let shown = ends.iter().rfind(|(name, _)| name.starts_with(first) && !name.contains("shN")).expect("has files");
    assert_eq!(meta["streams"]["reveal_bytes"], shown.1, "the end of the first segment");
}

/// Returns `meta.json` and all files of an archive.
pub(super) fn unpacked(bytes: &[u8]) -> (Value, Vec<Entry>) {
    let mut zip = ZipArchive::new(Cursor::new(bytes)).expect("an archive");
    let entries: Vec<Entry> = (0..zip.len())
        .map(|index| {
            let mut file = zip.by_index(index).expect("an entry");
            let mut bytes = Vec::new();
            file.read_to_end(&mut bytes).expect("intact");
            Entry { name: file.name().expect("a name").into_owned(), bytes }
        })
        .collect();
    let meta = entries.iter().find(|entry| entry.name == "meta.json").expect("is there");
    (serde_json::from_slice(&meta.bytes).expect("JSON"), entries)
}
