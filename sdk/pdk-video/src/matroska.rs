//! What is needed of Matroska: which decoder of ffmpeg a clip needs for its alpha channel, and pictures with their times for ffmpeg to read.
//!
//! VP8 and VP9 keep alpha as a second stream beside the colours,
//! which ffmpeg's own decoders pass over; those of libvpx read it.
//!
//! A file is elements in elements, each with its number, its size and its content (RFC 8794, RFC 9559).

/// The numbers of the elements on the way to the video track, whose content is further elements.
const PARENTS: [u32; 4] = [SEGMENT, 0x1654_AE6B, TRACK, VIDEO];
const SEGMENT: u32 = 0x1853_8067;
const TRACK: u32 = 0xAE;
const VIDEO: u32 = 0xE0;
const CODEC: u32 = 0x86;
const ALPHA_MODE: u32 = 0x53C0;
const CLUSTER: u32 = 0x1F43_B675;

/// Bytes at the beginning of a file in which its tracks are described.
pub const HEAD: u64 = 1 << 20;

/// The decoder that reads the alpha channel of the first video track that has one, by the beginning of the file; none if no track has one.
pub fn alpha_decoder(head: &[u8]) -> Option<&'static str> {
    let mut codec: &[u8] = &[];
    for (number, content) in (Elements { rest: head }) {
        match number {
            TRACK => codec = &[],
            CODEC => codec = content,
            ALPHA_MODE if content.iter().any(|byte| *byte != 0) => {
                return match codec {
                    b"V_VP8" => Some("libvpx"),
                    b"V_VP9" => Some("libvpx-vp9"),
                    _ => None,
                };
            }
            CLUSTER => return None,
            _ => {}
        }
    }
    None
}

/// All elements one after the other, a parent before its children.
struct Elements<'a> {
    rest: &'a [u8],
}

impl<'a> Iterator for Elements<'a> {
    type Item = (u32, &'a [u8]);

    fn next(&mut self) -> Option<Self::Item> {
        let first = *self.rest.first()?;
        let length = first.leading_zeros() as usize + 1;
        if length > 4 {
            return None;
        }
        let number = self.rest.get(..length)?.iter().fold(0, |number, byte| number << 8 | u32::from(*byte));
        let size = self.rest.get(length..)?;
        let bytes = size.first()?.leading_zeros() as usize + 1;
        let mask = 0xFF_u64.checked_shr(bytes as u32).unwrap_or(0);
        let value = size.get(..bytes)?.iter().fold(0, |value, byte| value << 8 | u64::from(*byte));
        let content = &size[bytes..];
        // The bits that say how long the size is are not part of it.
        let value = value & (mask << (8 * (bytes - 1)) | ((1_u64 << (8 * (bytes - 1))) - 1));
        let length = usize::try_from(value).unwrap_or(usize::MAX).min(content.len());
        self.rest = if PARENTS.contains(&number) { content } else { &content[length..] };
        Some((number, &content[..length]))
    }
}

/// The beginning of a stream of pictures without compression: planes of luma, blue and red chroma at half the size. A frame lasts this many
/// nanoseconds on average, and times are in nanoseconds.
pub fn stream_head([width, height]: [usize; 2], duration: f64) -> Vec<u8> {
    let number = |id: u32, value: u64| element(id, &value.to_be_bytes());
    let parent = |id: u32, children: &[Vec<u8>]| element(id, &children.concat());
    let versions = [number(0x4286, 1), number(0x42F7, 1), number(0x42F2, 4), number(0x42F3, 8)];
    let kind = [element(0x4282, b"matroska"), number(0x4287, 4), number(0x4285, 2)];
    let mut head = parent(0x1A45_DFA3, &[versions.concat(), kind.concat()]);
    // A segment without end.
    head.extend(SEGMENT.to_be_bytes());
    head.extend([0x01, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF]);
    head.extend(parent(
        0x1549_A966,
        &[number(0x2A_D7B1, 1), element(0x4D80, b"pdk"), element(0x5741, b"pdk")],
    ));
    // The matrix of BT.601 and a range from 16 to 235, which encoders write into the video; players guess if it is missing.
    let color = parent(0x55B0, &[number(0x55B1, 6), number(0x55B9, 1)]);
    let size = [number(0xB0, width as u64), number(0xBA, height as u64)];
    let picture = [size.concat(), element(0x2E_B524, b"I420"), color];
    let track = [
        number(0xD7, 1),
        number(0x73C5, 1),
        number(0x83, 1),
        number(0x9C, 0),
        element(CODEC, b"V_UNCOMPRESSED"),
        number(0x23_E383, duration.round().max(1.0) as u64),
        parent(VIDEO, &picture),
    ];
    head.extend(parent(0x1654_AE6B, &[parent(TRACK, &track)]));
    head
}

/// What comes before a picture of this many bytes, which begins at this time in nanoseconds.
pub fn frame_head(time: u64, length: usize) -> Vec<u8> {
    let time = element(0xE7, &time.to_be_bytes());
    // The track, its time after that of the cluster, and that it can be decoded alone.
    let block = [0x81, 0, 0, 0x80];
    let mut head = begin(CLUSTER, time.len() + 9 + block.len() + length);
    head.extend(time);
    head.extend(begin(0xA3, block.len() + length));
    head.extend(block);
    head
}

fn element(id: u32, content: &[u8]) -> Vec<u8> {
    let mut element = begin(id, content.len());
    element.extend_from_slice(content);
    element
}

/// The number and the size of an element, the size in eight bytes.
fn begin(id: u32, length: usize) -> Vec<u8> {
    let mut begin: Vec<u8> = id.to_be_bytes().into_iter().skip_while(|byte| *byte == 0).collect();
    begin.extend((length as u64 | 1 << 56).to_be_bytes());
    begin
}

#[cfg(test)]
mod tests {
    use super::*;

