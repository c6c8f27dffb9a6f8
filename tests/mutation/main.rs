//! Changed files for every reader: whatever a file contains, reading it ends within a time limit with an error or a
//! drawable scene.
//!
//! In: the files of `tests/corpus/`, then seeds made here by the crate's own writers and changed: valid containers
//! around wrong contents, and noise. Out: a program that runs the readers on them, reports every defect with a command
//! that repeats it, and ends with a line of counts; exit code 1 if there was a defect. `docs/reliability.md` lists the
//! checks.
//!
//! ```sh
//! cargo test --features viewer,cli --test mutation   # the corpus and a few inputs, always the same
//! cargo test --release --no-default-features --features cli --test mutation -- --seed 7 --seconds 14400 --keep found
//! cargo test --features viewer,cli --test mutation -- --seed 7 --reader package --input 1234
//! cargo test --features viewer,cli --test mutation -- --seed 7 --reader package --draw   # on the GPU, too
//! ```
//!
//! An input depends only on the seed, its reader and its number.

mod accepted;
mod change;
mod designs;
mod limits;
mod memory;
mod options;
mod readers;
mod rounding;
mod self_test;
mod trials;
mod watch;

#[path = "../support"]
mod support {
    pub mod allocations;
    pub mod dataset;
    pub mod gpu;
    pub mod gzip;
    pub mod harness;
    pub mod no_gpu;
    pub mod packed_scene;
    pub mod pth;
    pub mod random;
    pub mod skip;
}

use options::Options;
use readers::{KINDS, Kind, Reader};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Arc;
use std::time::Instant;
use support::random::Random;
use trials::{Input, Trials};

fn main() -> ExitCode {
    let options = Options::of_command_line();
    let known: Vec<&str> = KINDS.iter().map(|kind| kind.name).collect();
    if let Some(reader) = options.unknown_reader(&known) {
        println!("no reader is named {reader}; --list lists them");
        return ExitCode::FAILURE;
    }
    let kinds = KINDS.iter().filter(|kind| options.want(kind.name));
    if options.list {
        kinds.for_each(|kind| println!("{}: {}", kind.name, kind.about));
        return ExitCode::SUCCESS;
    }
    watch::record_panics();
    if options.draw {
        designs::open();
    }
    self_test::run();
    let readers: Vec<(&Kind, Arc<dyn Reader>)> = kinds.map(|kind| (kind, (kind.make)())).collect();
    let mut trials = Trials::new(options.seed, options.keep.clone());
    match (&options.file, options.input) {
        (Some(path), _) => give_files(&mut trials, &readers, path),
        (None, Some(number)) => give_one(&mut trials, &readers, options.seed, number),
        (None, None) => give_all(&mut trials, &readers, &options),
    }
    if trials.close() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// Runs each reader on its corpus, then on the requested number of inputs, all readers in turn.
fn give_all(trials: &mut Trials, readers: &[(&Kind, Arc<dyn Reader>)], options: &Options) {
    let start = Instant::now();
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus");
    for (kind, reader) in readers {
        for input in files(&corpus.join(kind.name)) {
            if trials.give(kind, reader, input).is_none() {
                return;
            }
        }
    }
    let mut number = 0;
    while !options.is_over(number, start) && !readers.is_empty() {
        for (kind, reader) in readers.iter().filter(|(kind, _)| number.is_multiple_of(kind.share)) {
            let input = input(kind, reader.as_ref(), options.seed, number);
            if trials.give(kind, reader, input).is_none() {
                return;
            }
        }
        number += 1;
    }
}

/// Runs a reader on one input and prints the outcome.
fn give_one(trials: &mut Trials, readers: &[(&Kind, Arc<dyn Reader>)], seed: u64, number: u64) {
    for (kind, reader) in readers {
        let outcome = trials.give(kind, reader, input(kind, reader.as_ref(), seed, number));
        println!("{} {number}: {outcome:?}", kind.name);
    }
}

/// Runs a reader on a file, or on each file of a folder, and prints the outcomes.
fn give_files(trials: &mut Trials, readers: &[(&Kind, Arc<dyn Reader>)], path: &Path) {
    for (kind, reader) in readers {
        for input in files(path) {
            let name = input.name.clone();
            println!("{name}: {:?}", trials.give(kind, reader, input));
        }
    }
}

/// Returns the input of a reader with this number.
fn input(kind: &Kind, reader: &dyn Reader, seed: u64, number: u64) -> Input {
    let mut stream = Random::new(seed ^ (u64::from(crc32fast::hash(kind.name.as_bytes())) << 32));
    let mut random = Random::new(stream.bits() ^ number.wrapping_mul(0xD134_2543_DE82_EF95));
    Input { name: number.to_string(), bytes: reader.input(&mut random), accepted: None }
}

/// Returns a file, or the files of a folder by name, as inputs. Files whose names begin with `refused-` must be
/// refused, files whose names begin with `accepted-` accepted.
fn files(path: &Path) -> Vec<Input> {
    let mut paths: Vec<PathBuf> = match fs::read_dir(path) {
        Ok(entries) => entries.map(|entry| entry.expect("the folder can be listed").path()).collect(),
        Err(_) if path.is_file() => vec![path.to_owned()],
        // A reader without a corpus.
        Err(_) => Vec::new(),
    };
    paths.sort();
    let input = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let wanted = [("refused-", false), ("accepted-", true)].into_iter().find(|(start, _)| name.starts_with(start));
        let accepted = wanted.map(|(_, accepted)| accepted);
        let bytes = fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        Input { name: path.display().to_string(), bytes, accepted }
    };
    paths.iter().map(input).collect()
}
