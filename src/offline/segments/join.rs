//! One capture of segments that were trained apart.
//!
//! In: captures of stretches of time. Out: one capture with one clock, in which each Gaussian is only drawn within the
//! time of its segment: at a seam one segment ends and the next begins, without cross-fade. Within a segment the
//! pictures are those of the segment alone, except that times are rounded to single precision.

use super::alike::{color_period, require_alike};
use super::clock::{Grid, Place, Span, following, grid, own};
use super::error::{SegmentsError, Shared};
use super::forms::move_form;
use super::segment::Segment;
use super::windows::{Frame, windows};
use crate::offline::work::{FileError, Progress, proceed};
use crate::scene::union::append;
use crate::scene::{
    ActiveSets, FilterKind, GaussianScene, Origin, PlaybackHints, SceneForm, TemporalFilter, TrainedWith,
};
use std::path::PathBuf;

/// When segments are shown. Default: [`Following`](Self::Following).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Times {
    /// Each begins when the one before it ends.
    #[default]
    Following,
    /// At the times of their own intervals. Between two there may be a gap, in which nothing is drawn.
    Own,
}

/// A segment of a joined capture.
#[derive(Debug, Clone, PartialEq)]
pub struct JoinedSegment {
    /// The file or the folder that it was read from.
    pub path: PathBuf,
    /// First and last timestamp on the clock of all.
    pub interval: [f64; 2],
    /// Number of Gaussians.
    pub gaussians: usize,
}

/// A joined capture.
#[derive(Debug, Clone)]
pub struct Joined {
    /// The capture.
    pub scene: GaussianScene,
    /// Its segments, in the order of their times.
    pub segments: Vec<JoinedSegment>,
    /// Whether every seam, and every window of time of a segment, is exact; else times are rounded to the 65,535
    /// segments that a temporal filter can have.
    pub is_exact: bool,
}

/// Joins segments. Begins the task "joining".
///
/// The capture is in the trained form if all segments are, with one model and one speed; else in the runtime form.
/// Segments must be in one space; their origins are used. Sockets are left out: the track of each ends with its
/// segment.
///
/// # Errors
/// Segments that are packed, are stills, are drawn with different settings or overlap; a Gaussian that cannot be drawn.
pub fn join(mut segments: Vec<Segment>, times: Times, progress: &mut dyn Progress) -> Result<Joined, SegmentsError> {
    segments.iter().try_for_each(Segment::require_unpacked)?;
    if times == Times::Own {
        segments.sort_by(|a, b| span(a).begins().total_cmp(&span(b).begins()));
    }
    require_alike(&segments)?;
    let places = places(&segments, times)?;
    let interval = [places.first(), places.last()];
    let interval = [interval[0].map_or(0.0, |place| place.start), interval[1].map_or(1.0, |place| place.end)];
    let seconds = seconds(&segments, times, interval);
    let interval = interval.map(|time| time as f32);
    let grid = filter_grid(&segments, &places, interval)?;
    let period = color_period(&segments, &places)?;
    let (trained_with, playback) = settings(&segments, interval, period, seconds);
    let environment = segments.first().and_then(|first| first.scene.environment.clone());
    let segments = in_one_form(segments, &places)?;
    let (form, intervals, segments) = merged(segments, &places, &grid, interval, progress)?;
    let count = form.len();
    let filter = TemporalFilter {
        kind: FilterKind::Window,
        segments: grid.segments,
        count,
        sets: ActiveSets::Intervals(intervals),
    };
    let (filter, (levels, sockets, colliders, sound, chunks)) = (Some(filter), Default::default());
    let scene =
        GaussianScene { form, environment, filter, trained_with, playback, levels, sockets, colliders, sound, chunks };
    Ok(Joined { scene, segments, is_exact: grid.is_exact })
}

/// Returns the times of a segment.
fn span(segment: &Segment) -> Span {
    let TrainedWith { time_interval, origin, .. } = &segment.scene.trained_with;
    Span { interval: *time_interval, origin: origin.time, seconds: f64::from(segment.scene.playback.duration_seconds) }
}

