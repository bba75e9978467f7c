//! Quantised coefficients, and the steps of their quantisation.

use crate::dct::LANES;

/// The quantisation table of Annex K for luma, row by row.
const LUMA: [u8; 64] = [
    16, 11, 10, 16, 24, 40, 51, 61, //
    12, 12, 14, 19, 26, 58, 60, 55, //
    14, 13, 16, 24, 40, 57, 69, 56, //
    14, 17, 22, 29, 51, 87, 80, 62, //
    18, 22, 37, 56, 68, 109, 103, 77, //
    24, 35, 55, 64, 81, 104, 113, 92, //
    49, 64, 78, 87, 103, 121, 120, 101, //
    72, 92, 95, 98, 112, 100, 103, 99,
];
/// The quantisation table of Annex K for chroma, row by row.
const CHROMA: [u8; 64] = [
    17, 18, 24, 47, 99, 99, 99, 99, //
    18, 21, 26, 66, 99, 99, 99, 99, //
    24, 26, 56, 99, 99, 99, 99, 99, //
    47, 66, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99, //
    99, 99, 99, 99, 99, 99, 99, 99,
];

/// The quantised coefficients of luma, Cb and Cr.
#[derive(Debug, Clone, Default)]
pub struct Levels {
    /// Of each plane.
    pub planes: [PlaneLevels; 3],
}

/// The quantised coefficients of a plane.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct PlaneLevels {
    /// Of as many blocks as are transformed at a time, the first coefficients, then the second ones, and so on.
    pub(super) values: Vec<i16>,
    pub(super) columns: usize,
    pub(super) rows: usize,
}

impl PlaneLevels {
    pub(super) fn resize(&mut self, columns: usize, rows: usize) {
        (self.columns, self.rows) = (columns, rows);
        self.values.resize(columns * rows * 64, 0);
    }

    /// How many rows of blocks there are.
    pub const fn rows(&self) -> usize {
        self.rows
    }

    /// The levels of the block in a row and a column, in some order of its coefficients, which are numbered row by row.
    ///
    /// # Panics
    /// If there is no such block or coefficient.
    #[inline]
    pub fn block(&self, block: [usize; 2], order: &[usize; 64]) -> [i16; 64] {
        let (start, lane) = self.place(block);
        let group = &self.values[start..start + 64 * LANES];
        order.map(|coefficient| group[coefficient * LANES + lane])
    }

    /// Changes these levels. The transform has room for coefficients, each the product of its level and its step, of a magnitude of
    /// [`LARGEST`] at most, which add up to at most [`LARGEST_SUM`].
    ///
    /// # Panics
    /// If there is no such block or coefficient.
    #[inline]
    pub fn set_block(&mut self, block: [usize; 2], order: &[usize; 64], levels: &[i16; 64]) {
        let (start, lane) = self.place(block);
        let group = &mut self.values[start..start + 64 * LANES];
        for (coefficient, level) in order.iter().zip(levels) {
            group[coefficient * LANES + lane] = *level;
        }
    }

    /// Where the group of a block begins, and the block's place in it.
    #[inline(always)]
    fn place(&self, [row, column]: [usize; 2]) -> (usize, usize) {
        assert!(row < self.rows && column < self.columns, "no block {column} in row {row}");
        ((row * self.columns + column) / LANES * 64 * LANES, column % LANES)
    }
}

/// No coefficient of a frame has a larger magnitude: 8 times 128 before it is quantised, and half of the largest step more.
pub const LARGEST: i32 = 8 * 128 + 128;
/// No block of a frame has coefficients whose magnitudes add up to more: 64 times 128 before they are quantised, and half of the largest
/// step more for each of them.
pub const LARGEST_SUM: i32 = 64 * 256;

/// The steps of quantisation of luma and of chroma.
#[derive(Debug, Clone)]
pub struct Quantisation {
    pub(super) luma: Table,
    chroma: Table,
}

impl Quantisation {
    /// The tables of Annex K for a quality from 1 (coarsest) to 100; what lies outside counts as the nearest.
    pub fn of_quality(quality: f64) -> Self {
        let quality = quality.clamp(1.0, 100.0);
        // The percentage loses its fraction, as the scaling of the Independent JPEG Group has it.
        Self::of_percent(if quality < 50.0 { 5000.0 / quality } else { 200.0 - 2.0 * quality } as u32)
    }

    /// The tables of Annex K, multiplied with a percentage. Steps are whole numbers from 1 to 255.
    pub fn of_percent(percent: u32) -> Self {
        Self { luma: Table::new(&LUMA, percent), chroma: Table::new(&CHROMA, percent) }
    }

    /// The steps of luma (plane 0) or chroma, row by row.
    pub const fn steps(&self, plane: usize) -> &[f32; 64] {
        &self.table(plane).steps
    }

    pub(super) const fn table(&self, plane: usize) -> &Table {
        if plane == 0 { &self.luma } else { &self.chroma }
    }
}

/// The steps of quantisation, and the reciprocals of those for coefficients times 8.
#[derive(Debug, Clone)]
pub(super) struct Table {
    pub(super) steps: [f32; 64],
    pub(super) reciprocals: [f32; 64],
}

impl Table {
    fn new(base: &[u8; 64], percent: u32) -> Self {
        let steps = base.map(|base| ((u32::from(base) * percent + 50) / 100).clamp(1, 255) as f32);
        Self { steps, reciprocals: steps.map(|step| 1.0 / (8.0 * step)) }
    }
}
