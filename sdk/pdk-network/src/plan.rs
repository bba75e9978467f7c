//! What each input of a network gets: what the description says, else what names and shapes tell, each with its reason.

use pdk_sdk::error::{Error, Result};

use crate::color::Color;
use crate::declared::{Declared, Element, Port};
use crate::described::Described;
use crate::gets::{Gets, Speed};
use crate::image::{Image, color, find_image, scale};
use crate::numbers::Scale;
use crate::reading::refuse_unknown;
use crate::reason::{Reason, assumptions, because, given};
use crate::waypoints;

/// The name of an input for the speed.
const SPEED: &str = "speed";

/// The ends of the names of a state's input and output, which are the same before that.
const STATE: [&str; 2] = ["_in", "_out"];

/// The most numbers of an input besides the image: 64 MiB.
const LARGEST: usize = 1 << 24;

/// Fields that decide what a frame goes through on its way to the image, and that have no guess: they are in force as they were given.
const ON_THE_WAY: [&str; 9] =
    ["frame", "crop", "region", "resize", "mean", "std", "dtype", "start", "differences"];

/// How to describe what cannot be guessed.
const REMEDY: &str = "`pdk new network MODEL.onnx` writes a description to complete";

/// What an input gets.
#[derive(Debug, Clone, PartialEq)]
pub enum Fill {
    /// The image.
    Image,
    /// The speed.
    Speed(Speed),
    /// Controls of the frames before.
    Controls,
    /// The same numbers with every frame.
    Constant(Vec<f32>),
    /// What an output was at the frame before, by its place.
    State(usize),
}

/// An input.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Its name.
    pub name: String,
    /// The shape of its tensor.
    pub shape: Vec<usize>,
    /// The type of its numbers.
    pub element: Element,
    /// What it gets.
    pub fill: Fill,
}

/// What goes into a network.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    /// What was described.
    pub described: Described,
    /// The inputs, in the order of the file.
    pub inputs: Vec<Input>,
    /// The image among them.
    pub image: Image,
    /// What its channels are.
    pub color: Color,
    /// How bytes become numbers.
    pub scale: Scale,
    /// The names of the outputs.
    pub outputs: Vec<String>,
    /// What is known, and why.
    pub reasons: Vec<Reason>,
}

impl Plan {
    /// Joins what a file declares and what was described.
    ///
    /// # Errors
    /// If they contradict each other, or something is missing that cannot be guessed.
    pub fn new(declared: &Declared, described: Described) -> Result<Self> {
        let mut reasons = Vec::new();
        let fills = fills(declared, &described, &mut reasons)?;
        let mut inputs = Vec::new();
        let mut image = None;
        for (place, (port, fill)) in declared.inputs.iter().zip(fills).enumerate() {
            let shape = match &fill {
                Fill::Image => {
                    let found = find_image(port, place, &described, &mut reasons)?;
                    image.insert(found).shape.clone()
                }
                fill => other_shape(port, fill, &described)?,
            };
            inputs.push(Input { name: port.name.clone(), shape, element: port.element, fill });
        }
        let image = image.ok_or_else(|| Error::new("it has no image among its inputs"))?;
        let color = color(&image, &described, &mut reasons)?;
        let scale = scale(&image, &described, &mut reasons)?;
        for field in ON_THE_WAY {
            if let Some((value, place)) = described.given.get(field) {
                let value = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                because(&mut reasons, field, value, format!("{place} says so"), false);
            }
        }
        for (name, list) in [("mean", &described.mean), ("std", &described.std)] {
            if list.len() != 1 && list.len() != image.channels {
                return Err(described.given.wrong(
                    name,
                    format_args!(
                        "has {} numbers, but a frame has {} channels; write one number, or one for each channel",
                        list.len(),
                        image.channels
                    ),
                ));
            }
        }
        if let Some((value, place)) = waypoints::in_force(&described.given)? {
            because(
                &mut reasons,
                "waypoints",
                value,
                format!("{place} says so, with defaults for what it leaves out"),
                false,
            );
        }
        let outputs = declared.outputs.iter().map(|port| port.name.clone()).collect();
        Ok(Self { described, inputs, image, color, scale, outputs, reasons })
    }

    /// The conventions that nothing confirms, in a sentence; none if there are none.
    pub fn assumptions(&self) -> Option<String> {
        assumptions(&self.reasons)
    }

    /// The outputs that are an input of the next frame, by their places.
    pub fn states(&self) -> impl Iterator<Item = usize> {
        self.inputs.iter().filter_map(|input| match input.fill {
            Fill::State(output) => Some(output),
            _ => None,
        })
    }
}

