//! Wall-clock time of a whole Bevy app's frame, with a capture that plays and without one.
//!
//! ```text
//! cargo bench --features viewer,cli --bench app -- [CAPTURE] [--size WIDTHxHEIGHT] [--frames N] [--rounds N] [--eye X,Y,Z]
//! ```
//!
//! In: a capture (default: the bundled one), a picture size (640x480), a number of frames for each measurement (600), how often each is
//! repeated (3), and an eye in capture space that looks at the origin with z up (-3.57,1.3,1.69). Out: for Bevy's default plugins and
//! for the few that a capture needs, with one sample and with four, for no capture and for each [`Design`]: frames per second and
//! milliseconds of a frame, the median of the rounds, how much longer the frame is than without a capture, and the spread of the rounds. Rendering is pipelined,
//! there is no window, and each measurement ends when the GPU has finished.

use bevy::a11y::AccessibilityPlugin;
use bevy::animation::AnimationPlugin;
use bevy::app::PluginGroupBuilder;
use bevy::input::InputPlugin;
use bevy::light::LightPlugin;
use bevy::log::LogPlugin;
use bevy::pbr::PbrPlugin;
use bevy::prelude::*;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::renderer::RenderDevice;
use bevy::state::app::StatesPlugin;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::prelude::*;
use bevy_gs4d::renderer::Design;
use bevy_gs4d::testing;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A GPU that was idle runs slowly for a while.
const WARM_UP: Duration = Duration::from_millis(600);

struct Arguments {
    capture: PathBuf,
    size: UVec2,
    frames: u32,
    rounds: usize,
    eye: Vec3,
}

/// One app, and the times of its frame in milliseconds, one for each round.
struct Subject {
    plugins: &'static str,
    samples: u32,
    design: Option<Design>,
    app: App,
    times: Vec<f64>,
}

fn main() -> Result {
    let arguments = parse()?;
    let mut subjects = Vec::new();
    for (plugins, adjust) in [("default", all as fn(_) -> _), ("minimal", few)] {
        for msaa in [Msaa::Off, Msaa::Sample4] {
            for design in [None, Some(Design::Reference), Some(Design::Fast)] {
                // Bevy has one logger for all apps.
                let logged = !subjects.is_empty();
                let app = app(&arguments, adjust, logged, msaa, design)?;
                subjects.push(Subject { plugins, samples: msaa.samples(), design, app, times: Vec::new() });
            }
        }
    }
    for _ in 0..arguments.rounds {
        for subject in &mut subjects {
            let began = Instant::now();
            while began.elapsed() < WARM_UP {
                run(&mut subject.app, 10)?;
            }
            let took = run(&mut subject.app, arguments.frames)?;
            subject.times.push(took.as_secs_f64() * 1e3 / f64::from(arguments.frames));
        }
    }
    println!("{}, {}x{}", arguments.capture.display(), arguments.size.x, arguments.size.y);
    println!(
        "{:<8} {:>7} {:<10} {:>8} {:>9} {:>9} {:>15}",
        "plugins", "samples", "capture", "FPS", "frame ms", "more ms", "rounds ms"
    );
    let mut without = f64::NAN;
    for Subject { plugins, samples, design, times, .. } in &mut subjects {
        times.sort_by(f64::total_cmp);
        let time = times.get(times.len() / 2).copied().unwrap_or(f64::NAN);
        without = if design.is_none() { time } else { without };
        let name = Design::NAMES.iter().find(|(_, known)| Some(*known) == *design).map_or("none", |(name, _)| name);
        let spread =
            times.first().zip(times.last()).map_or(String::new(), |(low, high)| format!("{low:.3} - {high:.3}"));
        println!(
            "{plugins:<8} {samples:>7} {name:<10} {:>8.0} {time:>9.3} {:>9.3} {spread:>15}",
            1e3 / time,
            time - without
        );
    }
    Ok(())
}

fn all(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
}

/// Leaves out what a capture does not need.
fn few(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
        .disable::<PbrPlugin>()
        .disable::<LightPlugin>()
        .disable::<AnimationPlugin>()
        .disable::<InputPlugin>()
        .disable::<AccessibilityPlugin>()
        .disable::<StatesPlugin>()
}

/// Returns an app with a camera and, if a design is given, a capture that plays and is drawn that way; everything is loaded.
fn app(
    arguments: &Arguments,
    adjust: fn(PluginGroupBuilder) -> PluginGroupBuilder,
    logged: bool,
    msaa: Msaa,
    design: Option<Design>,
) -> Result<App> {
    let mut app = testing::app_with(arguments.size, |plugins| {
        let plugins = adjust(plugins).enable::<PipelinedRenderingPlugin>();
        if logged { plugins.disable::<LogPlugin>() } else { plugins }
    });
    let eye = Transform::from_translation(arguments.eye).looking_at(Vec3::ZERO, Vec3::Z);
    let lens = Projection::Perspective(PerspectiveProjection { fov: 0.53, ..default() });
    let camera = app.world_mut().spawn((Camera3d::default(), msaa, lens, eye)).id();
    if let Some(design) = design {
        app.add_plugins(GaussianCapturePlugin);
        let handle = app.world().resource::<AssetServer>().load(arguments.capture.clone());
        app.world_mut().spawn(GaussianCapture3d(handle));
        app.world_mut().entity_mut(camera).insert(CaptureViewSettings { design, ..default() });
    }
    testing::settle(&mut app)?;
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(1.0 / 60.0)));
    Ok(app)
}

/// Runs the app for a number of frames, and returns the time until the GPU has finished them.
fn run(app: &mut App, frames: u32) -> Result<Duration> {
    let device = app.world().resource::<RenderDevice>().clone();
    let began = Instant::now();
    for _ in 0..frames {
        app.update();
        if app.should_exit().is_some() {
            return Err("the app stopped".into());
        }
    }
    device.wgpu_device().poll(wgpu::PollType::wait_indefinitely())?;
    Ok(began.elapsed())
}

fn parse() -> Result<Arguments> {
    let mut parsed = Arguments {
        capture: concat!(env!("CARGO_MANIFEST_DIR"), "/assets/toybox.gs4d").into(),
        size: UVec2::new(640, 480),
        frames: 600,
        rounds: 3,
        eye: Vec3::new(-3.57, 1.3, 1.69),
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--size" => parsed.size = numbers(&value()?, 'x').map(UVec2::from).ok_or("--size: not like 640x480")?,
            "--frames" => parsed.frames = value()?.parse().map_err(|_| "--frames: not a number")?,
            "--rounds" => parsed.rounds = value()?.parse().map_err(|_| "--rounds: not a number")?,
            "--eye" => parsed.eye = numbers(&value()?, ',').map(Vec3::from).ok_or("--eye: not like 1,2,3")?,
            // Cargo passes this one.
            "--bench" => {}
            option if option.starts_with('-') => return Err(format!("{option}: no such option").into()),
            file => parsed.capture = file.into(),
        }
    }
    Ok(parsed)
}

/// Returns exactly `N` numbers between separators.
fn numbers<T: std::str::FromStr, const N: usize>(text: &str, separator: char) -> Option<[T; N]> {
    let parts: Vec<T> = text.split(separator).map(|part| part.parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}
