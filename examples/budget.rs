//! Copies of a capture in rows that recede, within a budget of GPU time: pictures become coarser where there is too
//! little time, the farthest copies first.
//!
//! ```text
//! cargo run --release --features viewer --example budget -- [CAPTURE] [--copies N] [--cameras N | --stereo] \
//!     [--milliseconds T | --share S] [--least L] [--size WIDTHxHEIGHT] [--settle N] [--play] [--headless FOLDER] \
//!     [--frames N]
//! ```
//!
//! * up and down: a quarter more time, a fifth less; B: budget on and off
//!
//! The title of the window has the budget, the time that captures take, and the Gaussians that are drawn. Defaults:
//! `toybox.gs4d` from `assets/`, 8 copies, 4 milliseconds of the GPU in a frame, 640x360, one camera. `--cameras N`: 1
//! to 4 cameras side by side, each in its own column of the picture; `--stereo`: two eyes. `--least L`: the share of
//! the Gaussians, from 0 to 1, that is drawn in any case. Needs a GPU with timestamps.
//!
//! With `--headless FOLDER`, or without a display, it draws `--settle` frames (300) without the budget, as many until
//! the picture has settled, and as many again, and prints the median and the 99th percentile of their times. With
//! `--share S`, from 0 to 1, the budget is that part of the median without a budget. Captures stand still; with
//! `--play` they play, a 60th of a second in a frame. Then it draws the first moment 24 times, prints how much that
//! still view changes from a frame to the next, and the times of the passes of a frame, and writes N (8) pictures, a
//! 30th of a second apart, to FOLDER (`out`). The last line, `result:`, has the numbers for scripts.

#[path = "common/arguments.rs"]
mod arguments;
#[path = "common/size.rs"]
mod size;

use arguments::{Arguments, asset_path, parse, save_pictures, value};
use bevy::asset::UnapprovedPathMode;
use bevy::camera::{RenderTarget, Viewport};
use bevy::prelude::*;
use bevy::render::render_resource::PollType;
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::time::TimeUpdateStrategy;
use bevy::window::PrimaryWindow;
use bevy_gs4d::prelude::*;
use bevy_gs4d::stereo::{EyeTargets, StereoRig, spawn_stereo};
use bevy_gs4d::testing::{self, Offscreen, RgbaImage};
use size::parse_size;
use std::path::PathBuf;
use std::time::Duration;

/// The budget, unless the command line has another.
const GPU_TIME: Duration = Duration::from_millis(4);
/// Time from a frame to the next while captures play.
const STEP: Duration = Duration::from_nanos(1_000_000_000 / 60);
/// Distance from a camera to the next.
const ASIDE: f32 = 0.3;
/// Frames of a still view that are compared.
const STILL: u32 = 24;
/// Frames in which passes are timed.
const TIMED: u32 = 20;
/// Frames before these: buffers grow by the counts of an earlier frame.
const UNCOMPARED: u32 = 4;

/// The options of this example.
struct Options {
    copies: u32,
    gpu_time: Option<Duration>,
    /// The budget as a part of the median time without a budget.
    share: Option<f64>,
    /// The smallest share of the Gaussians that is drawn.
    least: Option<f32>,
    cameras: Option<u32>,
    stereo: bool,
    play: bool,
    size: UVec2,
    settle: u32,
}

