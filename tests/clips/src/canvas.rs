//! What the effects draw on: premultiplied red, green, blue and alpha, 0 to 1, and the shapes they are made of.

/// Width and height of all clips.
pub const SIZE: (usize, usize) = (640, 480);

/// A picture.
#[derive(Clone)]
pub struct Canvas {
    pixels: Vec<[f32; 4]>,
}

/// Red, green and blue, 0 to 1.
pub type Colour = [f32; 3];

impl Canvas {
    /// An empty canvas.
    pub fn new() -> Self {
        Self { pixels: vec![[0.0; 4]; SIZE.0 * SIZE.1] }
    }

    /// The pixels, row by row.
    pub fn pixels(&self) -> &[[f32; 4]] {
        &self.pixels
    }

    /// Makes it the mean of some pictures.
    pub fn mean(&mut self, pictures: &[Canvas]) {
        let share = 1.0 / pictures.len() as f32;
        for (i, pixel) in self.pixels.iter_mut().enumerate() {
            *pixel = [0, 1, 2, 3]
                .map(|c| pictures.iter().map(|picture| picture.pixels[i][c]).sum::<f32>() * share);
        }
    }

    /// Lays a colour over a pixel.
    pub fn over(&mut self, x: usize, y: usize, colour: Colour, alpha: f32) {
        let alpha = alpha.clamp(0.0, 1.0);
        let pixel = &mut self.pixels[y * SIZE.0 + x];
        for (value, colour) in pixel.iter_mut().zip(colour) {
            *value = *value * (1.0 - alpha) + colour * alpha;
        }
        pixel[3] = pixel[3] * (1.0 - alpha) + alpha;
    }

    /// Lays what `shade` gives over all pixels in a rectangle, as far as it lies inside. `shade` gets the centre of a pixel.
    pub fn shade(
        &mut self,
        [left, top, right, bottom]: [f32; 4],
        mut shade: impl FnMut(f32, f32) -> (Colour, f32),
    ) {
        let range = |low: f32, high: f32, size: usize| {
            (low.floor().max(0.0) as usize)..(high.ceil().max(0.0) as usize).min(size)
        };
        for y in range(top, bottom, SIZE.1) {
            for x in range(left, right, SIZE.0) {
                let (colour, alpha) = shade(x as f32 + 0.5, y as f32 + 0.5);
                if alpha > 0.0 {
                    self.over(x, y, colour, alpha);
                }
            }
        }
    }

    /// A disc with an edge that is `soft` pixels wide.
    pub fn disc(&mut self, [cx, cy]: [f32; 2], radius: f32, soft: f32, colour: Colour, alpha: f32) {
        let reach = radius + soft;
        self.shade([cx - reach, cy - reach, cx + reach, cy + reach], |x, y| {
            let distance = ((x - cx) * (x - cx) + (y - cy) * (y - cy)).sqrt();
            (colour, alpha * smooth(radius + soft / 2.0, radius - soft / 2.0, distance))
        });
    }

    /// A line whose ends fade out, as a moving point leaves it behind; `width` is the full width at half its strength.
    pub fn streak(&mut self, [x0, y0]: [f32; 2], [x1, y1]: [f32; 2], width: f32, colour: Colour, alpha: f32) {
        let (dx, dy) = (x1 - x0, y1 - y0);
        let square = (dx * dx + dy * dy).max(1e-6);
        let length = square.sqrt();
        let pad = width * 1.5 + 1.0;
        let bounds = [x0.min(x1) - pad, y0.min(y1) - pad, x0.max(x1) + pad, y0.max(y1) + pad];
        self.shade(bounds, |x, y| {
            let along = ((x - x0) * dx + (y - y0) * dy) / square;
            let across = ((x - x0) * dy - (y - y0) * dx).abs() / length;
            let side = smooth(width, 0.0, across);
            let ends = smooth(0.0, 0.25, along) * smooth(1.0, 0.85, along);
            (colour, alpha * side * ends)
        });
    }

    /// A soft disc that moves from one point to another, as wide as `width` at half its strength.
    pub fn trail(&mut self, from: [f32; 2], to: [f32; 2], width: f32, colour: Colour, alpha: f32) {
        let pad = width + 1.0;
        let bounds = [
            from[0].min(to[0]) - pad,
            from[1].min(to[1]) - pad,
            from[0].max(to[0]) + pad,
            from[1].max(to[1]) + pad,
        ];
        self.shade(bounds, |x, y| (colour, alpha * smooth(width, 0.0, distance([x, y], from, to))));
    }

