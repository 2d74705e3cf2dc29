//! Owns animation tracks: which values they may address, and the value of a track at a frame.

use serde_json::{Value as Json, json};

use crate::scene::document::blend::{Mismatch, blend, blendable};
use crate::scene::document::cursor::{Context, Cursor};
use crate::scene::document::decode::Decode;
use crate::scene::document::macros::{object, words};
use crate::scene::document::named::Named;
use crate::scene::document::path::Path;
use crate::scene::document::rule::{Allowed, or, required};
use crate::scene::document::schema::Definitions;
use crate::scene::document::tree::{Node, Value};

object! {
    "animation";
    /// What changes from frame to frame.
    pub(super) struct Animation checked by is_in_order {
        /// Frames per second of the film.
        fps: f64 = or(24.0).above(0.0).to(1000.0);
        /// First and last frame, both rendered.
        frames: FrameSpan = required();
        /// Tracks by the path of the value that they change: names joined by dots, such as
        /// `spheres.lamp.center`.
        tracks: Named<Track> = or(Named::default()).paths();
    }
}

object! {
    "track";
    /// How one number, vector or transform changes.
    ///
    /// Before the first key it has the value of the first, after the last key that of the last.
    pub(super) struct Track checked by is_increasing {
        /// What happens between two keys.
        interpolation: Interpolation = or(Interpolation::Linear);
        /// Values at frames, in increasing order of frames; at least one.
        keys: Vec<Key> = required().from(1.0);
    }
}

object! {
    "key";
    /// The value at a frame.
    pub(super) struct Key {
        /// The frame.
        frame: i32 = required().from(-MAX_FRAME).to(MAX_FRAME);
        /// The value, as it would stand in the document.
        value: Node = required();
    }
}

/// Frames are within ± this.
const MAX_FRAME: f64 = 1.0e8;

/// What happens between two keys.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Interpolation {
    Linear,
    Step,
}

words! {
    "interpolation";
    Interpolation {
        /// Numbers change evenly, part by part; a `matrix` is taken apart into translation, rotation and scale,
        /// and the rotation takes the shortest way at even speed. Both keys have the same fields and lengths; a
        /// sheared matrix cannot be taken apart. Integers cannot change evenly.
        "linear" => Linear,
        /// The value of the key before, up to the next key.
        "step" => Step,
    }
}

/// First and last frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrameSpan {
    pub(super) first: i32,
    pub(super) last: i32,
}

impl Decode for FrameSpan {
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        let items = match &at.node.value {
            Value::List(items) if items.len() == 2 => items,
            _ => {
                at.expected(&Self::expected(allowed));
                return None;
            }
        };
        let range = Allowed { min: -MAX_FRAME, max: MAX_FRAME, ..Allowed::ANY };
        let [first, last] = [0, 1].map(|index| i32::decode(&at.element(index, &items[index]), &range));
        let (first, last) = (first?, last?);
        let count = i64::from(last) - i64::from(first) + 1;
        let limit = at.context.limits.max_frames;
        if count < 1 {
            at.problem(format!("found the last frame {last} before the first frame {first}"), None);
        } else if count as u64 > limit {
            at.problem(format!("found {count} frames, the limit is {limit}"), None);
        }
        (count >= 1 && count as u64 <= limit).then_some(Self { first, last })
    }

    fn expected(_: &Allowed) -> String {
        "a list of the first and the last frame".to_owned()
    }

    fn schema(_: &Allowed, _: &mut Definitions) -> Json {
        json!({"type": "array", "items": {"type": "integer"}, "minItems": 2, "maxItems": 2, "title": "[first, last]"})
    }

    fn show(&self) -> Json {
        json!([self.first, self.last])
    }
}

impl Decode for Node {
    /// Takes any value whose leaves are numbers.
    fn decode(at: &Cursor<'_>, allowed: &Allowed) -> Option<Self> {
        match &at.node.value {
            Value::Number(_) => f64::decode(at, &Allowed::ANY).map(|_| at.node.clone()),
            Value::List(items) => {
                let sound = items
                    .iter()
                    .enumerate()
                    .map(|(index, item)| Self::decode(&at.element(index, item), allowed));
                let sound: Vec<bool> = sound.map(|item| item.is_some()).collect();
                sound.iter().all(|&ok| ok).then(|| at.node.clone())
            }
            Value::Object(members) => {
                let sound = members.iter().map(|member| {
                    let path = at.path.name(&member.name);
                    Self::decode(&Cursor { node: &member.node, path, context: at.context }, allowed)
                });
                let sound: Vec<bool> = sound.map(|member| member.is_some()).collect();
                sound.iter().all(|&ok| ok).then(|| at.node.clone())
            }
            Value::Null | Value::Bool(_) | Value::Text(_) => {
                at.expected(&Self::expected(allowed));
                None
            }
        }
    }

