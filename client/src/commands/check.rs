//! `karst check`: everything that a render would find wrong, without rendering.

use karst_client::{Error, read_document, scene_error, scene_folder};
use karst_core::scene::{AlbedoPeak, Assets, Document, Folder, Limits, Problems, Scene};
use serde_json::{Value, json};
use std::fmt::Write as _;

use crate::args::CheckArgs;
use crate::talk::Talk;

pub(super) fn run(args: &CheckArgs, talk: Talk) -> Result<(), Error> {
    let text = read_document(&args.scene, &Limits::default())?;
    let root = scene_folder(&args.scene);
    let folder = Folder::new(root).map_err(|source| Error::file(root, source))?;
    match check(args, &text, &folder) {
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

fn check(args: &CheckArgs, text: &str, folder: &Folder) -> Result<Found, Problems> {
    let limits = Limits::default();
    let document = Document::parse(text, &args.scene.display().to_string(), &limits)?;
    let assets = Assets::load(&document, folder, &limits)?;
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
            text += "; it gains energy, which \"energy_conserving\": true prevents";
        }
    }
    let albedo = |peak: &AlbedoPeak| json!({"material": names[peak.material], "albedo": peak.albedo, "angle": peak.angle});
    let json = json!({
        "valid": true,
        "width": size.width,
        "height": size.height,
        "first_frame": frames.first,
        "last_frame": frames.last,
        "files": document.assets().iter().map(|asset| asset.path.as_str()).collect::<Vec<_>>(),
        "albedo_peaks": peaks.iter().map(albedo).collect::<Vec<_>>(),
    });
    Ok(Found { text, json })
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
