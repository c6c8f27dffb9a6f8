//! `gs4d bake --plan` and `--only`: a bake as jobs.
//!
//! In: a small synthetic scene, its own pictures as a dataset, plans. Out: proof that a plan has every stage with what
//! it needs, that its jobs, in any order that it allows, twice at once and killed at random, give the bytes of a bake,
//! and that a job too early, a bad plan and a full disk are named and lose nothing. Stages of training are skipped
//! where there is no GPU.

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, gs4d, has_gpu};
use crate::support::folders::names;
use crate::support::random::Random;
use crate::support::small_capture::small_capture;
use serde_json::Value;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::Duration;

fn capture() -> Capture {
    small_capture(600, 4)
}

/// Goals, scores and filters, for which the stages differ.
const BY_VIEWS: [&str; 8] = ["--engine", "cpu", "--ratio", "0.4", "--variant", "auto", "--filter", "interval"];

impl Capture {
    fn bake(&self, out: &Path, more: &[&str]) -> Vec<OsString> {
        let fixed = arguments!["bake", &self.scene, "--data", &self.data, "-o", out];
        fixed.into_iter().chain(more.iter().map(OsString::from)).collect()
    }

    /// Plans a bake to `NAME.gs4d`. Returns the plan.
    fn plan(&self, name: &str, more: &[&str]) -> Value {
        let (out, plan) = (self.path(&format!("{name}.gs4d")), self.path(&format!("{name}.json")));
        let printed = gs4d(&[self.bake(&out, more), arguments!["--plan", &plan, "--json"].to_vec()].concat()).json();
        let written = fs::read_to_string(&plan).expect("the plan");
        let written: Value = serde_json::from_str(&written).expect("JSON");
        assert_eq!(printed, written, "the printed plan is the written one");
        written
    }
}

fn jobs(plan: &Value) -> &[Value] {
    plan["jobs"].as_array().expect("a list")
}

fn strings(list: &Value) -> Vec<&str> {
    list.as_array().expect("a list").iter().map(|text| text.as_str().expect("text")).collect()
}

fn ids(plan: &Value) -> Vec<&str> {
    jobs(plan).iter().map(|job| job["id"].as_str().expect("text")).collect()
}

/// Returns the command of a job.
fn command(plan: &Value, job: &Value) -> Command {
    let words = strings(&job["command"]);
    assert_eq!(words[0], "gs4d", "the program");
    let mut command = Command::new(GS4D);
    command.args(&words[1..]).current_dir(plan["directory"].as_str().expect("text")).stdin(Stdio::null());
    command
}

fn spawn(plan: &Value, job: &Value) -> Child {
    command(plan, job).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("the command starts")
}

/// Returns the jobs that may run when others are done.
fn ready<'a>(plan: &'a Value, done: &BTreeSet<&str>) -> Vec<&'a Value> {
    let may_run = |job: &&Value| {
        let is_new = !done.contains(job["id"].as_str().expect("text"));
        is_new && strings(&job["after"]).iter().all(|id| done.contains(id))
    };
    jobs(plan).iter().filter(may_run).collect()
}

/// Runs the jobs of a plan in a random order that it allows, each by `run`.
fn run_all(plan: &Value, random: &mut Random, mut run: impl FnMut(&Value, &mut Random)) {
    let mut done = BTreeSet::new();
    while done.len() < jobs(plan).len() {
        let ready = ready(plan, &done);
        let job = ready[random.below(ready.len())];
        run(job, random);
        let outputs = strings(&job["outputs"]);
        assert!(outputs.iter().all(|path| Path::new(path).is_file()), "{} writes {outputs:?}", job["id"]);
        done.insert(job["id"].as_str().expect("text"));
    }
}

/// Runs jobs, each twice, all at once.
fn run_twice_at_once(plan: &Value, jobs: &[&Value]) {
    let both = jobs.iter().flat_map(|&job| [job, job]).map(|job| (job, spawn(plan, job))).collect::<Vec<_>>();
    for (job, mut child) in both {
        let code = child.wait().expect("the child can be waited for").code();
        assert_eq!(code, Some(0), "both runs of {} end well", job["id"]);
    }
}

