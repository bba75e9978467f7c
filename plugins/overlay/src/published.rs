//! The published overlays with clips of our own, moving and standing still.

use pdk_sdk::prelude::*;

use crate::air::{Air, Effect};
use crate::clip::Clip;
use crate::common::{fit, fit_of, motion_of, with_common, with_motion};
use crate::player::{Drive, Motion, Player};
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
/// If there is no such clip, with those that there are.
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
/// Height of the horizon in the clips that have one, from the top.
const HORIZON: f64 = 0.45;
/// Where it is in frames by default: as in those of the built-in simulator.
const FRAME_HORIZON: f64 = 0.32;
/// The vehicle's speed for which rain and snow are drawn, in metres a second.
const SPEED: f64 = 10.0;

/// What a clip shows, as far as more follows from that than its pictures.
#[derive(Clone, Copy, PartialEq)]
enum Shows {
    /// Drops or flakes that come past the vehicle; this share of their motion is there when it stands. The air is full of them, of
    /// this colour, and hides things as many metres away.
    Falling { still: f64, colour: [f64; 3], metres: f64, haze: f64 },
    /// Something in the sky.
    Sky,
    /// The sun.
    Sun,
    /// Something that may be anywhere.
    Anything,
}

const RAIN: Shows = Shows::Falling { still: 0.5, colour: [0.60, 0.62, 0.64], metres: 30.0, haze: 0.45 };
const SNOW: Shows = Shows::Falling { still: 0.15, colour: [0.76, 0.78, 0.80], metres: 20.0, haze: 0.5 };

impl Shows {
    /// The same description with what follows from it.
    fn describe(self, description: Description) -> Description {
        if self == Self::Anything {
            return description;
        }
        let mut description = description.parameter(
            Parameter::number(
                "horizon",
                FRAME_HORIZON,
                "where the horizon is in the frame, as a share of its height from the top: the clip is laid so that its own lies there, \
                 and enlarged as far as that takes; not with fit=stretch",
            )
            .range(0.0, 1.0),
        );
        if self == Self::Sun {
            description.doc += "; the sun turns with the vehicle in a bend, because a perturbation does not know the vehicle's heading";
        }
        match self {
            Self::Falling { haze, .. } => description
                .mathematics(
                    "(1 - opacity a) w + opacity c, a the clip's alpha once the screen is out, c its colour times a; \
                     w = v + opacity haze (1 - exp(-z / s)) (air - v), z the depth of the road, s the sight in metres, air a grey \
                     that is darker in proportion if the mean of the scene above the horizon is below 90",
                )
                .divergence("The air hides what is far away; the published code draws the clip alone, as `haze=0` does.")
                .parameter(
                    Parameter::number("haze", haze, "the share of the distant scene that the air hides, at an opacity of 1")
                        .range(0.0, 1.0),
                ),
            Self::Sun => description
                .mathematics(
                    "(1 - opacity a) w + opacity c, a the clip's alpha once the screen is out, c its colour times a; \
                     w = v (1 - opacity darker) + 255 opacity veil",
                )
                .divergence(
                    "The camera exposes less and its lens scatters light over the frame; the published code draws the clip alone, as \
                     `darker=0,veil=0` does.",
                )
                .parameter(
                    Parameter::number("darker", 0.35, "the share of the light that the camera takes away, at an opacity of 1")
                        .range(0.0, 1.0),
                )
                .parameter(
                    Parameter::number("veil", 0.09, "the light scattered over the frame as a share of white, at an opacity of 1")
                        .range(0.0, 1.0),
                ),
            Self::Sky | Self::Anything => description,
        }
    }

    /// How its clip is fitted to a frame with this horizon.
    fn fit(self, fit: Fit, frame: f64) -> Fit {
        match fit {
            Fit::Cover if self != Self::Anything => Fit::Horizon { clip: HORIZON, frame },
            other => other,
        }
    }

    /// How its clip runs: with the vehicle, unless the user says how fast.
    fn motion(self, motion: Motion) -> Motion {
        match (self, motion) {
            (Self::Falling { still, .. }, Motion::Runs { end, rate: None }) => {
                Motion::Driven { end, drive: Drive { speed: SPEED, still } }
            }
            (_, motion) => motion,
        }
    }

