//! A pool of workers for `pdk run --pool`: it starts some workers on this machine and passes lines on between them and the
//! session. A pool for a cluster differs in one place only, which is how it starts a worker.
//!
//! `pool SLOTS [PDK]`: this many processes `PDK worker`, which is the `pdk` beside this program if none is named.
//!
//! A worker that is lost is started anew and gets its job again; one that is lost over and over ends the pool.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, Receiver, Sender};

use serde_json::Value;

type Result<T> = std::result::Result<T, String>;

/// How often a worker is started for one job.
const TRIES: u32 = 3;

/// A line of the session, if there is no slot, or of the worker of a slot; no line at its end.
type Event = (Option<usize>, Option<String>);

struct Worker {
    child: Child,
    input: Option<ChildStdin>,
    /// The line with the job that it is at, and how often it was given away.
    job: Option<(String, u32)>,
}

struct Pool {
    pdk: PathBuf,
    hello: String,
    workers: Vec<Worker>,
    /// How many workers have said that they are ready.
    ready: usize,
    sender: Sender<Event>,
}

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let slots = arguments.next().and_then(|slots| slots.parse().ok()).filter(|&slots: &usize| slots > 0);
    let slots = slots.ok_or("the first argument has to be the number of slots, from 1")?;
    let own = std::env::current_exe().map_err(|error| error.to_string())?;
    let pdk = arguments.next().map_or_else(|| own.with_file_name("pdk"), |pdk| Path::new(&pdk).to_owned());
    let (sender, events) = mpsc::channel();
    let of_session = sender.clone();
    std::thread::spawn(move || read(std::io::stdin().lock(), None, &of_session));
    let Ok((None, Some(hello))) = events.recv() else {
        return Err("the session did not say hello".to_owned());
    };
    let mut pool = Pool { pdk, hello, workers: Vec::new(), ready: 0, sender };
    for slot in 0..slots {
        let worker = pool.start(slot)?;
        pool.workers.push(worker);
    }
    pool.serve(&events)
}

impl Pool {
    /// Starts the worker of a slot, and hands it the session's hello.
    fn start(&self, slot: usize) -> Result<Worker> {
        let mut command = Command::new(&self.pdk);
        command.arg("worker").stdin(Stdio::piped()).stdout(Stdio::piped());
        let failed = |error| format!("cannot start {} ({error})", self.pdk.display());
        let mut child = command.spawn().map_err(failed)?;
        let (input, output) = (child.stdin.take(), child.stdout.take().ok_or("a worker has no output")?);
        let sender = self.sender.clone();
        std::thread::spawn(move || read(BufReader::new(output), Some(slot), &sender));
        let mut worker = Worker { child, input, job: None };
        worker.tell(&self.hello);
        Ok(worker)
    }

    fn serve(mut self, events: &Receiver<Event>) -> Result<()> {
        let slots = self.workers.len();
        while let Ok(event) = events.recv() {
            match event {
                (None, None) => break,
                (None, Some(line)) => {
                    match json(&line)?.get("job") {
                        Some(job) => {
                            let slot = job["slot"].as_u64().ok_or("the session gave no slot")?;
                            // A session numbers the slots of a pool in a row, from wherever.
                            self.workers[slot as usize % slots].give(line, 1);
                        }
                        // Of a later session: workers know what to do about it.
                        None => self.workers.iter_mut().for_each(|worker| worker.tell(&line)),
                    }
                }
                (Some(slot), Some(line)) => self.hear(slot, &line)?,
                (Some(slot), None) => self.lost(slot)?,
            }
        }
        // Without input they end.
        self.workers.iter_mut().for_each(|worker| worker.input = None);
        self.workers.iter_mut().for_each(|worker| _ = worker.child.wait());
        Ok(())
    }

    fn hear(&mut self, slot: usize, line: &str) -> Result<()> {
        let mut message = json(line)?;
        let mut line = line.to_owned();
        if let Some(slots) = message.pointer_mut("/ready/slots") {
            *slots = self.workers.len().into();
            line = message.to_string();
            self.ready += 1;
            // All of them say the same, and one that was started anew says it again.
            if self.ready != self.workers.len() {
                return Ok(());
            }
        } else if message.get("done").is_some() {
            self.workers[slot].job = None;
        }
        writeln!(std::io::stdout(), "{line}")
            .map_err(|error| format!("the session does not listen ({error})"))
    }

    /// The worker of a slot is gone.
    fn lost(&mut self, slot: usize) -> Result<()> {
        let status = self.workers[slot].child.wait().map_err(|error| error.to_string())?;
        let job = self.workers[slot].job.take();
        if self.ready < self.workers.len() || job.as_ref().is_some_and(|(_, tries)| *tries >= TRIES) {
            return Err(format!("the worker of slot {slot} ended ({status})"));
        }
        self.workers[slot] = self.start(slot)?;
        if let Some((line, tries)) = job {
            self.workers[slot].give(line, tries + 1);
        }
        Ok(())
    }
}

impl Worker {
    /// Writes a line to it. If it is gone, its end is noticed like any other.
    fn tell(&mut self, line: &str) {
        _ = self.input.as_mut().map(|input| writeln!(input, "{line}"));
    }

    fn give(&mut self, line: String, tries: u32) {
        self.tell(&line);
        self.job = Some((line, tries));
    }
}

fn json(line: &str) -> Result<Value> {
    serde_json::from_str(line).map_err(|error| format!("`{line}` is not a message ({error})"))
}

fn read(from: impl BufRead, slot: Option<usize>, events: &Sender<Event>) {
    for line in from.lines().map_while(std::io::Result::ok) {
        _ = events.send((slot, Some(line)));
    }
    _ = events.send((slot, None));
}
