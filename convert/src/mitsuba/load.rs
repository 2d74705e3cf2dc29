//! Owns loading a scene: files and what they include, defaults and variables, elements to objects, ids to objects.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use glam::DMat4;

use super::color::Color;
use super::object::{Object, Property, Value};
use super::place::Place;
use super::transform;
use super::value;
use super::xml::{self, Attributes, Element};
use crate::{ConvertError, Note, NoteKind};

/// Most bytes of a scene's XML files and of what its variables stand for, together; a file that is included twice counts
/// twice, a variable as often as it is used.
const MAX_BYTES: u64 = 64 << 20;
/// Most bytes of a file with a spectrum.
const MAX_SPECTRUM: u64 = 1 << 20;
/// Most files that include each other.
const MAX_INCLUDES: usize = 15;
/// Deepest nesting of objects, through references and included files.
const MAX_DEPTH: usize = 64;
/// Most variables, and the longest name of one in bytes.
const MAX_DEFAULTS: usize = 4096;
const MAX_VARIABLE: usize = 100;
/// Most folders in which files are looked for.
const MAX_FOLDERS: usize = 64;
/// Ids that are compared with one that is not there: so many, and so long in bytes.
const MAX_NEAR: usize = 4096;
const MAX_NEAR_ID: usize = 64;

/// Everything that a scene's XML says.
#[derive(Debug)]
pub(super) struct Scene {
    /// In the order of the documents, an object before what is in it.
    pub(super) objects: Vec<Object>,
    /// Number of the scene itself.
    pub(super) root: usize,
    /// Where files are looked for, in this order.
    pub(super) folders: Vec<PathBuf>,
    /// The XML files, as messages call them, in the order in which they were opened.
    pub(super) files: Vec<Rc<str>>,
    /// Whether the scene was written for a Mitsuba before 2.
    pub(super) legacy: bool,
    /// What was not understood.
    pub(super) notes: Vec<Note>,
}

/// Tags of plugins.
#[rustfmt::skip]
const OBJECTS: [&str; 15] = [
    "integrator", "sensor", "sampler", "film", "rfilter", "bsdf", "texture", "spectrum", "shape", "emitter", "medium",
    "phase", "volume", "subsurface", "scene",
];

/// Reads a scene and everything that it includes.
pub(super) fn load(path: &Path) -> Result<Scene, ConvertError> {
    let mut loader = Loader { left: MAX_BYTES, ..Loader::default() };
    let (file, text) = loader.open(path)?;
    loader.folders.push(folder_of(path));
    loader.including.push(path.canonicalize().unwrap_or_else(|_| path.to_owned()));
    let element = xml::parse(&text, &file)?;
    if element.tag != "scene" {
        let message = format!("found <{}>, expected <scene>: a Mitsuba scene", element.tag);
        return Err(element.place.error(message));
    }
    loader.legacy = is_legacy(&element);
    let root = loader.object(&element, &element.attributes, "scene", 0)?;
    let Loader { mut objects, ids, folders, files, legacy, notes, .. } = loader;
    link(&mut objects, &ids)?;
    Ok(Scene { objects, root, folders, files, legacy, notes })
}

/// Whether the version is below 2; scenes without one are taken for new ones.
fn is_legacy(element: &Element) -> bool {
    let major =
        element.attributes.get("version").and_then(|version| version.split('.').next()?.trim().parse().ok());
    major.is_some_and(|major: u32| major < 2)
}

fn folder_of(path: &Path) -> PathBuf {
    let parent = path.parent().filter(|parent| !parent.as_os_str().is_empty());
    parent.unwrap_or(Path::new(".")).to_owned()
}

/// The first of the folders that has a file; Windows' separators are understood.
pub(super) fn find(folders: &[PathBuf], name: &str) -> Option<PathBuf> {
    let name = name.replace('\\', "/");
    folders.iter().map(|folder| folder.join(&name)).find(|path| path.is_file())
}

#[derive(Default)]
struct Loader {
    objects: Vec<Object>,
    ids: BTreeMap<String, (usize, Place)>,
    defaults: BTreeMap<String, String>,
    folders: Vec<PathBuf>,
    files: Vec<Rc<str>>,
    notes: Vec<Note>,
    legacy: bool,
    /// The files that are being read, each included by the one before.
    including: Vec<PathBuf>,
    /// Bytes left of the limit for all text.
    left: u64,
}

