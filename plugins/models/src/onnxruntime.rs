//! Runs networks with ONNX Runtime, a shared library that is loaded when it is first asked for.

use std::ffi::CStr;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use half::f16;
use libloading::{Library, Symbol};
use ort::environment::Environment;
use ort::session::{Session as OrtSession, SessionInputValue};
use ort::sys::OrtApiBase;
use ort::value::{DynValue, Tensor, TensorRef};
use pdk_network::Element;
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::processor;
use crate::session::{Graph, Network, Session, Taken};

/// The library in use. It stays loaded until the process ends.
pub struct Runtime {
    path: PathBuf,
    version: String,
    environment: Environment,
    /// BLAKE3 of the library, once it has been asked for.
    hash: OnceLock<Option<String>>,
}

/// The full name of the engine with this version of ONNX Runtime.
fn name_of(version: &str) -> String {
    format!("onnxruntime {version}/{}", processor::class())
}

/// The full name of the engine that this library is. Only where the name of its file does not say its version is it loaded.
///
/// # Errors
/// As for [`load`].
pub fn engine(path: &Path) -> Result<String> {
    let real = path.canonicalize().unwrap_or_else(|_| path.to_owned());
    let name = real.file_name().unwrap_or_default().to_string_lossy();
    match name
        .split_once(".so.")
        .map(|(_, version)| version)
        .filter(|version| version.split('.').count() == 3)
    {
        Some(version) => Ok(name_of(version)),
        None => Ok(name_of(&load(path)?.version)),
    }
}

impl Runtime {
    /// BLAKE3 of the library, in hexadecimal; none if it cannot be read any more.
    fn hash(&self) -> Option<&str> {
        let hash = || Some(blake3::hash(&std::fs::read(&self.path).ok()?).to_hex().to_string());
        self.hash.get_or_init(hash).as_deref()
    }

    /// The name with the version.
    pub fn name(&self) -> String {
        format!("ONNX Runtime {}", self.version)
    }
}

/// Loads the library, or gives the one that is loaded.
///
/// # Errors
/// If the library cannot be loaded, is another one, or is too old; and where the process already uses another file,
/// because there can be one only.
pub fn load(path: &Path) -> Result<Arc<Runtime>> {
    // Two names of the same file are not a contradiction.
    let path = &path.canonicalize().place(format!("ONNX Runtime at `{}`", path.display()))?;
    static LOADED: Mutex<Option<Arc<Runtime>>> = Mutex::new(None);
    let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
    match &*loaded {
        Some(runtime) if runtime.path == *path => Ok(runtime.clone()),
        Some(runtime) => Err(Error::new(format!(
            "ONNX Runtime at `{}` cannot be used, because this process already uses the one at `{}`",
            path.display(),
            runtime.path.display()
        ))),
        None => {
            let runtime =
                Arc::new(start(path).map_err(|e| e.at(format!("ONNX Runtime at `{}`", path.display())))?);
            Ok(loaded.insert(runtime).clone())
        }
    }
}

fn start(path: &Path) -> Result<Runtime> {
    // SAFETY: the user named this file as ONNX Runtime, or installed it as such.
    let library = unsafe { Library::new(path) }.place("it cannot be loaded")?;
    // SAFETY: this is the type of ONNX Runtime's one entry point (onnxruntime_c_api.h).
    let base: Symbol<'_, unsafe extern "C" fn() -> *const OrtApiBase> =
        unsafe { library.get(b"OrtGetApiBase") }
            .map_err(|_| Error::new("it is another library: it has no OrtGetApiBase"))?;
    // SAFETY: the entry point takes nothing and gives a table that lives as long as the library, or null.
    let base = unsafe { base().as_ref() }.ok_or_else(|| Error::new("it has no interface"))?;
    // SAFETY: the table's function gives a text that lives as long as the library.
    let version = unsafe { CStr::from_ptr((base.GetVersionString)()) }.to_string_lossy().into_owned();
    // SAFETY: the table's function gives a table that lives as long as the library, or null.
    let api = unsafe { (base.GetApi)(ort::MINOR_VERSION).as_ref() }.ok_or_else(|| {
        Error::new(format!("it is version {version}, but 1.{} or later is needed", ort::MINOR_VERSION))
    })?;
    if !ort::set_api(api.clone()) {
        return Err(Error::new("an earlier attempt to start ONNX Runtime failed in this process"));
    }
    // From here on its functions are called until the process ends.
    std::mem::forget(library);
    let environment =
        ort::init().with_name("pdk").with_telemetry(false).build().place("it cannot be started")?;
    Ok(Runtime { path: path.to_path_buf(), version, environment, hash: OnceLock::new() })
}

