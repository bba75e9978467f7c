//! Counts allocations in tests, shared by plugin crates (`#[path]`).

// Every crate uses a part of this file.
#![allow(dead_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use pdk_sdk::config::frame_values;
use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Map;

/// The system's allocator, counting what each thread asks for.
struct Counting;

thread_local! {
    static ALLOCATIONS: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: everything is passed on to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`.
        unsafe { System.dealloc(pointer, layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller keeps the contract of `realloc`.
        unsafe { System.realloc(pointer, layout, size) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often this thread has asked for memory.
pub fn count() -> usize {
    ALLOCATIONS.get()
}

/// Checks that a perturbation asks for memory at the first frames of a sequence alone.
pub fn on_the_first_frames_alone<P: Component + Perturbation>() {
    let description = P::description();
    let config = Config::check(&description, &Map::new()).unwrap();
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let (mut values, key) = (Vec::new(), Key([6; 32]));
    frame_values(&description, &config, 3.0, &mut values);
    let mut kept = Recollection::of(description.history as usize);
    let (mut source, mut target) = (FrameBuf::new(96, 64), FrameBuf::new(96, 64));
    let mut instance = P::new(&config).unwrap();
    for index in 0..8 {
        key.frame(index).fill(source.as_mut().data_mut());
        let time = 0.05 * index as f64;
        let cx = Context::new(3.0, index, time, &key).with_values(&names, &values);
        let cx = cx.with_history(kept.before(source.as_ref(), index));
        let before = count();
        instance.apply(source.as_ref(), target.as_mut(), &cx).unwrap();
        assert!(index < 2 || count() == before, "{} at frame {index}", description.name);
        kept.keep(source.as_ref(), index, time);
    }
}
