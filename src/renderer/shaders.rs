//! The shaders: WGSL with imports, composed by naga_oil.
//!
//! In: the name of a pass. Out: a naga module, or a wgpu shader module. The files are compiled into the binary.

use super::error::GpuError;
use crate::scene::{Form, PackedColors, PackedScene};
use naga_oil::compose::{ComposableModuleDescriptor, Composer, NagaModuleDescriptor, ShaderDefValue};
use std::borrow::Cow;
use std::sync::{Mutex, PoisonError};
use wgpu::naga::valid::Capabilities;

/// Libraries, each before the libraries that import it.
const LIBRARIES: &[(&str, &str)] = &[
    ("types", include_str!("../../shaders/shared/types.wgsl")),
    ("records", include_str!("../../shaders/shared/records.wgsl")),
    ("conic", include_str!("../../shaders/shared/conic.wgsl")),
    ("alpha", include_str!("../../shaders/shared/alpha.wgsl")),
    ("tile", include_str!("../../shaders/shared/tile.wgsl")),
    ("srgb", include_str!("../../shaders/shared/srgb.wgsl")),
    ("appearance", include_str!("../../shaders/shared/appearance.wgsl")),
    ("harmonics", include_str!("../../shaders/shared/harmonics.wgsl")),
    ("packed", include_str!("../../shaders/shared/packed.wgsl")),
    ("scan", include_str!("../../shaders/shared/scan.wgsl")),
    ("environment", include_str!("../../shaders/shared/environment.wgsl")),
    ("capture", include_str!("../../shaders/shared/capture.wgsl")),
    ("color", include_str!("../../shaders/shared/color.wgsl")),
    ("bins", include_str!("../../shaders/shared/bins.wgsl")),
    ("nearest", include_str!("../../shaders/shared/nearest.wgsl")),
    ("pixel", include_str!("../../shaders/shared/pixel.wgsl")),
    ("random", include_str!("../../shaders/shared/random.wgsl")),
    ("trained", include_str!("../../shaders/shared/trained.wgsl")),
    ("slice_backward", include_str!("../../shaders/shared/slice_backward.wgsl")),
    ("pairs", include_str!("../../shaders/shared/pairs.wgsl")),
];

/// Passes by name.
const PASSES: &[(&str, &str)] = &[
    ("activate", include_str!("../../shaders/activate.wgsl")),
    ("project", include_str!("../../shaders/project.wgsl")),
    ("sort", include_str!("../../shaders/sort.wgsl")),
    ("bin", include_str!("../../shaders/bin.wgsl")),
    ("ranges", include_str!("../../shaders/ranges.wgsl")),
    ("blend", include_str!("../../shaders/blend.wgsl")),
    ("colors", include_str!("../../shaders/colors.wgsl")),
    ("sort_bins", include_str!("../../shaders/sort_bins.wgsl")),
    ("blend_blocks", include_str!("../../shaders/blend_blocks.wgsl")),
    ("motion", include_str!("../../shaders/motion.wgsl")),
    ("score", include_str!("../../shaders/score.wgsl")),
    ("slice", include_str!("../../shaders/slice.wgsl")),
    ("rounding", include_str!("../../shaders/rounding.wgsl")),
    ("loss", include_str!("../../shaders/loss.wgsl")),
    ("blend_backward", include_str!("../../shaders/blend_backward.wgsl")),
    ("project_backward", include_str!("../../shaders/project_backward.wgsl")),
    ("regularize", include_str!("../../shaders/regularize.wgsl")),
    ("codebooks", include_str!("../../shaders/codebooks.wgsl")),
    ("adam", include_str!("../../shaders/adam.wgsl")),
    ("dropout", include_str!("../../shaders/dropout.wgsl")),
    ("noise", include_str!("../../shaders/noise.wgsl")),
    ("relocate", include_str!("../../shaders/relocate.wgsl")),
];