/// A network that ONNX Runtime runs.
pub struct OnnxRuntime {
    session: OrtSession,
    inputs: Vec<Taken>,
    runtime: Arc<Runtime>,
    /// The last field, so that the session is gone when its memory is given back.
    _memory: GivenBack,
}

/// Gives memory back to the system when it is dropped. ONNX Runtime asks for aligned blocks, which the allocator of glibc before 2.38
/// does not use again once they are free (bug 14581): a worker that opened a hundred sessions had grown by a gigabyte.
struct GivenBack;

impl Drop for GivenBack {
    fn drop(&mut self) {
        // SAFETY: the function takes no pointer and may be called at any time from any thread.
        #[cfg(target_env = "gnu")]
        unsafe {
            libc::malloc_trim(0);
        }
    }
}

impl OnnxRuntime {
    /// Prepares a network.
    ///
    /// # Errors
    /// If ONNX Runtime cannot run the network.
    pub fn new(network: &Network<'_>, runtime: Arc<Runtime>) -> Result<Self> {
        let place = "it cannot prepare the model";
        let mut builder = OrtSession::builder(&runtime.environment)
            .place(place)?
            .with_intra_threads(1)
            .place(place)?
            .with_inter_threads(1)
            .place(place)?
            .with_deterministic_compute(true)
            .place(place)?;
        let session = match &network.graph {
            Graph::File(path) => builder.commit_from_file(path),
            Graph::Memory(bytes) => builder.commit_from_memory(bytes),
        };
        let session = session.place(place)?;
        Ok(Self { session, inputs: network.inputs.clone(), runtime, _memory: GivenBack })
    }
}

/// The tensor of an input.
fn input<'a>(taken: &'a Taken, values: &'a [f32]) -> ort::Result<SessionInputValue<'a>> {
    let shape = taken.shape.as_slice();
    let whole = || values.iter().map(|value| taken.whole(*value));
    Ok(match taken.element {
        Element::Float16 => {
            let halves: Vec<f16> = values.iter().map(|value| f16::from_f32(*value)).collect();
            Tensor::from_array((shape, halves))?.into()
        }
        Element::Uint8 => {
            Tensor::from_array((shape, whole().map(|value| value as u8).collect::<Vec<_>>()))?.into()
        }
        Element::Int8 => {
            Tensor::from_array((shape, whole().map(|value| value as i8).collect::<Vec<_>>()))?.into()
        }
        Element::Float32 | Element::Other(_) => TensorRef::from_array_view((shape, values))?.into(),
    })
}

/// Reads the numbers of an output, whatever their type is.
fn read(result: &DynValue, values: &mut Vec<f32>) -> ort::Result<()> {
    let floats = result.try_extract_tensor::<f32>();
    if let Ok((_, floats)) = &floats {
        values.extend_from_slice(floats);
    } else if let Ok((_, list)) = result.try_extract_tensor::<f16>() {
        values.extend(list.iter().map(|value| value.to_f32()));
    } else if let Ok((_, list)) = result.try_extract_tensor::<f64>() {
        values.extend(list.iter().map(|value| *value as f32));
    } else if let Ok((_, list)) = result.try_extract_tensor::<i64>() {
        values.extend(list.iter().map(|value| *value as f32));
    } else if let Ok((_, list)) = result.try_extract_tensor::<i32>() {
        values.extend(list.iter().map(|value| *value as f32));
    } else if let Ok((_, list)) = result.try_extract_tensor::<u8>() {
        values.extend(list.iter().map(|value| f32::from(*value)));
    } else if let Ok((_, list)) = result.try_extract_tensor::<i8>() {
        values.extend(list.iter().map(|value| f32::from(*value)));
    } else {
        floats?;
    }
    Ok(())
}

