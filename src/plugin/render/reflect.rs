//! Reflection for the enums of [`crate::view`] and [`crate::renderer`], which do not use Bevy.
//!
//! In: [`BlendSpace`], [`DebugView`] and [`Design`]. Out: `Reflect` for each, so that components that contain them can
//! be saved, inspected and animated.

use crate::renderer::Design;
use crate::view::{BlendSpace, DebugView};
use bevy::reflect::impl_reflect;
use bevy::reflect::std_traits::ReflectDefault;

impl_reflect!(
    #[reflect(Default, Debug, Clone, PartialEq, Hash)]
    #[type_path = "bevy_gs4d::view"]
    enum BlendSpace {
        Encoded,
        Linear,
    }
);

impl_reflect!(
    #[reflect(Default, Debug, Clone, PartialEq, Hash)]
    #[type_path = "bevy_gs4d::view"]
    enum DebugView {
        Color,
        Depth,
        Overdraw,
        Active,
        Lifespan,
        Velocity,
    }
);

impl_reflect!(
    #[reflect(Default, Debug, Clone, PartialEq, Hash)]
    #[type_path = "bevy_gs4d::renderer"]
    enum Design {
        Auto,
        TileBins,
        GlobalSort,
    }
);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plugin::render::settings::CaptureViewSettings;
    use bevy::reflect::enums::Enum;
    use bevy::reflect::{FromReflect, GetPath, PartialReflect, TypePath};

    #[test]
    fn camera_settings_can_be_set_by_reflection_path() {
        let mut settings = CaptureViewSettings::default();
        *settings.path_mut::<DebugView>("debug").expect("a field") = DebugView::Velocity;
        assert_eq!(settings.debug, DebugView::Velocity, "the field is set through reflection");
        assert_eq!(BlendSpace::Linear.variant_name(), "Linear", "variants have reflected names");
        assert_eq!(BlendSpace::type_path(), "bevy_gs4d::view::BlendSpace", "the type path is the public path");
    }

    #[test]
    fn camera_settings_survive_a_round_trip_through_reflection() {
        let settings = CaptureViewSettings { blend_space: BlendSpace::Linear, ..CaptureViewSettings::default() };
        let copy = CaptureViewSettings::from_reflect(settings.to_dynamic().as_ref());
        assert_eq!(copy, Some(settings), "the copy equals the original");
        for (name, design) in Design::NAMES {
            let settings = CaptureViewSettings { design, ..CaptureViewSettings::default() };
            let copy = CaptureViewSettings::from_reflect(settings.to_dynamic().as_ref());
            assert_eq!(copy, Some(settings), "the copy equals the original with {name}");
        }
    }
}