/// Whether shaders check their array indices and loops at run time, which can be slow. Default: [`Off`](Self::Off).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ShaderChecks {
    /// No checks: every index is bounded by construction.
    #[default]
    Off,
    /// With checks, to find defects.
    On,
}

/// Returns the names of all passes.
pub fn pass_names() -> impl Iterator<Item = &'static str> {
    PASSES.iter().map(|(name, _)| *name)
}

/// How a capture is stored, and therefore how `project` and `colors` read it: a [`Form`] without its values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Storage {
    /// Single precision.
    Sliced,
    /// Packed records, whole colors.
    Packed,
    /// Packed records, colors by codebook.
    Coded,
}

impl Storage {
    /// All kinds of storage.
    pub const ALL: [Self; 3] = [Self::Sliced, Self::Packed, Self::Coded];

    /// Returns the storage of a form.
    pub fn of(form: &Form) -> Self {
        match form {
            Form::Sliced(_) => Self::Sliced,
            Form::Packed(PackedScene { colors: PackedColors::Whole(_), .. }) => Self::Packed,
            Form::Packed(PackedScene { colors: PackedColors::Coded(_), .. }) => Self::Coded,
        }
    }

    /// Returns the shader definitions with which `project` and `colors` read a capture with this storage.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Sliced => &[],
            Self::Packed => &["PACKED_GEOMETRY"],
            Self::Coded => &["PACKED_GEOMETRY", "CODED_COLORS"],
        }
    }
}

/// The definition of `blend` for multisampled opaque depth.
pub const MULTISAMPLED: &[&str] = &["MULTISAMPLED"];

/// Definitions of `blend_backward` and `project_backward` that reproduce the gradients of the original, including its deviations.
pub const COMPAT: &[&str] = &["COMPAT"];

/// Like [`COMPAT`], for captures whose color does not depend on time.
pub const COMPAT_WITHOUT_TIME: &[&str] = &["COMPAT", "WITHOUT_TIME"];

/// The definition of `blend_backward` and `project_backward` that sums by float atomics, for devices that support them.
pub const ATOMIC_SUMS: &[&str] = &["ATOMIC_SUMS"];

/// Number of splats that `blend` blends in an iteration once it has blended the first splats of a tile. Mesa's software driver ends all loops
/// of a thread after 65,535 iterations; long lists are blended completely if an iteration blends many splats. Hardware blends one: the code
/// for many is long.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum AtOnce {
    /// One splat.
    #[default]
    One,
    /// 16 splats.
    Sixteen,
    /// 64 splats.
    SixtyFour,
}

impl AtOnce {
    /// All numbers, ascending.
    pub const ALL: [Self; 3] = [Self::One, Self::Sixteen, Self::SixtyFour];

    /// Returns the number of splats.
    pub(super) fn splats(self) -> u32 {
        match self {
            Self::One => 1,
            Self::Sixteen => 16,
            Self::SixtyFour => 64,
        }
    }

    /// Returns the definitions of `blend`.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::One => &[],
            Self::Sixteen => &["MANY_AT_ONCE", "SIXTEEN_AT_ONCE"],
            Self::SixtyFour => &["MANY_AT_ONCE", "SIXTY_FOUR_AT_ONCE"],
        }
    }
}

/// Definitions of the passes of the fast design in `project` (`project_bin`) and in `motion`.
pub const BINNED: &[&str] = &["BINNED"];

/// Definitions of `project`, `project_bin` and `colors` for several instances in one dispatch: each thread copies the uniforms of its
/// instance. On software drivers, dispatches of a single instance and `motion` use them too: if a branch depends on uniforms alone, Mesa's
/// driver recompiles a long shader with the values of the uniforms; version 22 does so at every bind, and keeps all variants.
pub const COPIED_INSTANCE: &[&str] = &["COPIED_INSTANCE"];