impl Options {
    /// Reads an option, and returns whether it is one of this example.
    fn read(&mut self, option: &str, values: &mut dyn Iterator<Item = String>) -> Result<bool> {
        match option {
            "--copies" => self.copies = number(option, values)?,
            "--milliseconds" => {
                let milliseconds: f64 = number(option, values)?;
                let time = Duration::try_from_secs_f64(milliseconds * 1e-3);
                self.gpu_time = Some(time.map_err(|_| format!("--milliseconds {milliseconds}: not a time"))?);
            }
            "--share" => {
                let share: f64 = number(option, values)?;
                if !(0.0..=1.0).contains(&share) {
                    return Err(format!("--share {share}: not a number from 0 to 1").into());
                }
                self.share = Some(share);
            }
            "--least" => {
                let least: f32 = number(option, values)?;
                if !(0.0..=1.0).contains(&least) {
                    return Err(format!("--least {least}: not a number from 0 to 1").into());
                }
                self.least = Some(least);
            }
            "--cameras" => {
                let cameras: u32 = number(option, values)?;
                if !(1..=4).contains(&cameras) {
                    return Err(format!("--cameras {cameras}: not a number from 1 to 4").into());
                }
                self.cameras = Some(cameras);
            }
            "--stereo" => self.stereo = true,
            "--play" => self.play = true,
            "--settle" => self.settle = number(option, values)?,
            "--size" => {
                let text = value(option, "a size", values)?;
                self.size = parse_size(&text).ok_or_else(|| format!("--size {text}: not a size such as 640x360"))?;
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// Returns an error for options that exclude each other.
    fn check(&self, has_window: bool) -> Result {
        if self.share.is_some() && self.gpu_time.is_some() {
            return Err("--share is a budget, and so is --milliseconds: leave out --milliseconds".into());
        }
        if self.share.is_some() && has_window {
            return Err("in a window nothing is measured first: leave out --share, or add --headless FOLDER".into());
        }
        if self.stereo && self.cameras.is_some() {
            return Err("--stereo has a camera for each eye: leave out --cameras".into());
        }
        Ok(())
    }

    fn views(&self) -> Views {
        if self.stereo { Views::Eyes } else { Views::Columns(self.cameras.unwrap_or(1)) }
    }

    /// Returns the budget of a time, with the least share of the command line.
    fn budget_of(&self, gpu_time: Duration) -> CaptureBudget {
        let unlimited = CaptureBudget::default();
        let least_share = self.least.unwrap_or(unlimited.least_share);
        CaptureBudget { gpu_time: Some(gpu_time), least_share, ..unlimited }
    }

    /// Returns the time of the budget. `free` is the median time without a budget, in milliseconds.
    fn time(&self, free: f64) -> Result<Duration> {
        match self.share {
            Some(_) if free == 0.0 => Err("there is no share of an unknown time: leave out --share".into()),
            Some(share) => Ok(Duration::try_from_secs_f64(share * free * 1e-3)?),
            None => Ok(self.gpu_time.unwrap_or(GPU_TIME)),
        }
    }
}

/// The copies on the command line.
#[derive(Resource)]
struct Copies {
    capture: PathBuf,
    count: u32,
}

/// The cameras on the command line.
#[derive(Resource, Clone, Copy)]
enum Views {
    /// So many cameras, from left to right.
    Columns(u32),
    Eyes,
}

impl Views {
    fn count(self) -> u32 {
        match self {
            Self::Columns(count) => count,
            Self::Eyes => 2,
        }
    }
}

/// The column that a camera draws into, counted from the left.
#[derive(Component)]
struct Column(u32);

fn main() -> Result {
    let mut options = Options {
        copies: 8,
        gpu_time: None,
        share: None,
        least: None,
        cameras: None,
        stereo: false,
        play: false,
        size: UVec2::new(640, 360),
        settle: 300,
    };
    let defaults = Arguments { file: "toybox.gs4d".into(), headless: None, frames: 8 };
    let arguments = parse(defaults, |option, values| options.read(option, values))?;
    options.check(arguments.headless.is_none())?;
    let copies = Copies { capture: asset_path(&arguments.file), count: options.copies };
    let Some(folder) = arguments.headless else {
        // A capture may be in any folder.
        let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
        let mut app = App::new();
        app.add_plugins(DefaultPlugins.set(files)).add_systems(Update, (keys, title));
        build(&mut app, copies, options.views(), options.budget_of(options.gpu_time.unwrap_or(GPU_TIME)));
        app.run();
        return Ok(());
    };
    let mut app = testing::app(options.size);
    // Times are measured, and nothing is left out.
    build(&mut app, copies, options.views(), options.budget_of(Duration::MAX));
    testing::settle(&mut app)?;
    let result = report(&mut app, &options)?;
    save_pictures(&mut app, arguments.frames, Duration::from_secs_f64(1.0 / 30.0), &folder)?;
    println!("result: {result}");
    Ok(())
}

fn number<T: std::str::FromStr>(option: &str, values: &mut dyn Iterator<Item = String>) -> Result<T> {
    let text = value(option, "a number", values)?;
    Ok(text.parse().map_err(|_| format!("{option} {text}: not a number"))?)
}

fn build(app: &mut App, copies: Copies, views: Views, budget: CaptureBudget) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(ClearColor(Color::BLACK))
        .insert_resource(copies)
        .insert_resource(views)
        .insert_resource(budget)
        .add_systems(Startup, (spawn_copies, spawn_cameras));
    // A single camera needs no viewport.
    if let Views::Columns(2..) = views {
        app.add_systems(Update, fit_columns);
    }
}

fn spawn_copies(mut commands: Commands, assets: Res<AssetServer>, copies: Res<Copies>) {
    let capture = assets.load(copies.capture.clone());
    for copy in 0..copies.count {
        // Rows of up to four, each farther away than the one before.
        let (column, row) = ((copy % 4) as f32 - 0.5 * (copies.count.min(4) - 1) as f32, (copy / 4) as f32);
        let place = Transform::from_xyz(1.6 * column, 0.0, -2.5 * row);
        commands.spawn((GaussianCapture3d(capture.clone()), Upright, place));
    }
}

fn spawn_cameras(mut commands: Commands, views: Res<Views>) {
    let place = |aside: f32| Transform::from_xyz(aside, 1.6, 3.6).looking_at(Vec3::new(0.0, -0.2, -1.0), Vec3::Y);
    match *views {
        Views::Columns(count) => {
            for column in 0..count {
                // The first camera clears the whole picture.
                let clear_color = if column == 0 { ClearColorConfig::Default } else { ClearColorConfig::None };
                let camera = Camera { order: column as isize, clear_color, ..default() };
                let place = place(ASIDE * (column as f32 - 0.5 * (count - 1) as f32));
                commands.spawn((Camera3d::default(), camera, Column(column), Msaa::Off, place));
            }
        }
        Views::Eyes => {
            let targets = EyeTargets::SideBySide(RenderTarget::default());
            let stereo = spawn_stereo(&mut commands, StereoRig::default(), targets);
            commands.entity(stereo.head).insert(place(0.0));
            for eye in stereo.eyes {
                commands.entity(eye).insert(Msaa::Off);
            }
        }
    }
}

/// Gives each camera its column of the window.
fn fit_columns(
    window: Single<&Window, With<PrimaryWindow>>,
    views: Res<Views>,
    mut cameras: Query<(&Column, &mut Camera)>,
) {
    let size = window.physical_size();
    for (&Column(column), mut camera) in &mut cameras {
        let [left, right] = [column, column + 1].map(|edge| size.x * edge / views.count());
        let (corner, size) = (UVec2::new(left, 0), UVec2::new(right - left, size.y));
        let fits = |viewport: &Viewport| viewport.physical_position == corner && viewport.physical_size == size;
        if size.min_element() > 0 && !camera.viewport.as_ref().is_some_and(fits) {
            camera.viewport = Some(Viewport { physical_position: corner, physical_size: size, ..default() });
        }
    }
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
    let (time, visible) = (time(statistics), visible(statistics));
    format!("{time:.2} ms, {visible} Gaussians, left out below {:.3} px", statistics.cut())
}

/// Describes the times of the passes, summed over all cameras: of one of the frames that are drawn with timestamps
/// between passes, which take time, too.
fn passes(app: &mut App, step: Duration) -> Result<String> {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    statistics.measure(true);
    draw(app, TIMED, step)?;
    statistics.measure(false);
    let mut times: Vec<(&str, f64)> = Vec::new();
    for pass in statistics.views().iter().flat_map(|(_, view)| &view.passes) {
        match times.iter_mut().find(|(name, _)| *name == pass.name) {
            Some((_, time)) => *time += pass.milliseconds,
            None => times.push((pass.name, pass.milliseconds)),
        }
    }
    let times: Vec<String> = times.iter().map(|(name, time)| format!("{name} {time:.3}")).collect();
    Ok(format!("passes, timed one by one: {} ms", times.join(", ")))
}

/// Returns the number of Gaussians that are drawn, summed over all cameras.
fn visible(statistics: &CaptureStatistics) -> u32 {
    statistics.views().iter().map(|(_, view)| view.visible).sum()
}

/// Draws frames without a budget, frames until the picture has settled, as many again, and a still view. Prints times
/// and changes, and returns them in one line.
fn report(app: &mut App, options: &Options) -> Result<String> {
    let statistics = app.world().resource::<CaptureStatistics>().clone();
    let (frames, step) = (options.settle, if options.play { STEP } else { Duration::ZERO });
    let free = quantile(&draw(app, frames, step)?, 0.5);
    if free == 0.0 {
        println!("no times: this GPU has no timestamps");
    }
    println!("without a budget: median {free:.2} ms; {}; {}", drawn(&statistics), passes(app, step)?);
    let all = visible(&statistics);
    let budget = options.time(free)?;
    let whole = still_pictures(app, 1)?.remove(0);
    app.world_mut().resource_mut::<CaptureBudget>().gpu_time = Some(budget);
    draw(app, frames, step)?;
    println!("settled: {}", drawn(&statistics));
    let share = f64::from(visible(&statistics)) / f64::from(all.max(1));
    let times = draw(app, frames, step)?;
    let (median, most, wanted) = (quantile(&times, 0.5), quantile(&times, 0.99), budget.as_secs_f64() * 1e3);
    println!("budget {wanted:.2} ms: median {median:.2} ms, 99th percentile {most:.2} ms, {frames} frames");
    let [least, change] = changes(&still_pictures(app, STILL)?, &whole);
    let least = if least.is_finite() { format!("{least:.1} dB") } else { "identical".into() };
    println!("least PSNR between two frames of a still view: {least}");
    println!("a still view changes by at most {change:.2} dB between two frames");
    println!("{}", passes(app, step)?);
    Ok(format!(
        "copies={} cameras={} stereo={} free_ms={free:.3} target_ms={wanted:.3} median_ms={median:.3} \
         p99_ms={most:.3} settled_share={share:.3} change_db={change:.3}",
        options.copies,
        options.views().count(),
        options.stereo
    ))
}

/// Draws frames `step` apart, and returns the times of captures in milliseconds, in ascending order.
fn draw(app: &mut App, frames: u32, step: Duration) -> Result<Vec<f64>> {
    let world = app.world();
    let (device, queue) = (world.resource::<RenderDevice>().clone(), world.resource::<RenderQueue>().clone());
    let statistics = world.resource::<CaptureStatistics>().clone();
    app.insert_resource(TimeUpdateStrategy::ManualDuration(step));
    let (mut times, mut newest) = (Vec::new(), None);
    for _ in 0..frames {
        update(app)?;
        times.push(time(&statistics));
        // As with a display, frames do not queue up, which would make the known times old.
        if let Some(before) = newest.replace(queue.submit([])) {
            device.poll(PollType::Wait { submission_index: Some(before), timeout: None })?;
        }
    }
    app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::ZERO));
    times.sort_by(f64::total_cmp);
    Ok(times)
}

