//! Long work under an observer: progress runs forwards to its end, and work that is to stop does, whatever
//! the method.

#![allow(clippy::unwrap_used, reason = "a test that cannot go on should stop where it is")]

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use ndfmap_core::bake::{Bake, BakeError, LevelSink, Place};
use ndfmap_core::grid::Size;
use ndfmap_core::measure::{BakedMap, TexelTruth, filtering_errors, lattice_for, level_errors};
use ndfmap_core::ndf::{self, AnyMethod};
use ndfmap_core::observe::{Cancelled, Observer};
use ndfmap_core::procedural;
use ndfmap_core::surface::Surface;
use ndfmap_core::units::Exponent;
use ndfmap_core::{brdf::BlinnPhong, pyramid::level_sizes};

/// Observer that lets so many looks pass, then stops the work.
struct Watch {
    patience: usize,
    looks: AtomicUsize,
    told: Mutex<Vec<f64>>,
}

impl Watch {
    fn new(patience: usize) -> Self {
        Self { patience, looks: AtomicUsize::new(0), told: Mutex::default() }
    }

    fn told(&self) -> Vec<f64> {
        self.told.lock().unwrap().clone()
    }
}

impl Observer for Watch {
    fn progress(&self, fraction: f64) {
        self.told.lock().unwrap().push(fraction);
    }

    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed) >= self.patience
    }
}

fn surface() -> Box<dyn Surface> {
    (procedural::find("armour").unwrap().build)(Size { width: 45, height: 37 })
}

fn methods() -> impl Iterator<Item = AnyMethod> {
    ndf::TABLE.iter().flat_map(|row| row.samples).map(|spelling| spelling.parse().unwrap())
}

#[test]
fn progress_runs_forwards_to_its_end() {
    let surface = surface();
    for method in methods() {
        let watch = Watch::new(usize::MAX);
        Bake::new(&*surface, &*method).observer(&watch).to_pyramid().unwrap();
        let told = watch.told();
        assert!(told.is_sorted() && told.iter().all(|f| (0.0..=1.0).contains(f)), "{method}: {told:?}");
        assert_eq!(told.last(), Some(&1.0), "{method}: {told:?}");
    }
}

/// Sink that counts rows, and takes them one by one.
#[derive(Default)]
struct Counting(usize);

impl LevelSink for Counting {
    type Error = std::convert::Infallible;

    fn write_rows(&mut self, _place: Place, _bytes: &[u8]) -> Result<(), Self::Error> {
        self.0 += 1;
        Ok(())
    }
}

#[test]
fn a_bake_that_is_to_stop_stops() {
    let surface = surface();
    for method in methods() {
        for patience in [0, 1, 5] {
            let watch = Watch::new(patience);
            let bake = Bake::new(&*surface, &*method).observer(&watch);
            assert_eq!(bake.to_pyramid().err(), Some(Cancelled), "{method} after {patience} looks");
            let watch = Watch::new(patience);
            let stopped = bake.observer(&watch).run(&mut Counting::default());
            assert_eq!(stopped.err(), Some(BakeError::Cancelled(Cancelled)), "{method}");
            assert!(watch.told().iter().all(|f| *f < 1.0), "{method}: {:?}", watch.told());
        }
    }
}

#[test]
fn measures_that_are_to_stop_stop() {
    let (surface, lobe) = (surface(), BlinnPhong { exponent: Exponent::new(50.0).unwrap() });
    let lattice = lattice_for(&lobe).unwrap();
    let truth = TexelTruth::new(&*surface, &lobe, &lattice);
    let levels: Vec<usize> = (1..level_sizes(surface.size()).len()).collect();
    let method = "toksvig".parse::<AnyMethod>().unwrap();
    let pyramid = Bake::new(&*surface, &*method).to_pyramid().unwrap().0;
    let maps = [BakedMap { pyramid: &pyramid, from_level: 0, method: &*method }];
    for patience in [0, 10] {
        assert_eq!(level_errors(&truth, &maps, &Watch::new(patience)).err(), Some(Cancelled));
        let corners = filtering_errors(&truth, surface.wraps(), &levels, &maps, &Watch::new(patience));
        assert_eq!(corners.err(), Some(Cancelled));
    }
}
