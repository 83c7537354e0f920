//! JSON that was edited, printed over the text that it came from: what did not change keeps its bytes.
//!
//! A parser and a printer would keep keys and values, and lose the text of numbers, duplicates of keys and
//! all white space. Here every value that is equal to what it was is copied; an object or an array that
//! gained members gets them at its end, in the manner of the file. One that lost some is printed anew.

use serde_json::Value;
use serde_json::map::Map;
use serde_json::ser::{PrettyFormatter, Serializer};
use serde_json::value::RawValue;

/// Members of an object whose values are left as text, in order, each key once.
type Members<'a> = indexmap::IndexMap<String, &'a RawValue>;

/// Prints an edited document over its text.
///
/// # Errors
/// An error of the parser for a text that is no JSON.
pub(super) fn reprint(text: &str, edited: &Value) -> Result<String, serde_json::Error> {
    let root: &RawValue = serde_json::from_str(text)?;
    let unit = indent_of(root.get());
    let (before, after) = around(text, root.get());
    Ok([before, &printed(root.get(), edited, &Manner { unit, prefix: "" })?, after].concat())
}

/// Manner of printing what is new.
#[derive(Clone, Copy)]
struct Manner<'a> {
    /// White space of one level; `None` for a file of one line.
    unit: Option<&'a str>,
    /// White space before the lines of the value.
    prefix: &'a str,
}

/// White space before the first member of a document, from its line's beginning.
fn indent_of(text: &str) -> Option<&str> {
    let inside = text.get(1..)?;
    let space = &inside[..inside.len() - inside.trim_start().len()];
    space.rfind('\n').map(|at| &space[at + 1..])
}

/// Text before and after a part of it.
fn around<'a>(text: &'a str, part: &str) -> (&'a str, &'a str) {
    // A part is a slice of the text: its address tells its place.
    let start = part.as_ptr() as usize - text.as_ptr() as usize;
    (&text[..start], &text[start + part.len()..])
}

/// Value printed over its old text.
fn printed(text: &str, edited: &Value, manner: &Manner<'_>) -> Result<String, serde_json::Error> {
    let old: Value = serde_json::from_str(text)?;
    match (&old, edited) {
        _ if old == *edited => Ok(text.to_owned()),
        (Value::Object(old), Value::Object(new)) if old.keys().all(|key| new.contains_key(key)) => {
            let members: Members<'_> = serde_json::from_str(text)?;
            let mut kept: Vec<_> = members.iter().map(|(key, raw)| (raw.get(), &new[key])).collect();
            // A key that stands twice counts where it stands last.
            kept.sort_by_key(|(part, _)| part.as_ptr());
            let added = added(old, new).map(|(key, value)| (Some(key), value)).collect();
            grown(text, kept, added, manner)
        }
        (Value::Array(old), Value::Array(new)) if old.len() <= new.len() => {
            let elements: Vec<&RawValue> = serde_json::from_str(text)?;
            let kept = elements.iter().map(|raw| raw.get()).zip(new).collect();
            grown(text, kept, new[old.len()..].iter().map(|value| (None, value)).collect(), manner)
        }
        _ => fresh(edited, manner),
    }
}

/// Members that an object has gained.
fn added<'a>(
    old: &Map<String, Value>,
    new: &'a Map<String, Value>,
) -> impl Iterator<Item = (&'a str, &'a Value)> {
    new.iter().filter(|(key, _)| !old.contains_key(*key)).map(|(key, value)| (key.as_str(), value))
}

/// Object or array whose members may have changed, with new ones at its end.
fn grown(
    text: &str,
    kept: Vec<(&str, &Value)>,
    added: Vec<(Option<&str>, &Value)>,
    manner: &Manner<'_>,
) -> Result<String, serde_json::Error> {
    let inner = match manner.unit {
        Some(unit) => format!("{}{unit}", manner.prefix),
        None => String::new(),
    };
    let inside = Manner { unit: manner.unit, prefix: &inner };
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    let mut is_empty = true;
    for (part, value) in kept {
        let (before, after) = around(rest, part);
        out += before;
        out += &printed(part, value, &inside)?;
        (rest, is_empty) = (after, false);
    }
    if added.is_empty() {
        return Ok(out + rest);
    }
    // The rest is white space and the closing bracket; of an empty one, the opening bracket too.
    let (head, close) = rest.split_at(rest.len() - 1);
    let (head, space) = head.split_at(head.trim_end().len());
    out += head;
    // Some files write small arrays in one line.
    let line = if is_empty || space.contains('\n') { manner.unit } else { None };
    for (key, value) in added {
        if !std::mem::replace(&mut is_empty, false) {
            out.push(',');
        }
        if line.is_some() {
            out.push('\n');
            out += &inner;
        }
        if let Some(key) = key {
            out += &serde_json::to_string(key)?;
            out += if manner.unit.is_some() { ": " } else { ":" };
        }
        out += &fresh(value, if line.is_some() { &inside } else { &ONE_LINE })?;
    }
    match line {
        Some(_) if space.is_empty() => out += &format!("\n{}", manner.prefix),
        _ => out += space,
    }
    Ok(out + close)
}

