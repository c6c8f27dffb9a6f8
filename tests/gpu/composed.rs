//! The composed WGSL of the passes, for people who debug shaders.
//!
//! In: passes and their definitions. Out: proof that each composed pass can be written as WGSL and read again; with `GS4D_SHADERS`, a file for
//! each variant in the folder that the variable names. No device is needed.

use bevy_gs4d::internal::renderer::shaders::{
    AtOnce, BINNED, Blending, COPIED_INSTANCE, FEW_BINS, LARGE_BATCHES, Lists, MULTISAMPLED, compose, pass_names,
};
use bevy_gs4d::renderer::{ColorPrecision, Storage};
use std::path::PathBuf;
use wgpu::naga::back::wgsl::{WriterFlags, write_string};
use wgpu::naga::front::wgsl::parse_str;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};

/// Returns the variants of the passes of a frame that differ most, and one variant of every other pass.
fn variants() -> Vec<(&'static str, Vec<&'static str>)> {
    let half = ColorPrecision::Half.definitions();
    let mut variants: Vec<(&'static str, Vec<&'static str>)> = pass_names().map(|name| (name, Vec::new())).collect();
    for storage in Storage::ALL {
        let own = storage.definitions();
        variants.push(("project", [own, COPIED_INSTANCE].concat()));
        variants.push(("project", [BINNED, own].concat()));
        variants.push(("project", [BINNED, FEW_BINS, own].concat()));
        variants.push(("colors", own.to_vec()));
        variants.push(("motion", [BINNED, own].concat()));
    }
    variants.extend(Lists::ALL.map(|lists| ("sort_bins", lists.definitions().to_vec())));
    variants.extend(AtOnce::ALL.map(|at_once| ("blend", [at_once.definitions(), half].concat())));
    variants.push(("blend", [MULTISAMPLED, half].concat()));
    for blending in Blending::ALL {
        variants.push(("blend_blocks", [blending.definitions(), half].concat()));
        variants.push(("blend_blocks", [blending.definitions(), half, LARGE_BATCHES].concat()));
    }
    variants.sort();
    variants.dedup();
    variants
}

#[test]
fn composed_passes_are_written_as_valid_wgsl() {
    let folder = std::env::var_os("GS4D_SHADERS").map(PathBuf::from);
    if let Some(folder) = &folder {
        std::fs::create_dir_all(folder).expect("the folder of GS4D_SHADERS can be created");
    }
    let mut failures = Vec::new();
    for (name, definitions) in variants() {
        let file = [&[name], &definitions[..]].concat().join("+");
        let module = compose(name, &definitions).unwrap_or_else(|error| panic!("{file} composes: {error}"));
        let capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        let info = Validator::new(ValidationFlags::all(), capabilities).validate(&module);
        let info = info.unwrap_or_else(|error| panic!("{file} is valid: {error:?}"));
        let text = write_string(&module, &info, WriterFlags::empty())
            .unwrap_or_else(|error| panic!("{file} can be written as WGSL: {error}"));
        let entries = |module: &wgpu::naga::Module| -> Vec<String> {
            module.entry_points.iter().map(|entry| entry.name.clone()).collect()
        };
        match parse_str(&text) {
            Ok(read) if entries(&read) == entries(&module) => {}
            Ok(read) => {
                failures.push(format!("{file} has the entry points {:?} when it is read again", entries(&read)))
            }
            Err(error) => failures.push(format!("{file} cannot be read again: {}", error.emit_to_string(&text))),
        }
        if let Some(folder) = &folder {
            std::fs::write(folder.join(file).with_extension("wgsl"), text)
                .expect("a file in the folder of GS4D_SHADERS");
        }
    }
    assert!(failures.is_empty(), "{} composed passes are not valid WGSL:\n{}", failures.len(), failures.join("\n"));
}
