//! The interface between host and plugin: plain C layouts, checked when a library is loaded.
//!
//! Authors and users never meet this module: [`export!`](crate::export) writes the plugin's side ([`plugin`]), and
//! the host turns raw components back into the traits of the SDK ([`host`]). Frames cross as pointer, length, width,
//! height and stride; configuration and descriptions cross as JSON; nothing is converted or allocated per frame.

// The `sabi_trait` macro of abi_stable 0.11 implements its traits inside a constant.
#![allow(non_local_definitions)]

use std::ffi::c_char;

use abi_stable::StableAbi;
use abi_stable::library::RootModule;
use abi_stable::package_version_strings;
use abi_stable::sabi_types::VersionStrings;
use abi_stable::std_types::{RBox, RResult, RStr, RString, RVec};
use pdk_ops::{Frame, FrameMut};

use crate::driver::{Control, DriveContext};
use crate::error::{Error, ErrorKind};
use crate::simulator::{Camera, State};

pub mod host;
pub mod plugin;

pub use abi_stable;

/// Name of the symbol that holds the plugin's header.
pub const HEADER_SYMBOL: &str = "pdk_plugin";
/// Name of the symbol that tells the SDK version, readable whatever the version: `extern "C" fn() -> *const c_char`.
pub const VERSION_SYMBOL: &str = "pdk_plugin_sdk_version";
/// The type of the function behind [`VERSION_SYMBOL`].
pub type VersionFn = extern "C" fn() -> *const c_char;

/// What a call returns: a value or an error.
pub type Outcome<T> = RResult<T, RawError>;

/// What [`Error`] holds.
#[repr(C)]
#[derive(StableAbi)]
pub struct RawError {
    /// The code of its kind: a number, because one that no kind has must do no harm.
    kind: u8,
    message: RString,
}

impl From<Error> for RawError {
    fn from(error: Error) -> Self {
        Self { kind: error.kind().code(), message: error.message().into() }
    }
}

impl From<RawError> for Error {
    fn from(raw: RawError) -> Self {
        Error::of(ErrorKind::from_code(raw.kind), RString::into_string(raw.message))
    }
}

/// A frame to read.
#[repr(C)]
#[derive(Clone, Copy, StableAbi)]
pub struct RawFrame {
    data: *const u8,
    len: usize,
    width: usize,
    height: usize,
    stride: usize,
}

impl RawFrame {
    fn new(frame: Frame<'_>) -> Self {
        let data = frame.data();
        Self {
            data: data.as_ptr(),
            len: data.len(),
            width: frame.width(),
            height: frame.height(),
            stride: frame.stride(),
        }
    }

    /// # Safety
    /// The memory has to be readable and unchanged for `'a`.
    unsafe fn get<'a>(self) -> Result<Frame<'a>, pdk_ops::FrameError> {
        // SAFETY: the caller's promise.
        let data = unsafe { std::slice::from_raw_parts(self.data, self.len) };
        Frame::with_stride(data, self.width, self.height, self.stride)
    }
}

/// A frame to write.
#[repr(C)]
#[derive(Clone, Copy, StableAbi)]
pub struct RawFrameMut {
    data: *mut u8,
    len: usize,
    width: usize,
    height: usize,
    stride: usize,
}

impl RawFrameMut {
    fn new(frame: &mut FrameMut<'_>) -> Self {
        let (width, height, stride) = (frame.width(), frame.height(), frame.stride());
        let data = frame.data_mut();
        Self { data: data.as_mut_ptr(), len: data.len(), width, height, stride }
    }

    /// # Safety
    /// The memory has to be writable and not otherwise used for `'a`.
    unsafe fn get<'a>(self) -> Result<FrameMut<'a>, pdk_ops::FrameError> {
        // SAFETY: the caller's promise.
        let data = unsafe { std::slice::from_raw_parts_mut(self.data, self.len) };
        FrameMut::with_stride(data, self.width, self.height, self.stride)
    }
}

/// What [`Context`](crate::perturbation::Context) holds.
#[repr(C)]
#[derive(Clone, Copy, StableAbi)]
pub struct RawContext {
    intensity: f64,
    frame_index: u64,
    time: f64,
    key: [u8; 32],
    stream: u64,
    values: *const f64,
    values_len: usize,
    saliency: *const f32,
    saliency_len: usize,
}

/// A map to write, one number a pixel.
#[repr(C)]
#[derive(Clone, Copy, StableAbi)]
pub struct RawHeatmap {
    values: *mut f32,
    width: usize,
    height: usize,
}

/// A recorded frame.
#[repr(C)]
#[derive(StableAbi)]
pub struct RawEntry {
    pixels: RVec<u8>,
    width: usize,
    height: usize,
    steering: f64,
    throttle: f64,
    time: f64,
}

