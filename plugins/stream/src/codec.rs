//! A small intra codec: what a frame loses in a compressed stream, and what a bit of it that arrives wrong does.
//!
//! It is built as JPEG and the intra frames of MPEG are: luma and chroma at half the resolution, cosine transform of blocks of 8 x 8,
//! quantisation, runs of zeros and levels in codes of different lengths. A row of macroblocks is a slice, which can be decoded on its own.
//! After an error a decoder reads on at the wrong place until a code is impossible, and hides the rest of the slice.

use pdk_sdk::ops::jpeg::{CHROMA, LUMA};
use pdk_sdk::prelude::*;

/// Rows and columns of a macroblock.
pub const MACROBLOCK: usize = 16;
/// Blocks of a macroblock: four of luma, two of chroma.
const BLOCKS: usize = 6;
/// Coefficients of a block.
const SIZE: usize = 64;
/// The largest level that is coded.
const LARGEST: i32 = 2047;

/// A frame as the stream has it, and what coding and decoding need.
pub struct Codec {
    /// The transform: coefficient u of place x is `basis[u][x]`.
    basis: [[f32; 8]; 8],
    /// The places of coefficients in the order in which they are coded.
    order: [usize; SIZE],
    columns: usize,
    rows: usize,
    /// Y, Cb and Cr, padded to whole macroblocks.
    planes: [Vec<f32>; 3],
    /// The levels of all blocks, macroblock after macroblock, in the order in which they are coded.
    levels: Vec<i16>,
    /// The bits of all slices, one after the other, and where each begins.
    bits: Bits,
    begins: Vec<usize>,
    /// How many macroblocks of each slice could be decoded; none if it has to be read again.
    decoded: Vec<Option<usize>>,
}

/// Bits that are written and read.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    length: usize,
}

impl Bits {
    fn clear(&mut self) {
        self.bytes.clear();
        self.length = 0;
    }

    fn put(&mut self, value: u32, count: u32) {
        for place in (0..count).rev() {
            if self.length.is_multiple_of(8) {
                self.bytes.push(0);
            }
            if value >> place & 1 == 1 {
                self.bytes[self.length / 8] |= 0x80 >> (self.length % 8);
            }
            self.length += 1;
        }
    }

    fn flip(&mut self, place: usize) {
        self.bytes[place / 8] ^= 0x80 >> (place % 8);
    }

    fn at(&self, place: usize) -> u32 {
        u32::from(self.bytes[place / 8] >> (7 - place % 8) & 1)
    }

    /// A whole number in the code of Golomb: as many zeros as its successor has digits behind the first, and these digits.
    fn put_number(&mut self, number: u32) {
        let digits = (number + 1).ilog2();
        self.put(0, digits);
        self.put(number + 1, digits + 1);
    }

    /// Reads such a number from before `end`; none if there is none.
    fn number(&self, place: &mut usize, end: usize) -> Option<u32> {
        let mut digits = 0;
        while *place < end && self.at(*place) == 0 {
            digits += 1;
            *place += 1;
            if digits > 16 {
                return None;
            }
        }
        if *place + digits + 1 > end {
            return None;
        }
        let value = (0..=digits).fold(0, |value, step| value << 1 | self.at(*place + step));
        *place += digits + 1;
        Some(value - 1)
    }
}

/// A level as a number that is not below zero: the small ones first.
fn folded(level: i32) -> u32 {
    if level > 0 { (2 * level - 1) as u32 } else { (-2 * level) as u32 }
}

fn unfolded(number: u32) -> i32 {
    let half = number.div_ceil(2) as i32;
    if number % 2 == 1 { half } else { -half }
}

/// The quantisation of a block of a macroblock.
fn steps(block: usize) -> &'static [u8; SIZE] {
    if block < 4 { &LUMA } else { &CHROMA }
}

impl Codec {
    /// The tables.
    pub fn new() -> Self {
        let basis = std::array::from_fn(|u: usize| {
            std::array::from_fn(|x: usize| {
                let scale = if u == 0 { 0.125f64.sqrt() } else { 0.5 };
                (scale * libm::cos((2 * x + 1) as f64 * u as f64 * std::f64::consts::PI / 16.0)) as f32
            })
        });
        // Along the diagonals, each the other way.
        let mut order: Vec<usize> = (0..SIZE).collect();
        order.sort_by_key(|place| {
            let (row, column) = (place / 8, place % 8);
            let along = if (row + column) % 2 == 0 { column } else { row };
            (row + column, along)
        });
        Self {
            basis,
            order: std::array::from_fn(|place| order[place]),
            columns: 0,
            rows: 0,
            planes: Default::default(),
            levels: Vec::new(),
            bits: Bits::default(),
            begins: Vec::new(),
            decoded: Vec::new(),
        }
    }

