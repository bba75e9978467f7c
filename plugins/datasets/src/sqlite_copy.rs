//! A copy of a file of SQLite in which blobs of one table are others: the pages of that table are built anew, and all other pages stay as
//! they are. Its rows keep their numbers and their other values, so that the indexes hold.

use std::fs::File;
use std::io::{Seek, SeekFrom, Write};
use std::path::Path;

use pdk_sdk::prelude::*;

use crate::sqlite::{Kind, Sqlite, Table};
use crate::sqlite_row::{Value, damaged, own_part, put_varint, with_blob};

/// The byte that SQLite locks: its page has no content.
const LOCKED: u64 = 1 << 30;
/// The largest cell of a page with children: the number of a child and the largest number of a row.
const LARGEST_CELL: usize = 4 + 9;

/// Gives the blob that is to stand in the column of a row; none if it stays as it is.
pub type Change<'a> = &'a mut dyn FnMut(i64, &[Value]) -> Result<Option<Vec<u8>>>;

/// Writes the file `from` to `into`, with other blobs in a column of a table.
///
/// # Errors
/// If one of them cannot be read or written, or the file has a map of its pages.
pub fn rewrite(from: &Path, into: &Path, table: &str, column: &str, change: Change<'_>) -> Result<()> {
    let mut source = Sqlite::open(from)?;
    let table = source.table(table)?;
    let column = table.column(column)?;
    if source.head[52..56] != [0; 4] {
        return Err(Error::new(
            "it has a map of its pages (auto_vacuum), which pdk does not write; convert it with `ros2 bag convert`",
        ));
    }
    std::fs::copy(from, into)?;
    let mut free = pages(&mut source, &table)?;
    // The lowest come first.
    free.sort_unstable_by(|a, b| b.cmp(a));
    let file = File::options().write(true).open(into)?;
    let mut tree = Tree {
        file,
        page: source.page,
        usable: source.usable,
        pages: source.pages,
        free,
        root: table.root,
        leaf: Leaf::default(),
        level: Vec::new(),
    };
    source.scan_with_content(&table, &mut |row, values, content| {
        let changed = change(row, values)?.map(|blob| with_blob(content, column, &blob)).transpose()?;
        tree.add(row, changed.as_deref().unwrap_or(content))
    })?;
    tree.finish(&source.head)
}

/// The pages of a table but for its root, which has a name elsewhere.
fn pages(source: &mut Sqlite, table: &Table) -> Result<Vec<u32>> {
    let mut found = Vec::new();
    let mut left = vec![(table.root, 0)];
    while let Some((number, depth)) = left.pop() {
        if found.len() > source.pages as usize {
            return Err(damaged("its pages form a ring"));
        }
        let page = source.page(number, depth)?;
        if depth > 0 {
            found.push(number);
        }
        for cell in 0..page.cells {
            match page.kind {
                Kind::Inner => left.push((page.child(cell)?, depth + 1)),
                Kind::Leaf => found.extend(source.overflow(&page, cell)?),
            }
        }
        if page.kind == Kind::Inner {
            left.push((page.last, depth + 1));
        }
    }
    Ok(found)
}

/// A table that is being built, from its leaves to its root.
struct Tree {
    file: File,
    page: usize,
    usable: usize,
    /// Pages of the file.
    pages: u32,
    /// Pages that may be written to, the lowest last.
    free: Vec<u32>,
    root: u32,
    leaf: Leaf,
    /// The leaves that are complete, with the largest number of a row of each.
    level: Vec<(u32, i64)>,
}

/// The cells of a page that is not complete.
#[derive(Default)]
struct Leaf {
    cells: Vec<Vec<u8>>,
    /// Bytes of the cells and their pointers.
    taken: usize,
    last: i64,
}

