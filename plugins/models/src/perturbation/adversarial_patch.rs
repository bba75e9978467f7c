//! A printed picture: in perspective on the road ahead or upright like a sign, or in a box of the frame.

use pdk_sdk::camera::Mounting;
use pdk_sdk::ground::{Placed, Pose, View};
use pdk_sdk::ops::decal::{self, Decal, Projection};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::attack::artwork;

/// Where pictures are laid on the road, and how close together: nearer ones are below most frames, further ones too small to be seen.
const NEAREST: f64 = 0.5;
const FURTHEST: f64 = 60.0;
const CLOSEST: f64 = 0.5;

/// The grey of a plain patch: the middle of the values of a frame.
const GREY: f32 = 128.0;

/// Lays a picture over the frame.
pub struct AdversarialPatch {
    picture: FrameBuf,
    values: Vec<f32>,
    /// Whether one colour is shown in place of the picture.
    is_plain: bool,
    place: Place,
    /// Whether what is nearer hides it, by the simulator's depth.
    is_hidden: bool,
    laid: Option<Laid>,
}

/// What is seen in frames of one size, and the pictures in it, given by their widths and how far ahead they are.
struct Laid {
    size: [usize; 2],
    middles: Vec<[f64; 2]>,
    decals: Vec<Decal>,
}

/// Where the picture is.
enum Place {
    Road { mounting: Mounting, distance: f64, spacing: f64, offset: f64, stretch: f64, pose: Pose },
    Frame { middle: [f64; 2] },
}

/// What is nearer than a picture by more than this share of its depth hides it. Depths of one pixel of flat road differ by about as much.
const NEARER: f64 = 0.05;

impl Component for AdversarialPatch {
    fn description() -> Description {
        Description::perturbation(
            "adversarial_patch",
            "Lays a picture on the road ahead or over a part of the frame, such as one that was trained so that a network steers elsewhere",
        )
        .family("attack")
        .dynamic()
        .not_default()
        .keeps_geometry()
        .example(json!({"picture": "dave2_patch"}))
        .mathematics("the picture on a plane, that of the ground or an upright one, as a pinhole camera sees it, with 16 samples a pixel")
        .source("Brown et al., Adversarial Patch, 2017; Sato et al., Dirty Road Can Attack, 2021")
        .parameter(
            artwork::parameter(
                "the picture, as `pdk attack patch` and `pdk attack drives` write one, or any other; or `dave2_patch`, which is part of pdk",
            )
            .role(Role::Picture),
        )
        .parameter(Parameter::choice(
            "show",
            &["picture", "mean", "grey"],
            "picture: as it is; mean and grey: a plain patch to compare it with, of its mean colour or of the grey 128",
        ))
        .parameter(Parameter::choice("on", &["road", "frame"], "where it lies: on the road, or over a box of the frame"))
        .parameter(
            Parameter::choice(
                "pose",
                &["flat", "upright"],
                "flat: it lies on the road; upright: it faces the camera, like a sign or the back of a vehicle",
            )
            .only_for("on", "road"),
        )
        .parameter(
            Parameter::choice(
                "depth",
                &["none", "simulator"],
                "none: it is drawn over everything; simulator: what is nearer hides it, as the simulator knows distances",
            )
            .only_for("on", "road"),
        )
        .depth_with("depth", "simulator")
        .parameter(
            Parameter::by_level("size", [0.5, 1.0, 1.5, 2.0, 3.0], "its width")
                .range(0.01, 20.0)
                .unit("m")
                .only_for("on", "road"),
        )
        .parameter(
            Parameter::number("stretch", 3.0, "how much longer it is along the road than its shape says, as markings are that are read at a flat angle")
                .range(0.1, 20.0)
                .only_for("pose", "flat"),
        )
        .parameter(
            Parameter::number("distance", 10.0, "how far ahead of the camera its middle lies; with a `spacing`, that of the first one at the start")
                .range(0.5, 60.0)
                .unit("m")
                .only_for("on", "road"),
        )
        .parameter(
            Parameter::number(
                "spacing",
                0.0,
                "how far apart pictures lie on the way of the vehicle, which drives over them; with 0, one stays ahead of it",
            )
            .range(0.0, 1000.0)
            .unit("m")
            .only_for("on", "road"),
        )
        .parameter(
            Parameter::number("offset", 0.0, "how far to the right of the camera its middle lies")
                .range(-10.0, 10.0)
                .unit("m")
                .only_for("on", "road"),
        )
        .parameter(
            Parameter::number("turn", 0.0, "by how much it is turned to the right on the road")
                .range(-180.0, 180.0)
                .unit("degrees")
                .only_for("pose", "flat"),
        )
        .parameter(
            Parameter::number("above", 1.0, "how high above the road its middle is")
                .range(0.0, 20.0)
                .unit("m")
                .only_for("pose", "upright"),
        )
        .parameter(
            Parameter::number("speed", 8.0, "how fast the vehicle drives where its way is not known, as in recordings")
                .range(0.0, 100.0)
                .unit("m/s")
                .only_for("on", "road"),
        )
        .parameter(
            Parameter::by_level("share", [0.05, 0.1, 0.15, 0.2, 0.3], "its width as a share of the frame's")
                .range(0.001, 1.0)
                .only_for("on", "frame"),
        )
        .parameter(
            Parameter::number("across", 0.5, "where its middle lies from the left of the frame to the right")
                .range(0.0, 1.0)
                .only_for("on", "frame"),
        )
        .parameter(
            Parameter::number("down", 0.7, "where its middle lies from the top of the frame to the bottom")
                .range(0.0, 1.0)
                .only_for("on", "frame"),
        )
        .mounting(Mounting::WINDSCREEN, 0.1..=10.0, -45.0..=45.0)
    }