#[test]
fn a_plan_has_every_stage_with_what_it_needs() {
    let capture = capture();
    let plan = capture.plan("out", &[&BY_VIEWS[..], &["--shards", "3"]].concat());
    let expected = ["score-0", "score-1", "score-2", "score", "prune", "mask", "compress", "report"];
    assert_eq!(ids(&plan), expected, "the stages, with three shards");
    assert_eq!(strings(&jobs(&plan)[3]["after"]), ["score-0", "score-1", "score-2"], "the scores wait for all shards");
    assert_eq!(strings(&jobs(&plan)[6]["after"]), ["mask"], "a stage waits for the one before");
    for job in jobs(&plan) {
        let needs = &job["needs"];
        assert!(needs["gpu"] == false && needs["memory_bytes"].as_u64() > Some(0), "{job}");
        assert!(needs["seconds"].as_f64() > Some(0.0), "{job}");
        assert!(!strings(&job["inputs"]).is_empty() && !strings(&job["outputs"]).is_empty(), "{job}");
    }
    assert_eq!(names(capture.folder.path()), ["data", "out.json", "scene.gs4d"], "nothing else is written");
    let plan = capture.plan("one", &["--engine", "cpu"]);
    assert_eq!(ids(&plan), ["score", "prune", "mask", "compress", "report"], "the stages of a usual bake on the CPU");
    let plan = capture.plan("gpu", &["--engine", "gpu"]);
    let trained = ["score", "prune", "rounds", "fine-tune", "mask", "compress", "report"];
    assert_eq!(ids(&plan), trained, "and on a GPU, which need not be here");
    assert!(jobs(&plan).iter().all(|job| job["needs"]["gpu"] == true), "all need one");
    let (data, out, file) = (&capture.data, capture.path("new.gs4d"), capture.path("new.json"));
    let plan = gs4d(&arguments!["bake", data, "-o", &out, "--engine", "gpu", "--plan", &file, "--json"]).json();
    assert_eq!(ids(&plan)[..2], ["train", "score"], "from pictures, a capture is trained first");
    assert_eq!(strings(&jobs(&plan)[1]["after"]), ["train"], "and then scored");
    let bytes = |plan: &Value, job: usize| jobs(plan)[job]["needs"]["memory_bytes"].as_u64().expect("a number");
    let mut plain = arguments!["bake", data, "-o", &out, "--engine", "gpu", "--plan", &file, "--json"].to_vec();
    plain.push("--no-fine-tune".into());
    let plain = gs4d(&plain).json();
    assert_eq!(ids(&plain), ["train", "score", "prune", "mask", "compress", "report"], "without fine-tuning");
    assert_eq!(bytes(&plain, 0), bytes(&plan, 0), "a training from pictures holds its images in any case");
    assert!(bytes(&plain, 2) > bytes(&plain, 1), "the stage prune holds the images of the validation views");
}

#[test]
fn jobs_in_any_order_give_the_bytes_of_a_bake() {
    let capture = capture();
    let whole = capture.path("whole.gs4d");
    gs4d(&capture.bake(&whole, &BY_VIEWS)).text();
    let whole = fs::read(&whole).expect("the package");
    for seed in 0..2u64 {
        let name = format!("jobs{seed}");
        let plan = capture.plan(&name, &[&BY_VIEWS[..], &["--shards", "3"]].concat());
        let mut random = Random::new(seed);
        run_all(&plan, &mut random, |job, _| {
            run_twice_at_once(&plan, &[job]);
            Run::of(&command(&plan, job).output().expect("the command starts")).text();
        });
        let out = capture.path(&format!("{name}.gs4d"));
        assert!(fs::read(&out).expect("the package") == whole, "the bytes of a bake");
        // A whole bake finds every stage done, and removes the results.
        let run = gs4d(&capture.bake(&out, &BY_VIEWS));
        assert!(run.err.contains("compress: skipped") && run.code == Some(0), "no stage runs again: {}", run.err);
        assert!(fs::read(&out).expect("the package") == whole, "the bytes of a bake");
        assert!(!capture.path(&format!("{name}.gs4d.bake")).exists(), "the results are removed");
    }
    // All jobs at once that may run, on as many workers.
    let plan = capture.plan("waves", &[&BY_VIEWS[..], &["--shards", "3"]].concat());
    let mut done = BTreeSet::new();
    while done.len() < jobs(&plan).len() {
        let ready = ready(&plan, &done);
        run_twice_at_once(&plan, &ready);
        done.extend(ready.iter().map(|job| job["id"].as_str().expect("text")));
    }
    assert!(fs::read(capture.path("waves.gs4d")).expect("the package") == whole, "the bytes of a bake");
}

#[test]
fn jobs_killed_at_random_give_the_bytes_of_a_bake() {
    let capture = capture();
    // A package that is too large at first, so that fewer Gaussians are kept.
    let options = ["--engine", "cpu", "--target-size", "0.012"];
    let whole = capture.path("whole.gs4d");
    gs4d(&capture.bake(&whole, &options)).text();
    let plan = capture.plan("jobs", &[&options[..], &["--shards", "2"]].concat());
    run_all(&plan, &mut Random::new(5), |job, random| {
        for _ in 0..3 {
            let mut child = spawn(&plan, job);
            thread::sleep(Duration::from_millis(random.below(150) as u64));
            child.kill().ok();
            child.wait().expect("the child can be waited for");
        }
        Run::of(&command(&plan, job).output().expect("the command starts")).text();
    });
    let [whole, jobs] = [whole, capture.path("jobs.gs4d")].map(|path| fs::read(path).expect("the package"));
    assert!(whole == jobs, "the bytes of a bake");
    let left = names(&capture.path("jobs.gs4d.bake"));
    assert!(left.iter().all(|name| !name.ends_with(".part")), "no temporary file is left: {left:?}");
}

