//! A small steering network as an ONNX file, written field by field: Protocol Buffers need no more than this.

use std::path::Path;

/// A field of bytes: a text, a message or packed numbers.
fn bytes(field: u8, content: &[u8]) -> Vec<u8> {
    let mut encoded = vec![field << 3 | 2];
    encoded.extend(variable(content.len() as u64));
    encoded.extend(content);
    encoded
}

/// A field of one whole number.
fn number(field: u8, value: u64) -> Vec<u8> {
    let mut encoded = vec![field << 3];
    encoded.extend(variable(value));
    encoded
}

fn variable(mut value: u64) -> Vec<u8> {
    let mut encoded = Vec::new();
    while value >= 0x80 {
        encoded.push(value as u8 | 0x80);
        value >>= 7;
    }
    encoded.push(value as u8);
    encoded
}

/// `NodeProto`.
fn node(operator: &str, inputs: [&str; 2], output: &str) -> Vec<u8> {
    let inputs = inputs.iter().filter(|input| !input.is_empty()).flat_map(|input| bytes(1, input.as_bytes()));
    let mut node: Vec<u8> = inputs.collect();
    node.extend(bytes(2, output.as_bytes()));
    node.extend(bytes(4, operator.as_bytes()));
    node
}

/// `ValueInfoProto` of a tensor of 32-bit floating-point numbers.
fn value(name: &str, shape: &[u64]) -> Vec<u8> {
    let shape: Vec<u8> = shape.iter().flat_map(|&length| bytes(1, &number(1, length))).collect();
    let tensor = [number(1, 1), bytes(2, &shape)].concat();
    [bytes(1, name.as_bytes()), bytes(2, &bytes(1, &tensor))].concat()
}

/// Writes a network whose steering is a weighted mean of the input: `channels` planes of `height` x `width` pixels in,
/// steering and throttle out. Three channels make a picture; other numbers make a network that cannot drive.
///
/// # Panics
/// If it cannot be written.
pub fn pilot(path: &Path, channels: u64, height: u64, width: u64) {
    let inputs = channels * height * width;
    write_pilot(path, [channels, height, width], &bytes(9, &pilot_weights(inputs, 7)));
}

/// Writes such a network for pictures, with its weights in a file of this name beside it. Another `mix` makes other weights.
///
/// # Panics
/// If it cannot be written.
pub fn pilot_with_weights_beside(path: &Path, weights: &str, height: u64, width: u64, mix: u64) {
    std::fs::write(path.with_file_name(weights), pilot_weights(3 * height * width, mix)).unwrap();
    let location = [bytes(1, b"location"), bytes(2, weights.as_bytes())].concat();
    write_pilot(path, [3, height, width], &[bytes(13, &location), number(14, 1)].concat());
}

fn pilot_weights(inputs: u64, mix: u64) -> Vec<u8> {
    let weight = |i: u64| ((i * mix % 23) as f32 - 11.0) / (inputs as f32 * 50.0);
    (0..inputs * 2).flat_map(|i| weight(i).to_le_bytes()).collect()
}

/// Writes the network of [`pilot`] with these fields for its weights.
fn write_pilot(path: &Path, [channels, height, width]: [u64; 3], weights: &[u8]) {
    let inputs = channels * height * width;
    let tensor = [&number(1, inputs), &number(1, 2), &number(2, 1), &bytes(8, b"weights"), weights].concat();
    let graph = [
        bytes(1, &node("Flatten", ["image", ""], "flat")),
        bytes(1, &node("MatMul", ["flat", "weights"], "control")),
        bytes(2, b"pilot"),
        bytes(5, &tensor),
        bytes(11, &value("image", &[1, channels, height, width])),
        bytes(12, &value("control", &[1, 2])),
    ]
    .concat();
    let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat();
    std::fs::write(path, model).unwrap();
}

/// Writes a network in which two nodes compute what is called `control`.
///
/// # Panics
/// If it cannot be written.
pub fn ambiguous(path: &Path, height: u64, width: u64) {
    let graph = [
        bytes(1, &node("GlobalAveragePool", ["image", ""], "control")),
        bytes(1, &node("GlobalMaxPool", ["image", ""], "control")),
        bytes(2, b"ambiguous"),
        bytes(11, &value("image", &[1, 3, height, width])),
        bytes(12, &value("control", &[1, 3, 1, 1])),
    ]
    .concat();
    let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat();
    std::fs::write(path, model).unwrap();
}

