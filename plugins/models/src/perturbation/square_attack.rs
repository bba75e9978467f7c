//! Square attack: random search with squares, which asks the network and needs no gradient.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::attack::ball::{self, Ball, Norm};
use crate::attack::goal::{self, Goal};
use crate::attack::network::{self, Attacked};

/// When squares become half as large: after this many of ten thousand queries.
const HALVES: [f64; 8] = [10.0, 50.0, 200.0, 1000.0, 2000.0, 4000.0, 6000.0, 8000.0];

/// Attacks by asking.
pub struct SquareAttack {
    network: Attacked,
    goal: Goal,
    queries: usize,
    share: f64,
    tried: FrameBuf,
    best: FrameBuf,
}

impl Component for SquareAttack {
    fn description() -> Description {
        let description = Description::perturbation(
            "square_attack",
            "Changes the colours of squares a little so that a network steers elsewhere, by random search that needs no gradient",
        )
        .family("attack")
        .not_default()
        .keeps_geometry()
        .example(json!({"model": "dave2", "queries": 4}))
        .mathematics("v + epsilon s, s the signs of stripes and then of squares, each of which is kept if the steering is nearer to the goal")
        .source("Andriushchenko et al., Square Attack: a query-efficient black-box adversarial attack via random search, 2020")
        .drawn_per_frame("the stripes, and the places and signs of the squares");
        let description = ball::epsilon(description, "no value changes by more than this, rounded down")
            .parameter(
                Parameter::integer("queries", 100, "how often the network is asked about a changed frame, besides once for the frame as it is")
                    .range(1.0, 100_000.0),
            )
            .parameter(
                Parameter::number(
                    "share",
                    0.1,
                    "the share of the frame that the first squares cover; they shrink as queries are used up",
                )
                .range(0.0001, 1.0),
            );
        network::parameters(goal::parameters(description))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            network: Attacked::open(config, false)?,
            goal: Goal::of(config),
            queries: config.integer("queries") as usize,
            share: config.number("share"),
            tried: FrameBuf::default(),
            best: FrameBuf::default(),
        })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(network::files(config))
    }
}

impl Perturbation for SquareAttack {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let epsilon = cx.number("epsilon").floor();
        if Ball::new(Norm::Largest, epsilon, 1).is_empty() {
            dst.copy_from(src);
            return Ok(());
        }
        self.network.move_at(cx.speed);
        let mut random = cx.frame_random();
        let before = self.network.steering(src)?;
        self.best.resize(width, height);
        self.tried.resize(width, height);
        stripes(src, self.best.as_mut(), epsilon, &mut random);
        let mut score = self.goal.score(self.network.steering(self.best.as_ref())?, before);
        for query in 1..self.queries {
            self.tried.as_mut().copy_from(self.best.as_ref());
            let side = side(self.share, query as f64 / self.queries as f64, [width, height]);
            square(src, self.tried.as_mut(), epsilon, side, &mut random);
            let found = self.goal.score(self.network.steering(self.tried.as_ref())?, before);
            if found > score {
                score = found;
                std::mem::swap(&mut self.best, &mut self.tried);
            }
        }
        // The frame as it is may serve better than all that was tried.
        let better = score > self.goal.score(before, before);
        dst.copy_from(if better { self.best.as_ref() } else { src });
        Ok(())
    }
}

/// The side of the squares, in pixels, after a share of the queries.
fn side(share: f64, done: f64, [width, height]: [usize; 2]) -> usize {
    let halved = HALVES.iter().filter(|at| done * 10_000.0 > **at).count() as i32;
    let area = share * (width * height) as f64 / f64::from(1 << halved);
    (area.sqrt().round() as usize).clamp(1, width.min(height))
}

/// Changes each colour of each column by the full amount, up or down.
fn stripes(src: Frame<'_>, mut into: FrameMut<'_>, epsilon: f64, random: &mut Random) {
    let signs: Vec<f64> = (0..src.width() * 3).map(|_| sign(random)).collect();
    for (to, from) in into.rows_mut().zip(src.rows()) {
        for ((to, from), sign) in to.iter_mut().zip(from).zip(&signs) {
            *to = changed(*from, sign * epsilon);
        }
    }
}

/// Changes each colour of a square anywhere by the full amount, up or down.
fn square(src: Frame<'_>, mut into: FrameMut<'_>, epsilon: f64, side: usize, random: &mut Random) {
    let [left, top] =
        [src.width(), src.height()].map(|length| random.below((length - side + 1) as u32) as usize);
    let signs = [(); 3].map(|()| sign(random));
    for y in top..top + side {
        let (from, to) = (&src.row(y)[left * 3..], &mut into.row_mut(y)[left * 3..][..side * 3]);
        for (place, (to, from)) in to.iter_mut().zip(from).enumerate() {
            *to = changed(*from, signs[place % 3] * epsilon);
        }
    }
}

/// Up or down.
fn sign(random: &mut Random) -> f64 {
    if random.below(2) == 0 { -1.0 } else { 1.0 }
}

/// A byte and what is added to it.
fn changed(byte: u8, by: f64) -> u8 {
    (f64::from(byte) + by).clamp(0.0, 255.0) as u8
}
