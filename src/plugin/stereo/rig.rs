//! The rig: a head, its eyes, and their targets.
//!
//! In: the distance between the eyes, and their targets. Out: three entities.

use bevy::camera::visibility::Visibility;
use bevy::camera::{Camera, Camera3d, RenderTarget};
use bevy::ecs::component::Component;
use bevy::ecs::entity::Entity;
use bevy::ecs::hierarchy::ChildOf;
use bevy::ecs::lifecycle::HookContext;
use bevy::ecs::reflect::ReflectComponent;
use bevy::ecs::system::Commands;
use bevy::ecs::template::FromTemplate;
use bevy::ecs::world::DeferredWorld;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::transform::components::Transform;

/// A head. [`StereoPlugin`](super::StereoPlugin) places its children with an [`Eye`] on both sides of it; the game sets
/// the transform of the head.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::stereo::StereoRig;
///
/// fn widen(mut rig: Single<&mut StereoRig>) {
///     rig.ipd = 0.070;
/// }
/// # bevy::ecs::system::assert_is_system(widen);
/// ```
#[derive(Component, Reflect, Debug, Clone, Copy, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stereo"]
#[require(Transform, Visibility)]
pub struct StereoRig {
    /// Distance between the eyes in world units, which are meters for a true sense of size. With 0 both eyes see the
    /// same picture; a value that is not finite does not move the eyes. Default: 0.064, the mean of adults.
    pub ipd: f32,
}

impl Default for StereoRig {
    fn default() -> Self {
        Self { ipd: 0.064 }
    }
}

/// The eye that a camera draws for. In Bevy's scene notation the left eye is the default.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::stereo::Eye;
/// use bevy_gs4d::view::DebugView;
///
/// /// Shows the depth view only to the right eye.
/// fn setup(eyes: Query<(Entity, &Eye)>, mut commands: Commands) {
///     for (camera, eye) in &eyes {
///         let debug = match eye {
///             Eye::Left => DebugView::Color,
///             Eye::Right => DebugView::Depth,
///         };
///         commands.entity(camera).insert(CaptureViewSettings { debug, ..default() });
///     }
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// assert_eq!(Eye::BOTH.map(Eye::side), [-1.0, 1.0], "left and right of the head");
/// ```
#[derive(Component, FromTemplate, Reflect, Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[reflect(Component, Debug, Clone, PartialEq, Hash)]
#[type_path = "bevy_gs4d::stereo"]
#[require(Camera3d)]
pub enum Eye {
    /// On the head's −x side.
    #[default]
    Left,
    /// On the head's +x side.
    Right,
}

impl Eye {
    /// Both eyes, the left one first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];

    /// Returns −1 for the left eye and +1 for the right eye: its position on the head's x axis, in halves of the
    /// distance between the eyes.
    pub fn side(self) -> f32 {
        match self {
            Self::Left => -1.0,
            Self::Right => 1.0,
        }
    }
}

/// Makes an eye draw into its half of the target, the left eye into the left half, and follow the target's size. If the
/// width is odd, neither eye draws the column in the middle. Removing it gives the eye its whole target again.
#[derive(Component, Reflect, Debug, Default, Clone, Copy, PartialEq, Eq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::stereo"]
#[component(on_remove = reset_viewport)]
pub struct SideBySide;

/// Takes the half of the target from an eye.
fn reset_viewport(mut world: DeferredWorld<'_>, context: HookContext) {
    if let Some(mut camera) = world.get_mut::<Camera>(context.entity) {
        camera.viewport = None;
    }
}

/// The targets that the eyes draw into.
///
/// # Examples
///
/// ```
/// use bevy::camera::RenderTarget;
/// use bevy::prelude::*;
/// use bevy::render::render_resource::TextureFormat;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::stereo::{EyeTargets, StereoRig, spawn_stereo};
///
/// fn setup(mut commands: Commands, mut images: ResMut<Assets<Image>>) {
///     let mut picture = || {
///         let image = Image::new_target_texture(512, 512, TextureFormat::Rgba8UnormSrgb, None);
///         RenderTarget::Image(images.add(image).into())
///     };
///     let targets = EyeTargets::Separate([picture(), picture()]);
///     spawn_stereo(&mut commands, StereoRig::default(), targets);
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Debug, Clone)]
pub enum EyeTargets {
    /// Both eyes draw into one target, each into its half.
    SideBySide(RenderTarget),
    /// Each eye draws into its own target; the left eye's target comes first.
    Separate([RenderTarget; 2]),
}

/// The entities that [`spawn_stereo`] has spawned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stereo {
    /// The entity with the [`StereoRig`]. Set its transform, or make it a child of another entity.
    pub head: Entity,
    /// The cameras of the eyes, the left one first. Insert further camera components into both eyes.
    pub eyes: [Entity; 2],
}

/// Spawns a head with two eyes, and returns their entities. The left eye is drawn first: its camera has the order 0,
/// the right camera the order 1.
///
/// [`StereoPlugin`](super::StereoPlugin) keeps the eyes at their positions.
///
/// # Examples
///
/// ```
/// use bevy::camera::RenderTarget;
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
/// use bevy_gs4d::stereo::{EyeTargets, StereoRig, spawn_stereo};
///
/// fn setup(mut commands: Commands) {
///     // Side by side in the primary window.
///     let window = EyeTargets::SideBySide(RenderTarget::default());
///     let stereo = spawn_stereo(&mut commands, StereoRig::default(), window);
///     commands.entity(stereo.head).insert(Transform::from_xyz(0.0, 1.6, 3.0));
///     for eye in stereo.eyes {
///         commands.entity(eye).insert(Msaa::Off);
///     }
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
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
