//! Whether a JPEG holds all that its header promises. Decoders fill what is missing of its compressed data with grey; here the
//! data is gone through code by code, without making a picture of it (ITU-T T.81).

use pdk_sdk::prelude::*;

/// Marker codes, the byte behind 0xff.
const SOF_BASELINE: u8 = 0xc0;
const SOF_EXTENDED: u8 = 0xc1;
const SOF_PROGRESSIVE: u8 = 0xc2;
const HUFFMAN_TABLES: u8 = 0xc4;
const END_OF_IMAGE: u8 = 0xd9;
const START_OF_SCAN: u8 = 0xda;
const RESTART_INTERVAL: u8 = 0xdd;

/// Coefficients of a block.
const BLOCK: usize = 64;
/// Says that nothing is known of a coefficient yet.
const UNKNOWN: u8 = u8::MAX;

/// Looks whether all scans are there, each with all of its blocks. Forms of JPEG that are not gone through here (arithmetic
/// coding, lossless, hierarchical) are left to the decoder to refuse.
///
/// # Errors
/// If something is missing, or what is there cannot be.
pub fn check(bytes: &[u8]) -> Result<()> {
    let mut file = Jpeg { bytes, at: 0, frame: None, tables: Default::default(), interval: 0 };
    loop {
        let Some(marker) = file.next_marker() else { return Err(cut_off()) };
        match marker {
            END_OF_IMAGE => return file.check_complete(),
            // Start of image, restarts and the temporary marker stand alone.
            0x01 | 0xd0..=0xd8 => {}
            marker => {
                let segment = file.segment().ok_or_else(cut_off)?;
                match marker {
                    SOF_BASELINE | SOF_EXTENDED | SOF_PROGRESSIVE => {
                        let frame = Frame::read(segment, marker == SOF_PROGRESSIVE).ok_or_else(senseless)?;
                        if file.frame.replace(frame).is_some() {
                            return Err(senseless());
                        }
                    }
                    // Other kinds of frames; 0xc8 and 0xcc are none.
                    0xc3 | 0xc5..=0xc7 | 0xc9..=0xcb | 0xcd..=0xcf => return Ok(()),
                    HUFFMAN_TABLES => read_tables(segment, &mut file.tables).ok_or_else(senseless)?,
                    RESTART_INTERVAL => {
                        file.interval = u16_at(segment, 0).ok_or_else(senseless)?.into();
                    }
                    START_OF_SCAN => file.scan(segment)?,
                    _ => {}
                }
            }
        }
    }
}

fn cut_off() -> Error {
    Error::new("it is cut off: the JPEG's end is missing")
}

fn missing() -> Error {
    Error::new("it is damaged: a part of its compressed data is missing")
}

fn senseless() -> Error {
    Error::new("it is damaged: its compressed data makes no sense")
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_be_bytes(bytes.get(at..at + 2)?.try_into().ok()?))
}

struct Jpeg<'a> {
    bytes: &'a [u8],
    at: usize,
    frame: Option<Frame>,
    /// Tables of codes for direct and for alternating coefficients.
    tables: [[Option<Table>; 4]; 2],
    /// Units between two restarts; 0 for none.
    interval: usize,
}

impl<'a> Jpeg<'a> {
    /// The next marker; between segments some files have bytes that mean nothing.
    fn next_marker(&mut self) -> Option<u8> {
        loop {
            let start = self.at + memchr::memchr(0xff, self.bytes.get(self.at..)?)?;
            self.at = start + 1;
            match *self.bytes.get(self.at)? {
                0 | 0xff => {}
                marker => {
                    self.at += 1;
                    return Some(marker);
                }
            }
        }
    }

