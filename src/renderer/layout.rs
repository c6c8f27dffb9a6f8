//! Mirrors of the structures in `shaders/shared/types.wgsl`, byte for byte (a test compares every offset).
//!
//! In: views and settings. Out: plain data for uniform and storage buffers.

use crate::scene::{ChunkTable, packed};
use crate::view::{Appearance, BlendSpace, DebugView, Lighting, View};
use bytemuck::{Pod, Zeroable};

/// Side of a tile in pixels.
pub use crate::view::TILE_SIZE;

/// Keys or pairs that one workgroup of `sort` and `bin` processes.
pub const BLOCK: u32 = 2048;
/// Bits that one step of `sort` sorts by.
pub const DIGIT_BITS: u32 = 4;
/// Number of values of a digit.
pub const DIGITS: u32 = 1 << DIGIT_BITS;
/// Number of steps that sort 32-bit depths.
pub const DEPTH_STEPS: u32 = 32 / DIGIT_BITS;

/// Stride in bytes of the uniforms of instances, which are bound at dynamic offsets or as an array (`InstanceSlot` of the shaders), and of
/// [`MotionUniforms`], [`SortStep`]s and [`Activation`]s. A multiple of the alignment of every device.
pub const INSTANCE_STRIDE: u32 = 512;
/// Instances that one dispatch may draw.
pub const INSTANCES_AT_ONCE: u32 = 64;
/// Bytes of the uniforms of [`INSTANCES_AT_ONCE`] instances, which are bound together.
pub const INSTANCES_BOUND: u32 = INSTANCE_STRIDE * INSTANCES_AT_ONCE;
const _: () = assert!(
    size_of::<InstanceUniforms>() <= INSTANCE_STRIDE as usize
        && size_of::<MotionUniforms>() <= INSTANCE_STRIDE as usize
        && size_of::<SortStep>() <= INSTANCE_STRIDE as usize
        && size_of::<Activation>() <= INSTANCE_STRIDE as usize,
    "uniforms fit their stride"
);

/// Input of `project` for one part of a capture in one view. An [`Instance`](super::Instance) may have several parts.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct InstanceUniforms {
    /// Rows of capture-to-camera: x.
    pub camera_x: [f32; 4],
    /// Row y.
    pub camera_y: [f32; 4],
    /// Row z.
    pub camera_z: [f32; 4],
    /// Row x of projection times capture-to-camera.
    pub clip_x: [f32; 4],
    /// Row y of it.
    pub clip_y: [f32; 4],
    /// Camera center in capture space; for an orthographic camera, the unit vector of its viewing direction.
    pub camera_position: [f32; 3],
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Half-angle tangents to which rays are clamped.
    pub reach: [f32; 2],
    /// Focal lengths that shape footprints, pixels.
    pub focal: [f32; 2],
    /// Picture size, pixels.
    pub size: [u32; 2],
    /// Tiles across and down.
    pub tiles: [u32; 2],
    /// First splat slot.
    pub first_slot: u32,
    /// Gaussians in this part.
    pub count: u32,
    /// Spatial degree of color.
    pub degree: u32,
    /// Time degree of color.
    pub degree_t: u32,
    /// Four-vectors of color coefficients per Gaussian.
    pub stride: u32,
    /// 1: the viewing direction of color points to the displaced mean.
    pub displaced: u32,
    /// Near limit, camera units.
    pub near: f32,
    /// Length of the capture's time interval, in the capture's unit.
    pub time_span: f32,
    /// 1: the Gaussians of the active list are drawn; 0: all.
    pub listed: u32,
    /// First entry of this part in the buffer of that list.
    pub first_listed: u32,
    /// Number of codebooks of color; 0 if the coefficients are whole.
    pub stages: u32,
    /// 1: rays are parallel.
    pub orthographic: u32,
    /// First entry of each codebook.
    pub first_entries: [u32; 4],
    /// Factor on linear light.
    pub light: [f32; 3],
    /// Factor on opacity.
    pub opacity: f32,
    /// `LIGHTING_*`.
    pub lighting: u32,
    /// `DEBUG_*`.
    pub debug: u32,
    /// 1: only Gaussians whose mean is inside the crop box are drawn.
    pub cropped: u32,
    /// Gaussians per thread of `project_bin`.
    pub per_thread: u32,
    /// Tile bins: tiles along each side of a bin (8 bits) and the stamp of the frame (16 bits); capacity of each bin in splats, or 0 if
    /// bins are counted before they are filled; index of this part; number of parts.
    pub binning: [u32; 4],
    /// Screen-space variances of one training pixel squared, at one pixel per camera unit.
    pub trained_variance: [f32; 2],
    /// The marginal at and below which a Gaussian is not drawn.
    pub marginal_cutoff: f32,
    /// Depth of the center of the instance, camera units; `f32::MIN` if it is not known.
    pub middle: f32,
    /// Rows of capture-to-crop-box: x.
    pub crop_x: [f32; 4],
    /// Row y.
    pub crop_y: [f32; 4],
    /// Row z.
    pub crop_z: [f32; 4],
    /// Gaussians of at most this importance are not drawn, capture units; 0: all are drawn, unchanged.
    pub least_importance: f32,
    /// Factor on the covariances of the others.
    pub growth: f32,
    /// Power of the transmittance of the others.
    pub boost: f32,
    /// Unused.
    pub padding: f32,
}

