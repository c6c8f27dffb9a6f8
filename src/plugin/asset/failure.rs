//! Why a capture is not shown.
//!
//! In: an error of Bevy's asset server, or of the renderer. Out: a [`CaptureFailure`], which games can tell apart, and
//! whose text names the file, the fault and, if there is one, the remedy.

use super::loader::CaptureLoadError;
use crate::renderer::GpuError;
use bevy::asset::AssetLoadError;
use bevy::asset::io::AssetReaderError;
use bevy::reflect::Reflect;

/// Why a capture could not be loaded, or cannot be drawn. Its text names the file, the fault and, if there is one, the
/// remedy.
///
/// The field `path` is the path of the asset; of captures that were not loaded from a file, their identifier.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// fn report(mut failures: MessageReader<CaptureFailed>) {
///     for failure in failures.read() {
///         match &failure.error {
///             CaptureFailure::NotFound { path, .. } => warn!("{path} is not in this edition of the game"),
///             CaptureFailure::OutOfMemory { .. } => warn!("fewer captures fit this graphics card"),
///             // The text of every failure.
///             other => warn!("{other}"),
///         }
///     }
/// }
/// # bevy::ecs::system::assert_is_system(report);
/// ```
#[derive(Reflect, Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[reflect(Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::asset"]
#[non_exhaustive]
pub enum CaptureFailure {
    /// The asset source has no such file.
    #[error("{path}: there is no file {file}; check the name, and that the file is in the folder of the app's assets")]
    NotFound {
        /// Path of the asset.
        path: String,
        /// The file that was looked for.
        file: String,
    },
    /// The asset source could not deliver the bytes of the file, or of another file that it names.
    #[error("{path}: {reason}")]
    Unreadable {
        /// Path of the asset.
        path: String,
        /// The fault.
        reason: String,
    },
    /// The file is damaged, is of no known format, or contains a Gaussian that cannot be drawn.
    #[error("{path}: {reason}")]
    Invalid {
        /// Path of the asset.
        path: String,
        /// The fault and the remedy.
        reason: String,
    },
    /// Bevy could not load the asset for another reason, for example because no loader is registered for the extension.
    /// The text names the path, if the asset has one.
    #[error("{0}")]
    NotLoaded(String),
    /// No capture can be drawn on this GPU or in this app.
    #[error("{path}: not drawn: {reason}")]
    NoRenderer {
        /// Path of the asset.
        path: String,
        /// What is missing.
        reason: String,
    },
    /// The capture needs a larger buffer than this GPU can bind.
    #[error("{path}: not drawn: {reason}")]
    TooLarge {
        /// Path of the asset.
        path: String,
        /// Size of the buffer, in bytes.
        needed: u64,
        /// Largest size that the GPU can bind, in bytes.
        limit: u64,
        /// The fault and the remedy.
        reason: String,
    },
    /// This GPU has no memory left for the capture.
    #[error("{path}: not drawn: {reason}")]
    OutOfMemory {
        /// Path of the asset.
        path: String,
        /// Smallest number of bytes needed.
        needed: u64,
        /// The fault and the remedy.
        reason: String,
    },
    /// The capture cannot be drawn on this GPU for another reason, or was assembled with inconsistent parts.
    #[error("{path}: not drawn: {reason}")]
    NotDrawable {
        /// Path of the asset.
        path: String,
        /// The fault and the remedy.
        reason: String,
    },
    /// The most important Gaussians of a moment of a capture in chunk files do not fit its share of
    /// [`StreamBudget::gpu_bytes`](crate::stream::StreamBudget::gpu_bytes).
    #[error(
        "{path}: the most important Gaussians of a moment take {needed} bytes on the GPU, and its share of \
         StreamBudget::gpu_bytes is {limit}: raise it, or cut the capture with a smaller first layer or into shorter stretches"
    )]
    OverBudget {
        /// Path of the asset.
        path: String,
        /// Bytes of these Gaussians.
        needed: u64,
        /// Its share of the budget, in bytes.
        limit: u64,
    },
    /// The GPU was lost or refused an object. After a lost device, also a capture of which no copy is in memory, with
    /// `RenderAssetUsages::RENDER_WORLD`: it must be loaded again.
    #[error("{path}: not drawn: {reason}")]
    Device {
        /// Path of the asset.
        path: String,
        /// The message of the GPU.
        reason: String,
    },
}

impl CaptureFailure {
    /// Returns the failure of loading an asset, without the names of loaders and types with which Bevy's message
    /// begins. `path`: the path of the asset; `None` if it has none.
    pub(super) fn of_loading(path: Option<String>, error: &AssetLoadError) -> Self {
        let Some(path) = path else { return Self::NotLoaded(error.to_string()) };
        match error {
            AssetLoadError::AssetReaderError(AssetReaderError::NotFound(file)) => {
                Self::NotFound { path, file: file.display().to_string() }
            }
            AssetLoadError::AssetReaderError(_) => Self::Unreadable { path, reason: error.to_string() },
            AssetLoadError::AssetLoaderError(failed) => match failed.error().downcast_ref::<CaptureLoadError>() {
                Some(fault @ CaptureLoadError::Read(_)) => Self::Unreadable { path, reason: fault.to_string() },
                Some(fault) => Self::Invalid { path, reason: fault.to_string() },
                None => Self::NotLoaded(format!("{path}: {}", failed.error()).trim_end().to_owned()),
            },
            _ => Self::NotLoaded(format!("{path}: {error}")),
        }
    }

    /// Returns the failure of an upload to the GPU.
    pub(crate) fn of_upload(path: String, error: &GpuError) -> Self {
        let reason = error.to_string();
        match *error {
            GpuError::TooLarge { needed, limit, .. } | GpuError::Picture { needed, limit, .. } => {
                Self::TooLarge { path, needed, limit, reason }
            }
            GpuError::Memory { needed, .. } => Self::OutOfMemory { path, needed, reason },
            GpuError::Refused(_) | GpuError::Device(_) => Self::Device { path, reason },
            GpuError::NoAdapter { .. }
            | GpuError::AdapterNotFound { .. }
            | GpuError::NoDevice { .. }
            | GpuError::Limit { .. }
            | GpuError::Shader { .. } => Self::NoRenderer { path, reason },
            GpuError::TooManySplats { .. } | GpuError::Size { .. } | GpuError::Scene(_) => {
                Self::NotDrawable { path, reason }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_of_the_gpu_keep_their_numbers_and_their_text() {
        let error = GpuError::TooLarge { what: "the splats", needed: 9, limit: 4 };
        let failure = CaptureFailure::of_upload("dancer.gs4d".into(), &error);
        assert!(matches!(failure, CaptureFailure::TooLarge { needed: 9, limit: 4, .. }), "both sizes: {failure:?}");
        assert_eq!(failure.to_string(), format!("dancer.gs4d: not drawn: {error}"), "the file, then the fault");
        let lost = CaptureFailure::of_upload("dancer.gs4d".into(), &GpuError::Device("lost".into()));
        assert!(matches!(lost, CaptureFailure::Device { .. }), "a lost device is told apart: {lost:?}");
    }
}
