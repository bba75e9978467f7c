//! A map, and the way along its lanes.

use std::collections::BTreeMap;

use super::geometry::{Piece, cubic};
use super::{turned, turned_back};
use crate::{Point, distance};

/// The points of a lane's centre line are this far apart, in metres.
const STEP: f64 = 1.0;
/// A lane that was wider is followed until it is narrower than this, in metres: it tapers off, and no vehicle fits in.
const NARROWEST: f64 = 2.0;
/// How near a lane has to be to where one is looked for, in metres.
const NEAREST: f64 = 6.0;

/// A map as far as it says where lanes are and how they go on.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Map {
    /// The roads by their ids.
    pub(super) roads: BTreeMap<String, Road>,
    /// Where one can go from a lane at a junction.
    pub(super) connections: Vec<Connection>,
}

/// The centre line of a lane, followed for some way.
#[derive(Debug, Clone, PartialEq)]
pub struct Lane {
    /// Its points as `[x, height, z]` in metres.
    pub points: Vec<[f64; 3]>,
    /// The smallest width of the lane on the way, in metres.
    pub width: f64,
}

/// A road.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Road {
    pub length: f64,
    pub left_hand_traffic: bool,
    pub plan: Vec<Piece>,
    pub heights: Vec<Cubic>,
    pub offsets: Vec<Cubic>,
    pub sections: Vec<Section>,
    /// What comes before its beginning and behind its end.
    pub neighbours: [Option<Neighbour>; 2],
}

/// A cubic that holds from some place on: `a + b ds + c ds^2 + d ds^3`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cubic {
    pub from: f64,
    pub coefficients: [f64; 4],
}

/// The road or junction at the end of a road.
#[derive(Debug, Clone, PartialEq)]
pub enum Neighbour {
    /// Another road, at its beginning (0) or its end (1).
    Road(String, usize),
    /// A junction.
    Junction(String),
}

/// From some place on, a road has these lanes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Section {
    pub from: f64,
    /// By number: negative to the right of the middle.
    pub lanes: BTreeMap<i32, LaneRecord>,
}

/// A lane in one section.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LaneRecord {
    pub driving: bool,
    pub widths: Vec<Cubic>,
    /// The number of the lane before and behind, in the neighbouring section or road.
    pub links: [Option<i32>; 2],
}

/// At a junction, a way from a lane of the road that comes in to one of a road that crosses the junction.
#[derive(Debug, Clone, PartialEq)]
pub struct Connection {
    pub junction: String,
    pub incoming: String,
    pub connecting: String,
    /// At which end of the connecting road one enters it.
    pub contact: usize,
    /// From lane to lane.
    pub links: Vec<(i32, i32)>,
}

/// A lane at some place, and in which direction it is driven.
#[derive(Debug, Clone, Copy)]
struct Place<'a> {
    id: &'a str,
    road: &'a Road,
    section: usize,
    lane: i32,
    /// Towards larger s.
    forwards: bool,
    s: f64,
}

fn value(cubics: &[Cubic], s: f64) -> f64 {
    let after = cubics.partition_point(|cubic| cubic.from <= s);
    match after.checked_sub(1).and_then(|i| cubics.get(i)).or(cubics.first()) {
        Some(part) => cubic(part.coefficients, s - part.from).0,
        None => 0.0,
    }
}

impl Road {
    /// Point and heading of the reference line.
    fn reference(&self, s: f64) -> Option<(Point, f64)> {
        let after = self.plan.partition_point(|piece| piece.s <= s);
        Some(self.plan.get(after.saturating_sub(1))?.at(s))
    }

    fn section_end(&self, section: usize) -> f64 {
        self.sections.get(section + 1).map_or(self.length, |next| next.from)
    }

    fn section_at(&self, s: f64) -> usize {
        self.sections.partition_point(|section| section.from <= s).saturating_sub(1)
    }

    /// Middle and width of a lane at a place: the point in the axes of OpenDRIVE, the height, the heading of the road.
    fn lane_at(&self, section: usize, lane: i32, s: f64) -> Option<(Point, f64, f64, f64)> {
        let lanes = &self.sections.get(section)?.lanes;
        let within = s - self.sections[section].from;
        let width = |id: i32| lanes.get(&id).map_or(0.0, |lane| value(&lane.widths, within).max(0.0));
        let own = width(lane);
        let between: f64 = (1..lane.abs()).map(|id| width(id * lane.signum())).sum();
        let across = value(&self.offsets, s) + f64::from(lane.signum()) * (between + own / 2.0);
        let ([x, y], heading) = self.reference(s)?;
        let at = [x - across * libm::sin(heading), y + across * libm::cos(heading)];
        Some((at, value(&self.heights, s), own, heading))
    }

    /// Whether a lane is driven towards larger s.
    fn forwards(&self, lane: i32) -> bool {
        (lane < 0) != self.left_hand_traffic
    }
}

