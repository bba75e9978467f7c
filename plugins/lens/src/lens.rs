//! Where things are on the lens, which of them exist, and what the scene behind them looks like out of focus.

use pdk_sdk::prelude::*;

/// A frame wider than this many times its height counts as that much higher, which bounds the work.
const WIDEST: f32 = 4.0;
/// The out-of-focus picture has about this many rows.
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

/// The share of all particles that exists at level 2.
const TYPICAL: f32 = 0.23;

/// How fast a particle of a rank moves, relative to the typical speed. Those that only a high intensity brings are fast: so
/// heavy rain runs faster, and yet no particle changes its speed when the intensity does, which would move all of its path.
/// The mean over the particles of level 2 is 1; over others it goes about with the square root of their share.
pub fn haste(rank: f32) -> f32 {
    (1.5 * (rank / TYPICAL).sqrt()).clamp(0.3, 2.0)
}

/// Adds the parameters that tell how fast particles move, how long they have come, and where.
///
/// `things` is what they are, `typical` their speed and `coming` what they do.
pub fn with_common(description: Description, things: &str, typical: f64, coming: &str) -> Description {
    description
        .follows_attention(&format!(
            "where {things} and those that stay come into being: more where the map is high at that time, fewer elsewhere; then \
             they go on as ever"
        ))
        .parameter(
            Parameter::number(
                "speed",
                typical,
                &format!(
                    "typical speed of {things} at level 2, the same one at all levels: what a higher level adds is faster, and \
                     what is there keeps its speed"
                ),
            )
            .range(0.001, 2.0)
            .unit("frame heights per second"),
        )
        .parameter(
            Parameter::number("since", 60.0, &format!("how long it has been {coming} when the sequence starts"))
                .range(0.0, 60.0)
                .unit("s"),
        )
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
    maps: EarlierMaps<'a>,
    /// The mean of each.
    means: Vec<f32>,
    lens: Lens,
}

/// Most that attention adds at a place, as a factor.
const ATTENTION_GAIN: f32 = 2.0;

impl<'a> Density<'a> {
    /// `share` of all particles exist: those with a rank below it. If there are saliency maps, the one in use when and where a
    /// particle comes into being thins them where it is low and adds some where it is high.
    pub fn new(share: f32, lens: Lens, cx: &Context<'a>) -> Self {
        let maps = cx.earlier;
        if maps.is_empty() {
            return Self { everywhere: share, attention: None };
        }
        let mean = |place| {
            let (_, _, values) = maps.map(place);
            (values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64) as f32
        };
        let means = (0..maps.len()).map(mean).collect();
        Self { everywhere: share, attention: Some(Attention { maps, means, lens }) }
    }

    /// How much of a particle exists, from 0 to 1: all of it while its rank is well below the density at the place and time of
    /// its birth.
    pub fn presence(&self, rank: f32, x: f32, y: f32, born: f64) -> f32 {
        let gain = self.attention.as_ref().map_or(1.0, |attention| attention.gain(x, y, born));
        // What is about to exist grows, so that nothing appears at once when the intensity rises.
        ((self.everywhere * gain - rank) * 100.0).clamp(0.0, 1.0)
    }
}

impl Attention<'_> {
    fn gain(&self, x: f32, y: f32, born: f64) -> f32 {
        let Some(place) = self.maps.place_at(born) else { return 1.0 };
        let (width, height, values) = self.maps.map(place);
        let (px, py) = self.lens.to_pixels(x, y);
        let cell = |at: f32, pixels: usize, cells: usize| {
            ((at + 0.5) / pixels as f32 * cells as f32).clamp(0.0, (cells - 1) as f32) as usize
        };
        let here = values[cell(py, self.lens.height, height) * width + cell(px, self.lens.width, width)];
        // 1 where the map is everywhere the same, 0 where it is 0, never above the gain.
        ATTENTION_GAIN * here / (here + (ATTENTION_GAIN - 1.0) * self.means[place]).max(1e-6)
    }
}

/// The scene, out of focus: means over square blocks of pixels.
#[derive(Default)]
pub struct Backdrop {
    /// Blocks per pixel.
    scale: f32,
    columns: usize,
    rows: usize,
    /// The colour of each block: red in the lowest [`LANE`] bits, green, blue. The last column and row are there twice.
    cells: Vec<u64>,
    sums: Vec<u32>,
}

/// The mean brightness of a scene below which it is darker than by day.
const DUSK: f32 = 60.0;

/// Bits of a channel: a byte times a weight of 12 bits, and one to spare.
const LANE: u32 = 21;
/// Adding this to a number from 0 to 2^16 leaves it, rounded to a 64th, in the lower bits.
const FIXED_POINT: f32 = 131_072.0;

impl Backdrop {
    pub fn update(&mut self, src: Frame<'_>, lens: &Lens) {
        let block = ((lens.unit / BACKDROP_ROWS).round() as usize).max(1);
        self.scale = 1.0 / block as f32;
        (self.columns, self.rows) = (lens.width.div_ceil(block), lens.height.div_ceil(block));
        let line = self.columns + 1;
        self.cells.resize(line * (self.rows + 1), 0);
        self.sums.resize(lens.width * 3, 0);
        for (row, cells) in self.cells.chunks_exact_mut(line).take(self.rows).enumerate() {
            let first = row * block;
            let last = (first + block).min(lens.height);
            self.sums.fill(0);
            for y in first..last {
                for (sum, &value) in self.sums.iter_mut().zip(src.row(y)) {
                    *sum += u32::from(value);
                }
            }
            for (cell, sums) in cells.iter_mut().zip(self.sums.chunks(block * 3)) {
                let mut total = [0u32; 3];
                for sum in sums.chunks_exact(3) {
                    (0..3).for_each(|c| total[c] += sum[c]);
                }
                let count = ((last - first) * (sums.len() / 3)) as u32;
                *cell = pack(total.map(|sum| (sum + count / 2) / count));
            }
            cells[self.columns] = cells[self.columns - 1];
        }
        self.cells.copy_within((self.rows - 1) * line..self.rows * line, self.rows * line);
    }

