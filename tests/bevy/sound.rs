//! Sounds beside timelines and captures, as a device hears them.
//!
//! In: apps without a renderer, whose players get random commands; samples that are asked for as an audio device asks.
//! Out: proof that what is heard is within 10 ms of the picture, without clicks, and that sounds are loaded, decoded,
//! reloaded and missed as told. Needs neither a GPU, a window nor an audio device.

use crate::support::playback_app::{app, change, get, pass, scene};
use crate::support::random::Random;
use crate::support::waiting::wait_until;
use crate::support::wave::wave;
use bevy::prelude::*;
use bevy_gs4d::codec::sound::Sound;
use bevy_gs4d::playback::{Repeat, SoundClip, Timeline, TimelinePlayer};
use bevy_gs4d::prelude::*;
use bevy_gs4d::scene::{GaussianScene, SoundFile};
use bevy_gs4d::sound::{SoundFollower, SoundState, SoundTrack, TimelineSound};
use std::fs;
use std::sync::Arc;

/// Seconds of the timeline and of its sound.
const SECONDS: f64 = 20.0;
const RATE: u32 = 48_000;
/// Frames for which a device asks at once: 10 ms.
const BLOCK: usize = 480;

/// Returns a sound whose left samples rise from -1 to 1 and whose right samples are 0.5.
fn ruler() -> Sound {
    let frames = SECONDS as i32 * 1000;
    let samples = (0..frames).flat_map(|frame| [(frame * 65_535 / frames - 32_768) as i16, 16_384]);
    Sound::new(1000, 2, samples.collect::<Vec<_>>()).expect("a good sound")
}

/// Returns the position that is heard in the ruler.
fn position(frame: [f32; 2]) -> f64 {
    (f64::from(frame[0]) + 1.0) / 2.0 * SECONDS
}

/// Spawns the player of a timeline with these sounds.
fn spawn(app: &mut App, sounds: Vec<SoundClip>, playback: Playback) -> Entity {
    let timeline = Timeline::new(Vec::new(), Vec::new(), Some(SECONDS as f32)).expect("a valid timeline");
    let timeline = timeline.with_sounds(sounds).expect("valid sounds");
    let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    app.world_mut().spawn((TimelinePlayer(timeline), playback)).id()
}

fn track(app: &mut App, sound: Sound) -> Handle<SoundTrack> {
    app.world_mut().resource_mut::<Assets<SoundTrack>>().add(SoundTrack(sound))
}

/// Returns the entities of the sounds of timelines, by their numbers.
fn sounds(app: &mut App) -> Vec<Entity> {
    let mut found: Vec<(usize, Entity)> = app
        .world_mut()
        .query::<(&TimelineSound, Entity)>()
        .iter(app.world())
        .map(|(sound, entity)| (sound.0, entity))
        .collect();
    found.sort_unstable();
    found.into_iter().map(|(_, entity)| entity).collect()
}

/// A device that asks for samples.
struct Device {
    follower: SoundFollower,
    /// The time of the next frame.
    now: f64,
    last: [f32; 2],
    largest_step: f32,
}

impl Device {
    /// Hears until `end`, and calls `heard` with the time and the samples of each frame.
    fn hear(&mut self, state: &SoundState, updated: f64, end: f64, mut heard: impl FnMut(f64, [f32; 2])) {
        let cue = state.cue(updated);
        while self.now < end {
            let mut block = [[0.0; 2]; BLOCK];
            self.follower.fill(&cue, self.now, &mut block);
            for (index, frame) in block.into_iter().enumerate() {
                let steps = [0, 1].map(|side| (frame[side] - self.last[side]).abs());
                self.largest_step = self.largest_step.max(steps[0]).max(steps[1]);
                self.last = frame;
                heard(self.now + index as f64 / f64::from(RATE), frame);
            }
            self.now += BLOCK as f64 / f64::from(RATE);
        }
    }
}

/// Gives a playback a random command. Returns its name.
fn command(playback: &mut Playback, random: &mut Random) -> &'static str {
    match random.below(6) {
        0 | 1 => {
            playback.seek(random.below(2000) as f32 / 100.0);
            "seek"
        }
        2 => {
            playback.toggle();
            "toggle"
        }
        3 => {
            playback.speed = [0.5, 1.0, 1.0, 1.5, 2.0, 4.0][random.below(6)] * playback.speed.signum();
            "speed"
        }
        4 => {
            playback.reverse();
            "reverse"
        }
        _ => {
            playback.playing = true;
            playback.repeat = [Repeat::Loop, Repeat::PingPong][random.below(2)];
            "repeat"
        }
    }
}

