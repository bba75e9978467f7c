//! Ups and downs of roads that have no heights of their own.

use std::f64::consts::PI;

use pdk_road::distance;

use crate::profile::{Profile, STEEPEST};

/// From one crest to the next in metres, of the two waves that a road follows, and how much each takes part.
const WAVES: [((f64, f64), f64); 2] = [((110.0, 170.0), 0.7), ((60.0, 85.0), 0.3)];
/// Roads are level at their start, for this many metres.
const LEVEL: f64 = 25.0;
/// Roads whose crests would be too steep to drive get lower ones, with this slope at most.
const STEEP: f64 = 0.14;

/// Raises and lowers flat waypoints by up to this many metres, as far as the road can be driven; those with heights stay as they are.
/// Returns them with the profile that `profile` finds.
pub fn raised(
    waypoints: Vec<[f64; 3]>,
    swing: f64,
    seed: u64,
    profile: impl Fn(&[[f64; 3]]) -> Profile,
) -> (Vec<[f64; 3]>, Profile) {
    let level = waypoints.first().map_or(0.0, |point| point[1]);
    if swing == 0.0 || waypoints.iter().any(|point| point[1] != level) {
        let flat = profile(&waypoints);
        return (waypoints, flat);
    }
    let mut random = pdk_sdk::seed::key(seed, "lane crests", 0).sequence();
    let waves = WAVES.map(|((low, high), part)| {
        (2.0 * PI / random.uniform(low, high), random.uniform(0.0, 2.0 * PI), part)
    });
    let swung = |swing: f64| {
        let mut swung = waypoints.clone();
        let mut along = 0.0;
        for i in 0..swung.len() {
            if i > 0 {
                let [a, b] = [swung[i - 1], swung[i]];
                along += distance([a[0], a[2]], [b[0], b[2]]);
            }
            // The amplitude grows from the start on.
            let begun = (along / LEVEL).min(1.0) * (along / LEVEL).min(1.0);
            let height =
                |(frequency, phase, part): (f64, f64, f64)| part * libm::sin(frequency * along + phase);
            swung[i][1] = level + begun * swing * waves.iter().map(|wave| height(*wave)).sum::<f64>();
        }
        let profile = profile(&swung);
        (swung, profile)
    };
    let full = swung(swing);
    let steepest = full.1.steepest();
    // Slopes are in proportion to the swing.
    if steepest > STEEPEST { swung(swing * STEEP / steepest) } else { full }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn profile(waypoints: &[[f64; 3]]) -> Profile {
        Profile::of(&waypoints.iter().map(|point| (point[2], point[1])).collect::<Vec<_>>())
    }

    #[test]
    fn flat_roads_get_crests_and_others_stay() {
        let flat: Vec<[f64; 3]> = (0..300).map(|i| [0.0, 5.0, f64::from(i)]).collect();
        let raised_by = |swing, seed| raised(flat.clone(), swing, seed, profile).0;
        assert_eq!(raised_by(0.0, 1), flat);
        let hilly = raised_by(2.0, 1);
        assert_eq!((hilly.clone(), hilly[0][1]), (raised_by(2.0, 1), 5.0));
        assert_ne!(hilly, raised_by(2.0, 2));
        let (low, high) = hilly.iter().fold((9.0f64, 0.0f64), |(l, h), p| (l.min(p[1]), h.max(p[1])));
        assert!(low < 4.2 && high > 5.8 && low >= 3.0 && high <= 7.0, "{low} {high}");
        let slopes = hilly.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
        assert!(slopes.fold(0.0, f64::max) < 0.14);
        assert_eq!(raised(hilly.clone(), 2.0, 5, profile).0, hilly);
    }

    #[test]
    fn crests_that_could_not_be_driven_are_lower() {
        let flat: Vec<[f64; 3]> = (0..300).map(|i| [0.0, 5.0, f64::from(i)]).collect();
        let mut lowered = 0;
        for seed in 0..40 {
            let once = raised(flat.clone(), 1.0, seed, profile).0;
            for swing in [2.4, 4.0, 6.0] {
                let (hilly, profile) = raised(flat.clone(), swing, seed, profile);
                assert!((0.05..=STEEPEST).contains(&profile.steepest()), "{swing} {seed}");
                // The same crests, in proportion.
                let factors = hilly.iter().zip(&once).filter(|(_, once)| (once[1] - 5.0).abs() > 0.1);
                let factors: Vec<f64> =
                    factors.map(|(hilly, once)| (hilly[1] - 5.0) / (once[1] - 5.0)).collect();
                let factor = factors[0];
                assert!(factor < swing + 1e-9 && factors.iter().all(|other| (other - factor).abs() < 1e-6));
                if factor < swing - 1e-9 {
                    assert!((profile.steepest() - STEEP).abs() < 1e-9, "{swing} {seed}");
                    lowered += 1;
                }
            }
        }
        assert!((40..120).contains(&lowered), "{lowered}");
    }
}
