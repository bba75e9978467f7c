//! `pdk doctor --simulator`: connects to a simulator, drives ten frames, and says what it found.

use std::time::{Duration, Instant};

use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::{Mode, Scenario};
use pdk_model::text::parse_value;
use pdk_pipeline::settings::{Override, refuse_repeated};
use pdk_sdk::describe::{Clock, Kind};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Camera, Control, FrameBuf, Simulator, State};
use pdk_supervise::calls::{self, Function};
use serde_json::{Map, Value};

use super::{Finding, State as Mark};

/// Frames that are driven.
const FRAMES: usize = 10;

/// What the frames took.
#[derive(Default)]
struct Times {
    /// From a control to the state after it.
    act: Vec<Duration>,
    /// From a state to its picture.
    frame: Vec<Duration>,
    states: Vec<State>,
}

/// Connects and drives.
///
/// # Errors
/// If there is no such simulator, or it does not do as it should.
pub fn examine(registry: &Registry, name: &str, values: &[Override]) -> Result<Vec<Finding>> {
    refuse_repeated(values)?;
    let parameters = values.iter().map(|Override { key, value }| Ok((key.clone(), parse_value(value)?)));
    let parameters: Map<String, Value> = parameters.collect::<Result<_>>()?;
    let clock = registry.catalog().get(Kind::Simulator, name)?.description.clock;
    let label = format!("simulator `{name}`");
    let placed = |error: Error| error.at(&label);
    let mut simulator = registry.simulator(name, &parameters)?.0;
    let camera = calls::call(&label, Function::Camera, || simulator.camera());
    let component = ComponentSpec { name: name.to_owned(), parameters };
    let mut scenario = Scenario::new(component, ComponentSpec::new("doctor"));
    if clock == Clock::Own {
        scenario.mode = Mode::Realtime;
    }
    let began = Instant::now();
    calls::call(&label, Function::Reset, || simulator.reset(&scenario, 0)).map_err(placed)?;
    let ready = began.elapsed();
    let info = calls::call(&label, Function::Info, || simulator.info());
    let times = drive(simulator.as_mut(), camera, &label).map_err(placed)?;
    calls::call(&label, Function::Drop, || drop(simulator));

    let good = |subject, text| Finding { subject, state: Mark::Good, text };
    let kept = match clock {
        Clock::Stepped => "waits for the driver: it can be driven in lockstep",
        Clock::Own => "has its own clock: it is driven in real time",
    };
    let mut findings =
        vec![good("simulator", format!("`{name}` was ready after {:.2} s, and {kept}", ready.as_secs_f64()))];
    findings.extend(info.into_iter().map(|(what, value)| good("told", format!("{what}: {value}"))));
    findings.push(rate(camera, &times, clock));
    findings.push(good(
        "latency",
        format!(
            "{} from a control to the next frame, {} to take its picture ({FRAMES} frames)",
            middle_and_longest(&times.act),
            middle_and_longest(&times.frame)
        ),
    ));
    Ok(findings)
}

fn drive(simulator: &mut dyn Simulator, camera: Camera, label: &str) -> Result<Times> {
    let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
    let mut times = Times::default();
    for number in 0..FRAMES as u64 {
        let began = Instant::now();
        let state = calls::call_at(label, Function::Frame, number, || simulator.frame(frame.as_mut()))?;
        times.frame.push(began.elapsed());
        times.states.push(state);
        let control = Control { steering: 0.0, throttle: 0.2 };
        let began = Instant::now();
        calls::call_at(label, Function::Act, number, || simulator.act(control))?;
        times.act.push(began.elapsed());
    }
    Ok(times)
}

/// Size and rate of the camera; whether the rate is as it says.
fn rate(camera: Camera, times: &Times, clock: Clock) -> Finding {
    let Camera { width, height, rate } = camera;
    let passed = times.states.last().map_or(0.0, |state| state.time);
    let measured = (FRAMES - 1) as f64 / passed;
    let (state, remark) = match clock {
        Clock::Stepped => (Mark::Good, String::new()),
        Clock::Own if passed <= 0.0 => (Mark::Bad, ", but its time does not advance".to_owned()),
        Clock::Own if (0.8..1.25).contains(&(measured / rate)) => {
            (Mark::Good, format!("; {measured:.1} frames a second were measured"))
        }
        Clock::Own => (
            Mark::Note,
            format!("; but {measured:.1} frames a second were measured: set `rate` to what it sends"),
        ),
    };
    let text = format!("frames of {width}x{height} pixels at {rate} Hz{remark}");
    Finding { subject: "camera", state, text }
}

fn middle_and_longest(times: &[Duration]) -> String {
    let mut sorted = times.to_vec();
    sorted.sort();
    let shown = |time: Option<&Duration>| time.map_or(0.0, Duration::as_secs_f64) * 1000.0;
    format!("{:.1} ms (at most {:.1})", shown(sorted.get(sorted.len() / 2)), shown(sorted.last()))
}
