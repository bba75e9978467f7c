//! Components that run a neural network.
//!
//! A model is an ONNX file. [`model_file`] reads what the file declares, joins it with its description, and refuses what is not a
//! driving model, the same way whichever engine runs it later. The crate `pdk-network` knows descriptions: it turns frames into the
//! numbers that the model expects, and outputs into a control. [`engine`] chooses who runs the model: [`executor`], which that is part of this plugin, or
//! [`onnxruntime`], a shared library that [`locate`] finds on the machine. Each [`driver`] puts it all together.
//! [`backward`] has the gradient of the steering with respect to a frame, along which an [`attack`] goes. [`saliency`] shows what a network looks at. Each [`perturbation`] and [`mask`] runs a network that makes of an image another
//! [`picture`].

mod backward;
mod engine;
mod executor;
mod locate;
mod model_file;
mod onnxruntime;
mod picture;
mod processor;
mod session;

#[cfg(test)]
mod attack_tests;
#[cfg(test)]
mod fixture;
#[cfg(test)]
mod gradient_tests;
#[cfg(test)]
mod saliency_tests;
#[cfg(test)]
mod sanity_tests;

mod attack {
    //! What attacks on a network have in common: the pictures of [`artwork`], the [`network`], the [`goal`] of its steering, the [`ball`] of changes that are allowed,
    //! [`descent`] along the gradient, and the [`expectation`] over what happens to a frame afterwards.

    pub mod artwork;
    pub mod ball;
    pub mod descent;
    pub mod expectation;
    pub mod goal;
    pub mod network;
}

mod driver {
    //! The drivers: [`onnx`] runs a network in a file, the others those that are part of this plugin: [`built_in`] has them by name, and
    //! [`trained`] what they share.

    pub mod built_in;
    pub mod dave2;
    pub mod dave2_augmented;
    pub mod dave2_hardened;
    pub mod dave2_quantised;
    pub mod dave2_temporal;
    pub mod dave2_tub;
    pub mod onnx;
    pub mod trained;
    pub mod transformer;
    pub mod waypoint_planner;
}

mod perturbation {
    //! The perturbations: [`repaint`] runs a network in a file that paints, others those that are part of this plugin ([`painter`]). [`fgsm`], [`pgd`] and
    //! [`square_attack`] change frames so that a network steers elsewhere; [`universal_perturbation`] and [`adversarial_patch`] show pictures that were trained to do that.

    pub mod adversarial_patch;
    pub mod artistic;
    pub mod fgsm;
    pub mod night;
    pub mod painter;
    pub mod pgd;
    pub mod rainy;
    pub mod repaint;
    pub mod square_attack;
    pub mod universal_perturbation;
}

mod mask {
    //! Masks.

    pub mod segmentation;
}

mod predictor {
    //! The predictors: [`network`] gives all outputs of a network in a file.

    pub mod network;
}

mod saliency {
    //! Saliency methods: which pixels a network looks at when it steers.
    //!
    //! [`viewer`] opens the model and prepares frames as the driver does. [`derived`] runs graphs that are built from the
    //! model's. A method makes a [`grid`] of cells, which has a sign and is laid over the frame by where the cells look; of recorded frames it
    //! is [`kept`]. Methods by gradients are in [`cam`], [`gradient`] and [`along`]; [`eigen_cam`], [`score_cam`], [`rise`] and [`occlusion`] need none,
    //! so that they work with operators whose gradient is not known.

    pub mod along;
    pub mod cam;
    pub mod derived;
    pub mod eigen_cam;
    pub mod expected_gradients;
    pub mod grad_cam;
    pub mod grad_cam_plus_plus;
    pub mod grad_cam_published;
    pub mod gradient;
    pub mod grid;
    pub mod hirescam;
    pub mod integrated_gradients;
    pub mod kept;
    pub mod method;
    pub mod occlusion;
    pub mod rise;
    pub mod score_cam;
    pub mod smooth_grad;
    pub mod viewer;
}

/// Reads a model, prepares it and runs it once: what fuzzing tries.
///
/// # Errors
/// If it cannot be read, prepared or run.
#[doc(hidden)]
pub fn try_model(path: &std::path::Path) -> pdk_sdk::error::Result<()> {
    let model = model_file::ModelFile::read(
        model_file::Source::File(path.to_owned()),
        pdk_network::Given::default(),
    )?;
    model.try_out(&mut executor::Executor::new(&model.network())?, 1.0).map(|_| ())
}

pdk_sdk::export! {
    drivers: [
        driver::onnx::Onnx,
        driver::dave2::Dave2,
        driver::dave2_augmented::Dave2Augmented,
        driver::dave2_hardened::Dave2Hardened,
        driver::dave2_quantised::Dave2Quantised,
        driver::dave2_temporal::Dave2Temporal,
        driver::dave2_tub::Dave2Tub,
        driver::transformer::Transformer,
        driver::waypoint_planner::WaypointPlanner,
    ],
    perturbations: [
        perturbation::repaint::Repaint,
        perturbation::night::Night,
        perturbation::rainy::Rainy,
        perturbation::artistic::Artistic,
        perturbation::fgsm::Fgsm,
        perturbation::pgd::Pgd,
        perturbation::square_attack::SquareAttack,
        perturbation::universal_perturbation::UniversalPerturbation,
        perturbation::adversarial_patch::AdversarialPatch,
    ],
    masks: [mask::segmentation::Segmentation],
    predictors: [predictor::network::Network],
    saliencies: [
        saliency::grad_cam::GradCam,
        saliency::grad_cam_plus_plus::GradCamPlusPlus,
        saliency::hirescam::HiResCam,
        saliency::grad_cam_published::PublishedGradCam,
        saliency::gradient::Gradient,
        saliency::smooth_grad::SmoothGrad,
        saliency::integrated_gradients::IntegratedGradients,
        saliency::expected_gradients::ExpectedGradients,
        saliency::eigen_cam::EigenCam,
        saliency::score_cam::ScoreCam,
        saliency::rise::Rise,
        saliency::occlusion::Occlusion,
    ],
}
