//! The camera: where it is mounted, and how pixels and points of the ground belong together.

use pdk_sdk::camera::Mounting;

/// How far the camera sits ahead of the vehicle's centre, in metres.
pub const AHEAD_OF_CENTRE: f64 = 0.5;

/// Where the camera is mounted.
pub const MOUNTING: Mounting = Mounting::WINDSCREEN;

/// A pinhole camera over flat ground, for one frame size.
#[derive(Debug, Clone, Copy)]
pub struct Projection {
    /// Focal length in pixels, both ways.
    pub focal: f64,
    /// Column of the optical axis; columns count from the frame's left edge, so that pixel 0 spans 0 to 1.
    pub centre_x: f64,
    /// Row of the optical axis.
    pub centre_y: f64,
    /// Height of the camera above the road in metres.
    pub height: f64,
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
}

impl Projection {
    /// The camera for frames of `width` x `height` pixels.
    pub fn new(width: usize, height: usize, mounting: Mounting) -> Self {
        let pitch_tangent = libm::tan(mounting.pitch.to_radians());
        let cosine = 1.0 / (1.0 + pitch_tangent * pitch_tangent).sqrt();
        Self {
            focal: width as f64 / 2.0 / libm::tan(mounting.field_of_view.to_radians() / 2.0),
            centre_x: width as f64 / 2.0,
            centre_y: height as f64 / 2.0,
            height: mounting.height,
            sine: pitch_tangent * cosine,
            cosine,
        }
    }

    /// The ground that a row shows (`y` is 0.5 in the middle of the first row), or `None` above the horizon.
    pub fn ground(&self, y: f64) -> Option<GroundRow> {
        let v = (y - self.centre_y) / self.focal;
        let down = self.sine + v * self.cosine;
        // Closer to the horizon than a third of a pixel is kilometres away.
        if down * self.focal < 0.3 {
            return None;
        }
        let scale = self.height / down;
        Some(GroundRow { ahead: scale * (self.cosine - v * self.sine), pixel_width: scale / self.focal })
    }

    /// The tangent of the elevation above the horizon that a row shows in its middle column; negative below.
    pub fn elevation(&self, y: f64) -> f64 {
        let v = (y - self.centre_y) / self.focal;
        -(self.sine + v * self.cosine) / (self.cosine - v * self.sine)
    }

    /// Where a point appears: column, row, and pixels a metre there. The point lies `right` and `ahead` of the camera
    /// and `height` above the road. `None` if it is less than half a metre in front of the lens.
    pub fn project(&self, right: f64, ahead: f64, height: f64) -> Option<[f64; 3]> {
        let below = self.height - height;
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

    /// How far ahead the ground lies that is `depth` metres away along the optical axis.
    pub fn ahead_at(&self, depth: f64) -> f64 {
        (depth - self.height * self.sine) / self.cosine
    }

    /// The row of the horizon for a vehicle on a slope (rise over run); it may lie outside the frame.
    pub fn horizon_on(&self, slope: f64) -> f64 {
        self.depth_and_row(1.0, slope).1
    }

    /// The row on which ground `ahead` metres in front of the camera appears.
    pub fn row_of(&self, ahead: f64) -> f64 {
        self.depth_and_row(ahead, self.height).1
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ground_and_project_are_inverse() {
        let camera = Projection::new(320, 240, MOUNTING);
        for y in [100.5, 150.5, 239.5] {
            let row = camera.ground(y).unwrap();
            let right = (250.5 - camera.centre_x) * row.pixel_width;
            let [x, back, _] = camera.project(right, row.ahead, 0.0).unwrap();
            assert!((x - 250.5).abs() < 1e-9 && (back - y).abs() < 1e-9, "{x} {back}");
            assert!((camera.row_of(row.ahead) - y).abs() < 1e-9);
            let (depth, _) = camera.depth_and_row(row.ahead, camera.height);
            assert!((camera.ahead_at(depth) - row.ahead).abs() < 1e-9);
        }
    }

    #[test]
    fn the_horizon_divides_ground_from_sky() {
        let camera = Projection::new(320, 240, MOUNTING);
        let horizon = camera.horizon_on(0.0);
        assert!((90.0..92.0).contains(&horizon));
        assert!(camera.ground(horizon - 0.1).is_none());
        assert!(camera.ground(horizon + 1.0).is_some());
        assert!(camera.elevation(horizon).abs() < 1e-12);
    }

    #[test]
    fn the_mounting_moves_the_horizon_and_the_ground() {
        let camera = |mounting| Projection::new(320, 240, mounting);
        let level = camera(Mounting { pitch: 0.0, ..MOUNTING });
        assert_eq!(level.horizon_on(0.0), 120.0);
        let [low, high] =
            [1.0, 2.0].map(|height| camera(Mounting { height, ..MOUNTING }).ground(200.5).unwrap());
        assert!((high.ahead / low.ahead - 2.0).abs() < 1e-12);
        let [narrow, wide] = [60.0, 90.0].map(|field_of_view| camera(Mounting { field_of_view, ..MOUNTING }));
        assert!((wide.focal - 160.0).abs() < 1e-9 && narrow.focal > wide.focal);
    }
}