/// What each input gets.
fn fills(declared: &Declared, described: &Described, reasons: &mut Vec<Reason>) -> Result<Vec<Fill>> {
    let inputs = || declared.inputs.iter().map(|port| port.name.as_str());
    let outputs = || declared.outputs.iter().map(|port| port.name.as_str());
    for (name, _) in &described.inputs {
        refuse_unknown(&described.given, "inputs", name, "input", inputs().collect::<Vec<_>>())?;
    }
    for (input, output) in &described.state {
        refuse_unknown(&described.given, "state", input, "input", inputs().collect::<Vec<_>>())?;
        refuse_unknown(&described.given, "state", output, "output", outputs().collect::<Vec<_>>())?;
        if described.inputs.iter().any(|(name, _)| name == input) {
            return Err(described.given.wrong(
                "state",
                format_args!("has the input `{input}`, which `inputs` has too; leave one out"),
            ));
        }
    }
    let place_of = |name: &str| outputs().position(|output| output == name);
    let mut fills: Vec<Option<Fill>> = Vec::new();
    for port in &declared.inputs {
        let name = &port.name;
        let subject = format!("input {name}");
        let of_inputs = described.inputs.iter().find(|(known, _)| known == name).map(|(_, gets)| gets);
        let of_state =
            described.state.iter().find(|(known, _)| known == name).and_then(|(_, output)| place_of(output));
        let by_name = name.strip_suffix(STATE[0]).and_then(|name| place_of(&format!("{name}{}", STATE[1])));
        fills.push(if let Some(gets) = of_inputs {
            let (fill, value) = match gets {
                Gets::Image => (Fill::Image, "the image"),
                Gets::Speed(speed) => (Fill::Speed(described.or_assumed(*speed)), "the speed"),
                Gets::Controls => (Fill::Controls, "the controls before"),
                Gets::Constant(list) => (Fill::Constant(list.clone()), "constants"),
            };
            because(reasons, &subject, value, given(described, "inputs").unwrap_or_default(), false);
            Some(fill)
        } else if let Some(output) = of_state {
            let value = format!("what `{}` was at the frame before", declared.outputs[output].name);
            because(reasons, &subject, value, given(described, "state").unwrap_or_default(), false);
            Some(Fill::State(output))
        } else if let Some(output) = by_name {
            let value = format!("what `{}` was at the frame before", declared.outputs[output].name);
            because(reasons, &subject, value, "the names of the two say so", false);
            Some(Fill::State(output))
        } else if name == waypoints::SPEED {
            because(reasons, &subject, "the speed in m/s", "the controller of its waypoints takes it", false);
            Some(Fill::Speed(described.or_assumed(Speed::PLAIN)))
        } else if name == SPEED && declared.inputs.len() > 1 {
            because(reasons, &subject, "the speed in m/s", "it is called so; nothing says the unit", true);
            Some(Fill::Speed(described.or_assumed(Speed::PLAIN)))
        } else {
            None
        });
    }
    let open: Vec<usize> = (0..fills.len()).filter(|&place| fills[place].is_none()).collect();
    if fills.iter().flatten().any(|fill| *fill == Fill::Image)
        && let Some(&place) = open.first()
    {
        return Err(unknown(declared, place));
    }
    let images: Vec<usize> = match open.as_slice() {
        [one] => vec![*one],
        all => all.iter().copied().filter(|&place| declared.inputs[place].dims().len() >= 4).collect(),
    };
    for place in open {
        if images != [place] {
            return Err(unknown(declared, place));
        }
        because(
            reasons,
            &format!("input {}", declared.inputs[place].name),
            "the image",
            "of its shape",
            false,
        );
        fills[place] = Some(Fill::Image);
    }
    Ok(fills.into_iter().flatten().collect())
}

/// The error about an input that gets nothing.
fn unknown(declared: &Declared, place: usize) -> Error {
    let names: Vec<_> =
        declared.inputs.iter().map(|port| format!("`{}` {}", port.name, port.shape_text())).collect();
    let name = &declared.inputs[place].name;
    Error::new(format!(
        "its inputs are {}, and nothing says what `{name}` gets; describe it, as in inputs = {{ {name} = \"speed\" }}, with \"image\", \
         \"controls\" or numbers, or in `state`: {REMEDY}",
        names.join(", ")
    ))
}

/// The shape of an input that is not the image.
fn other_shape(port: &Port, fill: &Fill, described: &Described) -> Result<Vec<usize>> {
    let Port { name, element, .. } = port;
    if !matches!(element, Element::Float32 | Element::Float16) {
        return Err(Error::new(format!(
            "its input `{name}` is {}, but pdk gives float32 or float16 to inputs besides the image; export it with one of these",
            element.name()
        )));
    }
    let field = if matches!(fill, Fill::State(_)) { "state" } else { "inputs" };
    let wrong = |what: String| {
        let place =
            described.given.get(field).map_or(String::new(), |(_, place)| format!("{place}: `{field}`: "));
        Err(Error::new(format!("{place}its input `{name}` has the shape {}, {what}", port.shape_text())))
    };
    let Some(shape) = port.batch_of_one().filter(|shape| {
        shape.iter().try_fold(1usize, |p, d| p.checked_mul(*d)).is_some_and(|all| all <= LARGEST)
    }) else {
        return wrong(format!(
            "but has to have a fixed one of at most {LARGEST} values; export the model with it"
        ));
    };
    let values: usize = shape.iter().product();
    match fill {
        Fill::Speed(_) if values != 1 => {
            wrong("but the speed is one number; give it something else".to_owned())
        }
        Fill::Controls if !values.is_multiple_of(2) || values == 0 => {
            wrong("but controls are two numbers for each frame; give it something else".to_owned())
        }
        Fill::Constant(list) if list.len() != 1 && list.len() != values => {
            wrong(format!("but is given {} numbers; give it {values}, or one for all", list.len()))
        }
        _ => Ok(shape),
    }
}

#[cfg(test)]
#[path = "plan_tests.rs"]
mod tests;
