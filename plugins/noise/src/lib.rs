//! Perturbations of the noise family: what a sensor adds.

mod gaussian_noise;
mod impulse_noise;
mod jpeg_filter;
mod poisson_noise;
mod speckle_noise_filter;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        gaussian_noise::GaussianNoise,
        impulse_noise::ImpulseNoise,
        jpeg_filter::JpegFilter,
        poisson_noise::PoissonNoise,
        speckle_noise_filter::SpeckleNoise,
    ]
}
