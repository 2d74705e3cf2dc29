//! Owns what a scene is converted to: tables of named things, asset files, notes.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json, json};

use super::load::{Scene, find};
use super::object::Object;
use super::place::Place;
use crate::parts::{MAX_NAME, allowed, clean_name};
use crate::{Asset, ConvertError, Converted, Note, NoteKind};

/// A table of the document.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Table {
    Materials,
    Meshes,
    Instances,
    Spheres,
    Lights,
    Media,
}

/// What stands before the tables.
const HEAD: [&str; 5] = ["camera", "film", "sampling", "integrator", "medium"];

/// The tables in the order of the document.
const TABLES: [(Table, &str); 6] = [
    (Table::Materials, "materials"),
    (Table::Meshes, "meshes"),
    (Table::Instances, "instances"),
    (Table::Spheres, "spheres"),
    (Table::Lights, "lights"),
    (Table::Media, "media"),
];

/// The document while it is made.
#[derive(Debug)]
pub(super) struct Output<'a> {
    pub(super) scene: &'a Scene,
    /// What stands before the tables: camera, film, sampling, integrator, medium.
    pub(super) head: Map<String, Json>,
    /// Names of the materials of objects that have been converted.
    pub(super) materials: BTreeMap<usize, String>,
    /// Names of the media of objects that have been converted, where documents can have them.
    pub(super) media: BTreeMap<usize, Option<String>>,
    /// Names of the media that are inside of something.
    pub(super) fillings: BTreeSet<String>,
    /// Media that shapes name as what is around them.
    pub(super) surroundings: Vec<(Place, String)>,
    /// Names of meshes by what they are made of.
    pub(super) meshes: BTreeMap<String, String>,
    tables: BTreeMap<Table, Map<String, Json>>,
    assets: BTreeMap<String, Asset>,
    /// Paths of assets by the files they come from.
    sources: BTreeMap<PathBuf, String>,
    notes: Vec<(Place, NoteKind, String)>,
    /// How often a name has been asked for.
    names: BTreeMap<(Table, String), u32>,
}

impl<'a> Output<'a> {
    pub(super) fn new(scene: &'a Scene) -> Self {
        Self {
            scene,
            head: Map::new(),
            materials: BTreeMap::new(),
            media: BTreeMap::new(),
            fillings: BTreeSet::new(),
            surroundings: Vec::new(),
            meshes: BTreeMap::new(),
            tables: BTreeMap::new(),
            assets: BTreeMap::new(),
            sources: BTreeMap::new(),
            notes: Vec::new(),
            names: BTreeMap::new(),
        }
    }