impl Tree {
    fn add(&mut self, row: i64, content: &[u8]) -> Result<()> {
        let mut cell = Vec::new();
        put_varint(content.len() as u64, &mut cell);
        put_varint(row as u64, &mut cell);
        let (own, rest) = content.split_at(own_part(content.len(), self.usable));
        cell.extend_from_slice(own);
        if !rest.is_empty() {
            cell.extend_from_slice(&self.overflow(rest)?.to_be_bytes());
        }
        if 8 + self.leaf.taken + cell.len() + 2 > self.usable {
            let leaf = std::mem::take(&mut self.leaf);
            let page = self.new_page()?;
            self.write(page, &self.laid_out(Kind::Leaf, &leaf.cells, 0))?;
            self.level.push((page, leaf.last));
        }
        self.leaf.taken += cell.len() + 2;
        self.leaf.last = row;
        self.leaf.cells.push(cell);
        Ok(())
    }

    /// Writes what goes on in other pages, and returns the first of them.
    fn overflow(&mut self, content: &[u8]) -> Result<u32> {
        let first = self.new_page()?;
        let mut page = first;
        let mut parts = content.chunks(self.usable - 4).peekable();
        while let Some(part) = parts.next() {
            let next = if parts.peek().is_some() { self.new_page()? } else { 0 };
            let mut bytes = vec![0; self.page];
            bytes[..4].copy_from_slice(&next.to_be_bytes());
            bytes[4..4 + part.len()].copy_from_slice(part);
            self.write(page, &bytes)?;
            page = next;
        }
        Ok(first)
    }

    fn new_page(&mut self) -> Result<u32> {
        if let Some(page) = self.free.pop() {
            return Ok(page);
        }
        let next = |pages: u32| pages.checked_add(1).ok_or_else(|| Error::new("it would become too large"));
        self.pages = next(self.pages)?;
        if u64::from(self.pages) == LOCKED / self.page as u64 + 1 {
            self.pages = next(self.pages)?;
        }
        Ok(self.pages)
    }

    fn write(&mut self, page: u32, bytes: &[u8]) -> Result<()> {
        self.file.seek(SeekFrom::Start(u64::from(page - 1) * self.page as u64))?;
        Ok(self.file.write_all(bytes)?)
    }

    /// A page with these cells; `last` is the last child of a page with children.
    fn laid_out(&self, kind: Kind, cells: &[Vec<u8>], last: u32) -> Vec<u8> {
        let mut bytes = vec![0; self.page];
        let mut end = self.usable;
        let pointers = if kind == Kind::Inner { 12 } else { 8 };
        for (number, cell) in cells.iter().enumerate() {
            end -= cell.len();
            bytes[end..end + cell.len()].copy_from_slice(cell);
            bytes[pointers + 2 * number..][..2].copy_from_slice(&(end as u16).to_be_bytes());
        }
        bytes[0] = if kind == Kind::Inner { 5 } else { 13 };
        bytes[3..5].copy_from_slice(&(cells.len() as u16).to_be_bytes());
        // 65536 is written as 0.
        bytes[5..7].copy_from_slice(&(end as u16).to_be_bytes());
        if kind == Kind::Inner {
            bytes[8..12].copy_from_slice(&last.to_be_bytes());
        }
        bytes
    }

    fn inner(&self, children: &[(u32, i64)]) -> Vec<u8> {
        let (last, before) =
            children.split_last().map_or((0, children), |((last, _), before)| (*last, before));
        let cell = |(page, row): &(u32, i64)| {
            let mut cell = page.to_be_bytes().to_vec();
            put_varint(*row as u64, &mut cell);
            cell
        };
        self.laid_out(Kind::Inner, &before.iter().map(cell).collect::<Vec<_>>(), last)
    }

