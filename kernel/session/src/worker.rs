//! `pdk worker`: does jobs for a session, and answers each one whatever its components do.
//!
//! The worker itself calls no component. It keeps a process that does ([`loop_process`](pdk_loop::loop_process)), sees to it that this
//! process comes back from every call and stays within its memory, and makes an answer of whatever happens to it. Then it starts
//! another one.

use std::io;
use std::process::{ChildStdin, Command, Stdio};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::{Duration, Instant};

use pdk_notice::eprintln;
use pdk_record::trace::writer::part_of;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_supervise::calls::{Function, Seen};
use pdk_supervise::supervisor::{End, LOOK, Limits, Supervised, is_from_outside};

use pdk_loop::lines::{self, Found};
use pdk_loop::protocol::{Answer, Done, Driven, Failure, FromWorker, Hello, Job, ToWorker, VERSION, Work};
use pdk_loop::recorder::write_trace;

/// How often a job is begun whose process is killed from outside, and how often a process is started that is killed before it is ready.
const TRIES: u32 = 3;

/// How long a process may take to leave that has nothing to do any more: less than it gives itself.
const LEAVE: Duration = Duration::from_secs(8);

/// Does jobs until there are no more.
///
/// # Errors
/// If the session does not speak as it should, or no process can be started.
pub fn run() -> Result<()> {
    let (sender, events) = mpsc::channel();
    let from_session = sender.clone();
    std::thread::Builder::new()
        .name("session".into())
        .spawn(move || lines::read_all(io::stdin().lock(), &from_session, Event::Session))
        .place("cannot start a thread")?;
    let Ok(Event::Session(Found::Message(ToWorker::Hello(hello)))) = events.recv() else {
        return Err(Error::new(
            "the session's first message is not `hello`; send `hello` first, as docs/worker-protocol.md describes",
        ));
    };
    if hello.protocol != VERSION {
        let reason = format!(
            "the session speaks version {} of the worker protocol, and this worker version {VERSION}; use the same pdk at both ends",
            hello.protocol
        );
        return lines::write(&mut io::stdout().lock(), &FromWorker::Failed(reason));
    }
    let patience = Duration::try_from_secs_f64(hello.patience)
        .map_err(|_| Error::new(format!("the patience is {} s, but has to be a time", hello.patience)))?;
    let limits = Limits { patience, memory: hello.memory };
    let mut worker = Worker {
        hello,
        limits,
        sender,
        events,
        process: None,
        generation: 0,
        introduced: false,
        job: None,
        tries: 0,
        unheard: false,
        suspect: None,
        left_out: false,
    };
    // The session tells the user. If it is gone, all that is left is to leave.
    if let Err(error) = worker.serve() {
        worker.say(&FromWorker::Failed(error.message().to_owned()));
    }
    worker.leave();
    Ok(())
}

enum Event {
    Session(Found<ToWorker>),
    /// From the process of this generation: what an earlier one said last does not count.
    Process(u64, Found<FromWorker>),
}

struct Worker {
    hello: Hello,
    limits: Limits,
    sender: mpsc::Sender<Event>,
    events: mpsc::Receiver<Event>,
    process: Option<Process>,
    generation: u64,
    /// Whether the session has heard of the components.
    introduced: bool,
    job: Option<Box<Job>>,
    /// How often the job was begun; before there is one, how often a process was killed before it was ready.
    tries: u32,
    /// Whether the session does not listen any more.
    unheard: bool,
    /// How a process ended that had done other jobs before this one.
    suspect: Option<String>,
    /// Whether it was reported that the session says what is not known here.
    left_out: bool,
}

struct Process {
    supervised: Supervised,
    input: ChildStdin,
    /// Since when it is over, although its output is still open.
    over: Option<Instant>,
    /// Whether it has done a job.
    used: bool,
}

