//! Perturbations of the weather family: light and what is in the air.

mod contrast;
mod distances;
mod falling;
mod fog_by_visibility;
mod fog_filter;
mod fog_mapping;
mod frost_filter;
mod increase_brightness;
mod night_by_illuminance;
mod patches;
mod rain_by_rate;
mod snow_by_rate;
mod snow_filter;
mod texture;
mod wet_road;

#[cfg(test)]
#[path = "../../allocations.rs"]
mod allocations;
#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;
#[cfg(test)]
mod test_frames;

pdk_sdk::export! {
    perturbations: [
        contrast::Contrast,
        fog_by_visibility::FogByVisibility,
        fog_filter::FogFilter,
        fog_mapping::FogMapping,
        frost_filter::FrostFilter,
        increase_brightness::IncreaseBrightness,
        night_by_illuminance::NightByIlluminance,
        rain_by_rate::RainByRate,
        snow_by_rate::SnowByRate,
        snow_filter::SnowFilter,
        wet_road::WetRoad,
    ]
}
