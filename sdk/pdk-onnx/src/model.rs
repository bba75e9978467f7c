//! ONNX files, read with everything that belongs to them.

use std::collections::HashSet;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Component, Path};

use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use prost::Message;

use crate::proto::{ModelProto, TensorProto};

/// The most bytes that a file may have; protocol buffers end there.
const MAX_BYTES: u64 = 1 << 31;

/// Reads a model with the weights that lie in files beside it.
///
/// # Errors
/// If a file cannot be read, is none, or is not an ONNX model.
pub fn read(path: &Path) -> Result<ModelProto> {
    let mut model = decode(&file::read(path, MAX_BYTES)?)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    for tensor in model.graph.iter_mut().flat_map(|graph| &mut graph.initializer) {
        if tensor.data_location == 1 {
            let place = format!("its weights `{}`", tensor.name);
            take_in(tensor, folder).place(place)?;
        }
    }
    Ok(model)
}

/// Reads a model from the content of its file.
///
/// # Errors
/// If it is not an ONNX model or holds no graph.
pub fn decode(bytes: &[u8]) -> Result<ModelProto> {
    let model =
        ModelProto::decode(bytes).map_err(|_| Error::new("the file is not an ONNX model, or is damaged"))?;
    match &model.graph {
        Some(graph) if !graph.node.is_empty() => {
            check_names(
                graph.initializer.iter().map(|tensor| tensor.name.as_str()),
                graph.input.iter().map(|input| input.name.as_str()),
                graph.node.iter().flat_map(|node| &node.output).map(String::as_str),
            )?;
            Ok(model)
        }
        _ => Err(Error::new("the file is not an ONNX model: it contains no graph")),
    }
}

/// Refuses a graph in which a name stands for two values: every reader picks one of them without a word. `weights`, `inputs` and
/// `computed` are the names of its initializers and inputs, and of all outputs of its nodes.
///
/// # Errors
/// Names the first that is there twice.
pub fn check_names<'a>(
    weights: impl IntoIterator<Item = &'a str>,
    inputs: impl IntoIterator<Item = &'a str>,
    computed: impl IntoIterator<Item = &'a str>,
) -> Result<()> {
    let (mut given, mut inputs_seen) = (HashSet::new(), HashSet::new());
    let twice = weights.into_iter().find(|name| !given.insert(*name));
    let twice = twice.or_else(|| inputs.into_iter().find(|name| !inputs_seen.insert(*name)));
    // Old files list their weights among the inputs.
    given.extend(inputs_seen);
    // An output that is not wanted has no name.
    let twice = twice.or_else(|| computed.into_iter().find(|name| !name.is_empty() && !given.insert(*name)));
    match twice {
        None => Ok(()),
        Some(name) => Err(Error::new(format!(
            "two values are called `{name}`, so it is not known which of them is meant; export the model again"
        ))),
    }
}

/// The content of a model's file.
pub fn encode(model: &ModelProto) -> Vec<u8> {
    model.encode_to_vec()
}

/// Puts the elements that lie in another file into the tensor.
fn take_in(tensor: &mut TensorProto, folder: &Path) -> Result<()> {
    let entry =
        |key: &str| tensor.external_data.iter().find(|entry| entry.key == key).map(|entry| &entry.value);
    let location = entry("location").ok_or_else(|| Error::new("no file is named for them"))?;
    let path = Path::new(location);
    if !path.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)) {
        return Err(Error::new(format!("`{location}` does not lie beside the model")));
    }
    let number = |key: &str| match entry(key) {
        None => Ok(None),
        Some(text) => text.parse::<u64>().map(Some).place(format!("`{key}` is `{text}`")),
    };
    let (offset, length) = (number("offset")?.unwrap_or(0), number("length")?);
    let path = folder.join(path);
    let place = format!("`{}`", path.display());
    let (mut file, whole) = file::open(&path).place(&place)?;
    let available = whole.saturating_sub(offset);
    let length = length.unwrap_or(available);
    if length > available.min(MAX_BYTES) {
        return Err(Error::new(format!("{place} does not hold {length} bytes from byte {offset} on")));
    }
    file.seek(SeekFrom::Start(offset)).place(&place)?;
    let mut bytes = Vec::new();
    file.take(length).read_to_end(&mut bytes).place(&place)?;
    tensor.raw_data = bytes;
    tensor.external_data.clear();
    tensor.data_location = 0;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::proto::StringStringEntryProto;
    use crate::tensor::Tensor;
    use crate::testing::Sketch;

    #[test]
    fn a_name_stands_for_one_value() {
        let model = |first: &str, second: &str| {
            let mut sketch = Sketch::new(17);
            sketch.input("x", &[1, 2]);
            sketch.weights("w", Tensor::floats(&[2], vec![3.0, 4.0]));
            sketch.node("Add", &["x", "w"], first, &[]);
            sketch.node("Mul", &["x", "w"], second, &[]);
            decode(&encode(&sketch.model(&["y"])))
        };
        assert!(model("y", "z").is_ok());
        for (first, second, name) in [("y", "y", "y"), ("y", "x", "x"), ("w", "y", "w")] {
            let error = model(first, second).unwrap_err().to_string();
            assert!(error.starts_with(&format!("two values are called `{name}`")), "{error}");
        }
    }

    fn external(location: &str, offset: &str) -> ModelProto {
        let mut sketch = Sketch::new(17);
        sketch.input("x", &[1, 2]);
        sketch.weights("w", Tensor::floats(&[2], vec![3.0, 4.0]));
        sketch.node("Add", &["x", "w"], "y", &[]);
        let mut model = sketch.model(&["y"]);
        let weights = &mut model.graph.as_mut().unwrap().initializer[0];
        weights.raw_data.clear();
        weights.data_location = 1;
        let entry = |key: &str, value: &str| StringStringEntryProto { key: key.into(), value: value.into() };
        weights.external_data =
            vec![entry("location", location), entry("offset", offset), entry("length", "8")];
        model
    }

    #[test]
    fn weights_are_read_from_the_file_beside_the_model() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("model.onnx");
        let write = |location: &str, offset: &str| {
            std::fs::write(&path, external(location, offset).encode_to_vec()).unwrap()
        };
        let weights: Vec<u8> = [9.0f32, 3.0, 4.0].iter().flat_map(|value| value.to_le_bytes()).collect();
        std::fs::write(dir.path().join("weights.bin"), weights).unwrap();
        write("weights.bin", "4");
        let model = read(&path).unwrap();
        let tensor = Tensor::from_proto(&model.graph.unwrap().initializer[0]).unwrap();
        assert_eq!(tensor, Tensor::floats(&[2], vec![3.0, 4.0]));
        for (location, offset, expected) in [
            ("weights.bin", "8", "does not hold 8 bytes"),
            ("../weights.bin", "0", "does not lie beside"),
            ("none.bin", "0", "none.bin"),
            ("weights.bin", "-1", "`offset` is `-1`"),
        ] {
            write(location, offset);
            let error = read(&path).unwrap_err().to_string();
            assert!(error.starts_with("its weights `w`: ") && error.contains(expected), "{error}");
        }
    }

    #[test]
    fn a_file_that_is_not_a_model_is_rejected() {
        for bytes in [&b""[..], b"PK\x03\x04 an archive of something else", &[0x0a; 40]] {
            assert!(decode(bytes).unwrap_err().to_string().starts_with("the file is not an ONNX model"));
        }
        assert!(
            read(Path::new("/dev/zero")).unwrap_err().to_string().contains("only regular files are read")
        );
        assert_eq!(read(Path::new("/no/such.onnx")).unwrap_err().to_string(), "it does not exist");
    }
}
