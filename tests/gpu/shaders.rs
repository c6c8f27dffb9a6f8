//! Validation of every shader, without a device.
//!
//! In: the files of `shaders/`. Out: proof that each file is known to the renderer and is valid WGSL, and that only the
//! variants for devices with optional capabilities need these capabilities.

use crate::support::composed::{compose, pass_names};
use bevy_gs4d::internal::offline::engine::{COMPAT, COMPAT_WITHOUT_TIME, MIP_FILTER};
use bevy_gs4d::internal::renderer::AtOnce;
use bevy_gs4d::internal::renderer::{BINNED, COPIED_INSTANCE, MULTISAMPLED, SHADERS, SUBGROUPS_OF_8, SUBGROUPS_OF_32};
use bevy_gs4d::internal::renderer::{Blending, COUNTED, EIGHT_AT_ONCE, FEW_BINS, LARGE_BATCHES, Lists, OPAQUE};
use bevy_gs4d::renderer::{ColorPrecision, Storage};
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderDefValue};
use std::collections::BTreeSet;
use std::path::Path;
use wgpu::naga::back::wgsl::{WriterFlags, write_string};
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
use wgpu::naga::{AddressSpace, Expression, GlobalVariable, Handle, Literal, Module, ScalarKind};

/// Validates a module that may use only these optional capabilities.
fn validate(name: &str, module: &Module, capabilities: Capabilities) -> Result<(), String> {
    Validator::new(ValidationFlags::all(), capabilities)
        .validate(module)
        .map(|_| ())
        .map_err(|error| format!("{name}: {error:?}"))
}

/// Fails with a list of all failures, if there are any.
fn report(failures: Vec<String>) {
    assert!(failures.is_empty(), "{} shaders are invalid:\n{}", failures.len(), failures.join("\n"));
}

#[test]
fn every_shader_file_is_a_pass_of_the_renderer_or_of_the_plugin() {
    let folders = ["shaders", "shaders/global_sort", "shaders/tile_bins", "shaders/offline"]
        .map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
    let files = folders.iter().flat_map(|folder| std::fs::read_dir(folder).expect("the folder of shaders"));
    let files = files.map(|entry| entry.expect("an entry").path());
    let shaders = files.filter(|path| path.extension().is_some_and(|ending| ending == "wgsl"));
    let mut names: BTreeSet<String> =
        shaders.filter_map(|path| Some(path.file_stem()?.to_string_lossy().into_owned())).collect();
    for name in ["composite", "write_depth", "write_motion"] {
        assert!(names.remove(name), "the file of {name} exists");
    }
    let passes: BTreeSet<String> = pass_names().map(str::to_owned).collect();
    assert!(!passes.is_empty(), "there are passes");
    assert_eq!(passes, names, "each pass has a file and each file is a pass");
    assert_eq!(passes.len(), pass_names().count(), "names of passes are unique");
}