/// Capacity of the list of splats that `sort_bins` sorts in workgroup memory. With a small capacity, more workgroups run at the same time;
/// bins with more splats are sorted in rounds.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Lists {
    /// 1280 splats, 256 threads: for every device.
    #[default]
    Short,
    /// 2304 splats, 512 threads.
    Medium,
    /// 5120 splats, 512 threads.
    Long,
}

impl Lists {
    /// All lengths.
    pub const ALL: [Self; 3] = [Self::Short, Self::Medium, Self::Long];

    /// Returns the definitions of `sort_bins`.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Short => &[],
            Self::Medium => &["MEDIUM_LISTS"],
            Self::Long => &["LONG_LISTS"],
        }
    }

    /// Returns the number of splats that `sort_bins` sorts at once, and its threads: `LIST` and `THREADS` of the shader.
    pub(super) fn sizes(self) -> [u32; 2] {
        match self {
            Self::Short => [1280, 256],
            Self::Medium => [2304, 512],
            Self::Long => [5120, 512],
        }
    }

    /// Returns an upper bound of the workgroup memory of `sort_bins` with these lists, bytes.
    pub fn memory(self) -> u32 {
        match self {
            Self::Short => 16 * 1024,
            Self::Medium => 32 * 1024,
            Self::Long => 48 * 1024,
        }
    }

    /// Returns the length that suits a device and the number of splats of the fullest bin.
    pub(super) fn suiting(limits: &wgpu::Limits, fullest: u32) -> Self {
        let memory = limits.max_compute_workgroup_storage_size;
        let threads = limits.max_compute_workgroup_size_x.min(limits.max_compute_invocations_per_workgroup);
        if threads < 512 || memory < Self::Medium.memory() {
            Self::Short
        } else if fullest <= 2304 || memory < Self::Long.memory() {
            Self::Medium
        } else {
            Self::Long
        }
    }
}

/// Precision of the color and transmittance of each pixel.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum ColorPrecision {
    /// `Rgba32Float`: 16 bytes for each pixel.
    #[default]
    Single,
    /// `Rgba16Float`: 8 bytes for each pixel, for targets of half precision.
    Half,
}

impl ColorPrecision {
    /// Returns the format of the texture.
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Single => wgpu::TextureFormat::Rgba32Float,
            Self::Half => wgpu::TextureFormat::Rgba16Float,
        }
    }

    /// Returns the definitions of `blend` and `blend_blocks`.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Single => &[],
            Self::Half => &["HALF_COLOR"],
        }
    }
}

/// The variant of the pixel passes, which determines the layout of their bindings.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Pixels {
    /// Whether the opaque depth is multisampled.
    pub multisampled: bool,
    pub precision: ColorPrecision,
}

impl Pixels {
    /// All kinds, by [`index`](Self::index).
    pub(super) const ALL: [Self; 4] = [
        Self { multisampled: false, precision: ColorPrecision::Single },
        Self { multisampled: true, precision: ColorPrecision::Single },
        Self { multisampled: false, precision: ColorPrecision::Half },
        Self { multisampled: true, precision: ColorPrecision::Half },
    ];

    pub(super) fn index(self) -> usize {
        usize::from(self.multisampled) + 2 * self.precision as usize
    }

    /// Returns the definitions of `blend`.
    pub(super) fn definitions(self) -> Vec<&'static str> {
        let multisampled = if self.multisampled { MULTISAMPLED } else { &[] };
        [multisampled, self.precision.definitions()].concat()
    }
}

/// Definitions of `sort_bins` and `blend_blocks` on devices whose subgroups always have 32 threads.
pub const SUBGROUPS_OF_32: &[&str] = &["SUBGROUPS_OF_32"];

/// Definitions of `blend_blocks` for small pictures.
pub const LARGE_BATCHES: &[&str] = &["LARGE_BATCHES"];

