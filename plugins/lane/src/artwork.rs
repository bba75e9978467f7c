//! The pictures of what stands beside the road and drives on it. They are drawn once, when a simulator is made.

use pdk_sdk::prelude::Random;

use crate::sprite::Sprite;

/// A conifer.
pub fn conifer(random: &mut Random) -> Sprite {
    const TIERS: usize = 9;
    let ragged: Vec<f32> = (0..64).map(|_| random.uniform(0.72, 1.0) as f32).collect();
    let lean: Vec<f32> = (0..TIERS).map(|_| random.uniform(-0.05, 0.05) as f32).collect();
    Sprite::drawn(|x, y| {
        if y > 0.9 {
            return (x.abs() < 0.05).then(|| [84.0, 62.0, 44.0].map(|c| c * (0.9 - 0.5 * x / 0.05)));
        }
        // Each tier widens downwards and starts narrower than the one above ends.
        let tier = (y / 0.9 * TIERS as f32) as usize;
        let within = y / 0.9 * TIERS as f32 - tier as f32;
        let widest = 0.12 + 0.8 * (tier as f32 + 1.0) / TIERS as f32;
        // The topmost comes to a point.
        let narrowest = if tier == 0 { 0.05 } else { 0.55 };
        let half = widest * (narrowest + (1.0 - narrowest) * within);
        let centre = lean[tier.min(TIERS - 1)];
        let tooth = ragged[(((x + 1.0) * 16.0) as usize + tier * 5) & 63];
        let side = (x - centre) / half;
        if side.abs() > tooth {
            return None;
        }
        let light = 0.86 - 0.34 * side - 0.3 * (1.0 - within) * (1.0 - side * side);
        Some([52.0, 84.0, 48.0].map(|c| c * light))
    })
}

/// A broad-leaved tree.
pub fn broadleaf(random: &mut Random) -> Sprite {
    // Clumps of leaves, the later ones in front.
    let clumps: Vec<[f32; 4]> = (0..70)
        .map(|i| {
            let depth = i as f64 / 70.0;
            let angle = random.uniform(0.0, 2.0 * std::f64::consts::PI);
            let reach = random.unit().sqrt() * (0.78 - 0.2 * depth);
            let (x, y) = (reach * libm::cos(angle), 0.38 + reach * 0.38 * libm::sin(angle));
            let radius = random.uniform(0.1, 0.22);
            [x, y, radius, random.uniform(-0.1, 0.1)].map(|v| v as f32)
        })
        .collect();
    Sprite::drawn(|x, y| {
        for &[cx, cy, radius, tint] in clumps.iter().rev() {
            // Heights run from 0 to 1 where widths run from -1 to 1.
            let (dx, dy) = ((x - cx) / radius, (y - cy) * 2.0 / radius);
            if dx * dx + dy * dy < 1.0 {
                let light = 0.8 - 0.2 * dx - 0.22 * dy - 0.38 * (y - 0.3) + tint;
                return Some([88.0, 114.0, 52.0].map(|c| c * light));
            }
        }
        let half = 0.05 + 0.05 * (y - 0.9).max(0.0) * 10.0;
        (y > 0.5 && x.abs() < half).then(|| [92.0, 72.0, 54.0].map(|c| c * (0.85 - 0.4 * x / half)))
    })
}

/// A delineator post: white with a black band and a reflector.
pub fn post() -> Sprite {
    Sprite::drawn(|x, y| {
        let light = 0.95 - 0.2 * x;
        // The top slants.
        if y < 0.03 + 0.03 * x {
            return None;
        }
        let band = (0.14..0.36).contains(&(y - 0.06 * x));
        let reflector = band && x.abs() < 0.5 && (0.19..0.31).contains(&y);
        Some(if reflector {
            [250.0, 150.0, 40.0]
        } else if band {
            [38.0, 38.0, 42.0].map(|c| c * light)
        } else {
            [238.0, 238.0, 234.0].map(|c| c * light)
        })
    })
}

/// The shadow of something round, black and fading outwards.
pub fn shadow() -> Sprite {
    Sprite::veil([0.0; 3], |x, y| {
        let from_middle = (2.0 * x - 1.0) * (2.0 * x - 1.0) + (2.0 * y - 1.0) * (2.0 * y - 1.0);
        (1.0 - from_middle).max(0.0)
    })
}

