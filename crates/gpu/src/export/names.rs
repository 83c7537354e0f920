//! Names of exported WGSL, which has no namespaces: each one at module scope gets the prefix `ndf_`.

use std::collections::HashSet;

/// Prefix of every exported name.
pub(super) const PREFIX: &str = "ndf_";

/// Names of a module that are not the library's own, and so may clash with an engine's.
pub(super) fn foreign(module: &naga::Module) -> HashSet<String> {
    let functions = module.functions.iter().filter_map(|(_, function)| function.name.clone());
    let constants = module.constants.iter().filter_map(|(_, constant)| constant.name.clone());
    let types = module.types.iter().filter_map(|(_, ty)| ty.name.clone());
    let globals = module.global_variables.iter().filter_map(|(_, global)| global.name.clone());
    functions.chain(constants).chain(types).chain(globals).filter(|name| !is_own(name)).collect()
}

/// True for a name that begins with the library's prefix, as a type's does too: `NdfPlace`.
pub(super) fn is_own(name: &str) -> bool {
    name.to_lowercase().starts_with("ndf")
}

/// The text with a prefix before these names. A local that hides such a name gets it too, everywhere; members
/// of structs keep theirs.
pub(super) fn prefixed(text: &str, names: &HashSet<String>) -> String {
    let mut out = String::with_capacity(text.len() + text.len() / 8);
    // Depth of braces inside a struct, whose members are declared by `name:`.
    let (mut in_struct, mut rest) = (false, text);
    while let Some(first) = rest.chars().next() {
        if rest.starts_with("//") {
            let end = rest.find('\n').unwrap_or(rest.len());
            out.push_str(&rest[..end]);
            rest = &rest[end..];
            continue;
        }
        if !first.is_alphabetic() && first != '_' {
            in_struct &= first != '}';
            out.push(first);
            rest = &rest[first.len_utf8()..];
            continue;
        }
        let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        let member = out.ends_with('.') || in_struct && after.trim_start().starts_with(':');
        // A suffix of a number is no name: `1u`.
        let suffix = out.ends_with(|c: char| c.is_ascii_digit());
        if names.contains(word) && !member && !suffix {
            out.push_str(PREFIX);
        }
        in_struct |= word == "struct";
        out.push_str(word);
        rest = after;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_at_module_scope_are_prefixed_and_members_are_not() {
        let text = "struct Way { cosine: f32, }\n// cosine stays\nfn cosine(w: Way) -> f32 { let c = w.cosine; return c + 1f; }\n\
            fn ndf_a(w: Way) -> f32 { return cosine(w); }";
        let module = naga::front::wgsl::parse_str(text).unwrap();
        let names = foreign(&module);
        assert_eq!(names, ["Way", "cosine"].map(str::to_owned).into());
        let expected = "struct ndf_Way { cosine: f32, }\n// cosine stays\nfn ndf_cosine(w: ndf_Way) -> f32 { let c = w.cosine; \
            return c + 1f; }\nfn ndf_a(w: ndf_Way) -> f32 { return ndf_cosine(w); }";
        assert_eq!(prefixed(text, &names), expected);
    }
}
