//! MCAP files, record by record: every message with its place, so that it can be read again. Bags of ROS 2 in SQLite likewise, row by row.
//!
//! The file says how long its records are. That is compared with the file, and with a limit, before memory is taken for them.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use ::mcap::parse_record;
use ::mcap::records::{Channel, Record, op};
use ::mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use pdk_sdk::error::Place as _;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

use crate::sqlite::{self, Sqlite};
use crate::sqlite_row::Value;

/// The table with the messages of a bag in SQLite, and its column with what they say.
pub const MESSAGES: &str = "messages";
pub const DATA: &str = "data";
/// How an MCAP file begins.
pub const MAGIC: &[u8] = ::mcap::MAGIC;
/// Bytes of a record, and of what a chunk unpacks to.
const LARGEST: u64 = 1 << 29;

/// Where a message lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// The number of the file.
    pub file: usize,
    /// Where the record of the message, or of its chunk, begins; the number of the row in SQLite.
    at: u64,
    /// Its place among the messages of the chunk.
    ordinal: u32,
    /// Its channel in the file; none in SQLite.
    channel: Option<u16>,
}

/// A message as it is found.
pub struct Message<'a> {
    /// Its topic.
    pub topic: &'a str,
    /// How it is encoded, such as `cdr`.
    pub encoding: &'a str,
    /// What it is, such as `sensor_msgs/msg/Image`.
    pub schema: &'a str,
    /// When it was recorded, in nanoseconds.
    pub time: u64,
    /// Where it is.
    pub place: Place,
    /// What it says.
    pub data: &'a [u8],
}

/// A chunk: its file, its place and channel, and its messages by their place in it.
type Chunk = (usize, u64, Option<u16>, BTreeMap<u32, Vec<u8>>);

/// Files that belong together.
pub struct Bag {
    files: Vec<PathBuf>,
    /// The chunk that was read last.
    kept: Option<Chunk>,
}

impl Bag {
    /// Files in the order in which they were recorded.
    pub fn new(files: Vec<PathBuf>) -> Self {
        Self { files, kept: None }
    }

    /// The file of a number.
    ///
    /// # Errors
    /// If there is none.
    pub fn file(&self, number: usize) -> Result<&Path> {
        self.files.get(number).map(PathBuf::as_path).ok_or_else(changed)
    }

    /// Shows every message, in the order of the files. Returns a notice if a file ends early.
    ///
    /// # Errors
    /// If a file cannot be read, is not an MCAP file or is damaged, or `show` returns an error.
    pub fn scan(&self, show: &mut dyn FnMut(&Message<'_>) -> Result<()>) -> Result<Option<String>> {
        let mut early = None;
        for (number, path) in self.files.iter().enumerate() {
            let place = format!("`{}`", path.display());
            match is_sqlite(path) {
                true => scan_rows(number, path, show).place(place)?,
                false => early = early.or(scan(number, path, show).place(place)?),
            }
        }
        Ok(early)
    }

    /// Reads a message again.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(&mut self, place: Place) -> Result<&[u8]> {
        let Place { file, at, ordinal, channel } = place;
        let is_kept = matches!(&self.kept, Some((f, a, c, _)) if (*f, *a, *c) == (file, at, channel));
        if !is_kept {
            let path = self.files.get(file).ok_or_else(changed)?;
            let messages = match channel {
                Some(channel) => chunk(path, at, channel)?,
                None => BTreeMap::from([(0, row(path, at)?)]),
            };
            self.kept = Some((file, at, channel, messages));
        }
        let messages = self.kept.as_ref().map(|(.., messages)| messages);
        messages.and_then(|messages| messages.get(&ordinal)).map(Vec::as_slice).ok_or_else(changed)
    }
}

/// The messages of a channel in a chunk, by their place in it.
fn chunk(path: &Path, at: u64, channel: u16) -> Result<BTreeMap<u32, Vec<u8>>> {
    let (opcode, body) = Records::open(path)?.record(at)?.ok_or_else(changed)?;
    let mut messages = BTreeMap::new();
    each_record(opcode, &body, at, &mut |record, _, ordinal| {
        if let Record::Message { header, data } = record
            && header.channel_id == channel
        {
            messages.insert(ordinal, data.into_owned());
        }
        Ok(())
    })?;
    Ok(messages)
}

/// The message of a row.
fn row(path: &Path, at: u64) -> Result<Vec<u8>> {
    let mut file = Sqlite::open(path)?;
    let table = file.table(MESSAGES)?;
    let mut values = file.get(&table, at as i64)?.ok_or_else(changed)?;
    match values.get_mut(table.column(DATA)?) {
        Some(Value::Bytes(data)) => Ok(std::mem::take(data)),
        _ => Err(changed()),
    }
}

