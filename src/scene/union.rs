//! The capture of chunks.
//!
//! In: the chunks of a capture, in order. Out: the capture, with the Gaussians in the order of the chunks; a packed one
//! is the package that was cut.

use super::packed::{BLOCK, SHARED_RANGES};
use super::{ActiveSets, Form, GaussianScene, PackedColors, PackedScene, RunPart, Runs, SceneForm, TemporalFilter};
use crate::gaussian::{Harmonics, Parameters};

/// The chunks of a capture that have been put together.
#[derive(Debug)]
pub(crate) struct Union {
    /// The first chunk, with the Gaussians of the others, without its filter.
    all: GaussianScene,
    /// The filters of the chunks, and the number of chunks.
    filters: Vec<TemporalFilter>,
    count: usize,
}

/// What a chunk has that is not that of the first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unlike {
    /// The settings.
    Settings,
    /// The form of the Gaussians.
    Form,
    /// The temporal filter, or that there is none.
    Filter,
}

impl Union {
    /// Begins with the first chunk, which has all that is not of a Gaussian.
    pub(crate) fn new(mut first: GaussianScene) -> Self {
        let filters = first.filter.take().into_iter().collect();
        Self { all: first, filters, count: 1 }
    }

    /// Appends a chunk.
    ///
    /// # Errors
    /// A chunk of another capture.
    pub(crate) fn append(&mut self, chunk: GaussianScene) -> Result<(), Unlike> {
        let Self { all, filters, count } = self;
        if chunk.trained_with != all.trained_with || chunk.playback != all.playback {
            return Err(Unlike::Settings);
        }
        if !append(&mut all.form, chunk.form) {
            return Err(Unlike::Form);
        }
        *count += 1;
        filters.extend(chunk.filter);
        let Some(TemporalFilter { kind, segments, .. }) = filters.first() else { return Ok(()) };
        let is_alike = |filter: &TemporalFilter| (&filter.kind, &filter.segments) == (kind, segments);
        match filters.len() == *count && filters.last().is_some_and(is_alike) {
            true => Ok(()),
            false => Err(Unlike::Filter),
        }
    }

    /// Returns the capture.
    pub(crate) fn finish(self) -> GaussianScene {
        GaussianScene { filter: concatenated(&self.filters), ..self.all }
    }
}

/// Returns the filter of the Gaussians of several filters of one number of segments; `None` if there is none.
fn concatenated(filters: &[TemporalFilter]) -> Option<TemporalFilter> {
    let TemporalFilter { kind, segments, .. } = *filters.first()?;
    let count = filters.iter().map(|filter| filter.count).sum();
    let intervals: Option<Vec<&Vec<u32>>> = filters
        .iter()
        .map(|filter| match &filter.sets {
            ActiveSets::Intervals(words) => Some(words),
            ActiveSets::Bits(_) => None,
        })
        .collect();
    if let Some(intervals) = intervals {
        let sets = ActiveSets::Intervals(intervals.into_iter().flatten().copied().collect());
        return Some(TemporalFilter { kind, segments, count, sets });
    }
    let words = TemporalFilter::words(count);
    let mut bits = vec![0; words * segments as usize];
    let mut first = 0;
    for filter in filters {
        for segment in 0..segments {
            for index in (0..filter.count).filter(|&index| filter.is_active(segment, index)) {
                let to = first + index;
                bits[segment as usize * words + to / 32] |= 1 << (to % 32);
            }
        }
        first += filter.count;
    }
    Some(TemporalFilter { kind, segments, count, sets: ActiveSets::Bits(bits) })
}

/// Appends the Gaussians of a form to those of another. Returns false if the forms or the models are different, or the
/// numbers of coefficients; then nothing is appended.
pub(crate) fn append(all: &mut SceneForm, part: SceneForm) -> bool {
    match (all, part) {
        (SceneForm::Trained(all), SceneForm::Trained(part)) => {
            let is_alike = all.parameters.model() == part.parameters.model();
            if is_alike && append_colors(&mut all.harmonics, part.harmonics) {
                append_parameters(&mut all.parameters, part.parameters);
                return true;
            }
            false
        }
        (SceneForm::Ready(Form::Sliced(all)), SceneForm::Ready(Form::Sliced(mut part))) => {
            if append_colors(&mut all.harmonics, part.harmonics) {
                all.gaussians.append(&mut part.gaussians);
                return true;
            }
            false
        }
        (SceneForm::Ready(Form::Packed(all)), SceneForm::Ready(Form::Packed(part))) => append_packed(all, part),
        _ => false,
    }
}

