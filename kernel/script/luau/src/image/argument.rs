//! The arguments of operations on images: their types, their documentation, and how what a script gives is checked.

use mlua::{AnyUserData, MultiValue, UserDataRef, UserDataRefMut, Value};
use pdk_sdk::ops::Frame;
use pdk_sdk::ops::perspective::Perspective;
use pdk_sdk::seed::Random;

use super::pixels::LuaImage;
use crate::arguments::{number, within, wrong};
use crate::random::LuaRandom;

/// The largest width and height of an image that a script can make.
pub const LARGEST_SIDE: f64 = 16_384.0;
/// The most arguments an operation can have.
const MOST_ARGUMENTS: usize = 8;
/// How far outside of an image corners may lie, in pixels.
const FARTHEST_CORNER: f64 = 1e6;

/// An argument of an operation.
pub struct Argument {
    /// Its name.
    pub name: &'static str,
    /// What it is, with its unit, as a part of a sentence.
    pub doc: &'static str,
    kind: Kind,
    /// Whether it may be left out.
    optional: bool,
}

enum Kind {
    /// A finite number within a range.
    Number { low: f64, high: f64 },
    /// A part of a colour, rounded and clipped to 0 to 255.
    Shade,
    /// A coordinate or length, rounded to a whole number.
    Pixel,
    /// A list of that many numbers.
    Numbers(usize),
    /// Four corners of a convex quadrilateral, as a list of eight numbers.
    Corners,
    /// A buffer of 256 bytes.
    Bytes,
    /// Another image, of the same size where `same_size` is set.
    Image { same_size: bool },
    /// A stream of random numbers.
    Random,
    /// One of a few texts.
    Choice(&'static [&'static str]),
}

impl Argument {
    const fn new(name: &'static str, kind: Kind, doc: &'static str) -> Self {
        Self { name, doc, kind, optional: false }
    }

    /// A number within a range.
    pub const fn number(name: &'static str, low: f64, high: f64, doc: &'static str) -> Self {
        Self::new(name, Kind::Number { low, high }, doc)
    }

