//! Perturbations: components that change a frame, what the driver gets besides the frame, or what becomes of its control.

use pdk_abi::{PerturbationFunctionsRef, empty, load, store};
use pdk_ops::affine::Affine;
use pdk_ops::{Frame, FrameBuf, FrameMut};
use pdk_seed::{Key, Random};

use crate::abi::convert::{self, Crosses};
use crate::abi::host::call::{Object, call, needed};
use crate::abi::plugin::call::functions;
use crate::config::{Config, frame_values};
use crate::describe::{ActsOn, Description, LEVELS};
pub use crate::earlier_maps::EarlierMaps;
use crate::error::{Error, ErrorKind, Result};
use crate::history::{History, Recollection, Ring};
use crate::kinds::driver::{Control, DriveContext};
use crate::signals::{Numbers, Signals};
use crate::testing::sample::{Make, SIZES, ensure, sample_frame};
use crate::testing::signals;

/// Changes a frame: [`apply`](Perturbation::apply). One whose description [says so](crate::describe::Description::acts_on) is a fault of a
/// device, and changes what the driver gets besides the frame, [`observe`](Perturbation::observe), or what becomes of its control,
/// [`actuate`](Perturbation::actuate).
///
/// The output depends on the source frame, the parameters, the key in the context and the earlier frames in it alone. It must not depend on
/// which frames were computed before, so that any frame of a recording can be computed again on its own; what an
/// instance keeps between calls is a cache (a lookup table, a workspace), never a state that changes the result. A perturbation that needs
/// earlier frames asks for them with [`Description::history`](crate::describe::Description::history).
pub trait Perturbation: Send {
    /// Writes the perturbed `src` to `dst`. Both have the same size; `dst` starts out with unspecified content, and all
    /// of it has to be written.
    ///
    /// # Errors
    /// If the frame cannot be perturbed; the run records it and goes on with the next scenario.
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let _ = (src, dst, cx);
        Err(Error::new("it does not change frames; implement `apply`"))
    }

    /// What the driver gets in place of the speed and the time in `observation`. The number of the frame stays.
    ///
    /// # Errors
    /// As [`Perturbation::apply`].
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        let _ = (observation, cx);
        Err(Error::new("it does not change what the driver gets; implement `observe`"))
    }

    /// What is applied to the vehicle from this frame to the next in place of the driver's control.
    ///
    /// # Errors
    /// As [`Perturbation::apply`].
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let _ = (control, cx);
        Err(Error::new("it does not change controls; implement `actuate`"))
    }

    /// Moves points as it moves the pixels of a frame of `size`, width and height, in the same context. A point is `[x, y]` in pixels, to
    /// the right and down from the centre of the first pixel, and may lie outside the frame; one that has nowhere to go becomes not a
    /// number.
    ///
    /// A perturbation that says it [moves geometry](crate::describe::Description::moves_geometry) has it; others do without.
    ///
    /// # Errors
    /// If it cannot say where the points go.
    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        let _ = (points, way, size, cx);
        Err(Error::new("it does not say where it moves things; implement `move_points`"))
    }

    /// Takes a gradient back from the perturbed frame to the picture that it shows, so that the picture can be trained. `of_frame` has how
    /// something, such as the driver's steering, changes with each value of a perturbed frame of `size`, width and height, in the same context: three
    /// numbers for each pixel, row by row. How it changes with each value of the picture is added to `into`, which is as long as the picture has
    /// values. Rounding to bytes counts as if it were not there.
    ///
    /// A perturbation with a parameter of the [role](crate::describe::Role) `Picture` has it; others do without.
    ///
    /// # Errors
    /// If it cannot say, or if `into` is not as long as the picture has values.
    fn picture_gradient(
        &mut self,
        of_frame: &[f32],
        size: [usize; 2],
        cx: &Context<'_>,
        into: &mut [f32],
    ) -> Result<()> {
        let _ = (of_frame, size, cx, into);
        Err(Error::new("it does not show a picture that can be trained; implement `picture_gradient`"))
    }
}

