//! Files of SQLite, of which only rows of tables are read: the file format as its documentation has it, without indexes, queries and
//! changes. What a page says about sizes and places is compared with the file before it is used.
//!
//! The library itself would be compiled from C for each target, which takes longer than the rest of this crate.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::sqlite_row::{Value, damaged, own_part, values, varint};

/// How a file of SQLite begins.
pub const MAGIC: &[u8] = b"SQLite format 3\0";
/// Bytes of the head of the file, which are those of the first page.
const HEAD: usize = 100;
/// Bytes of a row.
const LARGEST: u64 = 1 << 29;
/// Pages from the root of a table to a row. With the fewest branches that a page may have there are more rows than a file can hold.
const DEEPEST: usize = 24;

/// A table: where its rows are, and its columns in their order.
pub struct Table {
    /// The page at which its rows begin.
    pub root: u32,
    columns: Vec<String>,
}

impl Table {
    /// The place of a column in a row.
    ///
    /// # Errors
    /// If there is none of this name.
    pub fn column(&self, name: &str) -> Result<usize> {
        self.columns.iter().position(|column| column.eq_ignore_ascii_case(name)).ok_or_else(|| {
            Error::new(format!(
                "it has no column `{name}`; it was not written by ROS 2, or by a version that is not known"
            ))
        })
    }
}

/// Takes the number of a row, its values, and the bytes in which they are stored.
pub type Show<'a> = &'a mut dyn FnMut(i64, &[Value], &[u8]) -> Result<()>;

/// An open file.
pub struct Sqlite {
    file: File,
    /// The head of the file.
    pub head: [u8; HEAD],
    /// Bytes of a page.
    pub page: usize,
    /// Bytes of a page that hold content.
    pub usable: usize,
    /// Pages of the file.
    pub pages: u32,
}

impl Sqlite {
    /// Opens a file.
    ///
    /// # Errors
    /// If it cannot be read, is not of SQLite, or has changes in another file.
    pub fn open(path: &Path) -> Result<Self> {
        let mut log = path.as_os_str().to_owned();
        log.push("-wal");
        if std::fs::metadata(&log).is_ok_and(|log| log.len() > 0) {
            return Err(Error::new(format!(
                "the recording was not closed, so a part of it is in `{}`; write it back with `sqlite3 FILE 'PRAGMA wal_checkpoint'`",
                Path::new(&log).display()
            )));
        }
        let (mut file, size) = file::open(path)?;
        let mut head = [0; HEAD];
        file.read_exact(&mut head).map_err(|_| damaged("its header is cut off"))?;
        if !head.starts_with(MAGIC) {
            return Err(Error::new("it does not begin as a file of SQLite"));
        }
        let page = match u16::from_be_bytes([head[16], head[17]]) {
            1 => 1 << 16,
            page => usize::from(page),
        };
        let usable = page.saturating_sub(usize::from(head[20]));
        if !page.is_power_of_two() || page < 512 || usable < 480 {
            return Err(damaged("its header has an impossible page size"));
        }
        if !matches!(u32::from_be_bytes([head[56], head[57], head[58], head[59]]), 0 | 1) {
            return Err(Error::new(
                "its texts are in UTF-16, and pdk reads UTF-8; convert it with `ros2 bag convert`",
            ));
        }
        let pages = u32::try_from(size / page as u64).map_err(|_| damaged("it is too large"))?;
        Ok(Self { file, head, page, usable, pages })
    }

    /// A table.
    ///
    /// # Errors
    /// If there is none of this name, or the file is damaged.
    pub fn table(&mut self, name: &str) -> Result<Table> {
        let schema = Table { root: 1, columns: Vec::new() };
        let mut found = None;
        self.scan(&schema, &mut |_, row| {
            if let [kind, own, _, root, sql, ..] = row
                && kind.text() == Some("table")
                && own.text().is_some_and(|own| own.eq_ignore_ascii_case(name))
            {
                let root = root.whole().and_then(|root| u32::try_from(root).ok());
                found = root.zip(sql.text().map(columns));
            }
            Ok(())
        })?;
        let (root, columns) =
            found.ok_or_else(|| Error::new(format!("it has no table `{name}`, as a bag of ROS 2 has")))?;
        Ok(Table { root, columns })
    }

