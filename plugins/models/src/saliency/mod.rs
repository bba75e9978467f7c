//! Saliency methods: which pixels a network looks at when it steers.
//!
//! [`viewer`] opens the model and prepares frames as the driver does. [`derived`] runs graphs that are built from the
//! model's. A method makes a [`grid`] of cells, which has a sign and is laid over the frame by where the cells look; of recorded frames it is [`kept`]. Methods
//! by gradients are in [`cam`] and [`gradient`]; [`eigen_cam`], [`score_cam`], [`rise`] and [`occlusion`] need none, so that
//! they work with operators whose gradient is not known.

mod cam;
mod derived;
mod eigen_cam;
mod grad_cam;
mod grad_cam_plus_plus;
mod grad_cam_published;
mod gradient;
mod grid;
mod hirescam;
mod kept;
mod method;
mod occlusion;
mod rise;
mod score_cam;
mod smooth_grad;
mod viewer;

pub use eigen_cam::EigenCam;
pub use grad_cam::GradCam;
pub use grad_cam_plus_plus::GradCamPlusPlus;
pub use grad_cam_published::PublishedGradCam;
pub use gradient::Gradient;
pub use hirescam::HiResCam;
pub use occlusion::Occlusion;
pub use rise::Rise;
pub use score_cam::ScoreCam;
pub use smooth_grad::SmoothGrad;

#[cfg(test)]
mod tests;
