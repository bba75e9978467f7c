//! `pdk perturb`: perturbs one image.

use std::path::PathBuf;

use pdk::chain::{Chain, Spec};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk perturb`
#[derive(clap::Args)]
pub struct Arguments {
    /// The image
    image: PathBuf,
    /// A perturbation with its intensity from 0 to 4 and parameters; several are applied one after the other
    #[arg(long = "with", value_name = "NAME[@LEVEL][,PARAMETER=VALUE]...", required = true)]
    perturbations: Vec<String>,
    /// Where to write the result; the ending says the format
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// The seed that all random numbers come from
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The number of the frame that the image stands for
    #[arg(long, default_value_t = 0)]
    frame: u64,
    /// The simulation time that the image stands for, in seconds
    #[arg(long, default_value_t = 0.0)]
    time: f64,
}

/// The intensity where none is given: the middle of the scale.
const DEFAULT_LEVEL: f64 = 2.0;

/// Reads, perturbs and writes an image.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if !arguments.time.is_finite() {
        return Err(Error::new(format!("--time is {}, but has to be a number of seconds", arguments.time)));
    }
    let specs: Vec<Spec> =
        arguments.perturbations.iter().map(|text| Spec::parse(text, DEFAULT_LEVEL)).collect::<Result<_>>()?;
    let registry = global.registry()?;
    let mut chain = Chain::new(&registry, &specs, arguments.seed, 0)?;
    let image = pdk_image::read(&arguments.image)?;
    let mut perturbed = FrameBuf::new(image.width(), image.height());
    chain.apply(image.as_ref(), perturbed.as_mut(), arguments.frame, arguments.time)?;
    pdk_image::write(&arguments.output, perturbed.as_ref())?;
    if global.json {
        let specs = specs.iter().map(Spec::to_string).collect::<Vec<_>>();
        print_json(&json!({ "output": arguments.output, "perturbations": specs, "seed": arguments.seed }))?;
    }
    Ok(())
}
