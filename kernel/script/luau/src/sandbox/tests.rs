use std::time::{Duration, Instant};

use pdk_sdk::seed::Key;

use super::*;
use crate::watchdog::{own_time, without_clock};

const SCRIPT: &str = "scripts/foo.lua";

fn limits() -> Limits {
    Limits { memory_bytes: 32 << 20, time: Duration::from_millis(100), renewed: false }
}

fn sandbox() -> Sandbox {
    Sandbox::new(limits()).unwrap()
}

fn run(sandbox: &Sandbox, source: &str) -> Result<Value> {
    let chunk = sandbox.load(SCRIPT, source.as_bytes())?;
    sandbox.call(SCRIPT, &chunk, ())
}

fn error(source: &str) -> String {
    let sandbox = sandbox();
    let error = run(&sandbox, source).expect_err(source).to_string();
    // The machine is as good as new.
    assert_eq!(run(&sandbox, "return 6 * 7").unwrap(), Value::Number(42.0), "after {source}");
    assert!(!error.contains('\n'), "{error}");
    error
}

fn number(source: &str) -> f64 {
    let value = run(&sandbox(), source).unwrap();
    match value {
        Value::Number(number) => number,
        Value::Integer(number) => number as f64,
        other => panic!("{other:?} from {source}"),
    }
}

#[test]
fn loops_without_end_are_ended_with_their_line() {
    let expected = "used more than 0.1 s of processor time; make the loop shorter or raise the limit with PDK_SCRIPT_SECONDS";
    for (line, source) in [
        (2, "local x = 0\nwhile true do x += 1 end"),
        (1, "for i = 1, math.huge do end"),
        // Catching the error does not help.
        (1, "while true do pcall(function() while true do end end) end"),
        (1, "while true do pcall(error) end"),
        (1, "local function f() pcall(f) pcall(f) end while true do f() end"),
        (1, "xpcall(function() while true do end end, function() while true do end end)"),
        (1, "local ok = pcall(function() while true do end end) return ok"),
        (
            1,
            "local co = coroutine.wrap(function() while true do coroutine.yield() end end) while true do co() end",
        ),
        (1, "coroutine.wrap(function() while true do end end)()"),
        (1, "coroutine.resume(coroutine.create(function() while true do end end))"),
        (1, "return (string.rep('a', 100000)):find(('.-'):rep(20) .. 'b')"),
        (1, "table.sort(table.create(1000, 1), function() while true do end end)"),
        (1, "string.gsub('x', 'x', function() while true do end end)"),
        (1, "local t = setmetatable({}, { __index = function() while true do end end }) return t.x"),
    ] {
        let before = own_time();
        let error = error(source);
        assert_eq!(error, format!("{SCRIPT}:{line}: {expected}"), "{source}");
        // Processor time: on a busy machine the clock says nothing.
        let took = Duration::from_nanos(own_time() - before);
        assert!(took < Duration::from_secs(1), "{took:?} for {source}");
    }
}

#[test]
fn memory_bombs_are_refused_with_their_line() {
    let expected = "used more than 32 MiB of memory; keep less or raise the limit with PDK_SCRIPT_MEGABYTES";
    for (line, source) in [
        (2, "local x = 1\nreturn string.rep('x', 1e9)"),
        (2, "local x = 1\nreturn buffer.create(1e9)"),
        (3, "local t = {}\nwhile true do\n t[#t + 1] = 'x' .. #t end"),
        (1, "return table.create(6e7, 0)"),
        (3, "local s = 'x'\nwhile true do\n s = s .. s end"),
        (2, "local function grow(t)\n t[1] = buffer.create(1048576) return grow({ t }) end grow({})"),
        (1, "local t = {} for i = 1, 1e9 do t[i] = {} end"),
        (1, "return string.rep('x', 16777216) .. string.rep('y', 16777216)"),
    ] {
        let sandbox = Sandbox::new(Limits { time: Duration::from_secs(20), ..limits() }).unwrap();
        let error = run(&sandbox, source).expect_err(source).to_string();
        assert_eq!(error, format!("{SCRIPT}:{line}: {expected}"), "{source}");
        assert!(
            sandbox.lua().used_memory() < 1 << 20,
            "{} bytes after {source}",
            sandbox.lua().used_memory()
        );
        assert!(run(&sandbox, "return buffer.create(16777216)").is_ok(), "after {source}");
    }
}

