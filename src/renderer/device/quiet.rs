//! A process whose standard error has no lines of libwayland.
//!
//! In: the environment and the arguments of the process. Out: the same process, started again with another environment if it needs one.

#[cfg(target_os = "linux")]
use std::env;
#[cfg(target_os = "linux")]
use std::process::Command;

/// Keeps libwayland from printing `error: XDG_RUNTIME_DIR is invalid or not set in the environment.` whenever a program opens a GPU.
///
/// The layer `VK_LAYER_MESA_device_select`, which Mesa adds to every program, asks the Wayland server of the session for its GPU as soon as a Vulkan
/// instance supports Wayland windows, and that of wgpu does. On a server without a session libwayland then prints that line. If `XDG_RUNTIME_DIR` is
/// not an absolute path, this function sets it to a folder that does not exist, in which no server is found and nothing is printed. Since the
/// environment of a process with threads cannot be changed safely, the process is replaced by itself, which takes a few milliseconds: call it first in
/// `main`. It does nothing on other systems than Linux.
pub fn silence_wayland() {
    #[cfg(target_os = "linux")]
    restart_if_needed();
}

/// A path in which no file can be made.
#[cfg(target_os = "linux")]
const NOWHERE: &str = "/dev/null";

/// Replaces the process by itself with `XDG_RUNTIME_DIR`, unless libwayland prints nothing.
#[cfg(target_os = "linux")]
fn restart_if_needed() {
    use std::os::unix::process::CommandExt;

    let is_absolute = |name: &&str| env::var_os(name).is_some_and(|path| path.as_encoded_bytes().starts_with(b"/"));
    // An absolute path to the socket of a server needs no folder.
    if ["XDG_RUNTIME_DIR", "WAYLAND_DISPLAY"].iter().any(is_absolute) {
        return;
    }
    let (Ok(program), mut arguments) = (env::current_exe(), env::args_os()) else { return };
    let mut command = Command::new(program);
    if let Some(name) = arguments.next() {
        command.arg0(name);
    }
    // It returns only if it fails; the process then goes on, and the line is printed.
    let _ = command.args(arguments).env("XDG_RUNTIME_DIR", NOWHERE).exec();
}
