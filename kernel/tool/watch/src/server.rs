//! Addresses, and what is answered to them. Nothing of an address becomes a path: it names one of a few things, with numbers.

use std::fmt::Write as _;
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use oxhttp::model::header::ETAG;
use oxhttp::model::{Body, HeaderValue, Method, Request, Response, StatusCode};
use pdk_sdk::error::{Error, Place, Result};
use rustix::rand::{GetRandomFlags, getrandom};
use serde_json::json;

use crate::live::{self, Live};
use crate::query::Query;
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

/// What is said of an address at which there is nothing.
const NOTHING: &str = "there is nothing at this address";

type Content = (&'static str, Vec<u8>);

fn answer(watched: &Watched, request: &Request<Body>) -> Response<Body> {
    let path = request.uri().path().trim_start_matches('/');
    let (given, rest) = path.split_once('/').unwrap_or((path, ""));
    if !is_same(given, &watched.token) {
        return plain(StatusCode::FORBIDDEN, "this address has no valid token");
    }
    if request.method() != Method::GET {
        let mut response = plain(StatusCode::METHOD_NOT_ALLOWED, "only GET is served");
        response.headers_mut().insert("allow", HeaderValue::from_static("GET"));
        return response;
    }
    let query = Query::parse(request.uri().query().unwrap_or(""));
    if let Some(topic) = rest.strip_prefix("frame/") {
        let has = request.headers().get("if-none-match").and_then(|tag| tag.to_str().ok());
        return frame(watched, topic, query, has);
    }
    match content(watched, rest, query) {
        Ok(Some((kind, bytes))) => response(StatusCode::OK, kind, bytes),
        Ok(None) => plain(StatusCode::NOT_FOUND, NOTHING),
        Err(error) => plain(StatusCode::INTERNAL_SERVER_ERROR, error.message()),
    }
}

/// The newest frame of the drive under way, unless it is the one that the browser has.
fn frame(watched: &Watched, topic: &str, query: Query, has: Option<&str>) -> Response<Body> {
    let perturbed = match topic {
        "raw" => false,
        "perturbed" => true,
        _ => return plain(StatusCode::NOT_FOUND, NOTHING),
    };
    let mut live = watched.live.lock().unwrap_or_else(PoisonError::into_inner);
    let found = live.look(query.slot).and_then(|()| match live.tag(perturbed) {
        Some(tag) if has == Some(&tag) => Ok(response(StatusCode::NOT_MODIFIED, "image/bmp", Vec::new())),
        Some(tag) => {
            let mut response =
                response(StatusCode::OK, "image/bmp", live.frame(perturbed)?.unwrap_or_default());
            response.headers_mut().extend(HeaderValue::from_str(&tag).map(|tag| (ETAG, tag)));
            Ok(response)
        }
        None => Ok(plain(StatusCode::NOT_FOUND, NOTHING)),
    });
    found.unwrap_or_else(|error| plain(StatusCode::INTERNAL_SERVER_ERROR, error.message()))
}

fn content(watched: &Watched, path: &str, query: Query) -> Result<Option<Content>> {
    let parts: Vec<&str> = path.split('/').collect();
    let recorded = || watched.recorded.lock().unwrap_or_else(PoisonError::into_inner);
    let live = || watched.live.lock().unwrap_or_else(PoisonError::into_inner);
    let number = |text: &str| text.parse::<u64>().ok();
    let json = |value: serde_json::Value| ("application/json", value.to_string().into_bytes());
    let jpeg = |bytes| ("image/jpeg", bytes);
    Ok(match parts[..] {
        [""] => Some(("text/html; charset=utf-8", PAGE.into())),
        ["style.css"] => {
            Some(("text/css; charset=utf-8", format!("{}\n{STYLE}", pdk_report::style()?).into_bytes()))
        }
        ["page.js"] => Some(("text/javascript; charset=utf-8", SCRIPT.into())),
        ["status.json"] => {
            let driven = {
                let mut live = live();
                live.look(query.slot)?;
                (live.is_under_way(), live.told(query.drive))
            };
            let mut recorded = recorded();
            let progress = recorded.progress();
            let status = json!({
                "title": recorded.title, "record": recorded.folder(), "under_way": driven.0 || progress.is_some(),
                "progress": progress, "live": driven.1, "scenarios": recorded.rows(query.rows)?,
            });
            Some(json(status))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recorded::tests::record;

    fn watched(folder: &Path) -> Watched {
        Watched {
            token: "0123".to_owned(),
            live: Mutex::new(Live::new(folder.to_owned())),
            recorded: Mutex::new(record(folder)),
        }
    }

    fn ask(watched: &Watched, method: Method, address: &str) -> (u16, String) {
        let request = Request::builder().method(method).uri(format!("http://x{address}"));
        let response = answer(watched, &request.body(Body::empty()).unwrap());
        let status = response.status().as_u16();
        (status, response.into_body().to_string().unwrap())
    }

    #[test]
    fn an_address_needs_the_token_and_names_one_of_a_few_things() {
        let folder = tempfile::tempdir().unwrap();
        let watched = watched(folder.path());
        let get = |address: &str| ask(&watched, Method::GET, address).0;
        for address in ["/", "/status.json", "/012/", "/01234/", "/0124/status.json"] {
            assert_eq!(get(address), 403, "{address}");
        }
        for address in ["/0123/", "/0123/page.js", "/0123/style.css", "/0123/status.json"] {
            assert_eq!(get(address), 200, "{address}");
        }
        for address in [
            "/0123/manifest.json",
            "/0123/../manifest.json",
            "/0123/clips/../manifest.json",
            "/0123/clips/scenario-0.mp4",
            "/0123/scenario/0",
            "/0123/scenario/0/raw/x",
            "/0123/frame/raw",
            "/0123/frame/other",
        ] {
            assert_eq!(get(address), 404, "{address}");
        }
        assert_eq!(ask(&watched, Method::POST, "/0123/").0, 405);
    }

    #[test]
    fn the_status_is_that_of_the_record() {
        let folder = tempfile::tempdir().unwrap();
        let watched = watched(folder.path());
        let (_, text) = ask(&watched, Method::GET, "/0123/status.json?rows=0-0&drive=1-2");
        let status: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!((&status["title"], &status["under_way"]), (&json!("drives"), &json!(false)));
        assert_eq!(status["scenarios"], json!({ "generation": 0, "from": 0, "rows": [], "clips": [] }));
    }

    #[test]
    fn tokens_are_random_and_compared_whole() {
        let (one, two) = (token().unwrap(), token().unwrap());
        assert!(one.len() == 32 && one != two);
        assert!(
            is_same(&one, &one) && !is_same(&one, &two) && !is_same(&one[..31], &one) && !is_same("", &one)
        );
    }
}
