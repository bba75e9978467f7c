//! The simulator of one worker: its port, its process, and the connection to it.

use std::fmt;
use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream, ToSocketAddrs};
use std::time::{Duration, Instant};

use pdk_sdk::prelude::{Error, ErrorKind, Result};

use crate::deadline::Deadline;
use crate::port::Claim;
use crate::process::{Launch, Launched};
use crate::settings::Settings;

/// How often it is looked whether something has come true.
const TICK: Duration = Duration::from_millis(20);
/// How long after the loss of its connection a process that was started here may still be seen to end.
const LAST_MOMENTS: Duration = Duration::from_millis(300);

/// The simulator of one worker.
#[derive(Debug)]
pub struct Station {
    settings: Settings,
    slot: u32,
    port: u16,
    process: Option<Launched>,
    /// Given back after the process has ended.
    _claim: Claim,
}

/// As it is named to users: "the Donkey simulator at 127.0.0.1:9091".
impl fmt::Display for Station {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} at {}:{}", self.settings.title, self.settings.host, self.port)
    }
}

impl Station {
    /// The station of a slot. Nothing is started yet.
    ///
    /// # Errors
    /// If the slot's port belongs to another process of pdk, or there is no such port.
    pub fn new(settings: &Settings, slot: u32) -> Result<Self> {
        let port = settings.port_of(slot)?;
        let claim = Claim::new(&settings.host, port)?;
        Ok(Self { settings: settings.clone(), slot, port, process: None, _claim: claim })
    }

    /// The slot whose simulator this is.
    pub fn slot(&self) -> u32 {
        self.slot
    }

    /// The port of the simulator.
    pub fn port(&self) -> u16 {
        self.port
    }

    /// What the user has set.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Starts the simulator, where `launch` says how; one that has ended is started again, and one that runs goes on.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn launch(&mut self) -> Result<()> {
        if self.settings.launch.is_empty() || self.check().is_ok() && self.process.is_some() {
            return Ok(());
        }
        self.process = None;
        let (port, slot) = (self.port.to_string(), self.slot.to_string());
        let words: Vec<String> = self
            .settings
            .launch
            .iter()
            .map(|word| word.replace("{port}", &port).replace("{slot}", &slot))
            .collect();
        let launch = Launch { what: "simulator", parameter: "launch", words: &words, environment: &[] };
        self.process = Some(Launched::start(&launch)?);
        Ok(())
    }

    /// Says that the simulator has ended, if it was started here and has.
    ///
    /// # Errors
    /// How it ended, and what it wrote last.
    pub fn check(&mut self) -> Result<()> {
        self.process.as_mut().map_or(Ok(()), Launched::check)
    }

    /// An error that came while talking to the simulator; where its process is gone, that is why.
    pub fn blame(&mut self, error: Error) -> Error {
        if error.kind() != ErrorKind::Lost || self.process.is_none() {
            return error;
        }
        // Its connections are closed before its end can be seen.
        let began = Instant::now();
        loop {
            match self.check() {
                Err(ended) => return ended,
                Ok(()) if began.elapsed() > LAST_MOMENTS => return error,
                Ok(()) => std::thread::sleep(TICK),
            }
        }
    }

    /// An error of the first that was asked of whatever listens at the station's port: what does not answer there may not be a simulator
    /// at all.
    pub fn unknown(&self, error: Error) -> Error {
        match error.kind() {
            ErrorKind::Late => Error::of(
                ErrorKind::Late,
                format!("{error}, or correct `port`: another program may listen at {}", self.port),
            ),
            _ => error,
        }
    }

    /// Waits until `poll` has something to give; where the simulator was started here, for no longer than it lives. `what` is what
    /// the simulator has not done where it comes to nothing, as in "loaded the scene".
    ///
    /// # Errors
    /// That of `poll`, or if the simulator ends or the time is over.
    pub fn wait<T>(
        &mut self,
        deadline: &Deadline,
        what: &str,
        mut poll: impl FnMut() -> Result<Option<T>>,
    ) -> Result<T> {
        loop {
            if let Some(found) = poll()? {
                return Ok(found);
            }
            self.check()?;
            let Some(left) = deadline.left() else { return Err(deadline.late(&*self, what)) };
            std::thread::sleep(TICK.min(left));
        }
    }

    /// Starts the simulator if that is to be done, and connects to it as soon as it listens. `offset` is added to the port, for
    /// simulators with several.
    ///
    /// # Errors
    /// If the host is unknown, the simulator ends, or nothing listens before the deadline.
    pub fn connect(&mut self, offset: u16, deadline: &Deadline) -> Result<TcpStream> {
        self.connect_to(self.port.saturating_add(offset), deadline)
    }

    /// The same at a port that the simulator has told.
    ///
    /// # Errors
    /// As [`Station::connect`].
    pub fn connect_to(&mut self, port: u16, deadline: &Deadline) -> Result<TcpStream> {
        self.launch()?;
        let host = self.settings.host.clone();
        let addresses = addresses(&host, port)?;
        let mut refused = String::new();
        let connected = self.wait(deadline, "begun to listen", || {
            for address in &addresses {
                let limit = deadline.left().unwrap_or(TICK).min(Duration::from_secs(1));
                match TcpStream::connect_timeout(address, limit) {
                    // If nothing listens, the system may connect a port of its own choice with itself.
                    Ok(stream) if stream.local_addr().ok() == stream.peer_addr().ok() => {
                        refused = "nothing listens".to_owned()
                    }
                    Ok(stream) => return Ok(Some(stream)),
                    Err(error) => refused = error.to_string(),
                }
            }
            Ok(None)
        });
        connected.map_err(|error| match error.kind() {
            ErrorKind::Late => self.absent(port, &refused, deadline),
            _ => error,
        })
    }

    /// Listens for a simulator that connects to pdk, and starts it if that is to be done. The listener does not block.
    ///
    /// # Errors
    /// If the port is taken, or the simulator cannot be started.
    pub fn listen(&mut self) -> Result<TcpListener> {
        let (host, port) = (&self.settings.host, self.port);
        let addresses = addresses(host, port)?;
        let listener = TcpListener::bind(&addresses[..]).and_then(|listener| {
            listener.set_nonblocking(true)?;
            Ok(listener)
        });
        let listener = listener.map_err(|error| {
            let why = match error.kind() {
                io::ErrorKind::AddrInUse => "another program listens there".to_owned(),
                _ => error.to_string(),
            };
            mistake(format!("cannot listen at {host}:{port}: {why}; end it, or set `port` to another one"))
        })?;
        self.launch()?;
        Ok(listener)
    }

    /// What the user can do about a simulator that has not come and that pdk does not start: `first`, as in "start it, correct `port`", or
    /// what there is to do for a worker that is not the first.
    pub fn remedy(&self, first: &str) -> String {
        match self.slot {
            0 => format!("{first}, or let pdk start it with `launch`"),
            slot => format!(
                "worker {slot} needs a simulator of its own there: start one, let pdk start it with `launch`, or set --workers 1"
            ),
        }
    }

    fn absent(&self, port: u16, refused: &str, deadline: &Deadline) -> Error {
        let Settings { title, host, start, .. } = &self.settings;
        let remedy = match self.process.is_some() {
            true => format!(
                "it was started {:.0} s ago; raise `start_seconds` if it is slow",
                deadline.elapsed().as_secs_f64()
            ),
            false => self.remedy("start it, correct `host` and `port`"),
        };
        Error::of(
            ErrorKind::Lost,
            format!(
                "{title} is not at {host}:{port}: it was tried for {} s ({refused}); {remedy}",
                start.as_secs_f64()
            ),
        )
    }
}

