//! Markers: named times.
//!
//! In: the markers of a timeline or a capture; a played stretch. Out: the markers on the stretch, in the order of play.

use super::span::Leg;
use bevy::ecs::component::Component;
use bevy::ecs::reflect::ReflectComponent;
use bevy::reflect::Reflect;
use bevy::reflect::std_traits::ReflectDefault;

/// A named time: playing across it sends [`MarkerReached`](super::MarkerReached).
#[derive(Reflect, Debug, Default, Clone, PartialEq)]
#[reflect(Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub struct Marker {
    /// Seconds since the start of the timeline or of the capture: 0 or later.
    pub time: f32,
    /// The name, which the message contains.
    pub name: String,
}

/// Markers on one capture, without a timeline: each sends [`MarkerReached`](super::MarkerReached) when the capture's
/// [`Playback`](super::Playback) plays across it, in any direction and with any [`Repeat`](super::Repeat). Seeks skip
/// markers; a marker at exactly the sought time is reached once playback continues.
///
/// The markers may be in any order. A time outside of the played range, or NaN, is never reached. Default: no markers.
///
/// # Examples
///
/// ```
/// use bevy::prelude::*;
/// use bevy_gs4d::playback::{MarkerReached, Markers};
/// use bevy_gs4d::prelude::*;
///
/// fn setup(mut commands: Commands, assets: Res<AssetServer>) {
///     let steps = Markers::new([(0.4, "left foot"), (0.9, "right foot")]);
///     commands
///         .spawn((GaussianCapture3d(assets.load("dancer.gs4d")), steps))
///         .observe(|reached: On<MarkerReached>| info!("{}", reached.name));
/// }
/// # bevy::ecs::system::assert_is_system(setup);
/// ```
#[derive(Component, Reflect, Debug, Default, Clone, PartialEq)]
#[reflect(Component, Default, Debug, Clone, PartialEq)]
#[type_path = "bevy_gs4d::playback"]
pub struct Markers(pub Vec<Marker>);

impl Markers {
    /// Returns markers from pairs of a time, in seconds since the capture's start, and a name.
    pub fn new<N: Into<String>>(markers: impl IntoIterator<Item = (f32, N)>) -> Self {
        Self(markers.into_iter().map(|(time, name)| Marker { time, name: name.into() }).collect())
    }
}

/// Returns the markers on a stretch, in the order of play.
pub(super) fn crossed<'a>(markers: &'a [Marker], leg: &Leg) -> Vec<&'a Marker> {
    // Rounded to the precision of marker times: otherwise 0.4 would be later than the end of a step of 400 ms.
    let [from, to] = [leg.from, leg.to].map(|time| f64::from(time as f32));
    let rounded = Leg { from, to, inclusive: leg.inclusive };
    let mut crossed: Vec<&Marker> = markers.iter().filter(|marker| rounded.passes(marker.time.into())).collect();
    crossed.sort_by(|a, b| a.time.total_cmp(&b.time));
    if leg.from > leg.to {
        crossed.reverse();
    }
    crossed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_marker_at_the_end_of_a_step_is_passed_in_that_step_only() {
        let markers = Markers::new([(0.4, "end")]);
        let count = |from, to| crossed(&markers.0, &Leg { from, to, inclusive: false }).len();
        assert_eq!((count(0.0, 0.4), count(0.4, 0.8)), (1, 0), "forwards, the first of two steps passes the marker");
        assert_eq!((count(0.8, 0.4), count(0.4, 0.0)), (1, 0), "backwards, the first of two steps passes the marker");
    }

    #[test]
    fn markers_come_in_the_order_of_play() {
        let markers = Markers::new([(1.5, "c"), (0.5, "a"), (f32::NAN, "never"), (1.0, "b")]);
        let names = |from, to, inclusive| {
            let crossed = crossed(&markers.0, &Leg { from, to, inclusive });
            crossed.iter().map(|marker| marker.name.as_str()).collect::<Vec<_>>()
        };
        assert_eq!(names(0.0, 2.0, false), ["a", "b", "c"], "markers are sorted by time");
        assert_eq!(names(2.0, 0.0, false), ["c", "b", "a"], "backwards, the order is reversed");
        assert_eq!(names(0.5, 1.0, false), ["b"], "a marker at the start of the stretch is excluded");
        assert_eq!(names(0.5, 1.0, true), ["a", "b"], "an inclusive stretch includes the marker at its start");
        assert_eq!(names(1.1, 1.4, true), [""; 0], "markers outside of the stretch are excluded");
    }
}