/// What crosses the boundary for a perturbation.
#[abi_stable::sabi_trait]
pub trait RawPerturbation: Send {
    /// Writes the perturbed `src` to `dst`.
    #[sabi(last_prefix_field)]
    fn apply(&mut self, src: RawFrame, dst: RawFrameMut, cx: &RawContext) -> Outcome<()>;
}

/// What crosses the boundary for a simulator.
#[abi_stable::sabi_trait]
pub trait RawSimulator: Send {
    /// Size and rate of the camera.
    fn camera(&mut self) -> Outcome<Camera>;
    /// Puts the vehicle at the start of a scenario, given as JSON.
    fn reset(&mut self, scenario: RStr<'_>, slot: u32) -> Outcome<State>;
    /// Writes what the camera sees.
    fn frame(&mut self, into: RawFrameMut) -> Outcome<State>;
    /// Applies a control.
    fn act(&mut self, control: Control) -> Outcome<State>;
    /// The centre line of the driven lane.
    #[sabi(last_prefix_field)]
    fn waypoints(&mut self) -> Outcome<RVec<[f64; 3]>>;
}

/// What crosses the boundary for a driver.
#[abi_stable::sabi_trait]
pub trait RawDriver: Send {
    /// Forgets everything about earlier frames.
    fn reset(&mut self) -> Outcome<()>;
    /// Decides what to do.
    fn drive(&mut self, frame: RawFrame, cx: DriveContext) -> Outcome<Control>;
    /// What was decided when the instance was made, as JSON.
    #[sabi(last_prefix_field)]
    fn info(&mut self) -> Outcome<RString>;
}

/// What crosses the boundary for a saliency method.
#[abi_stable::sabi_trait]
pub trait RawSaliency: Send {
    /// Writes the map.
    #[sabi(last_prefix_field)]
    fn map(&mut self, frame: RawFrame, out: RawHeatmap) -> Outcome<()>;
}

/// What crosses the boundary for a search strategy. Problem, candidates and results are JSON.
#[abi_stable::sabi_trait]
pub trait RawSearch: Send {
    /// Begins a search, with the key of everything that it draws.
    fn start(&mut self, problem: RStr<'_>, key: &[u8; 32]) -> Outcome<()>;
    /// Proposes candidates.
    fn ask(&mut self, n: usize) -> Outcome<RString>;
    /// Learns how candidates did.
    #[sabi(last_prefix_field)]
    fn tell(&mut self, results: RStr<'_>) -> Outcome<()>;
}

/// What crosses the boundary for a dataset reader.
#[abi_stable::sabi_trait]
pub trait RawDataset: Send {
    /// The number of frames.
    fn len(&mut self) -> Outcome<usize>;
    /// The name of a frame.
    fn name(&mut self, index: usize) -> Outcome<RString>;
    /// Reads a frame.
    #[sabi(last_prefix_field)]
    fn read(&mut self, index: usize) -> Outcome<RawEntry>;
}

/// An instance of a component of any kind.
#[repr(u8)]
#[derive(StableAbi)]
pub enum RawComponent {
    /// A perturbation.
    Perturbation(RawPerturbation_TO<'static, RBox<()>>),
    /// A simulator.
    Simulator(RawSimulator_TO<'static, RBox<()>>),
    /// A driver.
    Driver(RawDriver_TO<'static, RBox<()>>),
    /// A saliency method.
    Saliency(RawSaliency_TO<'static, RBox<()>>),
    /// A search strategy.
    Search(RawSearch_TO<'static, RBox<()>>),
    /// A dataset reader.
    Dataset(RawDataset_TO<'static, RBox<()>>),
}

/// The functions of a plugin.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = PluginModuleRef)))]
pub struct PluginModule {
    /// Describes the plugin and its components as JSON: see [`PluginDescription`].
    pub describe: extern "C" fn() -> Outcome<RString>,
    /// Makes an instance of the component with this place in the description, from its parameters as a JSON object.
    #[sabi(last_prefix_field)]
    pub create: extern "C" fn(index: usize, config: RStr<'_>) -> Outcome<RawComponent>,
}

impl RootModule for PluginModuleRef {
    abi_stable::declare_root_module_statics! {PluginModuleRef}
    const BASE_NAME: &'static str = "pdk_plugin";
    const NAME: &'static str = "pdk plugin";
    const VERSION_STRINGS: VersionStrings = package_version_strings!();
}

/// What a plugin says of itself.
#[derive(Debug, Clone, serde::Serialize, serde::Deserialize)]
pub struct PluginDescription {
    /// The plugin's name.
    pub name: String,
    /// The plugin's own version.
    pub version: String,
    /// Its components.
    pub components: Vec<crate::describe::Description>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_crosses_the_boundary_with_its_kind() {
        for kind in ErrorKind::ALL {
            let error = Error::of(kind, "it is gone");
            assert_eq!(Error::from(RawError::from(error.clone())), error);
        }
        let unknown = RawError { kind: 77, message: "from another time".into() };
        assert_eq!(Error::from(unknown), Error::new("from another time"));
    }
}
