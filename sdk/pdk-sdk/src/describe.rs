//! How a component describes itself. Lists, help, error messages, Lua types and reference pages all derive from it.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_abi::each_kind;
pub use pdk_model::level::LEVELS;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use crate::kinds::Kind;

/// Whether a perturbation looks at one frame only or moves over time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Temporal {
    /// The same effect on every frame, up to per-frame random draws.
    Static,
    /// The effect moves with simulation time.
    Dynamic,
}

/// What a perturbation does to the places of things in the frame, and so to labels that say where something is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Geometry {
    /// Everything stays in its place, though it may be hidden, or smeared from there.
    Kept,
    /// Things move, and [`Perturbation::move_points`](crate::perturbation::Perturbation::move_points) says where to.
    Moved,
    /// Things move, or appear in further places, in a way that it cannot describe.
    Altered,
    /// It does not say, as plugins of before this field. Labels are not kept on trust: a user has to decide.
    #[default]
    #[serde(other)]
    Undeclared,
}

impl Geometry {
    /// Whether it says nothing, which descriptions leave out.
    pub fn is_undeclared(&self) -> bool {
        *self == Self::Undeclared
    }
}

/// What a perturbation changes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActsOn {
    /// Frames, by [`Perturbation::apply`](crate::perturbation::Perturbation::apply).
    #[default]
    Frame,
    /// What the driver gets besides the frame, by [`Perturbation::observe`](crate::perturbation::Perturbation::observe).
    Observation,
    /// What becomes of the driver's control, by [`Perturbation::actuate`](crate::perturbation::Perturbation::actuate).
    Control,
}

impl ActsOn {
    /// Whether it changes frames, which descriptions leave unsaid.
    pub fn is_frame(&self) -> bool {
        *self == Self::Frame
    }

    /// What it changes, in words.
    pub fn text(self) -> &'static str {
        match self {
            Self::Frame => "the frame",
            Self::Observation => "the speed and the time that the driver gets",
            Self::Control => "the control on its way to the vehicle",
        }
    }
}

/// Whose clock a simulator goes by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Clock {
    /// It moves on by one frame for each control and waits for the next one, so that it can be driven in lockstep.
    #[default]
    Stepped,
    /// It goes on by itself while the driver is at work, so that it can be driven in real time only, and no drive comes out
    /// exactly like another.
    Own,
}

impl Clock {
    /// Whether it waits for controls, which descriptions leave unsaid.
    pub fn is_stepped(&self) -> bool {
        *self == Self::Stepped
    }
}

/// The role of a parameter for callers that do not know the component, such as code that shows what a driver looks at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// A network: its file, or the name of a driver that is a network ([`Description::network`]).
    Network,
    /// The layer of a network of which maps are made, by its name.
    Layer,
    /// Which of a network's numbers a map explains: `steering`, `throttle`, or another one that it computes.
    Explained,
    /// How fine a map is: `layer` for a number for each cell of the network's layer, `frame` for one for each pixel.
    Resolution,
    /// The vehicle's speed in metres per second, if nothing else says it.
    Speed,
    /// The file of the picture that a perturbation shows, and that can be trained: see
    /// [`picture_gradient`](crate::perturbation::Perturbation::picture_gradient).
    Picture,
    /// One that this version of the SDK does not know.
    #[serde(other)]
    Unknown,
}

