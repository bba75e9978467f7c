//! The perturbations whose network is part of this plugin. They learned from images of the embedded simulator; the recipe is in
//! `scripts/training/repaint`.
//!
//! The networks compute with whole numbers only, all of which 32-bit floats hold exactly, so that every engine on every processor
//! paints the same bytes.

use pdk_onnx::model;
use pdk_sdk::prelude::*;

use crate::engine;
use crate::model_file::Source;
use crate::picture::PictureNetwork;
use crate::repaint::{Repaint, laying};

/// The styles of `artistic`, in the order of the network's.
pub const STYLES: [&str; 6] = ["brush", "dots", "ink", "mosaic", "pencil", "swirls"];

/// The number in a network's file that says in which of its styles it paints.
const STYLE: &str = "style";

/// Defines the perturbation of a network; the literals are its name, which is also that of its file in `scripts/painters`, BLAKE3 of
/// that file, what it does, and where that comes from.
macro_rules! painters {
    ($($painter:ident: $name:literal, $hash:literal, $doc:literal, $source:literal $(, $styles:expr)?;)*) => {
        $(
            #[doc = concat!($doc, ".")]
            pub struct $painter {
                repaint: Repaint,
            }

            impl $painter {
                const CONTENT: &[u8] = include_bytes!(concat!("../../../scripts/painters/", $name, ".onnx"));
            }

            impl Component for $painter {
                fn description() -> Description {
                    let description = Description::perturbation($name, $doc)
                        .family("generative")
                        // A frame takes ten times as long as with most others.
                        .not_default()
                        .source($source)
                        .mathematics("(1 - strength) v + strength G(v)")
                        .blake3($hash);
                    $(let description = description.parameter(
                        Parameter::choice("style", &$styles, "the style, each after a picture that the recipe draws"),
                    );)?
                    laying(description).parameter(engine::indifferent_parameter())
                }

                fn new(config: &Config) -> Result<Self> {
                    Ok(Self { repaint: open($name, Self::CONTENT, config)? })
                }
            }

            impl Perturbation for $painter {
                fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
                    self.repaint.apply(src, dst, cx)
                }
            }
        )*

        #[cfg(test)]
        const ALL: &[(fn() -> Description, &[u8])] = &[$(($painter::description, $painter::CONTENT)),*];
    };
}

painters! {
    Night: "night", "9e5b8e1273b3a3d5baeb3631a6f925876a12a16e9c8d01d3e69d344552f51b27", "Repaints a day as a night, by a network",
        "Park et al., Contrastive Learning for Unpaired Image-to-Image Translation, 2020";
    Rainy: "rainy", "46ba8d284b04dbfa88670b49929e37a37d654c116e3bb61e2c404facb33830f6", "Repaints a dry day as a rainy one, with thick air and a wet road, by a network",
        "Park et al., Contrastive Learning for Unpaired Image-to-Image Translation, 2020";
    Artistic: "artistic", "98caf1702b6a576bb006ce9adc85a9a90a9b4e91ca9c4eb886a8d010f8ad7be3", "Repaints the frame in one of six styles of art, by a network",
        "Dumoulin et al., A Learned Representation for Artistic Style, 2017", STYLES;
}

/// Repaints with a network of this plugin.
fn open(name: &str, content: &'static [u8], config: &Config) -> Result<Repaint> {
    let mut values = config.values().clone();
    values.remove(STYLE);
    values.insert("model".to_owned(), name.into());
    // As the recipe exports them.
    values.insert("scale".to_owned(), "0..255".into());
    values.insert("result".to_owned(), "0..255".into());
    let of_repaint = Config::check(&Repaint::description(), &values)?;
    let source = match config.values().get(STYLE) {
        None => content.into(),
        Some(_) => {
            let style = STYLES.iter().position(|style| *style == config.text(STYLE));
            with_style(content, style.unwrap_or_default())?.into()
        }
    };
    Repaint::of(PictureNetwork::of(Source::BuiltIn(source), &of_repaint)?, &of_repaint)
}

