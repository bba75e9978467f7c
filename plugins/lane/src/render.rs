//! Draws what the camera sees, on the CPU, straight into a frame.
//!
//! Each row of pixels below the horizon shows a strip of ground at one distance. For each pixel the [`field`](crate::field)
//! says where it lies on the road, and the [`section`](crate::section) gives the colour as the mean over the
//! ground that the pixel covers. All texture belongs to places in the world, so that motion shows. Colours are computed
//! in single precision with additions, multiplications and divisions alone, which are the same on every CPU.

use pdk_sdk::prelude::{Frame, FrameMut, Random};

use crate::camera::Projection;
use crate::places::Places;
use crate::scene::{Object, ObjectKind, Scene};
use crate::section::{self, Section};
use crate::sprite::{Placement, Sprite};
use crate::texture::{Scale, Texture};

/// Colour of the sky overhead and of the air at the horizon.
const ZENITH: [f32; 3] = [72.0, 128.0, 200.0];
const HAZE: [f32; 3] = [204.0, 219.0, 228.0];
const CLOUD: [f32; 3] = [244.0, 246.0, 248.0];
/// Colour of the far and the near hills.
const HILLS: [[f32; 3]; 2] = [[138.0, 163.0, 184.0], [108.0, 140.0, 124.0]];
/// Distance over which the air takes 63 % of a colour, in metres.
const VISIBILITY: f64 = 700.0;
/// Objects farther away than this are not drawn, in metres.
const FARTHEST_OBJECT: f64 = 260.0;
/// Texels a metre of the two layers of texture: grain everywhere, and patches in the grass.
const GRAIN: f32 = 30.0;
const PATCHES: f32 = 0.45;
/// What patches add to the colour of grass; the fourth number goes unused, as in all colours that are computed by fours.
const PATCH: [f32; 4] = [24.0, 13.0, -2.0, 0.0];

/// What a row of pixels shows.
#[derive(Debug)]
enum Row {
    Sky { colour: [f32; 3], clouds: f32, right: f32, ahead: f32, scale: Scale },
    Ground(GroundRow),
}

/// A row of ground, prepared for all frames.
#[derive(Debug)]
struct GroundRow {
    ahead: f32,
    pixel_width: f32,
    pixel_depth: f32,
    haze: f32,
    grain: Scale,
    patches: Scale,
}

/// Where the camera is.
#[derive(Debug, Clone, Copy)]
pub struct Pose {
    /// x and z in metres.
    pub at: [f64; 2],
    /// Heading in radians, clockwise from +z.
    pub heading: f64,
}

/// The renderer for one frame size.
#[derive(Debug)]
pub struct Renderer {
    projection: Projection,
    width: usize,
    rows: Vec<Row>,
    /// Angle of each column to the right of the optical axis in radians, with its cosine.
    columns: Vec<(f64, f32)>,
    /// The rows on which the far and the near hills begin, by column; of the frame at hand.
    hill_tops: Vec<[f32; 2]>,
    /// Distance and number of each object that may be in view, far ones first; of the frame at hand.
    visible: Vec<(f64, usize)>,
    texture: Texture,
    section: Section,
    post: Sprite,
    conifer: Sprite,
    broadleaf: Sprite,
    shadow: Sprite,
}

impl Renderer {
    /// Prepares everything that is the same for all frames.
    pub fn new(width: usize, height: usize, random: &mut Random) -> Self {
        let projection = Projection::new(width, height);
        let texture = Texture::new(random);
        let rows = (0..height).map(|y| row(&projection, &texture, y as f64 + 0.5)).collect();
        let columns = (0..width)
            .map(|x| {
                let angle = libm::atan((x as f64 + 0.5 - projection.centre_x) / projection.focal);
                (angle, libm::cos(angle) as f32)
            })
            .collect();
        Self {
            projection,
            width,
            rows,
            columns,
            hill_tops: vec![[0.0; 2]; width],
            visible: Vec::new(),
            texture,
            section: Section::new(),
            post: Sprite::post(),
            conifer: Sprite::conifer(random),
            broadleaf: Sprite::broadleaf(random),
            shadow: Sprite::shadow(),
        }
    }

    /// Makes room for the objects of a scene, so that drawing it allocates nothing.
    pub fn prepare(&mut self, scene: &Scene) {
        self.visible.clear();
        self.visible.reserve(scene.objects.len());
    }

    /// Draws a scene. The frame has the size that the renderer was made for.
    pub fn draw(&mut self, scene: &Scene, pose: Pose, mut into: FrameMut<'_>) {
        let (sine, cosine) = (libm::sin(pose.heading), libm::cos(pose.heading));
        let view = View {
            at: [
                (pose.at[0] - scene.field.origin()[0]) as f32,
                (pose.at[1] - scene.field.origin()[1]) as f32,
            ],
            ahead: [sine as f32, cosine as f32],
            right: [cosine as f32, -sine as f32],
        };
        self.raise_hills(scene, pose.heading);
        for (y, row) in into.rows_mut().enumerate() {
            match &self.rows[y] {
                Row::Ground(ground) => self.draw_ground(scene, &view, ground, row),
                Row::Sky { colour, clouds, right, ahead, scale } => {
                    self.draw_sky(&view, y as f32 + 0.5, (*colour, *clouds, *right, *ahead, *scale), row);
                }
            }
        }
        self.draw_objects(scene, pose, [sine, cosine], &mut into);
    }

