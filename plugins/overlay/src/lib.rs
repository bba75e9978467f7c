//! Perturbations of the overlay family: green-screen clips laid over the frame. The user's own clips need no code: see
//! [`overlay`].

mod air;
mod cache;
mod clip;
mod common;
mod ffmpeg;
mod file;
mod frames;
mod key;
mod overlay;
mod picture;
mod pictures;
mod place;
mod player;
mod prepare;
mod process;
#[cfg(test)]
mod processes;
mod published;
#[cfg(test)]
mod refused;
mod scale;
#[cfg(test)]
mod stand_in;
mod store;
#[cfg(test)]
mod tests;
mod turn;

pdk_sdk::export! {
    perturbations: [
        overlay::Overlay,
        published::DynamicRain,
        published::DynamicSnow,
        published::DynamicSmoke,
        published::DynamicObject,
        published::DynamicSun,
        published::DynamicLightning,
        published::StaticRain,
        published::StaticSnow,
        published::StaticSmoke,
        published::StaticObject,
        published::StaticSun,
        published::StaticLightning,
    ]
}
