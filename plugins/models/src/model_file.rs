//! What an ONNX file declares: its inputs, an image and maybe the speed and a memory, and its outputs.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use pdk_sdk::file;
use pdk_sdk::prelude::*;
use tract_onnx::pb;
use tract_onnx::pb::tensor_proto::DataType;
use tract_onnx::pb::tensor_shape_proto::dimension;
use tract_onnx::prelude::Framework;

use crate::selection::{Selection, Slot};
use crate::session::{Graph, Network, Session};

/// In which order the input holds its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Layout {
    /// One plane after the other: (batch, channels, height, width).
    Nchw,
    /// Pixel by pixel: (batch, height, width, channels).
    Nhwc,
}

/// The image input of a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageInput {
    /// The order of its numbers.
    pub layout: Layout,
    /// 1 (grey) or 3.
    pub channels: usize,
    /// Height in pixels.
    pub height: usize,
    /// Width in pixels.
    pub width: usize,
}

impl ImageInput {
    /// The shape for one image.
    pub fn shape(&self) -> [usize; 4] {
        match self.layout {
            Layout::Nchw => [1, self.channels, self.height, self.width],
            Layout::Nhwc => [1, self.height, self.width, self.channels],
        }
    }

    /// The number of values of one image.
    pub fn len(&self) -> usize {
        self.channels * self.height * self.width
    }
}

/// The size of an image in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

/// A value that the network gives to itself: what it puts into an output is what an input gets with the next frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// The place among the inputs.
    pub input: usize,
    /// The place among the outputs.
    pub output: usize,
}

/// The name of the input for the speed.
const SPEED: &str = "speed";

/// The ends of the names of a memory's input and output, which are the same before that.
const MEMORY: [&str; 2] = ["_in", "_out"];

/// Bytes of a model: a message in protocol buffers has no more.
const LARGEST: u64 = 2 << 30;

/// Where a model comes from.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Source {
    /// A file.
    File(PathBuf),
    /// The content of a file that is part of this plugin, or what was made of it.
    BuiltIn(Cow<'static, [u8]>),
}

impl Source {
    /// The content.
    ///
    /// # Errors
    /// If the file cannot be read, or is too large.
    pub fn content(&self) -> Result<Cow<'_, [u8]>> {
        match self {
            Self::File(path) if !path.exists() => {
                Err(Error::new("there is no such file; give the path of an ONNX file"))
            }
            Self::File(path) => Ok(Cow::Owned(file::read(path, LARGEST)?)),
            Self::BuiltIn(bytes) => Ok(Cow::Borrowed(bytes)),
        }
    }
}

/// An ONNX file that takes an image, and maybe the speed and what it remembers.
pub struct ModelFile {
    /// Where it comes from.
    pub source: Source,
    /// What it contains.
    pub proto: pb::ModelProto,
    /// Its image input.
    pub input: ImageInput,
    /// The place of the image among the inputs.
    pub image: usize,
    /// The place of the speed among the inputs, where it takes one.
    pub speed: Option<usize>,
    /// What it remembers.
    pub memories: Vec<Memory>,
    /// The shape of each input, in their order.
    pub shapes: Vec<Vec<usize>>,
    /// The names of its outputs.
    pub outputs: Vec<String>,
}

