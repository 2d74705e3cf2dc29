//! Owns the tests of meshes and nodes.

use glam::{Vec2, Vec3};
use serde_json::{Value, json};

use super::{Parts, differs, error, mesh_of, near, ok, square, untranslated};

fn numbers(value: &Value) -> Vec<f64> {
    let Some(items) = value.as_array() else { return vec![value.as_f64().unwrap()] };
    items.iter().flat_map(numbers).collect()
}

#[test]
fn a_textured_square_keeps_its_corners_and_says_that_v_runs_downwards() {
    let (mut parts, mut primitive) = square();
    primitive["attributes"]["NORMAL"] =
        json!(parts.floats("VEC3", &[0., 0., 1., 0., 0., 1., 0., 0., 1., 0., 0., 1.]));
    let file = parts
        .file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"name": "A b/c", "primitives": [primitive]}]}));
    let (converted, _) = ok(&file);
    let mesh = mesh_of(&converted, 0);
    assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y]);
    assert_eq!(mesh.normals, [Vec3::Z; 4]);
    assert_eq!(mesh.uvs, [Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO]);
    assert_eq!(converted.document["meshes"], json!({"A b_c": {"file": "meshes/0-a_bc.ply", "flip_v": true}}));
    assert_eq!(converted.document["instances"], json!({"A b_c": {"mesh": "A b_c", "material": "default"}}));
}

#[test]
fn only_vertices_that_are_used_are_written() {
    let mut parts = Parts::default();
    let positions = parts.floats("VEC3", &[9., 9., 9., 0., 0., 0., 8., 8., 8., 1., 0., 0., 0., 1., 0.]);
    let indices = parts.shorts(&[1, 3, 4]);
    let primitive = json!({"attributes": {"POSITION": positions}, "indices": indices});
    let (converted, _) =
        ok(&parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]})));
    let mesh = mesh_of(&converted, 0);
    assert_eq!((mesh.positions, mesh.triangles), (vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]]));
}

/// The triangles of a row of five vertices on a curve, by the x of their corners.
fn row(mode: u32) -> Vec<[f32; 3]> {
    let mut parts = Parts::default();
    let corners: Vec<f32> = (0..5_u8).map(f32::from).flat_map(|x| [x, x * x, 0.0]).collect();
    let positions = parts.floats("VEC3", &corners);
    let primitive = json!({"attributes": {"POSITION": positions}, "mode": mode});
    let (converted, _) =
        ok(&parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]})));
    let mesh = mesh_of(&converted, 0);
    mesh.triangles.iter().map(|triangle| triangle.map(|index| mesh.positions[index as usize].x)).collect()
}

#[test]
fn strips_and_fans_keep_the_winding() {
    assert_eq!(row(4), [[0.0, 1.0, 2.0]]);
    assert_eq!(row(5), [[0.0, 1.0, 2.0], [1.0, 3.0, 2.0], [2.0, 3.0, 4.0]]);
    assert_eq!(row(6), [[1.0, 2.0, 0.0], [2.0, 3.0, 0.0], [3.0, 4.0, 0.0]]);
}

#[test]
fn points_and_lines_are_noted() {
    let (parts, mut primitive) = square();
    primitive["mode"] = json!(1);
    let file = parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]}));
    let (converted, _) = ok(&file);
    assert_eq!(untranslated(&converted), ["meshes[0].primitives[0]: has no triangles"]);
    assert_eq!(converted.document["instances"], json!({}));
}

#[test]
fn sparse_strided_and_normalized_accessors() {
    let mut parts = Parts::default();
    // Two numbers beside each position are passed over.
    let rows: Vec<f32> = [[0., 0., 0.], [1., 0., 0.], [7., 7., 7.]]
        .iter()
        .flat_map(|[x, y, z]| [*x, *y, *z, 5.0, 5.0])
        .collect();
    let positions = parts.floats("VEC3", &rows);
    parts.views[0]["byteStride"] = json!(20);
    parts.accessors[positions]["count"] = json!(3);
    let which = parts.view(&[2]);
    let values: Vec<u8> = [0.0_f32, 1.0, 0.0].iter().flat_map(|number| number.to_le_bytes()).collect();
    let values = parts.view(&values);
    parts.accessors[positions]["sparse"] = json!({
        "count": 1, "indices": {"bufferView": which, "componentType": 5121}, "values": {"bufferView": values},
    });
    let uvs = parts.add("VEC2", 5121, 3, &[0, 255, 51, 0, 255, 102]);
    parts.accessors[uvs]["normalized"] = json!(true);
    let normals = parts.add("VEC3", 5120, 3, &[0, 0, 127, 0, 0x81, 0, 0x80, 0, 0]);
    parts.accessors[normals]["normalized"] = json!(true);
    let primitive = json!({"attributes": {"POSITION": positions, "TEXCOORD_0": uvs, "NORMAL": normals}});
    let (converted, _) =
        ok(&parts.file(&json!({"nodes": [{"mesh": 0}], "meshes": [{"primitives": [primitive]}]})));
    let mesh = mesh_of(&converted, 0);
    assert_eq!(mesh.positions, [Vec3::ZERO, Vec3::X, Vec3::Y]);
    assert_eq!(mesh.uvs, [Vec2::Y, Vec2::new(0.2, 0.0), Vec2::new(1.0, 0.4)]);
    assert_eq!(mesh.normals, [Vec3::Z, Vec3::NEG_Y, Vec3::NEG_X]);
}

