//! The uniform of the pass `shade` for a view. Mirrors the structures of `shaders/pbr/shade.wgsl`.
//!
//! In: the captures that a camera draws, with their shading. Out: [`GpuSettings`].

use super::components::{CaptureLight, ReceivesShadows};
use super::extract::PlacedShading;
use bevy::log::warn_once;
use bevy::render::render_resource::ShaderType;
use glam::{Mat4, UVec2, Vec4};

/// Maximum number of captures of one view with separate shading.
pub(super) const MOST_SHADINGS: usize = 16;

/// Distance over which the own shadow of a capture sets in, in distances of the shadow behind the surface.
const OWN_SHADOW: f32 = 2.0;

/// Distance from the center of a cube for captures without a box: larger than the distance of any box.
const BEYOND_ALL_BOXES: f32 = 1e30;

/// The shading of one capture. Mirrors `Shading`.
#[derive(ShaderType, Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct GpuShading {
    cube_from_world: [Vec4; 3],
    tint: Vec4,
    light: Vec4,
}

/// The shading of a view. Mirrors `Settings`.
#[derive(ShaderType, Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct GpuSettings {
    pub(super) size: UVec2,
    count: u32,
    is_linear: u32,
    is_surrounded: u32,
    shadings: [GpuShading; MOST_SHADINGS],
}

impl GpuSettings {
    /// Creates the settings of a view. Captures that only fog changes are listed only together with shaded captures.
    pub(super) fn new<'a>(
        size: UVec2,
        is_linear: bool,
        drawn: impl Iterator<Item = &'a PlacedShading> + Clone,
    ) -> Self {
        let is_surrounded = drawn.clone().any(|placed| placed.has_environment);
        let mut settings =
            Self { size, is_linear: u32::from(is_linear), is_surrounded: u32::from(is_surrounded), ..Self::default() };
        if drawn.clone().any(PlacedShading::is_shaded) {
            let shaded = drawn.clone().filter(|placed| placed.is_shaded());
            let others = drawn.clone().filter(|placed| !placed.is_shaded());
            for (entry, placed) in settings.shadings.iter_mut().zip(shaded.chain(others)) {
                *entry = GpuShading::new(placed);
                settings.count += 1;
            }
            if drawn.count() > MOST_SHADINGS {
                warn_once!(
                    "a camera sees more than {MOST_SHADINGS} captures, of which some receive shadows or light: some of \
                     the others are shaded like their neighbors; show fewer captures at once"
                );
            }
        }
        settings
    }
}

impl GpuShading {
    fn new(placed: &PlacedShading) -> Self {
        let cube_from_world = match placed.cube_from_world.map(Mat4::from) {
            Some(cube) => [cube.row(0), cube.row(1), cube.row(2)],
            None => [BEYOND_ALL_BOXES * Vec4::W; 3],
        };
        let ReceivesShadows { tint, bias } = placed.shadows.unwrap_or_default();
        let [red, green, blue] = [tint.red, tint.green, tint.blue].map(number);
        let receives = if placed.shadows.is_some() { 1.0 } else { 0.0 };
        let CaptureLight { reference, amount } = placed.light.unwrap_or(CaptureLight { reference: 1.0, amount: 0.0 });
        let valid = reference.is_finite() && reference > 0.0;
        let amount = if valid { number(amount).min(1.0) } else { 0.0 };
        let inverse = if valid { reference.recip() } else { 0.0 };
        let bias = if bias.is_finite() { bias } else { 0.0 };
        Self {
            cube_from_world,
            tint: Vec4::new(red, green, blue, receives),
            light: Vec4::new(amount, inverse, bias, OWN_SHADOW * placed.own_shadow),
        }
    }
}

/// Returns a value if it is finite and positive, else 0.
fn number(value: f32) -> f32 {
    if value.is_finite() { value.max(0.0) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Affine3A;

    const PLAIN: PlacedShading = PlacedShading {
        cube_from_world: Some(Affine3A::IDENTITY),
        has_environment: false,
        shadows: None,
        own_shadow: 0.0,
        light: None,
    };

    fn lit(light: CaptureLight) -> PlacedShading {
        PlacedShading { light: Some(light), ..PLAIN }
    }

    #[test]
    fn captures_changed_only_by_fog_are_listed_only_with_shaded_ones() {
        let plain = GpuSettings::new(UVec2::ONE, false, [PLAIN, PLAIN].iter());
        assert_eq!(plain.count, 0, "no capture is listed without a shaded capture");
        let light = CaptureLight { reference: 0.5, amount: 1.0 };
        let mixed = GpuSettings::new(UVec2::ONE, true, [PLAIN, lit(light)].iter());
        assert_eq!((mixed.count, mixed.is_linear), (2, 1), "both captures are listed");
        assert_eq!(mixed.shadings[0].light, Vec4::new(1.0, 2.0, 0.02, 0.0), "the shaded capture comes first");
        assert_eq!(
            (mixed.shadings[1].light.x, mixed.shadings[1].tint.w),
            (0.0, 0.0),
            "the unshaded capture has neither light nor shadow"
        );
    }

    #[test]
    fn unshaded_captures_are_dropped_beyond_the_maximum() {
        let mut drawn = vec![PLAIN; 40];
        drawn[39] = lit(CaptureLight::default());
        let settings = GpuSettings::new(UVec2::ONE, false, drawn.iter());
        assert_eq!(settings.count as usize, MOST_SHADINGS, "the list is full");
        assert_eq!(settings.shadings[0].light.x, 1.0, "the shaded capture is listed first");
    }

    #[test]
    fn invalid_light_settings_have_no_effect() {
        for reference in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let shading = GpuShading::new(&lit(CaptureLight { reference, amount: 1.0 }));
            assert_eq!(shading.light.x, 0.0, "no light with a reference of {reference}");
        }
        let shading = GpuShading::new(&lit(CaptureLight { amount: f32::NAN, ..CaptureLight::default() }));
        assert_eq!(shading.light.x, 0.0, "no light with an amount of NaN");
        let shading = GpuShading::new(&lit(CaptureLight { amount: 9.0, ..CaptureLight::default() }));
        assert_eq!(shading.light.x, 1.0, "an amount above 1 counts as 1");
    }

    #[test]
    fn captures_without_a_box_are_beyond_all_boxes() {
        let boundless = GpuShading::new(&PlacedShading { cube_from_world: None, has_environment: true, ..PLAIN });
        assert!(
            boundless.cube_from_world.iter().all(|row| row.w == BEYOND_ALL_BOXES),
            "every point is outside a capture without a box"
        );
        let surrounded = PlacedShading { has_environment: true, ..PLAIN };
        assert_eq!(
            GpuSettings::new(UVec2::ONE, false, [surrounded].iter()).is_surrounded,
            1,
            "an environment map marks the view as surrounded"
        );
    }
}
