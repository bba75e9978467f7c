//! Ups and downs of roads that have no heights of their own.

use std::f64::consts::PI;

use pdk_road::distance;

/// From one crest to the next in metres, of the two waves that a road follows, and how much each takes part.
const WAVES: [((f64, f64), f64); 2] = [((110.0, 170.0), 0.7), ((60.0, 85.0), 0.3)];
/// Roads are level at their start, for this many metres.
const LEVEL: f64 = 25.0;

/// Raises and lowers flat waypoints by up to this many metres; those with heights stay as they are.
pub fn raised(mut waypoints: Vec<[f64; 3]>, swing: f64, seed: u64) -> Vec<[f64; 3]> {
    let level = waypoints.first().map_or(0.0, |point| point[1]);
    if swing == 0.0 || waypoints.iter().any(|point| point[1] != level) {
        return waypoints;
    }
    let mut random = pdk_sdk::seed::key(seed, "lane crests", 0).sequence();
    let waves = WAVES.map(|((low, high), part)| {
        (2.0 * PI / random.uniform(low, high), random.uniform(0.0, 2.0 * PI), part)
    });
    let mut along = 0.0;
    for i in 0..waypoints.len() {
        if i > 0 {
            let [a, b] = [waypoints[i - 1], waypoints[i]];
            along += distance([a[0], a[2]], [b[0], b[2]]);
        }
        // The amplitude grows from the start on.
        let begun = (along / LEVEL).min(1.0) * (along / LEVEL).min(1.0);
        let height = |(frequency, phase, part): (f64, f64, f64)| part * libm::sin(frequency * along + phase);
        waypoints[i][1] = level + begun * swing * waves.iter().map(|wave| height(*wave)).sum::<f64>();
    }
    waypoints
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flat_roads_get_crests_and_others_stay() {
        let flat: Vec<[f64; 3]> = (0..300).map(|i| [0.0, 5.0, f64::from(i)]).collect();
        let raised_by = |swing, seed| raised(flat.clone(), swing, seed);
        assert_eq!(raised_by(0.0, 1), flat);
        let hilly = raised_by(2.0, 1);
        assert_eq!((hilly.clone(), hilly[0][1]), (raised_by(2.0, 1), 5.0));
        assert_ne!(hilly, raised_by(2.0, 2));
        let (low, high) = hilly.iter().fold((9.0f64, 0.0f64), |(l, h), p| (l.min(p[1]), h.max(p[1])));
        assert!(low < 4.2 && high > 5.8 && low >= 3.0 && high <= 7.0, "{low} {high}");
        let slopes = hilly.windows(2).map(|pair| (pair[1][1] - pair[0][1]).abs());
        assert!(slopes.fold(0.0, f64::max) < 0.14);
        assert_eq!(raised(hilly.clone(), 2.0, 5), hilly);
    }
}
