//! Colours that people with any colour vision tell apart.

use serde::{Serialize, Serializer};

/// A colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

impl std::fmt::Display for Rgb {
    /// As CSS writes it.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "#{:02x}{:02x}{:02x}", self.0, self.1, self.2)
    }
}

impl Serialize for Rgb {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// From harmless to bad: every step is darker than the one before, so it reads in grey as well.
const RAMP: [Rgb; 6] = [
    Rgb(255, 250, 228),
    Rgb(253, 216, 133),
    Rgb(245, 156, 75),
    Rgb(216, 84, 66),
    Rgb(150, 36, 88),
    Rgb(68, 18, 76),
];

/// Lines of a group of many, on a white and on a dark ground.
pub const LINES: [Rgb; 8] = [
    Rgb(0, 125, 186),
    Rgb(218, 92, 20),
    Rgb(0, 150, 110),
    Rgb(196, 100, 156),
    Rgb(176, 132, 0),
    Rgb(122, 100, 210),
    Rgb(70, 150, 200),
    Rgb(190, 50, 60),
];

/// Lines of groups that have an order, from harmless to bad.
pub const ORDERED: [Rgb; 5] =
    [Rgb(44, 127, 184), Rgb(45, 160, 140), Rgb(178, 150, 30), Rgb(226, 112, 40), Rgb(190, 30, 60)];

/// The line of what is not perturbed.
pub const NOMINAL: Rgb = Rgb(125, 125, 125);

/// The colour of a share from 0, harmless, to 1, bad.
pub fn ramp(share: f64) -> Rgb {
    let place = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let below = (place.floor() as usize).min(RAMP.len() - 2);
    let (from, to, part) = (RAMP[below], RAMP[below + 1], place - below as f64);
    let mix = |from: u8, to: u8| (f64::from(from) + (f64::from(to) - f64::from(from)) * part).round() as u8;
    Rgb(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

/// The colour of text on a ground.
pub fn ink(ground: Rgb) -> Rgb {
    match luma(ground) > 118.0 {
        true => Rgb(26, 26, 26),
        false => Rgb(255, 255, 255),
    }
}

/// How light a colour looks, 0 to 255 (ITU-R BT.601).
fn luma(Rgb(r, g, b): Rgb) -> f64 {
    0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
}

/// The ramp for a style sheet.
pub fn gradient() -> String {
    let stops: Vec<String> = RAMP.iter().map(Rgb::to_string).collect();
    format!("linear-gradient(90deg,{})", stops.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_gets_darker_all_the_way() {
        let lumas: Vec<f64> = (0..=100).map(|i| luma(ramp(f64::from(i) / 100.0))).collect();
        assert!(lumas.windows(2).all(|pair| pair[1] < pair[0]), "{lumas:?}");
        assert_eq!((ramp(-1.0), ramp(7.0), ramp(0.2)), (RAMP[0], RAMP[5], RAMP[1]));
        assert_eq!(ramp(0.0).to_string(), "#fffae4");
    }

    /// Contrast as the Web Content Accessibility Guidelines 2.1 define it.
    fn contrast(a: Rgb, b: Rgb) -> f64 {
        let linear = |v: u8| {
            let v = f64::from(v) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
        };
        let light = |Rgb(r, g, b): Rgb| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b) + 0.05;
        (light(a) / light(b)).max(light(b) / light(a))
    }

    #[test]
    fn numbers_can_be_read_on_every_colour_of_the_ramp() {
        for i in 0..=100 {
            let ground = ramp(f64::from(i) / 100.0);
            assert!(contrast(ground, ink(ground)) >= 4.0, "{ground}: {}", contrast(ground, ink(ground)));
        }
    }

    #[test]
    fn lines_stand_out_from_both_grounds() {
        for line in LINES.iter().chain(&ORDERED).chain([&NOMINAL]) {
            for ground in [Rgb(255, 255, 255), Rgb(24, 26, 30)] {
                assert!(contrast(*line, ground) >= 2.5, "{line} on {ground}: {}", contrast(*line, ground));
            }
        }
    }
}
