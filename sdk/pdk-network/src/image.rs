//! The image among a network's inputs: its layout, its size, its stack of frames, its colours and the range of its numbers.

use pdk_sdk::error::{Error, Result};

use crate::color::Color;
use crate::declared::{Element, LAYOUTS, Port};
use crate::described::{Described, Differences};
use crate::numbers::Scale;
use crate::reason::{Reason, because, given};

/// More than any camera has; a damaged file may say anything.
const MAX_SIDE: usize = 16_384;

/// The image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Image {
    /// Its place among the inputs.
    pub place: usize,
    /// The order of its axes.
    pub layout: &'static str,
    /// The shape of its tensor.
    pub shape: Vec<usize>,
    /// Channels of a frame.
    pub channels: usize,
    /// Rows.
    pub height: usize,
    /// Columns.
    pub width: usize,
    /// Frames that it is made of.
    pub frames: usize,
    /// Frames and differences that it holds.
    pub slots: usize,
    /// The type of its numbers.
    pub element: Element,
}

impl Image {
    /// The axis with this letter, if there is one.
    pub fn axis(&self, letter: char) -> Option<usize> {
        self.layout.find(letter)
    }
}

/// Finds layout, size and stack of the image.
pub(crate) fn find_image(
    port: &Port,
    place: usize,
    described: &Described,
    reasons: &mut Vec<Reason>,
) -> Result<Image> {
    let input = Input { port, described, dims: port.dims(), shape: port.shape_text() };
    input.check_element()?;
    input.check_axes()?;
    let layout = input.layout()?;
    let why = given(described, "layout").unwrap_or_else(|| format!("the shape is {}", input.shape));
    because(reasons, "layout", layout, why, false);
    let all_channels = input.axis(layout, 'c').unwrap_or_default();
    let in_time = layout.contains('t');
    let time = in_time.then(|| input.axis(layout, 't'));
    let (frames, slots) = frames(time, described, &input.shape, reasons)?;
    let channels = if in_time { all_channels } else { all_channels / slots };
    let height = input.side(layout, 'h', described.image_size.map(|size| size[1]))?;
    let width = input.side(layout, 'w', described.image_size.map(|size| size[0]))?;
    let why = match input.axis(layout, 'w') {
        Some(_) => "the shape says so".to_owned(),
        None => given(described, "image_size").unwrap_or_default(),
    };
    because(reasons, "size", format!("{width}x{height} pixels"), why, false);
    let tensor = layout.chars().map(|letter| match letter {
        'n' => 1,
        't' => slots,
        'c' => all_channels,
        'h' => height,
        _ => width,
    });
    let shape: Vec<usize> = tensor.collect();
    if shape.iter().try_fold(1usize, |product, dim| product.checked_mul(*dim)).is_none_or(|all| all > 1 << 28)
    {
        return Err(input.wrong(", which is too large"));
    }
    Ok(Image { place, layout, shape, channels, height, width, frames, slots, element: port.element })
}

/// An input that has to be the image, and what is said of it.
struct Input<'a> {
    port: &'a Port,
    described: &'a Described,
    /// The lengths of its axes, if they are fixed.
    dims: Vec<Option<usize>>,
    /// The same as text.
    shape: String,
}

