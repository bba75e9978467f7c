//! Saliency methods: components that say which pixels matter to a driver.

use pdk_abi::{SaliencyFunctionsRef, empty, load, map_flag, store};
use pdk_ops::Frame;
use pdk_seed::{Key, Random};

use crate::abi::convert;
use crate::abi::host::call::{Object, call};
use crate::abi::plugin::call::functions;
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::testing::sample::{Make, ensure, sample_frame};

/// Says how much each part of a frame matters.
///
/// The map depends on the frame, the parameters and the key in the context alone, so that it can be made for any frame on its
/// own. The model whose view it shows is among the parameters.
pub trait Saliency: Send {
    /// Width and height of the map of a frame of this size: as large as the frame by default, and never larger.
    ///
    /// # Errors
    /// If the method cannot use frames of this size.
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        Ok([width, height])
    }

    /// Writes a value from 0 (does not matter) to 1 (matters most) for each part of the frame. `out` has the size that
    /// [`map_size`](Saliency::map_size) tells, covers the whole frame, and starts out with unspecified values, all of which have
    /// to be written.
    ///
    /// # Errors
    /// If the method cannot use the frame.
    fn map(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, out: HeatmapMut<'_>) -> Result<()>;
}

/// What a saliency method knows besides the frame.
#[derive(Debug, Clone, Copy)]
pub struct MapContext<'a> {
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// The vehicle's speed in metres per second, where it is known.
    pub speed: Option<f64>,
    /// Whether the frame is of a recording and may come again, so that what took long to compute is worth keeping.
    pub recorded: bool,
    /// The key that all random numbers of this instance come from.
    pub key: &'a Key,
}

impl<'a> MapContext<'a> {
    /// A context of which no more is known.
    pub fn new(frame_index: u64, time: f64, key: &'a Key) -> Self {
        Self { frame_index, time, speed: None, recorded: false, key }
    }

    /// Random numbers that are drawn anew for every frame. Every call starts the stream from its beginning.
    pub fn frame_random(&self) -> Random {
        self.key.frame(self.frame_index)
    }

    /// Random numbers that are the same for all frames of a sequence. Every call starts the stream from its beginning.
    pub fn sequence_random(&self) -> Random {
        self.key.sequence()
    }
}

/// A writable map of one number a part of the frame, row by row without gaps.
pub struct HeatmapMut<'a> {
    values: &'a mut [f32],
    width: usize,
}

impl<'a> HeatmapMut<'a> {
    /// A map over `values`.
    ///
    /// # Errors
    /// If the number of values is not `width * height`, or zero.
    pub fn new(values: &'a mut [f32], width: usize, height: usize) -> Result<Self> {
        if values.is_empty() || width.checked_mul(height) != Some(values.len()) {
            return Err(Error::new(format!("{} values cannot hold a {width}x{height} map", values.len())));
        }
        Ok(Self { values, width })
    }

    /// Values in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// All values.
    pub fn values_mut(&mut self) -> &mut [f32] {
        self.values
    }

    /// The values of row `y`.
    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.values[y * self.width..(y + 1) * self.width]
    }
}

/// What a saliency method knows, as it crosses.
pub(crate) fn map_context(cx: &MapContext<'_>) -> pdk_abi::MapContext {
    pdk_abi::MapContext {
        frame_index: cx.frame_index,
        time: cx.time,
        key: cx.key.0,
        speed: cx.speed.unwrap_or(f64::NAN),
        flags: if cx.recorded { map_flag::RECORDED } else { 0 },
        ..empty()
    }
}

/// What a saliency method knows where the other side says nothing.
pub(crate) fn unsaid_map_context() -> pdk_abi::MapContext {
    pdk_abi::MapContext { speed: f64::NAN, ..empty() }
}

