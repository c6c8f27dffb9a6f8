//! Wall-clock time of a Bevy app's frame in which a capture stands in a scene: what glass, fog, shadows and many copies cost.
//!
//! ```text
//! cargo bench --features viewer,cli --bench scene -- [CAPTURE] [--detailed CAPTURE] [--size WIDTHxHEIGHT] [--frames N] [--rounds N]
//! ```
//!
//! In: a capture (default: the bundled one) and the same with levels of detail (`gs4d detail`; without it those rows are left out), a
//! picture size (1280x720), frames for each measurement (300), rounds (3). Out: milliseconds of a frame for each scene, the median of the
//! rounds, how much longer it is than the scene that it is compared with, and the spread of the rounds. Default plugins, no window,
//! rendering is pipelined, all apps take turns, and each measurement ends when the GPU has finished.

use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap};
use bevy::log::LogPlugin;
use bevy::prelude::*;
use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
use bevy::render::renderer::RenderDevice;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::prelude::*;
use bevy_gs4d::testing;
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A GPU that was idle runs slowly for a while.
const WARM_UP: Duration = Duration::from_millis(600);

struct Arguments {
    capture: PathBuf,
    detailed: Option<PathBuf>,
    size: UVec2,
    frames: u32,
    rounds: usize,
}

/// What stands in the scene.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Nothing,
    Capture,
    TwoViews,
    GlassAlone,
    Glass,
    Fog,
    SunAlone,
    Sun,
    Shadow,
    Crowd,
    CrowdOfLevels,
}

use Kind::*;

/// The scenes: a name, what stands there, the samples of the camera, and the scene that it is compared with.
const SCENES: [(&str, Kind, Msaa, &str); 15] = [
    ("nothing", Nothing, Msaa::Off, "nothing"),
    ("capture", Capture, Msaa::Off, "nothing"),
    ("capture, two cameras", TwoViews, Msaa::Off, "capture"),
    ("glass alone", GlassAlone, Msaa::Off, "nothing"),
    ("glass before the capture", Glass, Msaa::Off, "glass alone"),
    ("nothing, 4 samples", Nothing, Msaa::Sample4, "nothing, 4 samples"),
    ("capture, 4 samples", Capture, Msaa::Sample4, "nothing, 4 samples"),
    ("glass alone, 4 samples", GlassAlone, Msaa::Sample4, "nothing, 4 samples"),
    ("glass before the capture, 4 samples", Glass, Msaa::Sample4, "glass alone, 4 samples"),
    ("capture in fog", Fog, Msaa::Off, "capture"),
    ("sun alone", SunAlone, Msaa::Off, "nothing"),
    ("capture in the sun", Sun, Msaa::Off, "sun alone"),
    ("capture that casts a shadow", Shadow, Msaa::Off, "capture in the sun"),
    ("100 copies, 50 units away", Crowd, Msaa::Off, "nothing"),
    ("the same with levels of detail", CrowdOfLevels, Msaa::Off, "nothing"),
];

/// One scene, and the times of its frame in milliseconds, one for each round.
struct Subject {
    name: &'static str,
    compared: &'static str,
    app: App,
    times: Vec<f64>,
}

