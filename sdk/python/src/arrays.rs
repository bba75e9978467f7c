//! Images as arrays of numpy: height x width x 3 bytes, or a batch of those.

use numpy::{
    AllowTypeChange, PyArray, PyArray2, PyArray3, PyArrayDescrMethods, PyArrayMethods, PyReadonlyArray,
    PyReadonlyArray2, PyReadonlyArray3, PyReadwriteArray, PyUntypedArray, PyUntypedArrayMethods,
};
use pdk_chain::moment::{Labels, Moment};
use pdk_sdk::prelude::{Frame, FrameMut};
use pyo3::prelude::*;

use crate::failure::{mistake, raise};

const CHANNELS: usize = 3;

/// An image, read in place where its pixels lie one behind the other, as also in a window of a larger image; else copied.
pub fn image<'py>(value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArray3<'py, u8>> {
    let py = value.py();
    let array = value.cast::<PyArray3<u8>>().map_err(|_| unfit(value))?;
    if array.shape()[2] != CHANNELS {
        return Err(unfit(value));
    }
    match stride(array) {
        Some(_) => borrowed(array),
        None => borrowed(packed(py, value)?.cast::<PyArray3<u8>>().map_err(|_| unfit(value))?),
    }
}

/// The same array with its values one behind the other.
pub fn packed<'py>(py: Python<'py>, value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    py.import("numpy")?.call_method1("ascontiguousarray", (value,))
}

/// Bytes from one row to the next; none if pixels do not lie one behind the other, or rows in another order.
fn stride(array: &Bound<'_, PyArray3<u8>>) -> Option<usize> {
    let [height, width, _] = [array.shape()[0], array.shape()[1], array.shape()[2]];
    let row = width * CHANNELS;
    let &[down, right, channel] = array.strides() else { return None };
    let in_order = channel == 1 && (width <= 1 || right == CHANNELS as isize);
    match height {
        _ if !in_order => None,
        // Of a single row numpy may say anything.
        0 | 1 => Some(row),
        _ => usize::try_from(down).ok().filter(|down| *down >= row),
    }
}

fn borrowed<'py, T: numpy::Element, D: numpy::ndarray::Dimension>(
    array: &Bound<'py, PyArray<T, D>>,
) -> PyResult<PyReadonlyArray<'py, T, D>> {
    array.try_readonly().map_err(|_| {
        mistake(array.py(), "the image is being written to, as it would be where `out` is the image itself; give another array as `out`")
    })
}

/// The pixels of an image that [`image`] has read.
pub fn frame<'a>(py: Python<'_>, array: &'a PyReadonlyArray3<'_, u8>) -> PyResult<Frame<'a>> {
    let (height, width) = (array.shape()[0], array.shape()[1]);
    let stride = stride(array).unwrap_or(width * CHANNELS);
    let length = if height == 0 { 0 } else { stride * (height - 1) + width * CHANNELS };
    // SAFETY: from its first value to its last an array is one allocation, which the borrow keeps, and `stride` was found to be
    // that of its rows. As for every function of numpy, it is up to the caller not to write to it from another thread.
    let bytes = unsafe { std::slice::from_raw_parts(array.data(), length) };
    Frame::with_stride(bytes, width, height, stride)
        .map_err(|error| raise(py, &pdk_sdk::error::Error::new(error)))
}

/// A new array of this shape, all of which has to be written.
pub fn made<'py, const N: usize>(
    py: Python<'py>,
    shape: [usize; N],
) -> Bound<'py, PyArray<u8, numpy::ndarray::Dim<[usize; N]>>>
where
    numpy::ndarray::Dim<[usize; N]>: numpy::ndarray::Dimension,
    [usize; N]: numpy::ndarray::IntoDimension<Dim = numpy::ndarray::Dim<[usize; N]>>,
{
    // SAFETY: every value of a byte is valid, and all are written before the array is handed out: by the chain, or it is dropped.
    unsafe { PyArray::new(py, shape, false) }
}

/// The array that is to be written to, which has to have this shape, with its values one behind the other.
pub fn target<'py, D: numpy::ndarray::Dimension>(
    out: &Bound<'py, PyAny>,
    shape: &[usize],
) -> PyResult<PyReadwriteArray<'py, u8, D>> {
    let py = out.py();
    let wrong = || {
        mistake(
            py,
            format!(
                "`out` has to be an array of {}, dtype uint8, that can be written to, lies one value behind the other and is not part of \
                 the image; it is {}",
                dimensions(shape),
                described(out)
            ),
        )
    };
    let array = out.cast::<PyArray<u8, D>>().map_err(|_| wrong())?;
    if array.shape() != shape || !array.is_c_contiguous() {
        return Err(wrong());
    }
    array.try_readwrite().map_err(|_| wrong())
}

