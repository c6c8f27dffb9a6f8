//! A path of the head: follows a recorded path, and records one.
//!
//! In: a RON file of poses, or the moving head. Out: the transforms of body and head at each time, or a file.

use super::body::{Body, EYE_HEIGHT, Head};
use super::teleport::Teleport;
use bevy::prelude::*;
use bevy_gs4d::stereo::StereoRig;
use serde::{Deserialize, Serialize};
use std::array::from_fn;
use std::f32::consts::{PI, TAU};
use std::path::Path;

/// Seconds between recorded poses.
const SPACING: f32 = 0.1;
/// The file that recordings are written to.
const RECORDING: &str = "recorded.path.ron";

/// A pose of the head.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Seconds.
    time: f32,
    /// Meters, y up.
    position: [f32; 3],
    /// Radians about the vertical, to the left.
    yaw: f32,
    /// Radians upwards.
    pitch: f32,
}

impl Pose {
    fn of(time: f32, head: &GlobalTransform) -> Self {
        let (yaw, pitch, _) = head.rotation().to_euler(EulerRot::YXZ);
        Self { time, position: head.translation().to_array(), yaw, pitch }
    }

    fn values(&self) -> [f32; 5] {
        let [x, y, z] = self.position;
        [x, y, z, self.yaw, self.pitch]
    }
}

/// Poses in order of time, at least one.
#[derive(Resource)]
pub struct HeadPath(Vec<Pose>);

impl HeadPath {
    /// Reads a path from a file, or the bundled path.
    ///
    /// # Errors
    /// A file that cannot be read or is not a valid path.
    pub fn load(path: Option<&Path>) -> Result<Self> {
        let read = match path {
            Some(path) => {
                let text = std::fs::read_to_string(path).map_err(|error| error.to_string());
                text.and_then(|text| Self::read(&text)).map_err(|error| format!("{}: {error}", path.display()))
            }
            None => Self::read(include_str!("../../assets/walkthrough.path.ron")),
        };
        Ok(read?)
    }

    fn read(text: &str) -> Result<Self, String> {
        let mut poses: Vec<Pose> = ron::from_str(text).map_err(|error| error.to_string())?;
        if poses.is_empty() {
            return Err("a path needs at least one pose".into());
        }
        let mut before: Option<Pose> = None;
        for (number, pose) in (1..).zip(&mut poses) {
            if !pose.time.is_finite() || !pose.values().iter().all(|value| value.is_finite()) {
                return Err(format!("pose {number}: every value must be a finite number"));
            }
            if let Some(before) = before {
                if pose.time <= before.time {
                    return Err(format!("pose {number}: {} s is not after {} s", pose.time, before.time));
                }
                pose.yaw = before.yaw + wrapped(pose.yaw - before.yaw);
            }
            before = Some(*pose);
        }
        Ok(Self(poses))
    }

    fn duration(&self) -> f32 {
        self.0.last().map_or(0.0, |pose| pose.time)
    }

    /// Returns the pose at a time, on a smooth curve through the poses. The curve starts and ends at rest, and is
    /// constant before and after.
    fn at(&self, seconds: f32) -> Pose {
        let Some(last) = self.0.len().checked_sub(1).filter(|last| *last > 0) else { return self.0[0] };
        let next = self.0.partition_point(|pose| pose.time <= seconds).clamp(1, last);
        let (a, b) = (self.0[next - 1], self.0[next]);
        let (span, [from, to]) = (b.time - a.time, [self.slopes(next - 1), self.slopes(next)]);
        let s = ((seconds - a.time) / span).clamp(0.0, 1.0);
        let (before, after) = (a.values(), b.values());
        let [x, y, z, yaw, pitch] = from_fn(|i| hermite(s, [before[i], after[i]], [from[i] * span, to[i] * span]));
        Pose { time: seconds, position: [x, y, z], yaw, pitch }
    }

    /// Returns the slopes of the curve at a pose, per second.
    fn slopes(&self, index: usize) -> [f32; 5] {
        let (Some(before), Some(after)) = (index.checked_sub(1).map(|i| self.0[i]), self.0.get(index + 1)) else {
            return [0.0; 5];
        };
        let (from, to) = (before.values(), after.values());
        from_fn(|i| (to[i] - from[i]) / (after.time - before.time))
    }
}

/// Evaluates the cubic between two values with given slopes at both ends; `s` is from 0 to 1.
fn hermite(s: f32, [a, b]: [f32; 2], [from, to]: [f32; 2]) -> f32 {
    let (s2, s3) = (s * s, s * s * s);
    let rise = 3.0 * s2 - 2.0 * s3;
    a * (1.0 - rise) + b * rise + from * (s3 - 2.0 * s2 + s) + to * (s3 - s2)
}

/// Returns an angle wrapped to −π to π.
pub fn wrapped(angle: f32) -> f32 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// The state of following the path.
#[derive(Resource)]
pub struct PathPlayer {
    pub playing: bool,
    pub seconds: f32,
}

/// Returns whether the body can walk: no path is being followed.
pub fn walking(player: Res<PathPlayer>) -> bool {
    !player.playing
}

