//! Who runs a network: the engines of this machine, and how one is opened.
//!
//! What a network computes depends in its last digits on who runs it, on which version, and on the instructions that this takes from
//! the processor. These three together are an *engine*, such as `tract 0.23.9/x86-64-v3`. A scenario names the engine, so that its
//! outcome does not depend on the machine: one that does not have the engine refuses the scenario.

use std::sync::OnceLock;

use pdk_sdk::prelude::*;

use crate::locate::Search;
use crate::onnxruntime::{self, OnnxRuntime};
use crate::session::{Network, Session};
use crate::tract::{self, Tract};

/// The name of the parameter.
pub use pdk_sdk::model::component::ENGINE as PARAMETER;

const TRACT: &str = "tract";
const ONNXRUNTIME: &str = "onnxruntime";
const AUTO: &str = "auto";

/// The parameter that says who runs a network whose result depends on it.
pub fn parameter() -> Parameter {
    let doc = "who runs the network: tract is part of pdk and computes the same on every processor with AVX2; onnxruntime is ONNX Runtime, \
               which is faster, has to be installed, and computes as the processor lets it; auto is onnxruntime if it is installed, \
               else tract. A scenario records the engine with its version and the class of processor, such as tract 0.23.9/x86-64-v3";
    Parameter::choice(PARAMETER, &[TRACT, AUTO, ONNXRUNTIME], doc).stands_for(meanings().iter().cloned())
}

/// The parameter for the engine of a network that gives the same result on each.
pub fn indifferent_parameter() -> Parameter {
    let doc = "who runs the network, which gives the same result on each engine: auto is onnxruntime if it is installed, else tract";
    Parameter::choice(PARAMETER, &[AUTO, TRACT, ONNXRUNTIME], doc)
}

/// What the options stand for on this machine. If ONNX Runtime cannot be used, its options stand for nothing, and opening a network
/// on it says why. Every component with a network asks, and the machine is searched once.
fn meanings() -> &'static [(String, String)] {
    static MEANINGS: OnceLock<Vec<(String, String)>> = OnceLock::new();
    MEANINGS.get_or_init(find_meanings)
}

fn find_meanings() -> Vec<(String, String)> {
    let tract = tract::engine();
    let onnxruntime = match Search::from_environment().find() {
        Ok(Some(found)) => onnxruntime::engine(&found.path).map(Some),
        Ok(None) => Ok(None),
        Err(error) => Err(error),
    };
    let auto = match &onnxruntime {
        Ok(Some(engine)) => Some(engine.clone()),
        Ok(None) => Some(tract.clone()),
        Err(_) => None,
    };
    let options = [(TRACT, Some(tract)), (AUTO, auto), (ONNXRUNTIME, onnxruntime.ok().flatten())];
    options.into_iter().filter_map(|(option, engine)| Some((option.to_owned(), engine?))).collect()
}

/// Makes a session on an engine, by its option or by its full name.
///
/// # Errors
/// If the engine is not there or cannot run the model.
pub fn open(network: &Network<'_>, name: &str) -> Result<Box<dyn Session>> {
    let library = match name.split([' ', '/']).next() {
        Some(TRACT) => None,
        Some(ONNXRUNTIME) => Some(Search::from_environment().require()?),
        _ => Search::from_environment().find()?.map(|found| found.path),
    };
    let session: Box<dyn Session> = match library {
        None => Box::new(Tract::new(network).map_err(|error| error.at(tract::name()))?),
        Some(path) => {
            let runtime = onnxruntime::load(&path)?;
            let session = OnnxRuntime::new(network, runtime.clone());
            Box::new(session.map_err(|error| error.at(runtime.name()))?)
        }
    };
    if name.contains('/') && session.engine() != name {
        return Err(Error::of(
            ErrorKind::Configuration,
            format!("the network has to run on {name}, and this machine has {}", session.engine()),
        ));
    }
    Ok(session)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_option_stands_for_an_engine_with_its_class() {
        let parameter = parameter();
        let tract = &parameter.stands_for[TRACT];
        assert!(tract.starts_with(tract::name()) && tract.contains('/'), "{tract}");
        let auto = parameter.stands_for.get(ONNXRUNTIME).unwrap_or(tract);
        assert_eq!(parameter.stands_for[AUTO], *auto);
        assert_eq!(parameter.default, TRACT);
    }
}