    /// How much of the light of a day there is, 0 to 1.
    pub fn daylight(&self) -> f32 {
        (self.brightness() / DUSK).min(1.0)
    }

    /// The mean brightness of the scene, 0 to 255.
    pub fn brightness(&self) -> f32 {
        let rows = self.cells.chunks_exact(self.columns + 1).take(self.rows);
        let mut sums = [0u64; 3];
        for cell in rows.flat_map(|row| &row[..self.columns]) {
            (0..3).for_each(|c| sums[c] += cell >> (LANE * c as u32) & 0xff);
        }
        let [red, green, blue] = sums.map(|sum| sum as f32);
        (0.299 * red + 0.587 * green + 0.114 * blue) / (self.columns * self.rows) as f32
    }

    /// The colour at a place in pixels, interpolated; beyond the edge it is the colour of the edge.
    #[inline(always)]
    pub fn at(&self, x: f32, y: f32) -> [f32; 3] {
        let place = |v: f32, count: usize| {
            let v = ((v + 0.5) * self.scale - 0.5).clamp(0.0, (count as i32 - 1) as f32);
            let fixed = (v + FIXED_POINT).to_bits() & 0x7f_ffff;
            ((fixed >> 6) as usize, u64::from(fixed & 63))
        };
        let ((column, across), (row, down)) = (place(x, self.columns), place(y, self.rows));
        let start = row * (self.columns + 1) + column;
        let upper = &self.cells[start..start + 2];
        let lower = &self.cells[start + self.columns + 1..start + self.columns + 3];
        // All three channels at once; the weights sum to 4096.
        let sum = (upper[0] * (64 - across) + upper[1] * across) * (64 - down)
            + (lower[0] * (64 - across) + lower[1] * across) * down;
        [0, 1, 2].map(|c| (sum >> (LANE * c) & ((1 << LANE) - 1)) as i32 as f32 * (1.0 / 4096.0))
    }
}

fn pack([red, green, blue]: [u32; 3]) -> u64 {
    u64::from(red) | u64::from(green) << LANE | u64::from(blue) << (2 * LANE)
}

/// Clips to 0 to 255 and rounds; what is not a number becomes 0.
#[allow(clippy::manual_clamp)] // `clamp` keeps what is not a number
#[inline(always)]
pub fn to_byte(value: f32) -> u8 {
    // The number, rounded half to even, is in the lowest byte of the sum.
    (value.max(0.0).min(255.0) + 8_388_608.0).to_bits() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_backdrop_is_the_mean_of_blocks_with_smooth_transitions() {
        // 120 rows make blocks of 2; the last column of blocks is cut.
        let (width, height) = (161, 120);
        let mut frame = FrameBuf::new(width, height);
        for (x, y) in (0..width * height).map(|i| (i % width, i / width)) {
            frame.as_mut().set_pixel(x, y, [x as u8, y as u8, 200]);
        }
        let lens = Lens::of(frame.as_ref());
        let mut backdrop = Backdrop::default();
        backdrop.update(frame.as_ref(), &lens);
        for (x, y) in [(10.0, 20.0), (33.5, 71.5), (150.25, 3.0)] {
            let [red, green, blue] = backdrop.at(x, y);
            // Means are whole numbers: they are half a level too high here.
            assert!((red - x - 0.5).abs() < 0.02 && (green - y - 0.5).abs() < 0.02 && blue == 200.0);
        }
        assert_eq!(backdrop.at(-900.0, -900.0), [1.0, 1.0, 200.0]);
        assert_eq!(backdrop.at(1e6, 1e6), [160.0, 119.0, 200.0]);
        let mean = 0.299 * 80.0 + 0.587 * 59.5 + 0.114 * 200.0;
        assert!((backdrop.brightness() - mean).abs() < 1.0);
    }

    #[test]
    fn the_mean_speed_grows_with_the_share_that_exists() {
        for (share, mean) in [(0.05, 0.47), (0.23, 1.0), (0.635, 1.57)] {
            let speeds = (0..1000).map(|i| haste(share * (i as f32 + 0.5) / 1000.0));
            assert!((speeds.sum::<f32>() / 1000.0 - mean).abs() < 0.02, "{share}");
        }
        assert!(haste(0.0) > 0.0);
    }

    #[test]
    fn bytes_are_rounded_and_clipped() {
        for (value, byte) in [(-5.0, 0), (0.4, 0), (0.6, 1), (254.6, 255), (300.0, 255), (f32::NAN, 0)] {
            assert_eq!(to_byte(value), byte, "{value}");
        }
    }

    #[test]
    fn places_do_not_depend_on_the_resolution() {
        for (width, height) in [(320, 240), (1280, 960)] {
            let lens = Lens::of(FrameBuf::new(width, height).as_ref());
            let (x, y) = lens.to_pixels(0.25, 0.5);
            assert!(((x + 0.5) / width as f32 - 0.6875).abs() < 1e-6);
            assert!(((y + 0.5) / height as f32 - 0.5).abs() < 1e-6);
        }
        // A very wide frame counts as higher.
        assert_eq!(Lens::of(FrameBuf::new(800, 10).as_ref()).half_width(), 2.0);
    }
}
