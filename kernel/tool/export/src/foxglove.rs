//! A layout for Foxglove, and for Lichtblick, in which the traces of a record open: what the camera and the driver saw, steering, cross-track
//! error and speed, and what happened.

use serde_json::{Map, Value, json};

/// Curves below each other: a title, and the topics and fields that it shows.
const PLOTS: [(&str, &[(&str, &str)]); 3] = [
    ("Steering and throttle", &[("control", "steering"), ("control", "throttle")]),
    ("Cross-track error in metres", &[("state", "cross_track_error")]),
    ("Speed in metres per second", &[("state", "speed")]),
];

/// The layout.
pub fn layout() -> Value {
    let mut panels = Map::new();
    let mut panel = |id: String, config: Value| {
        panels.insert(id.clone(), config);
        Value::from(id)
    };
    let camera = |topic: &str| json!({ "foxglovePanelTitle": topic, "imageMode": { "imageTopic": format!("/{topic}") } });
    let raw = panel("Image!raw".to_owned(), camera("raw"));
    let perturbed = panel("Image!perturbed".to_owned(), camera("perturbed"));
    let plots: Vec<Value> = PLOTS
        .iter()
        .enumerate()
        .map(|(number, (title, curves))| {
            let path = |(topic, field): &(&str, &str)| {
                json!({ "value": format!("/{topic}.{field}"), "enabled": true, "timestampMethod": "receiveTime", "label": field })
            };
            let config = json!({
                "foxglovePanelTitle": title, "paths": curves.iter().map(path).collect::<Vec<_>>(), "isSynced": true,
                "showXAxisLabels": true, "showYAxisLabels": true, "showLegend": true, "legendDisplay": "floating",
                "showPlotValuesInLegend": true, "xAxisVal": "timestamp", "sidebarDimension": 240,
            });
            panel(format!("Plot!{number}"), config)
        })
        .collect();
    let events = panel("RosOut!event".to_owned(), json!({ "topicToRender": "/event" }));
    let below = |first: Value, second: Value, percent: u32| json!({ "direction": "column", "first": first, "second": second, "splitPercentage": percent });
    let [steering, error, speed] = <[Value; 3]>::try_from(plots).unwrap_or_default();
    let curves = below(steering, below(error, below(speed, events, 60), 40), 30);
    let cameras = json!({ "direction": "row", "first": raw, "second": perturbed, "splitPercentage": 50 });
    json!({
        "configById": panels, "globalVariables": {}, "userNodes": {}, "playbackConfig": { "speed": 1 },
        "layout": below(cameras, curves, 45),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::{Control, State};

    /// Whether a topic of pdk's own messages has a field.
    fn has(topic: &str, field: &str) -> bool {
        match topic {
            "control" => Control::NUMBERS.contains(&field),
            "state" => State::NUMBERS.contains(&field),
            _ => false,
        }
    }

    /// The panels that a layout shows.
    fn shown(layout: &Value, all: &mut Vec<String>) {
        match layout {
            Value::String(id) => all.push(id.clone()),
            split => ["first", "second"].iter().for_each(|side| shown(&split[side], all)),
        }
    }

    #[test]
    fn each_panel_is_shown_once_and_shows_what_traces_have() {
        let layout = layout();
        let mut all = Vec::new();
        shown(&layout["layout"], &mut all);
        all.sort();
        let mut known: Vec<String> = layout["configById"].as_object().unwrap().keys().cloned().collect();
        known.sort();
        assert_eq!(all, known);
        assert_eq!(all.len(), 6);
        for (_, curves) in PLOTS {
            assert!(curves.iter().all(|(topic, field)| has(topic, field)), "{curves:?}");
        }
        assert!(!has("state", "steering") && !has("event", "name"));
    }
}
