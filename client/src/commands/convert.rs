//! `karst convert`: a scene of another renderer becomes a karst document with the files that it names.

use std::fs::{File, Permissions};
use std::io::{self, Read, Write as _};
use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};

use karst_client::{Error, OpenScene};
use karst_convert::{Asset, Converted, Note, NoteKind, convert};
use serde_json::{Value, json};

use crate::args::ConvertArgs;
use crate::talk::Talk;

/// Notes that a command which is not about them shows.
const SHOWN: usize = 20;

pub(super) fn run(args: &ConvertArgs, talk: Talk) -> Result<(), Error> {
    let mut converted = convert(&args.input)?;
    for note in &converted.notes {
        talk.say(note);
    }
    let lost = converted.notes.iter().filter(|note| note.kind == NoteKind::Untranslated).count();
    if args.strict && lost > 0 {
        talk.event(&json!({"event": "refused", "notes": notes_json(&converted.notes)}));
        return Err(Error::Scene(format!("{}: {lost} things are not translated", args.input.display())));
    }
    let folder = folder_of(&args.output);
    leave_in_place(&mut converted, folder);
    let planned = plan(&converted, args, folder)?;
    for (path, asset) in &planned {
        write(path, asset)?;
    }
    let written: Vec<&Path> = planned.iter().map(|(path, _)| path.as_path()).collect();
    let text =
        format!("{}: {} files written, {lost} things not translated", args.output.display(), written.len());
    let event = json!({
        "event": "converted",
        "document": args.output,
        "written": written,
        "notes": notes_json(&converted.notes),
    });
    talk.result(&text, &event);
    Ok(())
}

/// Says what a scene that was converted on the way lacks or shows otherwise.
pub(super) fn say_notes(scene: &OpenScene, talk: Talk) {
    let notes = scene.notes();
    for note in notes.iter().take(SHOWN) {
        talk.say(note);
    }
    if notes.len() > SHOWN {
        talk.say(&format_args!("and {} notes more: `karst convert` lists them all", notes.len() - SHOWN));
    }
}

/// The same for scripts.
pub(super) fn notes_json(notes: &[Note]) -> Vec<Value> {
    let kind = |note: &Note| match note.kind {
        NoteKind::Untranslated => "untranslated",
        NoteKind::Differs => "differs",
    };
    let one =
        |note: &Note| json!({"file": note.file, "line": note.line, "kind": kind(note), "text": note.text});
    notes.iter().map(one).collect()
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Names files that lie in the folder of the document or below where they are.
fn leave_in_place(converted: &mut Converted, folder: &Path) {
    let Ok(root) = folder.canonicalize() else { return };
    converted.rename_assets(|_, asset| {
        let Asset::File(file) = asset else { return None };
        let file = file.canonicalize().ok()?;
        let within = file.strip_prefix(&root).ok()?.to_str()?.to_owned();
        // Others cannot be named in a document.
        let plain = |c: char| !c.is_control() && c != '\\';
        (within.len() <= 512 && within.chars().all(plain)).then_some(within)
    });
}

/// What is to be written where, the document last; what is there already is left out.
fn plan(converted: &Converted, args: &ConvertArgs, folder: &Path) -> Result<Vec<(PathBuf, Asset)>, Error> {
    let document = Asset::Bytes(converted.text().into_bytes());
    let assets = converted.assets.iter().map(|(path, asset)| (folder.join(path), asset.clone()));
    let mut planned = Vec::new();
    let mut foreign = Vec::new();
    for (path, asset) in assets.chain([(args.output.clone(), document)]) {
        match holds(&path, &asset).map_err(|source| Error::file(&path, source))? {
            Found::Nothing => planned.push((path, asset)),
            Found::Same => {}
            Found::Other if args.force => planned.push((path, asset)),
            Found::Other => foreign.push(path.display().to_string()),
        }
    }
    if foreign.is_empty() {
        return Ok(planned);
    }
    let list = foreign.join("\n  ");
    Err(Error::Usage(format!(
        "nothing is written: these files are there with other contents\n  {list}\n  hint: name another folder, or \
         overwrite them with --force"
    )))
}

/// What is at a path already.
enum Found {
    Nothing,
    Same,
    Other,
}

fn holds(path: &Path, asset: &Asset) -> Result<Found, io::Error> {
    let there = match File::open(path) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Found::Nothing),
        Err(error) => return Err(error),
    };
    let same = match asset {
        Asset::Bytes(bytes) => {
            there.metadata()?.len() == bytes.len() as u64 && equal(there, bytes.as_slice())?
        }
        Asset::File(source) => {
            let source = File::open(source)?;
            there.metadata()?.len() == source.metadata()?.len() && equal(there, source)?
        }
    };
    Ok(if same { Found::Same } else { Found::Other })
}

/// Whether two streams of the same length have the same bytes.
fn equal(mut a: impl Read, mut b: impl Read) -> Result<bool, io::Error> {
    let (mut left, mut right) = (vec![0; 1 << 16], vec![0; 1 << 16]);
    loop {
        let length = a.read(&mut left)?;
        if length == 0 {
            return Ok(true);
        }
        b.read_exact(&mut right[..length])?;
        if left[..length] != right[..length] {
            return Ok(false);
        }
    }
}

/// Writes a file so that nobody ever sees a part of it under this name.
fn write(path: &Path, asset: &Asset) -> Result<(), Error> {
    let folder = folder_of(path);
    let failed = |source| Error::file(path, source);
    std::fs::create_dir_all(folder).map_err(|source| Error::file(folder, source))?;
    let part = tempfile::Builder::new()
        .prefix(".karst-")
        .suffix(".part")
        .permissions(Permissions::from_mode(0o666))
        .tempfile_in(folder);
    let mut part = part.map_err(|source| Error::file(folder, source))?;
    match asset {
        Asset::Bytes(bytes) => part.write_all(bytes).map_err(failed)?,
        Asset::File(source) => {
            let mut source = File::open(source).map_err(|error| Error::file(source, error))?;
            io::copy(&mut source, part.as_file_mut()).map_err(failed)?;
        }
    }
    part.persist(path).map_err(|error| failed(error.error)).map(drop)
}
