//! Gaussians for formats whose up is +Y or -Y.
//!
//! In: [`Columns`] and the axis that points up. Out: the columns, rotated with their colors.

use crate::codec::import::columns::Columns;
use crate::codec::import::placed::place;
use crate::scene::UpAxis;
use glam::{DAffine3, DMat3, DVec3};
use std::borrow::Cow;
use std::io;

/// From +Y to -Y, around the x-axis.
const HALF_TURN: DAffine3 = DAffine3 {
    matrix3: DMat3 { x_axis: DVec3::X, y_axis: DVec3::NEG_Y, z_axis: DVec3::NEG_Z },
    translation: DVec3::ZERO,
};

/// Returns the columns in a space in which +Y points up.
///
/// # Errors
/// None: a rotation is always possible.
pub(super) fn y_up(columns: &Columns, up: UpAxis) -> io::Result<Cow<'_, Columns>> {
    turned(columns, &rotation(up))
}

/// Returns the columns in a space in which -Y points up.
///
/// # Errors
/// None: a rotation is always possible.
pub(super) fn y_down(columns: &Columns, up: UpAxis) -> io::Result<Cow<'_, Columns>> {
    turned(columns, &(HALF_TURN * rotation(up)))
}

fn turned<'c>(columns: &'c Columns, map: &DAffine3) -> io::Result<Cow<'c, Columns>> {
    if *map == DAffine3::IDENTITY {
        return Ok(Cow::Borrowed(columns));
    }
    let mut turned = columns.clone();
    place(&mut turned, map).map_err(io::Error::other)?;
    Ok(Cow::Owned(turned))
}

/// Returns the rotation from a space in which `up` points up to one in which +Y does.
fn rotation(up: UpAxis) -> DAffine3 {
    // Quarter turns, by their columns: no digit of a number changes.
    let [x, y, z] = match up {
        UpAxis::PosX => [DVec3::Y, DVec3::NEG_X, DVec3::Z],
        UpAxis::NegX => [DVec3::NEG_Y, DVec3::X, DVec3::Z],
        UpAxis::PosY => [DVec3::X, DVec3::Y, DVec3::Z],
        UpAxis::NegY => [DVec3::X, DVec3::NEG_Y, DVec3::NEG_Z],
        UpAxis::PosZ => [DVec3::X, DVec3::NEG_Z, DVec3::Y],
        UpAxis::NegZ => [DVec3::X, DVec3::Z, DVec3::NEG_Y],
    };
    DAffine3::from_mat3(DMat3::from_cols(x, y, z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_that_points_up_is_rotated_to_y() {
        use UpAxis::{NegX, NegY, NegZ, PosX, PosY, PosZ};
        for up in [PosX, NegX, PosY, NegY, PosZ, NegZ] {
            let map = rotation(up);
            let to = map.transform_vector3(up.vector().as_dvec3());
            assert_eq!((to, map.matrix3.determinant()), (DVec3::Y, 1.0), "{up:?} is rotated to +Y");
            let down = HALF_TURN * map;
            assert_eq!(down.transform_vector3(up.vector().as_dvec3()), DVec3::NEG_Y, "{up:?} is rotated to -Y");
        }
    }
}
