//! `ndfmap figure`: lists, makes figures and a page, and says what is wrong with a request.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use common::{json, ndfmap};

#[test]
fn figures_are_listed_by_paper() {
    let listed = json(&["figure", "--list", "--json"]);
    let names: Vec<&str> =
        listed["figures"].as_array().unwrap().iter().map(|row| row["name"].as_str().unwrap()).collect();
    assert_eq!(names, ndfmap_figures::TABLE.iter().map(|row| row.name).collect::<Vec<_>>());
    let text = String::from_utf8(ndfmap(&["figure", "--list"]).stdout).unwrap();
    assert!(names.iter().all(|name| text.contains(name)) && text.contains("Olano and North 1997"));
}

#[test]
fn a_figure_is_made_with_its_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    let told = json(&["figure", "olano-7,han-1", "--quick", "--json", "-o", path]);
    let made = told["figures"].as_array().unwrap();
    assert_eq!(made.len(), 2);
    // In the order of the papers, whatever the order asked for.
    assert_eq!([&made[0]["figure"], &made[1]["figure"]], ["han-1", "olano-7"]);
    for figure in made {
        let name = figure["figure"].as_str().unwrap();
        let file = std::fs::read_to_string(folder.path().join(format!("{name}.json"))).unwrap();
        assert_eq!(&serde_json::from_str::<serde_json::Value>(&file).unwrap(), figure);
        for ending in [".png", "-dark.png"] {
            let bytes = std::fs::read(folder.path().join(format!("{name}{ending}"))).unwrap();
            assert!(bytes.starts_with(b"\x89PNG"), "{name}{ending}");
        }
        assert!(figure["command"].as_str().unwrap().contains("--quick"));
    }
    assert!(!folder.path().join("index.html").exists());
    // Again by one thread: no byte differs.
    let before = std::fs::read(folder.path().join("han-1.png")).unwrap();
    assert!(ndfmap(&["figure", "han-1", "--quick", "--threads", "1", "-o", path]).status.success());
    assert_eq!(std::fs::read(folder.path().join("han-1.png")).unwrap(), before);
    let kept = ndfmap(&["figure", "han-1", "--quick", "--no-clobber", "-o", path]);
    assert_eq!(kept.status.code(), Some(1));
}

#[test]
fn wrong_requests_are_refused() {
    for (arguments, said) in [
        (&["figure", "tan-44", "-o", "x"][..], "`tan-4` is nearest"),
        (&["figure", "-o", "x"], "required"),
        (&["figure", "tan-4"], "--output"),
        (&["figure", "tan-4", "--all", "-o", "x"], "cannot be used with"),
        (&["figure", "--list", "--all"], "cannot be used with"),
        (&["figure", "tan-4", "--seed", "x", "-o", "x"], "--seed"),
    ] {
        let output = ndfmap(arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains(said), "{arguments:?}: {text}");
    }
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("file");
    std::fs::write(&file, "").unwrap();
    let output = ndfmap(&["figure", "olano-7", "-o", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stderr));
}
