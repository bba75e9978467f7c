//! The fields of a description: the one list from which its reading, its errors, the parameters of components, the template and the table
//! in the documents follow.

use pdk_sdk::describe::{Description, Parameter};
use pdk_sdk::serde_json::Value;

/// What a field may be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// One of these names. As a parameter it may also be `auto`: as if it were left out.
    Choice(&'static [&'static str]),
    /// Numbers, lists and tables; the text says which.
    Free(&'static str),
}

/// A field of a description.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Field {
    /// Its name in a file, which is also that of the parameter.
    pub name: &'static str,
    /// What it may be.
    pub kind: Kind,
    /// What holds if it is left out.
    pub default: &'static str,
    /// What it says.
    pub doc: &'static str,
}

/// A choice that is left out.
pub const AUTO: &str = "auto";

const fn field(name: &'static str, kind: Kind, default: &'static str, doc: &'static str) -> Field {
    Field { name, kind, default, doc }
}

/// The field with the waypoints of a network that plans, and what its value looks like.
pub(crate) const WAYPOINTS: &str = "waypoints";
pub(crate) const WAYPOINTS_EXAMPLE: &str =
    "{ output = \"waypoints\", axes = \"forward_left\", interval = 0.5, wheelbase = 2.6, full_lock = 25 }";

/// All fields, in the order in which a frame passes them.
pub const FIELDS: [Field; 22] = [
    field(
        "preset",
        Kind::Choice(&crate::preset::NAMES),
        "none",
        "a description that has a name; fields beside it override its fields",
    ),
    field(
        "frame",
        Kind::Free("[width, height]"),
        "as they come",
        "the size of the camera's frames that crops in pixels are meant for; frames of another size are resized to it first",
    ),
    field(
        "crop",
        Kind::Free("{ top = 60, bottom = 25, left = 0, right = 0 }"),
        "nothing",
        "what is cut off at each side: whole numbers are pixels, numbers below 1 are shares",
    ),
    field(
        "region",
        Kind::Free("[left, top, right, bottom]"),
        "all that the crop leaves",
        "the region of interest, instead of a crop: in pixels, or in shares if no number is above 1",
    ),
    field(
        "image_size",
        Kind::Free("[width, height]"),
        "as the file declares",
        "the size of the network's image, which a file may leave open",
    ),
    field(
        "resize",
        Kind::Choice(&crate::resize::NAMES),
        "bilinear",
        "the filter: bilinear, area and bicubic are OpenCV's, nearest, pil_bilinear and pil_bicubic are PIL's and torchvision's, and linear is pdk's own",
    ),
    field(
        "color",
        Kind::Choice(&crate::color::NAMES),
        "rgb, or grey for one channel",
        "what the channels are, by OpenCV's 8-bit conversions: yuv is COLOR_RGB2YUV, hsv is COLOR_RGB2HSV with hue from 0 to 179",
    ),
    field(
        "scale",
        Kind::Free("\"0..255\", \"0..1\", \"-1..1\", another range, or a factor"),
        "0..255",
        "the range to which bytes are brought, or the factor on them",
    ),
    field("mean", Kind::Free("a number, or one for each channel"), "0", "what is subtracted after the scale"),
    field("std", Kind::Free("a number, or one for each channel"), "1", "what is divided by after that"),
    field(
        "layout",
        Kind::Choice(&crate::declared::LAYOUTS),
        "by the shape",
        "the order of the image's axes: batch n, time t, channels c, height h, width w; frames of a stack are joined along t, or along c if there is no t",
    ),
    field(
        "dtype",
        Kind::Choice(&crate::declared::DTYPES),
        "as the file declares",
        "the type of the image's numbers; bytes are rounded to the nearest",
    ),
    field(
        "frames",
        Kind::Free("a whole number"),
        "1, or the length of axis t",
        "how many frames the image stacks",
    ),
    field("spacing", Kind::Free("a whole number"), "1", "the distance between stacked frames, in frames"),
    field(
        "order",
        Kind::Choice(&["oldest_first", "newest_first"]),
        "oldest_first",
        "the order of stacked frames",
    ),
    field(
        "start",
        Kind::Choice(&["repeat", "zeros"]),
        "repeat",
        "what stands for frames before the first of a sequence: the first, or zeros",
    ),
    field(
        "differences",
        Kind::Choice(&["none", "only", "both"]),
        "none",
        "whether the stack holds the differences of neighbouring frames: only them (one fewer than frames), or the newest frame \
         followed by them",
    ),
    field(
        "inputs",
        Kind::Free("{ NAME = \"image\", \"speed\", \"controls\", a number, a list or a table }"),
        "by name and shape",
        "what each input gets: the image; the speed, as { value = \"speed\", unit = \"km/h\", scale = 1, offset = 0, assumed = 8 }, where \
         assumed is in m/s and stands for a speed that is not known; the controls before, as { value = \"controls\" }; or constants",
    ),
    field(
        "state",
        Kind::Free("{ INPUT = \"OUTPUT\" }"),
        "NAME_in and NAME_out",
        "inputs that get what an output was at the frame before, and zeros at the first",
    ),
    field(
        "steering",
        Kind::Free("\"OUTPUT\" or a table"),
        "the first output",
        "the output that steers, or { output = \"NAME\", index = 0, bins = { from = -1, to = 1, count = 15 }, decode = \"argmax\", scale = 1, \
         offset = 0, clip = [-1, 1] }; bins may be a list of values; decode may also be mean, or softmax_mean for logits",
    ),
    field(
        "throttle",
        Kind::Free("\"OUTPUT\", a table or a number"),
        "the second output or number, or 0.3",
        "the output that gives the throttle, likewise; a number is a constant throttle",
    ),
    field(
        WAYPOINTS,
        Kind::Free(WAYPOINTS_EXAMPLE),
        "the network steers",
        "the output with the waypoints of a network that plans: what their numbers are, the seconds between them, and wheelbase in metres and full \
         lock in degrees of the vehicle that follows them",
    ),
];

