//! A sound that follows the time of a picture.
//!
//! In: a [`SoundCue`], which says where in which sound the picture was, and when; the time for which samples are
//! needed. Out: the samples, two channels, without clicks. Needs no audio device and no Bevy app.

use crate::codec::sound::Sound;

/// Where the picture is in a sound.
#[derive(Debug, Default, Clone)]
pub struct SoundCue {
    /// The sound; `None` is silent.
    pub sound: Option<Sound>,
    /// The position in the sound, in seconds.
    pub seconds: f64,
    /// Seconds of the sound per second of the clock; negative backwards, 0 at rest.
    pub speed: f64,
    /// A factor on the samples, 0 to 1.
    pub volume: f32,
    /// When it was there, in seconds of a clock of the caller.
    pub at: f64,
}

/// Makes the samples of a sound that follows a picture.
///
/// The pitch changes with the speed. The sound is silent at rest, slower than a twentieth of the normal speed, faster
/// than four times, and when its cue is older than a quarter of a second: the game stands still. The first and the last
/// 20 ms of the sound are faded.
///
/// From one sample to the next, the samples differ by at most those of the sound at this speed, and
/// [`LARGEST_STEP`](Self::LARGEST_STEP) for what the follower itself changes.
///
/// # Examples
///
/// ```
/// use bevy_gs4d::codec::sound::Sound;
/// use bevy_gs4d::sound::{SoundCue, SoundFollower};
///
/// let sound = Sound::new(1000, 1, vec![8192; 2000])?;
/// let cue = SoundCue { sound: Some(sound), seconds: 0.5, speed: 1.0, volume: 1.0, at: 10.0 };
/// let (mut follower, mut samples) = (SoundFollower::new(48_000), [[0.0; 2]; 480]);
/// follower.fill(&cue, 10.0, &mut samples);
/// assert_eq!(samples[479], [0.25, 0.25], "the sound has been faded in");
/// # Ok::<(), bevy_gs4d::codec::sound::SoundError>(())
/// ```
#[derive(Debug)]
pub struct SoundFollower {
    /// Seconds of a frame.
    frame: f64,
    current: Option<Voice>,
    /// Voices that are faded out.
    leaving: Vec<Voice>,
    /// The factor on the samples that is reached.
    volume: f32,
}

/// A sound that is heard.
#[derive(Debug)]
struct Voice {
    sound: Sound,
    seconds: f64,
    speed: f64,
    /// 0: silent, 1: heard.
    level: f32,
}

/// Speeds at which a sound is heard: a twentieth to four times, and what rounding makes of them.
const SPEEDS: [f64; 2] = [0.0499, 4.01];
/// Seconds by which a sound may be away from the picture, at normal speed, without a jump.
const NEAR: f64 = 0.01;
/// Seconds in which a sound that is away comes back.
const RETURN: f64 = 0.5;
/// Largest share of the speed by which it does.
const CORRECTION: f64 = 0.005;
/// Seconds after which a cue is too old.
const PATIENCE: f64 = 0.25;
/// Most voices that are faded out at once.
const MOST_LEAVING: usize = 2;

impl SoundFollower {
    /// Seconds in which a sound is faded in or out.
    pub const FADE_SECONDS: f64 = 0.005;
    /// The largest difference between two samples at 48,000 frames a second, besides that of the sound itself: of a
    /// voice that comes, two that leave, each perhaps at an end of the sound, and the volume.
    pub const LARGEST_STEP: f32 = ((MOST_LEAVING + 1) as f32 * 2.0 * 1.5 + 1.0) / 240.0;

    /// Creates a follower that makes `rate` frames a second. Nothing is heard yet.
    pub fn new(rate: u32) -> Self {
        let frame = f64::from(rate.max(1)).recip();
        Self { frame, current: None, leaving: Vec::new(), volume: 0.0 }
    }

    /// Writes the next frames, left and right, of which the first is heard at `now`, in seconds of the clock of the
    /// cue. Calls with no more than a hundredth of a second each keep the sound closest to the picture.
    pub fn fill(&mut self, cue: &SoundCue, now: f64, frames: &mut [[f32; 2]]) {
        self.follow(cue, now);
        let fade = (self.frame / Self::FADE_SECONDS) as f32;
        let volume = if cue.volume.is_nan() { 0.0 } else { cue.volume.clamp(0.0, 1.0) };
        for frame in frames {
            self.volume += (volume - self.volume).clamp(-fade, fade);
            let mut sum = [0.0; 2];
            let coming = self.current.iter_mut().map(|voice| (voice, fade));
            for (voice, change) in coming.chain(self.leaving.iter_mut().map(|voice| (voice, -fade))) {
                let samples = voice.next(change, self.frame);
                sum = [sum[0] + samples[0], sum[1] + samples[1]];
            }
            *frame = sum.map(|sample| sample * self.volume);
        }
        self.leaving.retain(|voice| voice.level > 0.0);
    }

