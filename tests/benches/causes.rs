//! How well `pdk why` finds causes that are known: drives that fail if, and only if, a box is black in some frames, both drawn at random.
//!
//! ```sh
//! cargo build --release && cargo bench --bench causes [-- --count N]
//! ```
//!
//! For the part that suffices: the overlap with the cause (intersection over union of pixels in all frames), and whether the frames are the same. For the part
//! that is needed: whether it is one cell of the grid in one frame of the cause, since all of a cause has to be black. Causes are
//! drawn in pixels, and `pdk why` reports 64ths of the frame, so the overlap cannot be complete, the less so the smaller the box is. Such causes
//! are as simple as the search assumes: one box, and whatever contains it fails.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::time::Instant;

use pdk_tests::planted::{self, Cause};
use pdk_tests::temp;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    let count = arguments.iter().position(|argument| argument == "--count");
    let count = count.map_or(200, |place| arguments[place + 1].parse().unwrap());
    for sides in [[0.25, 0.75], [0.125, 0.25]] {
        measure(count, sides);
    }
}

/// Explains drives with causes whose boxes have sides between these shares of the frame.
fn measure(count: usize, sides: [f64; 2]) {
    let folder = temp();
    let causes = Cause::drawn(count, 1, sides);
    let record = planted::record(folder.path(), &causes);
    let (mut overlaps, mut probes, mut seconds) = (Vec::new(), Vec::new(), Vec::new());
    let (mut same_frames, mut needed) = (0, 0);
    for (number, cause) in causes.iter().enumerate() {
        let start = Instant::now();
        let found = planted::why(&record, folder.path(), number);
        seconds.push(start.elapsed().as_secs_f64());
        probes.push(found["probes"].as_f64().unwrap());
        let [sufficient, necessary] = ["sufficient", "necessary"].map(|what| Cause::found(&found[what]));
        overlaps.push(sufficient.overlap(cause));
        same_frames += usize::from(sufficient.frames == cause.frames);
        needed += usize::from(necessary.is_a_cell() && necessary.meets(cause));
    }
    for numbers in [&mut overlaps, &mut probes, &mut seconds] {
        numbers.sort_by(f64::total_cmp);
    }
    let at = |numbers: &[f64], share: f64| numbers[((numbers.len() - 1) as f64 * share).round() as usize];
    let above = overlaps.iter().filter(|overlap| **overlap > 0.9).count();
    println!("{count} planted causes, whose boxes have sides of {} to {} of the frame:", sides[0], sides[1]);
    println!(
        "  overlap {:.3} in the median, {:.3} at the 5th percentile, above 0.9 for {above}; the same frames for {same_frames}; a cell of it needed for \
         {needed}",
        at(&overlaps, 0.5),
        at(&overlaps, 0.05)
    );
    println!(
        "  drives {} in the median, {} at most; seconds {:.1} in the median, {:.1} at most",
        at(&probes, 0.5),
        at(&probes, 1.0),
        at(&seconds, 0.5),
        at(&seconds, 1.0)
    );
}
