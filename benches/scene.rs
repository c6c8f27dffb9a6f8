//! Wall-clock time of a Bevy app's frame with a capture in a scene: the cost of walls, glass, fog, shadows, cameras and
//! many copies.
//!
//! ```text
//! cargo bench --features viewer,cli --bench scene -- [CAPTURE] [--size WIDTHxHEIGHT] [--frames N] [--rounds N] \
//!     [--only WORD]
//! ```
//!
//! In: a capture (default: the bundled capture), a picture size (1280x720), the number of frames of a measurement
//! (100), the number of rounds (9), a word in the names of the scenes to measure (all scenes). Out: for each scene
//! milliseconds of a frame (median of the rounds), the spread of the rounds, the additional time compared with the
//! scene that the last column names (median of the rounds' differences), and the range of the middle half of these
//! differences; then, from the same number of further frames but at most 100, the GPU time of the captures' passes, all
//! together and (on a line of its own) each, the number of splats, and the GPU memory of all views. Default plugins, no
//! window, pipelined rendering; all apps take turns, and each measurement ends when the GPU has finished.

mod common;

use bevy::light::{CascadeShadowConfigBuilder, DirectionalLightShadowMap};
use bevy::prelude::*;
use bevy_gs4d::pbr::{CastsShadows, ShadowResolution};
use bevy_gs4d::prelude::*;
use common::{Arguments, Times};

/// The contents of a scene.
#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Nothing,
    Capture,
    TwoViews,
    FourViews,
    Wall,
    GlassAlone,
    Glass,
    Fog,
    SunAlone,
    Sun,
    Shadow,
    Crowd,
    CrowdOfAll,
}

use Kind::*;

/// The scenes: a name, the contents, the samples of the camera, and the name of the scene for comparison.
const SCENES: [(&str, Kind, Msaa, &str); 18] = [
    ("nothing", Nothing, Msaa::Off, "nothing"),
    ("capture", Capture, Msaa::Off, "nothing"),
    ("capture, two cameras", TwoViews, Msaa::Off, "capture"),
    ("capture, four cameras", FourViews, Msaa::Off, "capture"),
    ("capture behind a wall", Wall, Msaa::Off, "capture"),
    ("glass alone", GlassAlone, Msaa::Off, "nothing"),
    ("glass before the capture", Glass, Msaa::Off, "glass alone"),
    ("nothing, 4 samples", Nothing, Msaa::Sample4, "nothing, 4 samples"),
    ("capture, 4 samples", Capture, Msaa::Sample4, "nothing, 4 samples"),
    ("capture behind a wall, 4 samples", Wall, Msaa::Sample4, "capture, 4 samples"),
    ("glass alone, 4 samples", GlassAlone, Msaa::Sample4, "nothing, 4 samples"),
    ("glass before the capture, 4 samples", Glass, Msaa::Sample4, "glass alone, 4 samples"),
    ("capture in fog", Fog, Msaa::Off, "capture"),
    ("sun alone", SunAlone, Msaa::Off, "nothing"),
    ("capture in the sun", Sun, Msaa::Off, "sun alone"),
    ("capture that casts a shadow", Shadow, Msaa::Off, "capture in the sun"),
    ("100 copies, 50 units away", Crowd, Msaa::Off, "nothing"),
    ("100 copies without levels of detail", CrowdOfAll, Msaa::Off, "nothing"),
];

fn main() -> Result {
    let mut wanted = String::new();
    let arguments = common::parse(UVec2::new(1280, 720), 100, 9, |option, value| {
        let is_own = option == "--only";
        if is_own {
            wanted = value()?;
        }
        Ok(is_own)
    })?;
    let is_wanted = |(name, ..): &(&str, Kind, Msaa, &str)| {
        let names = |other: &str| other.contains(&wanted);
        names(name) || SCENES.iter().any(|(other, .., than)| names(other) && than == name)
    };
    let scenes: Vec<_> = SCENES.into_iter().filter(is_wanted).collect();
    let mut apps = Vec::new();
    for &(_, kind, msaa, _) in &scenes {
        apps.push(app(&arguments, !apps.is_empty(), kind, msaa)?);
    }
    let measured = common::measure(&mut apps, &arguments)?;
    println!("{}, {}x{}", arguments.capture.display(), arguments.size.x, arguments.size.y);
    println!(
        "{:<36} {:>9} {:>15} {:>9} {:>15} {:>9} {:>9} {:>8}  than",
        "scene", "frame ms", "rounds ms", "more ms", "middle half", "GPU ms", "splats", "views MB"
    );
    let mut known: Vec<(&str, &Times)> = Vec::new();
    let timed = scenes.into_iter().zip(&mut apps).zip(&measured);
    for (((name, _, _, compared), app), times) in timed {
        known.push((name, times));
        let than = known.iter().find(|(name, _)| *name == compared);
        let (more, middle) = than.map_or((f64::NAN, String::new()), |(_, than)| times.more_than(than));
        let Passes { whole: gpu, each, splats, bytes } = passes(app, arguments.frames.clamp(1, 100))?;
        println!(
            "{name:<36} {:>9.3} {:>15} {more:>9.3} {middle:>15} {gpu:>9.4} {splats:>9} {:>8.1}  {compared}",
            times.median(),
            times.spread(),
            bytes as f64 / 1e6
        );
        let each: Vec<_> = each.iter().map(|(name, time)| format!("{name} {time:.4}")).collect();
        println!("{:<36} {}", "", each.join(", "));
    }
    Ok(())
}

