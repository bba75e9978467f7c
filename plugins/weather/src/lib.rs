//! Perturbations of the weather family: light and what is in the air.

mod contrast;
mod fog_filter;
mod fog_mapping;
mod frost_filter;
mod increase_brightness;
mod snow_filter;
mod texture;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        contrast::Contrast,
        fog_filter::FogFilter,
        fog_mapping::FogMapping,
        frost_filter::FrostFilter,
        increase_brightness::IncreaseBrightness,
        snow_filter::SnowFilter,
    ]
}
