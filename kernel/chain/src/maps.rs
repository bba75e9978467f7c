//! Saliency maps of the frames of a sequence: when one is made, and how long it is used.

use pdk_model::component::ComponentSpec;
use pdk_model::pace::Pace;
use pdk_sdk::describe::{Description, Kind, Role};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Frame, FrameBuf, HeatmapMut, Key, MapContext, Saliency};

use crate::moment::Moment;
use pdk_components::held::Held;
use pdk_components::registry::Registry;
use pdk_ops::cells;
use pdk_ops::compare::mean_difference;
use pdk_ops::motion::{self, Motion};
use pdk_supervise::calls::{self, Function};

/// Says for which frames a map is made, from the raw frames alone.
pub struct Turns {
    pace: Pace,
    /// Which map is in use: the number of its frame where it stays until a change, else that divided by how long it stays.
    period: Option<u64>,
    /// The number of the last frame that was asked about.
    last: Option<u64>,
    /// The frame whose map is in use, where others are compared with it.
    seen: FrameBuf,
    size: (usize, usize),
    motion: Motion,
}

/// The map that a frame is to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turn {
    /// What tells this map from others of the sequence.
    pub period: u64,
    /// Whether it has to be made of this very frame.
    pub new: bool,
    /// By how many pixels the image has moved right and down since.
    pub moved: [isize; 2],
}

impl Turns {
    /// For a sequence.
    pub fn new(pace: Pace) -> Self {
        let (seen, motion) = (FrameBuf::default(), Motion::default());
        Self { pace, period: None, last: None, seen, size: (0, 0), motion }
    }

    /// Goes on with another sequence.
    pub fn begin_again(&mut self) {
        (self.period, self.last) = (None, None);
    }

    /// Which map a frame has. A frame whose number is not larger than the last one's has a map of its own: it may be the same moment in another
    /// state, or an earlier one.
    pub fn of(&mut self, raw: Frame<'_>, moment: &Moment<'_>) -> Turn {
        let Pace { every, change, follow } = self.pace;
        let size = (raw.width(), raw.height());
        let goes_on = self.size == size && self.last.is_none_or(|last| moment.frame_index > last);
        self.last = Some(moment.frame_index);
        let period = match (change, self.period) {
            _ if moment.alone => moment.frame_index,
            (None, _) => moment.frame_index / every,
            (Some(change), Some(period)) if goes_on && mean_difference(self.seen.as_ref(), raw) <= change => {
                period
            }
            (Some(_), _) => moment.frame_index,
        };
        let new = moment.alone || self.period != Some(period) || !goes_on;
        if new {
            (self.period, self.size) = (Some(period), size);
            if change.is_some() {
                self.seen.resize(raw.width(), raw.height());
                self.seen.as_mut().copy_from(raw);
            }
            if follow {
                self.motion.begin(raw);
            }
        }
        let moved = if follow && !new { self.motion.since(raw) } else { [0, 0] };
        Turn { period, new, moved }
    }
}

/// The maps of a sequence by a method.
pub struct Maps {
    method: Held<dyn Saliency>,
    description: Description,
    key: Key,
    /// Whether the maps have a single line of cells, once that is known.
    line: Option<Option<Line>>,
    /// The map that was made last: by cells as the method gave it, and for each pixel.
    cells: Vec<f32>,
    made: Vec<f32>,
    /// The same where the image is by now.
    now: Vec<f32>,
}

impl Maps {
    /// Makes the method.
    ///
    /// # Errors
    /// If there is no such method, or it refuses its parameters.
    pub fn new(registry: &Registry, by: &ComponentSpec, key: Key) -> Result<Self> {
        let (method, _) = registry.saliency(&by.name, &by.parameters)?;
        let description = registry.catalog().get(Kind::Saliency, &by.name)?.description.clone();
        Ok(Self::from_method(Held::new(Kind::Saliency, by.clone(), method), description, key))
    }

    pub(crate) fn from_method(method: Held<dyn Saliency>, description: Description, key: Key) -> Self {
        Self { method, description, key, line: None, cells: Vec::new(), made: Vec::new(), now: Vec::new() }
    }

    /// What a user should know about the maps that were made.
    pub fn noticed(&self) -> Option<String> {
        self.line.flatten().map(|line| line.noticed(self.method.component(), &self.description))
    }

    /// Draws from another key.
    pub fn set_key(&mut self, key: Key) {
        self.key = key;
    }

