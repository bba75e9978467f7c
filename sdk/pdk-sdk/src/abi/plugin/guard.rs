//! Turns the panics of an author's code into errors.

use std::cell::{Cell, RefCell};
use std::mem::ManuallyDrop;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Once;

use crate::error::{Error, ErrorKind, Result};

/// With this the error of a panic begins.
const PANICKED: &str = "the plugin panicked";

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
pub(super) fn guard<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    static HOOK: Once = Once::new();
    // A plugin has its own copy of the standard library, so this hook concerns the plugin alone.
    HOOK.call_once(|| {
        let report = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            // Only the hook reports a panic on a thread that the plugin started itself.
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

/// An author's component with everything that keeps its panics from the host.
pub(super) struct Guarded<T: ?Sized> {
    component: ManuallyDrop<Box<T>>,
    /// Names of the parameters, in the order of the description.
    names: Vec<String>,
    /// A panic has left the component in an unknown state.
    broken: bool,
}

impl<T: ?Sized> Guarded<T> {
    pub(super) fn new(component: Box<T>, names: Vec<String>) -> Self {
        Self { component: ManuallyDrop::new(component), names, broken: false }
    }

    #[inline]
    pub(super) fn call<R>(&mut self, work: impl FnOnce(&mut T, &[String]) -> Result<R>) -> Result<R> {
        if self.broken {
            let sentence = format!("{PANICKED} earlier, so this instance is no longer used");
            return Err(Error::of(ErrorKind::Panic, sentence));
        }
        // Stays set if `work` panics.
        self.broken = true;
        guard(|| {
            let result = work(&mut self.component, &self.names);
            self.broken = false;
            result
        })
    }
}

impl<T: ?Sized> Drop for Guarded<T> {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_of_its_own_kind_and_so_is_what_follows_it() {
        let mut guarded = Guarded::new(Box::new(()), Vec::new());
        assert_eq!(guarded.call(|(), _| Ok(3)), Ok(3));
        let lost = Error::of(ErrorKind::Lost, "it is gone");
        assert_eq!(guarded.call(|(), _| Err::<(), _>(lost.clone())), Err(lost));
        let first = guarded.call(|(), _| -> Result<()> { panic!("as asked to") });
        let second = guarded.call(|(), _| Ok(()));
        for (end, place) in [(first, "guard.rs:"), (second, "earlier, so this instance is no longer used")] {
            let error = end.unwrap_err();
            assert_eq!(error.kind(), ErrorKind::Panic);
            assert!(error.message().starts_with(PANICKED) && error.message().contains(place), "{error}");
        }
    }
}
