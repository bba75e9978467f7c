//! The page of a run in a real browser: on a wide and a narrow window, light and dark, and printed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use pdk_tests::process::pipeline;
use pdk_tests::{Pdk, temp};
use serde_json::Value;

/// Browsers that take the same options.
const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/// Looks at the page as a reader does and writes what it sees where the test finds it.
const PROBE: &str = r#"<script>
const all = (selector) => [...document.querySelectorAll(selector)];
const light = (element) => {
  const [r, g, b] = getComputedStyle(element).backgroundColor.match(/[0-9.]+/g).map(Number);
  return 0.299 * r + 0.587 * g + 0.114 * b;
};
const cell = (text) => all("figure.heat td").find((cell) => cell.textContent === text);
const heat = all("figure.heat")[0];
const marks = [...heat.querySelectorAll("td[aria-label]")];
const first = marks.find((mark) => mark.tabIndex === 0);
first.focus();
const before = heat.querySelector(".told").textContent;
first.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowDown", bubbles: true }));
const track = all("figure.tracks .track[aria-label]")[0];
track.focus();
const found = {
  width: innerWidth,
  page: document.documentElement.scrollWidth,
  ground: light(document.body),
  failed: light(cell("failed")),
  survived: light(cell("ok")),
  cut: all(".scroll").filter((box) => box.clientWidth && box.scrollWidth > box.clientWidth + 2).map((box) =>
    [box.classList.contains("cut"), getComputedStyle(box, "::before").content]),
  first: [first.getAttribute("aria-label"), before],
  moved: [document.querySelector("figure.heat td[tabindex='0']").getAttribute("aria-label"), heat.querySelector(".told").textContent],
  track: [track.getAttribute("aria-label"), track.closest("figure").querySelector(".told").textContent],
  stops: heat.querySelectorAll("[tabindex='0']:not(.scroll)").length,
  picture: all("figure.tracks")[0].getBoundingClientRect().top,
  details: all("details").some((part) => part.open),
};
parent.postMessage(found, "*");
</script>"#;

/// Shows the page in a frame as wide as a telephone or a desk, because the window of a browser without a screen has a least width, and
/// writes what the probe sees into its own text.
const FRAME: &str = r#"<!doctype html><body><script>
addEventListener("message", (event) => {
  const text = document.createElement("script");
  text.type = "application/json";
  text.id = "found";
  text.textContent = JSON.stringify(event.data);
  document.body.append(text);
});
</script><iframe src="page.html" width="WIDTH" height="1600" style="border:0"></iframe></body>"#;

/// The browser of this machine. If there is none, says that what needs it is skipped.
fn browser() -> Option<&'static str> {
    let is_there = |name: &&str| {
        let quiet = || Stdio::null();
        let ran = Command::new(name).arg("--version").stdin(quiet()).stdout(quiet()).stderr(quiet()).status();
        ran.is_ok_and(|status| status.success())
    };
    let found = BROWSERS.into_iter().find(is_there);
    if found.is_none() {
        eprintln!("skipped: none of {} is installed", BROWSERS.join(", "));
    }
    found
}

/// Opens a page in a window of this width, with more options.
fn open(browser: &str, folder: &Path, page: &Path, width: u32, options: &[&str]) -> String {
    let profile = folder.join("profile");
    let mut command = Command::new(browser);
    command.args(["--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", "--no-first-run"]);
    command.arg(format!("--user-data-dir={}", profile.display()));
    command.arg(format!("--window-size={width},1600")).args(options);
    let ran = command.arg(format!("file://{}", page.display())).stderr(Stdio::null()).output().unwrap();
    assert!(ran.status.success(), "{browser}: {}", ran.status);
    String::from_utf8(ran.stdout).unwrap()
}