/// The view of one part of a capture in the previous frame. Input of `motion`.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct MotionUniforms {
    /// Row x of projection times capture-to-camera.
    pub clip_x: [f32; 4],
    /// Row y of it.
    pub clip_y: [f32; 4],
    /// Row z of capture-to-camera.
    pub camera_z: [f32; 4],
    /// Timestamp, in the capture's unit.
    pub time: f32,
    /// Near limit, camera units.
    pub near: f32,
    /// Unused.
    pub padding: [f32; 2],
}

impl MotionUniforms {
    /// Creates the uniforms of a view.
    pub fn new(view: &View) -> Self {
        let [clip_x, clip_y] = view.clip_rows();
        Self {
            clip_x: clip_x.to_array(),
            clip_y: clip_y.to_array(),
            camera_z: view.world_to_camera.row(2).to_array(),
            time: view.time,
            near: view.near,
            padding: [0.0; 2],
        }
    }
}

/// Colors are blended as trained.
pub const LIGHTING_AS_TRAINED: u32 = 0;
/// Colors are multiplied by the light and stay encoded.
pub const LIGHTING_ENCODED: u32 = 1;
/// Colors are multiplied by the light and become linear.
pub const LIGHTING_LINEAR: u32 = 2;

/// Input of `activate` for one part of a capture.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct Activation {
    /// Gaussians in this part, or in its pages that are listed.
    pub count: u32,
    /// First entry of this part in the buffer of the list.
    pub first: u32,
    /// `FILTER_*`.
    pub filter_mode: u32,
    /// Segment of the time that is drawn.
    pub segment: u32,
    /// 1: the Gaussians are in pages.
    pub paged: u32,
    /// First entry of this part in the list of pages.
    pub first_page: u32,
    /// Number of segments.
    pub segments: u32,
    /// Unused.
    pub padding: u32,
}