/// What a perturbation makes of a signal at the moment of `cx`, if that can be used: of the time and the speed that the driver gets, or of the
/// steering and throttle of a control.
///
/// # Errors
/// If it fails, or makes something of it that is not a number.
pub fn pass(
    instance: &mut dyn Perturbation,
    what: ActsOn,
    given: Numbers,
    cx: &Context<'_>,
) -> Result<Numbers> {
    let [time, speed] = given;
    match what {
        ActsOn::Control => Ok(instance.actuate(Control::from_numbers(given), cx)?.checked()?.numbers()),
        _ => {
            let observation = DriveContext { frame_index: cx.frame_index, time, speed };
            Ok(instance.observe(observation, cx)?.checked()?.numbers())
        }
    }
}

/// Which way points are moved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// From the source frame to where the perturbed frame shows what is there: for corners, keypoints and lines.
    ToPerturbed,
    /// From the perturbed frame to the place in the source frame whose colour is seen there: for masks, pixel by pixel.
    ToSource,
}

impl Way {
    /// Moves points by the map by which the frame was warped, or back. A map that cannot be inverted leads nowhere.
    pub fn along(self, map: &Affine, points: &mut [[f64; 2]]) {
        match self {
            Self::ToPerturbed => points.iter_mut().for_each(|point| *point = map.at(*point)),
            Self::ToSource => {
                let back = map.inverse().unwrap_or(Affine([f64::NAN; 6]));
                points.iter_mut().for_each(|point| *point = back.at(*point));
            }
        }
    }
}

/// What a perturbation knows about the frame at hand.
pub struct Context<'a> {
    /// The intensity: 0 to 4, any real number in between.
    pub intensity: f64,
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// How far the vehicle has driven since the start of the sequence, in metres, if it is known.
    pub travelled: Option<f64>,
    /// How much each pixel matters to the driver, 0 to 1, row by row, as large as the frame, if there is a saliency map.
    pub saliency: Option<&'a [f32]>,
    /// The saliency maps of the sequence so far, this frame's among them; none if there are none.
    pub earlier: EarlierMaps<'a>,
    /// The frames before this one, if the description asks for any.
    pub history: History<'a>,
    /// What passed at the frames before this one, for a perturbation that acts on observations or controls.
    pub signals: Signals<'a>,
    /// How long a frame lasts at the camera's rate, in seconds, if it is known, as in drives.
    pub period: Option<f64>,
    /// How far away each pixel is along the optical axis in metres, row by row; infinite for the sky. None if the description
    /// does not [ask for it](crate::describe::Description::depth_with), or if it is not known.
    pub depth: Option<&'a [f32]>,
    /// The vehicle's speed in metres per second; where it is known.
    pub speed: Option<f64>,
    pub(crate) key: &'a Key,
    /// The stream that [`Context::frame_random`] starts: the frame's own, unless the user wants the same draws in all.
    pub(crate) stream: u64,
    pub(crate) names: &'a [String],
    pub(crate) values: &'a [f64],
}

impl<'a> Context<'a> {
    /// A context made by hand, for tests and for hosts other than pdk.
    pub fn new(intensity: f64, frame_index: u64, time: f64, key: &'a Key) -> Self {
        Self {
            intensity,
            frame_index,
            time,
            travelled: None,
            saliency: None,
            earlier: EarlierMaps::default(),
            history: History::default(),
            signals: Signals::default(),
            period: None,
            depth: None,
            speed: None,
            key,
            stream: frame_index,
            names: &[],
            values: &[],
        }
    }

    /// The same context with parameter values, one for each name.
    pub fn with_values(mut self, names: &'a [String], values: &'a [f64]) -> Self {
        (self.names, self.values) = (names, values);
        self
    }

