//! Colours that people with any colour vision tell apart.

use std::fmt::Write as _;

use pdk_sdk::ops::light::to_light;
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

/// What the colour of a cell says. Each kind has colours of its own, so that a drive that was survived at a distance never looks like
/// one that failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hue {
    /// Drives failed: the vehicle left its lane or hit something.
    Failed,
    /// Drives failed because the vehicle stopped.
    Stopped,
    /// Drives failed because it was too slow.
    Late,
    /// A distance or an error of what did not fail.
    Distance,
    /// Fewer failures than another driver.
    Better,
}

/// Ramps from harmless to bad. On a white ground each step is darker than the one before, on a dark ground lighter: what is harmless
/// recedes in both.
struct Ramps {
    hue: Hue,
    /// The letter of its classes in the style sheet.
    letter: char,
    light: &'static [Rgb],
    dark: &'static [Rgb],
}

/// Where the ramps on a dark ground begin, near the ground itself.
const DARK: Rgb = Rgb(34, 38, 43);

const RAMPS: [Ramps; 5] = [
    Ramps {
        hue: Hue::Failed,
        letter: 'f',
        light: &[
            Rgb(255, 250, 228),
            Rgb(253, 216, 133),
            Rgb(245, 156, 75),
            Rgb(216, 84, 66),
            Rgb(150, 36, 88),
            Rgb(68, 18, 76),
        ],
        dark: &[
            DARK,
            Rgb(84, 42, 66),
            Rgb(152, 46, 76),
            Rgb(216, 82, 66),
            Rgb(248, 150, 74),
            Rgb(255, 226, 140),
        ],
    },
    Ramps {
        hue: Hue::Stopped,
        letter: 's',
        light: &[
            Rgb(246, 244, 252),
            Rgb(204, 194, 232),
            Rgb(142, 122, 198),
            Rgb(90, 64, 152),
            Rgb(50, 26, 102),
        ],
        dark: &[DARK, Rgb(64, 56, 100), Rgb(112, 98, 172), Rgb(162, 148, 224), Rgb(218, 208, 255)],
    },
    Ramps {
        hue: Hue::Late,
        letter: 'l',
        light: &[
            Rgb(240, 249, 247),
            Rgb(178, 222, 214),
            Rgb(92, 176, 164),
            Rgb(26, 120, 110),
            Rgb(8, 68, 64),
        ],
        dark: &[DARK, Rgb(26, 74, 70), Rgb(34, 120, 112), Rgb(84, 178, 168), Rgb(180, 238, 228)],
    },
    Ramps {
        hue: Hue::Distance,
        letter: 'd',
        light: &[
            Rgb(243, 248, 253),
            Rgb(192, 217, 240),
            Rgb(120, 172, 220),
            Rgb(54, 114, 178),
            Rgb(18, 58, 114),
        ],
        dark: &[DARK, Rgb(36, 66, 100), Rgb(50, 106, 162), Rgb(98, 162, 222), Rgb(188, 224, 255)],
    },
    Ramps {
        hue: Hue::Better,
        letter: 'b',
        light: &[
            Rgb(242, 250, 242),
            Rgb(182, 224, 188),
            Rgb(108, 184, 124),
            Rgb(42, 126, 74),
            Rgb(12, 72, 42),
        ],
        dark: &[DARK, Rgb(32, 76, 50), Rgb(46, 122, 74), Rgb(100, 184, 120), Rgb(188, 242, 196)],
    },
];

/// The colour of a cell: a step on the ramp of a hue. The style sheet has a class for each, with a colour for either ground.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shade {
    /// What it says.
    pub hue: Hue,
    /// From 0, harmless, to [`STEPS`].
    step: usize,
}

/// The last step of a ramp.
const STEPS: usize = 20;

impl Shade {
    /// That of a share from 0, harmless, to 1, bad. Only nothing at all has the first step.
    pub fn new(hue: Hue, share: f64) -> Self {
        let share = share.clamp(0.0, 1.0);
        let step = (share * STEPS as f64).round() as usize;
        Self { hue, step: if share > 0.0 { step.max(1) } else { 0 } }
    }

    /// The ground on white paper, and the text on it.
    pub fn on_paper(self) -> (Rgb, Rgb) {
        let ground = self.on(|ramps| ramps.light);
        (ground, ink(ground))
    }

    fn on(self, of: fn(&Ramps) -> &'static [Rgb]) -> Rgb {
        ramps(self.hue).map_or(DARK, |ramps| along(of(ramps), self.step as f64 / STEPS as f64))
    }
}

impl Serialize for Hue {
    /// The letter of its classes.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_char(ramps(*self).map_or('f', |ramps| ramps.letter))
    }
}

impl Serialize for Shade {
    /// The class in the style sheet.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let letter = ramps(self.hue).map_or('f', |ramps| ramps.letter);
        serializer.collect_str(&format_args!("{letter}{}", self.step))
    }
}

fn ramps(hue: Hue) -> Option<&'static Ramps> {
    RAMPS.iter().find(|ramps| ramps.hue == hue)
}

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

