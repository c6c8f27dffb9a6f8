//! Wall-clock time of a whole Bevy app's frame, with a playing capture and without a capture.
//!
//! ```text
//! cargo bench --features viewer,cli --bench app -- [CAPTURE] [--size WIDTHxHEIGHT] [--frames N] [--rounds N] \
//!     [--eye X,Y,Z] [--plugins SET]
//! ```
//!
//! In: a capture (default: the bundled capture), a picture size (640x480), the number of frames of a measurement (100),
//! the number of rounds (21), an eye in capture space that looks at the origin with z up (-3.57,1.3,1.69), and
//! `default` or `minimal` (both). Out: for Bevy's default plugins and for the minimal plugins that a capture needs,
//! with one sample and with four, without a capture and with each [`Design`]: frames per second and milliseconds of a
//! frame (median of the rounds), the spread of the rounds, the additional time compared with the frame without a
//! capture (median of the rounds' differences), and the range of the middle half of these differences. Rendering is
//! pipelined, there is no window, and each measurement ends when the GPU has finished.

mod common;

use bevy::a11y::AccessibilityPlugin;
use bevy::animation::AnimationPlugin;
use bevy::anti_alias::AntiAliasPlugin;
use bevy::app::PluginGroupBuilder;
use bevy::input::InputPlugin;
use bevy::light::LightPlugin;
use bevy::pbr::PbrPlugin;
use bevy::picking::input::PointerInputPlugin;
use bevy::picking::{InteractionPlugin, PickingPlugin};
use bevy::post_process::PostProcessPlugin;
use bevy::prelude::*;
use bevy::state::app::StatesPlugin;
use bevy_gs4d::prelude::*;
use bevy_gs4d::renderer::Design;
use common::Arguments;

/// A measured app: the set of plugins, the samples of the camera, and the design that draws the capture, `None` without
/// a capture.
struct Subject {
    plugins: &'static str,
    samples: u32,
    design: Option<Design>,
}

fn main() -> Result {
    let mut eye = Vec3::new(-3.57, 1.3, 1.69);
    let mut wanted = None;
    let arguments = common::parse(UVec2::new(640, 480), 100, 21, |option, value| {
        match option {
            "--eye" => eye = common::numbers(&value()?, ',').map(Vec3::from).ok_or("--eye: not like 1,2,3")?,
            "--plugins" => wanted = Some(value()?),
            _ => return Ok(false),
        }
        Ok(true)
    })?;
    let (mut subjects, mut apps) = (Vec::new(), Vec::new());
    for (plugins, adjust) in [("default", all as fn(_) -> _), ("minimal", few)] {
        if wanted.as_ref().is_some_and(|wanted| wanted != plugins) {
            continue;
        }
        for msaa in [Msaa::Off, Msaa::Sample4] {
            for design in [None, Some(Design::GlobalSort), Some(Design::TileBins)] {
                apps.push(app(&arguments, eye, adjust, !apps.is_empty(), msaa, design)?);
                subjects.push(Subject { plugins, samples: msaa.samples(), design });
            }
        }
    }
    if apps.is_empty() {
        return Err("--plugins: neither default nor minimal".into());
    }
    let measured = common::measure(&mut apps, &arguments)?;
    println!("{}, {}x{}", arguments.capture.display(), arguments.size.x, arguments.size.y);
    println!(
        "{:<8} {:>7} {:<10} {:>8} {:>9} {:>15} {:>9} {:>15}",
        "plugins", "samples", "capture", "FPS", "frame ms", "rounds ms", "more ms", "middle half"
    );
    let mut without = None;
    for (Subject { plugins, samples, design }, times) in subjects.into_iter().zip(&measured) {
        if design.is_none() {
            without = Some(times);
        }
        let (more, middle) = times.more_than(without.unwrap_or(times));
        let name = Design::NAMES.iter().find(|(_, known)| Some(*known) == design).map_or("none", |(name, _)| name);
        let time = times.median();
        println!(
            "{plugins:<8} {samples:>7} {name:<10} {:>8.0} {time:>9.3} {:>15} {more:>9.3} {middle:>15}",
            1e3 / time,
            times.spread()
        );
    }
    Ok(())
}

fn all(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
}

/// Disables plugins that a capture does not need.
fn few(plugins: PluginGroupBuilder) -> PluginGroupBuilder {
    plugins
        .disable::<PbrPlugin>()
        .disable::<LightPlugin>()
        .disable::<AnimationPlugin>()
        .disable::<InputPlugin>()
        .disable::<AccessibilityPlugin>()
        .disable::<StatesPlugin>()
        .disable::<PointerInputPlugin>()
        .disable::<PickingPlugin>()
        .disable::<InteractionPlugin>()
        .disable::<AntiAliasPlugin>()
        .disable::<PostProcessPlugin>()
}

/// Returns an app with a camera and, if a design is given, a playing capture drawn with that design. All assets are
/// loaded.
fn app(
    arguments: &Arguments,
    eye: Vec3,
    adjust: fn(PluginGroupBuilder) -> PluginGroupBuilder,
    logged: bool,
    msaa: Msaa,
    design: Option<Design>,
) -> Result<App> {
    let mut app = common::app(arguments.size, logged, adjust);
    let eye = Transform::from_translation(eye).looking_at(Vec3::ZERO, Vec3::Z);
    let lens = Projection::Perspective(PerspectiveProjection { fov: 0.53, ..default() });
    let camera = app.world_mut().spawn((Camera3d::default(), msaa, lens, eye)).id();
    if let Some(design) = design {
        app.add_plugins(GaussianCapturePlugins);
        let handle = app.world().resource::<AssetServer>().load(arguments.capture.clone());
        app.world_mut().spawn(GaussianCapture3d(handle));
        app.world_mut().entity_mut(camera).insert(CaptureViewSettings { design, ..default() });
    }
    common::start(&mut app)?;
    Ok(app)
}
