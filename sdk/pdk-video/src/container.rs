//! Puts encoded frames into an MP4 file: the frames as they come, and the index behind them.

use std::io::{Seek, SeekFrom, Write};

use mp4_atom::{
    Avc1, Avcc, Co64, Dinf, Dref, DrefEntry, Encode, FourCC, Ftyp, Hdlr, Matrix, Mdhd, Mdia, Minf, Moov,
    Mvhd, Stbl, Stco, Stsc, StscEntry, Stsd, Stss, Stsz, StszSamples, Stts, SttsEntry, Tkhd, Trak, Url,
    Visual, Vmhd,
};
use pdk_sdk::prelude::*;

/// The length of the header of the box that holds the frames; it gives its own length in 64 bits.
const HEADER: u64 = 16;
/// Pictures are neither turned nor scaled.
const UPRIGHT: Matrix = Matrix { a: 1 << 16, b: 0, u: 0, c: 0, d: 1 << 16, v: 0, x: 0, y: 0, w: 1 << 30 };

/// An MP4 file with one track, which is written.
pub struct Mp4<W> {
    output: W,
    /// Ticks a second of the track and of the whole file.
    scale: u32,
    /// Where the box of the frames begins, and where the next frame goes.
    data: u64,
    end: u64,
    track: Option<Avc1>,
    lengths: Vec<u32>,
    /// How many frames in a row last equally long, and how long.
    durations: Vec<SttsEntry>,
    /// Frames with which decoding can begin, from 1.
    alone: Vec<u32>,
    /// The frames lie in chunks of a second: where each begins, and how many frames it has.
    chunks: Vec<(u64, u32)>,
    /// Ticks that the last chunk lasts.
    chunk: u64,
}

impl<W: Write + Seek> Mp4<W> {
    /// Begins a file whose track has this many ticks a second.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn begin(mut output: W, scale: u32) -> Result<Self> {
        let mut head = Vec::new();
        let brands = [b"isom", b"iso2", b"avc1", b"mp41"].map(FourCC::new);
        let [major_brand, ..] = brands;
        put(&Ftyp { major_brand, minor_version: 512, compatible_brands: brands.to_vec() }, &mut head)?;
        let data = head.len() as u64;
        head.extend_from_slice(&[0, 0, 0, 1, b'm', b'd', b'a', b't', 0, 0, 0, 0, 0, 0, 0, 0]);
        output.write_all(&head)?;
        Ok(Self {
            output,
            scale,
            data,
            end: data + HEADER,
            track: None,
            lengths: Vec::new(),
            durations: Vec::new(),
            alone: Vec::new(),
            chunks: Vec::new(),
            chunk: 0,
        })
    }

    /// Says how the frames are encoded.
    ///
    /// # Errors
    /// If the parameter sets are none.
    pub fn describe(&mut self, width: u16, height: u16, sequence: &[u8], picture: &[u8]) -> Result<()> {
        self.track = Some(Avc1 {
            visual: Visual { data_reference_index: 1, width, height, ..Visual::default() },
            avcc: Avcc::new(sequence, picture).map_err(broken)?,
            btrt: None,
            colr: None,
            pasp: None,
            taic: None,
            fiel: None,
            spatial: None,
        });
        Ok(())
    }

    /// Adds a frame that lasts this many ticks.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, frame: &[u8], duration: u32, alone: bool) -> Result<()> {
        self.output.write_all(frame)?;
        self.lengths.push(frame.len() as u32);
        if alone {
            self.alone.push(self.lengths.len() as u32);
        }
        match self.durations.last_mut() {
            Some(last) if last.sample_delta == duration => last.sample_count += 1,
            _ => self.durations.push(SttsEntry { sample_count: 1, sample_delta: duration }),
        }
        match self.chunks.last_mut() {
            Some((_, count)) if self.chunk < u64::from(self.scale) => *count += 1,
            _ => {
                self.chunks.push((self.end, 1));
                self.chunk = 0;
            }
        }
        self.chunk += u64::from(duration);
        self.end += frame.len() as u64;
        Ok(())
    }

    /// Writes the index, and gives the output back.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(mut self) -> Result<W> {
        self.output.seek(SeekFrom::Start(self.data + 8))?;
        self.output.write_all(&(self.end - self.data).to_be_bytes())?;
        self.output.seek(SeekFrom::Start(self.end))?;
        let mut index = Vec::new();
        put(&self.index()?, &mut index)?;
        self.output.write_all(&index)?;
        Ok(self.output)
    }

    fn index(&mut self) -> Result<Moov> {
        let track = self.track.take().ok_or_else(|| Error::new("the video was not described"))?;
        let ticks: u64 = self
            .durations
            .iter()
            .map(|entry| u64::from(entry.sample_count) * u64::from(entry.sample_delta))
            .sum();
        let (width, height) = (track.visual.width, track.visual.height);
        let mut chunks: Vec<StscEntry> = Vec::new();
        for (number, (_, count)) in (1u32..).zip(&self.chunks) {
            if chunks.last().is_none_or(|last| last.samples_per_chunk != *count) {
                chunks.push(StscEntry {
                    first_chunk: number,
                    samples_per_chunk: *count,
                    sample_description_index: 1,
                });
            }
        }
        let places = self.chunks.iter().map(|(at, _)| *at);
        let near: Option<Vec<u32>> = places.clone().map(|at| u32::try_from(at).ok()).collect();
        let far = if near.is_none() { Some(Co64 { entries: places.collect() }) } else { None };
        let tables = Stbl {
            stsd: Stsd { codecs: vec![track.into()] },
            stts: Stts { entries: std::mem::take(&mut self.durations) },
            stss: Some(Stss { entries: std::mem::take(&mut self.alone) }),
            stsc: Stsc { entries: chunks },
            stsz: Stsz { samples: StszSamples::Different { sizes: std::mem::take(&mut self.lengths) } },
            stco: near.map(|entries| Stco { entries }),
            co64: far,
            ..Stbl::default()
        };
        let header = Tkhd {
            track_id: 1,
            duration: ticks,
            enabled: true,
            in_movie: true,
            matrix: UPRIGHT,
            width: width.into(),
            height: height.into(),
            ..Tkhd::default()
        };
        let media = Mdia {
            mdhd: Mdhd {
                timescale: self.scale,
                duration: ticks,
                language: "und".to_owned(),
                ..Mdhd::default()
            },
            hdlr: Hdlr { handler: FourCC::new(b"vide"), name: "VideoHandler".to_owned() },
            minf: Minf {
                vmhd: Some(Vmhd::default()),
                dinf: Dinf { dref: Dref { entries: vec![DrefEntry::Url(Url::default())] } },
                stbl: tables,
                ..Minf::default()
            },
        };
        Ok(Moov {
            mvhd: Mvhd {
                timescale: self.scale,
                duration: ticks,
                rate: 1.into(),
                volume: 1.into(),
                matrix: UPRIGHT,
                next_track_id: 2,
                ..Mvhd::default()
            },
            trak: vec![Trak { tkhd: header, mdia: media, ..Trak::default() }],
            ..Moov::default()
        })
    }
}

fn put(what: &impl Encode, into: &mut Vec<u8>) -> Result<()> {
    what.encode(into).map_err(broken)
}

fn broken(error: mp4_atom::Error) -> Error {
    Error::new(format!("its index cannot be written ({error})"))
}
