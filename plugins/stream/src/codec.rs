//! A small intra codec: what a frame loses in a compressed stream, and what a bit of it that arrives wrong does.
//!
//! It is built as JPEG and the intra frames of MPEG are: luma and chroma at half the resolution, cosine transform of blocks of 8 x 8,
//! quantisation, runs of zeros and levels in codes of different lengths. A row of macroblocks is a slice, which can be decoded on its own.
//! After an error a decoder reads on at the wrong place until a code is impossible, and hides the rest of the slice.

use pdk_sdk::ops::jpeg::{LARGEST, LARGEST_SUM, Levels, Quantisation, Workspace, compress, decompress};
use pdk_sdk::prelude::*;

/// Rows and columns of a macroblock.
pub const MACROBLOCK: usize = 16;
/// Blocks of a macroblock: four of luma, two of chroma.
const BLOCKS: usize = 6;
/// Coefficients of a block.
const SIZE: usize = 64;

/// A frame as the stream has it, and what coding and decoding need.
pub struct Codec {
    /// The places of coefficients in the order in which they are coded.
    order: [usize; SIZE],
    /// Of macroblocks.
    columns: usize,
    rows: usize,
    workspace: Workspace,
    levels: Levels,
    /// The bits of all slices, one after the other, and where each begins.
    bits: Bits,
    length: usize,
    begins: Vec<usize>,
    /// How many macroblocks of each slice could be decoded; none if it has to be read again.
    decoded: Vec<Option<usize>>,
}

/// Bits that are written and read.
#[derive(Default)]
struct Bits {
    bytes: Vec<u8>,
    /// The last bits that were written, which are not among the bytes yet, and how many.
    rest: u64,
    pending: u32,
}

/// Bytes that are read at a time.
const WINDOW: usize = size_of::<u64>();

impl Bits {
    fn clear(&mut self) {
        self.bytes.clear();
        (self.rest, self.pending) = (0, 0);
    }

    /// How many bits were written.
    fn length(&self) -> usize {
        self.bytes.len() * 8 + self.pending as usize
    }

    /// Writes the lowest bits of a value, at most 32.
    #[inline(always)]
    fn put(&mut self, value: u64, count: u32) {
        debug_assert!(count <= u32::BITS && value >> count == 0, "{value} in {count} bits");
        self.rest = self.rest << count | value;
        self.pending += count;
        if self.pending >= u32::BITS {
            self.pending -= u32::BITS;
            self.bytes.extend_from_slice(&((self.rest >> self.pending) as u32).to_be_bytes());
        }
    }

    /// Writes what is pending, and room for the window behind it; how many bits there are without that.
    fn finish(&mut self) -> usize {
        let length = self.length();
        self.bytes.extend_from_slice(&((self.rest << (u32::BITS - self.pending)) as u32).to_be_bytes());
        self.bytes.extend([0; WINDOW]);
        length
    }

    fn flip(&mut self, place: usize) {
        self.bytes[place / 8] ^= 0x80 >> (place % 8);
    }

    /// A whole number in the code of Golomb: as many zeros as its successor has digits behind the first, and these digits.
    fn put_number(&mut self, number: u32) {
        let digits = (number + 1).ilog2();
        self.put(u64::from(number + 1), 2 * digits + 1);
    }

