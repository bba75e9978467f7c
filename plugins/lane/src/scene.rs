//! What there is to see of one road: the road itself, what stands beside it, and the hills around.

use std::f64::consts::PI;

use pdk_sdk::prelude::Random;

use crate::field::Field;
use crate::light::{Light, Sun};
use crate::section;
use crate::wear::Wear;
use pdk_road::{Path, distance};

/// Distance between posts along the road in metres.
const POST_SPACING: f64 = 15.0;
/// Distance of the posts from the middle of the road in metres.
const POST_OFFSET: f64 = section::PAVED_HALF_WIDTH + 0.65;
/// Nearest and farthest distance of trees from the middle of the road in metres.
const TREE_OFFSETS: (f64, f64) = (10.0, 45.0);
/// Trees for each metre of road.
const TREE_DENSITY: f64 = 0.55;
/// Trees stand this far before and beyond the road too, in metres.
const TREES_BEYOND: f64 = 60.0;
/// A house every this many metres, where there is room, and its distance from the middle of the road in metres.
const HOUSE_SPACING: f64 = 45.0;
const HOUSE_OFFSETS: (f64, f64) = (17.0, 34.0);
/// Number of directions for which the height of the hills is stored.
const DIRECTIONS: usize = 2048;

/// Something upright beside the road.
#[derive(Debug, Clone, Copy)]
pub struct Object {
    /// x and z in metres.
    pub at: [f64; 2],
    /// Width and height in metres.
    pub size: [f64; 2],
    /// What it is.
    pub kind: ObjectKind,
    /// What the colours of its picture are multiplied with.
    pub tint: [f32; 3],
    /// Which of several pictures of its kind it has.
    pub variant: usize,
}

/// Kinds of object, each with its own picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ObjectKind {
    /// A delineator post.
    Post,
    /// A conifer.
    Conifer,
    /// A broad-leaved tree.
    Broadleaf,
    /// A house.
    House,
    /// A bush.
    Bush,
    /// A round sign that limits the speed.
    LimitSign,
    /// A triangle that warns.
    WarningSign,
    /// A board that points the way.
    GuideSign,
}

impl ObjectKind {
    /// Whether it is a sign.
    pub fn is_sign(self) -> bool {
        matches!(self, Self::LimitSign | Self::WarningSign | Self::GuideSign)
    }
}

/// Everything around one road.
#[derive(Debug)]
pub struct Scene {
    /// The road.
    pub field: Field,
    /// What stands beside it.
    pub objects: Vec<Object>,
    /// The light.
    pub light: Light,
    /// Where the sun stands, where it shows.
    pub sun: Option<Sun>,
    /// The state of the road, where the scene looks as cameras see it.
    pub wear: Option<Wear>,
    /// Tangent of the elevation of the far and the near hills in each direction.
    hills: Vec<[f32; 2]>,
}