    /// Takes a frame apart and codes it, with quantisation steps that are this multiple of those of the annex.
    pub fn encode(&mut self, src: Frame<'_>, coarseness: f32) {
        (self.columns, self.rows) = (src.width().div_ceil(MACROBLOCK), src.height().div_ceil(MACROBLOCK));
        self.split(src);
        self.levels.clear();
        self.levels.resize(self.columns * self.rows * BLOCKS * SIZE, 0);
        for macroblock in 0..self.columns * self.rows {
            for block in 0..BLOCKS {
                let samples = self.samples(macroblock, block);
                let coefficients = self.transformed(&samples);
                let steps = steps(block);
                let start = (macroblock * BLOCKS + block) * SIZE;
                for (level, place) in self.levels[start..][..SIZE].iter_mut().zip(self.order) {
                    let step = (f32::from(steps[place]) * coarseness).max(1.0);
                    *level = (coefficients[place] / step).round() as i16;
                }
            }
        }
        self.bits.clear();
        // So that a stream that is longer than the one before finds room.
        self.bits.bytes.reserve(3 * src.width() * src.height());
        self.begins.clear();
        for row in 0..self.rows {
            self.begins.push(self.bits.length);
            self.write_slice(row);
        }
        self.begins.push(self.bits.length);
        self.decoded.clear();
        self.decoded.resize(self.rows, Some(self.columns));
    }

    /// The number of bits.
    pub fn length(&self) -> usize {
        self.bits.length
    }

    /// Makes a bit arrive wrong.
    pub fn flip(&mut self, place: usize) {
        self.bits.flip(place);
        // The slice that it belongs to has to be read again.
        let slice = self.begins.partition_point(|begin| *begin <= place) - 1;
        self.decoded[slice] = None;
    }

    /// Decodes the slices in which bits are wrong.
    pub fn decode(&mut self) {
        for row in 0..self.rows {
            if self.decoded[row].is_none() {
                self.decoded[row] = Some(self.read_slice(row));
            }
        }
    }

    /// The rows of macroblocks that could not be decoded to their end, with how many macroblocks of each could be.
    pub fn broken(&self) -> impl Iterator<Item = (usize, usize)> {
        let decoded = self.decoded.iter().enumerate();
        decoded
            .filter_map(move |(row, count)| Some((row, (*count)?)).filter(|(_, count)| *count < self.columns))
    }

    /// Writes the frame that the decoder has.
    pub fn write(&mut self, mut dst: FrameMut<'_>, coarseness: f32) {
        for macroblock in 0..self.columns * self.rows {
            for block in 0..BLOCKS {
                let steps = steps(block);
                let start = (macroblock * BLOCKS + block) * SIZE;
                let mut coefficients = [0.0f32; SIZE];
                for (level, place) in self.levels[start..][..SIZE].iter().zip(self.order) {
                    coefficients[place] = f32::from(*level) * (f32::from(steps[place]) * coarseness).max(1.0);
                }
                let samples = self.restored(&coefficients);
                self.put_samples(macroblock, block, &samples);
            }
        }
        let [luma, blue, red] = &self.planes;
        let wide = self.columns * MACROBLOCK;
        for (y, row) in dst.rows_mut().enumerate() {
            for (x, pixel) in row.chunks_exact_mut(3).enumerate() {
                let (l, chroma) = (luma[y * wide + x], y / 2 * (wide / 2) + x / 2);
                let (b, r) = (blue[chroma], red[chroma]);
                let colour = [l + 1.402 * r, l - 0.344_136 * b - 0.714_136 * r, l + 1.772 * b];
                for (to, value) in pixel.iter_mut().zip(colour) {
                    *to = (value + 128.5).clamp(0.0, 255.0) as u8;
                }
            }
        }
    }