#[test]
fn a_sound_is_within_10_ms_of_the_picture_20_ms_after_each_of_1000_random_commands() {
    let mut app = app("assets");
    let sound = track(&mut app, ruler());
    let player = spawn(&mut app, vec![SoundClip { sound, start: 0.0, volume: 1.0 }], Playback::default());
    pass(&mut app, 0.0);
    pass(&mut app, 0.0);
    let [entity] = sounds(&mut app)[..] else { panic!("one sound") };
    let mut random = Random::new(11);
    let mut device = Device { follower: SoundFollower::new(RATE), now: 0.003, last: [0.0; 2], largest_step: 0.0 };
    let (mut now, mut settled, mut commands) = (0.0f64, 0.0f64, 0);
    let (mut compared, mut largest, mut last_command) = (0, 0.0f64, "none");
    while commands < 1000 {
        // Frames of 60 a second, which come early or late, and now and then one of a tenth of a second.
        let frame = if random.below(200) == 0 { 0.1 } else { 0.0137 + random.below(6000) as f64 * 1e-6 };
        // What was shown is heard until the next frame.
        let (state, shown) = (get::<SoundState>(&app, entity), get::<Playback>(&app, player));
        let (updated, end) = (now, now + frame);
        let moves = if shown.playing { f64::from(shown.speed) * if shown.returning { -1.0 } else { 1.0 } } else { 0.0 };
        device.hear(&state, updated, end, |time, heard| {
            let picture = f64::from(shown.time) + moves * (time - updated);
            // The ends, where the picture turns or begins again in the next frame, are compared again behind them.
            let is_inside = picture > 0.3 && picture < SECONDS - 0.3;
            if time < settled || time < updated || !is_inside {
                return;
            }
            if moves == 0.0 {
                assert_eq!(heard, [0.0; 2], "silence at rest, at {time} s after {last_command}");
                return;
            }
            assert!(heard[1] > 0.49, "the sound is heard at {time} s after {last_command}: {}", heard[1]);
            largest = largest.max((position(heard) - picture).abs() / moves.abs().max(1.0));
            compared += 1;
        });
        now = end;
        if random.below(12) == 0 {
            let mut name = "";
            change(&mut app, player, |playback: &mut Playback| name = command(playback, &mut random));
            (last_command, commands, settled) = (name, commands + 1, now + 0.02);
        }
        pass(&mut app, frame);
    }
    assert!(compared > 1_000_000, "{compared} samples are compared");
    assert!(largest < 0.0105, "the sound is {:.1} ms away", 1e3 * largest);
    let step = device.largest_step;
    assert!(step < SoundFollower::LARGEST_STEP + 0.001, "the largest step is {step}");
    println!("{compared} samples: {:.1} ms away at most, steps of {step:.4} at most", 1e3 * largest);
}

#[test]
fn each_sound_of_a_timeline_has_an_entity_with_its_own_time() {
    let mut app = app("assets");
    let (ruler, other) = (track(&mut app, ruler()), app.world().resource::<Assets<SoundTrack>>().reserve_handle());
    let clips = [(&ruler, 1.0, 0.5), (&other, 3.0, 1.0)];
    let clips = clips.map(|(sound, start, volume)| SoundClip { sound: sound.clone(), start, volume });
    let player = spawn(&mut app, clips.to_vec(), Playback::default());
    for _ in 0..3 {
        pass(&mut app, 0.5);
    }
    let [first, second] = sounds(&mut app)[..] else { panic!("two sounds") };
    let (first, second) = (get::<SoundState>(&app, first), get::<SoundState>(&app, second));
    let time = f64::from(get::<Playback>(&app, player).time);
    assert_eq!((first.seconds(), first.speed(), first.volume()), (time - 1.0, 1.0, 0.5), "the first begins at 1 s");
    assert_eq!((second.seconds(), second.sound()), (time - 3.0, None), "the second is not loaded");
    assert!(first.sound().is_some(), "the first is");
    // A reload with fewer sounds.
    let id = app.world().get::<TimelinePlayer>(player).expect("the player").0.id();
    let mut timelines = app.world_mut().resource_mut::<Assets<Timeline>>();
    let shorter = timelines.get(id).expect("the timeline").clone().with_sounds(clips[..1].to_vec());
    timelines.insert(id, shorter.expect("valid sounds")).expect("the place of the timeline");
    pass(&mut app, 0.5);
    pass(&mut app, 0.5);
    assert_eq!(sounds(&mut app).len(), 1, "the entity of the sound that is gone is despawned");
    app.world_mut().despawn(player);
    pass(&mut app, 0.5);
    assert!(sounds(&mut app).is_empty(), "sounds go with their player");
}

