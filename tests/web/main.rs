//! The players of `examples/web` in a browser.
//!
//! In: the folder that `.ci/web` has built, which `GS4D_WEB` names, and Chromium. Out: one test binary. A browser
//! without a window, which draws with a software driver, opens `page.js`, which opens players in frames, uses them as
//! people and pages do, and reports what it has seen; the tests check the report. Skipped without the folder and
//! without Chromium.

mod browser;
mod people;
mod server;
mod shots;
mod take;

#[path = "../support"]
mod support {
    pub mod byte_range;
    #[expect(dead_code, reason = "the player is compared with the CPU reference, not with the original's values")]
    pub mod golden;
    pub mod skip;
}

use bevy_gs4d::codec::package::{self, WriteSettings};
use bevy_gs4d::scene::synth::{SynthSettings, synthesize};
use serde_json::Value;
use server::{Captures, Results};
use shots::Shot;
use std::path::PathBuf;
use std::sync::OnceLock;
use support::skip::skip;
use take::Take;

/// Gaussians of the large capture, which is in the trained form and takes 21 MB.
const LARGE: usize = 40_000;

/// What the browser has reported, and the pictures that it was asked for.
struct Seen {
    results: Results,
    shots: Vec<Shot>,
}

impl Seen {
    /// Returns what the page has reported under this name.
    fn value(&self, name: &str) -> Value {
        let bytes =
            self.results.get(name).unwrap_or_else(|| panic!("the page reports `{name}`, found {:?}", self.names()));
        serde_json::from_slice(bytes).expect("a report is JSON")
    }

    fn names(&self) -> Vec<&String> {
        self.results.keys().collect()
    }
}

/// Returns what the browser has reported. The browser runs once for all tests; if it fails, all tests fail. `None`
/// without Chromium or a built page.
fn seen() -> Option<&'static Seen> {
    static SEEN: OnceLock<Option<Result<Seen, String>>> = OnceLock::new();
    let seen = SEEN.get_or_init(|| {
        let folder = PathBuf::from(std::env::var_os("GS4D_WEB")?);
        let program = browser::program()?;
        let take = Take::new();
        let shots = shots::all(&take);
        let captures = Captures { large: large(), take };
        let results = server::serve(&folder, &shots, captures, |address| browser::open(&program, address));
        Some(results.map(|results| Seen { results, shots }))
    });
    if seen.is_none() {
        skip(match std::env::var_os("GS4D_WEB") {
            None => "GS4D_WEB names no folder of a built page: `bash .ci/web`",
            Some(_) => "there is no Chromium: `apt-get install chromium`",
        });
    }
    let seen = seen.as_ref()?;
    Some(seen.as_ref().unwrap_or_else(|message| panic!("the page failed: {message}")))
}

/// Returns a package of many Gaussians.
fn large() -> Vec<u8> {
    let scene = synthesize(&SynthSettings { count: LARGE, ..SynthSettings::default() });
    let mut package = Vec::new();
    package::write(&mut package, &scene, &WriteSettings { level: 1 }).expect("a synthetic scene can be written");
    package
}

/// Returns the peak signal-to-noise ratio of a picture in 8 bits and the expected one, dB.
fn psnr(found: &[u8], expected: &[u8]) -> f64 {
    assert_eq!(found.len(), expected.len(), "pictures of the same size");
    let squares = found.iter().zip(expected).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2));
    let mean = squares.sum::<f64>() / found.len() as f64;
    10.0 * (255.0 * 255.0 / mean.max(1e-9)).log10()
}

/// Checks the pictures that a player has drawn.
fn check_pictures(player: &str, least: f64) {
    let Some(seen) = seen() else { return };
    let mut worst = f64::INFINITY;
    for (index, shot) in seen.shots.iter().enumerate() {
        let expected = if player == "bevy" { shot.of_app.as_ref() } else { Some(&shot.expected) };
        let Some(expected) = expected else { continue };
        let name = format!("{player}-{index}");
        let found = seen.results.get(&name).unwrap_or_else(|| panic!("{name} of {:?}", seen.names()));
        let found: Vec<u8> = found.chunks_exact(4).flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
        let psnr = psnr(&found, expected);
        println!("{player:8} {:32} {psnr:5.1} dB", shot.name);
        worst = worst.min(psnr);
        assert!(psnr >= least, "{player}: {} has {psnr:.1} dB", shot.name);
    }
    println!("{player}: worst {worst:.1} dB");
}

#[test]
fn the_global_sort_draws_in_a_browser_what_the_reference_draws() {
    check_pictures("sort", 60.0);
}

#[test]
fn tile_bins_draw_in_a_browser_what_the_reference_draws() {
    check_pictures("bins", 60.0);
}

#[test]
fn an_app_of_bevy_draws_in_a_browser_what_the_reference_draws() {
    let Some(seen) = seen() else { return };
    if seen.results.keys().any(|name| name.starts_with("bevy")) {
        check_pictures("bevy", 60.0);
    } else {
        skip("the page has no app of Bevy: `bash .ci/web --bevy`");
    }
}

