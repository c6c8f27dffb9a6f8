//! Chunk files on the GPU.
//!
//! In: chunk files that have been loaded, of which [`Uploads`] knows the capture. Out: their Gaussians in the pages of the
//! buffers of that capture, until they are no longer loaded; what is known of all of them.

use super::budget::core_of;
use crate::plugin::asset::Uploads;
use crate::plugin::component::GaussianCapture;
use crate::renderer::device::memory::catch_known;
use crate::renderer::{ChunkFiles, FileUpload, GpuCapture, GpuError, Renderer, ViewRenderer};
use crate::scene::{Bounds, Importances, RuntimeScene};
use bevy::asset::AssetId;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A chunk file that has been loaded.
pub(super) struct ChunkFile {
    /// The capture of which it is a file, and its number.
    pub(super) index: AssetId<GaussianCapture>,
    pub(super) number: usize,
    progress: Progress,
    bytes_left: u64,
}

/// How far the upload of a file is.
enum Progress {
    /// It has no pages.
    Waiting(GaussianCapture),
    Uploading(FileUpload<Arc<RuntimeScene>>),
    Complete,
}

impl ChunkFile {
    pub(super) fn new(index: AssetId<GaussianCapture>, number: usize, source: GaussianCapture) -> Self {
        let bytes_left = source.scene().size() as u64;
        Self { index, number, progress: Progress::Waiting(source), bytes_left }
    }

    /// Returns the bytes that remain to be uploaded; `None` if the file is complete, or has failed.
    pub(super) fn bytes_left(&self) -> Option<u64> {
        (!matches!(self.progress, Progress::Complete)).then_some(self.bytes_left)
    }

    /// Uploads no more of the file: it is not wanted any more.
    pub(super) fn abandon(&mut self) {
        self.progress = Progress::Complete;
    }

    /// Uploads at most `bytes` of the file `id` into the pages of `capture`, once there is room. Returns the uploaded bytes.
    ///
    /// # Errors
    /// When it is not a file of the capture, or the GPU has no memory for the pages. The file is dropped.
    pub(super) fn advance(
        &mut self,
        id: AssetId<GaussianCapture>,
        capture: &mut GpuCapture,
        files: &mut PlacedFiles,
        to: &Destination<'_>,
        bytes: u64,
    ) -> Result<u64, GpuError> {
        let UploadTarget { device, queue, renderer, uploads } = to.target;
        let progress = std::mem::replace(&mut self.progress, Progress::Complete);
        let mut upload = match progress {
            Progress::Waiting(source) => {
                let scene = source.shared_scene();
                files.remove(capture, self.number, uploads);
                if capture.paged_bytes().is_none() {
                    open(capture, &scene, to)?;
                }
                if !capture.has_room(scene.len()) {
                    self.progress = Progress::Waiting(source);
                    return Ok(0);
                }
                let upload = FileUpload::new(capture, self.number, scene)?;
                files.place(self.number, id, &source);
                upload
            }
            Progress::Uploading(upload) => upload,
            Progress::Complete => return Ok(0),
        };
        let needed = bytes.min(upload.bytes_left(capture));
        let advance = || upload.advance(queue, renderer, capture, bytes);
        let written = catch_known(device, needed, advance).flatten()?;
        self.bytes_left = upload.bytes_left(capture);
        if upload.is_complete(capture) {
            files.complete(capture, self.number, uploads);
        } else {
            self.progress = Progress::Uploading(upload);
        }
        Ok(written)
    }
}

/// Makes the pages of a capture, when its first file has been loaded.
fn open(capture: &mut GpuCapture, first: &RuntimeScene, to: &Destination<'_>) -> Result<(), GpuError> {
    let table = to.index.scene().chunks.as_ref().ok_or(GpuError::Scene("its index has no table of chunk files"))?;
    let index = (!to.index.is_released()).then(|| to.index.scene());
    let files = ChunkFiles { table, index, first };
    let UploadTarget { device, queue, renderer, .. } = to.target;
    capture.open_pages(device, queue, renderer, files, to.most_bytes)?;
    let room = ViewRenderer::check_room(device, capture.most_paged().unwrap_or_default());
    if room.is_err() {
        capture.close_pages();
    }
    room
}

