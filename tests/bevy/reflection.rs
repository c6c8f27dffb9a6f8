//! Reflection and names: what scene files, animations and inspectors see of this crate, and what its prelude brings
//! into a game.
//!
//! In: the type registry of an app, the source of the plugin and of the prelude. Out: proof that every public component
//! and resource is registered, by a path that exists, and that names of the prelude are this crate's own. Needs neither
//! a GPU nor a window.

use bevy::ecs::reflect::ReflectResource;
use bevy::prelude::*;
use bevy::reflect::{TypePath, TypeRegistry};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// Returns, for public paths of types, each path and the path by which reflection knows the type.
macro_rules! paths {
    ($($path:ty),+ $(,)?) => {
        vec![$((stringify!($path).replace(' ', ""), <$path as TypePath>::type_path())),+]
    };
}

/// Returns the paths of the types that are registered.
fn reflected() -> Vec<(String, &'static str)> {
    paths![
        bevy_gs4d::GaussianCapture3d,
        bevy_gs4d::Upright,
        bevy_gs4d::UprightTurn,
        bevy_gs4d::asset::CaptureFailure,
        bevy_gs4d::asset::CaptureState,
        bevy_gs4d::inspector::Inspector,
        bevy_gs4d::pbr::CaptureContactShadow,
        bevy_gs4d::pbr::CaptureLight,
        bevy_gs4d::pbr::CastsShadows,
        bevy_gs4d::pbr::ReceivesShadows,
        bevy_gs4d::pbr::ShadowResolution,
        bevy_gs4d::picking_backend::CapturePickingCamera,
        bevy_gs4d::picking_backend::CapturePickingSettings,
        bevy_gs4d::playback::CaptureCollider,
        bevy_gs4d::playback::CaptureSocket,
        bevy_gs4d::playback::ClipFade,
        bevy_gs4d::playback::ClockSource,
        bevy_gs4d::playback::ColliderState,
        bevy_gs4d::playback::FollowsClock,
        bevy_gs4d::playback::Marker,
        bevy_gs4d::playback::Markers,
        bevy_gs4d::playback::Playback,
        bevy_gs4d::playback::PlaybackClock,
        bevy_gs4d::playback::Repeat,
        bevy_gs4d::playback::SocketState,
        bevy_gs4d::playback::TimelinePlayer,
        bevy_gs4d::playback::TimelineTrack,
        bevy_gs4d::render::CaptureBudget,
        bevy_gs4d::render::CaptureDetail,
        bevy_gs4d::render::CaptureSettings,
        bevy_gs4d::render::CaptureStatistics,
        bevy_gs4d::render::CaptureUploadBudget,
        bevy_gs4d::render::CaptureViewSettings,
        bevy_gs4d::render::CropBox,
        bevy_gs4d::render::DepthWrite,
        bevy_gs4d::renderer::Design,
        bevy_gs4d::sound::CaptureSound,
        bevy_gs4d::sound::SoundState,
        bevy_gs4d::sound::TimelineSound,
        bevy_gs4d::stereo::Eye,
        bevy_gs4d::stereo::SideBySide,
        bevy_gs4d::stereo::StereoRig,
        bevy_gs4d::stream::CaptureStreamSettings,
        bevy_gs4d::stream::CaptureStreamState,
        bevy_gs4d::stream::OnUnderrun,
        bevy_gs4d::stream::StreamBudget,
        bevy_gs4d::testing::FilmedPoint,
        bevy_gs4d::testing::Offscreen,
        bevy_gs4d::view::BlendSpace,
        bevy_gs4d::view::DebugView,
    ]
}

/// Returns the paths of types that have a path for Bevy's asset server and are not registered themselves.
fn named() -> Vec<(String, &'static str)> {
    paths![
        bevy_gs4d::asset::CaptureLoader,
        bevy_gs4d::asset::CaptureTransformer,
        bevy_gs4d::asset::GaussianCapture,
        bevy_gs4d::asset::PackageSaver,
        bevy_gs4d::asset::SoundLoader,
        bevy_gs4d::playback::Timeline,
        bevy_gs4d::playback::TimelineLoader,
        bevy_gs4d::sound::SoundTrack,
    ]
}

/// Calls a function with the registry of an app with all plugins that need no renderer.
fn with_registry<T>(look: impl FnOnce(&TypeRegistry) -> T) -> T {
    let mut app = App::new();
    app.add_plugins((MinimalPlugins, AssetPlugin::default(), bevy_gs4d::GaussianCapturePlugins));
    look(&app.world().resource::<AppTypeRegistry>().read())
}

