//! The window of an app without a window.
//!
//! In: cameras whose target is the primary window. Out: a primary window that no display shows, as large as the [`Offscreen`], and that
//! picture as these cameras' target from the end of each update, when the frame is extracted and drawn, to the start of the next.
//!
//! To everything that runs in between they are cameras of the window. Bevy draws a user interface with the last of those unless told
//! otherwise, and sends the pointer's events to them.

use super::offscreen::Offscreen;
use bevy::app::{App, First, Last, PostUpdate};
use bevy::asset::{AssetId, Handle};
use bevy::camera::{CameraUpdateSystems, RenderTarget};
use bevy::ecs::change_detection::DetectChangesMut;
use bevy::ecs::entity::Entity;
use bevy::ecs::message::Messages;
use bevy::ecs::query::With;
use bevy::ecs::resource::Resource;
use bevy::ecs::schedule::IntoScheduleConfigs;
use bevy::ecs::schedule::common_conditions::resource_exists;
use bevy::ecs::system::{Query, Res, ResMut};
use bevy::image::Image;
use bevy::window::{PrimaryWindow, Window, WindowRef, WindowResized, WindowResolution};

/// The cameras that draw into a picture instead of the window, with their own targets and the picture.
#[derive(Resource, Default)]
struct Lent(Vec<(Entity, RenderTarget, AssetId<Image>)>);

/// Adds the window, unless the game's own plugins have added one, and the systems that draw its cameras into the [`Offscreen`].
pub(super) fn add_window(app: &mut App, offscreen: &Offscreen) {
    let world = app.world_mut();
    let is_there = world.query_filtered::<Entity, With<PrimaryWindow>>().iter(world).next().is_some();
    if !is_there {
        let resolution = WindowResolution::new(offscreen.size.x, offscreen.size.y);
        world.spawn((Window { resolution, ..Window::default() }, PrimaryWindow));
    }
    app.init_resource::<Lent>()
        .add_systems(First, give_back)
        .add_systems(PostUpdate, fit_window.run_if(resource_exists::<Offscreen>).before(CameraUpdateSystems))
        .add_systems(Last, lend.run_if(resource_exists::<Offscreen>));
}

/// Makes the window as large as the picture, whatever the game sets, and says so as a display would.
fn fit_window(
    offscreen: Res<Offscreen>,
    mut windows: Query<(Entity, &mut Window), With<PrimaryWindow>>,
    mut resized: Option<ResMut<Messages<WindowResized>>>,
) {
    let size = offscreen.size;
    for (entity, mut window) in &mut windows {
        if window.physical_size() == size {
            continue;
        }
        window.resolution.set_physical_resolution(size.x, size.y);
        if let Some(resized) = &mut resized {
            resized.write(WindowResized { window: entity, width: window.width(), height: window.height() });
        }
    }
}

/// Gives the cameras of the window the picture as their target. No change is marked: the game has made none.
fn lend(
    offscreen: Res<Offscreen>,
    windows: Query<(), With<PrimaryWindow>>,
    mut targets: Query<(Entity, &mut RenderTarget)>,
    mut lent: ResMut<Lent>,
) {
    for (camera, mut target) in &mut targets {
        let in_window = match &*target {
            RenderTarget::Window(WindowRef::Primary) => true,
            RenderTarget::Window(WindowRef::Entity(window)) => windows.contains(*window),
            RenderTarget::Image(_) | RenderTarget::TextureView(_) | RenderTarget::None { .. } => false,
        };
        if in_window {
            let own = std::mem::replace(target.bypass_change_detection(), offscreen.target());
            lent.0.push((camera, own, offscreen.image.id()));
        }
    }
}

/// Gives the cameras their own targets back, but for those that have been given another one since.
fn give_back(mut targets: Query<&mut RenderTarget>, mut lent: ResMut<Lent>) {
    for (camera, own, picture) in lent.0.drain(..) {
        if let Ok(mut target) = targets.get_mut(camera)
            && target.as_image().map(Handle::id) == Some(picture)
        {
            *target.bypass_change_detection() = own;
        }
    }
}