/// Returns the places of segments, which are in the order of their times.
fn places(segments: &[Segment], times: Times) -> Result<Vec<Place>, SegmentsError> {
    let spans: Vec<Span> = segments.iter().map(span).collect();
    if let Some((segment, _)) = segments.iter().zip(&spans).find(|(_, span)| span.seconds <= 0.0) {
        return Err(SegmentsError::Still { path: segment.path.clone() });
    }
    if times == Times::Following {
        return Ok(following(&spans));
    }
    let (first, usual) = (&segments[0], spans[0]);
    if let Some((segment, _)) = segments.iter().zip(&spans).find(|(_, span)| !span.is_as_fast_as(&usual)) {
        return Err(SegmentsError::Speed { path: segment.path.clone(), first: first.path.clone() });
    }
    let places = own(&spans);
    // Times are in single precision.
    let rounding = places.iter().map(|place| place.start.abs().max(place.end.abs())).fold(0.0, f64::max) * 1e-6;
    for (pair, placed) in segments.windows(2).zip(places.windows(2)) {
        if placed[1].start < placed[0].end - rounding {
            let (path, before) = (pair[1].path.clone(), pair[0].path.clone());
            return Err(SegmentsError::Overlap { path, before, end: placed[0].end });
        }
    }
    Ok(places)
}

/// Returns the seconds of the whole capture.
fn seconds(segments: &[Segment], times: Times, [start, end]: [f64; 2]) -> f64 {
    let spans = || segments.iter().map(span);
    match (times, spans().next()) {
        (Times::Own, Some(first)) => (end - start) * first.seconds / first.length(),
        _ => spans().map(|span| span.seconds).sum(),
    }
}

/// Returns the filter segments of all.
fn filter_grid(segments: &[Segment], places: &[Place], interval: [f32; 2]) -> Result<Grid, SegmentsError> {
    let division = |segment: &Segment| segment.scene.filter.as_ref().map_or(1, |filter| filter.segments);
    let window = |segment: &Segment| {
        segment.scene.filter.as_ref().filter(|filter| filter.is_of_capture()).map_or(1, |filter| filter.segments)
    };
    let divisions: Vec<u32> = segments.iter().map(division).collect();
    let windows: Vec<u32> = segments.iter().map(window).collect();
    grid(places, interval, &divisions, &windows)
        .map_err(|index| SegmentsError::Short { path: segments[index].path.clone() })
}

/// Returns the settings of the joined capture: those of the first segment, and what is of all.
fn settings(
    segments: &[Segment],
    interval: [f32; 2],
    period: Option<f32>,
    seconds: f64,
) -> (TrainedWith, PlaybackHints) {
    let each = || segments.iter().map(|segment| &segment.scene.trained_with);
    let mut trained_with = each().next().cloned().unwrap_or_default();
    trained_with.time_interval = interval;
    trained_with.color_period = period.filter(|period| *period != trained_with.time_span());
    trained_with.iteration = each().map(|trained| trained.iteration).max().unwrap_or_default();
    let pixels: Option<Vec<f32>> = each().map(|trained| trained.pixel).collect();
    trained_with.pixel = pixels.and_then(|pixels| pixels.into_iter().max_by(f32::total_cmp));
    if each().any(|trained| trained.validation != trained_with.validation) {
        trained_with.validation = None;
    }
    let up = segments.first().map(|first| first.scene.playback.up).unwrap_or_default();
    (trained_with, PlaybackHints { up, duration_seconds: seconds as f32 })
}

/// Returns the segments in one form, with the same coefficients of color.
fn in_one_form(mut segments: Vec<Segment>, places: &[Place]) -> Result<Vec<Segment>, SegmentsError> {
    let colors = segments.first().map(|first| first.scene.form.color_degrees());
    if segments.iter().any(|segment| Some(segment.scene.form.color_degrees()) != colors) {
        for Segment { scene, .. } in &mut segments {
            let degrees = scene.form.color_degrees();
            scene.form.truncate_colors(degrees.degree, degrees.degree_t);
        }
    }
    let trained = |segment: &Segment| Some((segment.scene.model()?, segment.scene.trained_with.prefilter_var));
    let first = segments.first().and_then(trained);
    let is_trained = first.is_some() && segments.iter().all(|segment| trained(segment) == first);
    // A rotation in space and time cannot be stretched in time.
    if is_trained && places.iter().all(|place| place.scale == 1.0) {
        return Ok(segments);
    }
    let as_runtime = |Segment { path, scene }: Segment| match scene.into_runtime() {
        Ok(scene) => Ok(Segment { path, scene: scene.into() }),
        Err(error) => Err(SegmentsError::from(FileError::at(&path, error))),
    };
    segments.into_iter().map(as_runtime).collect()
}