    fn new(config: &Config) -> Result<Self> {
        let spacing = config.number("spacing");
        if spacing > 0.0 && spacing < CLOSEST {
            return Err(Error::new(format!("`spacing` has to be 0 or at least {CLOSEST} m")));
        }
        let picture = artwork::read(config)?;
        let shown = decal::values(picture.as_ref());
        let (is_plain, values) = match config.text("show") {
            "mean" => (true, decal::mean(&shown)),
            "grey" => (true, vec![GREY; shown.len()]),
            _ => (false, shown),
        };
        let number = |name| config.number(name);
        let place = match config.text("on") {
            "frame" => Place::Frame { middle: [number("across"), number("down")] },
            _ => Place::Road {
                mounting: config.mounting(),
                distance: number("distance"),
                spacing: number("spacing"),
                offset: number("offset"),
                stretch: if config.text("pose") == "flat" { number("stretch") } else { 1.0 },
                pose: match config.text("pose") {
                    "upright" => Pose::Upright { above: number("above") },
                    _ => Pose::Flat { turn: number("turn").to_radians() },
                },
            },
        };
        let is_hidden = config.text("depth") == "simulator";
        Ok(Self { picture, values, is_plain, place, is_hidden, laid: None })
    }
}

impl Perturbation for AdversarialPatch {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let size = [src.width(), src.height()];
        dst.copy_from(src);
        let depth = self.depth(size, cx)?;
        self.lay(size, cx);
        let Some(laid) = &self.laid else { return Ok(()) };
        for (decal, middle) in laid.decals.iter().zip(&laid.middles) {
            match depth.zip(self.placed(size, *middle)) {
                Some((depth, (placed, view))) => {
                    let is_seen = |x: usize, y: usize| is_seen(depth, size, &placed, &view, [x, y]);
                    decal.lay_where(&self.values, dst.reborrow(), is_seen);
                }
                None => decal.lay(&self.values, dst.reborrow()),
            }
        }
        Ok(())
    }

    fn picture_gradient(
        &mut self,
        of_frame: &[f32],
        size: [usize; 2],
        cx: &Context<'_>,
        into: &mut [f32],
    ) -> Result<()> {
        if into.len() != self.values.len() {
            return Err(Error::new(format!(
                "{} numbers are not three for each pixel of a picture of {}x{}",
                into.len(),
                self.picture.width(),
                self.picture.height()
            )));
        }
        if self.is_plain {
            return Err(Error::new("a plain patch is shown in place of the picture; set `show=picture`"));
        }
        let depth = self.depth(size, cx)?;
        self.lay(size, cx);
        let Some(laid) = &self.laid else { return Ok(()) };
        // The nearest first: it was laid last, over the others.
        let mut of_frame = of_frame.to_vec();
        for (decal, middle) in laid.decals.iter().zip(&laid.middles).rev() {
            match depth.zip(self.placed(size, *middle)) {
                Some((depth, (placed, view))) => {
                    let is_seen = |x: usize, y: usize| is_seen(depth, size, &placed, &view, [x, y]);
                    decal.back_where(&mut of_frame, size[0], into, is_seen);
                }
                None => decal.back(&mut of_frame, size[0], into),
            }
        }
        Ok(())
    }
}

