//! Perturbations as the user names them.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::attention::Attention;
use crate::component::{check_values, unfold, without_value};
use crate::during::During;
use crate::error::{Error, Result};
use crate::level::{DEFAULT_LEVEL, Level, MAX_INTENSITY};
use crate::level_scale::LevelScale;
use crate::region::Region;
use crate::selection::Selection;
use crate::text::{parse_value, split_outside_brackets};

/// Something that can be set for every perturbation, on the command line as `NAME,MODIFIER=VALUE`.
#[derive(Debug, Clone, Copy)]
pub struct Modifier {
    /// The name under which it is set.
    pub name: &'static str,
    /// What it does, in one sentence.
    pub doc: &'static str,
    /// What else there is to know, in further sentences; may be empty.
    pub details: &'static str,
    /// Values, as they are written on the command line.
    pub examples: &'static [&'static str],
    /// Its type in Luau.
    pub luau_type: &'static str,
    /// Its type in Python.
    pub python: &'static str,
}

/// Writes [`AppliedPerturbation`], how its modifiers are read and written, and [`MODIFIERS`], from a list of
/// `field: type as "name", reader, "what it does" { what else there is to know }`.
macro_rules! modifiers {
    ($($field:ident: $type:ty as $name:literal, $read:expr, $doc:literal { $($more:tt)* })*) => {
        /// A perturbation as the user names it: at an intensity, with parameters, and with what limits it.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        pub struct AppliedPerturbation {
            /// The component's name.
            pub name: String,
            /// The intensity.
            pub level: Level,
            $(
                #[doc = $doc]
                #[serde(default, rename = $name, skip_serializing_if = "Option::is_none")]
                pub $field: Option<$type>,
            )*
            /// Parameters that the user sets.
            #[serde(default, skip_serializing_if = "Map::is_empty")]
            pub parameters: Map<String, Value>,
        }

        /// What every perturbation takes besides its own parameters.
        pub const MODIFIERS: &[Modifier] = &[LEVEL, $(Modifier { name: $name, doc: $doc, $($more)* }),*];

        impl AppliedPerturbation {
            /// One without modifiers.
            fn bare(name: String, level: Level, parameters: Map<String, Value>) -> Self {
                Self { name, level, $($field: None,)* parameters }
            }

            /// Takes the modifiers out of the parameters, among which users write them.
            fn take_modifiers(&mut self) -> Result<()> {
                $(if let Some(value) = take(&self.name, &mut self.parameters, $name)? {
                    let read: fn(&str, &Value) -> Result<$type> = $read;
                    self.$field = Some(read(&self.name, &value)?);
                })*
                Ok(())
            }

            /// The modifiers that are set, as they are written.
            fn written_modifiers(&self) -> String {
                let set = [$(self.$field.as_ref().map(|value| format!(",{}={}", $name, json(value)))),*];
                set.into_iter().flatten().collect()
            }

            /// Takes a modifier over from another one; whether there is one of this name.
            pub fn take_over(&mut self, name: &str, other: &mut Self) -> bool {
                match name {
                    "level" => self.level = other.level.clone(),
                    $($name => self.$field = other.$field.take(),)*
                    _ => return false,
                }
                true
            }
        }
    };
}

/// The intensity, which is also written behind the name.
const LEVEL: Modifier = Modifier {
    name: "level",
    doc: "Its intensity: any number from 0 to 4, or a course of such numbers over time in seconds.",
    details: "A number may also follow the name: `NAME@2.5`.",
    examples: &[
        "2.5",
        r#"{"ramp":{"from":0,"to":4,"start":2,"end":10}}"#,
        r#"{"pulse":{"level":3,"rest":1,"period":4,"duration":0.5,"start":1}}"#,
        r#"{"points":[[0,0],[2,4],[5,1]]}"#,
    ],
    luau_type: "(number | Schedule | ((time: number) -> number))?",
    python: "float | Mapping[str, Any]",
};

