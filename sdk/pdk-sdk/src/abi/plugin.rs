//! The plugin's side of the boundary: wraps the author's types, and turns their panics into errors before they reach it.

use std::cell::{Cell, RefCell};
use std::mem::ManuallyDrop;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use abi_stable::prefix_type::PrefixTypeTrait;
use abi_stable::sabi_trait::TD_Opaque;
use abi_stable::std_types::{RErr, ROk, RStr, RString, RVec};
use pdk_ops::Key;
use serde_json::{Map, Value};

use super::{
    Outcome, PluginDescription, PluginModule, PluginModuleRef, RawComponent, RawContext, RawDataset,
    RawDataset_TO, RawDriver, RawDriver_TO, RawEntry, RawFrame, RawFrameMut, RawHeatmap, RawPerturbation,
    RawPerturbation_TO, RawSaliency, RawSaliency_TO, RawSearch, RawSearch_TO, RawSimulator, RawSimulator_TO,
};
use crate::component::Component;
use crate::config::Config;
use crate::dataset::Dataset;
use crate::describe::Description;
use crate::driver::{Control, DriveContext, Driver};
use crate::error::{Error, ErrorKind, Result};
use crate::perturbation::{Context, Perturbation};
use crate::saliency::{HeatmapMut, Saliency};
use crate::search::Search;
use crate::simulator::{Camera, Simulator, State};

/// With this the error of a panic begins.
const PANICKED: &str = "the plugin panicked";

/// One line of a plugin's table of components.
pub struct Registration {
    /// Describes the component.
    pub describe: fn() -> Description,
    /// Makes an instance.
    pub create: fn(&Config, Vec<String>) -> Result<RawComponent>,
}

/// Makes the table line of a component; one function for each kind.
macro_rules! registrations {
    ($($function:ident, $bound:ident, $variant:ident, $object:ident;)*) => {
        $(
            /// The table line of a component of this kind.
            pub const fn $function<T: Component + $bound + 'static>() -> Registration {
                fn create<T: Component + $bound + 'static>(
                    config: &Config,
                    names: Vec<String>,
                ) -> Result<RawComponent> {
                    let guarded = Guarded::new(T::new(config)?, names);
                    Ok(RawComponent::$variant($object::from_value(guarded, TD_Opaque)))
                }
                Registration { describe: T::description, create: create::<T> }
            }
        )*
    };
}

registrations! {
    perturbations, Perturbation, Perturbation, RawPerturbation_TO;
    simulators, Simulator, Simulator, RawSimulator_TO;
    drivers, Driver, Driver, RawDriver_TO;
    saliencies, Saliency, Saliency, RawSaliency_TO;
    searches, Search, Search, RawSearch_TO;
    datasets, Dataset, Dataset, RawDataset_TO;
}

/// Describes a plugin from its table.
pub fn describe(name: &str, version: &str, table: &[Registration]) -> Outcome<RString> {
    outcome(guard(|| {
        let components = table.iter().map(|r| (r.describe)()).collect();
        let description =
            PluginDescription { name: name.to_owned(), version: version.to_owned(), components };
        Ok(RString::from(serde_json::to_string(&description)?))
    }))
}

/// Makes an instance of a component from its place in the table.
pub fn create(table: &[Registration], index: usize, config: RStr<'_>) -> Outcome<RawComponent> {
    outcome(guard(|| {
        let registration = table
            .get(index)
            .ok_or_else(|| Error::new(format!("the plugin has no component number {index}")))?;
        let given: Map<String, Value> = serde_json::from_str(config.as_str())?;
        let description = (registration.describe)();
        let config = Config::check(&description, &given)?;
        let names = description.parameters.into_iter().map(|p| p.name).collect();
        (registration.create)(&config, names)
    }))
}

