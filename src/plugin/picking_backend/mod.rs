//! Pointer events on captures: a backend of Bevy's `bevy_picking`.
//!
//! In: the rays of pointers through cameras, and the captures that those cameras see. Out: `PointerHits`, from which Bevy makes
//! `On<Pointer<Click>>`, `Over`, `Out`, `Drag` and the others, on captures as on meshes.
//!
//! ```no_run
//! use bevy::prelude::*;
//! use bevy_gs4d::prelude::*;
//!
//! fn setup(mut commands: Commands, assets: Res<AssetServer>) {
//!     commands.spawn(GaussianCapture3d(assets.load("toybox.gs4d"))).observe(
//!         |click: On<Pointer<Click>>, mut players: Query<&mut Playback>| {
//!             if let Ok(mut playback) = players.get_mut(click.entity) {
//!                 playback.toggle();
//!             }
//!         },
//!     );
//!     commands.spawn((Camera3d::default(), Transform::from_xyz(0.0, 1.0, 4.0)));
//! }
//!
//! App::new().add_plugins((DefaultPlugins, GaussianCapturePlugin)).add_systems(Startup, setup).run();
//! ```
//!
//! A pointer hits what [`CapturePicker`](crate::picker::CapturePicker) hits: the Gaussian at which half of the light along the ray is
//! absorbed. The depth of a hit is its distance along the ray, in world units, as that of Bevy's mesh picking: with Bevy's
//! `MeshPickingPlugin` meshes in front of a capture take its events, and captures in front of a mesh take those of the mesh. The position is the
//! point in the world; there is no normal; the extra data is the [`CaptureHit`](crate::picker::CaptureHit).
//!
//! `Pickable` on a capture has its usual meaning: `Pickable::IGNORE` lets pointers through. Hidden captures, those that no camera sees,
//! those on other `RenderLayers`, and those that are not [ready](crate::asset::CaptureState::Ready) are not hit. Of several cameras in one
//! target, what the one with the highest order sees comes first.
//!
//! Each frame, every pointer casts one ray for each camera that it is over, on the CPU, at each capture whose box the ray meets. Where that is
//! too much, let only some captures and cameras take part: [`CapturePickingSettings`].

mod backend;
mod plugin;
mod settings;

pub(crate) use plugin::CapturePickingPlugin;
pub use settings::{CapturePickingCamera, CapturePickingSettings};
