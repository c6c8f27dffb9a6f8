//! The enums whose values the panel lists.
//!
//! In: the enums of playback and drawing. Out: all values of each enum, in the order of its list, and their names.

use crate::plugin::playback::Repeat;
use crate::plugin::render::DepthWrite;
use crate::renderer::Design;
use crate::view::{BlendSpace, DebugView};
use bevy::core_pipeline::tonemapping::Tonemapping;

/// An enum whose values the panel lists.
pub(super) trait Listed: Copy + PartialEq + 'static {
    /// All values, in the order of the list.
    const ALL: &'static [Self];

    /// Returns the name of a value.
    fn name(self) -> &'static str;
}

impl Listed for Repeat {
    const ALL: &'static [Self] = &[Self::Once, Self::Loop, Self::PingPong];

    fn name(self) -> &'static str {
        match self {
            Self::Once => "once",
            Self::Loop => "loop",
            Self::PingPong => "ping-pong",
        }
    }
}

impl Listed for DebugView {
    const ALL: &'static [Self] =
        &[Self::Color, Self::Depth, Self::Overdraw, Self::Active, Self::Lifespan, Self::Velocity];

    fn name(self) -> &'static str {
        match self {
            Self::Color => "color",
            Self::Depth => "depth",
            Self::Overdraw => "overdraw",
            Self::Active => "active",
            Self::Lifespan => "lifespan (Σ_t)",
            Self::Velocity => "velocity",
        }
    }
}

impl Listed for Design {
    const ALL: &'static [Self] = &[Self::Auto, Self::TileBins, Self::GlobalSort];

    fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::TileBins => "bins",
            Self::GlobalSort => "sort",
        }
    }
}

impl Listed for BlendSpace {
    const ALL: &'static [Self] = &[Self::Encoded, Self::Linear];

    fn name(self) -> &'static str {
        match self {
            Self::Encoded => "encoded, as trained",
            Self::Linear => "linear light",
        }
    }
}

impl Listed for DepthWrite {
    const ALL: &'static [Self] = &[Self::Auto, Self::None, Self::Expected, Self::Median];

    fn name(self) -> &'static str {
        match self {
            Self::Auto => "auto",
            Self::None => "none",
            Self::Expected => "expected",
            Self::Median => "median",
        }
    }
}

impl Listed for Tonemapping {
    const ALL: &'static [Self] = &[
        Self::None,
        Self::Reinhard,
        Self::ReinhardLuminance,
        Self::AcesFitted,
        Self::AgX,
        Self::SomewhatBoringDisplayTransform,
        Self::TonyMcMapface,
        Self::BlenderFilmic,
        Self::KhronosPbrNeutral,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::None => "none, as trained",
            Self::Reinhard => "Reinhard",
            Self::ReinhardLuminance => "Reinhard luminance",
            Self::AcesFitted => "ACES fitted",
            Self::AgX => "AgX",
            Self::SomewhatBoringDisplayTransform => "somewhat boring",
            Self::TonyMcMapface => "Tony McMapface",
            Self::BlenderFilmic => "Blender filmic",
            Self::KhronosPbrNeutral => "Khronos PBR neutral",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bevy::reflect::{TypeInfo, Typed};
    use std::collections::HashSet;

    /// Returns whether a list has every value of its enum and each value has a unique name.
    fn is_complete<T: Listed + Typed>() -> bool {
        let TypeInfo::Enum(known) = T::type_info() else { return false };
        let names: HashSet<&str> = T::ALL.iter().map(|value| value.name()).collect();
        names.len() == T::ALL.len() && names.len() == known.variant_len()
    }

    #[test]
    fn every_value_is_listed() {
        assert!(is_complete::<Repeat>(), "every repeat mode is listed");
        assert!(is_complete::<DebugView>(), "every debug view is listed");
        assert!(is_complete::<BlendSpace>(), "every blend space is listed");
        assert!(is_complete::<DepthWrite>(), "every mode of writing depth is listed");
        assert!(is_complete::<Tonemapping>(), "every tonemapping is listed");
    }
}