/// A component as it describes itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Description {
    /// The kind of component.
    pub kind: Kind,
    /// The name by which users refer to it; unique within its kind. Lower-case letters, digits and underscores; for a saliency
    /// method also hyphens and pluses.
    pub name: String,
    /// One line that says what it does, without a full stop.
    pub doc: String,
    /// The family under which it is listed, such as `noise`; empty if there is none.
    #[serde(default)]
    pub family: String,
    /// Version of the algorithm. Raised by every change that changes an output.
    pub version: u32,
    /// Whether it moves over time.
    pub temporal: Temporal,
    /// Whether it belongs to the default set: the perturbations that keep a scene valid.
    pub default: bool,
    /// Where the algorithm comes from: a paper or a standard; empty if there is none.
    #[serde(default)]
    pub source: String,
    /// What it computes in one line of mathematics, for the reference; empty if it is not said.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub mathematics: String,
    /// The differences from the published tool, a sentence each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub divergences: Vec<String>,
    /// What it draws once per sequence, such as where drops sit; empty if it draws nothing of the kind.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub drawn_per_sequence: String,
    /// What it draws anew for every frame, such as noise; empty if it draws nothing of the kind.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub drawn_per_frame: String,
    /// What follows the saliency maps that it is given, such as where drops are born; empty if it does not look at any.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub follows_attention: String,
    /// How many frames before the one at hand a perturbation needs.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub history: u32,
    /// What a perturbation does to the places of things in the frame.
    #[serde(default, skip_serializing_if = "Geometry::is_undeclared")]
    pub geometry: Geometry,
    /// What a perturbation changes.
    #[serde(default, skip_serializing_if = "ActsOn::is_frame")]
    pub acts_on: ActsOn,
    /// The choice with which a perturbation needs to know how far away each pixel is; none if it never does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth: Option<Condition>,
    /// The parameters, in the order in which they are listed.
    pub parameters: Vec<Parameter>,
    /// Parameter values with which its strength grows with the intensity, for those whose published levels are out of
    /// order; empty for all others.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub grows_with: Map<String, Value>,
    /// Whether it is the one of its kind that is used if none is named.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub preferred: bool,
    /// Whether it is a search strategy that learns nothing: what it proposes does not depend on results, so parts of the search can be run alone.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub learns_nothing: bool,
    /// Whether it is the search strategy that the others are compared with.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub baseline: bool,
    /// Whether it is a driver that is a network, which saliency methods know by the driver's name.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub network: bool,
    /// Whether it is a saliency method for every network, also one with operators whose gradient is not known.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub gradient_free: bool,
    /// The saliency method to use if the maps of this one are too coarse; empty if there is none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub finer: String,
    /// The source file in which it is described. The functions that begin a description note it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub defined_in: String,
    /// Files that become components of their own; none for most components.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub drop_in: Option<DropIn>,
    /// BLAKE3 of the file that it stands for, such as a network, if that is part of its library; in hexadecimal, empty for all
    /// others. The same file beside a pipeline is the same component.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub blake3: String,
    /// Whose clock a simulator goes by.
    #[serde(default, skip_serializing_if = "Clock::is_stepped")]
    pub clock: Clock,
    /// Whether it needs a program besides pdk that runs, such as a simulator to connect to.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub external: bool,
    /// Parameter values with which `pdk check` runs it, instead of the defaults.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub examples: Vec<Map<String, Value>>,
}

impl Description {
    #[track_caller]
    fn of(kind: Kind, name: &str, doc: &str) -> Self {
        Self {
            kind,
            name: name.to_owned(),
            doc: doc.to_owned(),
            family: String::new(),
            version: 1,
            temporal: Temporal::Static,
            default: true,
            source: String::new(),
            mathematics: String::new(),
            divergences: Vec::new(),
            drawn_per_sequence: String::new(),
            drawn_per_frame: String::new(),
            follows_attention: String::new(),
            history: 0,
            geometry: Geometry::Undeclared,
            acts_on: ActsOn::Frame,
            depth: None,
            parameters: Vec::new(),
            grows_with: Map::new(),
            preferred: false,
            learns_nothing: false,
            baseline: false,
            network: false,
            gradient_free: false,
            finer: String::new(),
            defined_in: std::panic::Location::caller().file().to_owned(),
            drop_in: None,
            blake3: String::new(),
            clock: Clock::Stepped,
            external: false,
            examples: Vec::new(),
        }
    }

    /// Sets the family under which it is listed.
    pub fn family(mut self, family: &str) -> Self {
        self.family = family.to_owned();
        self
    }