#[test]
fn a_script_may_catch_that_memory_ran_out() {
    let source = "local ok, message = pcall(string.rep, 'x', 1e9) return ok == false and 1 or 0";
    assert_eq!(number(source), 1.0);
}

#[test]
fn what_a_script_raises_becomes_one_sentence() {
    for (source, expected) in [
        ("local x = 1\nerror('no road')", "scripts/foo.lua:2: no road"),
        ("local x = 1\nerror('no road', 0)", "scripts/foo.lua:2: no road"),
        ("local x = nil\nreturn x.y", "scripts/foo.lua:2: attempt to index nil with 'y'"),
        (
            "error({ code = 1 })",
            "scripts/foo.lua:1: raised an error that is a table; use a text, as in error(\"...\")",
        ),
        ("error()", "scripts/foo.lua:1: raised an error that is nothing; use a text, as in error(\"...\")"),
        (
            "error(setmetatable({}, { __tostring = function() while true do end end }))",
            "scripts/foo.lua:1: raised an error that is a table; use a text, as in error(\"...\")",
        ),
        ("error('a\\nb')", "scripts/foo.lua:1: a\nb"),
        ("return nothing()", "scripts/foo.lua:1: attempt to call a nil value"),
    ] {
        let sandbox = sandbox();
        assert_eq!(run(&sandbox, source).unwrap_err().to_string(), expected, "{source}");
    }
}

#[test]
fn syntax_errors_name_their_line() {
    let message = error("local x = 1\nlocal = 2");
    assert!(message.starts_with("scripts/foo.lua:2: Expected identifier"), "{message}");
    assert!(error("x = = 1").starts_with("scripts/foo.lua:1: "));
}

#[test]
fn recursion_without_end_is_an_error() {
    let overflow = error("local function f() return 1 + f() end return f()");
    assert_eq!(overflow, "scripts/foo.lua:1: stack overflow", "{overflow}");
    for source in [
        "local t = setmetatable({}, {}) getmetatable(t).__index = function(_, k) return t[k .. 'x'] end return t.x",
        "local function f() return (string.gsub('x', 'x', f)) end return f()",
        "local function f() coroutine.wrap(f)() end f()",
        "local t = setmetatable({}, {}) getmetatable(t).__index = t return t.x",
        "local function f() pcall(f) error('deep') end f()",
    ] {
        let error = error(source);
        assert!(error.starts_with("scripts/foo.lua:1: "), "{error}");
    }
    // The parser has its own stack to protect.
    for open in ["(", "{", "function() ", "if x then ", "not ", "f(", "`{"] {
        let source = format!("return {}", open.repeat(60_000));
        let error = error(&source);
        assert!(error.starts_with("scripts/foo.lua:1: "), "{error}");
    }
}

#[test]
fn there_is_no_way_out() {
    for name in [
        "io",
        "os",
        "debug",
        "require",
        "loadstring",
        "load",
        "dofile",
        "package",
        "collectgarbage",
        "gcinfo",
        "getfenv",
        "setfenv",
        "newproxy",
        "vector",
    ] {
        assert_eq!(run(&sandbox(), &format!("return {name}")).unwrap(), Value::Nil, "{name}");
    }
    for name in ["math.random", "math.randomseed", "math.noise"] {
        let error = error(&format!("return {name}(1, 2)"));
        assert!(error.contains(name) && error.contains("cx.frame_random"), "{error}");
    }
    assert!(error("math.sin = nil").contains("attempt to modify a readonly table"));
    assert!(error("string.rep = nil").contains("attempt to modify a readonly table"));
    assert!(error("getmetatable('').__index = {}").contains("attempt to"));
    let bytecode = Compiler::new().compile("return 1").unwrap();
    let refused = sandbox().load(SCRIPT, &bytecode).unwrap_err().to_string();
    assert!(refused.starts_with(SCRIPT), "{refused}");
    let long = sandbox().load(SCRIPT, &vec![b' '; (1 << 20) + 1]).unwrap_err().to_string();
    assert!(long.ends_with("bytes, but 1048576 are allowed; split it"), "{long}");
}

