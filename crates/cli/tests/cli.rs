//! The command line: what scripts rely on, and what happens when it is used wrongly.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use std::path::Path;

use common::{json, outcome, text};
use serde_json::{Value, json};

#[test]
fn bake_then_inspect_every_method() {
    let folder = tempfile::tempdir().unwrap();
    for (method, layers, key) in [
        ("fixed", 1, "mean"),
        ("naive", 1, "mean"),
        ("toksvig", 1, "mean"),
        ("ndm", 3, "covariance"),
        ("ndm:pearson:integrated", 3, "covariance"),
        ("slopes", 2, "height"),
        ("stereographic", 2, "covariance"),
        ("vmf:2:prior=0.5:printed", 2, "lobes"),
        ("sh:3", 4, "coefficients"),
        ("vmf:4", 4, "lobes"),
        ("vmf:2:unaligned:origin", 2, "lobes"),
        ("gmm:3:prior", 3, "lobes"),
        ("phong:2", 2, "peaks"),
    ] {
        for extension in ["ktx2", "exr"] {
            let file = text(&folder.path().join(format!("map.{extension}")));
            let baked =
                json(&["bake", "builtin:armour", "--map-size", "48x20", "-m", method, "-o", &file, "--json"]);
            for name in [
                "method", "width", "height", "levels", "layers", "format", "bytes", "threads", "seconds",
                "warnings",
            ] {
                assert!(!baked[name].is_null(), "{name}");
            }
            assert_eq!((baked["layers"].as_u64(), baked["levels"].as_u64()), (Some(layers), Some(6)));
            assert_eq!(baked["bytes"].as_u64().unwrap(), std::fs::metadata(&file).unwrap().len());
            assert!(["read", "bake", "write"].iter().all(|s| baked["seconds"][*s].as_f64().unwrap() >= 0.0));
            let told = json(&["inspect", &file, "--json"]);
            assert_eq!(told["method"], method);
            assert_eq!(told["levels"][5], serde_json::json!({ "width": 1, "height": 1 }));
            assert_eq!(told["source"]["file"], "builtin:armour");
            let texel = json(&["inspect", &file, "--json", "--texel", "2", "3", "4"]);
            assert_eq!(
                (texel["level"].as_u64(), texel["x"].as_u64(), texel["y"].as_u64()),
                (Some(2), Some(3), Some(4))
            );
            assert!(!texel[key].is_null(), "{method} {texel}");
        }
    }
}

#[test]
fn lobes_are_described_in_full() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("map.ktx2"));
    let texel = |method: &str| {
        json(&["bake", "builtin:foil", "--map-size", "64", "-m", method, "-o", &file, "--json"]);
        json(&["inspect", &file, "--json", "--texel", "4", "1", "2"])
    };
    for (method, mean, width) in [("vmf:4", 3, "kappa"), ("gmm:4", 2, "variance")] {
        let told = texel(method);
        let lobes = told["lobes"].as_array().unwrap();
        let weights: f64 = lobes.iter().map(|l| l["weight"].as_f64().unwrap()).sum();
        assert!((weights - 1.0).abs() < 1e-9 && !lobes.is_empty(), "{told}");
        for lobe in lobes {
            assert_eq!(lobe["mean"].as_array().unwrap().len(), mean);
            assert!(lobe[width].as_f64().unwrap() > 0.0);
        }
    }
    let told = texel("phong:3");
    assert!(
        told["peaks"].as_array().unwrap().iter().all(|p| p["exponent"].as_f64().unwrap() > 0.0),
        "{told}"
    );
}

/// An 8-bit picture of this size.
fn picture(
    path: &str,
    channels: png::ColorType,
    width: u32,
    height: u32,
    texel: impl Fn(u32, u32) -> Vec<u8>,
) {
    let mut encoder = png::Encoder::new(std::fs::File::create(path).unwrap(), width, height);
    encoder.set_color(channels);
    let data: Vec<u8> =
        (0..height).flat_map(|y| (0..width).map(move |x| (x, y))).flat_map(|(x, y)| texel(x, y)).collect();
    encoder.write_header().unwrap().write_image_data(&data).unwrap();
}