impl InstanceUniforms {
    /// Returns these uniforms with those of a view and an appearance.
    pub fn in_view(&self, view: &View, appearance: &Appearance, space: BlendSpace, debug: DebugView) -> Self {
        let m = view.world_to_camera;
        let [clip_x, clip_y] = view.clip_rows();
        let crop = glam::Mat4::from(appearance.crop.unwrap_or_default());
        Self {
            orthographic: u32::from(view.orthographic),
            light: appearance.light.to_array(),
            opacity: appearance.opacity,
            lighting: lighting_mode(appearance, space),
            debug: debug_mode(debug),
            cropped: u32::from(appearance.crop.is_some()),
            crop_x: crop.row(0).to_array(),
            crop_y: crop.row(1).to_array(),
            crop_z: crop.row(2).to_array(),
            least_importance: appearance.thinning.least,
            growth: appearance.thinning.growth,
            boost: appearance.thinning.boost,
            camera_x: m.row(0).to_array(),
            camera_y: m.row(1).to_array(),
            camera_z: m.row(2).to_array(),
            clip_x: clip_x.to_array(),
            clip_y: clip_y.to_array(),
            camera_position: view.camera_position.to_array(),
            time: view.time,
            reach: view.reach().to_array(),
            focal: view.focal().to_array(),
            size: view.size.to_array(),
            tiles: view.tiles().to_array(),
            near: view.near,
            trained_variance: view.trained_variance().to_array(),
            ..*self
        }
    }
}

/// Values shared by all instances of a view.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct FrameUniforms {
    /// Picture size, pixels.
    pub size: [u32; 2],
    /// Tiles across and down.
    pub tiles: [u32; 2],
    /// Splat slots in use.
    pub slots: u32,
    /// Capacity of the buffers of pairs.
    pub pair_capacity: u32,
    /// `BACKGROUND_*`.
    pub background_mode: u32,
    /// Samples per pixel of the opaque depth; 0 if there is none.
    pub opaque_samples: u32,
    /// Color, or the factor on the light of an environment map; w: factor on the transmittance behind the environment map, 0 or 1.
    pub background: [f32; 4],
    /// `P00, P11, P02, P12`.
    pub projection: [f32; 4],
    /// Column x of camera-to-world; w: x of the camera position.
    pub world_x: [f32; 4],
    /// Column y; w: y of the camera position.
    pub world_y: [f32; 4],
    /// Column z; w: z of the camera position.
    pub world_z: [f32; 4],
    /// Texels of the environment map.
    pub environment_size: [u32; 2],
    /// Corner of the view in the opaque depth texture.
    pub opaque_origin: [u32; 2],
    /// From opaque depth `d` to camera space: `z = (x + y d) / (z + w d)`.
    pub opaque_distance: [f32; 4],
    /// Lighting of the environment map: `LIGHTING_*`.
    pub environment_lighting: u32,
    /// `DEBUG_*`.
    pub debug: u32,
    /// Depth that the debug view shows half as bright as depth 0, camera units.
    pub debug_depth: f32,
    /// Opacity of the environment map, from 0 to 1.
    pub environment_opacity: f32,
    /// The same as in [`InstanceUniforms`].
    pub binning: [u32; 4],
}

/// Returns the lighting of an appearance as a constant of the shaders: `LIGHTING_*`.
pub fn lighting_mode(appearance: &Appearance, space: BlendSpace) -> u32 {
    match appearance.lighting(space) {
        Lighting::AsTrained => LIGHTING_AS_TRAINED,
        Lighting::Encoded => LIGHTING_ENCODED,
        Lighting::Linear => LIGHTING_LINEAR,
    }
}

/// Returns a debug view as a constant of the shaders: `DEBUG_*`.
pub fn debug_mode(debug: DebugView) -> u32 {
    match debug {
        DebugView::Color => DEBUG_COLOR,
        DebugView::Depth => DEBUG_DEPTH,
        DebugView::Overdraw => DEBUG_OVERDRAW,
        DebugView::Active => DEBUG_ACTIVE,
        DebugView::Lifespan => DEBUG_LIFESPAN,
        DebugView::Velocity => DEBUG_VELOCITY,
    }
}

