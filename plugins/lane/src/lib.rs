//! The embedded simulator `lane` and the classical driver `lane_keeper`: a closed loop with nothing to install.
//!
//! The world is a two-lane road through countryside, with hills where the road has heights. It is described in the same terms everywhere: `x` to the right,
//! `z` ahead, headings clockwise from `+z`, metres, seconds and radians. [`road`] turns what a scenario says into the
//! centre line of the driven lane, [`vehicle`] moves the car, [`render`] draws what its camera sees, and [`simulator`]
//! ties them together. The driver sees the image only; what it shares with the simulator is the [`camera`], which any
//! driver of a real car would know too.

mod artwork;
mod autopilot;
mod blend;
mod camera;
mod conditions;
mod countryside;
mod crests;
mod damage;
mod delay;
mod driver;
mod ends;
mod field;
mod ground;
mod gusts;
mod labels;
mod light;
mod lines;
mod located;
mod parked;
mod places;
mod profile;
mod render;
mod road;
mod roadside;
mod room;
mod saved;
mod scene;
mod section;
mod sensor;
mod simd;
mod simulator;
mod sky;
mod sprite;
#[cfg(target_arch = "x86_64")]
mod strips;
mod terrain;
mod texture;
mod things;
mod vehicle;
mod view;
mod wear;
mod weathered;

#[cfg(test)]
mod condition_tests;
#[cfg(test)]
mod frame_times;
#[cfg(test)]
mod pictures;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod view_tests;

pdk_sdk::export! {
    simulators: [simulator::Lane],
    drivers: [driver::LaneKeeper],
}