impl Loader {
    /// The text of an XML file, and what messages call it.
    fn open(&mut self, path: &Path) -> Result<(Rc<str>, String), ConvertError> {
        let failed = |source: io::Error| ConvertError::File { path: path.to_owned(), source };
        let size = std::fs::metadata(path).map_err(failed)?.len();
        let name: Rc<str> = path.display().to_string().into();
        let Some(left) = self.left.checked_sub(size) else {
            let message =
                format!("has {size} bytes, {} are left of the limit of {MAX_BYTES} for all XML", self.left);
            return Err(ConvertError::scene(&*name, 0, message));
        };
        self.left = left;
        let bytes = std::fs::read(path).map_err(failed)?;
        let text = String::from_utf8(bytes).map_err(|error| {
            let before = &error.as_bytes()[..error.utf8_error().valid_up_to()];
            let line = before.split(|&byte| byte == b'\n').count() as u32;
            ConvertError::scene(&*name, line, "found bytes that are not UTF-8").with_hint("save it as UTF-8")
        })?;
        self.files.push(Rc::clone(&name));
        Ok((name, text))
    }

    fn note(&mut self, place: &Place, text: String) {
        let (file, line) = (place.file.to_string(), place.line);
        self.notes.push(Note { file, line, kind: NoteKind::Untranslated, text });
    }

    /// Makes an object of an element, its attributes (already without variables) and its type.
    fn object(
        &mut self,
        element: &Element,
        attributes: &Attributes,
        plugin: &str,
        depth: usize,
    ) -> Result<usize, ConvertError> {
        let place = element.place.clone();
        if depth > MAX_DEPTH {
            return Err(place.error(format!("found objects nested more than {MAX_DEPTH} deep")));
        }
        let index = self.objects.len();
        let id = attributes.get("id").map(str::to_owned);
        if let Some(id) = &id {
            self.take(id, index, &place)?;
        }
        let (tag, plugin) = (element.tag.clone(), plugin.to_owned());
        let converted = Cell::new(false);
        self.objects.push(Object { tag, plugin, id, place, properties: Vec::new(), converted });
        let mut properties = Vec::new();
        for child in &element.children {
            self.child(child, &mut properties, depth + 1)?;
        }
        self.objects[index].properties = properties;
        Ok(index)
    }

    /// Gives an object an id.
    fn take(&mut self, id: &str, index: usize, place: &Place) -> Result<(), ConvertError> {
        match self.ids.insert(id.to_owned(), (index, place.clone())) {
            None => Ok(()),
            Some((_, Place { file, line })) => {
                Err(place.error(format!("found the id {id:?}, which the object at {file}:{line} has")))
            }
        }
    }

    /// Understands an element within an object.
    fn child(
        &mut self,
        element: &Element,
        into: &mut Vec<Property>,
        depth: usize,
    ) -> Result<(), ConvertError> {
        let attributes = self.substitute(element)?;
        let place = &element.place;
        let need = |name: &str| {
            attributes
                .get(name)
                .ok_or_else(|| place.error(format!("found <{}> without {name:?}", element.tag)))
        };
        match element.tag.as_str() {
            "default" => return self.variable(need("name")?, need("value")?, place),
            "path" => return self.folder(need("value")?, place),
            "include" => return self.include(need("filename")?, place, into, depth),
            "alias" => return self.alias(need("id")?, need("as")?, place),
            _ => {}
        }
        let plugin = attributes.get("type").filter(|_| OBJECTS.contains(&element.tag.as_str()));
        let value = if element.tag == "ref" {
            Some(Value::Reference(need("id")?.to_owned()))
        } else if let Some(plugin) = plugin {
            Some(Value::Object(self.object(element, &attributes, plugin, depth)?))
        } else if element.tag == "transform" {
            Some(Value::Transform(self.transform(element)?))
        } else {
            self.plain(&element.tag, &attributes).map_err(|message| place.error(message))?
        };
        let Some(value) = value else {
            self.note(place, format!("<{}>, which karst does not know", element.tag));
            return Ok(());
        };
        let name = value::snake(attributes.get("name").unwrap_or_default());
        into.push(Property { name, place: place.clone(), value, used: Cell::new(false) });
        Ok(())
    }

