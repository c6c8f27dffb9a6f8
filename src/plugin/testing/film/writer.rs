//! The pictures of a film, encoded and written while the next ones are drawn.
//!
//! In: pictures in linear light with coverage, and paths. Out: PNG files, sRGB-encoded with straight alpha.

use crate::plugin::testing::readback::HalfPicture;
use crate::plugin::testing::{TestingError, save};
use crate::view::srgb;
use glam::Vec3;
use image::{Rgba, Rgba32FImage, RgbaImage};
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// A picture and its path.
type Picture = (HalfPicture, PathBuf);

/// Threads that encode and write pictures. As many pictures as there are threads may wait.
pub(super) struct Writer {
    pictures: Option<SyncSender<Picture>>,
    threads: Vec<JoinHandle<()>>,
    failed: Arc<Mutex<Option<TestingError>>>,
}

impl Writer {
    /// Starts a thread for each core.
    pub(super) fn begin() -> Self {
        let count = thread::available_parallelism().map_or(1, usize::from);
        let (pictures, waiting) = sync_channel(count);
        let (waiting, failed) = (Arc::new(Mutex::new(waiting)), Arc::new(Mutex::new(None)));
        let start = |_| {
            let (waiting, failed) = (waiting.clone(), failed.clone());
            thread::spawn(move || write_all(&waiting, &failed))
        };
        Self { pictures: Some(pictures), threads: (0..count).map(start).collect(), failed }
    }

    /// Takes a picture to write; waits while too many wait already.
    ///
    /// # Errors
    /// The first picture that could not be written.
    pub(super) fn add(&self, picture: HalfPicture, path: PathBuf) -> Result<(), TestingError> {
        if let Some(pictures) = &self.pictures {
            // The threads take pictures until the writer is dropped, also after a failure.
            let _ = pictures.send((picture, path));
        }
        self.check()
    }

    /// Waits until every picture is written.
    ///
    /// # Errors
    /// The first picture that could not be written.
    pub(super) fn finish(mut self) -> Result<(), TestingError> {
        self.end();
        self.check()
    }

    fn check(&self) -> Result<(), TestingError> {
        self.failed.lock().unwrap_or_else(PoisonError::into_inner).take().map_or(Ok(()), Err)
    }

    fn end(&mut self) {
        self.pictures = None;
        for thread in self.threads.drain(..) {
            // A thread that panicked has shown its message.
            let _ = thread.join();
        }
    }
}

impl Drop for Writer {
    fn drop(&mut self) {
        self.end();
    }
}

/// Writes pictures until there are no more; after a failure they are dropped.
fn write_all(waiting: &Mutex<Receiver<Picture>>, failed: &Mutex<Option<TestingError>>) {
    loop {
        let next = waiting.lock().unwrap_or_else(PoisonError::into_inner).recv();
        let Ok((picture, path)) = next else { return };
        let floats = picture.to_floats().ok_or(TestingError::Readback);
        if let Err(error) = floats.and_then(|floats| save(&straight(&floats), &path)) {
            failed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
        }
    }
}

/// Converts linear light times coverage to sRGB-encoded colors with straight alpha: colors are divided by the coverage,
/// then encoded. Colors without coverage are black.
fn straight(picture: &Rgba32FImage) -> RgbaImage {
    let byte = |value: f32| (value.clamp(0.0, 1.0) * 255.0).round() as u8;
    RgbaImage::from_fn(picture.width(), picture.height(), |x, y| {
        let [red, green, blue, alpha] = picture.get_pixel(x, y).0;
        let covered = byte(alpha);
        if covered == 0 {
            return Rgba([0; 4]);
        }
        let color = srgb::encode((Vec3::new(red, green, blue) / alpha.min(1.0)).max(Vec3::ZERO));
        Rgba([byte(color.x), byte(color.y), byte(color.z), covered])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::UVec2;
    use half::f16;

    #[test]
    fn colors_are_divided_by_their_coverage_in_linear_light() {
        let linear = srgb::decode(Vec3::new(200.0, 100.0, 50.0) / 255.0);
        let picture = Rgba32FImage::from_fn(3, 1, |x, _| {
            let covered = x as f32 / 2.0;
            Rgba([linear.x * covered, linear.y * covered, linear.z * covered, covered])
        });
        let pixels: Vec<[u8; 4]> = straight(&picture).pixels().map(|pixel| pixel.0).collect();
        assert_eq!(pixels, [[0; 4], [200, 100, 50, 128], [200, 100, 50, 255]], "the color does not depend on coverage");
    }

    #[test]
    fn the_first_picture_that_cannot_be_written_is_an_error() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let (whole, inside) = (folder.path().join("a.png"), folder.path().join("a.png/b.png"));
        let half = f16::from_f32(0.5).to_le_bytes();
        let picture = || HalfPicture::new(UVec2::splat(2), half.repeat(16));
        let writer = Writer::begin();
        writer.add(picture(), whole.clone()).expect("the folder can be written to");
        writer.finish().expect("every picture is written");
        assert!(whole.is_file(), "the writer waits for its threads");
        let writer = Writer::begin();
        let failed = writer.add(picture(), inside).and_then(|()| writer.finish()).expect_err("a file is no folder");
        assert!(failed.to_string().contains("a.png"), "the error names the file: {failed}");
    }
}
