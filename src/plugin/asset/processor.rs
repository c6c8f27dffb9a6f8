//! The processor: from captures of any format to packages, while the game's assets are processed.
//!
//! In: a capture of any format, and [`CaptureTransformerSettings`], which a `.meta` file beside the source contains.
//! Out: a package in the folder of processed assets, which the game loads by the name of the source.
//!
//! Bevy processes assets in `AssetMode::Processed`. A source without a `.meta` file is processed with the default
//! settings; where one exists, it names the processor and the settings, and the source is processed again when either
//! of them changes.

use super::loader::CaptureLoader;
use super::saver::PackageSaver;
use crate::codec::checkpoint;
use crate::gaussian::InvalidGaussian;
use crate::plugin::component::GaussianCapture;
use crate::scene::{
    FilterKind, Form, GaussianScene, MAX_SEGMENTS, PackError, Packing, RuntimeScene, TemporalFilter, TrainedWith,
};
use bevy::app::App;
use bevy::asset::AssetApp;
use bevy::asset::processor::LoadTransformAndSave;
use bevy::asset::transformer::{AssetTransformer, TransformedAsset};
use bevy::reflect::TypePath;
use serde::{Deserialize, Serialize};

/// Processes captures into packages. Checkpoints are processed so unless their `.meta` file says otherwise; a game
/// makes it the default of further extensions:
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::asset::CaptureProcessor;
///
/// /// Packs packages, too: those that were made without loss, for instance.
/// fn pack_packages(app: &mut App) {
///     app.set_default_asset_processor::<CaptureProcessor>("gs4d");
/// }
/// ```
pub type CaptureProcessor = LoadTransformAndSave<CaptureLoader, CaptureTransformer, PackageSaver>;

/// Makes captures smaller: packs them, lowers the degrees of their color, adds a temporal filter. Errors:
/// [`CaptureTransformError`].
#[derive(Debug, Default, Clone, Copy, TypePath)]
#[type_path = "bevy_gs4d::asset"]
pub struct CaptureTransformer;

/// What a processed capture is like.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CaptureTransformerSettings {
    /// The form of the Gaussians. Default: packed.
    pub form: ProcessedForm,
    /// How finely they are packed. No effect in the runtime form, and on captures that are packed already.
    pub packing: Packing,
    /// Highest spatial degree of color that is kept, 0 to 3. Default: 3.
    pub sh_degree: u32,
    /// Highest time degree of color that is kept, 0 to 2. Default: 2.
    pub sh_degree_t: u32,
    /// Number of segments of time of a support filter, which leaves out Gaussians that are not visible in a segment;
    /// `None` keeps the filter of the source, if it has one. Stills get none. Default: 10.
    pub segments: Option<u32>,
}

impl Default for CaptureTransformerSettings {
    fn default() -> Self {
        let form = ProcessedForm::default();
        Self { form, packing: Packing::default(), sh_degree: 3, sh_degree_t: 2, segments: Some(10) }
    }
}

/// The form of the Gaussians of a processed capture. The trained form, which offline tools need, is not among them: the
/// loader of a game slices it.
#[derive(Debug, Default, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum ProcessedForm {
    /// Single precision.
    Runtime,
    /// Quantized: a fourth of the bytes, and drawn without unpacking.
    #[default]
    Packed,
}

/// Why a capture could not be processed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CaptureTransformError {
    /// The packed form cannot hold it.
    #[error(transparent)]
    Pack(#[from] PackError),
    /// A Gaussian cannot be drawn.
    #[error(transparent)]
    Gaussian(#[from] InvalidGaussian),
    /// A temporal filter cannot have so many segments.
    #[error("a temporal filter has 1 to {MAX_SEGMENTS} segments, not {0}: change `segments` in the .meta file")]
    Segments(u32),
}

impl AssetTransformer for CaptureTransformer {
    type AssetInput = GaussianCapture;
    type AssetOutput = GaussianCapture;
    type Settings = CaptureTransformerSettings;
    type Error = CaptureTransformError;

    async fn transform<'a>(
        &'a self,
        capture: TransformedAsset<GaussianCapture>,
        settings: &'a CaptureTransformerSettings,
    ) -> Result<TransformedAsset<GaussianCapture>, CaptureTransformError> {
        let processed = GaussianCapture::new(transformed(capture.scene().clone(), settings)?);
        let usages = capture.usages();
        Ok(capture.replace_asset(processed.with_usages(usages)))
    }
}