/// Returns the Gaussians of all segments, the intervals of their filter, and the facts of the segments. Begins the task
/// "joining".
fn merged(
    segments: Vec<Segment>,
    places: &[Place],
    grid: &Grid,
    interval: [f32; 2],
    progress: &mut dyn Progress,
) -> Result<(SceneForm, Vec<u32>, Vec<JoinedSegment>), SegmentsError> {
    progress.begin("joining", segments.len());
    let first = segments.first().map(|first| (first.path.clone(), first.scene.trained_with.origin));
    let Some((first_path, origin)) = first else { return Err(SegmentsError::Nothing) };
    let (mut all, mut intervals, mut facts) = (None::<SceneForm>, Vec::new(), Vec::with_capacity(segments.len()));
    for (segment, (place, &edges)) in segments.into_iter().zip(places.iter().zip(&grid.edges)) {
        proceed(progress)?;
        let frame = Frame { interval, segments: grid.segments, edges };
        intervals.extend(words(&segment, place, &frame)?);
        let Segment { path, scene: GaussianScene { mut form, trained_with, .. } } = segment;
        move_form(&mut form, place, shift(&trained_with.origin, &origin));
        let gaussians = form.len();
        let is_appended = match all.as_mut() {
            Some(all) => append(all, form),
            None => {
                all = Some(form);
                true
            }
        };
        if !is_appended {
            return Err(SegmentsError::Differs { path, first: first_path, what: Shared::Form });
        }
        facts.push(JoinedSegment { path, interval: [place.start, place.end], gaussians });
        progress.advance();
    }
    progress.finish();
    Ok((all.ok_or(SegmentsError::Nothing)?, intervals, facts))
}

/// Returns the interval of the filter of each Gaussian of a segment.
fn words(segment: &Segment, place: &Place, frame: &Frame) -> Result<Vec<u32>, SegmentsError> {
    let (scene, cutoff) = (&segment.scene, segment.scene.trained_with.marginal_cutoff);
    let gaussians = scene.gaussians().map_err(|error| segment.at(error))?;
    windows(&gaussians, scene.filter.as_ref(), place, frame, cutoff)
        .ok_or_else(|| SegmentsError::Scattered { path: segment.path.clone() })
}

