//! `gs4d detail`, run as a user runs it.
//!
//! In: a small synthetic scene. Out: proof that the package has the levels that the report names, and that verbs which change a scene say
//! that they leave them out. Skipped where there is no GPU.

use crate::support::command::{arguments, folder, gs4d, scene};
use crate::support::no_gpu::no_gpu;
use bevy_gs4d::renderer::GpuContext;

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
    assert_eq!(report["kept"], 1, "anything is close enough: {report}");
    let gaussians = report["levels"][0]["gaussians"].as_u64().expect("a number");
    assert!((1..=114).contains(&gaussians), "a seventh of 800: {gaussians}");
    let info = gs4d(&arguments!["info", &out, "--json"]).json();
    assert_eq!(info["package"]["levels"][0]["pixels"], report["levels"][0]["pixels"], "as reported");
    assert_eq!(info["gaussians"], 800, "and all Gaussians");
    let run = gs4d(&arguments!["mask", &out, "-o", &changed]);
    assert!(run.err.contains("levels of detail are left out"), "which is said: {}", run.err);
    run.text();
    let info = gs4d(&arguments!["info", &changed, "--json"]).json();
    assert_eq!(info["package"]["levels"].as_array().map(Vec::len), Some(0), "no levels of another scene");
}