/// The colour at a share of the way along a ramp.
fn along(ramp: &[Rgb], share: f64) -> Rgb {
    let place = share.clamp(0.0, 1.0) * (ramp.len() - 1) as f64;
    let below = (place.floor() as usize).min(ramp.len() - 2);
    let (from, to, part) = (ramp[below], ramp[below + 1], place - below as f64);
    let mix = |from: u8, to: u8| (f64::from(from) + (f64::from(to) - f64::from(from)) * part).round() as u8;
    Rgb(mix(from.0, to.0), mix(from.1, to.1), mix(from.2, to.2))
}

/// The colour of text on a ground: the one with the higher contrast.
pub fn ink(ground: Rgb) -> Rgb {
    let (black, white) = (Rgb(26, 26, 26), Rgb(255, 255, 255));
    if contrast(ground, black) >= contrast(ground, white) { black } else { white }
}

/// Contrast as the Web Content Accessibility Guidelines 2.1 define it.
fn contrast(a: Rgb, b: Rgb) -> f64 {
    let linear = |v: u8| to_light(f64::from(v) / 255.0);
    let light = |Rgb(r, g, b): Rgb| 0.2126 * linear(r) + 0.7152 * linear(g) + 0.0722 * linear(b) + 0.05;
    (light(a) / light(b)).max(light(b) / light(a))
}

/// The classes of all shades, and the ramps for legends, for a style sheet: on white paper, and on a dark ground.
pub fn style() -> (String, String) {
    (classes(|ramps| ramps.light), classes(|ramps| ramps.dark))
}

fn classes(of: fn(&Ramps) -> &'static [Rgb]) -> String {
    let mut text = String::new();
    for ramps in &RAMPS {
        let letter = ramps.letter;
        let stops: Vec<String> = of(ramps).iter().map(Rgb::to_string).collect();
        let _ =
            writeln!(text, ".ramp.{letter} {{ background: linear-gradient(90deg,{}); }}", stops.join(","));
        for step in 0..=STEPS {
            let ground = Shade { hue: ramps.hue, step }.on(of);
            // What is harmless is written as quietly as it is coloured.
            let ink = if step == 0 { "var(--dim)".to_owned() } else { ink(ground).to_string() };
            let _ = write!(text, ".{letter}{step}{{background:{ground};color:{ink}}}");
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How light a colour looks, 0 to 255 (ITU-R BT.601).
    fn luma(Rgb(r, g, b): Rgb) -> f64 {
        0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b)
    }

    #[test]
    fn ramps_move_away_from_the_ground_all_the_way() {
        for ramps in &RAMPS {
            let lumas = |ramp: &[Rgb]| -> Vec<f64> {
                (0..=STEPS).map(|step| luma(along(ramp, step as f64 / STEPS as f64))).collect()
            };
            let (light, dark) = (lumas(ramps.light), lumas(ramps.dark));
            assert!(light.windows(2).all(|pair| pair[1] < pair[0]), "{:?}: {light:?}", ramps.hue);
            assert!(dark.windows(2).all(|pair| pair[1] > pair[0]), "{:?}: {dark:?}", ramps.hue);
        }
        assert_eq!(Shade::new(Hue::Failed, 0.0).on_paper().0.to_string(), "#fffae4");
        assert_eq!(Shade::new(Hue::Failed, 7.0), Shade::new(Hue::Failed, 1.0));
        // One failure of many is not none.
        assert_ne!(Shade::new(Hue::Failed, 0.001), Shade::new(Hue::Failed, 0.0));
    }

    #[test]
    fn on_a_dark_ground_a_failure_stands_out_and_a_success_recedes() {
        let ground = Rgb(21, 24, 28);
        let at = |share| Shade::new(Hue::Failed, share).on(|ramps| ramps.dark);
        assert!(contrast(at(0.0), ground) < 1.3, "{}", contrast(at(0.0), ground));
        assert!(contrast(at(1.0), ground) > 10.0, "{}", contrast(at(1.0), ground));
    }

    #[test]
    fn numbers_can_be_read_on_every_colour() {
        for ramps in &RAMPS {
            for step in 1..=STEPS {
                for ground in [ramps.light, ramps.dark].map(|ramp| along(ramp, step as f64 / STEPS as f64)) {
                    let contrast = contrast(ground, ink(ground));
                    assert!(contrast >= 4.0, "{:?} {step}, {ground}: {contrast}", ramps.hue);
                }
            }
        }
    }

    #[test]
    fn the_largest_distance_is_far_from_every_colour_of_failures() {
        let away = |a: Rgb, b: Rgb| {
            let square = |a: u8, b: u8| (f64::from(a) - f64::from(b)) * (f64::from(a) - f64::from(b));
            (square(a.0, b.0) + square(a.1, b.1) + square(a.2, b.2)).sqrt()
        };
        for of in [|ramps: &Ramps| ramps.light, |ramps: &Ramps| ramps.dark] {
            let distance = Shade::new(Hue::Distance, 1.0).on(of);
            for share in [0.25, 0.5, 0.75, 1.0] {
                let failed = Shade::new(Hue::Failed, share).on(of);
                assert!(away(distance, failed) > 60.0, "{distance} and {failed}");
            }
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
