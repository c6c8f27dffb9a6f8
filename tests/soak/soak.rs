//! The soak test: an app that is changed at random.
//!
//! In: a seed and the end of the test. Out: the closing line, if the app's pictures equal those of new apps in the same
//! state, its log has no warnings and its memory is freed; else the first defect, with the options that reproduce it.

use crate::changes::Changes;
use crate::checks;
use crate::memory::{Memory, allocated, mebibytes, resident};
use crate::options::{Fresh, Options, Until};
use crate::stage::Stage;
use bevy_gs4d::testing;
use image::RgbaImage;
use std::collections::VecDeque;
use std::env;
use std::process::Command;
use std::time::Instant;

/// Number of last changes that are printed with a defect.
const PRINTED: usize = 20;

/// The last changes. Dropping it prints them after a defect, including a panic.
struct Tail {
    seed: u64,
    step: u64,
    changes: VecDeque<String>,
    /// Whether the end was reached without a defect.
    holds: bool,
}

impl Tail {
    fn record(&mut self, step: u64, change: String) {
        self.step = step;
        self.changes.push_back(format!("{step}: {change}"));
        if self.changes.len() > PRINTED {
            self.changes.pop_front();
        }
    }
}

impl Drop for Tail {
    fn drop(&mut self) {
        if !self.holds {
            self.changes.iter().for_each(|change| println!("    {change}"));
            println!("    again: --seed {} --steps {}", self.seed, self.step);
        }
    }
}

/// Counts of comparisons.
#[derive(Default)]
struct Compared {
    checks: u64,
    pictures: u64,
    shown: u64,
}

/// Changes an app until the end of the test.
///
/// # Errors
/// The first defect.
pub fn run(options: &Options, until: Until) -> Result<String, String> {
    let mut tail = Tail { seed: options.seed, step: 0, changes: VecDeque::new(), holds: false };
    let line = change(options, until, &mut tail)?;
    tail.holds = true;
    Ok(line)
}

fn change(options: &Options, until: Until, tail: &mut Tail) -> Result<String, String> {
    println!("soak: seed {}", options.seed);
    let began = Instant::now();
    let mut changes = Changes::new(options.seed);
    while changes.step < options.from {
        changes.advance();
    }
    let mut stage = Stage::new(&changes.state, &[])?;
    let (mut memory, mut compared) = (Memory::default(), Compared::default());
    while changes.step < until.steps && (began.elapsed() < until.time || !changes.is_check()) {
        let change = changes.advance();
        tail.record(changes.step, change);
        stage.show(&changes.state)?;
        for _ in 0..=changes.step % 3 {
            stage.update()?;
        }
        if changes.is_check() {
            compare(options, changes.step, &mut stage, &mut compared)?;
            let [allocated, resident] = [allocated(), resident().unwrap_or_default()].map(mebibytes);
            let (step, seconds) = (changes.step, began.elapsed().as_secs());
            println!("step {step}: equal to a new app, {allocated} allocated, {resident} resident, {seconds} s");
        } else if changes.is_clearing() {
            stage.wait_until_empty()?;
            memory.record();
        }
    }
    let Compared { checks, pictures, shown } = compared;
    if checks > 0 && shown == 0 {
        return Err("all compared pictures are empty".to_owned());
    }
    let (steps, updates, seconds) = (changes.step, stage.updates, began.elapsed().as_secs());
    Ok(format!(
        "soak: {steps} changes, {updates} updates, {checks} checks, {pictures} pictures equal to those of new apps, \
         {shown} not empty; {}; {seconds} s",
        memory.verdict()?
    ))
}

/// Compares all pictures of an app with those of a new app in a separate process, so that the state of one process
/// cannot affect the pictures of the other.
fn compare(options: &Options, step: u64, stage: &mut Stage, compared: &mut Compared) -> Result<(), String> {
    let seen = stage.pictures()?;
    let folder = tempfile::tempdir().map_err(|error| format!("no temporary folder: {error}"))?;
    let program = env::current_exe().map_err(|error| format!("the path of this program is unknown: {error}"))?;
    let order: Vec<String> = stage.order().iter().map(u64::to_string).collect();
    let mut command = Command::new(program);
    command.args([format!("--seed={}", options.seed), format!("--fresh={step}")]).arg("--pictures").arg(folder.path());
    if !order.is_empty() {
        command.arg(format!("--order={}", order.join(",")));
    }
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    if !output.status.success() {
        let text = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned()).concat();
        return Err(format!("a new app in the same state fails: {text}"));
    }
    for (index, seen) in seen.iter().enumerate() {
        let path = folder.path().join(format!("{index}.png"));
        let fresh = image::open(&path).map_err(|error| format!("{}: {error}", path.display()))?.into_rgba8();
        if let Err(apart) = checks::check_same(seen, &fresh) {
            for (name, picture) in [("seen", seen), ("new", &fresh)] {
                let Some(keep) = &options.keep else { continue };
                testing::save(picture, &keep.join(format!("{step}-{index}-{name}.png")))
                    .map_err(|error| error.to_string())?;
            }
            return Err(format!("the picture of camera {index} {apart}"));
        }
        compared.pictures += 1;
        compared.shown += u64::from(checks::shows_something(seen));
    }
    compared.checks += 1;
    Ok(())
}

/// Draws the state after some changes in a new app and writes its pictures. The process draws no other state.
///
/// # Errors
/// The state cannot be drawn, or the pictures cannot be written.
pub fn draw_fresh(seed: u64, fresh: &Fresh) -> Result<(), String> {
    let mut changes = Changes::new(seed);
    while changes.step < fresh.step {
        changes.advance();
    }
    let mut stage = Stage::new(&changes.state, &fresh.order)?;
    stage.show(&changes.state)?;
    let pictures: Vec<RgbaImage> = stage.pictures()?;
    for (index, picture) in pictures.iter().enumerate() {
        let path = fresh.folder.join(format!("{index}.png"));
        testing::save(picture, &path).map_err(|error| error.to_string())?;
    }
    Ok(())
}
