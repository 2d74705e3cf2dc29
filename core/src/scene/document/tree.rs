//! Owns the JSON tree of a document, with the place of each value in the text.

use jsonc_parser::ast;
use jsonc_parser::common::Ranged;
use jsonc_parser::{CollectOptions, ParseOptions, parse_to_ast};

use crate::scene::document::limits::Limits;
use crate::scene::document::path::Path;
use crate::scene::document::problem::{Problem, Problems};
use crate::scene::document::source::Source;

/// Deepest nesting of brackets; keeps recursion over the tree within any thread's stack.
pub(super) const MAX_DEPTH: usize = 200;

/// One JSON value.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    /// Byte offset of its first character.
    pub(super) start: u32,
    /// Byte offset after its last character.
    pub(super) end: u32,
    /// Whether it was made by linear interpolation.
    pub(super) blended: bool,
    /// What it is.
    pub(super) value: Value,
}

/// What a JSON value is.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Null,
    Bool(bool),
    /// May be infinite: whoever takes it checks.
    Number(f64),
    Text(String),
    List(Vec<Node>),
    Object(Vec<Member>),
}

/// One member of an object; names within an object differ.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Member {
    pub(super) name: String,
    /// Byte offset of the name.
    pub(super) start: u32,
    pub(super) node: Node,
}

impl Node {
    /// A value that no text stands for.
    pub(super) fn made(value: Value) -> Self {
        Self { start: 0, end: 0, blended: false, value }
    }

    /// The members, when it is an object.
    pub(super) fn members(&self) -> &[Member] {
        if let Value::Object(members) = &self.value { members } else { &[] }
    }

    /// The member of that name, when it is an object that has one.
    pub(super) fn get(&self, name: &str) -> Option<&Self> {
        self.members().iter().find(|member| member.name == name).map(|member| &member.node)
    }

    /// The member of that name, to be changed.
    pub(super) fn get_mut(&mut self, name: &str) -> Option<&mut Self> {
        let Value::Object(members) = &mut self.value else { return None };
        members.iter_mut().find(|member| member.name == name).map(|member| &mut member.node)
    }

    /// Takes a member out, when it is an object that has one.
    pub(super) fn remove(&mut self, name: &str) {
        if let Value::Object(members) = &mut self.value {
            members.retain(|member| member.name != name);
        }
    }

    /// Number of values in it, itself included.
    pub(super) fn count(&self) -> u64 {
        1 + match &self.value {
            Value::List(items) => items.iter().map(Self::count).sum(),
            Value::Object(members) => members.iter().map(|member| member.node.count()).sum::<u64>(),
            Value::Null | Value::Bool(_) | Value::Number(_) | Value::Text(_) => 0,
        }
    }
}

/// Reads strict JSON: no comments, no trailing commas, no name twice in an object.
///
/// Names that stand twice are put into `problems`; what follows can still be checked.
pub(super) fn parse(source: &Source, limits: &Limits, problems: &mut Problems) -> Result<Node, Problems> {
    measure(source, limits)?;
    let options = ParseOptions {
        allow_comments: false,
        allow_loose_object_property_names: false,
        allow_trailing_commas: false,
        allow_missing_commas: false,
        allow_single_quoted_strings: false,
        allow_hexadecimal_numbers: false,
        allow_unary_plus_numbers: false,
        allow_bare_decimal_point_numbers: false,
        allow_non_finite_numbers: false,
        allow_extended_string_escapes: false,
    };
    let parsed = parse_to_ast(source.text(), &CollectOptions::default(), &options).map_err(|error| {
        let said = error.kind().to_string();
        let message = format!("not JSON: {}{}", said[..1].to_lowercase(), &said[1..]);
        source.problem(error.range().start as u32, String::new(), message, None)
    })?;
    let Some(value) = parsed.value else {
        let message = "found nothing, expected a JSON object".to_owned();
        return Err(source.problem(0, String::new(), message, None).into());
    };
    Ok(convert(value, &Path::ROOT, source, problems))
}

/// Refuses text with too many values or too deep a nesting before any of it is parsed.
fn measure(source: &Source, limits: &Limits) -> Result<(), Problem> {
    let (mut depth, mut values, mut quoted, mut escaped) = (0_usize, 1_u64, false, false);
    for (at, byte) in source.text().bytes().enumerate() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' => escaped = quoted,
            b'"' => quoted = !quoted,
            _ if quoted => {}
            b'{' | b'[' => (depth, values) = (depth + 1, values + 1),
            b'}' | b']' => depth = depth.saturating_sub(1),
            b',' => values += 1,
            _ => {}
        }
        if depth > MAX_DEPTH {
            let message = format!("found brackets nested deeper than {MAX_DEPTH}, the most that is allowed");
            return Err(source.problem(at as u32, String::new(), message, None));
        }
    }
    if values > limits.max_values {
        let message = format!("found {values} JSON values, the limit is {}", limits.max_values);
        return Err(source.problem(0, String::new(), message, None));
    }
    Ok(())
}

fn convert(value: ast::Value<'_>, path: &Path<'_>, source: &Source, problems: &mut Problems) -> Node {
    let (start, end) = (value.start() as u32, value.end() as u32);
    let value = match value {
        ast::Value::NullKeyword(_) => Value::Null,
        ast::Value::BooleanLit(literal) => Value::Bool(literal.value),
        ast::Value::StringLit(literal) => Value::Text(literal.value.into_owned()),
        ast::Value::NumberLit(literal) => {
            // A number that is too large becomes infinite here and is refused where it is used.
            Value::Number(literal.value.parse().unwrap_or(f64::NAN))
        }
        ast::Value::Array(array) => Value::List(
            array
                .elements
                .into_iter()
                .enumerate()
                .map(|(index, element)| convert(element, &path.index(index), source, problems))
                .collect(),
        ),
        ast::Value::Object(object) => Value::Object(convert_members(object, path, source, problems)),
    };
    Node { start, end, blended: false, value }
}

fn convert_members(
    object: ast::Object<'_>,
    path: &Path<'_>,
    source: &Source,
    problems: &mut Problems,
) -> Vec<Member> {
    let mut members: Vec<Member> = Vec::with_capacity(object.properties.len());
    for property in object.properties {
        let start = property.start() as u32;
        let name = property.name.into_string();
        let node = convert(property.value, &path.name(&name), source, problems);
        members.push(Member { name, start, node });
    }
    let mut order: Vec<usize> = (0..members.len()).collect();
    order.sort_by(|&a, &b| (&members[a].name, a).cmp(&(&members[b].name, b)));
    for pair in order.windows(2) {
        let (first, second) = (&members[pair[0]], &members[pair[1]]);
        if first.name == second.name {
            let (line, column) = source.place(first.start);
            let message = format!("found the name a second time, it stands at {line}:{column} already");
            problems.push(source.problem(second.start, path.name(&second.name).text(), message, None));
        }
    }
    members
}

/// Text as messages show it: cut after 64 characters.
pub(super) fn shorten(text: &str) -> String {
    match text.char_indices().nth(64) {
        None => text.to_owned(),
        Some((cut, _)) => format!("{}…", &text[..cut]),
    }
}
