//! `karst convert`, and foreign scenes given to other commands.
#![expect(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod program;

use std::path::Path;

use serde_json::Value;
use tempfile::TempDir;

use crate::program::{done, karst, stderr};

const SCENE: &str = "<scene version='3.0.0'>
  <sensor type='perspective'>
    <transform name='to_world'><lookat origin='0 0 5' target='0 0 0' up='0 1 0'/></transform>
    <sampler type='independent'><integer name='sample_count' value='2'/></sampler>
    <film type='hdrfilm'><integer name='width' value='24'/><integer name='height' value='16'/><rfilter type='box'/></film>
  </sensor>
  <shape type='obj'><string name='filename' value='parts/tri.obj'/></shape>
  <shape type='cube'><transform name='to_world'><translate x='1'/></transform></shape>
  <emitter type='constant'/>
  <!-- fog -->
</scene>";

/// A scene in the folder `from`, with something that cannot be translated where `fog` is set.
fn folder(fog: bool) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("from/parts")).unwrap();
    let scene =
        if fog { SCENE.replace("<!-- fog -->", "<medium type='heterogeneous'/>") } else { SCENE.to_owned() };
    std::fs::write(folder.path().join("from/scene.xml"), scene).unwrap();
    let mesh = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    std::fs::write(folder.path().join("from/parts/tri.obj"), mesh).unwrap();
    folder
}

/// Names of all files below a folder, in their order.
fn files(folder: &Path) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            found.extend(files(&entry.path()).iter().map(|inner| format!("{name}/{inner}")));
        } else {
            found.push(name);
        }
    }
    found.sort();
    found
}

#[test]
fn a_document_gets_its_files() {
    let folder = folder(false);
    let at = folder.path();
    let said: Value =
        serde_json::from_str(&done(at, &["convert", "from/scene.xml", "-o", "to/it/scene.json", "--json"]))
            .unwrap();
    assert_eq!((&said["event"], &said["notes"]), (&"converted".into(), &serde_json::json!([])));
    assert_eq!(files(&at.join("to")), ["it/meshes/cube.ply", "it/meshes/tri.obj", "it/scene.json"]);
    done(at, &["check", "to/it/scene.json"]);
    let said = done(at, &["convert", "from/scene.xml", "-o", "to/it/scene.json"]);
    assert_eq!(said, "to/it/scene.json: 0 files written, 0 things not translated\n", "nothing has changed");
}

#[test]
fn files_in_the_folder_stay_where_they_are() {
    let folder = folder(false);
    let at = folder.path();
    done(at, &["convert", "from/scene.xml", "-o", "from/scene.json"]);
    assert_eq!(files(&at.join("from")), ["meshes/cube.ply", "parts/tri.obj", "scene.json", "scene.xml"]);
    let document: Value =
        serde_json::from_slice(&std::fs::read(at.join("from/scene.json")).unwrap()).unwrap();
    assert_eq!(document["meshes"]["tri"]["file"], "parts/tri.obj");
    done(at, &["check", "from/scene.json"]);
}

#[test]
fn nothing_of_others_is_overwritten() {
    let folder = folder(false);
    let at = folder.path();
    std::fs::create_dir_all(at.join("to/meshes")).unwrap();
    std::fs::write(at.join("to/meshes/cube.ply"), "mine").unwrap();
    let line = ["convert", "from/scene.xml", "-o", "to/scene.json"];
    let output = karst(at, &line);
    assert_eq!(output.status.code(), Some(2));
    let expected = "error: nothing is written: these files are there with other contents\n  to/meshes/cube.ply\n  hint: ";
    assert!(stderr(&output).starts_with(expected), "{}", stderr(&output));
    assert_eq!(files(&at.join("to")), ["meshes/cube.ply"]);
    done(at, &[&line[..], &["--force"]].concat());
    assert!(std::fs::read(at.join("to/meshes/cube.ply")).unwrap().starts_with(b"ply\n"));
}

#[test]
fn what_is_lost_is_listed_and_can_be_an_error() {
    let folder = folder(true);
    let at = folder.path();
    let line = ["convert", "from/scene.xml", "-o", "to/scene.json"];
    let output = karst(at, &[&line[..], &["--strict", "--json"]].concat());
    assert_eq!(output.status.code(), Some(2));
    let note = "from/scene.xml:10: not translated: a medium of type \"heterogeneous\"\n";
    assert_eq!(stderr(&output), format!("{note}error: from/scene.xml: 1 things are not translated\n"));
    let said: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!((&said["notes"][0]["line"], &said["notes"][0]["kind"]), (&10.into(), &"untranslated".into()));
    assert!(!at.join("to").exists());
    let output = karst(at, &line);
    assert_eq!((output.status.code(), stderr(&output)), (Some(0), note.to_owned()));
}

#[test]
fn other_commands_take_the_scene_as_it_is() {
    let folder = folder(true);
    let at = folder.path();
    done(at, &["convert", "from/scene.xml", "-o", "to/scene.json"]);
    done(at, &["render", "to/scene.json", "-o", "converted.exr"]);
    let output = karst(at, &["render", "from/scene.xml", "-o", "direct.exr"]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(
        stderr(&output).starts_with("from/scene.xml:10: not translated: a medium"),
        "{}",
        stderr(&output)
    );
    let read = |name: &str| std::fs::read(at.join(name)).unwrap();
    assert!(read("direct.exr") == read("converted.exr"), "the same bits either way");
    let checked: Value = serde_json::from_str(&done(at, &["check", "from/scene.xml", "--json"])).unwrap();
    assert_eq!((&checked["valid"], &checked["width"]), (&true.into(), &24.into()));
    assert_eq!(checked["notes"][0]["kind"], "untranslated");
    assert_eq!(files(&at.join("from")), ["parts/tri.obj", "scene.xml"], "nothing is written beside it");
}

#[test]
fn a_wrong_scene_says_where() {
    let folder = folder(false);
    let at = folder.path();
    let scene = at.join("from/scene.xml");
    std::fs::write(&scene, SCENE.replace("value='2'", "value='two'")).unwrap();
    for line in [&["convert", "from/scene.xml", "-o", "s.json"][..], &["check", "from/scene.xml"]] {
        let output = karst(at, line);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(stderr(&output), "error: from/scene.xml:4: found \"two\", expected a whole number\n");
    }
    std::fs::remove_file(&scene).unwrap();
    let output = karst(at, &["check", "from/scene.xml"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).starts_with("error: from/scene.xml: "), "{}", stderr(&output));
}