#[test]
fn jobs_that_train_give_the_bytes_of_a_bake() {
    if !has_gpu() {
        return;
    }
    let capture = capture();
    let options = ["--engine", "gpu", "--ratio", "0.5", "--steps", "6", "--rounds", "2"];
    let whole = capture.path("whole.gs4d");
    gs4d(&capture.bake(&whole, &options)).text();
    let plan = capture.plan("jobs", &[&options[..], &["--shards", "2"]].concat());
    run_all(&plan, &mut Random::new(7), |job, _| run_twice_at_once(&plan, &[job]));
    let [whole, jobs] = [whole, capture.path("jobs.gs4d")].map(|path| fs::read(path).expect("the package"));
    assert!(whole == jobs, "the bytes of a bake");
}

#[test]
fn a_job_before_its_time_names_what_is_missing() {
    let capture = capture();
    let out = capture.path("out.gs4d");
    let only = |stage: &str, more: &[&str]| {
        gs4d(
            &[
                capture.bake(&out, &BY_VIEWS),
                arguments!["--only", stage].to_vec(),
                more.iter().map(OsString::from).collect(),
            ]
            .concat(),
        )
    };
    only("mask", &[]).must_fail("out.gs4d.bake: has no result of the stage score");
    only("score", &["--shard", "1/2"]).text();
    only("score", &["--shards", "2"]).must_fail("no result of the shard 0/2 of the stage score");
    only("score", &["--shard", "0/2"]).text();
    only("score", &["--shards", "2"]).text();
    only("report", &[]).must_fail("no result of the stage prune");
    only("prune", &[]).text();
    // Another option changes the inputs of the stage before.
    let other = ["--engine", "cpu", "--ratio", "0.4", "--variant", "energy"];
    let changed = gs4d(&[capture.bake(&out, &other), arguments!["--only", "mask"].to_vec()].concat());
    changed.must_fail("has no result of the stage score with these inputs");
    only("mask", &[]).text();
    assert!(!out.exists(), "the package is written by the last job");
    // A disk that is full while a stage is stored.
    let folder = capture.path("out.gs4d.bake");
    let before = names(&folder);
    let mut shell = Command::new("sh");
    shell.args(["-c", "trap '' XFSZ; ulimit -f 1; exec \"$0\" \"$@\"", GS4D]);
    let full = shell.args(capture.bake(&out, &BY_VIEWS)).args(["--only", "compress"]).output();
    Run::of(&full.expect("the shell starts")).must_fail("compress");
    assert_eq!(names(&folder), before, "the results of the other stages stay");
    only("compress", &[]).text();
    only("report", &[]).text();
    assert!(out.exists(), "the package is written");
}

#[test]
fn bad_plans_are_refused() {
    let capture = capture();
    let (out, plan) = (capture.path("out.gs4d"), capture.path("plan.json"));
    let run = |more: &[&str]| gs4d(&capture.bake(&out, more));
    let path = plan.display().to_string();
    run(&["--plan", &path]).must_fail("give --engine gpu or --engine cpu");
    run(&["--engine", "cpu", "--shards", "2"]).must_fail("--shards has no effect without --plan");
    run(&["--engine", "cpu", "--only", "mask", "--shard", "0/2"]).must_fail("--shard has no effect on this stage");
    run(&["--engine", "cpu", "--only", "train"]).must_fail("needs the folder of a dataset");
    let nowhere = capture.path("nowhere/plan.json").display().to_string();
    run(&["--engine", "cpu", "--plan", &nowhere]).must_fail("there is no folder");
    let data = capture.data.join("transforms_train.json").display().to_string();
    run(&["--engine", "cpu", "--plan", &data]).must_fail("is the input itself");
    let pictures = arguments!["bake", &capture.data, "-o", &out, "--engine", "cpu", "--plan", &plan];
    gs4d(&pictures).must_fail("training from pictures needs a GPU");
    // What the jobs would refuse.
    run(&["--engine", "cpu", "--plan", &path, "--target-size", "0.0001"]).must_fail("a package without Gaussians has");
    let packed = capture.path("packed.gs4d");
    gs4d(&arguments!["compress", &capture.scene, &packed]).text();
    let of_packed =
        arguments!["bake", &packed, "--data", &capture.data, "-o", &out, "--engine", "cpu", "--plan", &plan];
    gs4d(&of_packed).must_fail("the scene is packed already");
    fs::remove_file(&packed).expect("the package exists");
    let image = capture.data.join("train/c00_01.png");
    let bytes = fs::read(&image).expect("the image exists");
    fs::remove_file(&image).expect("the image exists");
    gs4d(&arguments!["bake", &capture.data, "-o", &out, "--engine", "gpu", "--plan", &plan]).must_fail("c00_01.png");
    fs::write(&image, bytes).expect("the folder can be written to");
    for more in [["--only", "everything"], ["--shard", "0/2"], ["--shards", "0"]] {
        let refused = run(&more);
        assert_eq!(refused.code, Some(2), "{more:?}: {}", refused.err);
    }
    assert_eq!(names(capture.folder.path()), ["data", "scene.gs4d"], "nothing is written");
}