/// Where captures and chunk files are uploaded to.
#[derive(Clone, Copy)]
pub(super) struct UploadTarget<'a> {
    pub(super) device: &'a wgpu::Device,
    pub(super) queue: &'a wgpu::Queue,
    pub(super) renderer: &'a Renderer,
    /// Is told which files are in pages.
    pub(super) uploads: &'a Uploads,
}

/// The pages to which files of a capture are uploaded.
pub(super) struct Destination<'a> {
    pub(super) target: UploadTarget<'a>,
    /// The index of the capture.
    pub(super) index: &'a GaussianCapture,
    /// Bytes that its pages may take.
    pub(super) most_bytes: u64,
}

/// The files in the pages of a capture.
#[derive(Default)]
pub(super) struct PlacedFiles {
    files: BTreeMap<usize, PlacedFile>,
    /// The size of pages for which there was no memory.
    refused: Option<u64>,
}

struct PlacedFile {
    asset: AssetId<GaussianCapture>,
    gaussians: usize,
    bounds: Option<Bounds>,
    core: Option<Bounds>,
    importances: Importances,
    is_complete: bool,
}

impl PlacedFiles {
    /// Returns the importances of the Gaussians of complete files.
    pub(super) fn importances(&self) -> Importances {
        let complete = self.files.values().filter(|file| file.is_complete);
        Importances::of_all(complete.map(|file| (file.gaussians, &file.importances)))
    }

    /// Returns the box around most of the Gaussians of complete files; `None` if there is none.
    pub(super) fn core(&self) -> Option<Bounds> {
        self.files.values().filter(|file| file.is_complete).filter_map(|file| file.core).reduce(Bounds::union)
    }

    fn place(&mut self, number: usize, asset: AssetId<GaussianCapture>, source: &GaussianCapture) {
        let scene = source.scene();
        let (bounds, core, importances) = (source.bounds(), core_of(scene), Importances::of(scene));
        let file = PlacedFile { asset, gaussians: scene.len(), bounds, core, importances, is_complete: false };
        self.files.insert(number, file);
    }

    fn complete(&mut self, capture: &mut GpuCapture, number: usize, uploads: &Uploads) {
        if let Some(file) = self.files.get_mut(&number) {
            file.is_complete = true;
            uploads.set_placed(file.asset, true);
        }
        self.note(capture);
    }

    fn remove(&mut self, capture: &mut GpuCapture, number: usize, uploads: &Uploads) {
        if let Some(file) = self.files.remove(&number) {
            uploads.set_placed(file.asset, false);
            capture.remove_file(number);
            self.note(capture);
        }
    }

    /// Frees the pages of files that are not loaded any more.
    pub(super) fn release(
        &mut self,
        capture: &mut GpuCapture,
        uploads: &Uploads,
        is_loaded: impl Fn(AssetId<GaussianCapture>, usize) -> bool,
    ) {
        let gone: Vec<usize> = self
            .files
            .iter()
            .filter(|(number, file)| !is_loaded(file.asset, **number))
            .map(|(number, _)| *number)
            .collect();
        for number in gone {
            self.remove(capture, number, uploads);
        }
    }

    /// Records that the files are in no pages any more.
    pub(super) fn forget(&self, uploads: &Uploads) {
        self.files.values().for_each(|file| uploads.set_placed(file.asset, false));
    }

    /// Gives the capture the bounds of its files.
    fn note(&self, capture: &mut GpuCapture) {
        let complete = self.files.values().filter(|file| file.is_complete);
        capture.bounds = complete.filter_map(|file| file.bounds).reduce(Bounds::union);
    }

    /// Frees the pages of a capture that is not streamed any more, once its files are gone.
    pub(super) fn close(&mut self, capture: &mut GpuCapture) {
        if self.files.is_empty() && capture.paged_bytes().is_some() {
            capture.close_pages();
        }
    }

    /// Makes the pages of a capture anew if it may have more or fewer.
    ///
    /// # Errors
    /// When the GPU has no memory for the pages. Those of before stay.
    pub(super) fn resize(&mut self, capture: &mut GpuCapture, to: &Destination<'_>) -> Result<(), GpuError> {
        if self.refused == Some(to.most_bytes) {
            return Ok(());
        }
        let UploadTarget { device, queue, renderer, .. } = to.target;
        let resized = capture.resize_pages(device, queue, renderer, to.most_bytes);
        self.refused = resized.is_err().then_some(to.most_bytes);
        resized.map(|_| ())
    }
}