/// Whether nothing hides a picture at a pixel, by the simulator's depth.
fn is_seen(depth: &[f32], size: [usize; 2], placed: &Placed, view: &View, [x, y]: [usize; 2]) -> bool {
    let own = placed.depth(view, [x as f64 + 0.5, y as f64 + 0.5]);
    own.is_none_or(|own| f64::from(depth[y * size[0] + x]) > own * (1.0 - NEARER))
}

impl AdversarialPatch {
    /// Finds where the pictures are seen in a frame of this size.
    fn lay(&mut self, size: [usize; 2], cx: &Context<'_>) {
        let middles = self.middles(cx);
        if self.laid.as_ref().is_none_or(|laid| laid.size != size || laid.middles != middles) {
            let decals = middles.iter().map(|middle| self.decal(size, *middle)).collect();
            self.laid = Some(Laid { size, middles, decals });
        }
    }

    /// The width of the picture and how far ahead its middle is, for each that is seen, the furthest first.
    fn middles(&self, cx: &Context<'_>) -> Vec<[f64; 2]> {
        let Place::Road { distance, spacing, .. } = self.place else {
            return vec![[cx.number("share"), 0.0]];
        };
        let size = cx.number("size");
        if spacing == 0.0 {
            return vec![[size, distance]];
        }
        let first = distance - cx.travelled.unwrap_or(cx.time * cx.number("speed"));
        // The first that is not too near.
        let passed = ((NEAREST - first) / spacing).ceil().max(0.0);
        let ahead = (0..).map(|number| first + (passed + f64::from(number)) * spacing);
        let mut middles: Vec<_> =
            ahead.take_while(|ahead| *ahead <= FURTHEST).map(|ahead| [size, ahead]).collect();
        middles.reverse();
        middles
    }

    /// The simulator's depth of each pixel, if that hides the picture.
    fn depth<'a>(&self, size: [usize; 2], cx: &Context<'a>) -> Result<Option<&'a [f32]>> {
        if !self.is_hidden {
            return Ok(None);
        }
        match cx.depth.filter(|depth| depth.len() == size[0] * size[1]) {
            Some(depth) => Ok(Some(depth)),
            None => Err(Error::new(
                "it needs to know how far away pixels are, and only simulators tell; set `depth=none`",
            )),
        }
    }

    /// Where a picture on the road is, and how the camera sees it; none for one in a box of the frame.
    fn placed(&self, size: [usize; 2], [width, ahead]: [f64; 2]) -> Option<(Placed, View)> {
        let Place::Road { mounting, offset, stretch, pose, .. } = self.place else { return None };
        let proportion = self.picture.height() as f64 / self.picture.width() as f64;
        let sides = [width, width * proportion * stretch];
        Some((Placed { sides, offset, ahead, pose }, mounting.view(size)))
    }

    /// How a picture is seen in a frame.
    fn decal(&self, size: [usize; 2], of: [f64; 2]) -> Decal {
        let shape = [self.picture.width(), self.picture.height()];
        match self.place {
            Place::Frame { middle } => boxed(size, middle, of[0], shape),
            Place::Road { .. } => {
                self.placed(size, of).map(|(placed, view)| placed.decal(&view, shape)).unwrap_or_default()
            }
        }
    }
}

