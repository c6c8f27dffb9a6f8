//! Gradients: the CPU reference of the backward passes against golden gradients and against finite differences.
//!
//! In: the scenes of `tests/golden/`; four Gaussians made here, each so large that it is blended at every pixel. Out:
//! proof that the gradient of every raw parameter is right, in every model.

use crate::support::golden_gradients::{GoldenGradient, all_gradients, tensor};
use bevy_gs4d::gaussian::{GradientMode, Harmonics, Model, Parameters, ShDirection, SliceSettings};
use bevy_gs4d::internal::gaussian::{self, GradientSettings, ParameterGradient, SplatGradient, parameter_gradient};
use bevy_gs4d::internal::gaussian::{ALPHA_MIN, alpha_at};
use bevy_gs4d::internal::reference::{self, PixelGradients};
use bevy_gs4d::reference::Layer;
use bevy_gs4d::scene::{GaussianScene, RuntimeScene, SceneForm, Trained, TrainedWith};
use bevy_gs4d::view::{Appearance, Background, BlendSpace, Camera, Optics, RasterFov, View};
use glam::{UVec2, Vec2, Vec3, Vec4};

fn norm(values: impl Iterator<Item = f64>) -> f64 {
    values.map(|value| value * value).sum::<f64>().sqrt()
}

fn of_golden(gradient: &GoldenGradient, mode: GradientMode) -> Vec<ParameterGradient> {
    let GoldenGradient { golden, trained, slice, .. } = gradient;
    let pixels = gradient.pixels();
    reference::gradients(trained, slice, &golden.scene, &golden.view, golden.background, &pixels, mode)
}

/// A hundred-thousandth of the norm of each tensor: views are drawn in single precision, the golden gradients in
/// double.
#[test]
fn gradients_match_the_golden_gradients() {
    for golden in all_gradients() {
        for mode in [GradientMode::Exact, GradientMode::Compat] {
            let gradients = of_golden(&golden, mode);
            let expected = golden.expected(mode);
            assert!(expected.len() >= 8, "{}: there is a gradient for each of at least 8 tensors", golden.golden.name);
            for (name, expected) in expected {
                let found = tensor(name, &gradients);
                let of = format!("{} {mode:?} {name}", golden.golden.name);
                assert_eq!(found.len(), expected.len(), "{of}: number of values");
                let (error, length) = (
                    norm(found.iter().zip(&expected).map(|(found, expected)| found - expected)),
                    norm(expected.iter().copied()),
                );
                println!("{of:45} norm {length:.1e} error {:.1e}", error / length);
                let largest = found.iter().fold(0.0, |largest: f64, value| largest.max(value.abs()));
                let fits = if length == 0.0 { largest <= 1e-6 } else { error <= 1e-5 * length };
                assert!(fits, "{of}: differs by {error} of {length}");
            }
        }
    }
}

#[test]
fn gaussians_that_are_not_drawn_have_no_gradient() {
    for golden in all_gradients() {
        let gradients = of_golden(&golden, GradientMode::Exact);
        let scene = &golden.golden.scene;
        assert_eq!(gradients.len(), scene.len(), "{}: one for each Gaussian", golden.golden.name);
        for (index, (gaussian, gradient)) in scene.iter().zip(&gradients).enumerate() {
            if gaussian::project(&gaussian, &golden.golden.view).is_none() {
                let zero = vec![0.0; gradient.harmonics.len()];
                let none = ParameterGradient { harmonics: zero, ..ParameterGradient::default() };
                assert_eq!(*gradient, none, "{}: Gaussian {index}", golden.golden.name);
            }
        }
    }
}

#[test]
fn gradients_are_the_same_on_every_run() {
    for golden in all_gradients() {
        let [first, second] = [(); 2].map(|()| of_golden(&golden, GradientMode::Exact));
        assert_eq!(first, second, "{}: bit by bit", golden.golden.name);
    }
}

const SIZE: UVec2 = UVec2::new(24, 20);
const TIME: f32 = 0.45;
const BACKGROUND: Background = Background::Color([0.2, 0.4, 0.6]);
const GAUSSIANS: usize = 4;
const COEFFICIENTS: usize = 48;

