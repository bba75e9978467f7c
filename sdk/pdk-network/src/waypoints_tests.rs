//! The controller against its equations, in 64-bit floats.

use pdk_onnx::inference;
use pdk_onnx::proto::{DimensionProto, OperatorSetIdProto};
use pdk_sdk::serde_json::json;

use super::*;
use crate::Plan;
use crate::described::Described;
use crate::gets::Speed;
use crate::plan::Fill;

/// A network whose output is its only other input.
fn planner(count: usize) -> ModelProto {
    let graph = GraphProto {
        input: vec![
            ValueInfoProto::tensor("image", FLOAT, &[1, 3, 4, 6]),
            ValueInfoProto::tensor("plan", FLOAT, &[1, count]),
        ],
        output: vec![ValueInfoProto::tensor("waypoints", FLOAT, &[1, count])],
        node: vec![NodeProto {
            op_type: "Identity".to_owned(),
            input: vec!["plan".to_owned()],
            output: vec!["waypoints".to_owned()],
            ..Default::default()
        }],
        ..Default::default()
    };
    ModelProto {
        ir_version: 8,
        opset_import: vec![OperatorSetIdProto { version: 17, ..Default::default() }],
        graph: Some(graph),
        ..Default::default()
    }
}

fn given(fields: Value) -> Given {
    let mut given = Given::default();
    for (name, value) in fields.as_object().unwrap() {
        given.set(name, value.clone(), "pilot.toml line 1");
    }
    given
}

fn vehicle() -> Value {
    json!({"axes": "right_forward", "interval": 0.25, "wheelbase": 2.6, "full_lock": 25, "origin": 1.3})
}

/// Steering and throttle for a plan and a speed.
fn drive(table: &Value, plan: &[f32], speed: f32) -> [f64; 2] {
    let mut model = planner(plan.len());
    follow(&mut model, &mut given(json!({"waypoints": table}))).unwrap();
    let graph = Graph::new(model).unwrap();
    let mut session = inference::Program::new(graph).unwrap();
    let mut outputs = vec![Vec::new(); 3];
    session.run(&[vec![0.0; 72], plan.to_vec(), vec![speed]], &mut outputs).unwrap();
    [outputs[1][0].into(), outputs[2][0].into()]
}

#[test]
fn the_controller_pursues_the_plan() {
    // Waypoints on a circle of 50 m to the right, at 10 m/s; the planner slows down to 9.
    let at = |metres: f64| [50.0 * (1.0 - libm::cos(metres / 50.0)), 50.0 * libm::sin(metres / 50.0)];
    let metres = [2.5, 5.0, 7.4, 9.7, 12.0, 14.3];
    let plan: Vec<f32> = metres.iter().flat_map(|metres| at(*metres)).map(|number| number as f32).collect();
    let [steering, throttle] = drive(&vehicle(), &plan, 10.0);
    let point: Vec<f64> = (0..2).map(|axis| 0.8 * at(7.4)[axis] + 0.2 * at(9.7)[axis]).collect();
    let (right, ahead) = (point[0], point[1] + 1.3);
    let expected = libm::atan(2.6 * 2.0 * right / (right * right + ahead * ahead)) / 25f64.to_radians();
    assert!((steering - expected).abs() < 1e-6, "{steering} {expected}");
    // Counted from the rear axle, it is as a bicycle has to steer on that circle.
    let mut table = vehicle();
    table["origin"] = json!(0);
    let [on_circle, _] = drive(&table, &plan, 10.0);
    assert!((on_circle - libm::atan(2.6 / 50.0) / 25f64.to_radians()).abs() < 4e-3, "{on_circle}");
    let step = (0..2).map(|axis| (at(9.7)[axis] - at(7.4)[axis]).powi(2)).sum::<f64>().sqrt();
    assert!((throttle - 0.5 * (step / 0.25 - 10.0)).abs() < 1e-5, "{throttle}");
}

#[test]
fn every_order_of_axes_means_the_same() {
    let plan = [0.5f32, 3.0, 1.0, 6.0, 1.8, 9.0, 2.6, 12.0];
    let expected = drive(&vehicle(), &plan, 8.0);
    for (axes, [first, second]) in
        [("forward_right", [1, 0]), ("forward_left", [1, 0]), ("left_forward", [0, 1])]
    {
        let mut table = vehicle();
        table["axes"] = json!(axes);
        // With a third number of each, which is not taken, and in decimetres.
        table["numbers"] = json!(3);
        table["scale"] = json!(0.1);
        let turned: Vec<f32> = plan
            .chunks(2)
            .flat_map(|point| {
                let point = [if axes.contains("left") { -point[0] } else { point[0] }, point[1]];
                [10.0 * point[first], 10.0 * point[second], 99.0]
            })
            .collect();
        let found = drive(&table, &turned, 8.0);
        assert!(
            (0..2).all(|place| (found[place] - expected[place]).abs() < 1e-5),
            "{axes}: {found:?} {expected:?}"
        );
    }
}

