//! What streaming is like: the first picture, playing, also while the link is disturbed, seeks.
//!
//! In: an app whose camera sees the capture, a link. Out: the entity with the capture; lines for each of these, and the
//! numbers in them.

use crate::figures::{Figures, mebibytes, median, peak_memory, quantile, scattered};
use crate::link::Link;
use crate::take::Take;
use crate::watch::{Frame, LIMIT, Watch};
use bevy::prelude::*;
use bevy_gs4d::prelude::*;
use bevy_gs4d::testing;
use std::time::Instant;

/// Number of seeks.
const SEEKS: u64 = 8;
/// How long is measured after the link was disturbed, seconds.
const AFTERWARDS: f64 = 10.0;

/// How often the most important Gaussians were missing.
#[derive(Resource, Default)]
struct Underruns(u64);

fn count_underruns(_: On<CaptureBuffering>, mut underruns: ResMut<Underruns>) {
    underruns.0 += 1;
}

/// Draws a file of the capture, so that no shader is compiled while something is measured, and removes it again.
///
/// # Errors
/// Errors of drawing.
pub fn warm_up(app: &mut App, sample: GaussianCapture) -> Result {
    // Finishes the plugins, and makes the first frames of Bevy itself.
    testing::settle(app)?;
    let sample = app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(sample);
    let shown = app.world_mut().spawn((GaussianCapture3d(sample), Upright)).id();
    testing::settle(app)?;
    app.world_mut().despawn(shown);
    Ok(testing::settle(app)?)
}

/// Loads the capture over a link, plays it for `seconds`, seeks in it, and reports how that went.
///
/// # Errors
/// An index that cannot be loaded, no picture in time, the end of the app.
pub fn report(app: &mut App, take: &Take, link: &Link, seconds: f64, figures: &mut Figures) -> Result<Entity> {
    app.init_resource::<Underruns>();
    let began = Instant::now();
    let capture = app.world().resource::<AssetServer>().load(link.index());
    let player = app.world_mut().spawn((GaussianCapture3d(capture), Upright)).observe(count_underruns).id();
    let first = Watch::new(app, player).arrive(began)?;
    if first.coarse.is_infinite() {
        return Err(format!("no picture within {} s", LIMIT.as_secs()).into());
    }
    let (coarse, whole) = (text(first.coarse), text(first.whole));
    println!("first picture (coarse): {coarse} after the start of loading, whole: {whole}");
    figures.add("first_coarse_s", format_args!("{:.3}", first.coarse));
    figures.add("first_whole_s", format_args!("{:.3}", first.whole));
    play(app, player, seconds, figures)?;
    if link.quality().is_disturbed() {
        disturb(app, player, link, figures)?;
    }
    seek(app, player, take.seconds, figures)?;
    let (traffic, peak) = (link.traffic(), peak_memory().map_or(0.0, mebibytes));
    let (requests, lost, read) = (traffic.requests, traffic.lost, mebibytes(traffic.bytes));
    println!("over the link: {requests} requests, {lost} lost, {read:.1} MiB; {peak:.0} MiB of memory at most");
    figures.add("link_requests", requests);
    figures.add("link_lost", lost);
    figures.add("link_mib", format_args!("{read:.1}"));
    figures.add("peak_mib", format_args!("{peak:.1}"));
    Ok(player)
}

/// Returns the text of a time, which may be infinite.
fn text(seconds: f64) -> String {
    if seconds.is_finite() { format!("{seconds:.2} s") } else { format!("more than {} s", LIMIT.as_secs()) }
}