fn addresses(host: &str, port: u16) -> Result<Vec<SocketAddr>> {
    let unknown = |why: String| mistake(format!("the host `{host}` is not known ({why}); correct `host`"));
    let found: Vec<_> = (host, port).to_socket_addrs().map_err(|error| unknown(error.to_string()))?.collect();
    match found.is_empty() {
        true => Err(unknown("it has no address".to_owned())),
        false => Ok(found),
    }
}

/// Something that only the user can correct.
fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(port: u16, launch: &[&str]) -> Settings {
        Settings {
            title: "the test simulator",
            host: "127.0.0.1".to_owned(),
            port,
            port_step: 1,
            launch: launch.iter().map(|&word| word.to_owned()).collect(),
            start: Duration::from_millis(400),
            answer: Duration::from_millis(200),
        }
    }

    /// A port that nothing listens at.
    fn free_port() -> u16 {
        TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port()
    }

    #[test]
    fn a_simulator_that_comes_late_is_waited_for() {
        let settings = settings(free_port(), &[]);
        let port = settings.port;
        let late = std::thread::spawn(move || {
            std::thread::sleep(Duration::from_millis(150));
            TcpListener::bind(("127.0.0.1", port)).unwrap().accept().unwrap()
        });
        let mut station = Station::new(&settings, 0).unwrap();
        station.connect(0, &settings.starting()).unwrap();
        late.join().unwrap();
    }

    #[test]
    fn a_missing_simulator_is_reported_with_the_remedy() {
        let settings = settings(free_port(), &[]);
        let error = Station::new(&settings, 0).unwrap().connect(0, &settings.starting()).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Lost);
        let place = format!("the test simulator is not at 127.0.0.1:{}", settings.port);
        assert!(error.message().starts_with(&place) && error.message().contains("`launch`"), "{error}");
    }

    #[test]
    fn one_that_ends_while_it_starts_is_not_waited_for() {
        let mut settings = settings(free_port(), &["sh", "-c", "echo port {port} slot {slot}; exit 1"]);
        settings.start = Duration::from_secs(60);
        let deadline = settings.starting();
        let error = Station::new(&settings, 0).unwrap().connect(0, &deadline).unwrap_err();
        assert!(deadline.elapsed() < Duration::from_secs(30), "half of what it has to start");
        assert!(error.message().contains(&format!("port {} slot 0", settings.port)), "{error}");
    }

    #[test]
    fn a_port_that_is_taken_is_named() {
        let other = TcpListener::bind("127.0.0.1:0").unwrap();
        let settings = settings(other.local_addr().unwrap().port(), &[]);
        let error = Station::new(&settings, 0).unwrap().listen().unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Configuration);
        assert!(error.message().contains("another program listens there"), "{error}");
    }
}