#[test]
fn a_plan_to_stand_still_brakes_and_steers_gently() {
    let table = json!({"axes": "right_forward", "interval": 0.8, "wheelbase": 2.6, "full_lock": 25});
    for right in [0.0, 0.02, -0.02] {
        let [steering, throttle] = drive(&table, &[right, 0.01], 5.0);
        assert!(steering.abs() < 0.15 && steering * f64::from(right) >= 0.0, "{right}: {steering}");
        assert!((throttle + 2.5).abs() < 0.02, "{throttle}");
    }
    // What is near is pursued as it is down to half the wheelbase, also by a small vehicle: on a circle of 1 m.
    let small = json!({"axes": "right_forward", "interval": 0.8, "wheelbase": 0.165, "full_lock": 25});
    let [steering, _] = drive(&small, &[1.0 - libm::cosf(0.8), libm::sinf(0.8)], 1.0);
    let expected = libm::atan(0.165) / 25f64.to_radians();
    assert!((steering - expected).abs() < 1e-5, "{steering} {expected}");
}

#[test]
fn a_plan_backwards_is_to_stand_still() {
    let [_, throttle] = drive(&vehicle(), &[0.0, -2.0, 0.0, -4.0, 0.0, -6.0, 0.0, -8.0], 8.0);
    assert!((throttle + 4.0).abs() < 1e-6, "{throttle}");
}

#[test]
fn seconds_in_decimals_are_meant_as_they_are_written() {
    // Six times 0.15 is less than 0.9 in binary, and 0.07 / 0.01 more than 7.
    let plan = [0.0, 1.0, 0.0, 2.0, 0.0, 3.0, 0.0, 4.0, 0.0, 5.0, 0.0, 7.0, 0.0, 8.0, 0.0, 12.0];
    for (interval, aim, count, step) in [(0.15, 0.9, 6, 2.0), (0.01, 0.07, 8, 1.0)] {
        let mut table = vehicle();
        (table["interval"], table["aim"], table["gain"]) = (json!(interval), json!(aim), json!(1));
        let [_, throttle] = drive(&table, &plan[..2 * count], 0.0);
        assert!((throttle - step / interval).abs() < 1e-4, "{interval}, {aim}: {throttle}");
    }
}

#[test]
fn the_controller_is_described_and_takes_the_speed() {
    let mut table = vehicle();
    table["assumed"] = json!(8);
    let plan = |inputs: Value| {
        let mut model = planner(8);
        let mut given = given(json!({"waypoints": table, "inputs": inputs}));
        follow(&mut model, &mut given).unwrap();
        Plan::new(&Declared::of_model(&model), Described::new(given).unwrap()).unwrap()
    };
    let found = plan(json!({"image": "image", "plan": [0.0]}));
    assert_eq!((found.outputs[1].as_str(), found.outputs[2].as_str()), (STEERING, THROTTLE));
    let Fill::Speed(speed) = found.inputs[2].fill else { panic!("{:?}", found.inputs[2]) };
    assert_eq!(speed.assumed, Some(8.0));
    assert_eq!(
        found.described.or_assumed(Speed::PLAIN).assumed,
        Some(8.0),
        "for the network's own speed too"
    );
    assert!(
        found
            .reasons
            .iter()
            .any(|reason| reason.subject == "waypoints" && reason.value.contains("0.25 s apart"))
    );
    let own = plan(json!({"image": "image", "plan": [0.0], SPEED: {"value": "speed", "assumed": 3}}));
    let Fill::Speed(speed) = own.inputs[2].fill else { panic!("{:?}", own.inputs[2]) };
    assert_eq!(speed.assumed, Some(3.0));
    // With a throttle of its own it needs no speed.
    let mut model = planner(8);
    follow(&mut model, &mut self::given(json!({"waypoints": vehicle(), "throttle": 0.2}))).unwrap();
    let declared = Declared::of_model(&model);
    assert_eq!((declared.inputs.len(), declared.outputs.len()), (2, 2));
}

