//! A sound beside a capture: the bundled toybox and a melody that follows it, whatever the player does.
//!
//! ```text
//! cargo run --release --features viewer,bevy_audio --example sound -- [CAPTURE] [--sound FILE] [--headless FOLDER]
//!     [--frames N] [--commands N]
//! ```
//!
//! * space: play and pause; left and right: seek by half a second; up and down: faster and slower; R: reverse; P: to
//!   and fro
//!
//! FILE is Ogg Vorbis or WAV; without it the melody is made by the example. Without the feature
//! `bevy_audio`, which on Linux needs the headers of ALSA (`apt-get install libasound2-dev`), nothing is heard.
//!
//! With `--headless FOLDER`, or without a display, it writes N (4) pictures, half a second apart, to FOLDER (`out`).
//! With `--commands N` it also plays N random commands to a simulated audio device, and tells how far the sound is
//! away from the picture: `heard.wav` is what is heard in the first half minute, `away.png` shows in red by how much
//! the sound is away (10 ms above and below the middle line), and in gray what is heard.

#[path = "sound/commands.rs"]
mod commands;
mod common;
#[path = "sound/melody.rs"]
mod melody;

use bevy::asset::UnapprovedPathMode;
use bevy::core_pipeline::tonemapping::Tonemapping;
use bevy::prelude::*;
use bevy_gs4d::codec::sound::Sound;
use bevy_gs4d::playback::{Clip, PlaybackSystems, Repeat, SoundClip, Timeline, TimelinePlayer, TimelineTrack, Track};
use bevy_gs4d::prelude::*;
use bevy_gs4d::sound::SoundTrack;
use bevy_gs4d::testing;
use common::{Orbit, arguments};
use std::path::PathBuf;
use std::time::Duration;

/// What is played.
#[derive(Resource)]
struct Show {
    capture: PathBuf,
    sound: Option<PathBuf>,
}

fn main() -> Result {
    let defaults = arguments::Arguments { file: "toybox.gs4d".into(), headless: None, frames: 4 };
    let (mut sound, mut commands) = (None, None);
    let arguments = arguments::parse(defaults, |option, rest| {
        match option {
            "--sound" => sound = Some(common::asset_path(&arguments::value(option, "a file", rest)?)),
            "--commands" => {
                let count = arguments::value(option, "a number", rest)?;
                commands = Some(count.parse().map_err(|_| format!("--commands {count}: not a number of commands"))?);
            }
            _ => return Ok(false),
        }
        Ok(true)
    })?;
    let show = Show { capture: common::asset_path(&arguments.file), sound };
    if let Some(folder) = arguments.headless {
        let mut app = testing::app(UVec2::new(960, 540));
        scene(&mut app, show);
        common::save_pictures(&mut app, arguments.frames, Duration::from_millis(500), &folder)?;
        return commands.map_or(Ok(()), |count| commands::hear(count, &folder));
    }
    let mut app = App::new();
    // A capture and a sound may be in any folder.
    let files = AssetPlugin { unapproved_path_mode: UnapprovedPathMode::Allow, ..default() };
    app.add_plugins(DefaultPlugins.set(files));
    scene(&mut app, show);
    app.add_systems(Update, keys.before(PlaybackSystems::Timelines)).run();
    Ok(())
}

/// Adds the scene, with or without a window.
fn scene(app: &mut App, show: Show) {
    app.add_plugins(GaussianCapturePlugins)
        .insert_resource(show)
        .insert_resource(ClearColor(Color::srgb(0.06, 0.06, 0.08)))
        .add_systems(Startup, setup)
        .add_systems(Update, arrange);
}

fn setup(
    mut commands: Commands,
    assets: Res<AssetServer>,
    show: Res<Show>,
    mut sounds: ResMut<Assets<SoundTrack>>,
    mut timelines: ResMut<Assets<Timeline>>,
) -> Result {
    let sound = match &show.sound {
        Some(file) => assets.load(file.clone()),
        None => sounds.add(SoundTrack(Sound::new(melody::RATE, 2, melody::samples(4.0))?)),
    };
    let capture = assets.load(show.capture.clone());
    let clip = Clip { capture, start: 0.0, range: [0.0, 4.0], speed: 1.0, fade: [0.0; 2] };
    let tracks = vec![Track { name: "stage".into(), clips: vec![clip] }];
    let timeline = Timeline::new(tracks, Vec::new(), None)?;
    let timeline = timelines.add(timeline.with_sounds(vec![SoundClip { sound, start: 0.0, volume: 0.7 }])?);
    commands.spawn((TimelinePlayer(timeline), children![TimelineTrack("stage".into())]));
    commands.spawn((Camera3d::default(), Msaa::Off, Tonemapping::None));
    Ok(())
}

/// Stands the capture upright, and points the camera at it, once it is loaded.
fn arrange(
    captures: Res<Assets<GaussianCapture>>,
    mut stage: Single<(&GaussianCapture3d, &mut Transform), With<TimelineTrack>>,
    camera: Single<(&mut Transform, &mut Projection), (With<Camera3d>, Without<TimelineTrack>)>,
    mut is_arranged: Local<bool>,
) {
    let Some(loaded) = captures.get(&stage.0.0).filter(|_| !*is_arranged) else { return };
    *is_arranged = true;
    stage.1.rotation = loaded.upright();
    let (mut transform, mut projection) = camera.into_inner();
    Orbit::around(loaded).place(&mut transform, &mut projection);
}

fn keys(keys: Res<ButtonInput<KeyCode>>, mut playback: Single<&mut Playback, With<TimelinePlayer>>) {
    let playback = &mut **playback;
    let pressed = |key: KeyCode| keys.just_pressed(key);
    if pressed(KeyCode::Space) {
        playback.toggle();
    }
    if pressed(KeyCode::KeyR) {
        playback.reverse();
    }
    let half_seconds = i8::from(pressed(KeyCode::ArrowRight)) - i8::from(pressed(KeyCode::ArrowLeft));
    if half_seconds != 0 {
        playback.seek(playback.time + 0.5 * f32::from(half_seconds));
    }
    if pressed(KeyCode::ArrowUp) {
        playback.speed *= 1.25;
    }
    if pressed(KeyCode::ArrowDown) {
        playback.speed *= 0.8;
    }
    if pressed(KeyCode::KeyP) {
        playback.repeat = if playback.repeat == Repeat::Loop { Repeat::PingPong } else { Repeat::Loop };
    }
}
