//! Writes the graph of a gradient as a file: `gradient MODEL.onnx VALUE OUT.onnx [OUTPUT [NUMBER]]`.
//!
//! The gradient is that of one number of an output, the first if none is named, with respect to a value of the graph: an
//! input, or what any node computes. The file runs wherever the model runs.

use std::path::Path;
use std::process::ExitCode;

use pdk_onnx::{Graph, Target, gradients, model};
use pdk_sdk::error::{Error, Place, Result};

fn main() -> ExitCode {
    match run(&std::env::args().skip(1).collect::<Vec<_>>()) {
        Ok(outputs) => {
            println!("{}", outputs.join("\n"));
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

fn run(arguments: &[String]) -> Result<Vec<String>> {
    let [path, of, out, rest @ ..] = arguments else {
        return Err(Error::new("usage: gradient MODEL.onnx VALUE OUT.onnx [OUTPUT [NUMBER]]"));
    };
    let graph = Graph::new(model::read(Path::new(path))?)?;
    let value = rest
        .first()
        .or(graph.outputs().first())
        .ok_or_else(|| Error::new("the model has no output"))?
        .clone();
    let index = rest.get(1).map_or(Ok(0), |number| number.parse()).place("the number of the output")?;
    let built = gradients(&graph, Target { value: &value, index }, &[of], &[])?;
    std::fs::write(out, model::encode(&built.model)).place(out)?;
    Ok(built.outputs)
}
