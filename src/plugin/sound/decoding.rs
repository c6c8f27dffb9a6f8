//! The decoded sounds of captures.
//!
//! In: the sound files that captures carry. Out: the [`Sound`] of each, decoded once in a task, for as long as an
//! entity plays it.

use crate::codec::sound::{Sound, SoundError};
use crate::plugin::component::GaussianCapture;
use crate::scene::SoundFile;
use bevy::asset::AssetId;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::Res;
use bevy::log::warn;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// The sounds of captures that are played.
#[derive(Resource, Default)]
pub(super) struct DecodedSounds(HashMap<AssetId<GaussianCapture>, Decoded>);

/// The sound of a capture.
struct Decoded {
    file: Arc<SoundFile>,
    state: State,
}

enum State {
    Decoding(Task<Result<Sound, SoundError>>),
    /// `None`: it cannot be played.
    Done(Option<Sound>),
}

impl DecodedSounds {
    /// Returns the sound of a capture; `None` while it is decoded, and if it cannot be played.
    pub(super) fn get(&mut self, capture: AssetId<GaussianCapture>, file: &Arc<SoundFile>) -> Option<Sound> {
        let begin = || Decoded { file: file.clone(), state: State::Decoding(begin(file.clone())) };
        let decoded = self.0.entry(capture).or_insert_with(begin);
        if !Arc::ptr_eq(&decoded.file, file) {
            // The capture has been loaded again.
            *decoded = begin();
        }
        if let State::Decoding(task) = &mut decoded.state
            && let Some(outcome) = check_ready(task)
        {
            let refused = |error: &SoundError| warn!("the sound of the capture {capture} {error}");
            decoded.state = State::Done(outcome.inspect_err(refused).ok());
        }
        match &decoded.state {
            State::Decoding(_) => None,
            State::Done(sound) => sound.clone(),
        }
    }

    /// Drops the sounds of all other captures.
    pub(super) fn keep(&mut self, captures: &HashSet<AssetId<GaussianCapture>>) {
        self.0.retain(|capture, _| captures.contains(capture));
    }
}

/// Returns whether there are sounds of captures, so that those that no entity plays can be dropped.
pub(super) fn has_decoded_sounds(sounds: Res<DecodedSounds>) -> bool {
    !sounds.0.is_empty()
}

/// Begins to decode a sound file.
fn begin(file: Arc<SoundFile>) -> Task<Result<Sound, SoundError>> {
    AsyncComputeTaskPool::get().spawn(async move { decoded(&file) })
}

#[cfg(feature = "sound")]
fn decoded(file: &SoundFile) -> Result<Sound, SoundError> {
    crate::codec::sound::decode(file.bytes())
}

#[cfg(not(feature = "sound"))]
fn decoded(_: &SoundFile) -> Result<Sound, SoundError> {
    Err(SoundError::NotBuilt)
}