impl Session for OnnxRuntime {
    fn run(&mut self, inputs: &[Vec<f32>], outputs: &mut [Vec<f32>]) -> Result<()> {
        let runtime = &self.runtime;
        let failed = |error: ort::Error| Error::new(error.to_string()).at(runtime.name());
        let tensors =
            self.inputs.iter().zip(inputs).map(|(taken, values)| input(taken, values).map_err(failed));
        let tensors = tensors.collect::<Result<Vec<_>>>()?;
        let results = self.session.run(tensors.as_slice()).map_err(failed)?;
        for (values, result) in outputs.iter_mut().zip(results.values()) {
            values.clear();
            read(&result, values).map_err(failed)?;
        }
        Ok(())
    }

    fn engine(&self) -> String {
        name_of(&self.runtime.version)
    }

    // Two builds of one version may differ.
    fn info(&self) -> Vec<(String, String)> {
        let mut info = vec![("engine".to_owned(), self.engine())];
        if let Some(hash) = self.runtime.hash() {
            info.push(("ONNX Runtime BLAKE3".to_owned(), hash.to_owned()));
        }
        info
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::locate::Search;

    #[test]
    fn a_file_that_is_not_a_library_is_rejected() {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), "no library").unwrap();
        let error = load(file.path()).err().unwrap().to_string();
        assert!(error.contains(&file.path().display().to_string()), "{error}");
        assert!(
            load(Path::new("/no/such.so"))
                .err()
                .unwrap()
                .message()
                .starts_with("ONNX Runtime at `/no/such.so`")
        );
    }

    /// What this process holds of the machine's memory, in bytes.
    fn held() -> usize {
        let pages = std::fs::read_to_string("/proc/self/statm").unwrap();
        pages.split(' ').nth(1).unwrap().parse::<usize>().unwrap() * 4096
    }

    #[test]
    fn the_memory_of_a_session_is_given_back() {
        let Some(found) = Search::from_environment().find().unwrap() else {
            println!("skipped: ONNX Runtime is not installed");
            return;
        };
        const NIGHT: &[u8] = include_bytes!("../../../scripts/painters/night.onnx");
        let image = [vec![0.0; 3 * 160 * 320]];
        let run = || {
            let network = Network {
                graph: Graph::Memory(NIGHT),
                inputs: vec![Taken { shape: vec![1, 3, 160, 320], element: Element::Float32 }],
            };
            let mut session = OnnxRuntime::new(&network, load(&found.path).unwrap()).unwrap();
            session.run(&image, &mut [Vec::new()]).unwrap();
        };
        (0..3).for_each(|_| run());
        let before = held();
        (0..15).for_each(|_| run());
        // It grew by 150 MB.
        let grown = held().saturating_sub(before);
        assert!(grown < 60 << 20, "{grown} bytes");
    }

    #[test]
    fn the_first_library_holds_for_the_process() {
        let Some(found) = Search::from_environment().find().unwrap() else {
            println!("skipped: ONNX Runtime is not installed");
            return;
        };
        let runtime = load(&found.path).unwrap();
        assert!(Arc::ptr_eq(&runtime, &load(&found.path).unwrap()));
        let other = tempfile::NamedTempFile::new().unwrap();
        let error = load(other.path()).err().unwrap().to_string();
        assert!(error.contains("this process already uses the one at"), "{error}");
    }
}