#[test]
fn waypoints_come_one_after_the_other_and_in_one_plan() {
    let shaped = |shape: &[usize], numbers: usize| {
        let mut model = planner(shape.iter().product());
        let graph = model.graph.as_mut().unwrap();
        graph.input[1] = ValueInfoProto::tensor("plan", FLOAT, shape);
        graph.output[0] = ValueInfoProto::tensor("waypoints", FLOAT, shape);
        let mut table = vehicle();
        table["numbers"] = json!(numbers);
        follow(&mut model, &mut given(json!({"waypoints": table}))).map_err(|error| error.to_string())
    };
    for (shape, numbers) in [(&[1, 4, 2][..], 2), (&[4, 2], 2), (&[1, 12], 3), (&[8], 2), (&[1, 1, 4, 3], 3)]
    {
        shaped(shape, numbers).unwrap();
    }
    for (shape, numbers, expected) in [
        (&[1, 4, 3][..], 2, "of shape (1, 4, 3), which is not 2 numbers for each waypoint; set `numbers`"),
        (&[1, 2, 4], 2, "of shape (1, 2, 4), which is not 2 numbers for each waypoint"),
        (&[1, 3, 4, 2], 2, "of shape (1, 3, 4, 2), which holds 3 plans; have the network choose one"),
    ] {
        let error = shaped(shape, numbers).unwrap_err();
        assert!(error.contains(expected), "{error}");
    }
}

#[test]
fn every_description_that_cannot_be_is_an_error_with_a_remedy() {
    let with = |key: &str, value: Value| {
        let mut table = vehicle();
        table[key] = value;
        json!({"waypoints": table})
    };
    let without = |key: &str| {
        let mut table = vehicle();
        table.as_object_mut().unwrap().remove(key);
        json!({"waypoints": table})
    };
    for (fields, expected) in [
        (json!({"waypoints": 3}), "`waypoints` is 3; write { output"),
        (json!({"waypoints": vehicle(), "steering": "x"}), "gives the steering, and so does `steering`"),
        (without("axes"), "needs `axes`, what the numbers of a waypoint are"),
        (without("interval"), "needs `interval`, the seconds from one waypoint to the next"),
        (without("wheelbase"), "needs `wheelbase`, the metres between the axles"),
        (without("full_lock"), "needs `full_lock`"),
        (with("axes", json!("forward_lefd")), "did you mean `forward_left`?"),
        (
            with("interval", json!(0)),
            "has 0 as `interval`; it is the seconds from one waypoint to the next, from 0.001 to 60",
        ),
        (with("numbers", json!(1)), "has 1 as `numbers`"),
        (
            with("numbers", json!(3)),
            "of shape (1, 8), which is not 3 numbers for each waypoint; set `numbers`",
        ),
        (
            with("aim", json!(2)),
            "steers for the point in 2 s, but the 4 waypoints of the output `waypoints` end after 1 s",
        ),
        (
            with("output", json!("waypoint")),
            "names the output `waypoint`, which the network does not have; did you mean `waypoints`?",
        ),
        (with("intervall", json!(1)), "has no `intervall`; did you mean `interval`?"),
    ] {
        let error = follow(&mut planner(8), &mut given(fields)).unwrap_err().to_string();
        assert!(error.starts_with("pilot.toml line 1: ") && error.contains(expected), "{error}");
    }
}

#[test]
fn an_output_that_gives_one_coordinate_after_the_other_is_refused() {
    let shaped = |shape: &[usize]| {
        let mut model = planner(20);
        model.graph.as_mut().unwrap().output[0] = ValueInfoProto::tensor("waypoints", FLOAT, shape);
        follow(&mut model, &mut given(json!({"waypoints": vehicle()})))
    };
    let error = shaped(&[2, 10]).unwrap_err().to_string();
    assert!(error.contains("of shape (2, 10), which is not 2 numbers for each waypoint"), "{error}");
    for shape in [&[1, 20][..], &[10, 2], &[1, 10, 2], &[20]] {
        shaped(shape).unwrap_or_else(|error| panic!("{shape:?}: {error}"));
    }
}

#[test]
fn a_shape_that_is_left_open_follows_from_the_nodes() {
    let mut open = planner(8);
    let shape = |open: &mut ModelProto| {
        let tensor =
            open.graph.as_mut().unwrap().output[0].r#type.as_mut().unwrap().tensor_type.as_mut().unwrap();
        tensor.shape.as_mut().unwrap().dim[1] =
            DimensionProto { dim_value: None, dim_param: Some("count".to_owned()) };
    };
    shape(&mut open);
    follow(&mut open, &mut given(json!({"waypoints": vehicle()}))).unwrap();
    assert_eq!(open.graph.unwrap().output.len(), 3);
}