#[test]
fn attributes_stay_with_their_lobes() {
    // Left-facing texels are red, right-facing ones green, in a checkerboard: the coarsest texel has two
    // lobes, each of its own colour, where an average would be brown.
    let folder = tempfile::tempdir().unwrap();
    let [normal, albedo, roughness, small, file] =
        ["n.png", "a.png", "g.png", "s.png", "map.ktx2"].map(|n| text(&folder.path().join(n)));
    let left = |x: u32, y: u32| (x + y).is_multiple_of(2);
    picture(&normal, png::ColorType::Rgb, 16, 16, |x, y| vec![if left(x, y) { 68 } else { 188 }, 128, 240]);
    picture(
        &albedo,
        png::ColorType::Rgb,
        16,
        16,
        |x, y| if left(x, y) { vec![188, 0, 0] } else { vec![0, 188, 0] },
    );
    picture(&roughness, png::ColorType::Grayscale, 16, 16, |x, y| vec![if left(x, y) { 51 } else { 204 }]);
    picture(&small, png::ColorType::Grayscale, 8, 16, |_, _| vec![0]);
    for (zstd, method) in [(false, "vmf:2"), (true, "gmm:2")] {
        let srgb = format!("srgb:{albedo}");
        let mut words = vec![
            "bake",
            &normal,
            "-o",
            &file,
            "-m",
            method,
            "--attribute",
            &srgb,
            "--attribute",
            &roughness,
            "--json",
        ];
        words.extend(zstd.then_some("--zstd"));
        assert_eq!(json(&words)["layers"], 6);
        let told = json(&["inspect", &file, "--json"]);
        assert_eq!(
            told["attributes"][0],
            serde_json::json!({ "name": "a.png", "channels": 3, "transfer": "srgb" })
        );
        for level in ["0", "2", "4"] {
            let texel = json(&["inspect", &file, "--json", "--texel", level, "0", "0"]);
            for lobe in texel["lobes"].as_array().unwrap() {
                let is_left = lobe["mean"][0].as_f64().unwrap() < 0.0;
                let values = |name: &str| {
                    let all = lobe["attributes"][name].as_array().unwrap();
                    all.iter().map(|v| v.as_f64().unwrap()).collect::<Vec<_>>()
                };
                let (colour, roughness) = (values("a.png"), values("g.png"));
                // sRGB 188 is 0.5029 in linear light; half floats hold it, and its weight, to 5e-4 each.
                let expected = if is_left { [0.5029, 0.0, 0.0] } else { [0.0, 0.5029, 0.0] };
                assert!(colour.iter().zip(expected).all(|(c, e)| (c - e).abs() < 2e-3), "{texel}");
                assert!(
                    roughness.len() == 1 && (roughness[0] - if is_left { 0.2 } else { 0.8 }).abs() < 2e-3,
                    "{texel}"
                );
            }
        }
    }
    let (status, _, said) = outcome(&["bake", &normal, "-o", &file, "-m", "vmf:2", "--attribute", &small]);
    assert!(status == 1 && said.contains("must be as large as the map, 16 × 16"), "{said}");
    for method in ["slopes", "phong:2"] {
        let (status, _, said) =
            outcome(&["bake", &normal, "-o", &file, "-m", method, "--attribute", &roughness]);
        assert!(status == 2 && said.contains("no lobes that carry attributes"), "{said}");
    }
}

#[test]
fn zstandard_makes_the_same_map_smaller() {
    let folder = tempfile::tempdir().unwrap();
    let [plain, small] = ["plain.ktx2", "small.ktx2"].map(|n| text(&folder.path().join(n)));
    let bake = |file: &str, more: &[&str]| {
        let words = ["bake", "builtin:dunes", "--map-size", "96x33", "-m", "vmf:3", "-o", file, "--json"];
        json(&[&words[..], more].concat())["bytes"].as_u64().unwrap()
    };
    let (long, short) = (bake(&plain, &["--zstd=0"]), bake(&small, &["--zstd=9"]));
    assert!(short < long, "{short} {long}");
    assert_eq!(short, std::fs::metadata(&small).unwrap().len());
    for level in ["0", "3"] {
        let texel = |file: &str| json(&["inspect", file, "--json", "--texel", level, "2", "1"]);
        assert_eq!(texel(&plain)["lobes"], texel(&small)["lobes"]);
    }
    // Unless told otherwise, maps are compressed.
    assert!(bake(&small, &[]) < long);
    let bytes = |threads: &str| {
        bake(&small, &["--zstd", "--threads", threads]);
        std::fs::read(&small).unwrap()
    };
    assert!(bytes("1") == bytes("2") && bytes("1") == bytes("8"));
}

