//! A description: the meaning of its fields, each checked by itself.

use pdk_sdk::error::Result;

use crate::color::Color;
use crate::declared::Element;
use crate::gets::{Gets, Speed, inputs, state};
use crate::given::Given;
use crate::numbers::Scale;
use crate::reading::{known, numbers, whole};
use crate::region::{Length, Region};
use crate::resize::Filter;
use crate::rule::{Rule, Throttle, rule};
use crate::waypoints;

/// What is done with neighbouring frames of a stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Differences {
    /// The stack holds frames.
    #[default]
    None,
    /// It holds the differences of neighbours, one fewer than frames.
    Only,
    /// It holds the newest frame, then the differences.
    Both,
}

/// A description.
#[derive(Debug, Clone, PartialEq)]
pub struct Described {
    /// The fields as they were given, with those of the preset.
    pub given: Given,
    /// Width and height of the frames that crops are meant for.
    pub frame: Option<[usize; 2]>,
    /// What is seen of a frame.
    pub region: Region,
    /// Width and height of the network's image.
    pub image_size: Option<[usize; 2]>,
    /// The filter.
    pub resize: Filter,
    /// What the channels are.
    pub color: Option<Color>,
    /// How bytes become numbers.
    pub scale: Option<Scale>,
    /// What is subtracted: one number, or one for each channel.
    pub mean: Vec<f64>,
    /// What is divided by, likewise.
    pub std: Vec<f64>,
    /// The order of the image's axes.
    pub layout: Option<&'static str>,
    /// The type of the image's numbers.
    pub dtype: Option<&'static str>,
    /// Frames in a stack.
    pub frames: Option<usize>,
    /// The distance between them.
    pub spacing: usize,
    /// Whether the newest frame comes first.
    pub newest_first: bool,
    /// Whether zeros stand for frames before the first.
    pub starts_with_zeros: bool,
    /// Whether the stack holds differences.
    pub differences: Differences,
    /// What inputs get, by their names.
    pub inputs: Vec<(String, Gets)>,
    /// Inputs that get what an output was.
    pub state: Vec<(String, String)>,
    /// The steering.
    pub steering: Option<Rule>,
    /// The throttle.
    pub throttle: Option<Throttle>,
    /// The speed in metres per second that stands for one that is not known, for a network that plans.
    pub assumed: Option<f64>,
}

impl Described {
    /// Reads what was given.
    ///
    /// # Errors
    /// Names the place and the field that cannot be, and what it may be.
    pub fn new(given: Given) -> Result<Self> {
        let given = given.with_preset()?;
        let list = |name: &str, default: f64| match given.get(name) {
            None => Ok(vec![default]),
            Some((value, _)) => numbers(value).filter(|list| !list.is_empty()).ok_or_else(|| {
                given.wrong(
                    name,
                    format_args!("is {value}; write a number, or a list with one for each channel"),
                )
            }),
        };
        let (mean, std) = (list("mean", 0.0)?, list("std", 1.0)?);
        if std.iter().any(|std| *std as f32 == 0.0) {
            return Err(given.wrong(
                "std",
                "holds 0, by which nothing can be divided; write what the network was trained with",
            ));
        }
        let scale = Scale::read(&given)?;
        for name in ["mean", "std"] {
            if scale.is_none() && given.get(name).is_some() {
                return Err(given.wrong(
                    name,
                    "counts in the numbers after `scale`, which is not given; set scale = \"0..1\" or \"0..255\" beside it",
                ));
            }
        }
        let count = |name: &str| match given.get(name) {
            None => Ok(None),
            Some((value, _)) => match whole(value).filter(|count| (1..=1000).contains(count)) {
                Some(count) => Ok(Some(count)),
                None => {
                    Err(given.wrong(name, format_args!("is {value}; write a whole number from 1 to 1000")))
                }
            },
        };
        let differences = match given.choice("differences")? {
            Some("only") => Differences::Only,
            Some("both") => Differences::Both,
            _ => Differences::None,
        };
        let frames = count("frames")?;
        if differences != Differences::None && frames.is_none_or(|frames| frames < 2) {
            return Err(given.wrong("differences", "needs at least two frames; set `frames`"));
        }
        let described = Self {
            frame: size(&given, "frame")?,
            region: region(&given)?,
            image_size: size(&given, "image_size")?,
            resize: given.choice("resize")?.and_then(Filter::of).unwrap_or(Filter::Bilinear),
            color: given.choice("color")?.and_then(Color::of),
            scale,
            mean,
            std,
            layout: given.choice("layout")?,
            dtype: given.choice("dtype")?,
            frames,
            spacing: count("spacing")?.unwrap_or(1),
            newest_first: given.choice("order")? == Some("newest_first"),
            starts_with_zeros: given.choice("start")? == Some("zeros"),
            differences,
            inputs: inputs(&given)?,
            state: state(&given)?,
            steering: rule(&given, "steering")?,
            throttle: match given.get("throttle").map(|(value, _)| value.as_f64()) {
                Some(Some(number)) if (-1.0..=1.0).contains(&number) => Some(Throttle::Constant(number)),
                Some(Some(number)) => {
                    return Err(given.wrong(
                        "throttle",
                        format_args!("is {number}; write a number from -1 to 1, or an output"),
                    ));
                }
                _ => rule(&given, "throttle")?.map(Throttle::Output),
            },
            assumed: waypoints::assumed(&given),
            given,
        };
        Ok(described)
    }