/// Makes the module that the header refers to.
pub fn module(
    describe: extern "C" fn() -> Outcome<RString>,
    create: extern "C" fn(usize, RStr<'_>) -> Outcome<RawComponent>,
) -> PluginModuleRef {
    PluginModule { describe, create }.leak_into_prefix()
}

thread_local! {
    /// How many calls of [`guard`] this thread is in.
    static GUARDS: Cell<usize> = const { Cell::new(0) };
    /// Where the last panic on this thread happened.
    static PANIC_PLACE: RefCell<String> = const { RefCell::new(String::new()) };
}

/// This thread is in a call of [`guard`] while it lives.
struct InGuard;

impl InGuard {
    fn enter() -> Self {
        GUARDS.set(GUARDS.get() + 1);
        Self
    }
}

impl Drop for InGuard {
    fn drop(&mut self) {
        GUARDS.set(GUARDS.get() - 1);
    }
}

/// Runs the author's code; a panic becomes an error that names its place.
fn guard<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    static HOOK: Once = Once::new();
    // A plugin has its own copy of the standard library, so this hook concerns the plugin alone.
    HOOK.call_once(|| {
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            // Nobody but the hook tells of a panic on a thread that the plugin started itself.
            if GUARDS.get() == 0 {
                return report(info);
            }
            let place = info.location().map(|place| format!(" at {place}")).unwrap_or_default();
            PANIC_PLACE.with(|slot| *slot.borrow_mut() = place);
        }));
    });
    let _in_guard = InGuard::enter();
    // A panic that comes from another thread of the plugin, which has told of it, has no place here.
    PANIC_PLACE.with(|slot| slot.borrow_mut().clear());
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|payload| {
        let message = payload
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("no message")
            .to_owned();
        // A payload may itself panic when it is dropped.
        std::mem::forget(payload);
        let place = PANIC_PLACE.with(|slot| slot.borrow().clone());
        Err(Error::of(ErrorKind::Panic, format!("{PANICKED}{place}: {message}")))
    })
}

fn outcome<T>(result: Result<T>) -> Outcome<T> {
    match result {
        Ok(value) => ROk(value),
        Err(error) => RErr(error.into()),
    }
}

/// An author's component with everything that keeps its panics from the host.
struct Guarded<T> {
    component: ManuallyDrop<T>,
    /// Names of the parameters, in the order of the description.
    names: Vec<String>,
    /// A panic has left the component in an unknown state.
    broken: bool,
}

impl<T> Guarded<T> {
    fn new(component: T, names: Vec<String>) -> Self {
        Self { component: ManuallyDrop::new(component), names, broken: false }
    }

    fn call<R>(&mut self, work: impl FnOnce(&mut T, &[String]) -> Result<R>) -> Outcome<R> {
        if self.broken {
            let sentence = format!("{PANICKED} earlier, so this instance is no longer used");
            return outcome(Err(Error::of(ErrorKind::Panic, sentence)));
        }
        // Stays set where `work` panics.
        self.broken = true;
        let result = guard(|| {
            let result = work(&mut self.component, &self.names);
            self.broken = false;
            result
        });
        outcome(result)
    }
}

impl<T> Drop for Guarded<T> {
    fn drop(&mut self) {
        let dropped = guard(|| {
            // SAFETY: the component is dropped here and nowhere else.
            unsafe { ManuallyDrop::drop(&mut self.component) };
            Ok(())
        });
        // No call is in progress that could return it, and no result depends on it. Once is enough to find it.
        if let Err(error) = dropped {
            static SAID: Once = Once::new();
            SAID.call_once(|| eprintln!("pdk: warning: when an instance was dropped, {error}"));
        }
    }
}

impl<T: Perturbation> RawPerturbation for Guarded<T> {
    fn apply(&mut self, src: RawFrame, dst: RawFrameMut, raw: &RawContext) -> Outcome<()> {
        self.call(|component, names| {
            // SAFETY: the host lends both frames for this call, and `dst` to nobody else.
            let (src, dst) = unsafe { (src.get()?, dst.get()?) };
            let key = Key(raw.key);
            // SAFETY: the host's slices live through the call.
            let values = unsafe { slice(raw.values, raw.values_len) };
            // SAFETY: as above.
            let saliency = unsafe { slice(raw.saliency, raw.saliency_len) };
            let mut cx = Context::new(raw.intensity, raw.frame_index, raw.time, &key)
                .with_stream(raw.stream)
                .with_values(names, values);
            cx.saliency = (!saliency.is_empty()).then_some(saliency);
            component.apply(src, dst, &cx)
        })
    }
}

/// A slice from the host, empty where the pointer is null.
///
/// # Safety
/// A pointer that is not null has to be readable for `len` elements for `'a`.
unsafe fn slice<'a, V>(data: *const V, len: usize) -> &'a [V] {
    // SAFETY: the caller's promise.
    if data.is_null() { &[] } else { unsafe { std::slice::from_raw_parts(data, len) } }
}

impl<T: Simulator> RawSimulator for Guarded<T> {
    fn camera(&mut self) -> Outcome<Camera> {
        self.call(|component, _| Ok(component.camera()))
    }

