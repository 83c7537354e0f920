//! Promises of ARCHITECTURE.md and CONTRIBUTING.md, held by tests.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;

use common::root;

/// Our own crates that a crate depends on, straight from cargo.
fn own_dependencies(package: &str) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--edges", "normal,build", "--prefix", "none", "--package", package])
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    text.lines()
        .filter_map(|l| l.split(' ').next())
        .filter(|n| n.starts_with("ndfmap") && *n != package)
        .map(str::to_owned)
        .collect()
}

#[test]
fn arrows_point_one_way() {
    let set = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect::<BTreeSet<_>>();
    assert_eq!(own_dependencies("ndfmap-core"), set(&[]));
    assert_eq!(own_dependencies("ndfmap-scene"), set(&["ndfmap-core"]));
    for package in ["ndfmap-maps", "ndfmap-trace", "ndfmap-gpu"] {
        assert_eq!(own_dependencies(package), set(&["ndfmap-core", "ndfmap-scene"]), "{package}");
    }
    // Without its features, the library draws on no GPU.
    assert_eq!(
        own_dependencies("ndfmap"),
        set(&["ndfmap-core", "ndfmap-maps", "ndfmap-scene", "ndfmap-trace"])
    );
    let library = ["ndfmap", "ndfmap-core", "ndfmap-maps", "ndfmap-scene", "ndfmap-trace"];
    assert_eq!(own_dependencies("ndfmap-figures"), set(&library));
    assert_eq!(own_dependencies("ndfmap-cli"), &set(&library) | &set(&["ndfmap-figures", "ndfmap-gpu"]));
}

#[test]
fn truth_shares_no_representation() {
    for file in tracked().iter().filter(|f| f.starts_with("crates/trace/src/truth")) {
        let word = |c: char| !c.is_alphanumeric() && c != '_';
        let names = |line: &str| line.split(word).any(|name| name == "ndf" || name == "filtered");
        let used = read(file).lines().any(|l| !l.trim_start().starts_with("//") && names(l));
        assert!(!used, "{} uses what it is to judge", file.display());
    }
}

#[test]
fn core_opens_no_file_device_or_window() {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--offline",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--depth",
            "1",
            "--package",
            "ndfmap-core",
        ])
        .current_dir(root())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let found: BTreeSet<&str> =
        text.lines().filter_map(|l| l.split(' ').next()).filter(|n| *n != "ndfmap-core").collect();
    let allowed = [
        "bytemuck",
        "fearless_simd",
        "glam",
        "half",
        "levenberg-marquardt",
        "libm",
        "nalgebra",
        "rand",
        "rand_pcg",
        "rayon",
        "thiserror",
    ];
    assert_eq!(found, allowed.into_iter().collect());
}

/// Files that git tracks, or all but build output where there is no git.
fn tracked() -> Vec<PathBuf> {
    let output = Command::new("git")
        .args(["ls-files", "--cached", "--others", "--exclude-standard"])
        .current_dir(root())
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(PathBuf::from)
        .filter(|f| root().join(f).exists())
        .collect()
}

fn read(file: &Path) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_else(|e| panic!("{}: {e}", file.display()))
}

#[test]
fn every_source_file_says_its_purpose_and_none_is_huge() {
    for file in tracked().iter().filter(|f| f.extension().is_some_and(|e| e == "rs" || e == "wgsl")) {
        let text = read(file);
        let purpose = if file.extension().is_some_and(|e| e == "rs") { "//!" } else { "// " };
        let fuzz = file.starts_with("fuzz") && text.starts_with("#![no_main]");
        assert!(
            text.starts_with(purpose) || fuzz && text.contains("//!"),
            "{} has no purpose line",
            file.display()
        );
        assert!(text.lines().count() <= 800, "{} is too long for one idea", file.display());
        if file.extension().is_some_and(|e| e == "wgsl") {
            continue;
        }
        let allow = regex_free_allow(&text);
        assert!(allow.is_none(), "{}: an allow without a reason: {allow:?}", file.display());
    }
}

/// An `allow` attribute that gives no reason, if there is one.
fn regex_free_allow(text: &str) -> Option<String> {
    let opening = concat!("[all", "ow(");
    text.match_indices(opening)
        .map(|(at, _)| text[at..].split(")]").next().unwrap_or(""))
        .find(|a| !a.contains("reason"))
        .map(str::to_owned)
}

