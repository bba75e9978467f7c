//! What lines a road besides what every scene has: rows of trees, bushes and signs, and the shadows of trees on the road.

use pdk_road::Path;
use pdk_sdk::prelude::Random;

use crate::scene::{self, Object, ObjectKind, Scene};
use crate::section;

/// A row of trees is this many metres long, and its trees so far apart.
const ROW: f64 = 45.0;
const SPACING: (f64, f64) = (6.0, 11.0);
/// Distance of their trunks from the middle of the road in metres.
const OFFSETS: (f64, f64) = (6.6, 9.5);
/// Bushes for each metre of road, and their distance from its middle in metres.
const BUSHES: f64 = 0.35;
const BUSH_OFFSETS: (f64, f64) = (6.5, 24.0);
/// Distance of signs from the middle of the road in metres.
const SIGN_OFFSET: f64 = section::PAVED_HALF_WIDTH + 1.3;
/// Trees farther from the middle of the road cast no shadow that reaches it, in metres.
const FARTHEST_SHADOW: f64 = 42.0;

/// Adds trees, as densely as wanted from 0 to 1, bushes among them, and this many signs a kilometre.
pub fn furnish(scene: &mut Scene, path: &Path, (trees, signs): (f64, f64), random: &mut Random) {
    let length = path.length();
    for row in 0..((length + ROW) / ROW) as usize {
        for side in [-1.0, 1.0] {
            let (stands, oaks) = (random.unit() < trees, random.below(3) > 0);
            let mut along = row as f64 * ROW + random.uniform(-5.0, 5.0);
            let mut variant = random.below(64) as usize;
            while along < (row + 1) as f64 * ROW {
                let offset = random.uniform(OFFSETS.0, OFFSETS.1);
                let height = random.uniform(6.0, 11.0);
                let brightness = random.uniform(0.85, 1.1) as f32;
                let at = path.beside(along, section::ROAD_CENTRE + side * offset);
                along += random.uniform(SPACING.0, SPACING.1);
                variant += 1;
                // Crowns may reach over the road, trunks keep away from it.
                if stands && scene::clear(&scene.field, at, 1.5) {
                    let (kind, share) = match oaks {
                        true => (ObjectKind::Broadleaf, 0.75),
                        false => (ObjectKind::Conifer, 0.42),
                    };
                    let size = [height * share, height];
                    scene.objects.push(Object { at, size, kind, tint: [brightness; 3], variant });
                }
            }
        }
    }
    for variant in 0..(length * BUSHES * trees) as usize {
        let along = random.uniform(-20.0, length + 40.0);
        let offset = random.uniform(BUSH_OFFSETS.0, BUSH_OFFSETS.1);
        let side = if random.below(2) == 0 { -1.0 } else { 1.0 };
        let (width, brightness) = (random.uniform(0.9, 2.6), random.uniform(0.8, 1.15) as f32);
        let at = path.beside(along, section::ROAD_CENTRE + side * offset);
        if scene::clear(&scene.field, at, width) {
            let size = [width, width * 0.62];
            scene.objects.push(Object { at, size, kind: ObjectKind::Bush, tint: [brightness; 3], variant });
        }
    }
    if signs > 0.0 {
        let spacing = 1000.0 / signs;
        let mut along = 12.0 + random.unit() * spacing;
        while along < length {
            let (kind, size) = match random.below(5) {
                0 | 1 => (ObjectKind::LimitSign, [0.75, 2.6]),
                2 | 3 => (ObjectKind::WarningSign, [0.95, 2.7]),
                _ => (ObjectKind::GuideSign, [2.0, 2.9]),
            };
            let at = path.beside(along, section::ROAD_CENTRE + SIGN_OFFSET + size[0] / 2.0);
            if scene::clear(&scene.field, at, 0.3) {
                let variant = random.below(8) as usize;
                scene.objects.push(Object { at, size, kind, tint: [1.0; 3], variant });
            }
            along += spacing * random.uniform(0.5, 1.5);
        }
    }
    cast_shadows(scene);
}