/// Writes a network with a memory: its steering is the mean of the picture's values times `share`, plus half of its steering on the frame
/// before. Its pictures have three planes of `height` x `width` pixels.
///
/// # Panics
/// If it cannot be written.
pub fn remembering(path: &Path, height: u64, width: u64, share: f32) {
    let inputs = 3 * height * width;
    let tensor = |name: &str, shape: [u64; 2], content: &[f32]| {
        let shape: Vec<u8> = shape.iter().flat_map(|&length| number(1, length)).collect();
        let content: Vec<u8> = content.iter().flat_map(|value| value.to_le_bytes()).collect();
        bytes(5, &[shape, number(2, 1), bytes(8, name.as_bytes()), bytes(9, &content)].concat())
    };
    let weights = vec![share / inputs as f32; inputs as usize];
    let graph = [
        bytes(1, &node("Flatten", ["image", ""], "flat")),
        bytes(1, &node("MatMul", ["flat", "weights"], "seen")),
        bytes(1, &node("Mul", ["state_in", "half"], "kept")),
        bytes(1, &node("Add", ["seen", "kept"], "state_out")),
        bytes(1, &node("Identity", ["state_out", ""], "steering")),
        bytes(2, b"remembering"),
        tensor("weights", [inputs, 1], &weights),
        tensor("half", [1, 1], &[0.5]),
        bytes(11, &value("image", &[1, 3, height, width])),
        bytes(11, &value("state_in", &[1, 1])),
        bytes(12, &value("steering", &[1, 1])),
        bytes(12, &value("state_out", &[1, 1])),
    ]
    .concat();
    let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat();
    std::fs::write(path, model).unwrap();
}

/// Writes a classifier of pictures of `height` x `width` pixels: the output `scores` has the mean of red, green and blue.
///
/// # Panics
/// If it cannot be written.
pub fn colours(path: &Path, height: u64, width: u64) {
    let means = (0..3).map(|channel| (0.0, vec![(channel, 1.0)])).collect();
    of_means(path, height, width, &[("scores", means)]);
}

/// Writes a detector for pictures of `height` x `width` pixels, which finds a box for each channel, by its mean from 0 to 1: in the
/// outputs `boxes` (left, top, width, height), `scores` and `classes` (the last is of class 1, the others of class 0).
///
/// # Panics
/// If it cannot be written.
pub fn boxes(path: &Path, height: u64, width: u64) {
    let bounds = |channel: usize| {
        let size = 16.0 + 20.0 * channel as f32;
        [(0.0, vec![(channel, 20.0)]), (0.0, vec![(channel, 10.0)]), (size, vec![]), (16.0, vec![])]
    };
    let outputs = [
        ("boxes", (0..3).flat_map(bounds).collect()),
        ("scores", (0..3).map(|channel| (0.2, vec![(channel, 0.7)])).collect()),
        ("classes", (0..3).map(|channel| (f32::from(channel == 2), vec![])).collect()),
    ];
    of_means(path, height, width, &outputs);
}

/// A value of an output: a constant, and factors of the means of channels.
type Value = (f32, Vec<(usize, f32)>);

/// Writes a network whose outputs follow from the means of the channels of its picture.
fn of_means(path: &Path, height: u64, width: u64, outputs: &[(&str, Vec<Value>)]) {
    let pixels = (height * width) as usize;
    let tensor = |name: &str, shape: [u64; 2], content: &[f32]| {
        let shape: Vec<u8> = shape.iter().flat_map(|&length| number(1, length)).collect();
        let content: Vec<u8> = content.iter().flat_map(|value| value.to_le_bytes()).collect();
        bytes(5, &[shape, number(2, 1), bytes(8, name.as_bytes()), bytes(9, &content)].concat())
    };
    let mut graph = [
        bytes(1, &node("Flatten", ["image", ""], "flat")),
        bytes(2, b"means"),
        bytes(11, &value("image", &[1, 3, height, width])),
    ]
    .concat();
    for (name, values) in outputs {
        let [weights, seen, constant] = ["weights", "seen", "constant"].map(|what| format!("{name}_{what}"));
        let count = values.len();
        let mut content = vec![0.0; 3 * pixels * count];
        for (place, (_, factors)) in values.iter().enumerate() {
            for (channel, factor) in factors {
                (0..pixels).for_each(|pixel| {
                    content[(channel * pixels + pixel) * count + place] = factor / pixels as f32
                });
            }
        }
        let constants: Vec<f32> = values.iter().map(|(constant, _)| *constant).collect();
        graph.extend(bytes(1, &node("MatMul", ["flat", &weights], &seen)));
        graph.extend(bytes(1, &node("Add", [&seen, &constant], name)));
        graph.extend(tensor(&weights, [3 * pixels as u64, count as u64], &content));
        graph.extend(tensor(&constant, [1, count as u64], &constants));
        graph.extend(bytes(12, &self::value(name, &[1, count as u64])));
    }
    let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat();
    std::fs::write(path, model).unwrap();
}

