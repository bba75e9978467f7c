//! A controller for networks that plan waypoints instead of steering: pure pursuit of the plan (Coulter, "Implementation of the Pure Pursuit
//! Path Tracking Algorithm", 1992), and a throttle in proportion to the planned speed less the vehicle's.
//!
//! The controller becomes part of the graph, so that whatever runs, explains or differentiates a network that steers does so with one that plans.

use pdk_onnx::Graph;
use pdk_onnx::proto::{
    AttributeProto, GraphProto, ModelProto, NodeProto, TensorProto, ValueInfoProto, attribute_type,
};
use pdk_onnx::tensor::shape_text;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::serde_json::{Map, Value, json};

use crate::declared::{Declared, Element, Port};
use crate::field::{WAYPOINTS as FIELD, WAYPOINTS_EXAMPLE as EXAMPLE};
use crate::given::Given;
use crate::reading::{known, refuse_unknown, whole};
use crate::suggest::hint;

/// What the controller's outputs are called, and its input.
const STEERING: &str = "waypoints/steering";
const THROTTLE: &str = "waypoints/throttle";
pub(crate) const SPEED: &str = "waypoints/speed";

/// The names of axes: what the first two numbers of a waypoint are, each with its share of the distance to the right and ahead.
const AXES: [(&str, [[f64; 2]; 2]); 4] = [
    ("forward_left", [[0.0, 1.0], [-1.0, 0.0]]),
    ("forward_right", [[0.0, 1.0], [1.0, 0.0]]),
    ("left_forward", [[-1.0, 0.0], [0.0, 1.0]]),
    ("right_forward", [[1.0, 0.0], [0.0, 1.0]]),
];

/// Metres below which a step counts as this long, so that its length has a gradient.
const LEAST_STEP: f64 = 1e-3;
/// Steps are taken to be backwards below this many metres ahead, and in full above it.
const AHEAD: f64 = 1e-6;

/// A description of waypoints.
struct Waypoints {
    output: Option<String>,
    axes: [[f64; 2]; 2],
    /// How many numbers each has.
    numbers: usize,
    /// Metres for each of them.
    scale: f64,
    /// Seconds from one to the next, and from now to the first.
    interval: f64,
    /// Metres from the rear axle ahead to where they are counted from.
    origin: f64,
    /// Metres.
    wheelbase: f64,
    /// Radians.
    full_lock: f64,
    /// Seconds to the point that is steered for.
    aim: f64,
    /// Metres to that point below which steering fades.
    nearest: f64,
    /// Throttle for each m/s that the vehicle is too slow.
    gain: f64,
}

/// The keys that are numbers: the least and the greatest of each, and what it is.
const NUMBERS: [(&str, f64, f64, &str); 9] = [
    ("scale", 1e-6, 1e6, "the metres for each unit"),
    ("interval", 1e-3, 60.0, "the seconds from one waypoint to the next"),
    ("origin", -100.0, 100.0, "the metres from the rear axle ahead to where waypoints are counted from"),
    ("wheelbase", 0.01, 100.0, "the metres between the axles"),
    ("full_lock", 1.0, 89.0, "the degrees of the front wheels that steering 1 stands for"),
    ("aim", 1e-3, 60.0, "the seconds to the point that is steered for"),
    ("nearest", 0.01, 1000.0, "the metres to the point that is steered for below which steering fades"),
    ("gain", 0.0, 1000.0, "the throttle for each m/s that the vehicle is too slow"),
    ("assumed", 0.0, 100.0, "the m/s that stand for a speed that is not known"),
];

