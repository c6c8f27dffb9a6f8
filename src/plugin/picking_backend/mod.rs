//! Pointer events on captures: a backend of Bevy's `bevy_picking`.
//!
//! In: the rays of pointers through cameras, and the captures that those cameras see. Out: `PointerHits`, from which
//! Bevy makes `On<Pointer<Click>>`, `Over`, `Out`, `Drag` and the other events, on captures as on meshes.
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
//! App::new().add_plugins((DefaultPlugins, GaussianCapturePlugins)).add_systems(Startup, setup).run();
//! ```
//!
//! A pointer hits the same Gaussian as [`CapturePicker`](crate::picker::CapturePicker): the one at which half of the
//! light along the ray is absorbed, of those that are not too near for the camera to draw them. The depth of a hit is
//! its distance along the ray in world units, as in Bevy's mesh picking. With Bevy's `MeshPickingPlugin`, meshes in
//! front of a capture take its events, and captures in front of a mesh take the events of the mesh. The position of a
//! hit is its point in world space, it has no normal, and its extra data is the
//! [`CaptureHit`](crate::picker::CaptureHit).
//!
//! `Pickable` on a capture has its usual meaning: `Pickable::IGNORE` lets pointers through. Four kinds of captures are
//! not hit: hidden ones, ones that no camera sees, ones on other `RenderLayers`, and ones that are not
//! [ready](crate::asset::CaptureState::Ready). If several cameras draw into one target, hits of the camera with the
//! highest order come first.
//!
//! Each frame, every pointer casts one ray per camera under it. Each ray is tested on the CPU against every Gaussian of
//! each capture whose box it meets, unless neither the ray nor these captures have changed. Captures of at most 16,384
//! Gaussians together are tested in the same frame. Larger ones are tested in Bevy's `AsyncComputeTaskPool`, the newest
//! ray first: no frame waits for a test, and events then follow the pointer one or more frames late. If this costs too
//! much, [`CapturePickingSettings`] restricts picking to marked captures and cameras.

mod backend;
mod plugin;
mod searches;
mod settings;

pub use plugin::CapturePickingPlugin;
pub use settings::{CapturePickingCamera, CapturePickingSettings};
