//! The random numbers a script draws: the same streams, from the same keys, as those of a plugin.

use mlua::{UserData, UserDataMethods, UserDataRegistry, Value};
use pdk_sdk::seed::Random;

use crate::api::{ApiClass, ApiMethod};
use crate::arguments::{number, whole, wrong};
use crate::buffers::buffer_bytes;

/// A stream of random numbers in a script.
pub struct LuaRandom(pub Random);

/// What a script can do with a stream of random numbers.
pub const RANDOM: ApiClass<LuaRandom> = ApiClass {
    name: "Random",
    doc: "A stream of random numbers. It depends on the run's seed alone and starts anew with every frame.",
    properties: &[],
    methods: &[
        ApiMethod {
            name: "unit",
            signature: "() -> number",
            doc: "A number of at least 0 and less than 1.",
            add: |class, name| class.add_method_mut(name, |_, this, ()| Ok(this.0.unit())),
        },
        ApiMethod {
            name: "uniform",
            signature: "(low: number, high: number) -> number",
            doc: "A number of at least `low` and less than `high`.",
            add: |class, name| {
                class.add_method_mut(name, |_, this, (low, high): (Value, Value)| {
                    let low = number("random:uniform", "low", &low)?;
                    Ok(this.0.uniform(low, number("random:uniform", "high", &high)?))
                });
            },
        },
        ApiMethod {
            name: "integer",
            signature: "(low: number, high: number) -> number",
            doc: "A whole number from `low` to `high`, both included.",
            add: |class, name| {
                class.add_method_mut(name, |_, this, (low, high): (Value, Value)| {
                    let low = whole("random:integer", "low", &low)?;
                    Ok(this.0.between(low, whole("random:integer", "high", &high)?))
                });
            },
        },
        ApiMethod {
            name: "normal",
            signature: "() -> number",
            doc: "A number from the standard normal distribution.",
            add: |class, name| class.add_method_mut(name, |_, this, ()| Ok(this.0.normal())),
        },
        ApiMethod {
            name: "fill_unit",
            signature: "(numbers: buffer) -> ()",
            doc: "Fills a buffer with what `unit` would draw, 8 bytes each, to be read with buffer.readf64.",
            add: |class, name| {
                class.add_method_mut(name, |lua, this, numbers: Value| {
                    fill(lua, &numbers, "random:fill_unit", || this.0.unit())
                });
            },
        },
        ApiMethod {
            name: "fill_normal",
            signature: "(numbers: buffer) -> ()",
            doc: "Fills a buffer with what `normal` would draw, 8 bytes each, to be read with buffer.readf64.",
            add: |class, name| {
                class.add_method_mut(name, |lua, this, numbers: Value| {
                    fill(lua, &numbers, "random:fill_normal", || this.0.normal())
                });
            },
        },
    ],
};

impl UserData for LuaRandom {
    fn register(registry: &mut UserDataRegistry<Self>) {
        RANDOM.register(registry);
    }
}

fn fill(lua: &mlua::Lua, numbers: &Value, call: &str, mut draw: impl FnMut() -> f64) -> mlua::Result<()> {
    let Value::Buffer(numbers) = numbers else {
        return Err(wrong(call, "numbers", "a buffer", numbers));
    };
    let (data, len) = buffer_bytes(lua, numbers)?;
    if len % 8 != 0 {
        return Err(mlua::Error::runtime(format!(
            "{call} writes numbers of 8 bytes, but the buffer has {len} bytes; make it with \
             buffer.create(8 * count)"
        )));
    }
    // SAFETY: the buffer is alive, the machine is locked while a host function runs, and `draw` does not touch it.
    let bytes = unsafe { std::slice::from_raw_parts_mut(data, len) };
    for number in bytes.chunks_exact_mut(8) {
        number.copy_from_slice(&draw().to_le_bytes());
    }
    Ok(())
}
