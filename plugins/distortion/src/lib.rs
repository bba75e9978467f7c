//! Perturbations of the distortion family: the picture is bent, coarsened or over-processed.

mod elastic;
mod high_pass_filter;
mod pixelate;
mod sample_pairing_filter;
mod sharpen_filter;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        elastic::Elastic,
        high_pass_filter::HighPassFilter,
        pixelate::Pixelate,
        sample_pairing_filter::SamplePairingFilter,
        sharpen_filter::SharpenFilter,
    ]
}
