//! Views of 8-bit RGB images: borrowed, mutably borrowed and owned.

use std::fmt;

/// Number of bytes in a pixel: red, green, blue.
pub const CHANNELS: usize = 3;

/// A slice of bytes that cannot hold the image it was said to hold.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FrameError {
    width: usize,
    height: usize,
    stride: usize,
    len: usize,
}

impl From<FrameError> for String {
    fn from(error: FrameError) -> Self {
        error.to_string()
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} bytes cannot hold a {}x{} RGB frame with rows {} bytes apart",
            self.len, self.width, self.height, self.stride
        )
    }
}

impl std::error::Error for FrameError {}

/// The number of bytes a frame of this geometry needs, or `None` where the geometry makes no sense.
fn required_len(width: usize, height: usize, stride: usize) -> Option<usize> {
    let row = width.checked_mul(CHANNELS)?;
    if width == 0 || height == 0 || stride < row {
        return None;
    }
    stride.checked_mul(height - 1)?.checked_add(row)
}

fn check(len: usize, width: usize, height: usize, stride: usize) -> Result<(), FrameError> {
    match required_len(width, height, stride) {
        Some(required) if required <= len => Ok(()),
        _ => Err(FrameError { width, height, stride, len }),
    }
}

/// A read-only 8-bit RGB image: `height` rows of `width` pixels, `stride` bytes from one row to the next.
#[derive(Clone, Copy)]
pub struct Frame<'a> {
    data: &'a [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> Frame<'a> {
    /// A frame whose rows follow each other without a gap.
    ///
    /// # Errors
    /// If the size is zero or `data` is too short.
    pub fn new(data: &'a [u8], width: usize, height: usize) -> Result<Self, FrameError> {
        Self::with_stride(data, width, height, width.saturating_mul(CHANNELS))
    }

    /// A frame whose rows start `stride` bytes apart.
    ///
    /// # Errors
    /// If the size is zero, `stride` is shorter than a row or `data` is too short.
    pub fn with_stride(
        data: &'a [u8],
        width: usize,
        height: usize,
        stride: usize,
    ) -> Result<Self, FrameError> {
        check(data.len(), width, height, stride)?;
        Ok(Self { data, width, height, stride })
    }

    /// Width in pixels, at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels, at least 1.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Bytes from the start of one row to the start of the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The underlying bytes, gaps between rows included.
    pub fn data(&self) -> &'a [u8] {
        self.data
    }

    /// The bytes of row `y`, without the gap behind it.
    pub fn row(&self, y: usize) -> &'a [u8] {
        let start = y * self.stride;
        &self.data[start..start + self.width * CHANNELS]
    }

    /// All rows from top to bottom.
    pub fn rows(&self) -> impl Iterator<Item = &'a [u8]> + '_ {
        (0..self.height).map(|y| self.row(y))
    }

    /// The red, green and blue value of a pixel.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let start = y * self.stride + x * CHANNELS;
        [self.data[start], self.data[start + 1], self.data[start + 2]]
    }

    /// The pixels as one slice, where rows follow each other without a gap.
    pub fn contiguous(&self) -> Option<&'a [u8]> {
        let len = self.width * self.height * CHANNELS;
        (self.stride == self.width * CHANNELS).then(|| &self.data[..len])
    }

    /// An owned copy without gaps.
    pub fn to_buf(&self) -> FrameBuf {
        let mut buf = FrameBuf::new(self.width, self.height);
        buf.as_mut().copy_from(*self);
        buf
    }

    /// Whether both frames have the same width and height.
    pub fn same_size(&self, other: &Frame<'_>) -> bool {
        self.width == other.width && self.height == other.height
    }
}

impl fmt::Debug for Frame<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Frame({}x{}, stride {})", self.width, self.height, self.stride)
    }
}

impl PartialEq for Frame<'_> {
    /// Same size and same pixels; strides may differ.
    fn eq(&self, other: &Self) -> bool {
        self.same_size(other) && self.rows().eq(other.rows())
    }
}