/// What the captures of a frame take.
struct Passes {
    /// GPU time of all passes in a frame, milliseconds: the median.
    whole: f64,
    /// That of each pass, of all views together.
    each: Vec<(&'static str, f64)>,
    splats: u32,
    /// Bytes of all views.
    bytes: u64,
}

/// Measures so many frames.
fn passes(app: &mut App, frames: u32) -> Result<Passes> {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    statistics.measure(true);
    common::warm_up(app)?;
    let (mut times, mut splats, mut bytes) = (Vec::new(), 0, 0);
    let mut each: Vec<(&'static str, Vec<f64>)> = Vec::new();
    for _ in 0..frames {
        common::run(app, 1)?;
        let views = statistics.views();
        let mut frame: Vec<(&'static str, f64)> = Vec::new();
        for pass in views.iter().flat_map(|(_, view)| &view.passes) {
            match frame.iter_mut().find(|(name, _)| *name == pass.name) {
                Some((_, time)) => *time += pass.milliseconds,
                None => frame.push((pass.name, pass.milliseconds)),
            }
        }
        times.push(frame.iter().map(|(_, time)| time).sum::<f64>());
        for (name, time) in frame {
            match each.iter_mut().find(|(known, _)| *known == name) {
                Some((_, times)) => times.push(time),
                None => each.push((name, vec![time])),
            }
        }
        splats = views.iter().map(|(_, view)| view.visible).sum();
        let shared = views.iter().map(|(_, view)| view.shared_bytes).max().unwrap_or(0);
        bytes = shared + views.iter().map(|(_, view)| view.bytes).sum::<u64>();
    }
    statistics.measure(false);
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let each = each.into_iter().map(|(name, times)| (name, median(times))).collect();
    Ok(Passes { whole: median(times), each, splats, bytes })
}

/// Returns an app with a camera and a scene. All assets are loaded.
fn app(arguments: &Arguments, logged: bool, kind: Kind, msaa: Msaa) -> Result<App> {
    let mut app = common::app(arguments.size, logged, |plugins| plugins);
    app.add_plugins(GaussianCapturePlugins).insert_resource(DirectionalLightShadowMap { size: 1024 });
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
    if kind == Wall {
        let material = StandardMaterial { unlit: true, ..default() };
        let material = world.resource_mut::<Assets<StandardMaterial>>().add(material);
        let wall = world.resource_mut::<Assets<Mesh>>().add(Cuboid::new(6.0, 6.0, 0.01));
        let before = Transform::from_xyz(-2.0, 1.0, 1.3).looking_at(place.translation, Vec3::Y);
        world.spawn((Mesh3d(wall), MeshMaterial3d(material), before));
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
    let more = match kind {
        TwoViews => 1,
        FourViews => 3,
        _ => 0,
    };
    for camera in 0..more {
        world.spawn((Camera3d::default(), Camera { order: -1 - camera, ..default() }, msaa, place));
    }
    let handle = world.resource::<AssetServer>().load(arguments.capture.clone());
    match kind {
        Nothing | GlassAlone | SunAlone => {}
        Crowd | CrowdOfAll => {
            let bias = if kind == CrowdOfAll { 16.0 } else { 0.0 };
            world.insert_resource(CaptureDetail { bias });
            let away = place.forward() * 50.0;
            for index in 0..100 {
                let right = place.right() * (3.0 * (index % 10) as f32 - 13.5);
                let up = place.up() * (2.0 * (index / 10) as f32 - 9.0);
                let at = Transform::from_translation(place.translation + away + right + up);
                world.spawn((GaussianCapture3d(handle.clone()), Upright, at));
            }
        }
        Capture | TwoViews | FourViews | Wall | Glass | Fog | Sun | Shadow => {
            let capture = world.spawn((GaussianCapture3d(handle), Upright)).id();
            if kind == Shadow {
                world.entity_mut(capture).insert(CastsShadows { resolution: ShadowResolution::Full, ..default() });
            }
        }
    }
    common::start(&mut app)?;
    Ok(app)
}
