//! Structures and constants that both the shaders and the host define.
//!
//! In: the composed passes with naga's layout. Out: proof that every structure and constant is the same in the shaders
//! and on the host.

use crate::support::composed::{compose, pass_names};
use bevy_gs4d::gaussian::Gaussian;
use bevy_gs4d::internal::gaussian::{ALPHA_MAX, ALPHA_MIN, TRANSMITTANCE_MIN};
use bevy_gs4d::internal::gaussian::{LOW_PASS, MAX_VARIANCE, THIN};
use bevy_gs4d::internal::offline::engine::{
    AdamUniforms, DropoutUniforms, ExposureUniforms, FIRST_SEEN, LossUniforms, NoiseUniforms, RelocationUniforms,
    RoundingRecord, TiedColors, TrainedRecord, TrainedScene,
};
use bevy_gs4d::internal::offline::train::{NEIGHBORS, StandingUniforms, TermWeights};
use bevy_gs4d::internal::renderer::COPIED_INSTANCE;
use bevy_gs4d::internal::renderer::{
    self, Activation, BLOCK, Counters, DIGITS, FrameUniforms, INSTANCE_STRIDE, INSTANCES_AT_ONCE, InstanceUniforms,
    MotionUniforms, SortStep, SplatRecord, SplatShape, VisibleSplat,
};
use bevy_gs4d::view::{TILE_SIZE, Thinning};
use std::collections::{BTreeMap, BTreeSet};
use std::mem::offset_of;
use wgpu::naga::front::wgsl::parse_str;
use wgpu::naga::{AddressSpace, ArraySize, Expression, GlobalVariable, Literal, Module, StructMember, TypeInner};

/// A member of a structure: name, offset and size in bytes.
type Member = (String, usize, usize);

/// A structure of the host.
struct Mirror {
    name: &'static str,
    size: usize,
    members: Vec<Member>,
}

fn member_size<T, M>(_: impl Fn(&T) -> &M) -> usize {
    size_of::<M>()
}

macro_rules! mirror {
    ($type:ident { $($member:ident),* $(,)? }) => {
        Mirror {
            name: stringify!($type),
            size: size_of::<$type>(),
            members: vec![$((
                stringify!($member).to_owned(),
                offset_of!($type, $member),
                member_size(|value: &$type| &value.$member),
            )),*],
        }
    };
}

/// Returns a mirror whose bytes are divided into members of four words on the GPU.
fn in_fours<const N: usize>(mirror: Mirror, name: &'static str, members: [&str; N]) -> Mirror {
    assert!(
        mirror.members.iter().all(|(_, at, size)| at / 16 == (at + size - 1) / 16 || at % 16 == 0),
        "no member of `{name}` crosses a boundary of four words"
    );
    let pieces = members.into_iter().take(mirror.size / 16).enumerate();
    Mirror { name, size: mirror.size, members: pieces.map(|(i, member)| (member.to_owned(), 16 * i, 16)).collect() }
}

/// Returns the mirror of the Gaussian, which has the reciprocal of the temporal deviation on the GPU.
fn gaussian() -> Mirror {
    let mirror = mirror!(Gaussian { mean, mean_t, velocity, sigma_t, covariance, opacity, padding });
    in_fours(mirror, "GaussianRecord", ["mean", "velocity", "covariance_a", "covariance_b"])
}

fn trained() -> Mirror {
    let mirror = mirror!(TrainedRecord { mean, mean_t, log_scale, log_scale_t, rotation_l, rotation_r, opacity_logit });
    in_fours(mirror, "TrainedRecord", ["mean", "log_scale", "rotation_l", "rotation_r", "opacity_logit"])
}

fn splat() -> Mirror {
    let mirror = mirror!(SplatRecord { center, opacity, depth, conic, tiles_low, color, tiles_high });
    in_fours(mirror, "SplatRecord", ["place", "shape", "color", ""])
}