/// A writable 8-bit RGB image, laid out as [`Frame`] is.
pub struct FrameMut<'a> {
    data: &'a mut [u8],
    width: usize,
    height: usize,
    stride: usize,
}

impl<'a> FrameMut<'a> {
    /// A frame whose rows follow each other without a gap.
    ///
    /// # Errors
    /// If the size is zero or `data` is too short.
    pub fn new(data: &'a mut [u8], width: usize, height: usize) -> Result<Self, FrameError> {
        Self::with_stride(data, width, height, width.saturating_mul(CHANNELS))
    }

    /// A frame whose rows start `stride` bytes apart.
    ///
    /// # Errors
    /// If the size is zero, `stride` is shorter than a row or `data` is too short.
    pub fn with_stride(
        data: &'a mut [u8],
        width: usize,
        height: usize,
        stride: usize,
    ) -> Result<Self, FrameError> {
        check(data.len(), width, height, stride)?;
        Ok(Self { data, width, height, stride })
    }

    /// Width in pixels, at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels, at least 1.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Bytes from the start of one row to the start of the next.
    pub fn stride(&self) -> usize {
        self.stride
    }

    /// The underlying bytes, gaps between rows included.
    pub fn data(&self) -> &[u8] {
        self.data
    }

    /// The underlying bytes, gaps between rows included.
    pub fn data_mut(&mut self) -> &mut [u8] {
        self.data
    }

    /// The bytes of row `y`, without the gap behind it.
    pub fn row_mut(&mut self, y: usize) -> &mut [u8] {
        let start = y * self.stride;
        &mut self.data[start..start + self.width * CHANNELS]
    }

    /// All rows from top to bottom.
    pub fn rows_mut(&mut self) -> impl Iterator<Item = &mut [u8]> + '_ {
        let row = self.width * CHANNELS;
        self.data.chunks_mut(self.stride).take(self.height).map(move |chunk| &mut chunk[..row])
    }

    /// Sets a pixel.
    pub fn set_pixel(&mut self, x: usize, y: usize, rgb: [u8; 3]) {
        let start = y * self.stride + x * CHANNELS;
        self.data[start..start + CHANNELS].copy_from_slice(&rgb);
    }

    /// The pixels as one slice, where rows follow each other without a gap.
    pub fn contiguous_mut(&mut self) -> Option<&mut [u8]> {
        let len = self.width * self.height * CHANNELS;
        (self.stride == self.width * CHANNELS).then(|| &mut self.data[..len])
    }

    /// A read-only view.
    pub fn as_ref(&self) -> Frame<'_> {
        Frame { data: self.data, width: self.width, height: self.height, stride: self.stride }
    }

    /// A shorter-lived writable view, to hand on without giving this one away.
    pub fn reborrow(&mut self) -> FrameMut<'_> {
        FrameMut { data: self.data, width: self.width, height: self.height, stride: self.stride }
    }

    /// Copies the pixels of `src`.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn copy_from(&mut self, src: Frame<'_>) {
        assert!(src.same_size(&self.as_ref()), "copy between frames of different size");
        match (src.contiguous(), self.contiguous_mut()) {
            (Some(from), Some(to)) => to.copy_from_slice(from),
            _ => {
                for y in 0..src.height() {
                    self.row_mut(y).copy_from_slice(src.row(y));
                }
            }
        }
    }
}

impl fmt::Debug for FrameMut<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FrameMut({}x{}, stride {})", self.width, self.height, self.stride)
    }
}

/// An owned 8-bit RGB image without gaps between rows.
#[derive(Clone, PartialEq, Eq, Default)]
pub struct FrameBuf {
    data: Vec<u8>,
    width: usize,
    height: usize,
}

impl FrameBuf {
    /// A black frame.
    ///
    /// # Panics
    /// If the width or the height is zero.
    pub fn new(width: usize, height: usize) -> Self {
        assert!(width > 0 && height > 0, "a frame has at least one pixel");
        Self { data: vec![0; width * height * CHANNELS], width, height }
    }

