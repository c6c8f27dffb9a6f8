//! The input and output files of a computation, checked before it begins.
//!
//! In: the paths of both. Out: an error that names the first output that is an input, is another output or cannot be
//! written. Temporary files that killed runs have left beside the outputs are removed.

use crate::offline::dataset::{CameraFile, CameraOptions, Split, inputs};
use crate::offline::work::FileError;
use crate::offline::work::node::node;
use crate::offline::work::save::{is_stream, resolved};
use crate::offline::work::temporary_file::{self, folder_of};
use glam::UVec2;
use std::collections::{BTreeSet, HashMap};
use std::fs::{File, Metadata};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

/// The input and output files of a computation. Default: none.
#[derive(Debug, Clone, Default)]
pub(crate) struct Files {
    inputs: Vec<PathBuf>,
    outputs: Vec<Output>,
}

/// One output.
#[derive(Debug, Clone)]
enum Output {
    /// A file in a folder that exists. If its name has an extension, it is this one. It may be a device or a pipe.
    File(PathBuf, &'static str),
    /// A file as above, but not a device or a pipe: it is read again, or other files are written beside it.
    Regular(PathBuf, &'static str),
    /// A folder, which is made if it does not exist.
    Folder(PathBuf),
    /// A file in such a folder.
    Inside(PathBuf),
}

/// The identity of a file. All paths of one file have a place in common.
#[derive(Debug, PartialEq, Eq, Hash)]
enum Place {
    /// The numbers of the device and of the file on it: equal for all hard links.
    Node(u64, u64),
    /// The path without symbolic links, also if there is no file yet.
    Path(PathBuf),
}

impl Files {
    /// Adds inputs.
    pub(crate) fn reads<'a>(mut self, paths: impl IntoIterator<Item = &'a PathBuf>) -> Self {
        self.inputs.extend(paths.into_iter().cloned());
        self
    }

    /// Adds a capture, or the files of a folder of captures, and the `cfg_args` beside it.
    pub(crate) fn reads_scene(mut self, path: &Path) -> Self {
        if let Ok(entries) = path.read_dir() {
            self.inputs.extend(entries.flatten().map(|entry| entry.path()));
        }
        self.inputs.extend([path.to_owned(), path.with_file_name("cfg_args")]);
        self
    }

    /// Adds a camera file, the existing images that it names, and the images of the dataset in the same folder.
    pub(crate) fn reads_cameras(mut self, path: &Path) -> Self {
        self.add_cameras(path);
        self.reads_data(folder_of(path))
    }

    /// Adds the camera files of a dataset folder, and the existing images and masks that they name.
    pub(crate) fn reads_data(mut self, folder: &Path) -> Self {
        for split in Split::ALL {
            self.add_cameras(&folder.join(split.file_name()));
        }
        self.inputs.extend(inputs(folder).into_iter().filter(|path| may_exist(path)));
        self
    }

    fn add_cameras(&mut self, path: &Path) {
        self.inputs.push(path.to_owned());
        // Any size serves: paths do not depend on it. Faults of the file are reported when it is read.
        let options = CameraOptions { size: Some(UVec2::ONE), ..CameraOptions::default() };
        for view in CameraFile::load(path, &options).unwrap_or_default() {
            // An image that does not exist is no input: the same name may be an output.
            self.inputs.extend([Some(view.image), view.mask].into_iter().flatten().filter(|image| may_exist(image)));
        }
    }

    /// Adds an output: a file in a folder that exists. If its name has an extension, it must be this one.
    pub(crate) fn writes(mut self, path: &Path, extension: &'static str) -> Self {
        self.outputs.push(Output::File(path.to_owned(), extension));
        self
    }

    /// Adds an output that is read again or has other files beside it: a file as in [`writes`](Self::writes), but not a
    /// device or a pipe.
    pub(crate) fn writes_regular(mut self, path: &Path, extension: &'static str) -> Self {
        self.outputs.push(Output::Regular(path.to_owned(), extension));
        self
    }

    /// Adds an output: a folder, which will be made if it does not exist, and files in it.
    pub(crate) fn writes_folder(mut self, folder: &Path, files: impl IntoIterator<Item = PathBuf>) -> Self {
        self.outputs.push(Output::Folder(folder.to_owned()));
        self.outputs.extend(files.into_iter().map(Output::Inside));
        self
    }

    /// Checks that no output is an input or another output, and that all can be written. Removes the temporary files
    /// that killed runs have left beside them.
    ///
    /// # Errors
    /// The first output that is an input, is another output or cannot be written.
    pub(crate) fn check(&self) -> Result<(), FileError> {
        self.tell_apart()?;
        let mut folders = BTreeSet::new();
        for output in &self.outputs {
            let folder = output.check()?;
            if let Some(folder) = folder.filter(|folder| !folders.contains(folder)) {
                check_folder(output.path(), &folder)?;
                folders.insert(folder);
            }
        }
        folders.iter().for_each(|folder| temporary_file::remove_stale(folder));
        Ok(())
    }

    fn tell_apart(&self) -> Result<(), FileError> {
        let (mut inputs, mut outputs) = (HashMap::<Place, &Path>::new(), HashMap::<Place, &Path>::new());
        for path in &self.inputs {
            inputs.extend(places(path).into_iter().map(|place| (place, path.as_path())));
        }
        for path in self.outputs.iter().filter(|output| output.is_file()).map(Output::path) {
            let places = places(path);
            if let Some(input) = places.iter().find_map(|place| inputs.get(place)) {
                let input_name = input.display();
                let message = match may_exist(input) {
                    true => format!("is the input itself, {input_name}: write to another file"),
                    false => format!("would be read with the input, as {input_name}: write to another file"),
                };
                return Err(FileError::at(path, message));
            }
            if let Some(other) = places.iter().find_map(|place| outputs.get(place)) {
                let message = format!("would be written twice, also as {}: name another file", other.display());
                return Err(FileError::at(path, message));
            }
            outputs.extend(places.into_iter().map(|place| (place, path)));
        }
        Ok(())
    }
}

impl Output {
    fn path(&self) -> &Path {
        match self {
            Self::File(path, _) | Self::Regular(path, _) | Self::Folder(path) | Self::Inside(path) => path,
        }
    }