    /// Reads such a number from before `end`; none if there is none.
    fn number(&self, place: &mut usize, end: usize) -> Option<u32> {
        let window = self.bytes.get(*place / 8..)?.first_chunk::<WINDOW>()?;
        let window = u64::from_be_bytes(*window) << (*place % 8);
        let digits = window.leading_zeros();
        let length = 2 * digits + 1;
        if digits > 16 || *place + length as usize > end {
            return None;
        }
        *place += length as usize;
        Some((window >> (u64::BITS - length)) as u32 - 1)
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

/// The plane of a block of a macroblock, and the block in it; none if it lies below the frame.
fn place(levels: &Levels, [row, column]: [usize; 2], block: usize) -> Option<(usize, [usize; 2])> {
    let (plane, place) = match block {
        0..4 => (0, [2 * row + block / 2, 2 * column + block % 2]),
        chroma => (chroma - 3, [row, column]),
    };
    (place[0] < levels.planes[plane].rows()).then_some((plane, place))
}

impl Codec {
    /// The tables.
    pub fn new() -> Self {
        // Along the diagonals, each the other way.
        let mut order: Vec<usize> = (0..SIZE).collect();
        order.sort_by_key(|place| {
            let (row, column) = (place / 8, place % 8);
            let along = if (row + column) % 2 == 0 { column } else { row };
            (row + column, along)
        });
        Self {
            order: std::array::from_fn(|place| order[place]),
            columns: 0,
            rows: 0,
            workspace: Workspace::default(),
            levels: Levels::default(),
            bits: Bits::default(),
            length: 0,
            begins: Vec::new(),
            decoded: Vec::new(),
        }
    }

    /// Takes a frame apart and codes it.
    pub fn encode(&mut self, src: Frame<'_>, quantisation: &Quantisation) {
        (self.columns, self.rows) = (src.width().div_ceil(MACROBLOCK), src.height().div_ceil(MACROBLOCK));
        compress(src, quantisation, &mut self.workspace, &mut self.levels);
        self.bits.clear();
        // So that a stream that is longer than the one before finds room.
        self.bits.bytes.reserve(3 * src.width() * src.height());
        self.begins.clear();
        for row in 0..self.rows {
            self.begins.push(self.bits.length());
            self.write_slice(row);
        }
        self.length = self.bits.finish();
        self.begins.push(self.length);
        self.decoded.clear();
        self.decoded.resize(self.rows, Some(self.columns));
    }

    /// The number of bits.
    pub fn length(&self) -> usize {
        self.length
    }

    /// Makes a bit arrive wrong.
    pub fn flip(&mut self, place: usize) {
        self.bits.flip(place);
        // The slice that it belongs to has to be read again.
        let slice = self.begins.partition_point(|begin| *begin <= place) - 1;
        self.decoded[slice] = None;
    }

    /// Decodes the slices in which bits are wrong.
    pub fn decode(&mut self, quantisation: &Quantisation) {
        for row in 0..self.rows {
            if self.decoded[row].is_none() {
                self.decoded[row] = Some(self.read_slice(row, quantisation));
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
    pub fn write(&mut self, dst: FrameMut<'_>, quantisation: &Quantisation) {
        decompress(&self.levels, quantisation, &mut self.workspace, dst);
    }

    /// Codes the levels of a row of macroblocks: the difference of each first level to that of the block before, then how many zeros come
    /// before each other level, and the level; a run of 0 ends a block, and one more than the zeros stands for a run.
    fn write_slice(&mut self, row: usize) {
        let mut before = [0i32; 3];
        for column in 0..self.columns {
            for block in 0..BLOCKS {
                let Some((plane, place)) = place(&self.levels, [row, column], block) else { continue };
                let levels = self.levels.planes[plane].block(place, &self.order);
                let first = i32::from(levels[0]);
                self.bits.put_number(folded(first - before[plane]));
                before[plane] = first;
                // Which of the others are not 0.
                let mut set =
                    levels.iter().rev().fold(0u64, |set, level| set << 1 | u64::from(*level != 0)) & !1;
                let mut last = 0;
                while set != 0 {
                    let at = set.trailing_zeros();
                    self.bits.put_number(at - last);
                    self.bits.put_number(folded(i32::from(levels[at as usize])) - 1);
                    (last, set) = (at, set & (set - 1));
                }
                self.bits.put_number(0);
            }
        }
    }

    /// Decodes a row of macroblocks, up to the first that is impossible; which one that is in the row. That and those behind it keep the levels
    /// that were sent, of which the rows beside them get a trace of colour.
    fn read_slice(&mut self, row: usize, quantisation: &Quantisation) -> usize {
        let (mut bit, end) = (self.begins[row], self.begins[row + 1]);
        let mut before = [0i32; 3];
        for column in 0..self.columns {
            for block in 0..BLOCKS {
                let Some((plane, place)) = place(&self.levels, [row, column], block) else { continue };
                let steps = quantisation.steps(plane);
                let Some(levels) = self.read_block(&mut bit, end, &mut before[plane], steps) else {
                    return column;
                };
                self.levels.planes[plane].set_block(place, &self.order, &levels);
            }
        }
        self.columns
    }

    /// The levels of a block, in the order in which they are coded; none if no frame can have them.
    fn read_block(
        &self,
        bit: &mut usize,
        end: usize,
        before: &mut i32,
        steps: &[f32; SIZE],
    ) -> Option<[i16; SIZE]> {
        let mut levels = [0i16; SIZE];
        let mut sum = 0;
        let mut allowed = |at: usize, level: i32| {
            let step = steps[*self.order.get(at)?] as i32;
            sum += level.unsigned_abs() * step as u32;
            // A coefficient that is larger than any saturates, as decoders of MPEG have it.
            (sum <= LARGEST_SUM as u32).then_some(level.clamp(-LARGEST / step, LARGEST / step) as i16)
        };
        *before += unfolded(self.bits.number(bit, end)?);
        levels[0] = allowed(0, *before)?;
        let mut at = 0;
        loop {
            match self.bits.number(bit, end)? {
                0 => return Some(levels),
                run => {
                    at += run as usize;
                    let level = unfolded(self.bits.number(bit, end)? + 1);
                    *levels.get_mut(at)? = allowed(at, level)?;
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
        let (length, mut place) = (bits.finish(), 0);
        assert!(numbers.iter().all(|number| bits.number(&mut place, length) == Some(*number)));
        assert_eq!((place, bits.number(&mut place, length)), (length, None));
        assert!((-300..300).all(|level| unfolded(folded(level)) == level));
    }

    #[test]
    fn without_errors_the_frame_is_as_good_as_its_quantisation() {
        let (source, mut codec) = (picture(), Codec::new());
        let error = |codec: &mut Codec, percent: u32| {
            let quantisation = Quantisation::of_percent(percent);
            codec.encode(source.as_ref(), &quantisation);
            // What is read is what was written.
            let levels = codec.levels.clone();
            codec.decoded.fill(None);
            codec.decode(&quantisation);
            assert_eq!(codec.decoded, [Some(4); 3]);
            assert_eq!(codec.levels.planes, levels.planes);
            let mut target = FrameBuf::new(50, 37);
            codec.write(target.as_mut(), &quantisation);
            let squares: f64 =
                source.data().iter().zip(target.data()).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
            (squares / source.data().len() as f64).sqrt()
        };
        let [fine, usual, coarse] = [1, 50, 300].map(|percent| error(&mut codec, percent));
        assert!(fine < 3.0 && fine < usual && usual < 8.0 && usual < coarse, "{fine} {usual} {coarse}");
    }

    #[test]
    fn an_error_stays_in_its_slice_and_any_error_is_survived() {
        let (source, mut codec) = (picture(), Codec::new());
        let quantisation = Quantisation::of_percent(50);
        codec.encode(source.as_ref(), &quantisation);
        let mut clean = FrameBuf::new(50, 37);
        codec.write(clean.as_mut(), &quantisation);
        let (length, begins) = (codec.length(), codec.begins.clone());
        let mut stopped = 0;
        for place in (0..length).step_by(7) {
            codec.encode(source.as_ref(), &quantisation);
            codec.flip(place);
            let slice = begins.partition_point(|begin| *begin <= place) - 1;
            codec.decode(&quantisation);
            assert!(codec.broken().all(|(row, count)| row == slice && count < 4));
            stopped += codec.broken().count();
            let mut found = FrameBuf::new(50, 37);
            codec.write(found.as_mut(), &quantisation);
            // The chroma of the rows beside a slice is interpolated with its own.
            let touched = (slice * MACROBLOCK).saturating_sub(1)..=(slice + 1) * MACROBLOCK;
            for (y, (row, clean)) in found.as_ref().rows().zip(clean.as_ref().rows()).enumerate() {
                assert!(touched.contains(&y) || row == clean, "bit {place}, row {y}");
            }
        }
        assert!(stopped * 20 > length / 7, "{stopped} of {}", length / 7);
    }
}
