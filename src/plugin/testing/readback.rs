//! Pictures of an app, read back from the GPU.
//!
//! In: an app and a time step. Out: the picture that the app's cameras draw after that step, in memory or as a PNG.

use super::error::TestingError;
use super::offscreen::Offscreen;
use super::pipelines::require_renderer;
use super::stepping::advance;
use super::waiting::{load, settle, start, update};
use crate::codec::CodecError;
use bevy::app::App;
use bevy::asset::Assets;
use bevy::ecs::observer::On;
use bevy::image::Image;
use bevy::render::RenderApp;
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_asset::RenderAssets;
use bevy::render::render_resource::{
    BufferDescriptor, BufferUsages, CommandEncoderDescriptor, Extent3d, MapMode, PollType, TexelCopyBufferInfo,
    TexelCopyBufferLayout, TextureFormat,
};
use bevy::render::renderer::{RenderDevice, RenderQueue};
use bevy::render::texture::GpuImage;
use glam::UVec2;
use half::f16;
use image::codecs::png::PngEncoder;
use image::{Rgba32FImage, RgbaImage};
use std::io;
use std::mem;
use std::path::{Path, PathBuf};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest time that a readback may take. A limit in updates would fail on a GPU that other processes use.
const READBACK: Duration = Duration::from_secs(60);

/// Waits until all assets are loaded, advances time by `step` in one update, and returns the picture in the app's own
/// [`Offscreen`] at that time.
///
/// # Errors
/// The errors of [`settle`]; an app without [`Offscreen`], or with an [`Offscreen`] in HDR; a readback that fails.
pub fn picture(app: &mut App, step: Duration) -> Result<RgbaImage, TestingError> {
    require_renderer(app)?;
    let offscreen = app.world().get_resource::<Offscreen>().cloned().ok_or(TestingError::NotOffscreen)?;
    load(app)?;
    advance(app, step)?;
    settle(app)?;
    // The game may have replaced or resized the picture.
    let offscreen = app.world().get_resource::<Offscreen>().cloned().unwrap_or(offscreen);
    read(app, &offscreen)
}

/// Returns a picture as it was last drawn, at the time of the last [`picture`] or [`step`](super::step).
///
/// # Errors
/// Errors of drawing; a picture in HDR; a readback from the GPU that fails.
pub fn read(app: &mut App, offscreen: &Offscreen) -> Result<RgbaImage, TestingError> {
    if is_hdr(app, offscreen) {
        return Err(TestingError::Format { pixels: "16 bits of float in each channel", remedy: "read_hdr" });
    }
    let size = offscreen.size;
    RgbaImage::from_raw(size.x, size.y, pixels(app, offscreen, 4)?).ok_or(TestingError::Readback)
}

/// Returns a picture in HDR as it was last drawn: RGBA in linear light, not clamped. The camera's tonemapping has been
/// applied; `Tonemapping::None` applies none.
///
/// # Errors
/// Errors of drawing; a picture that was not made by [`Offscreen::hdr`]; a readback from the GPU that fails.
pub fn read_hdr(app: &mut App, offscreen: &Offscreen) -> Result<Rgba32FImage, TestingError> {
    read_half(app, offscreen)?.to_floats().ok_or(TestingError::Readback)
}

/// A picture in HDR as the GPU has it: RGBA in linear light.
pub(super) struct HalfPicture {
    size: UVec2,
    /// Half floats, row by row.
    data: Vec<u8>,
}

impl HalfPicture {
    /// `data` has eight bytes for each pixel.
    pub(super) fn new(size: UVec2, data: Vec<u8>) -> Self {
        Self { size, data }
    }

    /// Returns the picture in floats, or `None` if values are missing.
    pub(super) fn to_floats(&self) -> Option<Rgba32FImage> {
        let values = self.data.as_chunks::<2>().0.iter().map(|value| f16::from_le_bytes(*value).to_f32()).collect();
        Rgba32FImage::from_raw(self.size.x, self.size.y, values)
    }
}

/// Reads a picture as [`read_hdr`] does, and leaves its conversion to the caller.
pub(super) fn read_half(app: &mut App, offscreen: &Offscreen) -> Result<HalfPicture, TestingError> {
    if !is_hdr(app, offscreen) {
        return Err(TestingError::Format { pixels: "8 bits in each channel", remedy: "read" });
    }
    Ok(HalfPicture::new(offscreen.size, pixels(app, offscreen, 8)?))
}

fn is_hdr(app: &App, offscreen: &Offscreen) -> bool {
    let images = app.world().get_resource::<Assets<Image>>();
    let image = images.and_then(|images| images.get(&offscreen.image));
    image.is_some_and(|image| image.texture_descriptor.format == TextureFormat::Rgba16Float)
}

/// Returns the pixels of a picture, row by row without padding. `bytes` is the size of a pixel.
fn pixels(app: &mut App, offscreen: &Offscreen, bytes: usize) -> Result<Vec<u8>, TestingError> {
    require_renderer(app)?;
    start(app)?;
    if let Some(copied) = copied(app, offscreen, bytes) {
        return copied;
    }
    let arrived = Arc::new(Mutex::new(None));
    let sink = arrived.clone();
    let store = move |mut event: On<ReadbackComplete>| {
        *sink.lock().unwrap_or_else(PoisonError::into_inner) = Some(mem::take(&mut event.data));
    };
    let readback = app.world_mut().spawn(Readback::texture(offscreen.image.clone())).observe(store).id();
    let data = wait(app, &arrived);
    app.world_mut().despawn(readback);
    Ok(unpadded(&data?, offscreen.size, bytes))
}