/// Returns four Gaussians around the origin, with different depths and positive colors.
fn four_gaussians(model: Model) -> Trained {
    let (turns, lasts) = (model == Model::Rotated4d, model != Model::Static3d);
    let when = |present: bool, values: [f32; GAUSSIANS]| if present { values.to_vec() } else { Vec::new() };
    let rotation_r = vec![[1.0, 0.3, -0.2, 0.2], [0.5, -0.6, 0.5, 0.6], [0.9, 0.1, 0.6, -0.3], [-0.8, 0.5, 0.3, 0.3]];
    let parameters = Parameters {
        mean: vec![[0.1, -0.15, 0.05], [-0.2, 0.1, -0.1], [0.15, 0.2, 0.1], [0.0, -0.25, 0.3]],
        mean_t: when(lasts, [0.2, 0.75, 0.6, 0.15]),
        log_scale: vec![[0.15, 0.35, 0.25], [0.3, 0.2, 0.4], [0.25, 0.1, 0.3], [0.2, 0.3, 0.1]],
        log_scale_t: when(lasts, [-0.7, -0.5, -0.9, -0.6]),
        rotation_l: vec![[0.9, 0.2, -0.3, 0.1], [0.6, -0.5, 0.4, 0.7], [1.1, 0.3, 0.5, -0.4], [-0.7, 0.6, 0.2, 0.5]],
        rotation_r: if turns { rotation_r } else { Vec::new() },
        opacity_logit: vec![-0.4, 0.3, -0.8, 0.6],
    };
    let stride = 3 * COEFFICIENTS;
    let value = |i: usize| 0.12 * (1.3 * i as f32 + 0.4).sin() + if i % stride < 3 { 1.2 } else { 0.0 };
    let values = (0..GAUSSIANS * stride).map(value).collect();
    let degree_t = if lasts { 2 } else { 0 };
    Trained { parameters, harmonics: Harmonics { coefficients: COEFFICIENTS, degree: 3, degree_t, values } }
}

/// A view of the four Gaussians, and a loss on it: a sum over its pixels with weights that change slowly.
struct Case {
    name: &'static str,
    trained: Trained,
    slice: SliceSettings,
    sh_direction: ShDirection,
    view: View,
    color: Vec<Vec3>,
    depth: Vec<f32>,
    alpha: Vec<f32>,
}

/// The pixels of the view, row by row.
fn pixels() -> impl Iterator<Item = Vec2> {
    (0..SIZE.y).flat_map(|y| (0..SIZE.x).map(move |x| UVec2::new(x, y).as_vec2()))
}

impl Case {
    fn new(name: &'static str, model: Model) -> Self {
        let wave = |x: f32, y: f32, phase: f32| pixels().map(move |at| (at.dot(Vec2::new(x, y)) + phase).cos());
        let camera = Camera::look_at(Vec3::new(2.0, -1.8, 1.3), Vec3::ZERO, Vec3::Z, 0.8, SIZE);
        let phases = Vec3::new(0.0, 1.1, 2.2);
        Self {
            name,
            trained: four_gaussians(model),
            slice: SliceSettings::default(),
            sh_direction: ShDirection::Canonical,
            view: camera.view(TIME, RasterFov::Reference),
            color: pixels().map(|at| phases.map(|c| (0.21 * at.x + 0.13 * at.y + c).cos())).collect(),
            depth: wave(0.17, -0.11, -1.1).map(|weight| 0.2 * weight).collect(),
            alpha: wave(0.15, 0.19, 2.0).map(|weight| 0.4 * weight).collect(),
        }
    }

    /// Returns the case with settings that differ from training.
    fn with_slice_settings(self) -> Self {
        Self { slice: SliceSettings { scale_modifier: 0.8, prefilter_var: 0.02 }, ..self }
    }

    fn scene(&self, trained: &Trained) -> RuntimeScene {
        let trained_with = TrainedWith {
            time_interval: [0.0, 1.3],
            sh_direction: self.sh_direction,
            prefilter_var: self.slice.prefilter_var,
            ..TrainedWith::default()
        };
        let form = SceneForm::Trained(trained.clone());
        let (environment, filter, playback, levels, sockets, colliders, sound, chunks) = Default::default();
        let scene = GaussianScene {
            form,
            environment,
            filter,
            trained_with,
            playback,
            levels,
            sockets,
            colliders,
            sound,
            chunks,
        };
        scene.into_runtime_with(&self.slice).expect("valid Gaussians")
    }

    fn gradients(&self) -> Vec<ParameterGradient> {
        let pixels = PixelGradients { color: &self.color, depth: &self.depth, alpha: &self.alpha };
        let scene = self.scene(&self.trained);
        let mode = GradientMode::Exact;
        reference::gradients(&self.trained, &self.slice, &scene, &self.view, BACKGROUND, &pixels, mode)
    }

    fn loss(&self, trained: &Trained) -> f64 {
        let frame = reference::render(&self.scene(trained), &self.view, BACKGROUND);
        let mut loss = 0.0;
        for i in 0..frame.depth.len() {
            loss += self.color[i].as_dvec3().dot(frame.picture.pixels[i].as_dvec3());
            loss += f64::from(self.depth[i]) * f64::from(frame.depth[i]);
            loss += f64::from(self.alpha[i]) * (1.0 - f64::from(frame.transmittance[i]));
        }
        loss
    }

