//! Whether intervals cover the truth as often as they promise, on made-up failures with known probabilities.
//!
//! `cargo test --release -p pdk-statistics -- --ignored --nocapture` prints the figures of more conditions, with more studies each.

use pdk_seed::{Key, Random};
use pdk_statistics::CONFIDENCE;
use pdk_statistics::drives::{Drives, share_over_roads};
use pdk_statistics::level::{Bisection, Trial, failing_level};
use pdk_statistics::mean::over_roads;
use pdk_statistics::paired::compare;
use pdk_statistics::share::share;

/// Roads from easy to hard.
#[derive(Clone, Copy)]
struct World {
    /// How much roads differ: the standard deviation of the level at which they fail.
    spread: f64,
    /// How much a drive on the same road depends on luck: the scale of a logistic curve over the level.
    luck: f64,
    /// The level at which a road fails every other time, on average over roads.
    middle: f64,
}

impl World {
    fn road(&self, random: &mut Random) -> f64 {
        self.middle + self.spread * random.normal()
    }

    fn fails(&self, road: f64, level: f64) -> f64 {
        1.0 / (1.0 + libm::exp((road - level) / self.luck))
    }

    /// The probability of failing over all roads.
    fn probability(&self, level: f64) -> f64 {
        let many = 2001;
        let road = |i: i32| {
            let share = (f64::from(i) + 0.5) / f64::from(many);
            self.middle + self.spread * pdk_seed::normal_quantile(share)
        };
        (0..many).map(|i| self.fails(road(i), level)).sum::<f64>() / f64::from(many)
    }
}

const WORLDS: [World; 4] = [
    World { spread: 0.8, luck: 0.05, middle: 2.0 },
    World { spread: 0.5, luck: 0.4, middle: 1.4 },
    World { spread: 1.5, luck: 0.2, middle: 2.6 },
    World { spread: 0.3, luck: 0.6, middle: 2.1 },
];
/// Roads that hardly differ, as for a perturbation that draws nothing.
const ALIKE: World = World { spread: 0.02, luck: 0.01, middle: 1.2 };
const LEVELS: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];
/// Those that a fine bisection chooses from.
const QUARTERS: [f64; 17] =
    [0.0, 0.25, 0.5, 0.75, 1.0, 1.25, 1.5, 1.75, 2.0, 2.25, 2.5, 2.75, 3.0, 3.25, 3.5, 3.75, 4.0];

