//! Random commands to a player, and what a simulated audio device hears.
//!
//! In: the number of commands; a fixed seed. Out: a sound file, a picture of how far the sound is from the picture, and
//! the numbers on standard output. Needs neither a window nor an audio device.

use crate::melody;
use bevy::prelude::*;
use bevy::time::TimeUpdateStrategy;
use bevy_gs4d::codec::sound::Sound;
use bevy_gs4d::playback::{SoundClip, Timeline, TimelinePlayer};
use bevy_gs4d::prelude::*;
use bevy_gs4d::sound::{SoundFollower, SoundState, SoundTrack};
use bevy_gs4d::view::Picture;
use std::fs;
use std::path::Path;
use std::time::Duration;

/// Seconds of the melody, which loops.
const SECONDS: f64 = 12.0;
const RATE: u32 = 48_000;
/// Frames for which the device asks at once: 10 ms.
const BLOCK: usize = 480;
/// Seconds that are written and drawn.
const DRAWN: f64 = 30.0;

/// A measured frame of sound.
struct Measured {
    time: f64,
    /// The sound less the picture, in seconds of the wall clock; `None` within 20 ms of a command, and at rest.
    away: Option<f64>,
    /// What is heard of the melody.
    heard: f32,
}

/// Plays so many commands, and writes the results to a folder.
pub fn hear(count: usize, folder: &Path) -> Result {
    let (measured, largest_step) = play(count)?;
    let away: Vec<f64> = measured.iter().filter_map(|frame| frame.away.map(f64::abs)).collect();
    let largest = away.iter().copied().fold(0.0, f64::max);
    let mean = away.iter().sum::<f64>() / away.len().max(1) as f64;
    println!("{count} commands in {:.0} s", measured.last().map_or(0.0, |frame| frame.time));
    println!("away from the picture: {:.2} ms in the mean, {:.2} ms at most", 1e3 * mean, 1e3 * largest);
    println!(
        "largest step between samples: {largest_step:.4}, of which the follower may add {:.4}",
        SoundFollower::LARGEST_STEP
    );
    fs::create_dir_all(folder)?;
    let drawn = measured.iter().take_while(|frame| frame.time < DRAWN);
    let samples: Vec<u8> = drawn.clone().flat_map(|frame| ((32_767.0 * frame.heard) as i16).to_le_bytes()).collect();
    fs::write(folder.join("heard.wav"), wave(&samples))?;
    picture(&drawn.collect::<Vec<_>>()).to_rgb8().save(folder.join("away.png"))?;
    println!("wrote {} and {}", folder.join("heard.wav").display(), folder.join("away.png").display());
    Ok(())
}

/// Plays so many commands. Returns the measured frames, and the largest step between two of them.
fn play(count: usize) -> Result<(Vec<Measured>, f32)> {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
    // A ruler: the melody on the left, and on the right the position in the sound.
    let melody = melody::samples(SECONDS);
    let frames = melody.len() / 2;
    let position = |frame: usize| (frame as f64 / frames as f64 * 65_535.0 - 32_768.0) as i16;
    let samples: Vec<i16> =
        (0..frames).flat_map(|frame| [melody[2 * frame] / 2 + melody[2 * frame + 1] / 2, position(frame)]).collect();
    let sound = SoundTrack(Sound::new(melody::RATE, 2, samples)?);
    let sound = app.world_mut().resource_mut::<Assets<SoundTrack>>().add(sound);
    let timeline = Timeline::new(Vec::new(), Vec::new(), Some(SECONDS as f32))?;
    let timeline = timeline.with_sounds(vec![SoundClip { sound, start: 0.0, volume: 1.0 }])?;
    let timeline = app.world_mut().resource_mut::<Assets<Timeline>>().add(timeline);
    let player = app.world_mut().spawn(TimelinePlayer(timeline)).id();
    let update = |app: &mut App, seconds: f64| {
        app.insert_resource(TimeUpdateStrategy::ManualDuration(Duration::from_secs_f64(seconds)));
        app.update();
    };
    (0..3).for_each(|_| update(&mut app, 0.0));
    let (mut random, mut follower) = (Random(5), SoundFollower::new(RATE));
    let (mut measured, mut largest_step, mut last) = (Vec::new(), 0.0f32, [0.0f32; 2]);
    let (mut now, mut next, mut settled, mut commands) = (0.0f64, 0.003f64, 0.02f64, 0);
    while commands < count {
        let frame = 0.0137 + 0.006 * random.share();
        let playback = *app.world().get::<Playback>(player).ok_or("the player is gone")?;
        let mut states = app.world_mut().query::<&SoundState>();
        let state = states.single(app.world())?.clone();
        let cue = state.cue(now);
        let moves = if playback.playing { f64::from(playback.speed) } else { 0.0 };
        while next < now + frame {
            let mut block = [[0.0; 2]; BLOCK];
            follower.fill(&cue, next, &mut block);
            for (index, heard) in block.into_iter().enumerate() {
                let time = next + index as f64 / f64::from(RATE);
                largest_step = largest_step.max((heard[0] - last[0]).abs());
                last = heard;
                let shown = f64::from(playback.time) + moves * (time - now);
                let found = (f64::from(heard[1]) + 1.0) / 2.0 * SECONDS;
                let is_measured = time >= settled && moves != 0.0 && shown > 0.3 && shown < SECONDS - 0.3;
                let away = is_measured.then(|| (found - shown) / moves.abs().max(1.0));
                measured.push(Measured { time, away, heard: heard[0] });
            }
            next += BLOCK as f64 / f64::from(RATE);
        }
        now += frame;
        if random.share() < 0.03 {
            let mut playback = app.world_mut().get_mut::<Playback>(player).ok_or("the player is gone")?;
            command(&mut playback, &mut random);
            (commands, settled) = (commands + 1, now + 0.02);
        }
        update(&mut app, frame);
    }
    Ok((measured, largest_step))
}