impl Waypoints {
    fn read(given: &Given, table: &Map<String, Value>) -> Result<Self> {
        let keys = ["output", "axes", "numbers"].into_iter().chain(NUMBERS.iter().map(|(key, ..)| *key));
        known(given, FIELD, table, &keys.collect::<Vec<_>>())?;
        let wrong = |key: &str, value: &Value, what: &str| {
            given.wrong(FIELD, format_args!("has {value} as `{key}`; {what}"))
        };
        let lacks = |key: &str, what: &str| {
            given.wrong(FIELD, format_args!("needs `{key}`, {what}; write {EXAMPLE}"))
        };
        let number = |key: &str| -> Result<Option<f64>> {
            let Some(value) = table.get(key) else { return Ok(None) };
            let (_, least, greatest, what) =
                NUMBERS.iter().find(|(name, ..)| *name == key).copied().unwrap_or((key, 0.0, 0.0, ""));
            match value.as_f64().filter(|number| (least..=greatest).contains(number)) {
                Some(number) => Ok(Some(number)),
                None => Err(wrong(key, value, &format!("it is {what}, from {least} to {greatest}"))),
            }
        };
        let needed = |key: &str| {
            let what = NUMBERS.iter().find(|(name, ..)| *name == key).map_or("", |(.., what)| what);
            number(key)?.ok_or_else(|| lacks(key, what))
        };
        let output = match table.get("output") {
            None => None,
            Some(Value::String(output)) => Some(output.clone()),
            Some(value) => return Err(wrong("output", value, "write the name of an output")),
        };
        let axes = table.get("axes").ok_or_else(|| lacks("axes", "what the numbers of a waypoint are"))?;
        let names = AXES.map(|(name, _)| name);
        let (_, axes) = AXES
            .iter()
            .find(|(name, _)| axes.as_str() == Some(name))
            .ok_or_else(|| wrong("axes", axes, &hint(axes.as_str().unwrap_or_default(), names)))?;
        let numbers = match table.get("numbers") {
            None => 2,
            Some(value) => whole(value).filter(|count| (2..=1000).contains(count)).ok_or_else(|| {
                wrong("numbers", value, "write how many numbers each waypoint has, at least 2")
            })?,
        };
        number("assumed")?;
        let (interval, wheelbase) = (needed("interval")?, needed("wheelbase")?);
        Ok(Self {
            output,
            axes: *axes,
            numbers,
            scale: number("scale")?.unwrap_or(1.0),
            interval,
            origin: number("origin")?.unwrap_or(0.0),
            wheelbase,
            full_lock: needed("full_lock")?.to_radians(),
            aim: number("aim")?.unwrap_or(interval.max(0.8)),
            nearest: number("nearest")?.unwrap_or(wheelbase / 2.0),
            gain: number("gain")?.unwrap_or(0.5),
        })
    }

    /// The output with the waypoints.
    fn port<'a>(&self, given: &Given, declared: &'a Declared) -> Result<&'a Port> {
        let names = declared.outputs.iter().map(|port| port.name.as_str());
        let name = match (&self.output, declared.outputs.as_slice()) {
            (Some(name), _) => name,
            (None, [one]) => &one.name,
            (None, _) => {
                return Err(given.wrong(FIELD, "needs `output`, because the network has several outputs"));
            }
        };
        refuse_unknown(given, FIELD, name, "output", names.collect::<Vec<_>>())?;
        let port = declared.outputs.iter().find(|port| port.name == *name);
        port.ok_or_else(|| Error::new("it has no outputs"))
    }

    /// How many waypoints an output of this shape has.
    fn count(&self, given: &Given, name: &str, shape: &[usize]) -> Result<usize> {
        let all: usize = shape.iter().product();
        // The numbers of a plan come in one row, or on the last axis.
        let rows = match shape {
            [] | [_] | [1, _] => true,
            [.., last] => *last == self.numbers,
        };
        if all == 0 || !all.is_multiple_of(self.numbers) || !rows {
            return Err(given.wrong(
                FIELD,
                format_args!(
                    "takes the output `{name}` of shape {}, which is not {} numbers for each waypoint; set `numbers`, or have the network give one waypoint \
                     after the other",
                    shape_text(shape),
                    self.numbers
                ),
            ));
        }
        // One axis for the waypoints and one for their numbers: what is before those is other plans.
        let plans: usize = shape[..shape.len().saturating_sub(2)].iter().product();
        if plans > 1 {
            return Err(given.wrong(
                FIELD,
                format_args!(
                    "takes the output `{name}` of shape {}, which holds {plans} plans; have the network choose one",
                    shape_text(shape)
                ),
            ));
        }
        Ok(all / self.numbers)
    }

    /// Sums of an output's numbers, two of them: the point that is steered for, to the right and ahead; and the metres to the right and ahead from the
    /// waypoint before that point to the one after it.
    fn sums(&self, given: &Given, name: &str, waypoints: usize) -> Result<[Vec<f32>; 2]> {
        // Seconds are written in decimals, whose quotients are whole only nearly.
        let rounded = |number: f64| (number * 1e9).round() / 1e9;
        let (count, place) = (waypoints * self.numbers, rounded(self.aim / self.interval));
        if place > waypoints as f64 {
            return Err(given.wrong(
                FIELD,
                format_args!(
                    "steers for the point in {} s, but the {waypoints} waypoints of the output `{name}` end after {} s; set a smaller `aim`",
                    self.aim,
                    rounded(waypoints as f64 * self.interval)
                ),
            ));
        }
        let after = (place.ceil() as usize).clamp(1, waypoints) - 1;
        let share = place - after as f64;
        let mut sums = [vec![0.0; 2 * count], vec![0.0; 2 * count]];
        // The first waypoint comes after the origin itself.
        for (waypoint, of_point, of_step) in
            [(Some(after), share, 1.0), (after.checked_sub(1), 1.0 - share, -1.0)]
        {
            let Some(waypoint) = waypoint else { continue };
            for (number, axes) in self.axes.iter().enumerate() {
                for (axis, metres) in axes.iter().enumerate() {
                    let at = 2 * (waypoint * self.numbers + number) + axis;
                    sums[0][at] = (of_point * metres * self.scale) as f32;
                    sums[1][at] = (of_step * metres * self.scale) as f32;
                }
            }
        }
        Ok(sums)
    }
}

