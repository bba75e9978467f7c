//! Tests of CSV files: separators, headers, guessed columns, units.

use super::*;
use pdk_sdk::serde_json::{Value, json};

fn config(given: Value) -> Config {
    let description = Description::dataset("d", "");
    let description =
        Table::parameters(&["image", "frame"]).into_iter().fold(description, Description::parameter);
    let description = Units::parameters("m/s").into_iter().fold(description, Description::parameter);
    Config::check(&description, given.as_object().unwrap()).unwrap()
}

fn table(text: &str) -> Table {
    Table::parse(Path::new("labels.csv"), text).unwrap()
}

fn labels(text: &str, given: Value) -> Result<Labels> {
    let (table, config) = (table(text), config(given));
    table.labels(&table.columns(&config)?, &Units::new(&config)?)
}

#[test]
fn columns_are_found_by_their_names() {
    let text = "\u{feff}Time_Stamp;Image File ;Steering-Angle;user/throttle;Brake;Vehicle Speed\n1;a.png;0.5;0.75;0.25;10\n";
    let columns = table(text).columns(&config(json!({}))).unwrap();
    assert_eq!((columns.timestamp, columns.image, columns.steering), (Some(0), Some(1), Some(2)));
    let (labels, told) = labels(text, json!({"speed_unit": "km/h"})).unwrap();
    let label = labels[0].clone().unwrap();
    assert_eq!((label.steering, label.throttle), (0.5, 0.5));
    assert!((label.speed - 10.0 / 3.6).abs() < 1e-12);
    assert!(told.contains(&("speed".to_owned(), "column `Vehicle Speed`, in km/h".to_owned())), "{told:?}");
}

#[test]
fn parameters_override_what_is_guessed() {
    let text = "a,angle,steering\nx.png,0.25,0.5\n";
    let steering = |given| labels(text, given).map(|(labels, _)| labels[0].clone().unwrap().steering);
    assert_eq!(steering(json!({})).unwrap(), 0.5);
    assert_eq!(steering(json!({"steering": "angle"})).unwrap(), 0.25);
    assert_eq!(steering(json!({"steering": "2"})).unwrap(), 0.25);
    assert!(steering(json!({"steering": "none"})).unwrap().is_nan());
    let error = steering(json!({"steering": "angel"})).unwrap_err().to_string();
    assert_eq!(error, "`labels.csv` has no column `angel`; its columns are a, angle, steering");
}

#[test]
fn the_log_of_udacity_is_known_with_and_without_a_header() {
    let row = "/home/x/IMG/center_1.jpg,/home/x/IMG/left_1.jpg, /home/x/IMG/right_1.jpg,-0.25,1,0,30.19\n";
    for text in [row.to_owned(), format!("center,left,right,steering,throttle,brake,speed\n{row}")] {
        let table = table(&text);
        assert!(table.is_udacity && table.len() == 1);
        let columns = table.columns(&config(json!({}))).unwrap();
        assert_eq!((columns.image, columns.steering, columns.speed), (Some(0), Some(3), Some(6)));
    }
    assert!(!table("a.jpg,b.jpg,1,2,3,4,5\n").is_udacity);
}

#[test]
fn what_is_not_a_number_is_named_with_its_line() {
    let (labels, _) = labels("image,steering\na.png,0.5\nb.png,left\nc.png,\n", json!({})).unwrap();
    let error = labels[1].clone().unwrap_err().to_string();
    assert_eq!(error, "steering: labels.csv line 3: column `steering` holds `left`, which is not a number");
    assert!(labels[2].clone().unwrap().steering.is_nan());
    assert!(Table::parse(Path::new("a.csv"), "image,steering\n").unwrap_err().message().contains("no rows"));
    assert!(Table::parse(Path::new("a.csv"), "").unwrap_err().message().contains("no rows"));
}

#[test]
fn times_are_in_seconds_whatever_their_unit() {
    let times = |text: &str, given: Value| {
        let (table, config) = (table(text), config(given));
        table.times(&table.columns(&config).unwrap(), &config).unwrap()
    };
    let nanoseconds = "timestamp\n1700000000000000001\n1700000000050000001\n";
    assert_eq!(times(nanoseconds, json!({})).since, [Some(0.0), Some(0.05)]);
    let milliseconds = times("time_ms\n1000\n1050\n", json!({}));
    let expected =
        Times { since: vec![Some(0.0), Some(0.05)], begin: 1.0, how: "column `time_ms`, in ms".into() };
    assert_eq!(milliseconds, expected);
    assert_eq!(times("t\n0.5\n\n", json!({})).since, [Some(0.5)]);
    assert_eq!(times("t\n500\n1500\n", json!({"time_unit": "us"})).since, [Some(0.0), Some(0.001)]);
    for name in ["timestampMs", "timeMs", "timestamp [ms]", "Time (ms)"] {
        let times = times(&format!("{name}\n100\n200\n"), json!({}));
        assert_eq!((times.begin, &times.since[..]), (0.1, &[Some(0.0), Some(0.1)][..]), "{name}");
    }
    assert_eq!(times("times\n1\n2\n", json!({})).begin, 1.0);
}
