//! The hierarchy of nodes.
//!
//! In: the nodes of a document. Out: the meshes that its scene shows, each with the transformation to the space of the
//! scene. Animated nodes have the pose of the first key frame.

use super::accessors::Accessors;
use super::document::{Document, Node};
use crate::codec::import::error::ImportError;
use glam::{DAffine3, DMat4, DQuat, DVec3};

/// A mesh in the scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Placed {
    /// Its index.
    pub mesh: usize,
    /// From its space to that of the scene.
    pub map: DAffine3,
}

/// Returns the meshes of the scene that a document shows, and the number of nodes whose motion is left out.
///
/// # Errors
/// Nodes that do not exist, have two parents or are their own ancestors; transformations that are not finite.
pub(super) fn placed(accessors: &Accessors<'_>) -> Result<(Vec<Placed>, usize), ImportError> {
    let document = accessors.document;
    let (poses, moved) = poses(accessors)?;
    let mut open: Vec<(usize, DAffine3)> =
        roots(document)?.into_iter().map(|node| (node, DAffine3::IDENTITY)).collect();
    open.reverse();
    let mut seen = vec![false; document.nodes.len()];
    let mut placed = Vec::new();
    while let Some((index, parent)) = open.pop() {
        let (Some(node), Some(pose), Some(seen)) = (document.nodes.get(index), poses.get(index), seen.get_mut(index))
        else {
            return Err(ImportError::damaged(format!("node {index} does not exist")));
        };
        if std::mem::replace(seen, true) {
            return Err(ImportError::damaged(format!("node {index} has two parents or is its own ancestor")));
        }
        let map = parent * *pose;
        if !map.is_finite() {
            return Err(ImportError::damaged(format!("the transformation of node {index} is not finite")));
        }
        placed.extend(node.mesh.map(|mesh| Placed { mesh, map }));
        open.extend(node.children.iter().rev().map(|&child| (child, map)));
    }
    Ok((placed, moved))
}

/// Returns the roots of the scene that a document shows; of a document without scenes, the nodes without a parent.
fn roots(document: &Document) -> Result<Vec<usize>, ImportError> {
    let shown = document.scene.unwrap_or(0);
    match document.scenes.get(shown) {
        Some(scene) => Ok(scene.nodes.clone()),
        None if document.scenes.is_empty() => {
            let mut has_parent = vec![false; document.nodes.len()];
            for child in document.nodes.iter().flat_map(|node| &node.children) {
                if let Some(has_parent) = has_parent.get_mut(*child) {
                    *has_parent = true;
                }
            }
            Ok((0..has_parent.len()).filter(|&node| !has_parent[node]).collect())
        }
        None => Err(ImportError::damaged(format!("scene {shown} does not exist"))),
    }
}

/// Returns the transformation of each node to its parent, and the number of nodes that move.
fn poses(accessors: &Accessors<'_>) -> Result<(Vec<DAffine3>, usize), ImportError> {
    let document = accessors.document;
    let mut poses: Vec<Pose> = document.nodes.iter().map(Pose::of).collect();
    let mut moves = vec![false; poses.len()];
    // If several animations move a node, the first one decides.
    for animation in document.animations.iter().rev() {
        for channel in &animation.channels {
            let Some(node) = channel.target.node else { continue };
            let (Some(pose), Some(moves)) = (poses.get_mut(node), moves.get_mut(node)) else {
                return Err(ImportError::damaged(format!("an animation moves node {node}, which does not exist")));
            };
            let Some(sampler) = animation.samplers.get(channel.sampler) else {
                return Err(ImportError::damaged("a channel of an animation has no sampler"));
            };
            // A key frame of a cubic spline is a tangent, a value and a tangent.
            let key = usize::from(sampler.interpolation.as_deref() == Some("CUBICSPLINE"));
            let rows = || accessors.rows(sampler.output, "animation");
            let is_there = match &*channel.target.path {
                "translation" => keep(rows()?.row(key), &mut pose.translation),
                "rotation" => keep(rows()?.row(key), &mut pose.rotation),
                "scale" => keep(rows()?.row(key), &mut pose.scale),
                _ => continue,
            };
            if !is_there {
                return Err(ImportError::damaged("an animation without a first key frame"));
            }
            *moves = true;
        }
    }
    Ok((poses.iter().map(Pose::map).collect(), moves.iter().filter(|&&moves| moves).count()))
}

/// Stores the value of a key frame, if there is one. Returns whether there is.
fn keep<const N: usize>(value: Option<[f32; N]>, to: &mut [f64; N]) -> bool {
    if let Some(value) = value {
        *to = value.map(f64::from);
    }
    value.is_some()
}

/// A matrix, or the parts of one, which an animation may replace.
struct Pose {
    matrix: Option<[f64; 16]>,
    translation: [f64; 3],
    rotation: [f64; 4],
    scale: [f64; 3],
}

impl Pose {
    fn of(node: &Node) -> Self {
        Self {
            matrix: node.matrix,
            translation: node.translation.unwrap_or_default(),
            rotation: node.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]),
            scale: node.scale.unwrap_or([1.0; 3]),
        }
    }

    fn map(&self) -> DAffine3 {
        if let Some(matrix) = &self.matrix {
            return DAffine3::from_mat4(DMat4::from_cols_array(matrix));
        }
        // A quaternion of length zero is read as no rotation.
        let rotation = DQuat::from_array(self.rotation);
        let length = rotation.length();
        let rotation = if length > 0.0 && length.is_finite() { rotation / length } else { DQuat::IDENTITY };
        DAffine3::from_scale_rotation_translation(DVec3::from(self.scale), rotation, DVec3::from(self.translation))
    }
}