    fn draw_ground(&self, scene: &Scene, view: &View, ground: &GroundRow, row: &mut [u8]) {
        let across = view.right.map(|r| r * ground.pixel_width);
        let along = view.ahead.map(|a| a * ground.pixel_depth);
        let left = 0.5 - self.projection.centre_x as f32;
        let start = [0, 1].map(|k| view.at[k] + view.ahead[k] * ground.ahead + across[k] * left);
        let clear = 1.0 - ground.haze;
        let [r, g, b] = HAZE.map(|c| c * ground.haze);
        let haze = [r, g, b, 0.0];
        let mut places = Places::new(&scene.field, start, across, ground.pixel_width);
        for (i, pixel) in row.chunks_exact_mut(3).enumerate() {
            let (x, z) = (start[0] + across[0] * i as f32, start[1] + across[1] * i as f32);
            let grain = self.texture.at(x, z, ground.grain);
            let mut surface = section::grass();
            let mut meadow = 1.0;
            if let Some(place) = places.at(i, x, z) {
                let offset = place.lateral - section::ROAD_CENTRE as f32;
                if offset.abs() < section::HALF_WIDTH + 1.0 {
                    let [gx, gz] = place.gradient;
                    // How far the pixel extends across the road, and along it.
                    let extent = |x: f32, z: f32| {
                        (x * across[0] + z * across[1]).abs() + (x * along[0] + z * along[1]).abs()
                    };
                    let wide = extent(gx, gz);
                    surface = self.section.mean(offset, wide);
                    let half_line = section::LINE_WIDTH as f32 / 2.0;
                    if offset.abs() < half_line + wide {
                        let line = section::cover(offset, wide.max(0.01), -half_line, half_line);
                        let share = line * section::dash_cover(place.along, extent(gz, -gx));
                        for (c, yellow) in surface.iter_mut().zip(section::YELLOW) {
                            *c += (yellow - *c) * share;
                        }
                    }
                    meadow = (offset.abs() - section::PAVED_HALF_WIDTH as f32 - 0.2).clamp(0.0, 1.0);
                }
            }
            let mut patch = 0.0;
            if meadow > 0.0 {
                patch = self.texture.at(x, z, ground.patches) * meadow * clear;
            }
            let detail = (1.0 + surface[3] * grain * 1.6) * clear;
            for channel in 0..4 {
                surface[channel] = surface[channel] * detail + patch * PATCH[channel] + haze[channel];
            }
            write(pixel, surface);
        }
    }

    fn draw_sky(
        &self,
        view: &View,
        y: f32,
        (colour, clouds, right, ahead, scale): ([f32; 3], f32, f32, f32, Scale),
        row: &mut [u8],
    ) {
        let left = 0.5 - self.projection.centre_x as f32;
        for (i, pixel) in row.chunks_exact_mut(3).enumerate() {
            let mut rgb = colour;
            let tops = self.hill_tops[i];
            // Not where the near hills hide it anyway.
            if clouds > 0.0 && y < tops[1] + 1.0 {
                let to_right = right * (i as f32 + left);
                let x = view.ahead[0] * ahead + view.right[0] * to_right;
                let z = view.ahead[1] * ahead + view.right[1] * to_right;
                let density = self.texture.at(x, z, scale) + 0.05;
                let cover = (density * 1.6).clamp(0.0, 1.0) * clouds;
                for (c, cloud) in rgb.iter_mut().zip(CLOUD) {
                    *c += (cloud - *c) * cover;
                }
            }
            for (top, hill) in tops.into_iter().zip(HILLS) {
                let cover = (y + 0.5 - top).clamp(0.0, 1.0);
                if cover > 0.0 {
                    // Haze gathers at the foot of the hills.
                    let foot = self.projection.horizon() as f32;
                    let share = ((y - top) / (foot - top + 1.0)).clamp(0.0, 1.0) * 0.45;
                    for channel in 0..3 {
                        let seen = hill[channel] + (HAZE[channel] - hill[channel]) * share;
                        rgb[channel] += (seen - rgb[channel]) * cover;
                    }
                }
            }
            write(pixel, [rgb[0], rgb[1], rgb[2], 0.0]);
        }
    }

    /// Finds the rows on which the hills begin.
    fn raise_hills(&mut self, scene: &Scene, heading: f64) {
        let horizon = self.projection.horizon() as f32;
        let focal = self.projection.focal as f32;
        for (top, (angle, cosine)) in self.hill_tops.iter_mut().zip(&self.columns) {
            // Exact on the optical axis; the camera's small pitch is neglected beside it.
            *top = scene.hills_towards(heading + angle).map(|tangent| horizon - tangent / cosine * focal);
        }
    }

