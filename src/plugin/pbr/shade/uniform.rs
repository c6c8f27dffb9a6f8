//! What the pass `shade` is told about a view: the mirror of the structures of `shaders/pbr/shade.wgsl`.
//!
//! In: the captures that a camera draws, and how each is shaded. Out: [`GpuSettings`].

use super::components::{CaptureLight, ReceivesShadows};
use super::extract::PlacedShading;
use bevy::log::warn_once;
use bevy::render::render_resource::ShaderType;
use glam::{Mat4, UVec2, Vec4};

/// Captures of one view that are told apart.
pub(super) const MOST_SHADINGS: usize = 16;

/// A distance from the middle of a cube that is larger than any other: that of what has no box.
const BEYOND_ALL_BOXES: f32 = 1e30;

/// How one capture is shaded. Mirrors `Shading`.
#[derive(ShaderType, Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct GpuShading {
    cube_from_world: [Vec4; 3],
    tint: Vec4,
    light: Vec4,
}

/// How a view is shaded. Mirrors `Settings`.
#[derive(ShaderType, Debug, Default, Clone, Copy, PartialEq)]
pub(super) struct GpuSettings {
    pub(super) size: UVec2,
    count: u32,
    is_linear: u32,
    is_surrounded: u32,
    shadings: [GpuShading; MOST_SHADINGS],
}

impl GpuSettings {
    /// Creates the settings of a view of these captures. Captures that nothing but fog changes are listed only beside others.
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
                    "a camera sees more than {MOST_SHADINGS} captures, of which some receive shadows or light: of the others, some \
                     are shaded as their neighbors are"
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
            light: Vec4::new(amount, inverse, bias, 0.0),
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

    const PLAIN: PlacedShading =
        PlacedShading { cube_from_world: Some(Affine3A::IDENTITY), has_environment: false, shadows: None, light: None };

    fn lit(light: CaptureLight) -> PlacedShading {
        PlacedShading { light: Some(light), ..PLAIN }
    }

    #[test]
    fn captures_that_only_fog_changes_are_not_listed_alone() {
        let plain = GpuSettings::new(UVec2::ONE, false, [PLAIN, PLAIN].iter());
        assert_eq!(plain.count, 0, "nothing to tell apart");
        let light = CaptureLight { reference: 0.5, amount: 1.0 };
        let mixed = GpuSettings::new(UVec2::ONE, true, [PLAIN, lit(light)].iter());
        assert_eq!((mixed.count, mixed.is_linear), (2, 1), "both, since they must be told apart");
        assert_eq!(mixed.shadings[0].light, Vec4::new(1.0, 2.0, 0.02, 0.0), "those that are shaded come first");
        assert_eq!((mixed.shadings[1].light.x, mixed.shadings[1].tint.w), (0.0, 0.0), "the other stays as it is");
    }

    #[test]
    fn more_captures_than_places_are_cut_off_at_the_plain_end() {
        let mut drawn = vec![PLAIN; 40];
        drawn[39] = lit(CaptureLight::default());
        let settings = GpuSettings::new(UVec2::ONE, false, drawn.iter());
        assert_eq!(settings.count as usize, MOST_SHADINGS, "as many as there is room for");
        assert_eq!(settings.shadings[0].light.x, 1.0, "the one that matters among them");
    }

    #[test]
    fn nonsense_changes_nothing() {
        for reference in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let shading = GpuShading::new(&lit(CaptureLight { reference, amount: 1.0 }));
            assert_eq!(shading.light.x, 0.0, "with a reference of {reference}");
        }
        let shading = GpuShading::new(&lit(CaptureLight { amount: f32::NAN, ..CaptureLight::default() }));
        assert_eq!(shading.light.x, 0.0, "nor does no number");
        let shading = GpuShading::new(&lit(CaptureLight { amount: 9.0, ..CaptureLight::default() }));
        assert_eq!(shading.light.x, 1.0, "more than all is all");
    }

    #[test]
    fn what_has_no_box_is_beyond_all_boxes() {
        let boundless = GpuShading::new(&PlacedShading { cube_from_world: None, has_environment: true, ..PLAIN });
        assert!(boundless.cube_from_world.iter().all(|row| row.w == BEYOND_ALL_BOXES), "at any place");
        let surrounded = PlacedShading { has_environment: true, ..PLAIN };
        assert_eq!(GpuSettings::new(UVec2::ONE, false, [surrounded].iter()).is_surrounded, 1, "and its map is known");
    }
}