#[test]
fn every_path_in_the_documents_exists() {
    let root = root();
    for file in tracked().iter().filter(|f| f.extension().is_some_and(|e| e == "md")) {
        let folder = root.join(file).parent().unwrap().to_owned();
        for code in read(file).split('`').skip(1).step_by(2) {
            // A path is code with a slash and no blanks, of one of our folders, or a Markdown page.
            let ours = ["crates/", "docs/", "tests/", "fuzz/", "scripts/", "testdata/", ".ci/"];
            let is_path = !code.contains([' ', '<', '*', '{', '\n'])
                && (ours.iter().any(|o| code.starts_with(o)) || code.ends_with(".md") && !code.contains(':'));
            if is_path {
                assert!(
                    root.join(code).exists() || folder.join(code).exists(),
                    "{} names {code}",
                    file.display()
                );
            }
        }
        for (_, rest) in read(file).match_indices("](").map(|(at, _)| ((), read(file)[at + 2..].to_owned())) {
            let link =
                rest.split(')').next().unwrap_or_default().split('#').next().unwrap_or_default().to_owned();
            if !link.is_empty() && !link.starts_with("http") {
                assert!(folder.join(&link).exists(), "{} links to {link}", file.display());
            }
        }
    }
}

#[test]
fn every_command_in_the_documents_runs() {
    // Commands are the lines of `sh` blocks that begin with `ndfmap` or `cargo run --release --`. They run in
    // a folder of their own, on built-in maps; lines about a reader's own files are marked by a name in
    // capitals.
    let folder = tempfile::tempdir().unwrap();
    let mut ran = 0;
    for file in tracked().iter().filter(|f| f.extension().is_some_and(|e| e == "md")) {
        let text = read(file);
        for block in text.split("```sh\n").skip(1).filter_map(|b| b.split("```").next()) {
            for line in block.lines() {
                let line = line.split(" #").next().unwrap_or_default().trim();
                let words =
                    line.strip_prefix("ndfmap ").or_else(|| line.strip_prefix("cargo run --release -- "));
                let Some(words) = words.filter(|w| !w.contains("MY_")) else { continue };
                let output = Command::new(env!("CARGO_BIN_EXE_ndfmap"))
                    .args(words.split_whitespace())
                    .current_dir(folder.path())
                    .output()
                    .unwrap();
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(output.status.success(), "{}: {line}\n{said}", file.display());
                ran += 1;
            }
        }
    }
    assert!(ran >= 5, "only {ran} commands found");
}

#[test]
fn tables_in_the_documents_are_those_of_the_code() {
    let methods = read(Path::new("docs/methods.md"));
    for row in ndfmap_core::ndf::TABLE {
        assert!(
            methods.contains(&format!("`{}{}`", row.name, row.parameters)),
            "docs/methods.md lacks {}",
            row.name
        );
    }
    for row in ndfmap_core::brdf::TABLE {
        assert!(
            methods.contains(&format!("`{}{}`", row.name, row.parameter)),
            "docs/methods.md lacks {}",
            row.name
        );
    }
    let readme = read(Path::new("README.md"));
    for row in ndfmap_core::ndf::TABLE {
        assert!(readme.contains(&format!("`{}", row.name)), "README.md lacks {}", row.name);
    }
    let formats = read(Path::new("docs/formats.md"));
    for row in ndfmap_maps::formats::TABLE {
        assert!(formats.contains(row.name), "docs/formats.md lacks {}", row.name);
    }
    for row in ndfmap_core::procedural::TABLE {
        assert!(methods.contains(&format!("`builtin:{}`", row.name)), "docs/methods.md lacks {}", row.name);
    }
    let environments = read(Path::new("docs/environment.md"));
    for row in ndfmap_core::light::environment::builtin::TABLE {
        assert!(
            environments.contains(&format!("`builtin:{}`", row.name)),
            "docs/environment.md lacks {}",
            row.name
        );
    }
    let scenes = read(Path::new("docs/scenes.md"));
    for row in ndfmap::scene::TABLE {
        assert!(scenes.contains(&format!("`{}`", row.name)), "docs/scenes.md lacks {}", row.name);
    }
    for model in ndfmap_core::brdf::ShadingModel::ALL {
        assert!(scenes.contains(&format!("`{}`", model.name())), "docs/scenes.md lacks {}", model.name());
    }
    let figures = read(Path::new("docs/figures.md"));
    for row in ndfmap_figures::TABLE {
        assert!(figures.contains(&format!("`{}`", row.name)), "docs/figures.md lacks {}", row.name);
    }
    #[cfg(feature = "gpu")]
    for row in ndfmap::gpu::export::TABLE {
        let gpu = read(Path::new("docs/gpu.md"));
        assert!(gpu.contains(&format!("`{}`", row.name)), "docs/gpu.md lacks {}", row.name);
    }
    for row in ndfmap_maps::model::TABLE {
        assert!(formats.contains(row.name), "docs/formats.md lacks {}", row.name);
    }
}

