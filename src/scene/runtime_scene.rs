//! A scene ready to draw, and its levels of detail.
//!
//! In: Gaussians in a form that is drawn, and the other parts of a capture. Out: a [`RuntimeScene`], which returns its
//! Gaussians and colors; an error if its parts do not fit together. A [`Level`] is a scene of fewer Gaussians.

use super::chunk_table::ChunkTable;
use super::collider::Colliders;
use super::detail::{MAX_LEVELS, check_sizes};
use super::environment::Environment;
use super::filter::TemporalFilter;
use super::form::Form;
use super::provenance::{PlaybackHints, TrainedWith};
use super::sliced::Sliced;
use super::socket::{Socket, check_sockets};
use super::sound_file::SoundFile;
use crate::gaussian::{Gaussian, Harmonics};
use crate::view::{Background, Optics};
use glam::Vec3;
use std::sync::Arc;

/// A scene ready to draw.
#[derive(Debug, Clone, PartialEq)]
pub struct RuntimeScene {
    /// The Gaussians and their color.
    pub form: Form,
    /// The environment map, if the capture has one.
    pub environment: Option<Environment>,
    /// The Gaussians that are active in each segment of time; all if `None`.
    pub filter: Option<TemporalFilter>,
    /// The settings it was trained with.
    pub trained_with: TrainedWith,
    /// How it is meant to be played.
    pub playback: PlaybackHints,
    /// Levels of detail, which have fewer Gaussians, finest first; usually none.
    pub levels: Vec<Level>,
    /// Named points that follow a part of the capture; usually none. Levels of detail have none.
    pub sockets: Vec<Socket>,
    /// Meshes of the solid parts; usually none. Levels of detail have none. Shared, because they do not change.
    pub colliders: Option<Arc<Colliders>>,
    /// The sound that is played beside the picture; usually none. Levels of detail have none. Shared, likewise.
    pub sound: Option<Arc<SoundFile>>,
    /// The chunk files that have its Gaussians; `None` for every capture but the index of one in chunk files.
    pub chunks: Option<Arc<ChunkTable>>,
}

/// A level of detail: a capture of fewer Gaussians, without levels, environment map, temporal filter, sockets,
/// colliders, sound and chunk files.
#[derive(Debug, Clone, PartialEq)]
pub struct Level {
    /// The largest size on the screen (`pixels_across`) at which it looks nearly the same as all Gaussians, pixels.
    pub pixels: f32,
    /// Its Gaussians and their color. The time interval is that of the capture. Shared, because it does not change.
    pub scene: Arc<RuntimeScene>,
}

impl RuntimeScene {
    /// Creates a scene of sliced Gaussians and their color, without environment map and filter, with default
    /// [`TrainedWith`] and [`PlaybackHints`].
    pub fn sliced(gaussians: Vec<Gaussian>, harmonics: Harmonics) -> Self {
        Self {
            form: Form::Sliced(Sliced { gaussians, harmonics }),
            environment: None,
            filter: None,
            trained_with: TrainedWith::default(),
            playback: PlaybackHints::default(),
            levels: Vec::new(),
            sockets: Vec::new(),
            colliders: None,
            sound: None,
            chunks: None,
        }
    }

    /// Returns the number of Gaussians.
    pub fn len(&self) -> usize {
        self.form.len()
    }

    /// Returns whether there is no Gaussian.
    pub fn is_empty(&self) -> bool {
        self.form.is_empty()
    }

    /// Returns one Gaussian, decoded if it is packed.
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn gaussian(&self, index: usize) -> Gaussian {
        self.form.gaussian(index)
    }

