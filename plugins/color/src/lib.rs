//! Perturbations of the color family: what a camera makes of colour and tone.

mod false_color_filter;
mod grayscale_filter;
mod histogram_equalisation;
mod phase_scrambling;
mod posterize_filter;
mod saturation_decrease_filter;
mod saturation_filter;
mod white_balance_filter;

#[cfg(test)]
#[path = "../../golden.rs"]
mod golden;

pdk_sdk::export! {
    perturbations: [
        false_color_filter::FalseColorFilter,
        grayscale_filter::GrayscaleFilter,
        histogram_equalisation::HistogramEqualisation,
        phase_scrambling::PhaseScrambling,
        posterize_filter::PosterizeFilter,
        saturation_decrease_filter::SaturationDecreaseFilter,
        saturation_filter::SaturationFilter,
        white_balance_filter::WhiteBalanceFilter,
    ]
}