fn mirrors() -> [Mirror; 22] {
    [
        gaussian(),
        mirror!(InstanceUniforms {
            camera_x,
            camera_y,
            camera_z,
            clip_x,
            clip_y,
            camera_position,
            time,
            reach,
            focal,
            size,
            tiles,
            first_slot,
            count,
            degree,
            degree_t,
            stride,
            displaced,
            near,
            time_span,
            listed,
            first_listed,
            stages,
            orthographic,
            first_entries,
            light,
            opacity,
            lighting,
            debug,
            cropped,
            per_thread,
            binning,
            trained_variance,
            marginal_cutoff,
            middle,
            crop_x,
            crop_y,
            crop_z,
            least_importance,
            growth,
            boost,
            padding,
        }),
        mirror!(MotionUniforms { clip_x, clip_y, camera_z, time, near, padding }),
        mirror!(Activation { count, first, filter_mode, segment, paged, first_page, segments, padding }),
        mirror!(FrameUniforms {
            size,
            tiles,
            slots,
            pair_capacity,
            background_mode,
            opaque_samples,
            background,
            projection,
            world_x,
            world_y,
            world_z,
            environment_size,
            opaque_origin,
            opaque_distance,
            environment_lighting,
            debug,
            debug_depth,
            environment_opacity,
            binning,
        }),
        splat(),
        mirror!(SplatShape { place, conic }),
        mirror!(VisibleSplat { seen, words }),
        mirror!(Counters { visible, pairs, pairs_wanted, padding }),
        mirror!(SortStep { shift, source, stride, padding }),
        trained(),
        mirror!(RoundingRecord { mean, velocity, shape_x, shape_y, shape_z }),
        mirror!(TrainedScene { count, model, prefilter_var, view, first, total }),
        mirror!(LossUniforms { background, size, tiles, share, similarity_share, mask_weight, padding }),
        mirror!(ExposureUniforms { background, size, tiles, share, pull, camera, padding }),
        mirror!(TiedColors { count, stride, stages, padding }),
        mirror!(AdamUniforms { rates, correction, count, stride, values, padding, end }),
        mirror!(StandingUniforms { middle, least_scale_t, log_scale_t, stride }),
        mirror!(TermWeights { motion, rigid, opacity, scale, falloff }),
        mirror!(NoiseUniforms { count, seed, strength, least_log_scale_t }),
        mirror!(DropoutUniforms { count, seed, below, first }),
        mirror!(RelocationUniforms { moves, stride, keeps, first, count }),
    ]
}

/// Returns all passes, composed.
fn modules() -> BTreeMap<&'static str, Module> {
    pass_names().map(|name| (name, compose(name, &[]).expect("the pass composes"))).collect()
}

/// A structure that the host writes or reads, with the layout of a pass.
struct Shared {
    name: String,
    size: usize,
    members: Vec<Member>,
    /// Stride, if the binding is an array of structures.
    stride: Option<usize>,
}

/// Returns the structures behind the bindings of a pass.
fn shared(module: &Module) -> Vec<Shared> {
    let member = |member: &StructMember| {
        let size = module.types[member.ty].inner.size(module.to_ctx()) as usize;
        (member.name.clone().unwrap_or_default(), member.offset as usize, size)
    };
    let structure = |variable: &GlobalVariable| {
        variable.binding?;
        let (ty, stride) = match module.types[variable.ty].inner {
            TypeInner::Array { base, stride, .. } => (base, Some(stride as usize)),
            _ => (variable.ty, None),
        };
        let TypeInner::Struct { members, span } = &module.types[ty].inner else { return None };
        let name = module.types[ty].name.clone().unwrap_or_default();
        Some(Shared { name, size: *span as usize, members: members.iter().map(member).collect(), stride })
    };
    module.global_variables.iter().filter_map(|(_, variable)| structure(variable)).collect()
}