impl Scene {
    /// Furnishes a road; the same random numbers give the same scene.
    pub fn new(path: &Path, light: &Light, random: &mut Random) -> Self {
        let field = Field::new(path);
        let mut objects = Vec::new();
        let mut along = POST_SPACING / 2.0;
        while along < path.length() {
            for side in [-1.0, 1.0] {
                let at = path.beside(along, section::ROAD_CENTRE + side * POST_OFFSET);
                objects.push(Object {
                    at,
                    size: [0.13, 1.0],
                    kind: ObjectKind::Post,
                    tint: [1.0; 3],
                    variant: 0,
                });
            }
            along += POST_SPACING;
        }
        let trees = ((path.length() + 2.0 * TREES_BEYOND) * TREE_DENSITY) as usize;
        for i in 0..trees {
            let along = random.uniform(-TREES_BEYOND, path.length() + TREES_BEYOND);
            // More of them close to the road than far from it.
            let share = random.unit();
            let offset = TREE_OFFSETS.0 + (TREE_OFFSETS.1 - TREE_OFFSETS.0) * share * share;
            let side = if random.below(2) == 0 { -1.0 } else { 1.0 };
            let at = path.beside(along, section::ROAD_CENTRE + side * offset);
            let kind = if random.below(5) < 2 { ObjectKind::Conifer } else { ObjectKind::Broadleaf };
            let height = random.uniform(4.5, 9.0);
            let width = height * if kind == ObjectKind::Conifer { 0.45 } else { 0.8 };
            let brightness = random.uniform(0.85, 1.12) as f32;
            if clear(&field, at, width) {
                objects.push(Object { at, size: [width, height], kind, tint: [brightness; 3], variant: i });
            }
        }
        let hills = hills(random);
        let houses = (path.length() / HOUSE_SPACING) as usize;
        for i in 0..houses {
            let along = (i as f64 + random.unit()) * HOUSE_SPACING;
            let offset = random.uniform(HOUSE_OFFSETS.0, HOUSE_OFFSETS.1);
            let side = if random.below(2) == 0 { -1.0 } else { 1.0 };
            let at = path.beside(along, section::ROAD_CENTRE + side * offset);
            let width = random.uniform(7.0, 11.0);
            let warmth = random.uniform(0.8, 1.05) as f32;
            if clear(&field, at, width) {
                // Nothing grows in houses or right before them.
                objects.retain(|other| {
                    other.kind == ObjectKind::Post
                        || distance(other.at, at) > width * 0.5 + other.size[0] * 0.5 + 1.0
                });
                let tint = [1.0, 0.5 + 0.5 * warmth, warmth];
                objects.push(Object {
                    at,
                    size: [width, width * 0.82],
                    kind: ObjectKind::House,
                    tint,
                    variant: 0,
                });
            }
        }
        Self { field, objects, hills, sun: light.place_sun(random), light: *light, wear: None }
    }

    /// Tangent of the elevation of the far and the near hills in a direction, in radians clockwise from +z.
    pub fn hills_towards(&self, heading: f64) -> [f32; 2] {
        let turns = heading / (2.0 * PI);
        let position = (turns - turns.floor()) * DIRECTIONS as f64;
        let index = position as usize;
        let share = (position - index as f64) as f32;
        let (a, b) = (self.hills[index % DIRECTIONS], self.hills[(index + 1) % DIRECTIONS]);
        [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share]
    }
}

/// Whether something of that width leaves the road free: a bend may have brought its place onto another part of it.
pub fn clear(field: &Field, at: [f64; 2], width: f64) -> bool {
    let place = field.at((at[0] - field.origin()[0]) as f32, (at[1] - field.origin()[1]) as f32);
    let from_road = place.map_or(f64::INFINITY, |p| (f64::from(p.lateral) - section::ROAD_CENTRE).abs());
    from_road > section::PAVED_HALF_WIDTH + 1.0 + width / 2.0
}

fn hills(random: &mut Random) -> Vec<[f32; 2]> {
    /// Mean height, swing, and the waves around the horizon: number and weight.
    type Ridge = (f64, f64, &'static [(f64, f64)]);
    // Whole numbers of waves, so that the ends meet.
    let ridges: [Ridge; 2] = [
        (0.062, 0.03, &[(3.0, 0.7), (7.0, 0.5), (13.0, 0.35), (29.0, 0.14), (61.0, 0.06)]),
        (0.022, 0.016, &[(4.0, 0.7), (9.0, 0.5), (17.0, 0.3), (41.0, 0.1), (150.0, 0.05), (331.0, 0.04)]),
    ];
    let phases =
        ridges.map(|(_, _, waves)| waves.iter().map(|_| random.uniform(0.0, 2.0 * PI)).collect::<Vec<f64>>());
    (0..DIRECTIONS)
        .map(|i| {
            let angle = 2.0 * PI * i as f64 / DIRECTIONS as f64;
            [0, 1].map(|ridge| {
                let (height, swing, waves) = ridges[ridge];
                let wave: f64 = waves
                    .iter()
                    .zip(&phases[ridge])
                    .map(|(&(number, weight), phase)| weight * libm::sin(number * angle + phase))
                    .sum();
                (height + swing * wave).max(0.004) as f32
            })
        })
        .collect()
}