    /// A speed input with what stands for a speed that is not known, if it says nothing itself.
    pub(crate) fn or_assumed(&self, speed: Speed) -> Speed {
        Speed { assumed: speed.assumed.or(self.assumed), ..speed }
    }

    /// The type of the image's numbers that the description demands.
    pub fn element(&self) -> Option<Element> {
        self.dtype.map(|name| match name {
            "float16" => Element::Float16,
            "uint8" => Element::Uint8,
            "int8" => Element::Int8,
            _ => Element::Float32,
        })
    }
}

/// Pixels of a picture: more than any camera has, and few enough to fit into memory.
const MOST_PIXELS: usize = 32_000_000;

fn size(given: &Given, name: &str) -> Result<Option<[usize; 2]>> {
    let Some((value, _)) = given.get(name) else { return Ok(None) };
    let read = value.as_array().and_then(|list| list.iter().map(whole).collect::<Option<Vec<_>>>());
    match read.as_deref() {
        Some([width @ 1..=16_384, height @ 1..=16_384]) if width * height <= MOST_PIXELS => {
            Ok(Some([*width, *height]))
        }
        _ => Err(given.wrong(
            name,
            format_args!(
                "is {value}; write [width, height] in pixels, up to 16384 each and 32 million in all"
            ),
        )),
    }
}