    fn reset(&mut self, scenario: RStr<'_>, slot: u32) -> Outcome<State> {
        self.call(|component, _| component.reset(&serde_json::from_str(scenario.as_str())?, slot))
    }

    fn frame(&mut self, into: RawFrameMut) -> Outcome<State> {
        // SAFETY: the host lends the frame for this call and to nobody else.
        self.call(|component, _| component.frame(unsafe { into.get()? }))
    }

    fn act(&mut self, control: Control) -> Outcome<State> {
        self.call(|component, _| component.act(control))
    }

    fn waypoints(&mut self) -> Outcome<RVec<[f64; 3]>> {
        self.call(|component, _| Ok(component.waypoints().into()))
    }
}

impl<T: Driver> RawDriver for Guarded<T> {
    fn reset(&mut self) -> Outcome<()> {
        self.call(|component, _| component.reset())
    }

    fn drive(&mut self, frame: RawFrame, cx: DriveContext) -> Outcome<Control> {
        // SAFETY: the host lends the frame for this call.
        self.call(|component, _| component.drive(unsafe { frame.get()? }, &cx))
    }

    fn info(&mut self) -> Outcome<RString> {
        self.call(|component, _| Ok(serde_json::to_string(&component.info())?.into()))
    }
}

impl<T: Saliency> RawSaliency for Guarded<T> {
    fn map(&mut self, frame: RawFrame, out: RawHeatmap) -> Outcome<()> {
        self.call(|component, _| {
            // SAFETY: the host lends frame and map for this call, and the map to nobody else.
            let (frame, values) =
                unsafe { (frame.get()?, std::slice::from_raw_parts_mut(out.values, out.width * out.height)) };
            component.map(frame, HeatmapMut::new(values, out.width, out.height)?)
        })
    }
}

impl<T: Search> RawSearch for Guarded<T> {
    fn start(&mut self, problem: RStr<'_>, key: &[u8; 32]) -> Outcome<()> {
        self.call(|component, _| component.start(&serde_json::from_str(problem.as_str())?, &Key(*key)))
    }

    fn ask(&mut self, n: usize) -> Outcome<RString> {
        self.call(|component, _| Ok(serde_json::to_string(&component.ask(n)?)?.into()))
    }

    fn tell(&mut self, results: RStr<'_>) -> Outcome<()> {
        self.call(|component, _| component.tell(&serde_json::from_str::<Vec<_>>(results.as_str())?))
    }
}

impl<T: Dataset> RawDataset for Guarded<T> {
    fn len(&mut self) -> Outcome<usize> {
        self.call(|component, _| Ok(component.len()))
    }

    fn name(&mut self, index: usize) -> Outcome<RString> {
        self.call(|component, _| Ok(component.name(index).into()))
    }

    fn read(&mut self, index: usize) -> Outcome<RawEntry> {
        self.call(|component, _| {
            let entry = component.read(index)?;
            let (width, height) = (entry.frame.width(), entry.frame.height());
            Ok(RawEntry {
                pixels: entry.frame.into_vec().into(),
                width,
                height,
                steering: entry.steering,
                throttle: entry.throttle,
                time: entry.time,
            })
        })
    }
}

/// The version of the SDK the plugin was built with, for [`super::VERSION_SYMBOL`].
pub const SDK_VERSION: &std::ffi::CStr =
    match std::ffi::CStr::from_bytes_with_nul(concat!(env!("CARGO_PKG_VERSION"), "\0").as_bytes()) {
        Ok(version) => version,
        Err(_) => panic!("a version has no NUL"),
    };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_of_its_own_kind_and_so_is_what_follows_it() {
        let mut guarded = Guarded::new((), Vec::new());
        assert_eq!(guarded.call(|(), _| Ok(3)).into_result().map_err(Error::from), Ok(3));
        let error = |outcome: Outcome<()>| Error::from(outcome.into_result().err().unwrap());
        let failed = error(guarded.call(|(), _| Err(Error::of(ErrorKind::Lost, "it is gone"))));
        assert_eq!(failed, Error::of(ErrorKind::Lost, "it is gone"));
        let first = error(guarded.call(|(), _| panic!("as asked to")));
        let second = error(guarded.call(|(), _| Ok(())));
        for (error, end) in [(first, "plugin.rs:"), (second, "earlier, so this instance is no longer used")] {
            assert_eq!(error.kind(), ErrorKind::Panic);
            assert!(error.message().starts_with(PANICKED) && error.message().contains(end), "{error}");
        }
    }
}