    fn element(number: &[u8], content: &[u8]) -> Vec<u8> {
        [number, &[0x40 | (content.len() >> 8) as u8, content.len() as u8], content].concat()
    }

    fn file(codec: &[u8], alpha: &[u8]) -> Vec<u8> {
        let video = element(&[0xE0], &[element(&[0xB0], &[64]), alpha.to_vec()].concat());
        let sound = element(&[0xAE], &element(&[0x86], b"A_OPUS"));
        let track = element(&[0xAE], &[element(&[0x86], codec), video].concat());
        let tracks = element(&[0x16, 0x54, 0xAE, 0x6B], &[sound, track].concat());
        let void = element(&[0xEC], &[0x53, 0xC0, 0x81, 1]);
        let head = element(&[0x1A, 0x45, 0xDF, 0xA3], b"webm");
        // The size of the segment is not known.
        [head, vec![0x18, 0x53, 0x80, 0x67, 0x01, 255, 255, 255, 255, 255, 255, 255], void, tracks].concat()
    }

    #[test]
    fn the_track_with_alpha_says_the_decoder() {
        let alpha = element(&[0x53, 0xC0], &[1]);
        assert_eq!(alpha_decoder(&file(b"V_VP9", &alpha)), Some("libvpx-vp9"));
        assert_eq!(alpha_decoder(&file(b"V_VP8", &alpha)), Some("libvpx"));
        assert_eq!(alpha_decoder(&file(b"V_AV1", &alpha)), None);
        assert_eq!(alpha_decoder(&file(b"V_VP9", &element(&[0x53, 0xC0], &[0]))), None);
        assert_eq!(alpha_decoder(&file(b"V_VP9", &[])), None);
    }

    #[test]
    fn a_head_that_is_cut_off_or_something_else_has_no_alpha() {
        let whole = file(b"V_VP9", &element(&[0x53, 0xC0], &[1]));
        (0..whole.len()).for_each(|length| assert_eq!(alpha_decoder(&whole[..length]), None, "{length}"));
        for other in [&b""[..], b"RIFF....AVI ", &[0; 40], &[255; 40]] {
            assert_eq!(alpha_decoder(other), None);
        }
    }
}