/// Definitions of `blend_blocks` for small pictures with [`Blending::Color`] and [`Blending::ColorBehindSurfaces`]: each thread processes more
/// splats of its pixel at once, since few threads run.
pub const EIGHT_AT_ONCE: &[&str] = &["LARGE_BATCHES", "EIGHT_AT_ONCE"];

/// The outputs of `blend_blocks` and the opaque surfaces that it supports. If several variants can draw a picture, the results are the same;
/// the first is the fastest.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Blending {
    /// Color, without opaque surfaces.
    Color,
    /// Color, hidden by opaque surfaces.
    ColorBehindSurfaces,
    /// Color, hidden by opaque surfaces with several samples per pixel.
    ColorBehindSamples,
    /// Color and depths, opaque surfaces, every debug view.
    #[default]
    All,
    /// Color and depths, multisampled opaque surfaces, every debug view.
    AllMultisampled,
}

impl Blending {
    /// All kinds.
    pub const ALL: [Self; 5] =
        [Self::Color, Self::ColorBehindSurfaces, Self::ColorBehindSamples, Self::All, Self::AllMultisampled];

    /// Returns the definitions of `blend_blocks`.
    pub fn definitions(self) -> &'static [&'static str] {
        match self {
            Self::Color => &[],
            Self::ColorBehindSurfaces => &["OPAQUE"],
            Self::ColorBehindSamples => &["OPAQUE", "MULTISAMPLED"],
            Self::All => &["DEPTHS"],
            Self::AllMultisampled => &["DEPTHS", "MULTISAMPLED"],
        }
    }

    /// Returns whether depths are written.
    pub(super) fn writes_depths(self) -> bool {
        matches!(self, Self::All | Self::AllMultisampled)
    }

    /// Returns whether the opaque depth is multisampled.
    pub(super) fn is_multisampled(self) -> bool {
        matches!(self, Self::ColorBehindSamples | Self::AllMultisampled)
    }
}

/// Definitions of `project_bin` for at most [`FEW_BINS_LIMIT`] bins.
pub const FEW_BINS: &[&str] = &["FEW_BINS"];

/// The number of counters of bins with [`FEW_BINS`].
pub const FEW_BINS_LIMIT: u32 = 512;

/// The variants of the passes of a frame of the fast design.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct FastVariant {
    pub few_bins: bool,
    pub lists: Lists,
    pub blending: Blending,
    pub precision: ColorPrecision,
    pub large_batches: bool,
}

impl FastVariant {
    /// Number of variants of `blend_blocks`.
    pub(super) const BLENDS: usize = 4 * Blending::ALL.len();

    /// Returns the index of its `blend_blocks`, below [`BLENDS`](Self::BLENDS).
    pub(super) fn blend_index(self) -> usize {
        (self.blending as usize * 2 + self.precision as usize) * 2 + usize::from(self.large_batches)
    }

    /// Returns the definitions of `blend_blocks`.
    pub(super) fn blend_definitions(self) -> Vec<&'static str> {
        let batches = match self.blending {
            _ if !self.large_batches => &[],
            Blending::Color | Blending::ColorBehindSurfaces => EIGHT_AT_ONCE,
            _ => LARGE_BATCHES,
        };
        [self.blending.definitions(), self.precision.definitions(), batches].concat()
    }

    /// Returns the other variants that draw the same picture, perhaps not as fast: with lists of other lengths, counters for any number of bins,
    /// batches of another size.
    pub(super) fn substitutes(self) -> impl Iterator<Item = Self> {
        let bins = if self.few_bins { &[true, false][..] } else { &[false] };
        let lists = [self.lists].into_iter().chain(Lists::ALL);
        let batches = [self.large_batches, !self.large_batches];
        lists
            .flat_map(move |lists| batches.map(|large_batches| Self { lists, large_batches, ..self }))
            .flat_map(move |variant| bins.iter().map(move |&few_bins| Self { few_bins, ..variant }))
    }

    pub(super) fn pixels(self) -> Pixels {
        Pixels { multisampled: self.blending.is_multisampled(), precision: self.precision }
    }
}