    /// The map that a frame has, a value from 0 to 1 for each pixel, row by row.
    ///
    /// # Errors
    /// If the method fails.
    pub fn of(&mut self, raw: Frame<'_>, moment: &Moment<'_>, turn: Turn) -> Result<&[f32]> {
        if turn.new {
            let Self { method, key, cells, made, .. } = &mut *self;
            let cx = context(moment, key);
            let size = method
                .call(Function::Map, Some(cx.frame_index), |method| map_cells(method, raw, &cx, cells))?;
            fit(cells, size, raw, made);
            // One that is the same everywhere says nothing about the others.
            if self.line.is_none() && self.made.iter().any(|value| *value != self.made[0]) {
                self.line = Some(Line::of(&self.made, raw.width()));
            }
        }
        if turn.moved == [0, 0] {
            return Ok(&self.made);
        }
        motion::moved(&self.made, raw.width(), turn.moved, &mut self.now);
        Ok(&self.now)
    }
}

/// What a map is made of that has a single line of cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// One row: each column of pixels has one value.
    Row,
    /// One column: each row of pixels has one value.
    Column,
}

impl Line {
    /// What a map of a frame's size is made of, if that is a single line of cells. One that is the same everywhere may be made of any.
    pub fn of(map: &[f32], width: usize) -> Option<Self> {
        let constant = |values: &[f32]| values.iter().all(|value| *value == values[0]);
        if width < 2 || map.len() <= width || constant(map) {
            return None;
        }
        let rows = || map.chunks_exact(width);
        if rows().all(|row| row == &map[..width]) {
            Some(Self::Row)
        } else {
            rows().all(constant).then_some(Self::Column)
        }
    }

    /// What a user should know about the maps of a method.
    pub fn noticed(self, by: &ComponentSpec, method: &Description) -> String {
        let parameter = |role| method.with_role(role).map_or("", |parameter| parameter.name.as_str());
        let (layered, networked) = (parameter(Role::Layer), parameter(Role::Network));
        let text = |name: &str| by.parameters.get(name).and_then(|value| value.as_str()).unwrap_or_default();
        let (line, what) = match self {
            Self::Row => ("row", "near from far"),
            Self::Column => ("column", "left from right"),
        };
        let layer = match (layered, text(layered)) {
            ("", _) => String::new(),
            (_, "") => " by its default layer".to_owned(),
            (_, layer) => format!(" by layer `{layer}`"),
        };
        let model = match text(networked) {
            "" => String::new(),
            model => format!(" of model `{model}`"),
        };
        let mut remedies = Vec::new();
        if !layered.is_empty() {
            remedies.push(format!("name a layer that has several in both directions with `{layered}`"));
        }
        if !method.finer.is_empty() {
            remedies.push(format!("use `{}`", method.finer));
        }
        if remedies.is_empty() {
            remedies.push("use another method".to_owned());
        }
        format!(
            "the maps of saliency `{}`{layer}{model} have a single {line} of cells, so they cannot tell {what}; {}",
            by.name,
            remedies.join(", or ")
        )
    }
}

/// What a method knows of a frame.
pub fn context<'a>(moment: &Moment<'_>, key: &'a Key) -> MapContext<'a> {
    let Moment { frame_index, time, speed, alone, .. } = *moment;
    MapContext { speed, recorded: alone, ..MapContext::new(frame_index, time, key) }
}

/// The map of a frame by a method, brought to the size of the frame. `label` is what messages call the method.
///
/// # Errors
/// If the method fails, or a value is not a number.
pub fn map(
    method: &mut dyn Saliency,
    label: &str,
    frame: Frame<'_>,
    cx: &MapContext<'_>,
) -> Result<Vec<f32>> {
    let (mut cells, mut into) = (Vec::new(), Vec::new());
    let work = || map_cells(method, frame, cx, &mut cells);
    let size = calls::call_at(label, Function::Map, cx.frame_index, work).map_err(|error| error.at(label))?;
    fit(&mut cells, size, frame, &mut into);
    Ok(into)
}

/// The map of a frame by cells, and how many it has in a row and rows.
fn map_cells(
    method: &mut dyn Saliency,
    frame: Frame<'_>,
    cx: &MapContext<'_>,
    cells: &mut Vec<f32>,
) -> Result<[usize; 2]> {
    let [width, height] = method.map_size(frame.width(), frame.height())?;
    cells.clear();
    cells.resize(width * height, 0.0);
    method.map(frame, cx, HeatmapMut::new(cells, width, height)?)?;
    match cells.iter().all(|value| value.is_finite()) {
        true => Ok([width, height]),
        false => {
            let sentence = format!("its map of frame {} holds numbers that are not finite", cx.frame_index);
            Err(Error::new(sentence))
        }
    }
}

