//! What weather and light do to the whole frame: air full of drops or flakes hides what is far away, and a sun in the picture
//! makes the camera expose less and scatters light in its lens.

use pdk_sdk::ops::overlay::attenuate;
use pdk_sdk::prelude::*;

/// Height of the camera above the road in metres.
const CAMERA_HEIGHT: f64 = 1.4;
/// Heights of the frame that an angle with tangent 1 takes, for a lens of 75 degrees and a frame twice as wide as high.
const FOCAL: f64 = 1.3;

/// By day, the mean value above the horizon is at least this.
const DAY: f64 = 90.0;

/// What is done to a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Effect {
    /// Air of this colour by day, of which as many metres hide nearly two thirds of the scene, and which hides at most this share of it. The
    /// horizon is a share of the frame's height from the top. If the scene above the horizon is darker than by day, so is the air, in
    /// proportion.
    Haze { colour: [f64; 3], metres: f64, most: f64, horizon: f64 },
    /// The camera lets in less light by a share of `darker`, and a share of `veil` of white is scattered over the frame, of this
    /// colour.
    Glare { colour: [f64; 3], darker: f64, veil: f64 },
}

/// Does it to frames.
pub struct Air {
    effect: Effect,
    frame: FrameBuf,
}

impl Air {
    pub fn new(effect: Effect) -> Self {
        Self { effect, frame: FrameBuf::default() }
    }

    /// The frame behind it, as strong as the opacity of the clip says.
    pub fn apply(&mut self, src: Frame<'_>, cx: &Context<'_>) -> Frame<'_> {
        let opacity = cx.number("opacity");
        let (width, height) = (src.width(), src.height());
        self.frame.resize(width, height);
        let light = self.effect.light(src);
        for y in 0..height {
            let (share, added) = self.effect.at((y as f64 + 0.5) / height as f64, opacity);
            // In 65536ths, so that every machine computes the same.
            let keep = ((1.0 - share) * 65536.0).round() as u32;
            let add = added.map(|added| (added * light * 255.0 * 65536.0).round() as u32 + 32768);
            attenuate(src.row(y), self.frame.as_mut().row_mut(y), keep, add);
        }
        self.frame.as_ref()
    }
}

impl Effect {
    /// How much light there is, 0 to 1.
    fn light(&self, src: Frame<'_>) -> f64 {
        let Self::Haze { horizon, .. } = *self else { return 1.0 };
        let rows = ((horizon * src.height() as f64) as usize).clamp(1, src.height().max(1));
        let sum: u64 = (0..rows).flat_map(|y| src.row(y)).map(|&value| u64::from(value)).sum();
        (sum as f64 / (rows * src.width() * 3) as f64 / DAY).min(1.0)
    }

    /// The share of the scene that is lost at a height, from 0 at the top to 1 at the bottom, and the light that comes instead.
    fn at(&self, height: f64, opacity: f64) -> (f64, [f64; 3]) {
        match *self {
            Self::Haze { colour, metres, most, horizon } => {
                // At the horizon and above it the air is as deep as it gets.
                let below = (height - horizon).max(0.0);
                let depth = CAMERA_HEIGHT * FOCAL / below.max(1e-6);
                let share = opacity * most * (1.0 - libm::exp(-depth / metres));
                (share, colour.map(|value| value * share))
            }
            Self::Glare { colour, darker, veil } => {
                (opacity * darker, colour.map(|value| value * opacity * veil))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn applied(effect: Effect, opacity: f64, value: u8) -> Vec<u8> {
        let mut src = FrameBuf::new(4, 100);
        src.as_mut().data_mut().fill(value);
        let (key, names, values) = (Key([0; 32]), ["opacity".to_owned()], [opacity]);
        let cx = Context::new(2.0, 0, 0.0, &key).with_values(&names, &values);
        let mut air = Air::new(effect);
        let frame = air.apply(src.as_ref(), &cx);
        (0..100).map(|y| frame.pixel(1, y)[1]).collect()
    }

    #[test]
    fn haze_hides_what_is_far_away() {
        let haze = Effect::Haze { colour: [0.5; 3], metres: 60.0, most: 0.6, horizon: 0.3 };
        assert_eq!(applied(haze, 0.0, 200), [200; 100]);
        let rows = applied(haze, 1.0, 255);
        // In a white scene six tenths come from air that is half as bright.
        assert!(rows[..30].iter().all(|row| row.abs_diff(179) <= 1), "{rows:?}");
        assert!(rows[30..].is_sorted() && rows[99] > 245 && rows[35] < 230, "{rows:?}");
        // At night the air is dark too.
        assert_eq!(applied(haze, 1.0, 0), [0; 100]);
        let dusk = applied(haze, 1.0, 45);
        assert!(dusk[10].abs_diff(56) <= 1, "{dusk:?}");
    }

    #[test]
    fn glare_darkens_the_scene_and_lifts_its_shadows() {
        let glare = Effect::Glare { colour: [1.0; 3], darker: 0.4, veil: 0.1 };
        assert_eq!(applied(glare, 1.0, 0), [26; 100]);
        assert_eq!(applied(glare, 1.0, 200), [146; 100]);
        assert_eq!(applied(glare, 0.5, 200), [173; 100]);
    }
}
