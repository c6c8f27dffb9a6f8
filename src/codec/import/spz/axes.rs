//! The coordinate system of an SPZ file.
//!
//! In: the number in the extension record of Adobe. Out: the matrix from the axes of the file to right, up, back, the
//! axes of SPZ files without this record. Half of the systems are mirrored.

use glam::{DMat3, DVec3};

/// Returns the matrix of a coordinate system; `None` of a number that is none.
///
/// 1 to 8 are LDB, RDB, LUB, RUB, LDF, RDF, LUF, RUF: x left or right, y down or up, z back or front. 9 to 16 are LFD,
/// RFD, LFU, RFU, LBD, RBD, LBU, RBU: y front or back, z down or up. 0 is the same as 4.
pub(super) fn to_right_up_back(system: u32) -> Option<DMat3> {
    let index = match system {
        0 => 3,
        1..=16 => system - 1,
        _ => return None,
    };
    let sign = |bit: u32| if index & bit == 0 { -1.0 } else { 1.0 };
    let right = DVec3::X * sign(1);
    let up = DVec3::Y * sign(2);
    Some(if index < 8 {
        DMat3::from_cols(right, up, DVec3::Z * -sign(4))
    } else {
        DMat3::from_cols(right, DVec3::Z * sign(4), up)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_number_is_the_system_of_its_letters() {
        let names = "LDB RDB LUB RUB LDF RDF LUF RUF LFD RFD LFU RFU LBD RBD LBU RBU";
        for (system, name) in (1..).zip(names.split(' ')) {
            let columns: Vec<DVec3> = name
                .chars()
                .map(|letter| match letter {
                    'L' => DVec3::NEG_X,
                    'R' => DVec3::X,
                    'D' => DVec3::NEG_Y,
                    'U' => DVec3::Y,
                    'F' => DVec3::NEG_Z,
                    _ => DVec3::Z,
                })
                .collect();
            let expected = DMat3::from_cols(columns[0], columns[1], columns[2]);
            assert_eq!(to_right_up_back(system), Some(expected), "{system} is {name}");
        }
        assert_eq!(to_right_up_back(0), Some(DMat3::IDENTITY), "unspecified is RUB");
        assert_eq!(to_right_up_back(17), None, "there are 16 systems");
    }
}
