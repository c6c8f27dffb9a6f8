//! `gs4d collide SCENE -o OUT`: adds triangle meshes of the solid parts of a capture, for physics and navigation.
//!
//! In: a capture, the size of the cells in which it is searched, and what is solid. Out: a package with closed meshes
//! of what never moves and of what moves in each stretch of time; a report of their sizes; on request the meshes as
//! OBJ files. Also removes them.

use super::info::{box_json, corners};
use crate::cli::args::{CheckpointArgs, file_size, values};
use crate::cli::output::failure::Failure;
use crate::cli::output::obj;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{bytes, lines};
use crate::codec;
use crate::offline::collide::{CollideSettings, Collided, collide};
use crate::offline::store::outputs::Files;
use crate::offline::work::{Progress, proceed, save, write_settings};
use crate::scene::{Bounds, ColliderMesh, ColliderStretch, Colliders, GaussianScene, UpAxis};
use glam::Vec3;
use serde_json::{Value, json};
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Add triangle meshes of the solid parts of a capture, so that a game's physics and navigation can use it.
///
/// The capture is searched in cells. A cell is solid where a straight line through it meets enough opacity. There is
/// one closed mesh of what never moves, and one of what moves for each stretch of time. Colliders that SCENE has are
/// replaced; what is drawn does not change.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d collide dancer.gs4d -o solid.gs4d
  gs4d collide dancer.gs4d -o solid.gs4d --cells 256 --obj meshes
  gs4d collide dancer.gs4d -o solid.gs4d --bounds -2,-2,0,2,2,2.5 --rate 20 --json
  gs4d collide solid.gs4d --remove -o dancer.gs4d

Places are in capture units: gs4d info shows the bounds. In Bevy, a child CaptureCollider of the capture has the mesh at the time that is drawn,
for any physics engine. --obj writes the meshes as files that any viewer opens: standing.obj, 000.obj, 001.obj and so on.")]
pub(crate) struct CollideVerb {
    /// The package, or a capture of any other format. It stays as it is.
    #[arg(value_name = "SCENE")]
    scene: PathBuf,
    /// The package to write (.gs4d). An existing file is replaced when the new one is complete.
    #[arg(short, long, value_name = "OUT")]
    out: PathBuf,
    /// Cells along the longest side of the box that is searched: more of them find thinner parts, and take longer.
    #[arg(long, value_name = "N", default_value_t = CollideSettings::default().cells)]
    #[arg(value_parser = clap::value_parser!(u32).range(8..=512))]
    cells: u32,
    /// Opacity that a straight line through a cell must meet for the cell to be solid, above 0 and below 1.
    #[arg(long, value_name = "X", default_value_t = CollideSettings::default().level, value_parser = values::opacity)]
    level: f32,
    /// Stretches of time a second at speed 1.
    #[arg(long, value_name = "HZ", default_value_t = CollideSettings::default().rate, value_parser = values::positive)]
    rate: f32,
    /// Largest distance by which a mesh is simplified, in cells.
    #[arg(long, value_name = "CELLS", default_value_t = CollideSettings::default().error)]
    #[arg(value_parser = values::up_to(4.0))]
    error: f32,
    /// Solid cells that must hang together: smaller parts are left out.
    #[arg(long, value_name = "N", default_value_t = CollideSettings::default().smallest)]
    #[arg(value_parser = values::count_or_none(u64::from(u32::MAX)))]
    smallest: usize,
    /// Two corners of the box that is searched, capture space [default: where 99 % of the opacity is].
    #[arg(long, value_name = "X0,Y0,Z0,X1,Y1,Z1", value_parser = values::corners, allow_hyphen_values = true)]
    bounds: Option<[[f32; 3]; 2]>,
    /// Also write each mesh as a Wavefront OBJ file into this new folder.
    #[arg(long, value_name = "FOLDER")]
    obj: Option<PathBuf>,
    /// Remove the colliders instead.
    #[arg(long, conflicts_with_all = ["cells", "level", "rate", "error", "smallest", "bounds", "obj"])]
    remove: bool,
}