    /// Shows each row of a table with its number, in the order of these.
    ///
    /// # Errors
    /// If the file is damaged, or `show` returns an error.
    pub fn scan(&mut self, table: &Table, show: &mut dyn FnMut(i64, &[Value]) -> Result<()>) -> Result<()> {
        self.scan_with_content(table, &mut |row, values, _| show(row, values))
    }

    /// Shows each row as [`scan`](Self::scan) does, and how it is stored.
    ///
    /// # Errors
    /// As [`scan`](Self::scan).
    pub fn scan_with_content(&mut self, table: &Table, show: Show<'_>) -> Result<()> {
        // A page that is its own descendant would have no end.
        let mut left = self.pages;
        self.each(table.root, 0, &mut left, show)
    }

    fn each(&mut self, number: u32, depth: usize, left: &mut u32, show: Show<'_>) -> Result<()> {
        *left = left.checked_sub(1).ok_or_else(|| damaged("its pages form a ring"))?;
        let page = self.page(number, depth)?;
        for cell in 0..page.cells {
            match page.kind {
                Kind::Inner => self.each(page.child(cell)?, depth + 1, left, show)?,
                Kind::Leaf => {
                    let (row, content) = self.row(&page, cell)?;
                    show(row, &values(&content)?, &content)?;
                }
            }
        }
        match page.kind {
            Kind::Inner => self.each(page.last, depth + 1, left, show),
            Kind::Leaf => Ok(()),
        }
    }

    /// The row of this number; none if there is none.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn get(&mut self, table: &Table, wanted: i64) -> Result<Option<Vec<Value>>> {
        let mut number = table.root;
        for depth in 0.. {
            let page = self.page(number, depth)?;
            match page.kind {
                Kind::Inner => {
                    number = page.last;
                    for cell in 0..page.cells {
                        if wanted <= page.key(cell)? {
                            number = page.child(cell)?;
                            break;
                        }
                    }
                }
                Kind::Leaf => {
                    for cell in 0..page.cells {
                        if page.key(cell)? == wanted {
                            let (_, content) = self.row(&page, cell)?;
                            return values(&content).map(Some);
                        }
                    }
                    return Ok(None);
                }
            }
        }
        Ok(None)
    }

    fn raw(&mut self, number: u32) -> Result<Vec<u8>> {
        if number == 0 || number > self.pages {
            return Err(damaged("it names a page that it does not have"));
        }
        let mut bytes = vec![0; self.page];
        self.file.seek(SeekFrom::Start(u64::from(number - 1) * self.page as u64))?;
        self.file.read_exact(&mut bytes)?;
        Ok(bytes)
    }

    /// A page of a table, at this depth below its root.
    ///
    /// # Errors
    /// If it is not one.
    pub fn page(&mut self, number: u32, depth: usize) -> Result<Page> {
        if depth > DEEPEST {
            return Err(damaged("its pages form a ring"));
        }
        let bytes = self.raw(number)?;
        let at = if number == 1 { HEAD } else { 0 };
        let kind = match bytes[at] {
            5 => Kind::Inner,
            13 => Kind::Leaf,
            _ => return Err(damaged("a page is not of a table")),
        };
        let cells = usize::from(u16::from_be_bytes([bytes[at + 3], bytes[at + 4]]));
        let last = u32::from_be_bytes([bytes[at + 8], bytes[at + 9], bytes[at + 10], bytes[at + 11]]);
        let pointers = at + if kind == Kind::Inner { 12 } else { 8 };
        Ok(Page { bytes, kind, cells, last, pointers })
    }

    /// The number of a row of a leaf, and its content, which may go on in other pages.
    fn row(&mut self, page: &Page, cell: usize) -> Result<(i64, Vec<u8>)> {
        let mut rest = page.cell(cell)?;
        let length = varint(&mut rest)? as u64;
        let number = varint(&mut rest)?;
        if length > LARGEST || length > u64::from(self.pages) * self.page as u64 {
            return Err(damaged("a row is longer than the file"));
        }
        let length = length as usize;
        let own = own_part(length, self.usable);
        let mut content = rest.get(..own).ok_or_else(|| damaged("a row is cut off"))?.to_vec();
        let mut next = match rest.get(own..own + 4) {
            Some(&[a, b, c, d]) => u32::from_be_bytes([a, b, c, d]),
            _ => 0,
        };
        while content.len() < length {
            let bytes = self.raw(next)?;
            next = u32::from_be_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
            let count = (length - content.len()).min(self.usable - 4);
            content.extend_from_slice(&bytes[4..4 + count]);
        }
        Ok((number, content))
    }

    /// The pages in which the content of a row of a leaf goes on.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn overflow(&mut self, page: &Page, cell: usize) -> Result<Vec<u32>> {
        let mut rest = page.cell(cell)?;
        let length = usize::try_from(varint(&mut rest)?).unwrap_or(usize::MAX);
        varint(&mut rest)?;
        let own = own_part(length, self.usable);
        let count = length.saturating_sub(own).div_ceil(self.usable - 4);
        if count > self.pages as usize {
            return Err(damaged("a row is longer than the file"));
        }
        let mut pages = Vec::with_capacity(count);
        let mut next = rest.get(own..own + 4).map(<[u8]>::to_vec);
        for _ in 0..count {
            let number = match next.as_deref() {
                Some(&[a, b, c, d]) => u32::from_be_bytes([a, b, c, d]),
                _ => return Err(damaged("a row is cut off")),
            };
            next = Some(self.raw(number)?[..4].to_vec());
            pages.push(number);
        }
        Ok(pages)
    }
}

