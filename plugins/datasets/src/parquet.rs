//! Columns of numbers, and of lists of numbers, in Parquet files.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;

use ::parquet::file::reader::{FileReader, SerializedFileReader};
use ::parquet::record::Field;
use ::parquet::schema::types::Type;
use pdk_sdk::error::Place as _;
use pdk_sdk::file;
use pdk_sdk::prelude::*;

/// More rows than this are not believed.
const MOST: usize = 1 << 22;

/// Reads columns: for each row the numbers of each column, in the order of `wanted`. A column that is a number has one.
///
/// # Errors
/// If the file cannot be read, is damaged, or lacks a column, or a column holds something else.
pub fn columns(path: &Path, wanted: &[&str]) -> Result<Vec<Vec<Vec<f64>>>> {
    // The crate panics on some damaged files.
    catch_unwind(AssertUnwindSafe(|| rows(path, wanted)))
        .unwrap_or_else(|_| Err(damaged("its pages contradict each other")))
        .place(format_args!("`{}`", path.display()))
}

fn rows(path: &Path, wanted: &[&str]) -> Result<Vec<Vec<Vec<f64>>>> {
    let (file, _) = file::open(path)?;
    let reader = SerializedFileReader::new(file).map_err(refused)?;
    let schema = reader.metadata().file_metadata().schema();
    // The columns of a projection are in the order of the file.
    let fields: Vec<_> =
        schema.get_fields().iter().filter(|field| wanted.contains(&field.name())).map(Arc::clone).collect();
    let places = wanted.iter().map(|name| {
        fields.iter().position(|field| field.name() == *name).ok_or_else(|| {
            let known: Vec<&str> = schema.get_fields().iter().map(|field| field.name()).collect();
            Error::new(format!("it has no column `{name}`; its columns are {}", known.join(", ")))
        })
    });
    let places = places.collect::<Result<Vec<usize>>>()?;
    let projection = Type::group_type_builder(schema.name()).with_fields(fields).build().map_err(refused)?;
    let mut rows = Vec::new();
    for row in reader.get_row_iter(Some(projection)).map_err(refused)? {
        let row = row.map_err(refused)?;
        if rows.len() == MOST {
            return Err(Error::new(format!("it has more than {MOST} rows; divide the recording")));
        }
        let fields: Vec<&Field> = row.get_column_iter().map(|(_, field)| field).collect();
        let values = wanted.iter().zip(&places).map(|(name, place)| {
            let field = fields.get(*place).copied().unwrap_or(&Field::Null);
            numbers(field).ok_or_else(|| {
                Error::new(format!(
                    "column `{name}` holds `{field}` in row {}, which are not numbers",
                    rows.len() + 1
                ))
            })
        });
        let values = values.collect::<Result<Vec<_>>>()?;
        rows.push(values);
    }
    Ok(rows)
}

/// The numbers of a cell; none if it holds something else.
fn numbers(field: &Field) -> Option<Vec<f64>> {
    match field {
        Field::ListInternal(list) => list.elements().iter().map(number).collect(),
        field => number(field).map(|number| vec![number]),
    }
}

fn number(field: &Field) -> Option<f64> {
    Some(match *field {
        // What was not recorded.
        Field::Null => f64::NAN,
        Field::Bool(truth) => f64::from(u8::from(truth)),
        Field::Byte(number) => f64::from(number),
        Field::Short(number) => f64::from(number),
        Field::Int(number) => f64::from(number),
        Field::Long(number) => number as f64,
        Field::UByte(number) => f64::from(number),
        Field::UShort(number) => f64::from(number),
        Field::UInt(number) => f64::from(number),
        Field::ULong(number) => number as f64,
        Field::Float16(number) => f64::from(number.to_f32()),
        Field::Float(number) => f64::from(number),
        Field::Double(number) => number,
        _ => return None,
    })
}

fn refused(error: ::parquet::errors::ParquetError) -> Error {
    let error = error.to_string();
    match error.contains("Disabled feature") {
        true => Error::new(format!(
            "its pages are compressed in a way that pdk does not read ({error}); write it with the compression `snappy`, as LeRobot does"
        )),
        false => damaged(&error),
    }
}

fn damaged(what: &str) -> Error {
    Error::new(format!("it is not a Parquet file, or is damaged ({what}); copy it again"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_on_which_the_crate_panics_is_reported_as_damaged() {
        // Fuzzing found it: a page whose streams of bytes are not of one length.
        let found = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("../../tests/fuzz/corpus/lerobot/streams_of_unequal_length");
        let whole = std::fs::read(found).unwrap();
        let begin = whole.iter().position(|byte| *byte == 0xff).unwrap() + 1;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("f.parquet");
        std::fs::write(&path, &whole[begin..]).unwrap();
        let error = columns(&path, &["episode_index", "timestamp", "speed"]).unwrap_err();
        assert!(error.message().contains("f.parquet"), "{error}");
        assert!(error.message().contains("its pages contradict each other"), "{error}");
    }
}