    /// The values of the parameters in the order of the description; empty if none were given.
    pub fn values(&self) -> &'a [f64] {
        self.values
    }

    /// The same context with the saliency map of the frame, and with those of the sequence so far.
    pub fn with_saliency(mut self, now: &'a [f32], earlier: EarlierMaps<'a>) -> Self {
        (self.saliency, self.earlier) = (Some(now), earlier);
        self
    }

    /// The same context with the frames before this one.
    pub fn with_history(mut self, history: History<'a>) -> Self {
        self.history = history;
        self
    }

    /// The same context with what passed at the frames before this one.
    pub fn with_signals(mut self, signals: Signals<'a>) -> Self {
        self.signals = signals;
        self
    }

    /// The same context in which [`Context::frame_random`] starts another stream than the frame's own. With the same
    /// stream for all frames, what is usually drawn for every frame is drawn once.
    pub fn with_stream(mut self, stream: u64) -> Self {
        self.stream = stream;
        self
    }

    /// The value of a parameter of this frame: what the user set, or what the intensity makes it.
    ///
    /// # Panics
    /// If the description has no such parameter, which is a mistake in the plugin; the host reports it as an error.
    pub fn number(&self, name: &str) -> f64 {
        match self.names.iter().position(|n| n == name).and_then(|i| self.values.get(i)) {
            Some(value) => *value,
            None => panic!("the description has no parameter `{name}`"),
        }
    }

    /// The value of a parameter, rounded to the nearest whole number.
    ///
    /// # Panics
    /// As [`Context::number`].
    pub fn integer(&self, name: &str) -> i64 {
        self.number(name).round() as i64
    }

    /// Whether a boolean parameter is set.
    ///
    /// # Panics
    /// As [`Context::number`].
    pub fn boolean(&self, name: &str) -> bool {
        self.number(name) != 0.0
    }

    /// Random numbers that are drawn anew for every frame. Every call starts the stream from its beginning.
    pub fn frame_random(&self) -> Random {
        self.key.frame(self.stream)
    }

    /// The random numbers that an earlier frame, or a later one, starts with [`Context::frame_random`]: for what has to be known of a frame
    /// while another one is perturbed, such as whether it was lost. If the user wants the same draws in all frames, they are this frame's.
    pub fn random_of(&self, frame_index: u64) -> Random {
        let stream = if self.stream == self.frame_index { frame_index } else { self.stream };
        self.key.frame(stream)
    }

    /// Random numbers that are the same for all frames of a sequence. Every call starts the stream from its beginning.
    pub fn sequence_random(&self) -> Random {
        self.key.sequence()
    }

    /// The key all random numbers of this instance come from.
    pub fn key(&self) -> &Key {
        self.key
    }
}

/// Which way points are moved, for the other side.
fn raw_way(way: Way) -> u64 {
    match way {
        Way::ToPerturbed => pdk_abi::way::TO_PERTURBED,
        Way::ToSource => pdk_abi::way::TO_SOURCE,
    }
}

/// Which way the other side wants points moved.
fn read_way(number: u64) -> Result<Way> {
    match number {
        pdk_abi::way::TO_PERTURBED => Ok(Way::ToPerturbed),
        pdk_abi::way::TO_SOURCE => Ok(Way::ToSource),
        other => Err(Error::of(ErrorKind::Nonsense, format!("{other} is not a way to move points"))),
    }
}

functions! { Perturbation as PerturbationFunctions:
    fn apply(
        component,
        names,
        source: *const pdk_abi::Frame,
        target: *const pdk_abi::FrameMut,
        context: *const pdk_abi::PerturbationContext
    ) {
        let (source, target) = (convert::source(source)?, convert::target(target)?);
        with_context(names, context, |cx| component.apply(source, target, cx))
    }
    fn move_points(
        component,
        names,
        points: *mut f64,
        length: usize,
        way: u64,
        width: usize,
        height: usize,
        context: *const pdk_abi::PerturbationContext
    ) {
        let points = convert::slice_mut(points.cast::<[f64; 2]>(), length);
        let way = read_way(way)?;
        with_context(names, context, |cx| component.move_points(points, way, [width, height], cx))
    }
    fn observe(
        component,
        names,
        observation: *const pdk_abi::DriveContext,
        context: *const pdk_abi::PerturbationContext,
        into: *mut pdk_abi::DriveContext
    ) {
        let observation = DriveContext::read(observation);
        with_context(names, context, |cx| {
            store(component.observe(observation, cx)?.raw(), into);
            Ok(())
        })
    }
    fn actuate(
        component,
        names,
        control: *const pdk_abi::Control,
        context: *const pdk_abi::PerturbationContext,
        into: *mut pdk_abi::Control
    ) {
        let control = Control::read(control);
        with_context(names, context, |cx| {
            store(component.actuate(control, cx)?.raw(), into);
            Ok(())
        })
    }
    fn picture_gradient(
        component,
        names,
        of_frame: *const f32,
        width: usize,
        height: usize,
        context: *const pdk_abi::PerturbationContext,
        into: *mut f32,
        length: usize
    ) {
        let of_frame = convert::slice(of_frame, width.saturating_mul(height).saturating_mul(3));
        let into = convert::slice_mut(into, length);
        with_context(names, context, |cx| component.picture_gradient(of_frame, [width, height], cx, into))
    }
}