    /// The content of the segment that begins here.
    fn segment(&mut self) -> Option<&'a [u8]> {
        let length = usize::from(u16_at(self.bytes, self.at)?);
        let segment = self.bytes.get(self.at + 2..self.at + length)?;
        self.at += length;
        Some(segment)
    }

    fn check_complete(&self) -> Result<()> {
        let complete = self.frame.as_ref().is_some_and(|frame| {
            frame.components.iter().all(|component| component.known.iter().all(|bit| *bit == 0))
        });
        if complete { Ok(()) } else { Err(missing()) }
    }

    /// Goes through a scan, whose header this is.
    fn scan(&mut self, header: &[u8]) -> Result<()> {
        let frame = self.frame.as_mut().ok_or_else(senseless)?;
        let scan = Scan::read(header, frame).ok_or_else(senseless)?;
        // What comes twice would make a small file much work.
        frame.note(&scan).ok_or_else(senseless)?;
        let mut bits = Bits { bytes: self.bytes, at: self.at, buffer: 0, count: 0 };
        let mut run = 0;
        let (across, down) = frame.units(&scan);
        for unit in 0..across * down {
            if self.interval > 0 && unit > 0 && unit % self.interval == 0 {
                bits.restart(unit / self.interval - 1)?;
                run = 0;
            }
            for part in &scan.parts {
                let component = &mut frame.components[part.component];
                let (width, height) =
                    if scan.parts.len() == 1 { (1, 1) } else { (component.horizontal, component.vertical) };
                for place in 0..width * height {
                    let (x, y) =
                        ((unit % across) * width + place % width, (unit / across) * height + place / width);
                    let present = match frame.progressive {
                        true => &mut component.present[y * component.stride + x],
                        false => &mut 0,
                    };
                    let tables =
                        (self.tables[0][part.direct].as_ref(), self.tables[1][part.alternating].as_ref());
                    scan.block(&mut bits, tables, present, &mut run)?;
                }
            }
        }
        self.at = bits.end()?;
        Ok(())
    }
}

struct Frame {
    progressive: bool,
    width: usize,
    height: usize,
    components: Vec<Component>,
}

struct Component {
    id: u8,
    horizontal: usize,
    vertical: usize,
    /// Blocks in a row, with those that fill up the last unit.
    stride: usize,
    /// For each block of a progressive file a bit for each coefficient that is not zero.
    present: Vec<u64>,
    /// The lowest bit that is known of each coefficient.
    known: [u8; BLOCK],
}

impl Frame {
    fn read(segment: &[u8], progressive: bool) -> Option<Self> {
        let (height, width) = (usize::from(u16_at(segment, 1)?), usize::from(u16_at(segment, 3)?));
        let components = segment.get(6..6 + 3 * usize::from(*segment.get(5)?))?;
        let mut components: Vec<Component> = components
            .chunks_exact(3)
            .map(|component| Component {
                id: component[0],
                horizontal: usize::from(component[1] >> 4),
                vertical: usize::from(component[1] & 15),
                stride: 0,
                present: Vec::new(),
                known: [UNKNOWN; BLOCK],
            })
            .collect();
        let sampled = |c: &Component| (1..=4).contains(&c.horizontal) && (1..=4).contains(&c.vertical);
        if width == 0
            || height == 0
            || !(1..=4).contains(&components.len())
            || !components.iter().all(sampled)
        {
            return None;
        }
        let mut frame = Self { progressive, width, height, components: Vec::new() };
        let horizontal = components.iter().map(|c| c.horizontal).max()?;
        let vertical = components.iter().map(|c| c.vertical).max()?;
        for component in &mut components {
            component.stride = width.div_ceil(8 * horizontal) * component.horizontal;
            let rows = height.div_ceil(8 * vertical) * component.vertical;
            if progressive {
                component.present = vec![0; component.stride * rows];
            }
        }
        frame.components = components;
        Some(frame)
    }

    /// How many units a scan has across and down: blocks of its only component, or groups of blocks of all.
    fn units(&self, scan: &Scan) -> (usize, usize) {
        let horizontal = self.components.iter().map(|c| c.horizontal).max().unwrap_or(1);
        let vertical = self.components.iter().map(|c| c.vertical).max().unwrap_or(1);
        match scan.parts.as_slice() {
            [part] => {
                let component = &self.components[part.component];
                let blocks = |size: usize, own: usize, most: usize| (size * own).div_ceil(most).div_ceil(8);
                (
                    blocks(self.width, component.horizontal, horizontal),
                    blocks(self.height, component.vertical, vertical),
                )
            }
            _ => (self.width.div_ceil(8 * horizontal), self.height.div_ceil(8 * vertical)),
        }
    }

    /// Notes what a scan adds; none if an earlier scan had it already, or if the scan that it builds on is missing.
    fn note(&mut self, scan: &Scan) -> Option<()> {
        for part in &scan.parts {
            for known in &mut self.components[part.component].known[scan.first..=scan.last] {
                let expected = if scan.high == 0 { UNKNOWN } else { scan.high };
                if *known != expected {
                    return None;
                }
                *known = scan.low;
            }
        }
        Some(())
    }
}

/// The header of a scan.
struct Scan {
    parts: Vec<Part>,
    /// The first and the last coefficient that it has.
    first: usize,
    last: usize,
    /// The lowest bit of the coefficients before this scan, 0 if it is their first, and behind it.
    high: u8,
    low: u8,
    progressive: bool,
}

/// A component of a scan and the numbers of its tables.
struct Part {
    component: usize,
    direct: usize,
    alternating: usize,
}

