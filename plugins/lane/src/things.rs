//! Draws what stands upright: trees, houses, posts, signs and vehicles, far ones first, with their shadows.

use pdk_road::Path;
use pdk_road::traffic::{self, Seen};
use pdk_sdk::prelude::Random;

use crate::artwork;
use crate::camera::Projection;
use crate::countryside;
use crate::labels::{Canvas, Label};
use crate::scene::{Object, ObjectKind, Scene};
use crate::sprite::{Placement, Sprite};
use crate::terrain::Terrain;

/// Objects farther away than this are not drawn, in metres.
const FARTHEST_OBJECT: f64 = 260.0;
/// Neither is what is nearer than this.
const NEAREST: f64 = 0.5;
/// A vehicle is drawn as slices from its far end to its near one: this many for each pixel that a metre takes there, and
/// at most this many.
const SLICES_PER_SCALE: f64 = 0.8;
const MOST_SLICES: f64 = 26.0;
/// Where the axles are, as shares of a vehicle's length.
const AXLES: [f64; 2] = [0.18, 0.8];
/// How much more of the headlights' light comes back from what is made to do so.
const REFLECTORS: f32 = 2.5;

/// Something to draw over the ground.
#[derive(Debug, Clone, Copy)]
enum Thing {
    Object(usize),
    Vehicle(Shown),
}

/// A vehicle, and whether it is driven.
#[derive(Debug, Clone, Copy)]
pub struct Shown {
    pub seen: Seen,
    pub parked: bool,
}

/// The pictures, and what is in view.
#[derive(Debug)]
pub struct Things {
    pictures: Pictures,
    /// Distance and order of what may be in view, far ones first; of the frame at hand.
    visible: Vec<(f64, usize, Thing)>,
}

#[derive(Debug)]
struct Pictures {
    post: Sprite,
    conifers: Vec<Sprite>,
    broadleaves: Vec<Sprite>,
    bushes: Vec<Sprite>,
    house: Sprite,
    limit_sign: Sprite,
    warning_sign: Sprite,
    guide_sign: Sprite,
    shadow: Sprite,
    body: Sprite,
    axle: Sprite,
    rear: Sprite,
    front: Sprite,
    tail_lamps: Sprite,
    head_lamps: Sprite,
}

/// Where things are looked at from.
pub struct Eye<'a> {
    pub scene: &'a Scene,
    pub path: &'a Path,
    pub projection: &'a Projection,
    pub terrain: &'a Terrain,
    /// x and z in metres, and sine and cosine of the heading.
    pub at: [f64; 2],
    pub direction: [f64; 2],
}

impl Eye<'_> {
    /// How far to the right of the camera and ahead of it a place lies.
    #[inline(always)]
    fn relative(&self, at: [f64; 2]) -> (f64, f64) {
        let [sine, cosine] = self.direction;
        let (dx, dz) = (at[0] - self.at[0], at[1] - self.at[1]);
        (dx * cosine - dz * sine, dx * sine + dz * cosine)
    }

    /// Where something of `size` metres appears whose foot is at a place, with the light and air there; and its scale in
    /// pixels a metre. `None` if it is too close to the lens.
    #[inline(always)]
    fn placement(
        &self,
        (right, ahead): (f64, f64),
        size: [f64; 2],
        tint: [f32; 3],
        reflectors: f32,
    ) -> Option<(Placement, f64)> {
        let light = &self.scene.light;
        let (height, bottom) = self.terrain.at(ahead);
        let [x, foot, scale] = self.projection.project(right, ahead, height)?;
        let [width, tall] = size.map(|s| s * scale);
        // A camera that looks down sees a little of what is beside it.
        let away = ahead.max(0.0);
        let air = 1.0 - libm::exp(-away / light.visibility);
        let lit = light.on_things(right as f32, away as f32) * reflectors;
        let placement = Placement {
            left: (x - width / 2.0) as f32,
            top: (foot - tall) as f32,
            size: [width as f32, tall as f32],
            depth: (self.projection.focal / scale) as f32,
            // Things come into sight gradually.
            opacity: ((FARTHEST_OBJECT - ahead) / 40.0).min(1.0) as f32,
            tint: [0, 1, 2].map(|c| tint[c] * (light.ambient[c] + lit)),
            haze: (light.haze, air as f32),
            // The ground that a thing stands on hides nothing of it.
            bottom: if bottom + 1.0 < foot { bottom as f32 } else { f32::INFINITY },
        };
        Some((placement, scale))
    }
}

