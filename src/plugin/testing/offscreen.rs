//! The picture that an app draws into, instead of a window.
//!
//! In: the size of a picture, and whether it is in HDR. Out: an [`Offscreen`], which is the target of cameras.

use bevy::asset::{Assets, Handle};
use bevy::camera::RenderTarget;
use bevy::ecs::reflect::ReflectResource;
use bevy::ecs::resource::Resource;
use bevy::image::Image;
use bevy::reflect::Reflect;
use bevy::render::render_resource::{TextureFormat, TextureUsages};
use glam::UVec2;

/// A picture that cameras draw into. [`app`](super::app) inserts one as a resource, for all cameras of the window.
#[derive(Resource, Reflect, Debug, Clone)]
#[reflect(Resource, Debug, Clone)]
#[type_path = "bevy_gs4d::testing"]
pub struct Offscreen {
    /// The picture on the GPU: RGBA, 8 bits each, sRGB-encoded; or in [HDR](Self::hdr).
    pub image: Handle<Image>,
    /// Width and height in pixels.
    pub size: UVec2,
}

impl Offscreen {
    /// Creates another picture of `size` pixels (0 counts as 1), which [`read`](super::read) returns.
    pub fn new(images: &mut Assets<Image>, size: UVec2) -> Self {
        Self::of(images, size, TextureFormat::Rgba8UnormSrgb)
    }

    /// Creates a picture in HDR: RGBA in linear light, 16-bit floats, not clamped; [`read_hdr`](super::read_hdr)
    /// returns it. Cameras that draw into it need [`Hdr`](bevy::camera::Hdr). `size` as in [`new`](Self::new).
    ///
    /// # Examples
    ///
    /// ```no_run
    /// # use bevy::camera::Hdr;
    /// # use bevy::prelude::*;
    /// # use bevy_gs4d::testing::{self, Offscreen};
    /// let mut app = testing::app(UVec2::new(320, 240));
    /// let bright = Offscreen::hdr(&mut app.world_mut().resource_mut::<Assets<Image>>(), UVec2::new(320, 240));
    /// app.world_mut().spawn((Camera3d::default(), Hdr, bright.target()));
    /// testing::settle(&mut app)?;
    /// let picture = testing::read_hdr(&mut app, &bright)?;
    /// assert!(picture.pixels().all(|pixel| pixel.0[0].is_finite()), "no light is infinite");
    /// # Ok::<(), testing::TestingError>(())
    /// ```
    pub fn hdr(images: &mut Assets<Image>, size: UVec2) -> Self {
        Self::of(images, size, TextureFormat::Rgba16Float)
    }

    fn of(images: &mut Assets<Image>, size: UVec2, format: TextureFormat) -> Self {
        let size = size.max(UVec2::ONE);
        let mut image = Image::new_target_texture(size.x, size.y, format, None);
        image.texture_descriptor.usage |= TextureUsages::COPY_SRC;
        Self { image: images.add(image), size }
    }

    /// Returns the render target to insert on the entity of a `Camera3d`. Cameras of the primary window draw into the
    /// app's own picture without it.
    pub fn target(&self) -> RenderTarget {
        RenderTarget::Image(self.image.clone().into())
    }
}