fn main() -> Result {
    let arguments = parse()?;
    let mut subjects = Vec::new();
    for (name, kind, msaa, compared) in SCENES {
        if kind != CrowdOfLevels || arguments.detailed.is_some() {
            // Bevy has one logger for all apps.
            let app = app(&arguments, !subjects.is_empty(), kind, msaa)?;
            subjects.push(Subject { name, compared, app, times: Vec::new() });
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
    println!("{:<36} {:>9} {:>9} {:>15}  than", "scene", "frame ms", "more ms", "rounds ms");
    let mut known: Vec<(&str, f64)> = Vec::new();
    for Subject { name, compared, times, .. } in &mut subjects {
        times.sort_by(f64::total_cmp);
        let time = times.get(times.len() / 2).copied().unwrap_or(f64::NAN);
        known.push((name, time));
        let than = known.iter().find(|(name, _)| name == compared).map_or(f64::NAN, |(_, time)| *time);
        let spread = times.first().zip(times.last());
        let spread = spread.map_or(String::new(), |(low, high)| format!("{low:.3} - {high:.3}"));
        println!("{name:<36} {time:>9.3} {:>9.3} {spread:>15}  {compared}", time - than);
    }
    Ok(())
}

/// Returns an app with a camera and a scene; everything is loaded.
fn app(arguments: &Arguments, logged: bool, kind: Kind, msaa: Msaa) -> Result<App> {
    let mut app = testing::app_with(arguments.size, |plugins| {
        let plugins = plugins.enable::<PipelinedRenderingPlugin>();
        if logged { plugins.disable::<LogPlugin>() } else { plugins }
    });
    app.add_plugins(GaussianCapturePlugin).insert_resource(DirectionalLightShadowMap { size: 1024 });
    let place = Transform::from_xyz(-3.0, 1.6, 2.0).looking_at(Vec3::ZERO, Vec3::Y);
    let camera = app.world_mut().spawn((Camera3d::default(), msaa, place)).id();
    let world = app.world_mut();
    if matches!(kind, GlassAlone | Glass) {
        let material = StandardMaterial {
            base_color: Color::srgba(0.2, 0.4, 0.9, 0.3),
            alpha_mode: AlphaMode::Blend,
            unlit: true,
            ..default()
        };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let pane = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(1.0, 1.0, 0.01));
        let before = Transform::from_xyz(-2.0, 1.0, 1.3).looking_at(place.translation, Vec3::Y);
        world.spawn((Mesh3d(pane), MeshMaterial3d(material), before));
    }
    if matches!(kind, SunAlone | Sun | Shadow) {
        let floor = world.resource_mut::<Assets<Mesh>>().add(Plane3d::default().mesh().size(12.0, 12.0));
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(StandardMaterial::default());
        world.spawn((Mesh3d(floor), MeshMaterial3d(material), Transform::from_xyz(0.0, -1.0, 0.0)));
        let cascades = CascadeShadowConfigBuilder { num_cascades: 1, maximum_distance: 12.0, ..default() }.build();
        let sun = DirectionalLight { shadow_maps_enabled: true, ..default() };
        world.spawn((sun, cascades, Transform::from_xyz(2.0, 5.0, 3.0).looking_at(Vec3::ZERO, Vec3::Y)));
    }
    if kind == Fog {
        let falloff = FogFalloff::Exponential { density: 0.1 };
        world.entity_mut(camera).insert(DistanceFog { color: Color::srgb(0.5, 0.6, 0.7), falloff, ..default() });
    }
    if kind == TwoViews {
        world.spawn((Camera3d::default(), Camera { order: -1, ..default() }, msaa, place));
    }
    let file = if kind == CrowdOfLevels { arguments.detailed.as_ref() } else { None };
    let handle = world.resource::<AssetServer>().load(file.unwrap_or(&arguments.capture).clone());
    match kind {
        Nothing | GlassAlone | SunAlone => {}
        Crowd | CrowdOfLevels => {
            let away = place.forward() * 50.0;
            for index in 0..100 {
                let beside = place.right() * (3.0 * (index % 10) as f32 - 13.5);
                let above = place.up() * (2.0 * (index / 10) as f32 - 9.0);
                let at = Transform::from_translation(place.translation + away + beside + above);
                world.spawn((GaussianCapture3d(handle.clone()), Upright, at));
            }
        }
        Capture | TwoViews | Glass | Fog | Sun | Shadow => {
            let capture = world.spawn((GaussianCapture3d(handle), Upright)).id();
            if kind == Shadow {
                world.entity_mut(capture).insert(CastsShadows { resolution: ShadowResolution::Full, ..default() });
            }
        }
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
        detailed: None,
        size: UVec2::new(1280, 720),
        frames: 300,
        rounds: 3,
    };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--detailed" => parsed.detailed = Some(value()?.into()),
            "--size" => {
                let text = value()?;
                let (width, height) = text.split_once('x').ok_or("--size: not like 1280x720")?;
                parsed.size = UVec2::new(width.parse()?, height.parse()?);
            }
            "--frames" => parsed.frames = value()?.parse()?,
            "--rounds" => parsed.rounds = value()?.parse()?,
            // Cargo passes this one.
            "--bench" => {}
            option if option.starts_with('-') => return Err(format!("{option}: no such option").into()),
            file => parsed.capture = file.into(),
        }
    }
    Ok(parsed)
}