impl Things {
    /// Draws the pictures, which are the same in all scenes: those of a drawing, or those of the world as cameras see it.
    pub fn new(natural: bool, random: &mut Random) -> Self {
        // In this order, so that a drawing's pictures are those that they were.
        let (conifers, broadleaves, bushes) = match natural {
            false => {
                let (conifer, broadleaf) = (artwork::conifer(random), artwork::broadleaf(random));
                (vec![conifer], vec![broadleaf], Vec::new())
            }
            true => {
                (countryside::conifers(random), countryside::broadleaves(random), countryside::bushes(random))
            }
        };
        let pictures = Pictures {
            post: artwork::post(),
            conifers,
            broadleaves,
            bushes,
            house: artwork::house(),
            limit_sign: countryside::limit_sign(),
            warning_sign: countryside::warning_sign(),
            guide_sign: countryside::guide_sign(),
            shadow: artwork::shadow(),
            body: artwork::body(false),
            axle: artwork::body(true),
            rear: artwork::rear(),
            front: artwork::front(),
            tail_lamps: artwork::lamps([255.0, 42.0, 30.0]),
            head_lamps: artwork::lamps([255.0, 248.0, 226.0]),
        };
        Self { pictures, visible: Vec::new() }
    }

    /// Makes room for the objects and vehicles of a scene, so that drawing it allocates nothing.
    pub fn prepare(&mut self, scene: &Scene, vehicles: usize) {
        self.visible.clear();
        self.visible.reserve(scene.objects.len() + vehicles);
    }

    /// Draws all that is in view.
    pub fn draw(&mut self, eye: &Eye<'_>, vehicles: impl Iterator<Item = Shown>, into: &mut impl Canvas) {
        let half_view = eye.projection.centre_x / eye.projection.focal;
        let objects = &eye.scene.objects;
        self.visible.clear();
        // Behind the camera, to the left of what it sees, or to the right.
        let outside = |(right, ahead): (f64, f64), width: f64| {
            let edge = half_view * ahead + 1.0 + width;
            [ahead <= NEAREST, right <= -edge, right >= edge]
        };
        for (i, object) in objects.iter().enumerate() {
            let at = eye.relative(object.at);
            if at.1 < FARTHEST_OBJECT && outside(at, object.size[0]) == [false; 3] {
                self.visible.push((at.1, i, Thing::Object(i)));
            }
        }
        for (i, shown) in vehicles.enumerate() {
            let [width, _, length] = traffic::SIZE;
            let end = |along: f64| eye.relative(eye.path.beside(along, shown.seen.lateral));
            let at = end(shown.seen.along);
            let near = outside(at, width);
            // Until all of it is on one side of what the camera sees, a part of it shows.
            let in_view = near == [false; 3] || {
                let far = outside(end(shown.seen.along + length), width);
                near.iter().zip(far).all(|(near, far)| !(*near && far))
            };
            if at.1 < FARTHEST_OBJECT && in_view {
                self.visible.push((at.1, objects.len() + i, Thing::Vehicle(shown)));
            }
        }
        self.visible.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(_, _, thing) in &self.visible {
            match thing {
                Thing::Object(i) => self.draw_object(eye, &objects[i], into),
                Thing::Vehicle(shown) => self.draw_vehicle(eye, shown, into),
            }
        }
    }

