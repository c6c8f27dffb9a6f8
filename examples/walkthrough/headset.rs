//! A headset, with the feature `openxr`.
//!
//! In: an app without plugins, and Bevy's plugins. Out: the app with these plugins and, if there is a headset, a
//! tracked body and the eyes of the headset.

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

/// Adds the plugins; returns whether there is a headset.
#[cfg(not(feature = "openxr"))]
pub fn add_plugins(app: &mut App, plugins: PluginGroupBuilder) -> bool {
    app.add_plugins(plugins);
    false
}

/// Adds the plugins and the plugins of OpenXR; returns whether there is a headset.
#[cfg(feature = "openxr")]
pub fn add_plugins(app: &mut App, plugins: PluginGroupBuilder) -> bool {
    worn::add_plugins(app, plugins)
}

#[cfg(feature = "openxr")]
mod worn {
    use crate::body::{Body, Head, START};
    use crate::comfort::EyeView;
    use crate::eye_settings;
    use bevy::app::PluginGroupBuilder;
    use bevy::prelude::*;
    use bevy::render::pipelined_rendering::PipelinedRenderingPlugin;
    use bevy::winit::{UpdateMode, WinitSettings};
    use bevy_mod_openxr::add_xr_plugins;
    use bevy_mod_openxr::resources::OxrInstance;
    use bevy_mod_xr::camera::XrCamera;
    use bevy_mod_xr::session::XrTrackingRoot;

    pub fn add_plugins(app: &mut App, plugins: PluginGroupBuilder) -> bool {
        // Without pipelining, frames use the newest pose of the head.
        app.add_plugins(add_xr_plugins(plugins.disable::<PipelinedRenderingPlugin>()));
        let found = app.world().contains_resource::<OxrInstance>();
        if found {
            // The headset keeps drawing while another window has the focus.
            let always = UpdateMode::Continuous;
            app.insert_resource(WinitSettings { focused_mode: always, unfocused_mode: always })
                .add_systems(Startup, give_body)
                .add_systems(Update, give_eyes);
        } else {
            eprintln!("no OpenXR runtime or no headset: the window shows both eyes side by side");
        }
        found
    }

    /// Makes the tracking space of the headset the body, which walks and teleports.
    fn give_body(mut commands: Commands, root: Single<Entity, With<XrTrackingRoot>>) {
        commands.entity(*root).insert((Body::default(), START));
    }

    /// Inserts the eye settings into the headset's cameras, which already have lenses and poses.
    fn give_eyes(mut commands: Commands, eyes: Query<(Entity, &XrCamera), Added<XrCamera>>) {
        for (entity, camera) in &eyes {
            let mut eye = commands.entity(entity);
            eye.insert((EyeView(camera.0 as usize), eye_settings()));
            if camera.0 == 0 {
                eye.insert(Head);
            }
        }
    }
}