#[test]
fn transcendental_functions_are_those_of_libm() {
    // Constant arguments, which the compiler would compute itself; variables; a local copy of the table; native loops.
    for (name, expected) in [
        ("sin", libm::sin as fn(f64) -> f64),
        ("cos", libm::cos),
        ("tan", libm::tan),
        ("asin", libm::asin),
        ("acos", libm::acos),
        ("atan", libm::atan),
        ("sinh", libm::sinh),
        ("cosh", libm::cosh),
        ("tanh", libm::tanh),
        ("exp", libm::exp),
        ("log", libm::log),
        ("log10", libm::log10),
    ] {
        let value = expected(0.7).to_bits();
        for source in [
            format!("return math.{name}(0.7)"),
            format!("local x = 0.7 return math.{name}(x)"),
            format!("local m = math local f = m.{name} return f(0.7)"),
            format!("local v = 0 for i = 1, 3 do v = math.{name}(i - i + 0.7) end return v"),
            format!("return (pcall(math.{name}, 0.7)) and select(2, pcall(math.{name}, 0.7))"),
        ] {
            assert_eq!(number(&source).to_bits(), value, "{source}");
        }
        assert!(error(&format!("return math.{name}('x')")).contains("invalid argument #1"), "{name}");
    }
    assert_eq!(number("return math.pow(1.1, 2.7)").to_bits(), libm::pow(1.1, 2.7).to_bits());
    assert_eq!(number("return math.atan2(1.1, 2.7)").to_bits(), libm::atan2(1.1, 2.7).to_bits());
    assert_eq!(number("return math.log(5, 2)").to_bits(), libm::log2(5.0).to_bits());
    assert_eq!(number("return math.log(5, 3)").to_bits(), (libm::log(5.0) / libm::log(3.0)).to_bits());
    assert_eq!(number("return math.lerp(2, 4, 0.25) + math.map(1, 0, 2, 10, 20)"), 17.5);
}

/// Luau's own `math.lerp` is a fused multiply-add in native code where the processor has one.
#[test]
fn interpolation_is_not_fused() {
    // Only the last bits count, so that they are not lost in the sum.
    let source = "local s = 0 for i = 1, 1000 do
        local v = math.lerp(0.1 * i, 0.7, i / 3000) * 1e14 s += v - math.floor(v) end return s";
    let sum = |lerp: fn(f64, f64, f64) -> f64| {
        (1..=1000).map(f64::from).fold(0.0, |sum, i| {
            let v = lerp(0.1 * i, 0.7, i / 3000.0) * 1e14;
            sum + (v - v.floor())
        })
    };
    let plain = sum(|a, b, t| a + (b - a) * t);
    assert_ne!(plain.to_bits(), sum(|a, b, t| (b - a).mul_add(t, a)).to_bits(), "the test could not fail");
    assert_eq!(number(source).to_bits(), plain.to_bits());
}

/// That Luau's compiler and interpreter really bypass a replaced function unless told not to: without this the test
/// above could pass by chance, wherever libm and the C library agree.
#[test]
fn replaced_functions_are_called_and_not_bypassed() {
    let calls = std::sync::Arc::new(std::sync::atomic::AtomicU32::new(0));
    let sandbox = Sandbox::with_api(limits(), |lua| {
        let math: mlua::Table = lua.globals().get("math")?;
        for name in arithmetic::disabled_builtins().filter_map(|name| name.strip_prefix("math.")) {
            let calls = std::sync::Arc::clone(&calls);
            math.raw_set(
                name,
                lua.create_function(move |_, _: MultiValue| {
                    calls.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                    Ok(0.0)
                })?,
            )?;
        }
        Ok(())
    })
    .unwrap();
    for name in arithmetic::disabled_builtins() {
        let arguments = match name {
            "math.map" => "1, 2, 3, 4, 5",
            "math.lerp" => "1, 2, 0.5",
            "math.pow" | "math.atan2" => "1, 2",
            _ => "0.5",
        };
        calls.store(0, std::sync::atomic::Ordering::Relaxed);
        run(&sandbox, &format!("local s = 0 for i = 1, 10 do s += {name}({arguments}) end return s"))
            .unwrap();
        assert_eq!(calls.load(std::sync::atomic::Ordering::Relaxed), 10, "{name}");
    }
}

