//! Labels of a frame under a chain: boxes, polygons, lines, points and masks, moved as the pixels are.
//!
//! Coordinates count from the upper left corner of the frame, in pixels: its edges are 0 and its width and height, and the centre of the
//! first pixel is 0.5, 0.5. So do COCO, YOLO and most others count.

use pdk_sdk::error::Result;
use pdk_sdk::prelude::Way;

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;

/// Points on each side of a box that are moved, so that its hull is right where sides are bent.
const ON_A_SIDE: usize = 8;

/// A box by its left, upper, right and lower edge.
pub type Edges = [f64; 4];

/// A box after it was moved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MovedBox {
    /// The hull of what was the box, cut off at the edges of the frame. Empty if nothing is left in the frame.
    pub edges: Edges,
    /// How much of the hull is in the frame, from 0 to 1.
    pub visible: f64,
}

/// Moves the labels of one frame.
pub struct Labels<'a> {
    chain: &'a mut Chain,
    size: [usize; 2],
    moment: &'a Moment<'a>,
}

impl<'a> Labels<'a> {
    /// Labels of a frame of `size`, width and height, that `chain` perturbs at this moment.
    pub fn new(chain: &'a mut Chain, size: [usize; 2], moment: &'a Moment<'a>) -> Self {
        Self { chain, size, moment }
    }

    /// Where points are seen afterwards, inside the frame or outside.
    ///
    /// # Errors
    /// If a perturbation cannot say.
    pub fn points(&mut self, points: &mut [[f64; 2]]) -> Result<()> {
        points.iter_mut().flatten().for_each(|place| *place -= 0.5);
        self.chain.move_points(points, Way::ToPerturbed, self.size, self.moment)?;
        points.iter_mut().flatten().for_each(|place| *place += 0.5);
        Ok(())
    }

    /// Whether a point is in the frame.
    pub fn is_inside(&self, [x, y]: [f64; 2]) -> bool {
        let [width, height] = self.size.map(|length| length as f64);
        (0.0..=width).contains(&x) && (0.0..=height).contains(&y)
    }