/// What a saliency method knows.
pub(crate) fn read_map_context<'a>(raw: &pdk_abi::MapContext, key: &'a Key) -> MapContext<'a> {
    MapContext {
        speed: Some(raw.speed).filter(|speed| !speed.is_nan()),
        recorded: raw.flags & map_flag::RECORDED != 0,
        ..MapContext::new(raw.frame_index, raw.time, key)
    }
}

functions! { Saliency as SaliencyFunctions:
    fn map_size(component, _, width: usize, height: usize, into: *mut pdk_abi::MapSize) {
        let [width, height] = component.map_size(width, height)?;
        store(pdk_abi::MapSize { width, height, ..empty() }, into);
        Ok(())
    }
    fn map(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::MapContext,
        map: *const pdk_abi::Heatmap
    ) {
        let raw = load(context, unsaid_map_context());
        let key = Key(raw.key);
        let pdk_abi::Heatmap { values, width, height, .. } = load(map, empty());
        let values = convert::slice_mut(values, width.saturating_mul(height));
        component.map(convert::source(frame)?, &read_map_context(&raw, &key), HeatmapMut::new(values, width, height)?)
    }
}

/// An instance in a plugin.
pub(crate) struct Host(Object<SaliencyFunctionsRef>);

impl Host {
    pub(crate) fn new(object: Object<SaliencyFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Saliency for Host {
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        let Object { pointer, functions, .. } = self.0;
        let mut size = empty::<pdk_abi::MapSize>();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.map_size()(pointer, width, height, &mut size, error) })?;
        if !(1..=width).contains(&size.width) || !(1..=height).contains(&size.height) {
            let sentence = format!(
                "its map of a frame of {width}x{height} has {}x{} values, but has to have 1x1 at least and {width}x{height} at most",
                size.width, size.height
            );
            return Err(Error::of(ErrorKind::Nonsense, sentence));
        }
        Ok([size.width, size.height])
    }

    fn map(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let frame = convert::frame(frame);
        let context = map_context(cx);
        let (width, height) = (out.width(), out.height());
        let heatmap = pdk_abi::Heatmap { values: out.values_mut().as_mut_ptr(), width, height, ..empty() };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.map()(pointer, &frame, &context, &heatmap, error) })
    }
}

/// Checks that a saliency map has values from 0 to 1 and comes out the same twice.
///
/// # Errors
/// The first check that fails.
pub fn check(_: &Description, config: &Config, make: Make<'_, dyn Saliency>) -> Result<()> {
    let mut method = make(config)?;
    let frame = sample_frame(160, 120);
    let [width, height] = method.map_size(160, 120)?;
    ensure((1..=160).contains(&width) && (1..=120).contains(&height), || {
        format!(
            "its map of a frame of 160x120 has {width}x{height} values; it has to have one, and no more than the frame has pixels"
        )
    })?;
    let key = Key([9; 32]);
    let mut maps = [vec![f32::NAN; width * height], vec![f32::NAN; width * height]];
    for map in &mut maps {
        let cx = MapContext::new(5, 0.25, &key);
        method.map(frame.as_ref(), &cx, HeatmapMut::new(map, width, height)?)?;
        ensure(map.iter().all(|value| (0.0..=1.0).contains(value)), || {
            "its map has values that are not from 0 to 1, or that were not written".to_owned()
        })?;
    }
    ensure(maps[0] == maps[1], || "the same frame gives two maps".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_saliency_method_knows_crosses_as_it_is() {
        let key = Key([3; 32]);
        let known = MapContext { speed: Some(0.0), recorded: true, ..MapContext::new(4, 0.5, &key) };
        for cx in [known, MapContext::new(5, 1.0, &key)] {
            let raw = map_context(&cx);
            let read = read_map_context(&raw, &key);
            assert_eq!(
                (read.frame_index, read.time, read.speed, read.recorded),
                (cx.frame_index, cx.time, cx.speed, cx.recorded)
            );
        }
        assert_eq!(read_map_context(&unsaid_map_context(), &key).speed, None);
    }
}