    /// The value of an element that is not an object; `None` for an unknown one.
    fn plain(&self, tag: &str, attributes: &Attributes) -> Result<Option<Value>, String> {
        let text = || attributes.get("value").ok_or(format!("found <{tag}> without \"value\""));
        Ok(Some(match tag {
            "boolean" => Value::Flag(value::flag(text()?)?),
            "integer" => Value::Integer(value::integer(text()?)?),
            "float" => Value::Number(value::number(text()?)?),
            "string" => Value::Text(text()?.to_owned()),
            "rgb" => Value::Color(Color::rgb(text()?)?),
            "srgb" => Value::Color(Color::srgb(text()?)?),
            "spectrum" => Value::Color(match attributes.get("filename") {
                Some(name) => self.spectrum_file(name)?,
                None => Color::spectrum(text()?)?,
            }),
            "blackbody" => Value::Color(blackbody(attributes)?),
            "point" | "vector" => Value::Vector(transform::xyz(attributes, 0.0)?),
            _ => return Ok(None),
        }))
    }

    fn transform(&mut self, element: &Element) -> Result<DMat4, ConvertError> {
        let mut whole = DMat4::IDENTITY;
        for child in &element.children {
            let attributes = self.substitute(child)?;
            let operation = transform::operation(&child.tag, &attributes, self.legacy);
            whole = operation.map_err(|message| child.place.error(message))? * whole;
        }
        if whole.is_finite() {
            return Ok(whole);
        }
        Err(element.place.error("found a transform whose numbers are not finite"))
    }

    fn spectrum_file(&self, name: &str) -> Result<Color, String> {
        let path =
            find(&self.folders, name).ok_or(format!("found the file {name:?}, which does not exist"))?;
        let wrong = |error: &dyn std::fmt::Display| format!("file {name:?}: {error}");
        let size = std::fs::metadata(&path).map_err(|error| wrong(&error))?.len();
        if size > MAX_SPECTRUM {
            return Err(wrong(&format!("has {size} bytes, the limit is {MAX_SPECTRUM}")));
        }
        let text = std::fs::read_to_string(&path).map_err(|error| wrong(&error))?;
        Color::table_file(&text).map_err(|error| wrong(&error))
    }

    /// Gives a variable its value, unless it has one.
    fn variable(&mut self, name: &str, value: &str, place: &Place) -> Result<(), ConvertError> {
        let length = name.len();
        if !(1..=MAX_VARIABLE).contains(&length) {
            let message =
                format!("found a <default> whose name has {length} bytes, expected 1 to {MAX_VARIABLE}");
            return Err(place.error(message));
        }
        if self.defaults.contains_key(name) {
            return Ok(());
        }
        if self.defaults.len() == MAX_DEFAULTS {
            return Err(place.error(format!("found more than {MAX_DEFAULTS} variables, which is the limit")));
        }
        self.defaults.insert(name.to_owned(), value.to_owned());
        Ok(())
    }

    /// The attributes of an element with `$name` replaced by the value of the default `name`.
    fn substitute(&mut self, element: &Element) -> Result<Attributes, ConvertError> {
        let mut attributes = element.attributes.clone();
        for (_, value) in attributes.0.iter_mut().filter(|(_, value)| value.contains('$')) {
            *value = self.replace(value, &element.place)?;
        }
        Ok(attributes)
    }

    /// Text with its variables replaced. What they stand for counts as if it were read: variables of variables would
    /// make any amount of text out of a few lines.
    fn replace(&mut self, text: &str, place: &Place) -> Result<String, ConvertError> {
        let mut parts = text.split('$');
        let mut out = parts.next().unwrap_or_default().to_owned();
        for part in parts {
            // The longest name wins: $size_x is not $size and then "_x".
            let mut names = (1..=part.len().min(MAX_VARIABLE)).rev().filter_map(|length| part.get(..length));
            let found = names.find_map(|name| self.defaults.get_key_value(name));
            let (name, value) = found.ok_or_else(|| self.unknown(text, place))?;
            let size = value.len() as u64;
            self.left = self.left.checked_sub(size).ok_or_else(|| {
                let left = self.left;
                place.error(format!(
                    "found ${name}, which stands for {size} bytes, {left} are left of the limit of {MAX_BYTES} for all XML"
                ))
            })?;
            out += value;
            out += &part[name.len()..];
        }
        Ok(out)
    }

    fn unknown(&self, text: &str, place: &Place) -> ConvertError {
        let known: Vec<&str> = self.defaults.keys().take(20).map(String::as_str).collect();
        let known = match self.defaults.len() {
            0 => "there is none".to_owned(),
            count if count > known.len() => format!("{}, …", known.join(", ")),
            _ => known.join(", "),
        };
        place.error(format!("found {text:.80?}, expected a variable that has a <default>: {known}"))
    }