#[test]
fn auto_chooses_by_measuring_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let file = text(&folder.path().join("map.ktx2"));
    let base = ["bake", "builtin:foil", "--map-size", "64", "-m", "auto", "-o", &file];
    let chosen = json(&[&base[..], &["--bytes-per-texel", "24", "--json"]].concat());
    assert!(chosen["layers"].as_u64().unwrap() <= 3);
    let candidates = chosen["auto"]["candidates"].as_array().unwrap();
    let least = candidates.iter().map(|c| c["error"].as_f64().unwrap()).fold(f64::INFINITY, f64::min);
    let own = candidates.iter().find(|c| c["method"] == chosen["method"]).unwrap();
    assert_eq!(own["error"].as_f64().unwrap(), least);
    assert!(candidates.iter().all(|c| c["bytes_per_texel"].as_u64().unwrap() <= 24));
    assert!(chosen["auto"]["why"].as_str().unwrap().contains("within 24 bytes"));
    assert_eq!(json(&["inspect", &file, "--json"])["method"], chosen["method"]);
    let (status, _, said) = outcome(&[&base[..], &["--max-error", "1e-9"]].concat());
    assert!(status == 1 && said.contains("no method's error is at most"), "{said}");
    // The table that was measured is not lost.
    assert!(said.contains("toksvig ") && said.contains("bytes a texel"), "{said}");
    let (status, _, said) = outcome(&[&base[..], &["--bytes-per-texel", "4"]].concat());
    assert!(
        status == 2 && said.contains("no method takes at most 4 bytes a texel; the least is 8"),
        "{said}"
    );
}

#[test]
fn a_compact_map_is_measured_and_shaded_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (whole, compact) = (file("whole.ktx2"), file("compact.ktx2"));
    let bake = |output: &str, more: &[&str]| {
        let words = ["bake", "builtin:foil", output, "--map-size", "64", "--method", "vmf:2", "--json"];
        json(&[&words[..], more].concat())
    };
    let said = bake(&whole, &[]);
    assert_eq!((&said["levels"], &said["video_bytes"]), (&json!(7), &json!(5461 * 16)));
    let said = bake(&compact, &["--precision", "unorm8", "--from-level", "1"]);
    // A third of the texels of level 0, two layers of four bytes.
    assert_eq!((&said["width"], &said["levels"]), (&json!(32), &json!(6)));
    assert_eq!(said["video_bytes"], json!(1365 * 8));
    let seen = json(&["inspect", &compact, "--json"]);
    assert_eq!((&seen["from_level"], &seen["compact"]["bits"]), (&json!(1), &json!(8)));
    let report = file("report");
    let baked = format!("{whole},{compact}");
    let words = ["compare", "builtin:foil", "--map-size", "64", "--baked", &baked, "--filtering"];
    let compared = json(&[&words[..], &["--report", &report, "--json"]].concat());
    let [whole, compact] = ["whole.ktx2", "compact.ktx2"].map(|name| &compared["methods"][name]);
    let first = |list: &Value| list.as_array().unwrap()[0]["level"].as_u64().unwrap();
    assert_eq!((first(&whole["levels"]), first(&compact["levels"])), (0, 1));
    assert_eq!(first(&compact["filtering"]), 1);
    for level in compact["levels"].as_array().unwrap() {
        let at = level["level"].as_u64().unwrap() as usize;
        let own = level["error"].as_f64().unwrap();
        let due = whole["levels"][at]["error"].as_f64().unwrap();
        // Measured: at most 1.01 times.
        assert!(own < 1.03 * due, "{at}: {own} {due}");
    }
    let (status, table, _) = outcome(&words);
    assert!(status == 0 && table.contains("compact.ktx2      8      0.0      -"), "{table}");
    let page = std::fs::read_to_string(folder.path().join("report/report.html")).unwrap();
    assert!(page.contains("compact.ktx2"));
    let path = file("compact.ktx2");
    let (status, shader, _) = outcome(&["shader", &path]);
    assert!(status == 0 && shader.contains("method vmf:2") && shader.contains("RGBA8 unorm"));
    assert_eq!(shader.matches("    channels[").count(), 2);
    for (words, says) in [
        (vec!["shader", &*path, "--method", "vmf:2"], "cannot be used with"),
        (vec!["shader", "Cargo.toml"], "Cargo.toml"),
        (vec!["bake", "builtin:foil", &*path, "--from-level", "20"], "there is none from 20"),
        (vec!["bake", "builtin:foil", &*file("a.exr"), "--precision", "unorm10"], "OpenEXR holds floats"),
        (vec!["bake", "builtin:foil", &*path, "--precision", "unorm9"], "unorm10"),
    ] {
        let (status, _, stderr) = outcome(&words);
        assert!(status > 0 && stderr.contains(says), "{words:?}: {stderr}");
    }
}