#[test]
fn exact_powers_are_exact_in_native_code_too() {
    let x = 1.000_000_1_f64;
    let sum = |f: fn(f64) -> f64| (1..=1000).fold(0.0, |sum, i| sum + f(x * f64::from(i)));
    for (power, f) in [("2", (|v| v * v) as fn(f64) -> f64), ("3", |v| v * v * v), ("0.5", f64::sqrt)] {
        let source = format!(
            "local function f(v: number) return v ^ {power} end local s = 0 for i = 1, 1000 do s += f({x} * i) end return s"
        );
        assert_eq!(number(&source).to_bits(), sum(f).to_bits(), "{power}");
    }
    assert!(
        error("return 2 ^ 1.5").starts_with("scripts/foo.lua:1: `^` takes the exponents 2, 3 and 0.5 only")
    );
}

#[test]
fn a_stale_interrupt_does_not_end_the_next_call() {
    let sandbox = sandbox();
    let long = sandbox.load(SCRIPT, b"local s = 0 for i = 1, 1e6 do s += i end return s").unwrap();
    let stuck = sandbox.load(SCRIPT, b"while true do end").unwrap();
    for _ in 0..10 {
        assert!(sandbox.call(SCRIPT, &stuck, ()).is_err());
        for _ in 0..20 {
            assert_eq!(sandbox.call(SCRIPT, &long, ()).unwrap(), Value::Number(500_000_500_000.0));
        }
    }
}

/// The watchdog goes to sleep when nothing runs. (Other tests keep it awake: this says most when it runs alone.)
#[test]
fn a_sleeping_watchdog_is_woken() {
    let sandbox = sandbox();
    assert!(run(&sandbox, "return 1").is_ok());
    std::thread::sleep(Duration::from_millis(1_500));
    assert!(run(&sandbox, "while true do end").is_err());
}

#[test]
fn every_machine_on_every_thread_is_watched() {
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(|| {
                for _ in 0..5 {
                    let sandbox = sandbox();
                    assert!(run(&sandbox, "while true do end").is_err());
                    drop(sandbox);
                }
            });
        }
    });
}

#[test]
fn time_of_a_host_function_can_be_left_out() {
    let compute = |lua: &Lua| {
        lua.create_function(|_, outside: bool| {
            // Twice the limit, of the time that counts.
            let compute = || {
                let end = own_time() + 200_000_000;
                while own_time() < end {}
            };
            if outside {
                without_clock(compute)
            } else {
                compute()
            }
            Ok(())
        })
    };
    let sandbox = Sandbox::with_api(limits(), |lua| lua.globals().set("compute", compute(lua)?)).unwrap();
    assert!(run(&sandbox, "compute(true) local s = 0 for i = 1, 1000 do s += i end return s").is_ok());
    assert!(run(&sandbox, "compute(false) for i = 1, 1000 do end").is_err());
    assert!(run(&sandbox, "compute(true) while true do end").is_err());
}

#[test]
fn time_in_which_the_machine_does_something_else_does_not_count() {
    let sandbox = Sandbox::with_api(limits(), |lua| {
        let wait = |_: &Lua, ()| {
            std::thread::sleep(Duration::from_millis(300));
            Ok(())
        };
        lua.globals().set("wait", lua.create_function(wait)?)
    })
    .unwrap();
    assert!(run(&sandbox, "wait() local s = 0 for i = 1, 1000 do s += i end return s").is_ok());
}

