//! The published overlays with clips of our own, moving and standing still.

use pdk_sdk::prelude::*;

use crate::clip::Clip;
use crate::common::{fit, fit_of, motion_of, with_common, with_motion};
use crate::player::{Motion, Player};
use crate::prepare::Settings;

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

/// Where the clips come from.
const SOURCE: &str = "A loop over a green screen, drawn by this project";
/// What differs in all of them.
const OWN_CLIP: &str = "The clip is a drawing of this project's instead of the published recording.";

/// Defines the two perturbations of a clip; the literals are their names, what they show, and how long and how often it
/// does; then their versions.
macro_rules! overlays {
    ($($clip:literal: $moving:ident $moving_name:literal, $still:ident $still_name:literal, $what:literal, $loop:literal,
       $version:literal $still_version:literal $(, $not_default:ident)?;)*) => {
        $(
            #[doc = concat!("Lays moving ", $what, " over the frame.")]
            pub struct $moving(Player);

            impl Component for $moving {
                fn description() -> Description {
                    let doc = concat!("Lays ", $what, " over the frame, moving in simulation time in ", $loop);
                    let description =
                        Description::perturbation($moving_name, doc).version($version).source(SOURCE).divergence(OWN_CLIP);
                    // The clips' last frames lead to their first ones.
                    with_motion(with_common(description), ["repeat", "cross-fade", "ping-pong"])
                }

                fn new(config: &Config) -> Result<Self> {
                    Ok(Self(Player::new(clip!($clip), settings(config), motion_of(config))?))
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
                    let doc = concat!("Lays ", $what, " over the frame, standing still");
                    let description =
                        Description::perturbation($still_name, doc).version($still_version).source(SOURCE).divergence(OWN_CLIP);
                    with_common(description)
                        .drawn_per_sequence(
                            "which frame of the clip is shown, of those that cover at least a third as much as the fullest",
                        )
                        .parameter(fit())
                        $(.$not_default())?
                }

                fn new(config: &Config) -> Result<Self> {
                    Ok(Self(Player::new(clip!($clip), settings(config), Motion::Stands)?))
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
    "rain": DynamicRain "dynamic_rain_filter", StaticRain "static_rain_filter", "streaks of rain",
        "a loop of 3 s", 2 1;
    "snow": DynamicSnow "dynamic_snow_filter", StaticSnow "static_snow_filter", "flakes of snow",
        "a loop of 4 s", 2 1;
    "smoke": DynamicSmoke "dynamic_smoke_filter", StaticSmoke "static_smoke_filter", "swathes of smoke",
        "a loop of 4 s", 2 1, not_default;
    "birds": DynamicObject "dynamic_object_overlay", StaticObject "static_object_overlay", "birds in flight",
        "a loop of 4 s", 2 1;
    "sun": DynamicSun "dynamic_sun_filter", StaticSun "static_sun_filter", "glare of a low sun",
        "a loop of 4 s", 2 1;
    "lightning": DynamicLightning "dynamic_lightning_filter", StaticLightning "static_lightning_filter", "bolts of lightning",
        "a loop of 10 s, in 40 % of which one shows; otherwise the frame stays as it is", 3 2;
}

/// The screen of all clips of our own; smoke hides too much of it to have it searched for.
const SCREEN: [u8; 3] = [0, 219, 26];

fn settings(config: &Config) -> Settings {
    Settings { key: Some(SCREEN), fit: fit_of(config), seconds: 60.0 }
}
