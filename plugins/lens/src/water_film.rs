//! Water film: water that runs down the glass bends the light on its way to the camera.

use pdk_sdk::ops::sample::{Border, Padded, SUBPIXELS};
use pdk_sdk::prelude::*;

/// Cells of the waves' grid in a height, and texels in a cell.
const CELLS: usize = 8;
const TEXELS: usize = 16;
const SIDE: usize = CELLS * TEXELS;

/// Lets water run down the glass.
#[derive(Default)]
pub struct WaterFilm {
    /// The slope of the film to the right and down, over a tile that repeats, for a key.
    slopes: Vec<[f32; 2]>,
    made_for: Option<Key>,
    padded: Padded,
    /// The slopes of both layers in a row of the frame, between those of the tile.
    rows: [Vec<[f32; 2]>; 2],
    xs: Vec<i32>,
    ys: Vec<i32>,
}

impl Component for WaterFilm {
    fn description() -> Description {
        Description::perturbation(
            "water_film",
            "Lets a film of water run down the glass in front of the camera, whose waves bend what is seen",
        )
        .version(2)
        .family("lens")
        .dynamic()
        .not_default()
        .alters_geometry()
        .mathematics("frame(p + bend H grad(h)(p / H - flow t)), h two layers of waves that run at different speeds")
        .drawn_per_sequence("the waves")
        .source("Refraction by a thin film, of first order in its slope, as in Halimeh and Roser, Raindrop detection on car windshields using geometric-photometric environment construction (2009)")
        .parameter(Parameter::by_level("bend", [0.004, 0.008, 0.016, 0.03, 0.05], "how far the steepest waves bend the light, in heights of the frame").range(0.0, 0.2))
        .parameter(Parameter::number("flow", 0.25, "how fast the film runs down, in heights of the frame a second").range(0.0, 10.0).unit("1/s"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

/// Waves on a grid that repeats: their height at a place in cells.
fn height(grid: &[f64], [x, y]: [f64; 2]) -> f64 {
    let smooth = |t: f64| t * t * t * (t * (6.0 * t - 15.0) + 10.0);
    let (column, row) = (x.floor(), y.floor());
    let (right, down) = (smooth(x - column), smooth(y - row));
    let at =
        |dx: usize, dy: usize| grid[(row as usize + dy) % CELLS * CELLS + (column as usize + dx) % CELLS];
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    mix(mix(at(0, 0), at(1, 0), right), mix(at(0, 1), at(1, 1), right), down)
}

impl WaterFilm {
    fn prepare(&mut self, cx: &Context<'_>) {
        if self.made_for == Some(*cx.key()) {
            return;
        }
        self.made_for = Some(*cx.key());
        let mut random = cx.sequence_random();
        let grid: Vec<f64> = (0..CELLS * CELLS).map(|_| random.unit()).collect();
        let texel = 1.0 / TEXELS as f64;
        // Runs are longer than they are wide, so the slope down is half as steep.
        let slope = |x: usize, y: usize| {
            let place = [x as f64 * texel, y as f64 * texel];
            let beside = |dx: f64, dy: f64| {
                let wrapped = |value: f64| value.rem_euclid(CELLS as f64);
                height(&grid, [wrapped(place[0] + dx), wrapped(place[1] + dy)])
            };
            let right = beside(0.5 * texel, 0.0) - beside(-0.5 * texel, 0.0);
            let down = beside(0.0, 0.5 * texel) - beside(0.0, -0.5 * texel);
            [(right / texel) as f32, (0.5 * down / texel) as f32]
        };
        self.slopes = (0..SIDE * SIDE).map(|place| slope(place % SIDE, place / SIDE)).collect();
        // The steepest has a slope of one.
        let steepest =
            self.slopes.iter().flatten().fold(f32::MIN_POSITIVE, |most, slope| most.max(slope.abs()));
        self.slopes.iter_mut().flatten().for_each(|slope| *slope /= steepest);
    }
}

/// The nearest whole number, halves away from zero: as `round`, but without a call.
#[inline(always)]
fn rounded(value: f32) -> i32 {
    let whole = value as i32;
    let rest = value - whole as f32;
    whole + i32::from(rest >= 0.5) - i32::from(rest <= -0.5)
}

/// Two slopes mixed: the second has this share.
#[inline(always)]
fn mix(one: [f32; 2], other: [f32; 2], share: f32) -> [f32; 2] {
    [one[0] + (other[0] - one[0]) * share, one[1] + (other[1] - one[1]) * share]
}

/// The slopes of a tile in a row that may lie between two of its own, times a weight.
fn between_rows(slopes: &[[f32; 2]], at: f64, weight: f32, into: &mut Vec<[f32; 2]>) {
    let at = at.rem_euclid(SIDE as f64);
    let (row, share) = (at as usize, (at - at.floor()) as f32);
    let [one, other] = [row, row + 1].map(|row| &slopes[row % SIDE * SIDE..][..SIDE]);
    into.clear();
    into.extend(
        one.iter().zip(other).map(|(one, other)| mix(*one, *other, share).map(|slope| weight * slope)),
    );
}

/// The slope at a place of a row that repeats, which may lie between two of its own.
#[inline(always)]
fn between(row: &[[f32; 2]], at: f32) -> [f32; 2] {
    let place = at as usize;
    mix(row[place % SIDE], row[(place + 1) % SIDE], at - place as f32)
}

impl Perturbation for WaterFilm {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.prepare(cx);
        let (width, height) = (src.width(), src.height());
        let bend = (cx.number("bend") * height as f64) as f32;
        self.padded.fill(src, (bend.ceil() as usize + 1).min(height), Border::Mirror);
        // Two layers, of which the second is finer, runs faster, and is half as strong.
        let texels = SIDE as f64 / height as f64;
        let run = cx.number("flow") * cx.time * SIDE as f64;
        let layers = [(1.0, run, 1.0 / 1.5), (1.7, 1.6 * run, 0.5 / 1.5)];
        let layers = layers.map(|(finer, run, weight)| (texels * finer, run.rem_euclid(SIDE as f64), weight));
        for (y, to) in dst.rows_mut().enumerate() {
            self.xs.clear();
            self.ys.clear();
            for (row, (step, run, weight)) in self.rows.iter_mut().zip(layers) {
                between_rows(&self.slopes, y as f64 * step - run, weight as f32, row);
            }
            let steps = layers.map(|(step, ..)| step as f32);
            for x in 0..width {
                let [one, other] = [0, 1].map(|layer| between(&self.rows[layer], x as f32 * steps[layer]));
                let (right, down) = (one[0] + other[0], one[1] + other[1]);
                let place = |whole: usize, bent: f32| {
                    whole as i32 * SUBPIXELS + rounded(bent * bend * SUBPIXELS as f32)
                };
                self.xs.push(place(x, right));
                self.ys.push(place(y, down));
            }
            self.padded.sample(&self.xs, &self.ys, to);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::{Value, json};
    use pdk_sdk::testing::Trial;

    use super::*;

    fn seen(given: &Value, time: f64, source: &FrameBuf) -> FrameBuf {
        let mut trial = Trial::<WaterFilm>::new(given, 2.0, Key([2; 32])).unwrap();
        trial.frame(source, 0, time).unwrap()
    }

    /// A frame whose red grows to the right and whose green grows down, a grey level a pixel.
    fn places() -> FrameBuf {
        let mut frame = FrameBuf::new(200, 150);
        for y in 0..150 {
            for x in 0..200 {
                frame.as_mut().set_pixel(x, y, [x as u8, y as u8, 0]);
            }
        }
        frame
    }

    #[test]
    fn light_is_bent_as_far_as_asked_for_and_no_further() {
        let source = places();
        assert_eq!(seen(&json!({"bend": 0}), 1.0, &source), source);
        let found = seen(&json!({"bend": 0.04}), 1.0, &source);
        let (mut most, mut sum, mut count) = ([0, 0], 0u32, 0u32);
        for y in 10..140 {
            for x in 10..190 {
                let [red, green, _] = found.as_ref().pixel(x, y);
                let bent = [i32::from(red) - x as i32, i32::from(green) - y as i32].map(i32::abs);
                most = [most[0].max(bent[0]), most[1].max(bent[1])];
                sum += (bent[0] + bent[1]) as u32;
                count += 1;
            }
        }
        // 0.04 of 150 pixels.
        assert!(most[0] <= 6 && most[1] <= 6 && most[0] >= 3, "{most:?}");
        assert!(sum > count / 2, "{sum} of {count}");
    }

    #[test]
    fn the_picture_is_bent_smoothly_however_large_it_is() {
        // A frame as high as sixteen texels of the film each, whose red grows by a grey level in four pixels.
        let (width, height) = (1000, 16 * SIDE);
        let mut source = FrameBuf::new(width, height);
        for y in 0..height {
            for x in 0..width {
                source.as_mut().set_pixel(x, y, [(x / 4) as u8, 0, 0]);
            }
        }
        let found = seen(&json!({"bend": 0.02}), 0.3, &source);
        let row = |y: usize| (50..width - 50).map(move |x| (x, y));
        let steps = [100, 777, 1500].into_iter().flat_map(row).map(|(x, y)| {
            let red = |x: usize| i32::from(found.as_ref().pixel(x, y)[0]);
            (red(x + 1) - red(x)).abs()
        });
        assert!(steps.max() <= Some(1), "neighbouring pixels come from neighbouring places");
    }

    #[test]
    fn the_film_runs_down() {
        // A tile is as high as the frame, so the first layer is back after one and the second after five eighths of that.
        let source = places();
        let given = json!({"bend": 0.02, "flow": 0.5});
        let [now, later] = [0.0, 0.4].map(|time| seen(&given, time, &source));
        assert_ne!(now, later);
        // Five times the first is eight times the second.
        assert_eq!(now, seen(&given, 10.0, &source));
    }

    #[test]
    fn the_waves_are_as_smooth_where_the_tile_repeats_as_anywhere() {
        let mut film = WaterFilm::new(&Config::default()).unwrap();
        let key = Key([3; 32]);
        film.prepare(&Context::new(2.0, 0, 0.0, &key));
        let at = |x: usize, y: usize| film.slopes[y % SIDE * SIDE + x % SIDE];
        let step = |a: [f32; 2], b: [f32; 2]| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        let largest = |places: &mut dyn Iterator<Item = f32>| places.fold(0.0, f32::max);
        let inside = largest(&mut (0..SIDE * SIDE).map(|place| {
            let (x, y) = (place % SIDE, place / SIDE);
            if x + 1 < SIDE && y + 1 < SIDE {
                step(at(x, y), at(x + 1, y)).max(step(at(x, y), at(x, y + 1)))
            } else {
                0.0
            }
        }));
        let seam = largest(&mut (0..SIDE).map(|place| {
            step(at(SIDE - 1, place), at(SIDE, place)).max(step(at(place, SIDE - 1), at(place, SIDE)))
        }));
        assert!(seam <= 1.01 * inside && inside < 0.5, "{seam} {inside}");
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<WaterFilm>();
        crate::allocations::on_the_first_frames_alone::<WaterFilm>();
    }
}