    fn expected(_: &Allowed) -> String {
        "a number, a vector or a transform".to_owned()
    }

    fn schema(_: &Allowed, _: &mut Definitions) -> Json {
        json!({"title": "number, vector or transform"})
    }

    fn show(&self) -> Json {
        match &self.value {
            Value::Null => Json::Null,
            Value::Bool(value) => json!(value),
            Value::Number(number) => number.show(),
            Value::Text(text) => json!(text),
            Value::List(items) => items.iter().map(Decode::show).collect(),
            Value::Object(members) => {
                Json::Object(members.iter().map(|member| (member.name.clone(), member.node.show())).collect())
            }
        }
    }
}

fn is_increasing(track: &Track, at: &Cursor<'_>) -> bool {
    let mut sound = true;
    for (index, pair) in track.keys.windows(2).enumerate() {
        let (before, after) = (&pair[0], &pair[1]);
        let report = |field: &str, message: String, hint: Option<String>| {
            let start = start_of(at, index + 1, field);
            let keys = at.path.name("keys");
            let key = keys.index(index + 1);
            at.problem_at(start, &key.name(field), message, hint);
        };
        if after.frame <= before.frame {
            report(
                "frame",
                format!("found frame {} after frame {}, expected a later one", after.frame, before.frame),
                None,
            );
            sound = false;
        } else if track.interpolation == Interpolation::Linear
            && let Err(mismatch) = blendable(&before.value, &after.value, last_name(at))
        {
            let hint = match mismatch {
                Mismatch::Shape => "both keys need the same fields and lengths, or use \"step\"",
                Mismatch::Sheared => "write translate, rotate and scale, or use \"step\"",
                Mismatch::Mirrored => "mirror both keys or none, or use \"step\"",
            };
            report("value", format!("found {}", mismatch.words()), Some(hint.to_owned()));
            sound = false;
        }
    }
    sound
}

/// Where a field of a key stands in the text.
fn start_of(track: &Cursor<'_>, key: usize, field: &str) -> u32 {
    let keys = track.node.get("keys").map(|keys| &keys.value);
    let key = if let Some(Value::List(keys)) = keys { keys.get(key) } else { None };
    key.and_then(|key| key.get(field)).map_or(track.node.start, |node| node.start)
}

/// The last name of the path that a track addresses.
fn last_name<'a>(track: &Cursor<'a>) -> &'a str {
    track.path.last_name().rsplit('.').next().unwrap_or("")
}

/// No track may change a part of what another track changes.
fn is_in_order(animation: &Animation, at: &Cursor<'_>) -> bool {
    let mut paths: Vec<&str> = animation.tracks.iter().map(|(path, _)| path).collect();
    // A dot sorts before whatever else may follow a name, so that a part stands right behind the whole.
    paths.sort_by(|a, b| a.split('.').cmp(b.split('.')));
    let mut sound = true;
    for pair in paths.windows(2) {
        let part = pair[1].strip_prefix(pair[0]).is_some_and(|rest| rest.starts_with('.'));
        if part {
            let tracks = at.path.name("tracks");
            let start = at.node.get("tracks").map_or(at.node.start, |tracks| {
                tracks
                    .members()
                    .iter()
                    .find(|member| member.name == pair[1])
                    .map_or(tracks.start, |found| found.start)
            });
            let message = format!("changes a part of what the track {:?} changes", pair[0]);
            at.problem_at(start, &tracks.name(pair[1]), message, Some("merge the two tracks".to_owned()));
            sound = false;
        }
    }
    sound
}

/// Reports every track whose path is not that of a value that may be animated.
pub(super) fn check_targets(root: &Node, context: &Context<'_>) {
    let Some(tracks) = root.get("animation").and_then(|animation| animation.get("tracks")) else { return };
    let at = Cursor::root(root, context);
    let animation = Path::ROOT.name("animation");
    let all = animation.name("tracks");
    for member in tracks.members() {
        if let Err((message, hint)) = target(root, &member.name, context) {
            at.problem_at(member.start, &all.name(&member.name), message, hint);
        }
    }
}

