//! The frames of an MP4 file in fragments, as cameras write it that may lose power, and as streams are stored: each fragment has an index
//! of its own.

use std::io::{Read, Seek};

use mp4_atom::{Tfdt, Tfhd, Trex, Trun};

use crate::boxes::{Content, Misbuilt, Outermost};
use crate::sample::{Left, Sample, within};
use crate::timing::{Moment, few_enough};

/// In the flags of a frame: decoding cannot begin with it.
const NOT_ALONE: u32 = 1 << 16;

/// The frames of a track, and when they are shown.
///
/// # Errors
/// If a fragment is not built as expected, or frames lie outside of the file of `size` bytes.
pub fn read(
    input: &mut (impl Read + Seek),
    boxes: &[Outermost],
    defaults: Content<'_>,
    track: u32,
    size: u64,
) -> Result<(Vec<Sample>, Vec<Moment>), Left> {
    let mut own = Trex::default();
    for (name, content) in defaults.boxes()? {
        if &name == b"trex" {
            let found: Trex = content.as_a()?;
            if found.track_id == track {
                own = found;
            }
        }
    }
    let (mut samples, mut moments, mut decoded) = (Vec::new(), Vec::new(), 0i64);
    for fragment in boxes.iter().filter(|found| &found.name == b"moof") {
        let content = fragment.read(input)?;
        // Where the frames of the track before end, behind which those of the next one lie if it does not say.
        let mut end = fragment.at;
        for (name, part) in Content(&content).boxes()? {
            if &name != b"traf" {
                continue;
            }
            let header: Tfhd = part.find(b"tfhd")?.ok_or(Misbuilt)?.as_a()?;
            let base = match (header.base_data_offset, header.default_base_is_moof) {
                (Some(base), _) => base,
                (None, true) => fragment.at,
                (None, false) => end,
            };
            let wanted = header.track_id == track;
            if let (true, Some(time)) = (wanted, part.find(b"tfdt")?) {
                decoded = i64::try_from(time.as_a::<Tfdt>()?.base_media_decode_time).map_err(|_| Misbuilt)?;
            }
            let mut at = base;
            for (name, run) in part.boxes()? {
                if &name != b"trun" {
                    continue;
                }
                let run: Trun = run.as_a()?;
                if let Some(offset) = run.data_offset {
                    at = base.saturating_add_signed(i64::from(offset));
                }
                few_enough(u32::try_from(samples.len() + run.samples.len()).unwrap_or(u32::MAX))?;
                for entry in &run.samples {
                    let length = entry.size.or(header.default_sample_size).unwrap_or(own.default_sample_size);
                    if wanted {
                        let flags = entry.flags.or(header.default_sample_flags);
                        let alone = flags.unwrap_or(own.default_sample_flags) & NOT_ALONE == 0;
                        let duration = entry.duration.or(header.default_sample_duration);
                        let duration = duration.unwrap_or(own.default_sample_duration);
                        samples.push(Sample { at, length, alone });
                        let begins = decoded.saturating_add(entry.cts.unwrap_or_default());
                        moments.push(Moment { begins, duration });
                        decoded = decoded.saturating_add(i64::from(duration));
                    }
                    at = at.saturating_add(u64::from(length));
                }
            }
            end = at;
        }
    }
    within(&samples, size)?;
    Ok((samples, moments))
}
