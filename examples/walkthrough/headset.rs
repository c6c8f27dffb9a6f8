//! A headset, with the feature `openxr`.
//!
//! In: an app without plugins, and Bevy's. Out: the app with them and, if there is a headset, a body and eyes that are its wearer's.

use bevy::app::PluginGroupBuilder;
use bevy::prelude::*;

/// Adds the plugins; returns whether there is a headset.
#[cfg(not(feature = "openxr"))]
pub fn add_plugins(app: &mut App, plugins: PluginGroupBuilder) -> bool {
    app.add_plugins(plugins);
    false
}

/// Adds the plugins and those for OpenXR; returns whether there is a headset.
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
        // Without pipelining the pose of the head is the newest.
        app.add_plugins(add_xr_plugins(plugins.disable::<PipelinedRenderingPlugin>()));
        let found = app.world().contains_resource::<OxrInstance>();
        if found {
            // The headset keeps drawing while another window has the focus.
            let always = UpdateMode::Continuous;
            app.insert_resource(WinitSettings { focused_mode: always, unfocused_mode: always })
                .add_systems(Startup, give_body)
                .add_systems(Update, give_eyes);
        } else {
            eprintln!("no OpenXR runtime or no headset: both eyes go side by side into the window");
        }
        found
    }

    /// Makes the space that the headset is tracked in the body, which walks and teleports.
    fn give_body(mut commands: Commands, root: Single<Entity, With<XrTrackingRoot>>) {
        commands.entity(*root).insert((Body::default(), START));
    }

    /// Inserts the settings of eyes on the headset's cameras, which have lenses and poses already.
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
