//! What is trained: a patch on the road or a change of the whole frame, as it is put on a frame.

use pdk_sdk::error::{Error, Result};
use pdk_sdk::ground::{Placed, Pose};
use pdk_sdk::ops::change;
use pdk_sdk::ops::decal::{self, Decal};
use pdk_sdk::prelude::{Frame, FrameBuf, Random};

use super::Mounting;
use super::Shown;

/// Where a patch lies, and the camera that sees it.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct Road {
    /// Width of a patch, in metres
    #[arg(long, default_value_t = 1.5)]
    size: f64,
    /// How a patch is put on the road: flat, or upright like a sign or the back of a vehicle
    #[arg(long, default_value = "flat")]
    pose: Posture,
    /// How much longer a flat patch is along the road than wide [default: 3]
    #[arg(long)]
    stretch: Option<f64>,
    /// How high above the road the middle of an upright patch is, in metres [default: 1]
    #[arg(long)]
    above: Option<f64>,
    /// How far to the right of the camera a patch lies, in metres
    #[arg(long, default_value_t = 0.0, allow_negative_numbers = true)]
    offset: f64,
    /// The nearest that a patch is, in metres ahead of the camera
    #[arg(long, default_value_t = 5.0)]
    near: f64,
    /// The furthest that a patch is, in metres ahead of the camera
    #[arg(long, default_value_t = 15.0)]
    far: f64,
    /// Angle that the frame's width covers, in degrees
    #[arg(long, default_value_t = Mounting::WINDSCREEN.field_of_view)]
    field_of_view: f64,
    /// Height of the camera above the road, in metres
    #[arg(long, default_value_t = Mounting::WINDSCREEN.height)]
    camera_height: f64,
    /// Angle by which the camera looks down, in degrees
    #[arg(long, default_value_t = Mounting::WINDSCREEN.pitch, allow_negative_numbers = true)]
    camera_pitch: f64,
}

/// How a patch is put on the road.
#[derive(Debug, Clone, Copy, PartialEq, clap::ValueEnum)]
enum Posture {
    Flat,
    Upright,
}

/// How much longer a flat patch is along the road than wide if nothing else is asked for: the camera sees it at a flat angle.
const STRETCH: f64 = 3.0;
/// How high above the road the middle of an upright patch is if nothing else is asked for, in metres.
const ABOVE: f64 = 1.0;
/// By how much a patch is moved aside and turned at random, in metres and radians.
const ASIDE: f64 = 0.2;
const TURN: f64 = 0.05;

/// What is trained.
pub enum Artwork {
    /// A patch with this many pixels across and down.
    Patch { road: Road, pixels: usize },
    /// A change of frames of this size by at most `epsilon`.
    Universal { epsilon: f32, size: [usize; 2] },
}

/// How it was put on a frame, for the way back.
pub enum Put {
    Patch(Decal),
    Universal,
}

impl Artwork {
    /// A patch.
    ///
    /// # Errors
    /// If it lies nowhere.
    pub fn patch(road: Road, pixels: usize) -> Result<Self> {
        let positive = [
            ("size", road.size),
            ("stretch", road.stretch.unwrap_or(STRETCH)),
            ("near", road.near),
            ("camera-height", road.camera_height),
        ];
        if let Some((name, value)) = positive.into_iter().find(|(_, value)| !(*value > 0.0 && *value < 1e4)) {
            return Err(Error::new(format!("--{name} is {value}; give a length above 0")));
        }
        let other = match road.pose {
            Posture::Upright => road.stretch.map(|_| ("stretch", "flat")),
            Posture::Flat => road.above.map(|_| ("above", "upright")),
        };
        if let Some((name, pose)) = other {
            return Err(Error::new(format!("--{name} is for --pose {pose}; leave it out")));
        }
        if !(road.far >= road.near && road.far < 1e4) {
            return Err(Error::new(format!(
                "--far is {} and --near {}; the furthest place has to be further away than the nearest",
                road.far, road.near
            )));
        }
        for (name, value, range) in [
            ("field-of-view", road.field_of_view, 20.0..=130.0),
            ("camera-pitch", road.camera_pitch, -45.0..=45.0),
            ("offset", road.offset, -10.0..=10.0),
            ("above", road.above.unwrap_or(ABOVE), 0.0..=20.0),
        ] {
            if !range.contains(&value) {
                let (least, most) = range.into_inner();
                return Err(Error::new(format!("--{name} is {value}; give a number from {least} to {most}")));
            }
        }
        Ok(Self::Patch { road, pixels })
    }

