//! Who runs a network: the engines of this machine, and how one is opened.
//!
//! What a network computes depends in its last digits on who runs it, on which version, and on the instructions that this takes from
//! the processor. These three together are an *engine*, such as
//! `onnxruntime 1.24.1/x86-64-v3`. The executor of pdk computes the same on every processor: `pdk 1`. A scenario names the engine, so that its
//! outcome does not depend on the machine: one that does not have the engine refuses the scenario.

use std::sync::OnceLock;

use pdk_sdk::prelude::*;

use crate::executor::{self, Executor};
use crate::locate::Search;
use crate::onnxruntime::{self, OnnxRuntime};
use crate::session::{Network, Session};

/// The name of the parameter.
pub use pdk_sdk::model::component::ENGINE as PARAMETER;

const PDK: &str = "pdk";
const ONNXRUNTIME: &str = "onnxruntime";
const AUTO: &str = "auto";

/// The parameter that says who runs a network whose result depends on it.
pub fn parameter() -> Parameter {
    let doc = "who runs the network: pdk computes the same on every processor; onnxruntime is ONNX Runtime, which has to be installed, \
               knows more operators, and computes as the processor lets it; auto is onnxruntime if it is installed, else pdk. A scenario \
               records the engine with its version, such as pdk 1";
    Parameter::choice(PARAMETER, &[PDK, AUTO, ONNXRUNTIME], doc).stands_for(meanings().iter().cloned())
}

/// The parameter for the engine of a network that gives the same result on each.
pub fn indifferent_parameter() -> Parameter {
    let doc = "who runs the network, which gives the same result on each engine: auto is onnxruntime if it is installed, else pdk";
    Parameter::choice(PARAMETER, &[AUTO, PDK, ONNXRUNTIME], doc)
}

/// What the options stand for on this machine. If ONNX Runtime cannot be used, its options stand for nothing, and opening a network
/// on it says why. Every component with a network asks, and the machine is searched once.
fn meanings() -> &'static [(String, String)] {
    static MEANINGS: OnceLock<Vec<(String, String)>> = OnceLock::new();
    MEANINGS.get_or_init(find_meanings)
}

fn find_meanings() -> Vec<(String, String)> {
    let pdk = executor::ENGINE.to_owned();
    let onnxruntime = match Search::from_environment().find() {
        Ok(Some(found)) => onnxruntime::engine(&found.path).map(Some),
        Ok(None) => Ok(None),
        Err(error) => Err(error),
    };
    let auto = match &onnxruntime {
        Ok(Some(engine)) => Some(engine.clone()),
        Ok(None) => Some(pdk.clone()),
        Err(_) => None,
    };
    let options = [(PDK, Some(pdk)), (AUTO, auto), (ONNXRUNTIME, onnxruntime.ok().flatten())];
    options.into_iter().filter_map(|(option, engine)| Some((option.to_owned(), engine?))).collect()
}

/// Makes a session on an engine, by its option or by its full name.
///
/// # Errors
/// If the engine is not there or cannot run the model.
pub fn open(network: &Network<'_>, name: &str) -> Result<Box<dyn Session>> {
    let library = match name.split([' ', '/']).next() {
        Some(PDK) => None,
        Some(ONNXRUNTIME) => Some(Search::from_environment().require()?),
        _ => Search::from_environment().find()?.map(|found| found.path),
    };
    let session: Box<dyn Session> = match library {
        None => Box::new(Executor::new(network).map_err(|error| error.at(executor::ENGINE))?),
        Some(path) => {
            let runtime = onnxruntime::load(&path)?;
            let session = OnnxRuntime::new(network, runtime.clone());
            Box::new(session.map_err(|error| error.at(runtime.name()))?)
        }
    };
    if name.contains(' ') && session.engine() != name {
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
    fn every_option_stands_for_an_engine_with_its_version() {
        let parameter = parameter();
        let pdk = &parameter.stands_for[PDK];
        assert_eq!(pdk, executor::ENGINE);
        let auto = parameter.stands_for.get(ONNXRUNTIME).unwrap_or(pdk);
        assert_eq!(parameter.stands_for[AUTO], *auto);
        assert_eq!(parameter.default, PDK);
    }
}