/// Returns where the space of a segment begins in that of the first one.
fn shift(own: &Origin, first: &Origin) -> [f64; 3] {
    std::array::from_fn(|axis| own.place[axis] - first.place[axis])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::work::NoProgress;
    use crate::reference::render;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{RuntimeScene, UpAxis};
    use crate::view::{Background, Camera, Picture, RasterFov};
    use glam::{UVec2, Vec3};

    fn segment(seed: u64) -> Segment {
        let scene = synthesize(&SynthSettings { count: 300, seed, degree_t: 1, ..SynthSettings::default() });
        Segment { path: PathBuf::from(format!("{seed}.gs4d")), scene }
    }

    fn runtime(scene: &GaussianScene) -> RuntimeScene {
        scene.clone().into_runtime().expect("every Gaussian can be drawn")
    }

    fn picture(scene: &RuntimeScene, time: f32) -> Picture {
        let camera = Camera::look_at(Vec3::new(2.4, 0.3, 1.2), Vec3::Z * 0.1, Vec3::Z, 0.8, UVec2::new(48, 32));
        render(scene, &camera.view(time, RasterFov::Corrected), Background::Color([0.0; 3])).picture
    }

    /// Returns the largest difference of two pictures.
    fn largest(a: &Picture, b: &Picture) -> f32 {
        a.pixels.iter().zip(&b.pixels).map(|(a, b)| (*a - *b).abs().max_element()).fold(0.0, f32::max)
    }

    #[test]
    fn each_segment_looks_as_alone_up_to_its_seams() {
        let parts = [1, 2, 3].map(segment);
        let alone = parts.clone().map(|part| runtime(&part.scene));
        let joined = join(parts.to_vec(), Times::Following, &mut NoProgress).expect("equal settings");
        assert!(joined.is_exact && matches!(joined.scene.form, SceneForm::Trained(_)), "exact, in the form of all");
        let trained = &joined.scene.trained_with;
        assert_eq!((trained.time_interval, trained.color_period), ([0.0, 3.0], Some(1.0)), "the clock, and the colors");
        assert_eq!(joined.scene.playback.duration_seconds, 6.0, "three times two seconds");
        let scene = runtime(&joined.scene);
        assert_eq!(scene.check(), Ok(()), "its parts fit together");
        for (index, alone) in alone.iter().enumerate() {
            for time in [0.0, 0.25, 0.5, 0.96875] {
                let difference = largest(&picture(alone, time), &picture(&scene, index as f32 + time));
                // A splat may reach a pixel with an alpha above 1/255 on one clock only.
                assert!(difference <= if index == 0 { 0.0 } else { 5e-3 }, "{difference} at {time} of {index}");
            }
        }
    }

    #[test]
    fn no_gaussian_is_active_outside_its_segment() {
        let joined = join([1, 2].map(segment).to_vec(), Times::Following, &mut NoProgress).expect("equal settings");
        let filter = joined.scene.filter.as_ref().expect("windows");
        let counts = |range| filter.active_counts(range);
        let half = filter.segments as usize / 2;
        // Both halves have Gaussians that live beyond the seam.
        assert!(counts(0..288)[half..].iter().all(|&count| count == 0), "none of the first after the seam");
        assert!(counts(320..600)[..half].iter().all(|&count| count == 0), "none of the second before the seam");
        assert!(counts(0..600).iter().all(|&count| count > 100), "something is drawn at every time");
        let seams: Vec<_> = joined.segments.iter().map(|segment| segment.interval).collect();
        assert_eq!(seams, [[0.0, 1.0], [1.0, 2.0]], "the seam");
    }

    #[test]
    fn a_segment_of_another_speed_is_stretched() {
        let (first, mut second) = (segment(1), segment(2));
        second.scene.playback.duration_seconds = 1.0;
        let refused = join(vec![first.clone(), second.clone()], Times::Following, &mut NoProgress);
        let expected = Shared::ColorPeriod;
        assert!(
            matches!(refused, Err(SegmentsError::Differs { what, .. }) if what == expected),
            "its colors would repeat after another time"
        );
        let mut parts = vec![first, second];
        parts.iter_mut().for_each(|part| part.scene.form.truncate_colors(3, 0));
        let alone = runtime(&parts[1].scene);
        let joined = join(parts, Times::Following, &mut NoProgress).expect("colors at rest");
        assert_eq!(joined.scene.trained_with.time_interval, [0.0, 1.5], "half as long");
        assert_eq!(joined.scene.playback.duration_seconds, 3.0, "two seconds and one");
        let difference = largest(&picture(&alone, 0.5), &picture(&runtime(&joined.scene), 1.25));
        assert!(difference <= 5e-3, "the middle of the second: {difference}");
    }

    #[test]
    fn own_times_may_have_gaps_but_do_not_overlap() {
        let at = |seed, first: f32| {
            let mut part = segment(seed);
            part.scene.trained_with.origin.time = f64::from(first);
            part
        };
        let joined = join(vec![at(2, 2.0), at(1, 0.0)], Times::Own, &mut NoProgress).expect("a gap of one unit");
        assert_eq!(joined.scene.trained_with.time_interval, [0.0, 3.0], "with the gap");
        assert_eq!(joined.scene.playback.duration_seconds, 6.0, "at the speed of both");
        let counts = joined.scene.filter.as_ref().expect("windows").active_counts(0..600);
        let empty = counts.iter().filter(|&&count| count == 0).count();
        assert_eq!((empty * 3, counts[0] > 0), (counts.len(), true), "nothing is drawn in the gap");
        let overlap = join(vec![at(1, 0.0), at(2, 0.5)], Times::Own, &mut NoProgress);
        assert!(matches!(overlap, Err(SegmentsError::Overlap { end: 1.0, .. })), "half a unit of both");
    }

    #[test]
    fn segments_that_cannot_be_one_are_named() {
        let refusal = |change: fn(&mut GaussianScene)| {
            let mut other = segment(2);
            change(&mut other.scene);
            join(vec![segment(1), other], Times::Following, &mut NoProgress).expect_err("refused").to_string()
        };
        let changes: [(fn(&mut GaussianScene), &str); 4] = [
            (|scene| scene.playback.up = UpAxis::NegY, "2.gs4d: its up axis is not that of 1.gs4d"),
            (|scene| scene.trained_with.background = [1.0; 3], "its background color"),
            (|scene| scene.form.truncate_colors(1, 0), "its degree of color"),
            (|scene| scene.playback.duration_seconds = 0.0, "2.gs4d: is a still"),
        ];
        for (change, part) in changes {
            let message = refusal(change);
            assert!(message.contains(part), "{part}: {message}");
        }
        assert!(
            matches!(join(Vec::new(), Times::Following, &mut NoProgress), Err(SegmentsError::Nothing)),
            "no segment at all"
        );
    }
}
