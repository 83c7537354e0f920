//! Library: what a caller asks that cannot be, and what it is told of long work.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::sync::Mutex;

use ndfmap::compare::{Comparison, Row, Subject, compare};
use ndfmap::core::brdf::AnyLobe;
use ndfmap::core::compact::{Bits, Storage};
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::lookup::Lookups;
use ndfmap::core::ndf::{AnyMethod, Slopes, Vmf};
use ndfmap::core::observe::{Observer, Unobserved};
use ndfmap::core::pyramid::Precision;
use ndfmap::draw::Theme;
use ndfmap::maps::attribute::AttributeMap;
use ndfmap::maps::source::{SourceMap, SourceOptions, read_source};
use ndfmap::maps::{Attribute, ChannelLayout, NdfMap, WriteOptions};
use ndfmap::render::{Device, RenderJob, render};
use ndfmap::report::contact_sheet;
use ndfmap::roughness::Origin;
use ndfmap::scene::Effort;
use ndfmap::{BakeJob, Error, SceneSpec};

fn foil() -> SourceMap {
    let options = SourceOptions { builtin_size: Size { width: 24, height: 16 }, ..SourceOptions::default() };
    read_source("builtin:foil".as_ref(), &options).unwrap()
}

fn job<'a>(scene: &'a SceneSpec, methods: &'a [AnyMethod]) -> RenderJob<'a> {
    RenderJob {
        scene,
        times: &[0.0],
        methods,
        size: Size { width: 24, height: 24 },
        storage: Precision::Half.into(),
        lookups: Lookups::TRILINEAR,
        truth: Some(Effort::rays(32)),
        sparkle: true,
        keep: false,
        keep_drift: false,
    }
}

#[test]
fn options_that_contradict_each_other_are_refused_before_the_bake() {
    let (map, folder) = (foil(), tempfile::tempdir().unwrap());
    let refused = |method: AnyMethod, name: &str, options: WriteOptions| {
        let path = folder.path().join(name);
        let error = BakeJob::new(&map, method).save(&path, &options).unwrap_err();
        assert!(!path.exists(), "{name}");
        error
    };
    let bumpslopes = WriteOptions { channels: ChannelLayout::Bumpslopes, ..WriteOptions::default() };
    let zstd = WriteOptions { zstd: Some(3), ..WriteOptions::default() };
    let nine = || Slopes::with_grid(9).unwrap();
    assert!(matches!(refused(Vmf::new(2).unwrap().into(), "a.exr", bumpslopes), Error::Request(_)));
    // `slopes:9` stores what `slopes` does.
    let path = folder.path().join("nine.exr");
    BakeJob::new(&map, nine()).save(&path, &bumpslopes).unwrap();
    assert_eq!(NdfMap::open(&path).unwrap().header.method, "slopes:9");
    assert!(matches!(refused(Slopes::new().into(), "a.ktx2", bumpslopes), Error::Request(_)));
    assert!(matches!(refused(nine().into(), "a.exr", zstd), Error::Request(_)));
    assert!(matches!(refused(nine().into(), "a.png", WriteOptions::default()), Error::Map(_)));
}

#[test]
fn a_lobe_that_is_not_there_carries_nothing() {
    let attribute = |name: &str, value: f32| AttributeMap {
        attribute: Attribute { name: name.to_owned(), channels: 1, transfer: "linear".to_owned() },
        values: Grid::from_fn(Size { width: 24, height: 16 }, |_, _| [value, 0.0, 0.0, 1.0]),
    };
    let attributes = [attribute("a", 0.25), attribute("b", 0.75)];
    let foil = foil();
    let map = BakeJob::new(&foil, Vmf::new(2).unwrap()).attributes(&attributes).to_map().unwrap();
    let texel = map.texel(1, 0, 0).unwrap();
    for (number, value) in [(0, 0.25), (1, 0.75)] {
        for lobe in texel.decoded().lobes() {
            // Stored times the lobe's weight, both in half floats of eleven bits.
            let carried = texel.attribute(number, lobe.index).unwrap()[0];
            assert!((carried - value).abs() < value / 512.0, "{carried} for {value}");
        }
        // Past the last lobe lie the layers of the next attribute.
        assert!([2, 3, 99].iter().all(|lobe| texel.attribute(number, *lobe).is_none()));
    }
    assert!(texel.attribute(2, 0).is_none());
    assert!(map.texel(99, 0, 0).is_none() && map.texel(0, 24, 0).is_none());
    assert!(NdfMap::open("no-such-file.ktx2".as_ref()).is_err());
}

