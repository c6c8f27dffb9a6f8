//! Upload: copies a loaded capture to buffers on the GPU, once per asset, and again after a change or a lost device.
//!
//! In: [`GaussianCapture`] and the upload budget of a frame. Out: [`GpuGaussianCapture`] in `RenderAssets`, drawn once
//! it is complete, and its state in [`Uploads`], which is sent as messages. After a change, the old version is drawn
//! until the new one is complete, and kept if the GPU rejects the new one: if it refuses a buffer, has no memory for
//! it, or no view could draw the capture. A chunk file has no buffers of its own: it is uploaded into the pages of the
//! capture of which it is a file.

use super::budget::{ThinnedCapture, core_of};
use super::chunk_files::{ChunkFile, Destination, PlacedFiles, UploadTarget};
use crate::plugin::asset::{CaptureFailure, Uploads};
use crate::plugin::component::GaussianCapture;
use crate::plugin::render::logged::warn_once_each;
use crate::plugin::render::renderer::CaptureRenderer;
use crate::plugin::render::statistics::CaptureStatistics;
use crate::renderer::device::memory::{Caught, catch, catch_known};
use crate::renderer::{CaptureUpload, GpuCapture, GpuError, Storage, ViewRenderer};
use crate::scene::{Bounds, Importances, Level, RuntimeScene};
use crate::view::Optics;
use bevy::asset::{AssetId, AssetServer, RenderAssetUsages};
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::ecs::system::lifetimeless::SRes;
use bevy::ecs::system::{Res, ResMut, SystemParamItem};
use bevy::log::{debug_span, error, warn};
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;
use bevy::render::Extract;
use bevy::render::render_asset::{AssetExtractionError, PrepareAssetError, RenderAsset, RenderAssets};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use std::sync::Arc;
use std::thread::JoinHandle;

/// Why a capture is not uploaded again.
const WITHOUT_COPY: &str = "its Gaussians must be uploaded again, as after a lost device, and are no longer in memory: \
                            load the capture again; RenderAssetUsages::default() in CaptureLoaderSettings keeps a copy";

/// The number of bytes of captures that may be uploaded to the GPU in one frame: a resource.
///
/// A capture of 100 MB is drawn some frames after it has been loaded, and none of these frames is much longer.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::prelude::*;
///
/// /// Removes the limit, for example behind a loading screen, where frames may be long.
/// fn hurry(mut budget: ResMut<CaptureUploadBudget>) {
///     budget.bytes_per_frame = u64::MAX;
/// }
/// # bevy::ecs::system::assert_is_system(hurry);
/// ```
#[derive(Resource, Reflect, Debug, Clone, Copy, PartialEq, Eq)]
#[reflect(Resource, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::render"]
pub struct CaptureUploadBudget {
    /// Bytes per frame, summed over all captures; at least one Gaussian is uploaded. Default: 16 MiB.
    pub bytes_per_frame: u64,
}

impl Default for CaptureUploadBudget {
    fn default() -> Self {
        Self { bytes_per_frame: 16 << 20 }
    }
}

/// A capture on the GPU: empty until the upload is complete, and if it failed, which is logged and reported.
pub struct GpuGaussianCapture {
    shown: Option<Arc<ShownCapture>>,
    /// The version that will replace `shown`.
    next: Option<NextCapture>,
    /// A file of another capture.
    file: Option<ChunkFile>,
}

/// A capture whose upload is complete.
struct ShownCapture {
    /// All Gaussians, then each level of detail.
    levels: Vec<GpuCapture>,
    /// Those of each of the levels.
    importances: Vec<Importances>,
    /// The box around most of the Gaussians; `None` if there is none.
    core: Option<Bounds>,
    /// The source of these buffers, which may be older than the asset.
    source: GaussianCapture,
    /// The chunk files that are in the pages of the first of the levels.
    files: PlacedFiles,
}

impl ShownCapture {
    /// Keeps the chunk files of the version before, if the table of them is the same: they are not loaded again.
    fn keep_files(&mut self, mut before: Self, uploads: &Uploads) {
        let tables = self.source.scene().chunks.as_ref().zip(before.source.scene().chunks.as_ref());
        let levels = self.levels.first_mut().zip(before.levels.first_mut());
        if let Some((capture, from)) = levels.filter(|_| tables.is_some_and(|(table, other)| Arc::ptr_eq(table, other)))
        {
            capture.take_pages(from);
            self.files = before.files;
            (self.importances, self.core) = (before.importances, before.core);
        } else {
            before.files.forget(uploads);
        }
    }

