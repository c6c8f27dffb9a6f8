//! Raw parameters and color coefficients as they are on the GPU.
//!
//! In: parameters of a scene. Out: records for the GPU; the scene with records and values of the GPU in place of its
//! own.

use crate::gaussian::{Harmonics, Parameters};
use crate::offline::engine::layout::TrainedRecord;

/// Returns the raw parameters as `slice` reads them.
pub(crate) fn records(parameters: &Parameters) -> Vec<TrainedRecord> {
    let record = |index: usize| TrainedRecord {
        mean: parameters.mean[index],
        mean_t: parameters.mean_t.get(index).copied().unwrap_or_default(),
        log_scale: parameters.log_scale[index],
        log_scale_t: parameters.log_scale_t.get(index).copied().unwrap_or_default(),
        rotation_l: parameters.rotation_l[index],
        rotation_r: parameters.rotation_r.get(index).copied().unwrap_or([1.0, 0.0, 0.0, 0.0]),
        opacity_logit: [parameters.opacity_logit[index], 0.0, 0.0, 0.0],
    };
    (0..parameters.len()).map(record).collect()
}

/// Replaces the attributes that the model has.
pub(crate) fn set_parameters(parameters: &mut Parameters, records: &[TrainedRecord]) {
    fn set<T>(attribute: &mut [T], records: &[TrainedRecord], value: impl Fn(&TrainedRecord) -> T) {
        for (attribute, record) in attribute.iter_mut().zip(records) {
            *attribute = value(record);
        }
    }
    set(&mut parameters.mean, records, |record| record.mean);
    set(&mut parameters.mean_t, records, |record| record.mean_t);
    set(&mut parameters.log_scale, records, |record| record.log_scale);
    set(&mut parameters.log_scale_t, records, |record| record.log_scale_t);
    set(&mut parameters.rotation_l, records, |record| record.rotation_l);
    set(&mut parameters.rotation_r, records, |record| record.rotation_r);
    set(&mut parameters.opacity_logit, records, |record| record.opacity_logit[0]);
}

/// Replaces the coefficients that are evaluated; `stride` is the number of values of each Gaussian.
pub(crate) fn set_harmonics(harmonics: &mut Harmonics, values: &[f32], stride: usize) {
    let used = harmonics.evaluated() * 3;
    let own = harmonics.coefficients * 3;
    for (coefficients, values) in harmonics.values.chunks_exact_mut(own.max(1)).zip(values.chunks_exact(stride)) {
        coefficients[..used].copy_from_slice(&values[..used]);
    }
}