/// Every pass that a page uses, by both designs and for each storage that a capture of the test has.
#[test]
fn the_browser_has_no_message_about_a_shader_or_a_call() {
    let Some(seen) = seen() else { return };
    for (name, bytes) in seen.results.iter().filter(|(name, _)| name.ends_with(".frame")) {
        let frame: Value = serde_json::from_slice(bytes).expect("JSON");
        for kind in ["shaders", "errors", "console"] {
            assert_eq!(frame[kind], Value::Array(Vec::new()), "{name}: {kind}");
        }
        assert!(frame["modules"].as_u64() > Some(3), "{name}: shaders were compiled, found {}", frame["modules"]);
    }
}

#[test]
fn the_limits_that_every_device_has_are_enough() {
    let Some(seen) = seen() else { return };
    let limits = seen.value("limits");
    assert_eq!(limits["storage"], 8, "the device has the limits of the standard");
    assert_eq!(limits["workgroup"], 16384, "the device has the limits of the standard");
    assert!(limits["pictured"].as_bool() == Some(true), "the bundled capture is shown: {limits}");
}

/// Returns the number of running threads per core, at least 1: the factor by which a thread is slower than on an idle
/// machine.
fn busy() -> f64 {
    let cores = std::thread::available_parallelism().map_or(1.0, |cores| cores.get() as f64);
    let load = std::fs::read_to_string("/proc/loadavg").unwrap_or_default();
    let running = load.split_whitespace().next().and_then(|number| number.parse().ok()).unwrap_or(0.0);
    (running / cores).max(1.0)
}

/// Returns the least of several times, ms: other programs of the machine take time, too.
fn least(times: &Value) -> f64 {
    let all: Vec<f64> = serde_json::from_value(times.clone()).expect("milliseconds");
    all.into_iter().fold(f64::INFINITY, f64::min)
}

#[test]
fn the_page_answers_while_a_capture_is_loaded() {
    let Some(seen) = seen() else { return };
    let loading = seen.value("loading");
    println!("{loading}");
    let least = |key: &str| least(&loading[key]);
    let limit = 50.0 * busy();
    assert!(least("slices") <= limit, "the longest slice of loading is longer than {limit:.0} ms: {loading}");
    assert!(least("draws") <= limit, "the longest call to draw is longer than {limit:.0} ms: {loading}");
    assert!(least("pictures") <= 25_000.0, "the first picture, on a software driver: {loading}");
    assert!(loading["parts"].as_u64() > Some(3), "the progress was told: {loading}");
}

#[test]
fn the_page_answers_while_a_large_capture_is_loaded() {
    let Some(seen) = seen() else { return };
    let large = seen.value("large");
    println!("{large}");
    assert_eq!(large["gaussians"], LARGE, "the large capture is shown: {large}");
    let limit = 50.0 * busy();
    assert!(least(&large["slices"]) <= limit, "the longest slice of loading is longer than {limit:.0} ms: {large}");
}

#[test]
fn loading_again_takes_no_further_memory() {
    let Some(seen) = seen() else { return };
    let memory = seen.value("memory");
    let bytes = memory["bytes"].as_u64().expect("the length of the file");
    let sizes: Vec<u64> = serde_json::from_value(memory["sizes"].clone()).expect("bytes after each capture");
    // The heap may grow once, at any load: what is freed and allocated in between depends on when pieces of the file and
    // pictures arrive. If each load kept a twentieth of the file, those after the second would take more than the file.
    let [_, second, further @ .., last] = &sizes[..] else { panic!("loads after the second: {sizes:?}") };
    assert!(further.len() > 20, "so many loads: {sizes:?}");
    assert!(last - second < bytes, "loads after the second take less than the {bytes} bytes of the file: {sizes:?}");
}

/// Checks the values that the page has reported as true.
fn check_all(name: &str) {
    let Some(seen) = seen() else { return };
    let Value::Object(all) = seen.value(name) else { panic!("`{name}` is an object") };
    assert!(!all.is_empty(), "`{name}` has checks");
    for (check, value) in all {
        assert_eq!(value, Value::Bool(true), "{name}: {check}");
    }
}

#[test]
fn the_time_is_set_by_slider_keys_and_links() {
    check_all("seeking");
}

#[test]
fn the_camera_is_moved_by_mouse_touch_and_keys() {
    check_all("orbit");
}

#[test]
fn the_page_around_plays_pauses_and_seeks() {
    check_all("messages");
}

#[test]
fn a_dropped_file_is_shown() {
    check_all("dropped");
}

#[test]
fn a_broken_file_is_refused_with_a_message_and_the_capture_stays() {
    check_all("broken");
}

#[test]
fn a_browser_without_webgpu_shows_a_message() {
    check_all("missing");
}

#[test]
fn a_phone_has_all_controls_within_its_screen() {
    check_all("phone");
}

#[test]
fn a_capture_in_chunk_files_plays_while_its_files_arrive() {
    check_all("take");
}

#[test]
fn parts_of_one_file_are_fetched_and_without_parts_it_is_played_whole() {
    check_all("parts");
}

#[test]
fn an_app_of_bevy_streams_chunk_files_and_parts_of_one_file() {
    if seen().is_some_and(|seen| !seen.results.contains_key("app-streams")) {
        skip("the page has no app of Bevy: `bash .ci/web --bevy`");
    } else {
        check_all("app-streams");
    }
}

#[test]
fn chunk_files_that_fail_are_asked_for_again_and_a_missing_one_is_named() {
    check_all("faults");
}