#[test]
fn instances_share_a_mesh_and_get_the_product_of_their_nodes() {
    let (parts, primitive) = square();
    let file = parts.file(&json!({
        "nodes": [
            {"children": [1, 2], "translation": [10, 0, 0], "scale": [2, 3, 4]},
            {"mesh": 0, "name": "turned", "rotation": [0, 0, 0.707_106_77, 0.707_106_77], "translation": [1, 1, 1]},
            {"mesh": 0, "name": "turned", "matrix": [1, 0, 0, 0, 0.5, 1, 0, 0, 0, 0, -1, 0, 5, 6, 7, 1]},
        ],
        "meshes": [{"name": "m", "primitives": [primitive]}],
    }));
    let (converted, description) = ok(&file);
    let document = &converted.document;
    assert_eq!(document["meshes"].as_object().unwrap().len(), 1);
    let matrix = |name: &str| numbers(&document["instances"][name]["transform"]["matrix"]);
    near(matrix("turned"), &[0., -2., 0., 12., 3., 0., 0., 3., 0., 0., 4., 4., 0., 0., 0., 1.]);
    near(matrix("turned_1"), &[2., 1., 0., 20., 0., 3., 0., 18., 0., 0., -4., 28., 0., 0., 0., 1.]);
    assert_eq!(description.instances.len(), 2);
}

#[test]
fn each_primitive_is_a_mesh_with_its_own_material() {
    let (parts, primitive) = square();
    let (mut first, mut second) = (primitive.clone(), primitive);
    first["material"] = json!(1);
    second["material"] = json!(0);
    let file = parts.file(&json!({
        "nodes": [{"mesh": 0, "name": "n"}],
        "meshes": [{"name": "m", "primitives": [first, second]}],
        "materials": [{"name": "red"}, {"name": "green"}],
    }));
    let (converted, _) = ok(&file);
    assert_eq!(
        converted.document["instances"],
        json!({"n": {"mesh": "m", "material": "green"}, "n_1": {"mesh": "m_1", "material": "red"}})
    );
}

#[test]
fn what_is_scaled_to_nothing_is_noted() {
    let (parts, primitive) = square();
    let file = parts
        .file(&json!({"nodes": [{"mesh": 0, "scale": [1, 0, 1]}], "meshes": [{"primitives": [primitive]}]}));
    let (converted, _) = ok(&file);
    assert_eq!(untranslated(&converted), ["nodes[0]: a mesh that is scaled to nothing in some direction"]);
}

#[test]
fn what_moves_or_colours_vertices_is_noted() {
    let (mut parts, mut primitive) = square();
    primitive["targets"] = json!([{}]);
    primitive["attributes"]["COLOR_0"] = json!(parts.floats("VEC3", &[1.0; 12]));
    let file = parts.file(&json!({
        "nodes": [{"mesh": 0, "skin": 0}],
        "meshes": [{"primitives": [primitive]}],
        "skins": [{"joints": [0]}],
        "animations": [{"channels": [], "samplers": []}],
        "scenes": [{"nodes": [0]}, {}],
    }));
    let (converted, _) = ok(&file);
    assert_eq!(
        untranslated(&converted),
        [
            "animations: 1 animations: the scene stands as its nodes say",
            "scenes: 1 scenes beside scenes[0]",
            "meshes[0].primitives[0]: morph targets: the mesh is as it is without them",
            "meshes[0].primitives[0]: colours of vertices",
        ]
    );
    assert_eq!(differs(&converted), ["nodes[0]: bones do not move the mesh: it stands as it was modelled"]);
}

#[test]
fn nodes_that_are_no_tree_are_refused() {
    let twice = "is reached a second time: it has two parents, or is among its own descendants";
    let file = |nodes: Value| Parts::default().file(&json!({"nodes": nodes, "buffers": []}));
    assert_eq!(
        error(&file(json!([{"children": [1]}, {"children": [0]}]))),
        format!("a.gltf: nodes[0]: {twice}")
    );
    assert_eq!(
        error(&file(json!([{"children": [1, 2]}, {"children": [2]}, {}]))),
        format!("a.gltf: nodes[2]: {twice}")
    );
    assert_eq!(
        error(&file(json!([{"children": [7]}]))),
        "a.gltf: nodes: found the index 7, the file has 1 nodes"
    );
    assert_eq!(
        error(&file(json!([{"rotation": [0, 0, 0, 0]}]))),
        "a.gltf: nodes[0]: found a rotation of length 0, expected a unit quaternion"
    );
    assert_eq!(
        error(&file(json!([{"scale": [1e200, 1, 1], "children": [1]}, {"scale": [1e200, 1, 1]}]))),
        "a.gltf: nodes[1]: its place in the world is not finite"
    );
    // Before anything below is looked at: what waits to be visited must not outgrow the nodes.
    let bad = json!({"rotation": [0, 0, 0, 0]});
    let many = vec![1; 1000];
    assert_eq!(error(&file(json!([{"children": many}, bad]))), format!("a.gltf: nodes[1]: {twice}"));
    let mut roots = file(json!([bad]));
    roots["scenes"] = json!([{"nodes": [0, 0]}]);
    assert_eq!(error(&roots), format!("a.gltf: nodes[0]: {twice}"));
}

#[test]
fn a_chain_of_many_nodes_is_walked() {
    let mut nodes: Vec<Value> = (1..20_000).map(|next| json!({"children": [next]})).collect();
    nodes.push(json!({}));
    ok(&Parts::default().file(&json!({"nodes": nodes, "buffers": []})));
}
