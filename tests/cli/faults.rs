//! Faults while a verb writes: killed at any moment, a folder that cannot be written to, a full disk (by a limit of the
//! shell, and on a full file system), closed pipes, two runs at once.
//!
//! In: every verb that writes, on small inputs made here. Out: proof that inputs are unchanged, that an output is
//! absent, unchanged or complete and readable, and that the next run without a fault leaves no other files. Verbs that
//! need a GPU are skipped where there is none.
//!
//! `GS4D_KILLS` is how often each verb is killed, for long runs: 4 times if it is not set.

use crate::support::command::{GS4D, Run, arguments, gs4d, has_gpu};
use crate::support::dataset;
use crate::support::folders::{contents, names};
use crate::support::random::Random;
use crate::support::skip::skip;
use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::internal::codec::read_bytes;
use bevy_gs4d::offline;
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use glam::{UVec2, Vec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File, Permissions};
use std::io::Cursor;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Instant;
use tempfile::TempDir;

/// Gaussians of the scene.
const COUNT: usize = 600;
/// Contents of each output before a run. No reader accepts it.
const OLD: &[u8] = b"the old file";

/// A verb that writes.
struct Verb {
    name: &'static str,
    /// Its arguments, given the folders of the inputs and of the outputs.
    arguments: fn(&Path, &Path) -> Vec<OsString>,
    /// The files that it writes.
    files: &'static [&'static str],
    needs_gpu: bool,
}

const PACKAGE: &[&str] = &["made.gs4d"];

const VERBS: [Verb; 12] = [
    Verb {
        name: "convert",
        arguments: |from, to| arguments!["convert", from.join("scene.gs4d"), to.join("made.gs4d")].to_vec(),
        files: PACKAGE,
        needs_gpu: false,
    },
    Verb {
        name: "export",
        arguments: |from, to| {
            let time = arguments!["--time", "0.5"];
            [arguments!["export", from.join("scene.gs4d"), to.join("made.ply")].to_vec(), time.to_vec()].concat()
        },
        files: &["made.ply"],
        needs_gpu: false,
    },
    Verb {
        name: "compress",
        arguments: |from, to| {
            let (scene, made) = (from.join("scene.gs4d"), to.join("made.gs4d"));
            arguments!["compress", scene, made, "--codebooks", "16,16", "--verify", "0"].to_vec()
        },
        files: PACKAGE,
        needs_gpu: false,
    },
    Verb {
        name: "prune",
        arguments: |from, to| {
            let (scene, scores, made) = (from.join("scene.gs4d"), from.join("scores.f32"), to.join("made.gs4d"));
            arguments!["prune", scene, "--scores", scores, "--keep", "300", "-o", made].to_vec()
        },
        files: PACKAGE,
        needs_gpu: false,
    },
    Verb {
        name: "mask",
        arguments: |from, to| arguments!["mask", from.join("scene.gs4d"), "-o", to.join("made.gs4d")].to_vec(),
        files: PACKAGE,
        needs_gpu: false,
    },
    Verb {
        name: "synth",
        arguments: |_, to| arguments!["synth", to.join("made.gs4d"), "--count", COUNT.to_string()].to_vec(),
        files: PACKAGE,
        needs_gpu: false,
    },
    Verb {
        name: "score",
        arguments: |from, to| {
            let own = arguments!["--variant", "energy", "--engine", "cpu", "--out", to.join("made.f32")];
            [on_data("score", from), own.to_vec()].concat()
        },
        files: &["made.f32"],
        needs_gpu: false,
    },
    Verb {
        name: "ablate",
        arguments: |from, to| {
            let few = arguments!["--variants", "energy", "--ratios", "0.5", "--filters", "support", "--engine", "cpu"];
            [
                on_data("ablate", from),
                few.to_vec(),
                arguments!["--validation", "cameras", "--csv", to.join("made.csv")].to_vec(),
            ]
            .concat()
        },
        files: &["made.csv"],
        needs_gpu: false,
    },
    Verb {
        name: "bake",
        arguments: |from, to| {
            let few = arguments!["--variant", "energy", "--ratio", "0.5", "--quality", "visually-lossless"];
            let own = arguments!["--engine", "cpu", "-o", to.join("made.gs4d")];
            [on_data("bake", from), few.to_vec(), own.to_vec()].concat()
        },
        files: &["made.gs4d", "made.report.html", "made.report.json"],
        needs_gpu: false,
    },
    Verb {
        name: "render",
        arguments: |from, to| {
            let small = arguments!["--orbit", "2", "--size", "64x48", "--raw", "--out", to];
            [arguments!["render", from.join("scene.gs4d")].to_vec(), small.to_vec()].concat()
        },
        files: &["orbit_0000.f32", "orbit_0000.png", "orbit_0001.f32", "orbit_0001.png"],
        needs_gpu: true,
    },
    Verb {
        name: "finetune",
        arguments: |from, to| {
            let few = arguments!["--steps", "8", "--evaluate-every", "4", "--save-every", "4"];
            [on_data("finetune", from), few.to_vec(), arguments!["-o", to.join("made.gs4d")].to_vec()].concat()
        },
        files: PACKAGE,
        needs_gpu: true,
    },
    Verb {
        name: "detail",
        arguments: |from, to| {
            let few = arguments!["--levels", "1", "--steps", "2", "--directions", "1", "--times", "1"];
            [on_data("detail", from), few.to_vec(), arguments!["-o", to.join("made.gs4d")].to_vec()].concat()
        },
        files: PACKAGE,
        needs_gpu: true,
    },
];

