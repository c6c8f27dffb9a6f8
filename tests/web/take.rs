//! A capture in chunk files, for the pages.
//!
//! In: a synthetic scene. Out: the scene, and its index and files as they lie on the server.

use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::gaussian::Harmonics;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{ChunkFile, ChunkTable, Form, GaussianScene, RuntimeScene, Sliced, TemporalFilter};
use std::collections::BTreeMap;

const COUNT: usize = 4000;
/// Stretches of time, and seconds of each.
const STRETCHES: u32 = 4;
const SECONDS: f32 = 0.5;

/// A capture and its chunk files.
pub struct Take {
    pub scene: RuntimeScene,
    /// The index and the files, by name.
    pub files: BTreeMap<String, Vec<u8>>,
    /// The file of the index and all chunk files.
    pub one: Vec<u8>,
    /// The names of the files of layer 1, and of that of layer 0 of the last stretch alone.
    pub finer: Vec<String>,
    pub last: Vec<String>,
}

impl Take {
    /// Cuts a synthetic scene into two layers, and into files of a stretch of time each, and one of all.
    pub fn new() -> Self {
        let settings = SynthSettings { count: COUNT, seed: 7, degree: 1, ..SynthSettings::default() };
        let mut scene = synthesize(&settings).into_runtime().expect("synthetic scenes are valid");
        scene.playback.duration_seconds = STRETCHES as f32 * SECONDS;
        let (interval, cutoff) = (scene.trained_with.time_interval, scene.trained_with.marginal_cutoff);
        let filter = TemporalFilter::support(scene.iter(), interval, cutoff, STRETCHES);
        let mut by_importance: Vec<f32> = scene.iter().map(|gaussian| gaussian.importance()).collect();
        by_importance.sort_unstable_by(f32::total_cmp);
        let median = by_importance[COUNT / 2];
        let mut parts: BTreeMap<([u32; 2], u32), Vec<u32>> = BTreeMap::new();
        for (index, gaussian) in (0..).zip(scene.iter()) {
            let active: Vec<u32> = (0..STRETCHES).filter(|&at| filter.is_active(at, index as usize)).collect();
            let stretches = match active[..] {
                [only] => [only; 2],
                _ => [0, STRETCHES - 1],
            };
            parts.entry((stretches, u32::from(gaussian.importance() < median))).or_default().push(index);
        }
        assert!(parts.len() > 5, "stretches have files of their own: {:?}", parts.keys());
        let gaussian_bytes = GaussianScene::from(scene.clone()).gaussian_bytes();
        let mut table = ChunkTable {
            stretches: STRETCHES,
            gaussian_bytes,
            files: Vec::new(),
            utilities: Vec::new(),
            first_byte: None,
        };
        let (mut files, mut finer, mut last) = (BTreeMap::new(), Vec::new(), Vec::new());
        for (number, ((stretches, layer), own)) in parts.iter().enumerate() {
            let bytes = written(selected(&scene, own));
            let (gaussians, length) = (own.len() as u64, bytes.len() as u64);
            table.files.push(ChunkFile { stretches: *stretches, layer: *layer, gaussians, bytes: length });
            let name = ChunkTable::file_name(number, parts.len());
            finer.extend((*layer > 0).then(|| name.clone()));
            last.extend((*layer == 0 && *stretches == [STRETCHES - 1; 2]).then(|| name.clone()));
            files.insert(name, bytes);
        }
        let index = RuntimeScene { chunks: Some(table.into()), ..selected(&scene, &[]) };
        let mut one = Vec::new();
        let settings = WriteSettings::default();
        package::write_index(&mut one, &index.clone().into(), &settings).expect("the index can be written");
        // In the order of their names, which is that of the table.
        files.values().for_each(|file| one.extend_from_slice(file));
        files.insert(ChunkTable::INDEX.to_owned(), written(index));
        assert_eq!(last.len(), 1, "the last stretch has Gaussians of its own");
        Self { scene, files, one, finer, last }
    }
}

/// Returns some Gaussians of a scene.
fn selected(scene: &RuntimeScene, own: &[u32]) -> RuntimeScene {
    let Form::Sliced(Sliced { gaussians, harmonics }) = &scene.form else { panic!("a sliced scene") };
    let stride = harmonics.values.len() / COUNT;
    let values = own.iter().flat_map(|&index| &harmonics.values[index as usize * stride..][..stride]).copied();
    let form = Form::Sliced(Sliced {
        gaussians: own.iter().map(|&index| gaussians[index as usize]).collect(),
        harmonics: Harmonics { values: values.collect(), ..harmonics.clone() },
    });
    RuntimeScene { form, ..scene.clone() }
}

fn written(scene: RuntimeScene) -> Vec<u8> {
    let mut package = Vec::new();
    package::write(&mut package, &scene.into(), &WriteSettings::default()).expect("the scene can be written");
    package
}
