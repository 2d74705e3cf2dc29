//! Owns what becomes of a glTF file while it is converted: tables of the document, files, notes, names.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt::Display;

use karst_core::scene::Limits;
use serde_json::{Map, Value};

use crate::parts::clean_name;
use crate::{Asset, Note, NoteKind};

/// The parts of the document, the files it names, and what is said about them.
#[derive(Debug)]
pub(super) struct Output<'a> {
    file: &'a str,
    pub(super) materials: Map<String, Value>,
    pub(super) meshes: Map<String, Value>,
    pub(super) instances: Map<String, Value>,
    pub(super) lights: Map<String, Value>,
    pub(super) assets: BTreeMap<String, Asset>,
    pub(super) notes: Vec<Note>,
    /// Triangles that may still be written.
    pub(super) triangles: u64,
    /// Files of the images that were looked at; none where there is nothing that can be used.
    pub(super) images: BTreeMap<u32, Option<String>>,
    /// Numbers that may still be read out of accessors.
    pub(super) elements: u64,
    /// Bytes that may still be written.
    bytes: u64,
}

impl<'a> Output<'a> {
    /// Nothing yet.
    pub(super) fn new(file: &'a str, limits: &Limits) -> Self {
        Self {
            file,
            materials: Map::new(),
            meshes: Map::new(),
            instances: Map::new(),
            lights: Map::new(),
            assets: BTreeMap::new(),
            notes: Vec::new(),
            images: BTreeMap::new(),
            triangles: limits.max_triangles,
            elements: limits.max_triangles.saturating_mul(4),
            bytes: limits.max_asset_bytes,
        }
    }

    /// Says that something of the file is not in the document.
    pub(super) fn untranslated(&mut self, place: impl Display, text: impl Display) {
        self.note(NoteKind::Untranslated, place, text);
    }

    /// Says that something has another meaning in the document.
    pub(super) fn differs(&mut self, place: impl Display, text: impl Display) {
        self.note(NoteKind::Differs, place, text);
    }

    fn note(&mut self, kind: NoteKind, place: impl Display, text: impl Display) {
        let text = format!("{place}: {text}");
        self.notes.push(Note { file: self.file.to_owned(), line: 0, kind, text });
    }

    /// Notes extensions that are not read.
    pub(super) fn others<T>(&mut self, place: impl Display, others: &BTreeMap<String, T>) {
        for name in others.keys() {
            self.untranslated(&place, format!("the extension {name:.100}"));
        }
    }

    /// Keeps the bytes of a file that the document names, or says how many are left for it.
    pub(super) fn keep(&mut self, path: String, bytes: Cow<'_, [u8]>) -> Result<(), String> {
        let (size, left) = (bytes.len() as u64, self.bytes);
        self.bytes = left
            .checked_sub(size)
            .ok_or_else(|| format!("becomes {size} bytes, {left} are left of the limit for all files"))?;
        self.assets.insert(path, Asset::Bytes(bytes.into_owned()));
        Ok(())
    }
}

/// Adds an entry to a table of the document under a name like the wanted one that is still free, and gives the name.
pub(super) fn add(
    table: &mut Map<String, Value>,
    wanted: Option<&str>,
    otherwise: &str,
    entry: Value,
) -> String {
    let mut name = clean_name(wanted.unwrap_or_default());
    if name.is_empty() {
        otherwise.clone_into(&mut name);
    }
    if table.contains_key(&name) {
        // The size of the table is a number that no earlier entry of that name has.
        name = format!("{name}_{}", table.len());
        while table.contains_key(&name) {
            name.push('_');
        }
    }
    table.insert(name.clone(), entry);
    name
}

/// Name of a file in the document's folder: a number, and what of a name every file system can hold.
pub(super) fn file_name(folder: &str, number: usize, name: Option<&str>, extension: &str) -> String {
    let plain = name.unwrap_or_default().chars().filter_map(|c| match c {
        'a'..='z' | '0'..='9' | '-' | '_' => Some(c),
        'A'..='Z' => Some(c.to_ascii_lowercase()),
        ' ' | '.' => Some('_'),
        _ => None,
    });
    let plain: String = plain.take(40).collect();
    let dash = if plain.is_empty() { "" } else { "-" };
    format!("{folder}/{number}{dash}{plain}.{extension}")
}
