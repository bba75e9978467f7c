//! Perturbations of the weather family: light and what is in the air.

mod contrast;
mod distances;
mod fog_by_visibility;
mod fog_filter;
mod fog_mapping;
mod frost_filter;
mod increase_brightness;
mod rain_by_rate;
mod snow_filter;
mod texture;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        contrast::Contrast,
        fog_by_visibility::FogByVisibility,
        fog_filter::FogFilter,
        fog_mapping::FogMapping,
        frost_filter::FrostFilter,
        increase_brightness::IncreaseBrightness,
        rain_by_rate::RainByRate,
        snow_filter::SnowFilter,
    ]
}