    /// Chooses the voices, given the time of the next frame.
    fn follow(&mut self, cue: &SoundCue, now: f64) {
        let late = now - cue.at;
        let is_timely = late.abs() <= PATIENCE;
        let is_heard = is_timely && (SPEEDS[0]..=SPEEDS[1]).contains(&cue.speed.abs()) && cue.seconds.is_finite();
        let wanted = cue.sound.as_ref().filter(|_| is_heard);
        let seconds = cue.seconds + cue.speed * late;
        let is_near = |voice: &Voice, sound: &Sound| {
            sound.is_clone_of(&voice.sound) && (seconds - voice.seconds).abs() <= NEAR * cue.speed.abs().max(1.0)
        };
        match (self.current.take(), wanted) {
            (Some(mut voice), Some(sound)) if is_near(&voice, sound) => {
                let most = CORRECTION * cue.speed.abs();
                voice.speed = cue.speed + ((seconds - voice.seconds) / RETURN).clamp(-most, most);
                self.current = Some(voice);
            }
            // It plays on until there is room to fade it out.
            (Some(voice), _) if self.leaving.len() == MOST_LEAVING => self.current = Some(voice),
            (before, wanted) => {
                self.leaving.extend(before);
                let begin = |sound: &Sound| Voice { sound: sound.clone(), seconds, speed: cue.speed, level: 0.0 };
                self.current = wanted.map(begin);
            }
        }
    }
}

impl Voice {
    /// Returns the samples, and goes on by a frame.
    fn next(&mut self, change: f32, frame: f64) -> [f32; 2] {
        self.level = (self.level + change).clamp(0.0, 1.0);
        // The ends of the sound are faded, too, at every speed.
        let fade = SoundFollower::FADE_SECONDS * 4.0;
        let edge = (self.seconds.min(self.sound.seconds() - self.seconds) / fade).clamp(0.0, 1.0) as f32;
        let gain = smooth(self.level) * smooth(edge);
        let samples = self.sound.at(self.seconds).map(|sample| sample * gain);
        self.seconds += self.speed * frame;
        samples
    }
}

