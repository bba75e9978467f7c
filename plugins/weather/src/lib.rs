//! Perturbations of the weather family: light and what is in the air.

mod contrast;
mod fog_filter;
mod fog_mapping;
mod increase_brightness;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        contrast::Contrast,
        fog_filter::FogFilter,
        fog_mapping::FogMapping,
        increase_brightness::IncreaseBrightness,
    ]
}