    /// Returns the difference quotient of the loss at one value; `None` if the model has no such parameter.
    fn difference(&self, kind: &Kind, index: usize, component: usize) -> Option<f64> {
        let moved = |step: f32| {
            let mut trained = self.trained.clone();
            let value = (kind.value)(&mut trained, index, component)?;
            *value += step;
            let value = f64::from(*value);
            Some((value, self.loss(&trained)))
        };
        let ((low, before), (high, after)) = (moved(-STEP)?, moved(STEP)?);
        Some((after - before) / (high - low))
    }

    /// Asserts that no decision changes within a step: all Gaussians are blended at all pixels, with no clamp, and keep
    /// their order.
    fn assert_smooth(&self) {
        let scene = self.scene(&self.trained);
        let layer = Layer { scene: &scene, view: self.view, appearance: Appearance::default() };
        let splats = reference::project(&layer, BlendSpace::Encoded);
        let lists = reference::tile_lists(&splats, &self.view);
        assert_eq!(lists.pairs.len(), GAUSSIANS * 4, "{}: all Gaussians are in all four tiles", self.name);
        for splat in &splats {
            for at in pixels() {
                let alpha = alpha_at(splat.conic, splat.opacity, splat.center - at);
                let clear = alpha.is_some_and(|alpha| alpha > 2.0 * ALPHA_MIN && alpha < 0.9);
                assert!(clear, "{}: alpha {alpha:?} at {at}", self.name);
            }
            assert!(splat.color.min_element() > 0.1, "{}: color {}", self.name, splat.color);
        }
        let mut depths: Vec<f32> = splats.iter().map(|splat| splat.depth).collect();
        depths.sort_by(f32::total_cmp);
        assert!(depths.windows(2).all(|pair| pair[1] - pair[0] > 0.05), "{}: depths {depths:?}", self.name);
        let frame = reference::render(&scene, &self.view, BACKGROUND);
        assert!(frame.transmittance.iter().all(|&left| left > 0.01), "{}: no pixel stops early", self.name);
    }
}

/// A kind of raw parameter: its values, and their gradients.
struct Kind {
    name: &'static str,
    components: usize,
    /// Returns the value of a Gaussian and a component; `None` if the model does not have it.
    value: fn(&mut Trained, usize, usize) -> Option<&mut f32>,
    gradient: fn(&ParameterGradient, usize) -> f64,
}

const KINDS: [Kind; 11] = [
    Kind {
        name: "mean",
        components: 3,
        value: |t, index, i| t.parameters.mean.get_mut(index)?.get_mut(i),
        gradient: |g, i| g.mean[i],
    },
    Kind {
        name: "mean_t",
        components: 1,
        value: |t, index, _| t.parameters.mean_t.get_mut(index),
        gradient: |g, _| g.mean_t,
    },
    Kind {
        name: "log_scale",
        components: 3,
        value: |t, index, i| t.parameters.log_scale.get_mut(index)?.get_mut(i),
        gradient: |g, i| g.log_scale[i],
    },
    Kind {
        name: "log_scale_t",
        components: 1,
        value: |t, index, _| t.parameters.log_scale_t.get_mut(index),
        gradient: |g, _| g.log_scale_t,
    },
    Kind {
        name: "rotation_l",
        components: 4,
        value: |t, index, i| t.parameters.rotation_l.get_mut(index)?.get_mut(i),
        gradient: |g, i| g.rotation_l[i],
    },
    Kind {
        name: "rotation_r",
        components: 4,
        value: |t, index, i| t.parameters.rotation_r.get_mut(index)?.get_mut(i),
        gradient: |g, i| g.rotation_r[i],
    },
    Kind {
        name: "opacity_logit",
        components: 1,
        value: |t, index, _| t.parameters.opacity_logit.get_mut(index),
        gradient: |g, _| g.opacity_logit,
    },
    Kind {
        name: "first coefficient",
        components: 3,
        value: |t, index, i| coefficient(t, index, 0, i),
        gradient: |g, i| g.harmonics[i],
    },
    Kind {
        name: "high spatial coefficient",
        components: 3,
        value: |t, index, i| coefficient(t, index, 13, i),
        gradient: |g, i| g.harmonics[3 * 13 + i],
    },
    Kind {
        name: "first harmonic in time",
        components: 3,
        value: |t, index, i| coefficient(t, index, 16 + 5, i),
        gradient: |g, i| g.harmonics[3 * (16 + 5) + i],
    },
    Kind {
        name: "second harmonic in time",
        components: 3,
        value: |t, index, i| coefficient(t, index, 32 + 11, i),
        gradient: |g, i| g.harmonics[3 * (32 + 11) + i],
    },
];

