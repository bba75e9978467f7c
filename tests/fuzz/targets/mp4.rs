//! Videos in MP4 files: the container, and the first of their frames.

#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use pdk_fuzz as _;
use pdk_video::{Opened, Reader, Yuv420, container};

fuzz_target!(|data: &[u8]| {
    let _ = container(data);
    for few in [false, true] {
        let input = Box::new(Cursor::new(data.to_vec()));
        let Ok(Opened::Frames(mut reader)) = Reader::open(input, data.len() as u64, few) else { return };
        assert!(reader.rate().is_finite() && reader.rate() > 0.0);
        let mut picture = Yuv420::default();
        for _ in 0..8 {
            if !matches!(reader.next(&mut picture), Ok(true)) {
                break;
            }
        }
        if !few {
            let count = reader.count();
            for frame in [count - 1, 0, count / 2] {
                if reader.seek(frame).is_err() || reader.next(&mut picture).is_err() {
                    break;
                }
            }
        }
    }
});