    /// Changes the capture and its chunk files, with the place to which these are uploaded.
    fn change_files<T>(
        &mut self,
        to: &UploadTarget<'_>,
        most_bytes: u64,
        change: impl FnOnce(&mut GpuCapture, &mut PlacedFiles, &Destination<'_>) -> T,
    ) -> Option<T> {
        let Self { levels, importances, core, source, files } = self;
        let capture = levels.first_mut()?;
        let (before, index) = (capture.len(), &*source);
        let changed = change(capture, files, &Destination { target: *to, index, most_bytes });
        if let Some(importances) = importances.first_mut().filter(|_| capture.len() != before) {
            (*importances, *core) = (files.importances(), files.core());
        }
        Some(changed)
    }
}

/// A capture that is being uploaded.
struct NextCapture {
    /// All Gaussians, then each level of detail.
    uploads: Vec<CaptureUpload<Arc<RuntimeScene>>>,
    importances: Vec<Importances>,
    core: Option<Bounds>,
    source: GaussianCapture,
    /// Error scopes of the buffers, without results yet, as in browsers. Nothing is drawn until these arrive.
    pending: Option<Caught>,
    /// The thread that compiles the passes of this capture, which is not drawn before the end of the thread, so that no
    /// frame waits for the driver.
    passes: Option<JoinHandle<()>>,
}

impl NextCapture {
    /// Creates the buffers, without data.
    ///
    /// # Errors
    /// When the GPU refuses a buffer or has no memory for it, or no view can draw the capture.
    fn new(device: &wgpu::Device, renderer: &CaptureRenderer, source: GaussianCapture) -> Result<Self, GpuError> {
        let whole = source.shared_scene();
        let (needed, core) = (whole.size() as u64, core_of(&whole));
        let levels = whole.levels.iter().map(|level| level.scene.clone()).collect::<Vec<_>>();
        let importances = std::iter::once(&whole).chain(&levels).map(|scene| Importances::of(scene)).collect();
        let upload = |scene| CaptureUpload::new(device, &renderer.0, scene);
        let create = || std::iter::once(whole).chain(levels).map(upload).collect::<Result<Vec<_>, _>>();
        let (created, mut caught) = catch(device, needed, create);
        let uploads = created?;
        let pending = match caught.poll() {
            Some(result) => result.map(|()| None)?,
            None => Some(caught),
        };
        // Only the coarsest level must fit: cameras that see the capture small on the screen draw that level.
        let mut rooms = uploads.iter().map(|upload| ViewRenderer::check_room(device, upload.most_drawn()));
        rooms.next_back().unwrap_or(Ok(()))?;
        let passes = renderer.0.begin_ahead(device, Storage::of(&source.scene().form));
        Ok(Self { uploads, importances, core, source, pending, passes })
    }

    /// Returns whether the capture can be drawn.
    fn is_complete(&self) -> bool {
        let is_compiled = self.passes.as_ref().is_none_or(JoinHandle::is_finished);
        self.bytes_left() == 0 && self.pending.is_none() && is_compiled
    }

    /// Returns the bytes that have not been uploaded.
    fn bytes_left(&self) -> u64 {
        self.uploads.iter().map(CaptureUpload::bytes_left).sum()
    }
}

impl GpuGaussianCapture {
    /// Returns the buffers; `None` if the capture cannot be drawn.
    pub fn capture(&self) -> Option<&GpuCapture> {
        self.level(0)
    }

    /// Returns the buffers of a level of detail, or those of all Gaussians if there is no such level (0 is all
    /// Gaussians); `None` if the capture cannot be drawn.
    pub(in crate::plugin::render) fn level(&self, index: usize) -> Option<&GpuCapture> {
        let levels = &self.shown.as_ref()?.levels;
        levels.get(index).or(levels.first())
    }

