//! What the perturbations share whose network is part of this plugin. They learned from images of the embedded simulator; the recipe is in
//! `scripts/training/repaint`.
//!
//! The networks compute with whole numbers only, all of which 32-bit floats hold exactly, so that every engine on every processor
//! paints the same bytes.

use pdk_onnx::model;
use pdk_sdk::prelude::*;

use super::repaint::{Repaint, laying};
use crate::engine;
use crate::model_file::Source;
use crate::picture::PictureNetwork;

/// The styles of `artistic`, in the order of the network's.
pub const STYLES: [&str; 6] = ["brush", "dots", "ink", "mosaic", "pencil", "swirls"];

/// The number in a network's file that says in which of its styles it paints.
const STYLE: &str = "style";

/// Describes the perturbation of a network, with the BLAKE3 of its file and its styles, if it has several.
pub fn describe(description: Description, source: &str, blake3: &str, styles: &[&str]) -> Description {
    let mut description = description
        .family("generative")
        .alters_geometry()
        // A frame takes ten times as long as with most others.
        .not_default()
        .source(source)
        .mathematics("(1 - strength) v + strength G(v)")
        .blake3(blake3);
    if !styles.is_empty() {
        let style = Parameter::choice(STYLE, styles, "the style, each after a picture that the recipe draws");
        description = description.parameter(style);
    }
    laying(description).parameter(engine::indifferent_parameter())
}

/// Defines the perturbation of a network; the literals are its name, which is also that of its file in `scripts/painters`, its version,
/// BLAKE3 of that file, what it does, and where that comes from.
macro_rules! painter {
    ($painter:ident: $name:literal, $version:literal, $hash:literal, $doc:literal, $source:literal $(, $styles:expr)?) => {
        use pdk_sdk::prelude::*;

        #[doc = concat!($doc, ".")]
        pub struct $painter {
            repaint: super::repaint::Repaint,
        }

        impl $painter {
            /// The content of its file.
            pub const CONTENT: &[u8] =
                include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/painters/", $name, ".onnx"));
        }

        impl Component for $painter {
            fn description() -> Description {
                let description = Description::perturbation($name, $doc).version($version);
                let styles: &[&[&str]] = &[$(&$styles)?];
                super::painter::describe(description, $source, $hash, &styles.concat())
            }

            fn new(config: &Config) -> Result<Self> {
                Ok(Self { repaint: super::painter::open($name, Self::CONTENT, config)? })
            }
        }

        impl Perturbation for $painter {
            fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
                self.repaint.apply(src, dst, cx)
            }
        }
    };
}
pub(super) use painter;

/// Repaints with a network of this plugin.
///
/// # Errors
/// If the engine cannot run it.
pub fn open(name: &str, content: &'static [u8], config: &Config) -> Result<Repaint> {
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
    use super::super::artistic::Artistic;
    use super::super::night::Night;
    use super::super::rainy::Rainy;
    use super::*;
    use crate::gradient_tests::engines;
    use pdk_sdk::serde_json::{Value, json};
    use pdk_sdk::testing::Trial;

    /// A perturbation and its network.
    type Painter = (fn() -> Description, &'static [u8]);

    const ALL: [Painter; 3] = [
        (Night::description, Night::CONTENT),
        (Rainy::description, Rainy::CONTENT),
        (Artistic::description, Artistic::CONTENT),
    ];

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
        Trial::<P>::new(&given, level, Key([1; 32])).unwrap().frame(frame, 0, 0.0).unwrap()
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
