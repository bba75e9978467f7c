//! The check of the layout: it is compared with the one that was recorded for this version, in `layout/VERSION.txt`.
//!
//! When a library is opened, abi_stable proves that its functions are those of the host. Two things remain for this check. abi_stable
//! does not compare the structures of calls behind their size, and does not know what numbers stand for. And it says at the user's place
//! that a plugin no longer fits, not here: a function that was added after the first version is in no plugin of the tests.
//!
//! Tables and structures may grow at their end, and numbers may be added. That fails as well, until it is recorded:
//! `PDK_BLESS=1 cargo test --release -p pdk-abi`. Any other change is refused even then: it takes another `VERSION`, for which there
//! is not a file yet.

use std::collections::BTreeMap;
use std::path::PathBuf;

use abi_stable::StableAbi;
use abi_stable::type_layout::{TLData, TLFunction, TypeLayout};

use crate::{PluginRef, VERSION, annotation, fixed, map_flag, sized, state_flag, way};

/// The variable that has the layout recorded.
const RECORD: &str = "PDK_BLESS";

/// The layout of a structure.
pub(crate) struct Structure {
    pub name: &'static str,
    pub size: usize,
    /// Offset, size, name and type of each field.
    pub fields: Vec<(usize, usize, &'static str, &'static str)>,
}

/// The layout of a structure, from its name and fields.
macro_rules! structure {
    ($name:ident { $($field:ident: $type:ty),* }) => {
        crate::layout::Structure {
            name: stringify!($name),
            size: size_of::<$name>(),
            fields: vec![
                $((core::mem::offset_of!($name, $field), size_of::<$type>(), stringify!($field), stringify!($type))),*
            ],
        }
    };
}
pub(crate) use structure;

/// The lines of each structure and set of numbers, by a title that begins with how they may change.
type Layout = BTreeMap<String, Vec<String>>;

/// The layout as it is.
fn present() -> Layout {
    let mut layout = Layout::new();
    tables(<PluginRef as StableAbi>::LAYOUT, &mut layout);
    for Structure { name, fields, .. } in sized::layouts() {
        let lines = fields.into_iter().map(|(offset, size, name, kind)| {
            // However the compiler breaks lines.
            let kind = kind.split_whitespace().collect::<Vec<_>>().join(" ");
            format!("{offset} {size} {name} {kind}")
        });
        layout.insert(format!("sized {name}"), lines.collect());
    }
    for (name, numbers) in [
        ("status", fixed::status::ALL),
        ("state_flag", state_flag::ALL),
        ("map_flag", map_flag::ALL),
        ("annotation", annotation::ALL),
        ("way", way::ALL),
    ] {
        let lines = numbers.iter().map(|(name, number)| format!("{number} {name}"));
        layout.insert(format!("numbers {name}"), lines.collect());
    }
    layout
}

/// The tables of functions that a type leads to, as abi_stable compares them.
fn tables(of: &'static TypeLayout, layout: &mut Layout) {
    of.generics().type_params().iter().for_each(|inner| tables(inner(), layout));
    let table = match of.data() {
        TLData::PrefixType(table) => table,
        TLData::Struct { fields } => return fields.iter().for_each(|field| tables(field.layout(), layout)),
        _ => return,
    };
    let title = format!("functions {}", of.name());
    if layout.contains_key(&title) {
        return;
    }
    let functions: Vec<TLFunction> = table.fields.iter().flat_map(|field| field.function_range()).collect();
    assert_eq!(functions.len(), table.fields.len(), "{title} has something besides functions");
    layout.insert(title, functions.iter().map(line).collect());
    for parameter in functions.iter().flat_map(|function| function.param_type_layouts.iter()) {
        tables(parameter(), layout);
    }
}

/// Name, parameters and result of a function.
fn line(function: &TLFunction) -> String {
    let names = function.param_names.as_str().split(',');
    let parameters = names.zip(function.param_type_layouts.iter());
    let parameters: Vec<_> = parameters.map(|(name, of)| format!("{name}: {}", spelt(of()))).collect();
    let result = function.return_type_layout().map(|of| format!(" -> {}", spelt(of())));
    format!("{}({}){}", function.name, parameters.join(", "), result.unwrap_or_default())
}

