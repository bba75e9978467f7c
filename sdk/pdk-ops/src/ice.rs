//! A texture of ice: feathers that grow inwards from the edges, over a film that is thickest at the edges and cloudy everywhere.
//! It is the same one always.

use std::f64::consts::PI;

use crate::canvas::{Canvas, Point, Texel, ahead, smooth_step};
use pdk_seed::{Key, Random};

/// The texture is drawn from the sequence stream of this key.
const KEY: Key = Key(*b"ice crystals on the windscreen\0\0");
/// The number of feathers in focus, and behind them out of focus.
const FEATHERS: usize = 150;
const BLURRED_FEATHERS: usize = 36;
/// Side branches leave at 60 degrees, as the hexagonal lattice of ice has it.
const BRANCH_ANGLE: f64 = PI / 3.0;

/// The texture for a frame of this size.
pub fn draw(width: usize, height: usize) -> Vec<Texel> {
    let mut random = KEY.sequence();
    let mut crystals = Canvas::new(width, height);
    let mut blurred = crystals.clone();
    let unit = crystals.unit();
    for _ in 0..BLURRED_FEATHERS {
        let (root, angle, length) = root(&blurred, 0.45, &mut random);
        feather(&mut blurred, root, angle, length * 1.6, 1.1 * unit, &mut random);
    }
    for _ in 0..FEATHERS {
        let (root, angle, length) = root(&crystals, 0.38, &mut random);
        feather(&mut crystals, root, angle, length, 0.34 * unit, &mut random);
    }
    let film = Canvas::clouds(width, height, 14.0 * unit, 5, &mut random);
    let grain = Canvas::clouds(width, height, 0.9 * unit, 2, &mut random);
    let texel = |i: usize| {
        let edge = edge_nearness(i % width, i / width, width, height);
        let thickness = smooth_step(0.35, 1.0, 0.75 * film.shades[i] + 0.55 * edge);
        let crystal = 1.0 - (1.0 - crystals.shades[i]) * (1.0 - 0.45 * blurred.shades[i]);
        let shade =
            0.54 + 0.17 * thickness + 0.1 * (grain.shades[i] - 0.5) + 0.32 * crystal * (0.7 + 0.3 * edge);
        // Thin ice is bluer than white crystals.
        let tint = 0.05 * (1.0 - crystal);
        let cover = 1.0 - (1.0 - 0.65 * thickness) * (1.0 - 0.9 * crystal);
        Texel { rgb: [shade - tint, shade, shade + tint], cover }
    };
    (0..width * height).map(texel).collect()
}

/// 1 at the edges of the frame, 0 in the middle.
fn edge_nearness(x: usize, y: usize, width: usize, height: usize) -> f64 {
    let distance = |i: usize, length: usize| (i.min(length - 1 - i) as f64 + 0.5) / (0.5 * length as f64);
    1.0 - distance(x, width).min(distance(y, height)).min(1.0)
}

/// Where a feather begins, its direction and its length: mostly near an edge, `reach` of the way to the middle at most,
/// growing inwards, and longer the nearer to the edge.
fn root(canvas: &Canvas, reach: f64, random: &mut Random) -> (Point, f64, f64) {
    let (width, height) = (canvas.width as f64, canvas.height as f64);
    let depth = random.unit() * random.unit();
    let inset = depth * reach * width.min(height);
    let along = random.uniform(0.0, width + height);
    let near = random.below(2) == 0;
    let (root, inwards) = match (along < width, near) {
        (true, true) => ([along, inset], PI / 2.0),
        (true, false) => ([along, height - inset], -PI / 2.0),
        (false, true) => ([inset, along - width], 0.0),
        (false, false) => ([width - inset, along - width], PI),
    };
    let angle = inwards + random.uniform(-1.1, 1.1);
    let length = canvas.unit() * random.uniform(8.0, 23.0) * (1.1 - 0.6 * depth);
    (root, angle, length)
}

/// A slightly bent stem with branches on both sides that get shorter towards its tip, and twigs on the branches.
fn feather(canvas: &mut Canvas, root: Point, angle: f64, length: f64, radius: f64, random: &mut Random) {
    const STEPS: usize = 26;
    let bend = random.uniform(-0.35, 0.35) / STEPS as f64;
    let bright = random.uniform(0.3, 0.7);
    let (mut from, mut angle) = (root, angle);
    for step in 0..STEPS {
        let place = step as f64 / STEPS as f64;
        let to = ahead(from, angle, length / STEPS as f64);
        let thin = 1.0 - 0.65 * place;
        canvas.stroke(from, to, radius * 1.3 * thin, bright);
        for side in [-1.0, 1.0] {
            let branch =
                length * 0.26 * (1.0 - place) * smooth_step(-0.1, 0.25, place) * random.uniform(0.6, 1.1);
            let direction = angle + side * (BRANCH_ANGLE + random.uniform(-0.12, 0.12));
            let tip = ahead(from, direction, branch);
            canvas.stroke(from, tip, radius * 0.8 * thin, bright * 0.8);
            for part in [0.35, 0.65] {
                let knot = ahead(from, direction, branch * part);
                let twig = ahead(knot, direction - side * BRANCH_ANGLE, branch * 0.3 * (1.2 - part));
                canvas.stroke(knot, twig, radius * 0.55 * thin, bright * 0.6);
            }
        }
        (from, angle) = (to, angle + bend);
    }
}
