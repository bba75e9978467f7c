//! Perturbations of the overlay family: green-screen clips laid over the frame. The user's own clips need no code: see
//! [`overlay`]. Each clip of our own has a file for the perturbation that moves and one for that which stands still; [`published`] is what
//! these share.

mod air;
mod cache;
mod clip;
mod common;
mod dynamic_lightning_filter;
mod dynamic_object_overlay;
mod dynamic_rain_filter;
mod dynamic_smoke_filter;
mod dynamic_snow_filter;
mod dynamic_sun_filter;
mod edges;
mod file;
mod frames;
#[cfg(test)]
mod fringe;
mod key;
mod overlay;
mod picture;
mod pictures;
mod place;
mod player;
mod prepare;
#[cfg(test)]
mod processes;
mod published;
#[cfg(test)]
mod refused;
mod scale;
#[cfg(test)]
mod stand_in;
mod static_lightning_filter;
mod static_object_overlay;
mod static_rain_filter;
mod static_smoke_filter;
mod static_snow_filter;
mod static_sun_filter;
mod store;
#[cfg(test)]
mod tests;
mod turn;

pdk_sdk::export! {
    perturbations: [
        overlay::Overlay,
        dynamic_rain_filter::DynamicRain,
        dynamic_snow_filter::DynamicSnow,
        dynamic_smoke_filter::DynamicSmoke,
        dynamic_object_overlay::DynamicObject,
        dynamic_sun_filter::DynamicSun,
        dynamic_lightning_filter::DynamicLightning,
        static_rain_filter::StaticRain,
        static_snow_filter::StaticSnow,
        static_smoke_filter::StaticSmoke,
        static_object_overlay::StaticObject,
        static_sun_filter::StaticSun,
        static_lightning_filter::StaticLightning,
    ]
}
