//! Images: each as if it were the only one, with the number of its frame.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::FrameBuf;
use serde_json::json;

use super::{Arguments, STANDARD, check_output, warn};
use crate::verbs::saliency::frames::IMAGES;
use crate::verbs::{Global, print_json};

/// The format on standard output.
const STREAMED: &str = "image.png";

/// Where the result for each image goes: to the output itself, or into it under the image's name if there are several, it is a folder, or it ends in a
/// slash.
///
/// # Errors
/// If two have the same name, one has none, an input is not one image, or a result would replace an image.
pub fn outputs(inputs: &[PathBuf], output: &Path) -> Result<Vec<PathBuf>> {
    let streamed = |path: &Path| path.as_os_str() == STANDARD;
    inputs.iter().filter(|input| !streamed(input)).try_for_each(|input| check_input(input))?;
    let is_folder = output.is_dir() || output.as_os_str().as_encoded_bytes().ends_with(b"/");
    if let [_] = inputs
        && !is_folder
    {
        return Ok(vec![output.to_owned()]);
    }
    let refused = |why: &str| {
        let count = inputs.len();
        Err(Error::new(format!(
            "there are {count} images, but `{}` {why}; name a folder with -o",
            output.display()
        )))
    };
    if streamed(output) {
        return refused("is standard output, which takes one");
    }
    if output.is_file() {
        return refused("is a file");
    }
    let ending = output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    if !is_folder && IMAGES.contains(&ending.as_str()) {
        return refused("is the name of one image");
    }
    let mut from: HashMap<&std::ffi::OsStr, &Path> = HashMap::new();
    let mut outputs = Vec::new();
    for input in inputs {
        let name = input.file_name().filter(|_| !streamed(input)).ok_or_else(|| {
            Error::new(format!(
                "`{}` has no name for its result in the folder `{}`; name a file with -o",
                input.display(),
                output.display()
            ))
        })?;
        if let Some(other) = from.insert(name, input) {
            return Err(Error::new(format!(
                "`{}` and `{}` have the same name, so one result would replace the other; give them folders of their own, one after the other",
                other.display(),
                input.display()
            )));
        }
        let result = output.join(name);
        check_output(input, &result)?;
        outputs.push(result);
    }
    Ok(outputs)
}

/// Refuses what is perturbed in another way, before anything is written.
fn check_input(input: &Path) -> Result<()> {
    let shown = input.display();
    if input.is_dir() {
        return Err(Error::new(format!(
            "`{shown}` is a folder; name the images in it, such as {shown}/*.jpg, or perturb a whole dataset with `pdk corrupt`"
        )));
    }
    match super::container(input) {
        Ok(Some(_)) => Err(Error::new(format!(
            "`{shown}` is a video, which has to be given alone, with a result that ends in .mp4"
        ))),
        // What cannot be read is reported when it is read.
        _ => Ok(()),
    }
}

/// Perturbs each image.
///
/// # Errors
/// If one cannot be read or written, or a perturbation fails.
pub fn perturb(
    global: &Global,
    arguments: &Arguments,
    outputs: &[PathBuf],
    specs: &[AppliedPerturbation],
    mut chain: Chain,
) -> Result<()> {
    let several = outputs.len() > 1;
    let progress = pdk_terminal::progress(global.json || !several, "{pos}/{len} images, {eta} left");
    progress.set_length(outputs.len() as u64);
    let mut perturbed = FrameBuf::default();
    for (number, (input, output)) in (0..).zip(arguments.inputs.iter().zip(outputs)) {
        let image = read(input)?;
        perturbed.resize(image.width(), image.height());
        let moment = Moment::new(arguments.frame.saturating_add(number), arguments.time).alone();
        chain.apply(image.as_ref(), perturbed.as_mut(), &moment).map_err(|error| match several {
            true => error.at(format_args!("image `{}`", input.display())),
            false => error,
        })?;
        write(output, &perturbed)?;
        progress.inc(1);
    }
    progress.finish_and_clear();
    warn(&chain);
    if global.json {
        let specs = specs.iter().map(AppliedPerturbation::to_string).collect::<Vec<_>>();
        print_json(&json!({ "outputs": outputs, "perturbations": specs, "seed": arguments.seed }))?;
    }
    Ok(())
}

fn read(input: &Path) -> Result<FrameBuf> {
    if input.as_os_str() != STANDARD {
        return pdk_image::read(input);
    }
    pdk_image::read_from(std::io::stdin().lock()).map_err(|error| error.at("standard input"))
}

fn write(output: &Path, image: &FrameBuf) -> Result<()> {
    if output.as_os_str() != STANDARD {
        return pdk_image::write(output, image.as_ref());
    }
    // The quality is one of JPEG.
    let bytes = pdk_image::encode(Path::new(STREAMED), image.as_ref(), 100)?;
    pdk_notice::bytes(&bytes);
    Ok(())
}