/// Casts the shadows of trees on the road and what lies next to it, where the sun shines.
fn cast_shadows(scene: &mut Scene) {
    let Some(sun) = scene.sun.filter(|_| scene.light.shadow > 0.0) else { return };
    let Scene { field, objects, .. } = scene;
    // Away from the sun.
    let (x, z) = (-libm::sin(sun.heading), -libm::cos(sun.heading));
    // A metre of height casts a shadow so long; very low suns cast none that is worth following.
    let stretch = (1.0 / sun.elevation.max(0.05)).min(3.5);
    for tree in objects.iter() {
        let (middle, half, wide) = match tree.kind {
            ObjectKind::Broadleaf => (0.62, 0.38, 0.48),
            ObjectKind::Conifer => (0.45, 0.42, 0.36),
            _ => continue,
        };
        let [width, height] = tree.size;
        let reach = middle * height * stretch;
        let centre = [tree.at[0] + x * reach, tree.at[1] + z * reach];
        let across = wide * width;
        let along = ((half * height * stretch) * (half * height * stretch) + across * across).sqrt();
        let place = field.at((centre[0] - field.origin()[0]) as f32, (centre[1] - field.origin()[1]) as f32);
        if place.is_none() && reach > FARTHEST_SHADOW {
            continue;
        }
        field.cast(centre, along, |at| {
            let (dx, dz) = (at[0] - centre[0], at[1] - centre[1]);
            let (length, side) = ((dx * x + dz * z) / along, (dx * z - dz * x) / across);
            (0.95 * (1.3 * (1.0 - length * length - side * side)).clamp(0.0, 1.0)) as f32
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::light::Light;
    use crate::road::Road;
    use pdk_sdk::prelude::Key;

    fn furnished(light: &str, trees: f64, signs: f64) -> (Scene, Road) {
        let road = Road::from_angles(&[0.0, 20.0, -30.0, 0.0, 10.0], &[50.0; 5], &[]).unwrap();
        let mut random = Key([6; 32]).sequence();
        let mut scene = Scene::new(&road.path, &Light::named(light), &mut random);
        furnish(&mut scene, &road.path, (trees, signs), &mut random);
        (scene, road)
    }

    fn shaded(scene: &Scene, road: &Road) -> f64 {
        let places = (0..2000).map(|i| road.path.beside(i as f64 * 0.1, (i % 5) as f64 - 4.0));
        let shade = places.map(|at| {
            let [x, z] = [0, 1].map(|k| (at[k] - scene.field.origin()[k]) as f32);
            f64::from(scene.field.at(x, z).unwrap().shade)
        });
        shade.sum::<f64>() / 2000.0
    }

    #[test]
    fn trees_shade_the_road_where_the_sun_shines() {
        let [none, some, many] = [0.0, 0.5, 1.0].map(|trees| {
            let (scene, road) = furnished("day", trees, 0.0);
            shaded(&scene, &road)
        });
        assert!(none < some && some < many && (0.15..0.9).contains(&many), "{none} {some} {many}");
        let (scene, road) = furnished("overcast", 1.0, 0.0);
        assert_eq!(shaded(&scene, &road), 0.0);
    }

    #[test]
    fn nothing_stands_on_the_road() {
        let (scene, _) = furnished("day", 1.0, 40.0);
        assert!(scene.objects.iter().filter(|object| object.kind.is_sign()).count() > 4);
        for object in &scene.objects {
            let [x, z] = [0, 1].map(|k| (object.at[k] - scene.field.origin()[k]) as f32);
            let Some(place) = scene.field.at(x, z) else { continue };
            let from_middle = f64::from(place.lateral) - section::ROAD_CENTRE;
            assert!(from_middle.abs() > section::PAVED_HALF_WIDTH + 0.2, "{object:?}");
        }
    }
}