/// How often the interval of a made-up study covers the truth.
fn coverage(studies: u32, name: &str, mut covers: impl FnMut(&mut Random) -> bool) -> f64 {
    let mut key = [0; 32];
    key.iter_mut().zip(name.bytes()).for_each(|(to, byte)| *to = byte);
    let mut random = Key(key).sequence();
    let share = (0..studies).filter(|_| covers(&mut random)).count() as f64 / f64::from(studies);
    println!("{:5.1} %  {name}", 100.0 * share);
    share
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// One drive a road, any probability: the mean over probabilities, because that of a single one jumps from count to count.
fn shares(studies: u32, roads: u64) -> f64 {
    let steps = 99;
    let each = studies.div_ceil(steps).max(1);
    let of = |step: u32| {
        let probability = f64::from(step + 1) / f64::from(steps + 1);
        coverage_quietly(each, u64::from(step) + 1000 * roads, |random| {
            let failed = (0..roads).filter(|_| random.unit() < probability).count();
            let found = share(failed as u64, roads, CONFIDENCE).expect("there are roads");
            found.low <= probability && probability <= found.high
        })
    };
    let found = mean(&(0..steps).map(of).collect::<Vec<_>>());
    println!("{:5.1} %  a share, one drive on each of {roads} roads, over all probabilities", 100.0 * found);
    found
}

fn coverage_quietly(studies: u32, seed: u64, mut covers: impl FnMut(&mut Random) -> bool) -> f64 {
    let mut random = Key([7; 32]).frame(seed);
    (0..studies).filter(|_| covers(&mut random)).count() as f64 / f64::from(studies)
}

/// One level, several repeats a road.
fn repeated(studies: u32, world: World, level: f64, roads: usize, repeats: u32) -> f64 {
    let truth = world.probability(level);
    let name = format!("{roads:2} roads x {repeats} repeats, one level, probability {truth:.2}");
    coverage(studies, &name, |random| {
        let drives: Vec<Drives> = (0..roads)
            .map(|_| {
                let probability = world.fails(world.road(random), level);
                let mut drives = Drives::default();
                (0..repeats).for_each(|_| drives.add(random.unit() < probability));
                drives
            })
            .collect();
        let found = share_over_roads(&drives, CONFIDENCE).expect("there are roads");
        found.low <= truth && truth <= found.high
    })
}

/// The share that fails of the levels of a road: what a perturbation is ranked by.
fn failed_share(random: &mut Random, world: World, road: f64, repeats: u32) -> f64 {
    let drive = |level: &f64| {
        let failed = (0..repeats).filter(|_| random.unit() < world.fails(road, *level)).count();
        failed as f64 / f64::from(repeats)
    };
    mean(&LEVELS.iter().map(drive).collect::<Vec<_>>())
}

fn over_levels(studies: u32, world: World, roads: usize, repeats: u32) -> f64 {
    let truth = mean(&LEVELS.map(|level| world.probability(level)));
    let name = format!("{roads:2} roads x 5 levels x {repeats} repeats, mean probability {truth:.2}");
    coverage(studies, &name, |random| {
        let values: Vec<f64> = (0..roads)
            .map(|_| {
                let road = world.road(random);
                failed_share(random, world, road, repeats)
            })
            .collect();
        let found = over_roads(&values, (0.0, 1.0), CONFIDENCE).expect("there are roads");
        found.low <= truth && truth <= found.high
    })
}

/// Two drivers on the same roads, of which the second holds out longer.
fn differences(studies: u32, world: World, better: f64, roads: usize) -> f64 {
    let second = World { middle: world.middle + better, ..world };
    let truth = mean(&LEVELS.map(|level| world.probability(level) - second.probability(level)));
    let name = format!("{roads:2} roads x 5 levels, two drivers, difference {truth:.2}");
    coverage(studies, &name, |random| {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for _ in 0..roads {
            let road = world.road(random);
            a.push(Some(failed_share(random, world, road, 1)));
            b.push(Some(failed_share(random, second, road + better, 1)));
        }
        let found = compare(&a, &b, (0.0, 1.0), CONFIDENCE).expect("there are roads").difference;
        found.low <= truth && truth <= found.high
    })
}

/// How the failing level is looked for.
#[derive(Clone, Copy)]
struct Plan {
    roads: usize,
    repeats: usize,
    bisection: Option<Bisection>,
    /// The levels that are driven if there is no bisection.
    levels: &'static [f64],
    /// Whether the luck of a repeat is the same at all levels, so that it fails from one of them on, or another at each.
    same_luck: bool,
}

const PLAN: Plan = Plan { roads: 10, repeats: 1, bisection: Some(FINE), levels: &LEVELS, same_luck: false };

/// The drives of a study.
fn drives(world: World, plan: Plan, random: &mut Random) -> Vec<Vec<Vec<Trial>>> {
    let Plan { roads, repeats, bisection, same_luck, levels } = plan;
    let repeat = |road: f64, random: &mut Random| {
        let of_repeat = random.unit();
        let mut drive = |level: f64| {
            let luck = if same_luck { of_repeat } else { random.unit() };
            Trial { level, failed: luck < world.fails(road, level) }
        };
        let Some(bisection) = bisection else { return levels.iter().copied().map(drive).collect() };
        let mut trials = Vec::new();
        while let Some(level) = bisection.next(&trials) {
            trials.push(drive(level));
        }
        trials
    };
    (0..roads)
        .map(|_| {
            let road = world.road(random);
            (0..repeats).map(|_| repeat(road, random)).collect()
        })
        .collect()
}

/// The failing level. The truth is where the share over all roads crosses one half, which is the middle: roads and luck are
/// symmetric about it.
fn levels(studies: u32, world: World, plan: Plan) -> f64 {
    let Plan { roads, repeats, bisection, same_luck, .. } = plan;
    let how = if bisection.is_some() { "bisection" } else { "5 levels" };
    let each = if same_luck { "a repeat" } else { "a drive" };
    let World { spread, luck, middle } = world;
    let name = format!(
        "{roads:2} roads x {repeats} repeats, level {middle} by {how}, spread {spread}, luck {luck} of {each}"
    );
    let (mut driven, mut width) = (0, 0.0);
    let found = coverage(studies, &name, |random| {
        let trials = drives(world, plan, random);
        let found = failing_level(&trials, CONFIDENCE).expect("there are roads");
        driven += found.drives;
        let (low, high) = (found.low.unwrap_or(4.0), found.high.unwrap_or(4.0));
        width += high - low;
        found.low.is_some_and(|low| low <= world.middle) && found.high.is_none_or(|high| high >= world.middle)
    });
    let each = f64::from(studies);
    println!("         with {:.1} drives, the interval {:.2} wide", driven as f64 / each, width / each);
    found
}

const COARSE: Bisection = Bisection { lowest: 0.0, highest: 4.0, resolution: 1.0 };
const FINE: Bisection = Bisection { lowest: 0.0, highest: 4.0, resolution: 0.25 };

/// 95 % within sampling error of this many studies: two points, and four standard errors.
fn promised(coverage: f64) -> bool {
    (0.93..=0.97).contains(&coverage)
}

#[test]
fn intervals_cover_as_often_as_they_promise() {
    let mut found = Vec::new();
    for roads in [10, 20] {
        found.push(shares(40_000, roads));
    }
    found.push(repeated(1500, WORLDS[1], 1.0, 20, 3));
    found.push(over_levels(1500, WORLDS[0], 10, 1));
    found.push(over_levels(1500, WORLDS[1], 10, 3));
    found.push(differences(1500, WORLDS[1], 0.7, 10));
    assert!(found.iter().all(|coverage| promised(*coverage)), "{found:?}");
}

/// Intervals of failing levels end at levels that were driven, so they cover more often.
#[test]
fn intervals_of_failing_levels_cover_at_least_as_often() {
    let mut found = Vec::new();
    for world in [WORLDS[0], WORLDS[1], ALIKE] {
        for bisection in [None, Some(FINE)] {
            found.push(levels(400, world, Plan { bisection, ..PLAN }));
            found.push(levels(200, world, Plan { bisection, repeats: 3, same_luck: true, ..PLAN }));
        }
    }
    assert!(found.iter().all(|coverage| *coverage >= 0.93), "{found:?}");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn few_roads_cover_less() {
    let mut found = Vec::new();
    for roads in [4, 6, 8] {
        for world in WORLDS {
            found.push(over_levels(1000, world, roads, 1));
            found.push(differences(1000, world, 0.7, roads));
            found.push(levels(300, world, Plan { roads, ..PLAN }));
            found.push(levels(300, world, Plan { roads, bisection: Some(COARSE), ..PLAN }));
        }
    }
    assert!(found.iter().all(|coverage| *coverage >= 0.86), "{found:?}");
}

/// Rare failures: shares of failing drives that are far from normal, with their mean.
type Rare = (&'static str, f64, fn(&mut Random) -> f64);

const RARE: [Rare; 4] = [
    // A gamma distribution of shape 1/2: half of the square of a normal number, scaled.
    ("most roads almost never", 0.05, |random| (0.05 * random.normal().powi(2)).min(1.0)),
    ("most roads almost never, some less", 0.01, |random| (0.01 * random.normal().powi(2)).min(1.0)),
    ("one road in ten always", 0.1, |random| if random.unit() < 0.1 { 1.0 } else { 0.0 }),
    ("one road in twenty at the highest level", 0.01, |random| if random.unit() < 0.05 { 0.2 } else { 0.0 }),
];

/// Many drives a road, of which few fail.
fn rare(studies: u32, (what, truth, share): Rare, roads: usize) -> f64 {
    coverage(studies, &format!("{roads:2} roads, mean {truth:.2}: {what}"), |random| {
        let values: Vec<f64> = (0..roads).map(|_| share(random)).collect();
        let found = over_roads(&values, (0.0, 1.0), CONFIDENCE).expect("there are roads");
        found.low <= truth && truth <= found.high
    })
}

#[test]
fn intervals_of_rare_failures_cover_too() {
    for roads in [4, 6, 8, 10, 20] {
        for world in RARE {
            let found = rare(500, world, roads);
            assert!(found >= 0.93, "{roads} roads, {}: {found}", world.0);
        }
    }
}

/// A quantity that has one value a road, with its mean and what it can be.
type Quantity = (&'static str, f64, (f64, f64), fn(&mut Random) -> f64);

const ANY: (f64, f64) = (f64::NEG_INFINITY, f64::INFINITY);
const LENGTH: (f64, f64) = (0.0, f64::INFINITY);

fn exponential(random: &mut Random) -> f64 {
    -libm::log(1.0 - random.unit())
}

fn lognormal(random: &mut Random) -> f64 {
    libm::exp(random.normal())
}

/// The mean of a lognormal quantity with sigma 1.
const LOGNORMAL: f64 = 1.648_721_270_700_128;

const QUANTITIES: [Quantity; 6] =
    [
        ("normal", 0.0, ANY, Random::normal),
        ("uniform", 0.5, (0.0, 1.0), Random::unit),
        ("exponential", 1.0, LENGTH, exponential),
        ("lognormal, sigma 1", LOGNORMAL, LENGTH, lognormal),
        ("half 0, else exponential", 0.5, LENGTH, |random| {
            if random.unit() < 0.5 { 0.0 } else { exponential(random) }
        }),
        ("80 % 0, else lognormal", 0.2 * LOGNORMAL, LENGTH, |random| {
            if random.unit() < 0.8 { 0.0 } else { lognormal(random) }
        }),
    ];

/// Means of quantities, of which not all are the same on all roads.
fn means(studies: u32, (name, truth, range, quantity): Quantity, roads: usize) -> f64 {
    coverage(studies, &format!("{roads:2} roads, mean, {name}"), |random| {
        let values = loop {
            let values: Vec<f64> = (0..roads).map(|_| quantity(random)).collect();
            if values.iter().any(|value| *value != values[0]) {
                break values;
            }
        };
        let found = over_roads(&values, range, CONFIDENCE).expect("there are roads");
        found.low <= truth && truth <= found.high
    })
}

#[test]
fn means_of_skewed_quantities_are_covered_too() {
    for roads in [6, 8, 10, 20, 50] {
        for quantity in QUANTITIES {
            let found = means(4000, quantity, roads);
            // The longer the tail, the more studies miss it altogether.
            let least = match quantity.0 {
                "normal" | "uniform" => 0.93,
                "lognormal, sigma 1" if roads < 20 => 0.87,
                _ => 0.91,
            };
            assert!((least..=0.98).contains(&found), "{roads} roads, {}: {found}", quantity.0);
        }
    }
}

/// How often two conditions that do not differ have a p of at most 5 %.
fn size(studies: u32, world: World, roads: usize) -> f64 {
    let name = format!("{roads:2} roads, p at most 5 %, alike, middle {}, luck {}", world.middle, world.luck);
    coverage(studies, &name, |random| {
        let (mut a, mut b) = (Vec::new(), Vec::new());
        for _ in 0..roads {
            let road = world.road(random);
            a.push(Some(failed_share(random, world, road, 1)));
            b.push(Some(failed_share(random, world, road, 1)));
        }
        compare(&a, &b, (0.0, 1.0), CONFIDENCE).expect("there are roads").p <= 0.05
    })
}

/// Conditions that fail at all levels, and ones that rarely fail.
const ALIKE_WORLDS: [World; 3] = [
    World { spread: 0.5, luck: 0.4, middle: 2.0 },
    World { spread: 0.5, luck: 0.1, middle: 2.0 },
    World { spread: 0.5, luck: 0.4, middle: 4.5 },
];

#[test]
#[ignore = "long: .ci/run runs it"]
fn conditions_that_do_not_differ_seldom_seem_to() {
    for roads in [5, 6, 8, 10, 14, 20] {
        for world in ALIKE_WORLDS {
            let found = size(if roads < 15 { 3000 } else { 600 }, world, roads);
            assert!(found <= 0.07, "{roads} roads, {}: {found}", world.middle);
        }
    }
}

/// The mean of the levels that are found, less the truth, by bisection and by driving all of its levels; and how often there is none.
fn bias(studies: u32, world: World, plan: Plan) -> (f64, f64) {
    let mut random = Key([11; 32]).frame(u64::from(plan.same_luck));
    let (mut sum, mut found, mut never) = (0.0, 0_u32, 0_u32);
    for _ in 0..studies {
        match failing_level(&drives(world, plan, &mut random), CONFIDENCE).and_then(|found| found.level) {
            Some(level) => (sum, found) = (sum + level, found + 1),
            None => never += 1,
        }
    }
    (sum / f64::from(found.max(1)) - world.middle, f64::from(never) / f64::from(studies))
}

fn biases(studies: u32, world: World, same_luck: bool, roads: usize) -> [f64; 2] {
    let plan = Plan { roads, same_luck, ..PLAN };
    let of = [
        bias(studies, world, plan),
        bias(studies, world, Plan { bisection: None, levels: &QUARTERS, ..plan }),
    ];
    println!(
        "{:+.2} by bisection (never in {:3.0} %), {:+.2} by all levels (never in {:3.0} %): {roads} roads, level {}, spread {}, luck {} of {}",
        of[0].0,
        100.0 * of[0].1,
        of[1].0,
        100.0 * of[1].1,
        world.middle,
        world.spread,
        world.luck,
        if same_luck { "a repeat" } else { "a drive" }
    );
    of.map(|(bias, _)| bias)
}

#[test]
fn bisection_is_biased_only_where_each_drive_has_luck_of_its_own() {
    let world = World { spread: 0.5, luck: 0.6, middle: 3.0 };
    let same = biases(100, world, true, 10);
    assert!(same.iter().all(|bias| bias.abs() < 0.12), "{same:?}");
    let other = biases(100, world, false, 10);
    assert!(other[0].abs() < 0.4 && other[1].abs() < 0.12, "{other:?}");
}

#[test]
#[ignore = "takes minutes; prints how far levels that bisection finds are from the truth"]
fn figures_of_bisection() {
    for same_luck in [true, false] {
        for spread in [0.3, 1.0] {
            for middle in [1.0, 2.0, 3.0, 3.5] {
                for luck in [0.05, 0.2, 0.4, 0.6, 0.8] {
                    biases(200, World { spread, luck, middle }, same_luck, 10);
                }
            }
        }
    }
}

#[test]
#[ignore = "takes minutes; prints the figures of many conditions"]
fn figures() {
    let studies = 4000;
    for roads in [5, 10, 20, 40] {
        shares(200_000, roads);
    }
    for roads in [5, 6, 8, 10, 20] {
        for world in WORLDS.into_iter().chain([ALIKE]) {
            for repeats in [2, 3, 5] {
                repeated(studies, world, 1.0, roads, repeats);
            }
            for repeats in [1, 3] {
                over_levels(studies, world, roads, repeats);
            }
            differences(studies, world, 0.7, roads);
            differences(studies, world, 0.0, roads);
        }
    }
}

#[test]
#[ignore = "takes minutes; prints the figures of intervals of failing levels"]
fn figures_of_levels() {
    let studies = 4000;
    for roads in [5, 6, 8, 10, 20] {
        for world in WORLDS.into_iter().chain([ALIKE]) {
            for bisection in [None, Some(COARSE), Some(FINE)] {
                levels(studies / 4, world, Plan { roads, bisection, ..PLAN });
                levels(studies / 4, world, Plan { roads, bisection, repeats: 3, same_luck: true, ..PLAN });
            }
        }
    }
}