    /// Any finite number.
    pub const fn finite(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Kind::Number { low: f64::MIN, high: f64::MAX }, doc)
    }

    /// A part of a colour.
    pub const fn shade(name: &'static str) -> Self {
        Self::new(name, Kind::Shade, "this part of the colour, 0 to 255, rounded and clipped")
    }

    /// A coordinate or length in whole pixels.
    pub const fn pixel(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Kind::Pixel, doc)
    }

    /// A list of `count` numbers, 8 at most.
    pub const fn numbers(name: &'static str, count: usize, doc: &'static str) -> Self {
        Self::new(name, Kind::Numbers(count), doc)
    }

    /// Four corners.
    pub const fn corners(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Kind::Corners, doc)
    }

    /// A buffer of 256 bytes.
    pub const fn bytes(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Kind::Bytes, doc)
    }

    /// Another image of the same size.
    pub const fn image(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Kind::Image { same_size: true }, doc)
    }

    /// An image of any size.
    pub const fn mask(name: &'static str, doc: &'static str) -> Self {
        Self::new(name, Kind::Image { same_size: false }, doc)
    }

    /// A stream of random numbers.
    pub const fn random() -> Self {
        Self::new("random", Kind::Random, "what it draws from: cx.frame_random or cx.sequence_random")
    }

    /// One of a few texts, the first of which is the default.
    pub const fn choice(name: &'static str, options: &'static [&'static str], doc: &'static str) -> Self {
        Self { name, doc, kind: Kind::Choice(options), optional: true }
    }

    /// The same argument, which may be left out.
    pub const fn optional(self) -> Self {
        Self { optional: true, ..self }
    }

    /// Its type in Luau.
    pub(super) fn luau_type(&self) -> String {
        let mark = if self.optional { "?" } else { "" };
        match &self.kind {
            Kind::Number { .. } | Kind::Shade | Kind::Pixel => format!("number{mark}"),
            Kind::Numbers(_) | Kind::Corners => format!("{{ number }}{mark}"),
            Kind::Bytes => format!("buffer{mark}"),
            Kind::Image { .. } => format!("Image{mark}"),
            Kind::Random => format!("Random{mark}"),
            Kind::Choice(options) => {
                let options: Vec<_> = options.iter().map(|option| format!("\"{option}\"")).collect();
                format!("({}){mark}", options.join(" | "))
            }
        }
    }

    /// What it is, with its range.
    pub(super) fn describe(&self) -> String {
        match self.kind {
            Kind::Number { low, high } if (low, high) != (f64::MIN, f64::MAX) => {
                format!("{}, {low} to {high}", self.doc)
            }
            _ => self.doc.to_owned(),
        }
    }

    /// Checks what a script gives. `this` is the image that the operation works on.
    fn read(&self, call: &str, value: &Value, this: &AnyUserData) -> mlua::Result<Given> {
        let name = self.name;
        if self.optional && value.is_nil() {
            return Ok(Given::Nothing);
        }
        Ok(match self.kind {
            Kind::Number { low: f64::MIN, high: f64::MAX } => Given::Number(number(call, name, value)?),
            Kind::Number { low, high } => Given::Number(within(call, name, value, low, high)?),
            Kind::Shade => Given::Number(number(call, name, value)?.round_ties_even().clamp(0.0, 255.0)),
            Kind::Pixel => Given::Number(number(call, name, value)?.round_ties_even()),
            Kind::Numbers(count) => Given::Numbers(numbers(call, name, value, count, f64::MAX)?),
            Kind::Corners => {
                let corners = numbers(call, name, value, 8, FARTHEST_CORNER)?;
                if Perspective::of_corners(1.0, 1.0, pairs(corners)).is_none() {
                    return Err(mlua::Error::runtime(format!(
                        "{call} needs `{name}` to be the upper left, upper right, lower right and lower left corner of a \
                         convex quadrilateral, {{ x, y, x, y, x, y, x, y }}"
                    )));
                }
                Given::Numbers(corners)
            }
            Kind::Bytes => {
                let Value::Buffer(bytes) = value else {
                    return Err(wrong(call, name, "a buffer of 256 bytes", value));
                };
                if bytes.len() != 256 {
                    return Err(mlua::Error::runtime(format!(
                        "{call} needs `{name}` to be a buffer of 256 bytes, but it has {}",
                        bytes.len()
                    )));
                }
                Given::Bytes(Box::new(bytes.read_bytes::<256>(0)))
            }
            Kind::Image { same_size } => match value {
                Value::UserData(other) if other == this => Given::Same,
                Value::UserData(other) if other.is::<LuaImage>() => {
                    let other = other.borrow::<LuaImage>()?;
                    if same_size {
                        check_size(call, &*this.borrow::<LuaImage>()?, &other)?;
                    }
                    Given::Image(other)
                }
                _ => return Err(wrong(call, name, "an image", value)),
            },
            Kind::Random => match value {
                Value::UserData(random) if random.is::<LuaRandom>() => {
                    Given::Random(random.borrow_mut::<LuaRandom>()?)
                }
                _ => return Err(wrong(call, name, "a stream such as cx.frame_random", value)),
            },
            Kind::Choice(options) => {
                let given = match value {
                    Value::String(text) => text.to_string_lossy(),
                    _ => return Err(wrong(call, name, &format!("one of {}", options.join(", ")), value)),
                };
                match options.iter().position(|option| *option == given) {
                    Some(place) => Given::Number(place as f64),
                    None => {
                        return Err(mlua::Error::runtime(format!(
                            "{call} needs `{name}` to be one of {}, but it is \"{given}\"",
                            options.join(", ")
                        )));
                    }
                }
            }
        })
    }
}

/// A list of `count` numbers of a magnitude of at most `largest`.
fn numbers(call: &str, name: &str, value: &Value, count: usize, largest: f64) -> mlua::Result<[f64; 8]> {
    let expected = || format!("a list of {count} numbers");
    let Value::Table(list) = value else {
        return Err(wrong(call, name, &expected(), value));
    };
    if list.raw_len() != count {
        return Err(mlua::Error::runtime(format!(
            "{call} needs `{name}` to be {}, but it has {}",
            expected(),
            list.raw_len()
        )));
    }
    let mut numbers = [0.0; 8];
    for (index, place) in numbers.iter_mut().enumerate().take(count) {
        let value: Value = list.raw_get(index + 1)?;
        *place = within(call, &format!("{name}[{}]", index + 1), &value, -largest, largest)?;
    }
    Ok(numbers)
}

/// Corners as pairs of coordinates.
pub fn pairs(numbers: [f64; 8]) -> [[f64; 2]; 4] {
    std::array::from_fn(|corner| [numbers[2 * corner], numbers[2 * corner + 1]])
}

