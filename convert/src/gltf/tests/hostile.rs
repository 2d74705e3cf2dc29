//! Owns the tests of files that are damaged or made to do harm.

use std::time::{Duration, Instant};

use karst_core::scene::Limits;
use serde_json::{Value, json};

use super::{Parts, error, ok, read, square, with_material};
use crate::convert_gltf;

/// The file of the square with a change.
fn changed(change: impl FnOnce(&mut Value)) -> Value {
    let mut file =
        with_material(&json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}), &json!({}));
    ok(&file);
    change(&mut file);
    file
}

#[test]
fn indices_beyond_their_tables_name_the_place() {
    for (pointer, place, table) in [
        ("/scene", "scene", "1 scenes"),
        ("/scenes/0/nodes/0", "nodes", "1 nodes"),
        ("/nodes/0/mesh", "nodes[0]", "1 meshes"),
        ("/meshes/0/primitives/0/material", "meshes[0].primitives[0].material", "1 materials"),
        ("/meshes/0/primitives/0/indices", "meshes[0].primitives[0].indices", "3 accessors"),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            "meshes[0].primitives[0].attributes.POSITION",
            "3 accessors",
        ),
        (
            "/meshes/0/primitives/0/attributes/TEXCOORD_0",
            "meshes[0].primitives[0].attributes.TEXCOORD_0",
            "3 accessors",
        ),
        ("/accessors/0/bufferView", "accessors[0]", "3 buffer views"),
        ("/bufferViews/0/buffer", "bufferViews[0].buffer", "1 buffers"),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/index",
            "materials[0].baseColorTexture",
            "1 textures",
        ),
        ("/textures/0/source", "textures[0]", "1 images"),
    ] {
        let file = changed(|file| *file.pointer_mut(pointer).unwrap() = json!(4_000_000_000_u32));
        let expected = format!("a.gltf: {place}: found the index 4000000000, the file has {table}");
        assert_eq!(error(&file), expected, "{pointer}");
    }
}

#[test]
fn vertices_that_are_not_there_name_the_primitive() {
    let mut parts = Parts::default();
    let positions = parts.floats("VEC3", &[0., 0., 0., 1., 0., 0., 0., 1., 0.]);
    let indices = parts.shorts(&[0, 1, 3]);
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices});
    let file = parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]}));
    assert_eq!(
        error(&file),
        "a.gltf: meshes[0].primitives[0].indices: found the vertex index 3, the primitive has 3 vertices"
    );
}

#[test]
fn numbers_that_are_none_name_the_vertex() {
    let mut parts = Parts::default();
    let positions = parts.floats("VEC3", &[0., 0., 0., 1., f32::NAN, 0., 0., 1., 0.]);
    let primitive = json!({"attributes": {"POSITION": positions}});
    let file = parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]}));
    assert_eq!(
        error(&file),
        "a.gltf: meshes[0].primitives[0]: vertex 1: found position [1, NaN, 0], expected finite numbers"
    );
    let file = changed(|file| file["nodes"][0]["translation"] = json!([1e308, 0, 0]));
    assert_eq!(error(&file), "nothing");
    let file = changed(|file| {
        file["nodes"][0]["matrix"] = json!([1e308, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0]);
    });
    assert_eq!(error(&file), "a.gltf: nodes[0]: the last row of the matrix is not [0, 0, 0, 1]");
}