    /// Sets the version of the algorithm; 1 if it is not set.
    pub fn version(mut self, version: u32) -> Self {
        self.version = version;
        self
    }

    /// Says that the effect moves over time.
    pub fn dynamic(mut self) -> Self {
        self.temporal = Temporal::Dynamic;
        self
    }

    /// Takes it out of the default set: it is there by name only.
    pub fn not_default(mut self) -> Self {
        self.default = false;
        self
    }

    /// Names the source of the algorithm.
    pub fn source(mut self, source: &str) -> Self {
        self.source = source.to_owned();
        self
    }

    /// Makes it the default of its kind: the one that is used if none is named.
    pub fn preferred(mut self) -> Self {
        self.preferred = true;
        self
    }

    /// Says that it is a search strategy whose proposals do not depend on results.
    pub fn learns_nothing(mut self) -> Self {
        self.learns_nothing = true;
        self
    }

    /// Says that it is the search strategy that the others are compared with.
    pub fn baseline(mut self) -> Self {
        self.baseline = true;
        self
    }

    /// Says that it is a driver that is a network, which saliency methods know by the driver's name.
    pub fn network(mut self) -> Self {
        self.network = true;
        self
    }

    /// Says that it is a saliency method that needs no gradients.
    pub fn gradient_free(mut self) -> Self {
        self.gradient_free = true;
        self
    }

    /// Names the saliency method to use if the maps of this one are too coarse.
    pub fn finer(mut self, method: &str) -> Self {
        self.finer = method.to_owned();
        self
    }

    /// The parameter with this role, if there is one.
    pub fn with_role(&self, role: Role) -> Option<&Parameter> {
        self.parameters.iter().find(|parameter| parameter.role == Some(role))
    }

    /// Makes every file with one of these endings, in a folder of this name, a component of its own: named after the file,
    /// with `parameter` set to its path.
    pub fn drop_in(mut self, folder: &str, endings: &[&str], parameter: &str) -> Self {
        self.drop_in = Some(DropIn {
            folder: folder.to_owned(),
            endings: endings.iter().map(|&ending| ending.to_owned()).collect(),
            parameter: parameter.to_owned(),
            folders: Vec::new(),
        });
        self
    }

    /// Makes folders that hold files with one of these endings drop-ins too, if files are: named after the folder, with the parameter set to
    /// its path. The component lists the files of such a folder itself, by [`Component::input_files`](crate::component::Component).
    pub fn drop_in_folders(mut self, endings: &[&str]) -> Self {
        if let Some(drop_in) = &mut self.drop_in {
            drop_in.folders = endings.iter().map(|&ending| ending.to_owned()).collect();
        }
        self
    }

    /// Adds parameter values with which `pdk check` runs it: an object. Without examples it runs with its defaults.
    pub fn example(mut self, values: Value) -> Self {
        if let Value::Object(values) = values {
            self.examples.push(values);
        }
        self
    }

    /// Says of which file it is made that is part of its library.
    pub fn blake3(mut self, hash: impl Into<String>) -> Self {
        self.blake3 = hash.into();
        self
    }

    /// Says that it is the adapter to a program besides pdk that has to run, such as a simulator to connect to.
    pub fn external(mut self) -> Self {
        self.external = true;
        self
    }

    /// Says that the simulator goes on by itself while the driver is at work: see [`Clock::Own`].
    pub fn own_clock(mut self) -> Self {
        self.clock = Clock::Own;
        self
    }

    /// Says what it computes in one line of mathematics.
    pub fn mathematics(mut self, line: &str) -> Self {
        self.mathematics = line.to_owned();
        self
    }

    /// Says where it differs from the published tool.
    pub fn divergence(mut self, sentence: &str) -> Self {
        self.divergences.push(sentence.to_owned());
        self
    }

    /// Gives parameter values with which its strength grows with the intensity, where the published levels are out of order:
    /// an object.
    pub fn grows_with(mut self, values: Value) -> Self {
        if let Value::Object(values) = values {
            self.grows_with = values;
        }
        self
    }

