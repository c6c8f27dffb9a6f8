//! Gaussians of a segment on the clock of all.
//!
//! In: a form, its place on the clock of all, a shift in space. Out: the form in the time and the space of all.

use super::clock::Place;
use crate::gaussian::Gaussian;
use crate::scene::{Form, SceneForm, Sliced, Trained};

/// Moves Gaussians to the clock of all and by `shift`, capture units. Values that do not move keep their bits. Gaussians
/// in the trained form are moved only, not stretched in time: their clock must have the unit of the clock of all.
pub(super) fn move_form(form: &mut SceneForm, place: &Place, shift: [f64; 3]) {
    match form {
        SceneForm::Trained(Trained { parameters, .. }) => {
            parameters.mean.iter_mut().for_each(|mean| move_mean(mean, shift));
            parameters.mean_t.iter_mut().for_each(|mean_t| *mean_t = place.time(*mean_t) as f32);
        }
        SceneForm::Ready(Form::Sliced(Sliced { gaussians, .. })) => {
            gaussians.iter_mut().for_each(|gaussian| move_gaussian(gaussian, place, shift));
        }
        SceneForm::Ready(Form::Packed(_)) => {}
    }
}

fn move_mean(mean: &mut [f32; 3], shift: [f64; 3]) {
    for (value, shift) in mean.iter_mut().zip(shift) {
        *value = (f64::from(*value) + shift) as f32;
    }
}

fn move_gaussian(gaussian: &mut Gaussian, place: &Place, shift: [f64; 3]) {
    move_mean(&mut gaussian.mean, shift);
    gaussian.mean_t = place.time(gaussian.mean_t) as f32;
    if place.scale != 1.0 {
        gaussian.sigma_t = (f64::from(gaussian.sigma_t) * place.scale) as f32;
        gaussian.velocity = gaussian.velocity.map(|speed| (f64::from(speed) / place.scale) as f32);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gaussian_on_a_faster_clock_is_at_the_same_place_at_the_same_moment() {
        let own = Gaussian {
            mean: [1.0, 2.0, 3.0],
            mean_t: 0.25,
            sigma_t: 0.5,
            velocity: [4.0, 0.0, -1.0],
            ..bytemuck::Zeroable::zeroed()
        };
        let mut moved = own;
        move_gaussian(&mut moved, &Place { begin: 0.0, start: 10.0, end: 12.0, scale: 2.0 }, [0.0, 0.0, 1.0]);
        for time in [0.0, 0.25, 1.0] {
            let there = 10.0 + 2.0 * time;
            assert_eq!(moved.mean_at(there) - own.mean_at(time), glam::Vec3::Z, "at {time}, one unit higher");
            assert_eq!(moved.marginal(there), own.marginal(time), "as visible at {time}");
        }
    }
}