modifiers! {
    probability: f64 as "probability", chance, "The chance that a frame is perturbed, drawn for each frame." {
        details: "",
        examples: &["0.8"],
        luau_type: "number?",
        python: "float",
    }
    region: Region as "region", |name, value| placed(name, Region::from_json(value)), "The part of the frame that is perturbed." {
        details: "A box is left, top, right, bottom, a polygon has corners of x and y, all as shares of the width and height; a \
                  mask is an image that is stretched over the frame: white is perturbed, black or transparent is not, what lies \
                  between is blended.",
        examples: &[
            r#"{"box":[0,0.5,1,1]}"#,
            r#"{"polygon":[[0.1,1],[0.4,0.5],[0.6,0.5],[0.9,1]]}"#,
            r#"{"mask":"FILE.png"}"#,
        ],
        luau_type: "Region?",
        python: "Mapping[str, Any] | Sequence[float]",
    }
    during: During as "during", |name, value| placed(name, During::from_json(value)), "The part of the drive that is perturbed." {
        details: "A span of time in seconds, of which `from` is in it and `to` is not, and a box in its frames as for `region`. What is left out does not \
                  limit it. `except` is another such part, which is not perturbed.",
        examples: &[
            r#"{"from":2,"to":3.5}"#,
            r#"{"to":3.5,"box":[0,0.5,1,1]}"#,
            r#"{"except":{"from":2,"to":3.5,"box":[0,0.5,1,1]}}"#,
        ],
        luau_type: "During?",
        python: "Mapping[str, Any]",
    }
    selection: Selection as "where", |name, value| placed(name, Selection::from_json(value)),
    "The pixels that are perturbed, by a saliency map of the frame as the camera saw it, by what they show, or by a mask." {
        details: "`top`, `bottom`, `random` and `above` take a share of the frame from a map that the saliency method `by` makes, `label`, `nearer` \
              and `farther` what a simulator knows of the pixels, and `mask` what another component or a script says. `every`, `change` \
              and `follow` say when a map is made anew; `close`, `smallest` and `soft` smooth what was selected. Together with `region`, \
              what both leave is perturbed.",
        examples: &[
        r#"{"top":20,"by":"METHOD,model=FILE.onnx"}"#,
        r#"{"bottom":20,"by":"METHOD,model=FILE.onnx","every":10,"follow":true,"soft":3}"#,
        r#"{"random":20}"#,
        r#"{"label":["road","vehicle"]}"#,
        r#"{"farther":20,"nearer":60}"#,
        r#"{"mask":"MASK,model=FILE.onnx,classes=7"}"#,
        r#"{"above":0.5,"by":"METHOD,model=FILE.onnx,layer=conv_5","close":2,"smallest":30}"#,
    ],
        luau_type: "Selection?",
        python: "Mapping[str, Any]",
    }
    attention: Attention as "attention", |name, value| placed(name, Attention::from_json(value)),
    "The saliency maps that the perturbation itself follows, for those that do, such as drops that are born where a map is high." {
        details: "A saliency method with its parameters, or a table of such a method as `by` and of `every`, `change` and `follow`, as \
                  for `where`. `pdk show NAME` says whether a perturbation follows maps, and how.",
        examples: &[r#""METHOD,model=FILE.onnx""#, r#"{"by":"METHOD,model=FILE.onnx","every":5,"follow":true}"#],
        luau_type: "(string | Attention)?",
        python: "str | Mapping[str, Any]",
    }
    level_scale: LevelScale as "level_scale", |name, value| placed(name, LevelScale::from_json(value)),
    "The scale that its level is on, if it is not the published one, such as one on which a level means the same for every perturbation." {
        details: "`pdk show NAME` lists the scales that a perturbation was measured for, and how far it reaches on each; `pdk calibrate` measures \
                  one of your own.",
        examples: &["SCALE"],
        luau_type: "(string | { name: string, version: number, points: { { number } } })?",
        python: "str | Mapping[str, Any]",
    }
    draws: Draws as "draws", draws, "Draw everything anew for every frame, or once." {
        details: "If it is not set, every perturbation does what the real effect would do: noise is drawn for every frame, \
              where drops sit once for all frames of a sequence; `pdk show NAME` says which.",
        examples: &["per_frame", "per_sequence"],
        luau_type: "(\"per_frame\" | \"per_sequence\")?",
        python: "Literal[\"per_frame\", \"per_sequence\"]",
    }
}

/// The chance that is set for a perturbation.
fn chance(name: &str, value: &Value) -> Result<f64> {
    match value.as_f64() {
        Some(chance) if (0.0..=1.0).contains(&chance) => Ok(chance),
        _ => Err(Error::new(format!(
            "the probability of `{name}` is {value}, but has to be a number from 0 to 1"
        ))),
    }
}

/// When a perturbation draws.
fn draws(name: &str, value: &Value) -> Result<Draws> {
    serde_json::from_value(value.clone()).map_err(|_| {
        Error::new(format!("`draws` of `{name}` is {value}, but has to be \"per_frame\" or \"per_sequence\""))
    })
}

/// An error of a modifier with the perturbation that it is set for.
fn placed<T>(name: &str, read: Result<T>) -> Result<T> {
    read.map_err(|error| error.at(format_args!("perturbation `{name}`")))
}

/// Takes a value out of a table.
///
/// # Errors
/// If it is null.
fn take(name: &str, table: &mut Map<String, Value>, key: &str) -> Result<Option<Value>> {
    match table.shift_remove(key) {
        Some(Value::Null) => Err(without_value(name, key)),
        value => Ok(value),
    }
}

/// When random numbers are drawn, against what the perturbation itself would do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Draws {
    /// Everything anew for every frame.
    PerFrame,
    /// Everything once: all frames have the same noise.
    PerSequence,
}

