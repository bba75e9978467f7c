//! What the bus costs: `cargo bench -p pdk-bus`.
//!
//! The loop's own part is measured in this process. The way to a tap is measured in a second process, which
//! this program starts from itself: from the moment the loop sends a frame to the moment the tap has read the
//! last byte of it.

use std::{
    hint::black_box,
    io::Read,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};

use pdk_bus::{Bus, Message, Result, Stamp, Tap, Topic, monotonic_nanoseconds};

const SIZES: [(u32, u32); 3] = [(160, 120), (320, 240), (1280, 720)];
const FRAMES: u64 = 2_000;
const PACED_FRAMES: u64 = 300;
const TAP: &str = "PDK_BUS_BENCH_TAP";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    if let Ok(role) = std::env::var(TAP) {
        return tap(&role);
    }
    println!("{:<58} {:>9} {:>12} {:>12}", "", "size", "median (µs)", "p99 (µs)");
    for (width, height) in SIZES {
        let size = format!("{width}x{height}");
        let run = format!("bench-{}-{size}", std::process::id());
        let row = |what: &str, mut nanoseconds: Vec<u64>| {
            nanoseconds.sort_unstable();
            let at =
                |part: f64| nanoseconds[((nanoseconds.len() - 1) as f64 * part) as usize] as f64 / 1_000.0;
            println!("{what:<58} {size:>9} {:>12.1} {:>12.1}", at(0.5), at(0.99));
        };

        row("make the four topics and take them off again", creation(&run, width, height)?);
        let bus = Bus::create(&run, 0, width, height)?;
        row("loop: borrow, send, read back; no tap", own_part(&bus)?);
        let child = start_tap(&format!("{run} {FRAMES}"))?;
        row("loop: the same, one tap in another process", own_part_with_tap(&bus)?);
        finish(child)?;
        for (what, pause) in [
            ("send to last byte read by another process; every 2 ms", Duration::from_millis(2)),
            ("send to last byte read by another process; 30 a second", Duration::from_nanos(33_333_333)),
        ] {
            let child = start_tap(&format!("{run} {PACED_FRAMES}"))?;
            paced(&bus, pause)?;
            row(what, finish(child)?);
        }
    }
    Ok(())
}

fn creation(run: &str, width: u32, height: u32) -> Result<Vec<u64>> {
    (0..20)
        .map(|round| {
            let start = Instant::now();
            drop(Bus::create(&format!("{run}-{round}"), 0, width, height)?);
            Ok(start.elapsed().as_nanos() as u64)
        })
        .collect()
}

fn step(bus: &Bus, sequence: u64) -> Result<()> {
    let mut loan = bus.loan_frame(Topic::Raw, Stamp { sequence, ..Default::default() })?;
    loan[0] = sequence as u8;
    black_box(loan.publish()?[0]);
    Ok(())
}

fn own_part(bus: &Bus) -> Result<Vec<u64>> {
    (0..FRAMES)
        .map(|sequence| {
            let start = Instant::now();
            step(bus, sequence)?;
            Ok(start.elapsed().as_nanos() as u64)
        })
        .collect()
}

/// The same with a reader that keeps up, so that frames go there and come back.
fn own_part_with_tap(bus: &Bus) -> Result<Vec<u64>> {
    (0..FRAMES)
        .map(|sequence| {
            let start = Instant::now();
            step(bus, sequence)?;
            let elapsed = start.elapsed().as_nanos() as u64;
            std::thread::sleep(Duration::from_micros(300));
            Ok(elapsed)
        })
        .collect()
}

fn paced(bus: &Bus, pause: Duration) -> Result<()> {
    for sequence in 0..PACED_FRAMES {
        std::thread::sleep(pause);
        step(bus, sequence)?;
    }
    Ok(())
}

fn start_tap(role: &str) -> std::io::Result<Child> {
    let mut child = Command::new(std::env::current_exe()?)
        .env(TAP, role)
        .stdout(Stdio::piped())
        .stdin(Stdio::null())
        .spawn()?;
    // It says when its tap is open.
    if let Some(output) = &mut child.stdout {
        output.read_exact(&mut [0; 1])?;
    }
    Ok(child)
}

fn finish(child: Child) -> Result<Vec<u64>, Box<dyn std::error::Error>> {
    let output = child.wait_with_output()?;
    let text = String::from_utf8(output.stdout)?;
    Ok(text.split_whitespace().map(str::parse).collect::<Result<_, _>>()?)
}

/// The other process: prints the nanoseconds from send to last byte of every frame.
fn tap(role: &str) -> Result<(), Box<dyn std::error::Error>> {
    let (run, frames) = role.split_once(' ').ok_or("the role is a run id and a number of frames")?;
    let frames: usize = frames.parse()?;
    let mut tap = Tap::open(run, 0, Topic::Raw, Duration::from_secs(10))?;
    println!();
    let mut latencies = Vec::with_capacity(frames);
    // The last frames may be lost on a busy machine; then nothing comes for a while.
    while latencies.len() < frames
        && let Some(Message::Frame(frame)) = tap.receive(Duration::from_millis(500))?
    {
        black_box(frame.iter().fold(0_u64, |sum, value| sum + u64::from(*value)));
        latencies.push(monotonic_nanoseconds() - frame.header().sent_at);
    }
    eprintln!("    (tap: {} frames read, {} lost)", latencies.len(), tap.lost());
    latencies.iter().for_each(|latency| println!("{latency}"));
    Ok(())
}
