//! Components that run a neural network.
//!
//! A model is an ONNX file. [`model_file`] reads what the file declares and refuses what is no driving model, the same
//! way whichever engine runs it later. [`engine`] chooses who runs it: [`tract`], which is part of this plugin, or
//! [`onnxruntime`], a shared library that [`locate`] finds on the machine. [`pixels`] turns frames into the numbers that
//! the model expects, [`selection`] says which of its outputs steer, and [`driver`] puts it all together. [`trained`] holds the
//! drivers that are part of the plugin. [`saliency`] shows what a network looks at. [`repaint`] and [`segmentation`] run networks
//! that make of an image another [`picture`], and [`painters`] holds those that are part of the plugin.

mod driver;
mod engine;
mod locate;
mod mathematics;
mod model_file;
mod onnxruntime;
mod painters;
mod picture;
mod pixels;
mod processor;
mod repaint;
mod saliency;
mod segmentation;
mod selection;
mod session;
mod tract;
mod trained;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod gradient_tests;

/// Reads a model, prepares it and runs it once: what fuzzing tries.
///
/// # Errors
/// Where it cannot be read, prepared or run.
#[doc(hidden)]
pub fn try_model(path: &std::path::Path) -> pdk_sdk::error::Result<()> {
    let model = model_file::ModelFile::read(model_file::Source::File(path.to_owned()), "auto")?;
    model.try_out(&mut tract::Tract::new(&model.network())?, 1.0).map(|_| ())
}

pdk_sdk::export! {
    drivers: [
        driver::Onnx,
        trained::Dave2,
        trained::Dave2Augmented,
        trained::Dave2Temporal,
        trained::Dave2Tub,
    ],
    perturbations: [repaint::Repaint, painters::Night, painters::Rainy, painters::Artistic],
    masks: [segmentation::Segmentation],
    saliencies: [
        saliency::GradCam,
        saliency::GradCamPlusPlus,
        saliency::HiResCam,
        saliency::PublishedGradCam,
        saliency::Gradient,
        saliency::SmoothGrad,
        saliency::EigenCam,
        saliency::ScoreCam,
        saliency::Rise,
        saliency::Occlusion,
    ],
}