impl AppliedPerturbation {
    /// A perturbation at a level.
    pub fn new(name: &str, level: f64) -> Self {
        Self::bare(name.to_owned(), Level::Constant(level), Map::new())
    }

    /// The same perturbation at another level.
    pub fn at_level(self, level: f64) -> Self {
        Self { level: Level::Constant(level), ..self }
    }

    /// Reads `NAME` or `NAME@LEVEL`, with parameters behind it: `NAME@LEVEL,key=value,...`. Without a level it is
    /// [`DEFAULT_LEVEL`].
    ///
    /// # Errors
    /// If the level is not a number from 0 to 4, or a parameter has no value.
    pub fn parse(text: &str) -> Result<Self> {
        Self::from_table(&read_text(text)?)
    }

    /// Reads a perturbation from a script: a text as for [`AppliedPerturbation::parse`], or a table with `name`, [`MODIFIERS`] and
    /// parameters, which may stand in a table `parameters` as they do in records.
    ///
    /// # Errors
    /// If it is neither, or one of them is out of range or null.
    pub fn from_json(value: &Value) -> Result<Self> {
        Self::from_table(&read(value)?)
    }

    /// Reads a perturbation whose levels are set later, by [`AppliedPerturbation::at_level`].
    ///
    /// # Errors
    /// As [`AppliedPerturbation::from_json`], and if it has a level of its own.
    pub fn from_json_without_level(value: &Value) -> Result<Self> {
        let table = read(value)?;
        if table.contains_key("level") {
            return Err(Error::new(format!(
                "the perturbation {value} has a level of its own; leave it out, because each is evaluated at all `levels`"
            )));
        }
        Self::from_table(&table)
    }

    fn from_table(table: &Map<String, Value>) -> Result<Self> {
        let mut parameters = table.clone();
        let name = match parameters.shift_remove("name") {
            Some(Value::String(name)) if !name.is_empty() => name,
            _ => {
                let table = Value::Object(table.clone());
                return Err(Error::new(format!("the perturbation {table} has no `name`")));
            }
        };
        let level = match take(&name, &mut parameters, "level")? {
            None => Level::Constant(DEFAULT_LEVEL),
            Some(level) => Level::from_json(&name, &level)?,
        };
        let mut applied = Self::bare(name, level, parameters);
        applied.take_modifiers()?;
        unfold(&applied.name, &mut applied.parameters)?;
        check_values(&applied.name, &applied.parameters)?;
        Ok(applied)
    }

    /// What it is without its level, as it is written on the command line: `NAME,key=value,...`. It tells two of the same
    /// name with other parameters apart.
    pub fn label(&self) -> String {
        format!("{}{}", self.name, self.conditions())
    }

    /// What it is in the name of a scenario, for which a course of intensities has too many numbers.
    pub fn short_name(&self) -> String {
        match self.level.constant() {
            Some(_) => self.to_string(),
            None => format!("{} over time", self.label()),
        }
    }

    /// What stands behind the name and the level, each part with a comma before it.
    fn conditions(&self) -> String {
        let parameters = self.parameters.iter().map(|(key, value)| format!(",{key}={value}"));
        std::iter::once(self.written_modifiers()).chain(parameters).collect()
    }
}

impl fmt::Display for AppliedPerturbation {
    /// As it is written on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.level.constant() {
            Some(level) => write!(f, "{}@{level}", self.name)?,
            None => write!(f, "{},level={}", self.name, json(&self.level))?,
        }
        f.write_str(&self.conditions())
    }
}

/// The table that a text or a table stands for.
fn read(value: &Value) -> Result<Map<String, Value>> {
    match value {
        Value::String(text) => read_text(text),
        Value::Object(table) => Ok(table.clone()),
        other => Err(Error::new(format!(
            "{other} is not a perturbation; write \"name@level\" or {{ name = ..., level = ... }}"
        ))),
    }
}

