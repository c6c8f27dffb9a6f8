//! The asset type of sounds.
//!
//! In: a decoded [`Sound`]. Out: a [`SoundTrack`] that timelines share.

use crate::codec::sound::Sound;
use bevy::asset::Asset;
use bevy::reflect::TypePath;

/// A decoded sound as an asset: what a [timeline](crate::playback::SoundClip) plays beside its captures.
///
/// Bevy's `AudioSource` is a file that is decoded from its beginning while it plays. A timeline seeks, loops and plays
/// backwards, so that all samples of its sounds are in memory, two bytes each.
///
/// With the feature `sound`, `AssetServer::load` reads Ogg Vorbis and WAV. Sounds of other formats that a game decodes,
/// or samples that it makes, become a track by [`Sound::new`].
///
/// # Examples
///
/// ```
/// use bevy_gs4d::codec::sound::Sound;
/// use bevy_gs4d::sound::SoundTrack;
///
/// // A second of a tone of 480 Hz, one channel.
/// let wave = |frame: u32| ((frame % 100) as i16 - 50) * 200;
/// let track = SoundTrack(Sound::new(48_000, 1, (0..48_000).map(wave).collect::<Vec<_>>())?);
/// assert_eq!(track.0.seconds(), 1.0, "as long as its frames");
/// // `assets.add(track)`, with `assets: ResMut<Assets<SoundTrack>>`, returns a handle for a timeline.
/// # Ok::<(), bevy_gs4d::codec::sound::SoundError>(())
/// ```
#[derive(Asset, TypePath, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::sound"]
pub struct SoundTrack(pub Sound);