impl Map {
    /// The lane that lies nearest to a point and is driven in about the direction of `heading` (radians, clockwise from +z), followed
    /// from there for at most `length` metres. At a junction it goes on as straight as possible. It ends before it is narrower than 2 m,
    /// unless it begins so.
    ///
    /// # Errors
    /// If there is no such lane, or it ends after less than 10 m.
    pub fn follow(&self, at: Point, heading: f64, length: f64) -> Result<Lane, String> {
        let mut place = self.nearest(at, heading)?;
        let mut lane = Lane { points: Vec::new(), width: f64::INFINITY };
        let mut walked = 0.0;
        let mut before: Option<Point> = None;
        // This many sections of no length in a row are a ring.
        let mut idle = 0;
        while walked < length && idle < 100 {
            let Some((point, height, width, _)) = place.road.lane_at(place.section, place.lane, place.s)
            else {
                break;
            };
            if width < NARROWEST && lane.width >= NARROWEST && before.is_some() {
                break;
            }
            let step = before.map_or(f64::INFINITY, |before| distance(before, point));
            // If one road ends and the next begins the same point comes twice.
            if step > STEP / 4.0 {
                let [x, z] = turned_back(point);
                lane.points.push([x, height, z]);
                lane.width = lane.width.min(width);
                walked += if step.is_finite() { step } else { 0.0 };
                (before, idle) = (Some(point), 0);
            }
            let (start, end) =
                (place.road.sections[place.section].from, place.road.section_end(place.section));
            let left = if place.forwards { end - place.s } else { place.s - start };
            if left > 1e-6 {
                place.s += STEP.min(left) * if place.forwards { 1.0 } else { -1.0 };
                continue;
            }
            idle += 1;
            match self.next(place) {
                Some(next) => place = next,
                None => break,
            }
        }
        if walked < 10.0_f64.min(length) {
            let [x, z] = at;
            return Err(format!(
                "the lane near x {x:.1}, z {z:.1} ends after {walked:.1} m; start from another place"
            ));
        }
        Ok(lane)
    }

    fn nearest(&self, at: Point, heading: f64) -> Result<Place<'_>, String> {
        let wanted = turned(at);
        let mut best: Option<(f64, Place<'_>)> = None;
        for (id, road) in &self.roads {
            for i in 0..=(road.length / STEP) as usize {
                let s = i as f64 * STEP;
                let section = road.section_at(s);
                let Some(lanes) = road.sections.get(section) else { continue };
                for (&lane, _) in lanes.lanes.iter().filter(|(id, lane)| **id != 0 && lane.driving) {
                    let Some((point, _, width, direction)) = road.lane_at(section, lane, s) else { continue };
                    let off = distance(point, wanted);
                    let forwards = road.forwards(lane);
                    // Our headings are clockwise, those of OpenDRIVE counter-clockwise.
                    let difference = direction + heading;
                    let along = libm::cos(difference) * if forwards { 1.0 } else { -1.0 };
                    let nearer = best.is_none_or(|(nearest, _)| off < nearest);
                    if off < NEAREST && nearer && along > 0.5 && width > 1.0 {
                        best = Some((off, Place { id, road, section, lane, forwards, s }));
                    }
                }
            }
        }
        let [x, z] = at;
        best.map(|(_, place)| place).ok_or_else(|| {
            format!(
                "the map has no lane within {NEAREST} m of x {x:.1}, z {z:.1} that leads towards {:.0} degrees; start from another \
                 place",
                heading.to_degrees()
            )
        })
    }

    /// Where a lane goes on behind the end of its section.
    fn next<'a>(&'a self, place: Place<'a>) -> Option<Place<'a>> {
        let Place { road, section, lane, forwards, .. } = place;
        let side = usize::from(forwards);
        let link = road.sections[section].lanes.get(&lane)?.links[side];
        let within = if forwards { section + 1 < road.sections.len() } else { section > 0 };
        if within {
            let section = if forwards { section + 1 } else { section - 1 };
            // By default, lanes keep their numbers.
            let lane = link.unwrap_or(lane);
            road.sections[section].lanes.get(&lane)?;
            let s = if forwards { road.sections[section].from } else { road.section_end(section) };
            return Some(Place { section, lane, s, ..place });
        }
        match road.neighbours[side].as_ref()? {
            Neighbour::Road(id, contact) => self.enter(id, *contact, link?),
            Neighbour::Junction(junction) => {
                let ([x, y], _, _, heading) = road.lane_at(section, lane, place.s)?;
                let heading = if forwards { heading } else { heading + std::f64::consts::PI };
                let ways = self
                    .connections
                    .iter()
                    .filter(|way| way.junction == *junction && way.incoming == place.id);
                let ways = ways.flat_map(|way| {
                    let links = way.links.iter().filter(|(from, _)| *from == lane);
                    links.filter_map(|(_, to)| self.enter(&way.connecting, way.contact, *to))
                });
                // How far ahead of the place each way leads in its own direction: the straightest is the farthest.
                let ahead = |way: &Place<'_>| {
                    let end = if way.forwards { way.road.length } else { 0.0 };
                    let section = way.road.section_at(end);
                    let (point, ..) =
                        way.road.lane_at(section, way.lane, end).unwrap_or(([x, y], 0.0, 0.0, 0.0));
                    let [dx, dy] = [point[0] - x, point[1] - y];
                    (dx * libm::cos(heading) + dy * libm::sin(heading)) / distance(point, [x, y]).max(1e-9)
                };
                ways.max_by(|a, b| ahead(a).total_cmp(&ahead(b)).then_with(|| b.id.cmp(a.id)))
            }
        }
    }

    /// The lane of a road, entered at one of its ends.
    fn enter(&self, id: &str, contact: usize, lane: i32) -> Option<Place<'_>> {
        let (id, road) = self.roads.get_key_value(id)?;
        let (section, s) = match contact {
            0 => (0, 0.0),
            _ => (road.sections.len().checked_sub(1)?, road.length),
        };
        road.sections.get(section)?.lanes.get(&lane)?;
        Some(Place { id, road, section, lane, forwards: contact == 0, s })
    }
}
