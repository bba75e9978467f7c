//! What perturbations outside of the default set make of frames stays the same from release to release: their digests are those in
//! `tests/golden/digests.txt`. A change of them is a change of a component's version, and made on purpose: `PDK_BLESS=1` writes the file anew.

use std::fmt::Write;
use std::fs;

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::search_path::SearchPath;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_preview::preview;
use pdk_sdk::prelude::FrameBuf;
use pdk_tests::repository;

/// Frames of a sequence.
const FRAMES: u64 = 14;

/// Networks and attacks on them, which have tests of their own, and corruptions that have reference outputs.
const ELSEWHERE: [&str; 3] = ["attack", "generative", "imagenet_c"];

/// The digest of some frames, each of which is moved to the left of the one before.
fn digest(chain: &mut Chain, source: &FrameBuf) -> String {
    let (width, height) = (source.width(), source.height());
    let (mut frame, mut target) = (FrameBuf::new(width, height), FrameBuf::new(width, height));
    let mut hasher = blake3::Hasher::new();
    for index in 0..FRAMES {
        for (to, from) in frame.as_mut().rows_mut().zip(source.as_ref().rows()) {
            to.copy_from_slice(from);
            to.rotate_left(3 * index as usize);
        }
        let moment = Moment::new(index, index as f64 / 20.0).after(0.4 * index as f64).at_rate(20.0);
        chain.apply(frame.as_ref(), target.as_mut(), &moment).unwrap();
        hasher.update(target.data());
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

#[test]
fn frames_of_perturbations_by_name_are_what_they_were() {
    let registry = pdk_tests::registry(&SearchPath::default());
    let source = pdk_image::read(&repository().join("tests/golden/lane.png")).unwrap();
    let shown = preview::chosen(registry.catalog(), &[], true).unwrap();
    let mut found = String::new();
    for shown in shown.iter().filter(|shown| !shown.description.default) {
        if ELSEWHERE.contains(&shown.description.family.as_str()) {
            continue;
        }
        for level in [1.0, 3.0] {
            let applied: AppliedPerturbation = shown.at(level);
            let mut chain = Chain::new(&registry, &[applied], 7).unwrap();
            let digest = digest(&mut chain, &source);
            writeln!(found, "{}@{level} {digest}", shown.description.name).unwrap();
        }
    }
    let path = repository().join("tests/golden/digests.txt");
    if std::env::var_os("PDK_BLESS").is_some() {
        fs::write(&path, &found).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap();
    for (found, expected) in found.lines().zip(expected.lines()) {
        assert_eq!(found, expected);
    }
    assert_eq!(found.lines().count(), expected.lines().count());
}
