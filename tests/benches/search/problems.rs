//! Problems whose critical regions are known.

use pdk_sdk::seed::Key;

/// How far a critical candidate may be from a part of a region that it covers, in each variable that matters.
const NEAR: f64 = 0.05;

/// A problem over variables from 0 to 1.
pub struct Known {
    pub name: &'static str,
    /// What the table says about it.
    pub about: &'static str,
    pub variables: usize,
    pub objectives: usize,
    pub regions: Vec<Region>,
    /// The objectives.
    value: Values,
}

/// Where candidates are critical, in the first variables; the others do not matter.
pub struct Region {
    middle: Vec<f64>,
    /// Half the side, or the radius in all variables.
    half: Vec<f64>,
    /// A ball, else a box.
    ball: bool,
}

impl Region {
    fn cube(middle: [f64; 4], side: f64) -> Self {
        Self { middle: middle.to_vec(), half: vec![side / 2.0; 4], ball: false }
    }

    fn ball(middle: [f64; 4], radius: f64) -> Self {
        Self { middle: middle.to_vec(), half: vec![radius; 4], ball: true }
    }

    fn between(corners: [(f64, f64); 4]) -> Self {
        let middle = corners.iter().map(|(low, high)| (low + high) / 2.0).collect();
        Self { middle, half: corners.iter().map(|(low, high)| (high - low) / 2.0).collect(), ball: false }
    }

    /// Whether it holds a candidate.
    pub fn holds(&self, x: &[f64]) -> bool {
        match self.ball {
            true => self.squares(x) <= self.half[0] * self.half[0],
            false => self.miss(x) <= 1e-12,
        }
    }

    /// How far a candidate is from a box, summed over the variables.
    fn miss(&self, x: &[f64]) -> f64 {
        let of = |i: usize| ((x[i] - self.middle[i]).abs() - self.half[i]).max(0.0);
        (0..self.middle.len()).map(of).sum()
    }

    /// The squared distance from the middle.
    fn squares(&self, x: &[f64]) -> f64 {
        self.middle.iter().zip(x).map(|(middle, x)| (x - middle) * (x - middle)).sum()
    }

    /// Evenly spread points in it, the same for all strategies.
    fn samples(&self, n: usize) -> Vec<Vec<f64>> {
        let mut random = Key([9; 32]).sequence();
        let mut samples = Vec::new();
        while samples.len() < n {
            let sides = self.middle.iter().zip(&self.half);
            let point: Vec<f64> =
                sides.map(|(middle, half)| random.uniform(middle - half, middle + half)).collect();
            if self.holds(&point) {
                samples.push(point);
            }
        }
        samples
    }

    /// The share of it that lies near a critical candidate.
    pub fn covered(&self, critical: &[Vec<f64>]) -> f64 {
        const SAMPLES: usize = 400;
        let near = |point: &Vec<f64>, x: &Vec<f64>| point.iter().zip(x).all(|(a, b)| (a - b).abs() <= NEAR);
        let samples = self.samples(SAMPLES);
        let covered = samples.iter().filter(|point| critical.iter().any(|x| near(point, x)));
        covered.count() as f64 / SAMPLES as f64
    }
}

impl Known {
    /// The objectives of a candidate, smaller is better, and whether it is critical.
    pub fn judge(&self, x: &[f64]) -> (Vec<f64>, bool) {
        ((self.value)(&self.regions, x), self.regions.iter().any(|region| region.holds(x)))
    }
}

/// How far it is to the nearest region, and what speaks for staying away from all.
fn leads(regions: &[Region], x: &[f64]) -> Vec<f64> {
    vec![nearest(regions, x), x[0] * 0.2 + x[3] * 0.1]
}

fn nearest(regions: &[Region], x: &[f64]) -> f64 {
    regions.iter().map(|region| region.miss(x)).fold(f64::INFINITY, f64::min)
}

/// Heights of the peaks: the lower, the wider, so that all are above a half in balls of one size.
const HEIGHTS: [f64; 3] = [1.0, 0.7, 0.55];

fn peaks(regions: &[Region], x: &[f64]) -> Vec<f64> {
    let height = |(region, height): (&Region, f64)| {
        let steepness = libm::log(2.0 * height) / (region.half[0] * region.half[0]);
        height * libm::exp(-steepness * region.squares(x))
    };
    vec![-regions.iter().zip(HEIGHTS).map(height).fold(0.0, f64::max)]
}

/// A number from 0 to 1 that nothing tells beforehand.
pub fn noise(x: &[f64]) -> f64 {
    let mut state = 0xcbf2_9ce4_8422_2325_u64;
    for byte in x.iter().flat_map(|x| x.to_bits().to_le_bytes()) {
        state = (state ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    (state ^ (state >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) as f64 / u64::MAX as f64
}

fn nothing_leads(_: &[Region], x: &[f64]) -> Vec<f64> {
    vec![noise(x), noise(&[x[0], x[1]])]
}

type Values = fn(&[Region], &[f64]) -> Vec<f64>;

fn known(
    name: &'static str,
    about: &'static str,
    (variables, objectives): (usize, usize),
    regions: Vec<Region>,
    value: Values,
) -> Known {
    Known { name, about, variables, objectives, regions, value }
}

/// All problems.
pub fn all() -> Vec<Known> {
    // 10 % of the volume, three times 0.3 %, and 0.02 %.
    let large = || vec![Region::cube([0.35, 0.6, 0.65, 0.4], 0.562_34)];
    let three = || {
        [[0.2, 0.25, 0.7, 0.8], [0.75, 0.8, 0.25, 0.3], [0.8, 0.2, 0.8, 0.2]]
            .map(|middle| Region::cube(middle, 0.234))
            .into()
    };
    let balls = || {
        [[0.2, 0.25, 0.7, 0.8], [0.75, 0.8, 0.25, 0.3], [0.8, 0.2, 0.8, 0.2]]
            .map(|middle| Region::ball(middle, 0.157))
            .into()
    };
    let needle = || vec![Region::cube([0.63, 0.37, 0.58, 0.71], 0.118_92)];
    let ridge = vec![Region::between([(0.05, 0.95), (0.1, 0.9), (0.55, 0.65), (0.3, 0.42)])];
    vec![
        known("large", "one region of 10 %", (4, 2), large(), leads),
        known("needle", "one of 0.02 %", (4, 2), needle(), leads),
        known(
            "ridge",
            "one that is long and narrow, 0.9 %, objectives with noise",
            (4, 2),
            ridge,
            |regions, x| vec![nearest(regions, x) + 0.2 * noise(x), x[0] * 0.1],
        ),
        known("three", "three of 0.3 %", (4, 2), three(), leads),
        known("eight", "three of 0.3 %, and four more variables that change nothing", (8, 2), three(), leads),
        known("peaks", "three of 0.3 %, one far more severe than the others", (4, 1), balls(), peaks),
        known(
            "nearby",
            "three of 0.3 %, to which the objective leads from nearby only",
            (4, 1),
            three(),
            |regions, x| vec![nearest(regions, x).min(0.15)],
        ),
        known("hidden_three", "three of 0.3 %, to which nothing leads", (4, 2), three(), nothing_leads),
        known("hidden", "one of 0.02 %, to which nothing leads", (4, 2), needle(), nothing_leads),
    ]
}
