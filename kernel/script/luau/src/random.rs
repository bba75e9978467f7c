//! The random numbers a script draws: the same streams, from the same keys, as those of a plugin.

use mlua::{Table, UserData, UserDataMethods, UserDataRegistry, Value};
use pdk_sdk::seed::Random;

use crate::api::{ApiClass, ApiMethod};
use crate::arguments::{number, whole, wrong};
use crate::buffers::buffer_bytes;

/// A stream of random numbers in a script.
pub struct LuaRandom(pub Random);

/// What a script can do with a stream of random numbers.
pub const RANDOM: ApiClass<LuaRandom> = ApiClass {
    name: "Random",
    doc: "A stream of random numbers. It depends on the seed alone, so it is the same on every machine. Those of a perturbation start \
          anew with every frame.",
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
            name: "choice",
            signature: "(list: { any }) -> any",
            doc: "One of the values of a list, each as likely as the others.",
            add: |class, name| {
                class.add_method_mut(name, |_, this, list: Value| {
                    let list = filled("random:choice", &list)?;
                    let place = this.0.below(count("random:choice", &list)?);
                    list.raw_get::<Value>(place + 1)
                });
            },
        },
        ApiMethod {
            name: "shuffle",
            signature: "(list: { any }) -> ()",
            doc: "Puts the values of a list in another order, each as likely as the others.",
            add: |class, name| {
                class.add_method_mut(name, |_, this, list: Value| {
                    let list = filled("random:shuffle", &list)?;
                    count("random:shuffle", &list)?;
                    let mut values = list.sequence_values().collect::<mlua::Result<Vec<Value>>>()?;
                    this.0.shuffle(&mut values);
                    // A list that may not be changed is an error of its own.
                    values.into_iter().enumerate().try_for_each(|(place, value)| list.set(place + 1, value))
                });
            },
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
        RANDOM.refuse_unknown(registry, "random");
    }
}

/// A list with at least one value.
fn filled(call: &str, list: &Value) -> mlua::Result<Table> {
    match list {
        Value::Table(list) if list.raw_len() > 0 => Ok(list.clone()),
        Value::Table(_) => {
            Err(mlua::Error::runtime(format!("{call} needs a list, but the table has no values in order")))
        }
        other => Err(wrong(call, "list", "a list", other)),
    }
}

/// How many values a list has.
fn count(call: &str, list: &Table) -> mlua::Result<u32> {
    let length = list.raw_len();
    u32::try_from(length).map_err(|_| {
        mlua::Error::runtime(format!("{call} takes a list of at most {} values, not {length}", u32::MAX))
    })
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::Limits;
    use crate::sandbox::Sandbox;

    /// What a script returns that draws from `random`.
    fn drawn(script: &str) -> String {
        let sandbox = Sandbox::new(Limits::default()).unwrap();
        let random =
            sandbox.lua().create_userdata(LuaRandom(pdk_sdk::seed::key(7, "test", 0).sequence())).unwrap();
        let script = format!("local random = ... {script}");
        let chunk = sandbox.load("s.lua", script.as_bytes()).unwrap();
        match sandbox.call("s.lua", &chunk, random) {
            Ok(value) => value.to_string().unwrap(),
            Err(error) => error.to_string(),
        }
    }

    #[test]
    fn a_choice_is_one_of_the_values_and_none_is_left_out() {
        let script = "local counts = { 0, 0, 0 }
            for _ = 1, 3000 do local c = random:choice({ 1, 2, 3 }) counts[c] += 1 end
            return counts[1] .. ' ' .. counts[2] .. ' ' .. counts[3]";
        let text = drawn(script);
        let counts: Vec<u32> = text.split(' ').map(|count| count.parse().unwrap()).collect();
        assert!(
            counts.iter().sum::<u32>() == 3000 && counts.iter().all(|count| (900..1100).contains(count)),
            "{text}"
        );
        assert_eq!(drawn(script), text);
    }

    #[test]
    fn a_shuffled_list_has_the_same_values() {
        let text = drawn(
            "local list = {} for i = 1, 50 do list[i] = i end random:shuffle(list)
            local order = table.concat(list, ' ') table.sort(list) return order .. '|' .. table.concat(list, ' ')",
        );
        let (order, sorted) = text.split_once('|').unwrap();
        let numbers: Vec<String> = (1..=50).map(|number| number.to_string()).collect();
        assert_eq!(sorted, numbers.join(" "));
        assert_ne!(order, sorted);
    }

    #[test]
    fn what_is_not_a_list_with_values_is_refused() {
        for (script, said) in [
            ("random:choice({})", "random:choice needs a list, but the table has no values in order"),
            ("random:unifrm(0, 1)", "random has no method or field `unifrm`; did you mean `uniform`?"),
            (
                "random:shuffle({ a = 1 })",
                "random:shuffle needs a list, but the table has no values in order",
            ),
            ("random:choice(3)", "random:choice needs `list` to be a list, but it is a number"),
            ("random:shuffle(table.freeze({ 1, 2 }))", "attempt to modify a readonly table"),
        ] {
            assert!(drawn(script).contains(said), "{script}: {}", drawn(script));
        }
    }
}