#[test]
fn compare_prints_one_document_and_a_report_stands_alone() {
    let folder = tempfile::tempdir().unwrap();
    let report = text(&folder.path().join("report"));
    let compared = json(&[
        "compare",
        "builtin:foil",
        "--map-size",
        "64",
        "--method",
        "naive,toksvig,slopes",
        "--json",
        "--report",
        &report,
    ]);
    assert_eq!(compared["brdf"], "blinn-phong:50");
    let error =
        |method: &str, level: usize| compared["methods"][method]["levels"][level]["error"].as_f64().unwrap();
    assert_eq!(compared["methods"]["slopes"]["bytes_per_texel"], 16);
    assert_eq!(compared["methods"]["naive"]["levels"].as_array().unwrap().len(), 7);
    assert!(compared["methods"]["naive"]["filtering"].is_null());
    // Purpose of the project: keeping the spread beats forgetting it.
    assert!(error("toksvig", 5) < 0.5 * error("naive", 5));
    let page = std::fs::read_to_string(Path::new(&report).join("report.html")).unwrap();
    assert!(
        page.contains("<svg") && page.contains("data:image/png;base64,") && page.contains("builtin:foil")
    );
    assert!(
        !page.contains("http://")
            || page.matches("http://").count() == page.matches("http://www.w3.org").count()
    );
    assert!(!page.contains("<script") && !page.contains("<link"));
    for picture in ["contact-sheet.png", "ndf.png"] {
        let bytes = std::fs::read(Path::new(&report).join(picture)).unwrap();
        let reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().unwrap();
        assert!(reader.info().width > 300 && reader.info().height > 200);
    }
    let (_, _, said) =
        outcome(&["compare", "builtin:foil", "--map-size", "16", "--method", "naive", "--report", &report]);
    assert!(said.contains("replacing"), "{said}");
}

#[test]
fn filtering_is_measured_and_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let report = text(&folder.path().join("report"));
    let words =
        ["compare", "builtin:foil", "--map-size", "64", "--method", "toksvig,vmf:4,vmf:4:unaligned,phong:2"];
    let told = json(&[&words[..], &["--filtering", "--report", &report, "--json"]].concat());
    let at = |method: &str, key: &str| told["methods"][method]["filtering"][2][key].as_f64().unwrap();
    // Level 0 is the map itself, and one texel has nothing between.
    assert_eq!(told["methods"]["toksvig"]["filtering"].as_array().unwrap().len(), 5);
    assert_eq!(told["methods"]["toksvig"]["filtering"][2]["level"], 3);
    assert!(at("vmf:4", "between") < at("vmf:4:unaligned", "between"));
    // A method that cannot be filtered is shaded texel by texel.
    assert_eq!(at("phong:2", "between"), at("phong:2", "reference"));
    assert!(Path::new(&report).join("alignment.png").exists());
    let page = std::fs::read_to_string(Path::new(&report).join("report.html")).unwrap();
    assert!(page.contains("Between texels") && page.contains("corner between four texels"));
    let (_, table, _) = outcome(&[&words[..], &["--filtering"]].concat());
    assert!(table.contains("reference"), "{table}");
}

#[test]
fn demo_needs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = text(&folder.path().join("demo"));
    let told = json(&["demo", "-o", &output, "--json"]);
    // `scripts/test` times it, when nothing else runs.
    assert!(told["seconds"].as_f64().unwrap() > 0.0);
    for file in told["files"].as_array().unwrap() {
        assert!(Path::new(file.as_str().unwrap()).exists());
    }
    let (status, table, _) = outcome(&["demo", "-o", &output]);
    assert!(status == 0 && table.contains("toksvig") && table.contains("report.html"));
}

