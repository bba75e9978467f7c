//! Level ground as a camera sees it, and pictures that lie or stand on it.

use pdk_ops::decal::{Decal, Projection};

use crate::camera::Mounting;

impl Mounting {
    /// What it sees of level ground in frames of this width and height.
    pub fn view(&self, [width, height]: [usize; 2]) -> View {
        let pitch = self.pitch.to_radians();
        View {
            focal: width as f64 / 2.0 / libm::tan(self.field_of_view.to_radians() / 2.0),
            size: [width, height],
            sine: libm::sin(pitch),
            cosine: libm::cos(pitch),
            height: self.height,
        }
    }
}

/// What a camera sees of level ground, in frames of one size. Places are in pixels from the upper left corner of the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct View {
    /// The focal length in pixels.
    pub focal: f64,
    size: [usize; 2],
    /// Of the angle by which it looks down.
    sine: f64,
    cosine: f64,
    height: f64,
}

impl View {
    /// Where a place looks: to the right, down and ahead, as the sides of a vector of length 1.
    pub fn direction(&self, place: [f64; 2]) -> [f64; 3] {
        let ([u, v], stretch) = (self.tangents(place), self.stretch(place));
        [u / stretch, (self.sine + v * self.cosine) / stretch, (self.cosine - v * self.sine) / stretch]
    }

    /// The direction of a place, of any length, to the right, down and ahead, as linear functions of the place: what its sides are multiplied by, and what
    /// is added.
    fn rays(&self) -> [[f64; 3]; 3] {
        let [x, y] = self.size.map(|side| -(side as f64) / 2.0 / self.focal);
        let step = 1.0 / self.focal;
        [
            [step, 0.0, x],
            [0.0, step * self.cosine, self.sine + y * self.cosine],
            [0.0, -step * self.sine, self.cosine - y * self.sine],
        ]
    }

    /// How much further away what is seen at a place is than its distance along the optical axis, as a factor.
    pub fn stretch(&self, place: [f64; 2]) -> f64 {
        let [u, v] = self.tangents(place);
        (1.0 + u * u + v * v).sqrt()
    }

    /// A place from the middle, to the right and down, in focal lengths.
    fn tangents(&self, place: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| (place[axis] - self.size[axis] as f64 / 2.0) / self.focal)
    }

    /// Which point of the ground is seen at a place: how far it is to the right of the point below the camera, and ahead of it, in metres. None above the
    /// horizon.
    pub fn ground(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let [right, down, ahead] = self.direction(place);
        (down > 0.0).then(|| [right, ahead].map(|side| side * self.height / down))
    }

    /// Where a point of the ground is seen; none behind the camera.
    pub fn seen(&self, [right, ahead]: [f64; 2]) -> Option<[f64; 2]> {
        self.towards([right, self.height, ahead])
    }

    /// How far away along the optical axis a point is that lies to the right, down and ahead, as simulators give depths.
    fn depth(&self, [_, down, ahead]: [f64; 3]) -> f64 {
        ahead * self.cosine + down * self.sine
    }

    /// Where what lies in a direction is seen, which is to the right, down and ahead, of any length; none behind the camera.
    pub fn towards(&self, [right, down, ahead]: [f64; 3]) -> Option<[f64; 2]> {
        let along = self.depth([right, down, ahead]);
        let below = down * self.cosine - ahead * self.sine;
        let [width, height] = self.size.map(|side| side as f64);
        (along > 0.0)
            .then(|| [width / 2.0 + self.focal * right / along, height / 2.0 + self.focal * below / along])
    }
}

/// A picture on the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placed {
    /// Its width, and its length or height, in metres.
    pub sides: [f64; 2],
    /// How far to the right of the camera its middle is, in metres.
    pub offset: f64,
    /// How far ahead of the camera its middle is, in metres.
    pub ahead: f64,
    /// Whether it lies or stands.
    pub pose: Pose,
}

/// How a picture is put on the road.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pose {
    /// It lies flat, its upper edge away from the camera, and is turned to the right.
    Flat {
        /// In radians.
        turn: f64,
    },
    /// It faces back along the road, such as a sign or the back of a vehicle.
    Upright {
        /// How high above the road its middle is, in metres.
        above: f64,
    },
}

impl Placed {
    /// How a picture of this width and height in pixels is seen.
    pub fn decal(&self, view: &View, picture: [usize; 2]) -> Decal {
        match self.pose {
            Pose::Upright { .. } if self.ahead <= 0.0 => Decal::default(),
            _ => Decal::new(view.size, picture, &self.projection(view)),
        }
    }

    /// Which place of it is seen at a place of the frame.
    fn projection(&self, view: &View) -> Projection {
        let [right, down, ahead] = view.rays();
        // All as multiples of how far below the camera a point of the road is, or how far ahead a point of an upright plane.
        let sum = |parts: &[(f64, [f64; 3])]| {
            [0, 1, 2].map(|at| parts.iter().map(|(factor, function)| factor * function[at]).sum::<f64>())
        };
        let (across, up, depth) = match self.pose {
            Pose::Flat { turn } => {
                let (sine, cosine) = (libm::sin(turn), libm::cos(turn));
                let right = sum(&[(view.height, right), (-self.offset, down)]);
                let ahead = sum(&[(view.height, ahead), (-self.ahead, down)]);
                (sum(&[(cosine, right), (-sine, ahead)]), sum(&[(sine, right), (cosine, ahead)]), down)
            }
            Pose::Upright { above } => (
                sum(&[(self.ahead, right), (-self.offset, ahead)]),
                sum(&[(view.height - above, ahead), (-self.ahead, down)]),
                ahead,
            ),
        };
        let half = |factor: f64, function| sum(&[(factor, function), (0.5, depth)]);
        Projection([half(1.0 / self.sides[0], across), half(-1.0 / self.sides[1], up), depth])
    }

