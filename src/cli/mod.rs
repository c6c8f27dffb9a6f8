//! The `gs4d` command: trains, inspects, converts, renders, measures and compresses captures.
//!
//! In: the command line. Out: one report on standard output (text, or one JSON document with `--json`); progress, notes
//! and errors on standard error; exit code 0, 2 for any failure, 101 for a panic, 128 + signal when interrupted (130
//! INT, 143 TERM).
//!
//! | module | subject |
//! |---|---|
//! | `verbs` | one file for each verb: its options, a call of [`offline`](crate::offline), its report |
//! | `args` | the options that verbs share |
//! | `output` | reports, failures and their remedies, progress, signals |
//! | `usage` | parsing of the command line |

mod args;
mod output;
#[cfg(test)]
mod remedies;
mod usage;
mod verbs;

use crate::offline::work::unfinished;
use clap::{Parser, Subcommand};
use output::failure::{FAILED, Failure};
use output::report::Report;
use output::{interrupt, note};
use std::env;
use std::ffi::OsString;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use verbs::{
    ablate, bake, bench, collide, compare, compress, convert, detail, edit, eval, export, fine_tune, fleet, footage,
    info, join, mask, prune, render, score, socket, sound, split, synth, train,
};

/// The exit code after a panic, a defect of this crate.
const PANICKED: u8 = 101;

/// Dynamic captures (native 4D Gaussian Splatting): train from pictures, inspect, convert, render, compare, benchmark,
/// compress.
#[derive(Parser)]
#[command(name = "gs4d", version, propagate_version = true, after_help = EXAMPLES)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,
    /// Print exactly one JSON document on standard output instead of text.
    #[arg(long, global = true)]
    json: bool,
}

const EXAMPLES: &str = "\
Examples:
  gs4d info chkpnt30000.pth
  gs4d footage videos -o pictures                       # what several cameras filmed becomes a dataset
  gs4d bake pictures -o capture.gs4d                    # from a dataset: trains, prunes, compresses
  gs4d bake chkpnt30000.pth --data pictures -o capture.gs4d
  gs4d render capture.gs4d --orbit 60 --out frames

gs4d VERB --help describes a verb. Exit codes: 0 done, 2 failed, 130 interrupted, 143 terminated.";

#[derive(Subcommand)]
enum Verb {
    Info(info::Info),
    Convert(convert::Convert),
    Export(export::ExportVerb),
    Render(render::Render),
    Compress(compress::Compress),
    Detail(detail::Detail),
    Edit(edit::EditVerb),
    Join(join::Join),
    Split(split::SplitVerb),
    Socket(socket::SocketVerb),
    Collide(collide::CollideVerb),
    Sound(sound::SoundVerb),
    Compare(compare::Compare),
    Synth(synth::Synth),
    Bench(bench::Bench),
    Score(score::Score),
    Prune(prune::Prune),
    Mask(mask::Mask),
    Eval(eval::Eval),
    Ablate(ablate::Ablate),
    Footage(footage::Footage),
    Train(train::Train),
    #[command(name = "finetune")]
    FineTune(fine_tune::FineTune),
    Bake(bake::Bake),
    #[command(name = "report")]
    Fleet(fleet::Fleet),
}

impl Verb {
    fn run(&self) -> Result<Report, Failure> {
        match self {
            Self::Info(verb) => verb.run(),
            Self::Convert(verb) => verb.run(),
            Self::Export(verb) => verb.run(),
            Self::Render(verb) => verb.run(),
            Self::Compress(verb) => verb.run(),
            Self::Detail(verb) => verb.run(),
            Self::Edit(verb) => verb.run(),
            Self::Join(verb) => verb.run(),
            Self::Split(verb) => verb.run(),
            Self::Socket(verb) => verb.run(),
            Self::Collide(verb) => verb.run(),
            Self::Sound(verb) => verb.run(),
            Self::Compare(verb) => verb.run(),
            Self::Synth(verb) => verb.run(),
            Self::Bench(verb) => verb.run(),
            Self::Score(verb) => verb.run(),
            Self::Prune(verb) => verb.run(),
            Self::Mask(verb) => verb.run(),
            Self::Eval(verb) => verb.run(),
            Self::Ablate(verb) => verb.run(),
            Self::Footage(verb) => verb.run(),
            Self::Train(verb) => verb.run(),
            Self::FineTune(verb) => verb.run(),
            Self::Bake(verb) => verb.run(),
            Self::Fleet(verb) => verb.run(),
        }
    }
}

/// Runs the command that the process was started with. Returns its exit code.
pub fn run() -> ExitCode {
    let arguments: Vec<OsString> = env::args_os().collect();
    let cli = match usage::parse::<Cli>(&arguments) {
        Ok(cli) => cli,
        Err(code) => return code,
    };
    note::silence_progress(cli.json);
    let (report, failed) = report_of(|| {
        interrupt::install(cli.json)?;
        cli.verb.run()
    });
    interrupt::begin_report();
    let printed = report.print(cli.json);
    interrupt::end_report();
    match printed {
        Ok(()) if report.interrupted => interrupt::end(),
        Ok(()) if report.failure.is_none() => ExitCode::SUCCESS,
        _ => ExitCode::from(failed),
    }
}

/// Runs a verb. Returns its report, also after a panic, and the exit code if it has failed.
fn report_of(verb: impl FnOnce() -> Result<Report, Failure>) -> (Report, u8) {
    match catch_unwind(AssertUnwindSafe(verb)) {
        Ok(Err(failure)) if failure.is_interruption() && interrupt::is_requested() => {
            (Report::of_interruption(&unfinished::existing()), FAILED)
        }
        Ok(outcome) => (outcome.unwrap_or_else(Report::of_failure), FAILED),
        Err(panic) => (Report::of_failure(Failure::of_panic(&*panic)), PANICKED),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io;

    #[test]
    fn panics_are_reported_as_other_failures() {
        let (report, code) = report_of(|| panic!("{} are too many", 7));
        let error = report.json["error"].as_str().expect("an error in the document");
        assert!(error.contains("7 are too many") && error.contains("report"), "the panic and the remedy: {error}");
        assert!(
            code == PANICKED && report.failure.is_some_and(|failure| !failure.is_silent()),
            "a panic is a failure with a message"
        );
        let (report, code) = report_of(|| Err(Failure::from(io::Error::other("no luck"))));
        assert_eq!((report.json["error"].as_str(), code), (Some("no luck"), FAILED), "a failure keeps its message");
    }
}