    /// Returns what decides about the Gaussians that are left out of a level of detail; `None` as for its buffers.
    pub(crate) fn thinned(&self, index: usize) -> Option<ThinnedCapture<'_>> {
        let ShownCapture { importances, core, .. } = &**self.shown.as_ref()?;
        let importances = importances.get(index).or(importances.first())?;
        Some(ThinnedCapture { importances, core: *core })
    }

    /// Returns the levels of detail and the bounds over all times of the drawn capture; `None` if it has no levels.
    pub(in crate::plugin::render) fn detail(&self) -> Option<(&[Level], Bounds)> {
        let source = &self.shown.as_ref()?.source;
        let levels = &source.scene().levels[..];
        (!levels.is_empty()).then_some((levels, source.bounds()?))
    }

    /// Returns the index of the coarsest level of detail; 0 is all Gaussians.
    #[cfg(feature = "pbr")]
    pub(crate) fn coarsest(&self) -> usize {
        self.shown.as_ref().map_or(0, |shown| shown.levels.len().saturating_sub(1))
    }

    /// Returns how a level of detail is drawn; see [`RuntimeScene::optics`]. `None` if the capture cannot be drawn.
    pub(crate) fn optics(&self, level: usize, antialias: bool) -> Option<Optics> {
        Some(self.shown.as_ref()?.source.scene().optics(level, antialias))
    }

    /// Returns the size of the buffers in bytes.
    pub(in crate::plugin::render) fn bytes(&self) -> u64 {
        self.shown.iter().flat_map(|shown| &shown.levels).map(GpuCapture::bytes).sum()
    }

    /// Returns the timestamp at `seconds` since the start, in the capture's unit of time; `None` if it cannot be drawn.
    pub(crate) fn time_at(&self, seconds: f32) -> Option<f32> {
        self.shown.as_ref().map(|shown| shown.source.time_at(seconds))
    }

    /// Uploads at most `bytes` of the next version, and shows it once it is complete. Returns the uploaded bytes.
    ///
    /// # Errors
    /// When the GPU has no memory for the upload, or for buffers created before. The next version is dropped.
    fn advance(&mut self, to: &UploadTarget<'_>, bytes: u64) -> Result<u64, GpuError> {
        let UploadTarget { device, queue, renderer, uploads } = *to;
        let Some(mut next) = self.next.take() else { return Ok(0) };
        if let Some(result) = next.pending.as_mut().and_then(Caught::poll) {
            next.pending = None;
            result?;
        }
        let written = catch_known(device, bytes.min(next.bytes_left()), || {
            let mut written = 0;
            for upload in &mut next.uploads {
                if written < bytes {
                    written += upload.advance(queue, renderer, bytes - written);
                }
            }
            written
        })?;
        if !next.is_complete() {
            self.next = Some(next);
        } else {
            let finish = |upload: CaptureUpload<_>| upload.finish(queue, renderer);
            let mut levels: Vec<_> = next.uploads.into_iter().map(finish).collect();
            let mut source = next.source;
            for level in &mut levels {
                level.bounds = source.bounds();
            }
            if source.usages() == RenderAssetUsages::RENDER_WORLD {
                source.release();
            }
            let (importances, core, files) = (next.importances, next.core, PlacedFiles::default());
            let mut shown = ShownCapture { levels, importances, core, source, files };
            if let Some(before) = self.shown.take().and_then(Arc::into_inner) {
                shown.keep_files(before, uploads);
            }
            self.shown = Some(Arc::new(shown));
        }
        Ok(written)
    }

    /// Returns the bytes that remain to be uploaded; `None` if no upload is in progress.
    pub(in crate::plugin::render) fn bytes_left(&self) -> Option<u64> {
        let of_file = || self.file.as_ref().and_then(ChunkFile::bytes_left);
        self.next.as_ref().map(NextCapture::bytes_left).or_else(of_file)
    }

    /// Returns whether it has pages for chunk files.
    fn has_pages(&self) -> bool {
        self.capture().is_some_and(|capture| capture.paged_bytes().is_some())
    }

    /// Returns what is drawn; `None` if nothing is, and in the frame in which the capture is replaced.
    fn shown_mut(&mut self) -> Option<&mut ShownCapture> {
        self.shown.as_mut().and_then(Arc::get_mut)
    }
}

