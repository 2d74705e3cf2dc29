//! Owns how a document is written: as JSON that people can read, with short values on one line.

use std::fmt::Write as _;

use serde_json::Value;

/// Longest line that a value shares with its name.
const WIDTH: usize = 110;

/// A document as text, with a line break at its end. Numbers keep every bit.
pub(crate) fn write(document: &Value) -> String {
    let mut out = String::new();
    put(&mut out, document, 0);
    out.push('\n');
    out
}

fn put(out: &mut String, value: &Value, indent: usize) {
    let line = on_one_line(value);
    let used = out.len() - out.rfind('\n').map_or(0, |at| at + 1);
    let flat = indent > 0 && used + line.len() <= WIDTH;
    if let (false, Some(members)) = (flat, value.as_object().filter(|members| !members.is_empty())) {
        let lines = members.iter().map(|(name, member)| (format!("{}: ", quoted(name)), member));
        block(out, ['{', '}'], lines, indent);
    } else if let (false, Some(items)) = (flat, value.as_array().filter(|items| !items.is_empty())) {
        block(out, ['[', ']'], items.iter().map(|item| (String::new(), item)), indent);
    } else {
        out.push_str(&line);
    }
}

fn block<'a>(
    out: &mut String,
    brackets: [char; 2],
    lines: impl ExactSizeIterator<Item = (String, &'a Value)>,
    indent: usize,
) {
    out.push(brackets[0]);
    let last = lines.len().saturating_sub(1);
    for (at, (name, value)) in lines.enumerate() {
        let _ = write!(out, "\n{:width$}{name}", "", width = indent + 2);
        put(out, value, indent + 2);
        if at < last {
            out.push(',');
        }
    }
    let _ = write!(out, "\n{:indent$}{}", "", brackets[1]);
}

fn on_one_line(value: &Value) -> String {
    match value {
        Value::Array(items) => {
            let items: Vec<String> = items.iter().map(on_one_line).collect();
            format!("[{}]", items.join(", "))
        }
        Value::Object(members) => {
            let members: Vec<String> = members
                .iter()
                .map(|(name, member)| format!("{}: {}", quoted(name), on_one_line(member)))
                .collect();
            format!("{{{}}}", members.join(", "))
        }
        Value::Number(_) | Value::Null | Value::Bool(_) | Value::String(_) => value.to_string(),
    }
}

fn quoted(text: &str) -> String {
    Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::write;
    use serde_json::{Value, json};

    #[test]
    fn short_values_share_a_line() {
        let document =
            json!({"version": 1, "rows": [[1.0, 0.1], [2.5, 3.0]], "name \"x\"": {"a": {}, "b": []}});
        let expected = "{\n  \"version\": 1,\n  \"rows\": [[1.0, 0.1], [2.5, 3.0]],\n  \"name \\\"x\\\"\": {\"a\": {}, \"b\": []}\n}\n";
        assert_eq!(write(&document), expected);
    }

    #[test]
    fn long_values_are_broken_and_keep_every_bit() {
        let numbers: Vec<f64> = (0..40).map(|i| 1.0 / 3.0 + f64::from(i) * 0.1).collect();
        let document = json!({"list": numbers, "deep": {"list": numbers}});
        let text = write(&document);
        assert!(text.lines().all(|line| line.len() <= 110), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), document);
    }
}
