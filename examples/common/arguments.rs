//! The command line of every example, and pictures without a window.
//!
//! In: `[FILE] [--headless FOLDER] [--frames N] [--help]` and the options of one example. Out: [`Arguments`], an asset
//! path, pictures in a folder.

use bevy::asset::io::file::FileAssetReader;
use bevy::prelude::*;
use bevy_gs4d::renderer::silence_wayland;
use bevy_gs4d::testing;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// The source of the compiled example. Its header is the text of `--help`.
const SOURCE: &str = include_str!(concat!("../", env!("CARGO_CRATE_NAME"), ".rs"));

/// The parsed arguments of an example, or its defaults.
pub struct Arguments {
    pub file: String,
    /// The folder for pictures; `None` for a window.
    pub headless: Option<PathBuf>,
    pub frames: u32,
}

/// Reads the command line. `more` is called with each option that is not common to all examples and with the following
/// arguments; it returns whether the option belongs to this example. Without a display, pictures are written even
/// without `--headless`.
///
/// # Errors
/// An unknown option, an option without its value, more than one file.
pub fn parse(
    defaults: Arguments,
    mut more: impl FnMut(&str, &mut dyn Iterator<Item = String>) -> Result<bool>,
) -> Result<Arguments> {
    // On a server without a session nothing is printed about that.
    silence_wayland();
    let mut parsed = defaults;
    let mut arguments = std::env::args().skip(1);
    let mut files = 0;
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--headless" => parsed.headless = Some(value(&argument, "a folder", &mut arguments)?.into()),
            "--frames" => {
                let count = value(&argument, "a number", &mut arguments)?;
                parsed.frames = count.parse().map_err(|_| format!("--frames {count}: not a number of pictures"))?;
            }
            "--help" | "-h" => {
                println!("{}", help());
                std::process::exit(0);
            }
            option if option.starts_with('-') => {
                if !more(option, &mut arguments)? {
                    return Err(format!("{option}: no such option; --help lists all options").into());
                }
            }
            _ if files == 1 => return Err(format!("{argument}: more than one file; name one file").into()),
            _ => {
                parsed.file = argument;
                files += 1;
            }
        }
    }
    if parsed.headless.is_none() && !has_display() {
        eprintln!("no display: writing pictures instead");
        parsed.headless = Some("out".into());
    }
    Ok(parsed)
}

/// Returns the argument after an option.
///
/// # Errors
/// The option is the last argument.
pub fn value(option: &str, what: &str, arguments: &mut dyn Iterator<Item = String>) -> Result<String> {
    Ok(arguments.next().ok_or_else(|| format!("{option} needs {what}"))?)
}

/// Returns the header of the example.
fn help() -> String {
    let lines = SOURCE.lines().map_while(|line| line.strip_prefix("//!"));
    let lines = lines.map(|line| line.strip_prefix(' ').unwrap_or(line)).filter(|line| !line.starts_with("```"));
    lines.collect::<Vec<_>>().join("\n")
}

fn has_display() -> bool {
    // The feature `viewer` opens X11 windows on Linux.
    !cfg!(target_os = "linux") || std::env::var_os("DISPLAY").is_some_and(|display| !display.is_empty())
}

/// Returns a path from the command line as an asset path: relative to `assets/` if there is such a file there and none
/// in the current folder, else to the current folder, where it may appear later.
pub fn asset_path(argument: &str) -> PathBuf {
    let path = Path::new(argument);
    let is_asset = FileAssetReader::get_base_path().join("assets").join(path).exists();
    if is_asset && !path.exists() { path.into() } else { std::path::absolute(path).unwrap_or_else(|_| path.into()) }
}

/// Renders `count` pictures, `step` apart, into `folder`, and prints its path.
///
/// # Errors
/// Those of [`testing::pictures`].
pub fn save_pictures(app: &mut App, count: u32, step: Duration, folder: &Path) -> Result {
    testing::pictures(app, folder, count, step)?;
    println!("{count} pictures in {}", folder.display());
    Ok(())
}