#[test]
fn every_crate_can_be_packed() {
    let output = Command::new(env!("CARGO"))
        .args(["package", "--workspace", "--no-verify", "--allow-dirty", "--offline"])
        .arg("--target-dir")
        .arg(tempfile::tempdir().unwrap().path())
        .current_dir(root())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    for file in tracked().iter().filter(|f| f.starts_with("crates") && f.ends_with("Cargo.toml")) {
        let folder = root().join(file.parent().unwrap());
        let text = read(file);
        for key in ["description", "keywords", "categories", "license"] {
            assert!(text.lines().any(|l| l.starts_with(key)), "{} has no {key}", file.display());
        }
        let readme = std::fs::read_to_string(folder.join("README.md")).unwrap();
        assert!(readme.starts_with("# ndfmap"), "{}", folder.display());
    }
    // An included file lies in the crate that includes it, or the packed crate would not build.
    for file in tracked().iter().filter(|f| f.extension().is_some_and(|e| e == "rs")) {
        let Some(of) = file.iter().nth(1).filter(|_| file.starts_with("crates")) else { continue };
        let text = read(file);
        for (at, word) in
            text.match_indices("include_").filter(|(at, _)| text[*at..].starts_with("include_str!(\""))
        {
            let path = text[at + word.len()..].split('"').nth(1).unwrap();
            let full = root().join(file.parent().unwrap()).join(path).canonicalize();
            let own = root().join("crates").join(of).canonicalize().unwrap();
            let inside = full.as_ref().is_ok_and(|f| f.starts_with(&own));
            assert!(inside || file.to_string_lossy().contains("/tests/"), "{}: {path}", file.display());
        }
    }
}

/// Columns that a line of prose or of a comment may have.
const WIDTH: usize = 110;

#[test]
fn bevys_lobes_are_ours() {
    let read = |path: &str| std::fs::read_to_string(root().join(path)).unwrap();
    let ours = read("crates/gpu/src/export/lobes.wgsl");
    let (purpose, rest) = ours.split_once('\n').unwrap();
    let theirs = read("integrations/bevy/src/lobes.wgsl");
    assert_eq!(theirs, format!("{purpose}\n#define_import_path ndfmap::lobes\n{rest}"));
}

#[test]
fn prose_is_no_wider_than_a_page() {
    for file in tracked() {
        let extension = file.extension().unwrap_or_default().to_string_lossy().into_owned();
        let (markdown, code) = (extension == "md", extension == "rs" || extension == "wgsl");
        if !markdown && !code {
            continue;
        }
        let mut block = false;
        for (at, line) in read(&file).lines().enumerate() {
            let start = line.trim_start();
            block ^= markdown && start.starts_with("```");
            // Tables, blocks of commands, pictures and what one word fills are as wide as they are.
            let prose =
                markdown && !block && !start.starts_with(['|', '!']) || code && start.starts_with("//");
            let one_word = start.split(' ').filter(|word| word.chars().count() > 60).count() > 0;
            assert!(
                !prose || one_word || line.chars().count() <= WIDTH,
                "{} line {}: {} columns",
                file.display(),
                at + 1,
                line.chars().count()
            );
        }
    }
}

#[test]
fn tables_in_the_documents_are_tables() {
    for file in tracked().iter().filter(|f| f.extension().is_some_and(|e| e == "md")) {
        let text = read(file);
        let lines: Vec<&str> = text.lines().collect();
        let cells = |line: &str| line.replace("\\|", "").matches('|').count();
        for (at, line) in lines.iter().enumerate().filter(|(_, line)| line.starts_with('|')) {
            let first = at == 0 || !lines[at - 1].starts_with('|');
            let place = format!("{} line {}: {line}", file.display(), at + 1);
            if first {
                let rule = lines.get(at + 1).copied().unwrap_or_default();
                assert!(rule.starts_with('|') && rule.chars().all(|c| "|-: ".contains(c)), "{place}");
                assert!(at == 0 || lines[at - 1].is_empty(), "{place}: needs an empty line above");
            } else {
                assert_eq!(cells(line), cells(lines[at - 1]), "{place}");
            }
        }
    }
}