/// Calls a perturbation with the context that the host hands over.
///
/// # Safety
/// The context and all that it points to are those of a call in progress.
unsafe fn with_context(
    names: &[String],
    context: *const pdk_abi::PerturbationContext,
    work: impl FnOnce(&Context<'_>) -> Result<()>,
) -> Result<()> {
    // SAFETY: the caller's promise.
    unsafe {
        // A host that does not tell how far the vehicle has driven, and how fast, does not know it.
        let unknown = pdk_abi::PerturbationContext { travelled: f64::NAN, speed: f64::NAN, ..empty() };
        let raw = load(context, unknown);
        let key = Key(raw.key);
        let mut cx = Context::new(raw.intensity, raw.frame_index, raw.time, &key)
            .with_stream(raw.stream)
            .with_values(names, convert::slice(raw.values, raw.values_length));
        let saliency = convert::slice(raw.saliency, raw.saliency_length);
        cx.travelled = Some(raw.travelled).filter(|metres| metres.is_finite());
        cx.saliency = (!saliency.is_empty()).then_some(saliency);
        let times = convert::slice(raw.earlier_times, raw.earlier_length);
        let (width, height) = (raw.earlier_width, raw.earlier_height);
        let length = times.len().saturating_mul(width).saturating_mul(height);
        cx.earlier = EarlierMaps::new(times, convert::slice(raw.earlier_values, length), width, height)?;
        let (slots, width, height) = (raw.history_slots, raw.history_width, raw.history_height);
        let bytes = slots.saturating_mul(width).saturating_mul(height).saturating_mul(3);
        cx.history = History::new(Ring {
            pixels: convert::slice(raw.history, bytes),
            indices: convert::slice(raw.history_indices, slots),
            times: convert::slice(raw.history_times, slots),
            latest: raw.history_latest,
            length: raw.history_length,
            width,
            height,
        })?;
        let (signals, pairs) =
            (raw.signals_length, |data: *const f64| convert::slice(data.cast(), raw.signals_length));
        cx.signals = Signals::new(
            convert::slice(raw.signal_indices, signals),
            convert::slice(raw.signal_times, signals),
            pairs(raw.signals_given),
            pairs(raw.signals_passed),
        )?;
        cx.period = Some(raw.period).filter(|seconds| *seconds > 0.0);
        let depth = convert::slice(raw.depth, raw.depth_length);
        cx.depth = (!depth.is_empty()).then_some(depth);
        cx.speed = Some(raw.speed).filter(|speed| speed.is_finite());
        work(&cx)
    }
}

/// An instance in a plugin.
pub(crate) struct Host(Object<PerturbationFunctionsRef>);

impl Host {
    pub(crate) fn new(object: Object<PerturbationFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Perturbation for Host {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let context = perturbation_context(cx);
        let (source, target) = (convert::frame(src), convert::frame_mut(&mut dst));
        let Object { pointer, functions, .. } = self.0;
        // SAFETY: the frames and all slices live through the call.
        call(|error| unsafe { functions.apply()(pointer, &source, &target, &context, error) })
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        [width, height]: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let move_points = needed(functions.move_points(), "move_points")?;
        let context = perturbation_context(cx);
        let (data, length, way) = (points.as_mut_ptr().cast(), points.len(), raw_way(way));
        // SAFETY: the points and all slices live through the call.
        call(|error| unsafe { move_points(pointer, data, length, way, width, height, &context, error) })
    }

    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        let Object { pointer, functions, .. } = self.0;
        let observe = needed(functions.observe(), "observe")?;
        let (context, observation) = (perturbation_context(cx), observation.raw());
        let mut into = observation;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { observe(pointer, &observation, &context, &mut into, error) })?;
        Ok(DriveContext::from_raw(into))
    }

    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let Object { pointer, functions, .. } = self.0;
        let actuate = needed(functions.actuate(), "actuate")?;
        let (context, control) = (perturbation_context(cx), control.raw());
        let mut into = control;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { actuate(pointer, &control, &context, &mut into, error) })?;
        Ok(Control::from_raw(into))
    }

    fn picture_gradient(
        &mut self,
        of_frame: &[f32],
        [width, height]: [usize; 2],
        cx: &Context<'_>,
        into: &mut [f32],
    ) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let gradient = needed(functions.picture_gradient(), "picture_gradient")?;
        values_of([width, height], of_frame)?;
        let context = perturbation_context(cx);
        let (from, data, length) = (of_frame.as_ptr(), into.as_mut_ptr(), into.len());
        // SAFETY: everything lives through the call, and there are three numbers for each pixel of the frame.
        call(|error| unsafe { gradient(pointer, from, width, height, &context, data, length, error) })
    }
}

