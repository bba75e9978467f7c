//! The process that drives: it loads components and does one job after the other, under the eyes of a worker.
//!
//! Whatever a component does to this process, to its directory, its output or its life, ends with it. The conversation with the
//! worker goes over files that components do not know: what they write to standard output ends up on standard error.

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::sync::{Arc, PoisonError};
use std::time::{Duration, Instant};

use pdk_components::registry::{Registry, Scripts};
use pdk_components::search_path::SearchPath;
use pdk_sdk::error::{Error, Place, Result};
use pdk_supervise::calls;
use pdk_supervise::supervisor::kill_group;

use crate::engine::{BUS_ROOT, Engine};
use crate::environment::Environment;
use crate::lines::{self, Found};
use crate::protocol::{Done, FromWorker, Hello, MINOR, Progress, Ready, ToWorker, VERSION};

/// How long taking leave of the components may take.
const LEAVE: Duration = Duration::from_secs(10);
/// How often progress is reported.
const PROGRESS: Duration = Duration::from_millis(200);

/// Does jobs until there are no more. `scripts` makes components from scripts, which are looked for in these places.
///
/// # Errors
/// If the worker does not speak as it should, or components cannot be looked for.
pub fn run(scripts: impl FnOnce(&SearchPath) -> Box<dyn Scripts>) -> Result<()> {
    let (input, mut output) = take_standard_files().place("cannot set up the files of the worker")?;
    let environment = Environment::this();
    let (sender, messages) = mpsc::channel();
    let busy = Arc::new(AtomicBool::new(false));
    let watching = Arc::clone(&busy);
    let reader = std::thread::Builder::new().name("worker-input".into());
    reader
        .spawn(move || {
            lines::read_all(input, &sender, |found| {
                if matches!(found, Found::End) && watching.load(Ordering::SeqCst) {
                    leave_at_once();
                }
                found
            });
            // The worker needs nothing any more. What does not leave by itself is made to.
            std::thread::sleep(LEAVE);
            leave_at_once();
        })
        .place("cannot start a thread")?;

    let hello = match messages.recv() {
        Ok(Found::Message(ToWorker::Hello(hello))) => hello,
        // The worker was killed before it came to that.
        Ok(Found::End) => return Ok(()),
        _ => {
            return Err(Error::new(
                "the worker's first message is not `hello`; send `hello` first, as docs/worker-protocol.md describes",
            ));
        }
    };
    busy.store(true, Ordering::SeqCst);
    let registry = Registry::discover(&hello.search, scripts(&hello.search));
    busy.store(false, Ordering::SeqCst);
    let registry = match registry {
        Ok(registry) => registry,
        Err(error) => {
            let said = lines::write(&mut output, &FromWorker::Failed(error.message().to_owned()));
            calls::done();
            return said;
        }
    };
    let ready = Ready {
        protocol: VERSION,
        minor: MINOR,
        pdk: env!("CARGO_PKG_VERSION").to_owned(),
        slots: 1,
        catalog: registry.catalog().clone(),
        refused: registry
            .refused()
            .iter()
            .map(ToString::to_string)
            .chain(registry.skipped().to_vec())
            .collect(),
        passed_over: registry.passed_over().to_vec(),
    };
    // If the session is gone, an error cannot be reported to it either: here and below, the end of the input is noticed.
    let _ = lines::write(&mut output, &FromWorker::Ready(ready));
    serve(&registry, &hello, environment, &messages, &busy, &mut output)?;
    // Behind this, ending is what is wanted.
    calls::done();
    Ok(())
}

fn serve(
    registry: &Registry,
    hello: &Hello,
    environment: Environment,
    messages: &mpsc::Receiver<Found<ToWorker>>,
    busy: &AtomicBool,
    output: &mut impl Write,
) -> Result<()> {
    environment.restore();
    let mut engine = Engine::new(registry, hello, environment);
    while let Ok(message) = messages.recv() {
        let job = match message {
            Found::Message(ToWorker::Job(job)) => job,
            Found::Message(ToWorker::Hello(_)) => return Err(Error::new("the worker says `hello` twice")),
            Found::Nonsense(error, _) => {
                return Err(Error::new(format!("the worker says what is not a message ({error})")));
            }
            Found::End => break,
        };
        busy.store(true, Ordering::SeqCst);
        let number = job.number;
        let (mut frames, mut told) = (0, None::<Instant>);
        let answer = engine.work(&job, &mut |more| {
            frames += more;
            // The first frame says that the work has begun. Each later one may come only after a long time, and the session ends a worker
            // that is silent.
            if told.is_none_or(|told| told.elapsed() >= PROGRESS) {
                told = Some(Instant::now());
                let _ = lines::write(output, &FromWorker::Progress(Progress { number, frames }));
                frames = 0;
            }
        });
        if frames > 0 {
            let _ = lines::write(output, &FromWorker::Progress(Progress { number, frames }));
        }
        let _ = lines::write(output, &FromWorker::Done(Done { number, answer }));
        busy.store(false, Ordering::SeqCst);
        if !engine.is_usable() {
            break;
        }
    }
    Ok(())
}

/// Ends this process and all that it started, in the middle of whatever it does: the worker is gone.
fn leave_at_once() {
    let root = BUS_ROOT.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(root) = root {
        // What cannot be removed is swept by the next run.
        let _ = pdk_bus::remove(&root);
    }
    // This process leads its group.
    kill_group(std::process::id());
}

/// Takes standard input and output for the conversation with the worker. In their place there is nothing to read, and what is
/// written goes to standard error.
fn take_standard_files() -> io::Result<(File, File)> {
    let input = File::from(io::stdin().as_fd().try_clone_to_owned()?);
    let output = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    let nothing = File::open("/dev/null")?;
    rustix::stdio::dup2_stdin(&nothing)?;
    rustix::stdio::dup2_stdout(io::stderr().as_fd())?;
    Ok((input, output))
}
