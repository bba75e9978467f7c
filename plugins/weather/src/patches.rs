//! Patches of the ground, such as puddles, that lie still while the vehicle passes.

use pdk_sdk::ops::canvas::Canvas;
use pdk_sdk::prelude::*;

/// The side of the map in texels, and of a texel in metres.
const SIDE: usize = 256;
const TEXEL: f64 = 0.1;
/// How much of the ground lies in the soft edge of patches.
const EDGE: f32 = 0.02;
/// From here on, in metres, patches are too small to be told apart, and from there on they are not.
const FAR: [f32; 2] = [25.0, 50.0];

/// Where patches begin to grow, and where they grow last.
#[derive(Default)]
pub struct Patches {
    /// For each texel the share of the ground that has grown over when it does, for a key.
    map: Vec<f32>,
    made_for: Option<Key>,
}

/// From 0 below the first value to 1 above the second.
fn between(from: f32, to: f32, value: f32) -> f32 {
    ((value - from) / (to - from)).clamp(0.0, 1.0)
}

impl Patches {
    /// Draws them from the sequence's random numbers.
    pub fn draw(&mut self, cx: &Context<'_>) {
        if self.made_for == Some(*cx.key()) {
            return;
        }
        self.made_for = Some(*cx.key());
        let clouds = Canvas::clouds(SIDE, SIDE, 32.0, 4, &mut cx.sequence_random()).shades;
        let mut order: Vec<usize> = (0..clouds.len()).collect();
        order.sort_by(|a, b| clouds[*b].total_cmp(&clouds[*a]));
        self.map = vec![0.0; clouds.len()];
        for (rank, place) in order.iter().enumerate() {
            self.map[*place] = rank as f32 / clouds.len() as f32;
        }
    }

    /// A place of the ground, to the right and ahead in metres, after the vehicle has driven a way.
    #[inline]
    pub fn at(&self, [right, ahead]: [f32; 2], driven: f64) -> Patch {
        // There and back over the map, so that it has no seams.
        let texel = |metres: f64| {
            let there = 2.0 * SIDE as f64;
            let place = metres / TEXEL;
            let place = place - there * (place / there).floor();
            (place.min(there - place) as usize).min(SIDE - 1)
        };
        let middle = 0.5 * SIDE as f64 * TEXEL;
        let place = texel(f64::from(ahead) + driven) * SIDE + texel(f64::from(right) + middle);
        Patch { grown: self.map[place], far: between(FAR[0], FAR[1], ahead) }
    }
}

/// What is known of a place on the ground.
#[derive(Clone, Copy)]
pub struct Patch {
    /// The share of the ground that has grown over when this place does.
    grown: f32,
    /// Whether it is too far away to be told apart.
    far: f32,
}

impl Patch {
    /// How much of it patches cover that cover a share of the ground.
    #[inline]
    pub fn cover(self, share: f32) -> f32 {
        if share <= 0.0 {
            return 0.0;
        }
        let near = 1.0 - between(share, share + EDGE, self.grown);
        near + (share - near) * self.far
    }
}

/// Adds the parameter that says how fast patches pass.
pub fn described(description: Description) -> Description {
    description.parameter(
        Parameter::number(
            "speed",
            8.0,
            "how fast the vehicle drives if it is not known how far it has driven",
        )
        .range(0.0, 60.0)
        .unit("m/s"),
    )
}

/// How far the vehicle has driven, in metres.
pub fn driven(cx: &Context<'_>) -> f64 {
    cx.travelled.unwrap_or(cx.time * cx.number("speed"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_cover_their_share_and_pass_as_the_vehicle_drives() {
        let mut patches = Patches::default();
        let key = Key([4; 32]);
        patches.draw(&Context::new(2.0, 0, 0.0, &key));
        let covered = |share: f32| -> f32 {
            let places = (0..100).flat_map(|right| {
                (0..200).map(move |ahead| [right as f32 * 0.25 - 12.7, ahead as f32 * 0.1])
            });
            places.map(|place| patches.at(place, 0.0).cover(share)).sum::<f32>() / 20_000.0
        };
        for share in [0.05, 0.2, 0.5, 1.0] {
            assert!((covered(share) - share).abs() < 0.04, "{share}: {}", covered(share));
        }
        assert_eq!(covered(0.0), 0.0);
        let row = |from: f32, driven: f64| -> Vec<f32> {
            (0..100).map(|step| patches.at([1.0, from + step as f32 * 0.1], driven).cover(0.3)).collect()
        };
        let (near, later) = (row(5.0, 0.0), row(2.0, 3.0));
        let same = near.iter().zip(&later).filter(|(a, b)| (**a - **b).abs() < 0.3).count();
        assert!(same > 85, "{same}");
        // Far away there are no patches, but their mean.
        assert_eq!(patches.at([3.0, 60.0], 0.0).cover(0.3), 0.3);
    }
}
