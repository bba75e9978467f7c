//! The functions of each kind of component, as the host calls them.

use std::ffi::c_void;

use pdk_abi::abi_stable::prefix_type::WithMetadata;
use pdk_abi::{Instance, Sink, Status, Text, empty, load, store};
use pdk_seed::Key;

use super::guard::{Guarded, guard};
use super::{Exported, Registration, configured, finish, put};
use crate::abi::convert::{self, Crosses};
use crate::component::Component;
use crate::config::Config;
use crate::dataset::Dataset;
use crate::driver::{Control, DriveContext, Driver};
use crate::error::{Error, ErrorKind, Result};
use crate::history::{History, Ring};
use crate::mask::Mask;
use crate::perturbation::{Context, EarlierMaps, Perturbation};
use crate::predictor::Predictor;
use crate::saliency::{HeatmapMut, Saliency};
use crate::search::Search;
use crate::signals::Signals;
use crate::simulator::Simulator;

/// Makes, for each kind, the table line of a component and the function of the root module that makes instances. The functions of a table
/// take the host's pointers, which live through the call, and the instance that was made here, which the host lends to one call at a
/// time.
macro_rules! registrations {
    ($($registration:ident: $bound:ident, $make:ident, $table:ident as $table_ref:ident { $($function:ident),* };)*) => {
        /// The functions of an instance, by its kind.
        #[derive(Clone, Copy)]
        pub enum Functions {
            $(
                #[doc = concat!("Those of a ", stringify!($make), ".")]
                $bound(pdk_abi::$table_ref),
            )*
        }

        $(
            /// The table line of a component of this kind.
            pub const fn $registration<T: Component + $bound + 'static>() -> Registration {
                let functions = const {
                    &WithMetadata::new(pdk_abi::$table {
                        drop: end::<T>,
                        $($function: $registration::$function::<T>,)*
                    })
                };
                Registration {
                    describe: T::description,
                    create: create::<T>,
                    functions: Functions::$bound(pdk_abi::$table_ref(functions.static_as_prefix())),
                    input_files: T::input_files,
                }
            }
        )*

        /// The functions of the root module that make instances.
        pub(super) mod make {
            use super::*;
            $(
                pub unsafe extern "C" fn $make<P: Exported>(
                    index: usize,
                    parameters: Text,
                    into: *mut Instance<pdk_abi::$table_ref>,
                    error: *const Sink,
                ) -> Status {
                    let made = guard(|| {
                        // SAFETY: the host lends the parameters for this call.
                        let configured = unsafe { configured(P::TABLE, index, parameters) };
                        let (registration, description, config) = configured?;
                        let Functions::$bound(functions) = registration.functions else {
                            let sentence = format!(concat!("component number {} is not a ", stringify!($make)), index);
                            return Err(Error::of(ErrorKind::Nonsense, sentence));
                        };
                        let names = description.parameters.into_iter().map(|p| p.name).collect();
                        let object = (registration.create)(&config, names)?;
                        // SAFETY: the host lends it for this call.
                        unsafe { into.write(Instance { object, functions: Some(functions) }) };
                        Ok(())
                    });
                    // SAFETY: the host lends the sink for this call.
                    unsafe { finish(made, error) }
                }
            )*
        }
    };
}

registrations! {
    perturbations: Perturbation, perturbation, PerturbationFunctions as PerturbationFunctionsRef {
        apply, move_points, observe, actuate
    };
    simulators: Simulator, simulator, SimulatorFunctions as SimulatorFunctionsRef {
        camera, reset, frame, act, waypoints, info, label_names, labels, annotate, depth
    };
    drivers: Driver, driver, DriverFunctions as DriverFunctionsRef { reset, drive, info };
    saliencies: Saliency, saliency, SaliencyFunctions as SaliencyFunctionsRef { map_size, map };
    masks: Mask, mask, MaskFunctions as MaskFunctionsRef { weights };
    predictors: Predictor, predictor, PredictorFunctions as PredictorFunctionsRef { reset, predict, info };
    searches: Search, search, SearchFunctions as SearchFunctionsRef { start, ask, tell };
    datasets: Dataset, dataset, DatasetFunctions as DatasetFunctionsRef { length, name, read, position, info };
}

/// Makes an instance.
fn create<T: Component + 'static>(config: &Config, names: Vec<String>) -> Result<*mut c_void> {
    Ok(Box::into_raw(Box::new(Guarded::new(T::new(config)?, names))).cast())
}

/// Ends an instance.
unsafe extern "C" fn end<T>(object: *mut c_void) {
    // SAFETY: the host has it from here, and does not use it after this.
    drop(unsafe { Box::from_raw(object.cast::<Guarded<T>>()) });
}

/// Calls the component in an instance.
///
/// # Safety
/// The instance was made here for this type, no other call of it is in progress, and the sink is that of this call.
#[inline]
unsafe fn call<T>(
    object: *mut c_void,
    error: *const Sink,
    work: impl FnOnce(&mut T, &[String]) -> Result<()>,
) -> Status {
    // SAFETY: the caller's promise.
    unsafe { finish((*object.cast::<Guarded<T>>()).call(work), error) }
}