/// Returns the validated naga module of a pass with resolved imports and these definitions: the definitions of a [`Storage`] and
/// [`COPIED_INSTANCE`] for `project`, `colors` and `motion`, [`MULTISAMPLED`] and the definitions of a [`ColorPrecision`] and of [`AtOnce`] for
/// `blend`, the definitions of the passes of the fast design, none for other passes.
///
/// # Errors
/// When there is no such pass or it does not compile.
pub fn compose(name: &str, definitions: &[&str]) -> Result<wgpu::naga::Module, GpuError> {
    let Some(&(name, source)) = PASSES.iter().find(|(pass, _)| *pass == name) else {
        return Err(GpuError::Shader { name: "unknown", reason: format!("there is no pass `{name}`") });
    };
    let uses = |own: &[&str]| definitions.iter().any(|definition| own.contains(definition));
    let (composer, optional) = if uses(SUBGROUPS_OF_32) {
        (1, Capabilities::SUBGROUP)
    } else if uses(ATOMIC_SUMS) {
        (2, Capabilities::SHADER_FLOAT32_ATOMIC)
    } else {
        (0, Capabilities::empty())
    };
    let mut composer = COMPOSERS[composer].lock().unwrap_or_else(PoisonError::into_inner);
    if composer.is_none() {
        // WebGPU supports half-precision values packed into words.
        *composer = Some(with_libraries(Capabilities::SHADER_FLOAT16_IN_FLOAT32 | optional)?);
    }
    let Some(composer) = composer.as_mut() else {
        return Err(GpuError::Shader { name, reason: "there is no composer".into() });
    };
    let shader_defs = definitions.iter().map(|name| ((*name).to_owned(), ShaderDefValue::Bool(true))).collect();
    let descriptor = NagaModuleDescriptor { source, file_path: name, shader_defs, ..Default::default() };
    composer
        .make_naga_module(descriptor)
        .map_err(|error| GpuError::Shader { name, reason: error.emit_to_string(composer) })
}

/// Composers that have parsed the libraries: without optional capabilities, with subgroups, with float atomics.
static COMPOSERS: [Mutex<Option<Composer>>; 3] = [const { Mutex::new(None) }; 3];

/// Returns a composer that has parsed the libraries.
fn with_libraries(capabilities: Capabilities) -> Result<Composer, GpuError> {
    let mut composer = Composer::default().with_capabilities(capabilities);
    for &(library, source) in LIBRARIES {
        let descriptor = ComposableModuleDescriptor { source, file_path: library, ..Default::default() };
        if let Err(error) = composer.add_composable_module(descriptor) {
            return Err(GpuError::Shader { name: library, reason: error.emit_to_string(&composer) });
        }
    }
    Ok(composer)
}

/// Creates the shader module of a pass from the result of [`compose`].
///
/// # Errors
/// As [`compose`].
pub fn module(
    device: &wgpu::Device,
    name: &'static str,
    definitions: &[&str],
    checks: ShaderChecks,
) -> Result<wgpu::ShaderModule, GpuError> {
    let descriptor = wgpu::ShaderModuleDescriptor {
        label: Some(name),
        source: wgpu::ShaderSource::Naga(Cow::Owned(compose(name, definitions)?)),
    };
    Ok(match checks {
        ShaderChecks::On => device.create_shader_module(descriptor),
        ShaderChecks::Off => trusted(device, descriptor),
    })
}

#[expect(unsafe_code, reason = "wgpu marks shaders without run-time checks as unsafe")]
fn trusted(device: &wgpu::Device, descriptor: wgpu::ShaderModuleDescriptor<'_>) -> wgpu::ShaderModule {
    // SAFETY: the shaders are part of this crate. Each index is below a count by which the host sized the buffer (slots, pair capacity, tiles,
    // blocks), and each loop ends at such a count.
    unsafe { device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) }
}