#[test]
fn a_timeline_waits_for_its_sounds_and_plays_without_those_that_fail() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let text = r#"(duration: 4.0, sounds: [(file: "song.wav", start: 0.25, volume: 0.5), (file: "none.ogg")])"#;
    let file = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).expect("a file can be written");
    file("show.timeline.ron", text.as_bytes());
    file("song.wav", &wave(1, 8000, &[8192; 8000]));
    let mut app = app(folder.path().to_str().expect("a path of text"));
    let timeline = app.world().resource::<AssetServer>().load("show.timeline.ron");
    let player = app.world_mut().spawn(TimelinePlayer(timeline)).id();
    let begins = |app: &App| get::<Playback>(app, player).time > 0.0;
    wait_until(&mut app, "time begins", begins, |app| pass(app, 0.01));
    let [song, none] = sounds(&mut app)[..] else { panic!("two sounds") };
    let (song, none) = (get::<SoundState>(&app, song), get::<SoundState>(&app, none));
    assert_eq!(song.sound().map(Sound::seconds), Some(1.0), "the song was loaded before time began");
    assert_eq!(none.sound(), None, "a file that does not exist is not heard");
}

#[test]
fn the_sound_of_a_package_is_played_at_the_time_of_its_capture() {
    let mut app = app("assets");
    let song = wave(1, 8000, &[8192; 16_000]);
    let captures = [Some(song.as_slice()), Some(b"damaged"), None].map(|bytes| {
        let sound = bytes.map(|bytes| Arc::new(SoundFile::new(bytes).expect("a file has bytes")));
        let scene = GaussianScene { sound, ..scene(2.0, 4) }.into_runtime().expect("a synthetic scene can be drawn");
        app.world_mut().resource_mut::<Assets<GaussianCapture>>().add(GaussianCapture::new(scene))
    });
    let players = captures.map(|capture| {
        let bundle = (GaussianCapture3d(capture), CaptureSound { volume: 0.25, ..default() }, Playback::paused_at(0.5));
        app.world_mut().spawn(bundle).id()
    });
    let is_decoded = |app: &App| get::<SoundState>(app, players[0]).sound().is_some();
    wait_until(&mut app, "the sound is decoded", is_decoded, |app| pass(app, 0.01));
    change(&mut app, players[0], Playback::play);
    pass(&mut app, 0.25);
    pass(&mut app, 0.25);
    let state = get::<SoundState>(&app, players[0]);
    let time = f64::from(get::<Playback>(&app, players[0]).time);
    assert_eq!((state.seconds(), state.speed(), state.volume()), (time, 1.0, 0.25), "the time of the capture");
    assert_eq!(state.sound().map(Sound::seconds), Some(2.0), "the sound of the package");
    for silent in &players[1..] {
        assert_eq!(get::<SoundState>(&app, *silent).sound(), None, "a damaged sound and none are silent");
    }
    let track = track(&mut app, ruler());
    change(&mut app, players[2], |sound: &mut CaptureSound| sound.track = Some(track));
    pass(&mut app, 0.25);
    let given = get::<SoundState>(&app, players[2]);
    assert_eq!(given.sound().map(Sound::seconds), Some(SECONDS), "a track in place of that of the package");
    app.world_mut().entity_mut(players[2]).remove::<CaptureSound>();
    app.world_mut().entity_mut(players[0]).remove::<GaussianCapture3d>();
    pass(&mut app, 0.25);
    assert_eq!(get::<SoundState>(&app, players[0]).speed(), 0.0, "without its capture it is silent");
    let removed = get::<SoundState>(&app, players[2]);
    assert_eq!((removed.sound(), removed.speed()), (None, 0.0), "without its component it is silent");
}