#[test]
fn type_paths_are_the_public_paths() {
    for (path, known) in reflected().into_iter().chain(named()) {
        assert_eq!(known, path, "scene files and .meta files name a type by its public path");
    }
}

#[test]
fn registered_types_have_public_paths_alone() {
    let registered: Vec<&str> =
        with_registry(|registry| registry.iter().map(|known| known.type_info().type_path()).collect());
    let own = registered.iter().filter(|path| path.starts_with("bevy_gs4d::")).copied();
    let expected = reflected();
    let expected: BTreeSet<&str> = expected.iter().map(|(path, _)| path.as_str()).collect();
    assert_eq!(own.collect::<BTreeSet<&str>>(), expected, "the registered types of this crate");
    let private: Vec<_> = registered.iter().filter(|path| path.contains("bevy_gs4d::plugin::")).collect();
    assert!(private.is_empty(), "no path has a private module, also not in a generic type: {private:?}");
}

/// Returns the names of the public components or resources that a source defines, from its derives.
fn derived(source: &str, derive: &str) -> Vec<String> {
    let lines: Vec<&str> = source.lines().collect();
    let is_derived = |line: &str| {
        let list = line.strip_prefix("#[derive(").and_then(|rest| rest.strip_suffix(")]"));
        list.is_some_and(|list| list.split(", ").any(|name| name == derive))
    };
    let items = (0..lines.len()).filter(|line| is_derived(lines[*line])).filter_map(|line| {
        let item = lines[line..].iter().find(|line| !line.starts_with("#[") && !line.starts_with("//"))?;
        let item = item.strip_prefix("pub struct ").or(item.strip_prefix("pub enum "))?;
        item.split(|c: char| !c.is_alphanumeric()).next()
    });
    items.map(str::to_owned).collect()
}

/// Collects the public components or resources that the files below a folder define.
fn collect(folder: &Path, derive: &str, found: &mut Vec<String>) {
    for entry in fs::read_dir(folder).expect("the source can be listed") {
        let path = entry.expect("an entry can be read").path();
        if path.is_dir() {
            collect(&path, derive, found);
        } else {
            found.extend(derived(&fs::read_to_string(&path).expect("the source is text"), derive));
        }
    }
}

#[test]
fn every_public_component_and_resource_is_registered() {
    // State that both worlds share, and resources of the render world: no path of the crate leads to them.
    const OF_RENDERING: [&str; 3] = ["CaptureRenderer", "CheckedPipelines", "Uploads"];
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/plugin");
    for (derive, least) in [("Component", 20), ("Resource", 6)] {
        let mut defined = Vec::new();
        collect(&source, derive, &mut defined);
        defined.retain(|name| !OF_RENDERING.contains(&name.as_str()));
        assert!(defined.len() >= least, "the source defines at least {least}: {defined:?}");
        let missing: Vec<String> = with_registry(|registry| {
            let is_registered = |name: &String| {
                let end = format!("::{name}");
                let mut own = registry.iter().filter(|known| known.type_info().type_path().starts_with("bevy_gs4d::"));
                own.any(|known| {
                    let is_resource = derive != "Resource" || known.data::<ReflectResource>().is_some();
                    known.type_info().type_path().ends_with(&end)
                        && known.data::<ReflectComponent>().is_some()
                        && is_resource
                })
            };
            defined.into_iter().filter(|name| !is_registered(name)).collect()
        });
        assert_eq!(missing, [""; 0], "scenes, animations and inspectors know every {derive}");
    }
}

#[test]
fn names_of_the_prelude_are_those_of_this_crate() {
    let source = include_str!("../../src/prelude.rs");
    let exports = source.split("pub use ").skip(1).filter_map(|rest| rest.split(';').next());
    let names: Vec<&str> = exports
        .filter_map(|path| path.rsplit("::").next())
        .flat_map(|names| names.split(['{', '}', ',', '\n', ' ']).filter(|name| !name.is_empty()))
        .collect();
    assert!(names.len() > 20 && names.contains(&"GaussianCapturePlugins"), "the exports are read: {names:?}");
    let is_own =
        |name: &&str| *name == "Upright" || ["Capture", "Gaussian", "Playback"].iter().any(|own| name.starts_with(own));
    let others: Vec<_> = names.iter().filter(|name| !is_own(name)).collect();
    assert!(others.is_empty(), "a name that another prelude may have stays in its module: {others:?}");
}