impl Worker {
    fn serve(&mut self) -> Result<()> {
        self.start()?;
        let mut looked = Instant::now();
        loop {
            let event = match self.events.recv_timeout(LOOK) {
                Ok(event) => Some(event),
                Err(RecvTimeoutError::Timeout) => None,
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            };
            match event {
                Some(Event::Session(Found::Message(ToWorker::Job(job)))) => {
                    self.tries = 0;
                    self.job = Some(job);
                    self.suspect = None;
                    self.begin()?;
                }
                Some(Event::Session(Found::End)) => return Ok(()),
                Some(Event::Session(Found::Message(ToWorker::Hello(_)))) => {
                    return Err(Error::new("the session says `hello` twice"));
                }
                Some(Event::Session(Found::Nonsense(_, Some(name))))
                    if !ToWorker::NAMES.contains(&&*name) =>
                {
                    if !std::mem::replace(&mut self.left_out, true) {
                        eprintln!(
                            "pdk: warning: the session says `{name}`, which this worker does not know and leaves out"
                        );
                    }
                }
                Some(Event::Session(Found::Nonsense(error, _))) => {
                    return Err(Error::new(format!("the session says what is not a message ({error})")));
                }
                Some(Event::Process(generation, found)) if generation == self.generation => {
                    self.hear(found)?
                }
                Some(Event::Process(..)) | None => {}
            }
            if looked.elapsed() >= LOOK {
                looked = Instant::now();
                self.look()?;
            }
            if self.unheard {
                return Ok(());
            }
        }
    }

    /// Starts a process for components.
    fn start(&mut self) -> Result<()> {
        let executable = std::env::current_exe().place("cannot find the pdk executable")?;
        let mut command = Command::new(executable);
        command.args(["worker", "--components"]).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut supervised =
            Supervised::start(command, self.limits, true).place("cannot start a process for components")?;
        let child = supervised.child();
        let (Some(mut input), Some(output)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(Error::new("a process for components has no input or output"));
        };
        self.generation += 1;
        let (generation, sender) = (self.generation, self.sender.clone());
        std::thread::Builder::new()
            .name("components".into())
            .spawn(move || lines::read_all(output, &sender, |found| Event::Process(generation, found)))
            .place("cannot start a thread")?;
        // If it is gone already, its end is noticed like any other.
        let _ = lines::write(&mut input, &ToWorker::Hello(self.hello.clone()));
        self.process = Some(Process { supervised, input, over: None, used: false });
        Ok(())
    }

    /// Hands the job to the process.
    fn begin(&mut self) -> Result<()> {
        self.tries += 1;
        if self.process.is_none() {
            self.start()?;
        }
        if let (Some(process), Some(job)) = (&mut self.process, &self.job) {
            // As above.
            let _ = lines::write(&mut process.input, &ToWorker::Job(job.clone()));
        }
        Ok(())
    }

    /// Takes what the process says.
    fn hear(&mut self, found: Found<FromWorker>) -> Result<()> {
        match found {
            Found::Message(FromWorker::Ready(ready)) => {
                if !std::mem::replace(&mut self.introduced, true) {
                    self.say(&FromWorker::Ready(ready));
                }
                Ok(())
            }
            Found::Message(FromWorker::Done(done)) => {
                // Whatever its components write there, only the job's own answer counts.
                if self.job.as_ref().is_some_and(|job| job.number == done.number) {
                    // What an earlier job, or another program, did to its topics does not reach a new process. A simulator that is not
                    // to be had has been waited for, and is not there for another process either.
                    // What only the user can change, a new process finds as it is.
                    let used = self.process.as_ref().is_some_and(|process| process.used);
                    let again = matches!(&done.answer, Answer::Broken(failure) if match failure.kind {
                        ErrorKind::Lost | ErrorKind::Late => false,
                        ErrorKind::Configuration => used,
                        _ => true,
                    });
                    if again && self.tries < TRIES {
                        self.end_process();
                        return self.begin();
                    }
                    self.job = None;
                    if let Some(process) = &mut self.process {
                        process.used = true;
                    }
                    // If it went well in a new process, nothing else would tell.
                    if let Some(sentence) = self.suspect.take().filter(|_| done.answer.is_good()) {
                        self.say(&FromWorker::Trouble(sentence));
                    }
                    self.say(&FromWorker::Done(done));
                }
                Ok(())
            }
            Found::Message(FromWorker::Failed(reason)) => Err(Error::new(reason)),
            Found::Message(FromWorker::Trouble(_)) => Ok(()),
            Found::Message(progress @ FromWorker::Progress(_)) => {
                self.say(&progress);
                Ok(())
            }
            // It may have been the answer to the job, which is not said again.
            Found::Nonsense(why, _) => {
                if let Some(process) = &mut self.process {
                    process.supervised.kill();
                }
                self.ended(&End::Unreadable(why))
            }
            Found::End => {
                let end = match &mut self.process {
                    // It may have closed its output and go on; without it, it is of no use.
                    Some(process) => wait_or_kill(&mut process.supervised)?,
                    None => return Ok(()),
                };
                self.ended(&end)
            }
        }
    }