/// Brings a map by cells to the size of its frame.
fn fit(cells: &mut Vec<f32>, size: [usize; 2], frame: Frame<'_>, into: &mut Vec<f32>) {
    let wanted = [frame.width(), frame.height()];
    match size == wanted {
        true => std::mem::swap(cells, into),
        false => cells::stretch(cells, size, wanted, into),
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::describe::Parameter;

    use super::*;

    fn pace(every: u64, change: Option<f64>) -> Pace {
        Pace { every, change, follow: false }
    }

    fn shade(value: u8) -> FrameBuf {
        FrameBuf::from_vec(vec![value; 20 * 20 * 3], 20, 20).unwrap()
    }

    fn turns(pace: Pace, shades: &[u8], alone: bool) -> Vec<(u64, bool)> {
        let mut turns = Turns::new(pace);
        let turn = |(at, &value): (usize, &u8)| {
            let moment = Moment { alone, ..Moment::new(at as u64, 0.0) };
            let turn = turns.of(shade(value).as_ref(), &moment);
            (turn.period, turn.new)
        };
        shades.iter().enumerate().map(turn).collect()
    }

    #[test]
    fn a_map_stays_for_its_frames() {
        let found = turns(pace(3, None), &[1, 2, 3, 4, 5], false);
        assert_eq!(found, [(0, true), (0, false), (0, false), (1, true), (1, false)]);
        // A later period is the same whatever came before it.
        let mut late = Turns::new(pace(3, None));
        assert_eq!(
            late.of(shade(9).as_ref(), &Moment::new(4, 0.0)),
            Turn { period: 1, new: true, moved: [0, 0] }
        );
        // A frame that counts for itself has a map of its own.
        assert_eq!(turns(pace(3, None), &[1, 2, 3], true), [(0, true), (1, true), (2, true)]);
    }

    #[test]
    fn a_map_stays_until_the_frame_changes() {
        let found = turns(pace(1, Some(10.0)), &[100, 106, 110, 111, 105], false);
        assert_eq!(found, [(0, true), (0, false), (0, false), (3, true), (3, false)]);
        // Slow changes add up: what counts is the distance from the map's own frame.
        assert_eq!(turns(pace(1, Some(10.0)), &[100, 105, 111], false)[2], (2, true));
        assert_eq!(turns(pace(1, Some(10.0)), &[100, 111, 111], true)[2], (2, true));
    }

    #[test]
    fn a_frame_with_the_same_or_an_earlier_number_has_a_map_of_its_own() {
        for pace in [pace(1, None), pace(3, None), pace(1, Some(10.0))] {
            let mut turns = Turns::new(pace);
            let mut is_new = |index| turns.of(shade(100).as_ref(), &Moment::new(index, 0.0)).new;
            assert!(is_new(7) && is_new(7) && is_new(6) && is_new(6), "{pace:?}");
        }
    }

    #[test]
    fn a_single_line_of_cells_is_noticed() {
        assert_eq!(Line::of(&[0.1, 0.2, 0.1, 0.2], 2), Some(Line::Row));
        assert_eq!(Line::of(&[0.1, 0.1, 0.2, 0.2], 2), Some(Line::Column));
        assert_eq!(Line::of(&[0.1, 0.1, 0.2, 0.3], 2), None);
        assert_eq!(Line::of(&[0.1, 0.2, 0.1, 0.3], 2), None);
        // One that is the same everywhere may be made of any cells, and a frame of a single line has no others.
        assert_eq!(Line::of(&[0.5; 6], 3), None);
        assert_eq!(Line::of(&[0.1, 0.2], 2), None);
        assert_eq!(Line::of(&[0.1, 0.2], 1), None);
        let by = ComponentSpec::parse("saliency method", "hirescam,net=a.onnx,at=conv_4").unwrap();
        let method = Description::saliency("hirescam", "x")
            .parameter(Parameter::path("net", "the network").role(Role::Network))
            .parameter(Parameter::text("at", "the layer").role(Role::Layer))
            .finer("gradient");
        assert_eq!(
            Line::Row.noticed(&by, &method),
            "the maps of saliency `hirescam` by layer `conv_4` of model `a.onnx` have a single row of cells, so they cannot tell near \
             from far; name a layer that has several in both directions with `at`, or use `gradient`"
        );
        let by = ComponentSpec::new("marks");
        assert_eq!(
            Line::Column.noticed(&by, &Description::saliency("marks", "x")),
            "the maps of saliency `marks` have a single column of cells, so they cannot tell left from right; use another method"
        );
    }
}
