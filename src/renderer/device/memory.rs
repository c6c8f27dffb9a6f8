//! Creation of buffers, textures and bind groups, and the limits of a device for them.
//!
//! In: a device, sizes and usages. Out: buffers, textures and bind groups, each counted; the limits that sizes are
//! checked against; the errors of the device, where memory runs out or an object is refused.

use super::error::GpuError;
use super::work::WorkCounters;
use glam::UVec2;
use pollster::block_on;
use std::pin::Pin;
use std::sync::{Mutex, PoisonError};
use std::task::{Context, Poll, Waker};
use wgpu::{BufferUsages, ErrorFilter, TextureFormat};

/// Creates resources on a device and counts them.
#[derive(Debug, Clone, Copy)]
pub struct Allocator<'a> {
    /// The device.
    pub device: &'a wgpu::Device,
    /// Counts the resources created.
    pub work: &'a WorkCounters,
}

impl Allocator<'_> {
    /// Creates a buffer that can also be written through the queue.
    pub fn buffer(self, label: &str, size: u64, usage: BufferUsages) -> wgpu::Buffer {
        self.work.add_created();
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage: usage | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        })
    }

    /// Creates a texture that passes write and later passes read. A depth texture is only read.
    pub fn texture(self, label: &str, size: UVec2, format: TextureFormat) -> wgpu::Texture {
        let usage = if format == TextureFormat::Depth32Float {
            wgpu::TextureUsages::TEXTURE_BINDING
        } else {
            wgpu::TextureUsages::STORAGE_BINDING | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC
        };
        self.work.add_created();
        self.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d { width: size.x, height: size.y, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage,
            view_formats: &[],
        })
    }

    /// Creates a bind group whose bindings are numbered in order.
    pub fn bind_group(
        self,
        label: &str,
        layout: &wgpu::BindGroupLayout,
        resources: &[wgpu::BindingResource<'_>],
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = resources
            .iter()
            .enumerate()
            .map(|(i, resource)| wgpu::BindGroupEntry { binding: i as u32, resource: resource.clone() })
            .collect();
        self.work.add_created();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
    }
}

/// Scopes that catch the errors of a device, which otherwise reach the handler of the app, and may end it. Scopes belong to a thread: open and
/// close them in one function.
pub(crate) struct ErrorScopes([wgpu::ErrorScopeGuard; 3]);

impl ErrorScopes {
    /// Opens scopes for all kinds of errors.
    pub(crate) fn open(device: &wgpu::Device) -> Self {
        let filters = [ErrorFilter::Validation, ErrorFilter::Internal, ErrorFilter::OutOfMemory];
        Self(filters.map(|filter| device.push_error_scope(filter)))
    }

    /// Closes the scopes. `needed` is the number of bytes of the objects created since they were opened, for the message.
    pub(crate) fn close(self, needed: u64) -> Caught {
        let [refused, internal, lacking] = self.0;
        // Scopes are closed in reverse order.
        let (lacking, internal, refused) = (lacking.pop(), internal.pop(), refused.pop());
        let result = async move {
            match (lacking.await, internal.await, refused.await) {
                (Some(error), ..) => Err(GpuError::Memory { needed, reason: error.to_string() }),
                (None, Some(error), _) | (None, None, Some(error)) => Err(GpuError::Refused(error.to_string())),
                (None, None, None) => Ok(()),
            }
        };
        Caught(Mutex::new(Box::pin(result)))
    }
}

/// The errors that [`ErrorScopes`] have caught. They are known at once, except in browsers, where they arrive some frames later.
pub(crate) struct Caught(Mutex<Pin<Box<dyn Future<Output = Result<(), GpuError>> + Send>>>);

impl Caught {
    /// Returns the result without waiting; `None` while it is unknown. A result is returned once.
    pub(crate) fn poll(&mut self) -> Option<Result<(), GpuError>> {
        let result = self.0.get_mut().unwrap_or_else(PoisonError::into_inner);
        match result.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(result) => Some(result),
            Poll::Pending => None,
        }
    }

    /// Waits for the result.
    fn wait(self) -> Result<(), GpuError> {
        block_on(self.0.into_inner().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Runs `create`, which creates objects of `needed` bytes, and returns what it created with the errors of the device.
pub(crate) fn catch<T>(device: &wgpu::Device, needed: u64, create: impl FnOnce() -> T) -> (T, Caught) {
    let scopes = ErrorScopes::open(device);
    let created = create();
    (created, scopes.close(needed))
}

/// Runs `create` as [`catch`] does, without waiting for errors that are unknown when it has returned.
///
/// # Errors
/// The device has no memory left, or refuses an object.
pub(crate) fn catch_known<T>(device: &wgpu::Device, needed: u64, create: impl FnOnce() -> T) -> Result<T, GpuError> {
    let (created, mut caught) = catch(device, needed, create);
    caught.poll().unwrap_or(Ok(())).map(|()| created)
}

/// Runs `create`, which allocates `needed` bytes or more. If the device has too little memory, an error is returned, instead of a panic of
/// wgpu.
///
/// # Errors
/// The device has no memory left, or rejects an object that uses a resource without memory.
pub fn with_room<T>(device: &wgpu::Device, needed: u64, create: impl FnOnce() -> T) -> Result<T, GpuError> {
    let (created, caught) = catch(device, needed, create);
    caught.wait().map(|()| created)
}

/// Returns the size of the largest storage buffer that can be created and bound as a whole, bytes.
pub fn binding_limit(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
}

/// Checks that the device can create textures of this size.
///
/// # Errors
/// No pixels, or a longer side than the device allows.
pub fn require_texture(size: UVec2, limits: &wgpu::Limits) -> Result<(), GpuError> {
    let limit = limits.max_texture_dimension_2d;
    match size.min_element() == 0 || size.max_element() > limit {
        true => Err(GpuError::Size { width: size.x, height: size.y, limit }),
        false => Ok(()),
    }
}