/// Returns the level of a fade, whose slope is at most 1.5 and 0 at both ends; two that cross over add up to 1.
fn smooth(level: f32) -> f32 {
    level * level * (3.0 - 2.0 * level)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: u32 = 48_000;
    const BLOCK: usize = 240;

    /// A sound of 20 s whose left samples rise from -1 to 1, and whose right samples are 0.5.
    fn ruler() -> Sound {
        let frames = 20_000;
        let samples = (0..frames).flat_map(|frame| [(frame * 65_535 / frames - 32_768) as i16, 16_384]);
        Sound::new(1000, 2, samples.collect::<Vec<_>>()).expect("a good sound")
    }

    /// Returns the position that is heard, of a frame of the ruler.
    fn position(frame: [f32; 2]) -> f64 {
        (f64::from(frame[0]) + 1.0) * 10.0
    }

    fn cue(sound: &Sound, seconds: f64, speed: f64, at: f64) -> SoundCue {
        SoundCue { sound: Some(sound.clone()), seconds, speed, volume: 1.0, at }
    }

    /// Returns the frames of some blocks from `now` on.
    fn frames(follower: &mut SoundFollower, cue: &SoundCue, now: f64, blocks: usize) -> Vec<[f32; 2]> {
        let (mut all, mut block) = (Vec::new(), [[0.0; 2]; BLOCK]);
        for index in 0..blocks {
            follower.fill(cue, now + (index * BLOCK) as f64 / f64::from(RATE), &mut block);
            all.extend_from_slice(&block);
        }
        all
    }

    #[test]
    fn a_sound_is_heard_where_the_picture_is() {
        let sound = ruler();
        for (seconds, speed) in [(3.0, 1.0), (15.0, -1.0), (8.0, 4.000_1), (8.0, 0.049_99)] {
            let mut follower = SoundFollower::new(RATE);
            let heard = frames(&mut follower, &cue(&sound, seconds, speed, 100.0), 100.0, 20);
            let last = heard[heard.len() - 1];
            let expected = seconds + speed * (heard.len() - 1) as f64 / f64::from(RATE);
            let away = (position(last) - expected).abs();
            assert!(away < 0.002, "at speed {speed} {} is heard, and {expected} shown", position(last));
            assert!((last[1] - 0.5).abs() < 1e-4, "the sound is heard in full");
        }
    }

    #[test]
    fn a_sound_that_is_a_little_away_comes_back_without_a_jump() {
        let (sound, mut follower) = (ruler(), SoundFollower::new(RATE));
        frames(&mut follower, &cue(&sound, 3.0, 1.0, 0.0), 0.0, 4);
        // The picture is 8 ms ahead of what it was.
        let later = cue(&sound, 3.008, 1.0, 0.0);
        let heard = frames(&mut follower, &later, 0.02, 40);
        let steps = heard.windows(2).map(|pair| position(pair[1]) - position(pair[0]));
        let largest = steps.fold(0.0, f64::max);
        assert!(largest < 2e-4, "no jump, but {largest} s");
        assert!(position(heard[heard.len() - 1]) - 3.22 > 0.0005, "it has come nearer");
    }

    #[test]
    fn jumps_rests_and_ends_are_no_clicks() {
        let (sound, mut follower) = (ruler(), SoundFollower::new(RATE));
        let mut heard = Vec::new();
        let cues = [
            cue(&sound, 1.0, 1.0, 0.0),
            cue(&sound, 19.0, 1.0, 0.1),
            cue(&sound, 2.0, 0.0, 0.2),
            cue(&sound, 2.0, 1.0, 0.3),
            cue(&sound, 19.95, 1.0, 0.4),
            cue(&sound, 0.05, -1.0, 0.5),
            SoundCue { volume: 0.2, ..cue(&sound, 5.0, 1.0, 0.6) },
            SoundCue { volume: f32::NAN, ..cue(&sound, 5.1, 1.0, 0.7) },
            cue(&sound, 5.2, 9.0, 0.8),
            SoundCue { sound: None, ..cue(&sound, 5.2, 1.0, 0.9) },
            cue(&sound, f64::NAN, 1.0, 1.0),
        ];
        for cue in &cues {
            heard.extend(frames(&mut follower, cue, cue.at, 20));
        }
        let steps = heard.windows(2).flat_map(|pair| [0, 1].map(|side| (pair[1][side] - pair[0][side]).abs()));
        let largest = steps.fold(0.0, f32::max);
        assert!(largest <= SoundFollower::LARGEST_STEP + 1e-4, "the largest step is {largest}");
        assert!(largest > 0.005, "the ruler jumps between loud places");
        let silent = |cue: usize| heard[(cue * 20 + 19) * BLOCK..(cue + 1) * 20 * BLOCK].iter().all(|f| *f == [0.0; 2]);
        assert_eq!([2, 3, 7, 8, 9, 10].map(silent), [true, false, true, true, true, true], "which cues are silent");
    }

    #[test]
    fn a_cue_that_is_too_old_is_silent() {
        let (sound, mut follower) = (ruler(), SoundFollower::new(RATE));
        let heard = frames(&mut follower, &cue(&sound, 3.0, 1.0, 0.0), 0.0, 70);
        let at = |seconds: f64| heard[(seconds * f64::from(RATE)) as usize][1];
        assert!(at(0.2) > 0.49 && at(0.3) == 0.0, "heard at 0.2 s, {}, and not at 0.3 s, {}", at(0.2), at(0.3));
    }

    #[test]
    fn many_jumps_at_once_keep_a_few_voices() {
        let (sound, mut follower) = (ruler(), SoundFollower::new(RATE));
        let (mut few, mut last) = ([[0.0; 2]; 2], [0.0f32; 2]);
        for jump in 0..1000 {
            follower.fill(&cue(&sound, f64::from(jump % 19) + 0.5, 1.0, 0.0), 0.0, &mut few);
            assert!(follower.leaving.len() <= MOST_LEAVING, "{} voices leave", follower.leaving.len());
            let steps = [[last, few[0]], few].map(|[a, b]| (b[0] - a[0]).abs().max((b[1] - a[1]).abs()));
            last = few[1];
            assert!(steps[0].max(steps[1]) <= SoundFollower::LARGEST_STEP, "steps of {steps:?} at jump {jump}");
        }
    }
}