/// Appends packed Gaussians that are drawn by the same ranges and codebooks, and their runs.
fn append_packed(all: &mut PackedScene, mut part: PackedScene) -> bool {
    let count = all.len();
    let (Some(runs), Some(own)) = (&mut all.runs, part.runs) else { return false };
    let shared = |ranges: &[[f32; 4]]| {
        ranges.iter().take(SHARED_RANGES).map(|range| range.map(f32::to_bits)).collect::<Vec<_>>()
    };
    let is_alike =
        count.is_multiple_of(BLOCK) && runs.stretches == own.stretches && shared(&all.ranges) == shared(&part.ranges);
    if !is_alike || !append_packed_colors(&mut all.colors, part.colors) {
        return false;
    }
    let Runs { parts, .. } = own;
    runs.parts.extend(parts.into_iter().map(|part| RunPart { end: count + part.end, ..part }));
    all.layers = runs.layers();
    all.records.append(&mut part.records);
    all.ranges.extend(part.ranges.into_iter().skip(SHARED_RANGES));
    true
}

fn append_packed_colors(all: &mut PackedColors, part: PackedColors) -> bool {
    match (all, part) {
        (PackedColors::Whole(all), PackedColors::Whole(part)) => append_colors(all, part),
        (PackedColors::Coded(all), PackedColors::Coded(mut part)) => {
            let degrees = (all.degree, all.degree_t) == (part.degree, part.degree_t);
            let is_alike = degrees && all.codebooks == part.codebooks;
            if is_alike {
                all.records.append(&mut part.records);
            }
            is_alike
        }
        _ => false,
    }
}

fn append_colors(all: &mut Harmonics, mut part: Harmonics) -> bool {
    let degrees = |harmonics: &Harmonics| (harmonics.coefficients, harmonics.degree, harmonics.degree_t);
    let is_alike = degrees(all) == degrees(&part);
    if is_alike {
        all.values.append(&mut part.values);
    }
    is_alike
}

fn append_parameters(all: &mut Parameters, mut part: Parameters) {
    all.mean.append(&mut part.mean);
    all.mean_t.append(&mut part.mean_t);
    all.log_scale.append(&mut part.log_scale);
    all.log_scale_t.append(&mut part.log_scale_t);
    all.rotation_l.append(&mut part.rotation_l);
    all.rotation_r.append(&mut part.rotation_r);
    all.opacity_logit.append(&mut part.opacity_logit);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::FilterKind;
    use crate::scene::synth::{SynthSettings, synthesize};

    #[test]
    fn filters_of_both_forms_are_concatenated() {
        let filter = |count, sets| TemporalFilter { kind: FilterKind::Support, segments: 2, count, sets };
        let bits = filter(33, ActiveSets::Bits(vec![1, 1, u32::MAX, 0]));
        let intervals = filter(2, ActiveSets::Intervals(vec![0, 1 | 1 << 16]));
        let both = concatenated(&[bits, intervals.clone()]).expect("two filters");
        assert_eq!(both.check(35), Ok(()), "a filter of all");
        assert_eq!(both.to_bits(), [1, 0b011, u32::MAX, 0b100], "the Gaussians of the second follow");
        let twice = concatenated(&[intervals.clone(), intervals]).expect("two filters");
        assert_eq!(twice.sets, ActiveSets::Intervals(vec![0, 1 | 1 << 16, 0, 1 | 1 << 16]), "intervals stay intervals");
    }

    #[test]
    fn only_equal_forms_are_appended() {
        let scene = |degree| synthesize(&SynthSettings { count: 3, degree, ..SynthSettings::default() });
        let mut all = scene(3).form;
        assert!(append(&mut all, scene(3).form), "two trained forms");
        assert_eq!((all.len(), all.harmonics().map(|colors| colors.values.len())), (6, Some(6 * 48 * 3)), "of both");
        assert!(!append(&mut all, scene(1).form), "another degree of color");
        let runtime = scene(3).into_runtime().expect("the scene can be drawn");
        assert!(!append(&mut all, SceneForm::Ready(runtime.form)), "another form");
        assert_eq!(all.len(), 6, "what differs is left out");
    }
}
