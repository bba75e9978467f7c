//! What the files of a dataset are.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::form::Form;
use serde_json::Value;
use walkdir::{DirEntry, WalkDir};

use crate::labels::{coco, lines, records, yolo};

/// The largest file of labels that is read, in bytes.
pub const LARGEST_LABELS: u64 = 2 << 30;
/// Folders in which a PNG file is a mask of the picture with the same name.
const MASK_FOLDERS: &[&str] =
    &["masks", "mask", "annotations", "segmentation", "SegmentationClass", "SegmentationObject"];

/// What a file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// A picture to perturb.
    Picture,
    /// A mask of a picture: a value for each pixel, in PNG.
    Mask,
    /// Boxes or polygons of a picture, one a line, as YOLO has them.
    Yolo,
    /// Points of lines of a picture, a line each, as CULane has them.
    Lines,
    /// Boxes, polygons, masks and keypoints of many pictures, as COCO has them.
    Coco,
    /// Records with steering.
    Records,
    /// A table with the steering of all frames.
    Table,
    /// The lengths of the lines of a file of records.
    Lengths,
    /// Frames of a recording that are not files of their own.
    Frames,
    /// What was recorded beside them, which the reader of the recording writes where steering changes its sign.
    Beside,
    /// Labels that pdk knows but cannot move.
    Fixed,
    /// Anything else.
    Other,
}

impl Role {
    /// What several are called, for people.
    pub fn name(self) -> &'static str {
        self.names()[1]
    }

    /// What one is called, and what several are.
    pub fn names(self) -> [&'static str; 2] {
        match self {
            Self::Picture => ["picture", "pictures"],
            Self::Mask => ["mask", "masks"],
            Self::Yolo => {
                ["label file with a box or polygon a line", "label files with a box or polygon a line"]
            }
            Self::Lines => {
                ["label file with a line of points a line", "label files with a line of points a line"]
            }
            Self::Coco => ["file of COCO annotations", "COCO annotations"],
            Self::Records | Self::Table | Self::Lengths | Self::Beside => {
                ["record with steering", "records with steering"]
            }
            Self::Frames => ["file with frames", "files with frames"],
            Self::Fixed => ["file of labels in XML", "labels in XML"],
            Self::Other => ["other file", "other files"],
        }
    }

    /// Whether it says where something is in a picture.
    pub fn is_placed(self) -> bool {
        matches!(self, Self::Mask | Self::Yolo | Self::Lines | Self::Coco | Self::Fixed)
    }
}

/// The files of a dataset by their paths in its folder, with `/` between folders.
#[derive(Debug, Default)]
pub struct Contents {
    /// The role of each file.
    pub roles: BTreeMap<String, Role>,
    /// The labels of a picture alone, by the picture.
    pub companions: BTreeMap<String, Vec<String>>,
    /// The pictures by their names without folder.
    named: BTreeMap<String, Vec<String>>,
}

impl Contents {
    /// Looks at all files of a folder.
    ///
    /// # Errors
    /// If a file cannot be read, or its name is not text.
    pub fn of(folder: &Path, mask_folders: &[String]) -> Result<Self> {
        let names = names(folder)?;
        let is_mask_folder = |part: &str| {
            MASK_FOLDERS.contains(&part) || mask_folders.iter().any(|folder| folder.trim_matches('/') == part)
        };
        let in_masks = |name: &str| {
            let folder = name.rsplit_once('/').map_or("", |(folder, _)| folder);
            folder.split('/').any(is_mask_folder)
                || mask_folders.iter().any(|given| given.trim_matches('/') == folder)
        };
        let mut contents = Self::default();
        let (mut masks, mut others) = (Vec::new(), Vec::new());
        // The pictures by their names without folder and ending.
        let mut stems: BTreeMap<String, Vec<String>> = BTreeMap::new();
        for name in names {
            if name.to_ascii_lowercase().ends_with(".png") && in_masks(&name) {
                masks.push(name);
            } else if is_picture(&name) {
                stems.entry(stem(&name).to_owned()).or_default().push(name.clone());
                contents.named.entry(file_of(&name).to_owned()).or_default().push(name.clone());
                contents.roles.insert(name, Role::Picture);
            } else {
                others.push(name);
            }
        }
        for name in masks {
            match nearest(&stems, &name) {
                Some(picture) => contents.add_companion(picture, name, Role::Mask),
                None => {
                    contents.roles.insert(name, Role::Other);
                }
            }
        }
        for name in others {
            contents.sort_in(folder, &stems, name)?;
        }
        Ok(contents)
    }