/// Declares functions of a table. What they do with the host's pointers is within the promises that `call` asks for.
macro_rules! functions {
    ($module:ident: $bound:ident;
     $(fn $function:ident($component:ident, $names:pat $(, $argument:ident: $type:ty)*) $work:block)*) => {
        mod $module {
            use super::*;
            $(
                pub unsafe extern "C" fn $function<T: $bound>(
                    object: *mut c_void,
                    $($argument: $type,)*
                    error: *const Sink,
                ) -> Status {
                    // SAFETY: the host lends the instance, the memory behind all pointers and the sink for this call, what is to be
                    // not written to by anything else.
                    unsafe { call::<T>(object, error, |$component, $names| $work) }
                }
            )*
        }
    };
}

functions! { perturbations: Perturbation;
    fn apply(
        component,
        names,
        source: *const pdk_abi::Frame,
        target: *const pdk_abi::FrameMut,
        context: *const pdk_abi::PerturbationContext
    ) {
        let (source, target) = (convert::source(source)?, convert::target(target)?);
        with_context(names, context, |cx| component.apply(source, target, cx))
    }
    fn move_points(
        component,
        names,
        points: *mut f64,
        length: usize,
        way: u64,
        width: usize,
        height: usize,
        context: *const pdk_abi::PerturbationContext
    ) {
        let points = convert::slice_mut(points.cast::<[f64; 2]>(), length);
        let way = convert::read_way(way)?;
        with_context(names, context, |cx| component.move_points(points, way, [width, height], cx))
    }
    fn observe(
        component,
        names,
        told: *const pdk_abi::DriveContext,
        context: *const pdk_abi::PerturbationContext,
        into: *mut pdk_abi::DriveContext
    ) {
        let told = DriveContext::read(told);
        with_context(names, context, |cx| {
            store(component.observe(told, cx)?.raw(), into);
            Ok(())
        })
    }
    fn actuate(
        component,
        names,
        control: *const pdk_abi::Control,
        context: *const pdk_abi::PerturbationContext,
        into: *mut pdk_abi::Control
    ) {
        let control = Control::read(control);
        with_context(names, context, |cx| {
            store(component.actuate(control, cx)?.raw(), into);
            Ok(())
        })
    }
}

