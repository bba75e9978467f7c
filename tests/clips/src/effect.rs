//! What an effect is, and which there are.

use pdk_seed::{Key, Random};

use crate::birds::Birds;
use crate::canvas::Canvas;
use crate::lightning::Lightning;
use crate::rain::Rain;
use crate::smoke::Smoke;
use crate::snow::Snow;
use crate::sun::Sun;

/// Frames per second of what moves slowly: between two of these, both can be mixed.
const SLOW: u32 = 30;
/// Frames per second of what moves so fast that a mixture of two frames shows it twice: the nearest is taken.
const FAST: u32 = 60;

/// Something that moves and repeats.
pub trait Effect {
    /// Draws it at a time: 0 at the beginning of the clip, 1 at its end, where it looks as at 0.
    fn draw(&self, time: f32, canvas: &mut Canvas);
}

/// A clip: its name, its frames per second, its length in frames, how finely it is encoded (the quantiser, finer is smaller) and what
/// it shows.
pub struct Clip {
    pub name: &'static str,
    pub rate: u32,
    pub frames: usize,
    pub quantiser: u8,
    pub make: fn(&mut Random) -> Box<dyn Effect>,
}

/// All clips.
pub const CLIPS: [Clip; 6] = [
    Clip { name: "rain", rate: FAST, frames: 180, quantiser: 33, make: |random| Box::new(Rain::new(random)) },
    Clip { name: "snow", rate: FAST, frames: 240, quantiser: 35, make: |random| Box::new(Snow::new(random)) },
    Clip {
        name: "smoke",
        rate: SLOW,
        frames: 120,
        quantiser: 24,
        make: |random| Box::new(Smoke::new(random)),
    },
    Clip {
        name: "birds",
        rate: FAST,
        frames: 240,
        quantiser: 26,
        make: |random| Box::new(Birds::new(random)),
    },
    Clip { name: "sun", rate: SLOW, frames: 120, quantiser: 22, make: |random| Box::new(Sun::new(random)) },
    Clip {
        name: "lightning",
        rate: SLOW,
        frames: LIGHTNING_FRAMES,
        quantiser: 24,
        make: |random| Box::new(Lightning::new(random)),
    },
];

/// Lightning counts in frames, because a flash is shorter than anything else.
pub const LIGHTNING_FRAMES: usize = 300;

impl Clip {
    /// The effect, always the same.
    pub fn effect(&self) -> Box<dyn Effect> {
        let mut key = [0; 32];
        for (byte, letter) in key.iter_mut().zip(self.name.bytes()) {
            *byte = letter;
        }
        (self.make)(&mut Key(key).sequence())
    }

    /// One of its frames.
    pub fn frame(&self, effect: &dyn Effect, number: usize) -> Canvas {
        let mut canvas = Canvas::new();
        effect.draw(number as f32 / self.frames as f32, &mut canvas);
        canvas
    }
}

/// What is left of a number above the whole number below it.
pub fn fraction(value: f32) -> f32 {
    value - value.floor()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The mean difference between two frames.
    fn difference(a: &Canvas, b: &Canvas) -> f32 {
        let sums =
            a.pixels().iter().zip(b.pixels()).map(|(a, b)| (0..4).map(|i| (a[i] - b[i]).abs()).sum::<f32>());
        sums.sum::<f32>() / a.pixels().len() as f32
    }

    #[test]
    fn every_clip_leads_from_its_last_frame_to_its_first() {
        for clip in &CLIPS {
            let effect = clip.effect();
            let frame = |number: usize| clip.frame(effect.as_ref(), number);
            // The frame behind the last one is the first one.
            assert!(difference(&frame(clip.frames), &frame(0)) < 1e-3, "{}", clip.name);
            // And the step to it is no larger than other steps.
            let inside = difference(&frame(30), &frame(31)).max(difference(&frame(40), &frame(41)));
            let around = difference(&frame(clip.frames - 1), &frame(0));
            assert!(around <= 1.5 * inside + 1e-6, "{}: {around}, elsewhere {inside}", clip.name);
        }
    }

    #[test]
    fn every_clip_shows_something_and_leaves_most_of_the_scene() {
        for clip in &CLIPS {
            let effect = clip.effect();
            let numbers = (0..clip.frames).step_by(10);
            let covers: Vec<f32> = numbers
                .map(|number| {
                    let frame = clip.frame(effect.as_ref(), number);
                    frame.pixels().iter().map(|pixel| pixel[3]).sum::<f32>() / frame.pixels().len() as f32
                })
                .collect();
            let mean = covers.iter().sum::<f32>() / covers.len() as f32;
            println!("{} covers {mean}", clip.name);
            assert!((0.003..0.5).contains(&mean), "{} covers {mean}", clip.name);
            let drawn = clip.frame(effect.as_ref(), 7);
            let again = clip.frame(clip.effect().as_ref(), 7);
            assert_eq!(difference(&drawn, &again), 0.0, "{}", clip.name);
        }
    }
}
