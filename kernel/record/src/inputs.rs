//! The content of groups of files, such as those of a dataset, as one hash each.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use pdk_sdk::input_files::InputFiles;

use crate::files::{FileRecord, recorded};

/// Groups of this many files at most have a record of each file too, so that a difference is named.
const FEW: usize = 64;
/// What stands for the size and the hash of a file that cannot be read.
const UNREADABLE: (u64, [u8; 32]) = (u64::MAX, [0; 32]);

/// Called with the number of files read so far and the total. An error stops the reading.
pub type Tick<'a> = dyn FnMut(usize, usize) -> Result<()> + 'a;

/// The records of a group of files: one of all together, and one of each if they are few.
///
/// # Errors
/// What `tick` returns.
pub fn records(group: &InputFiles, tick: &mut Tick<'_>) -> Result<Vec<FileRecord>> {
    let InputFiles { what, folder, names } = group;
    let mut names: Vec<&PathBuf> = names.iter().collect();
    names.sort();
    names.dedup();
    let contents = contents(folder, &names, tick)?;
    let mut hasher = blake3::Hasher::new_derive_key("pdk input files, version 1");
    for (name, (size, hash)) in names.iter().zip(&contents) {
        let name = name.as_os_str().as_encoded_bytes();
        hasher.update(&(name.len() as u64).to_le_bytes()).update(name);
        hasher.update(&size.to_le_bytes()).update(hash);
    }
    let mut records = vec![FileRecord {
        path: recorded(folder),
        group: what.clone(),
        count: names.len(),
        blake3: hasher.finalize().to_hex().to_string(),
    }];
    if names.len() <= FEW {
        let readable = names.iter().zip(&contents).filter(|(_, content)| **content != UNREADABLE);
        records.extend(readable.map(|(name, (_, hash))| {
            FileRecord::new(&folder.join(name), blake3::Hash::from_bytes(*hash).to_hex().to_string())
        }));
    }
    Ok(records)
}

/// The content of the files in a folder as one hash, without what is in its folders.
///
/// # Errors
/// If it cannot be listed.
pub fn of_folder(folder: &Path) -> Result<String> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let entry = entry?;
        names.extend(entry.path().is_file().then(|| PathBuf::from(entry.file_name())));
    }
    let group = InputFiles::new("files", folder, names);
    Ok(records(&group, &mut |_, _| Ok(()))?.swap_remove(0).blake3)
}

/// The size and the hash of each file, read on all processors.
fn contents(folder: &Path, names: &[&PathBuf], tick: &mut Tick<'_>) -> Result<Vec<(u64, [u8; 32])>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(names.len());
    let (next, stopped) = (AtomicUsize::new(0), AtomicBool::new(false));
    let (sender, receiver) = mpsc::channel();
    let mut contents = vec![UNREADABLE; names.len()];
    std::thread::scope(|scope| {
        for _ in 0..threads {
            let (sender, next, stopped) = (sender.clone(), &next, &stopped);
            scope.spawn(move || {
                while let Some((place, name)) = {
                    let place = next.fetch_add(1, Ordering::Relaxed);
                    names.get(place).map(|name| (place, name))
                } {
                    let content = content(&folder.join(name)).unwrap_or(UNREADABLE);
                    if stopped.load(Ordering::Relaxed) || sender.send((place, content)).is_err() {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for (done, (place, content)) in receiver.iter().enumerate() {
            contents[place] = content;
            tick(done + 1, names.len()).inspect_err(|_: &Error| stopped.store(true, Ordering::Relaxed))?;
        }
        Ok(contents)
    })
}

/// The size and the hash of a file; none if it is not a file that can be read, which is for the component to say.
fn content(path: &Path) -> Option<(u64, [u8; 32])> {
    let mut hasher = blake3::Hasher::new();
    let (mut file, _) = file::open(path).ok()?;
    let size = std::io::copy(&mut file, &mut hasher).ok()?;
    Some((size, *hasher.finalize().as_bytes()))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    fn group(folder: &Path, names: &[&str]) -> InputFiles {
        InputFiles::new("pictures", folder, names.iter().map(PathBuf::from).collect())
    }

    fn hash(folder: &Path, names: &[&str]) -> String {
        records(&group(folder, names), &mut |_, _| Ok(())).unwrap()[0].blake3.clone()
    }

    #[test]
    fn the_hash_follows_from_names_and_contents_alone() {
        let folder = std::env::temp_dir().join(format!("pdk-inputs-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        fs::create_dir_all(folder.join("in")).unwrap();
        for (name, text) in [("a", "1"), ("b", "2"), ("in/c", "3")] {
            fs::write(folder.join(name), text).unwrap();
        }
        let all = ["a", "b", "in/c"];
        let before = hash(&folder, &all);
        assert_eq!(before, hash(&folder, &["in/c", "b", "a", "b"]));
        let mut others = vec![hash(&folder, &all[..2]), hash(&folder, &["a", "b", "in/c", "d"])];
        fs::write(folder.join("b"), "3").unwrap();
        others.push(hash(&folder, &all));
        fs::remove_file(folder.join("b")).unwrap();
        others.push(hash(&folder, &all));
        fs::write(folder.join("b"), "2").unwrap();
        fs::rename(folder.join("in/c"), folder.join("in/d")).unwrap();
        others.push(hash(&folder, &["a", "b", "in/d"]));
        others.push(before.clone());
        others.sort();
        others.dedup();
        assert_eq!(others.len(), 6);
        fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn few_files_have_records_of_their_own_and_an_error_ends_the_reading() {
        let folder = std::env::temp_dir().join(format!("pdk-inputs-many-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let names: Vec<String> = (0..FEW + 1).map(|number| format!("{number}.png")).collect();
        names.iter().for_each(|name| fs::write(folder.join(name), name).unwrap());
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let mut ticks = Vec::new();
        let mut tick = |done, all| {
            ticks.push((done, all));
            Ok(())
        };
        let many = records(&group(&folder, &names), &mut tick).unwrap();
        assert_eq!((many.len(), many[0].count), (1, FEW + 1));
        assert_eq!(ticks, (1..=FEW + 1).map(|done| (done, FEW + 1)).collect::<Vec<_>>());
        let few = records(&group(&folder, &names[..FEW]), &mut |_, _| Ok(())).unwrap();
        assert_eq!(few.len(), FEW + 1);
        assert_eq!(few[1].blake3, blake3::hash(b"0.png").to_hex().to_string());
        let stopped = records(&group(&folder, &names), &mut |_, _| Err(Error::new("enough")));
        assert_eq!(stopped.unwrap_err().message(), "enough");
        assert_eq!(records(&group(&folder, &[]), &mut |_, _| Ok(())).unwrap().len(), 1);
        fs::remove_dir_all(folder).unwrap();
    }
}
