//! Addresses, and what is answered to them. Nothing of an address becomes a path: it names one of a few things, with numbers.

use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use oxhttp::model::{Body, Method, Request, Response, StatusCode};
use pdk_sdk::error::{Error, Place, Result};
use rustix::rand::{GetRandomFlags, getrandom};
use serde_json::json;

use crate::live::{self, Live};
use crate::recorded::Recorded;

/// How long a browser may take to send a request or to take an answer.
const PATIENCE: Duration = Duration::from_secs(20);
/// How often controls and states are taken while a browser asks.
const SAMPLE: Duration = Duration::from_millis(100);
/// Browsers and their connections at the same time.
const CONNECTIONS: usize = 64;

const PAGE: &str = include_str!("template/page.html");
const STYLE: &str = include_str!("template/style.css");
const SCRIPT: &str = include_str!("template/page.js");

/// A running server.
pub struct Server {
    /// The address for the browser, with the token.
    pub address: String,
    /// The record that is watched.
    pub record: PathBuf,
}

/// What requests work on.
struct Watched {
    token: String,
    live: Mutex<Live>,
    recorded: Mutex<Recorded>,
}

/// The record of the run that started last of those under way; none if no run is.
///
/// # Errors
/// If runs cannot be listed.
pub fn latest() -> Result<Option<PathBuf>> {
    live::latest()
}

/// Serves a record on the loopback interface, as long as the process lives; `port` 0 takes a free one.
///
/// # Errors
/// If the folder holds no record, or the port cannot be had.
pub fn start(record: &Path, port: u16) -> Result<Server> {
    let recorded = Recorded::open(record)?;
    let absolute = std::fs::canonicalize(record).place(record.display())?;
    let taken = |error: std::io::Error| {
        Error::new(format!("cannot listen on port {port} ({error}); choose another with --port"))
    };
    let free = || TcpListener::bind((Ipv4Addr::LOCALHOST, port)).and_then(|listener| listener.local_addr());
    let address: SocketAddr = free().map_err(taken)?;
    let token = token()?;
    let watched = Arc::new(Watched {
        token: token.clone(),
        live: Mutex::new(Live::new(absolute)),
        recorded: Mutex::new(recorded),
    });
    let sampled = Arc::downgrade(&watched);
    std::thread::Builder::new()
        .name("sampler".into())
        .spawn(move || {
            while let Some(watched) = sampled.upgrade() {
                watched.live.lock().unwrap_or_else(PoisonError::into_inner).sample();
                drop(watched);
                std::thread::sleep(SAMPLE);
            }
        })
        .place("cannot start a thread")?;
    oxhttp::Server::new(move |request| answer(&watched, request))
        .bind(address)
        .with_global_timeout(PATIENCE)
        .with_max_concurrent_connections(CONNECTIONS)
        .spawn()
        .map_err(taken)?;
    Ok(Server { address: format!("http://{address}/{token}/"), record: record.to_owned() })
}

/// 128 random bits in hexadecimal.
fn token() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom(&mut bytes, GetRandomFlags::empty())
        .map_err(std::io::Error::from)
        .place("cannot draw a token")?;
    let mut token = String::new();
    for byte in bytes {
        let _ = write!(token, "{byte:02x}");
    }
    Ok(token)
}

/// Whether a token is the right one, in a time that does not tell how much of it is.
fn is_same(given: &str, token: &str) -> bool {
    let differing = given.bytes().zip(token.bytes()).fold(0, |all, (a, b)| all | (a ^ b));
    given.len() == token.len() && differing == 0
}