impl RenderAsset for GpuGaussianCapture {
    type SourceAsset = GaussianCapture;
    // `byte_len` is not implemented: with a byte limit per frame, Bevy removes the old upload before the new one.
    type Param =
        (SRes<RenderDevice>, SRes<AssetServer>, SRes<Uploads>, SRes<CaptureStatistics>, Option<SRes<CaptureRenderer>>);

    fn asset_usage(source: &GaussianCapture) -> RenderAssetUsages {
        source.usages()
    }

    fn take_gpu_data(
        source: &mut GaussianCapture,
        _previous: Option<&Self>,
    ) -> Result<GaussianCapture, AssetExtractionError> {
        // Without Gaussians if they have been dropped: the upload then fails, with the reason.
        Ok(source.release().unwrap_or_else(|| source.clone()))
    }

    fn prepare_asset(
        source: GaussianCapture,
        id: AssetId<GaussianCapture>,
        (device, assets, uploads, statistics, renderer): &mut SystemParamItem<Self::Param>,
        previous: Option<&Self>,
    ) -> Result<Self, PrepareAssetError<GaussianCapture>> {
        let name = || name(assets, id);
        let shown = previous.and_then(|previous| previous.shown.clone());
        if source.is_released() {
            // Chunk files are loaded again.
            if uploads.file_of(id).is_none() {
                uploads.begin(id, shown.is_some());
                let failure = CaptureFailure::Device { path: name(), reason: WITHOUT_COPY.to_owned() };
                error!("{failure}");
                uploads.fail(id, failure);
            }
            return Ok(Self { shown, next: None, file: None });
        }
        uploads.begin(id, shown.is_some());
        let Some(renderer) = renderer else {
            // The failure has already been logged once for all captures.
            let reason = statistics.renderer_missing().unwrap_or_else(|| "there is no renderer".into());
            uploads.fail(id, CaptureFailure::NoRenderer { path: name(), reason });
            return Ok(Self { shown, next: None, file: None });
        };
        if let Some((index, number)) = uploads.file_of(id) {
            let file = Some(ChunkFile::new(index, number, source));
            return Ok(Self { shown: None, next: None, file });
        }
        if source.scene().trained_with.uses_fov_sentinel() {
            warn!(
                "{}: trained with the field-of-view sentinel of intrinsics cameras; drawn with each camera's true \
                 field of view, so it looks slightly different from its training",
                name()
            );
        }
        let next = match NextCapture::new(device.wgpu_device(), renderer, source) {
            Ok(next) => Some(next),
            Err(failure) => {
                renderer.0.forget_shared();
                report(uploads, id, &name(), &failure);
                None
            }
        };
        Ok(Self { shown, next, file: None })
    }

    fn unload_asset(id: AssetId<GaussianCapture>, (_, _, uploads, ..): &mut SystemParamItem<Self::Param>) {
        uploads.forget(id);
    }
}

/// Returns the path of a capture, or its identifier if it was not loaded from a file.
fn name(assets: &AssetServer, id: AssetId<GaussianCapture>) -> String {
    assets.get_path(id).map_or_else(|| format!("{id}"), |path| path.to_string())
}

/// Logs and reports a failed upload.
fn report(uploads: &Uploads, id: AssetId<GaussianCapture>, name: &str, failure: &GpuError) {
    let failure = CaptureFailure::of_upload(name.to_owned(), failure);
    error!("{failure}");
    uploads.fail(id, failure);
}

/// Copies the budget to the render world; the default if it has been removed.
pub(in crate::plugin::render) fn extract_upload_budget(
    mut extracted: ResMut<CaptureUploadBudget>,
    budget: Extract<Option<Res<CaptureUploadBudget>>>,
) {
    *extracted = budget.as_deref().copied().unwrap_or_default();
}

/// Returns whether any capture is being uploaded, or has pages for chunk files, which may go.
pub(in crate::plugin::render) fn any_uploading(captures: Res<RenderAssets<GpuGaussianCapture>>) -> bool {
    captures.iter().any(|(_, capture)| capture.bytes_left().is_some() || capture.has_pages())
}