fn region(given: &Given) -> Result<Region> {
    let length = |number: f64, shares: bool| match number {
        _ if !(0.0..1e9).contains(&number) => None,
        number if shares => Some(Length::Share(number)),
        number if number < 1.0 && number > 0.0 => Some(Length::Share(number)),
        number if number.fract() == 0.0 => Some(Length::Pixels(number as usize)),
        _ => None,
    };
    match (given.get("crop"), given.get("region")) {
        (None, None) => Ok(Region::Whole),
        (Some(_), Some(_)) => {
            Err(given.wrong("crop", "says what is cut off and `region` what is kept; leave one of them out"))
        }
        (Some((value, _)), None) => {
            let sides = ["left", "top", "right", "bottom"];
            let form =
                "write a table such as { top = 60, bottom = 25 }, in whole pixels or in shares below 1";
            let Some(table) = value.as_object() else {
                return Err(given.wrong("crop", format_args!("is {value}; {form}")));
            };
            known(given, "crop", table, &sides)?;
            let lengths = sides
                .map(|side| table.get(side).map_or(Some(Length::Pixels(0)), |v| length(v.as_f64()?, false)));
            match lengths {
                [Some(left), Some(top), Some(right), Some(bottom)] => {
                    Ok(Region::Crop([left, top, right, bottom]))
                }
                _ => Err(given.wrong("crop", format_args!("is {value}; {form}"))),
            }
        }
        (None, Some((value, _))) => {
            let list = value.as_array().and_then(|_| numbers(value)).unwrap_or_default();
            let shares = list.iter().all(|number| *number <= 1.0);
            let lengths: Option<Vec<Length>> = list.iter().map(|number| length(*number, shares)).collect();
            match lengths.as_deref() {
                Some([left, top, right, bottom]) => Ok(Region::Edges([*left, *top, *right, *bottom])),
                _ => Err(given.wrong(
                    "region",
                    format_args!("is {value}; write [left, top, right, bottom] in whole pixels, or in shares from 0 to 1"),
                )),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::{Value, json};

    fn read(fields: Value) -> Result<Described> {
        let mut given = Given::default();
        for (name, value) in fields.as_object().unwrap() {
            given.set(name, value.clone(), "pilot.toml line 1");
        }
        Described::new(given)
    }

    fn error(fields: Value) -> String {
        read(fields).unwrap_err().to_string()
    }

    #[test]
    fn every_field_that_cannot_be_is_an_error_with_its_place_and_a_remedy() {
        for (fields, expected) in [
            (json!({"scale": "1..0"}), "`scale` is \"1..0\"; write a range such as"),
            (
                json!({"mean": 0.5}),
                "`mean` counts in the numbers after `scale`, which is not given; set scale",
            ),
            (json!({"scale": "0..1", "std": [0.2, 0]}), "`std` holds 0, by which"),
            (json!({"mean": "x", "scale": "0..1"}), "`mean` is \"x\"; write a number, or a list"),
            (json!({"frames": 0}), "`frames` is 0; write a whole number from 1 to 1000"),
            (json!({"differences": "only"}), "`differences` needs at least two frames; set `frames`"),
            (json!({"image_size": [200]}), "`image_size` is [200]; write [width, height]"),
            (json!({"crop": {"topp": 3}}), "`crop` has no `topp`; did you mean `top`?"),
            (json!({"crop": {"top": 1.5}}), "`crop` is {\"top\":1.5}; write a table such as"),
            (
                json!({"crop": {"top": 1}, "region": [0, 0, 1, 1]}),
                "`crop` says what is cut off and `region` what is kept",
            ),
            (json!({"region": [0, 0, 1]}), "`region` is [0,0,1]; write [left, top"),
            (json!({"color": "ycc"}), "`color` is \"ycc\"; there are `rgb`, `bgr`, `grey`, `yuv`, `hsv`"),
            (
                json!({"inputs": {"v": "sped"}}),
                "`inputs` for `v` has the value \"sped\"; did you mean `speed`?",
            ),
            (
                json!({"inputs": {"v": {"value": "speed", "unit": "kmh"}}}),
                "has the unit \"kmh\"; did you mean `km/h`?",
            ),
            (json!({"inputs": 3}), "`inputs` is 3; write a table such as"),
            (json!({"state": {"h": 3}}), "`state` gives 3 to `h`; write the name of an output"),
            (
                json!({"steering": {"bins": {"from": -1, "to": 1}}}),
                "`steering` has {\"from\":-1,\"to\":1} as `bins`; write {",
            ),
            (json!({"steering": {"bins": [0, 1], "index": 2}}), "`steering` has both `bins`"),
            (json!({"steering": {"decode": "mean"}}), "`steering` has `decode`, which is for bins"),
            (json!({"steering": 3}), "`steering` is 3; write the name of an output"),
            (json!({"throttle": 3}), "`throttle` is 3; write a number from -1 to 1"),
        ] {
            let error = error(fields);
            assert!(error.starts_with("pilot.toml line 1: ") && error.contains(expected), "{error}");
        }
    }

    #[test]
    fn bins_lie_evenly_as_those_of_donkeycar() {
        let described = read(json!({"preset": "donkeycar_categorical"})).unwrap();
        let steering = described.steering.unwrap().bins.unwrap();
        let Some(Throttle::Output(Rule { bins: Some(throttle), .. })) = described.throttle else { panic!() };
        // donkeycar's linear_unbin: value = bin * R / (N + offset) + offset.
        for (bin, value) in steering.iter().enumerate() {
            assert!((value - (bin as f64 * (2.0 / 14.0) - 1.0)).abs() < 1e-12);
        }
        for (bin, value) in throttle.iter().enumerate() {
            assert!((value - bin as f64 * (0.8 / 20.0)).abs() < 1e-12);
        }
        assert_eq!((steering.len(), throttle.len()), (15, 20));
    }

    #[test]
    fn units_of_speed_are_converted() {
        let described = read(json!({"inputs": {"v": {"value": "speed", "unit": "km/h", "scale": 0.5, "offset": 1, "assumed": 5}}})).unwrap();
        let Gets::Speed(speed) = described.inputs[0].1 else { panic!() };
        assert_eq!((speed.number(10.0), speed.assumed), (19.0, Some(5.0)));
    }
}
