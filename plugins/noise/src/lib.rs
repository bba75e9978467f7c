//! Perturbations of the noise family: what a sensor adds.

mod gaussian_noise;
mod impulse_noise;
mod poisson_noise;
mod speckle_noise_filter;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        gaussian_noise::GaussianNoise,
        impulse_noise::ImpulseNoise,
        poisson_noise::PoissonNoise,
        speckle_noise_filter::SpeckleNoise,
    ]
}
