//! The window of an app without a window.
//!
//! In: cameras whose target is the primary window. Out: a primary window that no display shows, as large as the
//! [`Offscreen`]; and the [`Offscreen`] as the target of these cameras from the end of each update, when the frame is
//! extracted and drawn, to the start of the next update.
//!
//! During an update these cameras have the window as their target. Bevy draws a user interface with the last camera of
//! the window by default, and sends pointer events to the cameras of the window.

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

/// The cameras that currently draw into a picture instead of the window: each with its own target and the picture.
#[derive(Resource, Default)]
struct Lent(Vec<(Entity, RenderTarget, AssetId<Image>)>);

/// Adds a window, unless the game has added one, and the systems that make its cameras draw into the [`Offscreen`].
pub(super) fn add_window(app: &mut App, offscreen: &Offscreen) {
    let world = app.world_mut();
    let is_there = world.query_filtered::<Entity, With<PrimaryWindow>>().iter(world).next().is_some();
    if !is_there {
        let resolution = WindowResolution::new(offscreen.size.x, offscreen.size.y);
        world.spawn((Window { resolution, ..Window::default() }, PrimaryWindow));
    }
    app.init_resource::<Lent>()
        .add_systems(First, restore)
        .add_systems(PostUpdate, fit_window.run_if(resource_exists::<Offscreen>).before(CameraUpdateSystems))
        .add_systems(Last, lend.run_if(resource_exists::<Offscreen>));
}

/// Resizes the window to the size of the picture, also after the game has resized it, and sends [`WindowResized`].
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

/// Sets the picture as the target of the window's cameras, bypassing change detection: the game changed nothing.
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

/// Restores the cameras' own targets, except where the game has set another target since.
fn restore(mut targets: Query<&mut RenderTarget>, mut lent: ResMut<Lent>) {
    for (camera, own, picture) in lent.0.drain(..) {
        if let Ok(mut target) = targets.get_mut(camera)
            && target.as_image().map(Handle::id) == Some(picture)
        {
            *target.bypass_change_detection() = own;
        }
    }
}
