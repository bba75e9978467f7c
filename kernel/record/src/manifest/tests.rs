use serde_json::json;

use super::*;

fn manifest(in_use: &InUse) -> Manifest {
    let mut manifest: Manifest = serde_json::from_value(json!({
        "pdk": "1", "seed": 0, "pipeline": {"path": "a.lua", "source": ""}, "settings": null, "components": [], "files": [],
        "machine": {"system": "linux", "architecture": "x86_64", "processors": 1},
    }))
    .unwrap();
    manifest.files = in_use.files();
    manifest
}

#[test]
fn two_groups_of_a_kind_in_one_folder_are_both_compared() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
    let group = |name: &str| InputFiles::new("labels", folder.path(), vec![name.into()]);
    let noted = |names: &[&str]| {
        let mut in_use = InUse::default();
        for name in names {
            in_use.add_input_files(&[group(name)], &mut |_, _| Ok(())).unwrap();
        }
        assert!(names.iter().all(|name| in_use.content_of(&group(name)).is_some()));
        manifest(&in_use)
    };
    write("a.json", "1");
    write("b.json", "2");
    let recorded = noted(&["a.json", "b.json"]);
    assert_eq!(recorded.files.iter().filter(|file| !file.group.is_empty()).count(), 2);
    // The second is not come to yet, or was not come to then.
    for (is, was) in [(noted(&["a.json"]), &recorded), (recorded.clone(), &noted(&["a.json"]))] {
        assert_eq!(is.continuing(was).unwrap().files, recorded.files);
    }
    write("b.json", "3");
    let error = noted(&["a.json", "b.json"]).continuing(&recorded).unwrap_err();
    assert!(error.ends_with("b.json is a different one"), "{error}");
}