#[test]
fn the_same_file_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let bake = |threads: &str, name: &str, method: &str| {
        let file = text(&folder.path().join(name));
        json(&[
            "bake",
            "builtin:foil",
            "--map-size",
            "211x130",
            "-m",
            method,
            "-o",
            &file,
            "--threads",
            threads,
            "--json",
        ]);
        std::fs::read(file).unwrap()
    };
    for extension in ["ktx2", "exr"] {
        for method in ["ndm", "vmf:4", "gmm:4:prior"] {
            let one = bake("1", &format!("1.{extension}"), method);
            let more = |threads: &str| bake(threads, &format!("{threads}.{extension}"), method);
            assert!(one == more("2") && one == more("8"), "{method}");
        }
    }
}

#[test]
fn odd_shapes_bake() {
    let folder = tempfile::tempdir().unwrap();
    for size in ["1", "1x4096", "4096x1", "3x5", "745"] {
        let file = text(&folder.path().join("map.ktx2"));
        json(&["bake", "builtin:ripples", "--map-size", size, "-o", &file, "--json"]);
        let told = json(&["inspect", &file, "--json"]);
        let last = told["levels"].as_array().unwrap().last().unwrap().clone();
        assert_eq!(last, serde_json::json!({ "width": 1, "height": 1 }));
    }
    let compared =
        json(&["compare", "builtin:foil", "--map-size", "1x37", "--method", "slopes,naive", "--json"]);
    assert!(compared["methods"]["slopes"]["levels"][5]["error"].as_f64().unwrap().is_finite());
}

#[test]
fn wrong_usage_is_2_and_suggests() {
    for (words, why) in [
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "toksvi"], "did you mean `toksvig`"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "sh:99"], "whole number from 2 to 16"),
        (vec!["bake", "builtin:foil", "-o", "a.png"], "maps are written as .exr or .ktx2"),
        (
            vec!["bake", "builtin:foil", "-o", "a.ktx2", "--layout", "bumpslopes"],
            "needs an output ending in .exr",
        ),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--methd", "naive"], "--method"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--height-scale", "-1"], "above 0"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--wrap", "mirror"], "neither `repeat` nor `clamp`"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--map-size", "0"], "no side from 1"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--threads", "0"], "threads"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "vmf:9"], "whole number from 1 to 8"),
        (
            vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "vmf:4:sorted"],
            "no alignment; there are refined",
        ),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "phong"], "number of peaks"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "auto"], "needs `--max-error E`"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--max-error", "0.1"], "are for `--method auto`"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--zstd=23"], "--zstd"),
        (vec!["bake", "builtin:foil", "-o", "a.exr", "--zstd"], "is for KTX2"),
        (
            vec!["bake", "builtin:foil", "-o", "a.ktx2", "-m", "vmf:2", "--attribute", "srgb:"],
            "names no file",
        ),
        (vec!["compare", "builtin:foil", "--brdf", "gxx:0.2"], "did you mean `ggx`"),
        (vec!["compare", "builtin:foil", "--brdf", "ggx:7"], "between 0.0001 and 1"),
        (vec!["inspect", "builtin:foil", "--texel", "0", "0", "0"], "no baked map"),
        (vec!["bake", "builtin:foil", "-o", "a.ktx2", "--brdf", "ggx:0.2"], "is for `--method auto`"),
        (vec!["bake", "builtin:foil"], "as in `ndfmap bake builtin:foil foil.ktx2`"),
        (vec!["bake", "builtin:foil", "builtin:armour"], "need `--output-dir DIR`"),
        (vec!["bake", "tests", "-o", "a.ktx2"], "name `--output-dir DIR`"),
        (vec!["bake", "builtin:foil", "-o", "tests"], "is a folder"),
        (vec!["bake", "builtin:foil", "a/foil.png", "--output-dir", "b"], "written twice"),
        (vec!["compare", "builtin:foil", "--report", "Cargo.toml"], "is a file, not a folder"),
        (vec!["compare", "builtin:foil", "--brdf", "ggx"], "ALPHA must follow, as in `ggx:0.1`"),
        (vec!["render", "--scene", "plane", "--truth", "64", "-o", "a.png"], "write `--truth=64`"),
        (vec!["render", "--scene", "plane", "-o", "a.png", "--compare", "a.png"], "named for two outputs"),
        (vec!["render", "--scene", "src", "-o", "a.png"], "is a folder: name the model in it"),
        (vec!["render", "--scene", "house.blend", "-o", "a.png"], "Export > glTF 2.0"),
        (vec!["render", "--scene", "dragon.ply.gz", "-o", "a.png"], "unpack it first"),
        (vec!["render", "--scene", "plane", "-o", "a.png", "--material", "x"], "models have"),
        (vec!["bkae"], "bake"),
        (vec![], "Usage"),
    ] {
        let (status, stdout, stderr) = outcome(&words);
        assert_eq!(status, 2, "{words:?} {stderr}");
        assert!(stdout.is_empty() && stderr.contains(why), "{words:?}: {stderr}");
        assert!(!Path::new("a.ktx2").exists());
    }
}

