//! Perturbations of the camera family: faults of the sensor, of its exposure and of its balance.

mod defective_pixels;
mod exposure_hunting;
mod flicker;
mod rolling_shutter;
mod sensor_noise;
mod stuck_white_balance;

#[cfg(test)]
#[path = "../../allocations.rs"]
mod allocations;
#[cfg(test)]
mod test_frames;

pdk_sdk::export! {
    perturbations: [
        defective_pixels::DefectivePixels,
        exposure_hunting::ExposureHunting,
        flicker::Flicker,
        rolling_shutter::RollingShutter,
        sensor_noise::SensorNoise,
        stuck_white_balance::StuckWhiteBalance,
    ]
}
