//! The road as a field: for any place near it, how far along and how far to the side of the driven lane it is.
//!
//! The renderer asks this for every pixel of ground. Distances are exact on a grid of half a metre and interpolated in
//! between, which is off by less than a centimetre where the road bends with a radius of 8 m. Only tiles that the road touches
//! are stored.

use pdk_road::{Path, Point, distance};

/// Distance from the driven lane up to which the field is known, in metres.
const REACH: f64 = 13.0;
/// The distance up to which it is exact, away from its outer border.
pub const NEAR: f32 = (REACH - 1.0) as f32;
/// Cells a metre.
pub const CELLS: f32 = 2.0;
/// Cells along a side of a tile: a power of two.
pub const TILE: usize = 16;
pub const SHIFT: usize = 4;
/// Grid points along a side of a tile; neighbours share their borders, so that a cell lies in one tile whole.
pub const CORNERS: usize = TILE + 1;
/// Length of a side of a tile in metres.
const TILE_LENGTH: f64 = TILE as f64 / CELLS as f64;
/// Marks a tile that the road does not touch.
pub const EMPTY: u32 = u32::MAX;
/// Lateral distance of what is not near the road.
const FAR: f32 = 99.0;
/// Every this many points of the path count in the first, coarse search.
const COARSE: usize = 4;
/// How far the road goes on straight beyond its ends where there is room, in metres, so that it does not seem to end.
const LEAD_OUT: f64 = 90.0;
const LEAD_IN: f64 = 20.0;
/// The continuation keeps this distance from the rest of the road, in metres.
const CLEARANCE: f64 = 15.0;

/// A place relative to the driven lane.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// Distance to the right of the lane's centre line in metres.
    pub lateral: f32,
    /// Distance along the lane in metres.
    pub along: f32,
    /// How `lateral` changes with x and z; a unit vector up to interpolation.
    pub gradient: [f32; 2],
    /// How much of the sun what stands there takes, 0 to 1.
    pub shade: f32,
}

impl Place {
    /// Whether it lies where the field is exact, away from its outer border.
    pub fn is_near(&self) -> bool {
        self.lateral.abs() < NEAR
    }
}

/// The field of one road.
#[derive(Debug)]
pub struct Field {
    /// The corner of the map, x and z: places are asked for relative to it, which keeps numbers small.
    origin: Point,
    /// Tiles in a row of the map, and rows.
    pub columns: usize,
    pub rows: usize,
    /// Which of the stored tiles lies where on the map, row by row; [`EMPTY`] if none does.
    pub tiles: Vec<u32>,
    /// `lateral` and `along` at the corners of cells, tile by tile.
    pub corners: Vec<[f32; 2]>,
    /// How much of the sun is taken at each corner; empty if nothing casts shadows.
    pub shades: Vec<f32>,
}

impl Field {
    /// Computes the field of a road.
    pub fn new(path: &Path) -> Self {
        let (path, lead_in) = continued(path);
        let points = path.points();
        let bound = |axis: usize, pick: fn(f64, f64) -> f64| {
            points.iter().map(|p| p[axis]).fold(points[0][axis], pick)
        };
        // One tile beyond what is reached, on whole tiles, so that the same road has the same grid.
        let low = |axis| ((bound(axis, f64::min) - REACH) / TILE_LENGTH).floor() * TILE_LENGTH;
        let count = |axis, low: f64| ((bound(axis, f64::max) + REACH - low) / TILE_LENGTH).ceil() as usize;
        let origin = [low(0), low(1)];
        let (columns, rows) = (count(0, origin[0]), count(1, origin[1]));
        let mut field = Self {
            origin,
            columns,
            rows,
            tiles: vec![EMPTY; columns * rows],
            corners: Vec::new(),
            shades: Vec::new(),
        };

        let mut nearby: Vec<Vec<usize>> = vec![Vec::new(); columns * rows];
        // From the middle of a tile to its corner, and from a coarse point to the next.
        let reach = REACH + TILE_LENGTH * 0.75 + 1.0;
        for i in (0..points.len()).step_by(COARSE) {
            let tile = |v: f64, most: usize| (v / TILE_LENGTH).clamp(0.0, most as f64 - 1.0) as usize;
            let (x, z) = (points[i][0] - origin[0], points[i][1] - origin[1]);
            for row in tile(z - reach, rows)..=tile(z + reach, rows) {
                for column in tile(x - reach, columns)..=tile(x + reach, columns) {
                    nearby[row * columns + column].push(i);
                }
            }
        }
        for (tile, candidates) in nearby.iter().enumerate().filter(|(_, c)| !c.is_empty()) {
            field.tiles[tile] = (field.corners.len() / (CORNERS * CORNERS)) as u32;
            for corner in 0..CORNERS * CORNERS {
                let cell = |tile: usize, corner: usize| (tile * TILE + corner) as f64 / f64::from(CELLS);
                let at = [
                    origin[0] + cell(tile % columns, corner % CORNERS),
                    origin[1] + cell(tile / columns, corner / CORNERS),
                ];
                field.corners.push(nearest(&path, lead_in, candidates, at));
            }
        }
        field
    }

