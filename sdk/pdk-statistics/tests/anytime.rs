//! Whether verdicts about two drivers are wrong as seldom as they promise although they are looked at after every road, and how many drives
//! they take.
//!
//! `cargo test --release -p pdk-statistics --test anytime -- --include-ignored --nocapture` prints the figures of more pairs of drivers,
//! with 10,000 studies each.

use pdk_seed::{Key, Random};
use pdk_statistics::anytime::{Claim, Side};

/// The error that is allowed.
const ERROR: f64 = 0.05;
/// The difference that is tolerated.
const TOLERATED: f64 = 0.1;

/// Two drivers on one road: how often the first and the second fail, and how their verdicts hang together.
#[derive(Debug, Clone, Copy)]
enum Pair {
    /// Each road has a probability of failing of its own, evenly spread around a rate; both drivers draw from it.
    ByRoad { rate: f64, spread: f64 },
    /// The verdicts have nothing to do with each other.
    Apart { first: f64, second: f64 },
    /// The second has the verdict of the first but for this share of roads, on which it has one of its own.
    Alike { first: f64, second: f64, own: f64 },
    /// Both fail and pass on the same roads.
    Identical { rate: f64 },
    /// Roads come in runs of ten of which one driver or the other is at a disadvantage, by turns at random: no mean is known of the next
    /// road but that it is 0 given what came before.
    InRuns { rate: f64 },
}

impl Pair {
    /// The verdicts on the next road: whether the first and the second driver fail. `run` is what lasts for some roads.
    fn verdicts(self, random: &mut Random, run: &mut f64, road: u32) -> (bool, bool) {
        match self {
            Self::ByRoad { rate, spread } => {
                let probability = random.uniform(rate - spread, rate + spread).clamp(0.0, 1.0);
                (random.unit() < probability, random.unit() < probability)
            }
            Self::Apart { first, second } => (random.unit() < first, random.unit() < second),
            Self::Alike { first, second, own } => {
                let luck = random.unit();
                let other = if random.unit() < own { random.unit() } else { luck };
                (luck < first, other < second)
            }
            Self::Identical { rate } => {
                let failed = random.unit() < rate;
                (failed, failed)
            }
            Self::InRuns { rate } => {
                if road.is_multiple_of(10) {
                    *run = random.uniform(0.0, 2.0 * rate);
                }
                let (a, b) = (random.unit() < *run, random.unit() < *run);
                if random.below(2) == 0 { (a, b) } else { (b, a) }
            }
        }
    }
}

/// What studies of two drivers came to.
#[derive(Debug, Default)]
struct Studies {
    worse: f64,
    not_worse: f64,
    undecided: f64,
    /// The mean number of roads.
    roads: f64,
}

/// Studies that look after every road and stop at a verdict or after `budget` roads.
fn studies(count: u32, budget: u32, name: &str, pair: Pair) -> Studies {
    let mut key = [0; 32];
    key.iter_mut().zip(name.bytes()).for_each(|(to, byte)| *to = byte);
    let mut random = Key(key).sequence();
    let mut found = Studies::default();
    let each = 1.0 / f64::from(count);
    for _ in 0..count {
        let (mut not_worse, mut worse) = (Claim::new(Side::Below, TOLERATED), Claim::new(Side::Above, 0.0));
        let (mut run, mut road) = (0.0, 0);
        let verdict = loop {
            if road == budget {
                break &mut found.undecided;
            }
            let (first, second) = pair.verdicts(&mut random, &mut run, road);
            road += 1;
            let difference = f64::from(u8::from(second)) - f64::from(u8::from(first));
            not_worse.add(difference);
            worse.add(difference);
            if not_worse.is_shown(ERROR) {
                break &mut found.not_worse;
            }
            if worse.is_shown(ERROR) {
                break &mut found.worse;
            }
        };
        *verdict += each;
        found.roads += each * f64::from(road);
    }
    println!(
        "{:6.2} % worse, {:6.2} % not worse, {:6.2} % undecided, {:5.1} roads  {name}",
        100.0 * found.worse,
        100.0 * found.not_worse,
        100.0 * found.undecided,
        found.roads
    );
    found
}

