//! Owns the tests of glTF files, which are built here.

mod hostile;
mod look;
mod shape;
mod world;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use karst_core::mesh::{self, Mesh};
use karst_core::scene::{Description, Document, Limits};
use serde_json::{Value, json};

use crate::{Asset, Converted, NoteKind, convert_gltf};

/// A white PNG of one texel.
const PNG: &str =
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mP8/5+hHgAHggJ/PchI7wAAAABJRU5ErkJggg==";

fn read(gltf: &Value) -> Result<Converted, String> {
    convert_gltf(gltf.to_string().as_bytes(), "a.gltf", &Limits::default()).map_err(|error| error.to_string())
}

/// What a file becomes, once it is sure that it is a document and that its meshes can be read.
fn ok(gltf: &Value) -> (Converted, Description) {
    let converted = read(gltf).unwrap_or_else(|error| panic!("{error}"));
    let text = converted.document.to_string();
    let document = Document::parse(&text, "a.json", &Limits::default()).unwrap_or_else(|problems| {
        panic!("{problems}\n{text}");
    });
    for asset in document.assets() {
        assert!(converted.assets.contains_key(&asset.path), "{} is not there", asset.path);
    }
    assert_eq!(document.assets().len(), converted.assets.len());
    for (path, asset) in &converted.assets {
        if let (true, Asset::Bytes(bytes)) = (path.ends_with(".ply"), asset) {
            mesh::read(bytes, path, 1 << 20).unwrap_or_else(|error| panic!("{path}: {error}"));
        }
    }
    let description = document.at(1).unwrap_or_else(|problems| panic!("{problems}"));
    (converted, description)
}

fn error(gltf: &Value) -> String {
    read(gltf).map_or_else(|error| error, |_| "nothing".to_owned())
}

/// The mesh of that number.
fn mesh_of(converted: &Converted, number: usize) -> Mesh {
    let prefix = format!("meshes/{number}");
    let (path, asset) = converted.assets.iter().find(|(path, _)| path.starts_with(&prefix)).unwrap();
    let Asset::Bytes(bytes) = asset else { panic!("{path} is a file") };
    mesh::read(bytes, path, 1000).unwrap()
}

/// The notes of a kind, without those that every file has.
fn notes(converted: &Converted, kind: NoteKind) -> Vec<String> {
    let common = ["materials: ", "cameras: ", "lights: "];
    let own = converted.notes.iter().filter(|note| note.kind == kind);
    own.map(|note| note.text.clone())
        .filter(|text| !common.iter().any(|start| text.starts_with(start)))
        .collect()
}

fn untranslated(converted: &Converted) -> Vec<String> {
    notes(converted, NoteKind::Untranslated)
}

fn differs(converted: &Converted) -> Vec<String> {
    notes(converted, NoteKind::Differs)
}

/// Asserts that two lists of numbers are the same up to rounding.
#[track_caller]
fn near(found: impl IntoIterator<Item = f64>, expected: &[f64]) {
    let found: Vec<f64> = found.into_iter().collect();
    let same = found.len() == expected.len()
        && found.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1.0e-6 * (1.0 + b.abs()));
    assert!(same, "found {found:?}, expected {expected:?}");
}

fn data(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))
}

/// Bytes of a buffer and the views of it.
#[derive(Default)]
struct Parts {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Parts {
    /// Adds a view of bytes, and gives its number.
    fn view(&mut self, bytes: &[u8]) -> usize {
        self.views.push(json!({"buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len()}));
        self.bytes.extend(bytes);
        self.views.len() - 1
    }

    /// Adds an accessor over a view of its own, and gives its number.
    fn add(&mut self, shape: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        self.accessors
            .push(json!({"bufferView": view, "componentType": component, "count": count, "type": shape}));
        self.accessors.len() - 1
    }

    fn floats(&mut self, shape: &str, numbers: &[f32]) -> usize {
        let width = ["SCALAR", "VEC2", "VEC3", "VEC4"].iter().position(|name| *name == shape).unwrap() + 1;
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.add(shape, 5126, numbers.len() / width, &bytes)
    }

    fn shorts(&mut self, numbers: &[u16]) -> usize {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        self.add("SCALAR", 5123, numbers.len(), &bytes)
    }

    /// A file with these parts, one scene with node 0, and more.
    fn file(&self, more: &Value) -> Value {
        let mut file = json!({
            "asset": {"version": "2.0"},
            "buffers": [{"byteLength": self.bytes.len(), "uri": data(&self.bytes)}],
            "bufferViews": self.views,
            "accessors": self.accessors,
            "scene": 0,
            "scenes": [{"nodes": [0]}],
        });
        for (name, value) in more.as_object().unwrap() {
            file[name] = value.clone();
        }
        file
    }
}

/// A unit square with corners as texture coordinates; glTF's v runs downwards.
fn square() -> (Parts, Value) {
    let mut parts = Parts::default();
    let positions = parts.floats("VEC3", &[0., 0., 0., 1., 0., 0., 1., 1., 0., 0., 1., 0.]);
    let uvs = parts.floats("VEC2", &[0., 1., 1., 1., 1., 0., 0., 0.]);
    let indices = parts.shorts(&[0, 1, 2, 0, 2, 3]);
    let primitive = json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs}, "indices": indices});
    (parts, primitive)
}

/// A file with the square under a material.
fn with_material(material: &Value, more: &Value) -> Value {
    let (parts, mut primitive) = square();
    primitive["material"] = json!(0);
    let mut file = parts.file(&json!({
        "nodes": [{"mesh": 0, "name": "square"}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [material],
        "textures": [{"source": 0}],
        "images": [{"uri": format!("data:image/png;base64,{PNG}"), "name": "white"}],
    }));
    for (name, value) in more.as_object().unwrap() {
        file[name] = value.clone();
    }
    file
}