/// Starts following the path from its start, or stops, when P is pressed.
pub fn start(keys: Res<ButtonInput<KeyCode>>, mut player: ResMut<PathPlayer>, mut teleport: ResMut<Teleport>) {
    if keys.just_pressed(KeyCode::KeyP) {
        *player = PathPlayer { playing: !player.playing, seconds: 0.0 };
        teleport.stop_aiming();
    }
}

/// Places body and head on the path.
pub fn follow(
    time: Res<Time>,
    path: Res<HeadPath>,
    mut player: ResMut<PathPlayer>,
    body: Option<Single<&mut Transform, With<Body>>>,
    head: Option<Single<&mut Transform, (With<StereoRig>, Without<Body>)>>,
) {
    let Some(mut body) = body.filter(|_| player.playing) else { return };
    player.seconds += time.delta_secs();
    player.playing = player.seconds <= path.duration();
    let pose = path.at(player.seconds);
    body.translation = Vec3::from(pose.position) - Vec3::Y * EYE_HEIGHT;
    body.rotation = Quat::from_rotation_y(pose.yaw);
    if let Some(mut head) = head {
        head.rotation = Quat::from_rotation_x(pose.pitch);
    }
}

/// The poses recorded so far; `None` while nothing is recorded.
#[derive(Resource, Default)]
pub struct Recorder {
    poses: Option<Vec<Pose>>,
    seconds: f32,
}

/// Starts and ends a recording when R is pressed, and records poses in between.
pub fn record(
    time: Res<Time>,
    keys: Res<ButtonInput<KeyCode>>,
    mut recorder: ResMut<Recorder>,
    head: Single<&GlobalTransform, With<Head>>,
) {
    if keys.just_pressed(KeyCode::KeyR) {
        match recorder.poses.take() {
            Some(poses) => save(&poses),
            None => {
                info!("recording; R stops the recording");
                *recorder = Recorder { poses: Some(Vec::new()), seconds: 0.0 };
            }
        }
    }
    recorder.seconds += time.delta_secs();
    let now = recorder.seconds;
    let Some(poses) = &mut recorder.poses else { return };
    if poses.last().is_none_or(|last| now - last.time >= SPACING) {
        poses.push(Pose::of(now, &head));
    }
}

/// Returns poses as text for [`HeadPath::read`].
fn text(poses: &[Pose]) -> Result<String, String> {
    let lines = ron::ser::PrettyConfig::default().depth_limit(1);
    ron::ser::to_string_pretty(poses, lines).map_err(|error| error.to_string())
}

fn save(poses: &[Pose]) {
    let written = text(poses).and_then(|text| std::fs::write(RECORDING, text).map_err(|error| error.to_string()));
    match written {
        Ok(()) => info!("{} poses in {RECORDING}: --path {RECORDING} follows them", poses.len()),
        Err(error) => error!("{RECORDING}: {error}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn head(position: Vec3, yaw: f32, pitch: f32) -> GlobalTransform {
        let turn = Quat::from_euler(EulerRot::YXZ, yaw, pitch, 0.0);
        Transform::from_translation(position).with_rotation(turn).into()
    }

    #[test]
    fn a_recorded_path_survives_a_round_trip() {
        let ways = [(Vec3::new(0.5, 1.6, 3.0), 0.7, -0.3), (Vec3::new(1.5, 1.5, -2.0), -1.2, 0.4), (Vec3::Y, 0.0, 0.0)];
        let poses: Vec<Pose> = (0u8..)
            .zip(ways)
            .map(|(step, (place, yaw, pitch))| Pose::of(f32::from(step), &head(place, yaw, pitch)))
            .collect();
        let path = HeadPath::read(&text(&poses).expect("poses can be written")).expect("written poses can be read");
        assert_eq!(path.duration(), 2.0, "the path has the duration of the recording");
        for (pose, (place, yaw, pitch)) in poses.iter().zip(ways) {
            let read = path.at(pose.time);
            let [x, y, z, read_yaw, read_pitch] = read.values();
            assert!(place.abs_diff_eq(Vec3::new(x, y, z), 1e-5), "at {} s the head is at {place}", pose.time);
            let off = (read_yaw - yaw).abs().max((read_pitch - pitch).abs());
            assert!(off < 1e-5, "at {} s the direction is {off} radians off", pose.time);
        }
    }

    #[test]
    fn errors_of_an_invalid_path_name_the_pose() {
        let pose = |time: &str| format!("(time: {time}, position: (0.0, 1.6, 0.0), yaw: 0.0, pitch: 0.0)");
        let refused = |second: &str| HeadPath::read(&format!("[{}, {}]", pose("0.0"), pose(second))).err();
        assert!(refused("1.0").is_none(), "poses in order of time are valid");
        for time in ["0.0", "-1.0", "NaN", "inf"] {
            let message = refused(time).unwrap_or_default();
            assert!(message.contains("pose 2"), "the error for a second pose at {time} s names it: {message:?}");
        }
        assert!(HeadPath::read("[]").is_err(), "a path without poses is an error");
    }
}
