//! Perturbations of the color family: what a camera makes of colour and tone.

mod grayscale_filter;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [grayscale_filter::GrayscaleFilter]
}