#[test]
fn failures_are_1_and_leave_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let good = text(&folder.path().join("good.ktx2"));
    json(&["bake", "builtin:foil", "--map-size", "8", "-o", &good, "--json"]);
    let cut = folder.path().join("cut.ktx2");
    let bytes = std::fs::read(&good).unwrap();
    std::fs::write(&cut, &bytes[..bytes.len() / 2]).unwrap();
    std::fs::create_dir(folder.path().join("folder.ktx2")).unwrap();
    let path = |name: &str| text(&folder.path().join(name));
    let before = std::fs::read_dir(folder.path()).unwrap().count();
    for (words, why) in [
        (vec!["bake", "builtin:nothing", "-o", &path("x.ktx2")], "there is no built-in surface `nothing`"),
        (vec!["bake", &path("none.png"), "-o", &path("x.ktx2")], "none.png"),
        (vec!["bake", &good, "-o", &path("x.ktx2")], "is already a baked map"),
        (vec!["bake", "builtin:foil", "-o", &path("no/such/x.ktx2")], "x.ktx2"),
        (vec!["bake", "builtin:foil", "-o", "/dev/null/x.exr"], "x.exr"),
        (vec!["inspect", &text(&cut)], "is truncated"),
    ] {
        let (status, stdout, stderr) = outcome(&words);
        assert_eq!(status, 1, "{words:?} {stderr}");
        assert!(stdout.is_empty() && stderr.contains(why), "{words:?}: {stderr}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), before, "{words:?}");
    }
    let (status, _, stderr) = outcome(&["inspect", &good, "--texel", "0", "8", "0"]);
    assert!(status == 2 && stderr.contains("level 0 is 8 × 8"), "{stderr}");
}

#[test]
fn heights_too_large_for_half_floats_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let picture = folder.path().join("h.png");
    let mut encoder = png::Encoder::new(std::fs::File::create(&picture).unwrap(), 4, 4);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&[255; 16]).unwrap();
    writer.finish().unwrap();
    let output = text(&folder.path().join("x.ktx2"));
    let words = ["bake", &text(&picture), "-o", &output, "--height-scale", "1e5", "-m", "slopes"];
    let (status, _, stderr) = outcome(&words);
    assert!(status == 1 && stderr.contains("too large for half floats"), "{stderr}");
    assert!(!Path::new(&output).exists());
    let baked: Value = json(&[&words[..], &["--precision", "single", "--json"]].concat());
    assert_eq!(baked["width"], 4);
}

/// Whether a process has begun to write in a folder, under a name or on Linux without any.
#[cfg(unix)]
fn writes_in(process: u32, folder: &Path) -> bool {
    let open = std::fs::read_dir(format!("/proc/{process}/fd")).into_iter().flatten();
    let mut files = open.filter_map(|descriptor| std::fs::read_link(descriptor.ok()?.path()).ok());
    files.any(|file| file.starts_with(folder)) || std::fs::read_dir(folder).unwrap().count() > 0
}

/// Ends a long bake by a signal while it writes; returns its exit status, unless the signal itself ended it,
/// and the number of files that it left.
#[cfg(unix)]
fn end_a_bake(signal: &str, more: &[&str]) -> (Option<i32>, usize) {
    use std::process::{Command, Stdio};
    let folder = tempfile::tempdir().unwrap();
    // Factors by integration take long enough to be caught in the act.
    let mut child = Command::new(env!("CARGO_BIN_EXE_ndfmap"))
        .args(["bake", "builtin:foil", "--map-size", "4096", "-m", "ndm:gaussian:integrated"])
        .args(more)
        .arg("-o")
        .arg(folder.path().join("big.ktx2"))
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let begun = || writes_in(child.id(), folder.path());
    let start = std::time::Instant::now();
    while !begun() && start.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert!(begun(), "the bake never began to write");
    Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    let status = child.wait().unwrap();
    assert!(!status.success(), "the bake was over before the signal");
    (status.code(), std::fs::read_dir(folder.path()).unwrap().count())
}

#[cfg(unix)]
#[test]
fn interrupted_bakes_leave_nothing() {
    assert_eq!(end_a_bake("-INT", &[]), (Some(130), 0));
}

