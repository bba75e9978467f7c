//! A plugin as a later SDK of the same version of the interface would make it: its structures and tables are longer than those
//! that pdk knows, it has a component of another kind, and its description says more. It is written against the interface alone.
//!
//! Its driver steers by what it was given. If pdk touched what it does not know, the numbers would be others.

pub mod interface;

use std::ffi::c_void;

use abi_stable::library::{CheckTypeLayout, LibHeader, RootModuleResult};
use abi_stable::prefix_type::{PrefixRefTrait, WithMetadata};
use abi_stable::std_types::ROk;
use interface::{DriverFunctions, DriverFunctionsRef, Plugin, PluginRef};
use pdk_abi::{Frame, Instance, Prefix, Sink, Status, Text, empty, load, status, store};

/// Describes the component of the unknown kind first, so that places count.
const DESCRIPTION: &str = r#"{
    "name": "later", "version": "2.0.0", "sdk": "9.1.0", "licence": "MIT",
    "components": [
        { "kind": "horn", "name": "later", "doc": "Blows", "version": 1, "temporal": "static", "default": true,
          "parameters": [] },
        { "kind": "driver", "name": "later", "doc": "Steers by what it is given", "version": 1, "temporal": "static",
          "default": true, "since": 2030, "parameters": [
            { "name": "gain", "doc": "factor", "type": "number", "min": 0.0, "max": 9.0, "default": 1.0, "step": 0.5 },
            { "name": "tint", "doc": "a colour", "type": "colour", "default": "red" }
        ] }
    ]
}"#;

/// What a driver decides, with a field more.
#[repr(C)]
#[derive(Clone, Copy)]
struct LaterControl {
    size: usize,
    steering: f64,
    throttle: f64,
    horn: f64,
}

/// The context of a driver, with one more field.
#[repr(C)]
#[derive(Clone, Copy)]
struct LaterContext {
    size: usize,
    frame_index: u64,
    time: f64,
    speed: f64,
    daylight: f64,
}

// SAFETY: `repr(C)` with the size first, no padding, and every value is a number.
unsafe impl Prefix for LaterControl {}
// SAFETY: as above.
unsafe impl Prefix for LaterContext {}

const DONE: Status = Status { code: status::DONE };

/// Never called by a pdk that does not know it.
unsafe extern "C" fn unknown() {
    std::process::abort();
}

/// Never called, because there is no such component.
unsafe extern "C" fn never<F>(_: usize, _: Text, _: *mut F, _: *const Sink) -> Status {
    std::process::abort();
}

/// It has no files.
unsafe extern "C" fn input_files(_: usize, _: Text, files: *const Sink, _: *const Sink) -> Status {
    // SAFETY: the host lends the sink for this call.
    unsafe { load(files, empty()).put(b"[]") };
    DONE
}

unsafe extern "C" fn describe(description: *const Sink, _error: *const Sink) -> Status {
    // SAFETY: the host lends the sink for this call.
    unsafe { load(description, empty()).put(DESCRIPTION.as_bytes()) };
    DONE
}

unsafe extern "C" fn driver(
    index: usize,
    parameters: Text,
    into: *mut Instance<DriverFunctionsRef>,
    error: *const Sink,
) -> Status {
    const FUNCTIONS: &WithMetadata<DriverFunctions> =
        &WithMetadata::new(DriverFunctions { drop: end, reset, drive, info, gradient, explain: unknown });
    // SAFETY: the host lends the parameters for this call.
    let parameters = String::from_utf8_lossy(unsafe { parameters.bytes() });
    if index != 1 || !parameters.contains(r#""tint":"red""#) {
        let sentence = format!("it was asked for number {index} with {parameters}");
        // SAFETY: the host lends the sink for this call.
        unsafe { load(error, empty()).put(sentence.as_bytes()) };
        // A way to fail that pdk does not know.
        return Status { code: 99 };
    }
    let object = Box::into_raw(Box::new(0_u64)).cast();
    let functions = Some(DriverFunctionsRef(FUNCTIONS.static_as_prefix()));
    // SAFETY: the host lends it for this call.
    unsafe { into.write(Instance { object, functions }) };
    DONE
}

unsafe extern "C" fn end(object: *mut c_void) {
    // SAFETY: the host has it from `create`, and does not use it after this.
    drop(unsafe { Box::from_raw(object.cast::<u64>()) });
}

unsafe extern "C" fn gradient(
    _object: *mut c_void,
    _frame: *const Frame,
    _context: *const pdk_abi::DriveContext,
    _into: *mut f32,
    _length: usize,
    _steering: *mut f64,
    _error: *const Sink,
) -> Status {
    Status { code: 99 }
}

unsafe extern "C" fn reset(object: *mut c_void, _error: *const Sink) -> Status {
    // SAFETY: the object is that of `create`.
    unsafe { object.cast::<u64>().write(0) };
    DONE
}

unsafe extern "C" fn drive(
    object: *mut c_void,
    frame: *const Frame,
    context: *const pdk_abi::DriveContext,
    into: *mut pdk_abi::Control,
    _error: *const Sink,
) -> Status {
    // What pdk does not say is as without it.
    let unsaid = LaterContext { size: 0, frame_index: 0, time: 0.0, speed: 0.0, daylight: 1.0 };
    // SAFETY: the host lends all of it for this call, and the object is that of `create`.
    unsafe {
        let context = load(context.cast::<LaterContext>(), unsaid);
        let frame = load(frame, empty());
        let frames = object.cast::<u64>();
        frames.write(frames.read() + 1);
        let steering = if context.daylight == 1.0 { f64::from(*frame.data) / 1000.0 } else { f64::NAN };
        let throttle = context.time / 10.0 + frames.read() as f64 / 1000.0;
        store(LaterControl { size: 0, steering, throttle, horn: 1.0 }, into.cast::<LaterControl>());
    }
    DONE
}

unsafe extern "C" fn info(_object: *mut c_void, info: *const Sink, _error: *const Sink) -> Status {
    // SAFETY: the host lends the sink for this call.
    unsafe { load(info, empty()).put(b"[]") };
    DONE
}

macro_rules! nothing {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        /// A plugin that makes nothing.
        const NOTHING: Plugin = Plugin {
            describe,
            input_files,
            $($name: never,)*
            horn: never,
            forget: unknown,
        };
    };
}

pdk_abi::each_kind!(nothing);

extern "C" fn root_module() -> RootModuleResult {
    const PLUGIN: &WithMetadata<Plugin> = &WithMetadata::new(Plugin { driver, ..NOTHING });
    // SAFETY: the host compares the layout in the header before it uses it.
    ROk(unsafe { PluginRef(PLUGIN.static_as_prefix()).to_prefix_ref().cast() })
}

// SAFETY: the name is that of abi_stable's header, and nothing else in this library uses it. The constructor returns this root module.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static _1as_0lib_1header_0root_bmodule_bloader: LibHeader =
    unsafe { LibHeader::from_constructor::<PluginRef>(root_module, CheckTypeLayout::Yes) };