#[test]
fn every_pass_composes_and_is_valid() {
    let check = |name: &str, definitions: &[&str]| {
        let uses = |own: &[&str]| definitions.iter().any(|definition| own.contains(definition));
        let mut capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32;
        capabilities.set(Capabilities::SUBGROUP, uses(SUBGROUPS_OF_32) || uses(SUBGROUPS_OF_8));
        validate(name, &compose(name, definitions).map_err(|error| error.to_string())?, capabilities)
    };
    let binned = Storage::ALL
        .into_iter()
        .flat_map(|storage| [&[][..], FEW_BINS].map(|few| [BINNED, few, storage.definitions()].concat()));
    let binned: Vec<_> = binned.collect();
    let blending = Blending::ALL.into_iter().flat_map(|blending| {
        let half = ColorPrecision::Half.definitions();
        [&[][..], LARGE_BATCHES, SUBGROUPS_OF_32, half].map(|device| [blending.definitions(), device].concat())
    });
    let eight = [Blending::Color, Blending::ColorBehindSurfaces].into_iter().flat_map(|blending| {
        [&[][..], SUBGROUPS_OF_32].map(|device| [blending.definitions(), EIGHT_AT_ONCE, device].concat())
    });
    let lists = Lists::ALL
        .into_iter()
        .flat_map(|lists| [&[][..], COUNTED].map(|counted| [lists.definitions(), counted].concat()))
        .flat_map(|sorting| [&[][..], SUBGROUPS_OF_32].map(|device| [&sorting[..], device].concat()));
    let storages = Storage::ALL.map(|storage| storage.definitions().to_vec());
    let copied = storages.iter().chain(&binned).map(|definitions| [&definitions[..], COPIED_INSTANCE].concat());
    let copied: Vec<_> = copied.collect();
    let at_once = AtOnce::ALL
        .into_iter()
        .flat_map(|at_once| [&[][..], MULTISAMPLED].map(|samples| [at_once.definitions(), samples].concat()))
        .flat_map(|blending| [&[][..], SUBGROUPS_OF_8].map(|device| [&blending[..], device].concat()));
    let definitions: Vec<_> = storages
        .into_iter()
        .chain(at_once)
        .chain([MULTISAMPLED, COMPAT, COMPAT_WITHOUT_TIME, MIP_FILTER].map(<[&str]>::to_vec))
        .chain(binned)
        .chain(copied)
        .chain(blending)
        .chain(eight)
        .chain(lists)
        .collect();
    let all = definitions.iter().flat_map(|definitions| pass_names().map(move |name| (name, &definitions[..])));
    report(all.filter_map(|(name, definitions)| check(name, definitions).err()).collect());
}

/// Drivers may round a floating-point expression differently in each place where it is inlined; indices computed from
/// it would differ.
#[test]
fn sort_bins_computes_its_indices_from_integers() {
    for lists in Lists::ALL {
        let module = compose("sort_bins", &[lists.definitions(), COUNTED].concat()).expect("it composes");
        let functions = module.functions.iter().map(|(_, function)| function);
        for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
            let floats = function.expressions.iter().any(|(_, expression)| {
                matches!(expression, Expression::As { kind: ScalarKind::Float, .. })
                    || matches!(expression, Expression::Literal(Literal::F32(_)))
            });
            assert!(!floats, "{lists:?}: {:?} computes with integers only", function.name);
        }
    }
}

#[test]
fn workgroup_memory_is_within_the_required_limits() {
    let blending = Blending::ALL.map(|blending| ("blend_blocks", blending.definitions(), 16 * 1024));
    let large =
        [[LARGE_BATCHES, Blending::All.definitions()], [EIGHT_AT_ONCE, Blending::ColorBehindSurfaces.definitions()]]
            .map(|definitions| ("blend_blocks", definitions.concat(), 32 * 1024));
    let large = large.iter().map(|(name, definitions, limit)| (*name, &definitions[..], *limit));
    let sorting = Lists::ALL.map(|lists| ([lists.definitions(), COUNTED].concat(), lists.memory()));
    let sorting = sorting.iter().map(|(definitions, limit)| ("sort_bins", &definitions[..], *limit));
    let binning = [("project_bin", &[][..], 16 * 1024)];
    for (name, definitions, limit) in blending.into_iter().chain(large).chain(sorting).chain(binning) {
        let module = compose(name, definitions).expect("the pass composes");
        let shared = module.global_variables.iter().filter(|(_, v)| v.space == AddressSpace::WorkGroup);
        let bytes: u32 = shared.map(|(_, v)| module.types[v.ty].inner.size(module.to_ctx()).next_multiple_of(16)).sum();
        assert!(bytes <= limit, "{name} with {definitions:?} uses {bytes} bytes, the limit is {limit}");
        assert!(2 * bytes > limit, "{name} with {definitions:?} uses more than half of the limit, found {bytes} bytes");
    }
}