    /// Colours as luma and chroma around 0, with the last pixels repeated up to whole macroblocks.
    fn split(&mut self, src: Frame<'_>) {
        let (wide, high) = (self.columns * MACROBLOCK, self.rows * MACROBLOCK);
        for (plane, count) in self.planes.iter_mut().zip([wide * high, wide * high / 4, wide * high / 4]) {
            plane.clear();
            plane.resize(count, 0.0);
        }
        let [luma, blue, red] = &mut self.planes;
        for y in 0..high {
            let row = src.row(y.min(src.height() - 1));
            for x in 0..wide {
                let from = 3 * x.min(src.width() - 1);
                let [r, g, b] = [row[from], row[from + 1], row[from + 2]].map(f32::from);
                luma[y * wide + x] = 0.299 * r + 0.587 * g + 0.114 * b - 128.0;
                let chroma = y / 2 * (wide / 2) + x / 2;
                blue[chroma] += 0.25 * (-0.168_736 * r - 0.331_264 * g + 0.5 * b);
                red[chroma] += 0.25 * (0.5 * r - 0.418_688 * g - 0.081_312 * b);
            }
        }
    }

    /// The plane of a block, its first sample, and the samples in a row of the plane.
    fn place(&self, macroblock: usize, block: usize) -> (usize, usize, usize) {
        let (column, row) = (macroblock % self.columns, macroblock / self.columns);
        let wide = self.columns * MACROBLOCK;
        match block {
            0..4 => {
                let (x, y) = (column * MACROBLOCK + block % 2 * 8, row * MACROBLOCK + block / 2 * 8);
                (0, y * wide + x, wide)
            }
            chroma => (chroma - 3, row * 8 * (wide / 2) + column * 8, wide / 2),
        }
    }

    fn samples(&self, macroblock: usize, block: usize) -> [f32; SIZE] {
        let (plane, start, stride) = self.place(macroblock, block);
        let mut samples = [0.0; SIZE];
        for (row, to) in samples.chunks_exact_mut(8).enumerate() {
            to.copy_from_slice(&self.planes[plane][start + row * stride..][..8]);
        }
        samples
    }

    fn put_samples(&mut self, macroblock: usize, block: usize, samples: &[f32; SIZE]) {
        let (plane, start, stride) = self.place(macroblock, block);
        for (row, from) in samples.chunks_exact(8).enumerate() {
            self.planes[plane][start + row * stride..][..8].copy_from_slice(from);
        }
    }

    fn transformed(&self, samples: &[f32; SIZE]) -> [f32; SIZE] {
        // First along rows, then along columns.
        let mut half = [0.0f32; SIZE];
        for y in 0..8 {
            for x in 0..8 {
                for u in 0..8 {
                    half[y * 8 + u] += samples[y * 8 + x] * self.basis[u][x];
                }
            }
        }
        let mut whole = [0.0f32; SIZE];
        for v in 0..8 {
            for y in 0..8 {
                for u in 0..8 {
                    whole[v * 8 + u] += half[y * 8 + u] * self.basis[v][y];
                }
            }
        }
        whole
    }

    fn restored(&self, coefficients: &[f32; SIZE]) -> [f32; SIZE] {
        let mut half = [0.0f32; SIZE];
        for y in 0..8 {
            for v in 0..8 {
                for u in 0..8 {
                    half[y * 8 + u] += coefficients[v * 8 + u] * self.basis[v][y];
                }
            }
        }
        let mut whole = [0.0f32; SIZE];
        for y in 0..8 {
            for u in 0..8 {
                for x in 0..8 {
                    whole[y * 8 + x] += half[y * 8 + u] * self.basis[u][x];
                }
            }
        }
        whole
    }

    /// Codes the levels of a row of macroblocks: the difference of each first level to that of the block before, then how many zeros come
    /// before each other level, and the level; a run of 0 ends a block, and one more than the zeros stands for a run.
    fn write_slice(&mut self, row: usize) {
        let mut before = [0i32; 3];
        for macroblock in row * self.columns..(row + 1) * self.columns {
            for block in 0..BLOCKS {
                let plane = block.saturating_sub(3);
                let start = (macroblock * BLOCKS + block) * SIZE;
                let first = i32::from(self.levels[start]);
                self.bits.put_number(folded(first - before[plane]));
                before[plane] = first;
                let mut zeros = 0;
                for place in 1..SIZE {
                    match i32::from(self.levels[start + place]) {
                        0 => zeros += 1,
                        level => {
                            self.bits.put_number(zeros + 1);
                            self.bits.put_number(folded(level) - 1);
                            zeros = 0;
                        }
                    }
                }
                self.bits.put_number(0);
            }
        }
    }

