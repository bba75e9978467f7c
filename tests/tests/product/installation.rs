//! pdk away from its source tree: copied anywhere, read-only, without a home folder, for several users.

use std::fs::{self, Permissions};
use std::os::unix::fs::PermissionsExt;
use std::path::Path;

use pdk_product::PRODUCT;
use pdk_tests::installation::Installation;
use pdk_tests::process::{json_file, json_lines};
use pdk_tests::{Pdk, pictures, repository, temp};

/// The quickstart on a short road with small frames.
fn quickstart(pdk: Pdk, out: &Path) -> Pdk {
    pdk.args(["run", "quickstart", "--out"])
        .arg(out)
        .set("simulator", r#"{"name":"lane","width":80,"height":60,"rate":20}"#)
        .set("road", r#"{"angles":[0,4,-4],"segment":10}"#)
        .set("perturbations", "dirty_lens,banding,dynamic_rain_filter")
        .set("levels", "2")
}

/// What depends on scripts, networks and clips works where none of their files are, and comes out the same.
#[test]
#[ignore = "long: .ci/run runs it"]
fn a_copy_does_what_the_source_tree_does() {
    let folder = temp();
    let work = folder.path();
    quickstart(Pdk::new(["--json"]), &work.join("here")).env("PDK_CACHE", work.join("cache")).succeed();
    for installation in [Installation::copies(), Installation::unpacked()] {
        let out = installation.executable().parent().unwrap().file_name().unwrap();
        let ran = quickstart(installation.pdk(), Path::new(out)).env("TMPDIR", work).folder(work).succeed();
        // No warning; only what the pipeline itself says.
        assert_eq!(
            ran.stderr,
            "Each was driven once, on one road. What holds on others: pdk run greedy, pdk run study\n"
        );
        let digests = |record: &Path| -> Vec<serde_json::Value> {
            json_lines(&record.join("scenarios.jsonl")).iter().map(|line| line["digest"].clone()).collect()
        };
        assert_eq!(digests(&work.join("here")), digests(&work.join(out)));

        let manifest = json_file(&work.join(out).join("manifest.json"));
        assert_eq!(manifest["pipeline"]["path"], "quickstart");
        let component = |name: &str| {
            let components = manifest["components"].as_array().unwrap();
            components.iter().find(|component| component["name"] == name).unwrap().clone()
        };
        let banding = fs::read(repository().join("scripts/perturbations/banding.lua")).unwrap();
        assert_eq!(component("banding")["file"]["path"], "built-in:banding");
        assert_eq!(component("banding")["file"]["blake3"], blake3::hash(&banding).to_hex().as_str());
        let network = fs::read(repository().join("scripts/models/dave2.onnx")).unwrap();
        let network = blake3::hash(&network).to_hex().to_string();
        assert!(component("dave2")["info"].to_string().contains(&network), "{}", component("dave2"));

        // Its record needs neither it nor its place.
        let replayed =
            Pdk::new(["replay"]).arg(work.join(out)).env("PDK_CACHE", work.join("cache")).succeed();
        assert!(replayed.stdout.contains("4 of 4 equal"), "{}", replayed.stdout);
        assert!(replayed.stderr.is_empty(), "nothing has changed: {}", replayed.stderr);
        let other = Installation::copies();
        let replayed = other.pdk().arg("replay").arg(work.join("here")).env("TMPDIR", work).succeed();
        assert!(replayed.stdout.contains("4 of 4 equal"), "{}", replayed.stdout);
    }
}

#[test]
fn a_users_own_clip_and_script_work_without_a_home() {
    let installation = Installation::unpacked();
    let folder = temp();
    fs::create_dir(folder.path().join("clips")).unwrap();
    fs::create_dir(folder.path().join("tmp")).unwrap();
    fs::copy(repository().join("scripts/overlays/birds.mp4"), folder.path().join("clips/gulls.mp4")).unwrap();
    let script = "return { doc = 'Darkens', apply = function(image) image:brightness(0.5) end }";
    fs::write(folder.path().join("darker.lua"), script).unwrap();
    pictures::write(&folder.path().join("in.png"), 64, 48);
    let perturb = |with: &str| {
        let pdk = installation.pdk().folder(folder.path()).env("TMPDIR", folder.path().join("tmp"));
        let pdk = pdk.args(["--drop-ins", "clips", "--plugins", ".", "perturb", "in.png", "--time", "1"]);
        pdk.args(["--with", with, "-o", "out.png"]).succeed();
        fs::read(folder.path().join("out.png")).unwrap()
    };
    let (gulls, darker) = (perturb("gulls@4"), perturb("darker"));
    assert!(gulls != darker && gulls == perturb("gulls@4"));
    // What was prepared is kept in a folder that no other user can enter.
    let kept: Vec<_> =
        fs::read_dir(folder.path().join("tmp")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [cache] = kept.as_slice() else { panic!("{kept:?}") };
    assert!(cache.file_name().unwrap().to_str().unwrap().starts_with("pdk-"), "{cache:?}");
    assert_eq!(cache.metadata().unwrap().permissions().mode() & 0o777, 0o700);
    assert!(fs::read_dir(cache.join("overlays")).unwrap().count() > 0);
    let doctor = installation.pdk().arg("doctor").env("TMPDIR", folder.path().join("tmp")).succeed();
    assert!(doctor.stdout.contains("there is no home folder that can be written to"), "{}", doctor.stdout);
}

/// Two users, and each of them twice at once, for the first time.
#[test]
#[ignore = "long: .ci/run runs it"]
fn several_users_work_at_the_same_time() {
    if !rustix::process::geteuid().is_root() {
        eprintln!("skipped: only root can run pdk as other users");
        return;
    }
    let installation = Installation::copies();
    let folder = temp();
    fs::set_permissions(folder.path(), Permissions::from_mode(0o777)).unwrap();
    let start = |user: u32, number: u32| {
        let out = folder.path().join(format!("record-{user}-{number}"));
        let pdk = quickstart(installation.pdk(), &out).user(user).folder(folder.path());
        std::thread::spawn(move || {
            pdk.env("TMPDIR", out.parent().unwrap()).succeed();
            fs::read(out.join("scenarios.jsonl")).unwrap()
        })
    };
    let runs: Vec<_> =
        [(65533, 1), (65534, 1), (65533, 2), (65534, 2)].map(|(user, number)| start(user, number)).into();
    let ledgers: Vec<_> = runs.into_iter().map(|run| run.join().unwrap()).collect();
    assert!(ledgers.iter().all(|ledger| *ledger == ledgers[0]), "they drove different things");
    for user in [65533, 65534] {
        assert!(folder.path().join(format!("pdk-{user}/overlays")).is_dir());
    }
}

/// A part that is missing is never passed over.
#[test]
fn every_verb_reports_what_is_missing() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 16);
    for (installation, library) in [
        (Installation::copies(), "anywhere/libpdk_models.so"),
        (Installation::unpacked(), "pdk/lib/pdk/libpdk_models.so"),
    ] {
        installation.remove(library);
        let lies = installation.folder().join(library);
        let lies = lies.parent().unwrap().to_str().unwrap();
        for arguments in [
            &["list"][..],
            &["run", "quickstart"],
            // Which needs nothing of what is missing.
            &["perturb", "in.png", "--with", "gaussian_noise", "-o", "out.png"],
            &["new", "perturbation", "mine"],
        ] {
            let count = format!("1 of its {} libraries", PRODUCT.plugins.len());
            let parts = [
                count.as_str(),
                "libpdk_models.so",
                lies,
                "unpack the whole archive or install the Python package again",
            ];
            installation.pdk().args(arguments).folder(folder.path()).fail(1, &parts);
        }
        let doctor = installation.pdk().arg("doctor").run();
        assert_eq!(doctor.code, Some(1));
        let line = doctor.stdout.lines().find(|line| line.starts_with("BAD  libraries")).unwrap();
        assert!(line.contains("libpdk_models.so") && line.contains(lies), "{line}");
    }
    // Without the SDK's source everything works but plugins in Rust, and the remedy is said.
    let installation = Installation::copies();
    let new = installation.pdk().args(["new", "perturbation", "mine", "--rust"]).folder(folder.path());
    new.fail(1, &["the source of the SDK is missing", "--sdk"]);
    assert!(!folder.path().join("mine").exists());
    let doctor = installation.pdk().arg("doctor").succeed();
    assert!(
        doctor.stdout.contains("note sdk")
            && doctor.stdout.contains(&format!("{} libraries", PRODUCT.plugins.len())),
        "{}",
        doctor.stdout
    );
}

#[test]
fn pipelines_that_come_along_have_names_and_can_be_copied() {
    let folder = temp();
    let new = |arguments: &[&str]| Pdk::new(["new"]).args(arguments).folder(folder.path());
    new(&["pipeline", "mine", "--from", "quickstart"]).succeed();
    let text = |file: &Path| fs::read_to_string(file).unwrap();
    assert_eq!(text(&folder.path().join("mine.lua")), text(&repository().join("scripts/quickstart.lua")));
    new(&["driver", "mine", "--from", "quickstart"]).fail(1, &["--from is for pipelines"]);
    let run = |name: &str| Pdk::new(["run", name]).folder(folder.path());
    run("quickstat")
        .fail(1, &["no built-in pipeline `quickstat`", "did you mean `quickstart`?", "./quickstat"]);
    run("quickstart.lua").fail(1, &["cannot read the pipeline quickstart.lua", "`pdk run quickstart`"]);
    let help = Pdk::new(["run", "--help"]).succeed();
    for name in ["quickstart", "manual", "greedy", "study", "offline", "collect"] {
        assert!(help.stdout.contains(name), "{}", help.stdout);
    }
    // A module of the library is there, a file beside the pipeline is not.
    let study = run("study").set("roads", 0).fail(1, &["roads"]);
    assert!(study.starts_with("study:"), "{study}");
}

/// A link to the executable, as in a folder of the PATH, is as good as itself.
#[test]
fn a_link_finds_the_libraries() {
    let installation = Installation::unpacked();
    let folder = temp();
    let link = folder.path().join("pdk");
    std::os::unix::fs::symlink(installation.executable(), &link).unwrap();
    let listed = Pdk::program(link.to_str().unwrap()).bare().args(["list", "driver"]).succeed();
    assert!(listed.stdout.contains("dave2_augmented"), "{}", listed.stdout);
    let folder = folder.path().join("man");
    installation.pdk().arg("man").arg(&folder).succeed();
    assert!(fs::read_to_string(folder.join("pdk-run.1")).unwrap().contains("quickstart"));
}
