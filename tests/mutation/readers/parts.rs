//! Parts of shards: of scores, masks and evaluations.
//!
//! In: parts that `gs4d` has made. Out: a part with another label or another result, behind the right hash; all parts
//! of the computation are put together, and what is accepted gives scores, a filter that fits the scene, or metrics.
//!
//! An input is the name of the file, a line break, the label, a line break, and the result.

use super::{Outcome, Reader};
use crate::change::{bytes, numbers, text};
use crate::support::dataset;
use crate::support::random::Random;
use bevy_gs4d::codec::package::WriteSettings;
use bevy_gs4d::internal::offline::filter;
use bevy_gs4d::internal::offline::measure;
use bevy_gs4d::internal::offline::score;
use bevy_gs4d::internal::offline::store::{self, Label};
use bevy_gs4d::offline;
use bevy_gs4d::offline::score::Variant;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use bevy_gs4d::scene::{FilterKind, TemporalFilter};
use glam::{UVec2, Vec3};
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use tempfile::TempDir;

/// Gaussians of the scene, key-frames of the masks, test views.
const COUNT: usize = 60;
const KEYS: u32 = 3;
const VIEWS: usize = 4;
/// Most bytes of a result.
const MOST: usize = 1 << 20;
/// The computations, each in two shards.
const VERBS: [&str; 3] = ["score", "mask", "eval"];

/// The reader of parts.
pub struct Parts {
    folder: TempDir,
    seeds: Vec<Seed>,
}

struct Seed {
    name: String,
    label: Label,
    text: String,
    result: Vec<u8>,
}

impl Parts {
    /// Makes the parts.
    pub fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [input, data] = ["scene.gs4d", "data"].map(|name| folder.path().join(name));
        let scene = synthesize(&SynthSettings { count: COUNT, degree: 0, ..SynthSettings::default() });
        offline::work::save(&input, &scene, &WriteSettings::default()).expect("the folder can be written to");
        let runtime = scene.into_runtime().expect("a synthetic scene can be drawn");
        dataset::write(&data, &runtime, Vec3::ZERO, 2, VIEWS / 2, UVec2::splat(24), true);
        let mut seeds = Vec::new();
        for verb in VERBS {
            for shard in ["0/2", "1/2"] {
                let (name, keys) = (format!("{verb}-{}.gs4p", &shard[..1]), KEYS.to_string());
                let path = folder.path().join(&name);
                let mut command = Command::new(env!("CARGO_BIN_EXE_gs4d"));
                command
                    .arg(verb)
                    .arg(&input)
                    .arg("--data")
                    .arg(&data)
                    .args(["--engine", "cpu", "--shard", shard, "-o"]);
                let of_mask = ["--filter", "interval", "--key-frames", &keys];
                command.arg(&path).args(match verb {
                    "score" => &["--variant", "full"][..],
                    "mask" => &of_mask,
                    _ => &[],
                });
                let run = command.output().expect("the command starts");
                assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
                let label = store::label(&path).expect("a part");
                let result = store::result(&path, MOST).expect("a part");
                let text = ron::to_string(&label).expect("a label is text");
                seeds.push(Seed { name, label, text, result });
            }
        }
        Self { folder, seeds }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }
}

/// Returns the file of a part with this label.
fn file(label: &[u8], result: &[u8]) -> Vec<u8> {
    let result = zstd::bulk::compress(result, 1).expect("bytes can be compressed");
    let contents = [&(label.len() as u32).to_le_bytes()[..], label, &result].concat();
    [b"GS4P", &1u32.to_le_bytes()[..], blake3::hash(&contents).as_bytes(), &contents].concat()
}

impl Reader for Parts {
    fn input(&self, random: &mut Random) -> Vec<u8> {
        let Seed { name, text: label, result, .. } = random.pick(&self.seeds);
        let other = random.pick(&self.seeds);
        let (mut label, mut result) = (label.clone(), result.clone());
        if random.one_in(4) {
            label = text::change(&label, &other.text, random);
        } else if name.starts_with("eval") && !random.one_in(8) {
            let words = String::from_utf8_lossy(&result).into_owned();
            result = text::change(&words, &words, random).into_bytes();
        } else if random.one_in(2) {
            let at = random.below(result.len() / 4) * 4;
            let (whole, float) = (numbers::whole(random) as u32, numbers::float(random).to_bits());
            let word = if random.one_in(2) { whole } else { float };
            result[at..at + 4].copy_from_slice(&word.to_le_bytes());
        } else {
            bytes::change(&mut result, &other.result, random);
        }
        [name.as_bytes(), b"\n", label.replace('\n', " ").as_bytes(), b"\n", &result].concat()
    }

    fn read(&self, bytes: &[u8]) -> Result<Outcome, String> {
        let mut pieces = bytes.splitn(3, |&byte| byte == b'\n');
        let mut next = || pieces.next().unwrap_or_default();
        let (name, label, result) = (next(), next(), next());
        let Some(at) = self.seeds.iter().position(|seed| seed.name.as_bytes() == name) else {
            return Ok(Outcome::Refused("no part".to_owned()));
        };
        let (seed, partner) = (&self.seeds[at], &self.seeds[at ^ 1]);
        let paths = [self.path(&format!("changed-{}", seed.name)), self.path(&partner.name)];
        fs::write(&paths[0], file(label, result)).expect("the folder can be written to");
        let outcome = match at / 2 {
            0 => score::merge(&paths, None).map_err(|error| error.to_string()).map(|scores| {
                let lengths = Variant::ALL.map(|variant| scores.of(variant).map_or(0, |scores| scores.len()));
                lengths.iter().all(|&length| length == COUNT)
            }),
            1 => {
                let filter = filter::merge(&paths, &partner.label, FilterKind::Interval, KEYS, COUNT);
                let fits = |filter: TemporalFilter| (filter.count, filter.segments) == (COUNT, KEYS - 1);
                filter.map_err(|error| error.to_string()).map(fits)
            }
            _ => {
                let all = measure::merge(&paths, &partner.label, VIEWS);
                all.map_err(|error| error.to_string()).map(|all| all.views.len() == VIEWS)
            }
        };
        match outcome {
            Ok(true) => Ok(Outcome::Accepted),
            Ok(false) => Err("is put together to a result of another size".to_owned()),
            Err(reason) => Ok(Outcome::Refused(reason)),
        }
    }
}
