//! `gs4d detail`, run as a user runs it.
//!
//! In: a small synthetic scene. Out: proof that the package has the levels that the report names, that `gs4d render` draws each level,
//! that verbs which change a scene report that levels are left out, and that a size without a dataset is refused. Skipped where there is no GPU.

use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::GpuContext;
use std::path::Path;

#[test]
fn levels_are_written_reported_and_left_out_by_other_verbs() {
    if GpuContext::headless(None).is_err() {
        no_gpu();
        return;
    }
    let folder = folder();
    let input = scene(&folder, "800");
    let [out, changed] = ["out.gs4d", "next.gs4d"].map(|name| folder.path().join(name));
    let quick = ["--levels", "1", "--min-psnr", "0", "--steps", "5", "--directions", "2", "--times", "1", "--json"];
    let mut command = arguments!["detail", &input, "-o", &out].to_vec();
    command.extend(quick.map(Into::into));
    let report = gs4d(&command).json();
    assert_eq!(report["kept"], 1, "every level meets a PSNR of 0: {report}");
    let gaussians = report["levels"][0]["gaussians"].as_u64().expect("a number");
    assert!((1..=114).contains(&gaussians), "at most a seventh of 800: {gaussians}");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    for fact in ["pixels", "gaussians"] {
        assert_eq!(info["levels"][0][fact], report["levels"][0][fact], "{fact} are those of the report");
    }
    assert_eq!(info["gaussians"], 800, "the scene has all Gaussians");
    let run = gs4d(&arguments!["mask", &out, "-o", &changed]);
    assert!(run.err.contains("levels of detail are left out"), "the report says that levels are left out: {}", run.err);
    run.text();
    let info = gs4d(&arguments!["info", &changed, "--json"]).json();
    assert_eq!(info["levels"].as_array().map(Vec::len), Some(0), "no levels of another scene");

    let draw = |name: &str, scene: &Path, more: &[&str]| {
        let mut command =
            arguments!["render", scene, "-o", folder.path().join(name), "--orbit", "1", "--json"].to_vec();
        command.extend(["--size", "64x64"].iter().chain(more).map(Into::into));
        gs4d(&command)
    };
    let [(all, zero), (level, one)] = [("all", [].as_slice()), ("level", &["--level", "1"])].map(|(name, more)| {
        let drawn = draw(name, &out, more).json();
        (drawn["frames"][0]["visible"].as_u64(), drawn["level"].as_u64())
    });
    assert_eq!((zero, one), (Some(0), Some(1)), "the requested levels");
    assert!(level > Some(0) && level <= Some(gaussians) && level < all, "{level:?} of {all:?}");
    draw("missing", &out, &["--level", "2"]).must_fail("has no level of detail 2; the coarsest is 1");
    draw("none", &changed, &["--level", "1"]).must_fail("gs4d detail");
}

#[test]
fn a_size_without_a_dataset_is_refused() {
    let folder = folder();
    let [input, out] = [scene(&folder, "20"), folder.path().join("out.gs4d")];
    for option in [["--size", "64x64"], ["--resolution", "2"]] {
        let mut command = arguments!["detail", &input, "-o", &out].to_vec();
        command.extend(option.map(Into::into));
        gs4d(&command).must_fail("--data");
        assert!(!out.exists(), "no output is written");
    }
}
