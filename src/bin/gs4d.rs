//! The `gs4d` command. All of it is in [`bevy_gs4d::cli`].

use std::process::ExitCode;

fn main() -> ExitCode {
    bevy_gs4d::renderer::silence_wayland();
    bevy_gs4d::cli::run()
}
