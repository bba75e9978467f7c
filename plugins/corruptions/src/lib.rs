//! The corruptions of ImageNet-C with their own parameters, so that benchmarks of robustness have the same protocol: level 0 is
//! severity 1, and level 4 is severity 5.
//!
//! Hendrycks and Dietterich, "Benchmarking neural network robustness to common corruptions and perturbations" (2019), for images of
//! any size as in Michaelis et al., "Benchmarking robustness in object detection" (2019). Parameters are those of the package
//! imagecorruptions, whose outputs these are compared with; fractions of grey levels are dropped, as there. The nineteenth, frost, is in
//! the plugin of the weather family, which draws frost already.
//!
//! | module | corruptions |
//! |---|---|
//! | [`noise`] | gaussian_noise, shot_noise, impulse_noise, speckle_noise |
//! | [`blur`] | gaussian_blur, defocus_blur, glass_blur, motion_blur |
//! | [`zoom`] | zoom_blur, and the enlargement that snow shares |
//! | [`fog`], [`snow`], [`spatter`] | those |
//! | [`color`] | brightness, contrast, saturate |
//! | [`digital`] | elastic_transform, pixelate, jpeg_compression |
//! | [`chamfer`] | edges and distances from them, for spatter |
//! | [`suite`] | what their descriptions share |

mod blur;
mod chamfer;
mod color;
mod digital;
mod fog;
mod noise;
mod snow;
mod spatter;
mod suite;
#[cfg(test)]
mod testing;
mod zoom;

pdk_sdk::export! {
    perturbations: [
        blur::DefocusBlur,
        blur::GaussianBlur,
        blur::GlassBlur,
        blur::MotionBlur,
        color::Brightness,
        color::Contrast,
        color::Saturate,
        digital::ElasticTransform,
        digital::JpegCompression,
        digital::Pixelate,
        fog::Fog,
        noise::GaussianNoise,
        noise::ImpulseNoise,
        noise::ShotNoise,
        noise::SpeckleNoise,
        snow::Snow,
        spatter::Spatter,
        zoom::ZoomBlur,
    ]
}