#[test]
fn structures_have_the_same_members_at_the_same_offsets() {
    let mirrors = mirrors();
    let mut seen = BTreeSet::new();
    let mut wrong = Vec::new();
    for (pass, module) in modules() {
        for Shared { name, size, members, stride } in shared(&module) {
            let Some(mirror) = mirrors.iter().find(|mirror| mirror.name == name) else {
                wrong.push(format!("{pass}: the host has no `{name}`"));
                continue;
            };
            seen.insert(mirror.name);
            if mirror.size != size || stride.is_some_and(|stride| stride != size) {
                wrong.push(format!(
                    "{pass}: `{name}` has {size} bytes, stride {stride:?}; on the host {} bytes",
                    mirror.size
                ));
            }
            if mirror.members != members {
                wrong.push(format!("{pass}: `{name}` is\n  {members:?}, on the host\n  {:?}", mirror.members));
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert_eq!(seen.len(), mirrors.len(), "every structure of the host is bound by a pass: {seen:?}");
}

#[test]
fn the_array_of_instances_has_the_count_and_stride_of_the_host() {
    for pass in ["project", "colors", "motion"] {
        let module = compose(pass, COPIED_INSTANCE).expect("the pass composes");
        let uniforms = module.global_variables.iter().filter(|(_, variable)| variable.space == AddressSpace::Uniform);
        let arrays = uniforms.filter_map(|(_, variable)| match module.types[variable.ty].inner {
            TypeInner::Array { size: ArraySize::Constant(count), stride, .. } => Some((count.get(), stride)),
            _ => None,
        });
        let expected = [(INSTANCES_AT_ONCE, INSTANCE_STRIDE)];
        assert_eq!(arrays.collect::<Vec<_>>(), expected, "{pass}: count and stride of the array of instances");
    }
}

#[test]
fn structures_of_the_host_have_no_padding_between_members() {
    for mirror in mirrors() {
        let bytes: usize = mirror.members.iter().map(|(_, _, size)| size).sum();
        assert_eq!(bytes, mirror.size, "the members of `{}` cover all its bytes", mirror.name);
    }
}

/// Returns the value of a constant in double precision, which represents every u32 and f32.
fn constant(module: &Module, name: &str) -> f64 {
    let found = module.constants.iter().find(|(_, constant)| constant.name.as_deref() == Some(name));
    let (_, constant) = found.unwrap_or_else(|| panic!("there is no constant `{name}`"));
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::F32(value)) => value.into(),
        Expression::Literal(Literal::U32(value)) => value.into(),
        ref other => panic!("`{name}` is not a literal: {other:?}"),
    }
}

#[test]
fn constants_of_the_passes_match_the_host() {
    let modules = modules();
    let threads = 256;
    let expected: [(&str, &str, f64); 15] = [
        ("activate", "BLOCK", BLOCK.into()),
        ("activate", "PER_THREAD", (BLOCK / threads).into()),
        ("sort", "BLOCK", BLOCK.into()),
        ("sort", "KEYS_PER_THREAD", (BLOCK / threads).into()),
        ("sort", "NO_DIGIT", DIGITS.into()),
        ("bin", "BLOCK", BLOCK.into()),
        ("bin", "SPLATS_PER_THREAD", (BLOCK / threads).into()),
        ("blend", "BATCH", (TILE_SIZE * TILE_SIZE).into()),
        ("score", "PIXELS", (TILE_SIZE * TILE_SIZE).into()),
        ("blend_backward", "PIXELS", (TILE_SIZE * TILE_SIZE).into()),
        ("project_backward", "FIRST_SEEN", FIRST_SEEN.into()),
        ("statistics", "FIRST_SEEN", FIRST_SEEN.into()),
        ("exposure", "SIDE", TILE_SIZE.into()),
        ("regularize", "NEIGHBORS", NEIGHBORS as f64),
        ("loss", "SIDE", TILE_SIZE.into()),
    ];
    for (pass, name, value) in expected {
        let found = constant(&modules[pass], name);
        assert!(found == value, "{name} of {pass} is {found}, on the host {value}");
    }
}

#[test]
fn constants_of_the_libraries_match_the_host() {
    // These libraries import only each other: concatenated without directives, they are plain WGSL.
    let sources = [
        include_str!("../../shaders/shared/types.wgsl"),
        include_str!("../../shaders/shared/conic.wgsl"),
        include_str!("../../shaders/shared/alpha.wgsl"),
        include_str!("../../shaders/shared/tile.wgsl"),
        include_str!("../../shaders/shared/importance.wgsl"),
    ];
    let lines = sources.iter().flat_map(|source| source.lines()).filter(|line| !line.starts_with('#'));
    let libraries = parse_str(&lines.collect::<Vec<_>>().join("\n")).expect("the libraries are WGSL");
    let integers = [
        ("LIGHTING_AS_TRAINED", renderer::LIGHTING_AS_TRAINED),
        ("LIGHTING_ENCODED", renderer::LIGHTING_ENCODED),
        ("LIGHTING_LINEAR", renderer::LIGHTING_LINEAR),
        ("DEBUG_COLOR", renderer::DEBUG_COLOR),
        ("DEBUG_DEPTH", renderer::DEBUG_DEPTH),
        ("DEBUG_OVERDRAW", renderer::DEBUG_OVERDRAW),
        ("DEBUG_ACTIVE", renderer::DEBUG_ACTIVE),
        ("DEBUG_LIFESPAN", renderer::DEBUG_LIFESPAN),
        ("DEBUG_VELOCITY", renderer::DEBUG_VELOCITY),
        ("PAGE", renderer::PAGE),
        ("FILTER_ALL", renderer::FILTER_ALL),
        ("FILTER_BITS", renderer::FILTER_BITS),
        ("FILTER_INTERVALS", renderer::FILTER_INTERVALS),
        ("INVISIBLE", renderer::INVISIBLE),
        ("BACKGROUND_NONE", renderer::BACKGROUND_NONE),
        ("BACKGROUND_COLOR", renderer::BACKGROUND_COLOR),
        ("BACKGROUND_ENVIRONMENT", renderer::BACKGROUND_ENVIRONMENT),
        ("SORT_SLOTS", renderer::SORT_SLOTS),
        ("SORT_VISIBLE", renderer::SORT_VISIBLE),
        ("SORT_PAIRS", renderer::SORT_PAIRS),
        ("TILE_SIZE", TILE_SIZE),
        ("BIN_COUNTERS", renderer::BIN_COUNTERS),
    ];
    let floats = [
        ("LOW_PASS", LOW_PASS),
        ("MAX_VARIANCE", MAX_VARIANCE),
        ("THIN", THIN),
        ("ALPHA_MIN", ALPHA_MIN),
        ("INVERSE_ALPHA_MIN", ALPHA_MIN.recip().round()),
        ("ALPHA_MAX", ALPHA_MAX),
        ("TRANSMITTANCE_MIN", TRANSMITTANCE_MIN),
        ("FULL", Thinning::FULL),
    ];
    assert_eq!(libraries.constants.len(), integers.len() + floats.len(), "every constant of the libraries is compared");
    let integers = integers.map(|(name, value)| (name, f64::from(value)));
    let floats = floats.map(|(name, value)| (name, f64::from(value)));
    for (name, value) in integers.into_iter().chain(floats) {
        let found = constant(&libraries, name);
        assert!(found == value, "{name} is {found}, on the host {value}");
    }
}