/// Checks that there are three numbers for each pixel of a frame.
fn values_of([width, height]: [usize; 2], numbers: &[f32]) -> Result<()> {
    match numbers.len() == width * height * 3 {
        true => Ok(()),
        false => Err(Error::of(
            ErrorKind::Nonsense,
            format!("{} numbers are not three for each pixel of a frame of {width}x{height}", numbers.len()),
        )),
    }
}

/// What a perturbation knows about a frame; its slices live as long as the context.
fn perturbation_context(cx: &Context<'_>) -> pdk_abi::PerturbationContext {
    pdk_abi::PerturbationContext {
        intensity: cx.intensity,
        frame_index: cx.frame_index,
        time: cx.time,
        key: cx.key.0,
        stream: cx.stream,
        values: cx.values.as_ptr(),
        values_length: cx.values.len(),
        saliency: cx.saliency.map_or(std::ptr::null(), <[f32]>::as_ptr),
        saliency_length: cx.saliency.map_or(0, <[f32]>::len),
        earlier_times: cx.earlier.times.as_ptr(),
        earlier_length: cx.earlier.times.len(),
        earlier_values: cx.earlier.values.as_ptr(),
        earlier_width: cx.earlier.width,
        earlier_height: cx.earlier.height,
        travelled: cx.travelled.unwrap_or(f64::NAN),
        history: cx.history.ring.pixels.as_ptr(),
        history_slots: cx.history.ring.indices.len(),
        history_latest: cx.history.ring.latest,
        history_length: cx.history.ring.length,
        history_indices: cx.history.ring.indices.as_ptr(),
        history_times: cx.history.ring.times.as_ptr(),
        history_width: cx.history.ring.width,
        history_height: cx.history.ring.height,
        period: cx.period.unwrap_or_default(),
        signal_indices: cx.signals.indices.as_ptr(),
        signals_length: cx.signals.indices.len(),
        signal_times: cx.signals.times.as_ptr(),
        signals_given: cx.signals.given.as_ptr().cast(),
        signals_passed: cx.signals.passed.as_ptr().cast(),
        depth: cx.depth.map_or(std::ptr::null(), <[f32]>::as_ptr),
        depth_length: cx.depth.map_or(0, <[f32]>::len),
        speed: cx.speed.unwrap_or(f64::NAN),
        ..empty()
    }
}

