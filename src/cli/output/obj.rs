//! Meshes as Wavefront OBJ files, which every viewer of meshes opens.
//!
//! In: a mesh in capture space. Out: a text of its points and triangles, in the same space. The format has no axis that
//! points up, so that a comment names it.

use crate::codec::CodecError;
use crate::offline::work::write_beside;
use crate::scene::{ColliderMesh, UpAxis};
use std::io::{self, Write};
use std::path::Path;

/// Writes a mesh to a file, whole or not at all. `what` is a line about it, for people.
///
/// # Errors
/// A folder that cannot be written to, a full disk.
pub(crate) fn save(path: &Path, mesh: &ColliderMesh, what: &str, up: UpAxis) -> Result<(), CodecError> {
    write_beside(path, |file| write(file, mesh, what, up))
}

fn write(file: &mut impl Write, mesh: &ColliderMesh, what: &str, up: UpAxis) -> io::Result<()> {
    writeln!(file, "# {what}; {} points up", up.name())?;
    for [x, y, z] in &mesh.points {
        writeln!(file, "v {x} {y} {z}")?;
    }
    for triangle in &mesh.triangles {
        // Points are counted from 1.
        let [a, b, c] = triangle.map(|point| u64::from(point) + 1);
        writeln!(file, "f {a} {b} {c}")?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_are_counted_from_one_and_keep_every_digit() {
        let mesh = ColliderMesh {
            points: vec![[0.1, -2.0, 1e-7], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
            triangles: vec![[0, 1, 2]],
        };
        let mut bytes = Vec::new();
        write(&mut bytes, &mesh, "standing", UpAxis::PosZ).expect("memory");
        let text = String::from_utf8(bytes).expect("a text");
        let expected = "# standing; +z points up\nv 0.1 -2 0.0000001\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        assert_eq!(text, expected, "the whole file");
    }
}
