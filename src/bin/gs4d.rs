//! The `gs4d` command. All of it is in [`bevy_gs4d::cli`], and with the feature `storage` in `bevy_gs4d::storage`.

use std::process::ExitCode;

fn main() -> ExitCode {
    bevy_gs4d::renderer::silence_wayland();
    #[cfg(feature = "storage")]
    return bevy_gs4d::storage::run();
    #[cfg(not(feature = "storage"))]
    bevy_gs4d::cli::run()
}
