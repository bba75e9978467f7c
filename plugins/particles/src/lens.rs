//! Where things are on the lens, which of them exist, and what the scene behind them looks like out of focus.

use pdk_sdk::prelude::*;

/// A frame wider than so many times its height counts as that much higher, which bounds the work.
const WIDEST: f32 = 4.0;
/// The out-of-focus picture has about so many rows.
const BACKDROP_ROWS: f32 = 60.0;

/// The geometry of a frame. Places on the lens are in heights of the frame: `x` to the right from the middle of the
/// frame, `y` down from its top edge.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lens {
    pub width: usize,
    pub height: usize,
    /// Pixels in one height.
    pub unit: f32,
}

impl Lens {
    pub fn of(frame: Frame<'_>) -> Self {
        let (width, height) = (frame.width(), frame.height());
        Self { width, height, unit: (height as f32).max(width as f32 / WIDEST) }
    }

    /// Half the width of the frame in heights.
    pub fn half_width(&self) -> f32 {
        0.5 * self.width as f32 / self.unit
    }

    /// The place in pixels, where whole numbers are centres of pixels.
    pub fn to_pixels(self, x: f32, y: f32) -> (f32, f32) {
        (x * self.unit + 0.5 * self.width as f32 - 0.5, y * self.unit - 0.5)
    }
}

/// The smooth step from 0 at `t <= 0` to 1 at `t >= 1`.
pub fn smooth(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// The time of the frame, checked.
pub fn time_of(cx: &Context<'_>) -> Result<f64> {
    if cx.time.is_finite() && cx.time.abs() < 1e9 {
        return Ok(cx.time);
    }
    Err(Error::new(format!("the frame's time is {} seconds, but has to be within 1e9 seconds", cx.time)))
}

/// How many particles exist where.
pub struct Density<'a> {
    everywhere: f32,
    attention: Option<Attention<'a>>,
}

struct Attention<'a> {
    map: &'a [f32],
    mean: f32,
    lens: Lens,
}

/// Most that attention adds at a place, as a factor.
const ATTENTION_GAIN: f32 = 2.0;

impl<'a> Density<'a> {
    /// `share` of all particles exist: those with a rank below it. With the parameter `attention` the saliency map of
    /// this frame thins them where it is low and adds some where it is high.
    ///
    /// # Errors
    /// Where attention is asked for and the frame comes with no map.
    pub fn new(share: f32, lens: Lens, cx: &Context<'a>) -> Result<Self> {
        if !cx.boolean("attention") {
            return Ok(Self { everywhere: share, attention: None });
        }
        let map = cx.saliency.filter(|map| map.len() == lens.width * lens.height).ok_or_else(|| {
            Error::new("`attention` needs a saliency map of the frame and there is none: choose a saliency method, or leave `attention` off")
        })?;
        let mean = (map.iter().map(|&v| f64::from(v)).sum::<f64>() / map.len() as f64) as f32;
        Ok(Self { everywhere: share, attention: Some(Attention { map, mean, lens }) })
    }

    /// How much of a particle exists, from 0 to 1: all of it while its rank is well below the density at the place
    /// where it was born.
    pub fn presence(&self, rank: f32, x: f32, y: f32) -> f32 {
        let gain = self.attention.as_ref().map_or(1.0, |attention| attention.gain(x, y));
        // What is about to exist grows, so that nothing appears at once when the intensity rises.
        ((self.everywhere * gain - rank) * 100.0).clamp(0.0, 1.0)
    }
}

impl Attention<'_> {
    fn gain(&self, x: f32, y: f32) -> f32 {
        let (px, py) = self.lens.to_pixels(x, y);
        let column = (px + 0.5).clamp(0.0, (self.lens.width - 1) as f32) as usize;
        let row = (py + 0.5).clamp(0.0, (self.lens.height - 1) as f32) as usize;
        let here = self.map[row * self.lens.width + column];
        // 1 where the map is everywhere the same, 0 where it is 0, never above the gain.
        ATTENTION_GAIN * here / (here + (ATTENTION_GAIN - 1.0) * self.mean).max(1e-6)
    }
}

/// The scene, out of focus: means over square blocks of pixels.
#[derive(Default)]
pub struct Backdrop {
    block: usize,
    columns: usize,
    rows: usize,
    /// Red, green, blue and nothing.
    cells: Vec<[f32; 4]>,
    sums: Vec<u32>,
}

impl Backdrop {
    pub fn update(&mut self, src: Frame<'_>, lens: &Lens) {
        self.block = ((lens.unit / BACKDROP_ROWS).round() as usize).max(1);
        (self.columns, self.rows) = (lens.width.div_ceil(self.block), lens.height.div_ceil(self.block));
        self.cells.resize(self.columns * self.rows, [0.0; 4]);
        self.sums.resize(lens.width * 3, 0);
        for (row, cells) in self.cells.chunks_exact_mut(self.columns).enumerate() {
            let first = row * self.block;
            let last = (first + self.block).min(lens.height);
            self.sums.fill(0);
            for y in first..last {
                for (sum, &value) in self.sums.iter_mut().zip(src.row(y)) {
                    *sum += u32::from(value);
                }
            }
            for (cell, sums) in cells.iter_mut().zip(self.sums.chunks(self.block * 3)) {
                let mut total = [0u32; 3];
                for sum in sums.chunks_exact(3) {
                    (0..3).for_each(|c| total[c] += sum[c]);
                }
                let scale = 1.0 / ((last - first) * (sums.len() / 3)) as f32;
                *cell = [total[0] as f32 * scale, total[1] as f32 * scale, total[2] as f32 * scale, 0.0];
            }
        }
    }

    /// The mean brightness of the scene, 0 to 255.
    pub fn brightness(&self) -> f32 {
        let sum: f32 = self.cells.iter().map(|[r, g, b, _]| 0.299 * r + 0.587 * g + 0.114 * b).sum();
        sum / self.cells.len() as f32
    }

    /// The colour at a place in pixels, interpolated; beyond the edge it is the colour of the edge.
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> [f32; 4] {
        let scale = 1.0 / self.block as f32;
        let place = |v: f32, count: usize| {
            let v = ((v + 0.5) * scale - 0.5).clamp(0.0, (count - 1) as f32);
            let first = (v as usize).min(count.saturating_sub(2));
            (first, v - first as f32)
        };
        let (column, across) = place(x, self.columns);
        let (row, down) = place(y, self.rows);
        let right = usize::from(self.columns > 1);
        let below = if self.rows > 1 { self.columns } else { 0 };
        let start = row * self.columns + column;
        let (a, b) = (self.cells[start], self.cells[start + right]);
        let (c, d) = (self.cells[start + below], self.cells[start + below + right]);
        let mut mixed = [0.0; 4];
        for i in 0..4 {
            let upper = a[i] + (b[i] - a[i]) * across;
            let lower = c[i] + (d[i] - c[i]) * across;
            mixed[i] = upper + (lower - upper) * down;
        }
        mixed
    }
}
