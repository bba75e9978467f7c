//! Draws what the camera sees, on the CPU, straight into a frame.
//!
//! Each row of pixels below the horizon shows a strip of [ground](crate::ground) at one distance, which the
//! [terrain](crate::terrain) knows. For each pixel the [`field`](crate::field) says where it lies on the road, and the
//! [`section`](crate::section) gives the colour as the mean over the ground that the pixel covers. Above lies the
//! [sky](crate::sky); [things](crate::things) that stand upright come last, far ones first. All texture
//! belongs to places in the world, so that motion shows. At the very end a [sensor](crate::sensor) may take the picture. Colours are computed in single precision with additions,
//! multiplications and divisions alone, which are the same on every CPU.

use pdk_sdk::prelude::{Frame, FrameMut, Key, Random};

use crate::camera::Projection;
use crate::damage;
use crate::ground::{Ground, GroundRow};
use crate::labels::{Canvas, Distances, Label, Labels};
use crate::profile::Profile;
use crate::room::Room;
use crate::scene::Scene;
use crate::section::{Markings, Section};
use crate::sensor::Sensor;
use crate::sky::{Sky, SkyRow};
use crate::terrain::Terrain;
use crate::texture::Texture;
use crate::things::{Eye, Shown, Things};
use crate::view::View;
use pdk_road::Path;

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
    room: Room,
    texture: Texture,
    damage: Texture,
    section: Section,
    things: Things,
    sensor: Option<Sensor>,
}

impl Renderer {
    /// Prepares everything that is the same for all frames: of scenes as in a drawing, or as cameras see them.
    pub fn new(
        (projection, size): (Projection, [usize; 2]),
        markings: Markings,
        natural: bool,
        sensor: Option<Sensor>,
        random: &mut Random,
    ) -> Self {
        let [width, height] = size;
        let texture = Texture::new(random);
        let things = Things::new(natural, random);
        let damage = if natural { damage::draw(random) } else { Texture::of(vec![0.0; 4]) };
        let section = if natural { Section::natural(markings) } else { Section::drawn(markings) };
        Self {
            projection,
            width,
            height,
            terrain: Terrain::new(height),
            sky: Sky::new(&projection, width),
            rows: Vec::with_capacity(height),
            room: Room::new(width),
            texture,
            damage,
            section,
            things,
            sensor,
        }
    }

    /// Makes room for the objects and vehicles of a scene, so that drawing it allocates nothing.
    pub fn prepare(&mut self, scene: &Scene, vehicles: usize) {
        self.things.prepare(scene, vehicles);
    }

    /// Draws a scene; `taken` is the key and the number by which the camera's noise is drawn. The frame has the size that the
    /// renderer was made for.
    pub fn draw(
        &mut self,
        world: World<'_, impl Iterator<Item = Shown>>,
        pose: Pose,
        taken: (&Key, u64),
        mut into: FrameMut<'_>,
    ) {
        let scene = world.scene;
        let view = view(scene, pose);
        self.terrain.look(&self.projection, (world.path, world.profile), (pose.at, pose.heading, pose.along));
        let slope = self.terrain.slope();
        self.sky.look(&self.projection, scene, pose.heading, slope);
        self.rows.clear();
        for y in 0..self.height {
            self.rows.push(match self.terrain.strip(y) {
                Some(strip) => {
                    let damage = scene.wear.is_some().then_some(&self.damage);
                    Row::Ground(GroundRow::new(strip, &self.texture, damage, &scene.light, &self.projection))
                }
                None => {
                    let y = y as f64 + 0.5;
                    Row::Sky(SkyRow::new(&self.projection, &self.texture, &scene.light, y, slope))
                }
            });
        }
        self.draw_background(scene, &view, &mut into);
        self.draw_things(world, &view, pose, &mut into);
        if let Some(sensor) = &self.sensor {
            sensor.expose(&mut into, taken.0, taken.1);
        }
    }

    /// Says what the pixels of the frame show that was drawn last, of the same world and pose, row by row.
    pub fn label(&mut self, world: World<'_, impl Iterator<Item = Shown>>, pose: Pose, into: &mut [u8]) {
        let view = view(world.scene, pose);
        let ground = self.ground(world.scene);
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
    pub fn depth(&mut self, world: World<'_, impl Iterator<Item = Shown>>, pose: Pose, into: &mut [f32]) {
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

    fn ground<'a>(&'a self, scene: &'a Scene) -> Ground<'a> {
        let Self { texture, damage, section, projection, .. } = self;
        Ground { scene, texture, damage, section, projection }
    }

    /// Draws ground and sky.
    fn draw_background(&mut self, scene: &Scene, view: &View, into: &mut FrameMut<'_>) {
        let Self { texture, damage, section, projection, room, sky, rows, .. } = self;
        let ground = Ground { scene, texture, damage, section, projection };
        for (y, (pixels, row)) in into.rows_mut().zip(rows.iter()).enumerate() {
            match row {
                Row::Ground(strip) => ground.draw(view, strip, room, pixels),
                Row::Sky(row) => {
                    let row = (row, y as f32 + 0.5);
                    sky.draw((view, projection), (scene, texture), row, room, pixels);
                }
            }
        }
    }

    fn draw_things(
        &mut self,
        world: World<'_, impl Iterator<Item = Shown>>,
        view: &View,
        pose: Pose,
        into: &mut impl Canvas,
    ) {
        let World { scene, path, vehicles, .. } = world;
        let (projection, terrain) = (&self.projection, &self.terrain);
        let eye = Eye { scene, path, projection, terrain, at: pose.at, direction: view.direction };
        self.things.draw(&eye, vehicles, into);
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