    /// Returns whether the output is a file on a disk: folders, devices and pipes may be outputs of several runs.
    fn is_file(&self) -> bool {
        !matches!(self, Self::Folder(_)) && !is_stream(self.path())
    }

    /// Checks what exists at the path. Returns the folder in which a file will be made; `None` if another output checks
    /// it, or for a device or a pipe.
    fn check(&self) -> Result<Option<PathBuf>, FileError> {
        match self {
            Self::File(path, _) if is_stream(path) => check_stream(path).map(|()| None),
            Self::Regular(path, _) if is_stream(path) => {
                let message =
                    "is a device or a pipe, and what is written here is more than one stream of bytes: name a file";
                Err(FileError::at(path, message))
            }
            Self::File(path, extension) | Self::Regular(path, extension) => {
                if path.as_os_str().as_encoded_bytes().ends_with(b"/") {
                    return Err(FileError::at(path, "is the name of a folder: name a file"));
                }
                if path.extension().is_some_and(|found| !found.eq_ignore_ascii_case(extension)) {
                    let message = format!("the name of what is written here ends in .{extension}: choose another name");
                    return Err(FileError::at(path, message));
                }
                check_file(path)?;
                Ok(Some(folder_of(&resolved(path)).to_owned()))
            }
            Self::Folder(path) => {
                path.metadata().map_or_else(|error| check_missing(path, error), |_| Ok(()))?;
                let path = resolved(path);
                Ok(path.ancestors().find(|folder| folder.metadata().is_ok()).map(Path::to_owned))
            }
            Self::Inside(path) => check_file(path).map(|()| None),
        }
    }
}

/// Returns whether there may be a file at a path: false if the path does not exist, or is a link to a path that does
/// not exist.
fn may_exist(path: &Path) -> bool {
    path.metadata().map_or_else(|error| error.kind() == ErrorKind::PermissionDenied, |_| true)
}

/// Checks that a device can be written to. A pipe is not opened: opening waits until another program reads the pipe.
fn check_stream(path: &Path) -> Result<(), FileError> {
    match path.metadata() {
        Ok(metadata) if is_device(&metadata) => {
            File::options().write(true).open(path).map(drop).map_err(|error| FileError::at(path, error))
        }
        _ => Ok(()),
    }
}

/// Checks that a file can be replaced if it exists.
fn check_file(path: &Path) -> Result<(), FileError> {
    match path.metadata() {
        Ok(metadata) if metadata.is_dir() => Err(FileError::at(path, "is a folder: name a file")),
        Ok(metadata) if metadata.permissions().readonly() => {
            Err(FileError::at(path, "is write-protected: change its permissions, or write to another file"))
        }
        Ok(_) if is_stream(path) => Ok(()),
        Ok(_) => File::options().write(true).open(path).map(drop).map_err(|error| FileError::at(path, error)),
        Err(error) => check_missing(path, error),
    }
}

/// Checks that a path can be made, given the error of reading its metadata. Its folder is checked in any case.
fn check_missing(path: &Path, error: io::Error) -> Result<(), FileError> {
    match error.kind() {
        ErrorKind::NotFound | ErrorKind::NotADirectory => Ok(()),
        // A circle of links, a name that is too long.
        _ => Err(FileError::at(path, error)),
    }
}

/// Checks that files can be made in the folder of an output.
fn check_folder(out: &Path, folder: &Path) -> Result<(), FileError> {
    let shown = folder.display();
    let message = match folder.metadata() {
        Ok(metadata) if !metadata.is_dir() => format!("{shown} is a file, not a folder: write to another place"),
        // A file without a name, where the system supports it: a run that is killed here leaves no file.
        Ok(_) => match tempfile::tempfile_in(folder) {
            Ok(_) => return Ok(()),
            Err(error) => format!("nothing can be written to the folder {shown}: {error}"),
        },
        Err(error) if error.kind() == ErrorKind::NotFound => {
            format!("there is no folder {shown}: make it, or write to another one")
        }
        Err(error) => format!("the folder {shown} cannot be used: {error}"),
    };
    Err(FileError::at(out, message))
}

fn places(path: &Path) -> Vec<Place> {
    let node = path.metadata().ok().as_ref().and_then(node).map(|(device, number)| Place::Node(device, number));
    node.into_iter().chain([Place::Path(resolved(path))]).collect()
}

#[cfg(unix)]
fn is_device(metadata: &Metadata) -> bool {
    use std::os::unix::fs::FileTypeExt;
    metadata.file_type().is_char_device() || metadata.file_type().is_block_device()
}

#[cfg(not(unix))]
fn is_device(_: &Metadata) -> bool {
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn failure(files: Files) -> String {
        files.check().expect_err("the outputs must be refused").to_string()
    }

    #[test]
    fn no_output_is_an_input_by_any_path() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [input, roundabout] = ["in.gs4d", "./in.gs4d"].map(|name| folder.path().join(name));
        fs::write(&input, b"contents").expect("the folder can be written to");
        let files = || Files::default().reads_scene(&input);
        assert!(failure(files().writes(&roundabout, "gs4d")).contains("the input itself"), "another path of the input");
        let hard = folder.path().join("hard.gs4d");
        fs::hard_link(&input, &hard).expect("the folder can be written to");
        if cfg!(unix) {
            assert!(failure(files().writes(&hard, "gs4d")).contains("the input itself"), "a hard link");
        }
        let beside = folder.path().join("cfg_args");
        assert!(
            failure(files().writes(&beside, "f32")).contains("would be read with the input"),
            "the file does not exist"
        );
        fs::write(&beside, b"Namespace()").expect("the folder can be written to");
        assert!(
            failure(files().writes(&beside, "f32")).contains("the input itself"),
            "a file that is read with the input is an input"
        );
        files().writes(&folder.path().join("out.gs4d"), "gs4d").check().expect("another file");
    }

