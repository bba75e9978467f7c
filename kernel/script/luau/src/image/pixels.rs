//! The pixels of an image, which lie in the memory of the script.

use mlua::{Buffer, Lua};
use pdk_sdk::ops::{Frame, FrameMut};

use crate::buffers::buffer_bytes;
use crate::failure::is_memory;

/// Images that a script makes may have that many pixels, so that no operation on one takes much longer than a second, or
/// [`FRAMES`] times those of the frame, which then gives the script more time.
const MOST_PIXELS: usize = 4 << 20;
/// How many times as large as the frame an image may be.
const FRAMES: usize = 4;

/// The pixels of the frame at hand.
struct FramePixels(usize);

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
    fn new(lua: &Lua, width: usize, height: usize) -> mlua::Result<Self> {
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

    /// The image that holds frames of this size; those that the script makes may be somewhat larger.
    ///
    /// # Errors
    /// If the script is out of memory.
    pub fn for_frames(lua: &Lua, width: usize, height: usize) -> mlua::Result<Self> {
        lua.set_app_data(FramePixels(width.saturating_mul(height)));
        Self::new(lua, width, height)
    }

    /// A black image that the script makes.
    ///
    /// # Errors
    /// If it is too large, or the script is out of memory.
    pub(super) fn of_script(lua: &Lua, call: &str, width: usize, height: usize) -> mlua::Result<Self> {
        let frame = lua.app_data_ref::<FramePixels>().map_or(0, |pixels| pixels.0);
        let most = frame.saturating_mul(FRAMES).max(MOST_PIXELS);
        if width.saturating_mul(height) > most {
            return Err(mlua::Error::runtime(format!(
                "{call} makes an image of {width}x{height} pixels, but {most} pixels are allowed: 4 megapixels, or {FRAMES} \
                 times the frame; make it smaller"
            )));
        }
        Self::new(lua, width, height)
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels as the script has them.
    pub(super) fn buffer(&self) -> &Buffer {
        &self.pixels
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