/// Plays on, and reports what was there in each frame.
fn play(app: &mut App, player: Entity, seconds: f64, figures: &mut Figures) -> Result {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    let buffering = app.world().resource::<Underruns>().0;
    let (mut times, mut whole, mut coarse) = (Vec::new(), 0, 0);
    let (mut gpu, mut host, mut requests, mut failures, mut uploaded) = (0, 0, 0, 0, 0);
    let mut watch = Watch::new(app, player);
    let began = Instant::now();
    while began.elapsed().as_secs_f64() < seconds {
        let Frame { seconds, state } = watch.frame()?;
        times.push(1e3 * seconds);
        if state.is_whole() {
            whole += 1;
        } else if state.is_coarse {
            coarse += 1;
        }
        gpu = state.gpu_bytes.max(gpu);
        host = state.host_bytes.max(host);
        requests = state.requests.max(requests);
        failures = state.failures;
        uploaded = statistics.capture_bytes().max(uploaded);
    }
    let buffering = app.world().resource::<Underruns>().0 - buffering;
    let (frames, usual, most) = (times.len(), median(&times), quantile(&times, 0.99));
    let share = |count: usize| count as f64 / frames.max(1) as f64;
    let (whole, coarse, missing) = (share(whole), share(coarse), share(frames - whole - coarse));
    let (gpu, host, uploaded) = (mebibytes(gpu), mebibytes(host), mebibytes(uploaded));
    println!("played {seconds} s: {frames} frames, median {usual:.2} ms, 99th percentile {most:.2} ms");
    println!(
        "frames that were whole: {:.1} %, coarse: {:.1} %, less: {:.1} %; {buffering} times not even coarse",
        100.0 * whole,
        100.0 * coarse,
        100.0 * missing
    );
    println!(
        "at most {gpu:.1} MiB on the GPU ({uploaded:.1} measured), {host:.1} MiB on their way in {requests} files"
    );
    println!("requests that failed, from the start: {failures}");
    figures.add("frames", frames);
    figures.add("frame_ms", format_args!("{usual:.3}"));
    figures.add("frame_p99_ms", format_args!("{most:.3}"));
    figures.add("whole_share", format_args!("{whole:.4}"));
    figures.add("coarse_share", format_args!("{coarse:.4}"));
    figures.add("less_share", format_args!("{missing:.4}"));
    figures.add("buffering", buffering);
    figures.add("gpu_mib", format_args!("{gpu:.1}"));
    figures.add("uploaded_mib", format_args!("{uploaded:.1}"));
    figures.add("host_mib", format_args!("{host:.1}"));
    figures.add("requests", requests);
    figures.add("failures", failures);
    Ok(())
}

/// Disturbs the link, plays on, and reports how long pictures were coarse, or less.
fn disturb(app: &mut App, player: Entity, link: &Link, figures: &mut Figures) -> Result {
    let mut watch = Watch::new(app, player);
    let began = Instant::now();
    link.disturb();
    // The last moment at which the picture was not even coarse, and not whole.
    let (mut less, mut coarse) = (0.0, 0.0);
    while began.elapsed().as_secs_f64() < AFTERWARDS {
        let state = watch.frame()?.state;
        let seconds = began.elapsed().as_secs_f64();
        if !state.is_coarse {
            less = seconds;
        }
        if !state.is_whole() {
            coarse = seconds;
        }
    }
    println!("after the link was disturbed: pictures were coarse until {coarse:.2} s, less until {less:.2} s");
    figures.add("disturbed_coarse_s", format_args!("{coarse:.3}"));
    figures.add("disturbed_less_s", format_args!("{less:.3}"));
    Ok(())
}

/// Seeks to scattered times of a capture of some seconds, and reports how long pictures take.
fn seek(app: &mut App, player: Entity, duration: f32, figures: &mut Figures) -> Result {
    let (mut coarse, mut whole) = (Vec::new(), Vec::new());
    let mut watch = Watch::new(app, player);
    for number in 1..=SEEKS {
        watch.seek(duration * scattered(number) as f32);
        let arrival = watch.arrive(Instant::now())?;
        coarse.push(arrival.coarse);
        whole.push(arrival.whole);
    }
    for (name, times) in [("coarse", &coarse), ("whole", &whole)] {
        let (usual, most) = (median(times), quantile(times, 1.0));
        println!("{SEEKS} seeks, until {name}: median {}, at most {}", text(usual), text(most));
        figures.add(&format!("seek_{name}_s"), format_args!("{usual:.3}"));
        figures.add(&format!("seek_{name}_max_s"), format_args!("{most:.3}"));
    }
    Ok(())
}