/// The table that a text stands for.
fn read_text(text: &str) -> Result<Map<String, Value>> {
    let mut parts = split_outside_brackets(text).into_iter();
    let head = parts.next().unwrap_or_default();
    let (name, level) = head.split_once('@').map_or((head, None), |(name, level)| (name, Some(level)));
    if name.is_empty() {
        return Err(Error::new(format!(
            "`{text}` names no perturbation; write NAME, NAME@LEVEL or NAME@LEVEL,PARAMETER=VALUE"
        )));
    }
    let mut table = Map::from_iter([("name".to_owned(), Value::from(name))]);
    if let Some(level) = level {
        if level.is_empty() {
            return Err(Error::new(format!(
                "the level in `{head}` is missing; write a number from 0 to {MAX_INTENSITY} after the @, or leave the @ out"
            )));
        }
        let level = Level::from_json(head, &parse_value(level)?)?;
        table.insert("level".to_owned(), serde_json::to_value(level)?);
    }
    for part in parts {
        let (key, value) = part.split_once('=').ok_or_else(|| {
            Error::new(format!(
                "`{part}` in `{text}` sets nothing; write a parameter as name=value, and another perturbation by itself (with another \
                 --with on the command line)"
            ))
        })?;
        if table.insert(key.to_owned(), parse_value(value)?).is_some() {
            return Err(Error::new(format!("`{text}` sets `{key}` twice; leave one out")));
        }
    }
    Ok(table)
}

/// A value as a user writes it in JSON; what cannot be written is empty.
fn json(value: &impl Serialize) -> String {
    match serde_json::to_value(value).map(as_written) {
        // Digits without an exponent.
        Ok(Value::Number(number)) => number.as_f64().unwrap_or_default().to_string(),
        Ok(value) => value.to_string(),
        Err(_) => String::new(),
    }
}