/// What a page of a table holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Other pages.
    Inner,
    /// Rows.
    Leaf,
}

/// A page of a table.
pub struct Page {
    bytes: Vec<u8>,
    /// What it holds.
    pub kind: Kind,
    /// How many of that.
    pub cells: usize,
    /// The child with the largest numbers, of a page with children.
    pub last: u32,
    /// Where the places of its cells begin.
    pointers: usize,
}

impl Page {
    fn cell(&self, number: usize) -> Result<&[u8]> {
        let at = self.pointers + 2 * number;
        let place =
            self.bytes.get(at..at + 2).map(|place| usize::from(u16::from_be_bytes([place[0], place[1]])));
        place.and_then(|place| self.bytes.get(place..)).ok_or_else(|| damaged("a page is cut off"))
    }

    /// The page of a child.
    ///
    /// # Errors
    /// If the page is cut off.
    pub fn child(&self, number: usize) -> Result<u32> {
        match self.cell(number)? {
            [a, b, c, d, ..] => Ok(u32::from_be_bytes([*a, *b, *c, *d])),
            _ => Err(damaged("a page is cut off")),
        }
    }

    /// The number of the row of a leaf, or the largest one below a child.
    fn key(&self, number: usize) -> Result<i64> {
        let mut rest = self.cell(number)?;
        match self.kind {
            Kind::Inner => rest = rest.get(4..).ok_or_else(|| damaged("a page is cut off"))?,
            Kind::Leaf => _ = varint(&mut rest)?,
        }
        varint(&mut rest)
    }
}

/// The names of the columns in the text that made a table.
fn columns(sql: &str) -> Vec<String> {
    let inside = sql.split_once('(').map_or("", |(_, inside)| inside);
    let mut depth = 0;
    let parts = inside.split(|c: char| {
        match c {
            '(' => depth += 1,
            ')' => depth -= 1,
            _ => {}
        }
        c == ',' && depth == 0
    });
    let name = |part: &str| {
        let word = part.split_whitespace().next().unwrap_or_default();
        word.trim_matches(['"', '`', '[', ']', ')']).to_owned()
    };
    parts.map(name).collect()
}

/// What a bag in SQLite says of its topics, by their number: name, kind of messages and encoding.
pub type Topics = BTreeMap<i64, [String; 3]>;

/// The topics of a bag.
///
/// # Errors
/// If the file is not a bag, or is damaged.
pub fn topics(bag: &mut Sqlite) -> Result<Topics> {
    let table = bag.table("topics")?;
    let places = ["name", "type", "serialization_format"].map(|name| table.column(name));
    let mut topics = Topics::new();
    bag.scan(&table, &mut |number, row| {
        let mut texts: [String; 3] = Default::default();
        for (text, place) in texts.iter_mut().zip(&places) {
            let place = place.clone()?;
            *text = row.get(place).and_then(Value::text).unwrap_or_default().to_owned();
        }
        topics.insert(number, texts);
        Ok(())
    })?;
    Ok(topics)
}

#[cfg(test)]
#[path = "sqlite_tests.rs"]
mod tests;