/// Gives a player a random command. It rests for a short time only.
fn command(playback: &mut Playback, random: &mut Random) {
    if !playback.playing && random.share() < 0.7 {
        return playback.play();
    }
    match (random.share() * 5.0) as u32 {
        0 | 1 => playback.seek((random.share() * SECONDS) as f32),
        2 => playback.toggle(),
        3 => playback.speed = [0.5, 1.0, 1.0, 1.5, 2.0][(random.share() * 5.0) as usize % 5] * playback.speed.signum(),
        _ => playback.reverse(),
    }
}

/// Draws the distance between sound and picture over time, in red, and what is heard, in gray.
fn picture(measured: &[&Measured]) -> Picture {
    const SIZE: [usize; 2] = [1200, 320];
    const MILLISECONDS: f64 = 10.0;
    let mut picture = Picture::filled(UVec2::new(SIZE[0] as u32, SIZE[1] as u32), Vec3::new(0.07, 0.07, 0.09));
    let mut put = |time: f64, height: f64, color: [f32; 3]| {
        let (x, y) = (time / DRAWN * SIZE[0] as f64, (0.5 - 0.5 * height) * (SIZE[1] - 1) as f64);
        let (row, column) = ((y.round().max(0.0) as usize).min(SIZE[1] - 1), (x as usize).min(SIZE[0] - 1));
        picture.pixels[row * SIZE[0] + column] = color.into();
    };
    for frame in measured {
        put(frame.time, f64::from(frame.heard), [0.27, 0.29, 0.33]);
    }
    for column in 0..SIZE[0] {
        put(column as f64 / SIZE[0] as f64 * DRAWN, 0.0, [0.47, 0.47, 0.51]);
    }
    for frame in measured {
        if let Some(away) = frame.away {
            put(frame.time, away * 1e3 / MILLISECONDS, [0.94, 0.35, 0.27]);
        }
    }
    picture
}

/// Returns a file of one channel of 16 bits.
fn wave(data: &[u8]) -> Vec<u8> {
    let mut file = b"RIFF".to_vec();
    file.extend((36 + data.len() as u32).to_le_bytes());
    file.extend(b"WAVEfmt ");
    file.extend([16, 0, 0, 0, 1, 0, 1, 0]);
    file.extend([RATE, 2 * RATE].map(u32::to_le_bytes).as_flattened());
    file.extend([2, 0, 16, 0]);
    file.extend(b"data");
    file.extend((data.len() as u32).to_le_bytes());
    file.extend(data);
    file
}

/// Random numbers by a linear congruence.
struct Random(u64);

impl Random {
    /// Returns a number from 0 to below 1.
    fn share(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}
