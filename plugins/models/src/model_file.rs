//! An ONNX file with its description: what each input gets, and what is known about that.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use pdk_network::described::Described;
use pdk_network::given::ENDINGS;
use pdk_network::{Declared, Given, Inputs, Outputs, Plan, waypoints};
use pdk_onnx::model;
use pdk_onnx::proto::{GraphProto, ModelProto};
use pdk_sdk::file;
use pdk_sdk::prelude::*;
use prost::Message;

use crate::session::{Graph, Network, Session};

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
    /// The graph, for what is built from it.
    ///
    /// # Errors
    /// If it cannot be read, or contradicts itself.
    pub fn graph(&self) -> Result<pdk_onnx::Graph> {
        pdk_onnx::Graph::new(match self {
            Self::File(path) => model::read(path)?,
            Self::BuiltIn(bytes) => model::decode(bytes)?,
        })
    }

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

/// An ONNX file with its description.
pub struct ModelFile {
    /// Where it comes from.
    pub source: Source,
    /// What it contains.
    pub proto: ModelProto,
    /// What its inputs get.
    pub plan: Plan,
}

impl ModelFile {
    /// The network for an engine, for one image at a time.
    pub fn network(&self) -> Network<'_> {
        let graph = match &self.source {
            Source::File(path) => Graph::File(path),
            Source::BuiltIn(bytes) => Graph::Memory(bytes),
        };
        Network { graph, inputs: self.plan.inputs.iter().map(Into::into).collect() }
    }

    /// Room for its outputs.
    pub fn room(&self) -> Vec<Vec<f32>> {
        vec![Vec::new(); self.plan.outputs.len()]
    }

    /// Runs it on an image of zeros at a speed, and gives the number of values of each output, which files need not declare.
    ///
    /// # Errors
    /// If the engine cannot run it, or what it remembers does not fit its input.
    pub fn sizes(&self, session: &mut dyn Session, speed: f64) -> Result<Vec<usize>> {
        let mut outputs = self.room();
        let mut inputs = Inputs::new(&self.plan);
        inputs.move_at(speed)?;
        session.run(inputs.values(), &mut outputs)?;
        let sizes: Vec<usize> = outputs.iter().map(Vec::len).collect();
        inputs.check_states(&self.plan.outputs, &sizes)?;
        Ok(sizes)
    }

    /// Runs it as [`sizes`](Self::sizes) does, and says how its outputs become a control.
    ///
    /// # Errors
    /// As for [`sizes`](Self::sizes), and if its outputs are not a control.
    pub fn try_out(&self, session: &mut dyn Session, speed: f64) -> Result<Outputs> {
        self.control(&self.sizes(session, speed)?)
    }

    /// How its outputs become a control, by the number of values of each.
    ///
    /// # Errors
    /// If they do not.
    pub fn control(&self, sizes: &[usize]) -> Result<Outputs> {
        let states: Vec<usize> = self.plan.states().collect();
        Outputs::new(&self.plan.described, &self.plan.outputs, sizes, &states)
    }

    /// Reads a driving model with what was given to describe it. One that plans waypoints gets its controller.
    ///
    /// # Errors
    /// If the file cannot be read or is not an ONNX model, or if its inputs are not what was described and can be guessed.
    pub fn read(mut source: Source, mut given: Given) -> Result<Self> {
        let mut proto = Self::decode(&source)?;
        if waypoints::describes(&given) {
            if let Source::File(path) = &source {
                // With the weights that lie in files of their own, since the model is no longer the file beside them.
                proto = model::read(path)?;
            }
            waypoints::follow(&mut proto, &mut given)?;
            source = Source::BuiltIn(model::encode(&proto).into());
        }
        Self::new(source, proto, given)
    }

    /// Reads a model that need not drive, whose image has the given width and height if the file leaves it open.
    ///
    /// # Errors
    /// As for [`Self::read`].
    pub fn read_at(source: Source, mut given: Given, size: [usize; 2]) -> Result<Self> {
        let proto = Self::decode(&source)?;
        let inputs = Declared::of_model(&proto).inputs;
        if inputs.iter().any(|port| port.dims().iter().skip(1).any(Option::is_none)) {
            given.set("image_size", pdk_sdk::serde_json::json!(size), "the parameters `width` and `height`");
        }
        Self::new(source, proto, given)
    }

    fn decode(source: &Source) -> Result<ModelProto> {
        let proto = model::decode(&source.content()?)?;
        if let (Source::File(path), Some(graph)) = (source, &proto.graph) {
            check_external(graph, path.parent().unwrap_or(Path::new("")))?;
        }
        Ok(proto)
    }

    fn new(source: Source, proto: ModelProto, given: Given) -> Result<Self> {
        let plan = Plan::new(&Declared::of_model(&proto), Described::new(given)?)?;
        Ok(Self { source, proto, plan })
    }
}

