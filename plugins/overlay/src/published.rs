//! The published overlays with clips of our own, moving and standing still.

use pdk_sdk::prelude::*;

use crate::clip::Clip;
use crate::overlay::opacity;
use crate::player::{Loop, Motion, Player};
use crate::prepare::Settings;
use crate::scale::Fit;

macro_rules! clip {
    ($name:literal) => {
        Clip::BuiltIn($name, include_bytes!(concat!("../../../scripts/overlays/", $name, ".mp4")))
    };
}

/// Goes before the name of one of these clips where the user may give a path.
pub const PREFIX: &str = "built-in:";

/// A clip by name.
///
/// # Errors
/// Where there is no such clip, with those that there are.
pub fn clip(name: &str) -> Result<Clip> {
    let clips =
        [clip!("rain"), clip!("snow"), clip!("smoke"), clip!("birds"), clip!("sun"), clip!("lightning")];
    let found = clips.into_iter().find(|clip| matches!(clip, Clip::BuiltIn(own, _) if *own == name));
    found.ok_or_else(|| {
        Error::new(format!(
            "there is no clip `{PREFIX}{name}`; there are rain, snow, smoke, birds, sun and lightning"
        ))
    })
}

/// Defines the two perturbations of a clip.
macro_rules! overlays {
    ($($clip:literal: $moving:ident $moving_name:literal, $still:ident $still_name:literal, $what:literal $(, $not_default:ident)?;)*) => {
        $(
            #[doc = concat!("Lays moving ", $what, " over the frame.")]
            pub struct $moving(Player);

            impl Component for $moving {
                fn description() -> Description {
                    Description::perturbation($moving_name, concat!("Lays ", $what, " over the frame, moving in simulation time"))
                        .family("overlay")
                        .dynamic()
                        .source("A loop over a green screen, drawn by this project; where it starts is drawn once per sequence")
                        .parameter(opacity())
                }

                fn new(_config: &Config) -> Result<Self> {
                    // The clips' last frames lead to their first ones.
                    let motion = Motion::Runs { end: Loop::Repeat, rate: None };
                    Ok(Self(Player::new(clip!($clip), settings(), motion)?))
                }
            }

            impl Perturbation for $moving {
                fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
                    self.0.apply(src, dst, cx)
                }
            }

            #[doc = concat!("Lays ", $what, " that stand still over the frame.")]
            pub struct $still(Player);

            impl Component for $still {
                fn description() -> Description {
                    Description::perturbation($still_name, concat!("Lays ", $what, " over the frame, standing still"))
                        .family("overlay")
                        .source("One frame of a clip drawn by this project, chosen once per sequence among the fuller ones")
                        .parameter(opacity())
                        $(.$not_default())?
                }

                fn new(_config: &Config) -> Result<Self> {
                    Ok(Self(Player::new(clip!($clip), settings(), Motion::Stands)?))
                }
            }

            impl Perturbation for $still {
                fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
                    self.0.apply(src, dst, cx)
                }
            }
        )*
    };
}

overlays! {
    "rain": DynamicRain "dynamic_rain_filter", StaticRain "static_rain_filter", "streaks of rain";
    "snow": DynamicSnow "dynamic_snow_filter", StaticSnow "static_snow_filter", "flakes of snow";
    "smoke": DynamicSmoke "dynamic_smoke_filter", StaticSmoke "static_smoke_filter", "swathes of smoke", not_default;
    "birds": DynamicObject "dynamic_object_overlay", StaticObject "static_object_overlay", "birds in flight";
    "sun": DynamicSun "dynamic_sun_filter", StaticSun "static_sun_filter", "glare of a low sun";
    "lightning": DynamicLightning "dynamic_lightning_filter", StaticLightning "static_lightning_filter", "bolts of lightning";
}

/// The screen of all clips of our own; smoke hides too much of it to have it searched for.
const SCREEN: [u8; 3] = [0, 219, 26];

fn settings() -> Settings {
    Settings { key: Some(SCREEN), fit: Fit::Cover, seconds: 60.0 }
}