    /// The corner of the map: what [`Field::at`] takes is relative to it.
    pub fn origin(&self) -> Point {
        self.origin
    }

    /// Casts a shadow: `shade` says how much of the sun is taken at a place, x and z in metres, and is asked within `reach`
    /// metres of `middle`. Shadows that overlap do not add up to more than all of the sun.
    pub fn cast(&mut self, middle: Point, reach: f64, shade: impl Fn(Point) -> f32) {
        self.shades.resize(self.corners.len(), 0.0);
        let bound = |axis: usize, side: f64, most: usize| {
            ((middle[axis] + side * reach - self.origin[axis]) / TILE_LENGTH).clamp(0.0, most as f64) as usize
        };
        let columns = bound(0, -1.0, self.columns)..(bound(0, 1.0, self.columns) + 1).min(self.columns);
        for row in bound(1, -1.0, self.rows)..(bound(1, 1.0, self.rows) + 1).min(self.rows) {
            for column in columns.clone() {
                let tile = self.tiles[row * self.columns + column];
                if tile == EMPTY {
                    continue;
                }
                for corner in 0..CORNERS * CORNERS {
                    let cell = |tile: usize, corner: usize| (tile * TILE + corner) as f64 / f64::from(CELLS);
                    let at = [
                        self.origin[0] + cell(column, corner % CORNERS),
                        self.origin[1] + cell(row, corner / CORNERS),
                    ];
                    let taken = &mut self.shades[tile as usize * (CORNERS * CORNERS) + corner];
                    *taken += (1.0 - *taken) * shade(at);
                }
            }
        }
    }

    /// Where a place lies relative to the lane; `None` if it is far from the road.
    #[inline(always)]
    pub fn at(&self, x: f32, z: f32) -> Option<Place> {
        let (cx, cz) = (x * CELLS, z * CELLS);
        // Written so that a number that is not one is refused too.
        let inside =
            cx >= 0.0 && cz >= 0.0 && cx < (self.columns * TILE) as f32 && cz < (self.rows * TILE) as f32;
        if !inside {
            return None;
        }
        // By way of signed numbers, which CPUs convert to directly.
        let (column, row) = (cx as i32 as usize, cz as i32 as usize);
        let tile = self.tiles[(row >> SHIFT) * self.columns + (column >> SHIFT)];
        if tile == EMPTY {
            return None;
        }
        let (fx, fz) = (cx - column as f32, cz - row as f32);
        let first =
            tile as usize * (CORNERS * CORNERS) + (row & (TILE - 1)) * CORNERS + (column & (TILE - 1));
        let [near, far] =
            [&self.corners[first..first + 2], &self.corners[first + CORNERS..first + CORNERS + 2]];
        let (across_near, across_far) = (near[1][0] - near[0][0], far[1][0] - far[0][0]);
        let (lateral_near, lateral_far) = (near[0][0] + across_near * fx, far[0][0] + across_far * fx);
        let (along_near, along_far) =
            (near[0][1] + (near[1][1] - near[0][1]) * fx, far[0][1] + (far[1][1] - far[0][1]) * fx);
        let gradient =
            [(across_near + (across_far - across_near) * fz) * CELLS, (lateral_far - lateral_near) * CELLS];
        // A distance changes by a metre a metre. If it changes faster, the corners of the cell belong to different
        // parts of the road, or one of them to none.
        if gradient[0].abs() + gradient[1].abs() > 2.0 {
            return None;
        }
        let shade = match self.shades.get(first..first + CORNERS + 2) {
            Some(shades) => {
                let near = shades[0] + (shades[1] - shades[0]) * fx;
                let far = shades[CORNERS] + (shades[CORNERS + 1] - shades[CORNERS]) * fx;
                near + (far - near) * fz
            }
            None => 0.0,
        };
        Some(Place {
            lateral: lateral_near + (lateral_far - lateral_near) * fz,
            along: along_near + (along_far - along_near) * fz,
            gradient,
            shade,
        })
    }
}