#[test]
fn sizes_that_lie_take_no_memory() {
    for (pointer, value, expected) in [
        (
            "/accessors/0/count",
            json!(4_000_000_000_u32),
            "accessors[0]: ends at byte 48000000000, buffer view 0 has 48",
        ),
        (
            "/accessors/0/count",
            json!(u64::MAX),
            "accessors[0]: found the count 18446744073709551615, expected 1 to",
        ),
        ("/accessors/0/count", json!(0), "accessors[0]: found the count 0, expected 1 to 4294967295"),
        (
            "/accessors/0/byteOffset",
            json!(u64::MAX),
            "accessors[0]: ends at byte 18446744073709551615, buffer view 0",
        ),
        ("/accessors/0/byteOffset", json!(4), "accessors[0]: ends at byte 52, buffer view 0 has 48"),
        (
            "/bufferViews/0/byteLength",
            json!(u64::MAX),
            "bufferViews[0]: ends at byte 18446744073709551615, buffer 0",
        ),
        (
            "/bufferViews/0/byteOffset",
            json!(u64::MAX),
            "bufferViews[0]: ends at byte 18446744073709551615, buffer 0",
        ),
        (
            "/bufferViews/0/byteStride",
            json!(4),
            "accessors[0]: found the byteStride 4, its elements have 12 bytes",
        ),
        (
            "/bufferViews/0/byteStride",
            json!(u64::MAX),
            "accessors[0]: ends at byte 18446744073709551615, buffer view 0",
        ),
        (
            "/buffers/0/byteLength",
            json!(u64::MAX),
            "buffers[0]: found 92 bytes, byteLength says 18446744073709551615",
        ),
        (
            "/accessors/0/componentType",
            json!(5124),
            "accessors[0]: found the componentType 5124, expected 5120, 5121",
        ),
        ("/accessors/0/type", json!("VEC4"), "accessors[0]: found the type \"VEC4\", expected \"VEC3\""),
        (
            "/accessors/2/componentType",
            json!(5122),
            "meshes[0].primitives[0].indices: expected unsigned integers",
        ),
        (
            "/meshes/0/primitives/0/mode",
            json!(7),
            "meshes[0].primitives[0]: found the mode 7, expected 0 to 6",
        ),
        (
            "/accessors/1/count",
            json!(3),
            "meshes[0].primitives[0].attributes: found 4 positions and 3 of another",
        ),
    ] {
        let file = changed(|file| {
            let (table, field) = pointer.rsplit_once('/').unwrap();
            file.pointer_mut(table).unwrap()[field] = value;
        });
        let found = error(&file);
        assert!(found.starts_with(&format!("a.gltf: {expected}")), "{pointer}: {found}");
    }
    // Without bytes a count is not held down by the size of the file.
    let file = changed(|file| {
        file["accessors"][0].as_object_mut().unwrap().remove("bufferView");
        file["accessors"][0]["count"] = json!(4_194_305);
    });
    assert_eq!(
        error(&file),
        "a.gltf: accessors[0]: found 4194305 elements without bytes, the limit is 4194304"
    );
}

#[test]
fn sparse_elements_stay_within_their_accessor() {
    let sparse = |index: u8, count: u64| {
        let mut parts = Parts::default();
        let positions = parts.floats("VEC3", &[0.0; 9]);
        let which = parts.view(&[index]);
        let values = parts.view(&[0; 12]);
        parts.accessors[positions]["sparse"] = json!({
            "count": count, "indices": {"bufferView": which, "componentType": 5121}, "values": {"bufferView": values},
        });
        let primitive = json!({"attributes": {"POSITION": positions}});
        error(&parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]})))
    };
    assert_eq!(sparse(2, 1), "nothing");
    assert_eq!(sparse(3, 1), "a.gltf: accessors[0].sparse: found the index 3, the accessor has 3 elements");
    assert_eq!(sparse(2, 2), "a.gltf: accessors[0].sparse: ends at byte 2, buffer view 1 has 1");
    assert_eq!(sparse(2, 4), "a.gltf: accessors[0].sparse: found 4 elements, expected at most 3");
}

#[test]
fn buffers_that_are_missing_are_told() {
    for (buffer, expected) in [
        (json!({"byteLength": 1}), "buffers[0]: found no uri and no binary part that it stands for"),
        (
            json!({"byteLength": 1, "uri": "a.bin"}),
            "buffers[0]: found \"a.bin\", files beside the scene are not read here",
        ),
        (json!({"byteLength": 1, "uri": "data:x"}), "buffers[0]: found \"data:x\", expected data in base64"),
        (
            json!({"byteLength": 1, "uri": "data:;base64,?"}),
            "buffers[0]: the data is not base64: Invalid symbol 63, offset 0.",
        ),
    ] {
        let file = changed(|file| file["buffers"][0] = buffer);
        assert_eq!(error(&file), format!("a.gltf: {expected}"));
    }
}

#[test]
fn extensions_without_which_there_is_no_shape_are_refused() {
    let file = changed(|file| {
        file["extensionsRequired"] = json!(["KHR_mesh_quantization", "EXT_meshopt_compression"])
    });
    assert_eq!(
        error(&file),
        "a.gltf: extensionsRequired: found \"EXT_meshopt_compression\", which is not read\n\
         hint: write the file again without that extension"
    );
    let file = changed(|file| {
        file["meshes"][0]["primitives"][0]["extensions"] = json!({"KHR_draco_mesh_compression": {}});
    });
    assert!(error(&file).contains("packed by KHR_draco_mesh_compression"), "{}", error(&file));
}