type Content = (&'static str, Vec<u8>);

fn answer(watched: &Watched, request: &Request<Body>) -> Response<Body> {
    let path = request.uri().path().trim_start_matches('/');
    let (given, rest) = path.split_once('/').unwrap_or((path, ""));
    if !is_same(given, &watched.token) {
        return plain(StatusCode::FORBIDDEN, "this address has no valid token");
    }
    if request.method() != Method::GET {
        let mut response = plain(StatusCode::METHOD_NOT_ALLOWED, "only GET is served");
        response.headers_mut().insert("allow", oxhttp::model::HeaderValue::from_static("GET"));
        return response;
    }
    match content(watched, rest, request.uri().query().unwrap_or("")) {
        Ok(Some((kind, bytes))) => response(StatusCode::OK, kind, bytes),
        Ok(None) => plain(StatusCode::NOT_FOUND, "there is nothing at this address"),
        Err(error) => plain(StatusCode::INTERNAL_SERVER_ERROR, error.message()),
    }
}

fn content(watched: &Watched, path: &str, query: &str) -> Result<Option<Content>> {
    let parts: Vec<&str> = path.split('/').collect();
    let recorded = || watched.recorded.lock().unwrap_or_else(PoisonError::into_inner);
    let live = || watched.live.lock().unwrap_or_else(PoisonError::into_inner);
    let number = |text: &str| text.parse::<u64>().ok();
    let json = |value: serde_json::Value| ("application/json", value.to_string().into_bytes());
    let jpeg = |bytes| ("image/jpeg", bytes);
    let slot = query.split('&').find_map(|pair| pair.strip_prefix("slot=")?.parse().ok());
    Ok(match parts[..] {
        [""] => Some(("text/html; charset=utf-8", PAGE.into())),
        ["style.css"] => {
            Some(("text/css; charset=utf-8", format!("{}\n{STYLE}", pdk_report::style()?).into_bytes()))
        }
        ["page.js"] => Some(("text/javascript; charset=utf-8", SCRIPT.into())),
        ["status.json"] => {
            let driven = {
                let mut live = live();
                live.look(slot)?;
                (live.is_under_way(), live.told())
            };
            let mut recorded = recorded();
            let progress = recorded.progress();
            let status = json!({
                "title": recorded.title, "record": recorded.folder(), "under_way": driven.0 || progress.is_some(),
                "progress": progress, "live": driven.1, "scenarios": recorded.rows()?,
            });
            Some(json(status))
        }
        ["frame", topic @ ("raw" | "perturbed")] => {
            let mut live = live();
            live.look(slot)?;
            live.frame(topic == "perturbed")?.map(|bytes| ("image/bmp", bytes))
        }
        ["scenario", scenario] => match number(scenario) {
            Some(scenario) => recorded().scenario(scenario)?.map(json),
            None => None,
        },
        ["scenario", scenario, topic @ ("raw" | "perturbed"), frame] => {
            match (number(scenario), number(frame)) {
                (Some(scenario), Some(frame)) => {
                    recorded().image(scenario, frame, topic == "perturbed")?.map(jpeg)
                }
                _ => None,
            }
        }
        ["clips", name] => {
            let scenario = name.strip_prefix("scenario-").and_then(|name| number(name.strip_suffix(".mp4")?));
            match scenario {
                Some(scenario) => recorded().clip(scenario)?.map(|bytes| ("video/mp4", bytes)),
                None => None,
            }
        }
        ["report.html"] => Some(("text/html; charset=utf-8", recorded().report()?.into_bytes())),
        _ => None,
    })
}

fn plain(status: StatusCode, text: &str) -> Response<Body> {
    response(status, "text/plain; charset=utf-8", format!("{text}\n").into_bytes())
}

fn response(status: StatusCode, kind: &'static str, bytes: Vec<u8>) -> Response<Body> {
    use oxhttp::model::HeaderValue;
    let mut response = Response::new(Body::from(bytes));
    *response.status_mut() = status;
    let headers = [
        ("content-type", kind),
        ("cache-control", "no-store"),
        ("referrer-policy", "no-referrer"),
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "SAMEORIGIN"),
        // Style and script of the report are part of its page.
        (
            "content-security-policy",
            "default-src 'none'; img-src 'self' data:; media-src 'self'; connect-src 'self'; style-src 'self' 'unsafe-inline'; \
             script-src 'self' 'unsafe-inline'; base-uri 'none'; form-action 'none'",
        ),
    ];
    for (name, value) in headers {
        response.headers_mut().insert(name, HeaderValue::from_static(value));
    }
    response
}
