//! Prints one line for every message of a topic, and keeps the newest frame as a picture where asked to:
//! `cargo run --release -p pdk-bus --example tap -- perturbed --save newest.ppm`

use std::{fs, io, path::PathBuf, process::ExitCode, time::Duration};

use pdk_bus::{FrameSample, LATEST, Message, Tap, Topic, monotonic_nanoseconds};
use pdk_model::state::State;

const USAGE: &str = "\
Usage: tap [raw|perturbed|control|state] [--run ID] [--slot N] [--save FILE.ppm] [--wait SECONDS] [--count N]
       tap --list

  --run ID         the run to tap; by default the one that started last
  --slot N         which of its loops (default 0)
  --save FILE.ppm  keep the newest frame in this file
  --wait SECONDS   how long to wait for the run to start (default 60)
  --count N        end after N messages; by default when the run ends
  --list           name the loops that publish at this moment, with the folder of each";

struct Options {
    topic: Topic,
    run: String,
    slot: u32,
    save: Option<PathBuf>,
    wait: Duration,
    count: u64,
}

fn main() -> ExitCode {
    match run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if arguments.iter().any(|argument| argument == "--help" || argument == "-h") {
        println!("{USAGE}");
        return Ok(());
    }
    if arguments.iter().any(|argument| argument == "--list") {
        for run in Tap::list()? {
            for slot in run.slots {
                println!(
                    "{}  slot {}  process {}  {}",
                    run.run,
                    slot.slot,
                    slot.process,
                    slot.root.display()
                );
            }
        }
        return Ok(());
    }

    let options = parse(&arguments)?;
    let mut tap = Tap::open(&options.run, options.slot, options.topic, options.wait)?;
    eprintln!("tapping `{}` of slot {} of run `{}`", tap.topic(), tap.slot(), tap.run());
    let mut received = 0;
    while received < options.count {
        let Some(message) = tap.receive(Duration::from_millis(500))? else {
            if tap.is_over()? {
                eprintln!("the run has ended");
                break;
            }
            continue;
        };
        received += 1;
        print(&tap, &message);
        if let (Message::Frame(frame), Some(path)) = (&message, &options.save) {
            save(frame, path)?;
        }
    }
    Ok(())
}

fn parse(arguments: &[String]) -> Result<Options, Box<dyn std::error::Error>> {
    let mut options = Options {
        topic: Topic::Perturbed,
        run: LATEST.to_owned(),
        slot: 0,
        save: None,
        wait: Duration::from_secs(60),
        count: u64::MAX,
    };
    let mut arguments = arguments.iter();
    while let Some(argument) = arguments.next() {
        let mut value = || arguments.next().ok_or_else(|| format!("{argument} needs a value\n\n{USAGE}"));
        match argument.as_str() {
            "--run" => options.run = value()?.clone(),
            "--slot" => options.slot = value()?.parse().map_err(|error| format!("--slot: {error}"))?,
            "--save" => options.save = Some(value()?.into()),
            "--wait" => {
                let seconds = value()?.parse().map_err(|error| format!("--wait: {error}"))?;
                options.wait =
                    Duration::try_from_secs_f64(seconds).map_err(|error| format!("--wait: {error}"))?;
            }
            "--count" => options.count = value()?.parse().map_err(|error| format!("--count: {error}"))?,
            option if option.starts_with('-') => {
                return Err(format!("there is no option {option}\n\n{USAGE}").into());
            }
            topic => options.topic = topic.parse()?,
        }
    }
    Ok(options)
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
        "{} scenario {} frame {} t {:.3} s  {content}  {latency:.0} µs  {} lost",
        tap.run(),
        header.scenario,
        header.sequence,
        header.time,
        tap.lost()
    );
}

/// Writes a binary PPM beside the file and moves it there, so that a viewer never sees half a picture.
fn save(frame: &FrameSample, path: &PathBuf) -> io::Result<()> {
    let mut bytes = format!("P6\n{} {}\n255\n", frame.header().width, frame.header().height).into_bytes();
    bytes.extend_from_slice(frame);
    let unfinished = path.with_extension("ppm.part");
    fs::write(&unfinished, bytes)?;
    fs::rename(&unfinished, path)
}

/// The flags that are set, by name.
fn flags(state: &State) -> String {
    let set = State::FLAGS.iter().zip(state.flags()).filter(|(_, set)| *set);
    set.map(|(name, _)| *name).collect::<Vec<_>>().join(" ")
}