/// Writes a network that gives a distance for each of `height` x `width` pixels: 1, and 4, 2 and 1 times red, green and blue.
///
/// # Panics
/// If it cannot be written.
pub fn distances(path: &Path, height: u64, width: u64) {
    let tensor = |name: &str, channels: u64, content: &[f32]| {
        let shape: Vec<u8> = [1, channels, 1, 1].iter().flat_map(|&length| number(1, length)).collect();
        let content: Vec<u8> = content.iter().flat_map(|value| value.to_le_bytes()).collect();
        bytes(5, &[shape, number(2, 1), bytes(8, name.as_bytes()), bytes(9, &content)].concat())
    };
    let graph = [
        bytes(1, &node("Conv", ["image", "weights"], "seen")),
        bytes(1, &node("Add", ["seen", "one"], "distance")),
        bytes(2, b"distances"),
        tensor("weights", 3, &[4.0, 2.0, 1.0]),
        tensor("one", 1, &[1.0]),
        bytes(11, &value("image", &[1, 3, height, width])),
        bytes(12, &value("distance", &[1, 1, height, width])),
    ]
    .concat();
    let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat();
    std::fs::write(path, model).unwrap();
}

/// Writes a network that gives the picture that it gets: three planes of `height` x `width` pixels.
///
/// # Panics
/// If it cannot be written.
pub fn mirror(path: &Path, height: u64, width: u64) {
    let shape = [1, 3, height, width];
    let graph = [
        bytes(1, &node("Identity", ["image", ""], "same")),
        bytes(2, b"mirror"),
        bytes(11, &value("image", &shape)),
        bytes(12, &value("same", &shape)),
    ]
    .concat();
    let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, 17))].concat();
    std::fs::write(path, model).unwrap();
}

/// A small network with a convolution, and what is unusual about it.
#[derive(Debug, Clone, Copy)]
pub struct Convolution<'a> {
    /// The version of the operator set.
    pub opset: u64,
    /// Batch, channels, height and width of the image: numbers, or names of what is left open.
    pub image: [&'a str; 4],
    /// The type of the image: 1 for 32-bit floats, 10 for 16-bit ones.
    pub element: u64,
    /// Whether two rows are cut off above by a negative Pad.
    pub cut: bool,
    /// Whether nothing has an influence on the output.
    pub indifferent: bool,
}

impl Default for Convolution<'_> {
    fn default() -> Self {
        Self { opset: 17, image: ["1", "3", "16", "32"], element: 1, cut: false, indifferent: false }
    }
}

impl Convolution<'_> {
    /// Writes the network: a convolution of 3 x 3 over an image of 16 x 32 pixels, Relu, steering and throttle.
    ///
    /// # Panics
    /// If it cannot be written.
    pub fn write(&self, path: &Path) {
        let floats = |name: &str, shape: &[u64], factor: f32| {
            let count = shape.iter().product::<u64>();
            let content: Vec<u8> =
                (0..count).flat_map(|i| (((i * 7 % 23) as f32 - 11.0) * factor).to_le_bytes()).collect();
            let shape: Vec<u8> = shape.iter().flat_map(|&length| number(1, length)).collect();
            bytes(5, &[shape, number(2, 1), bytes(8, name.as_bytes()), bytes(9, &content)].concat())
        };
        let pads: Vec<u8> = [0, 0, -2, 0, 0, 0, 0, 0].into_iter().flat_map(i64::to_le_bytes).collect();
        let pads = bytes(5, &[number(1, 8), number(2, 7), bytes(8, b"pads"), bytes(9, &pads)].concat());
        let rows = if self.cut { 12 } else { 14 };
        let (from, cut) = match self.cut {
            true => ("cut", bytes(1, &node("Pad", ["image", "pads"], "cut"))),
            false => ("image", Vec::new()),
        };
        let influence = if self.indifferent { 0.0 } else { 0.0001 };
        let shape: Vec<u8> = self
            .image
            .iter()
            .flat_map(|side| match side.parse() {
                Ok(length) => bytes(1, &number(1, length)),
                Err(_) => bytes(1, &bytes(2, side.as_bytes())),
            })
            .collect();
        let tensor = [number(1, self.element), bytes(2, &shape)].concat();
        let graph = [
            cut,
            bytes(1, &node("Conv", [from, "kernel"], "convolved")),
            bytes(1, &node("Relu", ["convolved", ""], "lit")),
            bytes(1, &node("Flatten", ["lit", ""], "flat")),
            bytes(1, &node("MatMul", ["flat", "weights"], "control")),
            bytes(2, b"convolution"),
            floats("kernel", &[4, 3, 3, 3], 0.01),
            floats("weights", &[4 * rows * 30, 2], influence),
            if self.cut { pads } else { Vec::new() },
            bytes(11, &[bytes(1, b"image"), bytes(2, &bytes(1, &tensor))].concat()),
            bytes(12, &value("control", &[1, 2])),
        ]
        .concat();
        let model = [number(1, 8), bytes(7, &graph), bytes(8, &number(2, self.opset))].concat();
        std::fs::write(path, model).unwrap();
    }
}