    /// Says what it draws once per sequence, with [`Context::sequence_random`](crate::perturbation::Context::sequence_random).
    pub fn drawn_per_sequence(mut self, what: &str) -> Self {
        self.drawn_per_sequence = what.to_owned();
        self
    }

    /// Says what it draws anew for every frame, with [`Context::frame_random`](crate::perturbation::Context::frame_random).
    pub fn drawn_per_frame(mut self, what: &str) -> Self {
        self.drawn_per_frame = what.to_owned();
        self
    }

    /// Asks for this many frames before the one at hand, at most [`MOST_FRAMES`](crate::history::MOST_FRAMES): see [`crate::history`]. pdk keeps
    /// a copy of each. What does not [act on](Description::acts_on) frames gets the signals of these frames: see [`crate::signals`].
    pub fn history(mut self, frames: u32) -> Self {
        self.history = frames;
        self
    }

    /// Says what follows the saliency maps that it is given with [`Context::saliency`](crate::perturbation::Context::saliency).
    /// Without it, it cannot be given any.
    pub fn follows_attention(mut self, what: &str) -> Self {
        self.follows_attention = what.to_owned();
        self
    }

    /// Says that everything stays in its place, so that labels of the frame stay true: see [`Geometry::Kept`].
    pub fn keeps_geometry(mut self) -> Self {
        self.geometry = Geometry::Kept;
        self
    }

    /// Says that things move, and that [`Perturbation::move_points`](crate::perturbation::Perturbation::move_points) says where to.
    pub fn moves_geometry(mut self) -> Self {
        self.geometry = Geometry::Moved;
        self
    }

    /// Says that things move, or appear in further places, in a way that it cannot describe: see [`Geometry::Altered`].
    pub fn alters_geometry(mut self) -> Self {
        self.geometry = Geometry::Altered;
        self
    }

    /// Says what it changes: see [`ActsOn`]. Whatever is not a frame is changed in drives alone.
    pub fn acts_on(mut self, what: ActsOn) -> Self {
        self.acts_on = what;
        self
    }

    /// Asks, if the choice `parameter` is `option`, for how far away each pixel is:
    /// [`Context::depth`](crate::perturbation::Context::depth). Simulators that do not know it are refused then.
    pub fn depth_with(mut self, parameter: &str, option: &str) -> Self {
        self.depth = Some(Condition { parameter: parameter.to_owned(), option: option.to_owned() });
        self
    }

    /// Adds a parameter.
    pub fn parameter(mut self, parameter: Parameter) -> Self {
        self.parameters.push(parameter);
        self
    }
}

/// The functions that begin a description, one for each kind.
macro_rules! begin {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        impl Description {
            $(
                #[doc = concat!("Begins the description of a ", $one, ".")]
                #[track_caller]
                pub fn $name(name: &str, doc: &str) -> Self {
                    Self::of(Kind::$kind, name, doc)
                }
            )*
        }
    };
}

each_kind!(begin);

/// Files that become components of their own when they lie in a certain folder.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct DropIn {
    /// The name of the folder; every place where plugins lie may have one.
    pub folder: String,
    /// The endings of the files, without dot, in lower case.
    pub endings: Vec<String>,
    /// The parameter that is set to the file's path.
    pub parameter: String,
    /// The endings, without dot and in lower case, of the files that make their folder a component as well; empty if folders are none.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub folders: Vec<String>,
}

impl DropIn {
    /// Whether a file or a folder becomes a component.
    pub fn takes(&self, path: &Path) -> bool {
        let is_one_of = |path: &Path, endings: &[String]| {
            let ending = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            path.is_file() && endings.contains(&ending)
        };
        if path.is_dir() {
            // A folder that cannot be read has nothing to show.
            let mut files = std::fs::read_dir(path).into_iter().flatten().flatten();
            return !self.folders.is_empty() && files.any(|file| is_one_of(&file.path(), &self.folders));
        }
        is_one_of(path, &self.endings)
    }
}