/// Returns the passes that a page needs, with the definitions of each storage.
fn passes_of_pages() -> impl Iterator<Item = (&'static str, Vec<&'static str>)> {
    let names = SHADERS.names();
    names.flat_map(|name| Storage::ALL.into_iter().map(move |storage| (name, storage.definitions().to_vec())))
}

/// WGSL reserves names that other languages do not; naga renames an entry point with a reserved name.
#[test]
fn no_entry_point_has_a_reserved_name() {
    for (name, definitions) in pass_names().map(|name| (name, Vec::new())).chain(passes_of_pages()) {
        let module = compose(name, &definitions).expect("the pass composes");
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
        let info = validator.validate(&module).expect("the pass is valid");
        let text = write_string(&module, &info, WriterFlags::empty()).expect("the pass can be written");
        for entry in &module.entry_points {
            let is_kept = text.contains(&format!("fn {}(", entry.name));
            assert!(is_kept, "{name}: the entry point `{}` has another name in WGSL", entry.name);
        }
    }
}

/// Devices of browsers have at least 8 storage buffers for a stage.
#[test]
fn no_pass_of_a_page_uses_more_than_eight_storage_buffers() {
    let behind = Storage::ALL.map(|storage| ("project_bin", [OPAQUE, storage.definitions()].concat()));
    for (name, definitions) in passes_of_pages().chain(behind) {
        let module = compose(name, &definitions).expect("the pass composes");
        let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
        let info = validator.validate(&module).expect("the pass is valid");
        for (index, entry) in module.entry_points.iter().enumerate() {
            let uses = |(handle, variable): &(Handle<GlobalVariable>, &GlobalVariable)| {
                matches!(variable.space, AddressSpace::Storage { .. })
                    && !info.get_entry_point(index)[*handle].is_empty()
            };
            let used = module.global_variables.iter().filter(uses).count();
            assert!(used <= 8, "{name} {}: {used} storage buffers", entry.name);
        }
    }
}

#[test]
fn the_error_for_an_unknown_pass_contains_its_name() {
    let message = compose("no such pass", &[]).expect_err("the pass does not exist").to_string();
    assert!(message.contains("no such pass"), "the message contains the name: {message}");
}

#[test]
fn passes_of_the_plugin_are_valid_with_all_combinations_of_definitions() {
    let defines = ["READ_TARGET", "ENCODE_TARGET", "KEEP_SAMPLES"];
    let composite = ("composite", include_str!("../../shaders/composite.wgsl"), defines);
    let median = ["MEDIAN", "UNUSED", "UNUSED_TOO"];
    let write_depth = ("write_depth", include_str!("../../shaders/write_depth.wgsl"), median);
    let motion = ["MEDIAN", "DEPTH", "UNUSED"];
    let write_motion = ("write_motion", include_str!("../../shaders/write_motion.wgsl"), motion);
    let check = |(name, source, defines): (&str, &str, [&str; 3]), chosen: usize| {
        let chosen = defines.iter().enumerate().filter(|(index, _)| (chosen >> index) & 1 == 1);
        let shader_defs = chosen.map(|(_, define)| ((*define).to_owned(), ShaderDefValue::Bool(true))).collect();
        let mut composer = Composer::default();
        let srgb = include_str!("../../shaders/shared/srgb.wgsl");
        let library = ComposableModuleDescriptor { source: srgb, file_path: "srgb", ..Default::default() };
        if let Err(error) = composer.add_composable_module(library) {
            return Err(error.emit_to_string(&composer));
        }
        let descriptor = NagaModuleDescriptor { source, file_path: name, shader_defs, ..Default::default() };
        let module = composer.make_naga_module(descriptor).map_err(|error| error.emit_to_string(&composer))?;
        validate(name, &module, Capabilities::SHADER_FLOAT16_IN_FLOAT32)
    };
    let passes = [composite, write_depth, write_motion].into_iter();
    let all = passes.flat_map(|pass| (0..8).map(move |chosen| (pass, chosen)));
    report(all.filter_map(|(pass, chosen)| check(pass, chosen).err()).collect());
}