impl ModelFile {
    /// The network for an engine, for one image at a time.
    pub fn network(&self) -> Network<'_> {
        let graph = match &self.source {
            Source::File(path) => Graph::File { path, proto: &self.proto },
            Source::BuiltIn(bytes) => Graph::Memory(bytes),
        };
        Network { graph, inputs: self.shapes.clone() }
    }

    /// The values of its inputs before the first frame: zeros.
    pub fn inputs(&self) -> Inputs {
        let values = self.shapes.iter().map(|shape| vec![0.0; shape.iter().product()]).collect();
        Inputs { values, image: self.image, speed: self.speed, memories: self.memories.clone() }
    }

    /// Runs it on a black image at a speed, and gives the number of values of each output, which files need not declare.
    ///
    /// # Errors
    /// If the engine cannot run it, or what it remembers does not fit its input.
    pub fn try_out(&self, session: &mut dyn Session, speed: f32) -> Result<Vec<usize>> {
        let mut outputs = vec![Vec::new(); self.outputs.len()];
        let mut inputs = self.inputs();
        inputs.move_at(speed);
        session.run(inputs.values(), &mut outputs)?;
        for memory in &self.memories {
            let (takes, gives) = (inputs.values[memory.input].len(), outputs[memory.output].len());
            if takes != gives {
                return Err(Error::new(format!(
                    "its output `{}` has {gives} values, but the input that gets them with the next frame has {takes}",
                    self.outputs[memory.output]
                )));
            }
        }
        Ok(outputs.iter().map(Vec::len).collect())
    }

    /// Chooses the outputs that steer among those that are not remembered, by the number of values of each output. See
    /// [`Selection::new`].
    ///
    /// # Errors
    /// As for [`Selection::new`].
    pub fn selection(&self, sizes: &[usize], steering: &str, throttle: &str) -> Result<Selection> {
        let remembered = |output: usize| self.memories.iter().any(|memory| memory.output == output);
        let places: Vec<usize> = (0..self.outputs.len()).filter(|&output| !remembered(output)).collect();
        let names: Vec<String> = places.iter().map(|&place| self.outputs[place].clone()).collect();
        let sizes: Vec<usize> = places.iter().map(|&place| sizes[place]).collect();
        let chosen = Selection::new(&names, &sizes, steering, throttle)?;
        let in_file = |slot: Slot| Slot { output: places[slot.output], ..slot };
        Ok(Selection { steering: in_file(chosen.steering), throttle: chosen.throttle.map(in_file) })
    }

    /// Reads a model. `layout` is `nchw`, `nhwc` or `auto`.
    ///
    /// # Errors
    /// If the file cannot be read, is not an ONNX model, or takes anything but one float image of a fixed size, maybe
    /// `speed`, one float, and maybe memories: floats called `NAME_in` that come from the output `NAME_out`.
    pub fn read(source: Source, layout: &str) -> Result<Self> {
        Self::read_at(source, layout, None)
    }

    /// Reads a model whose image has the given size where the file leaves it open.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub fn read_at(source: Source, layout: &str, open: Option<Size>) -> Result<Self> {
        let proto = tract_onnx::onnx()
            .proto_model_for_read(&mut &*source.content()?)
            .map_err(|_| Error::new("the file is not an ONNX model, or is damaged"))?;
        let graph = proto
            .graph
            .as_ref()
            .filter(|graph| !graph.node.is_empty())
            .ok_or_else(|| Error::new("the file is not an ONNX model: it contains no graph"))?;
        pdk_onnx::model::check_names(
            graph.initializer.iter().map(|tensor| tensor.name.as_str()),
            graph.input.iter().map(|input| input.name.as_str()),
            graph.node.iter().flat_map(|node| &node.output).map(String::as_str),
        )?;
        if let Source::File(path) = &source {
            check_external(graph, path.parent().unwrap_or(Path::new("")))?;
        }
        // Old files list their weights among the inputs.
        let is_weight = |name: &str| graph.initializer.iter().any(|weight| weight.name == name);
        let inputs: Vec<_> = graph.input.iter().filter(|input| !is_weight(&input.name)).collect();
        let outputs: Vec<String> = graph.output.iter().map(|output| output.name.clone()).collect();
        let (mut images, mut speed, mut memories, mut shapes) = (Vec::new(), None, Vec::new(), Vec::new());
        for (place, given) in inputs.iter().enumerate() {
            let remembered = given.name.strip_suffix(MEMORY[0]).map(|name| format!("{name}{}", MEMORY[1]));
            let from = remembered.and_then(|name| outputs.iter().position(|output| *output == name));
            shapes.push(match from {
                Some(output) => {
                    memories.push(Memory { input: place, output });
                    memory_shape(given)?
                }
                None if given.name == SPEED && inputs.len() > 1 => {
                    speed = Some(place);
                    speed_shape(given)?
                }
                None => {
                    images.push(place);
                    Vec::new()
                }
            });
        }
        let &[image] = images.as_slice() else {
            let names: Vec<_> = inputs.iter().map(|input| format!("`{}`", input.name)).collect();
            return Err(Error::new(format!(
                "its inputs are {}, but it has to have one, the image, and may have `{SPEED}`, a number, and memories: inputs \
                 called `NAME{}` that get with each frame what the output `NAME{}` was before",
                names.join(", "),
                MEMORY[0],
                MEMORY[1]
            )));
        };
        let input = image_input(inputs[image], layout, open)?;
        shapes[image] = input.shape().to_vec();
        Ok(Self { source, input, image, speed, memories, shapes, outputs, proto })
    }
}

/// The values of a model's inputs.
#[derive(Debug, Clone)]
pub struct Inputs {
    values: Vec<Vec<f32>>,
    image: usize,
    speed: Option<usize>,
    memories: Vec<Memory>,
}

impl Inputs {
    /// The values of each input, in their order.
    pub fn values(&self) -> &[Vec<f32>] {
        &self.values
    }