    /// Returns all Gaussians in order.
    pub fn iter(&self) -> impl Iterator<Item = Gaussian> + '_ {
        self.form.iter()
    }

    /// Returns the color of one Gaussian seen along the unit vector `direction` from the camera, with
    /// `tau = mean_t − time`; see [`Harmonics::color`].
    ///
    /// # Panics
    /// If `index` is out of range.
    pub fn color(&self, index: usize, direction: Vec3, tau: f32) -> Vec3 {
        self.form.color(index, direction, tau, self.trained_with.period_of_colors())
    }

    /// Checks that its parts fit together, as those of every loaded scene do: lengths, codes, the temporal filter, the
    /// levels of detail, and that the environment map is finite. No index of a checked scene is out of range, here or
    /// on a GPU.
    ///
    /// # Errors
    /// A description of the first part that does not fit.
    pub fn check(&self) -> Result<(), &'static str> {
        self.form.check_parts()?;
        check_around(self.len(), self.filter.as_ref(), self.environment.as_ref())?;
        check_sockets(&self.sockets)?;
        self.colliders.as_deref().map_or(Ok(()), Colliders::check)?;
        self.sound.as_deref().map_or(Ok(()), SoundFile::check)?;
        self.chunks.as_deref().map_or(Ok(()), ChunkTable::check)?;
        check_levels(&self.levels, &self.trained_with, self.environment.is_some())
    }

    /// Returns the background that the capture was trained with: its environment map if it has one, else its color.
    pub fn trained_background(&self) -> Background {
        match self.environment {
            Some(_) => Background::Environment,
            None => Background::Color(self.trained_with.background),
        }
    }

    /// Returns the training pixel size, in capture units, with which a level of detail is anti-aliased (level 0, or one
    /// that does not exist: all Gaussians); `None`: it is drawn without anti-aliasing. Levels are always anti-aliased,
    /// by their own pixel size, because they were trained with anti-aliasing. All Gaussians are anti-aliased if
    /// `antialias` is true.
    pub fn antialias_pixel(&self, level: usize, antialias: bool) -> Option<f32> {
        match level.checked_sub(1).and_then(|index| self.levels.get(index)) {
            Some(level) => level.scene.trained_with.pixel,
            None => self.trained_with.pixel.filter(|_| antialias),
        }
    }

    /// Returns how a level of detail is drawn, with the [`antialias_pixel`](Self::antialias_pixel) of the same
    /// arguments.
    pub fn optics(&self, level: usize, antialias: bool) -> Optics {
        let drawn = level.checked_sub(1).and_then(|index| self.levels.get(index));
        let own = drawn.map_or(&self.trained_with, |level| &level.scene.trained_with).optics();
        let pixel = self.antialias_pixel(level, antialias).unwrap_or(f32::INFINITY);
        Optics { trained_pixel: own.trained_pixel.min(pixel), ..self.trained_with.optics() }
    }

    /// Returns the bytes of Gaussians and colors in memory.
    pub fn size(&self) -> usize {
        self.form.size()
    }
}

/// Checks the parts of a scene of `count` Gaussians other than its form and its levels.
pub(super) fn check_around(
    count: usize,
    filter: Option<&TemporalFilter>,
    environment: Option<&Environment>,
) -> Result<(), &'static str> {
    filter.map_or(Ok(()), |filter| filter.check(count))?;
    environment.map_or(Ok(()), Environment::check)
}

