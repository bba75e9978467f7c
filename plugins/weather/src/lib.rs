//! Perturbations of the weather family: light and what is in the air.

mod contrast;
mod increase_brightness;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [contrast::Contrast, increase_brightness::IncreaseBrightness]
}