impl Input<'_> {
    fn check_element(&self) -> Result<()> {
        let (Self { described, .. }, Port { name, element, .. }) = (self, self.port);
        if !matches!(element, Element::Float32 | Element::Float16 | Element::Uint8 | Element::Int8) {
            return Err(Error::new(format!(
                "its input `{name}` is {}, but has to be float32, float16, uint8 or int8",
                element.name()
            )));
        }
        match described.dtype.filter(|_| described.element() != Some(*element)) {
            None => Ok(()),
            Some(asked) => Err(described.given.wrong(
                "dtype",
                format_args!(
                    "is {asked}, but the network's input `{name}` is {}; leave it out, or export the network again",
                    element.name()
                ),
            )),
        }
    }

    fn check_axes(&self) -> Result<()> {
        if !(4..=5).contains(&self.dims.len()) {
            return Err(self.wrong(""));
        }
        match self.dims[0] {
            Some(batch) if batch != 1 => Err(self.wrong(", which takes several frames at once")),
            _ => Ok(()),
        }
    }

    fn wrong(&self, what: &str) -> Error {
        let Self { shape, port, .. } = self;
        Error::new(format!(
            "its input `{}` has the shape {shape}{what}, but has to be an image: (1, channels, height, width) or (1, height, width, channels) \
             with 1 or 3 channels, or a stack of such",
            port.name
        ))
    }

    /// The length of an axis, if the layout has it and it is fixed.
    fn axis(&self, layout: &str, letter: char) -> Option<usize> {
        layout.find(letter).and_then(|axis| self.dims[axis])
    }

    /// How many channels there may be, those of all stacked frames together.
    fn channel_counts(&self) -> Vec<usize> {
        let Self { described, dims, .. } = self;
        let slots_of = |frames: usize| frames - usize::from(described.differences == Differences::Only);
        let in_time = dims.len() == 5;
        let stacked = if in_time { 1 } else { described.frames.map_or(1, slots_of) };
        match described.color {
            Some(color) => vec![color.channels() * stacked],
            None => vec![stacked, 3 * stacked],
        }
    }

    /// The order of its axes, as it is described or by the one axis that can be the channels.
    fn layout(&self) -> Result<&'static str> {
        let counts = self.channel_counts();
        let fits = |layout: &str| self.axis(layout, 'c').is_some_and(|length| counts.contains(&length));
        let counted = || counts.iter().map(usize::to_string).collect::<Vec<_>>().join(" or ");
        let (Self { described, dims, shape, .. }, name) = (self, &self.port.name);
        if let Some(layout) = described.layout {
            if layout.len() != dims.len() {
                return Err(described.given.wrong(
                    "layout",
                    format_args!("is {layout}, but the input `{name}` has the shape {shape}; leave it out"),
                ));
            }
            return fits(layout).then_some(layout).ok_or_else(|| {
                described.given.wrong(
                    "layout",
                    format_args!(
                        "is {layout}, but the input `{name}` has the shape {shape}, and its channels would have to be {}; correct `layout`, `color` or `frames`",
                        counted()
                    ),
                )
            });
        }
        let layouts = LAYOUTS.iter().copied().filter(|layout| layout.len() == dims.len());
        match layouts.filter(|layout| fits(layout)).collect::<Vec<_>>().as_slice() {
            [one] => Ok(one),
            [] => Err(self.without_channels(&counted())),
            several => Err(Error::new(format!(
                "its input `{name}` has the shape {shape}, in which the channels may come first or last; set `layout` to {}",
                several.join(" or ")
            ))),
        }
    }

    /// The error of an input in which no axis can be the channels.
    fn without_channels(&self, counts: &str) -> Error {
        let (Self { described, dims, shape, .. }, name) = (self, &self.port.name);
        let said = ["frames", "color"].into_iter().find(|field| described.given.get(field).is_some());
        if let Some(field) = said {
            return described.given.wrong(
                field,
                format_args!(
                    "does not fit the input `{name}` with the shape {shape}: there would have to be {counts} channels; correct `frames` and `color`"
                ),
            );
        }
        let stack = match dims.as_slice() {
            [_, Some(2 | 4..=64), ..] | [.., Some(2 | 4..=64)] => "; if it stacks frames, set `frames`",
            _ => "",
        };
        Error::new(format!("{}{stack}", self.wrong("").message()))
    }

    /// The height or the width: that of the shape, or the one that is described.
    fn side(&self, layout: &str, letter: char, described: Option<usize>) -> Result<usize> {
        let (Self { shape, .. }, name) = (self, &self.port.name);
        match (self.axis(layout, letter), described) {
            (Some(fixed), Some(given)) if fixed != given => Err(self.described.given.wrong(
                "image_size",
                format_args!(
                    "is {:?}, but the input `{name}` has the shape {shape}; leave it out, or export the network with that size",
                    self.described.image_size.unwrap_or_default()
                ),
            )),
            (Some(fixed), _) if fixed > MAX_SIDE => {
                Err(self.wrong(&format!(", larger than {MAX_SIDE} pixels")))
            }
            (Some(fixed), _) if fixed > 0 => Ok(fixed),
            (None, Some(given)) => Ok(given),
            _ => Err(Error::new(format!(
                "its input `{name}` has the shape {shape} without a fixed height and width; set `image_size`, or export the model with the size that \
                 it was trained on"
            ))),
        }
    }
}