    /// The box around all that was in a box. It is the hull of its corners and of points on its sides, so that it is larger than what
    /// it holds after a rotation.
    ///
    /// # Errors
    /// As [`Labels::points`].
    pub fn moved_box(&mut self, [left, top, right, bottom]: Edges) -> Result<MovedBox> {
        let share = |from: f64, to: f64, step: usize| from + (to - from) * step as f64 / ON_A_SIDE as f64;
        let mut points: Vec<[f64; 2]> = (0..ON_A_SIDE)
            .flat_map(|step| {
                [
                    [share(left, right, step), top],
                    [right, share(top, bottom, step)],
                    [share(right, left, step), bottom],
                    [left, share(bottom, top, step)],
                ]
            })
            .collect();
        self.points(&mut points)?;
        let ends = |axis: usize| {
            let places = points.iter().map(|point| point[axis]).filter(|place| place.is_finite());
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| {
                [low.min(place), high.max(place)]
            })
        };
        let ([left, right], [top, bottom]) = (ends(0), ends(1));
        let [width, height] = self.size.map(|length| length as f64);
        let cut = |low: f64, high: f64, length: f64| {
            let (from, to) = (low.clamp(0.0, length), high.clamp(0.0, length));
            let whole = high - low;
            let visible = if whole > 0.0 { (to - from) / whole } else { f64::from(low == from) };
            (from, to, visible)
        };
        if !(left <= right && top <= bottom) {
            return Ok(MovedBox { edges: [0.0; 4], visible: 0.0 });
        }
        let ((left, right, across), (top, bottom, down)) =
            (cut(left, right, width), cut(top, bottom, height));
        Ok(MovedBox { edges: [left, top, right, bottom], visible: across * down })
    }

    /// The outline of a polygon, cut off at the edges of the frame; fewer than three corners if nothing is left. Its corners are moved and
    /// joined by straight lines.
    ///
    /// # Errors
    /// As [`Labels::points`].
    pub fn polygon(&mut self, corners: &[[f64; 2]]) -> Result<Vec<[f64; 2]>> {
        let mut corners = corners.to_vec();
        self.points(&mut corners)?;
        corners.retain(|corner| corner.iter().all(|place| place.is_finite()));
        let [width, height] = self.size.map(|length| length as f64);
        for (axis, limit, sign) in [(0, 0.0, 1.0), (0, width, -1.0), (1, 0.0, 1.0), (1, height, -1.0)] {
            corners = cut_off(&corners, axis, limit, sign);
        }
        Ok(corners)
    }

    /// For each pixel of the perturbed frame, row by row, the place in the source frame, row by row, of the pixel that is nearest to what
    /// is seen there; none for what comes from outside of the frame. A mask moved by this agrees with the picture pixel by pixel.
    ///
    /// # Errors
    /// If a perturbation cannot say where its pixels come from.
    pub fn sources(&mut self) -> Result<Vec<Option<usize>>> {
        let [width, height] = self.size;
        let mut points: Vec<[f64; 2]> =
            (0..width * height).map(|at| [(at % width) as f64, (at / width) as f64]).collect();
        self.chain.move_points(&mut points, Way::ToSource, self.size, self.moment)?;
        let inside = |place: f64, length: usize| {
            let nearest = place.round();
            (nearest >= 0.0 && nearest < length as f64).then_some(nearest as usize)
        };
        let source = |[x, y]: [f64; 2]| Some(inside(y, height)? * width + inside(x, width)?);
        Ok(points.into_iter().map(source).collect())
    }

    /// Whether the frame is a mirror image afterwards, in which left is right: a driver there has to steer the other way. A frame
    /// that is turned, also upside down, is none: that is another camera in the same world.
    ///
    /// # Errors
    /// As [`Labels::points`].
    pub fn mirrors(&mut self) -> Result<bool> {
        let [x, y] = self.size.map(|length| length as f64 / 2.0);
        let mut points = [[x, y], [x + 1.0, y], [x, y + 1.0]];
        self.points(&mut points)?;
        let [middle, right, down] = points;
        let along = |to: [f64; 2]| [to[0] - middle[0], to[1] - middle[1]];
        let (right, down) = (along(right), along(down));
        Ok(right[0] * down[1] - right[1] * down[0] < 0.0)
    }
}

/// Cuts off what lies beyond a limit in one direction: below it for a `sign` of 1, above it for -1.
fn cut_off(corners: &[[f64; 2]], axis: usize, limit: f64, sign: f64) -> Vec<[f64; 2]> {
    let beyond = |corner: [f64; 2]| sign * (limit - corner[axis]);
    let mut kept = Vec::with_capacity(corners.len() + 4);
    for (place, &corner) in corners.iter().enumerate() {
        let before = corners[(place + corners.len() - 1) % corners.len()];
        let (from, to) = (beyond(before), beyond(corner));
        if (from > 0.0) != (to > 0.0) {
            let share = from / (from - to);
            let mut edge = [0, 1].map(|axis| before[axis] + (corner[axis] - before[axis]) * share);
            edge[axis] = limit;
            kept.push(edge);
        }
        if to <= 0.0 {
            kept.push(corner);
        }
    }
    kept
}

/// The area of a polygon.
pub fn area(corners: &[[f64; 2]]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let twice: f64 = corners.iter().zip(next).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
    (twice / 2.0).abs()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polygon_ends_at_the_edges() {
        let square = [[-2.0, -2.0], [4.0, -2.0], [4.0, 4.0], [-2.0, 4.0]];
        let mut left = square.to_vec();
        for (axis, limit, sign) in [(0, 0.0, 1.0), (0, 10.0, -1.0), (1, 0.0, 1.0), (1, 3.0, -1.0)] {
            left = cut_off(&left, axis, limit, sign);
        }
        assert_eq!(area(&left), 12.0);
        assert!(cut_off(&square, 0, 5.0, 1.0).is_empty());
        assert_eq!(area(&square), 36.0);
    }
}