/// The type of a parameter and what it allows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ParameterType {
    /// A real number within `min..=max`.
    Number {
        /// Smallest value allowed.
        min: f64,
        /// Largest value allowed.
        max: f64,
    },
    /// A whole number within `min..=max`.
    Integer {
        /// Smallest value allowed.
        min: i64,
        /// Largest value allowed.
        max: i64,
    },
    /// True or false.
    Boolean,
    /// One of a few names.
    Choice {
        /// The names.
        options: Vec<String>,
    },
    /// Any text.
    Text,
    /// A file or folder. Relative paths count from the working directory.
    Path,
    /// Any JSON value; the component checks it.
    Json,
}

/// One parameter of a component.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// The name by which users set it.
    pub name: String,
    /// One line that says what it is.
    pub doc: String,
    /// The unit; empty if there is none.
    #[serde(default)]
    pub unit: String,
    /// Type and allowed values.
    #[serde(flatten)]
    pub kind: ParameterType,
    /// The value where neither the user nor the intensity sets one; null where the user has to.
    #[serde(default)]
    pub default: Value,
    /// The published value for each intensity level; values in between are interpolated. With it the parameter follows
    /// the intensity unless the user sets it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<[f64; LEVELS]>,
    /// The choice with which it has an effect; none if it always has one. With any other choice it may not be set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub only_for: Option<Condition>,
    /// What an option stands for on this machine, such as an engine with its version and class; empty for most parameters. An option
    /// is replaced by what it stands for before a scenario gets its id, so that the record says what decided the outcome.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub stands_for: BTreeMap<String, String>,
    /// What it is to those who use the component without knowing it; none for most parameters.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub role: Option<Role>,
    /// Whether its value is a program that the component starts, with or without arguments. Unless it is empty, a record that comes
    /// from elsewhere is replayed only if the user agrees.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub starts_program: bool,
}

/// A choice that has to be made for something to have an effect, such as `variant=corrected`.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Condition {
    /// The parameter with the choice.
    pub parameter: String,
    /// The option that has to be chosen.
    pub option: String,
}

impl std::fmt::Display for Condition {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}={}", self.parameter, self.option)
    }
}

impl Parameter {
    fn of(name: &str, doc: &str, kind: ParameterType, default: Value) -> Self {
        let (name, doc, unit) = (name.to_owned(), doc.to_owned(), String::new());
        let stands_for = BTreeMap::new();
        Self {
            name,
            doc,
            unit,
            kind,
            default,
            levels: None,
            only_for: None,
            stands_for,
            role: None,
            starts_program: false,
        }
    }

    /// A real number that follows the intensity, with its value at each of the five levels.
    pub fn by_level(name: &str, levels: [f64; LEVELS], doc: &str) -> Self {
        let kind = ParameterType::Number { min: f64::MIN, max: f64::MAX };
        Self { levels: Some(levels), ..Self::of(name, doc, kind, Value::Null) }
    }

    /// A real number.
    pub fn number(name: &str, default: f64, doc: &str) -> Self {
        Self::of(name, doc, ParameterType::Number { min: f64::MIN, max: f64::MAX }, default.into())
    }

    /// A whole number.
    pub fn integer(name: &str, default: i64, doc: &str) -> Self {
        Self::of(name, doc, ParameterType::Integer { min: i64::MIN, max: i64::MAX }, default.into())
    }

    /// True or false.
    pub fn boolean(name: &str, default: bool, doc: &str) -> Self {
        Self::of(name, doc, ParameterType::Boolean, default.into())
    }

    /// One of `options`, the first of which is the default.
    pub fn choice(name: &str, options: &[&str], doc: &str) -> Self {
        let kind = ParameterType::Choice { options: options.iter().map(|&o| o.to_owned()).collect() };
        Self::of(name, doc, kind, options.first().copied().unwrap_or_default().into())
    }