#[cfg(target_os = "linux")]
#[test]
fn killed_bakes_leave_nothing() {
    for more in [&[] as &[&str], &["--zstd"]] {
        assert_eq!(end_a_bake("-KILL", more), (None, 0), "{more:?}");
    }
}

#[test]
fn render_writes_pictures_and_tells_scripts() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| text(&folder.path().join(name));
    let (png, truth, sheet) = (at("a.png"), at("truth.exr"), at("sheet.png"));
    let told = json(&[
        "render",
        "--scene",
        "disk",
        "--map-size",
        "64",
        "--size",
        "48x40",
        "-m",
        "vmf:2,naive",
        "-o",
        &png,
        "--truth=64",
        "--truth-output",
        &truth,
        "--compare",
        &sheet,
        "--sparkle",
        "--json",
    ]);
    assert_eq!(told["scene"], "disk");
    assert_eq!((&told["method"], &told["device"]), (&Value::from("vmf:2"), &Value::from("cpu")));
    assert_eq!((told["width"].as_u64(), told["height"].as_u64()), (Some(48), Some(40)));
    assert!(told["seconds"].as_f64().unwrap() > 0.0);
    assert!(["median", "min", "max"].iter().all(|k| told["frame_ms"][*k].as_f64().unwrap() > 0.0));
    for key in ["relative_l2", "color_error", "sparkle"] {
        let of = |value: &Value| value[key].as_f64().unwrap();
        assert!(of(&told["error"]) >= 0.0);
        assert!(
            key == "sparkle" || of(&told["error"]) < of(&told["methods"]["naive"]["error"]),
            "{key}: {told}"
        );
    }
    assert_eq!(told["truth"]["rays_per_pixel"], 64);
    assert!(told["truth"]["noise"].as_f64().unwrap() > 0.0);
    for (file, magic) in [(&png, b"\x89PNG"), (&truth, b"\x76\x2f\x31\x01"), (&sheet, b"\x89PNG")] {
        assert!(std::fs::read(file).unwrap().starts_with(magic), "{file}");
    }
    // Linear light: a picture that the program itself can read back.
    assert_eq!(json(&["inspect", &truth, "--from", "normal", "--json"])["width"], 48);

    let numbered = at("frame.png");
    let frames = json(&[
        "render",
        "--scene",
        "v-groove",
        "--map-size",
        "16",
        "--size",
        "8",
        "--frames",
        "3",
        "-o",
        &numbered,
        "--json",
    ]);
    assert!(frames.get("error").is_none());
    assert!((0..3).all(|i| folder.path().join(format!("frame-000{i}.png")).exists()));
}

#[test]
fn render_gives_the_same_bytes_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mut all = Vec::new();
    for threads in ["1", "2", "7"] {
        let (a, b) = (text(&folder.path().join("a.exr")), text(&folder.path().join("b.exr")));
        json(&[
            "render",
            "--scene",
            "creature",
            "--map-size",
            "32",
            "--size",
            "40",
            "-m",
            "gmm:3",
            "-o",
            &a,
            "--truth=32",
            "--truth-output",
            &b,
            "--threads",
            threads,
            "--json",
        ]);
        all.push((std::fs::read(a).unwrap(), std::fs::read(b).unwrap()));
    }
    assert!(all[0] == all[1] && all[0] == all[2]);
}

