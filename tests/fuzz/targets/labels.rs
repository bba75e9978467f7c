//! Files with labels: COCO, YOLO, masks, arrays of distances, records and tables with steering. Each reader gets every input.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pdk_corrupt::labels::{coco, lines, records, rle, table, yolo as moving};
use pdk_fuzz as _;
use pdk_truth::{coco::Coco, npy, segments, yolo};

fuzz_target!(|data: &[u8]| {
    if let Ok(file) = Coco::parse(data) {
        assert!(
            file.of("a.png").map_or(true, |found| found.iter().all(|one| one.class < file.classes.len()))
        );
    }
    if let Ok((width, height, values)) = segments::parse(data) {
        assert_eq!(values.len(), width * height);
        // A mask survives being written.
        let mask = pdk_image::samples::read(data).expect("it was read");
        let again =
            pdk_image::samples::read(&mask.write(&values).expect("it is written")).expect("it is read");
        assert_eq!(again.values, values);
    }
    if let Ok(array) = npy::read(data) {
        assert_eq!(array.values.len(), array.shape.iter().product::<usize>());
    }
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(objects) = yolo::parse(text) {
        for object in objects {
            let found = object.in_pixels([640.0, 480.0]);
            assert!(found.bounds.iter().all(|edge| edge.is_finite()) && found.area.is_finite());
        }
    }
    let _ = (moving::fits(text), lines::fits(text));
    let steering = [0.5, -0.25];
    if let Ok(turned) = table::moved(text, &steering, &mut |_, _| Ok(true)) {
        let back = table::moved(&turned, &steering.map(|steering| -steering), &mut |_, _| Ok(true));
        let again = back.and_then(|back| table::moved(&back, &steering, &mut |_, _| Ok(true)));
        assert_eq!(again.expect("what was written is read"), turned);
    }
    let _ = records::moved("a.catalog", text, &mut |_| Ok(true));
    let _ = records::lengths(text, "a\nb\n");
    let Ok(value) = serde_json::from_str::<serde_json::Value>(text) else { return };
    let _ = coco::moved(&value, 0.5, &mut |_, _, _| Ok(()));
    if let Ok((mask, [width, height])) = rle::read(&value) {
        assert_eq!(mask.len(), width * height);
        let (again, _) =
            rle::read(&rle::write(&mask, [width, height], &value)).expect("what was written is read");
        assert_eq!(again, mask);
    }
});
