//! The Udacity simulator over its wire, and everything that can go wrong.
//!
//! The stand-in is the embedded simulator as a client of the Unity library's kind. `PDK_SHOW=1` prints what each fault came to.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::sync::mpsc;
use std::time::Duration;

use pdk_tests::process::{LIMIT, pipeline};
use pdk_tests::processes::comes_true;
use pdk_tests::records::partial;
use pdk_tests::stand_in::{StandIn, free_ports};
use pdk_tests::tried::{self, Tried};
use pdk_tests::{Pdk, pictures, real_data, temp};
use serde_json::{Value, json};

/// Scenarios with the driver `lane_keeper`.
const SOURCE: &str = r#"
    local settings = pdk.settings({ simulator = { name = "udacity" }, scenarios = 2, duration = 3, roads = true })
    local scenarios = {}
    for number = 1, settings.scenarios do
        local road = if settings.roads then { angles = { 0, number, 0 } } else nil
        table.insert(scenarios, {
            name = `drive {number}`, ["repeat"] = number, road = road,
            perturbations = if number == 2 then { "gaussian_noise@1" } else nil,
        })
    end
    pdk.show(pdk.drive({
        simulator = settings.simulator, driver = "lane_keeper", duration = settings.duration, scenarios = scenarios,
    }))
"#;

fn simulator(port: u16) -> Value {
    json!({
        "name": "udacity", "port": port, "rate": 40, "settle_seconds": 0, "start_seconds": 40, "answer_seconds": 15
    })
}

#[track_caller]
fn run(simulator: &Value, more: &[(&str, &str)]) -> Tried {
    let simulator = simulator.to_string();
    tried::run(SOURCE, &[&[("simulator", simulator.as_str())], more].concat())
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn roads_are_driven() {
    for numbers in ["plain", "german"] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("udacity", port, &["--rate", "40", "--numbers", numbers]);
        let run = run(&simulator(port), &[("duration", "4")]);
        run.says(0, &[]);
        for line in &run.lines {
            assert_eq!(line["cause"], "time_out", "{numbers}: {line}");
            assert!(line["max_cross_track_error"].as_f64().unwrap() < 1.0, "{numbers}: {line}");
            // It has come away from the start, however busy the machine was.
            assert!(line["progress"].as_f64().unwrap() > 0.0, "{numbers}: {line}");
            assert!(line["frames"].as_u64().unwrap() > 2, "{numbers}: {line}");
        }
        assert_ne!(run.lines[0]["digest"], run.lines[1]["digest"]);
    }
}

/// The stock build answers each command once, begins with two answers, and knows no road.
#[test]
#[ignore = "long: .ci/run runs it"]
fn the_stock_build_is_driven() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("udacity", port, &["--build", "stock"]);
    let mut simulator = simulator(port);
    simulator["build"] = json!("stock");
    let run = run(&simulator, &[("roads", "false")]);
    run.says(0, &[]);
    assert_eq!(run.causes(), ["time_out"; 2]);
    assert!(run.lines.iter().all(|line| line["frames"].as_u64().unwrap() > 2), "{:?}", run.lines);

    let run = self::run(&simulator, &[("scenarios", "1")]);
    run.says(1, &["takes no roads", "build=road_generating"]);
}

#[test]
fn the_other_build_is_named() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("udacity", port, &["--build", "stock"]);
    let run = run(&simulator(port), &[]);
    run.says(1, &["does not report roads, so it is the stock build; set build=stock"]);
    // It says nothing about a scenario.
    assert!(run.lines.is_empty(), "{:?}", run.lines);
}

/// What passes while the simulator stands still is not driving time.
#[test]
#[ignore = "long: .ci/run runs it"]
fn a_simulator_that_stalls_makes_no_driver_late() {
    let port = free_ports(1);
    let frozen = ["--rate", "40", "--fault", "freeze:6", "--at", "10", "--times", "2"];
    let _stand_in = StandIn::start("udacity", port, &frozen);
    let run = run(&simulator(port), &[("duration", "2")]);
    run.says(0, &[]);
    assert_eq!(run.causes(), ["time_out"; 2]);
    // Two seconds of driving each, and six of standing still, of which a third of a second counts.
    assert!(run.took.as_secs_f64() > 2.0 * (2.0 + 6.0 - 0.4), "{:?}", run.took);
}

