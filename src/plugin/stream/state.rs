//! How far the streaming of an entity's capture is.
//!
//! In: the schedule of the capture's files. Out: [`CaptureStreamState`], a component that games read.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// How far the streaming of an entity's capture is: on every entity whose capture is in chunk files. Setting it has no
/// effect.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::stream::CaptureStreamState;
///
/// /// A run condition: whether every capture is drawn with all of its Gaussians.
/// fn all_fine(states: Query<&CaptureStreamState>) -> bool {
///     states.iter().all(|state| state.is_whole())
/// }
/// # bevy::ecs::system::assert_is_system(all_fine);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stream"]
#[non_exhaustive]
pub struct CaptureStreamState {
    /// The time that is drawn, seconds since the capture's start: that of the playback, or that of the last picture
    /// while it stays. `None` before the first picture.
    pub seconds: Option<f32>,
    /// Files that have Gaussians of the playback's time.
    pub needed: usize,
    /// Those of them that are there.
    pub resident: usize,
    /// The share of the Gaussians of those files that is there, 0 to 1.
    pub share: f32,
    /// Whether the most important Gaussians of the playback's time are there.
    pub is_coarse: bool,
    /// Files of the playback's time that could not be loaded, and are asked for again in a few seconds.
    pub retries: usize,
    /// Seconds of playing, from the playback's time on, whose most important Gaussians are there.
    pub buffered_seconds: f32,
    /// Files of the capture on their way.
    pub requests: usize,
    /// Bytes of the capture's Gaussians on the GPU, those on their way included.
    pub gpu_bytes: u64,
    /// Bytes in memory of files on their way.
    pub host_bytes: u64,
    /// Files that could not be loaded, every try counted.
    pub failures: u64,
}

impl CaptureStreamState {
    /// Returns whether all Gaussians of the playback's time are there. `false` before the index of the capture has been
    /// loaded.
    pub fn is_whole(&self) -> bool {
        self.is_coarse && self.resident == self.needed
    }
}