fn changed() -> Error {
    Error::new(
        "a message is missing that was there before, so the file has changed while it was read; run the command again",
    )
}

/// The records of a file.
struct Records {
    file: BufReader<File>,
    size: u64,
}

impl Records {
    fn open(path: &Path) -> Result<Self> {
        let (file, size) = file::open(path)?;
        Ok(Self { file: BufReader::new(file), size })
    }

    /// What a record is and where its body is; none if the file ends before it does.
    fn head(&mut self, at: u64) -> Result<Option<(u8, u64)>> {
        if self.size.saturating_sub(at) < 9 {
            return Ok(None);
        }
        let mut head = [0; 9];
        self.file.seek(SeekFrom::Start(at))?;
        self.file.read_exact(&mut head)?;
        let [opcode, a, b, c, d, e, f, g, h] = head;
        let length = u64::from_le_bytes([a, b, c, d, e, f, g, h]);
        Ok((length <= self.size - at - 9).then_some((opcode, length)))
    }

    /// A record; none if the file ends before it does.
    fn record(&mut self, at: u64) -> Result<Option<(u8, Vec<u8>)>> {
        let Some((opcode, length)) = self.head(at)? else { return Ok(None) };
        if length > LARGEST {
            return Err(Error::new(format!("a record has {length} bytes, and at most {LARGEST} are read")));
        }
        let mut body = vec![0; length as usize];
        self.file.read_exact(&mut body)?;
        Ok(Some((opcode, body)))
    }
}

/// Takes a record, where it or its chunk begins, and how many messages come before it in its chunk.
pub type Tell<'a> = &'a mut dyn FnMut(Record<'_>, u64, u32) -> Result<()>;

/// The error for what does not fit the format.
fn damaged(error: impl std::fmt::Display) -> Error {
    Error::new(format!("it is damaged ({error}); copy it again"))
}

/// Tells a record, which begins at a place; of a chunk the records in it.
fn each_record(opcode: u8, body: &[u8], at: u64, tell: Tell<'_>) -> Result<()> {
    if opcode != op::CHUNK {
        return tell(parse_record(opcode, body).map_err(damaged)?, at, 0);
    }
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(LARGEST as usize);
    let mut reader = LinearReader::new_with_options(options);
    let (code, length) = ([opcode], (body.len() as u64).to_le_bytes());
    let mut chunk = code[..].chain(&length[..]).chain(body);
    let mut left = body.len() + 9;
    let mut ordinal = 0;
    while let Some(event) = reader.next_event() {
        match event.map_err(damaged)? {
            LinearReadEvent::ReadRequest(wanted) => {
                // No more room than what comes.
                let count = wanted.min(left);
                chunk.read_exact(reader.insert(count))?;
                reader.notify_read(count);
                left -= count;
            }
            LinearReadEvent::Record { data, opcode } => {
                tell(parse_record(opcode, data).map_err(damaged)?, at, ordinal)?;
                ordinal += u32::from(opcode == op::MESSAGE);
            }
        }
    }
    Ok(())
}

/// Tells the records of the data of a file that are of these kinds, and what is in its chunks. Returns a notice if it ends early.
///
/// # Errors
/// If the file cannot be read, is not an MCAP file or is damaged, or `tell` returns an error.
pub fn walk(path: &Path, kinds: fn(u8) -> bool, tell: Tell<'_>) -> Result<Option<String>> {
    let mut records = Records::open(path)?;
    let mut magic = vec![0; MAGIC.len()];
    if records.size < MAGIC.len() as u64 || records.file.read_exact(&mut magic).is_err() || magic != MAGIC {
        return Err(Error::new("it does not begin as an MCAP file"));
    }
    let mut at = MAGIC.len() as u64;
    loop {
        let Some((opcode, length)) = records.head(at)? else {
            // What was recorded until a crash is all there is.
            let path = path.display();
            return Ok(Some(format!(
                "`{path}` ends early, as after a crash; what was recorded until then is read"
            )));
        };
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            return Ok(None);
        }
        if (kinds(opcode) || opcode == op::CHUNK)
            && let Some((opcode, body)) = records.record(at)?
        {
            each_record(opcode, &body, at, tell)?;
        }
        at += 9 + length;
    }
}