/// Clients of Socket.IO poll first, unless they are told otherwise.
#[test]
fn clients_that_poll_first_are_driven() {
    for version in ["3", "4"] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("udacity", port, &["--rate", "40", "--polls", version]);
        let run = run(&simulator(port), &[("duration", "1")]);
        run.says(0, &[]);
        assert_eq!(run.causes(), ["time_out"; 2], "{version}");
        assert!(run.lines.iter().all(|line| line["progress"].as_f64().unwrap() > 0.0), "{:?}", run.lines);
    }
}

/// Whoever connects and says nothing, or says it slowly, does not hold up the simulator behind it.
#[test]
fn a_silent_client_blocks_no_other() {
    let port = free_ports(1);
    let (there, come) = mpsc::channel();
    let silent = std::thread::spawn(move || {
        let mut kept = Vec::new();
        comes_true(LIMIT, || {
            kept.extend(TcpStream::connect(("127.0.0.1", port)).ok());
            kept.len() == 3
        });
        there.send(()).unwrap();
        for byte in b"GET /slow" {
            for stream in &mut kept[..1] {
                let _ = stream.write_all(&[*byte]);
            }
            std::thread::sleep(Duration::from_millis(300));
        }
        kept
    });
    // It comes behind them.
    let stand_in = std::thread::spawn(move || {
        come.recv().unwrap();
        StandIn::start("udacity", port, &["--rate", "40"])
    });
    let mut simulator = simulator(port);
    // Less than one of them may take to say what it wants.
    simulator["start_seconds"] = json!(4);
    let run = run(&simulator, &[("duration", "1")]);
    run.says(0, &[]);
    assert_eq!(run.causes(), ["time_out"; 2]);
    drop((silent.join().unwrap(), stand_in.join().unwrap()));
}

/// A scenario in the middle of which the simulator is lost says nothing about the driver: it is driven again.
#[test]
#[ignore = "long: .ci/run runs it"]
fn a_scenario_whose_simulator_is_lost_is_driven_again() {
    for (fault, least) in [("close", 0.0), ("close:5", 5.0), ("half", 0.0)] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("udacity", port, &["--rate", "40", "--fault", fault, "--at", "1"]);
        let run = run(&simulator(port), &[]);
        run.says(
            0,
            &["closed the connection", "simulator `udacity`", "driven again from its beginning, once"],
        );
        assert_eq!(run.causes(), ["time_out"; 2], "{fault}");
        assert!(run.took.as_secs_f64() >= least, "{fault}: {:?}", run.took);
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn one_that_pdk_starts_is_started_again() {
    tried::is_started_again(SOURCE, &simulator(1), "udacity", "--rate 40", 1);
}

#[test]
fn one_that_hangs_ends_the_run() {
    let port = free_ports(1);
    let mut simulator = simulator(port);
    simulator["answer_seconds"] = json!(3);
    simulator["start_seconds"] = json!(3);
    let _stand_in = StandIn::start("udacity", port, &["--rate", "40", "--fault", "hang", "--at", "1"]);
    let run = run(&simulator, &[]);
    run.says(1, &["simulator `udacity`", "has not connected within 3 s"]);
    assert!(run.lines.is_empty(), "{:?}", run.lines);
}

#[test]
fn nonsense_is_the_outcome_of_its_scenario() {
    for (fault, says) in [
        ("garbage", "`220 mail.example.org ESMTP ready`, which is not a packet of Engine.IO"),
        ("flood", "a message of more than 67108864 bytes"),
    ] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("udacity", port, &["--rate", "40", "--fault", fault, "--at", "1"]);
        let run = run(&simulator(port), &[("memory", "400")]);
        run.says(1, &["1 of 2 scenarios", says, "is another program connected to this port?"]);
        assert_eq!(run.causes(), ["error", "time_out"], "{fault}");
        assert_eq!(run.lines[0]["error_kind"], "nonsense");
    }
}

