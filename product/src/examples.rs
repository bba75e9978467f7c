//! The examples in the help of each verb of the command line.

use pdk_components::product::Examples;

/// A verb with commands that use it, each with what it does. A verb that only other programs call has none.
pub const EXAMPLES: &[Examples] = &[
    (
        "run",
        &[
            ("pdk run quickstart", "drive a few perturbations on a road and show the outcomes"),
            (
                "pdk run search --set driver=dave2 --seed 7",
                "search for the conditions in which a driver fails",
            ),
            ("pdk run study.lua --out records/study", "run a pipeline of your own and keep its record there"),
        ],
    ),
    (
        "gate",
        &[
            ("pdk gate dave2 dave2_augmented --suite smoke", "whether one network is worse than another one"),
            (
                "pdk gate runs/standard-1 pilot.onnx --suite standard --markdown verdict.md --junit verdict.xml",
                "a network of your own against the driver that passed the last gate, for continuous integration",
            ),
            (
                "pdk gate old.onnx new.onnx --suite route.toml",
                "two networks on the frames of a recording, which route.toml names in a [[recording]]",
            ),
        ],
    ),
    (
        "verify",
        &[
            ("pdk verify runs/smoke-1", "whether the verdict of a gate holds, by repeating 59 of its drives"),
            (
                "pdk verify verdict.json --probes 200 --draw unforeseen",
                "more drives, which the maker of the verdict could not foresee",
            ),
            (
                "pdk verify runs/route-1 --scenario 1ef88c9d9b53454cf9e0f191320c2799",
                "one block of a recording that the new driver fails, again",
            ),
        ],
    ),
    (
        "suite",
        &[
            ("pdk suite smoke", "what a suite drives and requires"),
            (
                "pdk suite runs/smoke-1 -o never_again.toml",
                "a suite of the scenarios in which drivers failed",
            ),
        ],
    ),
    (
        "perturb",
        &[
            ("pdk perturb road.png --with fog_filter@3 -o fog.png", "fog of intensity 3 on an image"),
            (
                "pdk perturb drive.mp4 --with gaussian_blur@1 --with dirty_lens@2 -o worse.mp4",
                "two perturbations, one after the other, on a video",
            ),
        ],
    ),
    (
        "sensitivity",
        &[
            (
                "pdk sensitivity runs/study-1 --scenario 12",
                "when and where in the frames the level of a perturbation matters",
            ),
            (
                "pdk sensitivity runs/study-1 --scenario 12 --least -o least",
                "and the least change of it over time with which the driver leaves its lane",
            ),
        ],
    ),
    (
        "why",
        &[
            ("pdk why runs/study-1 --scenario 12", "which frames and which part of them made the drive fail"),
            (
                "pdk why runs/study-1 --scenario 12 --clips -o why-12",
                "and videos of the drives that prove it",
            ),
        ],
    ),
    (
        "attack",
        &[
            (
                "pdk attack patch docs/examples/recording --driver dave2 -o patch.png",
                "a picture for the road that makes a network steer to the left; `--with adversarial_patch,picture=patch.png` shows it",
            ),
            (
                "pdk attack universal docs/examples/recording --driver dave2 --goal right -o change.png",
                "one change for all frames that makes it steer to the right",
            ),
            (
                "pdk attack drives runs/patch-1 -o trained.png",
                "the picture that recorded drives show, trained until the vehicle leaves its lane",
            ),
        ],
    ),
    (
        "gradient",
        &[
            (
                "pdk gradient pilot.onnx -o gradient.onnx --of steering",
                "the gradient of the steering with respect to the image",
            ),
            (
                "pdk gradient pilot.onnx -o loss.onnx --of 'squared_error(steering)' --by weights",
                "the gradient of a loss with respect to all weights, as training needs it",
            ),
        ],
    ),
    (
        "corrupt",
        &[
            (
                "pdk corrupt photos --with fog_filter@1..3,rotate_image@0 -o worse",
                "a folder of pictures and labels under four conditions",
            ),
            (
                "pdk corrupt drive --suite imagenet_c -o drives",
                "a recording under all perturbations of a family, at all levels",
            ),
        ],
    ),
    (
        "calibrate",
        &[
            (
                "pdk calibrate frames -o mine.scale.json",
                "a scale of the default set on the images in a folder",
            ),
            (
                "pdk calibrate frames --with my_fog --with pixelate,variant=corrected -o mine.scale.json",
                "a scale of two perturbations, one with a parameter",
            ),
        ],
    ),
    (
        "preview",
        &[
            ("pdk preview road.png", "a sheet of the default set, and strips and clips of what moves"),
            ("pdk preview road.png --with fog_filter --out fog", "one perturbation at all levels"),
        ],
    ),
    (
        "saliency",
        &[
            (
                "pdk saliency frames --driver dave2 --out maps",
                "what matters to a network in a folder of images",
            ),
            (
                "pdk saliency frames --driver dave2 --out maps --with gradient --curves",
                "another method, and how faithful it is",
            ),
        ],
    ),
    ("reference", &[("pdk reference pages", "the reference pages of all perturbations, in a folder")]),
    (
        "list",
        &[
            ("pdk list perturbation", "all perturbations by family"),
            ("pdk list --json", "all components for a program"),
        ],
    ),
    (
        "show",
        &[
            ("pdk show fog_filter", "a perturbation with its parameters"),
            (
                "pdk show pilot.onnx",
                "the inputs, outputs and layers of a network, and what is known about its preprocessing",
            ),
            ("pdk show pilot.onnx --image frame.png -o seen.png", "what the network sees of a frame"),
        ],
    ),
    (
        "new",
        &[
            ("pdk new perturbation salt_spray", "a perturbation in Lua that works"),
            ("pdk new perturbation salt_spray --rust", "the same as a plugin in Rust"),
            ("pdk new driver my_pilot", "a driver that drives, as a plugin"),
            (
                "pdk new network pilot.onnx",
                "a description of a network's preprocessing to complete, beside its file",
            ),
        ],
    ),
    ("check", &[("pdk check target/release/libsalt_spray.so", "a plugin, before it is shipped")]),
    (
        "plugin",
        &[
            ("pdk plugin add libsalt_spray.so", "install a plugin for this user"),
            ("pdk plugin remove salt_spray", "remove it"),
        ],
    ),
    (
        "doctor",
        &[
            ("pdk doctor", "whether everything that pdk needs is there"),
            ("pdk doctor --simulator carla", "whether a simulator can be reached"),
        ],
    ),
    (
        "tap",
        &[
            ("pdk tap state", "the states of the vehicle in a run under way, a line each"),
            ("pdk tap raw --save frame.png", "keep the newest frame of the camera in a picture"),
        ],
    ),
    (
        "watch",
        &[
            ("pdk watch --open", "the run under way that started last, in the browser"),
            ("pdk watch runs/quickstart-1 --port 8080", "a run at a port of your choice"),
        ],
    ),
    (
        "report",
        &[
            ("pdk report runs/quickstart-1 --open", "write the page about a run and show it in the browser"),
            (
                "pdk report runs/study-1 runs/study-2 -o comparison.html",
                "one page that compares the drivers of two runs",
            ),
        ],
    ),
    (
        "road",
        &[(
            "pdk road --turns 3 --mean-curvature 0.02 --seed 4 -o road.svg",
            "a road with three turns, drawn",
        )],
    ),
    (
        "replay",
        &[
            ("pdk replay runs/quickstart-1", "drive all scenarios again and compare"),
            (
                "pdk replay runs/quickstart-1 --scenario 6 --clip failure.mp4",
                "a video of the failure in fog, scenario 6 (the first is 0)",
            ),
        ],
    ),
    (
        "shrink",
        &[("pdk shrink runs/search-1 --scenario 12 -o failure.lua", "the simplest drive that still fails")],
    ),
    (
        "export",
        &[
            (
                "pdk export runs/quickstart-1 --to csv",
                "scenarios, telemetry and tables, for pandas and DuckDB",
            ),
            (
                "pdk export runs/quickstart-1 --to svg -o paper",
                "the pictures of the report, in paper/figures",
            ),
            ("pdk export runs/quickstart-1 --to tex -o paper", "its tables for LaTeX, in paper/tables"),
            ("pdk export runs/quickstart-1 --to junit -o .", "junit.xml: a test case for each scenario"),
            (
                "pdk export runs/study-1 --to odd -o .",
                "odd.json and odd.html: what was driven of an operational design domain, what failed, and what is open",
            ),
            ("pdk export runs/quickstart-1 -o scenarios.json", "the scenarios for the published tool"),
        ],
    ),
    ("merge", &[("pdk merge part-1 part-2 --out whole", "one record from the parts of a run")]),
    (
        "cache",
        &[
            ("pdk cache", "how much is kept"),
            ("pdk cache clear", "remove what was prepared; it is made again"),
        ],
    ),
    (
        "completions",
        &[(
            "pdk completions bash > ~/.local/share/bash-completion/completions/pdk",
            "completions for this user",
        )],
    ),
    ("man", &[("pdk man ~/.local/share/man/man1", "the manual pages for this user")]),
];