/// Observer that keeps what it is told, and stops the work after so many pieces of it.
struct Diary {
    pieces: Mutex<Vec<(String, Vec<f64>)>>,
    patience: usize,
}

impl Observer for Diary {
    fn begin(&self, work: &str) {
        self.pieces.lock().unwrap().push((work.to_owned(), Vec::new()));
    }

    fn progress(&self, fraction: f64) {
        self.pieces.lock().unwrap().last_mut().unwrap().1.push(fraction);
    }

    fn cancelled(&self) -> bool {
        self.pieces.lock().unwrap().len() > self.patience
    }
}

#[test]
fn every_piece_of_a_rendering_runs_forwards_to_its_end_and_can_be_stopped() {
    let scene = SceneSpec { scene: "disk".to_owned(), ..SceneSpec::default() };
    let methods = [Vmf::new(2).unwrap().into()];
    let diary = |patience| Diary { pieces: Mutex::default(), patience };
    let all = diary(usize::MAX);
    let report = render(&job(&scene, &methods), &Device::Cpu, &all, &mut |_, _| Ok(())).unwrap();
    let pieces = all.pieces.into_inner().unwrap();
    let names: Vec<&str> = pieces.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names, ["bake vmf:2", "truth", "truth, drifting", "filtered"]);
    for (name, told) in &pieces {
        assert!(told.is_sorted() && told.last() == Some(&1.0), "{name}: {told:?}");
    }
    // A report whose pictures were not kept has no contact sheet, and says so.
    assert!(matches!(contact_sheet(&report, "disk", Theme::Light), Err(Error::Request(_))));
    for patience in 0..4 {
        let stopped = render(&job(&scene, &methods), &Device::Cpu, &diary(patience), &mut |_, _| Ok(()));
        assert!(matches!(stopped, Err(Error::Cancelled(_))), "{patience}");
    }
    let nothing = RenderJob { times: &[], ..job(&scene, &methods) };
    assert!(matches!(
        render(&nothing, &Device::Cpu, &Unobserved, &mut |_, _| Ok(())),
        Err(Error::Request(_))
    ));
}

/// Comparison on a foil of 64 × 64, at texels and between them.
fn compared(
    lobe: &str,
    methods: &[AnyMethod],
    engines: &[Origin],
    precision: Precision,
) -> Result<Comparison, Error> {
    let options = SourceOptions { builtin_size: Size { width: 64, height: 64 }, ..SourceOptions::default() };
    let map = read_source("builtin:foil".as_ref(), &options).unwrap();
    let lobe = lobe.parse::<AnyLobe>().unwrap();
    let subject = Subject {
        name: "foil",
        surface: &*map.surface,
        lobe: &*lobe,
        methods,
        baked: &[],
        engines,
        storage: precision.into(),
        filtering: true,
    };
    compare(&subject, &Unobserved)
}

#[test]
fn errors_say_how_sure_they_are() {
    let methods = ["toksvig", "vmf:2"].map(|m| m.parse::<AnyMethod>().unwrap());
    let compared = |lobe: &str| compared(lobe, &methods, &[], Precision::Half);
    let comparison = compared("blinn-phong:50").unwrap();
    for row in &comparison.rows {
        // 64 × 64 and 32 × 32 texels are sampled, or measured whole; 16 × 16 and fewer are whole.
        for e in &row.levels {
            let all = 4096 >> (2 * e.level);
            assert!(e.texels <= all && (e.level < 2) >= (e.standard_error > 0.0), "{} {e:?}", row.method);
            assert!(
                e.standard_error <= (0.02 * e.error).max(5e-4) || e.texels == 4096,
                "{} {e:?}",
                row.method
            );
        }
        for e in &row.filtering {
            assert!(e.filtered.places <= 512 && (e.level < 4) >= (e.filtered.standard_error > 0.0), "{e:?}");
        }
    }
    assert!(!serde_json::to_string(&comparison).unwrap().contains("null"));
    let refused = compared("ggx:0.003").unwrap_err();
    assert!(matches!(&refused, Error::Request(said) if said.contains("too narrow")), "{refused}");
}