    /// The numbers of the image.
    pub fn image(&mut self) -> &mut [f32] {
        &mut self.values[self.image]
    }

    /// Sets the speed in metres per second, where the model takes one.
    pub fn move_at(&mut self, speed: f32) {
        if let Some(place) = self.speed {
            self.values[place].fill(speed);
        }
    }

    /// Forgets all frames.
    pub fn forget(&mut self) {
        self.memories.iter().for_each(|memory| self.values[memory.input].fill(0.0));
    }

    /// Takes what is to be remembered from these outputs, and leaves there what was before.
    pub fn remember(&mut self, outputs: &mut [Vec<f32>]) {
        for memory in &self.memories {
            std::mem::swap(&mut self.values[memory.input], &mut outputs[memory.output]);
        }
    }
}

/// Looks at the files of weights that a graph names: they lie in the folder of the model, and are files.
fn check_external(graph: &pb::GraphProto, folder: &Path) -> Result<()> {
    let mut external = Vec::new();
    locations(graph, &mut external);
    for location in external {
        if !is_beside(location) {
            return Err(Error::new(format!(
                "its weights are in `{}`, outside its folder, and pdk reads nothing there; put them beside the model",
                location.display()
            )));
        }
        file::open(&folder.join(location))
            .map_err(|error| error.at(format_args!("its weights `{}`", location.display())))?;
    }
    Ok(())
}

/// The files that a graph names for its weights, and for those of the graphs within it.
fn locations<'a>(graph: &'a pb::GraphProto, into: &mut Vec<&'a Path>) {
    let attributes = || graph.node.iter().flat_map(|node| &node.attribute);
    let tensors = attributes().flat_map(|attribute| attribute.t.iter().chain(&attribute.tensors));
    let entries = graph.initializer.iter().chain(tensors).flat_map(|tensor| &tensor.external_data);
    for entry in entries.filter(|entry| entry.key == "location") {
        let location = Path::new(&entry.value);
        if !into.contains(&location) {
            into.push(location);
        }
    }
    let graphs = attributes().flat_map(|attribute| attribute.g.iter().chain(&attribute.graphs));
    graphs.for_each(|graph| locations(graph, into));
}

/// Whether weights lie in the model's own folder, or in one within it.
fn is_beside(location: &Path) -> bool {
    location.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// The files beside a model that hold weights of it, for the record of a run. What is wrong with the model is for
/// [`ModelFile::read`] to say.
pub fn weights(model: &str) -> Vec<InputFiles> {
    let path = Path::new(model);
    let content = file::read(path, LARGEST).ok();
    let proto = content.and_then(|content| tract_onnx::onnx().proto_model_for_read(&mut &*content).ok());
    let graph = proto.as_ref().and_then(|proto| proto.graph.as_ref());
    let mut names = Vec::new();
    graph.into_iter().for_each(|graph| locations(graph, &mut names));
    let names: Vec<PathBuf> = names.into_iter().filter(|name| is_beside(name)).map(Path::to_owned).collect();
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    match names.is_empty() {
        true => Vec::new(),
        false => vec![InputFiles::new(&format!("weights of {name}"), folder, names)],
    }
}

/// The type and shape of an input of 32-bit floats.
fn float_tensor<'a>(input: &'a pb::ValueInfoProto, expected: &str) -> Result<&'a pb::type_proto::Tensor> {
    let name = &input.name;
    let Some(pb::type_proto::Value::TensorType(tensor)) =
        input.r#type.as_ref().and_then(|t| t.value.as_ref())
    else {
        return Err(Error::new(format!("its input `{name}` is not a tensor, but has to be {expected}")));
    };
    if tensor.elem_type != DataType::Float as i32 {
        let found = DataType::try_from(tensor.elem_type).map_or("of an unknown type", |t| t.as_str_name());
        return Err(Error::new(format!("its input `{name}` is {found}, but has to be FLOAT (32 bit)")));
    }
    Ok(tensor)
}

/// The dimensions of a tensor; nothing if one is left open.
fn dims(tensor: &pb::type_proto::Tensor) -> Vec<Option<i64>> {
    tensor.shape.iter().flat_map(|shape| &shape.dim).map(|dim| fixed(dim.value.as_ref())).collect()
}

fn speed_shape(input: &pb::ValueInfoProto) -> Result<Vec<usize>> {
    let tensor = float_tensor(input, "a number")?;
    let dims = dims(tensor);
    if dims.len() > 2 || dims.iter().any(|dim| dim.is_some_and(|dim| dim != 1)) {
        return Err(Error::new(format!(
            "its input `{}` has the shape {}, but has to be one number: (1) or (1, 1)",
            input.name,
            shape_text(tensor.shape.as_ref())
        )));
    }
    Ok(vec![1; dims.len()])
}

