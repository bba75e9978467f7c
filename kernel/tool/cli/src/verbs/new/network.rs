//! `pdk new network MODEL.onnx`: the description of a network to complete, beside its file.

use std::path::Path;

use pdk_network::given::ENDINGS;
use pdk_network::outputs::Source;
use pdk_network::template::{self, Known};
use pdk_notice::println;
use pdk_sdk::error::{Error, Place, Result};

use super::super::network::{self, Reading};
use super::Arguments;

/// Writes the description.
pub fn write(arguments: &Arguments) -> Result<()> {
    let path = Path::new(&arguments.name);
    if !network::is_file(&arguments.name) {
        return Err(Error::new(format!(
            "`{}` is not an ONNX file; write `pdk new network MODEL.onnx`",
            arguments.name
        )));
    }
    if arguments.rust || arguments.from.is_some() || arguments.sdk.is_some() {
        return Err(Error::new("--rust, --sdk and --from are for components and pipelines; leave them out"));
    }
    let place = format!("network `{}`", path.display());
    let file = match &arguments.out {
        Some(folder) => folder.join(path.file_name().unwrap_or_default()),
        None => path.to_owned(),
    };
    for ending in ENDINGS {
        let there = file.with_extension(ending);
        if there.symlink_metadata().is_ok() {
            return Err(Error::new(format!(
                "{} describes the network already; edit it, or remove it first",
                there.display()
            )));
        }
    }
    let reading = Reading::of(&arguments.name).place(&place)?;
    let outputs: Vec<_> = reading
        .declared
        .outputs
        .iter()
        .enumerate()
        .map(|(place, port)| (port.name.clone(), reading.size(place)))
        .collect();
    let name = |source: &Source| {
        let output = &reading.declared.outputs[source.output].name;
        match (source.index, reading.size(source.output)) {
            (Some(index), Some(size)) if size > 1 => format!("{{ output = {output:?}, index = {index} }}"),
            _ => format!("{output:?}"),
        }
    };
    let drives = match &reading.drives {
        Ok(drives) => [
            Some(name(&drives.steering)),
            Some(drives.throttle.as_ref().map_or_else(|| drives.constant.to_string(), name)),
        ],
        Err(_) => [None, None],
    };
    let model = path.file_name().unwrap_or_default().to_string_lossy();
    let text = template::text(&Known {
        model: &model,
        plan: reading.plan.as_ref().ok(),
        reasons: &reading.reasons(),
        outputs: &outputs,
        drives,
        missing: reading.error().map(|error| error.message().to_owned()),
    });
    let file = file.with_extension(ENDINGS[0]);
    if let Some(folder) = &arguments.out {
        std::fs::create_dir_all(folder).place(format_args!("cannot make the folder {}", folder.display()))?;
    }
    pdk_sdk::file::write(&file, text.as_bytes()).place(format_args!("cannot write {}", file.display()))?;
    println!(
        "Wrote {}. Check it and uncomment what is marked ASSUMED; then see what is in force, and what the network sees:",
        file.display()
    );
    println!("  pdk show {}", path.display());
    println!("  pdk show {} --image FRAME.png -o seen.png", path.display());
    Ok(())
}
