//! The image a script edits.
//!
//! A script reaches single pixels through `image.pixels`, a Luau buffer, and everything that works on the whole image
//! through methods, which are the kernels of `pdk-ops`. They stand in tables of [`Operation`], a file for each subject.

pub mod argument;
mod blurs;
mod color;
mod drawing;
mod geometry;
mod noises;
pub mod operation;
mod workspaces;

use std::ptr;

use mlua::{Buffer, Lua, MultiValue, UserData, UserDataFields, UserDataMethods, UserDataRegistry, ffi};
use pdk_sdk::ops::{Frame, FrameMut};

use super::api::{ApiClass, ApiProperty};
use super::failure::is_memory;
use super::types::Declare;
pub use operation::Operation;

/// An 8-bit RGB image in the memory of a script: rows of pixels without gaps.
pub struct LuaImage {
    width: usize,
    height: usize,
    /// Keeps the pixels alive, and hands them to the script.
    pixels: Buffer,
    /// Where they are.
    data: *mut u8,
}

// SAFETY: `data` points into `pixels`, which may be sent. Every access happens under the lock of the virtual machine, or
// while no script runs.
unsafe impl Send for LuaImage {}
// SAFETY: as above.
unsafe impl Sync for LuaImage {}

impl LuaImage {
    /// A black image.
    ///
    /// # Errors
    /// Where the script is out of memory.
    pub fn new(lua: &Lua, width: usize, height: usize) -> mlua::Result<Self> {
        let bytes = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(3));
        let bytes = bytes.filter(|&bytes| bytes > 0).ok_or_else(|| {
            mlua::Error::runtime(format!("an image of {width}x{height} pixels cannot be made"))
        })?;
        let pixels = match lua.create_buffer_with_capacity(bytes) {
            // Luau does not collect when memory runs out, and images make much garbage with few objects. The first
            // round drops images that nothing refers to, the second their pixels.
            Err(error) if is_memory(&error) => {
                lua.gc_collect()?;
                lua.gc_collect()?;
                lua.create_buffer_with_capacity(bytes)?
            }
            made => made?,
        };
        let (data, len) = buffer_bytes(lua, &pixels)?;
        debug_assert_eq!(len, bytes);
        Ok(Self { width, height, pixels, data })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    fn len(&self) -> usize {
        self.width * self.height * 3
    }

    /// The pixels.
    pub fn frame(&self) -> mlua::Result<Frame<'_>> {
        // SAFETY: `data` points to that many bytes, which `pixels` keeps alive; Luau never moves them. Nothing else
        // accesses them while a host function runs, and no function here holds this together with `frame_mut` of
        // the same image.
        let bytes = unsafe { std::slice::from_raw_parts(self.data, self.len()) };
        Frame::new(bytes, self.width, self.height).map_err(mlua::Error::external)
    }

    /// The pixels, to be written.
    pub fn frame_mut(&mut self) -> mlua::Result<FrameMut<'_>> {
        // SAFETY: as in `frame`.
        let bytes = unsafe { std::slice::from_raw_parts_mut(self.data, self.len()) };
        FrameMut::new(bytes, self.width, self.height).map_err(mlua::Error::external)
    }
}

/// Where the bytes of a buffer are, and how many.
pub(super) fn buffer_bytes(lua: &Lua, buffer: &Buffer) -> mlua::Result<(*mut u8, usize)> {
    let (mut data, mut len) = (ptr::null_mut(), 0usize);
    // SAFETY: the buffer is on top of the stack; looking at it neither allocates nor raises.
    unsafe {
        lua.exec_raw::<()>(buffer, |state| {
            data = ffi::lua_tobuffer(state, -1, &mut len).cast::<u8>();
            ffi::lua_pop(state, 1);
        })?;
    }
    if data.is_null() {
        return Err(mlua::Error::runtime("a buffer without memory"));
    }
    Ok((data, len))
}

/// What a script can do with an image: its values, and all [`operations`].
pub const IMAGE: ApiClass<LuaImage> = ApiClass {
    name: "Image",
    doc: "An 8-bit RGB image. Coordinates are in pixels from the upper left corner, which is (0, 0). Methods change \
          the image in place, but for those that make a new one.",
    properties: &[
        ApiProperty {
            name: "width",
            luau_type: "number",
            doc: "Width in pixels.",
            add: |class, name| class.add_field_method_get(name, |_, image| Ok(image.width)),
        },
        ApiProperty {
            name: "height",
            luau_type: "number",
            doc: "Height in pixels.",
            add: |class, name| class.add_field_method_get(name, |_, image| Ok(image.height)),
        },
        ApiProperty {
            name: "pixels",
            luau_type: "buffer",
            doc: "The pixels: the red, green and blue byte of (x, y) are at (y * width + x) * 3 and the two places \
                  behind. A byte drops fractions and everything outside of 0 to 255 wraps around, so round with + 0.5 \
                  and clip with math.clamp.",
            add: |class, name| class.add_field_method_get(name, |_, image| Ok(image.pixels.clone())),
        },
    ],
    methods: &[],
};

/// All operations on images, subject by subject.
pub fn operations() -> impl Iterator<Item = &'static Operation> {
    [drawing::OPERATIONS, color::OPERATIONS, blurs::OPERATIONS, geometry::OPERATIONS, noises::OPERATIONS]
        .into_iter()
        .flatten()
}

impl UserData for LuaImage {
    fn register(registry: &mut UserDataRegistry<Self>) {
        IMAGE.register(registry);
        for operation in operations() {
            // A function rather than a method, because it may be given the same image again.
            registry.add_function(operation.name, |lua, values: MultiValue| operation.call(lua, values));
        }
    }
}

/// The class with its operations, for the type definitions.
pub struct ImageClass;

impl Declare for ImageClass {
    fn declare(&self) -> String {
        let methods =
            operations().map(|operation| (operation.name, operation.signature(), operation.paragraphs()));
        IMAGE.declare_with(methods)
    }
}

#[cfg(test)]
mod tests;