#[test]
fn engines_are_measured_beside_methods() {
    // Plain mips and a mean normal made unit are `naive`; `alpha² + 2/kappa` is the one von Mises-Fisher lobe
    // of the mean normal.
    let methods = ["naive", "vmf:1"].map(|m| m.parse::<AnyMethod>().unwrap());
    let engines = ["plain", "kappa", "fit:1", "three"].map(|name| name.parse::<Origin>().unwrap());
    let compared = |lobe: &str| compared(lobe, &methods, &engines, Precision::Single);
    let comparison = compared("ggx:0.16").unwrap();
    let names: Vec<&str> = comparison.rows.iter().map(|row| row.method.as_str()).collect();
    assert_eq!(names, ["naive", "vmf:1", "rule:plain", "rule:kappa", "rule:fit:1", "rule:three"]);
    let [naive, vmf, plain, kappa, ..] = &comparison.rows[..] else { unreachable!() };
    for level in 0..comparison.sizes.len() {
        let error = |row: &Row| row.levels[level].error;
        // Roughness passes through a fourth root in single precision, and back: measured 4e-6 and 1.4e-6.
        assert!((error(plain) - error(naive)).abs() < 1e-5 * (1.0 + error(naive)), "{level}");
        assert!((error(kappa) - error(vmf)).abs() < 5e-6, "{level}: {} {}", error(kappa), error(vmf));
    }
    // An engine filters normals that are unit: between texels it is not what sums of normals are.
    assert!(plain.filtering[0].filtered.error > 0.0 && plain.filtering.len() == naive.filtering.len());
    for lobe in ["lambert", "sgd:gold-metallic-paint"] {
        let refused = compared(lobe).unwrap_err();
        assert!(matches!(&refused, Error::Request(said) if said.contains("roughness")), "{refused}");
    }
}

#[test]
fn a_compact_map_in_memory_is_that_of_its_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.ktx2");
    let map = foil();
    let job = BakeJob::new(&map, Vmf::new(1).unwrap()).storage(Storage::Compact(Bits::Eight)).from_level(1);
    job.save(&path, &WriteOptions::default()).unwrap();
    let read = NdfMap::open(&path).unwrap();
    assert!(job.to_map().unwrap() == read);
    assert_eq!((read.header.from_level, read.pyramid.sizes()[0]), (1, Size { width: 12, height: 8 }));
}

#[test]
fn a_camera_further_away_sees_less() {
    let scene = |distance| SceneSpec { scene: "sphere".to_owned(), distance, ..SceneSpec::default() };
    let camera = |distance| scene(distance).build(0.0, &Unobserved).unwrap().camera;
    let (near, far) = (camera(None), camera(Some(4.0)));
    assert!(((far.eye - far.target).length() / (near.eye - near.target).length() - 4.0).abs() < 1e-12);
    assert_eq!((far.target, far.degrees), (near.target, near.degrees));
}

#[test]
fn every_frame_of_a_scene_differs() {
    for row in ndfmap::scene::TABLE {
        let scene = SceneSpec {
            scene: row.name.to_owned(),
            map_size: Some(Size { width: 32, height: 32 }),
            ..SceneSpec::default()
        };
        let methods = ["naive".parse().unwrap()];
        let times = [0.0, 0.25, 0.5, 0.75, 1.0];
        let job = RenderJob {
            times: &times,
            // Far away some scenes are a fiftieth of the picture.
            size: Size { width: 128, height: 128 },
            truth: None,
            sparkle: false,
            keep: true,
            ..job(&scene, &methods)
        };
        let report = render(&job, &Device::Cpu, &Unobserved, &mut |_, _| Ok(())).unwrap();
        for (at, frame) in report.frames.iter().enumerate() {
            let same = report.frames[..at].iter().find(|f| f.pictures == frame.pictures);
            assert!(same.is_none(), "{}: frame {at} is another once more", row.name);
        }
    }
}