/// The network with another style.
fn with_style(content: &[u8], style: usize) -> Result<Vec<u8>> {
    let mut network = model::decode(content)?;
    let graph = network.graph.iter_mut();
    for tensor in graph.flat_map(|graph| &mut graph.initializer).filter(|tensor| tensor.name == STYLE) {
        tensor.raw_data = (style as i64).to_le_bytes().to_vec();
    }
    Ok(model::encode(&network))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gradient_tests::engines;
    use pdk_sdk::config::frame_values;
    use pdk_sdk::serde_json::{Value, json};

    /// A road under a sky, with lines, a tree, and noise that tells of any shift.
    fn scene(width: usize, height: usize) -> FrameBuf {
        let mut frame = FrameBuf::new(width, height);
        for (x, y) in (0..width * height).map(|at| (at % width, at / width)) {
            let (u, v) = (x as f64 / width as f64, y as f64 / height as f64);
            let noise = ((x * 31 + y * 17) % 23) as u8;
            let side = (u - 0.5).abs() / (v - 0.3).max(0.01);
            let color = match (v < 0.33, side) {
                (true, _) => [110, 160, 215],
                (_, side) if (0.55..0.6).contains(&side) => [225, 225, 220],
                (_, side) if side < 0.55 => [80, 80, 84],
                _ => [80, 120, 50],
            };
            frame.as_mut().set_pixel(x, y, color.map(|value| value + noise));
        }
        frame
    }

    fn painted<P: Component + Perturbation>(given: Value, level: f64, frame: &FrameBuf) -> FrameBuf {
        let description = P::description();
        let config = Config::check(&description, given.as_object().unwrap()).unwrap();
        let mut painter = P::new(&config).unwrap();
        let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
        let mut values = Vec::new();
        frame_values(&description, &config, level, &mut values);
        let key = Key([1; 32]);
        let cx = Context::new(level, 0, 0.0, &key).with_values(&names, &values);
        let mut out = FrameBuf::new(frame.width(), frame.height());
        painter.apply(frame.as_ref(), out.as_mut(), &cx).unwrap();
        out
    }

    fn mean(frame: &FrameBuf) -> f64 {
        frame.data().iter().map(|value| f64::from(*value)).sum::<f64>() / frame.data().len() as f64
    }

    fn difference(a: &FrameBuf, b: &FrameBuf) -> f64 {
        let sum: f64 = a.data().iter().zip(b.data()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
        sum / a.data().len() as f64
    }

    #[test]
    fn the_hashes_that_are_written_down_are_those_of_the_networks() {
        for (description, content) in ALL {
            let hash = blake3::hash(content).to_hex().to_string();
            let description = description();
            assert_eq!(description.blake3, hash, "write the hash of `{}` down anew", description.name);
        }
    }

    #[test]
    fn networks_are_small() {
        let sizes: Vec<_> = ALL.iter().map(|(_, content)| content.len()).collect();
        assert!(sizes.iter().all(|size| *size < 600_000), "{sizes:?}");
    }

    #[test]
    fn every_engine_paints_the_same_bytes() {
        let frame = scene(320, 160);
        for style in STYLES {
            let of = |engine| painted::<Artistic>(json!({"style": style, "engine": engine}), 4.0, &frame);
            let all: Vec<_> = engines().into_iter().map(of).collect();
            assert!(all.iter().all(|picture| picture.data() == all[0].data()), "{style}");
        }
        let nights =
            engines().into_iter().map(|engine| painted::<Night>(json!({"engine": engine}), 4.0, &frame));
        let nights: Vec<_> = nights.collect();
        assert!(nights.iter().all(|picture| picture.data() == nights[0].data()));
        let rains =
            engines().into_iter().map(|engine| painted::<Rainy>(json!({"engine": engine}), 4.0, &frame));
        let rains: Vec<_> = rains.collect();
        assert!(rains.iter().all(|picture| picture.data() == rains[0].data()));
    }

    #[test]
    fn weather_is_what_its_name_says_and_follows_the_level() {
        let frame = scene(320, 160);
        let nights = [0.0, 2.0, 4.0].map(|level| mean(&painted::<Night>(json!({}), level, &frame)));
        assert!(nights[0] > nights[1] && nights[1] > nights[2], "{nights:?}");
        assert!(nights[2] < 0.4 * mean(&frame), "{nights:?} of {}", mean(&frame));
        let rain = painted::<Rainy>(json!({}), 4.0, &frame);
        let colorful = |frame: &FrameBuf| {
            let spread = |p: &[u8]| f64::from(p.iter().max().unwrap() - p.iter().min().unwrap());
            frame.data().chunks_exact(3).map(spread).sum::<f64>()
        };
        assert!(colorful(&rain) < 0.6 * colorful(&frame), "{} of {}", colorful(&rain), colorful(&frame));
    }

    #[test]
    fn styles_differ_and_other_ones_are_refused() {
        let frame = scene(320, 160);
        let pictures = STYLES.map(|style| painted::<Artistic>(json!({"style": style}), 4.0, &frame));
        for (i, one) in pictures.iter().enumerate() {
            for other in &pictures[..i] {
                assert!(difference(one, other) > 10.0, "{}", STYLES[i]);
            }
        }
        let given = json!({"style": "mosaik"});
        let error =
            Config::check(&Artistic::description(), given.as_object().unwrap()).unwrap_err().to_string();
        assert!(error.contains("style") && error.contains("mosaic"), "{error}");
        // The file says the same names in the same order.
        let text = String::from_utf8_lossy(Artistic::CONTENT);
        assert!(text.contains(&STYLES.join(",")));
    }

    #[test]
    fn frames_of_other_sizes_are_scaled_or_tiled() {
        let frame = scene(500, 300);
        let scaled = painted::<Night>(json!({}), 4.0, &frame);
        let tiled = painted::<Night>(json!({"fit": "tile"}), 4.0, &frame);
        assert_eq!((scaled.width(), scaled.height()), (500, 300));
        assert!(difference(&scaled, &tiled) > 0.5);
        let tiny = painted::<Rainy>(json!({}), 4.0, &scene(21, 13));
        assert_eq!((tiny.width(), tiny.height()), (21, 13));
    }
}