#[test]
fn one_that_does_not_come_is_waited_for_and_said() {
    let port = free_ports(1);
    let mut simulator = simulator(port);
    simulator["start_seconds"] = json!(4);
    // A browser looks in meanwhile.
    let browser = std::thread::spawn(move || {
        let mut answer = String::new();
        assert!(comes_true(LIMIT, || {
            let Ok(mut stream) = TcpStream::connect(("127.0.0.1", port)) else { return false };
            let request = "GET /index.html HTTP/1.1\r\nHost: x\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                           Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";
            stream.write_all(request.as_bytes()).is_ok()
                && stream.read_to_string(&mut answer).is_ok()
                && !answer.is_empty()
        }));
        answer
    });
    let run = run(&simulator, &[]);
    run.says(1, &["has not connected within 4 s; something else tried to", "`launch`"]);
    assert!(run.lines.is_empty(), "{:?}", run.lines);
    assert!(browser.join().unwrap().starts_with("HTTP/1.1 400"));
}

#[test]
fn a_port_in_use_is_reported() {
    let other = TcpListener::bind("127.0.0.1:0").unwrap();
    let run = run(&simulator(other.local_addr().unwrap().port()), &[]);
    run.says(1, &["cannot listen at 127.0.0.1:", "another program listens there"]);
}

/// It binds to this machine's own address, not to those that others can reach.
#[test]
fn no_other_user_can_connect() {
    let port = free_ports(1);
    let stand_in = StandIn::start("udacity", port, &["--rate", "40"]);
    let folder = temp();
    let command = Pdk::new(["run", "--workers", "1", "--out"]).arg(folder.path().join("out"));
    let command =
        command.arg(pipeline(folder.path(), SOURCE)).set("simulator", simulator(port)).set("duration", 4);
    let mut child = command.spawn();
    let listening = || {
        let wanted = format!(":{port:04X} ");
        let table = std::fs::read_to_string("/proc/net/tcp").unwrap();
        table.lines().find(|line| line.contains(&wanted) && line.contains(" 0A ")).map(str::to_owned)
    };
    assert!(comes_true(LIMIT, || listening().is_some()));
    assert!(listening().unwrap().contains("0100007F:"), "{:?}", listening());
    // Another simulator that wants to have it too is refused, and the drive goes on.
    let out = folder.path().join("out");
    assert!(comes_true(LIMIT, || !partial(&out.join("traces")).is_empty()), "it does not drive");
    let second = StandIn::start("udacity", port, &["--rate", "40"]);
    let status = child.wait().unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert!(status.success(), "{said}");
    assert_eq!(said.matches("another simulator wants to connect").count(), 1, "{said}");
    drop((stand_in, second));
}

#[test]
fn doctor_says_what_it_found() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("udacity", port, &["--rate", "20"]);
    let set = |text: String| ["--set".to_owned(), text];
    let finished = Pdk::new(["doctor", "--simulator", "udacity"])
        .args(set(format!("port={port}")))
        .args(set("settle_seconds=0".to_owned()))
        .succeed();
    for part in ["`udacity` was ready after", "has its own clock", "320x160", "at 20 Hz", "from a control"] {
        assert!(finished.stdout.contains(part), "{part}: {}", finished.stdout);
    }
}

/// The stand-in that behaves as the Unity library does byte for byte. It sends what it is given, and drives nowhere.
#[test]
fn the_unity_library_is_understood() {
    let Some(tool) = real_data("tools/unity_client.py") else { return };
    let python = Command::new("python3").args(["-c", "import websocket"]).stderr(Stdio::null()).status();
    if !python.is_ok_and(|status| status.success()) {
        eprintln!("skipped: python3 has no websocket-client");
        return;
    }
    for (mode, build) in [("fork", "road_generating"), ("stock", "stock")] {
        let port = free_ports(1);
        let folder = temp();
        let picture = folder.path().join("frame.jpg");
        pictures::write(&picture, 320, 160);
        let log = folder.path().join("log");
        let mut simulator = simulator(port);
        simulator["build"] = json!(build);
        simulator["launch"] = json!([
            "sh",
            "-c",
            format!(
                "sleep 1; exec python3 -u {} $0 {mode} {} 60 > {} 2>&1",
                tool.display(),
                picture.display(),
                log.display()
            ),
            "{port}"
        ]);
        // This stock build answers a dozen commands only, and the time is that of the clock.
        let duration = if mode == "stock" { "0.001" } else { "0.1" };
        let run = run(&simulator, &[("roads", "false"), ("scenarios", "1"), ("duration", duration)]);
        let said = std::fs::read_to_string(&log).unwrap();
        assert_eq!(run.finished.code, Some(0), "{mode}: {}{said}", run.finished.stderr);
        assert_eq!(run.causes(), ["time_out"], "{mode}");
        assert!(
            said.contains("UNITY <- 40") && said.contains("UNITY <- 3") && said.contains("steer"),
            "{mode}: {said}"
        );
    }
}

