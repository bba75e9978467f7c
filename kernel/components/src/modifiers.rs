//! What every perturbation takes besides its own parameters: one list, from which the help, `pdk show`, the reference, the
//! README and the types for editors tell of it.

/// Something that can be set for every perturbation, on the command line as `NAME,MODIFIER=VALUE`.
pub struct Modifier {
    /// The name under which it is set.
    pub name: &'static str,
    /// What it does, in one sentence.
    pub doc: &'static str,
    /// What else there is to know, in further sentences; may be empty.
    pub details: &'static str,
    /// Values, as they are written on the command line.
    pub examples: &'static [&'static str],
}

/// The intensity, which is also written behind the name.
pub const LEVEL: Modifier = Modifier {
    name: "level",
    doc: "Its intensity: 0 to 4, any number in between, or a course of such numbers over time in seconds.",
    details: "A number may also stand behind the name: `NAME@2.5`.",
    examples: &[
        "2.5",
        r#"{"ramp":{"from":0,"to":4,"start":2,"end":10}}"#,
        r#"{"pulse":{"level":3,"rest":1,"period":4,"duration":0.5,"start":1}}"#,
        r#"{"points":[[0,0],[2,4],[5,1]]}"#,
    ],
};

/// Leaves frames out at random.
pub const PROBABILITY: Modifier = Modifier {
    name: "probability",
    doc: "The chance that a frame is perturbed, drawn for each frame.",
    details: "",
    examples: &["0.8"],
};

/// Leaves a part of each frame out.
pub const REGION: Modifier = Modifier {
    name: "region",
    doc: "The part of the frame that is perturbed.",
    details: "A box is left, top, right, bottom, a polygon has corners of x and y, all as shares of the width and height; a \
              mask is an image that is stretched over the frame: white is perturbed, black or transparent is not, what lies \
              between is blended.",
    examples: &[
        r#"{"box":[0,0.5,1,1]}"#,
        r#"{"polygon":[[0.1,1],[0.4,0.5],[0.6,0.5],[0.9,1]]}"#,
        r#"{"mask":"FILE.png"}"#,
    ],
};

/// Leaves out what a saliency map does not mark.
pub const WHERE: Modifier = Modifier {
    name: "where",
    doc: "The pixels that are perturbed, by a saliency map of the frame as the camera saw it, by what they show, or by a mask.",
    details: "`top`, `bottom` and `random` are shares in percent, of which exactly so many pixels are taken; `above` is a value \
              from 0 to 1. `by` is a saliency method with its parameters, the model among them; `pdk list saliency` names them. \
              A map is made of every frame, of one in `every`, or whenever a frame differs from that of the \
              last map by more than `change` on average, of 255; with `follow` it moves with the image until the next one. `close` closes gaps, `smallest` leaves out spots of fewer \
              pixels, and `soft` blends the edges, all in pixels. \
              `label` is what a simulator's own labels say that pixels show, `nearer` and `farther` are distances in metres along the \
              camera's axis, from a simulator that knows them, and `mask` is a component that \
              `pdk list mask` names, or a Lua file of one's own. Together with `region`, what both leave is perturbed.",
    examples: &[
        r#"{"top":20,"by":"METHOD,model=FILE.onnx"}"#,
        r#"{"bottom":20,"by":"METHOD,model=FILE.onnx","every":10,"follow":true,"soft":3}"#,
        r#"{"random":20}"#,
        r#"{"label":["road","vehicle"]}"#,
        r#"{"farther":20,"nearer":60}"#,
        r#"{"mask":"MASK,model=FILE.onnx,classes=7"}"#,
        r#"{"above":0.5,"by":"METHOD,model=FILE.onnx,layer=conv_5","close":2,"smallest":30}"#,
    ],
};

/// Gives the perturbation a saliency map.
pub const ATTENTION: Modifier = Modifier {
    name: "attention",
    doc: "The saliency maps that the perturbation itself follows, for those that do, such as drops that are born where a map is high.",
    details: "A saliency method with its parameters, or a table of such a method as `by` and of `every`, `change` and `follow`, as \
              for `where`. `pdk show NAME` says whether a perturbation follows maps, and how.",
    examples: &[r#""METHOD,model=FILE.onnx""#, r#"{"by":"METHOD,model=FILE.onnx","every":5,"follow":true}"#],
};

/// Says what is drawn when.
pub const DRAWS: Modifier = Modifier {
    name: "draws",
    doc: "Draw everything anew for every frame, or once.",
    details: "Where it is not set, every perturbation does what the real effect would do: noise is drawn for every frame, \
              where drops sit once for all frames of a sequence; `pdk show NAME` says which.",
    examples: &["per_frame", "per_sequence"],
};

/// All of them.
pub const MODIFIERS: [&Modifier; 6] = [&LEVEL, &PROBABILITY, &REGION, &WHERE, &ATTENTION, &DRAWS];

/// One line that names them all.
pub fn names() -> String {
    MODIFIERS.map(|modifier| modifier.name).join(", ")
}

/// All of them as text for a terminal.
pub fn help() -> String {
    let mut text = String::from("Every perturbation also takes, like parameters:\n");
    for modifier in MODIFIERS {
        text += &format!("\n  {}\n      {}", modifier.name, modifier.doc);
        if !modifier.details.is_empty() {
            text += &format!(" {}", modifier.details);
        }
        for example in modifier.examples {
            text += &format!("\n        {}={example}", modifier.name);
        }
        text += "\n";
    }
    text + "\nValues in braces or brackets are JSON; quote them for the shell."
}

/// All of them as a table in Markdown.
pub fn markdown() -> String {
    let rows = MODIFIERS.map(|Modifier { name, doc, details, examples }| {
        let values: Vec<_> = examples.iter().map(|example| format!("`{example}`")).collect();
        let text = if details.is_empty() { String::new() } else { format!(" {details}") };
        format!("| `{name}` | {doc}{text} | {} |\n", values.join("<br>"))
    });
    format!("| modifier | what it does | such as |\n|---|---|---|\n{}", rows.concat())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::perturbation::AppliedPerturbation;

    #[test]
    fn the_examples_are_read_as_what_they_are() {
        for modifier in MODIFIERS {
            for example in modifier.examples {
                let text = format!("fog,{}={example}", modifier.name);
                let spec =
                    AppliedPerturbation::parse(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
                assert!(spec.parameters.is_empty(), "{text} sets a parameter");
                assert_ne!(spec, AppliedPerturbation::parse("fog").unwrap(), "{text} changes nothing");
            }
        }
    }

    #[test]
    fn all_that_can_be_recorded_is_told() {
        let spec = AppliedPerturbation::parse(
            r#"fog@1,probability=0.5,region={"box":[0,0.5,1,1]},where={"random":5},attention="rise",draws=per_frame,own=3"#,
        );
        let recorded = serde_json::to_value(spec.unwrap()).unwrap();
        let told = MODIFIERS.map(|modifier| modifier.name);
        for key in
            recorded.as_object().unwrap().keys().filter(|key| !["name", "parameters"].contains(&key.as_str()))
        {
            assert!(told.contains(&key.as_str()), "{key} is not told of");
        }
        for (text, place) in [(help(), "help"), (markdown(), "Markdown"), (names(), "names")] {
            assert!(told.iter().all(|name| text.contains(name)), "{place}: {text}");
        }
    }
}
