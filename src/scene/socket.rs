//! Sockets: named points with a frame that follow what they were placed on.
//!
//! In: the positions and rotations of a frame at times of a capture, in capture space. Out: a [`Socket`], which returns
//! the frame at any time of its track.

use glam::{Quat, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Most sockets of a capture.
const MAX_SOCKETS: usize = 256;
/// Longest name, bytes.
const LONGEST_NAME: usize = 256;
/// Largest difference of the length of a rotation from 1.
const UNIT: f32 = 1e-3;

/// A named point with a frame that follows a part of a capture.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Socket {
    /// The name, by which it is found. No two sockets of a capture have the same.
    pub name: String,
    /// The track, in ascending order of time; one sample at least. Before the first and after the last one, the part
    /// that it follows is not there or could not be followed.
    pub samples: Vec<SocketSample>,
}

/// The frame of a socket at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SocketSample {
    /// The time, timestamp units.
    pub time: f32,
    /// The position, capture space.
    pub position: [f32; 3],
    /// The rotation since the time at which the socket was placed, capture space: a unit quaternion x, y, z, w.
    pub rotation: [f32; 4],
    /// An estimate of the distance of `position` from the true place, a standard deviation in capture units.
    pub error: f32,
}

impl Socket {
    /// Most samples of all sockets of a capture: eighteen minutes of one socket at 60 a second.
    pub const MOST_SAMPLES: usize = 1 << 16;

    /// Returns the first and the last time of the track, timestamp units; `None` without samples.
    pub fn reach(&self) -> Option<[f32; 2]> {
        Some([self.samples.first()?.time, self.samples.last()?.time])
    }

    /// Returns the frame at `time`, timestamp units, between the samples before and after it; `None` outside the track.
    pub fn at(&self, time: f32) -> Option<SocketSample> {
        let after = self.samples.partition_point(|sample| sample.time <= time);
        let before = self.samples.get(after.checked_sub(1)?)?;
        if before.time == time {
            return Some(*before);
        }
        Some(before.toward(self.samples.get(after)?, time))
    }

    /// Returns whether a socket may have this name.
    pub(crate) fn is_name(name: &str) -> bool {
        !name.trim().is_empty() && name.len() <= LONGEST_NAME && !name.contains(char::is_control)
    }

    /// Checks that it can be used: a name, one sample at least, finite values, ascending times, unit rotations.
    ///
    /// # Errors
    /// A description of the first fault.
    pub fn check(&self) -> Result<(), &'static str> {
        if !Self::is_name(&self.name) {
            return Err("the name of a socket that is blank, longer than 256 bytes, or has control characters");
        }
        if self.samples.is_empty() {
            return Err("a socket without samples");
        }
        if !self.samples.iter().all(SocketSample::is_usable) {
            return Err("a sample of a socket that is not finite, or has a rotation of another length than 1");
        }
        if !self.samples.is_sorted_by(|a, b| a.time < b.time) {
            return Err("a socket whose times are not in ascending order");
        }
        Ok(())
    }
}

impl SocketSample {
    /// Returns the frame between this sample and the next at `time`.
    fn toward(&self, next: &Self, time: f32) -> Self {
        let part = ((f64::from(time) - f64::from(self.time)) / (f64::from(next.time) - f64::from(self.time))) as f32;
        let rotation = Quat::from_array(self.rotation).slerp(Quat::from_array(next.rotation), part);
        Self {
            time,
            position: Vec3::from(self.position).lerp(next.position.into(), part).to_array(),
            rotation: rotation.normalize().to_array(),
            error: self.error + (next.error - self.error) * part,
        }
    }

    fn is_usable(&self) -> bool {
        let length = self.rotation.iter().map(|value| value * value).sum::<f32>().sqrt();
        self.time.is_finite()
            && self.position.iter().all(|value| value.is_finite())
            && (length - 1.0).abs() <= UNIT
            && self.error.is_finite()
            && self.error >= 0.0
    }
}

/// Checks the sockets of a capture: each, their number, and that their names differ.
///
/// # Errors
/// A description of the first fault.
pub(crate) fn check_sockets(sockets: &[Socket]) -> Result<(), &'static str> {
    if sockets.len() > MAX_SOCKETS {
        return Err("more than 256 sockets");
    }
    if sockets.iter().map(|socket| socket.samples.len()).sum::<usize>() > Socket::MOST_SAMPLES {
        return Err("more than 65536 samples of sockets: fewer sockets, or fewer samples a second");
    }
    sockets.iter().try_for_each(Socket::check)?;
    let names: BTreeSet<&str> = sockets.iter().map(|socket| socket.name.as_str()).collect();
    if names.len() < sockets.len() { Err("two sockets of one name") } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f32::consts::FRAC_PI_2;

    fn sample(time: f32, x: f32, angle: f32) -> SocketSample {
        let rotation = Quat::from_rotation_z(angle).to_array();
        SocketSample { time, position: [x, 0.0, 0.0], rotation, error: x }
    }

    fn socket() -> Socket {
        Socket { name: "hand".into(), samples: vec![sample(0.25, 0.0, 0.0), sample(0.75, 2.0, FRAC_PI_2)] }
    }

    #[test]
    fn the_frame_is_interpolated_within_the_track_only() {
        let socket = socket();
        for (index, time) in [0.25, 0.75].into_iter().enumerate() {
            assert_eq!(socket.at(time), Some(socket.samples[index]), "the sample at {time} itself");
        }
        let middle = socket.at(0.5).expect("within the track");
        assert_eq!((middle.time, middle.position[0], middle.error), (0.5, 1.0, 1.0), "half way");
        let turned = Quat::from_array(middle.rotation).angle_between(Quat::from_rotation_z(FRAC_PI_2 / 2.0));
        assert!(turned < 5e-3, "half of the turn, not {turned} beside it");
        for time in [0.0, 0.249, 0.751, f32::NAN] {
            assert_eq!(socket.at(time), None, "no frame at {time}");
        }
        assert_eq!(socket.reach(), Some([0.25, 0.75]), "from the first to the last sample");
    }

    #[test]
    fn faults_are_refused() {
        assert_eq!(check_sockets(&[socket()]), Ok(()), "a good socket");
        let changes: [fn(&mut Socket); 9] = [
            |socket| socket.name.clear(),
            |socket| socket.name = "a\nb".into(),
            |socket| socket.name = "a".repeat(257),
            |socket| socket.samples.clear(),
            |socket| socket.samples.reverse(),
            |socket| socket.samples[1].time = 0.25,
            |socket| socket.samples[0].position[1] = f32::NAN,
            |socket| socket.samples[0].rotation = [0.0; 4],
            |socket| socket.samples[0].error = -1.0,
        ];
        for (index, change) in changes.into_iter().enumerate() {
            let mut bad = socket();
            change(&mut bad);
            assert!(check_sockets(&[bad]).is_err(), "the fault with index {index} is refused");
        }
        assert!(check_sockets(&[socket(), socket()]).is_err(), "two sockets of one name are refused");
        let long = Socket {
            samples: (0..=Socket::MOST_SAMPLES).map(|index| sample(index as f32, 0.0, 0.0)).collect(),
            ..socket()
        };
        assert!(check_sockets(&[long]).is_err(), "too many samples are refused");
    }
}