/// Whether a description has waypoints.
pub fn describes(given: &Given) -> bool {
    given.get(FIELD).is_some()
}

/// The speed in metres per second that stands for one that is not known; none without waypoints.
pub(crate) fn assumed(given: &Given) -> Option<f64> {
    given.get(FIELD).and_then(|(value, _)| value.get("assumed")).and_then(Value::as_f64)
}

/// What is in force, for people.
///
/// # Errors
/// If the description cannot be.
pub(crate) fn in_force(given: &Given) -> Result<Option<(String, &str)>> {
    let Some((Value::Object(table), place)) = given.get(FIELD) else { return Ok(None) };
    let Waypoints { numbers, scale, interval, origin, aim, nearest, gain, .. } =
        Waypoints::read(given, table)?;
    let axes = table.get("axes").and_then(Value::as_str).unwrap_or_default();
    let text = format!(
        "{numbers} numbers each, {axes}, {scale} m a unit, {interval} s apart, counted from {origin} m ahead of the rear axle; steers for the point in {aim} s, \
         fading below {nearest} m; throttle {gain} for each m/s"
    );
    Ok(Some((text, place)))
}

/// Adds a controller to a model if its waypoints are described, and describes the controller's outputs.
///
/// # Errors
/// If the description cannot be, or does not fit the model.
pub fn follow(model: &mut ModelProto, given: &mut Given) -> Result<()> {
    let Some((value, place)) = given.get(FIELD) else { return Ok(()) };
    let Value::Object(table) = value.clone() else {
        return Err(given.wrong(FIELD, format_args!("is {value}; write {EXAMPLE}")));
    };
    let place = place.to_owned();
    if given.get("steering").is_some() {
        return Err(given.wrong(FIELD, "gives the steering, and so does `steering`; leave one of them out"));
    }
    let waypoints = Waypoints::read(given, &table)?;
    let declared = Declared::of_model(model);
    let port = waypoints.port(given, &declared)?;
    let shape = match port.batch_of_one().filter(|shape| !shape.is_empty()) {
        Some(shape) => shape,
        // What the file leaves open often follows from its nodes.
        None => Graph::new(model.clone())?.fact(&port.name)?.shape.clone(),
    };
    let sums = waypoints.sums(given, &port.name, waypoints.count(given, &port.name, &shape)?)?;
    let graph = model.graph.get_or_insert_default();
    let mut controller = Controller { graph };
    let numbers = controller.flat(port);
    let [target, step] = sums.map(|sum| controller.sum(&numbers, sum));
    let steering = controller.pursue(&waypoints, &target);
    controller.output(&steering, STEERING);
    given.set("steering", json!({"output": STEERING}), &place);
    if given.get("throttle").is_none() {
        controller.graph.input.push(ValueInfoProto::tensor(SPEED, FLOAT, &[1, 1]));
        let throttle = controller.keep_up(&waypoints, &step);
        controller.output(&throttle, THROTTLE);
        given.set("throttle", json!({"output": THROTTLE}), &place);
    }
    Ok(())
}

/// ONNX's numbers of types.
const FLOAT: i32 = 1;
const INT64: i32 = 7;

/// A graph to which a controller is added. All its values are tables of one row.
struct Controller<'a> {
    graph: &'a mut GraphProto,
}