    fn draw_objects(&mut self, scene: &Scene, pose: Pose, [sine, cosine]: [f64; 2], into: &mut FrameMut<'_>) {
        let relative = |object: &Object| {
            let (dx, dz) = (object.at[0] - pose.at[0], object.at[1] - pose.at[1]);
            (dx * cosine - dz * sine, dx * sine + dz * cosine)
        };
        let half_view = self.projection.centre_x / self.projection.focal;
        self.visible.clear();
        for (i, object) in scene.objects.iter().enumerate() {
            let (right, ahead) = relative(object);
            let in_view = right.abs() - object.size[0] < half_view * ahead + 1.0;
            if ahead > 0.5 && ahead < FARTHEST_OBJECT && in_view {
                self.visible.push((ahead, i));
            }
        }
        self.visible.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for &(ahead, i) in &self.visible {
            let object = &scene.objects[i];
            let (right, _) = relative(object);
            let Some([x, foot, scale]) = self.projection.project(right, ahead, 0.0) else { continue };
            let [width, height] = object.size.map(|s| s * scale);
            let air = 1.0 - libm::exp(-ahead / VISIBILITY);
            // They come into sight gradually.
            let opacity = ((FARTHEST_OBJECT - ahead) / 40.0).min(1.0) as f32;
            if object.kind != ObjectKind::Post {
                let near_edge = self.projection.row_of((ahead - object.size[0] * 0.35).max(0.5));
                let half = near_edge - foot;
                self.shadow.draw(
                    into,
                    Placement {
                        left: (x - width * 0.4) as f32,
                        top: (foot - half) as f32,
                        size: [(width * 1.0) as f32, (half * 2.0) as f32],
                        opacity: opacity * 0.55,
                        brightness: 1.0,
                        haze: (HAZE, air as f32),
                    },
                );
            }
            let picture = match object.kind {
                ObjectKind::Post => &self.post,
                ObjectKind::Conifer => &self.conifer,
                ObjectKind::Broadleaf => &self.broadleaf,
            };
            picture.draw(
                into,
                Placement {
                    left: (x - width / 2.0) as f32,
                    top: (foot - height) as f32,
                    size: [width as f32, height as f32],
                    opacity,
                    brightness: object.brightness,
                    haze: (HAZE, air as f32),
                },
            );
        }
    }

    /// Whether a frame has the size that the renderer was made for.
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        frame.width() == self.width && frame.height() == self.rows.len()
    }
}

/// Rounds a colour to bytes. The fourth number is left out.
#[inline]
fn write(pixel: &mut [u8], colour: [f32; 4]) {
    // In a number just above 2^23 the lowest bits are those of the whole number added: faster than a conversion.
    let rounded = colour.map(|c| (c.clamp(0.0, 255.0) + 8_388_608.0).to_bits());
    for channel in 0..3 {
        pixel[channel] = rounded[channel] as u8;
    }
}

/// The camera's place and directions on the ground, relative to the corner of the field.
struct View {
    at: [f32; 2],
    ahead: [f32; 2],
    right: [f32; 2],
}

fn row(projection: &Projection, texture: &Texture, y: f64) -> Row {
    if y < projection.horizon() {
        return sky(projection, texture, y);
    }
    // What is left between the horizon and the first row of ground is so far away that it is all haze.
    let ground = projection.ground(y).unwrap_or(crate::camera::GroundRow {
        ahead: 5_000.0,
        pixel_width: 20.0,
        pixel_depth: 2_000.0,
    });
    // Between the two extents of a pixel: with the larger one texture would vanish early, with the smaller one it flickers.
    let footprint = (ground.pixel_width * ground.pixel_depth).sqrt() as f32;
    Row::Ground(GroundRow {
        ahead: ground.ahead as f32,
        pixel_width: ground.pixel_width as f32,
        pixel_depth: ground.pixel_depth as f32,
        haze: (0.9 * (1.0 - libm::exp(-ground.ahead.abs() / VISIBILITY))) as f32,
        grain: texture.scale(GRAIN, footprint),
        patches: texture.scale(PATCHES, footprint),
    })
}

fn sky(projection: &Projection, texture: &Texture, y: f64) -> Row {
    let elevation = projection.elevation(y).max(0.0);
    // Blue grows quickly above the horizon and slowly further up.
    let share = (1.0 - libm::exp(-elevation * 4.5)) as f32;
    let colour = [0, 1, 2].map(|c| HAZE[c] + (ZENITH[c] - HAZE[c]) * share);
    // Clouds lie on a plane one unit up; a unit is as far as the plane is high.
    let ahead = 1.0 / elevation.max(0.01);
    let slant = (1.0 + elevation * elevation).sqrt() / elevation.max(0.01);
    let pixel_width = slant / projection.focal;
    let footprint = pixel_width * slant.sqrt();
    let clouds = ((elevation - 0.04) / 0.25).clamp(0.0, 1.0) * 0.8;
    Row::Sky {
        colour,
        clouds: clouds as f32,
        right: pixel_width as f32,
        ahead: ahead as f32,
        scale: texture.scale(7.0, footprint as f32),
    }
}
