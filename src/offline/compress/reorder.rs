//! From a packed scene to the same scene in another order.
//!
//! In: a packed scene, a [`PackedOrder`]. Out: its Gaussians in that order, without those that are never visible: fillers
//! of the order of before. Positions and velocities are rounded once more (`PackedScene::reordered`).

use super::pack::{CompressReport, chunk_order};
use super::{CompressError, PackedOrder};
use crate::gaussian::Gaussian;
use crate::scene::packed::order::Order;
use crate::scene::packed::pack::check_each;
use crate::scene::{Form, GaussianScene, RuntimeScene};

/// Stores a packed scene in another order. Levels of detail stay as they are.
///
/// # Errors
/// A scene that is not packed, more stretches or chunk files than an index may have.
pub fn reorder(scene: RuntimeScene, order: &PackedOrder) -> Result<(GaussianScene, CompressReport), CompressError> {
    let Form::Packed(packed) = &scene.form else { return Err(CompressError::NotPacked) };
    let keep: Vec<u32> =
        (0..packed.len() as u32).filter(|&index| packed.gaussian(index as usize).opacity > 0.0).collect();
    let gaussians: Vec<Gaussian> = keep.iter().map(|&index| packed.gaussian(index as usize)).collect();
    let wanted = match order {
        PackedOrder::Chunks(cut) => {
            let filter = scene.filter.as_ref().map(|filter| filter.select(&keep));
            chunk_order(&gaussians, &gaussians, filter.as_ref(), &scene, cut)?
        }
        PackedOrder::Progressive | PackedOrder::Spatial => Order::of(&gaussians, *order == PackedOrder::Progressive),
    };
    let indices: Vec<u32> = wanted.indices.iter().map(|&place| keep[place as usize]).collect();
    let wanted = Order { indices, ..wanted };
    let reordered = packed.reordered(&wanted, scene.trained_with.time_span());
    reordered.check().map_err(CompressError::Range)?;
    check_each(&reordered, &wanted.indices)?;
    let report = CompressReport {
        gaussians: keep.len(),
        fillers: reordered.len() - keep.len(),
        memory_before: scene.size(),
        memory_after: reordered.size(),
        codebooks: scene.form.coded_colors().map(|colors| colors.codebooks.entries.clone()).unwrap_or_default(),
    };
    let filter = scene.filter.as_ref().map(|filter| filter.select(&wanted.indices));
    Ok((RuntimeScene { form: Form::Packed(reordered), filter, ..scene }.into(), report))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::offline::compress::{CompressSettings, Quality, compress};
    use crate::offline::segments::Cut;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{PackedScene, Packing, TemporalFilter};
    use std::collections::BTreeMap;

    /// Returns a packed scene with codebooks and a support filter.
    fn packed() -> RuntimeScene {
        let scene = synthesize(&SynthSettings { count: 9000, degree: 1, ..SynthSettings::default() });
        let scene = scene.into_runtime().expect("it can be drawn");
        let settings = CompressSettings { codebooks: vec![32], ..CompressSettings::from(Quality::Balanced) };
        let (packed, _) = compress(scene, &settings).expect("the scene fits");
        let mut packed = packed.into_runtime().expect("it can be drawn");
        let (interval, cutoff) = (packed.trained_with.time_interval, packed.trained_with.marginal_cutoff);
        packed.filter = Some(TemporalFilter::support(packed.iter(), interval, cutoff, 20));
        packed
    }

    fn of(scene: &RuntimeScene) -> &PackedScene {
        scene.form.as_packed().expect("packed")
    }

    #[test]
    fn gaussians_keep_all_but_the_last_digits_of_their_positions() {
        let before = packed();
        // What keeps its bits; some Gaussians have all of it in common.
        let key = |scene: &RuntimeScene, index: usize| {
            let Gaussian { mean_t, sigma_t, covariance, opacity, .. } = scene.gaussian(index);
            let color = scene.form.coded_colors().expect("coded").records[index];
            let exact = [mean_t, sigma_t, opacity, covariance[0], covariance[4]].map(f32::to_bits);
            (exact, color)
        };
        let mut known: BTreeMap<_, Vec<usize>> = BTreeMap::new();
        (0..before.len()).for_each(|index| known.entry(key(&before, index)).or_default().push(index));
        assert!(known.len() > 1000, "{} keys", known.len());
        let cut = Cut { seconds: before.playback.duration_seconds / 4.0, layers: Default::default() };
        for order in [PackedOrder::Progressive, PackedOrder::Chunks(cut), PackedOrder::Spatial] {
            let (after, report) = reorder(before.clone(), &order).expect("it is packed");
            let after = after.into_runtime().expect("it can be drawn");
            assert_eq!(after.check(), Ok(()), "{order:?}: its parts fit together");
            assert_eq!(after.len(), report.gaussians + report.fillers, "{order:?}: Gaussians and fillers");
            assert_eq!(of(&after).runs.is_some(), matches!(order, PackedOrder::Chunks(_)), "{order:?}: its runs");
            assert_eq!(of(&after).layers.is_empty(), order == PackedOrder::Spatial, "{order:?}: its layers");
            let (filter, filter_before) =
                (after.filter.as_ref().expect("kept"), before.filter.as_ref().expect("a filter"));
            let mut visible = 0;
            for index in (0..after.len()).filter(|&index| after.gaussian(index).opacity > 0.0) {
                visible += 1;
                let now = after.gaussian(index);
                let apart = |a: [f32; 3], b: [f32; 3]| (0..3).map(|axis| (a[axis] - b[axis]).abs()).fold(0.0, f32::max);
                let is_close = |then: Gaussian| {
                    let moved = apart(now.velocity, then.velocity) * now.sigma_t.min(1.0);
                    apart(now.mean, then.mean) < 1e-3 && moved < 2e-3
                };
                let candidates = known.get(&key(&after, index)).into_iter().flatten().copied();
                let old = candidates.clone().find(|&old| is_close(before.gaussian(old)));
                let Some(old) = old else {
                    panic!("{order:?}: {now:?} is none of {:?}", candidates.collect::<Vec<_>>())
                };
                let active =
                    |filter: &TemporalFilter, index| (0..20).map(|at| filter.is_active(at, index)).collect::<Vec<_>>();
                assert_eq!(active(filter, index), active(filter_before, old), "{order:?}: active in the same segments");
            }
            assert_eq!(visible, report.gaussians, "{order:?}: every Gaussian once");
        }
    }

    #[test]
    fn a_scene_that_is_not_packed_is_refused() {
        let scene = synthesize(&SynthSettings { count: 10, ..SynthSettings::default() });
        let scene = scene.into_runtime().expect("it can be drawn");
        assert!(
            matches!(reorder(scene.clone(), &PackedOrder::Progressive), Err(CompressError::NotPacked)),
            "not packed"
        );
        let packed = scene.pack(&Packing::default()).expect("the scene fits");
        assert!(reorder(packed, &PackedOrder::Progressive).is_ok(), "packed");
    }
}