    fn draw_object(&self, eye: &Eye<'_>, object: &Object, into: &mut impl Canvas) {
        let at = eye.relative(object.at);
        let reflectors =
            if object.kind == ObjectKind::Post || object.kind.is_sign() { REFLECTORS } else { 1.0 };
        let Some((placement, _)) = eye.placement(at, object.size, object.tint, reflectors) else { return };
        if object.kind != ObjectKind::Post && !object.kind.is_sign() {
            self.draw_shadow(eye, &placement, (at.1, object.size[0] * 0.35), into);
        }
        let one_of = |pictures: &'_ [Sprite]| object.variant % pictures.len().max(1);
        let pictures = &self.pictures;
        let (picture, label) = match object.kind {
            ObjectKind::Post => (Some(&pictures.post), Label::Post),
            ObjectKind::Conifer => (pictures.conifers.get(one_of(&pictures.conifers)), Label::Vegetation),
            ObjectKind::Broadleaf => {
                (pictures.broadleaves.get(one_of(&pictures.broadleaves)), Label::Vegetation)
            }
            ObjectKind::Bush => (pictures.bushes.get(one_of(&pictures.bushes)), Label::Vegetation),
            ObjectKind::House => (Some(&pictures.house), Label::Building),
            ObjectKind::LimitSign => (Some(&pictures.limit_sign), Label::Sign),
            ObjectKind::WarningSign => (Some(&pictures.warning_sign), Label::Sign),
            ObjectKind::GuideSign => (Some(&pictures.guide_sign), Label::Sign),
        };
        if let Some(picture) = picture {
            into.paint(picture, placement, Some(label));
        }
    }

    /// Draws the shadow of a thing whose picture goes there, this many metres ahead and with that extent towards the camera.
    fn draw_shadow(
        &self,
        eye: &Eye<'_>,
        thing: &Placement,
        (ahead, extent): (f64, f64),
        into: &mut impl Canvas,
    ) {
        if eye.scene.light.shadow <= 0.0 {
            return;
        }
        let (foot, width) = (thing.top + thing.size[1], thing.size[0]);
        let near = (ahead - extent).max(0.5);
        let (height, _) = eye.terrain.at(near);
        let Some([_, near_edge, _]) = eye.projection.project(0.0, near, height) else { return };
        let half = (near_edge as f32 - foot).max(0.0);
        into.paint(
            &self.pictures.shadow,
            Placement {
                left: thing.left + width * 0.1,
                top: foot - half,
                size: [width, half * 2.0],
                opacity: thing.opacity * eye.scene.light.shadow,
                tint: [1.0; 3],
                ..*thing
            },
            None,
        );
    }

    fn draw_vehicle(&self, eye: &Eye<'_>, shown: Shown, into: &mut impl Canvas) {
        let Shown { seen, parked } = shown;
        let [width, height, length] = traffic::SIZE;
        let place = |along: f64| eye.relative(eye.path.beside(along, seen.lateral));
        let placed = |at: (f64, f64)| eye.placement(at, [width, height], seen.tint, 1.0);
        // As many as possible if its near end is too close to the lens, or behind it.
        let wanted = placed(place(seen.along)).map_or(MOST_SLICES, |(_, scale)| scale * SLICES_PER_SCALE);
        let slices = wanted.clamp(2.0, MOST_SLICES) as usize;
        for share in [0.85, 0.5, 0.15] {
            let at = place(seen.along + length * share);
            if let Some((placement, _)) = placed(at) {
                self.draw_shadow(eye, &placement, (at.1, length * 0.22), into);
            }
        }
        for slice in (0..=slices).rev() {
            // From the far end to the near one; the same picture behind itself looks solid in bends.
            let share = |slice: usize| slice as f64 / slices as f64;
            let along = seen.along + length * share(slice);
            let Some((placement, scale)) = placed(place(along)) else { continue };
            let on_axle = AXLES.iter().any(|axle| (share(slice)..share(slice + 1)).contains(axle));
            let picture = match (slice == 0, slice == slices) {
                (false, false) if on_axle => &self.pictures.axle,
                (false, false) => &self.pictures.body,
                (nearest, _) if nearest == seen.oncoming => &self.pictures.front,
                _ => &self.pictures.rear,
            };
            into.paint(picture, placement, Some(Label::Vehicle));
            if slice == 0 && eye.scene.light.lamps && !parked {
                let lamps = match seen.oncoming {
                    true => &self.pictures.head_lamps,
                    false => &self.pictures.tail_lamps,
                };
                // Never fainter than a point of light.
                let wide = (2.4 * scale).max(2.0) as f32 / placement.size[0].max(0.1);
                let grown = placement.size.map(|s| s * wide.min(3.0));
                let left = placement.left - (grown[0] - placement.size[0]) / 2.0;
                let top = placement.top - (grown[1] - placement.size[1]) / 2.0;
                into.paint(lamps, Placement { left, top, size: grown, tint: [1.0; 3], ..placement }, None);
            }
        }
    }
}
