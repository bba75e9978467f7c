use std::cell::RefCell;
use std::fs;
use std::time::Duration;

use tempfile::TempDir;

use super::*;
use crate::limits::Limits;
use crate::sandbox::Sandbox;

/// The library of all tests.
const LIBRARY: &[BuiltInScript] = &[
    BuiltInScript {
        name: "study",
        file: "study.lua",
        source: "return { value = require('./parts/part').value .. 's' .. pdk.twice(2) }",
    },
    BuiltInScript { name: "parts/part", file: "parts/part.lua", source: "return { value = 'p' }" },
];

/// A pipeline's folder with files, beside a file that scripts may not see.
struct Place {
    place: TempDir,
    /// Those of the latest run.
    modules: RefCell<Modules>,
}

impl Place {
    fn new(files: &[(&str, &str)]) -> Self {
        let place = tempfile::tempdir().unwrap();
        fs::create_dir(place.path().join("pipelines")).unwrap();
        fs::write(place.path().join("secret.lua"), "return { secret = true }").unwrap();
        for (name, source) in files {
            let file = place.path().join(name);
            fs::create_dir_all(file.parent().unwrap()).unwrap();
            fs::write(file, source).unwrap();
        }
        let modules = RefCell::new(Modules::new(None, LIBRARY));
        Self { place, modules }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    /// Runs a pipeline; errors are without the way to the folder.
    fn run(&self, source: &str) -> Result<String, String> {
        let modules = Modules::new(Some(&self.path("pipelines")), LIBRARY);
        self.modules.replace(modules.clone());
        let limits = Limits { time: Duration::from_millis(300), ..Limits::default() };
        let sandbox = Sandbox::with_api(limits, |lua| {
            let pdk = lua.create_table()?;
            pdk.set("twice", lua.create_function(|_, number: f64| Ok(2.0 * number))?)?;
            lua.globals().set("pdk", pdk)?;
            modules.install(lua)
        })
        .unwrap();
        let chunk = sandbox.load("p.lua", source.as_bytes()).unwrap();
        let result = sandbox.call("p.lua", &chunk, ());
        let shown = |text: String| text.replace(&format!("{}/", self.place.path().display()), "");
        result.map(|value| value.to_string().unwrap()).map_err(|error| shown(error.to_string()))
    }

    fn names(&self) -> Vec<String> {
        self.modules.borrow().loaded().into_iter().map(|module| module.name).collect()
    }
}

#[test]
fn modules_require_others_from_their_own_folder() {
    let place = Place::new(&[
        ("pipelines/a.lua", "local b = require('./sub/b') return { value = b() .. 'a' }"),
        (
            "pipelines/sub/b.luau",
            "local c = require('./c') local d = require('../d') return function() return c.value .. d.value .. 'b' end",
        ),
        ("pipelines/sub/c.lua", "return { value = 'c' }"),
        ("pipelines/d.lua", "return { value = require('@pdk/study').value .. 'd' }"),
    ]);
    assert_eq!(place.run("return require('./a').value").unwrap(), "cps4dba");
    assert_eq!(place.names(), ["./a", "./sub/b", "./sub/c", "./d", "@pdk/study", "@pdk/parts/part"]);
    // What a function of a module asks for later counts from its own file as well.
    let place = Place::new(&[
        ("pipelines/sub/late.lua", "return function() return require('./c') end"),
        ("pipelines/sub/c.lua", "return { value = 'c' }"),
    ]);
    let source = "local late = require('./sub/late') return select(2, pcall(late)).value";
    assert_eq!(place.run(source).unwrap(), "c");
}

#[test]
fn a_module_is_run_once_and_shared() {
    let place = Place::new(&[
        ("pipelines/count.lua", "local t = { n = 0 } return t"),
        ("pipelines/other.lua", "local count = require('./count') count.n += 10 return { count = count }"),
    ]);
    let source = "local a, b = require('./count'), require('./sub/../count') a.n += 1
        assert(a == b and a == require('./other').count and require('./other') == require('./other'))
        local f = pcall local ok, again = f(require, './count') assert(again == a)
        return coroutine.wrap(function() return require('./count').n end)()";
    assert_eq!(place.run(source).unwrap(), "11");
    assert_eq!(place.names(), ["./count", "./other"]);
}

#[test]
fn what_is_recorded_is_the_text_that_was_run() {
    let source = "return { value = 1 }";
    let place = Place::new(&[("pipelines/a.lua", source)]);
    assert_eq!(place.modules.borrow().loaded(), []);
    place.run("return require('./a').value").unwrap();
    assert_eq!(place.modules.borrow().loaded(), [Loaded { name: "./a".into(), source: source.into() }]);
}

#[test]
fn globals_of_a_module_are_its_own() {
    let place = Place::new(&[(
        "pipelines/a.lua",
        "leaked = 1 assert(mine == nil, 'mine') assert(math.sin, 'math') assert(pdk.twice, 'pdk') assert(require, 'require') return { get = function() return leaked end }",
    )]);
    assert_eq!(
        place.run("mine = 2 local a = require('./a') return tostring(leaked) .. a.get()").unwrap(),
        "nil1"
    );
    for source in [
        "getmetatable(getmetatable).x = 1 return {}",
        "math.sin = nil return {}",
        "pdk.twice = nil return {}",
        "string.find = nil return {}",
        "require = nil pdk = nil return { f = function() return loadstring or getfenv or io or os end }",
    ] {
        let place = Place::new(&[("pipelines/a.lua", source)]);
        let result = place.run("local a = require('./a') return tostring(a.f() or pdk.twice(1))");
        assert!(
            result.as_ref().is_err_and(|error| error.starts_with("pipelines/a.lua:1: "))
                || result == Ok("2".into()),
            "{result:?}"
        );
    }
}

#[test]
fn a_circle_is_named() {
    let place = Place::new(&[
        ("pipelines/a.lua", "return { b = require('./sub/b') }"),
        ("pipelines/sub/b.lua", "local c\nc = require('../c') return {}"),
        ("pipelines/c.lua", "return { a = require('./a') }"),
        ("pipelines/self.lua", "return require('./self')"),
    ]);
    let remedy = "; move what they share into one that requires none of them";
    for (source, place_of, circle) in [
        ("return require('./a')", "pipelines/c.lua:1", "./a -> ./sub/b -> ./c -> ./a"),
        ("return require('./c')", "pipelines/sub/b.lua:2", "./c -> ./a -> ./sub/b -> ./c"),
        ("return require('./self')", "pipelines/self.lua:1", "./self -> ./self"),
    ] {
        let expected = format!("{place_of}: modules require each other in a circle: {circle}{remedy}");
        assert_eq!(place.run(source).unwrap_err(), expected);
    }
}

#[test]
fn a_module_that_failed_is_not_reported_as_a_cycle() {
    let place = Place::new(&[("pipelines/a.lua", "error('not today')")]);
    let source = "local first, second = select(2, pcall(require, './a')), select(2, pcall(require, './a'))
        assert(first == second, second) return first";
    assert_eq!(place.run(source).unwrap().rsplit('/').next().unwrap(), "a.lua:1: not today");
    // And it can be required once it works.
    let place = Place::new(&[("pipelines/a.lua", "if pdk.ready then return {} end error('not today')")]);
    let ready = "local ok = pcall(require, './a') assert(not ok) local ok = pcall(require, './a') return tostring(ok)";
    assert_eq!(place.run(ready).unwrap(), "false");
    assert_eq!(place.names(), ["./a"]);
}

#[test]
fn nothing_leads_out_of_the_folder() {
    let place = Place::new(&[("pipelines/sub/up.lua", "return require('../../secret')")]);
    let link = std::os::unix::fs::symlink::<PathBuf, PathBuf>;
    link(place.path("secret.lua"), place.path("pipelines/link.lua")).unwrap();
    link(place.path(""), place.path("pipelines/around")).unwrap();
    for name in [
        "../secret",
        "./../secret",
        "./a/../../secret",
        "./sub/../../secret",
        "./sub/up",
        "./link",
        "./around/secret",
        "./around/pipelines/../secret",
        "@pdk/../secret",
        "@pdk/a/../../secret",
    ] {
        let error = place.run(&format!("return require('{name}')")).unwrap_err();
        assert!(error.contains("leads out of its folder: "), "{name}: {error}");
    }
    let absolute = place.path("secret").display().to_string();
    for name in ["/etc/passwd", absolute.as_str(), "secret", "~/secret", "", "@other/x", "@pdk", "C:/x"] {
        let error = place.run(&format!("return require('{name}')")).unwrap_err();
        assert!(error.contains(" has to begin with ./ for a file beside this one"), "{name}: {error}");
    }
    for name in [".//secret", "./", "./.", "./..", "./sub/", "@pdk/", "@pdk//etc/passwd", "./a//b"] {
        let error = place.run(&format!("return require('{name}')")).unwrap_err();
        assert!(error.contains(" names no file; write it as in ./folder/name"), "{name}: {error}");
    }
    for name in [r"./a\\b", r"./a\0b", "./C:x"] {
        let error = place.run(&format!("return require('{name}')")).unwrap_err();
        assert!(error.contains("has a character that no name of a module has"), "{name}: {error}");
    }
    assert!(place.names().iter().all(|name| name == "./sub/up"), "{:?}", place.names());
    // A link to a file in the folder is that file.
    let place = Place::new(&[("pipelines/a.lua", "return {}")]);
    link(place.path("pipelines/a.lua"), place.path("pipelines/b.lua")).unwrap();
    assert_eq!(place.run("return tostring(require('./a') == require('./b'))").unwrap(), "true");
}

#[test]
fn mistakes_are_reported_with_file_and_line() {
    let large = " ".repeat(1 << 20) + "return {}";
    let place = Place::new(&[
        ("pipelines/none.lua", "local x = 1"),
        ("pipelines/number.lua", "return 5"),
        ("pipelines/two.lua", "return {}, {}"),
        ("pipelines/many.lua", "return table.unpack(table.create(5000, 1))"),
        ("pipelines/syntax.lua", "\nlocal = 5"),
        ("pipelines/power.lua", "\nreturn { x = 2 ^ 1.5 }"),
        ("pipelines/index.lua", "local x\n\nreturn { y = x.y }"),
        ("pipelines/plain.lua", "\nerror('no road', 0)"),
        ("pipelines/table.lua", "\nerror({})"),
        ("pipelines/stuck.lua", "\n\nwhile true do end"),
        ("pipelines/memory.lua", "\nreturn { ('x'):rep(1e9) }"),
        ("pipelines/later.lua", "return {\nfail = function() error('later') end }"),
        ("pipelines/large.lua", &large),
        ("pipelines/both.lua", "return {}"),
        ("pipelines/both.luau", "return {}"),
        ("pipelines/folder.lua/x.lua", "return {}"),
    ]);
    fs::write(place.path("pipelines/binary.lua"), [0xff, 0xfe]).unwrap();
    for (source, expected) in [
        (
            "\nrequire('./none')",
            "p.lua:2: the module ./none returns nothing, but has to return one table or function",
        ),
        (
            "require('./number')",
            "p.lua:1: the module ./number returns a number, but has to return one table or function",
        ),
        (
            "require('./two')",
            "p.lua:1: the module ./two returns 2 values, but has to return one table or function",
        ),
        (
            "require('./many')",
            "p.lua:1: the module ./many returns 5000 values, but has to return one table or function",
        ),
        (
            "require('./syntax')",
            "p.lua:1: pipelines/syntax.lua:2: Expected identifier when parsing variable name, got '='",
        ),
        (
            "require('./power')",
            "p.lua:1: pipelines/power.lua:2: `^` takes the exponents 2, 3 and 0.5 only, because with others its result depends \
             on the machine; write math.pow(x, y)",
        ),
        ("require('./index')", "pipelines/index.lua:3: attempt to index nil with 'y'"),
        ("require('./plain')", "pipelines/plain.lua:2: no road"),
        (
            "require('./table')",
            "pipelines/table.lua:2: raised an error that is a table; use a text, as in error(\"...\")",
        ),
        (
            "require('./stuck')",
            "pipelines/stuck.lua:3: used more than 0.3 s of processor time; make the loop shorter or raise the limit with \
             PDK_SCRIPT_SECONDS",
        ),
        (
            "require('./memory')",
            "pipelines/memory.lua:2: used more than 256 MiB of memory; keep less or raise the limit with \
             PDK_SCRIPT_MEGABYTES",
        ),
        ("local l = require('./later')\n\nl.fail()", "pipelines/later.lua:2: later"),
        (
            "require('./large')",
            "p.lua:1: the module pipelines/large.lua cannot be read (it has more than 1 MiB, which is too large for what it is to be)",
        ),
        (
            "require('./binary')",
            "p.lua:1: the module pipelines/binary.lua cannot be read (it is not text: byte 0 is not UTF-8)",
        ),
        (
            "require('./folder')",
            "p.lua:1: the module pipelines/folder.lua cannot be read (it is a folder, and only regular files are read; name a file)",
        ),
        (
            "require('./both')",
            "p.lua:1: require(\"./both\") could be pipelines/both.lua or pipelines/both.luau; rename one of them",
        ),
        (
            "\n\nrequire('./missing')",
            "p.lua:3: require(\"./missing\") finds no module: there is no pipelines/missing.lua",
        ),
        (
            "require('./none.lua')",
            "p.lua:1: require(\"./none.lua\") finds no module: there is no pipelines/none.lua.lua; leave out the ending",
        ),
        (
            "require('@pdk/studi')",
            "p.lua:1: require(\"@pdk/studi\") finds no module: pdk comes with no `studi`; did you mean `study`?",
        ),
        (
            "require(5)",
            "p.lua:1: require takes the name of a module, as in require(\"./name\"), not a number",
        ),
        ("require()", "p.lua:1: require takes the name of a module, as in require(\"./name\"), not nothing"),
    ] {
        assert_eq!(place.run(source).unwrap_err(), expected, "{source}");
    }
}

#[test]
fn nothing_lies_beside_a_pipeline_that_is_part_of_pdk() {
    let modules = Modules::new(None, LIBRARY);
    let sandbox = Sandbox::with_api(Limits::default(), |lua| {
        lua.load("pdk = { twice = function(n) return 2 * n end }").exec()?;
        modules.install(lua)
    })
    .unwrap();
    let run = |source: &str| {
        let chunk = sandbox.load("p.lua", source.as_bytes()).unwrap();
        sandbox.call("p.lua", &chunk, ()).map(|value| value.to_string().unwrap())
    };
    assert_eq!(run("return require('@pdk/study').value").unwrap(), "ps4");
    let error = run("return require('./study')").unwrap_err().to_string();
    assert!(error.contains("the pipeline is part of pdk, so nothing lies beside it; write @pdk/"), "{error}");
}

#[test]
fn compiled_modules_are_refused() {
    let place = Place::new(&[]);
    let compiled = mlua::chunk::Compiler::new().compile("return {}").unwrap();
    fs::write(place.path("pipelines/a.lua"), compiled).unwrap();
    assert!(place.run("return require('./a')").unwrap_err().starts_with("p.lua:1: "));
}

#[test]
fn modules_may_require_each_other_deeply_but_not_without_end() {
    let files: Vec<_> = (0..100)
        .map(|n| (format!("pipelines/m{n}.lua"), format!("return {{ next = require('./m{}') }}", n + 1)))
        .chain([("pipelines/m100.lua".to_owned(), "return {}".to_owned())])
        .collect();
    let files: Vec<_> = files.iter().map(|(name, source)| (name.as_str(), source.as_str())).collect();
    let place = Place::new(&files);
    assert_eq!(place.run("require('./m69') return 'deep'").unwrap(), "deep");
    assert_eq!(place.names().len(), 32);
    assert_eq!(
        place.run("require('./m68')").unwrap_err(),
        "pipelines/m99.lua:1: modules require each other more than 32 deep, down to ./m100; require some of them from the pipeline"
    );
    let many = "for n = 100, 0, -1 do require('./m' .. n) end return 'many'";
    assert_eq!(place.run(many).unwrap(), "many");
}

#[test]
fn modules_are_of_one_virtual_machine() {
    let modules = Modules::new(Some(Path::new(".")), &[]);
    let install = || Sandbox::with_api(Limits::default(), |lua| modules.install(lua)).map(|_| ());
    install().unwrap();
    assert!(install().unwrap_err().to_string().contains("these modules are already in a virtual machine"));
}
