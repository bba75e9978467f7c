//! Perturbations of the lens family: rain and snow that stick to the glass in front of the camera and move over it, mist and a film of water
//! on it, and stray light in it.
//!
//! What sits on the lens at some time follows from the key and that time alone. Particles are born in cells, one for
//! each column of the lens and each second, with a stream of random numbers of its own ([`births`]); each has a
//! bounded life, and its path is a function of time. So a frame in the middle of a recording needs the births of the
//! last half minute and nothing else, and comes out the same whether or not the frames before it were computed.
//!
//! All lengths are in heights of the frame ([`lens`]), so that the effect looks the same at any resolution. Each
//! particle has a rank; it exists while its rank is below the density that the intensity asks for. A higher intensity
//! therefore adds particles and enlarges them without moving the others: paths and speeds are drawn at birth and do not
//! depend on the intensity. So an intensity that changes over time makes nothing jump or run back. What it adds has been
//! there for as long as it would have been under that intensity all along, and with a drop that runs the track behind it
//! appears and vanishes.

mod births;
mod condensation;
mod flakes;
mod focus;
mod lens;
mod lens_flare;
mod rain;
mod raindrops_on_lens;
mod sliders;
mod snow_cover;
mod snow_on_lens;
mod sweep;
mod water;
mod water_film;

#[cfg(test)]
#[path = "../../allocations.rs"]
mod allocations;
#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;
#[cfg(test)]
mod pictures;
#[cfg(test)]
mod tests;

pdk_sdk::export! {
    perturbations: [
        condensation::Condensation,
        lens_flare::LensFlare,
        raindrops_on_lens::RaindropsOnLens,
        snow_on_lens::SnowOnLens,
        water_film::WaterFilm,
    ]
}