/// Returns the arguments of a verb that uses the training views of the scene.
fn on_data(verb: &str, from: &Path) -> Vec<OsString> {
    arguments![verb, from.join("scene.gs4d"), "--data", from.join("data")].to_vec()
}

/// Inputs, and folders for outputs.
struct Stage {
    folder: TempDir,
    /// The contents of each input.
    inputs: BTreeMap<PathBuf, Vec<u8>>,
}

/// A verb with its own folder for outputs.
struct Act<'a> {
    verb: Verb,
    stage: &'a Stage,
    out: PathBuf,
}

impl Stage {
    /// Makes the inputs.
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let from = folder.path().join("inputs");
        let scene = synthesize(&SynthSettings { count: COUNT, ..SynthSettings::default() });
        let runtime = scene.clone().into_runtime().expect("a synthetic scene can be drawn");
        dataset::write(&from.join("data"), &runtime, Vec3::ZERO, 2, 3, UVec2::splat(48), true);
        offline::work::save(&from.join("scene.gs4d"), &scene, &WriteSettings::default()).expect("the folder is there");
        let scores: Vec<u8> = (0..COUNT).flat_map(|at| (at as f32).to_le_bytes()).collect();
        fs::write(from.join("scores.f32"), scores).expect("the folder can be written to");
        let inputs = contents(&from);
        Self { folder, inputs }
    }

    /// Returns every verb that this machine can run.
    fn acts(&self) -> impl Iterator<Item = Act<'_>> {
        let gpu = has_gpu();
        let possible = VERBS.into_iter().filter(move |verb| gpu || !verb.needs_gpu);
        possible.map(move |verb| {
            let out = self.folder.path().join(verb.name);
            fs::create_dir(&out).expect("the folder of the verb does not exist");
            Act { verb, stage: self, out }
        })
    }
}