fn memory_shape(input: &pb::ValueInfoProto) -> Result<Vec<usize>> {
    let tensor = float_tensor(input, "a memory")?;
    let mut shape: Vec<Option<usize>> = dims(tensor)
        .iter()
        .map(|dim| dim.and_then(|dim| usize::try_from(dim).ok()).filter(|&dim| dim > 0))
        .collect();
    // The batch, which is left open often.
    if let Some(first) = shape.first_mut() {
        first.get_or_insert(1);
    }
    let values = shape.iter().try_fold(1usize, |product, dim| product.checked_mul((*dim)?));
    match (shape.iter().copied().collect::<Option<Vec<usize>>>(), values) {
        (Some(shape), Some(values)) if values <= LARGEST_MEMORY => Ok(shape),
        _ => Err(Error::new(format!(
            "its input `{}`, a memory, has the shape {}, but has to have a fixed one of at most {LARGEST_MEMORY} values",
            input.name,
            shape_text(tensor.shape.as_ref())
        ))),
    }
}

fn image_input(input: &pb::ValueInfoProto, layout: &str, open: Option<Size>) -> Result<ImageInput> {
    let name = &input.name;
    let tensor = float_tensor(input, "an image")?;
    let dims = dims(tensor);
    let shape = shape_text(tensor.shape.as_ref());
    let expected = "(1, channels, height, width) or (1, height, width, channels) with 1 or 3 channels";
    let wrong = |what: &str| {
        Err(Error::new(format!(
            "its input `{name}` has the shape {shape}{what}, but has to be an image: {expected}"
        )))
    };
    let &[batch, a, b, c] = dims.as_slice() else { return wrong("") };
    if batch.is_some_and(|batch| batch != 1) {
        return wrong(", which takes several frames at once");
    }
    let is_channels = |dim: Option<i64>| matches!(dim, Some(1 | 3));
    let layout = match (layout, is_channels(a), is_channels(c)) {
        ("nchw", true, _) | ("auto", true, false) => Layout::Nchw,
        ("nhwc", _, true) | ("auto", false, true) => Layout::Nhwc,
        ("auto", true, true) => {
            return Err(Error::new(format!(
                "its input `{name}` has the shape {shape}, in which the channels may come first or last; set \
                 `layout` to nchw or nhwc"
            )));
        }
        ("auto", ..) => return wrong(""),
        (asked, ..) => return wrong(&format!(", which is not {asked}")),
    };
    let (channels, height, width) = match layout {
        Layout::Nchw => (a, b, c),
        Layout::Nhwc => (c, a, b),
    };
    let height = height.or(open.map(|size| size.height as i64));
    let width = width.or(open.map(|size| size.width as i64));
    match [channels, height, width]
        .map(|dim| dim.and_then(|dim| usize::try_from(dim).ok()).filter(|&dim| dim > 0))
    {
        [Some(channels), Some(height), Some(width)] if height <= MAX_SIDE && width <= MAX_SIDE => {
            Ok(ImageInput { layout, channels, height, width })
        }
        [_, Some(_), Some(_)] => wrong(&format!(", larger than {MAX_SIDE} pixels")),
        _ => Err(Error::new(format!(
            "its input `{name}` has the shape {shape} without a fixed height and width; export the model with the size \
             that it was trained on"
        ))),
    }
}

/// More than any camera has; a damaged file may say anything.
const MAX_SIDE: usize = 16_384;

/// The same for what a network remembers: 64 MiB.
const LARGEST_MEMORY: usize = 1 << 24;

fn fixed(value: Option<&dimension::Value>) -> Option<i64> {
    match value {
        Some(dimension::Value::DimValue(value)) => Some(*value),
        _ => None,
    }
}

