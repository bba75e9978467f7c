//! How high the road lies along its way.

use pdk_sdk::prelude::{Error, Result};

/// Distance between the stored heights in metres.
const STEP: f64 = 1.0;
/// Heights are smoothed over this distance to either side in metres, twice: corners between waypoints become vertical curves.
const SMOOTHING: usize = 6;
/// Steepest slope, as rise over run.
pub const STEEPEST: f64 = 0.15;
/// Slopes less than this leave a road flat, and spare the effort that hills cost.
const FLAT: f64 = 1e-4;

/// Heights along a road.
#[derive(Debug, Clone)]
pub struct Profile {
    heights: Vec<f64>,
    flat: bool,
}

impl Profile {
    /// The profile through points, each the distance along the road and the height there, in metres and in order.
    pub fn of(points: &[(f64, f64)]) -> Self {
        let [(first, start), .., (last, _)] = points else {
            return Self { heights: vec![points.first().map_or(0.0, |p| p.1)], flat: true };
        };
        let count = ((last - first) / STEP).ceil() as usize + 1;
        let mut segment = 0;
        let raw: Vec<f64> = (0..count)
            .map(|i| {
                let along = (first + i as f64 * STEP).min(*last);
                while segment + 2 < points.len() && points[segment + 1].0 < along {
                    segment += 1;
                }
                let [(a, low), (b, high)] = [points[segment], points[segment + 1]];
                low + (high - low) * ((along - a) / (b - a).max(1e-9)).clamp(0.0, 1.0)
            })
            .collect();
        let flat = raw.iter().all(|height| (height - start).abs() < FLAT);
        let heights = if flat { raw } else { smoothed(&smoothed(&raw)) };
        Self { heights, flat }
    }

    /// The slopes from each stored height to the next, all positive.
    fn slopes(&self) -> impl Iterator<Item = f64> {
        self.heights.windows(2).map(|pair| ((pair[1] - pair[0]) / STEP).abs())
    }

    /// The steepest slope, up or down.
    pub fn steepest(&self) -> f64 {
        self.slopes().fold(0.0, f64::max)
    }

    /// Refuses a profile that is steeper than vehicles can drive.
    ///
    /// # Errors
    /// If it is.
    pub fn checked(self) -> Result<Self> {
        let steep = self.slopes().enumerate().find(|(_, slope)| *slope > STEEPEST);
        match steep {
            None => Ok(self),
            Some((i, slope)) => Err(Error::new(format!(
                "the road has a slope of {:.1} % {} m after its start, but vehicles here manage at most {:.0} %: lower the \
                 height of the waypoints, or draw them apart",
                slope * 100.0,
                i + 1,
                STEEPEST * 100.0
            ))),
        }
    }

    /// Whether the road keeps its height.
    pub fn is_flat(&self) -> bool {
        self.flat
    }

    /// The height in metres this many metres after the start; beyond the ends that of the end.
    pub fn height(&self, along: f64) -> f64 {
        let position = (along / STEP).clamp(0.0, (self.heights.len() - 1) as f64);
        let index = position as usize;
        let next = self.heights[(index + 1).min(self.heights.len() - 1)];
        self.heights[index] + (next - self.heights[index]) * (position - index as f64)
    }

    /// The slope, rise over run, this many metres after the start.
    pub fn slope(&self, along: f64) -> f64 {
        if self.flat {
            return 0.0;
        }
        // Over a vehicle's length, so that it changes gently.
        const REACH: f64 = 2.0;
        (self.height(along + REACH) - self.height(along - REACH)) / (2.0 * REACH)
    }
}

/// The running mean; beyond the ends the ends' heights count, so that these stay where they are.
fn smoothed(heights: &[f64]) -> Vec<f64> {
    let last = heights.len() - 1;
    (0..heights.len())
        .map(|i| {
            // Narrower towards the ends.
            let reach = SMOOTHING.min(i).min(last - i);
            heights[i - reach..=i + reach].iter().sum::<f64>() / (2 * reach + 1) as f64
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ramp_keeps_its_slope_and_its_ends() {
        let profile = Profile::of(&[(0.0, 2.0), (100.0, 7.0), (200.0, 7.0)]);
        assert!((profile.steepest() - 0.05).abs() < 1e-9);
        assert!(!profile.is_flat());
        assert_eq!((profile.height(0.0), profile.height(-5.0), profile.height(900.0)), (2.0, 2.0, 7.0));
        assert!((profile.slope(50.0) - 0.05).abs() < 1e-9 && profile.slope(150.0).abs() < 1e-9);
        // The corner has become a curve.
        assert!((0.01..0.04).contains(&profile.slope(100.0)));
    }

    #[test]
    fn flat_roads_are_flat_and_steep_ones_are_refused() {
        let flat = Profile::of(&[(0.0, 3.0), (50.0, 3.0)]).checked().unwrap();
        assert!(flat.is_flat() && flat.height(17.0) == 3.0 && flat.slope(17.0) == 0.0);
        let error = Profile::of(&[(0.0, 0.0), (50.0, 10.0)]).checked().unwrap_err().to_string();
        assert!(error.contains("a slope of 20.0 %"), "{error}");
    }
}