    /// The files of a recording that its reader writes; if all others of its folder belong to it, these are what they are, whatever is in them.
    ///
    /// # Errors
    /// If the folder cannot be listed, or a name is not text.
    pub fn of_form(form: &Form) -> Result<Self> {
        let mut contents = Self::default();
        if form.whole {
            contents.roles.extend(names(&form.folder)?.into_iter().map(|name| (name, Role::Other)));
        }
        for file in &form.files {
            let role = if file.frames > 0 { Role::Frames } else { Role::Beside };
            contents.roles.insert(file.name.clone(), role);
        }
        Ok(contents)
    }

    fn add_companion(&mut self, picture: &str, name: String, role: Role) {
        self.companions.entry(picture.to_owned()).or_default().push(name.clone());
        self.roles.insert(name, role);
    }

    /// Finds out what a file is that is not a picture.
    fn sort_in(&mut self, folder: &Path, stems: &BTreeMap<String, Vec<String>>, name: String) -> Result<()> {
        let path = folder.join(&name);
        let text =
            |largest| file::read_text(&path, largest).place(format_args!("cannot read `{}`", path.display()));
        let ending = name.rsplit_once('.').map(|(_, ending)| ending).unwrap_or_default();
        let role = match ending {
            "txt" => {
                let of_lines = name
                    .strip_suffix(".lines.txt")
                    .and_then(|before| nearest(stems, &format!("{before}.txt")));
                match (of_lines, nearest(stems, &name)) {
                    (Some(picture), _) if lines::fits(&text(LARGEST_LABELS)?) => {
                        self.add_companion(picture, name, Role::Lines);
                        return Ok(());
                    }
                    (None, Some(picture)) if yolo::fits(&text(LARGEST_LABELS)?) => {
                        self.add_companion(picture, name, Role::Yolo);
                        return Ok(());
                    }
                    _ => Role::Other,
                }
            }
            "json" => match serde_json::from_str::<Value>(&text(LARGEST_LABELS)?) {
                Ok(value) if coco::fits(&value) => Role::Coco,
                Ok(value) if records::fits(&value) => Role::Records,
                _ => Role::Other,
            },
            "catalog" => match text(LARGEST_LABELS)?.lines().next().map(serde_json::from_str::<Value>) {
                Some(Ok(value)) if records::fits(&value) => Role::Records,
                _ => Role::Other,
            },
            "catalog_manifest" => Role::Lengths,
            "xml" if text(LARGEST_LABELS).is_ok_and(|text| text.contains("<bndbox")) => Role::Fixed,
            _ => Role::Other,
        };
        self.roles.insert(name, role);
        Ok(())
    }

    /// The files of a role.
    pub fn of_role(&self, role: Role) -> impl Iterator<Item = &str> {
        self.roles.iter().filter(move |(_, found)| **found == role).map(|(name, _)| name.as_str())
    }

    /// The picture that a file of labels means by a path or a name, as far as it is clear: its place in the folder of the dataset, or the
    /// only picture whose path ends with it; of several the one that lies nearest to the file of labels.
    pub fn picture_named(&self, wanted: &str, by: &str) -> Option<&str> {
        let wanted = wanted.trim_start_matches("./");
        if let Some((name, Role::Picture)) = self.roles.get_key_value(wanted) {
            return Some(name);
        }
        let behind = format!("/{wanted}");
        let same = self.named.get(file_of(wanted)).map(Vec::as_slice).unwrap_or_default();
        let found: Vec<&str> =
            same.iter().map(String::as_str).filter(|name| name.ends_with(&behind)).collect();
        match found.as_slice() {
            [] => None,
            [one] => Some(one),
            // Such as annotations/instances_val2017.json for val2017/000001.jpg.
            several => {
                let folder = |name: &str| {
                    name.trim_end_matches(&behind).rsplit('/').next().unwrap_or_default().to_owned()
                };
                let mut of_set =
                    several.iter().filter(|name| stem(by).split(['_', '-']).any(|part| part == folder(name)));
                match (of_set.next(), of_set.next()) {
                    (Some(one), None) => Some(one),
                    _ => None,
                }
            }
        }
    }
}

