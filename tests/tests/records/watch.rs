//! A run in the browser: `pdk watch` over plain TCP, while the run goes on and afterwards; and `pdk tap`.

use std::fs;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::Child;
use std::time::Instant;

use pdk_tests::process::{LIMIT, pipeline};
use pdk_tests::{Pdk, temp};
use serde_json::Value;

/// A `pdk watch`, which ends when it is dropped.
struct Watch {
    child: Child,
    host: String,
    token: String,
}

impl Watch {
    fn start(record: &Path) -> Self {
        let mut child = Pdk::new(["watch", "--wait", "300"]).arg(record).spawn();
        let mut line = String::new();
        BufReader::new(child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let address = line.trim().strip_prefix("Watch: http://").unwrap_or_else(|| panic!("{line}"));
        let (host, token) = address.split_once('/').unwrap();
        assert!(host.starts_with("127.0.0.1:"), "{host}");
        let (host, token) = (host.to_owned(), token.trim_end_matches('/').to_owned());
        Self { child, host, token }
    }

    /// The status and the content of an answer.
    fn ask(&self, method: &str, path: &str) -> (u16, Vec<u8>) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        write!(stream, "{method} {path} HTTP/1.1\r\nhost: {}\r\nconnection: close\r\n\r\n", self.host)
            .unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let end = answer.windows(4).position(|four| four == b"\r\n\r\n").unwrap();
        let head = String::from_utf8(answer[..end].to_vec()).unwrap();
        (head.split(' ').nth(1).unwrap().parse().unwrap(), answer[end + 4..].to_vec())
    }

    /// The status of an answer to a browser that has what this tag stands for, and the tag of what came.
    fn tagged(&self, path: &str, tag: &str) -> (u16, Option<String>) {
        let mut stream = TcpStream::connect(&self.host).unwrap();
        let head = format!("host: {}\r\nif-none-match: {tag}\r\nconnection: close", self.host);
        write!(stream, "GET /{}/{path} HTTP/1.1\r\n{head}\r\n\r\n", self.token).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        let head = String::from_utf8_lossy(&answer[..answer.len().min(2000)]).into_owned();
        let tag = head.lines().find_map(|line| line.strip_prefix("etag: ")).map(str::to_owned);
        (head.split(' ').nth(1).unwrap().parse().unwrap(), tag)
    }

    fn get(&self, path: &str) -> (u16, Vec<u8>) {
        self.ask("GET", &format!("/{}/{path}", self.token))
    }

    fn json(&self, path: &str) -> Value {
        let (status, content) = self.get(path);
        assert_eq!(status, 200, "{path}: {}", String::from_utf8_lossy(&content));
        serde_json::from_slice(&content).unwrap()
    }

    /// The status, once something holds of it.
    fn wait_for(&self, what: &str, holds: impl Fn(&Value) -> bool) -> Value {
        let started = Instant::now();
        loop {
            let status = self.json("status.json");
            if holds(&status) {
                return status;
            }
            assert!(started.elapsed() < LIMIT, "{what} did not come: {status}");
        }
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        let _ = self.child.kill().and_then(|()| self.child.wait());
    }
}

/// Enough drives to be watched, one of which fails.
const SOURCE: &str = r#"
    local scenarios = { { perturbations = { "translate_image@4" } } }
    for index = 1, 400 do
        table.insert(scenarios, { seed = index })
    end
    for _, scenario in scenarios do
        scenario.road = { angles = { 0, 10, 10, 10 }, segment = 15 }
    end
    pdk.drive({ simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "lane_keeper", duration = 20, scenarios = scenarios })
"#;

