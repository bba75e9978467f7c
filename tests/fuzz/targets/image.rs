//! Image files.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pdk_fuzz as _;

fuzz_target!(|data: &[u8]| {
    if let Ok(image) = pdk_image::decode(data) {
        let pixels = image.width() as usize * image.height() as usize;
        assert!(pixels > 0 && pixels <= pdk_image::most_pixels().expect("the limit is not set"));
        assert_eq!(image.into_rgb8().into_raw().len(), pixels * 3);
    }
    let _ = pdk_image::without_texts(data);
});
