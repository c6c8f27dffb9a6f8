//! `gs4d edit SCENE EDITS -o OUT`: removes Gaussians by a list of edits.
//!
//! In: a capture, a list of edits in RON, the training views if an edit asks for them. Out: a package with the
//! Gaussians that remain, bit for bit; a report of how many each edit has removed.

use crate::cli::args::{CheckpointArgs, DataArgs, Given, Need, file_size};
use crate::cli::output::colliders::note_colliders;
use crate::cli::output::failure::Failure;
use crate::cli::output::note::note;
use crate::cli::output::progress::Bars;
use crate::cli::output::report::Report;
use crate::cli::output::table::{Table, bytes, lines};
use crate::codec::read_edits;
use crate::offline::edit::seen_by;
use crate::offline::store::outputs::Files;
use crate::offline::work::{save, write_settings};
use crate::scene::GaussianScene;
use crate::scene::edit::{EditError, EditList, Edited, apply};
use serde_json::{Value, json};
use std::path::PathBuf;

/// Remove Gaussians by a list of edits: outside or inside of boxes and spheres, over stretches of time, and floaters.
///
/// Nothing else changes: what remains keeps its bits, also in a packed capture. To undo an edit, remove its line and
/// apply the list to SCENE again.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  gs4d edit capture.gs4d edits.ron -o edited.gs4d
  gs4d edit capture.gs4d edits.ron --dry-run --json
  gs4d edit capture.gs4d edits.ron --data data/toybox -o edited.gs4d

A list of edits in RON, with every edit there is; times are optional:
  [
      keep_box(min: (-2, -2, 0), max: (2, 2, 2.5)),
      remove_box(min: (1, 1, 0), max: (2, 2, 1), times: (0.5, 1)),
      keep_sphere(center: (0, 0, 1), radius: 3),
      remove_sphere(center: (1.5, 0, 1), radius: 0.5, times: (0.2, 0.3)),
      remove_faint_large(opacity_below: 0.1, scale_above: 0.5),
      remove_floaters(cameras_below: 3, distance_below: 0.4),
  ]

Places and lengths are in capture units, times are timestamps: gs4d info shows the bounds and the time interval. A region removes a Gaussian as
a whole if its mean is inside at the time at which it is most opaque, of the whole interval or of the times given. remove_floaters needs --data:
it removes what is closer to a camera, and seen by fewer cameras in more than five pixels. docs/command.md has the rules.")]
pub(crate) struct EditVerb {
    #[command(flatten)]
    given: Given,
    /// The checkpoint or package to edit. It stays as it is.
    #[arg(value_name = "SCENE")]
    input: PathBuf,
    /// The list of edits (.ron).
    #[arg(value_name = "EDITS")]
    edits: PathBuf,
    /// The package to write (.gs4d). An existing file is replaced when the new one is complete.
    #[arg(short, long, value_name = "OUT", required_unless_present = "dry_run")]
    out: Option<PathBuf>,
    /// Count what each edit removes, and write nothing.
    #[arg(long, conflicts_with_all = ["out", "level"])]
    dry_run: bool,
    /// zstd level, 1 (fast) to 19 (small) [default: 9; of packed captures 19].
    #[arg(long, value_name = "LEVEL", value_parser = clap::value_parser!(i32).range(1..=19))]
    level: Option<i32>,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    checkpoint: CheckpointArgs,
}

impl EditVerb {
    /// Applies the edits and writes the capture.
    ///
    /// # Errors
    /// A list, a capture or views that cannot be used, edits that leave no Gaussian, a package that cannot be written.
    pub(crate) fn run(&self) -> Result<Report, Failure> {
        let files = Files::default().reads_scene(&self.input).reads([&self.edits]);
        let files = self.data.add_to(files);
        self.out.iter().fold(files, |files, out| files.writes(out, "gs4d")).check()?;
        let list = read_edits(&self.edits)?;
        self.given.require(Need::Cameras, list.needs_cameras())?;
        let before = file_size(&self.input)?;
        let scene = self.checkpoint.load_to_change(&self.input)?;
        let total = scene.len();
        let edited = self.apply(scene, &list)?;
        for (number, (edit, removed)) in (1..).zip(list.edits.iter().zip(&edited.removed)) {
            if *removed == 0 {
                note(&format!("note: {}: edit {number}, {}, removes nothing", self.edits.display(), edit.name()));
            }
        }
        note_colliders(&edited.scene, edited.kept, total);
        let after = self.save(&edited.scene)?;
        Ok(self.report(&list, &edited, total, before, after))
    }

    /// Applies the edits, with what the training cameras see if one asks for it.
    fn apply(&self, scene: GaussianScene, list: &EditList) -> Result<Edited, Failure> {
        let seen = match list.needs_cameras() {
            true => {
                let progress = &mut Bars::default();
                let views = self.data.open(&scene.trained_with, progress)?;
                let seen = seen_by(&scene, &views, progress);
                Some(seen.map_err(|error| Failure::at(&self.input, &error))?)
            }
            false => None,
        };
        apply(scene, list, seen.as_ref()).map_err(|error| {
            let path = if matches!(error, EditError::Invalid(_)) { &self.input } else { &self.edits };
            Failure::at(path, &error)
        })
    }

    /// Writes the capture, if a package is to be written. Returns its size in bytes.
    fn save(&self, scene: &GaussianScene) -> Result<Option<u64>, Failure> {
        let Some(out) = &self.out else { return Ok(None) };
        save(out, scene, &write_settings(&scene.form, self.level))?;
        file_size(out).map(Some)
    }

    /// Returns the report. `total` is the number of Gaussians before the edits, `before` and `after` are the sizes of
    /// the files, bytes.
    fn report(&self, list: &EditList, edited: &Edited, total: usize, before: u64, after: Option<u64>) -> Report {
        let (mut table, mut left) = (Table::new(&["edit", "removed", "left"]), total);
        let mut listed: Vec<Value> = Vec::with_capacity(list.edits.len());
        for (number, (edit, removed)) in (1..).zip(list.edits.iter().zip(&edited.removed)) {
            left -= removed;
            table.row([format!("{number} {}", edit.name()), removed.to_string(), left.to_string()]);
            listed.push(json!({ "edit": edit, "removed": removed, "left": left }));
        }
        let mut facts = vec![("kept", format!("{} of {total} Gaussians", edited.kept))];
        if edited.fillers() > 0 {
            let fillers = edited.fillers();
            facts.push(("fillers", format!("{fillers} invisible Gaussians, so that no other is rounded again")));
        }
        facts.push(match (&self.out, after) {
            (Some(out), Some(after)) => {
                ("wrote", format!("{}, {} (from {})", out.display(), bytes(after), bytes(before)))
            }
            _ => ("wrote", "nothing: a dry run".to_owned()),
        });
        let json = json!({
            "in": self.input.display().to_string(),
            "list": self.edits.display().to_string(),
            "dry_run": self.dry_run,
            "out": self.out.as_ref().map(|out| out.display().to_string()),
            "bytes_in": before,
            "bytes_out": after,
            "gaussians_in": total,
            "gaussians": edited.kept,
            "fillers": edited.fillers(),
            "edits": listed,
        });
        Report::new(json, format!("{table}\n{}", lines(&facts)))
    }
}