    /// Looks after the process.
    fn look(&mut self) -> Result<()> {
        let Some(process) = &mut self.process else { return Ok(()) };
        let Some(end) = process.supervised.look().place("cannot look after the process of the components")?
        else {
            return Ok(());
        };
        if let End::Done(_) | End::Exited(_) | End::Signal(_) = end {
            // What it said last may still be on its way, and tells more than its end; but a process that it started may hold its
            // output open for ever.
            let since = *process.over.get_or_insert_with(Instant::now);
            if since.elapsed() < Duration::from_secs(1) {
                return Ok(());
            }
        }
        self.ended(&end)
    }

    /// The process is over.
    fn ended(&mut self, end: &End) -> Result<()> {
        let Some(process) = &self.process else { return Ok(()) };
        let (calls, used) = (process.supervised.calls(), process.used);
        self.end_process();
        let Some(job) = &self.job else {
            self.tries += 1;
            if used && !is_blameless(end) && !calls.is_empty() {
                let sentence = self.sentence(end, &calls);
                self.say(&FromWorker::Trouble(sentence));
            }
            // No one is waiting for it, or it was killed while it started.
            return match self.introduced || is_blameless(end) && self.tries < TRIES {
                true => self.start(),
                false => Err(Error::of(end.kind(), self.sentence(end, &calls))),
            };
        };
        // A kill comes from outside, as a rule; and a process whose standard files a component has closed leaves by itself after
        // its job, maybe just when it was given another one.
        let blameless = is_blameless(end) && self.tries < TRIES;
        // If no component was called, shared memory may have been changed, such as that of the topics.
        let unexplained = calls.is_empty()
            && matches!(end, End::Signal(_) | End::Exited(_) | End::Silent | End::Unreadable(_))
            && self.tries < TRIES;
        // What is left of an earlier job may be to blame: memory that was overwritten or is missing, an instance that crashes when it
        // is dropped. So that an outcome does not depend on what came before, only a new process is believed.
        // What a strategy has learnt is gone with its process, so nothing is to be had from a new one.
        let goes_on = matches!(&job.work, Work::Search(step) if step.start.is_none());
        if (blameless || unexplained || used) && !goes_on {
            if unexplained && !blameless {
                let said = end.said(&[]).replacen("a component", "a process", 1);
                eprintln!(
                    "pdk: warning: {said} outside of any component; what it was driving is driven again"
                );
            } else if !blameless {
                self.suspect = Some(self.sentence(end, &calls));
            }
            self.start()?;
            return self.begin();
        }
        let answer = self.answer(job, end, &calls);
        let done = Done { number: job.number, answer };
        self.job = None;
        self.say(&FromWorker::Done(done));
        self.start()
    }

    /// Ends the process and removes what it had in shared memory and what it has written of a trace.
    fn end_process(&mut self) {
        let Some(mut process) = self.process.take() else { return };
        process.supervised.kill();
        self.remove_part(process.supervised.child().id());
        self.generation += 1;
        // Components may have topics of their own, which are not those of the run.
        let _ = pdk_bus::sweep();
    }

    fn sentence(&self, end: &End, calls: &[Seen]) -> String {
        let remedy = match end {
            End::Late(..) => " (the limit is raised with --set patience=SECONDS)",
            End::Memory(_) => " (the limit is raised with --set memory=MIB)",
            End::Signal(libc::SIGKILL) => " (killed from outside, or because memory ran out)",
            End::Signal(signal) if is_from_outside(*signal) => " (from outside)",
            End::Done(_) | End::Exited(_) => {
                " (a component has to return an error instead of ending its process)"
            }
            End::Silent => " (a component must not close files that it has not opened)",
            End::Signal(_) | End::Unreadable(_) => "",
        };
        end.said(calls) + remedy
    }

