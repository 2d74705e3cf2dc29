//! `karst check`: everything that a render would find wrong, without rendering.

use karst_client::{Error, OpenScene, open_scene, scene_error};
use karst_core::scene::{AlbedoPeak, Assets, Description, Limits, Model, Problems, Scene};
use serde_json::{Value, json};
use std::fmt::Write as _;

use crate::args::CheckArgs;
use crate::commands::convert::{notes_json, say_notes};
use crate::commands::marched;
use crate::talk::Talk;

pub(super) fn run(args: &CheckArgs, talk: Talk) -> Result<(), Error> {
    let scene = open_scene(&args.scene, &Limits::default())?;
    say_notes(&scene, talk);
    match check(args, &scene) {
        Ok(found) => {
            talk.result(&found.text, &found.json);
            Ok(())
        }
        Err(problems) => {
            talk.event(&problems_json(&problems));
            Err(scene_error(&problems))
        }
    }
}

/// What a valid scene holds.
struct Found {
    text: String,
    json: Value,
}

fn check(args: &CheckArgs, source: &OpenScene) -> Result<Found, Problems> {
    let limits = Limits::default();
    let document = source.document(&limits)?;
    let assets = Assets::load(&document, source, &limits)?;
    let frames = document.frames();
    let description = document.at(frames.first)?;
    let scene = Scene::build(&description, &assets, frames.first)?;
    let size = scene.size();
    let names: Vec<&str> = description.materials.iter().map(|(name, _)| name).collect();
    let peaks = scene.albedo_peaks();
    let mut text = format!(
        "{}: valid, {}x{} pixels, frames {} to {}, {} files",
        args.scene.display(),
        size.width,
        size.height,
        frames.first,
        frames.last,
        document.assets().len()
    );
    for peak in &peaks {
        let name = names[peak.material];
        let (share, angle) = (peak.albedo, peak.angle);
        let _ = write!(
            text,
            "\nmaterial {name:?}: reflects at most {share:.3} of white light, at {angle:.0} degrees"
        );
        // Of estimates to half a percent.
        if share > 1.005 {
            text += "; it gains energy";
            let model = description.materials.get(name).map(|material| &material.model);
            if let Some(Model::Principled { .. }) = model {
                text += ", which \"energy_conserving\": true prevents";
            }
        }
    }
    if !description.media.is_empty() {
        text += &media(&description);
    }
    let mut marches = serde_json::Map::new();
    for ((name, _), sdf) in description.sdf_objects.iter().zip(scene.distance_functions()) {
        let _ = write!(text, "\nsdf_object {name:?}: {}", marched::in_words(sdf));
        marches.insert(name.to_owned(), marched::as_json(sdf));
    }
    let mut dropped = serde_json::Map::new();
    for (name, entry) in description.meshes.iter() {
        let count = assets.mesh(&entry.file).map_or(0, |mesh| mesh.mesh.dropped);
        if count > 0 {
            let _ = write!(text, "\nmesh {name:?}: {count} triangles without area are left out");
            dropped.insert(name.to_owned(), count.into());
        }
    }
    let albedo = |peak: &AlbedoPeak| json!({"material": names[peak.material], "albedo": peak.albedo, "angle": peak.angle});
    let json = json!({
        "valid": true,
        "notes": notes_json(source.notes()),
        "width": size.width,
        "height": size.height,
        "first_frame": frames.first,
        "last_frame": frames.last,
        "files": document.assets().iter().map(|asset| asset.path.as_str()).collect::<Vec<_>>(),
        "sdf_objects": marches,
        "dropped_triangles": dropped,
        "albedo_peaks": peaks.iter().map(albedo).collect::<Vec<_>>(),
    });
    Ok(Found { text, json })
}

/// What fills space, in a line.
fn media(description: &Description) -> String {
    let around = match &description.medium {
        Some(name) => format!("{name:?} fills what is around all objects"),
        None => "nothing is around the objects".to_owned(),
    };
    format!("\nmedia: {}; {around}", description.media.iter().count())
}

fn problems_json(problems: &Problems) -> Value {
    let listed: Vec<Value> = problems
        .problems
        .iter()
        .map(|problem| {
            json!({
                "file": problem.origin,
                "line": problem.line,
                "column": problem.column,
                "path": problem.path,
                "message": problem.message,
                "hint": problem.hint,
            })
        })
        .collect();
    json!({"valid": false, "problems": listed, "total": problems.total})
}
