//! Where the files of the command are.
//!
//! In: a command line. Out: the same with paths of this machine, which the verb reads and writes; what it has written goes to its place
//! afterwards. Verbs know of paths alone.

use super::urls::urls;
use clap::ArgMatches;
use std::error::Error;
use std::ffi::OsString;

/// An error of a place. Its message names the file.
pub(crate) type PlaceError = Box<dyn Error + Send + Sync>;

/// A command line on the files of this machine.
pub(crate) struct Opened {
    /// The arguments.
    pub arguments: Vec<OsString>,
    /// Folders of this machine that have copies, each with the place that its files are shown by.
    pub names: Vec<(String, String)>,
}

/// Where the files of the command are.
pub(crate) trait Places {
    /// Returns the command line with paths in place of other names of files, once what the verb reads is there. `note` shows a line to the
    /// user.
    ///
    /// # Errors
    /// A file that cannot be read.
    fn open(
        &mut self,
        arguments: Vec<OsString>,
        values: &ArgMatches,
        note: &dyn Fn(&str),
    ) -> Result<Opened, PlaceError>;

    /// Brings what the verb has written to its place.
    ///
    /// # Errors
    /// A file that cannot be written.
    fn close(&mut self, note: &dyn Fn(&str)) -> Result<(), PlaceError>;
}

/// The disks of this machine alone.
pub(super) struct ThisMachine;

impl Places for ThisMachine {
    fn open(
        &mut self,
        arguments: Vec<OsString>,
        values: &ArgMatches,
        _note: &dyn Fn(&str),
    ) -> Result<Opened, PlaceError> {
        match urls(values)?.first() {
            Some(named) => Err(format!(
                "{}: URLs are read and written by a gs4d that was built with the feature storage: cargo install bevy_gs4d \
                 --features storage",
                named.url
            )
            .into()),
            None => Ok(Opened { arguments, names: Vec::new() }),
        }
    }

    fn close(&mut self, _note: &dyn Fn(&str)) -> Result<(), PlaceError> {
        Ok(())
    }
}
