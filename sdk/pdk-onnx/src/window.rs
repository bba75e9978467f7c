//! How convolutions and pools move a window over an image.

use pdk_sdk::error::{Error, Result};

use crate::attributes::{int, ints};
use crate::proto::AttributeProto;
use crate::site::Site;
use crate::tensor::{for_each_position, shape_text};

/// The most elements of a kernel: more than any image has pixels, and a damaged file may say anything.
const MOST_TAPS: usize = 1 << 24;

/// The largest stride, dilation or pad. Products of two of them fit an integer.
pub(crate) const LONGEST: i64 = 1 << 30;

/// A window that moves over the spatial axes of an input, with zeros around it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Window {
    /// The length of the input along each axis.
    pub input: Vec<usize>,
    /// The number of places of the window along each axis.
    pub output: Vec<usize>,
    pub kernel: Vec<usize>,
    pub strides: Vec<usize>,
    pub dilations: Vec<usize>,
    /// The number of zeros before the input.
    pub before: Vec<usize>,
    /// The number of zeros behind the input, as declared.
    pub after: Vec<usize>,
}

impl Window {
    /// The window of a convolution or pool over an input of this size.
    pub fn over(site: &Site<'_>, input: &[usize], kernel: &[usize]) -> Result<Self> {
        let mut window = Self::declared(site, input.to_vec(), Vec::new(), kernel)?;
        let auto_pad = site.text("auto_pad", "NOTSET");
        let ceil = site.int("ceil_mode", 0) != 0;
        for (axis, &length) in input.iter().enumerate() {
            let (stride, span) = (window.strides[axis], window.span(axis));
            if matches!(auto_pad, "SAME_UPPER" | "SAME_LOWER") {
                let places = length.div_ceil(stride);
                let total = ((places.max(1) - 1) * stride + span).saturating_sub(length);
                (window.before[axis], window.after[axis]) = shares(total, auto_pad == "SAME_UPPER");
                window.output.push(places);
                continue;
            }
            let padded = window.before[axis] + length + window.after[axis];
            let Some(room) = padded.checked_sub(span) else {
                return Err(Error::new(format!(
                    "its window of {span} is larger than its input of {length} with {} around it",
                    window.before[axis] + window.after[axis]
                )));
            };
            let mut places = if ceil { room.div_ceil(stride) } else { room / stride } + 1;
            // The last window has to begin within the input.
            if ceil && (places - 1) * stride >= length + window.before[axis] {
                places -= 1;
            }
            window.output.push(places);
        }
        Ok(window)
    }

    /// The window of a transposed convolution from an input of this size: its `output` is that input, its `input` what comes
    /// out.
    pub fn under(site: &Site<'_>, input: &[usize], kernel: &[usize]) -> Result<Self> {
        let mut window = Self::declared(site, Vec::new(), input.to_vec(), kernel)?;
        let auto_pad = site.text("auto_pad", "NOTSET");
        let missing = lengths(site, "output_padding", kernel.len(), 0)?;
        let asked = site.ints("output_shape").map(|shape| &shape[shape.len().saturating_sub(kernel.len())..]);
        for axis in 0..kernel.len() {
            let covered = window.extent(axis) + missing[axis];
            let same = matches!(auto_pad, "SAME_UPPER" | "SAME_LOWER");
            let asked = match asked.and_then(|shape| shape.get(axis)) {
                Some(&length) => usize::try_from(length).ok(),
                None if same => Some(input[axis] * window.strides[axis]),
                None => None,
            };
            if let Some(length) = asked {
                let total = covered.saturating_sub(length);
                (window.before[axis], window.after[axis]) = shares(total, auto_pad == "SAME_UPPER");
                window.input.push(length);
                continue;
            }
            let length = covered.checked_sub(window.before[axis] + window.after[axis]);
            window.input.push(length.ok_or_else(|| Error::new("its pads leave nothing of its output"))?);
        }
        Ok(window)
    }