/// The same without what users leave out: the fraction of a whole number, and the tables around a component's parameters, and around its
/// name if it has none.
fn as_written(value: Value) -> Value {
    match value {
        Value::Number(number) => match number.as_f64() {
            // Every number up to 2^53 is whole exactly.
            Some(float) if number.is_f64() && float.fract() == 0.0 && float.abs() < 9e15 => {
                (float as i64).into()
            }
            _ => Value::Number(number),
        },
        Value::Array(values) => values.into_iter().map(as_written).collect(),
        Value::Object(mut table) => {
            if table.contains_key("name")
                && let Some(Value::Object(parameters)) = table.get("parameters").cloned()
            {
                table.shift_remove("parameters");
                table.extend(parameters);
            }
            // What was measured for a scale is not what users write.
            let is_scale = table.len() == 3 && table.contains_key("version") && table.contains_key("points");
            match table.get("name") {
                Some(name @ Value::String(_)) if table.len() == 1 || is_scale => name.clone(),
                _ => table.into_iter().map(|(key, value)| (key, as_written(value))).collect(),
            }
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn parse(text: &str) -> AppliedPerturbation {
        AppliedPerturbation::parse(text).unwrap()
    }

    fn error(text: &str) -> String {
        AppliedPerturbation::parse(text).unwrap_err().to_string()
    }

    #[test]
    fn reads_what_users_write() {
        assert_eq!(parse("fog@2.5"), AppliedPerturbation::new("fog", 2.5));
        let spec = parse("fog@1,mode=soft,size=3");
        assert_eq!(spec.parameters, *json!({"mode": "soft", "size": 3}).as_object().unwrap());
        let limited = r#"fog@1,probability=0.5,region={"box":[0,0.5,1,1]},draws="per_frame""#;
        assert_eq!(parse(limited).to_string(), limited);
        assert_eq!(spec.to_string(), "fog@1,mode=\"soft\",size=3");
        assert_eq!(spec.label(), "fog,mode=\"soft\",size=3");
        assert_eq!(parse("fog@.5,s=.1").to_string(), "fog@0.5,s=0.1");
    }

    #[test]
    fn a_level_left_out_is_the_middle_of_the_scale_wherever_it_is_left_out() {
        assert_eq!(DEFAULT_LEVEL, 2.0);
        let default = AppliedPerturbation::new("fog", DEFAULT_LEVEL);
        assert_eq!(parse("fog"), default);
        for value in [json!("fog"), json!({"name": "fog"})] {
            assert_eq!(AppliedPerturbation::from_json(&value).unwrap(), default);
            assert_eq!(AppliedPerturbation::from_json_without_level(&value).unwrap(), default);
        }
    }

    #[test]
    fn levels_may_be_set_later() {
        let without = AppliedPerturbation::from_json_without_level(&json!("fog,size=3")).unwrap();
        assert_eq!(without.at_level(4.0), parse("fog@4,size=3"));
        for value in [json!("fog@2"), json!("fog,level=2"), json!({"name": "fog", "level": 2})] {
            let error = AppliedPerturbation::from_json_without_level(&value).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("the perturbation {value} has a level of its own; leave it out")),
                "{error}"
            );
        }
    }

    #[test]
    fn what_a_record_holds_is_read_back() {
        for text in [
            "fog@2.5,size=3",
            r#"fog,level={"ramp":{"from":0,"to":4,"start":0,"end":2}},size=3,mode="soft""#,
            r#"fog@1,probability=0.5,region={"box":[0,0.5,1,1]},draws="per_frame""#,
            r#"fog@1,where={"mask":{"name":"road_mask","size":3}}"#,
            r#"fog@1,where={"top":20,"by":{"name":"hirescam","model":"a.onnx"},"every":5},size=3"#,
            r#"fog@1,attention={"by":{"name":"hirescam","model":"a.onnx"}}"#,
        ] {
            let applied = parse(text);
            let recorded = serde_json::to_value(&applied).unwrap();
            assert_eq!(AppliedPerturbation::from_json(&recorded).unwrap(), applied, "{recorded}");
        }
        let both = json!({"name": "fog", "size": 3, "parameters": {"size": 4}});
        let error = AppliedPerturbation::from_json(&both).unwrap_err().to_string();
        assert_eq!(error, "`size` of `fog` is set twice, beside the name and in `parameters`; leave one out");
    }

    #[test]
    fn what_is_shown_is_read_back() {
        for text in [
            "fog@2.5,size=3",
            r#"fog,level={"ramp":{"from":0,"to":4,"start":0,"end":2}},size=3"#,
            r#"fog,level={"frames":{"rate":20,"levels":[[0,3],1.5]}},probability=0.5"#,
            r#"fog@1,where={"mask":"road_mask"}"#,
            r#"fog@1,where={"mask":{"name":"road_mask","size":3}}"#,
            r#"fog@1,where={"farther":30}"#,
        ] {
            assert_eq!(parse(text).to_string(), text);
        }
        assert_eq!(parse("fog@1,s=2").short_name(), "fog@1,s=2");
        assert_eq!(parse(r#"fog,level={"points":[[0,1]]},s=2"#).short_name(), "fog,s=2 over time");
    }

    #[test]
    fn a_name_without_a_component_is_reported() {
        for text in ["", "@2", ",size=3"] {
            let error = error(text);
            assert!(error.starts_with(&format!("`{text}` names no perturbation; write NAME")), "{error}");
        }
        let nameless = AppliedPerturbation::from_json(&json!({"name": ""})).unwrap_err().to_string();
        assert!(nameless.contains("has no `name`"), "{nameless}");
    }

    #[test]
    fn refuses_levels_outside_the_scale() {
        for text in ["fog@9", "fog@-1", "fog@nan", "fog@x", "fog@null"] {
            let error = error(text);
            assert!(error.ends_with("has to be a number from 0 to 4"), "{error}");
        }
        for text in ["fog@", "fog@,size=1"] {
            assert_eq!(
                error(text),
                "the level in `fog@` is missing; write a number from 0 to 4 after the @, or leave the @ out"
            );
        }
        assert!(AppliedPerturbation::from_json(&json!({"name": "fog", "level": "high"})).is_err());
        assert!(AppliedPerturbation::from_json(&json!(3)).is_err());
        assert_eq!(
            error("fog@1,probability=2"),
            "the probability of `fog` is 2, but has to be a number from 0 to 1"
        );
        for (text, twice) in
            [("fog@1,size=1,size=2", "size"), ("fog@1,level=2", "level"), ("fog,name=rain", "name")]
        {
            assert_eq!(error(text), format!("`{text}` sets `{twice}` twice; leave one out"));
        }
        assert!(error("fog@1,draws=often").contains("per_sequence"));
        assert_eq!(
            error("fog,rain"),
            "`rain` in `fog,rain` sets nothing; write a parameter as name=value, and another perturbation by itself (with another --with \
             on the command line)"
        );
    }

    #[test]
    fn null_is_refused_by_name_whatever_it_is_set_for() {
        for key in ["level", "probability", "region", "draws", "size"] {
            let mut value = json!({"name": "fog"});
            value[key] = json!(f64::NAN);
            let error = AppliedPerturbation::from_json(&value).unwrap_err().to_string();
            assert!(error.starts_with(&format!("`{key}` of `fog` is null")), "{error}");
        }
    }
}