    /// Another folder to look for files in, before all others.
    fn folder(&mut self, name: &str, place: &Place) -> Result<(), ConvertError> {
        let found = self.folders.iter().map(|folder| folder.join(name)).find(|path| path.is_dir());
        let found =
            found.ok_or_else(|| place.error(format!("found the folder {name:?}, which does not exist")))?;
        if self.folders.len() > MAX_FOLDERS {
            return Err(place.error(format!("found more than {MAX_FOLDERS} <path>, which is the limit")));
        }
        self.folders.insert(0, found);
        Ok(())
    }

    fn alias(&mut self, id: &str, name: &str, place: &Place) -> Result<(), ConvertError> {
        let Some((index, _)) = self.ids.get(id) else {
            return Err(
                place.error(format!("found an alias of {id:?}, expected the id of an object before it"))
            );
        };
        self.take(name, *index, place)
    }

    /// Puts what is in another file here.
    fn include(
        &mut self,
        name: &str,
        place: &Place,
        into: &mut Vec<Property>,
        depth: usize,
    ) -> Result<(), ConvertError> {
        let path = find(&self.folders, name)
            .ok_or_else(|| place.error(format!("found the file {name:?}, which does not exist")))?;
        let own = path.canonicalize().unwrap_or_else(|_| path.clone());
        if self.including.contains(&own) {
            return Err(place.error(format!("found {name:?}, which includes itself")));
        }
        if self.including.len() > MAX_INCLUDES {
            return Err(place.error(format!("found more than {MAX_INCLUDES} files that include each other")));
        }
        let (file, text) = self.open(&path)?;
        let element = xml::parse(&text, &file)?;
        self.including.push(own);
        if element.tag == "scene" {
            for child in &element.children {
                self.child(child, into, depth)?;
            }
        } else {
            self.child(&element, into, depth)?;
        }
        self.including.pop();
        Ok(())
    }
}

/// The light of a hot body, as version 0.6 writes it: its temperature with or without a K, and a factor.
fn blackbody(attributes: &Attributes) -> Result<Color, String> {
    let kelvin = attributes.get("temperature").ok_or("found <blackbody> without \"temperature\"")?.trim();
    let kelvin = value::number(kelvin.strip_suffix(['K', 'k']).unwrap_or(kelvin))?;
    let scale = attributes.get("scale").map_or(Ok(1.0), value::number)?;
    Color::blackbody(kelvin, scale)
}

/// Replaces references by the objects they name.
fn link(objects: &mut [Object], ids: &BTreeMap<String, (usize, Place)>) -> Result<(), ConvertError> {
    for object in objects.iter_mut() {
        for property in &mut object.properties {
            let Value::Reference(id) = &property.value else { continue };
            let Some((index, _)) = ids.get(id) else {
                let near = nearest(ids, id);
                let error = property
                    .place
                    .error(format!("found a reference to {id:?}, expected the id of an object"));
                return Err(match near {
                    Some(near) => error.with_hint(format!("the nearest id is {near:?}")),
                    None => error,
                });
            };
            property.value = Value::Object(*index);
        }
    }
    check_depth(objects)
}

/// The id that is spelt most like another one. Comparing takes the product of their lengths, so long ones are left out.
fn nearest<'a>(ids: &'a BTreeMap<String, (usize, Place)>, wanted: &str) -> Option<&'a String> {
    let short = |id: &str| id.len() <= MAX_NEAR_ID;
    let known = ids.keys().filter(|known| short(known) && short(wanted)).take(MAX_NEAR);
    known.min_by_key(|known| strsim::damerau_levenshtein(known, wanted))
}

/// Refuses circles and chains that are too long to follow.
fn check_depth(objects: &[Object]) -> Result<(), ConvertError> {
    // 0: not looked at, else 1 + the height of the object over what it is made of.
    let mut heights = vec![0_usize; objects.len()];
    for start in 0..objects.len() {
        height(objects, start, 0, &mut heights)?;
    }
    Ok(())
}

fn height(objects: &[Object], at: usize, depth: usize, heights: &mut [usize]) -> Result<usize, ConvertError> {
    if heights[at] > 0 {
        return Ok(heights[at]);
    }
    if depth > MAX_DEPTH {
        let message =
            format!("found objects that refer to each other in a circle or more than {MAX_DEPTH} deep");
        return Err(objects[at].place.error(message));
    }
    let mut most = 0;
    for (_, below) in objects[at].nested() {
        most = most.max(height(objects, below, depth + 1, heights)?);
    }
    if most > MAX_DEPTH {
        return Err(objects[at].place.error(format!("found objects nested more than {MAX_DEPTH} deep")));
    }
    heights[at] = most + 1;
    Ok(most + 1)
}
