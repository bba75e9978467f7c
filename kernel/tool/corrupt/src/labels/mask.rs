//! Masks in PNG files: a value for each pixel, moved as the pixels of the picture are, without a mixture of values.

use std::io::Cursor;

use pdk_labels::Labels;
use pdk_sdk::error::{Error, Place, Result};
use png::{Decoder, Encoder, Transformations};

/// A mask as its file has it.
struct Mask {
    info: png::Info<'static>,
    /// The values, one behind the other, and the bytes of each.
    values: Vec<u8>,
    /// Bytes of each value.
    bytes: usize,
}

/// The mask of a perturbed picture. What comes from outside of the picture has the value `outside` in all channels.
///
/// # Errors
/// If it is not a PNG file of the size of the picture, or a perturbation cannot say where its pixels come from.
pub fn moved(file: &[u8], size: [usize; 2], labels: &mut Labels<'_>, outside: u16) -> Result<Vec<u8>> {
    let mask = read(file)?;
    let found = [mask.info.width as usize, mask.info.height as usize];
    if found != size {
        return Err(Error::new(format!(
            "the mask has {}x{} pixels, but its picture {}x{}; make them of one size",
            found[0], found[1], size[0], size[1]
        )));
    }
    let deep = mask.info.bit_depth == png::BitDepth::Sixteen;
    let most = match mask.info.bit_depth {
        png::BitDepth::Sixteen => u16::MAX,
        depth => (1u16 << depth as u8) - 1,
    };
    if outside > most {
        return Err(Error::new(format!(
            "--outside is {outside}, but the mask holds values up to {most}; choose one of these"
        )));
    }
    let fill: Vec<u8> = match deep {
        true => outside.to_be_bytes().into_iter().cycle().take(mask.bytes).collect(),
        false => vec![outside as u8; mask.bytes],
    };
    let mut values = Vec::with_capacity(mask.values.len());
    for source in labels.sources()? {
        let value = source.and_then(|at| mask.values.get(at * mask.bytes..(at + 1) * mask.bytes));
        values.extend_from_slice(value.unwrap_or(&fill));
    }
    write(&Mask { values, ..mask })
}

fn read(file: &[u8]) -> Result<Mask> {
    let mut decoder = Decoder::new(Cursor::new(file));
    decoder.set_transformations(Transformations::IDENTITY);
    let damaged = "it is not a PNG file, or damaged";
    let mut reader = decoder.read_info().place(damaged)?;
    pdk_image::check_size(reader.info().width, reader.info().height)?;
    let length = reader.output_buffer_size().ok_or_else(|| Error::new("it is too large"))?;
    let mut packed = vec![0; length];
    reader.next_frame(&mut packed).place(damaged)?;
    let source = reader.info();
    let mut info = png::Info::with_size(source.width, source.height);
    (info.color_type, info.bit_depth) = (source.color_type, source.bit_depth);
    info.palette = source.palette.as_ref().map(|palette| palette.to_vec().into());
    info.trns = source.trns.as_ref().map(|trns| trns.to_vec().into());
    let bits = info.bit_depth as usize;
    let (width, row) = (info.width as usize, reader.output_line_size(info.width).unwrap_or(0));
    let bytes = info.color_type.samples() * bits.div_ceil(8);
    let values = match bits {
        // Several values in a byte, the first in its highest bits.
        1 | 2 | 4 => packed
            .chunks_exact(row.max(1))
            .flat_map(|row| {
                (0..width).map(move |x| row[x * bits / 8] >> (8 - bits - x * bits % 8) & ((1 << bits) - 1))
            })
            .collect(),
        _ => packed,
    };
    Ok(Mask { info, values, bytes })
}

fn write(mask: &Mask) -> Result<Vec<u8>> {
    let mut file = Vec::new();
    let bits = mask.info.bit_depth as usize;
    let packed = match bits {
        1 | 2 | 4 => mask
            .values
            .chunks_exact(mask.info.width as usize)
            .flat_map(|row| {
                row.chunks(8 / bits).map(|values| {
                    let place = |(x, value): (usize, &u8)| value << (8 - bits - x * bits);
                    values.iter().enumerate().map(place).fold(0, |byte, value| byte | value)
                })
            })
            .collect(),
        _ => mask.values.clone(),
    };
    let failed = "cannot write the mask";
    let mut writer =
        Encoder::with_info(&mut file, mask.info.clone()).place(failed)?.write_header().place(failed)?;
    writer.write_image_data(&packed).place(failed)?;
    writer.finish().place(failed)?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use png::ColorType;

    use super::*;

    #[test]
    fn every_depth_survives() {
        for (color, depth, bytes) in [
            (ColorType::Grayscale, png::BitDepth::One, 1),
            (ColorType::Indexed, png::BitDepth::Two, 1),
            (ColorType::Indexed, png::BitDepth::Four, 1),
            (ColorType::Grayscale, png::BitDepth::Eight, 1),
            (ColorType::Grayscale, png::BitDepth::Sixteen, 2),
            (ColorType::Rgb, png::BitDepth::Eight, 3),
        ] {
            let mut info = png::Info::with_size(11, 3);
            (info.color_type, info.bit_depth) = (color, depth);
            info.palette = (color == ColorType::Indexed).then(|| vec![7; 48].into());
            let most = if depth as u8 >= 8 { 255 } else { (1 << depth as u8) - 1 };
            let values: Vec<u8> = (0..33 * bytes).map(|at| (at * 37 % 256) as u8 & most as u8).collect();
            let mask = Mask { info, values, bytes };
            let again = read(&write(&mask).unwrap()).unwrap();
            assert_eq!((again.values, again.bytes), (mask.values, bytes), "{color:?} {depth:?}");
            assert_eq!(again.info.palette.is_some(), color == ColorType::Indexed);
        }
    }
}