    /// How far away along the optical axis its plane is at a place of the frame, in metres, as simulators give depths; none if the plane is not seen
    /// there.
    pub fn depth(&self, view: &View, place: [f64; 2]) -> Option<f64> {
        self.point(view, place).map(|point| view.depth(point))
    }

    /// Which point of its plane is seen at a place of the frame: to the right of the camera, below it and ahead of it.
    fn point(&self, view: &View, place: [f64; 2]) -> Option<[f64; 3]> {
        let direction = view.direction(place);
        let times = match self.pose {
            Pose::Flat { .. } => view.height / direction[1],
            Pose::Upright { .. } => self.ahead / direction[2],
        };
        (times > 0.0 && times.is_finite()).then(|| direction.map(|side| side * times))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_seen_at_a_place_is_where_it_is_seen() {
        let view = Mounting::WINDSCREEN.view([320, 160]);
        for place in [[10.0, 90.0], [160.0, 80.0], [300.5, 159.0]] {
            let point = view.ground(place).unwrap();
            let back = view.seen(point).unwrap();
            assert!(
                (0..2).all(|axis| (back[axis] - place[axis]).abs() < 1e-9),
                "{place:?} {point:?} {back:?}"
            );
        }
        assert_eq!((view.ground([160.0, 20.0]), view.seen([0.0, -5.0])), (None, None));
        // Straight ahead of a camera that looks down by 45 degrees the ground is as far away as the camera is high.
        let steep = Mounting { pitch: 45.0, height: 2.0, field_of_view: 90.0 }.view([101, 101]);
        let [right, ahead] = steep.ground([50.5, 50.5]).unwrap();
        assert!(right.abs() < 1e-12 && (ahead - 2.0).abs() < 1e-12);
    }

    #[test]
    fn a_picture_on_the_ground_covers_what_it_covers_there() {
        let view = Mounting::WINDSCREEN.view([320, 160]);
        for (turn, offset) in [(0.0, 0.0), (0.5, -1.0)] {
            let (sine, cosine) = (libm::sin(turn), libm::cos(turn));
            let lying = Placed { sides: [2.0, 3.0], offset, ahead: 8.0, pose: Pose::Flat { turn } };
            let decal = lying.decal(&view, [2, 2]);
            let inside = (0..160 * 320).filter(|at| {
                let point = view.ground([(at % 320) as f64 + 0.5, (at / 320) as f64 + 0.5]);
                point.is_some_and(|[right, ahead]| {
                    let (right, ahead) = (right - offset, ahead - 8.0);
                    let across = right * cosine - ahead * sine;
                    let up = right * sine + ahead * cosine;
                    across.abs() < 1.0 && up.abs() < 1.5
                })
            });
            let (inside, found) = (inside.count(), decal.pixels());
            assert!(inside > 500 && found >= inside && found < inside + 400, "{inside} {found}");
        }
    }

    #[test]
    fn a_picture_that_stands_is_seen_between_its_corners() {
        let view = Mounting::WINDSCREEN.view([320, 160]);
        let pose = Pose::Upright { above: 1.5 };
        let standing = Placed { sides: [1.6, 1.2], offset: 1.0, ahead: 9.0, pose };
        let decal = standing.decal(&view, [2, 2]);
        let corner = |right: f64, above: f64| view.towards([right, 1.35 - above, 9.0]).unwrap();
        let ([left, top], [right, bottom]) = (corner(0.2, 2.1), corner(1.8, 0.9));
        let area = (right - left) * (bottom - top);
        assert!(
            area > 300.0 && (decal.pixels() as f64 - area).abs() < 0.2 * area,
            "{area} {}",
            decal.pixels()
        );
        // Each corner shows its own pixel of the picture.
        let values = [[200.0; 3], [0.0; 3], [100.0; 3], [50.0; 3]].concat();
        let mut frame = pdk_ops::frame::FrameBuf::new(320, 160);
        decal.lay(&values, frame.as_mut());
        for (right, above, expected) in [(0.4, 2.0, 200), (1.6, 2.0, 0), (0.4, 1.0, 100), (1.6, 1.0, 50)] {
            let [x, y] = corner(right, above);
            assert_eq!(frame.as_ref().pixel(x as usize, y as usize), [expected; 3], "{right} {above}");
        }
        // A simulator's depth is along the optical axis, so that of both planes is the same where they meet.
        let foot = view.seen([0.5, 9.0]).unwrap();
        let lying = Placed { pose: Pose::Flat { turn: 0.0 }, ..standing };
        let depths = [standing.depth(&view, foot), lying.depth(&view, foot)].map(Option::unwrap);
        let pitch = 8.0_f64.to_radians();
        let expected = 9.0 * libm::cos(pitch) + 1.35 * libm::sin(pitch);
        assert!(depths.iter().all(|depth| (depth - expected).abs() < 1e-9), "{depths:?} {expected}");
        // Behind the camera there is nothing to see.
        assert_eq!(Placed { ahead: -3.0, ..standing }.decal(&view, [2, 2]).pixels(), 0);
    }
}
