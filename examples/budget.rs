//! Copies of a capture in rows that recede, within a budget of GPU time: pictures become coarser where there is too
//! little time, the farthest copies first.
//!
//! ```text
//! cargo run --release --features viewer --example budget -- [CAPTURE] [--copies N] [--milliseconds T] \
//!     [--size WIDTHxHEIGHT] [--settle N] [--headless FOLDER] [--frames N]
//! ```
//!
//! * up and down: a quarter more time, a fifth less; B: budget on and off
//!
//! The title of the window has the budget, the time that captures take, and the Gaussians that are drawn. Defaults:
//! `toybox.gs4d` from `assets/`, 8 copies, 4 milliseconds of the GPU in a frame, 640x360. Needs a GPU with timestamps.
//!
//! With `--headless FOLDER`, or without a display, it draws `--settle` frames (300) without the budget, as many until
//! the picture has settled, and as many again, prints the median and the 99th percentile of their times, and writes N
//! (8) pictures, a 30th of a second apart, to FOLDER (`out`).

#[path = "common/arguments.rs"]
mod arguments;
#[path = "common/size.rs"]
mod size;

use arguments::{Arguments, asset_path, parse, save_pictures, value};
use bevy::asset::UnapprovedPathMode;
use bevy::prelude::*;
use bevy::window::PrimaryWindow;
use bevy_gs4d::prelude::*;
use bevy_gs4d::testing;
use size::parse_size;
use std::path::PathBuf;
use std::time::Duration;

/// The copies on the command line.
#[derive(Resource)]
struct Copies {
    capture: PathBuf,
    count: u32,
}

fn main() -> Result {
    let (mut count, mut milliseconds, mut size, mut settle) = (8, 4.0, UVec2::new(640, 360), 300);
    let defaults = Arguments { file: "toybox.gs4d".into(), headless: None, frames: 8 };
    let arguments = parse(defaults, |option, values| {
        match option {
            "--copies" => count = number(option, values)?,
            "--milliseconds" => milliseconds = number(option, values)?,
            "--settle" => settle = number(option, values)?,
            "--size" => {
                let text = value(option, "a size", values)?;
                size = parse_size(&text).ok_or_else(|| format!("--size {text}: not a size such as 640x360"))?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    })?;
    let gpu_time = Duration::try_from_secs_f64(milliseconds * 1e-3)
        .map_err(|_| format!("--milliseconds {milliseconds}: not a time"))?;
    let budget = CaptureBudget { gpu_time: Some(gpu_time), ..default() };
    let copies = Copies { capture: asset_path(&arguments.file), count };
    let Some(folder) = arguments.headless else {
        // A capture may be in any folder.
        let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
        let mut app = App::new();
        app.add_plugins(DefaultPlugins.set(files)).add_systems(Update, (keys, title));
        build(&mut app, copies, budget);
        app.run();
        return Ok(());
    };
    let mut app = testing::app(size);
    build(&mut app, copies, budget);
    testing::settle(&mut app)?;
    report(&mut app, gpu_time, settle)?;
    save_pictures(&mut app, arguments.frames, Duration::from_secs_f64(1.0 / 30.0), &folder)
}

fn number<T: std::str::FromStr>(option: &str, values: &mut dyn Iterator<Item = String>) -> Result<T> {
    let text = value(option, "a number", values)?;
    Ok(text.parse().map_err(|_| format!("{option} {text}: not a number"))?)
}

fn build(app: &mut App, copies: Copies, budget: CaptureBudget) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(copies)
        .insert_resource(budget)
        .add_systems(Startup, setup);
}

fn setup(mut commands: Commands, assets: Res<AssetServer>, copies: Res<Copies>) {
    let capture = assets.load(copies.capture.clone());
    for copy in 0..copies.count {
        // Rows of up to four, each farther away than the one before.
        let (column, row) = ((copy % 4) as f32 - 0.5 * (copies.count.min(4) - 1) as f32, (copy / 4) as f32);
        let place = Transform::from_xyz(1.6 * column, 0.0, -2.5 * row);
        commands.spawn((GaussianCapture3d(capture.clone()), Upright, place));
    }
    commands.spawn((
        Camera3d::default(),
        Msaa::Off,
        Transform::from_xyz(0.0, 1.6, 3.6).looking_at(Vec3::new(0.0, -0.2, -1.0), Vec3::Y),
    ));
}

fn keys(keys: Res<ButtonInput<KeyCode>>, mut budget: ResMut<CaptureBudget>, mut last: Local<Option<Duration>>) {
    if keys.just_pressed(KeyCode::KeyB) {
        let before = budget.gpu_time;
        budget.gpu_time = if before.is_some() { None } else { *last };
        *last = before.or(*last);
    }
    let factor = if keys.just_pressed(KeyCode::ArrowUp) {
        1.25
    } else if keys.just_pressed(KeyCode::ArrowDown) {
        0.8
    } else {
        return;
    };
    budget.gpu_time = budget.gpu_time.map(|time| time.mul_f32(factor));
}

fn title(
    budget: Res<CaptureBudget>,
    statistics: Res<CaptureStatistics>,
    mut window: Single<&mut Window, With<PrimaryWindow>>,
) {
    let wanted =
        budget.gpu_time.map_or("no budget".into(), |time| format!("budget {:.2} ms", time.as_secs_f64() * 1e3));
    let title = format!("{wanted}, {}", drawn(&statistics));
    if window.title != title {
        window.title = title;
    }
}

/// Returns the newest measured time of captures, in milliseconds.
fn time(statistics: &CaptureStatistics) -> f64 {
    f64::from(statistics.gpu_seconds()) * 1e3
}

/// Describes what is drawn.
fn drawn(statistics: &CaptureStatistics) -> String {
    let visible: u32 = statistics.views().iter().map(|(_, view)| view.visible).sum();
    format!("{:.2} ms, {visible} Gaussians, left out below {:.3} px", time(statistics), statistics.cut())
}

/// Draws frames without a budget, frames until the picture has settled, and as many again, whose times it prints.
fn report(app: &mut App, budget: Duration, frames: u32) -> Result {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    let mut draw = |gpu_time: Duration| -> Result<Vec<f64>> {
        app.world_mut().resource_mut::<CaptureBudget>().gpu_time = Some(gpu_time);
        let mut times = Vec::new();
        for _ in 0..frames {
            app.update();
            if app.should_exit().is_some() {
                return Err("the app ended: the log has the reason".into());
            }
            times.push(time(&statistics));
        }
        times.sort_by(f64::total_cmp);
        Ok(times)
    };
    let at = |times: &[f64], part: f64| times.get((part * times.len() as f64) as usize).copied().unwrap_or(0.0);
    let free = draw(Duration::MAX)?;
    if at(&free, 0.5) == 0.0 {
        println!("no times: this GPU has no timestamps");
    }
    println!("without a budget: median {:.2} ms; {}", at(&free, 0.5), drawn(&statistics));
    draw(budget)?;
    println!("settled: {}", drawn(&statistics));
    let times = draw(budget)?;
    let (median, most) = (at(&times, 0.5), at(&times, 0.99));
    let wanted = budget.as_secs_f64() * 1e3;
    println!("budget {wanted:.2} ms: median {median:.2} ms, 99th percentile {most:.2} ms, {frames} frames");
    Ok(())
}
