//! Descriptions of networks, in TOML and in JSON, and the image that a small network gets by each that fits it.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pdk_fuzz as _;
use pdk_network::{Declared, Described, Element, Eye, Given, Inputs, Plan, Port};
use pdk_sdk::prelude::FrameBuf;

fn port(name: &str, shape: &[usize]) -> Port {
    let dims = shape.iter().map(|dim| Ok(*dim)).collect();
    Port { name: name.to_owned(), element: Element::Float32, shape: Some(dims) }
}

fuzz_target!(|data: &[u8]| {
    let folder = pdk_fuzz::folder("description");
    for ending in ["toml", "json"] {
        let path = folder.join(format!("pilot.{ending}"));
        std::fs::write(&path, data).expect("a file");
        let Ok(described) = Given::read(&path).and_then(Described::new) else { continue };
        for inputs in
            [vec![port("image", &[1, 3, 8, 12])], vec![port("image", &[1, 8, 12, 9]), port("v", &[1, 1])]]
        {
            let declared = Declared { inputs, outputs: vec![port("control", &[1, 2])] };
            let Ok(plan) = Plan::new(&declared, described.clone()) else { continue };
            let mut inputs = Inputs::new(&plan);
            let mut eye = Eye::new(&plan);
            // A crop of the network's frame may be meant for larger ones.
            let Ok(fitted) = eye.fit(FrameBuf::new(40, 30).as_ref()) else { continue };
            eye.see(fitted.as_ref(), inputs.image());
            assert!(inputs.values()[plan.image.place].len() == plan.image.shape.iter().product::<usize>());
        }
    }
});
