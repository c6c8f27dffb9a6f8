//! The rings: no module uses a module that lies further out, and neither files nor folders use each other in a cycle.
//!
//! In: the text of every file in `src/`. Out: proof that no path points outwards and that no paths form a cycle; a
//! failure lists such paths with file and line.
//!
//! A path is a use of the file that defines its item, behind all imports and re-exports. A `mod.rs` is treated as every
//! other file, except that its `mod` items, and re-exports of its children that its code does not use, are not uses.
//! Unit tests are read; comments and strings are ignored. Uses without a path, such as calls of methods, are not found.

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
    ("sound", &["component", "asset", "playback"]),
    ("stream", &["component", "asset", "playback", "render"]),
    ("picker", &["component", "asset", "playback", "render"]),
    ("pbr", &["component", "asset", "playback", "render", "stream"]),
    ("stereo", &["component", "asset", "playback", "render"]),
    ("picking_backend", &["component", "asset", "playback", "render", "picker"]),
    ("inspector", &["component", "asset", "playback", "render", "stream", "pbr", "picker", "stereo"]),
    ("testing", &["component", "asset", "playback", "render", "stream", "picker", "stereo"]),
];

#[test]
fn no_path_points_outwards() {
    let sources = Sources::of_this_crate();
    assert!(sources.uses().len() > 300, "more than 300 paths are found");
    let outward = sources.outward(RINGS, PLUGIN);
    assert!(outward.is_empty(), "{} paths point outwards:\n{}", outward.len(), outward.join("\n"));
}

#[test]
fn no_files_use_each_other_in_a_cycle() {
    let cycles = Sources::of_this_crate().cycles();
    assert!(cycles.is_empty(), "src has {} cycles:\n{}", cycles.len(), cycles.join("\n"));
}

#[test]
fn no_folders_use_each_other_in_a_circle() {
    let cycles = Sources::of_this_crate().folder_cycles();
    assert!(cycles.is_empty(), "the folders of src have {} circles:\n{}", cycles.len(), cycles.join("\n"));
}

#[test]
fn every_folder_has_a_place_in_the_order() {
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
        "src/scene/s.rs:1: super::T\nsrc/scene/t.rs:1: super::super::S\n",
    ];
    assert_eq!(sources.cycles(), cycles, "the files that use each other");
}

/// Returns the cycles among files.
fn cycles(files: &[(&str, &str)]) -> Vec<String> {
    Sources::new(files.iter().copied()).cycles()
}

#[test]
fn folders_of_one_parent_that_use_each_other_are_a_circle() {
    let files = [
        ("lib.rs", "mod a;"),
        ("a/mod.rs", "mod b; mod c; mod d; use b::x::X;"),
        ("a/b/mod.rs", "mod x;"),
        ("a/b/x.rs", "use crate::a::c::y::Y; pub struct X;"),
        ("a/c/mod.rs", "mod y; mod z;"),
        ("a/c/y.rs", "pub struct Y;"),
        ("a/c/z.rs", "use crate::a::d::W;"),
        ("a/d.rs", "use super::b::x::X; pub struct W;"),
    ];
    let none = Sources::new(files).folder_cycles();
    assert_eq!(none, [""; 0], "a file between two folders, and a parent that uses its child, are no circle of folders");
    let back = [("a/c/z.rs", "use crate::a::b::x::X;")];
    let found = Sources::new(files.into_iter().filter(|(file, _)| *file != "a/c/z.rs").chain(back)).folder_cycles();
    let steps = "src/a/b/x.rs:1: crate::a::c::y::Y\nsrc/a/c/z.rs:1: crate::a::b::x::X\n";
    assert_eq!(found, [steps], "no two files use each other, but their folders do");
}

