//! The command line under environments and with measured lobes.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

mod common;

use common::{json, outcome, text};
use serde_json::Value;

const COMPARED: [&str; 7] = ["compare", "builtin:foil", "--map-size", "32", "--method", "vmf:2", "--json"];

#[test]
fn environments_light_scenes_and_turn() {
    let folder = tempfile::tempdir().unwrap();
    let picture = |name: &str| text(&folder.path().join(name));
    let words =
        ["render", "--scene", "sphere", "--map-size", "32", "--size", "24", "--device", "cpu", "--json"];
    let told =
        json(&[&words[..], &["--environment", "builtin:sky", "--truth=64", "-m", "vmf:2,slopes"]].concat());
    assert_eq!(told["environment"]["file"], "builtin:sky");
    assert_eq!(told["environment"]["technique"], "prefiltered");
    assert_eq!(told["environment"]["suns"], 1);
    for method in ["vmf:2", "slopes"] {
        let error = &told["methods"][method]["error"];
        // Measured 1.0002 and 0.9995.
        assert!((error["brightness"].as_f64().unwrap() - 1.0).abs() < 0.002, "{method}: {error}");
    }
    // A turned film: its first frame is the environment as it is, its last is turned half around; and so for
    // the other technique.
    let film = picture("film.exr");
    for how in ["prefiltered", "harmonics"] {
        let turning = [
            "--environment",
            "builtin:studio",
            "--environment-light",
            how,
            "--turn",
            "0,180",
            "--frames",
            "3",
            "-m",
            "vmf:2",
            "-o",
            &film,
        ];
        json(&[&words[..], &turning].concat());
        let still = picture("still.exr");
        let turned = [
            "--environment",
            "builtin:studio",
            "--environment-light",
            how,
            "--turn",
            "180",
            "--time",
            "1",
            "-m",
            "vmf:2",
            "-o",
            &still,
        ];
        json(&[&words[..], &turned].concat());
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert!(
            read("film-0002.exr") == read("still.exr") && read("film-0000.exr") != read("film-0002.exr"),
            "{how}"
        );
    }
    let pictures = ["--scene", "sphere", "--environment", "builtin:white", "--size", "16", "--truth=32"];
    let compared = json(&[&COMPARED[..], &pictures].concat());
    assert_eq!(compared["environment"]["file"], "builtin:white");
    // Measured 0.054, of which thirty-two rays have a noise of 0.044.
    let error = &compared["methods"]["vmf:2"]["picture"]["error"];
    assert!(error["relative_l2"].as_f64().unwrap() < 0.057, "{compared}");
}

#[test]
fn measured_lobes_bring_their_colours() {
    let words = [
        "render",
        "--scene",
        "sphere",
        "--map-size",
        "32",
        "--size",
        "24",
        "--device",
        "cpu",
        "--json",
        "--truth=64",
    ];
    let (status, out, err) =
        outcome(&[&words[..], &["--brdf", "sgd:gold-metallic-paint", "-m", "vmf:2,sh:7"]].concat());
    assert_eq!(status, 0, "{err}");
    assert!(err.contains("sgd:gold-metallic-paint: kd + f(theta_h) g(theta_d) leaves"), "{err}");
    let told: Value = serde_json::from_str(&out).unwrap();
    // Two lobes are near, as docs/environment.md has it for six; order 7 is not: measured 0.0234 and 0.384.
    let error = |method: &str| told["methods"][method]["error"]["relative_l2"].as_f64().unwrap();
    assert!(error("vmf:2") < 0.025 && error("sh:7") > 0.35, "{told}");
    let compared = json(&[&COMPARED[..], &["--brdf", "sgd:blue-fabric"]].concat());
    assert_eq!(compared["brdf"], "sgd:blue-fabric");
}

#[test]
fn light_and_lobes_used_wrongly_say_why() {
    let folder = tempfile::tempdir().unwrap();
    let table = text(&folder.path().join("short.binary"));
    std::fs::write(&table, [90_u8, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0]).unwrap();
    let merl = format!("merl:{table}");
    let square = text(&folder.path().join("square.exr"));
    json(&[
        "render",
        "--scene",
        "v-groove",
        "--size",
        "4",
        "--map-size",
        "4",
        "--device",
        "cpu",
        "-o",
        &square,
        "--json",
    ]);
    let sphere =
        ["render", "--scene", "sphere", "--size", "4", "--map-size", "4", "--device", "cpu", "--json"];
    for (words, status, wanted) in [
        (&["--brdf", "sgd:blue-fabrik"][..], 2, "blue-fabric"),
        (&["--brdf", "sgd:"], 2, "NAME must follow, as in `sgd:blue-fabric`"),
        (&["--brdf", "merl"], 2, "as in `merl:FILE`"),
        (&["--brdf", "merl:nowhere.binary"], 1, "nowhere.binary"),
        (&["--brdf", &merl], 1, "has 12 bytes; a MERL table has 34992012"),
        (&["--brdf", "sgd:nickel", "--displace"], 2, "none of microfacets"),
        (&["--environment", "nowhere.hdr"], 1, "nowhere.hdr"),
        (&["--environment", "builtin:moon"], 1, "built in are white, sky, studio"),
        (&["--environment", &square], 1, "twice as wide as high"),
        (&["--environment", "builtin:sky", "--environment-light", "magic"], 2, "prefiltered, harmonics"),
        (&["--environment", "builtin:sky", "--turn", "1,2,3"], 2, "one number of degrees, or two"),
        (&["--turn", "90"], 2, "--environment"),
    ] {
        let (code, out, err) = outcome(&[&sphere[..], words].concat());
        assert_eq!((code, out.as_str()), (status, ""), "{words:?}: {err}");
        assert!(err.contains(wanted), "{words:?}: {err}");
    }
}

#[test]
fn facets_shadow_an_environment() {
    // Diffuse facets in a white furnace: those of a surface as rough as 0.5 hide some of it from each
    // other. Without that the light was 1.15 of the truth (docs/displacement.md).
    let told = json(&[
        "render",
        "--scene",
        "noise-sphere",
        "--size",
        "24",
        "--map-size",
        "512",
        "--displace=2",
        "--shadows",
        "--brdf",
        "lambert",
        "--environment",
        "builtin:white",
        "--method",
        "slopes",
        "--truth=64",
        "--device",
        "cpu",
        "--json",
    ]);
    let number = |key: &str| told["error"][key].as_f64().unwrap();
    // Measured 0.976 and 0.086; the truth's noise is 0.048.
    assert!((number("brightness") - 0.976).abs() < 0.01, "{told}");
    assert!(number("relative_l2") < 0.095, "{told}");
}
