//! Every figure, drawn quickly: it has pictures that can be judged, numbers that are numbers, and files that
//! are whole.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::collections::BTreeSet;

use ndfmap::core::observe::{Observer, Unobserved};
use ndfmap::draw::{Sheet, Theme};
use ndfmap::render::Device;
use ndfmap_figures::{Claim, Made, Paper, Plan, TABLE, Verdict, find, index, write};

const QUICK: Plan<'static> = Plan { quick: true, seed: 0, device: &Device::Cpu, observer: &Unobserved };

/// Colours of a sheet, of which a picture has many and blank paper one.
fn colours(sheet: &Sheet) -> usize {
    sheet.draw(Theme::Light).into_grid().texels().iter().collect::<BTreeSet<_>>().len()
}

#[test]
fn every_figure_is_drawn_and_measured() {
    let folder = tempfile::tempdir().unwrap();
    let mut all: Vec<Made> = Vec::new();
    for row in TABLE {
        let (made, files) = write(row, &QUICK, folder.path()).unwrap();
        println!("{}: {}, {:.1} s", made.figure, made.verdict, made.seconds);
        assert!(files.iter().all(|file| file.is_file()), "{}", row.name);
        assert!(!made.pictures.is_empty() && !made.claims.is_empty() && !made.why.is_empty(), "{}", row.name);
        let mut statements = BTreeSet::new();
        for Claim { says, paper, ours, .. } in &made.claims {
            assert!(ours.is_finite() && paper.is_none_or(f64::is_finite), "{}: {says}: {ours}", row.name);
            assert!(statements.insert(says), "{}: {says} stands twice", row.name);
        }
        let json = std::fs::read_to_string(folder.path().join(format!("{}.json", row.name))).unwrap();
        assert!(!json.contains("null"), "{}", row.name);
        all.push(made);
    }
    let page = index(&all, &["ndfmap figure --all".to_owned()]).unwrap();
    for made in &all {
        assert!(page.contains(&format!("id=\"{}\"", made.figure)), "{}", made.figure);
        assert!(made.pictures.iter().flatten().all(|picture| page.contains(picture)), "{}", made.figure);
    }
    for paper in Paper::ALL {
        assert!(page.contains(paper.title()));
    }
    std::fs::write(folder.path().join("index.html"), page).unwrap();
}

#[test]
fn figures_are_the_same_every_time_and_large_enough() {
    // Cheap ones that use all parts: disks, plots, scenes by brute force, and displaced ones.
    for name in ["han-1", "han-order", "tan-6", "olano-2", "leadr-3"] {
        let row = find(name).unwrap();
        let (once, again) = (row.draw(&QUICK).unwrap(), row.draw(&QUICK).unwrap());
        assert_eq!(once.claims, again.claims, "{name}");
        for (a, b) in once.sheets.iter().zip(&again.sheets) {
            assert_eq!(a.draw(Theme::Dark), b.draw(Theme::Dark), "{name}");
            let size = a.size();
            // Less can hardly be judged: see `Shot`'s least side.
            assert!(size.width >= 400 && size.height >= 250, "{name}: {size:?}");
            assert!(colours(a) > 100, "{name}");
        }
    }
}

#[test]
fn another_seed_makes_another_truth() {
    let row = find("tan-6").unwrap();
    let other = Plan { seed: 7, ..QUICK };
    let (a, b) = (row.draw(&QUICK).unwrap(), row.draw(&other).unwrap());
    for (a, b) in a.claims.iter().zip(&b.claims) {
        // 32 rays a pixel leave some hundredths of an error.
        assert!(a.ours != b.ours && (a.ours / b.ours - 1.0).abs() < 0.1, "{a:?} {b:?}");
    }
}

#[test]
fn figures_can_be_stopped() {
    struct Impatient;
    impl Observer for Impatient {
        fn progress(&self, _: f64) {}
        fn cancelled(&self) -> bool {
            true
        }
    }
    for name in ["tan-6", "tan-5", "leadr-4"] {
        let plan = Plan { observer: &Impatient, ..QUICK };
        let error = find(name).unwrap().draw(&plan).err();
        assert!(matches!(error, Some(ndfmap::Error::Cancelled(_))), "{name}: {error:?}");
    }
}

#[test]
fn names_are_of_the_papers_and_verdicts_count() {
    let mut names = BTreeSet::new();
    for row in TABLE {
        let of = match row.paper {
            Paper::Tan => "tan-",
            Paper::Han => "han-",
            Paper::Olano => "olano-",
            Paper::Leadr => "leadr-",
        };
        assert!(names.insert(row.name) && row.name.starts_with(of), "{}", row.name);
        assert!(row.name.chars().all(|c| c == '-' || c.is_ascii_lowercase() || c.is_ascii_digit()));
    }
    let claim = |holds: Option<bool>| Claim { says: String::new(), paper: None, ours: 1.0, holds };
    let said = |claims: &[Claim]| Verdict::of(claims).to_string();
    assert_eq!(said(&[claim(None)]), "nothing to judge");
    assert_eq!(said(&[claim(None), claim(Some(true))]), "comes out");
    assert_eq!(said(&[claim(Some(false)), claim(Some(true)), claim(None)]), "comes out in 1 of 2");
    assert_eq!(said(&[claim(Some(false))]), "does not come out");
}