fn check_size(call: &str, this: &LuaImage, other: &LuaImage) -> mlua::Result<()> {
    if (this.width(), this.height()) == (other.width(), other.height()) {
        return Ok(());
    }
    Err(mlua::Error::runtime(format!(
        "{call} needs two images of the same size, but they have {}x{} and {}x{} pixels; use image:resized",
        this.width(),
        this.height(),
        other.width(),
        other.height()
    )))
}

/// A checked argument.
#[derive(Default)]
enum Given {
    #[default]
    Nothing,
    Number(f64),
    Numbers([f64; 8]),
    Bytes(Box<[u8; 256]>),
    Random(UserDataRefMut<LuaRandom>),
    Image(UserDataRef<LuaImage>),
    /// The very image that the operation works on.
    Same,
}

/// The checked arguments of a call, by name.
///
/// # Panics
/// All accessors do so where the operation has no such argument of that type, which is a mistake in its table.
pub struct Arguments<'a> {
    arguments: &'a [Argument],
    given: [Given; MOST_ARGUMENTS],
}

impl<'a> Arguments<'a> {
    /// Checks what a script gives to `call`, one value for each argument; those at the end may be missing.
    ///
    /// # Errors
    /// Names the call, the argument and what is allowed.
    pub(super) fn read(
        call: &str,
        arguments: &'a [Argument],
        values: &MultiValue,
        this: &AnyUserData,
    ) -> mlua::Result<Self> {
        let mut given: [Given; MOST_ARGUMENTS] = Default::default();
        for (index, (argument, given)) in arguments.iter().zip(&mut given).enumerate() {
            *given = argument.read(call, values.get(index).unwrap_or(&Value::Nil), this)?;
        }
        if values.iter().skip(arguments.len()).any(|value| !value.is_nil()) {
            let names: Vec<_> = arguments.iter().map(|argument| argument.name).collect();
            return Err(mlua::Error::runtime(format!(
                "{call} takes ({}), but is given more: {} in all",
                names.join(", "),
                values.len()
            )));
        }
        Ok(Self { arguments, given })
    }

    fn place(&self, name: &str) -> usize {
        match self.arguments.iter().position(|argument| argument.name == name) {
            Some(place) => place,
            None => panic!("the operation has no argument `{name}`"),
        }
    }

    /// A number, if it is given.
    pub fn given(&self, name: &str) -> Option<f64> {
        match &self.given[self.place(name)] {
            Given::Nothing => None,
            Given::Number(number) => Some(*number),
            _ => panic!("the argument `{name}` is not a number"),
        }
    }

    /// A number.
    pub fn number(&self, name: &str) -> f64 {
        match self.given(name) {
            Some(number) => number,
            None => panic!("the argument `{name}` may be left out"),
        }
    }

    /// A coordinate or length; what lies outside of 32 bits lies outside of every image as well.
    pub fn pixel(&self, name: &str) -> i32 {
        self.number(name) as i32
    }

    /// The colour that `red`, `green` and `blue` give.
    pub fn rgb(&self) -> [u8; 3] {
        ["red", "green", "blue"].map(|name| self.number(name) as u8)
    }

    /// The place of a choice; 0, that of the default, if it is left out.
    pub fn choice(&self, name: &str) -> usize {
        self.given(name).unwrap_or_default() as usize
    }

    /// A list of numbers; those beyond its length are 0.
    pub fn numbers(&self, name: &str) -> [f64; 8] {
        match &self.given[self.place(name)] {
            Given::Numbers(numbers) => *numbers,
            _ => panic!("the argument `{name}` is not a list of numbers"),
        }
    }

    /// 256 bytes.
    pub fn bytes(&self, name: &str) -> &[u8; 256] {
        match &self.given[self.place(name)] {
            Given::Bytes(bytes) => bytes,
            _ => panic!("the argument `{name}` is not a buffer"),
        }
    }

    /// The random numbers that the operation draws from.
    pub fn random(&mut self) -> &mut Random {
        let place = self.place("random");
        match &mut self.given[place] {
            Given::Random(random) => &mut random.0,
            _ => panic!("the argument `random` is not a stream"),
        }
    }

    /// Another image; none if it is the very one that the operation works on.
    pub fn other(&self, name: &str) -> Option<Frame<'_>> {
        match &self.given[self.place(name)] {
            Given::Same => None,
            Given::Image(image) => match image.frame() {
                Ok(frame) => Some(frame),
                Err(error) => panic!("{error}"),
            },
            _ => panic!("the argument `{name}` is not an image"),
        }
    }
}