/// Manner of a file of one line.
const ONE_LINE: Manner<'_> = Manner { unit: None, prefix: "" };

/// Text of a value that is new.
fn fresh(value: &Value, manner: &Manner<'_>) -> Result<String, serde_json::Error> {
    let Some(unit) = manner.unit else { return serde_json::to_string(value) };
    let mut bytes = Vec::new();
    let formatter = PrettyFormatter::with_indent(unit.as_bytes());
    serde::Serialize::serialize(value, &mut Serializer::with_formatter(&mut bytes, formatter))?;
    // No string of JSON has a line break in it.
    Ok(String::from_utf8_lossy(&bytes).replace('\n', &format!("\n{}", manner.prefix)))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use serde_json::json;

    use super::*;

    #[test]
    fn what_did_not_change_keeps_its_bytes() {
        let text = "{ \"b\" : 1.10,\n\t\"a\":[1e-7, -0.0 ],\"big\":12345678901234567890123,\"e\":{} } ";
        let mut value: Value = serde_json::from_str(text).unwrap();
        assert_eq!(reprint(text, &value).unwrap(), text);
        value["a"][1] = json!(2);
        value["e"]["x"] = json!([true]);
        value["new"] = json!("é");
        let out = reprint(text, &value).unwrap();
        assert_eq!(
            out,
            "{ \"b\" : 1.10,\n\t\"a\":[1e-7, 2 ],\"big\":12345678901234567890123,\"e\":{\"x\":[true]},\"new\":\"é\" } "
        );
        let value: Value = serde_json::from_str("[]").unwrap();
        assert_eq!(reprint("{\"a\":1}", &value).unwrap(), "[]");
    }

    #[test]
    fn new_members_are_written_in_the_manner_of_the_file() {
        let text = "{\n  \"images\": [\n    {\n      \"uri\": \"a\"\n    }\n  ],\n  \"empty\": [],\n  \"v\": [1, 2]\n}\n";
        let mut value: Value = serde_json::from_str(text).unwrap();
        value["images"].as_array_mut().unwrap().push(json!({ "uri": "b" }));
        value["empty"].as_array_mut().unwrap().push(json!("x"));
        value["v"].as_array_mut().unwrap().push(json!(3));
        let out = reprint(text, &value).unwrap();
        assert_eq!(
            out,
            "{\n  \"images\": [\n    {\n      \"uri\": \"a\"\n    },\n    {\n      \"uri\": \"b\"\n    }\n  ],\n  \
             \"empty\": [\n    \"x\"\n  ],\n  \"v\": [1, 2,3]\n}\n"
        );
    }

    fn values() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i32>().prop_map(Value::from),
            "[a-c\"\\\\é]{0,3}".prop_map(Value::from),
        ];
        leaf.prop_recursive(4, 24, 4, |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..4).prop_map(Value::from),
                prop::collection::vec(("[a-c\"\\\\]", inner), 0..4)
                    .prop_map(|members| Value::from(members.into_iter().collect::<Map<_, _>>())),
            ]
        })
    }

    proptest! {
        #[test]
        fn any_edit_of_any_text_reads_as_what_it_was_edited_to(old in values(), new in values(), pretty: bool) {
            let text =
                if pretty { serde_json::to_string_pretty(&old) } else { serde_json::to_string(&old) }.unwrap();
            let out = reprint(&text, &new).unwrap();
            prop_assert_eq!(serde_json::from_str::<Value>(&out).unwrap(), new);
            prop_assert_eq!(reprint(&text, &old).unwrap(), text);
        }
    }
}
