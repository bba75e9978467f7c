//! Perturbations of the camera family: faults of the sensor, of its exposure and of its balance.

mod defective_pixels;
mod exposure_hunting;
mod flicker;
mod rolling_shutter;
mod stuck_white_balance;

#[cfg(test)]
mod test_frames;

pdk_sdk::export! {
    perturbations: [
        defective_pixels::DefectivePixels,
        exposure_hunting::ExposureHunting,
        flicker::Flicker,
        rolling_shutter::RollingShutter,
        stuck_white_balance::StuckWhiteBalance,
    ]
}
