//! The settings of the panel.
//!
//! In: fields that any system may set. Out: [`Inspector`], a resource that the panel reads and, on input, writes.

use bevy::ecs::entity::Entity;
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::input::keyboard::KeyCode;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// The settings of the panel: a resource. Any field may be set at any time.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::inspector::Inspector;
///
/// fn setup(mut inspector: ResMut<Inspector>) {
///     inspector.open = false;
///     inspector.key = KeyCode::KeyI;
///     inspector.note = "I opens the inspector".into();
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Resource, Reflect, Debug, Clone, PartialEq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::inspector"]
pub struct Inspector {
    /// Whether the panel is drawn. While it is closed, only [`warnings`](Self::warnings) are updated. Default: true.
    pub open: bool,
    /// The key that closes and opens the panel. Default: F1.
    pub key: KeyCode,
    /// The entity whose capture is shown; the first capture if `None`, or if the entity has none. Default: `None`.
    pub selected: Option<Entity>,
    /// The camera whose view is shown; the first if `None`, or if the entity is no `Camera3d`. Default: `None`.
    pub camera: Option<Entity>,
    /// Frame rate of the step buttons, in frames per second. Default: 30.
    pub fps: f32,
    /// A line of text at the end of the panel. Default: empty, which draws no line.
    pub note: String,
    /// The warnings at the top of the panel. Written at the end of each update in which they change, also while the
    /// panel is closed. Default: empty.
    pub warnings: Vec<String>,
}

impl Default for Inspector {
    fn default() -> Self {
        let (note, warnings) = (String::new(), Vec::new());
        Self { open: true, key: KeyCode::F1, selected: None, camera: None, fps: 30.0, note, warnings }
    }
}