/// A shape as it is written in papers: `(batch, 3, 120, 160)`.
fn shape_text(shape: Option<&pb::TensorShapeProto>) -> String {
    let dims = shape.iter().flat_map(|shape| &shape.dim).map(|dim| match &dim.value {
        Some(dimension::Value::DimValue(value)) => value.to_string(),
        Some(dimension::Value::DimParam(name)) => name.clone(),
        None => "?".to_owned(),
    });
    format!("({})", dims.collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use prost::Message;

    use super::*;
    use crate::fixture::Pilot;

    fn model_in(path: &Path, layout: &str) -> Result<ModelFile> {
        ModelFile::read(Source::File(path.to_owned()), layout)
    }

    fn read(pilot: &Pilot, layout: &str) -> Result<ImageInput> {
        let file = pilot.file();
        model_in(file.path(), layout).map(|model| model.input)
    }

    #[test]
    fn the_input_is_read_from_the_file() {
        let nchw = ImageInput { layout: Layout::Nchw, channels: 3, height: 4, width: 6 };
        assert_eq!(read(&Pilot::new(&["batch", "3", "4", "6"]), "auto").unwrap(), nchw);
        assert_eq!(read(&Pilot::new(&["1", "3", "4", "6"]), "nchw").unwrap(), nchw);
        let nhwc = ImageInput { layout: Layout::Nhwc, channels: 1, height: 4, width: 6 };
        assert_eq!(read(&Pilot::new(&["1", "4", "6", "1"]), "auto").unwrap(), nhwc);
        let narrow = Pilot::new(&["1", "3", "4", "3"]);
        assert_eq!(read(&narrow, "nchw").unwrap().width, 3);
        assert_eq!(read(&narrow, "nhwc").unwrap().width, 4);
    }

    #[test]
    fn a_speed_is_taken_beside_the_image() {
        let with = Pilot { second_input: Some(SPEED), ..Pilot::new(&["1", "3", "4", "6"]) };
        let model = |pilot: &Pilot| model_in(pilot.file().path(), "auto").unwrap().speed;
        assert_eq!(model(&with), Some(1));
        assert_eq!(model(&Pilot::new(&["1", "3", "4", "6"])), None);
    }

    #[test]
    fn a_file_that_is_not_an_image_is_rejected_with_what_was_found() {
        let error = |dims: &[&str], layout| read(&Pilot::new(dims), layout).unwrap_err().to_string();
        assert_eq!(
            error(&["batch", "10"], "auto"),
            "its input `image` has the shape (batch, 10), but has to be an image: (1, channels, height, width) or \
             (1, height, width, channels) with 1 or 3 channels"
        );
        assert!(error(&["1", "4", "5", "6"], "auto").contains("(1, 4, 5, 6), but"));
        assert!(error(&["8", "3", "5", "6"], "auto").contains("several frames at once"));
        assert!(error(&["1", "3", "5", "6"], "nhwc").contains("which is not nhwc"));
        assert!(error(&["1", "3", "4", "3"], "auto").contains("set `layout`"));
        assert!(
            error(&["1", "3", "h", "w"], "auto").contains("(1, 3, h, w) without a fixed height and width")
        );
        assert!(error(&["1", "3", "0", "6"], "auto").contains("without a fixed height"));
        assert!(error(&["1", "3", "99999999", "6"], "auto").contains("larger than"));
        let bytes = Pilot { element: DataType::Uint8, ..Pilot::new(&["1", "3", "4", "6"]) };
        assert!(read(&bytes, "auto").unwrap_err().message().contains("is UINT8, but has to be FLOAT"));
        let two = Pilot { second_input: Some("mirror"), ..Pilot::new(&["1", "3", "4", "6"]) };
        let message = read(&two, "auto").unwrap_err().message().to_owned();
        assert!(message.starts_with("its inputs are `image`, `mirror`, but it has to have one"), "{message}");
    }

    #[test]
    fn weights_are_read_from_the_folder_of_the_model_only() {
        let refused = |location: &str| {
            let mut model =
                pb::ModelProto::decode(Pilot::new(&["1", "3", "4", "6"]).bytes().as_slice()).unwrap();
            let entry = pb::StringStringEntryProto { key: "location".to_owned(), value: location.to_owned() };
            let weight = &mut model.graph.as_mut().unwrap().initializer[0];
            weight.external_data = vec![entry];
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("model.onnx");
            std::fs::write(&path, model.encode_to_vec()).unwrap();
            model_in(&path, "auto").err().unwrap().to_string()
        };
        for outside in ["/etc/passwd", "../weights", "a/../../weights"] {
            assert!(refused(outside).contains("outside its folder"), "{}", refused(outside));
        }
        assert_eq!(refused("none.bin"), "its weights `none.bin`: it does not exist");
    }

    #[test]
    fn files_that_are_not_models_are_rejected() {
        let error = |content: &[u8]| {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), content).unwrap();
            model_in(file.path(), "auto").err().unwrap().to_string()
        };
        assert!(error(b"").contains("not an ONNX model"));
        assert!(error(b"PK\x03\x04 an archive of something else").contains("not an ONNX model"));
        let whole = Pilot::new(&["1", "3", "4", "6"]).bytes();
        assert!(error(&whole[..whole.len() / 2]).contains("damaged"));
        let missing = model_in(Path::new("/no/such.onnx"), "auto").err().unwrap();
        assert_eq!(missing.message(), "there is no such file; give the path of an ONNX file");
    }
}
