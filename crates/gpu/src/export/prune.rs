//! Exported WGSL without what nobody calls: a method's text brings what other entries need.

use std::collections::HashSet;

use super::names::is_own;

/// A declaration at module scope, with the comment above it.
struct Item<'a> {
    name: &'a str,
    text: &'a str,
    is_function: bool,
}

/// A word of a text, and whether a parenthesis follows.
#[derive(PartialEq, Eq, Hash)]
struct Word<'a> {
    text: &'a str,
    called: bool,
}

/// Text without items that none of the library's own functions reaches, and without comments that stand by
/// themselves, which tell of files.
pub(super) fn pruned(text: &str) -> String {
    let items = items(text);
    let mut wanted: HashSet<&str> = items.iter().map(|item| item.name).filter(|name| is_own(name)).collect();
    let mut open: Vec<&Item<'_>> = items.iter().filter(|item| wanted.contains(item.name)).collect();
    while let Some(item) = open.pop() {
        let named: HashSet<Word<'_>> = words(item.text).collect();
        // A local may have a function's name, but is not called.
        let names = |other: &&Item<'_>| named.contains(&Word { text: other.name, called: other.is_function });
        for other in items.iter().filter(names) {
            if wanted.insert(other.name) {
                open.push(other);
            }
        }
    }
    let kept = items.iter().filter(|item| wanted.contains(item.name)).map(|item| item.text);
    kept.collect::<Vec<_>>().join("\n")
}

/// True for a text that declares a name at module scope.
pub(super) fn declares(text: &str, name: &str) -> bool {
    text.lines().any(|line| declared(line) == Some(name))
}

/// Items of a module whose declarations begin at the edge and end with `}` or `;` there or on their line.
fn items(text: &str) -> Vec<Item<'_>> {
    let mut found = Vec::new();
    // Where the item begins, with its comment, and its name once that is known.
    let (mut begin, mut name, mut at) = (0, None, 0);
    for line in text.split_inclusive('\n') {
        let end = at + line.len();
        let bare = line.trim_end();
        if name.is_none() {
            name = declared(bare);
        }
        match name {
            // A comment or an attribute may belong to what follows.
            None if bare.is_empty() => begin = end,
            Some(item) if bare == "}" || !bare.starts_with(' ') && bare.ends_with([';', '}']) => {
                let text = &text[begin..end];
                let is_function = text.lines().any(|line| line.starts_with("fn "));
                found.push(Item { name: item, text, is_function });
                (begin, name) = (end, None);
            }
            _ => {}
        }
        at = end;
    }
    found
}

/// Name that a line at the edge declares.
fn declared(line: &str) -> Option<&str> {
    let rest = ["fn ", "struct ", "const ", "alias ", "var<private> "]
        .iter()
        .find_map(|word| line.strip_prefix(word))?;
    rest.split(|c: char| !c.is_alphanumeric() && c != '_').next()
}

/// Words of an item, without those of its comments and without members. A type that makes a value is called,
/// and named as well.
fn words(text: &str) -> impl Iterator<Item = Word<'_>> {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    code.flat_map(|line| {
        let mut found = Vec::new();
        let mut rest = line;
        while let Some(start) = rest.find(|c: char| c.is_alphanumeric() || c == '_') {
            let (before, from) = rest.split_at(start);
            let end = from.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(from.len());
            let (text, after) = from.split_at(end);
            if !before.ends_with('.') {
                found.push(Word { text, called: false });
                if after.starts_with('(') {
                    found.push(Word { text, called: true });
                }
            }
            rest = after;
        }
        found
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_reached_is_kept_with_its_comment() {
        let text = "// File of all.\n\nconst LEFT: u32 = 1u;\n\n// Half of it.\nconst HALF = array<f32, 2>(\n    0.5, 1.0,\n);\n\n\
                    // Not called but in a comment: lost.\nfn lost() -> f32 {\n    return LEFT;\n}\n\n\
                    fn half() -> f32 {\n    return HALF[0]; // lost\n}\n\n// Entry.\nfn ndf_shade() -> f32 {\n    return half();\n}\n";
        let kept = pruned(text);
        assert_eq!(
            kept,
            "// Half of it.\nconst HALF = array<f32, 2>(\n    0.5, 1.0,\n);\n\nfn half() -> f32 {\n    return HALF[0]; // lost\n}\n\n\
             // Entry.\nfn ndf_shade() -> f32 {\n    return half();\n}\n"
        );
    }
}