#[test]
fn a_file_and_a_mod_that_use_each_other_are_a_cycle() {
    let own = ("a/b.rs", "use super::LIMIT; pub struct B;");
    let found = cycles(&[("a/mod.rs", "mod b; pub use b::B;\nconst LIMIT: u8 = 1; fn f() { b::g() }"), own]);
    assert_eq!(found, ["src/a/b.rs:1: super::LIMIT\nsrc/a/mod.rs:2: b::g\n"], "mod.rs calls a function of its child");
    let found = cycles(&[("a/mod.rs", "mod b;\nuse b::B;\nconst LIMIT: u8 = 1;"), own]);
    assert_eq!(found, ["src/a/b.rs:1: super::LIMIT\nsrc/a/mod.rs:2: b::B\n"], "mod.rs imports an item of its child");
    let found = cycles(&[("a/mod.rs", "mod b;\npub use b::B;\nconst LIMIT: u8 = 1; fn f(_: B) {}"), own]);
    assert_eq!(found, ["src/a/b.rs:1: super::LIMIT\nsrc/a/mod.rs:2: b::B\n"], "mod.rs uses a type that it re-exports");
    let found = cycles(&[("a/mod.rs", "mod b;\npub use b::*;\nconst LIMIT: u8 = 1; fn f(_: B) {}"), own]);
    assert_eq!(found, ["src/a/b.rs:1: super::LIMIT\nsrc/a/mod.rs:2: b::*\n"], "mod.rs uses a type of a glob");
    let through = ("a/c.rs", "use super::b::B;");
    let found = cycles(&[("a/mod.rs", "mod b; mod c; const LIMIT: u8 = 1;\nfn f() { c::g() }"), own, through]);
    let steps = "src/a/b.rs:1: super::LIMIT\nsrc/a/c.rs:1: super::b::B\nsrc/a/mod.rs:2: c::g\n";
    assert_eq!(found, [steps], "mod.rs uses the file through another file");
}

#[test]
fn declarations_and_reexports_of_a_mod_are_not_uses() {
    let child = ("a/b.rs", "use super::LIMIT; pub struct B;");
    let found = cycles(&[("a/mod.rs", "mod b; pub use b::B; pub(crate) use b::*; const LIMIT: u8 = 1;"), child]);
    assert_eq!(found, [""; 0], "mod.rs only re-exports its child");
    let found = cycles(&[
        ("a/mod.rs", "mod b; mod c; pub use c::LIMIT; fn f() { b::g() }"),
        child,
        ("a/c.rs", "pub const LIMIT: u8 = 1;"),
    ]);
    assert_eq!(found, [""; 0], "the item is defined in another child");
    let sibling =
        [("a/mod.rs", "pub mod b;\npub use super::c::D; const E: u8 = 1;"), ("c.rs", "use crate::a::E; pub struct D;")];
    let steps = "src/a/mod.rs:2: super::c::D\nsrc/c.rs:1: crate::a::E\n";
    assert_eq!(cycles(&sibling), [steps], "a re-export of a file that is not below mod.rs is a use");
}

#[test]
fn paths_that_begin_with_an_imported_name_lead_to_the_item() {
    let folder = [("a/mod.rs", "mod b; mod c; pub use b::B; fn f() { c::g() }"), ("a/b.rs", "pub struct B;")];
    let use_of_child = ("a/c.rs", "use crate::a; fn g() -> a::B {}");
    assert_eq!(
        cycles(&[folder[0], folder[1], use_of_child]),
        [""; 0],
        "the import of a folder is not a use of its mod.rs"
    );
    let use_of_mod = ("a/c.rs", "use crate::a;\nfn g() { a::f() }");
    let steps = "src/a/c.rs:2: a::f\nsrc/a/mod.rs:1: c::g\n";
    assert_eq!(
        cycles(&[folder[0], folder[1], use_of_mod]),
        [steps],
        "a path to a function of mod.rs is a use of mod.rs"
    );
    let inner = ("a/c.rs", "mod tests {\nuse crate::a;\nfn g() { a::f() } }");
    let steps = "src/a/c.rs:3: a::f\nsrc/a/mod.rs:1: c::g\n";
    assert_eq!(cycles(&[folder[0], folder[1], inner]), [steps], "paths in unit tests are uses");
}