/// A house, seen from its gable end: white walls that take a tint, a tiled roof, windows and a door.
pub fn house() -> Sprite {
    Sprite::drawn(|x, y| {
        let roof = 0.04 + 0.42 * x.abs();
        if y < roof {
            return None;
        }
        // The edge of the roof, and the eaves that stand over the walls.
        if y < roof + 0.06 && y < 0.52 {
            return Some([122.0, 62.0, 48.0].map(|c| c * (0.95 - 0.2 * x)));
        }
        if x.abs() > 0.88 {
            return None;
        }
        let light = 0.96 - 0.14 * x;
        let pane = |left: f32, top: f32, wide: f32, high: f32| {
            let (dx, dy) = ((x - left) / wide, (y - top) / high);
            ((0.0..1.0).contains(&dx) && (0.0..1.0).contains(&dy)).then(|| {
                // A frame and a cross divide the glass.
                let bar = (dx - 0.5).abs() > 0.42 || (dy - 0.5).abs() > 0.42 || (dx - 0.5).abs() < 0.05;
                if bar { [212.0, 208.0, 200.0] } else { [62.0, 76.0, 90.0].map(|c| c * (1.2 - 0.4 * dy)) }
            })
        };
        let windows =
            [pane(-0.62, 0.56, 0.4, 0.17), pane(0.22, 0.56, 0.4, 0.17), pane(-0.15, 0.28, 0.3, 0.13)];
        if let Some(window) = windows.into_iter().flatten().next() {
            return Some(window);
        }
        if (-0.16..0.12).contains(&x) && y > 0.72 {
            return Some([104.0, 76.0, 52.0].map(|c| c * light));
        }
        let plinth = if y > 0.93 { 0.72 } else { 1.0 };
        Some([226.0, 218.0, 202.0].map(|c| c * light * plinth))
    })
}

/// Half the width of a vehicle's outline at a height: y from 0 (roof) to 1 (road).
fn outline(y: f32) -> f32 {
    match y {
        y if y < 0.08 => 0.5 + 1.6 * y,
        y if y < 0.42 => 0.63 + 0.62 * (y - 0.08),
        y if y < 0.5 => 0.84 + 1.4 * (y - 0.42),
        y if y < 0.86 => 0.95,
        _ => 0.0,
    }
}

/// Whether a place belongs to a tyre.
fn tyre(x: f32, y: f32) -> bool {
    (0.62..0.9).contains(&x.abs()) && (0.8..0.995).contains(&y)
}

/// The body of a vehicle between its ends, in the colour of its paint: what one sees of its sides in bends. It has tyres
/// where the axles are.
pub fn body(axle: bool) -> Sprite {
    Sprite::drawn(|x, y| {
        if x.abs() < outline(y) {
            // Windows darken the upper half, between the roof and the doors.
            let shade = if (0.1..0.4).contains(&y) { 0.42 } else { 0.78 };
            return Some([205.0 * shade; 3]);
        }
        (axle && tyre(x, y)).then_some([26.0, 26.0, 28.0])
    })
}

/// The rear of a vehicle in white, which takes the tint of its paint; glass, tyres and the plate keep theirs, nearly.
pub fn rear() -> Sprite {
    vehicle_end(|x, y| {
        if (0.56..0.92).contains(&x.abs()) && (0.5..0.62).contains(&y) {
            return Some([176.0, 20.0, 22.0]);
        }
        (x.abs() < 0.28 && (0.62..0.7).contains(&y)).then_some([232.0, 224.0, 170.0])
    })
}

/// The front of a vehicle, as [`rear`].
pub fn front() -> Sprite {
    vehicle_end(|x, y| {
        if (0.54..0.9).contains(&x.abs()) && (0.54..0.66).contains(&y) {
            return Some([244.0, 246.0, 248.0]);
        }
        (x.abs() < 0.46 && (0.6..0.72).contains(&y)).then_some([34.0, 34.0, 38.0])
    })
}

fn vehicle_end(details: impl Fn(f32, f32) -> Option<[f32; 3]>) -> Sprite {
    Sprite::drawn(move |x, y| {
        if x.abs() >= outline(y) {
            return tyre(x, y).then_some([26.0, 26.0, 28.0]);
        }
        if let Some(detail) = details(x, y) {
            return Some(detail);
        }
        // The window, inside pillars.
        if (0.1..0.4).contains(&y) && x.abs() < outline(y) - 0.1 {
            return Some([44.0, 52.0, 60.0].map(|c| c * (1.35 - 0.9 * (y - 0.1))));
        }
        let bumper = if y > 0.74 { 0.72 } else { 1.0 };
        Some([225.0 * (1.0 - 0.25 * y) * bumper; 3])
    })
}

/// The lamps of a vehicle at night, white or red, and the light around them.
pub fn lamps(colour: [f32; 3]) -> Sprite {
    Sprite::veil(colour, |x, y| {
        let from = |lamp: f32| {
            let (dx, dy) = ((x - lamp) * 2.0 / 0.3, (y - 0.58) * 1.45 / 1.8 * 2.0 / 0.3);
            (1.3 - (dx * dx + dy * dy).sqrt()).clamp(0.0, 1.0)
        };
        from(0.22).max(from(0.78))
    })
}