/// Checks that a track may change the value at a path; otherwise says why not, with advice.
fn target(root: &Node, path: &str, context: &Context<'_>) -> Result<(), (String, Option<String>)> {
    let fixed = ["version", "sampling", "meshes", "animation", "film.width", "film.height", "film.crop"];
    let within =
        |whole: &str| path.strip_prefix(whole).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    if fixed.into_iter().any(within) {
        let hint = format!("the same in all frames: {}, files and names", fixed.join(", "));
        return Err((format!("found {path:?}, which cannot be animated"), Some(hint)));
    }
    let mut node = root;
    let names: Vec<&str> = path.split('.').collect();
    for (depth, name) in names.iter().enumerate() {
        let Some(next) = node.get(name) else {
            let near = context.nearest(name, node.members().iter().map(|member| member.name.as_str()));
            let hint = near.map(|near| {
                let whole: Vec<&str> = [&names[..depth], &[near], &names[depth + 1..]].concat();
                format!("did you mean {:?}?", whole.join("."))
            });
            let written =
                || "a track changes a value that the document contains: write its field there".to_owned();
            return Err((
                "found no such value in the document".to_owned(),
                Some(hint.unwrap_or_else(written)),
            ));
        };
        node = next;
    }
    if is_animatable(node) {
        return Ok(());
    }
    Err((
        format!("found the path of {}, expected that of a number, a vector or a transform", kind(node)),
        None,
    ))
}

/// Whether there are only numbers in a value, and at least one.
fn is_animatable(node: &Node) -> bool {
    match &node.value {
        Value::Number(_) => true,
        Value::List(items) => !items.is_empty() && items.iter().all(is_animatable),
        Value::Object(members) => {
            !members.is_empty() && members.iter().all(|member| is_animatable(&member.node))
        }
        Value::Null | Value::Bool(_) | Value::Text(_) => false,
    }
}

fn kind(node: &Node) -> &'static str {
    match node.value {
        Value::Null => "null",
        Value::Bool(_) => "a boolean",
        Value::Number(_) => "a number",
        Value::Text(_) => "a string",
        Value::List(_) => "a list",
        Value::Object(_) => "an object that is no transform",
    }
}

impl Animation {
    /// Puts the values at a frame into the document's tree.
    pub(super) fn apply(&self, root: &mut Node, frame: i32) {
        for (path, track) in self.tracks.iter() {
            let target = path.split('.').try_fold(&mut *root, |node, name| node.get_mut(name));
            if let Some(target) = target {
                *target = track.value(frame, path.rsplit('.').next().unwrap_or(""));
            }
        }
    }

    /// The frames on which keys stand, each once, in order.
    pub(super) fn key_frames(&self) -> Vec<i32> {
        let mut frames: Vec<i32> =
            self.tracks.values().flat_map(|track| track.keys.iter().map(|key| key.frame)).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }
}

impl Track {
    /// The value at a frame; `name` is the last name of the track's path.
    fn value(&self, frame: i32, name: &str) -> Node {
        let after = self.keys.partition_point(|key| key.frame <= frame);
        let before = &self.keys[after.saturating_sub(1)];
        let mut value = match self.keys.get(after) {
            Some(next)
                if after > 0 && self.interpolation == Interpolation::Linear && before.frame != frame =>
            {
                let length = f64::from(next.frame) - f64::from(before.frame);
                blend(&before.value, &next.value, (f64::from(frame) - f64::from(before.frame)) / length, name)
            }
            _ => before.value.clone(),
        };
        if self.interpolation == Interpolation::Linear && self.keys.len() > 1 {
            mark_blended(&mut value);
        }
        value
    }
}

/// Marks all numbers of a value as made by interpolation, so that integers can refuse it at every frame.
fn mark_blended(node: &mut Node) {
    node.blended = true;
    match &mut node.value {
        Value::List(items) => items.iter_mut().for_each(mark_blended),
        Value::Object(members) => members.iter_mut().for_each(|member| mark_blended(&mut member.node)),
        Value::Null | Value::Bool(_) | Value::Number(_) | Value::Text(_) => {}
    }
}
