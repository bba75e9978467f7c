//! Perturbations of the overlay family: green-screen clips laid over the frame. The user's own clips need no code: see
//! [`overlay`].

mod cache;
mod clip;
mod ffmpeg;
mod key;
mod overlay;
mod picture;
mod pictures;
mod player;
mod prepare;
mod published;
mod scale;
mod store;
#[cfg(test)]
mod tests;

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