/// The first record of the data of a file that is of one of these kinds; none if there is none.
///
/// # Errors
/// If the file cannot be read, or the record is damaged.
pub fn first_record(path: &Path, kinds: fn(u8) -> bool) -> Result<Option<Record<'static>>> {
    let mut records = Records::open(path)?;
    let mut at = MAGIC.len() as u64;
    while let Some((opcode, length)) = records.head(at)? {
        if kinds(opcode) {
            let body = records.record(at)?;
            let parsed = body.map(|(opcode, body)| parse_record(opcode, &body).map(Record::into_owned));
            return parsed.transpose().map_err(damaged);
        }
        if matches!(opcode, op::DATA_END | op::FOOTER) {
            break;
        }
        at += 9 + length;
    }
    Ok(None)
}

/// The schemas and channels of a file, as far as it was read.
#[derive(Default)]
pub struct Known {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
}

impl Known {
    /// Shows the message of a record; notes what a record tells of later ones.
    ///
    /// # Errors
    /// If the message belongs to no channel, or `show` returns an error.
    pub fn show<T>(
        &mut self,
        file: usize,
        (record, at, ordinal): (&Record<'_>, u64, u32),
        show: &mut dyn FnMut(&Message<'_>) -> Result<T>,
    ) -> Result<Option<T>> {
        match record {
            Record::Schema { header, .. } => {
                self.schemas.insert(header.id, header.name.clone());
            }
            Record::Channel(channel) => {
                self.channels.insert(channel.id, channel.clone());
            }
            Record::Message { header, data } => {
                let known = self.channels.get(&header.channel_id).ok_or_else(|| {
                    Error::new("it is damaged: a message belongs to no channel; copy it again")
                })?;
                let schema = self.schemas.get(&known.schema_id).map_or("", String::as_str);
                let (topic, encoding) = (known.topic.as_str(), known.message_encoding.as_str());
                let place = Place { file, at, ordinal, channel: Some(header.channel_id) };
                return show(&Message { topic, encoding, schema, time: header.log_time, place, data })
                    .map(Some);
            }
            _ => {}
        }
        Ok(None)
    }
}

fn scan(
    file: usize,
    path: &Path,
    show: &mut dyn FnMut(&Message<'_>) -> Result<()>,
) -> Result<Option<String>> {
    let mut known = Known::default();
    let kinds = |opcode| matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE);
    walk(path, kinds, &mut |record, at, ordinal| known.show(file, (&record, at, ordinal), show).map(drop))
}

/// Whether a file begins as one of SQLite. What cannot be read is reported by its reader.
pub fn is_sqlite(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = file::open(path).map(|(file, _)| file.take(sqlite::MAGIC.len() as u64).read_to_end(&mut head));
    read.is_ok_and(|read| read.is_ok()) && head == sqlite::MAGIC
}

fn scan_rows(file: usize, path: &Path, show: &mut dyn FnMut(&Message<'_>) -> Result<()>) -> Result<()> {
    let mut bag = Sqlite::open(path)?;
    let rows = Rows::of(&mut bag, file)?;
    let table = bag.table(MESSAGES)?;
    bag.scan(&table, &mut |number, row| rows.show(number, row, show))
}

/// How the rows of a bag in SQLite are messages.
pub struct Rows {
    file: usize,
    topics: sqlite::Topics,
    /// The columns of the topic, the time and the content.
    columns: [usize; 3],
}

impl Rows {
    /// Those of the file of this number.
    ///
    /// # Errors
    /// If it is not a bag, or is damaged.
    pub fn of(bag: &mut Sqlite, file: usize) -> Result<Self> {
        let topics = sqlite::topics(bag)?;
        let table = bag.table(MESSAGES)?;
        let [topic, time, data] = ["topic_id", "timestamp", DATA].map(|name| table.column(name));
        Ok(Self { file, topics, columns: [topic?, time?, data?] })
    }

    /// Shows the message of a row.
    ///
    /// # Errors
    /// If the row is not one, or `show` returns an error.
    pub fn show<T>(
        &self,
        number: i64,
        row: &[Value],
        show: &mut dyn FnMut(&Message<'_>) -> Result<T>,
    ) -> Result<T> {
        let [topic, time, data] = self.columns;
        let whole = |place: usize| row.get(place).and_then(Value::whole);
        let of_topic = whole(topic).and_then(|topic| self.topics.get(&topic));
        let (Some([topic, schema, encoding]), Some(time), Some(Value::Bytes(data))) =
            (of_topic, whole(time), row.get(data))
        else {
            return Err(Error::new(format!(
                "it is damaged: message {number} has no topic, time or content; copy it again"
            )));
        };
        let place = Place { file: self.file, at: number as u64, ordinal: 0, channel: None };
        show(&Message { topic, encoding, schema, time: time.max(0) as u64, place, data })
    }
}
