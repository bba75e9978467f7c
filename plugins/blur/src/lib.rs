//! Perturbations of the blur family: what a lens or a moving camera takes away.

mod defocus_blur;
mod gaussian_blur;
mod glass_blur;
mod low_pass_filter;
mod motion_blur;
mod zoom_blur;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        defocus_blur::DefocusBlur,
        gaussian_blur::GaussianBlur,
        glass_blur::GlassBlur,
        low_pass_filter::LowPassFilter,
        motion_blur::MotionBlur,
        zoom_blur::ZoomBlur,
    ]
}