#[test]
fn a_pipeline_has_its_time_again_after_each_host_function() {
    let limits = Limits { renewed: true, ..limits() };
    let sandbox = Sandbox::with_api(limits, |lua| {
        lua.globals().set("work", lua.create_function(|_, ()| without_clock(|| Ok(())))?)?;
        lua.globals().set("look", lua.create_function(|_, ()| Ok(()))?)
    })
    .unwrap();
    // Much more than 100 ms in all, and less than that at a stretch.
    let busy = "local function busy() for i = 1, 4e5 do math.floor(i / 3) end end";
    let start = Instant::now();
    run(&sandbox, &format!("{busy} for i = 1, 400 do busy() work() end")).unwrap();
    let took = start.elapsed();
    assert!(took > Duration::from_millis(150), "{took:?}: the test could not fail");
    for stuck in [
        "\nwhile true do end",
        "\nwhile true do look() end",
        "for i = 1, 3 do work() end\nwhile true do pcall(error) end",
    ] {
        assert_eq!(
            run(&sandbox, stuck).unwrap_err().to_string(),
            "scripts/foo.lua:2: computed for more than 0.1 s at a stretch; make the loop shorter or raise the limit with \
             PDK_SCRIPT_SECONDS"
        );
    }
}

#[test]
fn a_script_ends_when_the_user_stops_it() {
    static WANTED: std::sync::atomic::AtomicBool = std::sync::atomic::AtomicBool::new(false);
    let wanted = |wanted| WANTED.store(wanted, std::sync::atomic::Ordering::SeqCst);
    let long = Limits { time: Duration::from_secs(100), renewed: true, ..limits() };
    let mut sandbox = Sandbox::with_api(long, |lua| {
        let wait = || {
            // As a key that is pressed while a host function waits.
            WANTED.store(true, std::sync::atomic::Ordering::SeqCst);
            Ok(())
        };
        lua.globals().set("wait", lua.create_function(move |_, ()| without_clock(wait))?)
    })
    .unwrap();
    sandbox.stop_when(|| {
        WANTED.load(std::sync::atomic::Ordering::SeqCst).then(|| Error::new("stopped by Ctrl-C"))
    });
    for source in
        ["wait() while true do end", "wait() while true do pcall(function() while true do end end) end"]
    {
        wanted(false);
        assert_eq!(
            run(&sandbox, "local s = 0 for i = 1, 1e6 do s += i end return 1").unwrap(),
            Value::Number(1.0)
        );
        // Far less than its limit of processor time.
        let before = own_time();
        assert_eq!(run(&sandbox, source).unwrap_err(), Error::new("stopped by Ctrl-C"));
        let took = Duration::from_nanos(own_time() - before);
        assert!(took < Duration::from_secs(5), "{took:?}");
    }
    wanted(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            std::thread::sleep(Duration::from_millis(50));
            wanted(true);
        });
        assert_eq!(run(&sandbox, "while true do end").unwrap_err(), Error::new("stopped by Ctrl-C"));
    });
    wanted(false);
    assert_eq!(run(&sandbox, "return 6 * 7").unwrap(), Value::Number(42.0));
}

#[test]
fn a_panic_of_a_host_function_is_an_error() {
    let sandbox = Sandbox::with_api(limits(), |lua| {
        let fail = lua.create_function(|_, ()| -> mlua::Result<()> { panic!("oh no") })?;
        lua.globals().set("fail", fail)
    })
    .unwrap();
    let error = run(&sandbox, "\nfail()").unwrap_err().to_string();
    assert_eq!(error, "scripts/foo.lua:2: a host function failed, which is a defect in pdk: oh no");
    assert!(run(&sandbox, "return 1").is_ok());
}

#[test]
fn hostile_values_do_no_harm() {
    for source in [
        "return setmetatable({}, { __index = function() error('x') end, __tostring = 1, __metatable = 1 })",
        "return setmetatable({}, { __gc = function() while true do end end, __mode = 'kv', __len = error })",
        "return coroutine.create(function() end)",
        "return function() end",
        "return string.rep('x', 1e6)",
    ] {
        run(&sandbox(), source).unwrap();
    }
    for source in [
        "error(coroutine.create(function() end))",
        "error(function() end)",
        "error(string.rep('x', 1e6))",
        "error('\\xff\\xfe')",
        "coroutine.yield(1)",
        "coroutine.wrap(coroutine.wrap)()",
        "print(setmetatable({}, { __tostring = function() error('x') end }))",
        "print(setmetatable({}, { __tostring = function() while true do end end }))",
        "string.format('%d', 'x')",
        "string.format('%99999d', 1)",
        "table.concat(setmetatable({}, { __index = error, __len = function() return 1e9 end }), 'x', 1, 1e9)",
        "return buffer.readu8(buffer.create(3), 1e18)",
        "return buffer.create(-1)",
        "return table.unpack({}, 1, 1e8)",
        "return utf8.char(-1)",
        "return bit32.lshift(1, 'x')",
    ] {
        let error = sandbox_error(source);
        assert!(error.starts_with("scripts/foo.lua"), "{error}");
        assert!(error.len() < 600, "{error}");
    }
}