#[test]
fn text_that_is_no_gltf_names_the_line() {
    let text = |text: &str| {
        convert_gltf(text.as_bytes(), "a.gltf", &Limits::default())
            .map_or_else(|error| error.to_string(), |_| "nothing".to_owned())
    };
    assert_eq!(text("{\n\n"), "a.gltf:3: not glTF: EOF while parsing an object at line 3 column 0");
    assert!(
        text("{\"asset\": {\"version\": \"2.0\"},\n\"nodes\": [{\"mesh\": -1}]}")
            .starts_with("a.gltf:2: not glTF")
    );
    assert_eq!(text("{}"), "a.gltf:1: not glTF: missing field `asset` at line 1 column 2");
    assert!(
        text(r#"{"asset": {"version": "1.0"}}"#)
            .starts_with("a.gltf: asset.version: found \"1.0\", expected")
    );
    assert!(text(&"[".repeat(100_000)).starts_with("a.gltf:1: not glTF"));
    let nodes =
        format!(r#"{{"asset": {{"version": "2.0"}}, "nodes": [{}]}}"#, vec!["{}"; 2_000_000].join(","));
    assert_eq!(text(&nodes), "a.gltf: found 2000002 JSON objects, the limit is 1048576");
}

/// A mesh that is placed by many nodes, or primitives that share their numbers, must not become much out of little.
#[test]
fn little_text_does_not_become_a_large_scene() {
    let (parts, primitive) = square();
    let nodes = vec![json!({"mesh": 0}); 1000];
    let roots: Vec<usize> = (0..1000).collect();
    let file = parts.file(&json!({
        "nodes": nodes, "scenes": [{"nodes": roots}], "meshes": [{"primitives": vec![primitive; 100]}],
    }));
    assert_eq!(error(&file), "a.gltf: nodes[655]: places more than 65536 meshes, the limit");
    let limits = Limits { max_triangles: 150, ..Limits::default() };
    let found = convert_gltf(file.to_string().as_bytes(), "a.gltf", &limits).unwrap_err().to_string();
    assert_eq!(
        found,
        "a.gltf: meshes[0].primitives[75]: has 2 triangles, 0 are left of the limit for all meshes"
    );
}

/// A binary file of the chunks.
fn binary(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
    let mut bytes = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
    for (name, body) in chunks {
        bytes.extend((body.len() as u32).to_le_bytes());
        bytes.extend(*name);
        bytes.extend(*body);
    }
    let length = bytes.len() as u32;
    bytes[8..12].copy_from_slice(&length.to_le_bytes());
    bytes
}

fn square_json() -> (String, Vec<u8>) {
    let (parts, primitive) = square();
    let mut file = parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]}));
    file["buffers"][0].as_object_mut().unwrap().remove("uri");
    (file.to_string(), parts.bytes)
}

#[test]
fn binary_files_are_those_with_their_first_bytes() {
    let (json, bytes) = square_json();
    let file = binary(&[(b"JSON", json.as_bytes()), (b"BIN\0", &bytes), (b"more", b"....")]);
    let converted = convert_gltf(&file, "a.glb", &Limits::default()).unwrap();
    let text: Value = serde_json::from_str(&json).unwrap();
    let mut inside = text;
    inside["buffers"][0]["uri"] = json!(super::data(&bytes));
    let expected = read(&inside).unwrap();
    assert_eq!((converted.document, converted.assets), (expected.document, expected.assets));
    let fails = |bytes: &[u8]| convert_gltf(bytes, "a.glb", &Limits::default()).unwrap_err().to_string();
    assert_eq!(fails(b"glTF\x02\0\0\0"), "a.glb: found 8 bytes, expected a header of 12");
    assert_eq!(fails(b"glTF\x02\0\0\0\0\0\0\0"), "a.glb: the header says 0 bytes, the file has 12");
    assert_eq!(fails(b"glTF\x01\0\0\0\x0c\0\0\0"), "a.glb: found version 1 of the container, expected 2");
    assert_eq!(fails(&binary(&[])), "a.glb: found no JSON chunk, expected one first");
    let mut long = binary(&[(b"JSON", json.as_bytes())]);
    long[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    let said = format!("a.glb: offset 12: found a chunk of 4294967295 bytes, {} follow", json.len());
    assert_eq!(fails(&long), said);
}

#[test]
fn damaged_files_never_panic_and_never_hang() {
    let (json, bytes) = square_json();
    let file = binary(&[(b"JSON", json.as_bytes()), (b"BIN\0", &bytes)]);
    let start = now();
    for at in 0..file.len() {
        drop(convert_gltf(&file[..at], "a.glb", &Limits::default()));
        for byte in [0, 1, b'9', b'-', b'"', b'{', b'[', 0x7f, 0xff] {
            let mut damaged = file.clone();
            damaged[at] = byte;
            drop(convert_gltf(&damaged, "a.glb", &Limits::default()));
        }
    }
    assert!(start.elapsed() < Duration::from_secs(120));
}

#[expect(clippy::disallowed_methods, reason = "a test for hanging needs a clock; no pixel depends on it")]
fn now() -> Instant {
    Instant::now()
}
