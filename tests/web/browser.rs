//! The browser.
//!
//! In: the address of a page. Out: a process that shows it, without a window, and draws with a software driver.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// WebGPU by the software driver of Chromium. Without `--use-vulkan` canvases stay black; `--no-sandbox` is needed by
/// root.
const OPTIONS: [&str; 9] = [
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--disable-background-timer-throttling",
    "--window-size=1280,900",
];

/// A running browser and the folder of its profile.
pub struct Browser {
    child: Child,
    _profile: tempfile::TempDir,
}

/// Returns the program of an installed Chromium or Chrome.
pub fn program() -> Option<PathBuf> {
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let folders: Vec<PathBuf> = std::env::split_paths(&std::env::var_os("PATH")?).collect();
    names.iter().flat_map(|name| folders.iter().map(move |folder| folder.join(name))).find(|path| path.is_file())
}

/// Opens an address.
pub fn open(program: &PathBuf, address: &str) -> Browser {
    let profile = tempfile::tempdir().expect("a temporary folder");
    let mut folder = std::ffi::OsString::from("--user-data-dir=");
    folder.push(profile.path());
    let mut command = Command::new(program);
    command.args(OPTIONS).arg(folder).arg(address).stdout(Stdio::null()).stderr(Stdio::null());
    Browser { child: command.spawn().expect("the browser starts"), _profile: profile }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
