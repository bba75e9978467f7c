//! Instances with the notes that are made of every call, kept from one scenario to the next.

use pdk_model::component::ComponentSpec;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_supervise::calls::{self, Function};

/// An instance with what it was made from.
pub struct Held<T: ?Sized> {
    component: ComponentSpec,
    /// As it is named to the user.
    label: String,
    /// None only while it is dropped.
    instance: Option<Box<T>>,
}

impl<T: ?Sized> Held<T> {
    /// Holds a new instance.
    pub fn new(kind: Kind, component: ComponentSpec, instance: Box<T>) -> Self {
        let label = format!("{kind} `{}`", component.name);
        Self { component, label, instance: Some(instance) }
    }

    /// What it was made from.
    pub fn component(&self) -> &ComponentSpec {
        &self.component
    }

    /// As it is named to the user.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// Names it otherwise to the user.
    pub fn rename(&mut self, label: String) {
        self.label = label;
    }

    /// Makes a call; `frame` says for which frame. An error says whose it is.
    ///
    /// # Errors
    /// That of the call.
    pub fn call<R>(
        &mut self,
        function: Function,
        frame: Option<u64>,
        work: impl FnOnce(&mut T) -> Result<R>,
    ) -> Result<R> {
        let Self { label, instance, .. } = self;
        let Some(instance) = instance.as_deref_mut() else {
            return Err(Error::new(format!("{label} is gone, which is a defect in pdk")));
        };
        let result = match frame {
            Some(frame) => calls::call_at(label, function, frame, || work(instance)),
            None => calls::call(label, function, || work(instance)),
        };
        result.map_err(|error| error.at(&*label))
    }
}

impl<T: ?Sized> Drop for Held<T> {
    fn drop(&mut self) {
        if let Some(instance) = self.instance.take() {
            calls::call(&self.label, Function::Drop, || drop(instance));
        }
    }
}

/// The instance that is kept, made anew where another component is asked for.
///
/// # Errors
/// If it cannot be made.
pub fn keep<'a, T: ?Sized>(
    kept: &'a mut Option<Held<T>>,
    kind: Kind,
    component: &ComponentSpec,
    make: impl FnOnce() -> Result<Box<T>>,
) -> Result<&'a mut Held<T>> {
    if kept.as_ref().is_some_and(|held| held.component != *component) {
        *kept = None;
    }
    match kept {
        Some(held) => Ok(held),
        None => Ok(kept.insert(Held::new(kind, component.clone(), make()?))),
    }
}
