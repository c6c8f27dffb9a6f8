//! Pictures of an app, read back from the GPU.
//!
//! In: an app and a time step. Out: the picture that the app's cameras draw after that step, in memory or as a PNG file.

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
use bevy::render::gpu_readback::{Readback, ReadbackComplete};
use bevy::render::render_resource::TextureFormat;
use glam::UVec2;
use half::f16;
use image::codecs::png::PngEncoder;
use image::{Rgba32FImage, RgbaImage};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Longest time that a read-back may take. A limit in updates would fail on a GPU that is busy with the work of other processes.
const READBACK: Duration = Duration::from_secs(60);

/// Waits until all assets are loaded, advances time by `step` in one update, and returns the picture in the app's own [`Offscreen`] at
/// that time.
///
/// # Errors
/// The errors of [`settle`]; an app without [`Offscreen`], or with an [`Offscreen`] in HDR; a read-back from the GPU that fails.
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
/// Errors of drawing; a picture in HDR; a read-back from the GPU that fails.
pub fn read(app: &mut App, offscreen: &Offscreen) -> Result<RgbaImage, TestingError> {
    if is_hdr(app, offscreen) {
        return Err(TestingError::Format { pixels: "16 bits of float in each channel", remedy: "read_hdr" });
    }
    let size = offscreen.size;
    RgbaImage::from_raw(size.x, size.y, pixels(app, offscreen, 4)?).ok_or(TestingError::Readback)
}

/// Returns a picture in HDR as it was last drawn: RGBA in linear light, not clamped. The camera's tonemapping has been applied;
/// `Tonemapping::None` applies none.
///
/// # Errors
/// Errors of drawing; a picture that was not made by [`Offscreen::hdr`]; a read-back from the GPU that fails.
pub fn read_hdr(app: &mut App, offscreen: &Offscreen) -> Result<Rgba32FImage, TestingError> {
    if !is_hdr(app, offscreen) {
        return Err(TestingError::Format { pixels: "8 bits in each channel", remedy: "read" });
    }
    let size = offscreen.size;
    let data = pixels(app, offscreen, 8)?;
    let values = data.as_chunks::<2>().0.iter().map(|value| f16::from_le_bytes(*value).to_f32()).collect();
    Rgba32FImage::from_raw(size.x, size.y, values).ok_or(TestingError::Readback)
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
    let arrived = Arc::new(Mutex::new(None));
    let sink = arrived.clone();
    let store = move |event: On<ReadbackComplete>| {
        *sink.lock().unwrap_or_else(PoisonError::into_inner) = Some(event.data.clone());
    };
    let readback = app.world_mut().spawn(Readback::texture(offscreen.image.clone())).observe(store).id();
    let data = wait(app, &arrived);
    app.world_mut().despawn(readback);
    Ok(unpadded(&data?, offscreen.size, bytes))
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

/// Removes the row padding of a texture that was read back: its rows are padded to a multiple of 256 bytes. `bytes` is the size of a
/// pixel.
fn unpadded(data: &[u8], size: UVec2, bytes: usize) -> Vec<u8> {
    let row = size.x as usize * bytes;
    data.chunks(row.next_multiple_of(256)).flat_map(|padded| padded.iter().take(row).copied()).collect()
}

/// Writes `frames` pictures into `folder` as `0000.png`, `0001.png` and so on, and returns their paths. The first shows the current time,
/// each further picture is `step` later.
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
    let failed = |path: &Path, error: io::Error| CodecError { path: path.to_owned(), kind: error.into() };
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