/// Returns a scene with these settings. Levels of detail are dropped, since they were made from another one.
fn transformed(
    scene: RuntimeScene,
    settings: &CaptureTransformerSettings,
) -> Result<RuntimeScene, CaptureTransformError> {
    if let Some(segments) = settings.segments.filter(|segments| !(1..=MAX_SEGMENTS).contains(segments)) {
        return Err(CaptureTransformError::Segments(segments));
    }
    let mut scene = GaussianScene::from(scene);
    scene.levels.clear();
    if settings.form == ProcessedForm::Runtime {
        scene = scene.unpacked();
    }
    scene.form.truncate_colors(settings.sh_degree, settings.sh_degree_t);
    let scene = scene.into_runtime()?;
    let mut scene = match (settings.form, &scene.form) {
        (ProcessedForm::Packed, Form::Sliced(_)) => scene.pack(&settings.packing)?,
        _ => scene,
    };
    let TrainedWith { time_interval: interval, marginal_cutoff, .. } = scene.trained_with;
    let has_windows = scene.filter.as_ref().is_some_and(|filter| filter.kind == FilterKind::Window);
    if let Some(segments) = settings.segments.filter(|_| interval[1] > interval[0] && !has_windows) {
        scene.filter = Some(TemporalFilter::support(scene.iter(), interval, marginal_cutoff, segments));
    }
    Ok(scene)
}

/// Registers the processor, and makes it the default of checkpoints. Without Bevy's processor nothing is registered.
pub(super) fn register(app: &mut App) {
    app.register_asset_processor(CaptureProcessor::new(CaptureTransformer, PackageSaver));
    for extension in checkpoint::EXTENSIONS {
        app.set_default_asset_processor::<CaptureProcessor>(extension);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::synth::{SynthSettings, synthesize};

    fn scene() -> RuntimeScene {
        let scene = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
        scene.into_runtime().expect("a synthetic scene can be drawn")
    }

    #[test]
    fn settings_decide_form_colors_and_filter() {
        let packed = transformed(scene(), &CaptureTransformerSettings::default()).expect("the scene fits");
        assert!(matches!(packed.form, Form::Packed(_)), "packed by default");
        assert_eq!(packed.filter.as_ref().map(|filter| filter.segments), Some(10), "with a filter");
        assert_eq!(packed.check(), Ok(()), "all parts fit together");
        let plain = CaptureTransformerSettings {
            form: ProcessedForm::Runtime,
            sh_degree: 1,
            segments: None,
            ..CaptureTransformerSettings::default()
        };
        let plain = transformed(scene(), &plain).expect("the scene fits");
        assert!(matches!(plain.form, Form::Sliced(_)) && plain.filter.is_none(), "neither packed nor filtered");
        assert_eq!(plain.form.color_degrees().degree, 1, "colors of a lower degree");
        assert!(plain.iter().eq(scene().iter()), "the Gaussians do not change in the runtime form");
    }

    #[test]
    fn a_packed_scene_is_not_packed_again() {
        let packed = scene().pack(&Packing::default()).expect("the scene fits");
        let settings = CaptureTransformerSettings { segments: None, ..CaptureTransformerSettings::default() };
        assert_eq!(transformed(packed.clone(), &settings).ok(), Some(packed), "it is unchanged");
    }

    #[test]
    fn a_filter_without_segments_is_refused() {
        for segments in [0, MAX_SEGMENTS + 1] {
            let settings =
                CaptureTransformerSettings { segments: Some(segments), ..CaptureTransformerSettings::default() };
            let error = transformed(scene(), &settings).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(error.contains(&format!("not {segments}: change `segments`")), "count and remedy: {error}");
        }
    }
}
