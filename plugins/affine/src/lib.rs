//! Perturbations of the affine family: the camera sits elsewhere or looks elsewhere.

mod reflection_filter;
mod rotate_image;
mod scale_image;
mod shear_image;
mod translate_image;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        reflection_filter::ReflectionFilter,
        rotate_image::RotateImage,
        scale_image::ScaleImage,
        shear_image::ShearImage,
        translate_image::TranslateImage,
    ]
}