/// The files of a folder and of the folders in it that are not hidden.
fn names(folder: &Path) -> Result<BTreeSet<String>> {
    let mut names = BTreeSet::new();
    // The folder itself may be hidden, or be `.`.
    let hidden = |entry: &DirEntry| entry.depth() > 0 && entry.file_name().to_string_lossy().starts_with('.');
    for entry in WalkDir::new(folder).follow_links(true).into_iter().filter_entry(|entry| !hidden(entry)) {
        let entry = entry.place(format_args!("cannot list {}", folder.display()))?;
        if !entry.file_type().is_file() {
            continue;
        }
        let path = entry.path().strip_prefix(folder).unwrap_or(entry.path());
        let name = path.to_str().ok_or_else(|| {
            Error::new(format!("the name of {} is not UTF-8; rename it", entry.path().display()))
        })?;
        names.insert(name.to_owned());
    }
    Ok(names)
}

/// Whether a file is a picture by its name.
pub fn is_picture(name: &str) -> bool {
    let lower = name.to_ascii_lowercase();
    [".jpg", ".jpeg", ".png", ".bmp", ".webp"].iter().any(|ending| lower.ends_with(ending))
}

/// A name without folder.
fn file_of(name: &str) -> &str {
    name.rsplit_once('/').map_or(name, |(_, file)| file)
}

/// A name without folder and ending.
fn stem(name: &str) -> &str {
    let file = file_of(name);
    file.rsplit_once('.').map_or(file, |(stem, _)| stem)
}

/// The picture with the name of a file of labels: the only one, or the one whose folders differ from those of the file in one name.
fn nearest<'a>(stems: &'a BTreeMap<String, Vec<String>>, name: &str) -> Option<&'a str> {
    let pictures = stems.get(stem(name))?;
    let folders = |name: &str| name.split('/').rev().skip(1).map(str::to_owned).collect::<Vec<_>>();
    let own = folders(name);
    let differing = |picture: &&String| {
        let other = folders(picture);
        match other.len() == own.len() {
            true => other.iter().zip(&own).filter(|(a, b)| a != b).count(),
            false => usize::MAX,
        }
    };
    match pictures.as_slice() {
        [one] => Some(one),
        several => {
            let least = several.iter().map(|picture| differing(&picture)).min()?;
            let mut near = several.iter().filter(|picture| differing(picture) == least && least <= 1);
            match (near.next(), near.next()) {
                (Some(one), None) => Some(one),
                _ => None,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kinds_of_files_are_distinguished() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        };
        for name in [
            "images/train/a.jpg",
            "images/val/a.jpg",
            "val2017/b.png",
            "masks/train/c.png",
            "images/train/c.jpg",
        ] {
            write(name, "");
        }
        write("labels/val/a.txt", "0 0.5 0.5 0.1 0.2\n3 0.1 0.1 0.2 0.1 0.2 0.2\n");
        write("images/train/c.lines.txt", "1 2 3 4\n");
        write("readme.txt", "0 1 2 3 4");
        write("annotations/instances_val2017.json", r#"{"images": [], "annotations": []}"#);
        write("record_1.json", r#"{"user/angle": 0.5}"#);
        write("voc.xml", "<annotation><bndbox/></annotation>");
        write(".hidden", "");
        write(".thumbnails/images/val/a.jpg", "");
        let contents = Contents::of(dir.path(), &[]).unwrap();
        let role = |name: &str| contents.roles[name];
        assert_eq!(role("masks/train/c.png"), Role::Mask);
        assert_eq!(contents.companions["images/val/a.jpg"], ["labels/val/a.txt"]);
        assert_eq!(
            contents.companions["images/train/c.jpg"],
            ["masks/train/c.png", "images/train/c.lines.txt"]
        );
        assert_eq!(role("annotations/instances_val2017.json"), Role::Coco);
        assert_eq!(
            (role("record_1.json"), role("voc.xml"), role("readme.txt")),
            (Role::Records, Role::Fixed, Role::Other)
        );
        assert!(contents.roles.keys().all(|name| !name.starts_with('.')), "{:?}", contents.roles);
        assert_eq!(
            contents.picture_named("b.png", "annotations/instances_val2017.json"),
            Some("val2017/b.png")
        );
        assert_eq!(contents.picture_named("a.jpg", "annotations/all.json"), None);
        assert_eq!(contents.picture_named("a.jpg", "annotations/all_val.json"), Some("images/val/a.jpg"));
    }
}