/// Calls a perturbation with the context that the host hands over.
///
/// # Safety
/// The context and all that it points to are those of a call in progress.
unsafe fn with_context(
    names: &[String],
    context: *const pdk_abi::PerturbationContext,
    work: impl FnOnce(&Context<'_>) -> Result<()>,
) -> Result<()> {
    // SAFETY: the caller's promise.
    unsafe {
        // A host that does not tell how far the vehicle has driven does not know it.
        let unknown = pdk_abi::PerturbationContext { travelled: f64::NAN, ..empty() };
        let raw = load(context, unknown);
        let key = Key(raw.key);
        let mut cx = Context::new(raw.intensity, raw.frame_index, raw.time, &key)
            .with_stream(raw.stream)
            .with_values(names, convert::slice(raw.values, raw.values_length));
        let saliency = convert::slice(raw.saliency, raw.saliency_length);
        cx.travelled = Some(raw.travelled).filter(|metres| metres.is_finite());
        cx.saliency = (!saliency.is_empty()).then_some(saliency);
        let times = convert::slice(raw.earlier_times, raw.earlier_length);
        let (width, height) = (raw.earlier_width, raw.earlier_height);
        let length = times.len().saturating_mul(width).saturating_mul(height);
        cx.earlier = EarlierMaps::new(times, convert::slice(raw.earlier_values, length), width, height)?;
        let (slots, width, height) = (raw.history_slots, raw.history_width, raw.history_height);
        let bytes = slots.saturating_mul(width).saturating_mul(height).saturating_mul(3);
        cx.history = History::new(Ring {
            pixels: convert::slice(raw.history, bytes),
            indices: convert::slice(raw.history_indices, slots),
            times: convert::slice(raw.history_times, slots),
            latest: raw.history_latest,
            length: raw.history_length,
            width,
            height,
        })?;
        let (signals, pairs) =
            (raw.signals_length, |data: *const f64| convert::slice(data.cast(), raw.signals_length));
        cx.signals = Signals::new(
            convert::slice(raw.signal_indices, signals),
            convert::slice(raw.signal_times, signals),
            pairs(raw.signals_given),
            pairs(raw.signals_passed),
        )?;
        cx.period = Some(raw.period).filter(|seconds| *seconds > 0.0);
        let depth = convert::slice(raw.depth, raw.depth_length);
        cx.depth = (!depth.is_empty()).then_some(depth);
        work(&cx)
    }
}

functions! { simulators: Simulator;
    fn camera(component, _, into: *mut pdk_abi::Camera) {
        store(component.camera().raw(), into);
        Ok(())
    }
    fn reset(component, _, scenario: Text, slot: u32, into: *mut pdk_abi::State) {
        let scenario = serde_json::from_str(convert::text(scenario)?)?;
        store(component.reset(&scenario, slot)?.raw(), into);
        Ok(())
    }
    fn frame(component, _, target: *const pdk_abi::FrameMut, into: *mut pdk_abi::State) {
        store(component.frame(convert::target(target)?)?.raw(), into);
        Ok(())
    }
    fn act(component, _, control: *const pdk_abi::Control, into: *mut pdk_abi::State) {
        store(component.act(Control::read(control))?.raw(), into);
        Ok(())
    }
    fn waypoints(component, _, waypoints: *const Sink) {
        put(waypoints, &serde_json::to_string(&component.waypoints())?);
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
    fn label_names(component, _, names: *const Sink) {
        put(names, &serde_json::to_string(&component.label_names())?);
        Ok(())
    }
    fn labels(component, _, into: *mut u8, length: usize) {
        component.labels(convert::slice_mut(into, length))
    }
    fn annotate(component, _, annotations: u64) {
        component.annotate(convert::read_annotations(annotations));
        Ok(())
    }
    fn depth(component, _, into: *mut f32, length: usize) {
        component.depth(convert::slice_mut(into, length))
    }
}

functions! { drivers: Driver;
    fn reset(component, _) {
        component.reset()
    }
    fn drive(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::DriveContext,
        into: *mut pdk_abi::Control
    ) {
        store(component.drive(convert::source(frame)?, &DriveContext::read(context))?.raw(), into);
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
}

functions! { saliencies: Saliency;
    fn map_size(component, _, width: usize, height: usize, into: *mut pdk_abi::MapSize) {
        let [width, height] = component.map_size(width, height)?;
        store(pdk_abi::MapSize { width, height, ..empty() }, into);
        Ok(())
    }
    fn map(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::MapContext,
        map: *const pdk_abi::Heatmap
    ) {
        let raw = load(context, convert::unsaid_map_context());
        let key = Key(raw.key);
        let pdk_abi::Heatmap { values, width, height, .. } = load(map, empty());
        let values = convert::slice_mut(values, width.saturating_mul(height));
        component.map(convert::source(frame)?, &convert::read_map_context(&raw, &key), HeatmapMut::new(values, width, height)?)
    }
}

functions! { masks: Mask;
    fn weights(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::MapContext,
        map: *const pdk_abi::Heatmap
    ) {
        let raw = load(context, convert::unsaid_map_context());
        let key = Key(raw.key);
        let pdk_abi::Heatmap { values, width, height, .. } = load(map, empty());
        let values = convert::slice_mut(values, width.saturating_mul(height));
        let out = HeatmapMut::new(values, width, height)?;
        component.weights(convert::source(frame)?, &convert::read_map_context(&raw, &key), out)
    }
}

functions! { predictors: Predictor;
    fn reset(component, _) {
        component.reset()
    }
    fn predict(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::DriveContext,
        outputs: *const Sink,
        values: *const Sink
    ) {
        let found = component.predict(convert::source(frame)?, &DriveContext::read(context))?;
        put(outputs, &serde_json::to_string(&convert::shapes(&found))?);
        let sink = load(values, empty());
        found.iter().for_each(|output| sink.put(convert::bytes(&output.values)));
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
}

functions! { searches: Search;
    fn start(component, _, problem: Text, key: Text) {
        let problem = serde_json::from_str(convert::text(problem)?)?;
        let key = <[u8; 32]>::try_from(key.bytes())
            .map_err(|_| Error::of(ErrorKind::Nonsense, "a key has to have 32 bytes"))?;
        component.start(&problem, &Key(key))
    }
    fn ask(component, _, count: usize, candidates: *const Sink) {
        put(candidates, &serde_json::to_string(&component.ask(count)?)?);
        Ok(())
    }
    fn tell(component, _, results: Text) {
        component.tell(&serde_json::from_str::<Vec<_>>(convert::text(results)?)?)
    }
}

functions! { datasets: Dataset;
    fn length(component, _, into: *mut u64) {
        into.write(component.len() as u64);
        Ok(())
    }
    fn name(component, _, index: u64, name: *const Sink) {
        put(name, &component.name(index as usize));
        Ok(())
    }
    fn read(component, _, index: u64, into: *mut pdk_abi::Entry, pixels: *const Sink) {
        let entry = component.read(index as usize)?;
        let (width, height) = (entry.frame.width(), entry.frame.height());
        load(pixels, empty()).put(entry.frame.data());
        let crate::dataset::Entry { steering, throttle, time, speed, .. } = entry;
        store(pdk_abi::Entry { width, height, steering, throttle, time, speed, ..empty() }, into);
        Ok(())
    }
    fn position(component, _, index: u64, into: *mut pdk_abi::Position) {
        store(component.position(index as usize).raw(), into);
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
}
