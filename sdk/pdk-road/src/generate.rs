//! Angles of roads: at random, and towards a number of turns and a mean curvature.

use pdk_seed::Random;

use crate::{curve, lay_out};

/// The least angle of a turn in degrees; what turns less counts as straight.
pub const STRAIGHTEST_TURN: f64 = 25.0;

/// Whole random angles in degrees, from `-limit` to `limit`, each as likely as any other.
pub fn random_angles(random: &mut Random, count: usize, limit: i32) -> Vec<f64> {
    (0..count).map(|_| f64::from(random.between(-limit.abs(), limit.abs()))).collect()
}

/// What an informed road should be like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Informed {
    /// Number of nodes at which it turns; at most the number of angles.
    pub turns: usize,
    /// Mean curvature in 1/m that it should come near.
    pub mean_curvature: f64,
    /// Largest angle in degrees, at least [`STRAIGHTEST_TURN`].
    pub limit: i32,
}

/// Angles in degrees for a road with a number of turns whose mean curvature comes near a target.
///
/// Node by node: a turn comes with the probability turns left / nodes left, sides alternate, and a turn has the whole angle
/// that brings the mean curvature of the nodes so far nearest to the target. What can be reached depends on the number of
/// turns, since a turn has at least [`STRAIGHTEST_TURN`] degrees; measure the road to know.
pub fn informed_angles(random: &mut Random, lengths: &[f64], target: Informed) -> Vec<f64> {
    let mut angles: Vec<f64> = Vec::with_capacity(lengths.len());
    let mut turns_left = target.turns.min(lengths.len());
    let mut side = if random.below(2) == 0 { -1.0 } else { 1.0 };
    for node in 0..lengths.len() {
        angles.push(0.0);
        let nodes_left = (lengths.len() - node) as u32;
        if random.below(nodes_left) as usize >= turns_left {
            continue;
        }
        turns_left -= 1;
        let mut best = (f64::INFINITY, STRAIGHTEST_TURN);
        for degrees in STRAIGHTEST_TURN as i32..=target.limit.max(STRAIGHTEST_TURN as i32) {
            angles[node] = side * f64::from(degrees);
            let reached = curve::mean_curvature(&lay_out(&angles, &lengths[..=node]));
            let off = (reached - target.mean_curvature).abs();
            if off < best.0 {
                best = (off, f64::from(degrees));
            }
        }
        angles[node] = side * best.1;
        side = -side;
    }
    angles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{NODES, Road, SEGMENT};
    use pdk_seed::Key;
    use proptest::prelude::*;

    fn key(seed: u8) -> Random {
        Key([seed; 32]).sequence()
    }

    proptest! {
        #[test]
        fn the_same_key_gives_the_same_road_within_the_limit(seed in 0u8..=255, limit in 0i32..=90) {
            let angles = random_angles(&mut key(seed), NODES, limit);
            prop_assert_eq!(&angles, &random_angles(&mut key(seed), NODES, limit));
            prop_assert!(angles.iter().all(|angle| angle.abs() <= f64::from(limit)));
        }

        #[test]
        fn informed_roads_have_their_turns_and_the_same_key_gives_the_same_road(
            seed in 0u8..=255, turns in 0usize..=8, thousandths in 0u32..=80,
        ) {
            let target = Informed { turns, mean_curvature: f64::from(thousandths) / 1000.0, limit: 60 };
            let angles = informed_angles(&mut key(seed), &[SEGMENT; NODES], target);
            prop_assert_eq!(&angles, &informed_angles(&mut key(seed), &[SEGMENT; NODES], target));
            let road = Road::from_angles(&angles, &[SEGMENT; NODES]).unwrap();
            prop_assert_eq!(road.turns(), turns);
        }
    }

    /// Choosing node by node is not an optimisation: later turns add to the mean what earlier ones did not foresee. So single
    /// roads may be off, but not many and not by much.
    #[test]
    fn informed_roads_come_near_their_target() {
        let mut off = Vec::new();
        for (seed, turns, hundredths) in combinations(16, 9, 9) {
            let target = Informed { turns, mean_curvature: f64::from(hundredths) / 100.0, limit: 60 };
            let angles = informed_angles(&mut key(seed), &[SEGMENT; NODES], target);
            let curvature =
                |angles: &[f64]| Road::from_angles(angles, &[SEGMENT; NODES]).unwrap().mean_curvature();
            // What can be reached with these turns: all as slight, and all as sharp as may be.
            let turned = |degrees: f64| {
                let turn = |&angle: &f64| if angle == 0.0 { 0.0 } else { degrees.copysign(angle) };
                curvature(&angles.iter().map(turn).collect::<Vec<_>>())
            };
            let near = target.mean_curvature.clamp(turned(STRAIGHTEST_TURN), turned(60.0));
            off.push((curvature(&angles) - near).abs());
        }
        off.sort_by(f64::total_cmp);
        let share = |share: f64| off[((off.len() - 1) as f64 * share) as usize];
        assert!(share(0.5) < 0.001 && share(0.95) < 0.015, "{} {}", share(0.5), share(0.95));
    }

    /// All combinations of a seed, a number of turns and a target below these.
    fn combinations(seeds: u8, turns: usize, hundredths: u32) -> impl Iterator<Item = (u8, usize, u32)> {
        (0..seeds).flat_map(move |seed| {
            (0..turns).flat_map(move |turns| (0..hundredths).map(move |target| (seed, turns, target)))
        })
    }

    #[test]
    fn no_turns_are_a_straight_road() {
        let target = Informed { turns: 0, mean_curvature: 0.03, limit: 60 };
        assert_eq!(informed_angles(&mut key(1), &[SEGMENT; NODES], target), [0.0; NODES]);
    }
}
