//! Files that the exporters write.
//!
//! In: the id of an export, degrees of color. Out: the bytes of a file for each degree.

use crate::support::packed_scene;
use bevy_gs4d::internal::codec::{Export, Exporter};
use bevy_gs4d::scene::GaussianScene;

/// Gaussians of the scene.
const COUNT: usize = 20;

/// Returns the files of an export, one for each degree.
pub fn exported(id: &str, degrees: &[u32]) -> Vec<Vec<u8>> {
    let format = Export::of_id(id).unwrap_or_else(|| panic!("{id} is an export"));
    let file = |&degree: &u32| {
        let scene = GaussianScene::from(packed_scene::scene(COUNT, degree, 0));
        let exporter = Exporter::new(scene, format, 30.0).expect("a scene that can be exported");
        let mut file = Vec::new();
        exporter.write(0.5, &mut file).expect("memory can be written to");
        file
    };
    degrees.iter().map(file).collect()
}