    /// Plays its clip.
    fn player(self, clip: Clip, config: &Config, motion: Motion) -> Result<Player> {
        let horizon = if self == Self::Anything { FRAME_HORIZON } else { config.number("horizon") };
        let settings = Settings { key: None, fit: self.fit(fit_of(config), horizon), seconds: 60.0 };
        let player = Player::new(clip, settings, self.motion(motion))?;
        Ok(match self {
            Self::Falling { colour, metres, .. } => player.through(Air::new(Effect::Haze {
                colour,
                metres,
                most: config.number("haze"),
                horizon,
            })),
            Self::Sun => {
                let (darker, veil) = (config.number("darker"), config.number("veil"));
                player.through(Air::new(Effect::Glare { colour: [1.0, 0.96, 0.88], darker, veil }))
            }
            Self::Sky | Self::Anything => player,
        })
    }
}

/// What a clip shows.
fn shows(clip: &str) -> Shows {
    match clip {
        "rain" => RAIN,
        "snow" => SNOW,
        "birds" | "lightning" => Shows::Sky,
        "sun" => Shows::Sun,
        _ => Shows::Anything,
    }
}

/// How a clip of our own is fitted to frames by default.
pub fn usual_fit(name: &str, fit: Fit) -> Fit {
    shows(name).fit(fit, FRAME_HORIZON)
}

/// A clip of our own that is laid over frames.
pub struct Laid(Player);

impl Laid {
    /// The clip of this name, moving as the user says.
    ///
    /// # Errors
    /// If it cannot be prepared.
    pub fn moving(name: &str, config: &Config) -> Result<Self> {
        shows(name).player(clip(name)?, config, motion_of(config)).map(Self)
    }

    /// The clip of this name, standing still.
    ///
    /// # Errors
    /// As for [`Laid::moving`].
    pub fn still(name: &str, config: &Config) -> Result<Self> {
        shows(name).player(clip(name)?, config, Motion::Stands).map(Self)
    }

    /// Lays it over a frame.
    ///
    /// # Errors
    /// If the clip cannot be played.
    pub fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.0.apply(src, dst, cx)
    }
}

/// Describes a clip that moves.
pub fn describe_moving(description: Description, clip: &str) -> Description {
    let description = description.source(SOURCE).divergence(OWN_CLIP);
    // The clips' last frames lead to their first ones.
    let description = with_motion(with_common(description), ["repeat", "cross-fade", "ping-pong"]);
    let description = match shows(clip) {
        Shows::Falling { .. } => description.divergence(
            "Unless `rate` is set, the clip runs as fast as the vehicle drives, if that is known: it is drawn for 10 m/s, and a share \
             of its motion goes on when the vehicle stands.",
        ),
        _ => description,
    };
    shows(clip).describe(description)
}

/// Describes a clip that stands still.
pub fn describe_still(description: Description, clip: &str) -> Description {
    let description = description.source(SOURCE).divergence(OWN_CLIP);
    let description = with_common(description)
        .drawn_per_sequence(
            "which frame of the clip is shown, of those that cover at least a third as much as the fullest",
        )
        .parameter(fit());
    shows(clip).describe(description)
}

/// Defines the perturbation of a clip that moves; the literals are its name, that of the clip, what it shows, how long and how often it
/// does, and the version.
macro_rules! moving {
    ($type:ident: $name:literal, $clip:literal, $what:literal, $loop:literal, $version:literal) => {
        use pdk_sdk::prelude::*;

        use crate::published::{Laid, describe_moving};

        #[doc = concat!("Lays moving ", $what, " over the frame.")]
        pub struct $type(Laid);

        impl Component for $type {
            fn description() -> Description {
                let doc = concat!("Lays ", $what, " over the frame, moving in simulation time in ", $loop);
                describe_moving(Description::perturbation($name, doc).version($version), $clip)
            }

            fn new(config: &Config) -> Result<Self> {
                Laid::moving($clip, config).map(Self)
            }
        }

        impl Perturbation for $type {
            fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
                self.0.apply(src, dst, cx)
            }
        }
    };
}
pub(crate) use moving;

/// Defines the perturbation of a clip that stands still; the literals are its name, that of the clip, what it shows, and the version.
macro_rules! still {
    ($type:ident: $name:literal, $clip:literal, $what:literal, $version:literal $(, $not_default:ident)?) => {
        use pdk_sdk::prelude::*;

        use crate::published::{Laid, describe_still};

        #[doc = concat!("Lays ", $what, " that stand still over the frame.")]
        pub struct $type(Laid);

        impl Component for $type {
            fn description() -> Description {
                let doc = concat!("Lays ", $what, " over the frame, standing still");
                describe_still(Description::perturbation($name, doc).version($version)$(.$not_default())?, $clip)
            }

            fn new(config: &Config) -> Result<Self> {
                Laid::still($clip, config).map(Self)
            }
        }

        impl Perturbation for $type {
            fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
                self.0.apply(src, dst, cx)
            }
        }
    };
}
pub(crate) use still;