/// Debug view of colors, the default.
pub const DEBUG_COLOR: u32 = 0;
/// Debug view of the expected depth.
pub const DEBUG_DEPTH: u32 = 1;
/// Debug view of the number of splats per pixel.
pub const DEBUG_OVERDRAW: u32 = 2;
/// Debug view of the Gaussians that are active according to the filter.
pub const DEBUG_ACTIVE: u32 = 3;
/// Debug view of temporal deviations.
pub const DEBUG_LIFESPAN: u32 = 4;
/// Debug view of velocities.
pub const DEBUG_VELOCITY: u32 = 5;

/// Gaussians of a page of a capture in chunk files: as in the table of the files, and as many as in a block of the packed form.
pub const PAGE: u32 = ChunkTable::PAGE as u32;
const _: () = assert!(PAGE as usize == packed::BLOCK, "the ranges of a block are those of a page");

/// No filter: all Gaussians of the pages that are listed.
pub const FILTER_ALL: u32 = 0;
/// A filter of one bit for each Gaussian and segment.
pub const FILTER_BITS: u32 = 1;
/// A filter of one interval of segments for each Gaussian.
pub const FILTER_INTERVALS: u32 = 2;
/// Depth key of a slot without a splat.
pub const INVISIBLE: u32 = u32::MAX;

/// No background: the picture is composited later.
pub const BACKGROUND_NONE: u32 = 0;
/// A background of one color.
pub const BACKGROUND_COLOR: u32 = 1;
/// The environment map as background.
pub const BACKGROUND_ENVIRONMENT: u32 = 2;

/// A splat: a Gaussian sliced at a time and projected to a view, with its color.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SplatRecord {
    /// Center in pixels.
    pub center: [f32; 2],
    /// Opacity times marginal.
    pub opacity: f32,
    /// Depth, camera units.
    pub depth: f32,
    /// Inverse covariance, factored: `x (dx + y dy)² + z dy²`.
    pub conic: [f32; 3],
    /// Tiles x0 and y0, 16 bits each.
    pub tiles_low: u32,
    /// Color.
    pub color: [f32; 3],
    /// Tiles x1 and y1 (excluded), 16 bits each.
    pub tiles_high: u32,
}

/// A splat of tile bins, without its color.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SplatShape {
    /// Center in pixels, opacity times marginal, depth in camera units.
    pub place: [f32; 4],
    /// Inverse covariance, factored: `x (dx + y dy)² + z dy²`; unused.
    pub conic: [f32; 4],
}

/// Further data of a visible splat of tile bins.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct VisibleSplat {
    /// Viewing direction, or color in some debug views; time from the frame to the temporal mean.
    pub seen: [f32; 4],
    /// Slot, index of the Gaussian; tiles x0 and y0, x1 and y1 (excluded), 16 bits each.
    pub words: [u32; 4],
}

/// Counters that the GPU writes.
#[repr(C)]
#[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
pub struct Counters {
    /// Number of visible splats.
    pub visible: u32,
    /// Global sort: number of pairs written. Tile bins: number of pairs of the frame, written or not.
    pub pairs: u32,
    /// Global sort: number of pairs of the frame, written or not. Tile bins: number of splats in the fullest bin.
    pub pairs_wanted: u32,
    /// Unused.
    pub padding: u32,
}

/// One step of a radix sort.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
pub struct SortStep {
    /// First bit of the digit.
    pub shift: u32,
    /// `SORT_*`.
    pub source: u32,
    /// Capacity of the histogram in blocks, per digit.
    pub stride: u32,
    /// Unused.
    pub padding: u32,
}

/// Sorts all slots and leaves out invisible slots.
pub const SORT_SLOTS: u32 = 0;
/// Sorts the visible splats.
pub const SORT_VISIBLE: u32 = 1;
/// Sorts the pairs.
pub const SORT_PAIRS: u32 = 2;

/// Number of counters of tile bins before the counters of parts and bins: pairs of this frame, modulo 2³², how often this number
/// has wrapped, and the depth order of the farthest surface; then the [`Counters`] of the previous frame, the last of which is the number of pairs for which room was asked.
pub const BIN_COUNTERS: u32 = 7;