/// Checks the levels of a scene: their sizes, finest first, and that each fits the scene.
pub(super) fn check_levels(
    levels: &[Level],
    trained_with: &TrainedWith,
    has_environment: bool,
) -> Result<(), &'static str> {
    if levels.len() > MAX_LEVELS {
        return Err("more levels of detail than a capture may have");
    }
    if has_environment && !levels.is_empty() {
        return Err("levels of detail of a capture with an environment map, which surrounds the camera");
    }
    check_sizes(levels.iter().map(|level| level.pixels))?;
    for level in levels {
        let own = &level.scene;
        if !own.levels.is_empty() || own.environment.is_some() || own.filter.is_some() {
            return Err("a level of detail that has levels, an environment map or a temporal filter itself");
        }
        if !own.sockets.is_empty() || own.colliders.is_some() || own.sound.is_some() {
            return Err("a level of detail that has sockets, colliders or a sound itself");
        }
        if own.chunks.is_some() {
            return Err("a level of detail that is in chunk files itself");
        }
        if level.scene.trained_with.time_interval != trained_with.time_interval {
            return Err("a level of detail of another time interval");
        }
        level.scene.check()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::MARGINAL_CUTOFF;

    fn empty() -> RuntimeScene {
        RuntimeScene::sliced(Vec::new(), Harmonics { coefficients: 1, ..Harmonics::default() })
    }

    fn level(pixels: f32, scene: RuntimeScene) -> Level {
        Level { pixels, scene: Arc::new(scene) }
    }

    #[test]
    fn levels_are_always_antialiased_by_their_own_training_pixel() {
        let sized = |pixel| RuntimeScene { trained_with: TrainedWith { pixel, ..TrainedWith::default() }, ..empty() };
        let scene = |pixel| RuntimeScene { levels: vec![level(8.0, sized(Some(0.5)))], ..sized(pixel) };
        for pixel in [None, Some(0.25)] {
            let scene = scene(pixel);
            for antialias in [false, true] {
                assert_eq!(scene.antialias_pixel(1, antialias), Some(0.5), "level 1 has its own training pixel");
            }
            assert_eq!(scene.antialias_pixel(0, false), None, "all Gaussians are drawn without anti-aliasing");
            assert_eq!(scene.antialias_pixel(0, true), pixel, "all Gaussians have the training pixel of the capture");
            assert_eq!(scene.antialias_pixel(2, true), pixel, "a missing level is drawn as all Gaussians");
        }
    }

    #[test]
    fn levels_have_the_near_plane_of_the_capture_and_their_own_mip_filter() {
        let trained = |pixel, near, mip_filter| TrainedWith { pixel, near, mip_filter, ..TrainedWith::default() };
        let coarse = RuntimeScene { trained_with: trained(Some(0.5), 0.2, false), ..empty() };
        let scene =
            RuntimeScene { trained_with: trained(Some(0.25), 0.01, true), levels: vec![level(8.0, coarse)], ..empty() };
        for antialias in [false, true] {
            let [all, first] = [0, 1].map(|level| scene.optics(level, antialias));
            assert_eq!([all.near, first.near], [0.01; 2], "the near plane of the capture");
            assert_eq!(all.trained_pixel, 0.0, "anti-aliasing does not undo the mip filter of the capture");
            assert_eq!(first.trained_pixel, 0.5, "the level was not trained with the mip filter");
        }
        let plain = RuntimeScene { trained_with: trained(Some(0.25), 0.2, false), ..empty() };
        let pixels = [false, true].map(|antialias| plain.optics(0, antialias).trained_pixel);
        assert_eq!(pixels, [f32::INFINITY, 0.25], "without a mip filter only anti-aliasing reduces opacity");
    }

    #[test]
    fn inconsistent_levels_are_refused() {
        let with = |levels| RuntimeScene { levels, ..empty() };
        assert_eq!(
            with(vec![level(64.0, empty()), level(8.0, empty())]).check(),
            Ok(()),
            "levels of decreasing size are accepted"
        );
        let map = Environment { width: 1, height: 1, texels: vec![0.0; 3] };
        let chunks =
            ChunkTable { stretches: 1, gaussian_bytes: 88, files: Vec::new(), utilities: Vec::new(), first_byte: None };
        let other = TrainedWith { time_interval: [0.0, 2.0], ..TrainedWith::default() };
        let bad = [
            vec![level(8.0, empty()), level(64.0, empty())],
            vec![level(8.0, empty()), level(8.0, empty())],
            vec![level(f32::NAN, empty())],
            vec![level(f32::INFINITY, empty())],
            vec![level(0.0, empty())],
            vec![level(8.0, with(vec![level(4.0, empty())]))],
            vec![level(8.0, RuntimeScene { environment: Some(map.clone()), ..empty() })],
            vec![level(
                8.0,
                RuntimeScene {
                    filter: Some(TemporalFilter::support(empty().iter(), [0.0, 1.0], MARGINAL_CUTOFF, 2)),
                    ..empty()
                },
            )],
            vec![level(8.0, RuntimeScene { trained_with: other, ..empty() })],
            vec![level(8.0, RuntimeScene { colliders: Some(Arc::default()), ..empty() })],
            vec![level(8.0, RuntimeScene { chunks: Some(Arc::new(chunks.clone())), ..empty() })],
            (0..=MAX_LEVELS).map(|index| level(64.0 - index as f32, empty())).collect(),
        ];
        for (index, levels) in bad.into_iter().enumerate() {
            assert!(with(levels).check().is_err(), "the levels with index {index} are refused");
        }
        let surrounded = RuntimeScene { environment: Some(map), ..with(vec![level(8.0, empty())]) };
        assert!(surrounded.check().is_err(), "levels of a capture with an environment map are refused");
        let mut index = RuntimeScene { chunks: Some(Arc::new(chunks.clone())), ..empty() };
        assert_eq!(index.check(), Ok(()), "the index of a capture in chunk files");
        index.chunks = Some(Arc::new(ChunkTable { stretches: 0, ..chunks }));
        assert!(index.check().is_err(), "a table that a player cannot use is refused");
    }
}