impl Scan {
    fn read(header: &[u8], frame: &Frame) -> Option<Self> {
        let count = usize::from(*header.first()?);
        let mut parts = Vec::new();
        for part in header.get(1..1 + 2 * count)?.chunks_exact(2) {
            let component = frame.components.iter().position(|component| component.id == part[0])?;
            let (direct, alternating) = (usize::from(part[1] >> 4), usize::from(part[1] & 15));
            parts.push(Part { component, direct, alternating });
        }
        let &[first, last, bits] = header.get(1 + 2 * count..4 + 2 * count)? else { return None };
        let (first, last, high, low) = match frame.progressive {
            true => (usize::from(first), usize::from(last), bits >> 4, bits & 15),
            false => (0, BLOCK - 1, 0, 0),
        };
        let tables = parts.iter().all(|part| part.direct < 4 && part.alternating < 4);
        // Direct coefficients come alone, and alternating ones of one component at a time.
        let band = if first == 0 { last == 0 } else { first <= last && last < BLOCK && count == 1 };
        let bits = low < 14 && (high == 0 || high == low + 1);
        let valid = (1..=4).contains(&count) && tables && bits && (band || !frame.progressive);
        valid.then_some(Self { parts, first, last, high, low, progressive: frame.progressive })
    }

    /// Goes through a block; `run` counts the blocks that have no more coefficients.
    fn block(
        &self,
        bits: &mut Bits<'_>,
        tables: (Option<&Table>, Option<&Table>),
        present: &mut u64,
        run: &mut u32,
    ) -> Result<()> {
        if self.first == 0 {
            if self.high > 0 {
                return bits.skip(1);
            }
            let size = bits.code(tables.0.ok_or_else(senseless)?)?;
            bits.skip(size.into())?;
            if self.progressive {
                return Ok(());
            }
        }
        let table = tables.1.ok_or_else(senseless)?;
        match self.high {
            0 => self.first_of_band(bits, table, present, run),
            _ => self.refinement(bits, table, present, run),
        }
    }

    fn first_of_band(
        &self,
        bits: &mut Bits<'_>,
        table: &Table,
        present: &mut u64,
        run: &mut u32,
    ) -> Result<()> {
        if *run > 0 {
            *run -= 1;
            return Ok(());
        }
        let mut at = self.first.max(1);
        while at <= self.last {
            let code = bits.code(table)?;
            let (zeros, size) = (code >> 4, u32::from(code & 15));
            match (zeros, size) {
                (15, 0) => at += 16,
                (_, 0) => {
                    // Of other than progressive files this is the end of one block.
                    let more = if self.progressive { bits.take(zeros.into())? } else { 0 };
                    *run = (1 << if self.progressive { zeros } else { 0 }) + more - 1;
                    return Ok(());
                }
                _ => {
                    at += usize::from(zeros);
                    if at > self.last {
                        return Err(senseless());
                    }
                    *present |= 1 << at;
                    bits.skip(size)?;
                    at += 1;
                }
            }
        }
        if at > self.last + 1 { Err(senseless()) } else { Ok(()) }
    }

    fn refinement(&self, bits: &mut Bits<'_>, table: &Table, present: &mut u64, run: &mut u32) -> Result<()> {
        let mut at = self.first;
        if *run == 0 {
            while at <= self.last {
                let code = bits.code(table)?;
                let (mut zeros, size) = (code >> 4, code & 15);
                match (zeros, size) {
                    (15, 0) => {}
                    (_, 0) => {
                        *run = (1 << zeros) + bits.take(zeros.into())?;
                        break;
                    }
                    (_, 1) => bits.skip(1)?,
                    _ => return Err(senseless()),
                }
                // Coefficients that were there before get another bit each on the way.
                while at <= self.last {
                    if *present >> at & 1 == 1 {
                        bits.skip(1)?;
                    } else if zeros == 0 {
                        break;
                    } else {
                        zeros -= 1;
                    }
                    at += 1;
                }
                if size > 0 {
                    if at > self.last {
                        return Err(senseless());
                    }
                    *present |= 1 << at;
                }
                at += 1;
            }
        }
        if *run > 0 {
            for at in at..=self.last {
                bits.skip((*present >> at & 1) as u32)?;
            }
            *run -= 1;
        }
        Ok(())
    }
}

/// A table of codes of 1 to 16 bits.
struct Table {
    /// For what is read up to 16 bits ahead: by length, the first code behind those of this length, the first code and the place
    /// of its value.
    lengths: [(u32, u32, usize); 16],
    values: Vec<u8>,
    /// Value and length of the codes of up to 8 bits, by the next 8 bits; length 0 where the code is longer.
    short: [(u8, u8); 256],
}

