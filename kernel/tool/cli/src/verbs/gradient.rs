//! `pdk gradient`: the exact gradient of a network, as a network.

use std::path::{Path, PathBuf};

use pdk_network::{Given, waypoints};
use pdk_notice::println;
use pdk_onnx::objective::{self, Objective};
use pdk_onnx::proto::ModelProto;
use pdk_onnx::tensor::shape_text;
use pdk_onnx::{Graph, model};
use pdk_sdk::error::{Place, Result};
use pdk_terminal::table::table;
use serde_json::json;

use super::perturb::check_output;
use super::{Global, print_json};

/// Arguments of `pdk gradient`
#[derive(clap::Args)]
#[command(after_help = help())]
pub struct Arguments {
    /// The network, an ONNX file
    #[arg(value_name = "MODEL.onnx")]
    model: PathBuf,
    /// The file for the network that computes the number and its gradients
    #[arg(short, long = "out", alias = "output", value_name = "FILE.onnx")]
    output: PathBuf,
    /// What the gradient is taken of [default: the only number that the network computes]
    #[arg(long, value_name = "OBJECTIVE")]
    of: Option<String>,
    /// What it is taken with respect to: an input, a value, a layer, a weight, or `weights` for all of them; may be given several times [default:
    /// all inputs of floats]
    #[arg(long = "by", value_name = "NAME")]
    by: Vec<String>,
}

fn help() -> String {
    format!(
        "An OBJECTIVE is one of these terms, or several that are joined by ` + ` and ` - `, each with a factor before ` * ` if need be:\n{}\n\
         A target becomes an input of the network that is written.",
        objective::help()
    )
}

/// Reads a network; one that plans waypoints comes with its controller, if the file beside it describes it.
fn read(path: &Path) -> Result<ModelProto> {
    let mut model = model::read(path)?;
    waypoints::follow(&mut model, &mut Given::beside(path)?)?;
    Ok(model)
}

/// Writes the network.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Arguments { model, output, of, by } = arguments;
    check_output(model, output)?;
    let place = format!("network `{}`", model.display());
    let graph = read(model).and_then(Graph::new).place(&place)?;
    let objective = match of {
        Some(text) => Objective::parse(text, &graph),
        None => Objective::only(&graph).map_err(|error| error.at("--of is missing")),
    };
    let objective = objective.place(&place)?;
    let by = objective::values(&graph, by).place(&place)?;
    let built = objective.gradients(&graph, &by).place(&place)?;
    let written = Graph::new(built.model.clone()).place(&place)?;
    let place = format!("cannot write {}", output.display());
    pdk_sdk::file::write(output, &model::encode(&built.model)).place(&place)?;
    let shape = |name: &str| written.fact(name).map(|fact| fact.shape.clone());
    if global.json {
        let inputs = written.inputs().map(|name| Ok(json!({ "name": name, "shape": shape(name)? })));
        let outputs = built.outputs.iter().map(|name| Ok(json!({ "name": name, "shape": shape(name)? })));
        return print_json(&json!({
            "objective": objective.to_string(),
            "inputs": inputs.collect::<Result<Vec<_>>>()?,
            "outputs": outputs.collect::<Result<Vec<_>>>()?,
            "file": output,
        }));
    }
    let mut rows = table(["", "name", "shape", "is"]);
    for name in written.inputs() {
        let is = if graph.inputs().any(|input| input == name) {
            "as before"
        } else {
            "what the loss compares with"
        };
        rows.add_row(["input", name, &shape_text(&shape(name)?), is]);
    }
    let named =
        [objective.to_string()].into_iter().chain(by.iter().map(|name| format!("its gradient by {name}")));
    for (name, is) in built.outputs.iter().zip(named) {
        rows.add_row(["output", name, &shape_text(&shape(name)?), &is]);
    }
    println!("{rows}\nWrote {}", output.display());
    Ok(())
}