impl CollideVerb {
    /// Adds or removes colliders.
    ///
    /// # Errors
    /// A capture that cannot be read, nothing that is solid, no colliders to remove, files that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let files = Files::default().reads_scene(&self.scene).writes_regular(&self.out, "gs4d");
        self.obj.iter().fold(files, |files, folder| files.writes_folder(folder, [])).check()?;
        self.obj.as_deref().map_or(Ok(()), check_new)?;
        let before = file_size(&self.scene)?;
        let mut scene = CheckpointArgs::default().load(&self.scene)?;
        let found = match self.remove {
            true => self.remove_from(&mut scene).map(|()| None)?,
            false => Some(self.find(&mut scene)?),
        };
        if let (Some(folder), Some(found)) = (&self.obj, &found) {
            write_meshes(folder, &found.colliders, scene.playback.up)?;
        }
        save(&self.out, &scene, &write_settings(&scene.form, None))?;
        self.report(found.as_ref(), before)
    }

    /// Removes the colliders of a scene.
    fn remove_from(&self, scene: &mut GaussianScene) -> Result<(), Failure> {
        match scene.colliders.take() {
            Some(_) => Ok(()),
            None => Err(Failure::about(&self.scene, "has no colliders to remove")),
        }
    }

    /// Finds the colliders of a scene, and puts them into it.
    fn find(&self, scene: &mut GaussianScene) -> Result<Collided, Failure> {
        let settings = CollideSettings {
            cells: self.cells,
            level: self.level,
            rate: self.rate,
            error: self.error,
            smallest: self.smallest,
            bounds: self.bounds,
        };
        let found = collide(scene, &settings, &mut Bars::default());
        let found = found.map_err(|error| Failure::at(&self.scene, &error))?;
        scene.colliders = Some(Arc::new(found.colliders.clone()));
        Ok(found)
    }

    /// Returns the report. `before` is the size of the capture that was read, bytes.
    fn report(&self, found: Option<&Collided>, before: u64) -> Result<Report, Failure> {
        let (after, stored) = (file_size(&self.out)?, stored(&self.out)?);
        let mut pairs = match found {
            Some(found) => self.facts(found, stored),
            None => vec![("colliders", "removed".to_owned())],
        };
        if let (Some(folder), Some(found)) = (&self.obj, found) {
            pairs.push(("meshes", format!("{}, {} files", folder.display(), found.colliders.meshes().count())));
        }
        pairs.push(("wrote", format!("{}, {} (from {})", self.out.display(), bytes(after), bytes(before))));
        let json = json!({
            "scene": self.scene.display().to_string(),
            "out": self.out.display().to_string(),
            "obj": self.obj.as_ref().map(|folder| folder.display().to_string()),
            "bytes_in": before,
            "bytes_out": after,
            "bytes_colliders": stored,
            "colliders": found.map(|found| self.colliders_json(found)),
        });
        Ok(Report::new(json, lines(&pairs)))
    }

    /// Returns what has been found, for people. `stored` is the size of the colliders in the package, bytes.
    fn facts(&self, found: &Collided, stored: u64) -> Vec<(&'static str, String)> {
        let Collided { colliders, cell, solid: [standing, moving], .. } = found;
        let [points, triangles] = colliders.counts();
        let stretches = match colliders.stretches.as_slice() {
            [] => "none".to_owned(),
            all @ [first, ..] => {
                let last = all.last().unwrap_or(first);
                let points = all.iter().map(|part| part.mesh.points.len()).max().unwrap_or_default();
                let triangles = all.iter().map(|part| part.mesh.triangles.len()).max().unwrap_or_default();
                let (count, from, to) = (all.len(), first.from, last.to);
                format!("{count} from {from} to {to}, at most {points} points and {triangles} triangles each")
            }
        };
        let ColliderMesh { points: own_points, triangles: own_triangles } = &colliders.standing;
        vec![
            ("searched", corners(&searched(found))),
            ("cells", format!("{} along the longest side, {cell} units each", self.cells)),
            ("solid", format!("{standing} cells standing, at most {moving} in a stretch of time")),
            ("standing", format!("{} points, {} triangles", own_points.len(), own_triangles.len())),
            ("stretches", stretches),
            ("all", format!("{points} points, {triangles} triangles")),
            ("colliders", format!("{} of the package", bytes(stored))),
        ]
    }

    /// Returns what has been found, for programs.
    fn colliders_json(&self, found: &Collided) -> Value {
        let Collided { colliders, cell, solid: [standing, moving], .. } = found;
        let [points, triangles] = colliders.counts();
        let stretch = |ColliderStretch { from, to, mesh }: &ColliderStretch| json!({ "from": from, "to": to, "points": mesh.points.len(), "triangles": mesh.triangles.len() });
        let ColliderMesh { points: own_points, triangles: own_triangles } = &colliders.standing;
        json!({
            "searched": box_json(&searched(found)),
            "cells": self.cells,
            "cell": cell,
            "solid_standing": standing,
            "solid_moving": moving,
            "points": points,
            "triangles": triangles,
            "standing": { "points": own_points.len(), "triangles": own_triangles.len() },
            "stretches": colliders.stretches.iter().map(stretch).collect::<Vec<_>>(),
        })
    }
}

/// Returns the box that was searched.
fn searched(found: &Collided) -> Bounds {
    let [min, max] = found.bounds.map(Vec3::from);
    Bounds { min, max }
}

/// Checks that a folder does not exist, or is empty.
fn check_new(folder: &Path) -> Result<(), Failure> {
    match folder.read_dir().map(|mut entries| entries.next().is_none()) {
        Ok(true) => Ok(()),
        Ok(false) => {
            let reason = "is not empty, and its files would be among the meshes: name a new folder";
            Err(Failure::about(folder, reason))
        }
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(()),
        Err(error) => Err(Failure::at(folder, &error)),
    }
}

/// Writes meshes as OBJ files into a folder, which is made if it does not exist. Begins the task "writing meshes".
fn write_meshes(folder: &Path, colliders: &Colliders, up: UpAxis) -> Result<(), Failure> {
    fs::create_dir_all(folder).map_err(|error| Failure::at(folder, &error))?;
    let count = colliders.stretches.len();
    let digits = count.saturating_sub(1).to_string().len().max(3);
    let progress = &mut Bars::default();
    progress.begin("writing meshes", 1 + count);
    obj::save(&folder.join("standing.obj"), &colliders.standing, "what never moves", up)?;
    progress.advance();
    for (index, ColliderStretch { from, to, mesh }) in colliders.stretches.iter().enumerate() {
        proceed(progress)?;
        let what = format!("what moves from {from} to {to}");
        obj::save(&folder.join(format!("{index:0digits$}.obj")), mesh, &what, up)?;
        progress.advance();
    }
    progress.finish();
    Ok(())
}

/// Returns the size of the colliders in a package, bytes.
fn stored(package: &Path) -> Result<u64, Failure> {
    let (_, info) = codec::inspect(package)?;
    let sections = info.iter().flat_map(|info| &info.header.sections);
    let own = sections.filter(|section| section.name.starts_with("collider_"));
    Ok(own.map(|section| section.length as u64).sum())
}