fn update(app: &mut App) -> Result {
    app.update();
    match app.should_exit() {
        Some(_) => Err("the app ended: the log has the reason".into()),
        None => Ok(()),
    }
}

/// Returns the value at a part of sorted values; 0 if there are none.
fn quantile(sorted: &[f64], part: f64) -> f64 {
    sorted.get((part * sorted.len() as f64) as usize).copied().unwrap_or(0.0)
}

/// Pauses all copies at their first moment, returns the pictures of frames in turn, and plays from that moment again.
fn still_pictures(app: &mut App, count: u32) -> Result<Vec<RgbaImage>> {
    set_playback(app, Playback::paused_at(0.0));
    draw(app, UNCOMPARED, Duration::ZERO)?;
    let offscreen = app.world().resource::<Offscreen>().clone();
    let mut pictures = Vec::new();
    for _ in 0..count {
        update(app)?;
        pictures.push(testing::read(app, &offscreen)?);
    }
    set_playback(app, Playback::default());
    Ok(pictures)
}

fn set_playback(app: &mut App, playback: Playback) {
    let world = app.world_mut();
    for mut copy in world.query::<&mut Playback>().iter_mut(world) {
        *copy = playback;
    }
}

/// Returns how much pictures in turn differ, in dB: the least PSNR of one to the next, infinite if all are equal, and
/// the greatest change of the PSNR to `whole`, the picture of all Gaussians.
fn changes(pictures: &[RgbaImage], whole: &RgbaImage) -> [f64; 2] {
    let losses: Vec<f64> = pictures.iter().map(|picture| psnr(picture, whole)).collect();
    let least = pictures.windows(2).map(|pair| psnr(&pair[0], &pair[1])).fold(f64::INFINITY, f64::min);
    // The PSNR of equal pictures is infinite.
    let change = |pair: &[f64]| if pair[0] == pair[1] { 0.0 } else { (pair[0] - pair[1]).abs() };
    [least, losses.windows(2).map(change).fold(0.0, f64::max)]
}

/// Returns the PSNR of two pictures in dB.
fn psnr(a: &RgbaImage, b: &RgbaImage) -> f64 {
    let squares = a
        .pixels()
        .zip(b.pixels())
        .flat_map(|(a, b)| [0, 1, 2].map(|channel| (f64::from(a.0[channel]) - f64::from(b.0[channel])).powi(2)));
    let mean = squares.sum::<f64>() / (3.0 * f64::from(a.width()) * f64::from(a.height()));
    -10.0 * (mean / 255.0f64.powi(2)).log10()
}
