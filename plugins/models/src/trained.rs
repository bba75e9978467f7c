//! The networks that are part of this plugin. They learned to drive from images of the embedded simulator; the recipe is in
//! `scripts/training`.

use pdk_sdk::prelude::*;

use crate::driver::Onnx;
use crate::engine;
use crate::model_file::Source;

/// Defines the driver of a network; the literals are its name, which is also that of its file in `scripts/models`, BLAKE3 of that
/// file, and what it does. The hash is written down, because every process that loads the plugin asks for it.
macro_rules! networks {
    ($($driver:ident: $name:literal, $hash:literal, $doc:literal;)*) => {
        $(
            #[doc = concat!($doc, ".")]
            pub struct $driver {
                network: Onnx,
            }

            impl $driver {
                const CONTENT: &[u8] = include_bytes!(concat!("../../../scripts/models/", $name, ".onnx"));
            }

            impl Component for $driver {
                fn description() -> Description {
                    Description::driver($name, $doc)
                        .family("network")
                        .network()
                        .source("DAVE-2: Bojarski et al., End to End Learning for Self-Driving Cars, 2016")
                        .parameter(engine::parameter())
                        .blake3($hash)
                }

                fn new(config: &Config) -> Result<Self> {
                    let mut values = config.values().clone();
                    values.insert("model".to_owned(), $name.into());
                    let config = Config::check(&Onnx::description(), &values)?;
                    let network = Onnx::open(Source::BuiltIn(Self::CONTENT.into()), $name, &config)?;
                    Ok(Self { network })
                }
            }

            impl Driver for $driver {
                fn reset(&mut self) -> Result<()> {
                    self.network.reset()
                }

                fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
                    self.network.drive(frame, cx)
                }

                // The library's own hash changes with every build of it; that of the network says whether it is the same.
                fn info(&self) -> Vec<(String, String)> {
                    let mut info = self.network.info();
                    info.push(("network BLAKE3".to_owned(), $hash.to_owned()));
                    info
                }
            }
        )*

        /// The content of the file of the network that drives under this name; nothing where it is none of these.
        pub fn content(name: &str) -> Option<&'static [u8]> {
            match name {
                $($name => Some($driver::CONTENT),)*
                _ => None,
            }
        }
    };
}

networks! {
    Dave2: "dave2", "11e4f3b254f98268b186306bbba3d3dfc429d6f5ab4a42315f98313fef6324d3",
        "Drives with a network that learned from images of `lane`";
    Dave2Augmented: "dave2_augmented", "8cccfa4173b275f353bc472d27aa7efd229fa4b1c5eef2193425609cda02fa29",
        "Drives with a network that learned from images of `lane` with random noise, blur, brightness and contrast";
    Dave2Temporal: "dave2_temporal", "8c07da59a3d687533850959ae599489c2c5416ca33fd87681261aee5c9f592ac",
        "Drives with a network that learned from images of `lane`, and remembers what it saw 0.3 and 0.6 seconds before";
    Dave2Tub: "dave2_tub", "3d103491d33223951de52b4684f4cdef0c7fed417662914aa82bbf3beb51b871",
        "Drives with a network that learned from images of `lane` and from a recording of a real DonkeyCar";
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::Map;

    #[test]
    fn a_network_drives_as_the_file_that_it_was_made_from() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/models/dave2.onnx");
        let given =
            Map::from_iter([("model".to_owned(), file.into()), ("engine".to_owned(), "tract".into())]);
        let mut from_file = Onnx::new(&Config::check(&Onnx::description(), &given).unwrap()).unwrap();
        let given = Map::from_iter([("engine".to_owned(), "tract".into())]);
        let mut own = Dave2::new(&Config::check(&Dave2::description(), &given).unwrap()).unwrap();
        let pixels = (0..320 * 160 * 3).map(|i| (i * 31 % 251) as u8).collect();
        let frame = FrameBuf::from_vec(pixels, 320, 160).unwrap();
        let cx = DriveContext { speed: 7.0, ..DriveContext::default() };
        let expected = from_file.drive(frame.as_ref(), &cx).unwrap();
        assert_eq!(own.drive(frame.as_ref(), &cx).unwrap(), expected);
        assert!(expected.steering != 0.0, "a test that tells: {expected:?}");
        let hash = blake3::hash(&std::fs::read(file).unwrap()).to_hex().to_string();
        assert!(own.info().contains(&("network BLAKE3".to_owned(), hash)));
    }

    #[test]
    fn the_hashes_that_are_written_down_are_those_of_the_networks() {
        let all = [
            Dave2::description(),
            Dave2Augmented::description(),
            Dave2Temporal::description(),
            Dave2Tub::description(),
        ];
        for description in all {
            let hash = blake3::hash(content(&description.name).unwrap()).to_hex().to_string();
            assert_eq!(description.blake3, hash, "write the hash of `{}` down anew", description.name);
        }
    }
}