    /// What becomes of a job whose process came to this end.
    fn answer(&self, job: &Job, end: &End, calls: &[Seen]) -> Answer {
        let (kind, message) = (end.kind(), self.sentence(end, calls));
        let at = calls.iter().find_map(|call| call.frame);
        let Work::Drive(drive) = &job.work else {
            let by_driver = calls
                .iter()
                .any(|call| matches!(call.function, Function::Drive | Function::Predict | Function::Reset));
            return Answer::Failed(Failure { at, by_driver, ..Error::of(kind, message).into() });
        };
        let frames = at.unwrap_or_default();
        match write_trace(drive, &job.id(drive), &message) {
            Ok(()) => Answer::Driven(Driven::lost(kind, message, frames)),
            Err(error) => Answer::Broken(error.into()),
        }
    }

    /// Removes what a process has written of the job's trace.
    fn remove_part(&self, process: u32) {
        if let Some(Work::Drive(drive)) = self.job.as_ref().map(|job| &job.work)
            && let Some(trace) = &drive.trace
        {
            // There may be none.
            let _ = std::fs::remove_file(part_of(trace, process));
        }
    }

    fn say(&mut self, message: &FromWorker) {
        self.unheard |= lines::write(&mut io::stdout().lock(), message).is_err();
    }

    /// The session is gone, or needs no more.
    fn leave(&mut self) {
        let Some(process) = self.process.take() else { return };
        let Process { mut supervised, input, .. } = process;
        drop(input);
        let started = Instant::now();
        // In the middle of a job it ends at once; else it takes leave of its components, which takes some time.
        let limit = if self.job.is_some() { Duration::from_secs(1) } else { LEAVE };
        let end = loop {
            match supervised.look() {
                Ok(None) if started.elapsed() < limit => std::thread::sleep(Duration::from_millis(1)),
                Ok(None) => {
                    // One that still loads, on a machine that is busy, has computed nothing that could be wrong.
                    let call =
                        supervised.calls().into_iter().find(|call| !matches!(call.function, Function::Load));
                    break call.map(|call| End::Late(call, limit));
                }
                end => break end.unwrap_or(None),
            }
        };
        let calls = supervised.calls();
        supervised.kill();
        if let Some(end) = end.filter(|end| self.job.is_none() && !is_blameless(end) && !calls.is_empty()) {
            let sentence = match end {
                // Here it is another limit.
                End::Late(..) => end.said(&calls),
                _ => self.sentence(&end, &calls),
            };
            self.say(&FromWorker::Trouble(sentence));
        }
        self.remove_part(supervised.child().id());
        // As above.
        let _ = pdk_bus::sweep();
    }
}

/// Whether a process came to its end without a component's doing.
fn is_blameless(end: &End) -> bool {
    match end {
        End::Done(_) => true,
        End::Signal(signal) => is_from_outside(*signal),
        End::Exited(_) | End::Silent | End::Late(..) | End::Memory(_) | End::Unreadable(_) => false,
    }
}

/// How a process ended whose output is closed; where it goes on all the same, it is ended.
fn wait_or_kill(supervised: &mut Supervised) -> Result<End> {
    let started = Instant::now();
    loop {
        match supervised.look().place("cannot look after the process of the components")? {
            Some(end) => return Ok(end),
            None if started.elapsed() > Duration::from_secs(1) => {
                supervised.kill();
                return Ok(End::Silent);
            }
            None => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_process_that_closes_its_output_and_goes_on_is_ended_and_called_that() {
        let mut command = Command::new("sleep");
        command.arg("1000");
        let mut process = Supervised::start(command, Limits::default(), true).unwrap();
        let end = wait_or_kill(&mut process).unwrap();
        assert_eq!(end.said(&[]), "a component closed the output of the process and did not end it");
    }
}