/// Lateral distance and distance along the path of a place, from the coarse points near it.
fn nearest(path: &Path, lead_in: f64, candidates: &[usize], at: Point) -> [f32; 2] {
    let squared = |i: usize| {
        let p = path.points()[i];
        (p[0] - at[0]) * (p[0] - at[0]) + (p[1] - at[1]) * (p[1] - at[1])
    };
    let mut best = (f64::INFINITY, 0);
    for &i in candidates {
        let here = squared(i);
        if here < best.0 {
            best = (here, i);
        }
    }
    let located = path.locate(at, best.1.saturating_sub(COARSE + 1), best.1 + COARSE + 1);
    let beyond_an_end = located.distance - located.lateral.abs() > 0.01;
    let lateral = if beyond_an_end || located.distance > REACH { FAR } else { located.lateral as f32 };
    [lateral, (located.along - lead_in) as f32]
}

/// The path with a straight piece before and after it, as long as there is room, and the length of the one before.
fn continued(path: &Path) -> (Path, f64) {
    let room = |from: f64, towards: f64, longest: f64| {
        // The part of the road next to that end is not an obstacle.
        let others = || {
            let length = path.length();
            (0..(length as usize)).map(|s| s as f64).filter(move |s| (s - from).abs() > 2.0 * CLEARANCE)
        };
        let mut free = 0.0;
        while free < longest {
            let next = path.point_at(from + towards * (free + 1.0));
            if others().any(|s| distance(path.point_at(s), next) < CLEARANCE) {
                break;
            }
            free += 1.0;
        }
        free
    };
    let length = path.length();
    let (before, after) = (room(0.0, -1.0, LEAD_IN), room(length, 1.0, LEAD_OUT));
    let mut points: Vec<Point> = (1..=before as usize).rev().map(|s| path.point_at(-(s as f64))).collect();
    points.extend(path.points());
    points.extend((1..=after as usize).map(|s| path.point_at(length + s as f64)));
    (Path::of(points), before)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::road::Road;

    #[test]
    fn the_field_agrees_with_the_path() {
        let road =
            Road::from_angles(&[0.0, 30.0, -35.0, -35.0, 20.0, 35.0, 35.0, 0.0], &[25.0; 8], &[]).unwrap();
        let field = Field::new(&road.path);
        let (mut worst, mut asked) = (0.0f64, 0);
        for step in 0..1700 {
            let along = 1.0 + step as f64 * 0.1;
            for lateral in [-7.0, -2.1, 0.0, 1.9, 4.0] {
                let at = road.path.beside(along, lateral);
                let expected = road.path.locate(at, 0, road.path.segments());
                let place = field
                    .at((at[0] - field.origin()[0]) as f32, (at[1] - field.origin()[1]) as f32)
                    .expect("close to the road");
                worst = worst.max((f64::from(place.lateral) - expected.lateral).abs());
                assert!((f64::from(place.along) - expected.along).abs() < 0.1);
                let [gx, gz] = place.gradient;
                assert!(((gx * gx + gz * gz).sqrt() - 1.0).abs() < 0.03, "{gx} {gz}");
                asked += 1;
            }
        }
        assert!(worst < 0.01 && asked == 8500, "{worst}");
    }

    #[test]
    fn no_road_appears_where_there_is_none() {
        // Two parts of a road side by side: between them the nearest one changes.
        let road = Road::from_angles(&[0.0, 0.0, 60.0, 60.0, 60.0, 0.0, 0.0], &[20.0; 7], &[]).unwrap();
        let field = Field::new(&road.path);
        let (path, lead_in) = continued(&road.path);
        let centre = |lateral: f64| lateral - crate::section::ROAD_CENTRE;
        let mut on_road = 0;
        for i in 0..300 {
            for j in 0..300 {
                let (x, z) = (i as f32 * 0.331, j as f32 * 0.473);
                let at = [field.origin()[0] + f64::from(x), field.origin()[1] + f64::from(z)];
                let expected = path.locate(at, 0, path.segments());
                let Some(place) = field.at(x, z) else { continue };
                if centre(f64::from(place.lateral)).abs() < crate::section::PAVED_HALF_WIDTH {
                    assert!((f64::from(place.lateral) - expected.lateral).abs() < 0.05, "{at:?} {place:?}");
                    assert!((f64::from(place.along) - expected.along + lead_in).abs() < 0.3, "{at:?}");
                    on_road += 1;
                }
            }
        }
        assert!(on_road > 5000, "{on_road}");
    }

    #[test]
    fn far_from_the_road_there_is_nothing() {
        let road = Road::from_angles(&[0.0; 8], &[25.0; 8], &[]).unwrap();
        let field = Field::new(&road.path);
        assert_eq!(field.at(-1.0, 5.0), None);
        assert_eq!(field.at(f32::NAN, 5.0), None);
        assert_eq!(field.at(5.0, 1e9), None);
        // The road goes on beyond its end.
        let beyond = [0.0 - field.origin()[0], 230.0 - field.origin()[1]];
        assert!(field.at(beyond[0] as f32, beyond[1] as f32).unwrap().lateral.abs() < 0.01);
    }
}