impl Act<'_> {
    fn arguments(&self, out: &Path) -> Vec<OsString> {
        (self.verb.arguments)(&self.stage.folder.path().join("inputs"), out)
    }

    fn command(&self) -> Command {
        let mut command = Command::new(GS4D);
        command.args(self.arguments(&self.out));
        command
    }

    /// Returns the command, whose report and errors can be read.
    fn start(&self) -> Child {
        let mut command = self.command();
        command.stdout(Stdio::piped()).stderr(Stdio::piped());
        command.spawn().expect("the command starts")
    }

    /// Returns the command run by a shell, after `script`, of which `$1` is `limit`.
    fn in_shell(&self, script: &str, limit: &str) -> Command {
        let mut command = Command::new("sh");
        let script = format!("{script}; shift; exec \"$@\"");
        command.args(["-c", &script, "sh", limit, GS4D]).args(self.arguments(&self.out));
        command
    }

    /// Returns the command with its outputs on a file system of its own, in memory, of which `free` bytes are free. It
    /// begins with the files of the folder for outputs; its files are copied back there.
    fn on_full_system(&self, free: u64) -> Command {
        const SCRIPT: &str = "full=$1 old=$2 free=$3; shift 3
            mount -t tmpfs -o size=1m none \"$full\" && cp \"$old\"/* \"$full\" || exit 1
            cat /dev/zero >\"$full/filler\" 2>&-
            truncate -s -\"$free\" \"$full/filler\"
            \"$@\"; code=$?
            rm \"$full/filler\"; cp -a \"$full/.\" \"$old\" && exit $code";
        let full = self.stage.folder.path().join("full");
        fs::create_dir_all(&full).expect("the folder can be written to");
        let mut command = own_mounts();
        command.args(["sh", "-c", SCRIPT, "sh"]).args([&full, &self.out]).args([&free.to_string(), GS4D]);
        command.args(self.arguments(&full));
        command
    }

    /// Returns the common beginning of the names of its files.
    fn word(&self) -> &'static str {
        self.verb.files[0].split(['.', '_']).next().unwrap_or_default()
    }

    /// Writes the old contents to each output.
    fn put_old(&self) {
        for file in self.verb.files {
            fs::write(self.out.join(file), OLD).expect("the folder can be written to");
        }
    }

    /// Checks that the inputs are unchanged, and that each output is the old file or a complete new file.
    fn check(&self, context: &str) {
        let context = format!("{} {context}", self.verb.name);
        for file in self.verb.files {
            let bytes = fs::read(self.out.join(file)).unwrap_or_else(|error| panic!("{context}: {file}: {error}"));
            let whole = bytes == OLD || is_whole(file, &bytes);
            assert!(whole, "{context}: {file} is the old file or a complete one, {} bytes", bytes.len());
        }
        self.check_inputs(&context);
    }

    fn check_inputs(&self, context: &str) {
        let now = contents(&self.stage.folder.path().join("inputs"));
        assert!(now == self.stage.inputs, "{context}: the inputs are unchanged");
    }

    /// Checks that every output is complete and new, and that the folder has no other file.
    fn check_whole(&self, context: &str) {
        let context = format!("{} {context}", self.verb.name);
        for file in self.verb.files {
            let bytes = fs::read(self.out.join(file)).unwrap_or_else(|error| panic!("{context}: {file}: {error}"));
            assert!(is_whole(file, &bytes), "{context}: {file} is complete, {} bytes", bytes.len());
        }
        assert_eq!(names(&self.out), self.verb.files, "{context}: only the outputs");
        self.check_inputs(&context);
    }

    /// Runs the verb without a fault, after a fault.
    fn run_well(&self, context: &str) {
        let run = Run::of(&self.command().output().expect("the command starts"));
        assert_eq!(run.code, Some(0), "{} works {context}: {}", self.verb.name, run.err);
        self.check_whole(context);
    }

    /// Checks that a run failed with an error that names the output.
    fn check_refused(&self, run: &Run, context: &str) {
        run.must_fail(self.word());
        self.check(context);
    }

    /// Checks that there is no temporary file that was not there `before`.
    fn check_left(&self, before: &[String], context: &str) {
        let is_new = |name: &String| name.ends_with(".part") && !before.contains(name);
        let left: Vec<String> = names(&self.out).into_iter().filter(is_new).collect();
        assert!(left.is_empty(), "{} {context} leaves {left:?}", self.verb.name);
    }
}

/// Returns a command that runs the command in its arguments in a mount namespace of its own: file systems that it
/// mounts end with it.
fn own_mounts() -> Command {
    let mut command = Command::new("unshare");
    command.args(["--user", "--map-root-user", "--mount"]);
    command
}

/// Returns whether an output is complete.
fn is_whole(name: &str, bytes: &[u8]) -> bool {
    match Path::new(name).extension().and_then(OsStr::to_str) {
        Some("gs4d") => package::read(Cursor::new(bytes)).is_ok(),
        Some("ply") => read_bytes(Path::new(name), bytes).is_ok(),
        Some("png") => image::load_from_memory(bytes).is_ok(),
        Some("json") => serde_json::from_slice::<Value>(bytes).is_ok(),
        Some("html") => bytes.ends_with(b"</html>\n"),
        // The header, the whole scene, one filter, one ratio.
        Some("csv") => bytes.ends_with(b"\n") && bytes.iter().filter(|&&byte| byte == b'\n').count() == 4,
        _ if name.starts_with("orbit") => bytes.len() == 64 * 48 * 12,
        _ => bytes.len() == 4 * COUNT,
    }
}