/// Frees the pages of chunk files that are not loaded any more, and makes pages anew for what captures may have now.
fn release_files(captures: &mut RenderAssets<GpuGaussianCapture>, to: &UploadTarget<'_>) {
    let uploads = to.uploads;
    let with_pages: Vec<_> = captures.iter().filter(|(_, capture)| capture.has_pages()).map(|(id, _)| id).collect();
    for id in with_pages {
        // Its files are other assets.
        let Some(mut capture) = captures.remove(id) else { continue };
        let is_loaded = |asset, number| {
            let file = captures.get(asset).and_then(|capture| capture.file.as_ref());
            let is_own = file.is_some_and(|file| file.index == id && file.number == number);
            is_own && uploads.file_of(asset) == Some((id, number))
        };
        let granted = uploads.granted(id);
        let resized = capture.shown_mut().and_then(|shown| {
            shown.change_files(to, granted.unwrap_or_default(), |capture, files, to| {
                files.release(capture, uploads, is_loaded);
                match granted {
                    Some(_) => files.resize(capture, to),
                    None => {
                        files.close(capture);
                        Ok(())
                    }
                }
            })
        });
        if let Some(Err(failure)) = resized {
            warn_once_each(&format!("the memory of a capture in chunk files stays as it is: {failure}"));
        }
        captures.insert(id, capture);
    }
}

/// Continues the upload of a chunk file within a number of bytes. Returns the uploaded bytes.
///
/// # Errors
/// When it is not a file of its capture, or the GPU has no memory for the pages.
fn continue_file(
    captures: &mut RenderAssets<GpuGaussianCapture>,
    id: AssetId<GaussianCapture>,
    to: &UploadTarget<'_>,
    bytes: u64,
) -> Result<u64, GpuError> {
    let Some(mut file) = captures.get_mut(id).and_then(|capture| capture.file.take()) else { return Ok(0) };
    if to.uploads.file_of(id) != Some((file.index, file.number)) {
        file.abandon();
    }
    // An index that will be replaced keeps no files.
    let index = captures.get_mut(file.index).filter(|index| index.next.is_none());
    let index = index.and_then(GpuGaussianCapture::shown_mut);
    let advanced = index.zip(to.uploads.granted(file.index)).and_then(|(shown, most_bytes)| {
        shown.change_files(to, most_bytes, |capture, files, to| file.advance(id, capture, files, to, bytes))
    });
    if let Some(capture) = captures.get_mut(id) {
        capture.file = Some(file);
    }
    advanced.unwrap_or(Ok(0))
}

/// Continues the uploads within the budget, captures with the fewest remaining bytes first, so that one shows soon.
pub(in crate::plugin::render) fn continue_uploads(
    device: Res<RenderDevice>,
    queue: Res<RenderQueue>,
    renderer: Option<Res<CaptureRenderer>>,
    budget: Res<CaptureUploadBudget>,
    assets: Res<AssetServer>,
    uploads: Res<Uploads>,
    mut captures: ResMut<RenderAssets<GpuGaussianCapture>>,
) {
    let _span = debug_span!("gs4d/upload").entered();
    let Some(renderer) = renderer else { return };
    let to = UploadTarget { device: device.wgpu_device(), queue: &queue, renderer: &renderer.0, uploads: &uploads };
    release_files(&mut captures, &to);
    let mut waiting: Vec<_> = captures.iter().filter_map(|(id, capture)| Some((capture.bytes_left()?, id))).collect();
    waiting.sort_unstable();
    let mut left = budget.bytes_per_frame.max(1);
    for (_, id) in waiting {
        if left == 0 {
            break;
        }
        let Some(capture) = captures.get_mut(id) else { continue };
        let advanced = match capture.file {
            Some(_) => continue_file(&mut captures, id, &to, left),
            None => capture.advance(&to, left),
        };
        match advanced {
            Ok(written) => {
                left = left.saturating_sub(written);
                if captures.get(id).is_some_and(|capture| capture.bytes_left().is_none()) {
                    uploads.finish(id);
                }
            }
            Err(failure) => {
                renderer.0.forget_shared();
                report(&uploads, id, &name(&assets, id), &failure);
            }
        }
    }
    let paged = |(id, capture): (_, &GpuGaussianCapture)| Some((id, capture.capture()?.paged_bytes()?));
    uploads.set_paged(captures.iter().filter_map(paged));
}
