//! Faults of devices: what the driver gets besides the frame, and what becomes of its control, on the way that every simulator shares.

use std::fs;
use std::path::Path;

use pdk_record::trace::reader::read_steps;
use pdk_record::trace::step::Step;
use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::records::trace;
use pdk_tests::{Pdk, temp};

/// A short road for the embedded simulator in small frames, 20 a second.
const SIMULATOR: &str = "{ name = 'lane', width = 80, height = 60, rate = 20 }";
/// A perturbation in Lua: half of the control before, and a speed that is doubled.
const HALVED: &str =
    "return { doc = 'Halves the control before', history = 1, actuate = function(control, cx)
    local before = cx.history[1]
    assert(cx.period == 0.05 and (before == nil or before.frame_index == cx.frame_index - 1))
    control.steering = if before then before.given.steering / 2 else 0
end }";
const DOUBLED: &str =
    "return { doc = 'Doubles the speed', observe = function(observation) observation.speed *= 2 end }";

/// Drives under these perturbations, and gives the steps of each drive.
fn driven(folder: &Path, out: &Path, perturbations: &[&str], workers: &str) -> Vec<Vec<Step>> {
    fs::write(folder.join("halved.lua"), HALVED).unwrap();
    fs::write(folder.join("doubled.lua"), DOUBLED).unwrap();
    let scenarios: String =
        perturbations.iter().map(|list| format!("    {{ perturbations = {{ {list} }} }},\n")).collect();
    let source = format!(
        "local scenarios = {{\n{scenarios}}}
for _, scenario in scenarios do scenario.road = {{ angles = {{ 0, 8, -8 }}, segment = 15 }} end
pdk.drive {{ simulator = {SIMULATOR}, driver = 'lane_keeper', duration = 6, scenarios = scenarios }}\n"
    );
    let file = pipeline(folder, &source);
    Pdk::new(["run", "--workers", workers, "--out"]).arg(out).arg(file).folder(folder).succeed();
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(lines.len(), perturbations.len());
    lines.iter().map(|line| read_steps(&trace(out, line)).unwrap()).collect()
}

#[test]
fn controls_are_recorded_as_the_driver_gave_them_and_as_they_were_applied() {
    let folder = temp();
    let out = folder.path().join("record");
    let all = driven(
        folder.path(),
        &out,
        &[
            "",
            "{ name = 'late_controls', level = 0, delay = 0.15 }",
            "'halved@1'",
            "{ name = 'late_controls', level = 0, delay = 0.1 }, { name = 'limited_controls', level = 0, steering = 0.03 }",
            "{ name = 'late_controls', level = 0, delay = 0.15, probability = 0.5 }",
        ],
        "2",
    );
    assert!(all[0].iter().all(|step| step.applied.is_none() && step.observed.is_none()));
    assert!(all[1..].iter().flatten().all(|step| step.applied.is_some() && step.observed.is_none()));
    let bits = |value: f64| value.to_bits();
    for (index, step) in all[1].iter().enumerate() {
        let expected = index.checked_sub(3).map_or_else(Default::default, |index| all[1][index].control);
        assert_eq!(step.applied.unwrap().numbers().map(bits), expected.numbers().map(bits), "frame {index}");
    }
    for pair in all[2].windows(2) {
        assert_eq!(pair[1].applied.unwrap().steering, pair[0].control.steering / 2.0);
        assert_eq!(pair[1].applied.unwrap().throttle, pair[1].control.throttle);
    }
    for (index, step) in all[3].iter().enumerate().skip(2) {
        let steering = all[3][index - 2].control.steering.clamp(-0.03, 0.03);
        assert_eq!(step.applied.unwrap().steering, steering, "frame {index}");
    }
    // The probability draws whether a frame is spared, and a frame that is spared gets its own control.
    let spared = all[4].iter().filter(|step| step.applied == Some(step.control)).count();
    assert!(spared * 4 > all[4].len() && spared * 4 < 3 * all[4].len(), "{spared} of {}", all[4].len());
    // The vehicle went another way.
    assert_ne!(all[0].last().unwrap().state, all[1].last().unwrap().state);
}

