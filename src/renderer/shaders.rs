//! The shaders: WGSL with imports.
//!
//! In: the name of a pass. Out: its WGSL text, or a wgpu shader module. The files are compiled into the binary. [`SHADERS`] has the passes of the
//! renderer; other modules have sets of their own, which import the same libraries.

use super::device::GpuError;
use super::wgsl::{Library, composed};
use crate::scene::{Form, PackedColors, PackedScene};

/// Libraries by name.
const LIBRARIES: &[Library] = &[
    ("types", include_str!("../../shaders/shared/types.wgsl")),
    ("records", include_str!("../../shaders/shared/records.wgsl")),
    ("conic", include_str!("../../shaders/shared/conic.wgsl")),
    ("importance", include_str!("../../shaders/shared/importance.wgsl")),
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
    ("projection", include_str!("../../shaders/shared/projection.wgsl")),
    ("bins", include_str!("../../shaders/shared/bins.wgsl")),
    ("filling", include_str!("../../shaders/shared/filling.wgsl")),
    ("nearest", include_str!("../../shaders/shared/nearest.wgsl")),
    ("pixel", include_str!("../../shaders/shared/pixel.wgsl")),
];

/// Passes by name.
const PASSES: &[Library] = &[
    ("activate", include_str!("../../shaders/activate.wgsl")),
    ("project", include_str!("../../shaders/global_sort/project.wgsl")),
    ("sort", include_str!("../../shaders/global_sort/sort.wgsl")),
    ("bin", include_str!("../../shaders/global_sort/bin.wgsl")),
    ("ranges", include_str!("../../shaders/global_sort/ranges.wgsl")),
    ("blend", include_str!("../../shaders/global_sort/blend.wgsl")),
    ("find_surfaces", include_str!("../../shaders/tile_bins/find_surfaces.wgsl")),
    ("project_bin", include_str!("../../shaders/tile_bins/project_bin.wgsl")),
    ("place_bins", include_str!("../../shaders/tile_bins/place_bins.wgsl")),
    ("fill_bins", include_str!("../../shaders/tile_bins/fill_bins.wgsl")),
    ("colors", include_str!("../../shaders/tile_bins/colors.wgsl")),
    ("sort_bins", include_str!("../../shaders/tile_bins/sort_bins.wgsl")),
    ("blend_blocks", include_str!("../../shaders/tile_bins/blend_blocks.wgsl")),
    ("motion", include_str!("../../shaders/motion.wgsl")),
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

/// The definition of `motion` for splats in tile bins.
pub const BINNED: &[&str] = &["BINNED"];

/// Definitions of `project`, `project_bin` and `colors` for several instances in one dispatch: each thread copies the uniforms of its
/// instance. On software drivers, dispatches of a single instance and `motion` use them too: if a branch depends on uniforms alone, Mesa's
/// driver recompiles a long shader with the values of the uniforms; version 22 does so at every bind, and keeps all variants.
pub const COPIED_INSTANCE: &[&str] = &["COPIED_INSTANCE"];

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

    /// Returns the place of the kind in [`ALL`](Self::ALL).
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

/// Definitions of `blend` on software drivers whose subgroups always have 8 threads, and which load from memory thread by thread: a subgroup
/// loads a splat once for all its threads.
pub const SUBGROUPS_OF_8: &[&str] = &["SUBGROUPS_OF_8"];

/// The passes of the renderer. The definitions of those that read captures are those of a [`Storage`], and [`COPIED_INSTANCE`]; of those that
/// write pixels, [`MULTISAMPLED`] and those of a [`ColorPrecision`]. Each design has further definitions for its own passes.
pub static SHADERS: ShaderSet = ShaderSet::new(PASSES, &[]);

/// Passes, and the libraries that they import besides those of the renderer.
pub struct ShaderSet {
    passes: &'static [Library],
    libraries: &'static [Library],
}

impl ShaderSet {
    /// Returns a set of these passes and libraries, each with its name.
    pub const fn new(passes: &'static [Library], libraries: &'static [Library]) -> Self {
        Self { passes, libraries }
    }

    /// Returns the names of the passes.
    pub fn names(&self) -> impl Iterator<Item = &'static str> + use<> {
        self.passes.iter().map(|(name, _)| *name)
    }

    /// Returns the WGSL text of a pass with its libraries and these definitions.
    ///
    /// # Errors
    /// When there is no such pass, or a directive is not understood.
    pub fn compose(&self, name: &str, definitions: &[&str]) -> Result<String, GpuError> {
        let Some(&(name, source)) = self.passes.iter().find(|(pass, _)| *pass == name) else {
            return Err(GpuError::Shader { name: "unknown", reason: format!("there is no pass `{name}`") });
        };
        let libraries = LIBRARIES.iter().chain(self.libraries);
        composed(source, libraries, definitions).map_err(|reason| GpuError::Shader { name, reason })
    }

    /// Creates the shader module of a pass from the result of [`compose`](Self::compose). The device reports a text that does not compile.
    ///
    /// # Errors
    /// As [`compose`](Self::compose).
    pub fn module(
        &self,
        device: &wgpu::Device,
        name: &'static str,
        definitions: &[&str],
        checks: ShaderChecks,
    ) -> Result<wgpu::ShaderModule, GpuError> {
        let source = wgpu::ShaderSource::Wgsl(self.compose(name, definitions)?.into());
        let descriptor = wgpu::ShaderModuleDescriptor { label: Some(name), source };
        Ok(match checks {
            ShaderChecks::On => device.create_shader_module(descriptor),
            ShaderChecks::Off => trusted(device, descriptor),
        })
    }
}

#[expect(unsafe_code, reason = "wgpu marks shaders without run-time checks as unsafe")]
fn trusted(device: &wgpu::Device, descriptor: wgpu::ShaderModuleDescriptor<'_>) -> wgpu::ShaderModule {
    // SAFETY: the shaders are part of this crate. Each index is below a count by which the host sized the buffer (slots, pair capacity, tiles,
    // blocks), and each loop ends at such a count.
    unsafe { device.create_shader_module_trusted(descriptor, wgpu::ShaderRuntimeChecks::unchecked()) }
}