    /// An object of the scene, of which everything unused will be worth a note.
    pub(super) fn object(&self, index: usize) -> &'a Object {
        let object = &self.scene.objects[index];
        object.converted.set(true);
        object
    }

    /// Something is not in the document.
    pub(super) fn untranslated(&mut self, place: &Place, text: impl Into<String>) {
        self.notes.push((place.clone(), NoteKind::Untranslated, text.into()));
    }

    /// Something has a somewhat different meaning in the document.
    pub(super) fn differs(&mut self, place: &Place, text: impl Into<String>) {
        self.notes.push((place.clone(), NoteKind::Differs, text.into()));
    }

    /// A number within what the document allows; one that is not is moved there and noted.
    pub(super) fn within(&mut self, place: &Place, what: &str, number: f64, [least, most]: [f64; 2]) -> f64 {
        if (least..=most).contains(&number) {
            return number;
        }
        let nearest = number.clamp(least, most);
        self.differs(place, format!("{what} is {number}, karst has {least} to {most}: taken as {nearest}"));
        nearest
    }

    /// A name that the document allows and that nothing in the table has yet.
    pub(super) fn name(&mut self, table: Table, wanted: &str) -> String {
        let mut name = clean_name(wanted);
        if name.is_empty() {
            "unnamed".clone_into(&mut name);
        }
        loop {
            let count = self.names.entry((table, name.clone())).or_insert(0);
            *count += 1;
            if *count == 1 {
                return name;
            }
            let next = format!("{name} {count}");
            if let Entry::Vacant(free) = self.names.entry((table, next.clone())) {
                free.insert(1);
                return next;
            }
        }
    }

    /// Adds a thing under a name that [`Output::name`] gave.
    pub(super) fn add(&mut self, table: Table, name: String, value: impl Into<Json>) {
        self.tables.entry(table).or_default().insert(name, value.into());
    }

    /// A thing that has been added.
    pub(super) fn get(&self, table: Table, name: &str) -> Option<&Json> {
        self.tables.get(&table)?.get(name)
    }

    /// The file that the scene calls `name`.
    pub(super) fn find(&self, name: &str, place: &Place) -> Result<PathBuf, ConvertError> {
        find(&self.scene.folders, name)
            .ok_or_else(|| place.error(format!("found the file {name:?}, which does not exist")))
    }

    /// The path in the document of a file of the scene.
    pub(super) fn file(&mut self, folder: &str, source: &Path) -> String {
        if let Some(path) = self.sources.get(source) {
            return path.clone();
        }
        let name = source.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        let path = self.asset(folder, &name, Asset::File(source.to_owned()));
        self.sources.insert(source.to_owned(), path.clone());
        path
    }

    /// The path in the document of a new file.
    pub(super) fn bytes(&mut self, folder: &str, name: &str, bytes: Vec<u8>) -> String {
        self.asset(folder, name, Asset::Bytes(bytes))
    }

    fn asset(&mut self, folder: &str, name: &str, asset: Asset) -> String {
        let name: String = name.chars().map(|c| if c == '.' { c } else { allowed(c) }).collect();
        let (stem, ending) = name.rsplit_once('.').unwrap_or((&name, ""));
        let stem: String = stem.trim_start_matches('.').chars().take(MAX_NAME).collect();
        let numbered = |number: u32| match number {
            1 => format!("{folder}/{stem}.{ending}"),
            number => format!("{folder}/{stem}-{number}.{ending}"),
        };
        let path =
            (1..=u32::MAX).map(numbered).find(|path| !self.assets.contains_key(path)).unwrap_or_default();
        self.assets.insert(path.clone(), asset);
        path
    }

    /// The finished document, with a note for everything in converted objects that nobody asked for.
    pub(super) fn finish(mut self) -> Converted {
        self.note_unused();
        let mut document = Map::from_iter([("version".to_owned(), json!(1))]);
        let mut head = self.head;
        document.extend(HEAD.iter().filter_map(|name| head.remove_entry(*name)));
        for (table, name) in TABLES {
            if let Some(entries) = self.tables.remove(&table) {
                document.insert(name.to_owned(), Json::Object(entries));
            }
        }
        // Of a file that was opened twice the first place counts.
        let files = self.scene.files.iter().enumerate().rev();
        let order: BTreeMap<&str, usize> = files.map(|(at, file)| (&**file, at)).collect();
        let mut notes = self.scene.notes.clone();
        notes.extend(self.notes.into_iter().map(|(place, kind, text)| Note {
            file: place.file.to_string(),
            line: place.line,
            kind,
            text,
        }));
        notes.sort_by_key(|note| (order.get(note.file.as_str()).copied(), note.line));
        let mut seen = BTreeSet::new();
        notes.retain(|note| seen.insert((note.file.clone(), note.line, note.text.clone())));
        Converted { document: Json::Object(document), assets: self.assets, notes }
    }

    fn note_unused(&mut self) {
        let scene = self.scene;
        for object in scene.objects.iter().filter(|object| object.converted.get()) {
            for property in object.properties.iter().filter(|property| !property.used.get()) {
                let (kind, name) = (property.value.kind(), &property.name);
                let what = if name.is_empty() { kind.to_owned() } else { format!("{kind} {name:?}") };
                self.untranslated(&property.place, format!("{what} of a {}", object.title()));
            }
        }
    }
}