impl Controller<'_> {
    /// Adds a node, and gives the name of its output.
    fn node(&mut self, operator: &str, inputs: &[&str], attribute: Vec<AttributeProto>) -> String {
        let name = format!("waypoints/{}/{operator}", self.graph.node.len());
        self.graph.node.push(NodeProto {
            op_type: operator.to_owned(),
            name: name.clone(),
            input: inputs.iter().map(|&input| input.to_owned()).collect(),
            output: vec![name.clone()],
            attribute,
            ..Default::default()
        });
        name
    }

    /// Adds constants.
    fn constants(&mut self, shape: &[usize], data_type: i32, raw_data: Vec<u8>) -> String {
        let name = format!("waypoints/{}/constant", self.graph.initializer.len());
        let dims = shape.iter().map(|&length| length as i64).collect();
        self.graph.initializer.push(TensorProto {
            name: name.clone(),
            dims,
            data_type,
            raw_data,
            ..Default::default()
        });
        name
    }

    fn numbers(&mut self, rows: usize, values: &[f32]) -> String {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.constants(&[rows, values.len() / rows], FLOAT, bytes)
    }

    /// `operator(a, number)`.
    fn with(&mut self, operator: &str, a: &str, number: f64) -> String {
        let number = self.numbers(1, &[number as f32]);
        self.node(operator, &[a, &number], Vec::new())
    }

    /// An output's numbers in a row.
    fn flat(&mut self, port: &Port) -> String {
        let shape = self.constants(&[2], INT64, [1i64, -1].iter().flat_map(|n| n.to_le_bytes()).collect());
        let flat = self.node("Reshape", &[&port.name, &shape], Vec::new());
        if port.element == Element::Float32 {
            return flat;
        }
        let to = AttributeProto {
            name: "to".to_owned(),
            i: Some(FLOAT.into()),
            r#type: attribute_type::INT,
            ..Default::default()
        };
        self.node("Cast", &[&flat], vec![to])
    }

    /// Two sums of a row's numbers, by the weights of each.
    fn sum(&mut self, row: &str, weights: Vec<f32>) -> String {
        let weights = self.numbers(weights.len() / 2, &weights);
        self.node("MatMul", &[row, &weights], Vec::new())
    }

    /// The square of the length of a vector in a row.
    fn square(&mut self, vector: &str) -> String {
        let squares = self.node("Mul", &[vector, vector], Vec::new());
        let ones = self.numbers(2, &[1.0, 1.0]);
        self.node("MatMul", &[&squares, &ones], Vec::new())
    }

    /// The steering towards a point to the right and ahead of where waypoints are counted from.
    fn pursue(&mut self, waypoints: &Waypoints, target: &str) -> String {
        let origin = self.numbers(1, &[0.0, waypoints.origin as f32]);
        let target = self.node("Add", &[target, &origin], Vec::new());
        let square = self.square(&target);
        let square = self.with("Max", &square, waypoints.nearest * waypoints.nearest);
        let first = self.numbers(2, &[1.0, 0.0]);
        let right = self.node("MatMul", &[&target, &first], Vec::new());
        let right = self.with("Mul", &right, 2.0 * waypoints.wheelbase);
        let tangent = self.node("Div", &[&right, &square], Vec::new());
        let angle = self.node("Atan", &[&tangent], Vec::new());
        self.with("Div", &angle, waypoints.full_lock)
    }

    /// The throttle for a planned step of one interval. A step backwards is to stand still.
    fn keep_up(&mut self, waypoints: &Waypoints, step: &str) -> String {
        let square = self.square(step);
        let square = self.with("Max", &square, LEAST_STEP * LEAST_STEP);
        let length = self.node("Sqrt", &[&square], Vec::new());
        let second = self.numbers(2, &[0.0, 1.0]);
        let ahead = self.node("MatMul", &[step, &second], Vec::new());
        let ahead = self.with("Div", &ahead, AHEAD);
        let ahead = self.node("Relu", &[&ahead], Vec::new());
        let ahead = self.with("Min", &ahead, 1.0);
        let distance = self.node("Mul", &[&length, &ahead], Vec::new());
        let planned = self.with("Div", &distance, waypoints.interval);
        let lacking = self.node("Sub", &[&planned, SPEED], Vec::new());
        self.with("Mul", &lacking, waypoints.gain)
    }

    /// Gives a value a name as an output.
    fn output(&mut self, value: &str, name: &str) {
        if let Some(node) = self.graph.node.iter_mut().find(|node| node.name == value) {
            node.output = vec![name.to_owned()];
        }
        self.graph.output.push(ValueInfoProto::tensor(name, FLOAT, &[1, 1]));
    }
}

#[cfg(test)]
#[path = "waypoints_tests.rs"]
mod tests;
