// Structures that the host writes or reads, identical to those in src/renderer/layout.rs (a test compares every
// offset).
#define_import_path gs4d::types

// One Gaussian in the runtime form. See records.wgsl.
struct GaussianRecord {
    // Mean, mean_t.
    mean: vec4<f32>,
    // Velocity, inverse_sigma_t: 0 for a Gaussian that is present at every time.
    velocity: vec4<f32>,
    // Conditional covariance: xx, xy, xz, yy.
    covariance_a: vec4<f32>,
    // yz, zz; opacity.
    covariance_b: vec4<f32>,
}

// One part of a capture in one view: its camera and the slots of its splats.
struct InstanceUniforms {
    // Rows of capture-to-camera.
    camera_x: vec4<f32>,
    camera_y: vec4<f32>,
    camera_z: vec4<f32>,
    // Rows x and y of projection times capture-to-camera.
    clip_x: vec4<f32>,
    clip_y: vec4<f32>,
    // Camera center in capture space; for an orthographic camera, the unit vector of its viewing direction.
    camera_position: vec3<f32>,
    time: f32,
    // Half-angle tangents to which rays are clamped.
    reach: vec2<f32>,
    focal: vec2<f32>,
    size: vec2<u32>,
    tiles: vec2<u32>,
    first_slot: u32,
    count: u32,
    degree: u32,
    degree_t: u32,
    // vec4s of color coefficients per Gaussian.
    stride: u32,
    // 1: the viewing direction of color points to the displaced mean.
    displaced: u32,
    near: f32,
    time_span: f32,
    // 1: the Gaussians of the active list are drawn, from `first_listed` on; 0: all.
    listed: u32,
    first_listed: u32,
    // Number of codebooks of color; 0 if the coefficients are whole.
    stages: u32,
    orthographic: u32,
    // First entry of each codebook.
    first_entries: vec4<u32>,
    // Factor on linear light.
    light: vec3<f32>,
    opacity: f32,
    // LIGHTING_*
    lighting: u32,
    // DEBUG_*
    debug: u32,
    // 1: only Gaussians whose mean is inside the crop box are drawn.
    cropped: u32,
    // Gaussians per thread of `project_bin`.
    per_thread: u32,
    // Tile bins. x: tiles along each side of a bin (8 bits) and the stamp of the frame (16); y: capacity of each bin in splats, or 0
    // if bins are counted before they are filled; z: index of this part; w: number of parts.
    binning: vec4<u32>,
    // Screen-space variances of one training pixel squared, at one pixel per camera unit.
    trained_variance: vec2<f32>,
    // The marginal at and below which a Gaussian is not drawn.
    marginal_cutoff: f32,
    // Depth of the center of the instance, camera units.
    middle: f32,
    // Rows of capture-to-crop-box; the box is from -1 to 1.
    crop_x: vec4<f32>,
    crop_y: vec4<f32>,
    crop_z: vec4<f32>,
    // Gaussians of at most this importance are not drawn, capture units; 0: all are drawn, unchanged.
    least_importance: f32,
    // Factor on the covariances of the others, and power of their transmittance.
    growth: f32,
    boost: f32,
    padding: f32,
}

// The view of one part of a capture in the previous frame.
struct MotionUniforms {
    // Rows x and y of projection times capture-to-camera.
    clip_x: vec4<f32>,
    clip_y: vec4<f32>,
    // Row z of capture-to-camera.
    camera_z: vec4<f32>,
    time: f32,
    near: f32,
    padding: vec2<f32>,
}

const LIGHTING_AS_TRAINED: u32 = 0u;
const LIGHTING_ENCODED: u32 = 1u;
const LIGHTING_LINEAR: u32 = 2u;

const DEBUG_COLOR: u32 = 0u;
const DEBUG_DEPTH: u32 = 1u;
const DEBUG_OVERDRAW: u32 = 2u;
const DEBUG_ACTIVE: u32 = 3u;
const DEBUG_LIFESPAN: u32 = 4u;
const DEBUG_VELOCITY: u32 = 5u;

