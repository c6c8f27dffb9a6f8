//! The soak test of the plugin, and the test of cuts: after any sequence of changes to captures and cameras, an app
//! draws the same pictures as a new app in the same state, from the first frame on.
//!
//! In: a seed. Out: a program that changes an app with captures at random, and cuts in another app. It prints the first
//! defect with the options that reproduce it, and at the end a line of counts for each of the two tests; the exit code
//! is 1 after a defect. `docs/reliability.md` lists the checks. Without a GPU (a software driver counts) the program
//! skips both tests.
//!
//! ```sh
//! cargo test --features viewer,cli --test soak                             # 100 changes and 40 cuts of seed 1
//! cargo test --release --features viewer,cli --test soak -- --seed 7 --minutes 60
//! cargo test --release --features viewer,cli --test soak -- --seed 7 --cuts 10000
//! cargo test --features viewer,cli --test soak -- --seed 7 --steps 1234    # up to a defect
//! ```
//!
//! The changes depend on the seed and the number of the change only. The times at which files are loaded vary between
//! runs.

mod changes;
mod checks;
mod cuts;
mod memory;
mod options;
mod soak;
mod stage;
mod state;

#[path = "../support"]
mod support {
    pub mod allocations;
    pub mod coded_scene;
    pub mod harness;
    pub mod pipelines;
    pub mod random;
    pub mod skip;
    pub mod warning_layer;
}

use bevy_gs4d::testing::{self, TestingError};
use options::Options;
use std::process::ExitCode;
use support::skip::skip;

fn main() -> ExitCode {
    let options = Options::of_command_line();
    if !testing::has_gpu() {
        skip(TestingError::NoGpu);
        return ExitCode::SUCCESS;
    }
    let mut outcomes = Vec::new();
    if let Some(fresh) = options.fresh() {
        outcomes.push(soak::draw_fresh(options.seed, &fresh).map(|()| "drawn".to_owned()));
    } else {
        outcomes.extend(options.changes().map(|until| soak::run(&options, until)));
        outcomes.extend(options.cuts().map(|number| cuts::run(options.seed, number)));
    }
    for outcome in &outcomes {
        match outcome {
            Ok(line) => println!("{line}"),
            Err(defect) => println!("DEFECT {defect}"),
        }
    }
    if outcomes.iter().all(Result::is_ok) { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
