//! The camera: where it is mounted, and how pixels and points of the ground belong together.

/// Height of the camera above the road in metres.
pub const HEIGHT: f64 = 1.35;
/// How far the camera sits ahead of the vehicle's centre, in metres.
pub const AHEAD_OF_CENTRE: f64 = 0.5;
/// The tangent of the angle by which the camera looks down: 8 degrees.
const PITCH_TANGENT: f64 = 0.140_540_834_702_391_45;
/// The tangent of half the horizontal field of view of 75 degrees.
const HALF_VIEW_TANGENT: f64 = 0.767_326_987_978_960_4;

/// A pinhole camera over flat ground, for one frame size.
#[derive(Debug, Clone, Copy)]
pub struct Projection {
    /// Focal length in pixels, both ways.
    pub focal: f64,
    /// Column of the optical axis; columns count from the frame's left edge, so that pixel 0 spans 0 to 1.
    pub centre_x: f64,
    /// Row of the optical axis.
    pub centre_y: f64,
    sine: f64,
    cosine: f64,
}

/// The strip of ground that one row of pixels shows.
#[derive(Debug, Clone, Copy)]
pub struct GroundRow {
    /// Distance ahead of the camera in metres; the same for the whole row.
    pub ahead: f64,
    /// Width of a pixel on the ground in metres.
    pub pixel_width: f64,
    /// Extent of a pixel on the ground along the view direction in metres.
    pub pixel_depth: f64,
}

impl Projection {
    /// The camera for frames of `width` x `height` pixels.
    pub fn new(width: usize, height: usize) -> Self {
        let cosine = 1.0 / (1.0 + PITCH_TANGENT * PITCH_TANGENT).sqrt();
        Self {
            focal: width as f64 / 2.0 / HALF_VIEW_TANGENT,
            centre_x: width as f64 / 2.0,
            centre_y: height as f64 / 2.0,
            sine: PITCH_TANGENT * cosine,
            cosine,
        }
    }

    /// The row of the horizon; it may lie outside the frame.
    pub fn horizon(&self) -> f64 {
        self.centre_y - self.focal * PITCH_TANGENT
    }

    /// The ground that a row shows (`y` is 0.5 in the middle of the first row), or `None` above the horizon.
    pub fn ground(&self, y: f64) -> Option<GroundRow> {
        let v = (y - self.centre_y) / self.focal;
        let down = self.sine + v * self.cosine;
        // Closer to the horizon than a third of a pixel is kilometres away.
        if down * self.focal < 0.3 {
            return None;
        }
        let scale = HEIGHT / down;
        Some(GroundRow {
            ahead: scale * (self.cosine - v * self.sine),
            pixel_width: scale / self.focal,
            pixel_depth: scale / (down * self.focal),
        })
    }

    /// The tangent of the elevation above the horizon that a row shows in its middle column; negative below.
    pub fn elevation(&self, y: f64) -> f64 {
        let v = (y - self.centre_y) / self.focal;
        -(self.sine + v * self.cosine) / (self.cosine - v * self.sine)
    }

    /// Where a point appears: column, row, and pixels a metre there. The point lies `right` and `ahead` of the camera
    /// and `height` above the road. `None` where it is less than half a metre in front of the lens.
    pub fn project(&self, right: f64, ahead: f64, height: f64) -> Option<[f64; 3]> {
        let below = HEIGHT - height;
        let depth = ahead * self.cosine + below * self.sine;
        if depth < 0.5 {
            return None;
        }
        let scale = self.focal / depth;
        let down = below * self.cosine - ahead * self.sine;
        Some([self.centre_x + right * scale, self.centre_y + down * scale, scale])
    }

    /// Distance along the optical axis, in metres, and row of a point `ahead` of the camera and `below` it.
    pub fn depth_and_row(&self, ahead: f64, below: f64) -> (f64, f64) {
        let depth = ahead * self.cosine + below * self.sine;
        (depth, self.centre_y + self.focal * (below * self.cosine - ahead * self.sine) / depth)
    }

    /// The row of the horizon for a vehicle on a slope (rise over run).
    pub fn horizon_on(&self, slope: f64) -> f64 {
        self.depth_and_row(1.0, slope).1
    }

    /// The row on which ground `ahead` metres in front of the camera appears.
    pub fn row_of(&self, ahead: f64) -> f64 {
        let depth = ahead * self.cosine + HEIGHT * self.sine;
        self.centre_y + self.focal * (HEIGHT * self.cosine - ahead * self.sine) / depth
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_and_project_are_inverse() {
        let camera = Projection::new(320, 240);
        for y in [100.5, 150.5, 239.5] {
            let row = camera.ground(y).unwrap();
            let right = (250.5 - camera.centre_x) * row.pixel_width;
            let [x, back, _] = camera.project(right, row.ahead, 0.0).unwrap();
            assert!((x - 250.5).abs() < 1e-9 && (back - y).abs() < 1e-9, "{x} {back}");
            assert!((camera.row_of(row.ahead) - y).abs() < 1e-9);
        }
    }

    #[test]
    fn a_pixel_is_as_deep_as_the_step_to_the_next_row() {
        let camera = Projection::new(320, 240);
        let [above, here, below] = [199.0, 200.0, 201.0].map(|y| camera.ground(y).unwrap());
        let step = (above.ahead - below.ahead) / 2.0;
        assert!((here.pixel_depth / step - 1.0).abs() < 0.01, "{} {step}", here.pixel_depth);
    }

    #[test]
    fn the_horizon_divides_ground_from_sky() {
        let camera = Projection::new(320, 240);
        let horizon = camera.horizon();
        assert!((90.0..92.0).contains(&horizon));
        assert!(camera.ground(horizon - 0.1).is_none());
        assert!(camera.ground(horizon + 1.0).is_some());
        assert!(camera.elevation(horizon).abs() < 1e-12);
        assert!((PITCH_TANGENT - libm::tan(8f64.to_radians())).abs() < 1e-15);
        assert!((HALF_VIEW_TANGENT - libm::tan(37.5f64.to_radians())).abs() < 1e-15);
    }
}
