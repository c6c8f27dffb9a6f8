//! Random changes of a state.
//!
//! In: a seed. Out: a [`State`] after each step and a description of the change. Both depend on the seed and the number
//! of the step only, so that a new app can reproduce the state.

use crate::state::{Form, Lens, Placed, Source, State, Viewer};
use crate::support::random::Random;
use bevy::prelude::*;
use bevy_gs4d::playback::Playback;
use bevy_gs4d::render::{CaptureSettings, DepthWrite};
use bevy_gs4d::renderer::Design;
use std::f32::consts::TAU;

/// Number of steps from one check to the next. At a check all captures are paused, and the app is compared with a new
/// app.
const CHECK: u64 = 50;
/// Largest number of captures.
const CAPTURES: usize = 6;
/// Sizes of the first camera's target in pixels.
const SIZES: [UVec2; 5] =
    [UVec2::new(96, 96), UVec2::new(64, 48), UVec2::new(131, 70), UVec2::new(16, 16), UVec2::new(300, 20)];

/// The changes of a seed.
pub struct Changes {
    random: Random,
    /// Number of steps so far.
    pub step: u64,
    pub state: State,
    /// Number of captures so far.
    made: u64,
}

impl Changes {
    pub fn new(seed: u64) -> Self {
        Self { random: Random::new(seed), step: 0, state: State::default(), made: 0 }
    }

    /// Makes the next change, and returns its description.
    pub fn advance(&mut self) -> String {
        self.step += 1;
        if self.is_check() {
            return self.hold();
        }
        if self.is_clearing() {
            self.state.captures.clear();
            return "remove all captures".to_owned();
        }
        match self.random.below(100) {
            0..18 => self.spawn(),
            18..26 => self.despawn(),
            26..36 => self.seek(),
            36..44 => self.play(),
            44..50 => {
                self.state.version += 1;
                format!("version {} of the file", self.state.version)
            }
            50..56 => {
                self.state.size = SIZES[self.random.below(SIZES.len())];
                format!("a target of {}", self.state.size)
            }
            56..82 => self.change_camera(),
            82..95 => self.change_settings(),
            95 => {
                self.state.coarse = !self.state.coarse;
                format!("coarsest level of detail: {}", self.state.coarse)
            }
            _ => self.second_camera(),
        }
    }

    /// Returns whether the app is compared with a new app after this step.
    pub fn is_check(&self) -> bool {
        self.step.is_multiple_of(CHECK)
    }

    /// Returns whether this step removes all captures: the step after every second check.
    pub fn is_clearing(&self) -> bool {
        self.step % (2 * CHECK) == CHECK + 1
    }

    /// Pauses every capture at a random time.
    fn hold(&mut self) -> String {
        for capture in &mut self.state.captures {
            capture.playback = Playback::paused_at(2.0 * unit(&mut self.random));
        }
        "hold".to_owned()
    }

    fn spawn(&mut self) -> String {
        if self.state.captures.len() == CAPTURES {
            return self.despawn();
        }
        let seed = self.random.bits() % 1000;
        let source = match self.random.below(8) {
            0 => Source::Bundled,
            1 | 2 => Source::File,
            3 | 4 => Source::Made(Form::Single, seed),
            5 | 6 => Source::Made(Form::Filtered, seed),
            _ => Source::Made(Form::Packed, seed),
        };
        let turn = Quat::from_rotation_y(TAU * unit(&mut self.random));
        let pose = Transform::from_translation(0.8 * spread(&mut self.random)).with_rotation(turn);
        let pose = pose.with_scale(Vec3::splat(0.5 + unit(&mut self.random)));
        self.made += 1;
        let (number, settings) = (self.made, CaptureSettings::default());
        self.state.captures.push(Placed { number, source, pose, playback: Playback::default(), settings });
        format!("spawn {number} from {source:?}")
    }

    fn despawn(&mut self) -> String {
        let index = self.random.below(self.state.captures.len());
        if index >= self.state.captures.len() {
            return "nothing to despawn".to_owned();
        }
        format!("despawn {}", self.state.captures.remove(index).number)
    }

    fn seek(&mut self) -> String {
        let time = 3.0 * unit(&mut self.random) - 0.5;
        let Some(capture) = self.pick() else { return "nothing to seek".to_owned() };
        capture.playback.seek(time);
        format!("seek {} to {time}", capture.number)
    }

    fn play(&mut self) -> String {
        let speed = [-1.0, 0.25, 1.0, 8.0][self.random.below(4)];
        let playing = self.random.below(3) > 0;
        let Some(capture) = self.pick() else { return "nothing to play".to_owned() };
        (capture.playback.speed, capture.playback.playing) = (speed, playing);
        format!("play {}: {playing}, at {speed}", capture.number)
    }

    fn change_settings(&mut self) -> String {
        let opacity = [0.0, 0.3, 1.0][self.random.below(3)];
        let filter = self.random.below(3) > 0;
        let Some(capture) = self.pick() else { return "nothing to fade".to_owned() };
        capture.settings = CaptureSettings { opacity, filter, ..capture.settings };
        format!("show {}: opacity {opacity}, filter {filter}", capture.number)
    }

    fn change_camera(&mut self) -> String {
        let (what, pose) = (self.random.below(26), pose(&mut self.random));
        let index = self.random.below(self.state.cameras.len());
        let camera = &mut self.state.cameras[index];
        let change = match what {
            0..3 => {
                camera.msaa = if camera.msaa == Msaa::Off { Msaa::Sample4 } else { Msaa::Off };
                format!("{:?}", camera.msaa)
            }
            3..6 => {
                camera.settings.design = [Design::Auto, Design::TileBins, Design::GlobalSort][what - 3];
                format!("{:?}", camera.settings.design)
            }
            6..9 => {
                camera.settings.depth = [DepthWrite::None, DepthWrite::Expected, DepthWrite::Median][what - 6];
                format!("depth {:?}", camera.settings.depth)
            }
            9..13 => {
                camera.lens = [Lens::Perspective, Lens::Orthographic, Lens::Unusable, Lens::Perspective][what - 9];
                format!("{:?}", camera.lens)
            }
            _ => {
                camera.pose = pose;
                format!("to {}", pose.translation)
            }
        };
        format!("camera {index}: {change}")
    }

    fn second_camera(&mut self) -> String {
        if self.state.cameras.len() > 1 {
            self.state.cameras.truncate(1);
            return "one camera".to_owned();
        }
        self.state.cameras.push(Viewer { pose: pose(&mut self.random), ..Viewer::default() });
        "two cameras".to_owned()
    }

    /// Returns a random capture; `None` if there is none.
    fn pick(&mut self) -> Option<&mut Placed> {
        let index = self.random.below(self.state.captures.len());
        self.state.captures.get_mut(index)
    }
}

/// Returns a random number from 0 to 1.
pub fn unit(random: &mut Random) -> f32 {
    (random.bits() >> 40) as f32 / (1 << 24) as f32
}

/// Returns a random point of the cube from −1 to 1.
pub fn spread(random: &mut Random) -> Vec3 {
    Vec3::from([(); 3].map(|()| 2.0 * unit(random) - 1.0))
}

/// Returns a random pose of a camera: among the captures, close to them, around them or far away.
fn pose(random: &mut Random) -> Transform {
    let distance = [0.3, 1.2, 3.0, 3.0, 8.0, 300.0][random.below(6)];
    let place = distance * spread(random);
    Transform::from_translation(place).looking_at(0.5 * spread(random), Vec3::Y)
}
