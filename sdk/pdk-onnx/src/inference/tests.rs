//! Programs against the rules of operators in 64-bit floats.

use super::*;
use crate::testing::{CASES, OPSETS};

#[test]
fn programs_compute_what_the_rules_say() {
    for case in CASES {
        for opset in OPSETS.into_iter().filter(|opset| case.opsets.contains(opset)) {
            let graph = Graph::new(case.model(opset)).unwrap();
            let x = case.x();
            let expected = graph.evaluate(&[("x", &x)], &["target"]).unwrap().swap_remove(0);
            let mut program = Program::new(graph).unwrap_or_else(|error| panic!("{}: {error}", case.name));
            let input: Vec<f32> = x.values.iter().map(|&value| value as f32).collect();
            let mut outputs = vec![Vec::new()];
            for _ in 0..2 {
                program.run(&[input.clone()], &mut outputs).unwrap();
                let (found, expected) = (f64::from(outputs[0][0]), expected.values[0]);
                assert!(
                    (found - expected).abs() < 1e-5 * (1.0 + expected.abs()),
                    "{} {opset}: {found} {expected}",
                    case.name
                );
            }
        }
    }
}

#[test]
#[ignore = "bench"]
fn bench() {
    for path in std::env::var("NETS").unwrap().split(',') {
        let graph = Graph::new(crate::model::read(path.as_ref()).unwrap()).unwrap();
        let inputs: Vec<Vec<f32>> = graph
            .inputs()
            .map(|name| vec![0.5f32; graph.fact(name).unwrap().shape.iter().product()])
            .collect();
        let mut outputs = vec![Vec::new(); graph.outputs().len()];
        let t = std::time::Instant::now();
        let mut program = Program::new(graph).unwrap();
        let prepared = t.elapsed();
        let mut best = f64::MAX;
        for _ in 0..(if std::env::var("N").is_ok() { 3 } else { 200 }) {
            let t = std::time::Instant::now();
            program.run(&inputs, &mut outputs).unwrap();
            best = best.min(t.elapsed().as_secs_f64());
        }
        let mut times = vec![f64::MAX; program.steps.len()];
        for _ in 0..20 {
            for &(place, _, count) in &program.inputs {
                program.buffers[place].resize(count);
            }
            for (number, step) in program.steps.iter_mut().enumerate() {
                let t = std::time::Instant::now();
                step.run(&mut program.buffers, &program.constants).unwrap();
                times[number] = times[number].min(t.elapsed().as_secs_f64());
            }
        }
        for (number, time) in times.iter().enumerate().filter(|(_, time)| **time > 2e-5) {
            println!(
                "   {number} {:.3} ms {} -> {}",
                time * 1e3,
                program.steps[number].inputs.len(),
                program.steps[number].outputs[0].2
            );
        }
        println!(
            "{path}: prepared {prepared:?}, run {:.3} ms, {:?}",
            best * 1e3,
            &outputs[0][..2.min(outputs[0].len())]
        );
    }
}
