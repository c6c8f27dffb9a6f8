//! A list of edits with which the example `play` shows its capture, while the list is written.
//!
//! In: the capture of the app, the file of the list. Out: the capture without what the edits remove, in the place of
//! the capture that was loaded; a sentence in the log and in the panel about each list that has been read. The list is
//! read and applied by a task. A list with an error changes nothing that is shown.

use super::stamp::Stamp;
use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};
use bevy_gs4d::GaussianCapture3d;
use bevy_gs4d::asset::{CaptureEditError, GaussianCapture};
use bevy_gs4d::codec::read_edits;
use bevy_gs4d::inspector::Inspector;
use bevy_gs4d::scene::edit::{EditError, EditList};
use std::path::{Path, PathBuf};

/// The edits of the capture.
#[derive(Resource)]
pub struct Edits {
    file: PathBuf,
    /// The file at the last look.
    seen: Stamp,
    /// The last list without an error.
    list: EditList,
    versions: Option<Versions>,
    /// Whether the list is to be read and applied, once no task does.
    is_due: bool,
    task: Option<Task<Outcome>>,
    /// What is wrong with the list that was read last.
    fault: Option<String>,
}

/// The capture as it was loaded, and as it is among the assets.
struct Versions {
    loaded: GaussianCapture,
    shown: GaussianCapture,
}

/// What a task returns.
struct Outcome {
    /// The list, or the last one if it has an error.
    list: EditList,
    /// The capture with that list.
    edited: GaussianCapture,
    /// The number of Gaussians removed, or the error, as a sentence.
    told: Result<String, String>,
}

impl Edits {
    /// Returns the edits in a file.
    pub fn of(file: PathBuf) -> Self {
        let seen = Stamp::of(&file);
        let (list, versions, task, fault) = Default::default();
        Self { file, seen, list, versions, is_due: true, task, fault }
    }

    /// Returns whether the capture or the list has not been read, or is not shown yet.
    pub fn is_waiting(&self) -> bool {
        self.versions.is_none() || self.is_due || self.task.is_some()
    }

    /// Returns what is wrong with the list that was read last, with its file; `None` if nothing is.
    pub fn fault(&self) -> Option<&str> {
        self.fault.as_deref()
    }
}

/// Looks whether the file of the list has changed.
pub fn look_at_edits(mut edits: ResMut<Edits>) {
    let stamp = Stamp::of(&edits.file);
    if stamp.is_change_of(edits.seen) {
        edits.seen = stamp;
        edits.is_due = true;
    }
}

/// Begins to read and apply a list that has changed, or to apply it to a capture that has been loaded, and shows the
/// result of the last task.
pub fn apply_edits(
    edits: ResMut<Edits>,
    mut captures: ResMut<Assets<GaussianCapture>>,
    player: Single<&GaussianCapture3d>,
    mut inspector: Option<ResMut<Inspector>>,
) {
    let edits = edits.into_inner();
    let Some(found) = captures.get(&player.0) else { return };
    if edits.versions.as_ref().is_none_or(|versions| !is_same(&versions.shown, found)) {
        // Another file, or another version of the file, has been loaded since.
        edits.versions = Some(Versions { loaded: found.clone(), shown: found.clone() });
        edits.task = None;
        edits.is_due = true;
    }
    let Some(versions) = &mut edits.versions else { return };
    if let Some(task) = &mut edits.task
        && let Some(Outcome { list, edited, told }) = check_ready(task)
    {
        edits.task = None;
        // After a list with an error, the capture is as before unless it has just been loaded.
        let is_new = list != edits.list || is_same(&versions.shown, &versions.loaded);
        if is_new
            && !is_same(&versions.shown, &edited)
            && let Some(mut asset) = captures.get_mut(&player.0)
        {
            *asset = edited.clone();
            versions.shown = edited;
        }
        edits.list = list;
        match &told {
            Ok(sentence) => info!("{sentence}"),
            Err(fault) => warn!("{fault}"),
        }
        if let Some(inspector) = &mut inspector {
            inspector.note = told.clone().unwrap_or_else(|fault| fault);
        }
        edits.fault = told.err();
    }
    if edits.is_due && edits.task.is_none() {
        edits.is_due = false;
        let (loaded, file, last) = (versions.loaded.clone(), edits.file.clone(), edits.list.clone());
        edits.task = Some(AsyncComputeTaskPool::get().spawn(async move { edit(&loaded, &file, last) }));
    }
}

/// Returns whether two captures share one scene.
fn is_same(a: &GaussianCapture, b: &GaussianCapture) -> bool {
    std::ptr::eq(a.scene(), b.scene())
}

/// Reads a list and applies it to a capture as it was loaded; if the list has an error, `last` instead.
fn edit(loaded: &GaussianCapture, file: &Path, last: EditList) -> Outcome {
    let read = read_edits(file).map_err(|error| error.to_string());
    let applied = read.and_then(|list| {
        let (edited, removed) = loaded.edited(&list).map_err(|error| refused(file, &error))?;
        Ok((list, edited, removed.iter().sum::<usize>()))
    });
    match applied {
        Ok((list, edited, removed)) => {
            let (file, total) = (file.display(), loaded.scene().len());
            Outcome { list, edited, told: Ok(format!("{file}: {removed} of {total} Gaussians are removed")) }
        }
        Err(fault) => {
            // The last list may be wrong for a capture that has been loaded since.
            let edited = loaded.edited(&last).map_or_else(|_| loaded.clone(), |(edited, _)| edited);
            Outcome { list: last, edited, told: Err(fault) }
        }
    }
}

/// Returns why a list cannot be applied.
fn refused(file: &Path, error: &CaptureEditError) -> String {
    let remedy = match error {
        CaptureEditError::Edit(EditError::NotSeen { .. }) => ": gs4d edit has them with --data, play has not",
        _ => "",
    };
    format!("{}: {error}{remedy}", file.display())
}