/// A type as Rust writes it.
fn spelt(of: &'static TypeLayout) -> String {
    let inner: Vec<_> = of.generics().type_params().iter().map(|inner| spelt(inner())).collect();
    match (of.name(), &inner[..]) {
        ("Instance", []) => {
            let fields = of.get_fields().into_iter().flat_map(|fields| fields.to_vec());
            let fields: Vec<_> =
                fields.map(|field| format!("{}: {}", field.name(), spelt(field.layout()))).collect();
            format!("Instance {{ {} }}", fields.join(", "))
        }
        (name, []) => name.to_owned(),
        // The pointer to a table.
        ("PrefixRef", [table]) => format!("{table}Ref"),
        (pointer, [to]) if pointer.starts_with('*') => format!("{pointer} {to}"),
        (name, inner) => format!("{name}<{}>", inner.join(", ")),
    }
}

fn write(layout: &Layout) -> String {
    let block = |(title, lines): (&String, &Vec<String>)| format!("{title}\n  {}\n", lines.join("\n  "));
    layout.iter().map(block).collect::<Vec<_>>().join("\n")
}

fn read(text: &str) -> Layout {
    let mut layout = Layout::new();
    let mut title = String::new();
    for line in text.lines().filter(|line| !line.is_empty()) {
        match line.strip_prefix("  ") {
            Some(line) => layout.entry(title.clone()).or_default().push(line.to_owned()),
            None => title = line.to_owned(),
        }
    }
    layout
}

/// What a plugin of the recorded layout would trip over, a clause each.
fn broken(recorded: &Layout, present: &Layout) -> Vec<String> {
    let mut broken = Vec::new();
    for (title, was) in recorded {
        let Some(is) = present.get(title) else {
            broken.push(format!("`{title}` is gone"));
            continue;
        };
        if !is.starts_with(was) {
            broken.push(format!("`{title}` was\n  {}\nand is\n  {}", was.join("\n  "), is.join("\n  ")));
        }
    }
    broken
}

#[test]
#[cfg(target_pointer_width = "64")]
fn the_layout_is_the_one_that_was_recorded_for_this_version() {
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("layout/{VERSION}.txt"));
    let recorded = std::fs::read_to_string(&file).ok();
    let present = present();
    let shown = file.display();
    if let Some(recorded) = &recorded {
        let broken = broken(&read(recorded), &present);
        assert!(
            broken.is_empty(),
            "plugins of version {VERSION} would no longer work; undo this, or raise VERSION (docs/abi.md):\n{}",
            broken.join("\n")
        );
    }
    if recorded.as_deref() == Some(&write(&present)) {
        return;
    }
    assert!(
        std::env::var_os(RECORD).is_some(),
        "the layout has grown beyond {shown}; record it with {RECORD}=1 cargo test --release -p pdk-abi"
    );
    std::fs::write(&file, write(&present)).unwrap();
}

#[test]
fn the_package_has_the_version_of_the_interface() {
    assert_eq!(env!("CARGO_PKG_VERSION_MAJOR"), VERSION.to_string());
}

#[test]
fn no_structure_has_padding_which_a_new_field_could_fill() {
    for Structure { name, size, fields } in sized::layouts() {
        assert_eq!(fields.iter().map(|(_, size, ..)| size).sum::<usize>(), size, "{name}");
        assert_eq!((fields[0].0, fields[0].2), (0, "size"), "{name}");
    }
}

#[test]
fn growth_at_the_end_is_compatible_and_every_other_change_breaks() {
    let recorded =
        read("functions A\n  a(b: u64)\n\nsized B\n  0 8 size usize\n  8 8 b f64\n\nnumbers c\n  1 ONE\n");
    let breaks = |from: &str, to: &str| {
        let text = write(&recorded);
        assert!(text.contains(from));
        !broken(&recorded, &read(&text.replace(from, to))).is_empty()
    };
    assert_eq!(read(&write(&recorded)), recorded);
    for (from, to) in [
        ("a(b: u64)\n", "a(b: u64)\n  more()\n"),
        ("8 8 b f64\n", "8 8 b f64\n  16 8 more f64\n"),
        ("1 ONE\n", "1 ONE\n  2 TWO\n"),
        ("sized B", "sized A\n  0 8 size usize\n\nsized B"),
    ] {
        assert!(!breaks(from, to), "{to}");
    }
    for (from, to) in [
        ("a(b: u64)", "a(b: u32)"),
        ("a(b: u64)", "a(c: u64)"),
        ("  8 8 b f64\n", ""),
        ("8 8 b f64", "8 8 b u64"),
        ("8 8 b f64", "8 8 more f64\n  16 8 b f64"),
        ("sized B", "sized D"),
        ("1 ONE", "2 ONE"),
    ] {
        assert!(breaks(from, to), "{to}");
    }
}