fn sandbox_error(source: &str) -> String {
    run(&sandbox(), source).expect_err(source).to_string()
}

/// Whatever text there is in a script, the result is a value or an error.
#[test]
fn random_texts_neither_crash_nor_hang() {
    const WORDS: &[&str] = &[
        "local",
        "function",
        "end",
        "if",
        "then",
        "else",
        "while",
        "do",
        "for",
        "in",
        "return",
        "break",
        "continue",
        "repeat",
        "until",
        "true",
        "false",
        "nil",
        "and",
        "or",
        "not",
        "x",
        "y",
        "t",
        "math",
        "string",
        "table",
        "buffer",
        "coroutine",
        "pcall",
        "error",
        "setmetatable",
        "pairs",
        "select",
        "tostring",
        "wrap",
        "create",
        "rep",
        "sin",
        "floor",
        "1",
        "2",
        "0",
        "1e9",
        "-1",
        "0/0",
        "'s'",
        "[[s]]",
        "`{x}`",
        "(",
        ")",
        "(",
        ")",
        "{",
        "}",
        "[",
        "]",
        "=",
        "==",
        "~=",
        "<",
        "+",
        "-",
        "*",
        "/",
        "//",
        "%",
        "..",
        "#",
        ".",
        ":",
        ",",
        ";",
        "+=",
        "^",
        "\n",
        "--",
        "--[[",
        "]]",
        "::",
        "->",
        "?",
        "type",
        "export",
        "@native",
        "...",
        "\"",
        "'",
        "`",
        "\\",
    ];
    let sandbox =
        Sandbox::new(Limits { memory_bytes: 8 << 20, time: Duration::from_millis(20), renewed: false })
            .unwrap();
    let mut random = Key([5; 32]).sequence();
    let mut compiled = 0;
    for round in 0..4000 {
        let source = if round % 4 == 0 {
            let mut bytes = vec![0; random.below(200) as usize];
            random.fill(&mut bytes);
            bytes
        } else {
            let mut text = String::new();
            for _ in 0..random.below(12) {
                text.push_str(WORDS[random.below(WORDS.len() as u32) as usize]);
                text.push(' ');
            }
            text.into_bytes()
        };
        match sandbox.load(SCRIPT, &source) {
            Ok(chunk) => {
                compiled += 1;
                if let Err(error) = sandbox.call(SCRIPT, &chunk, ()) {
                    assert!(error.to_string().starts_with(SCRIPT), "{error}");
                }
            }
            Err(error) => assert!(error.to_string().starts_with(SCRIPT), "{error}"),
        }
    }
    // Otherwise the words are badly chosen and nothing was tried.
    assert!(compiled > 100, "{compiled}");
}

/// Prints the cost of a call; run with `--ignored --nocapture` on a machine that does nothing else.
#[test]
#[ignore = "measures time"]
fn arming_a_call_costs_less_than_a_microsecond() {
    let sandbox = sandbox();
    let rounds = 100_000;
    drop(sandbox.registration.start(Duration::from_secs(1), false));
    let start = Instant::now();
    for _ in 0..rounds {
        drop(std::hint::black_box(&sandbox.registration).start(Duration::from_secs(1), false));
    }
    let arming = start.elapsed().as_secs_f64() / f64::from(rounds) * 1e9;
    let chunk = sandbox.load(SCRIPT, b"return 1").unwrap();
    let start = Instant::now();
    for _ in 0..rounds {
        sandbox.call(SCRIPT, &chunk, ()).unwrap();
    }
    let call = start.elapsed().as_secs_f64() / f64::from(rounds) * 1e9;
    std::eprintln!("arming {arming:.0} ns, an empty call {call:.0} ns");
    assert!(arming < 1_000.0, "{arming} ns");
}