    #[cfg(unix)]
    #[test]
    fn links_are_followed_also_before_there_are_files() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let [real, link] = ["real", "link"].map(|name| folder.path().join(name));
        fs::create_dir(&real).expect("the folder can be written to");
        symlink("real", &link).expect("the folder can be written to");
        let twice = Files::default().writes(&real.join("new.csv"), "csv").writes(&link.join("new.csv"), "csv");
        assert!(failure(twice).contains("written twice"), "two paths of one file that does not exist yet");
        let (target, ahead) = (folder.path().join("later.gs4d"), folder.path().join("ahead.gs4d"));
        symlink("later.gs4d", &ahead).expect("the folder can be written to");
        let twice = Files::default().writes(&target, "gs4d").writes(&ahead, "gs4d");
        assert!(failure(twice).contains("written twice"), "a link to a file that does not exist yet");
    }

    #[cfg(unix)]
    #[test]
    fn devices_are_opened_and_refused_where_a_file_is_needed() {
        let null = Path::new("/dev/null");
        Files::default().writes(null, "gs4d").check().expect("the device can be written to");
        let message = failure(Files::default().writes_regular(null, "gs4d"));
        assert!(message.starts_with("/dev/null: is a device or a pipe"), "a file is needed: {message}");
    }

    #[cfg(unix)]
    #[test]
    fn images_that_lead_to_nothing_are_no_inputs() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        symlink("circle.png", path("circle.png")).expect("the folder can be written to");
        symlink("nothing", path("dangling.png")).expect("the folder can be written to");
        fs::write(path("file"), b"contents").expect("the folder can be written to");
        for name in ["circle.png", "dangling.png", "missing.png", "file/inside.png"] {
            assert!(!may_exist(&path(name)), "{name} is no file");
        }
        assert!(may_exist(&path("file")), "a file");
    }

    #[test]
    fn outputs_that_cannot_be_written_are_named() {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = |name: &str| folder.path().join(name);
        fs::write(path("file.gs4d"), b"contents").expect("the folder can be written to");
        fs::create_dir(path("folder.gs4d")).expect("the folder can be written to");
        for (name, reason) in [
            ("missing/out.gs4d", "there is no folder"),
            ("file.gs4d/out.gs4d", "not a folder"),
            ("folder.gs4d", "is a folder"),
            ("out.pth", "ends in .gs4d"),
            ("new.gs4d/", "name of a folder"),
        ] {
            let message = failure(Files::default().writes(&path(name), "gs4d"));
            assert!(message.contains(&path(name).display().to_string()), "{name} is named: {message}");
            assert!(message.contains(reason), "{name}: {reason}: {message}");
        }
        let inside = failure(Files::default().writes_folder(&path("file.gs4d/deep/frames"), []));
        assert!(inside.contains("file.gs4d is a file"), "no folder can be made in a file: {inside}");
        let new = path("deep/frames");
        Files::default().writes_folder(&new, [new.join("0.png")]).check().expect("the folder can be made");
        assert!(!path("deep").exists(), "the check makes no folder");
        let mut permissions = path("file.gs4d").metadata().expect("the file exists").permissions();
        permissions.set_readonly(true);
        fs::set_permissions(path("file.gs4d"), permissions).expect("permissions can be set");
        let message = failure(Files::default().writes(&path("file.gs4d"), "gs4d"));
        assert!(message.contains("write-protected"), "a write-protected file is refused: {message}");
    }
}
