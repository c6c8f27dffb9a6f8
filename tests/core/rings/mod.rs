//! The rings: no module uses one that lies further out, and the files of a folder build on each other in one direction.
//!
//! In: the text of every file in `src/`. Out: proof that no path points outwards and none is part of a circle; a
//! failure lists those that do, with file and line.
//!
//! Comments and strings are ignored, unit tests are not. Uses without a path, such as calls of methods, are not found.

mod paths;
mod sources;

use sources::{Order, Sources};
use std::collections::BTreeSet;

/// The order of the rings.
const RINGS: &Order = &[
    ("view", &[]),
    ("gaussian", &["view"]),
    ("scene", &["view", "gaussian"]),
    ("codec", &["view", "gaussian", "scene"]),
    ("reference", &["view", "gaussian", "scene"]),
    ("renderer", &["view", "gaussian", "scene", "codec", "reference"]),
    ("offline", &["view", "gaussian", "scene", "codec", "reference", "renderer"]),
    ("plugin", &["view", "gaussian", "scene", "codec", "reference", "renderer"]),
    ("cli", &["view", "gaussian", "scene", "codec", "reference", "renderer", "offline"]),
];

/// The order inside the plugin.
const PLUGIN: &Order = &[
    ("component", &[]),
    ("asset", &["component"]),
    ("playback", &["component", "asset"]),
    ("render", &["component", "asset", "playback"]),
    ("picker", &["component", "asset", "playback", "render"]),
    ("pbr", &["component", "asset", "playback", "render"]),
    ("stereo", &["component", "asset", "playback", "render"]),
    ("picking_backend", &["component", "asset", "playback", "render", "picker"]),
    ("inspector", &["component", "asset", "playback", "render", "pbr", "picker", "stereo"]),
    ("testing", &["component", "asset", "playback", "render", "picker", "stereo"]),
];

#[test]
fn no_path_points_outwards() {
    let sources = Sources::of_this_crate();
    assert!(sources.uses().len() > 300, "the paths are found");
    let outward = sources.outward(RINGS, PLUGIN);
    assert!(outward.is_empty(), "{} paths point outwards:\n{}", outward.len(), outward.join("\n"));
}

#[test]
fn no_files_use_each_other_in_a_circle() {
    let sources = Sources::of_this_crate();
    let cycles = sources.cycles();
    assert!(cycles.is_empty(), "{} circles:\n{}", cycles.len(), cycles.join("\n"));
}

#[test]
fn every_folder_has_its_place() {
    let sources = Sources::of_this_crate();
    let folders = |depth: usize| sources.modules.keys().filter(move |module| module.len() > depth + 1);
    let rings: BTreeSet<&str> = folders(0).map(|module| module[0].as_str()).collect();
    let plugin = folders(1).filter(|module| module[0] == "plugin").map(|module| module[1].as_str());
    let names = |order: &Order| order.iter().map(|(name, _)| *name).collect::<BTreeSet<&str>>();
    assert_eq!(rings, names(RINGS), "every folder of src is a ring");
    assert_eq!(
        plugin.collect::<BTreeSet<&str>>(),
        names(PLUGIN),
        "every folder of the plugin has a place in its order"
    );
}

#[test]
fn outward_paths_and_cycles_are_found() {
    let sources = Sources::new([
        ("lib.rs", "pub mod view; pub mod scene; pub mod plugin; pub use plugin::*;"),
        ("view/mod.rs", "mod a; pub use a::A; use crate::scene;"),
        ("view/a.rs", "pub struct A;\nfn f() { crate::Root; super::super::scene::S }"),
        ("scene/mod.rs", "mod s; mod t; pub use s::S; pub use t::*;"),
        ("scene/s.rs", "use crate::view::A; use super::T; pub struct S;"),
        ("scene/t.rs", "pub struct T; mod tests { use super::super::S; use super::*; }"),
        ("plugin/mod.rs", "mod asset; mod component; pub use asset::Asset;"),
        ("plugin/asset.rs", "use super::component::C; pub struct Asset;"),
        ("plugin/component.rs", "use crate::Asset; pub struct C;"),
    ]);
    let outward = [
        "src/plugin/component.rs:1: crate::Asset leads to plugin::asset, which plugin::component may not use",
        "src/view/mod.rs:1: crate::scene leads to scene, which view may not use",
        "src/view/a.rs:2: crate::Root leads to the crate root, which view may not use",
        "src/view/a.rs:2: super::super::scene::S leads to scene, which view may not use",
    ];
    assert_eq!(sources.outward(RINGS, PLUGIN), outward, "the paths that point outwards");
    let cycles = [
        "src/plugin/asset.rs:1: super::component::C\nsrc/plugin/component.rs:1: crate::Asset\n",
        "src/scene/s.rs:1: crate::view::A\nsrc/view/a.rs:2: super::super::scene::S\n",
    ];
    assert_eq!(sources.cycles(), cycles, "the files that use each other");
}

#[test]
fn an_item_of_a_mod_file_can_be_part_of_a_circle_and_a_re_export_cannot() {
    let folder = |text: &'static str| {
        let child = "use super::Limit; use super::Other; pub struct A; mod tests { use super::super::b::B; }";
        let other = "use super::a::A; pub struct B; pub struct Other;";
        Sources::new([("view/mod.rs", text), ("view/a.rs", child), ("view/b.rs", other)])
    };
    let defining = folder("mod a; mod b; pub use a::A; pub use b::Other; use a::A as Own; pub struct Limit;");
    let circles = defining.cycles();
    let through_mod = "src/view/a.rs:1: super::Limit\nsrc/view/mod.rs:1: a::A\n";
    assert!(circles.contains(&through_mod.to_owned()), "mod.rs defines an item of a file that it uses: {circles:?}");
    let between = "src/view/a.rs:1: super::Other\nsrc/view/b.rs:1: super::a::A\n";
    assert!(circles.contains(&between.to_owned()), "a re-export leads to the file that defines the item: {circles:?}");
    let using = Sources::new([
        ("view/mod.rs", "mod a; pub use a::A; pub struct Limit(A);"),
        ("view/a.rs", "use super::Limit; pub struct A;"),
    ]);
    let own = "src/view/a.rs:1: super::Limit\nsrc/view/mod.rs:1: a::A\n";
    assert_eq!(using.cycles(), [own], "the code of mod.rs has the name that it re-exports");
    let exporting = Sources::new([
        ("view/mod.rs", "mod a; mod b; pub use a::A; pub use b::*; pub(crate) use b::B as C;"),
        ("view/a.rs", "use super::B; pub struct A; mod tests { use super::super::b::B; }"),
        ("view/b.rs", "pub struct B; mod tests { use super::super::A; }"),
    ]);
    assert_eq!(exporting.cycles(), [""; 0], "re-exports and unit tests make no circle");
}
