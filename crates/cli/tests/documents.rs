//! Numbers in the documents: tables are made again by the commands beside them, and compared digit by digit.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use common::{json, root};
use ndfmap::compare::three_digits;
use serde_json::Value;

/// Rows of the first table after a text, cells without backticks; the header is the first.
fn table(page: &str, after: &str) -> Vec<Vec<String>> {
    let text = std::fs::read_to_string(root().join("docs").join(page)).unwrap();
    let from = text.find(after).unwrap_or_else(|| panic!("{page} lacks `{after}`"));
    let rows = text[from..].lines().skip_while(|line| !line.starts_with('|'));
    let cells = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|cell| cell.trim().trim_matches('`').to_owned()).collect()
    };
    let rows = rows.take_while(|line| line.starts_with('|')).map(cells);
    rows.enumerate().filter(|(i, _)| *i != 1).map(|(_, row)| row).collect()
}

/// Compares each cell with what `number` makes of its method and level.
fn compare(rows: &[Vec<String>], number: impl Fn(&str, usize) -> String) {
    let levels: Vec<usize> =
        rows[0][1..].iter().map(|head| head.strip_prefix("level ").unwrap().parse().unwrap()).collect();
    let mut wrong = Vec::new();
    for row in &rows[1..] {
        for (cell, level) in row[1..].iter().zip(&levels) {
            let got = number(&row[0], *level);
            if got != *cell {
                wrong.push(format!("{} at level {level}: {got}, not {cell}", row[0]));
            }
        }
    }
    assert!(rows.len() > 1 && wrong.is_empty(), "{}", wrong.join("\n"));
}

/// Comparison of a table's methods on the built-in foil.
fn told(rows: &[Vec<String>], more: &[&str]) -> Value {
    let methods: Vec<&str> = rows[1..].iter().map(|row| row[0].as_str()).collect();
    json(&[&["compare", "builtin:foil", "--json", "--method", &methods.join(",")], more].concat())
}

#[test]
fn errors_of_methods_come_out() {
    let rows = table("methods.md", "ndfmap compare builtin:foil --method fixed");
    let told = told(&rows, &[]);
    compare(&rows, |method, level| {
        three_digits(told["methods"][method]["levels"][level]["error"].as_f64().unwrap())
    });
}

#[test]
fn errors_of_engines_come_out() {
    let rows = table("roughness.md", "## Your engine's number");
    let (rules, methods): (Vec<&str>, Vec<&str>) =
        rows[1..].iter().map(|row| row[0].as_str()).partition(|name| name.starts_with("rule:"));
    let command = ["compare", "builtin:foil", "--map-size", "256", "--rule", "all", "--brdf", "ggx:0.16"];
    let told = json(&[&command[..], &["--json", "--method", &methods.join(",")]].concat());
    assert_eq!(rules.len(), ndfmap::core::roughness::TABLE.len());
    compare(&rows, |method, level| {
        three_digits(told["methods"][method]["levels"][level]["error"].as_f64().unwrap())
    });
}

#[test]
fn errors_of_printed_forms_come_out() {
    let rows = table("methods.md", "## Printed forms");
    let told = told(&rows, &["--filtering"]);
    compare(&rows, |method, level| {
        let own = &told["methods"][method];
        let between = own["filtering"].as_array().unwrap().iter().find(|e| e["level"] == level).unwrap();
        let [at, between] =
            [&own["levels"][level]["error"], &between["between"]].map(|e| e.as_f64().unwrap());
        format!("{} / {}", three_digits(at), three_digits(between))
    });
}

#[test]
fn numbers_of_figures_come_out() {
    // In full, for figures that take seconds; the statements of the others are those of the program.
    let rows = table("figures.md", "## Made again by a test");
    let mut names: Vec<&str> = rows[1..].iter().map(|row| row[0].as_str()).collect();
    names.dedup();
    let folder = tempfile::tempdir().unwrap();
    let told = json(&["figure", &names.join(","), "--json", "-o", folder.path().to_str().unwrap()]);
    let mut made = Vec::new();
    for figure in told["figures"].as_array().unwrap() {
        for claim in figure["claims"].as_array().unwrap() {
            let holds = claim["holds"].as_bool().map_or("", |holds| if holds { "yes" } else { "no" });
            let ours = ndfmap_figures::digits(claim["ours"].as_f64().unwrap());
            let of = |value: &Value| value.as_str().unwrap().to_owned();
            made.push(vec![of(&figure["figure"]), of(&claim["says"]), ours, holds.to_owned()]);
        }
    }
    assert!(!made.is_empty());
    assert_eq!(rows[1..], made);
}
