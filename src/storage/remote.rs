//! The command on URLs.
//!
//! In: the command line of the process. Out: the exit code. URLs of inputs are fetched, and those of outputs written, around the verb, which
//! works on paths.

use super::arguments::replaced;
use super::cache::{Cache, Staging};
use super::fetch::fetch;
use super::listing::{Listed, list};
use super::place::{Place, Target};
use super::store_error::StoreError;
use super::upload::upload;
use crate::cli::urls::urls;
use crate::cli::{Opened, PlaceError, Places, run_in};
use crate::offline::temporary_file;
use clap::ArgMatches;
use futures_util::{StreamExt, TryStreamExt, stream};
use std::ffi::OsString;
use std::fs;
use std::future::Future;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Number of objects that are fetched at a time.
const AT_A_TIME: usize = 8;

/// Runs the command that the process was started with, on files of this machine and on URLs. Returns its exit code.
pub fn run() -> ExitCode {
    run_in(&mut Remote::default())
}

/// The places of URLs.
#[derive(Default)]
struct Remote {
    outputs: Vec<Output>,
}

/// An output that is uploaded.
struct Output {
    place: Place,
    staging: Staging,
}

impl Places for Remote {
    fn open(
        &mut self,
        arguments: Vec<OsString>,
        values: &ArgMatches,
        note: &dyn Fn(&str),
    ) -> Result<Opened, PlaceError> {
        let (mut arguments, mut names) = (arguments, Vec::new());
        for named in urls(values)? {
            let path = match Target::of(&named.url)? {
                Target::Local(path) => path,
                Target::Remote(place) => {
                    let cache = Cache::of_user()?;
                    let folder = match named.is_output {
                        true => self.stage(&cache, &place)?,
                        false => block_on(fetched(&cache, &place, note))??,
                    };
                    names.push((folder.display().to_string(), place.parent().to_owned()));
                    folder.join(place.name())
                }
            };
            let path = path.to_str().ok_or_else(|| format!("{}: its path here is not Unicode", named.url))?;
            arguments = replaced(&arguments, &named.url, path);
        }
        Ok(Opened { arguments, names })
    }

    fn close(&mut self, note: &dyn Fn(&str)) -> Result<(), PlaceError> {
        for Output { place, staging } in self.outputs.drain(..) {
            match block_on(upload(&staging, &place))? {
                Ok(urls) => urls.iter().for_each(|url| note(&format!("uploaded {url}"))),
                Err(error) => {
                    let kept = kept(&staging.folder);
                    return Err(format!("{error}; the output is complete in {kept}: copy it from there").into());
                }
            }
            fs::remove_dir_all(&staging.folder)?;
        }
        Ok(())
    }
}

impl Remote {
    /// Returns the folder that a verb writes to in place of the URL of a folder.
    fn stage(&mut self, cache: &Cache, place: &Place) -> Result<PathBuf, StoreError> {
        let staging = cache.staging(&place.url).map_err(|error| StoreError::new(&place.url, error))?;
        let folder = staging.folder.clone();
        self.outputs.push(Output { place: place.clone(), staging });
        Ok(folder)
    }
}

/// Returns the folder with a copy of what a URL stands for.
async fn fetched(cache: &Cache, place: &Place, note: &dyn Fn(&str)) -> Result<PathBuf, StoreError> {
    let unwritable = |error| {
        let folder = cache.folder().display();
        StoreError::new(&place.url, format!("its copy cannot be written to {folder}: {error}"))
    };
    let listed = list(place).await?;
    let copies = stream::iter(&listed).map(|object| copied(cache, object)).buffered(AT_A_TIME);
    let copies: Vec<(PathBuf, u64)> = copies.try_collect().await?;
    let bytes: u64 = copies.iter().map(|(_, fetched)| fetched).sum();
    match copies.iter().filter(|(_, fetched)| *fetched > 0).count() {
        0 => note(&format!("{}: not fetched again, it has not changed", place.url)),
        count => {
            note(&format!("{}: fetched {count} of {} files, {:.1} MB", place.url, listed.len(), bytes as f64 / 1e6))
        }
    }
    let files: Vec<_> =
        listed.into_iter().map(|object| object.relative).zip(copies.into_iter().map(|(path, _)| path)).collect();
    cache.set(&files).map_err(unwritable)
}

/// Returns the path of a copy of an object, and the bytes that were fetched for it.
async fn copied(cache: &Cache, object: &Listed) -> Result<(PathBuf, u64), StoreError> {
    let url = &object.place.url;
    let path = cache.object(url, &object.version(), object.place.name());
    let path = path.map_err(|error| StoreError::new(url, format!("its copy cannot be written: {error}")))?;
    if path.metadata().is_ok_and(|metadata| metadata.is_file() && metadata.len() == object.meta.size) {
        return Ok((path, 0));
    }
    temporary_file::remove_stale(temporary_file::folder_of(&path));
    fetch(object, &path).await?;
    Ok((path, object.meta.size))
}

/// Returns where an output is kept, in words: its path would be shown as its URL.
fn kept(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let cache = folder.parent().and_then(Path::parent).unwrap_or(folder);
    format!("the folder {name} of {}", cache.join("outputs").display())
}

/// Runs what waits for the network.
fn block_on<T>(work: impl Future<Output = T>) -> Result<T, PlaceError> {
    Ok(tokio::runtime::Builder::new_current_thread().enable_all().build()?.block_on(work))
}
