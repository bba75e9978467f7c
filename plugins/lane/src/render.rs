//! Draws what the camera sees, on the CPU, straight into a frame.
//!
//! Each row of pixels below the horizon shows a strip of [ground](crate::ground) at one distance, which the
//! [terrain](crate::terrain) knows. For each pixel the [`field`](crate::field) says where it lies on the road, and the
//! [`section`](crate::section) gives the colour as the mean over the ground that the pixel covers. Above lies the
//! [sky](crate::sky); trees, houses and vehicles are [pictures](crate::sprite) that come last, far ones first. All texture
//! belongs to places in the world, so that motion shows. Colours are computed in single precision with additions,
//! multiplications and divisions alone, which are the same on every CPU.

use pdk_sdk::prelude::{Frame, FrameMut, Random};

use crate::artwork;
use crate::camera::Projection;
use crate::ground::{Ground, GroundRow, Room};
use crate::labels::{Canvas, Distances, Label, Labels};
use crate::profile::Profile;
use crate::scene::{Object, ObjectKind, Scene};
use crate::section::{Markings, Section};
use crate::sky::{Sky, SkyRow};
use crate::sprite::{Placement, Sprite};
use crate::terrain::Terrain;
use crate::texture::Texture;
use crate::view::View;
use pdk_road::Path;
use pdk_road::traffic::{self, Seen};

/// Objects farther away than this are not drawn, in metres.
const FARTHEST_OBJECT: f64 = 260.0;
/// A vehicle is drawn as slices from its far end to its near one: so many for each pixel that a metre takes there, and
/// at most so many.
const SLICES_PER_SCALE: f64 = 0.8;
const MOST_SLICES: f64 = 26.0;
/// Where the axles are, as shares of a vehicle's length.
const AXLES: [f64; 2] = [0.18, 0.8];

/// What a row of pixels shows.
#[derive(Debug, Clone, Copy)]
enum Row {
    Sky(SkyRow),
    Ground(GroundRow),
}

/// Where the camera is.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// x and z in metres.
    pub at: [f64; 2],
    /// Heading in radians, clockwise from +z.
    pub heading: f64,
    /// Distance along the road in metres.
    pub along: f64,
}

/// A road with everything on and around it, at one moment.
pub struct World<'a, V> {
    /// What stands still.
    pub scene: &'a Scene,
    /// The centre line of the driven lane.
    pub path: &'a Path,
    /// Its heights.
    pub profile: &'a Profile,
    /// The vehicles, in any order.
    pub vehicles: V,
}

/// Something to draw over the ground.
#[derive(Debug, Clone, Copy)]
enum Thing {
    Object(usize),
    Vehicle(Seen),
}

/// The renderer for one frame size.
#[derive(Debug)]
pub struct Renderer {
    projection: Projection,
    width: usize,
    height: usize,
    terrain: Terrain,
    sky: Sky,
    /// Of the frame at hand.
    rows: Vec<Row>,
    /// Distance and order of what may be in view, far ones first; of the frame at hand.
    visible: Vec<(f64, usize, Thing)>,
    room: Room,
    texture: Texture,
    section: Section,
    pictures: Pictures,
}

#[derive(Debug)]
struct Pictures {
    post: Sprite,
    conifer: Sprite,
    broadleaf: Sprite,
    house: Sprite,
    shadow: Sprite,
    body: Sprite,
    axle: Sprite,
    rear: Sprite,
    front: Sprite,
    tail_lamps: Sprite,
    head_lamps: Sprite,
}