/// Pairs of drivers that do not differ.
const EQUAL: [(&str, Pair); 12] = [
    ("equal, 1 % fail", Pair::Apart { first: 0.01, second: 0.01 }),
    ("equal, 5 % fail", Pair::Apart { first: 0.05, second: 0.05 }),
    ("equal, 20 % fail", Pair::Apart { first: 0.2, second: 0.2 }),
    ("equal, 50 % fail", Pair::Apart { first: 0.5, second: 0.5 }),
    ("equal, 90 % fail", Pair::Apart { first: 0.9, second: 0.9 }),
    ("equal, roads from 0 to 40 %", Pair::ByRoad { rate: 0.2, spread: 0.2 }),
    ("equal, roads from 0 to 100 %", Pair::ByRoad { rate: 0.5, spread: 0.5 }),
    ("alike, 30 % fail, 20 % own luck", Pair::Alike { first: 0.3, second: 0.3, own: 0.2 }),
    ("alike, 50 % fail, 5 % own luck", Pair::Alike { first: 0.5, second: 0.5, own: 0.05 }),
    ("identical, 30 % fail", Pair::Identical { rate: 0.3 }),
    ("in runs of roads, 20 % fail", Pair::InRuns { rate: 0.2 }),
    ("in runs of roads, 50 % fail", Pair::InRuns { rate: 0.5 }),
];

fn false_alarms(count: u32, budget: u32, pairs: &[(&str, Pair)]) {
    // Three standard deviations of what chance adds to the allowed share.
    let margin = 3.0 * libm::sqrt(ERROR * (1.0 - ERROR) / f64::from(count));
    for (name, pair) in pairs {
        let found = studies(count, budget, name, *pair);
        assert!(found.worse <= ERROR + margin, "{name}: {found:?}");
    }
    // A driver that is worse by exactly what is tolerated is not called "not worse" more often either.
    for (name, pair) in [
        ("worse by what is tolerated, 5 %", Pair::Apart { first: 0.05, second: 0.15 }),
        ("worse by what is tolerated, alike", Pair::Alike { first: 0.3, second: 0.4, own: 0.0 }),
    ] {
        let found = studies(count, budget, name, pair);
        assert!(found.not_worse <= ERROR + margin, "{name}: {found:?}");
    }
}

#[test]
fn drivers_that_are_alike_are_seldom_called_worse() {
    false_alarms(1000, 300, &EQUAL[2..]);
}

#[test]
#[ignore = "long: 10,000 studies of each pair"]
fn drivers_that_are_alike_are_seldom_called_worse_in_many_studies() {
    false_alarms(10_000, 1000, &EQUAL);
}

/// The number of roads that a study with a fixed number needs, so that the exact test of the two kinds of roads on which the verdicts
/// differ (McNemar's, one-sided) finds the effect with this power; none up to `most`.
fn fixed_number(pair: Pair, power: f64, most: u32) -> Option<u32> {
    let mut random = Key([7; 32]).sequence();
    let found = |roads: u32, random: &mut Random| {
        let studies = 2000;
        let hits = (0..studies).filter(|_| {
            let mut run = 0.0;
            let (mut up, mut down) = (0_u32, 0_u32);
            for road in 0..roads {
                let (first, second) = pair.verdicts(random, &mut run, road);
                up += u32::from(second && !first);
                down += u32::from(first && !second);
            }
            // The probability of this many or more of the differing roads against the second driver, if each is as likely either way.
            let all = up + down;
            let mut term = libm::pow(0.5, f64::from(all));
            let mut tail = 0.0;
            for k in 0..=all {
                if k >= up {
                    tail += term;
                }
                term *= f64::from(all - k) / f64::from(k + 1);
            }
            tail <= ERROR
        });
        hits.count() as f64 / f64::from(studies) >= power
    };
    (1..).map(|step| step * 10).take_while(|roads| *roads <= most).find(|roads| found(*roads, &mut random))
}

#[test]
#[ignore = "long: prints the power and the drives that looking saves"]
fn effects_are_found_with_fewer_drives_than_a_fixed_number() {
    let mut saved = 0;
    let pairs = [
        ("worse by 60 points", Pair::Apart { first: 0.1, second: 0.7 }),
        ("worse by 40 points", Pair::Apart { first: 0.1, second: 0.5 }),
        ("worse by 30 points", Pair::Apart { first: 0.2, second: 0.5 }),
        ("worse by 30 points, alike", Pair::Alike { first: 0.2, second: 0.5, own: 0.1 }),
        ("worse by 20 points", Pair::Apart { first: 0.2, second: 0.4 }),
        ("worse by 20 points, alike", Pair::Alike { first: 0.2, second: 0.4, own: 0.1 }),
    ];
    for (name, pair) in pairs {
        let found = studies(2000, 1000, name, pair);
        assert!(found.worse > 0.9, "{name}: {found:?}");
        let fixed = fixed_number(pair, found.worse.min(0.99), 1000);
        println!("                 a fixed number of roads with the same power: {fixed:?}");
        saved += u32::from(fixed.is_some_and(|fixed| f64::from(fixed) > found.roads));
    }
    println!("fewer roads on average in {saved} of {} cases", pairs.len());
    assert!(saved >= 3);
}
