//! Errors of the renderer.
//!
//! In: a missing or failing device, or a scene or picture that it cannot draw. Out: [`GpuError`], whose messages name
//! the remedy.

/// Failure of the GPU renderer.
#[derive(Debug, thiserror::Error)]
pub enum GpuError {
    /// No adapter at all.
    #[error(
        "no GPU adapter found ({reason}). Install a Vulkan driver; without a graphics card the software driver is sufficient: \
         `apt-get install mesa-vulkan-drivers libvulkan1` on Debian and Ubuntu"
    )]
    NoAdapter {
        /// Message of wgpu.
        reason: String,
    },
    /// No adapter with the name or index asked for.
    #[error("no GPU adapter matches `{wanted}`; available adapters: {found}")]
    AdapterNotFound {
        /// Name or index asked for.
        wanted: String,
        /// Names of the adapters that exist.
        found: String,
    },
    /// The adapter does not provide a device.
    #[error("the GPU adapter `{adapter}` provides no device: {reason}")]
    NoDevice {
        /// Name of the adapter.
        adapter: String,
        /// Message of wgpu.
        reason: String,
    },
    /// A limit of the device is too low for the passes.
    #[error("this GPU cannot run the renderer: {what} is {found}, {needed} is needed")]
    Limit {
        /// Name of the limit.
        what: &'static str,
        /// Value of the device.
        found: u64,
        /// Value needed.
        needed: u64,
    },
    /// A shader does not compile: a defect of this crate or of the driver.
    #[error("shader `{name}` does not compile: {reason}")]
    Shader {
        /// File name without its extension.
        name: &'static str,
        /// Message of the compiler.
        reason: String,
    },
    /// A buffer would be larger than the device can bind.
    #[error(
        "{what} need a buffer of {needed} bytes and this GPU binds at most {limit}: draw fewer Gaussians or a smaller picture"
    )]
    TooLarge {
        /// What the buffer is for.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes that the device can bind.
        limit: u64,
    },
    /// A software driver would end the loops of the passes before all splats are blended.
    #[error("a software driver does not draw {slots} Gaussians: draw fewer Gaussians, or use a graphics card")]
    TooManySplats {
        /// Number of Gaussians that are drawn.
        slots: usize,
    },
    /// A picture needs a larger buffer than the device can create or bind.
    #[error(
        "a picture of {} x {} pixels needs {needed} bytes for {what}, and buffers of this GPU have at most {limit}: draw a smaller picture",
        .size[0], .size[1]
    )]
    Picture {
        /// Width and height, pixels.
        size: [u32; 2],
        /// What the buffer is for.
        what: &'static str,
        /// Bytes needed.
        needed: u64,
        /// Bytes that the device allows.
        limit: u64,
    },
    /// The device has no memory left for a buffer or a texture.
    #[error(
        "at least {needed} bytes of this GPU's memory are needed, and there is no room for them ({reason}): draw fewer Gaussians or a \
         smaller picture"
    )]
    Memory {
        /// Bytes needed.
        needed: u64,
        /// Message of wgpu.
        reason: String,
    },
    /// The device refused an object: a limit that is not checked before, or a defect of this crate or of the driver.
    #[error(
        "this GPU refused an object of the renderer ({0}): draw fewer Gaussians or a smaller picture, or update its driver"
    )]
    Refused(String),
    /// The picture has no pixels or more than a texture can hold.
    #[error("a picture of {width} x {height} pixels cannot be drawn: sides must be between 1 and {limit}")]
    Size {
        /// Width asked for.
        width: u32,
        /// Height asked for.
        height: u32,
        /// Largest side.
        limit: u32,
    },
    /// A scene with inconsistent parts.
    #[error("{0}: the scene was not loaded from a file but assembled with inconsistent parts")]
    Scene(&'static str),
    /// The device was lost or a read-back failed.
    #[error("the GPU did not finish: {0}")]
    Device(String),
}

impl GpuError {
    /// Returns whether the device has reported the error: objects of the failed step are invalid. Other errors are found before an object is
    /// created.
    pub fn is_of_device(&self) -> bool {
        matches!(self, Self::Memory { .. } | Self::Refused(_) | Self::Device(_))
    }
}