/// Looks at the files of weights that a graph names: they lie in the folder of the model, and are files.
fn check_external(graph: &GraphProto, folder: &Path) -> Result<()> {
    let mut external = Vec::new();
    locations(graph, &mut external);
    for location in &external {
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
fn locations(graph: &GraphProto, into: &mut Vec<PathBuf>) {
    let attributes = || graph.node.iter().flat_map(|node| &node.attribute);
    let tensors = attributes().flat_map(|attribute| attribute.t.iter().chain(&attribute.tensors));
    let entries = graph.initializer.iter().chain(tensors).flat_map(|tensor| &tensor.external_data);
    for entry in entries.filter(|entry| entry.key == "location") {
        let location = PathBuf::from(&entry.value);
        if !into.contains(&location) {
            into.push(location);
        }
    }
    let graphs = attributes().flat_map(|attribute| attribute.g.iter().chain(&attribute.graphs));
    for graph in graphs.filter_map(|bytes| GraphProto::decode(bytes.as_slice()).ok()) {
        locations(&graph, into);
    }
}

/// Whether weights lie in the model's own folder, or in one within it.
fn is_beside(location: &Path) -> bool {
    location.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
}

/// The files beside a model that belong to it, for the record of a run: those that hold weights of it, and its description, which
/// counts also if there is none yet.
pub fn files_beside(model: &str) -> Vec<InputFiles> {
    let path = Path::new(model);
    let names = ENDINGS.map(|ending| path.with_extension(ending).file_name().unwrap_or_default().into());
    let mut groups = weights(model);
    groups.insert(
        0,
        InputFiles::new(&format!("description of {}", name_of(path)), folder_of(path), names.into()),
    );
    groups
}

/// The name of a file, for messages.
fn name_of(path: &Path) -> Cow<'_, str> {
    path.file_name().unwrap_or_default().to_string_lossy()
}

/// The folder of a file.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// The files beside a model that hold weights of it, for the record of a run. What is wrong with the model is for
/// [`ModelFile::read`] to say.
pub fn weights(model: &str) -> Vec<InputFiles> {
    let path = Path::new(model);
    let content = file::read(path, LARGEST).ok();
    let proto = content.and_then(|content| model::decode(&content).ok());
    let graph = proto.as_ref().and_then(|proto| proto.graph.as_ref());
    let mut names = Vec::new();
    graph.into_iter().for_each(|graph| locations(graph, &mut names));
    let names: Vec<PathBuf> = names.into_iter().filter(|name| is_beside(name)).collect();
    match names.is_empty() {
        true => Vec::new(),
        false => vec![InputFiles::new(&format!("weights of {}", name_of(path)), folder_of(path), names)],
    }
}

#[cfg(test)]
mod tests {
    use pdk_onnx::proto::StringStringEntryProto;

    use super::*;
    use crate::fixture::Pilot;

    fn model_in(path: &Path) -> Result<ModelFile> {
        ModelFile::read(Source::File(path.to_owned()), Given::beside(path)?)
    }

    #[test]
    fn weights_are_read_from_the_folder_of_the_model_only() {
        let refused = |location: &str| {
            let mut model = ModelProto::decode(Pilot::new(&["1", "3", "4", "6"]).bytes().as_slice()).unwrap();
            let entry = StringStringEntryProto { key: "location".to_owned(), value: location.to_owned() };
            let weight = &mut model.graph.as_mut().unwrap().initializer[0];
            weight.external_data = vec![entry];
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("model.onnx");
            std::fs::write(&path, model.encode_to_vec()).unwrap();
            model_in(&path).err().unwrap().to_string()
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
            model_in(file.path()).err().unwrap().to_string()
        };
        assert!(error(b"").contains("not an ONNX model"));
        assert!(error(b"PK\x03\x04 an archive of something else").contains("not an ONNX model"));
        let whole = Pilot::new(&["1", "3", "4", "6"]).bytes();
        assert!(error(&whole[..whole.len() / 2]).contains("damaged"));
        let missing = model_in(Path::new("/no/such.onnx")).err().unwrap();
        assert_eq!(missing.message(), "there is no such file; give the path of an ONNX file");
    }
}
