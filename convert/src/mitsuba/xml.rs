//! Owns reading XML: text to a tree of elements that know their lines.

use std::rc::Rc;

use quick_xml::Reader;
use quick_xml::escape::unescape;
use quick_xml::events::{BytesStart, Event};

use super::place::Place;
use crate::ConvertError;

/// Deepest nesting of elements.
const MAX_DEPTH: usize = 64;
/// Most elements of a file.
const MAX_ELEMENTS: usize = 1 << 20;

/// An element and what is in it.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) tag: String,
    pub(super) place: Place,
    pub(super) attributes: Attributes,
    pub(super) children: Vec<Self>,
}

/// The attributes of an element: names and values, in their order.
#[derive(Debug, Clone, Default)]
pub(super) struct Attributes(pub(super) Vec<(String, String)>);

impl Attributes {
    /// The value of an attribute.
    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(found, _)| found == name).map(|(_, value)| value.as_str())
    }
}

/// Reads a document; `file` is what messages call it.
pub(super) fn parse(text: &str, file: &Rc<str>) -> Result<Element, ConvertError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut reader = Reader::from_str(text);
    let mut lines = Lines { bytes: text.as_bytes(), at: 0, line: 1 };
    let mut tree = Tree::default();
    loop {
        let line = lines.of(reader.buffer_position());
        let place = Place { file: Rc::clone(file), line };
        match reader.read_event() {
            Err(error) => {
                let line = lines.of(reader.error_position());
                return Err(Place { line, ..place }.error(format!("found broken XML: {error}")));
            }
            Ok(Event::Start(tag)) => tree.open(element(&tag, place)?)?,
            Ok(Event::Empty(tag)) => {
                tree.open(element(&tag, place)?)?;
                tree.close();
            }
            Ok(Event::End(_)) => tree.close(),
            Ok(Event::Text(found)) => {
                if !found.chars().all(char::is_whitespace) {
                    let line = lines.of(reader.buffer_position());
                    return Err(Place { line, ..place }.error("found text between elements, expected none"));
                }
            }
            Ok(Event::CData(_) | Event::GeneralRef(_)) => {
                return Err(place.error("found text between elements, expected none"));
            }
            Ok(Event::Comment(_) | Event::Decl(_) | Event::PI(_) | Event::DocType(_)) => {}
            Ok(Event::Eof) => return tree.finish(&place),
        }
    }
}

fn element(tag: &BytesStart<'_>, place: Place) -> Result<Element, ConvertError> {
    let broken = |error: &dyn std::fmt::Display| place.error(format!("found broken XML: {error}"));
    let mut attributes = Vec::new();
    for attribute in tag.attributes() {
        let attribute = attribute.map_err(|error| broken(&error))?;
        let value = unescape(&attribute.value).map_err(|error| broken(&error))?.into_owned();
        attributes.push((attribute.key.as_ref().to_owned(), value));
    }
    Ok(Element {
        tag: tag.name().as_ref().to_owned(),
        place,
        attributes: Attributes(attributes),
        children: Vec::new(),
    })
}

/// The elements that are open, the outermost first, and the root once it is closed.
#[derive(Default)]
struct Tree {
    open: Vec<Element>,
    root: Option<Element>,
    count: usize,
}

impl Tree {
    fn open(&mut self, element: Element) -> Result<(), ConvertError> {
        self.count += 1;
        let place = &element.place;
        if self.count > MAX_ELEMENTS {
            return Err(place.error(format!("found more than {MAX_ELEMENTS} elements, which is the limit")));
        }
        if self.open.len() >= MAX_DEPTH {
            return Err(place.error(format!("found elements nested more than {MAX_DEPTH} deep")));
        }
        if self.open.is_empty() && self.root.is_some() {
            return Err(place.error(format!("found <{}> after the end of the document", element.tag)));
        }
        self.open.push(element);
        Ok(())
    }

    /// Ends the innermost element. The reader has compared the names.
    fn close(&mut self) {
        let Some(element) = self.open.pop() else { return };
        match self.open.last_mut() {
            Some(parent) => parent.children.push(element),
            None => self.root = Some(element),
        }
    }

    fn finish(mut self, end: &Place) -> Result<Element, ConvertError> {
        if let Some(element) = self.open.pop() {
            return Err(element.place.error(format!("found no end of <{}>", element.tag)));
        }
        self.root.ok_or_else(|| end.error("found no element, expected <scene>"))
    }
}

/// Counts lines up to offsets that only grow.
struct Lines<'a> {
    bytes: &'a [u8],
    at: usize,
    line: u32,
}

impl Lines<'_> {
    fn of(&mut self, offset: u64) -> u32 {
        let offset = (offset as usize).min(self.bytes.len());
        if offset > self.at {
            self.line += self.bytes[self.at..offset].split(|byte| *byte == b'\n').count() as u32 - 1;
            self.at = offset;
        }
        self.line
    }
}

#[cfg(test)]
mod tests {
    use super::{Element, parse};

    fn read(text: &str) -> Result<Element, String> {
        parse(text, &"a.xml".into()).map_err(|error| error.to_string())
    }

    #[test]
    fn elements_know_their_lines() {
        let text = "<?xml version='1.0'?>\n<!-- a\n comment -->\n<scene version=\"3.0.0\">\n\n  <float name=\"x\"\n value=\"1 &lt; 2\"/>\n<bsdf/></scene>\n";
        let root = read(text).unwrap();
        assert_eq!(
            (root.tag.as_str(), root.place.line, root.attributes.get("version")),
            ("scene", 4, Some("3.0.0"))
        );
        let lines: Vec<u32> = root.children.iter().map(|child| child.place.line).collect();
        assert_eq!(lines, [6, 8]);
        assert_eq!(root.children[0].attributes.get("value"), Some("1 < 2"));
    }

    #[test]
    fn broken_documents_are_refused_with_the_line() {
        let deep = format!("{}{}", "<a>".repeat(65), "</a>".repeat(65));
        for (text, expected) in [
            ("", "a.xml:1: found no element, expected <scene>"),
            ("<scene>\n<a>\n</b></scene>", "a.xml:3: found broken XML"),
            ("<scene>\n<a>", "a.xml:2: found no end of <a>"),
            ("<scene/>\n<scene/>", "a.xml:2: found <scene> after the end of the document"),
            ("<scene>\n  words\n</scene>", "a.xml:3: found text between elements"),
            ("<scene>&bomb;</scene>", "a.xml:1: found text between elements"),
            ("<scene a='&bomb;'/>", "a.xml:1: found broken XML"),
            ("<scene a='1' a='2'/>", "a.xml:1: found broken XML"),
            (&deep, "a.xml:1: found elements nested more than 64 deep"),
        ] {
            let error = read(text).unwrap_err();
            assert!(error.starts_with(expected), "{text:?}: {error}");
        }
    }
}
