//! Pictures that do not fit the memory or the GPU, in every verb that draws or loads pictures.
//!
//! In: a small scene, a dataset of it, sizes of 16384x16384 pixels, a limit on the address space that a shell sets.
//! Out: proof that each verb refuses them at once, with the need, the limit and the option that makes pictures smaller,
//! and writes no file; and that so many views are refused, too.

use crate::support::capture::Capture;
use crate::support::command::{GS4D, Run, arguments, gs4d, has_gpu};
use crate::support::no_gpu::no_gpu;
use crate::support::skip::skip;
use crate::support::small_capture::small_capture;
use bevy_gs4d::renderer::GpuContext;
use std::ffi::OsString;
use std::process::Command;
use std::time::{Duration, Instant};

/// Kilobytes of address space: less than a picture of 16384x16384 pixels needs, and enough for threads and libraries.
const LIMIT: &str = "3000000";
/// Time within which a verb refuses; to draw or to load such pictures takes minutes.
const AT_ONCE: Duration = Duration::from_secs(20);

fn capture() -> Capture {
    small_capture(100, 2)
}

/// Runs the command within the limit.
fn limited(arguments: &[OsString]) -> Run {
    let script = "ulimit -v \"$1\"; shift; exec \"$@\"";
    let mut command = Command::new("sh");
    command.args(["-c", script, "sh", LIMIT, GS4D]).args(arguments);
    Run::of(&command.output().expect("the command starts"))
}

/// Checks that a run was refused at once, for the memory, with this remedy.
fn refused_for_memory(arguments: &[OsString], remedy: &str) {
    let start = Instant::now();
    let run = limited(arguments);
    run.must_fail(remedy);
    assert!(run.err.contains("16384x16384 pixels need"), "{arguments:?}: the size is named: {}", run.err);
    assert!(run.err.contains("GB are available"), "{arguments:?}: the available memory is named: {}", run.err);
    assert!(start.elapsed() < AT_ONCE, "{arguments:?}: refused at once: {:?}", start.elapsed());
}

#[test]
fn pictures_that_do_not_fit_the_memory_are_refused_at_once_by_every_verb() {
    let capture = capture();
    let (scene, data, out) = (&capture.scene, &capture.data, capture.path("out.gs4d"));
    let on_data = |verb: &str, more: &[&str]| {
        let fixed = arguments![verb, scene, "--data", data, "--engine", "cpu", "--resolution", "16384"];
        [fixed.to_vec(), more.iter().map(OsString::from).collect()].concat()
    };
    let out = out.to_str().expect("temporary folders have plain names");
    let scores = capture.path("scores.f32");
    let scores = scores.to_str().expect("temporary folders have plain names");
    let by_resolution = "--resolution makes pictures smaller, by a divisor or a width";
    for command in [
        on_data("eval", &[]),
        on_data("eval", &["--metrics", "psnr"]),
        on_data("ablate", &["--validation", "cameras"]),
        on_data("prune", &["--max-loss", "0.1", "--validation", "cameras", "-o", out]),
        on_data("prune", &["--ratio", "0.5", "--variant", "energy", "-o", out]),
        on_data("score", &["--variant", "energy", "-o", scores]),
        on_data("score", &["--validation", "cameras", "--trust-images", "-o", scores]),
        on_data("mask", &["--filter", "interval", "-o", out]),
        on_data("bake", &["--ratio", "0.5", "-o", out]),
    ] {
        refused_for_memory(&command, by_resolution);
    }
    let compress = arguments!["compress", scene, out, "--engine", "cpu", "--codebooks", "4", "--size", "16384x16384"];
    refused_for_memory(&compress, "--size makes pictures smaller, --verify fewer");
    assert!(!capture.path("out.gs4d").exists() && !capture.path("scores.f32").exists(), "no output is written");
}

#[test]
fn pictures_that_do_not_fit_the_gpu_are_refused_before_training() {
    let limits = match GpuContext::headless(None) {
        Ok(context) => context.device.limits(),
        Err(_) => return no_gpu(),
    };
    let capture = capture();
    // 48 bytes for each pixel.
    assert!(limits.max_storage_buffer_binding_size < 48 << 28, "no GPU binds 12.9 GB");
    for verb in ["finetune", "bake"] {
        let (scene, data, out) = (&capture.scene, &capture.data, capture.path("out.gs4d"));
        let fixed = arguments![verb, scene, "--data", data, "--resolution", "16384", "-o", &out];
        let on_gpu = if verb == "bake" { arguments!["--engine", "gpu"].to_vec() } else { Vec::new() };
        let start = Instant::now();
        let run = gs4d(&[fixed.to_vec(), on_gpu].concat());
        run.must_fail("--resolution makes pictures smaller");
        assert!(!run.err.contains("fewer Gaussians"), "{verb}: the remedy is smaller pictures: {}", run.err);
        assert!(start.elapsed() < AT_ONCE, "{verb}: refused at once: {:?}", start.elapsed());
        assert!(!out.exists(), "{verb}: no output is written");
    }
}

#[test]
fn levels_of_detail_from_too_many_directions_are_refused_before_they_are_made() {
    if !has_gpu() {
        return;
    }
    let (capture, start) = (capture(), Instant::now());
    let out = capture.path("out.gs4d");
    let run = gs4d(&arguments!["detail", &capture.scene, "-o", &out, "--directions", "1000", "--times", "1000"]);
    run.must_fail("--directions and --times make pictures fewer");
    assert!(run.err.contains("1000000 pictures of up to"), "their number is named: {}", run.err);
    assert!(start.elapsed() < AT_ONCE, "refused at once: {:?}", start.elapsed());
}

#[test]
fn frames_that_do_not_fit_the_gpu_are_refused_before_they_are_timed() {
    let limit = match GpuContext::headless(None) {
        Ok(context) => context.device.limits().max_buffer_size,
        Err(_) => return no_gpu(),
    };
    if limit >= 1 << 32 {
        return skip(format_args!("this GPU has room for a picture of 16384x16384"));
    }
    let capture = capture();
    let start = Instant::now();
    let run = gs4d(&arguments!["bench", &capture.scene, "--size", "16384x16384"]);
    run.must_fail("--size makes pictures smaller");
    assert!(start.elapsed() < AT_ONCE, "refused at once: {:?}", start.elapsed());
}

#[test]
fn more_views_than_frames_that_can_be_measured_are_refused() {
    let capture = capture();
    let run = gs4d(&arguments!["bench", &capture.scene, "--orbit", "100000", "--times", "11"]);
    run.must_fail("100000 views at 11 times are more than 1000000 pictures: give fewer --times");
}