impl Renderer {
    /// Prepares everything that is the same for all frames.
    pub fn new(projection: Projection, size: [usize; 2], markings: Markings, random: &mut Random) -> Self {
        let [width, height] = size;
        let texture = Texture::new(random);
        Self {
            projection,
            width,
            height,
            terrain: Terrain::new(height),
            sky: Sky::new(&projection, width),
            rows: Vec::with_capacity(height),
            visible: Vec::new(),
            room: Room::new(width),
            texture,
            section: Section::new(markings),
            pictures: Pictures {
                post: artwork::post(),
                conifer: artwork::conifer(random),
                broadleaf: artwork::broadleaf(random),
                house: artwork::house(),
                shadow: artwork::shadow(),
                body: artwork::body(false),
                axle: artwork::body(true),
                rear: artwork::rear(),
                front: artwork::front(),
                tail_lamps: artwork::lamps([255.0, 42.0, 30.0]),
                head_lamps: artwork::lamps([255.0, 248.0, 226.0]),
            },
        }
    }

    /// Makes room for the objects and vehicles of a scene, so that drawing it allocates nothing.
    pub fn prepare(&mut self, scene: &Scene, vehicles: usize) {
        self.visible.clear();
        self.visible.reserve(scene.objects.len() + vehicles);
    }

