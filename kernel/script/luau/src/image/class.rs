//! The class of images: its values, and all operations.

use mlua::{MultiValue, UserData, UserDataFields, UserDataMethods, UserDataRegistry};

use super::operation::Operation;
use super::pixels::LuaImage;
use super::{blurs, color, drawing, geometry, noises};
use crate::api::{ApiClass, ApiProperty};
use crate::types::Declare;
use crate::unknown::refuse_unknown;

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
            add: |class, name| class.add_field_method_get(name, |_, image| Ok(image.width())),
        },
        ApiProperty {
            name: "height",
            luau_type: "number",
            doc: "Height in pixels.",
            add: |class, name| class.add_field_method_get(name, |_, image| Ok(image.height())),
        },
        ApiProperty {
            name: "pixels",
            luau_type: "buffer",
            doc: "The pixels: the red, green and blue byte of (x, y) are at (y * width + x) * 3 and the two places \
                  behind. A byte drops fractions and everything outside of 0 to 255 wraps around, so round with + 0.5 \
                  and clip with math.clamp.",
            add: |class, name| class.add_field_method_get(name, |_, image| Ok(image.buffer().clone())),
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
        let values = IMAGE.properties.iter().map(|property| property.name);
        let known = values.chain(operations().map(|operation| operation.name)).map(str::to_owned).collect();
        refuse_unknown(registry, "image", known);
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
