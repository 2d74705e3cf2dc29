//! Owns the measurement of rays against the triangles of one mesh: how many a second, by one thread.
//!
//! `cargo bench -p karst-core --bench rays -- MESH PREFIX RUNS` reads a mesh (u32 vertices, u32 triangles, f32 positions, u32
//! corners) and the files PREFIX.{primary,bounce,shadow,edge}.rays (u32 count, then origin, least t, direction, greatest t of
//! each), casts all rays RUNS times and writes what they met to PREFIX.KIND.karst.hits (f32 t, u32 triangle). Shadow rays ask
//! for any hit. Without arguments it does nothing: `bench/rays.py` makes the files and sets Embree beside it.
#![allow(
    clippy::print_stdout,
    clippy::disallowed_methods,
    reason = "a measurement reads the clock and prints its figures"
)]

use glam::Vec3;
use karst_core::bvh::Cast;
use karst_core::bvh::triangle::TriangleBvh;
use std::error::Error;
use std::fs;
use std::time::Instant;

/// Kinds of rays, and whether they are cast again and again: those at edges only look for leaks.
const KINDS: [(&str, bool); 4] = [("primary", true), ("bounce", true), ("shadow", true), ("edge", false)];

struct CastRay {
    origin: Vec3,
    direction: Vec3,
    t_max: f32,
}

/// Groups of four bytes, little endian.
fn words(path: &str) -> Result<Vec<[u8; 4]>, Box<dyn Error>> {
    let bytes = fs::read(path).map_err(|e| format!("{path}: {e}"))?;
    Ok(bytes.chunks_exact(4).map(|word| [word[0], word[1], word[2], word[3]]).collect())
}

fn read_mesh(path: &str) -> Result<Vec<[Vec3; 3]>, Box<dyn Error>> {
    let words = words(path)?;
    let [vertices, triangles] = [0, 1].map(|at| u32::from_le_bytes(words[at]) as usize);
    let positions: Vec<f32> = words[2..2 + 3 * vertices].iter().map(|w| f32::from_le_bytes(*w)).collect();
    let corners = words[2 + 3 * vertices..][..3 * triangles].iter().map(|w| u32::from_le_bytes(*w) as usize);
    let corners: Vec<Vec3> = corners.map(|at| Vec3::from_slice(&positions[3 * at..])).collect();
    Ok(corners.chunks_exact(3).map(|of| [of[0], of[1], of[2]]).collect())
}

fn read_rays(path: &str) -> Result<Vec<CastRay>, Box<dyn Error>> {
    let words = words(path)?;
    let numbers: Vec<f32> = words[1..].iter().map(|w| f32::from_le_bytes(*w)).collect();
    let ray = |of: &[f32]| CastRay {
        origin: Vec3::from_slice(of),
        direction: Vec3::from_slice(&of[4..]),
        t_max: of[7],
    };
    Ok(numbers.chunks_exact(8).map(ray).collect())
}

/// What each ray meets: distance (infinite where nothing, 0 where anything) and triangle.
fn cast(tree: &TriangleBvh, rays: &[CastRay], any: bool, found: &mut Vec<(f32, u32)>) {
    found.clear();
    found.extend(rays.iter().map(|ray| {
        let cast = Cast::new(ray.origin, ray.direction);
        if any {
            return (if tree.occluded(&cast, ray.t_max) { 0.0 } else { f32::INFINITY }, 0);
        }
        tree.intersect(&cast, ray.t_max).map_or((f32::INFINITY, 0), |hit| (hit.t, hit.triangle))
    }));
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let [mesh, prefix, runs] = arguments.as_slice() else {
        println!("see bench/rays.py");
        return Ok(());
    };
    let triangles = read_mesh(mesh)?;
    let started = Instant::now();
    let tree = TriangleBvh::build(triangles.iter().copied())?;
    let seconds = started.elapsed().as_secs_f64();
    println!("BUILD\t{seconds:.3}\t{:.1}", tree.bytes() as f64 / triangles.len() as f64);
    for (kind, again) in KINDS {
        let path = format!("{prefix}.{kind}.rays");
        if !fs::exists(&path)? {
            continue;
        }
        let rays = read_rays(&path)?;
        let mut found = Vec::with_capacity(rays.len());
        for _ in 0..if again { runs.parse()? } else { 1 } {
            let started = Instant::now();
            cast(&tree, &rays, kind == "shadow", &mut found);
            println!("RAYS\t{kind}\t{:.4}", rays.len() as f64 / started.elapsed().as_secs_f64() * 1e-6);
        }
        let bytes: Vec<u8> = found
            .iter()
            .flat_map(|(t, triangle)| [t.to_le_bytes(), triangle.to_le_bytes()])
            .flatten()
            .collect();
        fs::write(format!("{prefix}.{kind}.karst.hits"), bytes)?;
    }
    Ok(())
}