    /// Draws a scene. The frame has the size that the renderer was made for.
    pub fn draw(&mut self, world: World<'_, impl Iterator<Item = Seen>>, pose: Pose, mut into: FrameMut<'_>) {
        let scene = world.scene;
        let view = view(scene, pose);
        self.terrain.look(&self.projection, (world.path, world.profile), (pose.at, pose.heading, pose.along));
        let slope = self.terrain.slope();
        self.sky.look(&self.projection, scene, pose.heading, slope);
        self.rows.clear();
        for y in 0..self.height {
            self.rows.push(match self.terrain.strip(y) {
                Some(strip) => Row::Ground(GroundRow::new(strip, &self.texture, &scene.light)),
                None => {
                    let y = y as f64 + 0.5;
                    Row::Sky(SkyRow::new(&self.projection, &self.texture, &scene.light, y, slope))
                }
            });
        }
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2, which is all that this version asks for.
            return unsafe { self.draw_avx2(world, &view, pose, &mut into) };
        }
        self.draw_portable(world, &view, pose, &mut into);
    }

    /// Says what the pixels of the frame show that was drawn last, of the same world and pose, row by row.
    pub fn label(&mut self, world: World<'_, impl Iterator<Item = Seen>>, pose: Pose, into: &mut [u8]) {
        let view = view(world.scene, pose);
        let (texture, section, projection) = (&self.texture, &self.section, &self.projection);
        let ground = Ground { scene: world.scene, texture, section, projection };
        for (row, labels) in self.rows.iter().zip(into.chunks_exact_mut(self.width)) {
            match row {
                Row::Sky(_) => labels.fill(Label::Sky.number()),
                Row::Ground(strip) => ground.label(&view, strip, labels),
            }
        }
        let mut labels = Labels { pixels: into, width: self.width };
        self.draw_things(world, &view, pose, &mut labels);
    }

    /// Says how far away the pixels of the frame are that was drawn last, of the same world and pose, row by row.
    pub fn depth(&mut self, world: World<'_, impl Iterator<Item = Seen>>, pose: Pose, into: &mut [f32]) {
        let view = view(world.scene, pose);
        for (row, distances) in self.rows.iter().zip(into.chunks_exact_mut(self.width)) {
            distances.fill(match row {
                Row::Sky(_) => f32::INFINITY,
                Row::Ground(strip) => strip.depth(&self.projection),
            });
        }
        let mut distances = Distances { pixels: into, width: self.width };
        self.draw_things(world, &view, pose, &mut distances);
    }

    /// The same operations in the same order, compiled for AVX2: the same bytes, faster.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn draw_avx2(
        &mut self,
        world: World<'_, impl Iterator<Item = Seen>>,
        view: &View,
        pose: Pose,
        into: &mut FrameMut<'_>,
    ) {
        self.draw_portable(world, view, pose, into);
    }

    #[inline(always)]
    fn draw_portable(
        &mut self,
        world: World<'_, impl Iterator<Item = Seen>>,
        view: &View,
        pose: Pose,
        into: &mut FrameMut<'_>,
    ) {
        self.draw_background(world.scene, view, into);
        self.draw_things(world, view, pose, into);
    }

    /// Draws ground and sky.
    #[inline(always)]
    fn draw_background(&mut self, scene: &Scene, view: &View, into: &mut FrameMut<'_>) {
        let (texture, section, projection) = (&self.texture, &self.section, &self.projection);
        let ground = Ground { scene, texture, section, projection };
        for (y, row) in into.rows_mut().enumerate() {
            match &self.rows[y] {
                Row::Ground(strip) => ground.draw(view, strip, &mut self.room, row),
                Row::Sky(sky) => self.sky.draw(
                    (view, projection),
                    (scene, texture),
                    (sky, y as f32 + 0.5),
                    &mut self.room,
                    row,
                ),
            }
        }
    }

    #[inline(always)]
    fn draw_things(
        &mut self,
        world: World<'_, impl Iterator<Item = Seen>>,
        view: &View,
        pose: Pose,
        into: &mut impl Canvas,
    ) {
        let World { scene, path, vehicles, .. } = world;
        let [sine, cosine] = view.direction;
        let relative = |at: [f64; 2]| {
            let (dx, dz) = (at[0] - pose.at[0], at[1] - pose.at[1]);
            (dx * cosine - dz * sine, dx * sine + dz * cosine)
        };
        let half_view = self.projection.centre_x / self.projection.focal;
        let objects = &scene.objects;
        self.visible.clear();
        let mut consider = |at: [f64; 2], width: f64, order: usize, thing: Thing| {
            let (right, ahead) = relative(at);
            let in_view = right.abs() - width < half_view * ahead + 1.0;
            if ahead > 0.5 && ahead < FARTHEST_OBJECT && in_view {
                self.visible.push((ahead, order, thing));
            }
        };
        for (i, object) in objects.iter().enumerate() {
            consider(object.at, object.size[0], i, Thing::Object(i));
        }
        for (i, seen) in vehicles.enumerate() {
            let at = path.beside(seen.along, seen.lateral);
            consider(at, traffic::SIZE[0], objects.len() + i, Thing::Vehicle(seen));
        }
        self.visible.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(_, _, thing) in &self.visible {
            match thing {
                Thing::Object(i) => {
                    let object = &objects[i];
                    self.draw_object(scene, object, relative(object.at), into);
                }
                Thing::Vehicle(seen) => self.draw_vehicle((scene, path), seen, &relative, into),
            }
        }
    }

    /// Where something of `size` metres appears whose foot is at a place, with the light and air there; and its scale in
    /// pixels a metre. `None` where it is too close to the lens.
    #[inline(always)]
    fn placement(
        &self,
        scene: &Scene,
        (right, ahead): (f64, f64),
        size: [f64; 2],
        tint: [f32; 3],
    ) -> Option<(Placement, f64)> {
        let (height, bottom) = self.terrain.at(ahead);
        let [x, foot, scale] = self.projection.project(right, ahead, height)?;
        let [width, tall] = size.map(|s| s * scale);
        let air = 1.0 - libm::exp(-ahead / scene.light.visibility);
        let ambient = scene.light.ambient;
        let placement = Placement {
            left: (x - width / 2.0) as f32,
            top: (foot - tall) as f32,
            size: [width as f32, tall as f32],
            depth: (self.projection.focal / scale) as f32,
            // Things come into sight gradually.
            opacity: ((FARTHEST_OBJECT - ahead) / 40.0).min(1.0) as f32,
            tint: [0, 1, 2].map(|c| tint[c] * ambient[c]),
            haze: (scene.light.haze, air as f32),
            // The ground that a thing stands on hides nothing of it.
            bottom: if bottom + 1.0 < foot { bottom as f32 } else { f32::INFINITY },
        };
        Some((placement, scale))
    }

    #[inline(always)]
    fn draw_object(&self, scene: &Scene, object: &Object, at: (f64, f64), into: &mut impl Canvas) {
        let Some((placement, _)) = self.placement(scene, at, object.size, object.tint) else { return };
        if object.kind != ObjectKind::Post {
            self.draw_shadow(scene, &placement, (at.1, object.size[0] * 0.35), into);
        }
        let (picture, label) = match object.kind {
            ObjectKind::Post => (&self.pictures.post, Label::Post),
            ObjectKind::Conifer => (&self.pictures.conifer, Label::Vegetation),
            ObjectKind::Broadleaf => (&self.pictures.broadleaf, Label::Vegetation),
            ObjectKind::House => (&self.pictures.house, Label::Building),
        };
        into.paint(picture, placement, Some(label));
    }

    /// Draws the shadow of a thing whose picture goes there, so many metres ahead and with that extent towards the camera.
    #[inline(always)]
    fn draw_shadow(
        &self,
        scene: &Scene,
        thing: &Placement,
        (ahead, extent): (f64, f64),
        into: &mut impl Canvas,
    ) {
        if scene.light.shadow <= 0.0 {
            return;
        }
        let (foot, width) = (thing.top + thing.size[1], thing.size[0]);
        let near = (ahead - extent).max(0.5);
        let (height, _) = self.terrain.at(near);
        let Some([_, near_edge, _]) = self.projection.project(0.0, near, height) else { return };
        let half = (near_edge as f32 - foot).max(0.0);
        into.paint(
            &self.pictures.shadow,
            Placement {
                left: thing.left + width * 0.1,
                top: foot - half,
                size: [width, half * 2.0],
                opacity: thing.opacity * scene.light.shadow,
                tint: [1.0; 3],
                ..*thing
            },
            None,
        );
    }

    #[inline(always)]
    fn draw_vehicle(
        &self,
        (scene, path): (&Scene, &Path),
        seen: Seen,
        relative: &impl Fn([f64; 2]) -> (f64, f64),
        into: &mut impl Canvas,
    ) {
        let [width, height, length] = traffic::SIZE;
        let near = relative(path.beside(seen.along, seen.lateral));
        let Some((_, scale)) = self.placement(scene, near, [width, height], seen.tint) else { return };
        let slices = (scale * SLICES_PER_SCALE).clamp(2.0, MOST_SLICES) as usize;
        for share in [0.85, 0.5, 0.15] {
            let at = relative(path.beside(seen.along + length * share, seen.lateral));
            if let Some((placement, _)) = self.placement(scene, at, [width, height], seen.tint) {
                self.draw_shadow(scene, &placement, (at.1, length * 0.22), into);
            }
        }
        for slice in (0..=slices).rev() {
            // From the far end to the near one; the same picture behind itself looks solid in bends.
            let place = |slice: usize| slice as f64 / slices as f64;
            let along = seen.along + length * place(slice);
            let at = relative(path.beside(along, seen.lateral));
            let Some((placement, scale)) = self.placement(scene, at, [width, height], seen.tint) else {
                return;
            };
            let on_axle = AXLES.iter().any(|axle| (place(slice)..place(slice + 1)).contains(axle));
            let picture = match (slice == 0, slice == slices) {
                (false, false) if on_axle => &self.pictures.axle,
                (false, false) => &self.pictures.body,
                (nearest, _) if nearest == seen.oncoming => &self.pictures.front,
                _ => &self.pictures.rear,
            };
            into.paint(picture, placement, Some(Label::Vehicle));
            if slice == 0 && scene.light.lamps {
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

    /// Whether a frame has the size that the renderer was made for.
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        frame.width() == self.width && frame.height() == self.height
    }
}

/// Where the camera looks from, on the field's map.
fn view(scene: &Scene, pose: Pose) -> View {
    let (sine, cosine) = (libm::sin(pose.heading), libm::cos(pose.heading));
    View {
        at: [(pose.at[0] - scene.field.origin()[0]) as f32, (pose.at[1] - scene.field.origin()[1]) as f32],
        ahead: [sine as f32, cosine as f32],
        right: [cosine as f32, -sine as f32],
        direction: [sine, cosine],
    }
}