// Input of `activate` for one part of a capture.
struct Activation {
    // Number of Gaussians in this part, or in its pages that are listed, and first entry of this part in the
    // buffer of the list.
    count: u32,
    first: u32,
    // FILTER_*
    filter_mode: u32,
    segment: u32,
    // 1: the Gaussians are in pages; first entry of this part in the list of pages; number of segments.
    paged: u32,
    first_page: u32,
    segments: u32,
    padding: u32,
}

// Gaussians of a page.
const PAGE: u32 = 256u;

const FILTER_ALL: u32 = 0u;
const FILTER_BITS: u32 = 1u;
const FILTER_INTERVALS: u32 = 2u;

// Depth key of a slot without a splat.
const INVISIBLE: u32 = 0xffffffffu;

// Values shared by all instances of a view.
struct FrameUniforms {
    size: vec2<u32>,
    tiles: vec2<u32>,
    // Splat slots in use, whether their splats are visible or not.
    slots: u32,
    pair_capacity: u32,
    // BACKGROUND_*
    background_mode: u32,
    // Samples per pixel of the opaque depth; 0 if there is none.
    opaque_samples: u32,
    // Color, or the factor on the light of an environment map; w: factor on the transmittance behind a map, 0 or 1.
    background: vec4<f32>,
    // P00, P11, P02, P12.
    projection: vec4<f32>,
    // Columns of camera-to-world of the instance with the environment map; w: its camera position.
    world_x: vec4<f32>,
    world_y: vec4<f32>,
    world_z: vec4<f32>,
    environment_size: vec2<u32>,
    // Corner of the view in the opaque depth texture.
    opaque_origin: vec2<u32>,
    // From opaque depth d to camera space: z = (x + y d) / (z + w d).
    opaque_distance: vec4<f32>,
    // LIGHTING_* of the environment map.
    environment_lighting: u32,
    // DEBUG_*
    debug: u32,
    // Depth that the debug view shows half as bright as depth 0.
    debug_depth: f32,
    environment_opacity: f32,
    // The same as in InstanceUniforms.
    binning: vec4<u32>,
}

const BACKGROUND_NONE: u32 = 0u;
const BACKGROUND_COLOR: u32 = 1u;
const BACKGROUND_ENVIRONMENT: u32 = 2u;

// A Gaussian on the screen: a splat. See records.wgsl.
struct SplatRecord {
    // Center, opacity, depth.
    place: vec4<f32>,
    // Inverse covariance, factored (conic.wgsl); tiles x0 and y0.
    shape: vec4<u32>,
    // Color; tiles x1 and y1 (ends excluded).
    color: vec4<u32>,
}

// A splat of tile bins, without its color. See records.wgsl.
struct SplatShape {
    // Center, opacity, depth.
    place: vec4<f32>,
    // Inverse covariance, factored (conic.wgsl); unused.
    conic: vec4<f32>,
}

// Further data of a visible splat of tile bins.
struct VisibleSplat {
    // Viewing direction, or color in some debug views; time from the frame to the temporal mean.
    seen: vec4<f32>,
    // Slot, index of the Gaussian; tiles x0 and y0, x1 and y1 (ends excluded), 16 bits each.
    words: vec4<u32>,
}

struct Counters {
    visible: u32,
    // Number of pairs written: never above the capacity.
    pairs: u32,
    // Number of pairs of the frame, written or not.
    pairs_wanted: u32,
    padding: u32,
}

// One step of a radix sort.
struct SortStep {
    shift: u32,
    // SORT_*
    source: u32,
    // Capacity of the histogram in blocks, per digit.
    stride: u32,
    padding: u32,
}

// All slots: invisible slots are left out, and the value of a key is its slot.
const SORT_SLOTS: u32 = 0u;
const SORT_VISIBLE: u32 = 1u;
const SORT_PAIRS: u32 = 2u;

// Number of counters of tile bins before the counters of parts and bins: pairs of this frame, modulo 2^32, how often
// this number has wrapped, and the depth order of the farthest surface; then visible splats, pairs, splats of the
// fullest bin and pairs for which room was requested, of the previous frame.
const BIN_COUNTERS: u32 = 7u;