    /// Writes what is above the leaves, and the head of the file.
    fn finish(mut self, head: &[u8]) -> Result<()> {
        let leaf = std::mem::take(&mut self.leaf);
        if self.level.is_empty() {
            self.write(self.root, &self.laid_out(Kind::Leaf, &leaf.cells, 0))?;
        } else {
            let page = self.new_page()?;
            self.write(page, &self.laid_out(Kind::Leaf, &leaf.cells, 0))?;
            self.level.push((page, leaf.last));
            let most = (self.usable - 12) / (LARGEST_CELL + 2) + 1;
            while self.level.len() > most {
                let children = std::mem::take(&mut self.level);
                let groups = children.len().div_ceil(most);
                // Of about the same size, so that none has one child alone.
                for group in 0..groups {
                    let group =
                        &children[group * children.len() / groups..(group + 1) * children.len() / groups];
                    let page = self.new_page()?;
                    self.write(page, &self.inner(group))?;
                    self.level.push((page, group.last().map_or(0, |(_, row)| *row)));
                }
            }
            self.write(self.root, &self.inner(&self.level))?;
        }
        let word = |at: usize| u32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
        let (mut first, count) = (word(32), word(36).saturating_add(self.free.len() as u32));
        // Pages that are not needed any more are listed in pages of their own, as the format has it.
        while let Some(page) = self.free.pop() {
            let listed = self.free.split_off(self.free.len().saturating_sub(self.usable / 4 - 8));
            let mut bytes = vec![0; self.page];
            for (number, word) in [first, listed.len() as u32].iter().chain(&listed).enumerate() {
                bytes[4 * number..][..4].copy_from_slice(&word.to_be_bytes());
            }
            self.write(page, &bytes)?;
            first = page;
        }
        let change = word(24).wrapping_add(1);
        for (at, word) in [(24, change), (28, self.pages), (32, first), (36, count), (92, change)] {
            self.file.seek(SeekFrom::Start(at))?;
            self.file.write_all(&word.to_be_bytes())?;
        }
        Ok(self.file.sync_all()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn written() -> std::path::PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/written/rows.db3")
    }

    fn rows(path: &Path) -> Vec<(i64, Vec<Value>)> {
        let mut file = Sqlite::open(path).unwrap();
        let table = file.table("m").unwrap();
        let mut rows = Vec::new();
        file.scan(&table, &mut |number, row| {
            rows.push((number, row.to_vec()));
            Ok(())
        })
        .unwrap();
        for (number, row) in &rows {
            assert_eq!(file.get(&table, *number).unwrap().as_ref(), Some(row));
        }
        rows
    }

    #[test]
    fn blobs_become_longer_and_shorter_and_all_else_stays() {
        let dir = tempfile::tempdir().unwrap();
        let before = rows(&written());
        // Longer than a page, of many pages, shorter, and as they were.
        let lengths: [fn(i64) -> Option<usize>; 4] =
            [|row| (row % 2 == 0).then_some(700), |row| Some(row as usize * 400), |_| Some(0), |_| None];
        for (number, length) in lengths.iter().enumerate() {
            let (from, into) = (written(), dir.path().join(format!("{number}.db3")));
            let blob = |row: i64| length(row).map(|length| vec![!(row as u8); length]);
            rewrite(&from, &into, "m", "data", &mut |row, _| Ok(blob(row))).unwrap();
            let after = rows(&into);
            assert_eq!(after.len(), before.len());
            for ((row, old), (same, new)) in before.iter().zip(&after) {
                let data = blob(*row).map_or_else(|| old[3].clone(), Value::Bytes);
                assert_eq!((row, &old[..3], &data), (same, &new[..3], &new[3]), "{number}");
            }
            let checked = std::process::Command::new("python3")
                .args(["-c", "import sqlite3, sys; print(*sqlite3.connect(sys.argv[1]).execute('pragma integrity_check').fetchone())"])
                .arg(&into)
                .output();
            match checked {
                Ok(output) if output.status.success() => {
                    assert_eq!(String::from_utf8_lossy(&output.stdout), "ok\n", "{number}");
                }
                _ => println!("skipped: no python3 with sqlite3, which checks the file"),
            }
        }
    }
}