fn kills() -> usize {
    let wanted = std::env::var("GS4D_KILLS").ok();
    wanted.map_or(4, |wanted| wanted.parse().expect("GS4D_KILLS is a number"))
}

/// Ends a process by SIGKILL or by a signal that it can handle.
fn end(child: &mut Child, asking: bool) {
    if asking {
        let asked = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
        assert!(asked.is_ok_and(|status| status.success()), "the signal can be sent");
    } else {
        child.kill().expect("the process can be killed");
    }
    child.wait().expect("the process ends");
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn killed_verbs_leave_their_outputs_old_or_complete() {
    let (stage, mut random) = (Stage::new(), Random::new(11));
    for act in stage.acts() {
        let start = Instant::now();
        act.run_well("at first");
        let time = start.elapsed();
        for kill in 0..kills() {
            act.put_old();
            let before = names(&act.out);
            let moment = time.mul_f64(random.below(1000) as f64 / 1000.0);
            let mut child = act.start();
            thread::sleep(moment);
            let asking = kill % 2 == 1;
            end(&mut child, asking);
            let context = format!("ended after {moment:?}, number {kill}");
            act.check(&context);
            if asking {
                act.check_left(&before, &context);
            }
        }
        act.run_well("after it was killed");
    }
}

#[test]
fn a_folder_that_cannot_be_written_to_is_named_and_unchanged() {
    let stage = Stage::new();
    for act in stage.acts() {
        act.put_old();
        let before = contents(&act.out);
        fs::set_permissions(&act.out, Permissions::from_mode(0o555)).expect("permissions can be set");
        // Root may write in spite of permissions; no user can create a file in /proc.
        let holds = File::create(act.out.join("probe")).is_err();
        let out = if holds { act.out.as_path() } else { Path::new("/proc") };
        let run = gs4d(&act.arguments(out));
        fs::set_permissions(&act.out, Permissions::from_mode(0o755)).expect("permissions can be set");
        if !holds {
            fs::remove_file(act.out.join("probe")).expect("the file exists");
        }
        let written_to = if holds { act.word() } else { "/proc" };
        run.must_fail(written_to);
        act.check("without a folder to write to");
        assert!(contents(&act.out) == before, "{} changes no file of the folder", act.verb.name);
        act.run_well("once it can write");
    }
}

#[test]
fn a_full_disk_is_named_and_the_old_output_stays() {
    let stage = Stage::new();
    for act in stage.acts() {
        act.run_well("at first");
        let size = |file: &&str| fs::metadata(act.out.join(file)).expect("the file exists").len();
        let largest = act.verb.files.iter().map(size).max();
        // Blocks of 512 bytes or of 1024: full from the start, and in the middle of a file. Drivers of GPUs may keep
        // memory in files.
        let limits: &[&str] = match largest {
            _ if act.verb.needs_gpu => &[],
            Some(4097..) => &["0", "4"],
            _ => &["0"],
        };
        for limit in limits {
            act.put_old();
            let before = names(&act.out);
            let mut full = act.in_shell("trap '' XFSZ; ulimit -f \"$1\"", limit);
            let run = Run::of(&full.output().expect("the shell starts"));
            act.check_refused(&run, "on a full disk");
            act.check_left(&before, "on a full disk");
            // Here the system ends the process in the middle of a write.
            let ended = act.in_shell("ulimit -f \"$1\"", limit).output().expect("the shell starts").status;
            assert!(!ended.success(), "{} on a full disk: {ended}", act.verb.name);
            act.check("ended by the system");
        }
        act.run_well("once there is room");

        let device = act.out.join(act.verb.files[0]);
        fs::remove_file(&device).expect("the file exists");
        symlink("/dev/full", &device).expect("the folder can be written to");
        let run = Run::of(&act.command().output().expect("the command starts"));
        assert_eq!(run.code, Some(2), "{} to a full device: {}", act.verb.name, run.err);
        assert!(run.err.contains("error:") && !run.err.contains("panicked"), "{}: {}", act.verb.name, run.err);
        assert!(device.is_symlink(), "{}: the link to the device is unchanged", act.verb.name);
        act.check_inputs(act.verb.name);
        fs::remove_file(&device).expect("the file exists");
        act.run_well("to a file again");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn a_full_file_system_is_named_and_the_old_output_stays() {
    let stage = Stage::new();
    let probe = own_mounts().args(["mount", "-t", "tmpfs", "none"]).arg(stage.folder.path()).output();
    if !probe.is_ok_and(|probe| probe.status.success()) {
        return skip("unshare cannot mount a file system: `apt-get install util-linux mount`, and user namespaces");
    }
    for act in stage.acts() {
        act.run_well("at first");
        let size = |file: &&str| fs::metadata(act.out.join(file)).expect("the file exists").len();
        let largest = act.verb.files.iter().map(size).max();
        // Full from the start, and in the middle of a file.
        let free: &[u64] = if largest > Some(8192) { &[0, 4096] } else { &[0] };
        for free in free {
            act.put_old();
            let before = names(&act.out);
            let run = Run::of(&act.on_full_system(*free).output().expect("unshare starts"));
            let context = format!("with {free} bytes free");
            act.check_refused(&run, &context);
            act.check_left(&before, &context);
            let sentences = run.err.lines().filter(|line| line.contains(": no space is left on the disk")).count();
            assert_eq!(sentences, 1, "{}: one sentence names the fault: {}", act.verb.name, run.err);
        }
        act.run_well("once there is room");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn closed_pipes_do_not_affect_the_output() {
    let stage = Stage::new();
    for act in stage.acts() {
        act.put_old();
        let mut child = act.start();
        drop((child.stdout.take(), child.stderr.take()));
        let status = child.wait().expect("the process ends");
        assert!(status.success(), "{} with closed pipes: {status}", act.verb.name);
        act.check_whole("with closed pipes");

        act.put_old();
        let status = act.in_shell("exec >&- 2>&-", "").status().expect("the shell starts");
        assert!(status.success(), "{} without standard output: {status}", act.verb.name);
        act.check_whole("without standard output");

        act.put_old();
        let full = File::options().write(true).open("/dev/full").expect("a device of Linux");
        let output = act.command().stdout(full).stderr(Stdio::piped()).output().expect("the command starts");
        let run = Run::of(&output);
        assert_eq!(run.code, Some(2), "{} fails if its report is lost: {}", act.verb.name, run.err);
        act.check_whole("with a report that is lost");
    }
}

#[test]
#[ignore = "takes minutes; `.ci/full` runs it by name"]
fn two_runs_at_once_leave_one_complete_output() {
    let stage = Stage::new();
    for act in stage.acts() {
        for _ in 0..2 {
            act.put_old();
            let both = [act.start(), act.start()];
            let runs = both.map(|child| Run::of(&child.wait_with_output().expect("the process ends")));
            let [one, other] = &runs;
            let worked = runs.iter().any(|run| run.code == Some(0));
            assert!(worked, "{}: one of two works: {} {}", act.verb.name, one.err, other.err);
            // The other run may be refused while the first one works.
            for refused in runs.iter().filter(|run| run.code != Some(0)) {
                refused.must_fail(act.word());
            }
            act.check_whole("with two runs at once");
        }
        act.run_well("after two runs at once");
    }
}

#[test]
fn pipes_in_place_of_captures_are_refused_without_waiting_for_them() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let [pipe, out, scene] = ["pipe.ply", "out.gs4d", "scene.gs4d"].map(|name| folder.path().join(name));
    let made = Command::new("mkfifo").arg(&pipe).status();
    assert!(made.is_ok_and(|status| status.success()), "a named pipe can be made");
    gs4d(&arguments!["info", &pipe]).must_fail("is a pipe or a device");
    gs4d(&arguments!["convert", &pipe, &out]).must_fail("is a pipe or a device");
    assert!(!out.exists(), "nothing is written");
    gs4d(&arguments!["synth", &scene, "--count", "50"]).text();
    let input = File::open(&scene).expect("the scene is there");
    let run = Command::new(GS4D).args(["info", "/dev/stdin", "--json"]).stdin(input).output();
    let found = Run::of(&run.expect("the command starts")).json();
    assert_eq!(found["gaussians"], 50, "a file as standard input is a file");
}