/// Checks that a perturbation works at every level and size, writes every pixel, and that its output depends on the
/// source, the parameters and the key alone: not on the stride, on what `dst` held, or on earlier frames. Of one that does not act on
/// frames, that what it passes on follows from the signals that it asks for.
///
/// # Errors
/// The first check that fails.
pub fn check(description: &Description, config: &Config, make: Make<'_, dyn Perturbation>) -> Result<()> {
    if !description.acts_on.is_frame() {
        return signals::check(description, config, make);
    }
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let key = Key([9; 32]);
    let mut values = Vec::new();
    let mut veteran = make(config)?;
    // Far enough in its sequence to have as many frames before it as it asks for.
    let (frame_index, time) = (5 + u64::from(description.history), 0.25);
    for (width, height) in SIZES {
        let source = sample_frame(width, height);
        for level in 0..=2 * (LEVELS - 1) {
            let intensity = level as f64 / 2.0;
            let place = format!("at {width}x{height} and level {intensity}");
            frame_values(description, config, intensity, &mut values);
            let mut kept = earlier_frames(description.history, frame_index, width, height);
            let mut kept_for_other = kept.clone();
            let cx = Context::new(intensity, frame_index, time, &key)
                .with_values(&names, &values)
                .with_history(kept.before(source.as_ref(), frame_index));
            let other = Context::new(intensity, frame_index + 1, 0.3, &key)
                .with_values(&names, &values)
                .with_history(kept_for_other.before(source.as_ref(), frame_index + 1));

            let mut alone = FrameBuf::new(width, height);
            make(config)?.apply(source.as_ref(), alone.as_mut(), &cx).map_err(|e| e.at(&place))?;

            let mut dirty = FrameBuf::new(width, height);
            dirty.as_mut().rows_mut().for_each(|row| row.fill(0xa5));
            veteran.apply(source.as_ref(), dirty.as_mut(), &other).map_err(|e| e.at(&place))?;
            dirty.as_mut().rows_mut().for_each(|row| row.fill(0x5a));
            veteran.apply(source.as_ref(), dirty.as_mut(), &cx).map_err(|e| e.at(&place))?;
            ensure(alone == dirty, || {
                format!(
                    "{place} a frame comes out differently alone and after others; the result may depend on the source, \
                     the parameters and the key only, and every pixel of dst has to be written"
                )
            })?;

            let (strided_source, stride) = with_gaps(source.as_ref());
            let strided_source =
                Frame::with_stride(&strided_source, width, height, stride).map_err(Error::new)?;
            let mut target = vec![0x77; stride * height];
            let strided_target =
                FrameMut::with_stride(&mut target, width, height, stride).map_err(Error::new)?;
            veteran.apply(strided_source, strided_target, &cx).map_err(|e| e.at(&place))?;
            let strided = Frame::with_stride(&target, width, height, stride).map_err(Error::new)?;
            ensure(strided == alone.as_ref(), || {
                format!("{place} a frame comes out differently with a stride")
            })?;
            let gaps = target.chunks(stride).flat_map(|row| &row[width * 3..]);
            ensure(gaps.into_iter().all(|&byte| byte == 0x77), || {
                format!("{place} bytes between the rows of dst are written")
            })?;
        }
    }
    Ok(())
}

/// The frames before one, each of another brightness.
fn earlier_frames(history: u32, frame_index: u64, width: usize, height: usize) -> Recollection {
    let mut kept = Recollection::of(history as usize);
    for index in frame_index - u64::from(history)..frame_index {
        let mut frame = sample_frame(width, height);
        let darker = (index * 37 % 101) as u8;
        frame.as_mut().rows_mut().flatten().for_each(|value| *value = value.saturating_sub(darker));
        kept.keep(frame.as_ref(), index, index as f64 / 20.0);
    }
    kept
}

/// The same pixels with gaps between the rows.
fn with_gaps(frame: Frame<'_>) -> (Vec<u8>, usize) {
    let stride = frame.width() * 3 + 7;
    let mut bytes = vec![0xee; stride * frame.height()];
    for (y, row) in frame.rows().enumerate() {
        bytes[y * stride..][..row.len()].copy_from_slice(row);
    }
    (bytes, stride)
}
