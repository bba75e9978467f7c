//! The image a script edits.
//!
//! A script reaches single pixels through `image.pixels`, a Luau buffer, and everything that works on the whole image
//! through methods, which are the kernels of `pdk-ops`.

use std::ptr;

use mlua::{
    AnyUserData, Buffer, Lua, UserData, UserDataFields, UserDataMethods, UserDataRef, UserDataRegistry,
    Value, ffi,
};
use pdk_sdk::ops::{Frame, FrameBuf, FrameMut, blend, color, draw, gaussian, noise, point, resize};

use super::api::{ApiClass, ApiMethod, ApiProperty};
use super::arguments::{number, within, wrong};
use super::failure::is_memory;
use super::random::LuaRandom;

/// The largest width and height of an image that a script can make.
const LARGEST_SIDE: f64 = 16_384.0;
/// The largest kernel of a blur, in pixels.
const LARGEST_KERNEL: f64 = 1_023.0;

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

    /// Replaces the pixels by what `kernel` makes of them.
    fn transform(
        &mut self,
        lua: &Lua,
        kernel: impl FnOnce(Frame<'_>, FrameMut<'_>, &mut gaussian::Workspace),
    ) -> mlua::Result<()> {
        let mut scratch = take_scratch(lua);
        scratch.before.resize(self.width, self.height);
        scratch.before.as_mut().copy_from(self.frame()?);
        kernel(scratch.before.as_ref(), self.frame_mut()?, &mut scratch.gaussian);
        lua.set_app_data(scratch);
        Ok(())
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

/// What the methods keep between calls, one for each virtual machine.
#[derive(Default)]
struct Scratch {
    before: FrameBuf,
    gaussian: gaussian::Workspace,
}

fn take_scratch(lua: &Lua) -> Scratch {
    lua.remove_app_data::<Scratch>().unwrap_or_default()
}

/// What a script can do with an image.
pub const IMAGE: ApiClass<LuaImage> = ApiClass {
    name: "Image",
    doc: "An 8-bit RGB image. Coordinates are in pixels from the upper left corner, which is (0, 0). Methods change \
          the image in place.",
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
    methods: &[
        ApiMethod {
            name: "copy",
            signature: "() -> Image",
            doc: "A new image with the same pixels.",
            add: |class, name| {
                class.add_method(name, |lua, image, ()| {
                    let mut copy = LuaImage::new(lua, image.width, image.height)?;
                    copy.frame_mut()?.copy_from(image.frame()?);
                    Ok(copy)
                });
            },
        },
        ApiMethod {
            name: "resized",
            signature: "(width: number, height: number) -> Image",
            doc: "A new image of another size, interpolated linearly.",
            add: |class, name| {
                class.add_method(name, |lua, image, (width, height): (Value, Value)| {
                    let width = within("image:resized", "width", &width, 1.0, LARGEST_SIDE)?;
                    let height = within("image:resized", "height", &height, 1.0, LARGEST_SIDE)?;
                    let mut other = LuaImage::new(lua, width as usize, height as usize)?;
                    resize::resize_linear(image.frame()?, other.frame_mut()?);
                    Ok(other)
                });
            },
        },
        ApiMethod {
            name: "fill",
            signature: "(red: number, green: number, blue: number) -> ()",
            doc: "Gives all pixels one colour, each part from 0 to 255.",
            add: |class, name| {
                class.add_method_mut(name, |_, image, rgb: Colour| {
                    let rgb = colour("image:fill", &rgb)?;
                    for row in image.frame_mut()?.rows_mut() {
                        row.chunks_exact_mut(3).for_each(|pixel| pixel.copy_from_slice(&rgb));
                    }
                    Ok(())
                });
            },
        },
        ApiMethod {
            name: "blend",
            signature: "(other: Image, weight: number) -> ()",
            doc: "Mixes in another image of the same size: `1 - weight` of this one and `weight` of the other.",
            add: |class, name| {
                class.add_function(name, |lua, (this, other, weight): (AnyUserData, Value, Value)| {
                    let weight = within("image:blend", "weight", &weight, 0.0, 1.0)?;
                    let Some(other) = other_image("image:blend", &this, &other)? else { return Ok(()) };
                    let mut this = this.borrow_mut::<LuaImage>()?;
                    same_size("image:blend", &this, &other)?;
                    let other = other.frame()?;
                    this.transform(lua, |src, dst, _| blend::blend(src, 1.0 - weight, other, dst))
                });
            },
        },
        ApiMethod {
            name: "copy_from",
            signature: "(other: Image) -> ()",
            doc: "Takes over the pixels of another image of the same size.",
            add: |class, name| {
                class.add_function(name, |_, (this, other): (AnyUserData, Value)| {
                    let Some(other) = other_image("image:copy_from", &this, &other)? else { return Ok(()) };
                    let mut this = this.borrow_mut::<LuaImage>()?;
                    same_size("image:copy_from", &this, &other)?;
                    this.frame_mut()?.copy_from(other.frame()?);
                    Ok(())
                });
            },
        },
        ApiMethod {
            name: "blur",
            signature: "(kernel_size: number) -> ()",
            doc: "Gaussian blur with a kernel of that many pixels; an even number counts as the next odd one.",
            add: |class, name| {
                class.add_method_mut(name, |lua, image, size: Value| {
                    let size = within("image:blur", "kernel_size", &size, 1.0, LARGEST_KERNEL)? as usize;
                    image.transform(lua, |src, dst, workspace| {
                        gaussian::gaussian_blur(src, dst, size, workspace)
                    })
                });
            },
        },
        ApiMethod {
            name: "grayscale",
            signature: "() -> ()",
            doc: "Replaces each pixel by its grey, weighted as in ITU-R BT.601.",
            add: |class, name| {
                class.add_method_mut(name, |lua, image, ()| {
                    image.transform(lua, |src, dst, _| color::grayscale(src, dst))
                });
            },
        },
        ApiMethod {
            name: "brightness",
            signature: "(factor: number) -> ()",
            doc: "Multiplies each value by `factor`, rounded and clipped to 0 to 255.",
            add: |class, name| {
                class.add_method_mut(name, |lua, image, factor: Value| {
                    let factor = number("image:brightness", "factor", &factor)?;
                    image.transform(lua, |src, dst, _| point::scale_about(src, dst, 0.0, factor))
                });
            },
        },
        ApiMethod {
            name: "contrast",
            signature: "(factor: number) -> ()",
            doc: "Multiplies the distance of each value from middle grey, 127.5, by `factor`, rounded and clipped to 0 \
                  to 255.",
            add: |class, name| {
                class.add_method_mut(name, |lua, image, factor: Value| {
                    let factor = number("image:contrast", "factor", &factor)?;
                    image.transform(lua, |src, dst, _| point::scale_about(src, dst, 127.5, factor))
                });
            },
        },
        ApiMethod {
            name: "gaussian_noise",
            signature: "(sigma: number, random: Random) -> ()",
            doc: "Adds noise from the normal distribution to each value; `sigma` is its standard deviation as a fraction \
                  of the range of values.",
            add: |class, name| {
                class.add_method_mut(name, |lua, image, (sigma, random): (Value, Value)| {
                    let sigma = within("image:gaussian_noise", "sigma", &sigma, 0.0, 100.0)?;
                    let mut random = match &random {
                        Value::UserData(random) if random.is::<LuaRandom>() => {
                            random.borrow_mut::<LuaRandom>()?
                        }
                        other => {
                            return Err(wrong(
                                "image:gaussian_noise",
                                "random",
                                "a stream such as cx.frame_random",
                                other,
                            ));
                        }
                    };
                    image.transform(lua, |src, dst, _| noise::gaussian_noise(src, dst, sigma, &mut random.0))
                });
            },
        },
        ApiMethod {
            name: "lookup",
            signature: "(values: buffer) -> ()",
            doc: "Replaces each value `v` by the byte at `v` in a buffer of 256 bytes.",
            add: |class, name| {
                class.add_method_mut(name, |lua, image, values: Value| {
                    let Value::Buffer(values) = &values else {
                        return Err(wrong("image:lookup", "values", "a buffer of 256 bytes", &values));
                    };
                    if values.len() != 256 {
                        return Err(mlua::Error::runtime(format!(
                            "image:lookup needs `values` to be a buffer of 256 bytes, but it has {}",
                            values.len()
                        )));
                    }
                    let values = values.read_bytes::<256>(0);
                    image.transform(lua, |src, dst, _| point::lookup(src, dst, &values))
                });
            },
        },
        ApiMethod {
            name: "circle",
            signature: "(x: number, y: number, radius: number, red: number, green: number, blue: number) -> ()",
            doc: "Draws a filled circle.",
            add: |class, name| {
                class.add_method_mut(name, |_, image, (x, y, radius, r, g, b): Six| {
                    let rgb = colour("image:circle", &(r, g, b))?;
                    let x = number("image:circle", "x", &x)?;
                    let y = number("image:circle", "y", &y)?;
                    let radius = number("image:circle", "radius", &radius)?;
                    draw::fill_circle(image.frame_mut()?, x, y, radius, rgb);
                    Ok(())
                });
            },
        },
        ApiMethod {
            name: "rectangle",
            signature: "(x: number, y: number, width: number, height: number, red: number, green: number, \
                        blue: number) -> ()",
            doc: "Draws a filled rectangle with its upper left corner at (x, y), all four rounded to whole pixels.",
            add: |class, name| {
                class.add_method_mut(name, |_, image, (x, y, width, height, r, g, b): Seven| {
                    let rgb = colour("image:rectangle", &(r, g, b))?;
                    let x = pixel("image:rectangle", "x", &x)?;
                    let y = pixel("image:rectangle", "y", &y)?;
                    let width = pixel("image:rectangle", "width", &width)?;
                    let height = pixel("image:rectangle", "height", &height)?;
                    draw::fill_rectangle(image.frame_mut()?, x, y, width, height, rgb);
                    Ok(())
                });
            },
        },
        ApiMethod {
            name: "line",
            signature: "(x0: number, y0: number, x1: number, y1: number, red: number, green: number, \
                        blue: number) -> ()",
            doc: "Draws a line one pixel wide, from and to the pixels that the coordinates round to.",
            add: |class, name| {
                class.add_method_mut(name, |_, image, (x0, y0, x1, y1, r, g, b): Seven| {
                    let rgb = colour("image:line", &(r, g, b))?;
                    let (x0, y0) = (pixel("image:line", "x0", &x0)?, pixel("image:line", "y0", &y0)?);
                    let (x1, y1) = (pixel("image:line", "x1", &x1)?, pixel("image:line", "y1", &y1)?);
                    draw::draw_line(image.frame_mut()?, x0, y0, x1, y1, rgb);
                    Ok(())
                });
            },
        },
    ],
};

impl UserData for LuaImage {
    fn register(registry: &mut UserDataRegistry<Self>) {
        IMAGE.register(registry);
    }
}

type Colour = (Value, Value, Value);
type Six = (Value, Value, Value, Value, Value, Value);
type Seven = (Value, Value, Value, Value, Value, Value, Value);

/// The other image of a method with two; none where it is this one itself.
fn other_image(call: &str, this: &AnyUserData, other: &Value) -> mlua::Result<Option<UserDataRef<LuaImage>>> {
    match other {
        Value::UserData(other) if other.is::<LuaImage>() => {
            Ok(if other == this { None } else { Some(other.borrow()?) })
        }
        _ => Err(wrong(call, "other", "an image", other)),
    }
}

fn same_size(call: &str, this: &LuaImage, other: &LuaImage) -> mlua::Result<()> {
    if (this.width, this.height) == (other.width, other.height) {
        return Ok(());
    }
    Err(mlua::Error::runtime(format!(
        "{call} needs two images of the same size, but they have {}x{} and {}x{} pixels; use image:resized",
        this.width, this.height, other.width, other.height
    )))
}

fn colour(call: &str, (red, green, blue): &Colour) -> mlua::Result<[u8; 3]> {
    let part = |name, value| number(call, name, value).map(|v| v.round_ties_even().clamp(0.0, 255.0) as u8);
    Ok([part("red", red)?, part("green", green)?, part("blue", blue)?])
}

/// A coordinate or length in whole pixels; what lies outside of 32 bits lies outside of every image as well.
fn pixel(call: &str, name: &str, value: &Value) -> mlua::Result<i32> {
    number(call, name, value).map(|v| v.round_ties_even() as i32)
}
