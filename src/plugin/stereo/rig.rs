//! The rig: a head, its eyes, and where they draw.
//!
//! In: the distance between the eyes and their targets. Out: three entities.

use bevy::camera::visibility::Visibility;
use bevy::camera::{Camera, Camera3d, RenderTarget};
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::system::Commands;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;

/// A head. Its children with an [`Eye`] are kept beside its middle; its own transform is the game's.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[require(Transform, Visibility)]
pub struct StereoRig {
    /// Distance between the eyes in units of the world, which for a true sense of size are metres. 0 shows both eyes the same; what
    /// is no finite number leaves the eyes where they are.
    pub ipd: f32,
}

impl Default for StereoRig {
    /// 64 mm, the mean of adults.
    fn default() -> Self {
        Self { ipd: 0.064 }
    }
}

/// Which eye a camera is.
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Component, Debug, Clone, PartialEq, Hash)]
#[require(Camera3d)]
pub enum Eye {
    /// On the head's −x side.
    Left,
    /// On the head's +x side.
    Right,
}

impl Eye {
    /// Both, the left one first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// −1 for the left, +1 for the right: times half the distance, where it is on the head's x axis.
    pub fn side(self) -> f32 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }
}

/// On an eye: it draws into its half of the target, the left eye into the left one, whatever the target's size becomes. Where the
/// width is odd, the column in the middle is nobody's.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
pub struct SideBySide;

/// Where the eyes draw.
#[derive(Debug, Clone)]
pub enum EyeTargets {
    /// Both into one target, each into its half.
    SideBySide(RenderTarget),
    /// Each into a target of its own, the left eye first.
    Separate([RenderTarget; 2]),
}

/// What [`spawn_stereo`] has spawned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stereo {
    /// The entity with the [`StereoRig`]; insert its transform, or make it a child.
    pub head: Entity,
    /// The eyes' cameras, the left one first; insert what cameras have, the same for both.
    pub eyes: [Entity; 2],
}

/// Spawns a head with two eyes. The left one is drawn first: its camera has the order 0, the right one's 1.
///
/// [`StereoPlugin`](super::StereoPlugin) keeps them in their places.
pub fn spawn_stereo(commands: &mut Commands, rig: StereoRig, targets: EyeTargets) -> Stereo {
    let head = commands.spawn(rig).id();
    let (targets, halved) = match targets {
        EyeTargets::SideBySide(target) => ([target.clone(), target], true),
        EyeTargets::Separate(targets) => (targets, false),
    };
    let [left, right] = targets;
    let mut spawn = |eye: Eye, order: isize, target: RenderTarget| {
        let camera = Camera { order, ..Camera::default() };
        let mut spawned = commands.spawn((eye, camera, target, ChildOf(head)));
        if halved {
            spawned.insert(SideBySide);
        }
        spawned.id()
    };
    let eyes = [spawn(Eye::Left, 0, left), spawn(Eye::Right, 1, right)];
    Stereo { head, eyes }
}