/// What the probe saw in the page of this folder.
fn seen(browser: &str, folder: &Path, width: u32, scheme: &str) -> Value {
    let frame = folder.join("frame.html");
    fs::write(&frame, FRAME.replace("WIDTH", &width.to_string())).unwrap();
    let text = open(browser, folder, &frame, 1400, &["--dump-dom", "--virtual-time-budget=5000", scheme]);
    let (_, rest) = text.split_once("id=\"found\">").unwrap_or_else(|| panic!("the probe failed: {text}"));
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

const LIGHT: &str = "--blink-settings=preferredColorScheme=1";
const DARK: &str = "--blink-settings=preferredColorScheme=0";

/// The page of three scenarios, of which one leaves the lane.
fn page(folder: &Path) -> PathBuf {
    let source = r#"
        local scenarios = { {}, { perturbations = { "contrast@0" } }, { perturbations = { "translate_image@4" } } }
        for _, scenario in scenarios do
            scenario.road = { angles = { 0, 10, 10, 10, 10, 10 }, segment = 15 }
        end
        pdk.drive({
            simulator = { name = "lane", width = 80, height = 60, rate = 20 },
            driver = "lane_keeper", duration = 20, scenarios = scenarios,
        })
    "#;
    let (record, page) = (folder.join("record"), folder.join("page.html"));
    Pdk::new(["run", "--out"]).arg(&record).arg(pipeline(folder, source)).succeed();
    Pdk::new(["report"]).arg(&record).arg("--out").arg(&page).succeed();
    let text = fs::read_to_string(&page).unwrap();
    fs::write(&page, text.replace("</body>", &format!("{PROBE}</body>"))).unwrap();
    page
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_page_can_be_read_on_any_window() {
    let Some(browser) = browser() else { return };
    let folder = temp();
    page(folder.path());
    for (width, scheme) in [(1280, LIGHT), (1280, DARK), (390, LIGHT), (390, DARK)] {
        let seen = seen(browser, folder.path(), width, scheme);
        let number = |field: &str| seen[field].as_f64().unwrap_or_else(|| panic!("no {field}: {seen}"));
        assert_eq!(number("width"), f64::from(width));
        assert!(number("page") <= number("width"), "the page is cut: {seen}");
        // The result is on the first screen, and what it comes from is folded.
        assert!(number("picture") < 900.0 && seen["details"] == false, "{seen}");
        // A failure stands out from the ground, and what was survived recedes.
        let away = |field: &str| (number(field) - number("ground")).abs();
        assert!(away("failed") > 150.0 && away("survived") < 30.0, "{seen}");
        assert_eq!(number("ground") < 50.0, scheme == DARK, "{seen}");
        // A table that is cut says so.
        for cut in seen["cut"].as_array().unwrap() {
            assert!(cut[0] == true && cut[1].as_str().unwrap().contains("to the right"), "{seen}");
        }
        assert_eq!(seen["cut"].as_array().unwrap().is_empty(), width > 1000, "{seen}");
    }
}

#[test]
fn marks_tell_their_drives_to_the_keyboard() {
    let Some(browser) = browser() else { return };
    let folder = temp();
    page(folder.path());
    let seen = seen(browser, folder.path(), 1280, LIGHT);
    for part in ["first", "moved", "track"] {
        assert!(seen[part][0].as_str().unwrap().len() > 10, "{seen}");
        assert_eq!(seen[part][0], seen[part][1], "{seen}");
    }
    // One stop for Tab in a picture; the arrow went on to the next row.
    assert_eq!(seen["stops"], 1);
    assert_ne!(seen["first"][0], seen["moved"][0]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_page_is_drawn_and_printed() {
    let Some(browser) = browser() else { return };
    let folder = temp();
    let page = page(folder.path());
    let picture = folder.path().join("page.png");
    let option = format!("--screenshot={}", picture.display());
    open(browser, folder.path(), &page, 390, &[&option, DARK]);
    let picture = image::open(&picture).unwrap().to_rgb8();
    assert_eq!(picture.width(), 390);
    assert!(picture.get_pixel(2, 2).0.iter().all(|value| *value < 50), "{:?}", picture.get_pixel(2, 2));
    let bright = picture.pixels().filter(|pixel| pixel.0.iter().all(|value| *value > 200)).count();
    assert!(bright > 500, "{bright} bright pixels: nothing was written");

    let print = folder.path().join("page.pdf");
    let option = format!("--print-to-pdf={}", print.display());
    open(browser, folder.path(), &page, 1280, &[&option]);
    let print = fs::read(&print).unwrap();
    assert!(print.starts_with(b"%PDF") && print.len() > 20_000, "{} bytes", print.len());
}