/// How many frames the image is made of, and how many of them and their differences it holds.
fn frames(
    axis: Option<Option<usize>>,
    described: &Described,
    shape: &str,
    reasons: &mut Vec<Reason>,
) -> Result<(usize, usize)> {
    let less = usize::from(described.differences == Differences::Only);
    let (frames, why) = match (axis, described.frames) {
        (Some(Some(length)), Some(frames)) if frames - less != length => {
            return Err(described.given.wrong(
                "frames",
                format_args!(
                    "is {frames}, but the image has the shape {shape}; set {} frames",
                    length + less
                ),
            ));
        }
        (Some(Some(length)), None) if (1..=1000).contains(&length) => {
            (length, "the length of axis t".to_owned())
        }
        (Some(_), None) => {
            return Err(Error::new(format!(
                "its image has the shape {shape}, which leaves the number of frames open; set `frames`"
            )));
        }
        (None, None) => (1, String::new()),
        (_, Some(frames)) => (frames, given(described, "frames").unwrap_or_default()),
    };
    if frames > 1 {
        let order = if described.newest_first { "newest" } else { "oldest" };
        because(
            reasons,
            "frames",
            format!("{frames}, {} apart, the {order} first", described.spacing),
            why,
            false,
        );
    }
    Ok((frames, frames - less))
}

/// What the channels of a frame are.
pub(crate) fn color(image: &Image, described: &Described, reasons: &mut Vec<Reason>) -> Result<Color> {
    match (described.color, image.channels) {
        (Some(color), channels) if color.channels() == channels => {
            because(reasons, "color", color.name(), given(described, "color").unwrap_or_default(), false);
            Ok(color)
        }
        (Some(color), channels) => Err(described.given.wrong(
            "color",
            format_args!(
                "is {}, which has {} channels, but a frame of the network has {channels}; correct it",
                color.name(),
                color.channels()
            ),
        )),
        (None, 1) => {
            because(reasons, "color", "grey", "a frame has one channel", false);
            Ok(Color::Grey)
        }
        (None, _) => {
            because(reasons, "color", "rgb", "most networks have it; nothing in the file says it", true);
            Ok(Color::Rgb)
        }
    }
}

/// How bytes become numbers.
pub(crate) fn scale(image: &Image, described: &Described, reasons: &mut Vec<Reason>) -> Result<Scale> {
    let bytes = Scale::Range(0.0, 255.0);
    match (described.scale, image.element) {
        (Some(scale), _) => {
            because(
                reasons,
                "scale",
                scale.to_string(),
                given(described, "scale").unwrap_or_default(),
                false,
            );
            Ok(scale)
        }
        (None, Element::Uint8) => {
            because(reasons, "scale", bytes.to_string(), "the image is of bytes", false);
            Ok(bytes)
        }
        (None, Element::Int8) => Err(Error::new(
            "its image is of int8, and nothing says how bytes from 0 to 255 become these; set `scale` and `mean`, such as scale = \"0..255\" \
             and mean = 128",
        )),
        (None, _) => {
            because(reasons, "scale", bytes.to_string(), "nothing in the file says it", true);
            Ok(bytes)
        }
    }
}
