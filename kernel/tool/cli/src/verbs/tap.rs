//! `pdk tap`: prints the messages of a topic of a run under way.

use std::path::{Path, PathBuf};
use std::time::Duration;

use pdk_bus::{FrameSample, LATEST, Message, Tap, Topic, monotonic_nanoseconds};
use pdk_model::state::State;
use pdk_notice::{eprintln, println};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Value, json};

use super::{Global, json_text, print_json};

/// How long a tap waits for a message before it looks whether the run has ended.
const LOOK: Duration = Duration::from_millis(500);

/// Arguments of `pdk tap`
#[derive(clap::Args)]
pub struct Arguments {
    /// The topic: raw, perturbed, control or state
    #[arg(value_name = "TOPIC", default_value = "perturbed", conflicts_with = "list")]
    topic: Topic,
    /// The run to tap, as --list names it [default: the one that started last]
    #[arg(long, value_name = "ID")]
    run: Option<String>,
    /// Which of its loops
    #[arg(long, value_name = "N", default_value_t = 0)]
    slot: u32,
    /// Keep the newest frame in this picture
    #[arg(long, value_name = "FILE.png")]
    save: Option<PathBuf>,
    /// How many seconds to wait for the run to begin
    #[arg(long, value_name = "SECONDS", default_value_t = 60)]
    wait: u64,
    /// End after this many messages [default: when the run ends]
    #[arg(long, value_name = "N")]
    count: Option<u64>,
    /// List the loops that publish at this moment, with the folder of each
    #[arg(long)]
    list: bool,
}

/// Prints a line for each message, until the run ends.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if arguments.list {
        return list(global);
    }
    let topic = arguments.topic;
    if arguments.save.is_some() && !matches!(topic, Topic::Raw | Topic::Perturbed) {
        return Err(Error::new(format!("topic `{topic}` has no frames for --save; use raw or perturbed")));
    }
    let run = arguments.run.as_deref().unwrap_or(LATEST);
    let mut tap =
        Tap::open(run, arguments.slot, topic, Duration::from_secs(arguments.wait)).map_err(of_bus)?;
    eprintln!("tapping `{}` of slot {} of run `{}`", tap.topic(), tap.slot(), tap.run());
    let mut received = 0;
    while arguments.count.is_none_or(|count| received < count) {
        let Some(message) = tap.receive(LOOK).map_err(of_bus)? else {
            if tap.is_over().map_err(of_bus)? {
                eprintln!("the run has ended");
                break;
            }
            continue;
        };
        received += 1;
        match global.json {
            true => json_text::print(&told(&tap, &message).to_string()),
            false => print(&tap, &message),
        }
        if let (Message::Frame(frame), Some(path)) = (&message, &arguments.save) {
            save(frame, path)?;
        }
    }
    Ok(())
}

fn of_bus(error: pdk_bus::Error) -> Error {
    Error::new(error.message())
}

fn list(global: &Global) -> Result<()> {
    let runs = Tap::list().map_err(of_bus)?;
    let slots: Vec<_> =
        runs.iter().flat_map(|run| run.slots.iter().map(move |slot| (&run.run, slot))).collect();
    if global.json {
        let told = |(run, slot): &(&String, &pdk_bus::SlotTopics)| json!({ "run": run, "slot": slot.slot, "pid": slot.process, "root": slot.root });
        return print_json(&Value::Array(slots.iter().map(told).collect()));
    }
    for (run, slot) in slots {
        println!("{run}  slot {}  process {}  {}", slot.slot, slot.process, slot.root.display());
    }
    Ok(())
}

/// A message as JSON.
fn told(tap: &Tap, message: &Message) -> Value {
    let header = message.header();
    let mut told = json!({
        "run": tap.run(), "slot": tap.slot(), "topic": tap.topic().name(), "scenario": header.scenario,
        "frame": header.sequence, "time": header.time, "lost": tap.lost(),
    });
    match message {
        Message::Frame(_) => (told["width"], told["height"]) = (header.width.into(), header.height.into()),
        Message::Control(_, control) => told["control"] = json!(control),
        Message::State(_, state) => told["state"] = json!(state),
    }
    told
}

fn print(tap: &Tap, message: &Message) {
    let header = *message.header();
    let latency = monotonic_nanoseconds().saturating_sub(header.sent_at) as f64 / 1_000.0;
    let content = match message {
        Message::Frame(_) => format!("{}x{}", header.width, header.height),
        Message::Control(_, control) => {
            format!("steering {:+.3} throttle {:+.3}", control.steering, control.throttle)
        }
        Message::State(_, state) => format!(
            "x {:.2} y {:.2} z {:.2} speed {:.2} m/s cross-track {:+.3} m {}",
            state.position[0],
            state.position[1],
            state.position[2],
            state.speed,
            state.cross_track_error,
            flags(state)
        ),
    };
    println!(
        "scenario {} frame {} t {:.3} s  {content}  {latency:.0} µs  {} lost",
        header.scenario,
        header.sequence,
        header.time,
        tap.lost()
    );
}

/// Writes the picture as a whole, so that a viewer never sees half of one.
fn save(frame: &FrameSample, path: &Path) -> Result<()> {
    let header = frame.header();
    let picture =
        image::RgbImage::from_raw(header.width, header.height, frame.to_vec()).ok_or_else(|| {
            Error::new("the frame is not of the size that its header has, which is a defect in pdk")
        })?;
    let mut png = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut png, image::ImageFormat::Png).place("cannot encode the frame")?;
    pdk_sdk::file::write(path, png.get_ref()).place(format_args!("cannot write {}", path.display()))
}

/// The flags that are set, by name.
fn flags(state: &State) -> String {
    let set = State::FLAGS.iter().zip(state.flags()).filter(|(_, set)| *set);
    set.map(|(name, _)| *name).collect::<Vec<_>>().join(" ")
}