fn coefficient(trained: &mut Trained, index: usize, k: usize, channel: usize) -> Option<&mut f32> {
    trained.harmonics.values.get_mut(3 * (COEFFICIENTS * index + k) + channel)
}

/// Step of the differences: the errors by rounding in single precision and by curvature are both below a thousandth of
/// the gradient.
const STEP: f32 = 0.01;

/// Asserts that the gradients are the difference quotients, up to a hundredth of the norm of each kind.
fn assert_differences(case: &Case) {
    case.assert_smooth();
    let gradients = case.gradients();
    for kind in &KINDS {
        let mut both = Vec::new();
        for (index, gradient) in gradients.iter().enumerate() {
            for i in 0..kind.components {
                let found = (kind.gradient)(gradient, i);
                match case.difference(kind, index, i) {
                    Some(difference) => both.push([found, difference]),
                    None => assert_eq!(found, 0.0, "{} {}: there is no such parameter", case.name, kind.name),
                }
            }
        }
        let error = norm(both.iter().map(|[found, difference]| found - difference));
        let length = norm(both.iter().map(|[found, _]| *found));
        println!("{:20} {:25} norm {length:.1e} error {error:.1e}", case.name, kind.name);
        assert!(error <= 2e-3 * length, "{} {}: {both:?}", case.name, kind.name);
    }
}

#[test]
fn gradients_of_rotated_gaussians_are_difference_quotients() {
    assert_differences(&Case::new("rotated", Model::Rotated4d));
}

#[test]
fn gradients_through_the_displaced_direction_are_difference_quotients() {
    let case = Case { sh_direction: ShDirection::Displaced, ..Case::new("displaced", Model::Rotated4d) };
    assert_differences(&case.with_slice_settings());
}

#[test]
fn gradients_of_unrotated_gaussians_are_difference_quotients() {
    assert_differences(&Case::new("unrotated", Model::Unrotated4d).with_slice_settings());
}

#[test]
fn gradients_of_static_gaussians_are_difference_quotients() {
    assert_differences(&Case::new("static", Model::Static3d));
}

#[test]
fn gradients_in_an_orthographic_view_are_difference_quotients() {
    let case = Case::new("orthographic", Model::Rotated4d);
    // Ten pixels per unit on both axes.
    let projection = Vec4::new(20.0 / SIZE.x as f32, 20.0 / SIZE.y as f32, 0.0, 0.0);
    let view = View::orthographic(SIZE, TIME, case.view.world_to_camera, projection, 0.2);
    assert_differences(&Case { view, ..case });
}

/// The filter of Mip-Splatting matters to splats of about a pixel, which no picture shows everywhere: the opacity of
/// each splat is the loss.
#[test]
fn gradients_through_the_filter_of_mip_splatting_are_difference_quotients() {
    const STEP: f32 = 2e-3;
    let mut case = Case::new("filtered", Model::Static3d);
    case.view = case.view.with_optics(Optics { trained_pixel: 0.0, ..Optics::default() });
    case.trained.parameters.log_scale.as_flattened_mut().iter_mut().for_each(|scale| *scale -= 3.2);
    let settings = GradientSettings {
        slice: case.slice,
        sh_direction: case.sh_direction,
        time_span: 1.3,
        force_sh_3d: false,
        mode: GradientMode::Exact,
    };
    let splat = SplatGradient { opacity: 1.0, ..SplatGradient::default() };
    let opacity = |trained: &Trained, index: usize| {
        let gaussian = case.scene(trained).gaussian(index);
        f64::from(gaussian::project(&gaussian, &case.view).expect("it is in the picture").opacity)
    };
    let Trained { parameters, harmonics } = &case.trained;
    for kind in &KINDS[..7] {
        let mut both = Vec::new();
        for index in 0..GAUSSIANS {
            let gradient = parameter_gradient(parameters, harmonics, index, &case.view, &settings, &splat);
            for i in 0..kind.components {
                let moved = |step: f32| {
                    let mut trained = case.trained.clone();
                    let value = (kind.value)(&mut trained, index, i)?;
                    *value += step;
                    let value = f64::from(*value);
                    Some((value, opacity(&trained, index)))
                };
                let Some(((low, before), (high, after))) = moved(-STEP).zip(moved(STEP)) else { continue };
                both.push([(kind.gradient)(&gradient, i), (after - before) / (high - low)]);
            }
        }
        let error = norm(both.iter().map(|[found, difference]| found - difference));
        let length = norm(both.iter().map(|[found, _]| *found));
        println!("filtered {:25} norm {length:.1e} error {error:.1e}", kind.name);
        assert!(error <= 1e-2 * length, "{}: {both:?}", kind.name);
    }
}