#[test]
fn what_the_driver_gets_is_recorded_and_all_comes_out_again_on_any_number_of_workers() {
    let folder = temp();
    let perturbations = [
        "{ name = 'biased_speed', level = 0, share = -0.5 }",
        "{ name = 'drifting_clock', level = 0, rate = 0.5 }, 'doubled@2'",
        "'noisy_speed@3', { name = 'late_controls', level = 2, latency = 'jitter' }, 'fog_filter@2', 'lost_controls@2'",
        "{ name = 'lost_speed', level = { ramp = { from = 0, to = 4, ['end'] = 4 } } }",
    ];
    let one = folder.path().join("one");
    let steps = driven(folder.path(), &one, &perturbations, "1");
    for step in &steps[0] {
        assert_eq!(step.observed, Some([step.state.time, 0.5 * step.state.speed]));
    }
    for step in &steps[1] {
        assert_eq!(step.observed, Some([1.5 * step.state.time, 2.0 * step.state.speed]));
    }
    // A driver that holds a speed drives as much faster as it believes to be slower.
    let fastest = |steps: &[Step]| steps.iter().map(|step| step.state.speed).fold(0.0, f64::max);
    assert!(fastest(&steps[0]) > 1.3 * fastest(&steps[1]), "{} {}", fastest(&steps[0]), fastest(&steps[1]));
    let three = folder.path().join("three");
    assert_eq!(driven(folder.path(), &three, &perturbations, "3"), steps);
    let replayed = Pdk::new(["replay"]).arg(&one).folder(folder.path()).succeed();
    assert!(replayed.stdout.contains("4 of 4 equal"), "{}", replayed.stdout);
}

#[test]
fn what_is_not_in_pictures_is_refused_where_there_are_only_pictures() {
    let folder = temp();
    let picture = folder.path().join("in.png");
    pdk_tests::pictures::write(&picture, 60, 40);
    let out = folder.path().join("out.png");
    let sentence = "perturbation `late_controls@2`: it changes the control on its way to the vehicle, which exists only in drives; leave it out";
    Pdk::new(["perturb"])
        .arg(&picture)
        .args(["--with", "late_controls@2", "-o"])
        .arg(&out)
        .fail(1, &[sentence]);
    let file = pipeline(
        folder.path(),
        "pdk.drive { simulator = 'lane', driver = 'lane_keeper', scenarios = { { perturbations = { { name = 'late_controls', level = 2, region = { box = { 0, 0, 1, 0.5 } } } } } } }",
    );
    let ran = Pdk::new(["run", "--out"]).arg(folder.path().join("limited")).arg(file).run();
    let printed = format!("{}{}", ran.stdout, ran.stderr);
    assert!(
        printed.contains("it does not change frames, so leave `region`, `where` and the box of `during` out"),
        "{printed}"
    );
}

#[test]
fn a_script_that_changes_no_frames_is_checked_by_its_own_rules() {
    let folder = temp();
    let check = |text: &str| {
        fs::write(folder.path().join("fault.lua"), text).unwrap();
        Pdk::new(["check"]).arg(folder.path().join("fault.lua")).run()
    };
    let good = check(HALVED);
    assert_eq!(good.code, Some(0), "{}{}", good.stdout, good.stderr);
    let remembers = check(
        "local last = 0
        return { doc = 'x', actuate = function(control) control.steering, last = last, control.steering end }",
    );
    assert!(
        remembers.stdout.contains("than it does after other frames"),
        "{}{}",
        remembers.stdout,
        remembers.stderr
    );
    for (body, expected) in [
        (
            "actuate = function(control) control.steer = 1 end",
            "the control has no field `steer`; did you mean `steering`?",
        ),
        (
            "actuate = function(control) control.steering = 'left' end",
            "it leaves `steering` as a string, but it has to be a number",
        ),
        (
            "observe = function() return 1 end",
            "it returns a number, but has to change the table in place and return nothing",
        ),
        (
            "observe = print, apply = print",
            "the script has both `apply` and `observe`, but does one thing; leave one out",
        ),
        ("observe = print, geometry = 'kept'", "what does not change frames moves nothing"),
    ] {
        let ran = check(&format!("return {{ doc = 'x', {body} }}"));
        let printed = format!("{}{}", ran.stdout, ran.stderr);
        assert!(printed.contains(expected), "{body}: {printed}");
    }
}
