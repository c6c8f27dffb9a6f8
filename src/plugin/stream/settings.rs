//! The settings of streaming.
//!
//! In: values that a game sets. Out: [`StreamBudget`], a resource for all captures together, and
//! [`CaptureStreamSettings`], a component of one.

use bevy::ecs::component::Component;
use bevy::ecs::reflect::{ReflectComponent, ReflectResource};
use bevy::ecs::resource::Resource;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// What all captures in chunk files together may take: a resource.
///
/// Several captures share the memory on the GPU by how near they are to a camera: the share of a capture at twice the
/// distance is half as large. A capture that no camera sees counts as 16 times as far away.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::stream::StreamBudget;
///
/// let mut app = App::new();
/// app.add_plugins((MinimalPlugins, AssetPlugin::default(), GaussianCapturePlugins));
/// // For a phone: 256 MiB, and two files at once.
/// app.insert_resource(StreamBudget { gpu_bytes: 256 << 20, requests: 2, ..default() });
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stream"]
pub struct StreamBudget {
    /// Bytes of Gaussians on the GPU, those on their way included, in whole pages of 256 Gaussians for each file. While the
    /// share of a capture changes, its buffers of before exist as well. Default: 1 GiB.
    pub gpu_bytes: u64,
    /// Bytes in memory of files on their way to the GPU: the files, and their Gaussians. A file that alone is larger
    /// is loaded while no other is. Default: 512 MiB.
    pub host_bytes: u64,
    /// Files on their way at once. Each capture with something to load has one, as far as they go, and that with the
    /// largest share of the memory the rest. Default: 4.
    pub requests: u32,
    /// How far ahead of what is played files are loaded, seconds of playing, at most 600. Default: 10.
    pub ahead_seconds: f32,
}

impl Default for StreamBudget {
    fn default() -> Self {
        Self { gpu_bytes: 1 << 30, host_bytes: 512 << 20, requests: 4, ahead_seconds: 10.0 }
    }
}

/// How a capture in chunk files is streamed: an optional component next to
/// [`GaussianCapture3d`](crate::GaussianCapture3d). Without it the defaults apply.
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stream"]
pub struct CaptureStreamSettings {
    /// What is drawn while the most important Gaussians of a time are not there. Default: [`OnUnderrun::Coarse`].
    pub on_underrun: OnUnderrun,
    /// Times to which the game may jump, seconds since the capture's start: what they need is loaded right after what
    /// is drawn now, and kept as long as there is room for both. Default: none.
    pub preload: Vec<f32>,
}

/// What is drawn while the most important Gaussians of a time are not there.
///
/// Before the first picture, playback waits in each case.
#[derive(Reflect, Debug, Default, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stream"]
#[non_exhaustive]
pub enum OnUnderrun {
    /// Playback waits, and the last picture stays. The timeline of a track that shows a clip waits with it, also before
    /// the first picture of the clip, unless the timeline follows a clock, or a file cannot be read or does not fit.
    Stall,
    /// The last picture stays, and time passes.
    Hold,
    /// What is there is drawn, and time passes.
    #[default]
    Coarse,
}