fn read_tables(mut segment: &[u8], tables: &mut [[Option<Table>; 4]; 2]) -> Option<()> {
    while let Some((&which, rest)) = segment.split_first() {
        let (counts, rest) = rest.split_at_checked(16)?;
        let count: usize = counts.iter().map(|count| usize::from(*count)).sum();
        let (values, rest) = rest.split_at_checked(count)?;
        let place = tables.get_mut(usize::from(which >> 4))?.get_mut(usize::from(which & 15))?;
        *place = Some(Table::new(counts, values)?);
        segment = rest;
    }
    Some(())
}

impl Table {
    fn new(counts: &[u8], values: &[u8]) -> Option<Self> {
        let (mut code, mut place) = (0u32, 0);
        let (mut lengths, mut short) = ([(0, 0, 0); 16], [(0, 0); 256]);
        for (number, &count) in counts.iter().enumerate() {
            let length = number + 1;
            lengths[number] = (code + u32::from(count), code, place);
            if code + u32::from(count) > 1 << length {
                return None;
            }
            for _ in 0..count {
                if length <= 8 {
                    let first = (code as usize) << (8 - length);
                    short[first..first + (1 << (8 - length))].fill((values[place], length as u8));
                }
                (code, place) = (code + 1, place + 1);
            }
            code <<= 1;
        }
        Some(Self { lengths, values: values.to_vec(), short })
    }
}

/// Reads compressed data bit by bit.
struct Bits<'a> {
    bytes: &'a [u8],
    at: usize,
    /// The next bits, the first one on top.
    buffer: u64,
    count: u32,
}

impl Bits<'_> {
    /// Takes what there is, up to a marker.
    fn fill(&mut self) {
        while self.count <= 56 {
            let Some(&byte) = self.bytes.get(self.at) else { return };
            let next = self.bytes.get(self.at + 1);
            if byte == 0xff {
                if next != Some(&0) {
                    return;
                }
                self.at += 1;
            }
            self.at += 1;
            self.buffer |= u64::from(byte) << (56 - self.count);
            self.count += 8;
        }
    }

    fn take(&mut self, bits: u32) -> Result<u32> {
        if bits == 0 {
            return Ok(0);
        }
        if bits > 16 {
            return Err(senseless());
        }
        if self.count < bits {
            self.fill();
        }
        self.count = self.count.checked_sub(bits).ok_or_else(missing)?;
        let taken = self.buffer >> (64 - bits);
        self.buffer <<= bits;
        Ok(taken as u32)
    }

    fn skip(&mut self, bits: u32) -> Result<()> {
        self.take(bits).map(drop)
    }

    /// The value of the next code.
    fn code(&mut self, table: &Table) -> Result<u8> {
        if self.count < 16 {
            self.fill();
        }
        let (value, length) = table.short[(self.buffer >> 56) as usize];
        if length > 0 {
            self.skip(length.into())?;
            return Ok(value);
        }
        let ahead = (self.buffer >> 48) as u32;
        for (number, &(behind, first, place)) in table.lengths.iter().enumerate() {
            let code = ahead >> (15 - number);
            if code < behind {
                self.skip(number as u32 + 1)?;
                return table.values.get(place + (code - first) as usize).copied().ok_or_else(senseless);
            }
        }
        // No code begins so; where the data has ended, that is why.
        Err(if self.count < 16 { missing() } else { senseless() })
    }

    /// Goes on behind the restart marker that has to come now, `number` after the scan's first one: they count from 0 to 7 and
    /// begin again.
    fn restart(&mut self, number: usize) -> Result<()> {
        self.at = self.end()?;
        while self.bytes.get(self.at + 1) == Some(&0xff) {
            self.at += 1;
        }
        match self.bytes.get(self.at + 1) {
            Some(&marker @ 0xd0..=0xd7) if usize::from(marker - 0xd0) == number % 8 => {
                self.at += 2;
                Ok(())
            }
            _ => Err(missing()),
        }
    }

    /// Where the data ends, which is at a marker. Some cameras fill up the last bytes.
    fn end(&mut self) -> Result<usize> {
        let ahead = (self.buffer << (self.count % 8)).to_be_bytes();
        let mut filling = ahead[..self.count as usize / 8].iter().all(|byte| matches!(byte, 0 | 0xff));
        (self.buffer, self.count) = (0, 0);
        while let Some(&byte) = self.bytes.get(self.at) {
            match (byte, self.bytes.get(self.at + 1)) {
                (0xff, Some(0)) => self.at += 1,
                (0xff, _) => break,
                (byte, _) => filling &= byte == 0,
            }
            self.at += 1;
        }
        if filling { Ok(self.at) } else { Err(senseless()) }
    }
}
