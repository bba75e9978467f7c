//! Messages of Foxglove with pictures, in Protocol Buffers: the fields that are read, by their published numbers.

/// `foxglove.CompressedImage`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct CompressedImage {
    /// When it was taken.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// A JPEG, PNG or WebP.
    #[prost(bytes = "vec", tag = "2")]
    pub data: Vec<u8>,
}

/// `foxglove.RawImage`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct RawImage {
    /// When it was taken.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// Pixels in a row.
    #[prost(fixed32, tag = "2")]
    pub width: u32,
    /// Rows.
    #[prost(fixed32, tag = "3")]
    pub height: u32,
    /// How its pixels are stored.
    #[prost(string, tag = "4")]
    pub encoding: String,
    /// Bytes from one row to the next.
    #[prost(fixed32, tag = "5")]
    pub step: u32,
    /// The pixels.
    #[prost(bytes = "vec", tag = "6")]
    pub data: Vec<u8>,
}

/// `foxglove.CompressedVideo`.
#[derive(Clone, PartialEq, prost::Message)]
pub struct CompressedVideo {
    /// When it was taken.
    #[prost(message, optional, tag = "1")]
    pub timestamp: Option<Timestamp>,
    /// The units of one picture.
    #[prost(bytes = "vec", tag = "3")]
    pub data: Vec<u8>,
    /// The codec, such as `h264`.
    #[prost(string, tag = "4")]
    pub format: String,
}

/// `google.protobuf.Timestamp`.
#[derive(Clone, Copy, PartialEq, prost::Message)]
pub struct Timestamp {
    /// Seconds since 1970.
    #[prost(int64, tag = "1")]
    pub seconds: i64,
    /// And nanoseconds.
    #[prost(int32, tag = "2")]
    pub nanos: i32,
}

impl Timestamp {
    /// In nanoseconds.
    pub fn nanoseconds(self) -> u64 {
        let nanoseconds = i128::from(self.seconds) * 1_000_000_000 + i128::from(self.nanos);
        u64::try_from(nanoseconds).unwrap_or_default()
    }
}
