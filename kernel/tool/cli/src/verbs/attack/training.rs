//! The training: steps along the gradient of the driver's steering, on average over frames, places and perturbations.

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{DriveContext, Driver, FrameBuf, Random};
use pdk_sdk::seed;
use pdk_sensitivity::momentum::Momentum;
use pdk_supervise::calls::{self, Function};

use super::Shown;
use super::artwork::Artwork;

/// The first step, as a share of the range of the values to one side; later ones are shorter, down to none.
const STEP: f32 = 0.2;
/// A steering that is moved by more than this counts as moved.
const MOVED: f64 = 0.1;
/// Frames to measure on get a place each as often as this.
const PLACES: usize = 3;

/// What is needed to train.
pub struct Training {
    pub driver: Box<dyn Driver>,
    /// The driver in messages.
    pub place: String,
    pub artwork: Artwork,
    /// Perturbations to survive.
    pub under: Vec<Chain>,
    /// The side to steer to: -1 is left.
    pub side: f64,
    /// The speed if that of a frame is not known.
    pub speed: f64,
    pub seed: u64,
}

/// What the driver does on frames.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Measured {
    /// The mean steering.
    pub steering: f64,
    /// By how much it is moved towards the goal.
    pub moved: f64,
    /// The share of the frames at which it is moved by more than a tenth.
    pub share: f64,
}

impl Training {
    /// Trains the values of a picture. After each step `tick` gets the mean steering of its frames.
    ///
    /// # Errors
    /// If the driver has no gradient, or it or a perturbation fails.
    pub fn train(
        &mut self,
        frames: &[Shown],
        steps: u32,
        batch: u32,
        mut tick: impl FnMut(f64),
    ) -> Result<Vec<f32>> {
        let key = seed::key(self.seed, "attack", 0);
        let mut values = self.artwork.start(&mut key.sequence());
        let mut momentum = Momentum::new(values.len());
        let (middle, spread) = self.artwork.range();
        for step in 0..steps {
            let mut random = key.frame(step.into());
            let mut sums = vec![0.0; values.len()];
            let mut mean = 0.0;
            for _ in 0..batch {
                let shown = &frames[random.below(frames.len() as u32) as usize];
                mean += self.gradient(shown, &values, &mut random, &mut sums)? / f64::from(batch);
            }
            sums.iter_mut().for_each(|slope| *slope *= self.side as f32);
            let length = STEP * spread * (1.0 - step as f32 / steps as f32);
            momentum.step(&mut values, &sums, length, [middle - spread, middle + spread]);
            tick(mean);
        }
        Ok(values)
    }

    /// Adds the gradient of the steering at a frame with respect to the values, and gives the steering.
    fn gradient(
        &mut self,
        shown: &Shown,
        values: &[f32],
        random: &mut Random,
        sums: &mut [f32],
    ) -> Result<f64> {
        let mut frame = shown.frame.clone();
        let put = self.artwork.put(values, &mut frame, random);
        let frame = self.perturbed(frame, random)?;
        let cx = self.context(shown);
        let mut slopes = vec![0.0; frame.width() * frame.height() * 3];
        let driver = &mut self.driver;
        let work = || driver.gradient(frame.as_ref(), &cx, &mut slopes);
        let steering =
            calls::call(&self.place, Function::Gradient, work).map_err(|error| error.at(&self.place))?;
        // What a perturbation does in between counts as if it passed changes on as they are.
        self.artwork.back(&put, &mut slopes, frame.width(), sums);
        Ok(steering)
    }

    /// A frame under one of the perturbations, or as it is.
    fn perturbed(&mut self, frame: FrameBuf, random: &mut Random) -> Result<FrameBuf> {
        let drawn = random.below(self.under.len() as u32 + 1) as usize;
        let Some(chain) = self.under.get_mut(drawn) else { return Ok(frame) };
        let mut perturbed = FrameBuf::new(frame.width(), frame.height());
        let moment = Moment::new(u64::from(random.next_u32()), 0.0).alone();
        chain.apply(frame.as_ref(), perturbed.as_mut(), &moment)?;
        Ok(perturbed)
    }

    /// What the driver gets besides a frame.
    fn context(&self, shown: &Shown) -> DriveContext {
        DriveContext { speed: shown.speed.unwrap_or(self.speed), ..DriveContext::default() }
    }

    /// What the driver does on frames as they are, with what a picture is compared with, and with the picture, at the same places.
    ///
    /// # Errors
    /// If the driver fails.
    pub fn measure(&mut self, frames: &[Shown], values: &[f32]) -> Result<[Measured; 3]> {
        let key = seed::key(self.seed, "measured", 0);
        let compared = self.artwork.compared(values, &mut key.sequence());
        let mut measured = [Measured::default(); 3];
        let count = (frames.len() * PLACES) as f64;
        for (number, shown) in (0..).zip(frames.iter().flat_map(|shown| [shown; PLACES])) {
            let mut steered = [0.0; 3];
            for (steered, values) in steered.iter_mut().zip([None, Some(compared.as_slice()), Some(values)]) {
                let mut frame = shown.frame.clone();
                if let Some(values) = values {
                    self.artwork.put(values, &mut frame, &mut key.frame(number));
                }
                *steered = self.steering(shown, &frame)?;
            }
            for (measured, steering) in measured.iter_mut().zip(steered) {
                let moved = (steering - steered[0]) * self.side;
                measured.steering += steering / count;
                measured.moved += moved / count;
                measured.share += if moved > MOVED { 1.0 / count } else { 0.0 };
            }
        }
        Ok(measured)
    }

    /// How the driver steers at a frame that is the first.
    fn steering(&mut self, shown: &Shown, frame: &FrameBuf) -> Result<f64> {
        let cx = self.context(shown);
        let driver = &mut self.driver;
        let control = calls::call(&self.place, Function::Reset, || driver.reset())
            .and_then(|()| calls::call(&self.place, Function::Drive, || driver.drive(frame.as_ref(), &cx)));
        Ok(control.map_err(|error| error.at(&self.place))?.steering)
    }
}
