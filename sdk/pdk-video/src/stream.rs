//! H.264 that is not in a file: a stream whose pictures come one by one, each with the units that it needs (ITU-T H.264, annex B).

use openh264::OpenH264API;
use openh264::decoder::{Decoder, DecoderConfig, Flush};
use openh264::formats::YUVSource;
use pdk_sdk::prelude::*;

use crate::convert::Yuv420;
use crate::reader::copy_planes;
use crate::sps::{Colours, colours};

/// Decodes a stream whose pictures are shown in the order in which they come.
pub struct Stream {
    decoder: Decoder,
    /// What the last parameter sets say about colours.
    colours: Colours,
}

impl Stream {
    /// Begins with a picture that can be decoded on its own.
    ///
    /// # Errors
    /// If the decoder does not start.
    pub fn new() -> Result<Self> {
        let config = DecoderConfig::new().flush_after_decode(Flush::Flush);
        let decoder = Decoder::with_api_config(OpenH264API::from_source(), config);
        let decoder =
            decoder.map_err(|error| Error::new(format!("the H.264 decoder does not start: {error}")))?;
        Ok(Self { decoder, colours: Colours::default() })
    }

    /// Decodes the units of one picture.
    ///
    /// # Errors
    /// If they are damaged, make none, or code colours by a matrix that is not read.
    pub fn decode(&mut self, units: &[u8], into: &mut Yuv420) -> Result<()> {
        self.colours = colours(units).unwrap_or(self.colours);
        let coding = self.colours.coding().map_err(|what| {
            Error::new(format!(
                "it is {what}, and only the matrices of BT.601 and BT.709 are read; encode the topic again with one of them"
            ))
        })?;
        match self.decoder.decode(units) {
            Ok(Some(picture)) if picture.dimensions().0 > 0 => {
                copy_planes(&picture, into);
                into.coding = coding;
                Ok(())
            }
            Ok(_) => Err(Error::new(
                "its H.264 shows frames in another order than it stores them (B frames), which is not read here; encode it without them",
            )),
            Err(error) => Err(Error::new(format!(
                "its H.264 is damaged, or uses what the decoder does not know ({error})"
            ))),
        }
    }
}

/// Whether decoding can begin with these units: they have a picture of the kind IDR.
pub fn begins_anew(units: &[u8]) -> bool {
    units.windows(4).any(|window| window[..3] == [0, 0, 1] && window[3] & 31 == 5)
}
