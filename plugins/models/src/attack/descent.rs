//! Attacks along the gradient, step by step.

use pdk_sdk::prelude::*;

use super::ball::{Ball, Norm};
use super::expectation::Expectation;
use super::goal::Goal;
use super::network::Attacked;

/// An attack along the gradient: projected gradient descent, of which a single step is the fast gradient method.
pub struct Descent {
    network: Expectation,
    goal: Goal,
    norm: Norm,
    change: Vec<f32>,
    tried: FrameBuf,
    best: Best,
}

/// How an attack goes about it.
pub struct Way {
    /// How many steps it takes.
    pub steps: usize,
    /// How long each is, as a share of the size of the change.
    pub share: f64,
    /// Whether it starts from a drawn change, and not from the frame as it is.
    pub drawn: bool,
}

/// The best frame so far, and how well it serves.
#[derive(Default)]
struct Best {
    frame: FrameBuf,
    score: f64,
}

impl Descent {
    /// Opens the network.
    ///
    /// # Errors
    /// If it cannot be attacked along its gradient.
    pub fn open(config: &Config) -> Result<Self> {
        Ok(Self {
            network: Expectation::of(config, Attacked::open(config, true)?),
            goal: Goal::of(config),
            norm: Norm::of(config),
            change: Vec::new(),
            tried: FrameBuf::default(),
            best: Best::default(),
        })
    }

    /// Writes the frame that serves best of all that were tried, the one as it is among them. The network sees them in whole bytes, as the driver does,
    /// and behind the changes that are drawn for the frame, if there are any; what the steps add up to is not rounded.
    ///
    /// # Errors
    /// If the network fails.
    pub fn attack(
        &mut self,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        cx: &Context<'_>,
        way: &Way,
    ) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let ball = Ball::new(self.norm, cx.number("epsilon"), width * height * 3);
        if ball.is_empty() {
            dst.copy_from(src);
            return Ok(());
        }
        let mut random = cx.frame_random();
        self.network.start(width, height, cx.speed, &mut random);
        self.tried.resize(width, height);
        self.best.frame.resize(width, height);
        self.best.frame.as_mut().copy_from(src);
        let (before, at_frame) = self.network.gradient(src)?;
        self.best.score = self.goal.score(before, before);
        for side in self.goal.sides(before) {
            self.change.clear();
            self.change.resize(width * height * 3, 0.0);
            if way.drawn {
                ball.draw(&mut random.clone(), &mut self.change);
                ball.keep(&mut self.change, src);
            }
            for step in 0..way.steps {
                // Without a drawn change, the first gradient is known.
                let (steering, gradient) = match step {
                    0 if !way.drawn => (before, at_frame.clone()),
                    _ => {
                        ball.write(&self.change, src, self.tried.as_mut());
                        let (steering, gradient) = self.network.gradient(self.tried.as_ref())?;
                        self.consider(steering, before);
                        (steering, gradient)
                    }
                };
                ball.climb(&mut self.change, &gradient, self.goal.side(side, steering), way.share);
                ball.keep(&mut self.change, src);
            }
            ball.write(&self.change, src, self.tried.as_mut());
            let steering = self.network.steering(self.tried.as_ref())?;
            self.consider(steering, before);
        }
        dst.copy_from(self.best.frame.as_ref());
        Ok(())
    }

    /// Keeps what was tried if it serves better than all before.
    fn consider(&mut self, steering: f64, before: f64) {
        let score = self.goal.score(steering, before);
        if score > self.best.score {
            self.best.score = score;
            std::mem::swap(&mut self.best.frame, &mut self.tried);
        }
    }
}