/// The bytes of an array that was made here or given as `out`.
///
/// # Safety
/// Its values lie one behind the other, and nothing else uses them while the result lives.
pub unsafe fn bytes<'a, D: numpy::ndarray::Dimension>(array: &Bound<'_, PyArray<u8, D>>) -> &'a mut [u8] {
    // SAFETY: as the caller says.
    unsafe { std::slice::from_raw_parts_mut(array.data(), array.len()) }
}

/// A frame of bytes.
pub fn frame_mut<'a>(
    py: Python<'_>,
    bytes: &'a mut [u8],
    width: usize,
    height: usize,
) -> PyResult<FrameMut<'a>> {
    FrameMut::new(bytes, width, height).map_err(|error| raise(py, &pdk_sdk::error::Error::new(error)))
}

/// What pixels show and how far away they are, where the caller knows.
pub struct Known<'py> {
    names: Vec<String>,
    labels: Option<PyReadonlyArray2<'py, u8>>,
    depth: Option<numpy::PyArrayLike2<'py, f32, AllowTypeChange>>,
}

impl<'py> Known<'py> {
    /// Reads them; `shape` is height and width of the image.
    pub fn new(
        py: Python<'py>,
        labels: Option<(Vec<String>, Bound<'py, PyAny>)>,
        depth: Option<Bound<'py, PyAny>>,
        shape: [usize; 2],
    ) -> PyResult<Self> {
        let wrong = |what: &str, of: &str, found: &Bound<'_, PyAny>| {
            mistake(
                py,
                format!(
                    "{what} has to be an array of {}, {of}; it is {}",
                    dimensions(&shape),
                    described(found)
                ),
            )
        };
        let (names, labels) = match labels {
            None => (Vec::new(), None),
            Some((names, pixels)) => {
                let error = || {
                    wrong(
                        "the second part of `labels`",
                        "dtype uint8, the place of a name for each pixel",
                        &pixels,
                    )
                };
                let packed = packed(py, &pixels)?;
                let array = packed.cast::<PyArray2<u8>>().map_err(|_| error())?;
                if array.shape() != shape {
                    return Err(error());
                }
                (names, Some(borrowed(array)?))
            }
        };
        let depth = match depth {
            None => None,
            Some(depth) => {
                let packed = packed(py, &depth)?;
                let array: numpy::PyArrayLike2<'py, f32, AllowTypeChange> =
                    packed.extract().map_err(|_| wrong("`distances`", "distances in metres", &depth))?;
                if array.shape() != shape {
                    return Err(wrong("`distances`", "distances in metres", &depth));
                }
                Some(array)
            }
        };
        Ok(Self { names, labels, depth })
    }

    /// A moment with them.
    pub fn at<'a>(&'a self, moment: Moment<'a>) -> Moment<'a> {
        let pixels = self.labels.as_ref().and_then(|labels| labels.as_slice().ok());
        let labels = pixels.map(|pixels| Labels { names: &self.names, pixels });
        let depth = self.depth.as_ref().and_then(|depth| depth.as_slice().ok());
        moment.with_labels(labels).with_depth(depth)
    }
}

/// The error for something that is not an image, with the remedy.
pub fn unfit(value: &Bound<'_, PyAny>) -> PyErr {
    let remedy = match value.cast::<PyUntypedArray>() {
        Err(_) => "make one with numpy.asarray(image)",
        Ok(array) if !array.dtype().is_equiv_to(&numpy::dtype::<u8>(value.py())) => {
            "convert it, such as with (255 * image).round().astype(numpy.uint8) if its values are from 0 to 1"
        }
        Ok(array) if array.ndim() == 2 => {
            "repeat grey three times: numpy.repeat(image[..., None], 3, axis=2)"
        }
        Ok(array) if array.ndim() == 3 && array.shape()[2] == 4 => {
            "leave its fourth channel out: image[..., :3]"
        }
        Ok(array) if array.ndim() == 3 && array.shape()[0] == CHANNELS => {
            "move its channels to the end: image.transpose(1, 2, 0)"
        }
        Ok(_) => "give it that shape",
    };
    mistake(
        value.py(),
        format!(
            "an image has to be an array of height x width x 3, dtype uint8, RGB, or a batch of such; this is {}: {remedy}",
            described(value)
        ),
    )
}

/// A value in words: shape and type of an array, type of anything else.
fn described(value: &Bound<'_, PyAny>) -> String {
    match value.cast::<PyUntypedArray>() {
        Ok(array) => format!("an array of {}, dtype {}", dimensions(array.shape()), array.dtype()),
        Err(_) => match value.get_type().name() {
            Ok(name) => format!("a {name}"),
            Err(_) => "something else".to_owned(),
        },
    }
}

fn dimensions(shape: &[usize]) -> String {
    shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}
