//! Whether verdicts about two drivers on a recording are wrong as seldom as they promise, although the frames of a recording resemble their
//! neighbours, and how long a recording has to be.
//!
//! `cargo test --release -p pdk-statistics --test recordings -- --include-ignored --nocapture` prints the figures of the guide.

use pdk_seed::{Key, Random};
use pdk_statistics::anytime::{Claim, Side};
use pdk_statistics::neighbours::Neighbours;

const ERROR: f64 = 0.05;
const TOLERATED: f64 = 0.1;
/// A block fails if the mean error of its frames is above this.
const LIMIT: f64 = 1.1;
/// Frames after which the memory of an error has fallen to 1/e: one second at 20 frames a second.
const MEMORY: f64 = 20.0;

/// A series that remembers what it was.
struct Memory {
    value: f64,
    keeps: f64,
}

impl Memory {
    fn new(random: &mut Random) -> Self {
        Self { value: random.normal(), keeps: libm::exp(-1.0 / MEMORY) }
    }

    fn next(&mut self, random: &mut Random) -> f64 {
        self.value = self.keeps * self.value + (1.0 - self.keeps * self.keeps).sqrt() * random.normal();
        self.value
    }
}

/// Studies of two drivers on recordings.
#[derive(Debug, Clone, Copy)]
struct Plan {
    /// Frames of a block.
    block: usize,
    /// Blocks of a recording.
    blocks: usize,
    /// The errors of the new driver are larger by this factor.
    factor: f64,
    /// Whether a test stops although neighbours resemble each other.
    unguarded: bool,
}

#[derive(Debug, Default)]
struct Came {
    worse: f64,
    not_worse: f64,
    undecided: f64,
    looks: f64,
    old_fails: f64,
    new_fails: f64,
}

/// Which blocks the old and the new driver fail. Both see the same scene, which makes some places hard for both.
fn recording(plan: Plan, random: &mut Random) -> Vec<(bool, bool)> {
    let (mut scene, mut old, mut new) = (Memory::new(random), Memory::new(random), Memory::new(random));
    let mut block = |_| {
        let (mut of_old, mut of_new) = (0.0, 0.0);
        for _ in 0..plan.block {
            let hard = 0.5 * scene.next(random);
            of_old += (hard + old.next(random)).abs();
            of_new += plan.factor * (hard + new.next(random)).abs();
        }
        let fails = |sum: f64| sum / plan.block as f64 > LIMIT;
        (fails(of_old), fails(of_new))
    };
    (0..plan.blocks).map(&mut block).collect()
}

fn studies(count: u32, plan: Plan) -> Came {
    let mut random = Key([plan.blocks as u8; 32]).sequence();
    let (mut came, each) = (Came::default(), 1.0 / f64::from(count));
    for _ in 0..count {
        let recording = recording(plan, &mut random);
        let share = |failed: usize| each * failed as f64 / plan.blocks as f64;
        came.old_fails += share(recording.iter().filter(|(old, _)| *old).count());
        came.new_fails += share(recording.iter().filter(|(_, new)| *new).count());
        let mut order: Vec<usize> = (0..plan.blocks).collect();
        random.shuffle(&mut order);
        let (mut not_worse, mut worse) = (Claim::new(Side::Below, TOLERATED), Claim::new(Side::Above, 0.0));
        let mut neighbours = Neighbours::default();
        let mut looks = 0;
        let verdict = loop {
            let Some(&place) = order.get(looks) else { break &mut came.undecided };
            looks += 1;
            let (old, new) = recording[place];
            let difference = f64::from(u8::from(new)) - f64::from(u8::from(old));
            not_worse.add(difference);
            worse.add(difference);
            neighbours.add(place, difference);
            let (is_worse, is_not) = (worse.is_shown(ERROR), not_worse.is_shown(ERROR));
            if (is_worse || is_not) && (plan.unguarded || !neighbours.resemble()) {
                break if is_worse { &mut came.worse } else { &mut came.not_worse };
            }
        };
        *verdict += each;
        came.looks += each * looks as f64;
    }
    println!(
        "{:4} blocks of {:.2} memories, {}: {:2.0} and {:2.0} % fail: {:5.1} % worse, {:5.1} % not worse, {:5.1} % undecided, {:3.0} blocks",
        plan.blocks,
        plan.block as f64 / MEMORY,
        if plan.unguarded { "unguarded" } else { "guarded" },
        100.0 * came.old_fails,
        100.0 * came.new_fails,
        100.0 * came.worse,
        100.0 * came.not_worse,
        100.0 * came.undecided,
        came.looks
    );
    came
}

/// The share of false alarms that chance may add to what is allowed: three standard deviations.
fn margin(count: u32) -> f64 {
    3.0 * libm::sqrt(ERROR * (1.0 - ERROR) / f64::from(count))
}

fn equal_drivers(count: u32, blocks: &[usize], lengths: &[usize]) {
    for &blocks in blocks {
        for &block in lengths {
            let came = studies(count, Plan { block, blocks, factor: 1.0, unguarded: false });
            assert!(came.worse <= ERROR + margin(count), "{came:?}");
        }
    }
}

#[test]
fn drivers_that_are_alike_are_seldom_called_worse() {
    equal_drivers(400, &[60, 200], &[10, 20, 100]);
}

#[test]
#[ignore = "long: 4,000 studies of each kind of recording"]
fn drivers_that_are_alike_are_seldom_called_worse_in_many_studies() {
    equal_drivers(4000, &[30, 60, 120, 400], &[10, 20, 50, 100]);
    // Blocks of a quarter of the memory are too short: few of them have no neighbours that would show it.
    for blocks in [30, 60, 120, 400] {
        studies(4000, Plan { block: 5, blocks, factor: 1.0, unguarded: false });
    }
    for block in [5, 20] {
        studies(4000, Plan { block, blocks: 400, factor: 1.0, unguarded: true });
    }
}

/// Without the look at neighbours, blocks that are far too short raise false alarms: so the test above can fail.
#[test]
fn blocks_that_are_too_short_need_the_look_at_neighbours() {
    let plan = Plan { block: 5, blocks: 200, factor: 1.0, unguarded: true };
    let (without, with) = (studies(400, plan), studies(400, Plan { unguarded: false, ..plan }));
    assert!(without.worse > ERROR + margin(400), "{without:?}");
    assert!(with.worse < without.worse, "{with:?}");
}

#[test]
#[ignore = "long: prints what recordings of some lengths show"]
fn effects_are_found_if_the_recording_is_long_enough() {
    let mut last = Came::default();
    for blocks in [30, 60, 120, 400, 1000] {
        for factor in [1.0, 1.1, 1.2, 1.4] {
            last = studies(1000, Plan { block: 100, blocks, factor, unguarded: false });
        }
    }
    assert!(last.worse > 0.99, "{last:?}");
}