#[test]
fn render_used_wrongly_says_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let model = text(&folder.path().join("broken.glb"));
    std::fs::write(&model, b"glTF\x02\x00\x00\x00").unwrap();
    let cases: [(&[&str], i32, &str); 13] = [
        (
            &["--scene", "disk", "--frames", "900", "--size", "900", "--compare", "b.png"],
            2,
            "the contact sheet would be",
        ),
        (&["--scene", "dsk", "-o", "a.png"], 2, "did you mean `disk`"),
        (&["--scene", "disk"], 2, "--output"),
        (&["--scene", "disk", "-o", "a.jpg"], 2, "pictures are written as .png or .exr"),
        (&["--scene", "disk", "-o", "a.png", "--compare", "b.exr"], 2, "contact sheets"),
        (&["--scene", "disk", "-o", "a.png", "-m", "toksvg"], 2, "did you mean `toksvig`"),
        (&["--scene", "disk", "-o", "a.png", "--time", "2"], 2, "from 0 to 1"),
        (&["--scene", "disk", "-o", "a.png", "--camera", "1,2,3"], 2, "six numbers"),
        (&["--scene", "disk", "-o", "a.png", "--camera", "1,2,3,1,2,3"], 2, "somewhere else"),
        (&["--scene", "disk", "-o", "a.png", "--light", "0,0,0"], 2, "must not be zero"),
        (&["--scene", "disk", "-o", "a.png", "--filter", "cubic"], 2, "trilinear"),
        (&["--scene", "gone.glb", "-o", "a.png"], 1, "gone.glb"),
        (&["--scene", &model, "-o", "a.png"], 1, "broken.glb"),
    ];
    for (words, status, reason) in cases {
        let all: Vec<&str> = ["render"].into_iter().chain(words.iter().copied()).collect();
        let (code, out, err) = outcome(&all);
        assert_eq!((code, out.as_str()), (status, ""), "{words:?}: {err}");
        assert!(err.contains(reason), "{words:?}: {err}");
    }
    let nowhere = text(&folder.path().join("no/such/folder/a.png"));
    let (code, _, err) =
        outcome(&["render", "--scene", "v-groove", "--size", "4", "--map-size", "4", "-o", &nowhere]);
    assert!(code == 1 && err.contains("a.png"), "{err}");
}

#[test]
fn compare_measures_pictures_too() {
    let folder = tempfile::tempdir().unwrap();
    let report = text(&folder.path().join("report"));
    let told = json(&[
        "compare",
        "builtin:foil",
        "--map-size",
        "32",
        "--method",
        "naive,vmf:2",
        "--scene",
        "plane",
        "--truth=32",
        "--size",
        "24",
        "--report",
        &report,
        "--json",
    ]);
    assert_eq!(told["scene"], "plane");
    for method in ["naive", "vmf:2"] {
        let picture = &told["methods"][method]["picture"];
        assert!(
            picture["error"]["color_error"].as_f64().unwrap() > 0.0
                && picture["frame_ms"]["median"].as_f64().is_some()
        );
    }
    assert!(folder.path().join("report/scene.png").exists());
    assert!(
        std::fs::read_to_string(folder.path().join("report/report.html")).unwrap().contains("In a scene")
    );
}

#[test]
fn heights_displace_scenes() {
    let words = ["render", "--scene", "noise-sphere", "--displace", "--device", "cpu", "--json"];
    let small = ["--size", "24", "--map-size", "32", "--truth=32", "-m", "slopes,slopes:9"];
    let told = json(&[&words[..], &small].concat());
    assert_eq!(told["method"], "slopes");
    for method in ["slopes", "slopes:9"] {
        let error = &told["methods"][method]["error"];
        // Measured 0.036 and 0.998; the truth's noise is 0.010.
        assert!(error["relative_l2"].as_f64().unwrap() < 0.038, "{error}");
        assert!((error["brightness"].as_f64().unwrap() - 1.0).abs() < 0.003, "{error}");
    }
    let compared = json(&[
        "compare",
        "builtin:noise",
        "--map-size",
        "32",
        "--method",
        "slopes,toksvig",
        "--scene",
        "sphere",
        "--displace=0.5",
        "--shadows",
        "--size",
        "24",
        "--truth=32",
        "--json",
    ]);
    assert!(
        // Measured 0.109, and 0.154 for `toksvig`, which knows nothing of displacement.
        compared["methods"]["slopes"]["picture"]["error"]["relative_l2"].as_f64().unwrap() < 0.115,
        "{compared}"
    );
}

#[test]
fn what_cannot_be_displaced_says_why() {
    for (words, wanted) in [
        (
            &["render", "--scene", "v-groove", "--displace", "--json"][..],
            "none of the scene's maps has heights",
        ),
        (&["render", "--scene", "armour", "--displace=0", "--json"], "not 0"),
        (&["render", "--scene", "armour", "--displace=nan", "--json"], "not 0"),
        (&["render", "--scene", "armour", "--shadows", "--json"], "--displace"),
        (&["render", "--scene", "armour", "--displace", "--model", "tan", "--json"], "--model"),
        (&["bake", "builtin:armour", "-m", "slopes:1", "-o", "x.ktx2"], "5 to 128"),
    ] {
        let (status, _, stderr) = outcome(words);
        assert_eq!(status, 2, "{words:?}: {stderr}");
        assert!(stderr.contains(wanted), "{words:?}: {stderr}");
    }
}
