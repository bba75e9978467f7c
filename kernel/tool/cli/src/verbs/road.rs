//! `pdk road`: a road as text, in numbers and as a picture.

use std::path::PathBuf;

use pdk_model::scenario::parse_seed;
use pdk_notice::println;
use pdk_pipeline::records::ROAD_REQUEST;
use pdk_pipeline::road;
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Map, Value, json};

use super::{Global, print_json};

/// Arguments of `pdk road`; their help is that of the fields of `pdk.road`.
#[derive(clap::Args)]
pub struct Arguments {
    #[arg(long, value_name = "DEGREES", value_delimiter = ',', allow_hyphen_values = true, help = doc("angles"))]
    angles: Option<Vec<f64>>,
    /// Metres from node to node [default: 25]
    #[arg(long, value_name = "METRES")]
    segment: Option<f64>,
    /// The seed of the draws
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    #[arg(long, value_name = "DEGREES", help = doc("limit"))]
    limit: Option<u64>,
    #[arg(long, value_name = "COUNT", help = doc("turns"))]
    turns: Option<u64>,
    #[arg(long, value_name = "PER_METRE", help = doc("mean_curvature"))]
    mean_curvature: Option<f64>,
    #[arg(long, value_name = "METRES", help = doc("width"))]
    width: Option<f64>,
    /// How many roads are drawn until one is valid
    #[arg(long, value_name = "COUNT", default_value_t = 1000)]
    attempts: u64,
    /// Draw it as an SVG, one metre a unit; the name ends in .svg
    #[arg(short, long = "out", alias = "output", value_name = "FILE.svg")]
    output: Option<PathBuf>,
}

/// What the field of that name does.
fn doc(name: &str) -> &'static str {
    ROAD_REQUEST.fields.iter().find(|field| field.name == name).map_or("", |field| field.doc)
}

/// Makes the road that the arguments ask for.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Arguments { angles, segment, seed, limit, turns, mean_curvature, width, attempts, output } =
        arguments;
    let given = [
        ("angles", json!(angles)),
        ("segment", json!(segment)),
        ("limit", json!(limit)),
        ("turns", json!(turns)),
        ("mean_curvature", json!(mean_curvature)),
        ("width", json!(width)),
        // A given road has no attempts.
        ("attempts", if angles.is_some() { Value::Null } else { json!(attempts) }),
    ];
    let given = given.into_iter().filter(|(_, value)| !value.is_null());
    let request: Map<String, Value> = given.map(|(name, value)| (name.to_owned(), value)).collect();
    if let Some(path) = output
        && path.extension().is_none_or(|ending| ending != "svg")
    {
        return Err(Error::new(format!(
            "{} does not end in .svg, and roads are drawn as SVG only; name a file such as road.svg",
            path.display()
        )));
    }
    if angles.is_none() && turns.is_some() != mean_curvature.is_some() {
        return Err(Error::new("--turns and --mean-curvature belong together; give both or neither"));
    }
    let (road, lengths) = road::build(Value::Object(request), *seed)?;
    if let Some(path) = output {
        let picture = pdk_road::svg(&[&road], width.unwrap_or(pdk_road::WIDTH));
        pdk_sdk::file::write(path, picture.as_bytes())
            .place(format_args!("cannot write {}", path.display()))?;
    }
    if global.json {
        return print_json(&road::described(&road, &lengths));
    }
    let angles: Vec<String> = road.angles.iter().map(f64::to_string).collect();
    println!("angles          {} degrees", angles.join(", "));
    println!("length          {:.1} m", road.length());
    println!("turns           {}", road.turns());
    println!("mean curvature  {:.4} 1/m", road.mean_curvature());
    println!("waypoints       {}, which --json writes", road.waypoints.len());
    Ok(())
}