/// A simulator for socket.io-client 2 of npm. The vehicle stands at the start of the road that it gets.
const IN_JAVASCRIPT: &str = r#"
const io = require('socket.io-client'), image = require('fs').readFileSync(process.argv[2]).toString('base64');
const options = process.argv[3] === 'websocket' ? { transports: ['websocket'] } : {};
const socket = io('http://127.0.0.1:' + process.argv[1], options);
let track = '', steers = 0;
socket.on('connect', () => setInterval(() => socket.emit('telemetry', {
    steering_angle: '0.0000', throttle: '0.0000', speed: '0.0000', hit: 'none', cte: '0.0213', track, cte_pid: '0.0213',
    pos_x: '125.0000', pos_y: '1.9000', pos_z: '25.0000', image,
}), 50));
socket.on('track', data => track = data.track_string);
socket.on('steer', data => steers += typeof data.steering_angle === 'string');
socket.on('disconnect', () => { console.log('steers', steers); process.exit(0); });
setTimeout(() => process.exit(1), 60000);
"#;

/// The same for python-socketio, whose computer writes decimal commas.
const IN_PYTHON: &str = r#"
import base64, sys, time, socketio
image = base64.b64encode(open(sys.argv[2], 'rb').read()).decode()
client, state = socketio.Client(reconnection=False), {'track': '', 'steers': 0}

@client.on('track')
def _(data):
    state['track'] = data['track_string']

@client.on('steer')
def _(data):
    state['steers'] += isinstance(data['steering_angle'], str)

while not client.connected:
    try:
        client.connect('http://127.0.0.1:' + sys.argv[1], transports=['websocket'] if sys.argv[3] == 'websocket' else None)
    except socketio.exceptions.ConnectionError:
        time.sleep(0.05)
until = time.time() + 60
while client.connected and time.time() < until:
    try:
        client.emit('telemetry', {
            'steering_angle': '0,0000', 'throttle': '0,0000', 'speed': '0,0000', 'hit': 'none', 'cte': '0,0213', 'track': state['track'],
            'pos_x': '125,0000', 'pos_y': '1,9000', 'pos_z': '25,0000', 'image': image})
    except Exception:
        break
    time.sleep(0.05)
print('steers', state['steers'])
"#;

/// Other clients of Socket.IO, which poll first or do not. `NODE_PATH` is where npm's is found, and `PDK_TEST_SOCKETIO` a Python that has the other one.
#[test]
fn clients_of_socket_io_are_driven() {
    let python = std::env::var("PDK_TEST_SOCKETIO").unwrap_or_else(|_| "python3".to_owned());
    let clients = [
        ("node".to_owned(), ["-e", IN_JAVASCRIPT], ["-e", "require('socket.io-client')"]),
        (python, ["-c", IN_PYTHON], ["-c", "import socketio"]),
    ];
    let folder = temp();
    let picture = folder.path().join("frame.jpg");
    pictures::write(&picture, 320, 160);
    for (program, client, needed) in clients {
        let has = Command::new(&program).args(needed).stdout(Stdio::null()).stderr(Stdio::null()).status();
        if !has.is_ok_and(|status| status.success()) {
            eprintln!("skipped: {program} has no client of Socket.IO");
            continue;
        }
        for transport in ["websocket", "all"] {
            let port = free_ports(1);
            let client = Command::new(&program)
                .args(client)
                .arg(port.to_string())
                .arg(&picture)
                .arg(transport)
                .stdout(Stdio::piped())
                .spawn()
                .unwrap();
            let run = run(&simulator(port), &[("duration", "1")]);
            let said = String::from_utf8(client.wait_with_output().unwrap().stdout).unwrap();
            run.says(0, &[]);
            assert_eq!(run.causes(), ["time_out"; 2], "{program} {transport}");
            // The second one is perturbed.
            assert_ne!(run.lines[0]["digest"], run.lines[1]["digest"], "{program} {transport}");
            let steers: u32 = said.trim().strip_prefix("steers ").unwrap().parse().unwrap();
            assert!(steers >= 20, "{program} {transport}: {said}");
        }
    }
}