/// Copies the pixels without an update. `None` if rendering is pipelined, or no picture of this size has been drawn.
fn copied(app: &App, offscreen: &Offscreen, bytes: usize) -> Option<Result<Vec<u8>, TestingError>> {
    let world = app.get_sub_app(RenderApp)?.world();
    let image = world.get_resource::<RenderAssets<GpuImage>>()?.get(&offscreen.image)?;
    let size = Extent3d { width: offscreen.size.x, height: offscreen.size.y, depth_or_array_layers: 1 };
    if image.texture.size() != size {
        return None;
    }
    let (device, queue) = (world.get_resource::<RenderDevice>()?, world.get_resource::<RenderQueue>()?);
    let row = (offscreen.size.x as usize * bytes).next_multiple_of(256) as u32;
    let buffer = device.create_buffer(&BufferDescriptor {
        label: Some("gs4d picture"),
        size: u64::from(row) * u64::from(offscreen.size.y),
        usage: BufferUsages::COPY_DST | BufferUsages::MAP_READ,
        mapped_at_creation: false,
    });
    let layout = TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
    let mut encoder = device.create_command_encoder(&CommandEncoderDescriptor::default());
    let to = TexelCopyBufferInfo { buffer: &buffer, layout };
    encoder.copy_texture_to_buffer(image.texture.as_image_copy(), to, size);
    queue.submit([encoder.finish()]);
    let (sender, mapped) = channel();
    buffer.slice(..).map_async(MapMode::Read, move |result| {
        // The receiver is dropped if waiting has failed.
        let _ = sender.send(result.is_ok());
    });
    let waited = device.poll(PollType::wait_indefinitely()).is_ok() && mapped.try_recv() == Ok(true);
    Some(if waited {
        Ok(unpadded(&buffer.slice(..).get_mapped_range(), offscreen.size, bytes))
    } else {
        Err(TestingError::Readback)
    })
}

fn wait(app: &mut App, arrived: &Mutex<Option<Vec<u8>>>) -> Result<Vec<u8>, TestingError> {
    let began = Instant::now();
    while began.elapsed() < READBACK {
        update(app)?;
        if let Some(data) = arrived.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Ok(data);
        }
    }
    Err(TestingError::Readback)
}

/// Removes the padding of rows to a multiple of 256 bytes, which textures have when read back; `bytes` is per pixel.
fn unpadded(data: &[u8], size: UVec2, bytes: usize) -> Vec<u8> {
    let row = size.x as usize * bytes;
    let rows = data.chunks(row.next_multiple_of(256)).map(|padded| &padded[..row.min(padded.len())]);
    rows.collect::<Vec<_>>().concat()
}

/// Writes `frames` pictures into `folder` as `0000.png`, `0001.png` and so on, and returns their paths. The first shows
/// the current time, each further picture is `step` later.
///
/// # Errors
/// The errors of [`picture`] and [`save`].
pub fn pictures(app: &mut App, folder: &Path, frames: u32, step: Duration) -> Result<Vec<PathBuf>, TestingError> {
    let digits = frames.to_string().len().max(4);
    let mut paths = Vec::new();
    for index in 0..frames {
        let step = if index == 0 { Duration::ZERO } else { step };
        let path = folder.join(format!("{index:0digits$}.png"));
        save(&picture(app, step)?, &path)?;
        paths.push(path);
    }
    Ok(paths)
}

/// Writes a picture as a PNG file, completely or not at all, and creates the folder if it does not exist.
///
/// # Errors
/// A folder that cannot be created or written to, a full disk.
pub fn save(picture: &RgbaImage, path: &Path) -> Result<(), TestingError> {
    let failed = |path: &Path, error: io::Error| CodecError::at(path, error);
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(|error| failed(folder, error))?;
    }
    write_png(picture, path).map_err(|error| failed(path, error))?;
    Ok(())
}

/// Writes under a temporary name, and renames the file once it is complete.
fn write_png(picture: &RgbaImage, path: &Path) -> io::Result<()> {
    let mut png = Vec::new();
    picture.write_with_encoder(PngEncoder::new(&mut png)).map_err(io::Error::other)?;
    let partial = path.with_extension("png.part");
    let written = std::fs::write(&partial, png).and_then(|()| std::fs::rename(&partial, path));
    if written.is_err() {
        // A failure to remove the partial file is ignored: the first error is returned.
        std::fs::remove_file(&partial).ok();
    }
    written
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_row_padding_is_removed() {
        let size = UVec2::new(3, 2);
        let mut padded = vec![0; 512];
        padded[..12].copy_from_slice(&[1; 12]);
        padded[256..268].copy_from_slice(&[2; 12]);
        let expected: Vec<u8> = [[1; 12], [2; 12]].concat();
        assert_eq!(unpadded(&padded, size, 4), expected, "12 bytes of each row remain");
        assert_eq!(unpadded(&[7; 512], UVec2::new(64, 2), 4), [7; 512], "rows of 256 bytes have no padding");
        assert_eq!(unpadded(&[7; 512], UVec2::new(32, 2), 8), [7; 512], "rows of 32 pixels of 8 bytes have no padding");
    }
}
