//! Components that run a neural network.
//!
//! A model is an ONNX file. [`model_file`] reads what the file declares and refuses what is not a driving model, the same
//! way whichever engine runs it later. [`engine`] chooses who runs it: [`tract`], which is part of this plugin, or
//! [`onnxruntime`], a shared library that [`locate`] finds on the machine. [`pixels`] turns frames into the numbers that
//! the model expects, [`selection`] says which of its outputs steer, and each [`driver`] puts it all together.
//! [`saliency`] shows what a network looks at. Each [`perturbation`] and [`mask`] runs a network that makes of an image another
//! [`picture`].

mod driver;
mod engine;
mod locate;
mod mask;
mod mathematics;
mod model_file;
mod onnxruntime;
mod perturbation;
mod picture;
mod pixels;
mod predictor;
mod processor;
mod saliency;
mod selection;
mod session;
mod tract;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod gradient_tests;

/// Reads a model, prepares it and runs it once: what fuzzing tries.
///
/// # Errors
/// If it cannot be read, prepared or run.
#[doc(hidden)]
pub fn try_model(path: &std::path::Path) -> pdk_sdk::error::Result<()> {
    let model = model_file::ModelFile::read(model_file::Source::File(path.to_owned()), "auto")?;
    model.try_out(&mut tract::Tract::new(&model.network())?, 1.0).map(|_| ())
}

pdk_sdk::export! {
    drivers: [
        driver::Onnx,
        driver::Dave2,
        driver::Dave2Augmented,
        driver::Dave2Temporal,
        driver::Dave2Tub,
    ],
    perturbations: [perturbation::Repaint, perturbation::Night, perturbation::Rainy, perturbation::Artistic],
    masks: [mask::Segmentation],
    predictors: [predictor::Network],
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