    /// Takes pixels that are already laid out without gaps.
    ///
    /// # Errors
    /// If the size is zero or `data` has another length than `width * height * 3`.
    pub fn from_vec(data: Vec<u8>, width: usize, height: usize) -> Result<Self, FrameError> {
        let stride = width.saturating_mul(CHANNELS);
        check(data.len(), width, height, stride)?;
        if data.len() != stride * height {
            return Err(FrameError { width, height, stride, len: data.len() });
        }
        Ok(Self { data, width, height })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels.
    pub fn data(&self) -> &[u8] {
        &self.data
    }

    /// The pixels.
    pub fn into_vec(self) -> Vec<u8> {
        self.data
    }

    /// A read-only view.
    pub fn as_ref(&self) -> Frame<'_> {
        Frame { data: &self.data, width: self.width, height: self.height, stride: self.width * CHANNELS }
    }

    /// A writable view.
    pub fn as_mut(&mut self) -> FrameMut<'_> {
        FrameMut {
            stride: self.width * CHANNELS,
            data: &mut self.data,
            width: self.width,
            height: self.height,
        }
    }

    /// Gives the frame this size, keeping its memory if it is large enough. The pixels are unspecified.
    ///
    /// # Panics
    /// If the width or the height is zero.
    pub fn resize(&mut self, width: usize, height: usize) {
        assert!(width > 0 && height > 0, "a frame has at least one pixel");
        self.data.resize(width * height * CHANNELS, 0);
        (self.width, self.height) = (width, height);
    }
}

impl fmt::Debug for FrameBuf {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "FrameBuf({}x{})", self.width, self.height)
    }
}

/// Calls `row` with each row of `src` and the same row of `dst`; once with everything where neither has gaps.
///
/// # Panics
/// If the sizes differ.
pub fn for_each_row(src: Frame<'_>, mut dst: FrameMut<'_>, mut row: impl FnMut(&[u8], &mut [u8])) {
    assert!(
        src.same_size(&dst.as_ref()),
        "source is {}x{}, destination {}x{}",
        src.width,
        src.height,
        dst.width,
        dst.height
    );
    match (src.contiguous(), dst.contiguous_mut()) {
        (Some(from), Some(to)) => row(from, to),
        _ => (0..src.height()).for_each(|y| row(src.row(y), dst.row_mut(y))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refuses_bytes_that_cannot_hold_the_frame() {
        assert!(Frame::new(&[0; 11], 2, 2).is_err());
        assert!(Frame::new(&[], 0, 2).is_err());
        assert!(Frame::with_stride(&[0; 100], 4, 2, 11).is_err());
        assert!(Frame::new(&[0; 12], usize::MAX, 2).is_err());
        let message = Frame::new(&[0; 11], 2, 2).unwrap_err().to_string();
        assert_eq!(message, "11 bytes cannot hold a 2x2 RGB frame with rows 6 bytes apart");
    }

    #[test]
    fn rows_skip_the_gap_of_a_stride() {
        let data: Vec<u8> = (0..20).collect();
        // The last row needs no gap behind it.
        let frame = Frame::with_stride(&data[..16], 2, 2, 10).unwrap();
        assert_eq!(frame.row(1), &[10, 11, 12, 13, 14, 15]);
        assert_eq!(frame.pixel(1, 1), [13, 14, 15]);
        assert!(frame.contiguous().is_none());
        assert_eq!(frame.to_buf().data(), &[0, 1, 2, 3, 4, 5, 10, 11, 12, 13, 14, 15]);
    }

    #[test]
    fn rows_mut_visits_every_row_once() {
        let mut data = vec![0u8; 26];
        let mut frame = FrameMut::with_stride(&mut data, 2, 3, 10).unwrap();
        frame.rows_mut().for_each(|row| row.fill(1));
        assert_eq!(data.iter().map(|&v| v as usize).sum::<usize>(), 18);
    }
}
