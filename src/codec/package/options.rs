//! Options on a package, which contains all settings itself.
//!
//! In: [`ReadOptions`] and the scene of a package. Out: the scene with the settings that are given; an error for an
//! option that contradicts the stored Gaussians.

use crate::codec::options::{InvalidOption, ReadOptions};
use crate::scene::{FilterKind, GaussianScene, TemporalFilter};

/// Replaces the stored settings by the options that are given.
///
/// # Errors
/// The first option that the stored Gaussians depend on and whose value is not the stored one.
pub(super) fn apply(options: &ReadOptions, scene: &mut GaussianScene) -> Result<(), InvalidOption> {
    let stored = &mut scene.trained_with;
    let differs = [
        ("time_interval", options.time_interval.is_some_and(|given| given != stored.time_interval)),
        ("rotation_convention", options.rotation_convention.is_some_and(|given| given != stored.rotation_convention)),
        ("force_sh_3d", options.force_sh_3d.is_some_and(|given| given != stored.force_sh_3d)),
        ("prefilter_var", options.prefilter_var.is_some_and(|given| given != stored.prefilter_var)),
    ];
    if let Some((name, _)) = differs.into_iter().find(|(_, differs)| *differs) {
        let argument = name.replace('_', "-");
        let remedy = format!("convert its checkpoint again, with gs4d convert --{argument}");
        return Err(InvalidOption { name, reason: format!("the package was made with another value; {remedy}") });
    }
    stored.background = options.background.unwrap_or(stored.background);
    stored.raster_fov = options.raster_fov.unwrap_or(stored.raster_fov);
    stored.cameras = options.cameras.unwrap_or(stored.cameras);
    let cutoff = stored.marginal_cutoff;
    stored.marginal_cutoff = options.marginal_cutoff.unwrap_or(cutoff);
    stored.sh_direction = options.sh_direction.unwrap_or(stored.sh_direction);
    scene.playback.up = options.up.unwrap_or(scene.playback.up);
    scene.playback.duration_seconds = options.duration_seconds.unwrap_or(scene.playback.duration_seconds);
    if scene.trained_with.marginal_cutoff != cutoff {
        renew_support(scene);
    }
    Ok(())
}

/// Computes a support filter again: it follows from the cut-off, and that of a higher one would hide Gaussians.
fn renew_support(scene: &mut GaussianScene) {
    let Some(TemporalFilter { segments, .. }) = scene.filter.take_if(|filter| filter.kind == FilterKind::Support)
    else {
        return;
    };
    let (interval, cutoff) = (scene.trained_with.time_interval, scene.trained_with.marginal_cutoff);
    // A scene with a Gaussian that cannot be drawn is refused wherever it is drawn, with a filter or without.
    let gaussians = scene.gaussians().ok();
    let filter = gaussians.map(|all| TemporalFilter::support(all.iter().copied(), interval, cutoff, segments));
    scene.filter = filter;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gaussian::ShDirection;
    use crate::scene::synth::{SynthSettings, synthesize};
    use crate::scene::{RotationConvention, TrainedCameras, UpAxis};
    use crate::view::RasterFov;

    fn scene() -> GaussianScene {
        synthesize(&SynthSettings { count: 1, ..SynthSettings::default() })
    }

    #[test]
    fn options_replace_the_stored_settings() {
        let options = ReadOptions {
            background: Some([0.25; 3]),
            raster_fov: Some(RasterFov::Corrected),
            cameras: Some(TrainedCameras::Intrinsics),
            sh_direction: Some(ShDirection::Displaced),
            up: Some(UpAxis::NegY),
            duration_seconds: Some(3.0),
            ..ReadOptions::default()
        };
        let mut changed = scene();
        apply(&options, &mut changed).expect("no option contradicts the scene");
        let trained = &changed.trained_with;
        let found = (trained.background, trained.raster_fov, trained.cameras, trained.sh_direction);
        let expected = ([0.25; 3], RasterFov::Corrected, TrainedCameras::Intrinsics, ShDirection::Displaced);
        assert_eq!(found, expected, "the training settings are replaced");
        assert_eq!(
            (changed.playback.up, changed.playback.duration_seconds),
            (UpAxis::NegY, 3.0),
            "the playback settings are replaced"
        );
        let mut same = scene();
        apply(&ReadOptions::default(), &mut same).expect("no option is given");
        assert_eq!(same, scene(), "without options the scene is unchanged");
    }

    #[test]
    fn another_cutoff_changes_the_support_filter_alone() {
        let whole = synthesize(&SynthSettings { count: 200, ..SynthSettings::default() });
        let interval = whole.trained_with.time_interval;
        let support = |cutoff: f32| {
            let gaussians = whole.gaussians().expect("a synthetic scene can be drawn").into_owned();
            Some(TemporalFilter::support(gaussians.into_iter(), interval, cutoff, 20))
        };
        let (before, longer) = (support(whole.trained_with.marginal_cutoff), support(0.01));
        assert_ne!(before, longer, "a lower cut-off makes lifespans longer");
        let filter_at = |cutoff: f32, filter: &Option<TemporalFilter>| {
            let mut scene = GaussianScene { filter: filter.clone(), ..whole.clone() };
            let options = ReadOptions { marginal_cutoff: Some(cutoff), ..ReadOptions::default() };
            apply(&options, &mut scene).expect("no option contradicts the scene");
            assert_eq!(scene.trained_with.marginal_cutoff, cutoff, "the cut-off is replaced");
            scene.filter
        };
        assert_eq!(filter_at(0.01, &before), longer, "the filter of the lower cut-off");
        assert_eq!(filter_at(whole.trained_with.marginal_cutoff, &before), before, "the same cut-off");
        let other = before.clone().map(|filter| TemporalFilter { kind: FilterKind::Interval, ..filter });
        assert_eq!(filter_at(0.01, &other), other, "a filter that was computed from views");
        assert_eq!(filter_at(0.01, &None), None, "no filter");
    }

    #[test]
    fn options_that_contradict_the_stored_gaussians_are_refused() {
        let none = ReadOptions::default();
        for (name, options) in [
            ("time_interval", ReadOptions { time_interval: Some([0.0, 2.0]), ..none.clone() }),
            (
                "rotation_convention",
                ReadOptions { rotation_convention: Some(RotationConvention::Unflipped), ..none.clone() },
            ),
            ("force_sh_3d", ReadOptions { force_sh_3d: Some(true), ..none.clone() }),
            ("prefilter_var", ReadOptions { prefilter_var: Some(0.5), ..none.clone() }),
        ] {
            let mut scene = scene();
            let error = apply(&options, &mut scene).expect_err("the stored value is another");
            assert_eq!(error.name, name, "the error names the option");
        }
        let mut stored = scene();
        let trained = &stored.trained_with;
        let same = ReadOptions {
            time_interval: Some(trained.time_interval),
            rotation_convention: Some(trained.rotation_convention),
            force_sh_3d: Some(trained.force_sh_3d),
            prefilter_var: Some(trained.prefilter_var),
            ..none
        };
        assert_eq!(apply(&same, &mut stored), Ok(()), "the stored values are accepted");
    }
}