    /// Any text; empty if it is not set.
    pub fn text(name: &str, doc: &str) -> Self {
        Self::of(name, doc, ParameterType::Text, "".into())
    }

    /// A file or folder that the user has to name.
    pub fn path(name: &str, doc: &str) -> Self {
        Self::of(name, doc, ParameterType::Path, Value::Null)
    }

    /// Whether the user has to set it: it has no default, unless null is a value like any other.
    pub fn is_required(&self) -> bool {
        self.default.is_null() && self.levels.is_none() && !matches!(self.kind, ParameterType::Json)
    }

    /// Any JSON value, with a default.
    pub fn json(name: &str, default: Value, doc: &str) -> Self {
        Self::of(name, doc, ParameterType::Json, default)
    }

    /// Sets the unit.
    pub fn unit(mut self, unit: &str) -> Self {
        self.unit = unit.to_owned();
        self
    }

    /// Sets the smallest and the largest value allowed, of a number or an integer.
    pub fn range(mut self, low: f64, high: f64) -> Self {
        match &mut self.kind {
            ParameterType::Number { min, max } => (*min, *max) = (low, high),
            ParameterType::Integer { min, max } => (*min, *max) = (low as i64, high as i64),
            _ => {}
        }
        self
    }

    /// Makes it a parameter that has an effect only where the choice `parameter` is `option`. With another option the user
    /// may not set it, and it has no value. Its documentation says so too.
    pub fn only_for(mut self, parameter: &str, option: &str) -> Self {
        let condition = Condition { parameter: parameter.to_owned(), option: option.to_owned() };
        self.doc = format!("{}; only with `{condition}`", self.doc);
        self.only_for = Some(condition);
        self
    }

    /// Says what options stand for on this machine. Besides the options, these values are allowed, and no other machine's.
    pub fn stands_for(mut self, meanings: impl IntoIterator<Item = (String, String)>) -> Self {
        self.stands_for = meanings.into_iter().collect();
        self
    }

    /// Makes it a parameter that may be left out, whatever its type.
    pub fn optional(mut self) -> Self {
        if self.default.is_null() {
            self.default = Value::String(String::new());
        }
        self
    }

    /// Says what it is to those who use the component without knowing it.
    pub fn role(mut self, role: Role) -> Self {
        self.role = Some(role);
        self
    }

    /// Says that its value is a program that the component starts: a text or a list of texts.
    pub fn starts_program(mut self) -> Self {
        self.starts_program = true;
        self
    }

    /// The program in a value of this parameter, with its arguments; none if the value starts none.
    pub fn program(&self, value: &Value) -> Option<Vec<String>> {
        let words: Vec<String> = match value {
            _ if !self.starts_program => return None,
            Value::Null => return None,
            Value::String(program) => vec![program.clone()],
            Value::Array(words) => words
                .iter()
                .map(|word| word.as_str().map_or_else(|| word.to_string(), str::to_owned))
                .collect(),
            other => vec![other.to_string()],
        };
        words.first().is_some_and(|program| !program.is_empty()).then_some(words)
    }

    /// The value at an intensity, for a parameter that follows the intensity: linear between the levels. Outside them, to which only a
    /// measured scale leads, it goes on in the same straight line as far as the parameter's range.
    pub fn at_intensity(&self, intensity: f64) -> Option<f64> {
        self.levels.as_ref().map(|levels| self.in_range(along_levels(levels, intensity), intensity))
    }

    /// A value at an intensity, which is in the parameter's range by itself unless the intensity is outside the levels.
    pub(crate) fn in_range(&self, value: f64, intensity: f64) -> f64 {
        match self.kind {
            _ if (0.0..=(LEVELS - 1) as f64).contains(&intensity) => value,
            // Not `clamp`, which panics if a plugin's range is upside down.
            ParameterType::Number { min, max } => value.max(min).min(max),
            ParameterType::Integer { min, max } => value.max(min as f64).min(max as f64),
            _ => value,
        }
    }
}

