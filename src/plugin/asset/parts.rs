//! The order of plugins: parts of [`GaussianCapturePlugins`](crate::GaussianCapturePlugins) that need loaded captures.
//!
//! In: the plugins of an app, in any order. Out: each part set up once, as soon as captures can be loaded, at the
//! latest when the app starts; warnings.

use super::plugin::CaptureAssetPlugin;
use super::uploads::Uploads;
use bevy::app::{App, Plugin};
use bevy::ecs::resource::Resource;
use bevy::log::warn;
use std::marker::PhantomData;

/// Says that a part has been set up.
#[derive(Resource)]
struct SetUp<P: Plugin>(PhantomData<fn() -> P>);

/// Sets up a part if captures can be loaded, once: for `Plugin::build`.
pub(crate) fn set_up<P: Plugin>(app: &mut App, add: fn(&mut App)) {
    let world = app.world();
    if world.contains_resource::<Uploads>() && !world.contains_resource::<SetUp<P>>() {
        app.insert_resource(SetUp::<P>(PhantomData));
        add(app);
    }
}

/// Sets up a part that could not be set up before, because Bevy's `AssetPlugin` was added later: for `Plugin::finish`.
/// Warns, with the name of the part, if the app has no [`CaptureAssetPlugin`].
pub(crate) fn set_up_late<P: Plugin>(app: &mut App, part: &str, add: fn(&mut App)) {
    set_up::<P>(app, add);
    if !app.is_plugin_added::<CaptureAssetPlugin>() {
        warn!(
            "{part} has no effect without CaptureAssetPlugin: add GaussianCapturePlugins with this part, or disable \
             {part}, too"
        );
    }
}
