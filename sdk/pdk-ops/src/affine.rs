//! Maps that keep straight lines straight and parallel ones parallel.

/// An affine map of the plane: `x' = a[0] x + a[1] y + a[2]`, `y' = a[3] x + a[4] y + a[5]`, in pixels, `x` to the right
/// and `y` down from the centre of the first pixel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Affine(pub [f64; 6]);

impl Affine {
    /// A shift.
    pub fn translation(right: f64, down: f64) -> Self {
        Self([1.0, 0.0, right, 0.0, 1.0, down])
    }

    /// Each row moves to the right by `factor` times its distance from the first.
    pub fn shear(factor: f64) -> Self {
        Self([1.0, factor, 0.0, 0.0, 1.0, 0.0])
    }

    /// A rotation by `degrees`, counter-clockwise as one looks at it, about the place `(x, y)`.
    pub fn rotation(degrees: f64, x: f64, y: f64) -> Self {
        let radians = degrees * std::f64::consts::PI / 180.0;
        let (cos, sin) = (libm::cos(radians), libm::sin(radians));
        Self([cos, sin, (1.0 - cos) * x - sin * y, -sin, cos, sin * x + (1.0 - cos) * y])
    }

    /// Where it takes a point.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [a, b, c, d, e, f] = self.0;
        [a * x + b * y + c, d * x + e * y + f]
    }

    /// The map back, where there is one.
    pub fn inverse(&self) -> Option<Self> {
        let [a, b, c, d, e, f] = self.0;
        let determinant = a * e - b * d;
        let scale = 1.0 / determinant;
        let (a, b, d, e) = (e * scale, -b * scale, -d * scale, a * scale);
        let back = [a, b, -a * c - b * f, d, e, -d * c - e * f];
        back.iter().all(|number| number.is_finite()).then_some(Self(back))
    }
}