    fn declared(site: &Site<'_>, input: Vec<usize>, output: Vec<usize>, kernel: &[usize]) -> Result<Self> {
        let rank = kernel.len();
        let window = Self {
            input,
            output,
            kernel: kernel.to_vec(),
            strides: lengths(site, "strides", rank, 1)?,
            dilations: lengths(site, "dilations", rank, 1)?,
            before: Vec::new(),
            after: Vec::new(),
        };
        if kernel.iter().chain(&window.strides).chain(&window.dilations).any(|&length| length == 0) {
            return Err(Error::new("its kernel, strides and dilations have to be at least 1"));
        }
        if kernel
            .iter()
            .try_fold(1usize, |taps, &length| taps.checked_mul(length))
            .is_none_or(|taps| taps > MOST_TAPS)
        {
            return Err(Error::new(format!("its kernel {} is too large", shape_text(kernel))));
        }
        let pads = match site.text("auto_pad", "NOTSET") {
            "NOTSET" | "" => lengths(site, "pads", 2 * rank, 0)?,
            _ => vec![0; 2 * rank],
        };
        Ok(Self { before: pads[..rank].to_vec(), after: pads[rank..].to_vec(), ..window })
    }

    /// The length that the kernel covers along an axis.
    fn span(&self, axis: usize) -> usize {
        (self.kernel[axis] - 1) * self.dilations[axis] + 1
    }

    /// The length that all places of the window cover along an axis.
    pub fn extent(&self, axis: usize) -> usize {
        (self.output[axis].max(1) - 1) * self.strides[axis] + self.span(axis)
    }

    /// The number of elements of the kernel.
    pub fn taps(&self) -> usize {
        self.kernel.iter().product()
    }

    /// For each element of the kernel the places in output and input that it joins, as places in row-major order.
    pub fn pairs(&self) -> Vec<Vec<(usize, usize)>> {
        let mut pairs = Vec::with_capacity(self.taps());
        for_each_position(&self.kernel, |tap| {
            let mut joined = Vec::new();
            let mut output = 0;
            for_each_position(&self.output, |place| {
                let mut input = Some(0);
                for axis in 0..place.len() {
                    let at = place[axis] * self.strides[axis] + tap[axis] * self.dilations[axis];
                    let at = at.checked_sub(self.before[axis]).filter(|&at| at < self.input[axis]);
                    input = input.zip(at).map(|(input, at)| input * self.input[axis] + at);
                }
                joined.extend(input.map(|input| (output, input)));
                output += 1;
            });
            pairs.push(joined);
        });
        pairs
    }

    /// The attributes of a convolution with this window and `after` zeros behind the input.
    pub fn attributes(&self, group: usize, after: Vec<usize>) -> Vec<AttributeProto> {
        vec![
            ints("kernel_shape", self.kernel.iter().copied()),
            ints("strides", self.strides.iter().copied()),
            ints("dilations", self.dilations.iter().copied()),
            ints("pads", self.before.iter().copied().chain(after)),
            int("group", group as i64),
        ]
    }
}

/// How padding is shared between before and behind.
fn shares(total: usize, upper: bool) -> (usize, usize) {
    let smaller = total / 2;
    if upper { (smaller, total - smaller) } else { (total - smaller, smaller) }
}

/// An attribute of lengths.
pub(crate) fn lengths(site: &Site<'_>, name: &str, count: usize, default: usize) -> Result<Vec<usize>> {
    let Some(values) = site.ints(name).filter(|values| !values.is_empty()) else {
        return Ok(vec![default; count]);
    };
    if values.len() != count {
        return Err(Error::new(format!("its `{name}` are {values:?}, but have to be {count}")));
    }
    if values.iter().any(|&value| value > LONGEST) {
        return Err(Error::new(format!("its `{name}` are {values:?}, but can be {LONGEST} at most")));
    }
    let lengths = values.iter().map(|&value| usize::try_from(value)).collect::<Result<Vec<_>, _>>();
    lengths.map_err(|_| Error::new(format!("its `{name}` are {values:?}, but cannot be negative here")))
}
