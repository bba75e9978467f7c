//! Tests of the reader of SQLite, on a file that the library wrote.

use super::*;

/// 100 rows in pages of 512 bytes, with blobs of up to 2,700 bytes, written by SQLite 3 through Python:
/// `m(id INTEGER PRIMARY KEY, n INTEGER, r REAL, data BLOB)`, with what [`expected`] says.
fn file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/written/rows.db3")
}

fn expected(i: i64) -> Vec<Value> {
    let n = 3_i64.pow((i % 39) as u32) * if i % 2 == 0 { 1 } else { -1 };
    let data = vec![i as u8; (37 * i % 700 + if i % 25 == 0 { 2000 } else { 0 }) as usize];
    vec![Value::Null, Value::Whole(n), Value::Real(i as f64 + 0.5), Value::Bytes(data)]
}

#[test]
fn rows_are_read_in_order_and_by_number() {
    let mut file = Sqlite::open(&file()).unwrap();
    let table = file.table("M").unwrap();
    assert_eq!(table.columns, ["id", "n", "r", "data"]);
    let mut next = 1;
    let mut show = |number, row: &[Value]| {
        assert_eq!((number, row), (next, expected(next).as_slice()));
        next += 1;
        Ok(())
    };
    file.scan(&table, &mut show).unwrap();
    assert_eq!(next, 101);
    for number in [100, 1, 50, 51] {
        assert_eq!(file.get(&table, number).unwrap().unwrap(), expected(number));
    }
    assert_eq!(file.get(&table, 101).unwrap(), None);
    assert!(file.table("other").err().unwrap().message().contains("no table `other`"));
}

#[test]
fn a_file_that_is_cut_off_or_changed_is_an_error_and_never_a_panic() {
    let whole = std::fs::read(file()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("x.db3");
    let read = |bytes: &[u8]| -> Result<()> {
        std::fs::write(&path, bytes).unwrap();
        let mut file = Sqlite::open(&path)?;
        let table = file.table("m")?;
        file.scan(&table, &mut |_, _| Ok(()))?;
        file.get(&table, 70).map(drop)
    };
    read(&whole).unwrap();
    for length in [0, 50, 100, 600, whole.len() / 2] {
        assert!(read(&whole[..length]).is_err(), "{length}");
    }
    for place in (0..whole.len()).step_by(997).chain(16..120).chain(512..560) {
        for value in [0, 1, 0x7f, 0xff] {
            let mut changed = whole.clone();
            changed[place] = value;
            let _ = read(&changed);
        }
    }
    // The changes of a recording that was not closed lie in another file.
    std::fs::write(&path, &whole).unwrap();
    std::fs::write(dir.path().join("x.db3-wal"), "x").unwrap();
    assert!(Sqlite::open(&path).err().unwrap().message().contains("wal_checkpoint"));
}

#[test]
fn columns_are_the_first_words_between_commas() {
    let sql = "CREATE TABLE m(id INTEGER PRIMARY KEY, \"topic id\" INT, [t] DECIMAL(10,5) NOT NULL,data)";
    assert_eq!(columns(sql), ["id", "topic", "t", "data"]);
}
