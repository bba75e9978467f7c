//! Requests byte by byte, as CARLA's own client 0.9.16 makes them.

use pdk_sdk::prelude::Control;
use rmpv::Value;

use super::*;
use crate::rpc::request;
use crate::weather::Weather;

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn versions_are_compared_by_their_numbers() {
    let version = |text: &str| text.parse::<Version>();
    assert_eq!(version("0.9.16"), Ok(Version::SPOKEN[1]));
    assert_eq!(version("0.9.15-169-g063cc9d90-dirty").map(|v| v.to_string()), Ok("0.9.15".to_owned()));
    assert!(
        version("0.10.0").unwrap() > Version::SPOKEN[1] && version("0.9.12").unwrap() < Version::SPOKEN[0]
    );
    for wrong in ["", "0.9", "carla", "0..1"] {
        assert_eq!(version(wrong), Err(()), "{wrong}");
    }
}

#[test]
fn requests_are_those_of_the_official_client() {
    let of = |number, name, arguments| hex(&request(number, name, false, arguments));
    assert_eq!(of(1, "version", vec![]), "940001a776657273696f6e9191c2");
    assert_eq!(of(4, "get_sensor_token", vec![1.into()]), "940004b06765745f73656e736f725f746f6b656e9291c201");
    assert_eq!(of(10, "tick_cue", vec![]), "94000aa87469636b5f6375659191c2");
    assert_eq!(of(36, "destroy_actor", vec![26.into()]), "940024ad64657374726f795f6163746f729291c21a");
    assert_eq!(
        of(41, "load_new_episode", vec!["Town01".into(), true.into(), ALL_LAYERS.into()]),
        "940029b06c6f61645f6e65775f657069736f64659491c2a6546f776e3031c3cdffff"
    );
    let pedals = Pedals::of(Control { steering: -0.1, throttle: 0.5 });
    assert_eq!(
        hex(&request(23, "apply_control_to_vehicle", true, control_arguments(25, pedals))),
        "940017b86170706c795f636f6e74726f6c5f746f5f76656869636c659391c31997ca3f000000cabdcccccdca00000000c2c2c200"
    );
    let at = Transform { location: [20.0, 2.0, 0.5], rotation: [0.0; 3] };
    assert_eq!(
        hex(&request(29, "set_actor_transform", true, vec![25.into(), at.value()])),
        "94001db37365745f6163746f725f7472616e73666f726d9391c3199293ca41a00000ca40000000ca3f00000093ca00000000ca00000000ca00000000"
    );
    assert_eq!(
        hex(&request(31, "set_actor_target_velocity", true, vec![25.into(), vector([0.0; 3])])),
        "94001fb97365745f6163746f725f7461726765745f76656c6f636974799391c31993ca00000000ca00000000ca00000000"
    );
}

#[test]
fn settings_go_back_as_they_came_but_for_what_is_changed() {
    let received = vec![
        false.into(),
        false.into(),
        array([false.into()]),
        true.into(),
        Value::F32(0.01),
        10.into(),
        Value::F32(0.0),
        true.into(),
        Value::F32(3000.0),
        Value::F32(2000.0),
        true.into(),
    ];
    let settings = EpisodeSettings(received);
    assert!(!settings.is_synchronous());
    let stepped = settings.stepped(20.0);
    assert_eq!(
        hex(&request(9, "set_episode_settings", false, vec![array(stepped.0.clone())])),
        "940009b47365745f657069736f64655f73657474696e67739291c29bc3c292c3cb3fa999999999999ac3cb3f847ae1400000000aca00000000c3ca453b8000ca44fa0000c3"
    );
    assert!(stepped.is_synchronous());
    assert_eq!(stepped.free(), settings.restored());
    // Frames of half a second are divided.
    let slow = settings.stepped(2.0).0;
    assert!(number(&slow[4]).unwrap() * number(&slow[5]).unwrap() >= 0.5, "{slow:?}");
    // What a later version adds goes back as well.
    let mut more = settings.0.clone();
    more.push("new".into());
    assert_eq!(EpisodeSettings(more).stepped(20.0).0[11], "new".into());
}

#[test]
fn weather_is_written_as_it_is_read() {
    let mut numbers = [0.0; 14];
    Weather::read(&"HardRainNoon".into()).unwrap().put_into(&mut numbers);
    let values: Vec<Value> = numbers.iter().map(|&number| float(number)).collect();
    let bytes = hex(&request(17, "set_weather_parameters", true, vec![array(values)]));
    assert!(
        bytes.starts_with(
            "940011b67365745f776561746865725f706172616d65746572739291c39eca42c80000ca42c80000ca42b40000ca42c80000cabf800000ca42340000\
             ca40e00000ca3f400000ca3dcccccdca00000000ca3f800000ca3cf5c28fca3d0793de"
        ),
        "{bytes}"
    );
}