#[test]
fn a_run_is_watched_while_it_goes_on_and_afterwards() {
    let folder = temp();
    let record = folder.path().join("record");
    let run = Pdk::new(["run", "--workers", "1", "--out"]).arg(&record).arg(pipeline(folder.path(), SOURCE));
    let mut run = run.spawn();
    // The run may begin later.
    let watch = Watch::start(&record);
    let status = watch.wait_for("a drive", |status| {
        status["live"]["points"].as_array().is_some_and(|points| points.len() > 1)
            && status["live"]["name"].is_string()
            && status["progress"]["of"].as_u64().is_some_and(|frames| frames > 0)
    });
    assert_eq!(status["under_way"], true);
    assert_eq!(status["progress"]["scenarios"], 401);
    assert!(status["live"]["road"].as_array().is_some_and(|road| road.len() > 2), "{status}");
    for topic in ["raw", "perturbed"] {
        let (code, frame) = watch.get(&format!("frame/{topic}"));
        assert_eq!((code, &frame[..2]), (200, &b"BM"[..]));
        // A frame that the browser has is not sent again. The drive may have gone on in between.
        let again = (0..200).any(|_| {
            let (_, tag) = watch.tagged(&format!("frame/{topic}"), "none");
            watch.tagged(&format!("frame/{topic}"), &tag.unwrap()).0 == 304
        });
        assert!(again, "{topic}");
        assert!(frame.len() >= 80 * 60 * 3, "{}", frame.len());
    }
    for (path, beginning) in [("", "<!doctype html>"), ("page.js", "\"use strict\""), ("style.css", ":root")]
    {
        let (code, content) = watch.get(path);
        assert_eq!(code, 200, "{path}");
        assert!(String::from_utf8(content).unwrap().starts_with(beginning), "{path}");
    }
    // Other tests have runs under way, too.
    let listed: Value =
        serde_json::from_str(&Pdk::new(["tap", "--list", "--json"]).succeed().stdout).unwrap();
    let drives_for = |slot: &&Value| {
        let announced = fs::read_to_string(Path::new(slot["root"].as_str().unwrap()).join("scenario"));
        announced.is_ok_and(|text| text.contains(record.to_str().unwrap()))
    };
    let own = listed.as_array().unwrap().iter().find(drives_for).expect("the run is listed");
    let id = own["run"].as_str().unwrap();
    let tapped = Pdk::new(["tap", "state", "--run", id, "--count", "3", "--json"]).succeed().stdout;
    assert_eq!(tapped.lines().count(), 3, "{tapped}");

    // A browser that does not read holds nothing up.
    let mut slow = TcpStream::connect(&watch.host).unwrap();
    write!(slow, "GET /{}/frame/raw HTTP/1.1\r\nhost: x\r\n\r\n", watch.token).unwrap();
    let done = |status: &Value| status["scenarios"]["rows"].as_array().unwrap().len();
    let before = done(&status);
    watch.wait_for("another scenario", |status| done(status) > before);
    run.kill().unwrap();
    run.wait().unwrap();

    let status = watch.wait_for("the end", |status| status["under_way"] == false);
    assert_eq!(status["scenarios"]["rows"][0]["failed"], true, "{status}");
    // Whoever has all rows gets none again.
    let (generation, count) = (&status["scenarios"]["generation"], done(&status));
    let again = watch.json(&format!("status.json?rows={generation}-{count}"));
    assert_eq!((&again["scenarios"]["from"], done(&again)), (&count.into(), 0), "{again}");
    let scenario = watch.json("scenario/0");
    assert!(
        scenario["points"].as_array().unwrap().len() > 2 && !scenario["road"].as_array().unwrap().is_empty()
    );
    let (code, image) = watch.get(&format!("scenario/0/perturbed/{}", scenario["images"][0][0]));
    assert_eq!((code, &image[..2]), (200, &[0xff, 0xd8][..]));
    assert_eq!(watch.get("report.html").0, 200);
    for path in [
        "manifest.json",
        "../manifest.json",
        "clips/../manifest.json",
        "scenario/99999",
        "clips/scenario-0.mp4",
    ] {
        assert_eq!(watch.get(path).0, 404, "{path}");
    }
    for path in ["/", "/status.json", "/0123456789abcdef0123456789abcdef/status.json"] {
        assert_eq!(watch.ask("GET", path).0, 403, "{path}");
    }
    assert_eq!(watch.ask("POST", &format!("/{}/", watch.token)).0, 405);
    let port = watch.host.rsplit(':').next().unwrap();
    Pdk::new(["watch", "--port", port]).arg(&record).fail(1, &[&format!("cannot listen on port {port}")]);
}

#[test]
fn what_holds_no_record_is_not_watched() {
    let folder = temp();
    Pdk::new(["watch"]).arg(folder.path()).fail(1, &["holds no record: it has no manifest.json"]);
}
