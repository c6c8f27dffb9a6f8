//! The picture of a capture in chunk files.
//!
//! In: the files of the capture that are there. Out: [`StreamedPicture`] on its entity, whose asset has no Gaussians
//! itself.

use crate::scene::Bounds;
use bevy::ecs::component::Component;

/// What is drawn of a capture in chunk files. The plugins insert it.
#[derive(Component, Debug, Default, Clone, Copy, PartialEq)]
pub(crate) struct StreamedPicture {
    /// The time that is drawn, seconds since the capture's start. `None` before the first picture: nothing is drawn.
    pub(crate) seconds: Option<f32>,
    /// The box around the Gaussians of that time, capture space.
    pub(crate) bounds: Option<Bounds>,
    /// The typical extent of the Gaussians, the mean of the files, capture units.
    pub(crate) extent: f32,
}

impl StreamedPicture {
    /// Returns the time that is drawn of a capture, seconds since its start: that of its picture, if it is in chunk files and
    /// has one, else that of its playback. A capture that is not may have the picture of the one before, for a frame.
    pub(crate) fn drawn(picture: Option<&Self>, is_streamed: bool, playback: f32) -> f32 {
        picture.filter(|_| is_streamed).and_then(|picture| picture.seconds).unwrap_or(playback)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_a_picture_counts_while_playback_waits_for_files() {
        let held = StreamedPicture { seconds: Some(10.0), ..StreamedPicture::default() };
        assert_eq!(StreamedPicture::drawn(Some(&held), true, 95.0), 10.0, "the picture is still that of 10 s");
        assert_eq!(StreamedPicture::drawn(Some(&StreamedPicture::default()), true, 95.0), 95.0, "no picture yet");
        assert_eq!(StreamedPicture::drawn(None, false, 95.0), 95.0, "a whole capture");
        assert_eq!(
            StreamedPicture::drawn(Some(&held), false, 95.0),
            95.0,
            "a whole capture in place of the streamed one"
        );
    }
}