/// A picture of this shape over a box of the frame, given by its middle and width as shares of the frame.
fn boxed(size: [usize; 2], middle: [f64; 2], share: f64, shape: [usize; 2]) -> Decal {
    let across = share * size[0] as f64;
    let sides = [across, across * shape[1] as f64 / shape[0] as f64];
    let start = [0, 1].map(|axis| middle[axis] * size[axis] as f64 - sides[axis] / 2.0);
    Decal::new(size, shape, &Projection::over(start, sides))
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::Value;
    use pdk_sdk::testing::Trial;
    use tempfile::NamedTempFile;

    use super::*;

    /// A picture of one colour on the left and another on the right.
    fn picture() -> NamedTempFile {
        let file = NamedTempFile::with_suffix(".png").unwrap();
        let mut picture = FrameBuf::new(8, 8);
        for (x, y) in (0..64).map(|at| (at % 8, at / 8)) {
            picture.as_mut().set_pixel(x, y, if x < 4 { [200, 0, 0] } else { [0, 0, 100] });
        }
        pdk_image::write(file.path(), picture.as_ref()).unwrap();
        file
    }

    fn laid(mut given: Value, level: f64, travelled: Option<f64>) -> FrameBuf {
        let file = picture();
        given["picture"] = file.path().to_str().unwrap().into();
        let mut trial = Trial::<AdversarialPatch>::new(&given, level, Key([1; 32])).unwrap();
        let grey = FrameBuf::from_vec(vec![90; 320 * 160 * 3], 320, 160).unwrap();
        let mut target = FrameBuf::new(320, 160);
        let (instance, mut cx) = trial.at(10, 0.5);
        cx.travelled = travelled;
        instance.apply(grey.as_ref(), target.as_mut(), &cx).unwrap();
        target
    }

    /// The rows and columns that are not the grey of the frame: the first and the last of each.
    fn bounds(frame: &FrameBuf) -> Option<[usize; 4]> {
        let seen: Vec<_> = (0..320 * 160)
            .map(|at| (at % 320, at / 320))
            .filter(|(x, y)| frame.as_ref().pixel(*x, *y) != [90; 3])
            .collect();
        let range = |values: Vec<usize>| Some([*values.iter().min()?, *values.iter().max()?]);
        let [left, right] = range(seen.iter().map(|(x, _)| *x).collect())?;
        let [top, bottom] = range(seen.iter().map(|(_, y)| *y).collect())?;
        Some([left, top, right, bottom])
    }

    #[test]
    fn a_picture_lies_where_a_pinhole_camera_sees_that_part_of_the_road() {
        let frame = laid(json!({"distance": 8.0, "stretch": 1.0, "offset": 1.0}), 3.0, None);
        let view = Mounting::WINDSCREEN.view([320, 160]);
        // Two metres wide and long.
        let corner = |right: f64, ahead: f64| view.seen([right, ahead]).unwrap();
        let [left, top, right, bottom] = bounds(&frame).unwrap().map(|at| at as f64);
        let expected = [corner(0.0, 7.0)[0], corner(1.0, 9.0)[1], corner(2.0, 7.0)[0], corner(1.0, 7.0)[1]];
        for (found, expected) in [left, top, right, bottom].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1.5, "{left} {top} {right} {bottom}: {expected:?}");
        }
        let at = |right: f64, ahead: f64| {
            let [x, y] = corner(right, ahead);
            frame.as_ref().pixel(x as usize, y as usize)
        };
        assert_eq!((at(0.5, 8.0), at(1.5, 8.0)), ([200, 0, 0], [0, 0, 100]));
        // Turned by a quarter to the right, its left half is away from the camera.
        let turned = laid(json!({"distance": 8.0, "stretch": 1.0, "offset": 1.0, "turn": 90}), 3.0, None);
        let [x, y] = corner(1.0, 8.5);
        assert_eq!(turned.as_ref().pixel(x as usize, y as usize), [200, 0, 0]);
        let mean = laid(json!({"distance": 8.0, "stretch": 1.0, "offset": 1.0, "show": "mean"}), 3.0, None);
        let [x, y] = corner(0.5, 8.0);
        assert_eq!(
            (mean.as_ref().pixel(x as usize, y as usize), bounds(&mean)),
            ([100, 0, 50], bounds(&frame))
        );
        let grey = laid(json!({"distance": 8.0, "stretch": 1.0, "offset": 1.0, "show": "grey"}), 3.0, None);
        assert_eq!((grey.as_ref().pixel(x as usize, y as usize), bounds(&grey)), ([128; 3], bounds(&frame)));
    }

    #[test]
    fn pictures_on_the_way_come_nearer_and_others_follow() {
        let seen = |travelled| laid(json!({"distance": 20.0, "spacing": 100.0}), 3.0, travelled);
        let bottom = |travelled| bounds(&seen(Some(travelled))).map(|bounds| bounds[3]);
        let places = [0.0, 5.0, 10.0, 14.0].map(bottom);
        assert!(places.windows(2).all(|pair| pair[0] < pair[1]), "{places:?}");
        // Behind the camera it is gone, and the next one is as far away as the first was.
        assert_eq!(bounds(&seen(Some(30.0))), None);
        assert_eq!(seen(Some(100.0)), seen(Some(0.0)));
        // Where the way is not known, it follows from the speed.
        assert_eq!(seen(None), seen(Some(4.0)));
        let close = json!({"picture": "dave2_patch", "spacing": 1e-300});
        assert!(Trial::<AdversarialPatch>::new(&close, 3.0, Key([1; 32])).is_err());
        let always = json!({"distance": 20.0});
        assert_eq!(laid(always.clone(), 3.0, Some(5.0)), laid(always, 3.0, Some(0.0)));
    }

    #[test]
    fn an_upright_picture_stands_where_a_pinhole_camera_sees_it_and_what_is_nearer_hides_it() {
        let given = json!({"pose": "upright", "distance": 9.0, "offset": 2.0, "above": 2.0});
        let view = Mounting::WINDSCREEN.view([320, 160]);
        let corner = |right: f64, above: f64| view.towards([right, 1.35 - above, 9.0]).unwrap();
        let [left, top, right, bottom] = bounds(&laid(given, 1.0, None)).unwrap().map(|at| at as f64);
        let expected = [corner(1.5, 2.5)[0], corner(1.5, 2.5)[1], corner(2.5, 1.5)[0], corner(2.5, 1.5)[1]];
        for (found, expected) in [left, top, right, bottom].into_iter().zip(expected) {
            assert!((found - expected).abs() < 1.5, "{left} {top} {right} {bottom}: {expected:?}");
        }
        // The left half of what is seen is behind something that is 5 m away.
        let file = picture();
        let near = |x: usize| if x < 160 { 5.0 } else { 100.0 };
        let depth: Vec<f32> = (0..160 * 320).map(|at| near(at % 320)).collect();
        let grey = FrameBuf::from_vec(vec![90; 320 * 160 * 3], 320, 160).unwrap();
        for pose in ["upright", "flat"] {
            let given = json!({"picture": file.path(), "pose": pose, "distance": 9.0, "depth": "simulator"});
            let mut trial = Trial::<AdversarialPatch>::new(&given, 3.0, Key([1; 32])).unwrap();
            let mut shown = |depth| {
                let mut target = FrameBuf::new(320, 160);
                let (instance, mut cx) = trial.at(10, 0.5);
                cx.depth = depth;
                instance.apply(grey.as_ref(), target.as_mut(), &cx).map(|()| target)
            };
            let hidden = bounds(&shown(Some(&depth)).unwrap()).unwrap();
            assert!(hidden[0] == 160 && hidden[2] > 170, "{pose} {hidden:?}");
            assert!(shown(None).unwrap_err().to_string().contains("set `depth=none`"));
        }
    }

    #[test]
    fn a_gradient_goes_back_to_the_picture_as_differences_say() {
        // Two pictures on the way, the nearer of which covers a part of the other.
        let given = json!({"distance": 8.0, "spacing": 2.0, "stretch": 3.0, "offset": 0.5});
        let file = picture();
        let slopes: Vec<f32> = (0..160 * 80 * 3).map(|at| ((at * 7919) % 17) as f32 - 8.0).collect();
        let grey = FrameBuf::from_vec(vec![90; 160 * 80 * 3], 160, 80).unwrap();
        let named = |given: &Value, file: &NamedTempFile| {
            let mut given = given.clone();
            given["picture"] = file.path().to_str().unwrap().into();
            Trial::<AdversarialPatch>::new(&given, 4.0, Key([1; 32]))
        };
        let sum = |file: &NamedTempFile| -> f32 {
            let mut target = FrameBuf::new(160, 80);
            let mut trial = named(&given, file).unwrap();
            let (instance, cx) = trial.at(10, 0.5);
            instance.apply(grey.as_ref(), target.as_mut(), &cx).unwrap();
            target.data().iter().zip(&slopes).map(|(value, slope)| f32::from(*value) * slope).sum()
        };
        let mut trial = named(&given, &file).unwrap();
        let (instance, cx) = trial.at(10, 0.5);
        let mut gradient = vec![0.0; 8 * 8 * 3];
        instance.picture_gradient(&slopes, [160, 80], &cx, &mut gradient).unwrap();
        for at in [0, 27, 100, 191] {
            let changed = |by: u8| {
                let file = NamedTempFile::with_suffix(".png").unwrap();
                let mut bytes = pdk_image::read(self::picture().path()).unwrap().data().to_vec();
                bytes[at] = by;
                let picture = FrameBuf::from_vec(bytes, 8, 8).unwrap();
                pdk_image::write(file.path(), picture.as_ref()).unwrap();
                sum(&file)
            };
            let difference = (changed(240) - changed(0)) / 240.0;
            // Each of some hundred pixels is rounded.
            assert!(
                (difference - gradient[at]).abs() < 0.02 * difference.abs() + 1.0,
                "{at}: {difference} {}",
                gradient[at]
            );
        }
        let refused = instance.picture_gradient(&slopes, [160, 80], &cx, &mut [0.0; 3]).unwrap_err();
        assert!(refused.to_string().contains("3 numbers are not three for each pixel of a picture of 8x8"));
        let mut mean = named(&json!({"show": "mean"}), &file).unwrap();
        let (instance, cx) = mean.at(10, 0.5);
        let refused = instance.picture_gradient(&slopes, [160, 80], &cx, &mut gradient).unwrap_err();
        assert!(refused.to_string().contains("`show=picture`"));
    }

    #[test]
    fn a_picture_in_a_box_of_the_frame_covers_its_share() {
        let frame = laid(json!({"on": "frame", "share": 0.25, "across": 0.25, "down": 0.5}), 0.0, None);
        assert_eq!(bounds(&frame), Some([40, 40, 119, 119]));
        assert_eq!((frame.as_ref().pixel(50, 80), frame.as_ref().pixel(110, 80)), ([200, 0, 0], [0, 0, 100]));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<AdversarialPatch>();
    }
}
