//! The corruptions of ImageNet-C with their own parameters, so that benchmarks of robustness have the same protocol: level 0 is
//! severity 1, and level 4 is severity 5.
//!
//! Hendrycks and Dietterich, "Benchmarking neural network robustness to common corruptions and perturbations" (2019), for images of
//! any size as in Michaelis et al., "Benchmarking robustness in object detection" (2019). Parameters are those of the package
//! imagecorruptions, whose outputs these are compared with; fractions of grey levels are dropped, as there.
//!
//! Each corruption has a file of its own. What some of them share:
//!
//! | module | what |
//! |---|---|
//! | [`gaussian`] | weights that smooth |
//! | [`line`] | copies along a line, for motion blur and snow |
//! | [`enlarge`] | the enlarged middle of an image, for zoom blur and snow |
//! | [`chamfer`] | edges and distances from them, for spatter |
//! | [`simd`] | compiling a function for several sets of instructions |
//! | [`suite`] | what their descriptions share |

mod chamfer;
mod enlarge;
mod gaussian;
mod imagenet_c_brightness;
mod imagenet_c_contrast;
mod imagenet_c_defocus_blur;
mod imagenet_c_elastic_transform;
mod imagenet_c_fog;
mod imagenet_c_frost;
mod imagenet_c_gaussian_blur;
mod imagenet_c_gaussian_noise;
mod imagenet_c_glass_blur;
mod imagenet_c_impulse_noise;
mod imagenet_c_jpeg_compression;
mod imagenet_c_motion_blur;
mod imagenet_c_pixelate;
mod imagenet_c_saturate;
mod imagenet_c_shot_noise;
mod imagenet_c_snow;
mod imagenet_c_spatter;
mod imagenet_c_speckle_noise;
mod imagenet_c_zoom_blur;
mod line;
mod simd;
mod suite;

#[cfg(test)]
#[path = "../../allocations.rs"]
mod allocations;
#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;
#[cfg(test)]
mod testing;

pdk_sdk::export! {
    perturbations: [
        imagenet_c_brightness::Brightness,
        imagenet_c_contrast::Contrast,
        imagenet_c_defocus_blur::DefocusBlur,
        imagenet_c_elastic_transform::ElasticTransform,
        imagenet_c_fog::Fog,
        imagenet_c_frost::Frost,
        imagenet_c_gaussian_blur::GaussianBlur,
        imagenet_c_gaussian_noise::GaussianNoise,
        imagenet_c_glass_blur::GlassBlur,
        imagenet_c_impulse_noise::ImpulseNoise,
        imagenet_c_jpeg_compression::JpegCompression,
        imagenet_c_motion_blur::MotionBlur,
        imagenet_c_pixelate::Pixelate,
        imagenet_c_saturate::Saturate,
        imagenet_c_shot_noise::ShotNoise,
        imagenet_c_snow::Snow,
        imagenet_c_spatter::Spatter,
        imagenet_c_speckle_noise::SpeckleNoise,
        imagenet_c_zoom_blur::ZoomBlur,
    ]
}