    /// Decodes a row of macroblocks, up to the first that is impossible; which one that is in the row.
    fn read_slice(&mut self, row: usize) -> usize {
        let (mut place, end) = (self.begins[row], self.begins[row + 1]);
        let mut before = [0i32; 3];
        for column in 0..self.columns {
            for block in 0..BLOCKS {
                let plane = block.saturating_sub(3);
                let Some(levels) = self.read_block(&mut place, end, &mut before[plane]) else {
                    return column;
                };
                let start = ((row * self.columns + column) * BLOCKS + block) * SIZE;
                self.levels[start..][..SIZE].copy_from_slice(&levels);
            }
        }
        self.columns
    }

    fn read_block(&self, place: &mut usize, end: usize, before: &mut i32) -> Option<[i16; SIZE]> {
        let mut levels = [0i16; SIZE];
        let allowed = |level: i32| (-LARGEST..=LARGEST).contains(&level).then_some(level as i16);
        *before += unfolded(self.bits.number(place, end)?);
        levels[0] = allowed(*before)?;
        let mut at = 0;
        loop {
            match self.bits.number(place, end)? {
                0 => return Some(levels),
                run => {
                    at += run as usize;
                    *levels.get_mut(at)? = allowed(unfolded(self.bits.number(place, end)?.checked_add(1)?))?;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture() -> FrameBuf {
        let mut frame = FrameBuf::new(50, 37);
        for y in 0..37 {
            for x in 0..50 {
                let wave = 60.0 * libm::sin(x as f64 / 5.0) * libm::cos(y as f64 / 7.0);
                frame.as_mut().set_pixel(
                    x,
                    y,
                    [(128.0 + wave) as u8, (100 + 2 * y) as u8, (40 + 3 * x) as u8],
                );
            }
        }
        frame
    }

    #[test]
    fn numbers_and_levels_come_back() {
        let mut bits = Bits::default();
        let numbers = [0, 1, 2, 3, 7, 8, 100, 4095, 65_534];
        numbers.iter().for_each(|number| bits.put_number(*number));
        let mut place = 0;
        assert!(numbers.iter().all(|number| bits.number(&mut place, bits.length) == Some(*number)));
        assert_eq!((place, bits.number(&mut place, bits.length)), (bits.length, None));
        assert!((-300..300).all(|level| unfolded(folded(level)) == level));
    }

    #[test]
    fn without_errors_the_frame_is_as_good_as_its_quantisation() {
        let (source, mut codec) = (picture(), Codec::new());
        let error = |codec: &mut Codec, coarseness: f32| {
            codec.encode(source.as_ref(), coarseness);
            // What is read is what was written.
            let levels = codec.levels.clone();
            codec.decoded.fill(None);
            codec.decode();
            assert_eq!(codec.decoded, [Some(4); 3]);
            assert_eq!(codec.levels, levels);
            let mut target = FrameBuf::new(50, 37);
            codec.write(target.as_mut(), coarseness);
            let squares: f64 =
                source.data().iter().zip(target.data()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
            (squares / source.data().len() as f64).sqrt()
        };
        let [fine, usual, coarse] = [0.01, 0.5, 3.0].map(|coarseness| error(&mut codec, coarseness));
        assert!(fine < 3.0 && fine < usual && usual < 8.0 && usual < coarse, "{fine} {usual} {coarse}");
    }

    #[test]
    fn an_error_stays_in_its_slice_and_any_error_is_survived() {
        let (source, mut codec) = (picture(), Codec::new());
        codec.encode(source.as_ref(), 0.5);
        let mut clean = FrameBuf::new(50, 37);
        codec.write(clean.as_mut(), 0.5);
        let (length, begins) = (codec.length(), codec.begins.clone());
        let mut stopped = 0;
        for place in (0..length).step_by(7) {
            codec.encode(source.as_ref(), 0.5);
            codec.flip(place);
            let slice = begins.partition_point(|begin| *begin <= place) - 1;
            codec.decode();
            assert!(codec.broken().all(|(row, count)| row == slice && count < 4));
            stopped += codec.broken().count();
            let mut found = FrameBuf::new(50, 37);
            codec.write(found.as_mut(), 0.5);
            for (y, (row, clean)) in found.as_ref().rows().zip(clean.as_ref().rows()).enumerate() {
                assert!(y / MACROBLOCK == slice || row == clean, "bit {place}, row {y}");
            }
        }
        assert!(stopped * 7 > length / 10, "{stopped} of {}", length / 7);
    }
}