    /// A line of even strength from point to point: full up to `core` pixels from it, then fading over `halo` pixels.
    pub fn path(&mut self, points: &[[f32; 2]], core: f32, halo: f32, colour: Colour, alpha: f32) {
        let mut bounds = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
        for [x, y] in points {
            bounds = [bounds[0].min(*x), bounds[1].min(*y), bounds[2].max(*x), bounds[3].max(*y)];
        }
        let pad = core + halo;
        self.shade([bounds[0] - pad, bounds[1] - pad, bounds[2] + pad, bounds[3] + pad], |x, y| {
            let distances = points.windows(2).map(|ends| distance([x, y], ends[0], ends[1]));
            let nearest = distances.fold(f32::MAX, f32::min);
            let fall = smooth(core + halo, core, nearest);
            (colour, alpha * fall * fall)
        });
    }

    /// A filled shape with smooth edges; what it encloses more than once is inside.
    pub fn polygon(&mut self, points: &[[f32; 2]], colour: Colour, alpha: f32) {
        const STEPS: usize = 4;
        let mut bounds = [f32::MAX, f32::MAX, f32::MIN, f32::MIN];
        for [x, y] in points {
            bounds = [bounds[0].min(*x), bounds[1].min(*y), bounds[2].max(*x), bounds[3].max(*y)];
        }
        self.shade(bounds, |x, y| {
            let offset = |i: usize| (i as f32 + 0.5) / STEPS as f32 - 0.5;
            let inside = (0..STEPS * STEPS)
                .filter(|i| winding([x + offset(i % STEPS), y + offset(i / STEPS)], points) != 0)
                .count();
            (colour, alpha * inside as f32 / (STEPS * STEPS) as f32)
        });
    }
}

/// From 0 at `from` to 1 at `to`, smoothly, whichever is larger.
pub fn smooth(from: f32, to: f32, value: f32) -> f32 {
    let t = ((value - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn distance([x, y]: [f32; 2], [x0, y0]: [f32; 2], [x1, y1]: [f32; 2]) -> f32 {
    let (dx, dy) = (x1 - x0, y1 - y0);
    let along = (((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy).max(1e-6)).clamp(0.0, 1.0);
    let (dx, dy) = (x - x0 - along * dx, y - y0 - along * dy);
    (dx * dx + dy * dy).sqrt()
}

/// How often a closed line goes round a point.
fn winding([x, y]: [f32; 2], points: &[[f32; 2]]) -> i32 {
    let next = points.iter().cycle().skip(1);
    let crossings = points.iter().zip(next).map(|(&[x0, y0], &[x1, y1])| {
        let side = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0);
        match (y0 <= y, y1 <= y) {
            (true, false) if side > 0.0 => 1,
            (false, true) if side < 0.0 => -1,
            _ => 0,
        }
    });
    crossings.sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_cover_the_area_they_should() {
        let area = |draw: &dyn Fn(&mut Canvas)| {
            let mut canvas = Canvas::new();
            draw(&mut canvas);
            canvas.pixels().iter().map(|pixel| pixel[3]).sum::<f32>()
        };
        let square = [[10.25, 10.25], [30.25, 10.25], [30.25, 40.25], [10.25, 40.25]];
        assert!((area(&|c| c.polygon(&square, [1.0; 3], 1.0)) - 600.0).abs() < 1.0);
        assert!((area(&|c| c.disc([100.0, 100.0], 20.0, 2.0, [1.0; 3], 1.0)) - 1256.6).abs() < 15.0);
        assert_eq!(area(&|c| c.disc([-100.0, 9000.0], 20.0, 2.0, [1.0; 3], 1.0)), 0.0);
    }

    #[test]
    fn colours_are_premultiplied() {
        let mut canvas = Canvas::new();
        canvas.over(1, 0, [1.0, 0.5, 0.0], 0.5);
        assert_eq!(canvas.pixels()[1], [0.5, 0.25, 0.0, 0.5]);
        canvas.over(1, 0, [0.0; 3], 1.0);
        assert_eq!(canvas.pixels()[1], [0.0, 0.0, 0.0, 1.0]);
    }
}
