//! Files of bags, written again with other content in some of their messages. All else stays as it is: the order and the times of messages,
//! schemas, channels, attachments and metadata of an MCAP file, all tables of a file in SQLite.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use ::mcap::records::{Record, op};
use ::mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use pdk_sdk::prelude::*;

use crate::bag::{DATA, Known, MESSAGES, Message, Rows, first_record, is_sqlite, walk};
use crate::sqlite::Sqlite;
use crate::sqlite_copy;

/// Gives what is to stand in place of the content of a message; none if it stays.
pub type Change<'a> = &'a mut dyn FnMut(&Message<'_>) -> Result<Option<Vec<u8>>>;

/// Writes the file of this number, which is `from`, to `into`.
///
/// # Errors
/// If it cannot be read or written.
pub fn rewrite(number: usize, from: &Path, into: &Path, change: Change<'_>) -> Result<()> {
    if is_sqlite(from) {
        let rows = Rows::of(&mut Sqlite::open(from)?, number)?;
        return sqlite_copy::rewrite(from, into, MESSAGES, DATA, &mut |row, values| {
            rows.show(row, values, change)
        });
    }
    let mut writer =
        Writer::with_options(BufWriter::new(File::create(into)?), options(from)?).map_err(unwritten)?;
    let mut known = Known::default();
    let kinds = |opcode| {
        matches!(opcode, op::SCHEMA | op::CHANNEL | op::MESSAGE | op::ATTACHMENT | op::METADATA)
            || opcode >= PRIVATE
    };
    walk(from, kinds, &mut |record, at, ordinal| {
        let changed = known.show(number, (&record, at, ordinal), change)?.flatten();
        put(&mut writer, record, changed)
    })?;
    writer.finish().map_err(unwritten)?;
    let file = writer.into_inner().into_inner().map_err(|error| Error::from(error.into_error()))?;
    Ok(file.sync_all()?)
}

/// Records from this number on are not of the format but of the program that wrote them.
const PRIVATE: u8 = 0x80;

fn put(writer: &mut Writer<BufWriter<File>>, record: Record<'_>, changed: Option<Vec<u8>>) -> Result<()> {
    match record {
        Record::Schema { header, data } => {
            writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).map(drop)
        }
        Record::Channel(channel) => writer
            .add_channel_with_id(
                channel.id,
                channel.schema_id,
                &channel.topic,
                &channel.message_encoding,
                &channel.metadata,
            )
            .map(drop),
        Record::Message { header, data } => {
            writer.write_to_known_channel(&header, changed.as_deref().unwrap_or(&data))
        }
        Record::Attachment { header, data, .. } => writer.attach(&Attachment {
            log_time: header.log_time,
            create_time: header.create_time,
            name: header.name,
            media_type: header.media_type,
            data,
        }),
        Record::Metadata(metadata) => writer.write_metadata(&metadata),
        Record::Unknown { opcode, data } if opcode >= PRIVATE => {
            writer.write_private_record(opcode, &data, Default::default())
        }
        _ => Ok(()),
    }
    .map_err(unwritten)
}

/// How a file is written: as it says of itself, and compressed as its first chunk is.
fn options(path: &Path) -> Result<WriteOptions> {
    let mut options = WriteOptions::new().compression_threads(0);
    if let Some(Record::Header(header)) = first_record(path, |opcode| opcode == op::HEADER)? {
        options = options.profile(header.profile).library(header.library);
    }
    Ok(match first_record(path, |opcode| matches!(opcode, op::CHUNK | op::MESSAGE))? {
        Some(Record::Chunk { header, .. }) if header.compression == "zstd" => {
            options.compression(Some(Compression::Zstd))
        }
        Some(Record::Message { .. }) => options.compression(None).use_chunks(false),
        _ => options.compression(None),
    })
}

fn unwritten(error: McapError) -> Error {
    Error::new(format!("it cannot be written again ({error})"))
}
