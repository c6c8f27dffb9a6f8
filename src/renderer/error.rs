//! What can go wrong between a scene and its picture on the GPU.
//!
//! In: nothing. Out: [`GpuError`], whose messages name the remedy.

/// Failure of the GPU renderer.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter at all.
    #[error(
        "no GPU adapter found ({reason}). Install a Vulkan driver; without a graphics card the software driver does: \
         `apt-get install mesa-vulkan-drivers libvulkan1` on Debian and Ubuntu"
    )]
    NoAdapter {
        /// What wgpu said.
        reason: String,
    },
    /// No adapter by the name or index asked for.
    #[error("no GPU adapter matches `{wanted}`; there are: {found}")]
    AdapterNotFound {
        /// What was asked for.
        wanted: String,
        /// Names of those there are.
        found: String,
    },
    /// The adapter gives no device.
    #[error("the GPU adapter `{adapter}` gives no device: {reason}")]
    NoDevice {
        /// Its name.
        adapter: String,
        /// What wgpu said.
        reason: String,
    },
    /// The device cannot run our passes.
    #[error("this GPU cannot run the renderer: {what} is {found}, {needed} is needed")]
    Limit {
        /// Name of the limit.
        what: &'static str,
        /// What there is.
        found: u64,
        /// What there should be.
        needed: u64,
    },
    /// A shader does not compile: a defect of this crate or of the driver.
    #[error("shader `{name}` does not compile: {reason}")]
    Shader {
        /// File name without the ending.
        name: &'static str,
        /// What the compiler said.
        reason: String,
    },
    /// A buffer would be larger than the device binds.
    #[error(
        "{what} need a buffer of {needed} bytes and this GPU binds at most {limit}: draw fewer Gaussians or a smaller picture"
    )]
    TooLarge {
        /// What it is for.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes the device binds.
        limit: u64,
    },
    /// The picture has no pixels or more than a texture holds.
    #[error("a picture of {width} x {height} pixels cannot be drawn: sides must be between 1 and {limit}")]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
        /// Largest side.
        limit: u32,
    },
    /// A scene whose parts do not fit together.
    #[error("{0}: such a scene was not loaded from a file but put together wrongly")]
    Scene(&'static str),
    /// The device was lost or a read-back failed.
    #[error("the GPU did not finish: {0}")]
    Device(String),
}