    /// A change of frames, which have to be of one size.
    ///
    /// # Errors
    /// If they are not, or the change is none.
    pub fn universal(epsilon: f64, frames: &[&Shown]) -> Result<Self> {
        if !(1.0..=255.0).contains(&epsilon) {
            return Err(Error::new(format!("--epsilon is {epsilon}; give a number from 1 to 255")));
        }
        let size = |shown: &&Shown| [shown.frame.width(), shown.frame.height()];
        let first = frames.first().map(size).unwrap_or_default();
        match frames.iter().find(|shown| size(shown) != first) {
            None => Ok(Self::Universal { epsilon: epsilon as f32, size: first }),
            Some(other) => Err(Error::new(format!(
                "frame `{}` has {:?} pixels and the first one {first:?}; name a recording whose frames have one size",
                other.name,
                size(other)
            ))),
        }
    }

    /// The size of the picture.
    fn size(&self) -> [usize; 2] {
        match self {
            Self::Patch { pixels, .. } => [*pixels; 2],
            Self::Universal { size, .. } => *size,
        }
    }

    /// The values to start from, drawn around the middle.
    pub fn start(&self, random: &mut Random) -> Vec<f32> {
        let [width, height] = self.size();
        let (middle, spread) = self.range();
        (0..width * height * 3).map(|_| middle + (random.uniform(-0.2, 0.2) as f32) * spread).collect()
    }

    /// What it is compared with: a patch of the mean colour, or a change with signs at random.
    pub fn compared(&self, values: &[f32], random: &mut Random) -> Vec<f32> {
        let (middle, spread) = self.range();
        match self {
            Self::Patch { .. } => decal::mean(values),
            Self::Universal { .. } => {
                values.iter().map(|_| middle + if random.below(2) == 0 { -spread } else { spread }).collect()
            }
        }
    }

    /// The middle of the values, and how far they reach to both sides.
    pub fn range(&self) -> (f32, f32) {
        match self {
            Self::Patch { .. } => (127.5, 127.5),
            Self::Universal { .. } => (0.0, 1.0),
        }
    }

    /// The values as a picture.
    ///
    /// # Errors
    /// If the values are not as many as the picture has.
    pub fn picture(&self, values: &[f32]) -> Result<FrameBuf> {
        let byte = |value: &f32| match self {
            Self::Patch { .. } => value.round_ties_even() as u8,
            Self::Universal { .. } => change::byte(*value),
        };
        let [width, height] = self.size();
        FrameBuf::from_vec(values.iter().map(byte).collect(), width, height).map_err(Error::new)
    }

    /// The values of a picture.
    pub fn values(&self, picture: Frame<'_>) -> Vec<f32> {
        let value = |byte: &u8| match self {
            Self::Patch { .. } => f32::from(*byte),
            Self::Universal { .. } => change::of_byte(*byte),
        };
        picture.rows().flatten().map(value).collect()
    }

    /// Puts it on a frame, a patch at a place that is drawn.
    pub fn put(&self, values: &[f32], frame: &mut FrameBuf, random: &mut Random) -> Put {
        match self {
            Self::Patch { road, pixels } => {
                let ahead = random.uniform(road.near, road.far);
                let offset = road.offset + random.uniform(-ASIDE, ASIDE);
                let turned = random.uniform(-TURN, TURN);
                let (stretch, pose) = match road.pose {
                    Posture::Upright => (1.0, Pose::Upright { above: road.above.unwrap_or(ABOVE) }),
                    Posture::Flat => (road.stretch.unwrap_or(STRETCH), Pose::Flat { turn: turned }),
                };
                let placed = Placed { sides: [road.size, road.size * stretch], offset, ahead, pose };
                let mounting = Mounting {
                    field_of_view: road.field_of_view,
                    height: road.camera_height,
                    pitch: road.camera_pitch,
                };
                let decal = placed.decal(&mounting.view([frame.width(), frame.height()]), [*pixels; 2]);
                decal.lay(values, frame.as_mut());
                Put::Patch(decal)
            }
            Self::Universal { epsilon, .. } => {
                for (byte, value) in frame.as_mut().rows_mut().flatten().zip(values) {
                    *byte = change::added(*byte, change::step(*value, *epsilon));
                }
                Put::Universal
            }
        }
    }

    /// Adds the gradient with respect to the values, given the one with respect to the frame.
    pub fn back(&self, put: &Put, of_frame: &mut [f32], width: usize, sums: &mut [f32]) {
        match put {
            Put::Patch(decal) => decal.back(of_frame, width, sums),
            Put::Universal => sums.iter_mut().zip(&*of_frame).for_each(|(sum, value)| *sum += value),
        }
    }
}