/// The fields that say what outputs mean to a driver; the others say what goes in.
const OF_OUTPUTS: [&str; 3] = ["steering", "throttle", WAYPOINTS];

/// The parameters of a component that reads a description.
pub fn parameters(description: Description) -> Description {
    FIELDS.iter().map(parameter).fold(description, Description::parameter)
}

/// The same for a component that does not drive: without the fields of outputs.
pub fn input_parameters(description: Description) -> Description {
    let of_inputs = FIELDS.iter().filter(|field| !OF_OUTPUTS.contains(&field.name));
    of_inputs.map(parameter).fold(description, Description::parameter)
}

/// A field as a parameter.
fn parameter(field: &Field) -> Parameter {
    let doc = match field.kind {
        Kind::Choice(_) => {
            format!("{}; auto: as the file beside the model says, or {}", field.doc, field.default)
        }
        Kind::Free(form) => {
            format!(
                "{} ({form}); left out: as the file beside the model says, or {}",
                field.doc, field.default
            )
        }
    };
    match field.kind {
        Kind::Choice(options) => Parameter::choice(field.name, &[&[AUTO], options].concat(), &doc),
        Kind::Free(_) => Parameter::json(field.name, Value::Null, &doc),
    }
}

/// The fields as a table in Markdown, for the documents.
pub fn table() -> String {
    let mut table = "| field | may be | left out | meaning |\n|---|---|---|---|\n".to_owned();
    for Field { name, kind, default, doc } in FIELDS {
        let form = match kind {
            Kind::Choice(options) => options.iter().map(|o| format!("`{o}`")).collect::<Vec<_>>().join(", "),
            Kind::Free(form) if form.starts_with(['[', '{']) => format!("`{}`", form.replace('|', "\\|")),
            // In a sentence only the texts in quotes are code.
            Kind::Free(form) => {
                form.split('"').enumerate().fold(String::new(), |form, (place, part)| match place % 2 {
                    0 => form + part,
                    _ => form + "`\"" + part + "\"`",
                })
            }
        };
        table.push_str(&format!("| `{name}` | {form} | {default} | {doc} |\n"));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_in_the_documents_is_a_description() {
        let text =
            std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/guide/your-network.md"))
                .unwrap();
        let start = text.find("```toml\n").unwrap() + 8;
        let example = &text[start..start + text[start..].find("```").unwrap()];
        let path = std::env::temp_dir().join(format!("pdk-network-example-{}.toml", std::process::id()));
        std::fs::write(&path, example).unwrap();
        let given = crate::Given::read(&path).unwrap();
        std::fs::remove_file(&path).unwrap();
        let described = crate::Described::new(given).unwrap();
        let steering = described.steering.unwrap();
        assert_eq!(
            (steering.bins.unwrap()[0], described.frames, described.inputs.len()),
            (-25.0, Some(3), 2)
        );
    }

    #[test]
    fn the_table_in_the_documents_is_that_of_the_fields() {
        let page = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/guide/your-network.md");
        let text = std::fs::read_to_string(page).unwrap();
        let start = text.find("| field | may be |").unwrap();
        let end = start + text[start..].find("\n\n").unwrap() + 1;
        if std::env::var_os("PDK_BLESS").is_some() {
            std::fs::write(page, format!("{}{}{}", &text[..start], table(), &text[end..])).unwrap();
            return;
        }
        assert_eq!(&text[start..end], table(), "PDK_BLESS=1 cargo test --release -p pdk-network writes it");
    }
}