/// The value at an intensity of what has these values at the levels: linear between them, and in the line of the nearest two outside them.
pub(crate) fn along_levels(levels: &[f64; LEVELS], intensity: f64) -> f64 {
    // Below 0 the conversion gives 0.
    let lower = (intensity as usize).min(LEVELS - 2);
    let fraction = intensity - lower as f64;
    // Exact at the levels themselves, so that published values come out as published.
    if fraction == 0.0 {
        levels[lower]
    } else if fraction == 1.0 {
        levels[lower + 1]
    } else {
        levels[lower] + (levels[lower + 1] - levels[lower]) * fraction
    }
}

/// Whether a number says nothing, which descriptions leave out.
fn is_zero(number: &u32) -> bool {
    *number == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_interpolate_and_are_exact_at_the_published_ones() {
        let sigma = Parameter::by_level("sigma", [0.03, 0.06, 0.12, 0.18, 0.22], "spread");
        assert_eq!(sigma.at_intensity(0.0), Some(0.03));
        assert_eq!(sigma.at_intensity(4.0), Some(0.22));
        assert_eq!(sigma.at_intensity(1.0), Some(0.06));
        assert!((sigma.at_intensity(1.5).unwrap() - 0.09).abs() < 1e-12);
        assert_eq!(Parameter::number("x", 1.0, "").at_intensity(2.0), None);
    }

    #[test]
    fn outside_the_levels_values_go_on_as_far_as_the_range() {
        let sigma = Parameter::by_level("sigma", [0.25, 0.5, 1.0, 2.0, 4.0], "spread").range(0.0, 9.0);
        assert_eq!(
            [-1.0, -0.5, 5.0, 6.5, 7.0].map(|level| sigma.at_intensity(level).unwrap()),
            [0.0, 0.125, 6.0, 9.0, 9.0]
        );
        let count = Parameter::by_level("count", [5.0, 4.0, 3.0, 2.0, 1.0], "how many").range(0.0, 6.0);
        assert_eq!([-2.0, 4.5, 8.0].map(|level| count.at_intensity(level).unwrap()), [6.0, 0.5, 0.0]);
        let upside_down = Parameter::by_level("x", [1.0, 2.0, 3.0, 4.0, 5.0], "anything").range(9.0, 0.0);
        assert_eq!(upside_down.at_intensity(5.0), Some(0.0));
    }

    #[test]
    fn a_description_survives_the_trip_through_json() {
        let before = Description::perturbation("fog", "Fog")
            .family("weather")
            .dynamic()
            .parameter(
                Parameter::by_level("s", [1.0, 2.0, 3.0, 4.0, 5.0], "strength").range(0.0, 9.0).unit("m"),
            )
            .parameter(Parameter::choice("mode", &["soft", "hard"], "edge"))
            .parameter(Parameter::number("width", 1.0, "width of the edge").only_for("mode", "soft"))
            .parameter(Parameter::path("clip", "the clip"))
            .moves_geometry();
        assert_eq!(before.parameters[2].doc, "width of the edge; only with `mode=soft`");
        let text = serde_json::to_string(&before).unwrap();
        let after: Description = serde_json::from_str(&text).unwrap();
        assert_eq!(before, after);
    }

    #[test]
    fn what_is_not_said_of_the_geometry_is_undeclared() {
        let silent = serde_json::to_value(Description::perturbation("fog", "Fog")).unwrap();
        assert!(silent.get("geometry").is_none());
        let read = |geometry: &str| {
            let mut said = silent.clone();
            said["geometry"] = geometry.into();
            serde_json::from_value::<Description>(said).unwrap().geometry
        };
        // A plugin of a later SDK may say what is not known here.
        assert_eq!(
            ["kept", "moved", "altered", "folded"].map(read),
            [Geometry::Kept, Geometry::Moved, Geometry::Altered, Geometry::Undeclared]
        );
        assert_eq!(
            serde_json::from_value::<Description>(silent.clone()).unwrap().geometry,
            Geometry::Undeclared
        );
    }
}
