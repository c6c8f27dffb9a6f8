//! A soak of the plugin, and cuts: whatever a game does with captures, an app draws what a new one would, from the first frame on.
//!
//! In: a seed. Out: a program that changes an app with captures at random, and cuts another, tells the first defect and how to have it
//! again, and ends with a line of counts for each; exit code 1 if there was a defect. `docs/reliability.md` lists what is watched. It does
//! nothing where there is no GPU, not even a software one.
//!
//! ```sh
//! cargo test --features viewer,cli --test soak                             # a few of both, always the same
//! cargo test --release --features viewer,cli --test soak -- --seed 7 --minutes 60
//! cargo test --release --features viewer,cli --test soak -- --seed 7 --cuts 10000
//! cargo test --features viewer,cli --test soak -- --seed 7 --steps 1234    # as far as a defect
//! ```
//!
//! What is changed follows from the seed and the number of the change, and from nothing else; when files arrive does not.

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
    pub mod random;
    pub mod skip;
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
