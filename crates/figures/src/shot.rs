//! Scenes by brute force and through baked maps, side by side.

use std::time::Instant;

use glam::Vec3;
use ndfmap::core::grid::{Grid, Size};
use ndfmap::core::lookup::{Filtering, Lookups};
use ndfmap::core::ndf::AnyMethod;
use ndfmap::core::pyramid::Precision;
use ndfmap::draw::{Panel, Rgb, Sheet, SheetRow, enlarged};
use ndfmap::report::DifferenceColours;
use ndfmap::scene::metrics::{Picture, color_error, relative_l2, to_bytes};
use ndfmap::scene::{Effort, Scene, TruePicture};
use ndfmap::trace::filtered::{BakedMaps, Filtered};
use ndfmap::trace::truth::Truth;
use ndfmap::trace::{DisplacedMeshes, Geometry};
use ndfmap::{Error, SceneSpec};

use crate::Plan;

/// Pixels of the longer side of the smallest pictures on a sheet.
const LEAST_SIDE: usize = 200;

/// Maps of a scene, baked by several methods.
pub(crate) struct Maps(Vec<(String, BakedMaps)>);

impl Maps {
    pub(crate) fn bake(plan: &Plan<'_>, scene: &Scene, methods: &[&str]) -> Result<Self, Error> {
        let bake = |name: &&str| -> Result<(String, BakedMaps), Error> {
            let method = name.parse::<AnyMethod>()?;
            plan.observer.begin(&format!("bake {method}"));
            let maps = BakedMaps::new(&scene.materials, &method, Precision::Half, plan.observer)?;
            Ok(((*name).to_owned(), maps))
        };
        Ok(Self(methods.iter().map(bake).collect::<Result<_, _>>()?))
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|(name, _)| name.as_str())
    }
}

/// View of a scene.
#[derive(Clone, Copy)]
pub(crate) struct Shot<'a> {
    pub(crate) plan: &'a Plan<'a>,
    pub(crate) scene: &'a Scene,
    pub(crate) size: Size,
    pub(crate) lookups: Lookups,
}

impl<'a> Shot<'a> {
    /// A view by the default filter.
    pub(crate) fn new(plan: &'a Plan<'a>, scene: &'a Scene, size: Size) -> Self {
        Self { plan, scene, size, lookups: Lookups::taps(Filtering::fine(16)) }
    }

    /// Picture by brute force; of displaced meshes, where the scene has any.
    pub(crate) fn truth(&self, effort: &Effort) -> Result<TruePicture, Error> {
        let Self { plan, scene, size, .. } = *self;
        plan.observer.begin("truth");
        if !scene.is_displaced() {
            let geometry = Geometry::new(scene);
            return Ok(Truth::new(scene, &geometry).render(&scene.camera, size, effort, plan.observer)?);
        }
        let (plain, displacement) = (Geometry::without_displacement(scene), DisplacedMeshes::new(scene));
        let truth = Truth::displaced(scene, &plain, &displacement);
        Ok(truth.render(&scene.camera, size, effort, plan.observer)?)
    }

    /// Pictures through maps, in their order.
    pub(crate) fn filtered(&self, maps: &Maps) -> Result<Vec<Picture>, Error> {
        let geometry = Geometry::displaced(self.scene, &self.scene.camera, self.size);
        (0..maps.0.len()).map(|at| self.through(maps, at, &geometry)).collect()
    }

    /// Seconds that the picture through one of the maps takes, the scene being set up.
    pub(crate) fn seconds(&self, maps: &Maps, at: usize) -> Result<f64, Error> {
        let geometry = Geometry::displaced(self.scene, &self.scene.camera, self.size);
        let start = Instant::now();
        self.through(maps, at, &geometry)?;
        Ok(start.elapsed().as_secs_f64())
    }

    fn through(&self, maps: &Maps, at: usize, geometry: &Geometry) -> Result<Picture, Error> {
        let Self { plan, scene, size, lookups } = *self;
        plan.observer.begin("filtered");
        let filtered = Filtered { scene, geometry, maps: &maps.0[at].1 };
        Ok(filtered.render(&scene.camera, size, lookups, plan.observer)?)
    }

    /// Both.
    pub(crate) fn shown(
        &self,
        maps: &Maps,
        effort: &Effort,
        head: impl Into<String>,
    ) -> Result<Shown, Error> {
        let TruePicture { picture, noise, rays } = self.truth(effort)?;
        let window = Window::of(&picture, self.scene.background);
        let (head, pictures, exposure) = (head.into(), self.filtered(maps)?, self.scene.exposure);
        Ok(Shown { head, truth: picture, rays, noise, pictures, exposure, window })
    }
}

/// Truth of a view beside pictures through maps.
pub(crate) struct Shown {
    pub(crate) head: String,
    pub(crate) truth: Picture,
    pub(crate) rays: usize,
    pub(crate) noise: f64,
    pub(crate) pictures: Vec<Picture>,
    pub(crate) exposure: f32,
    /// Part that sheets show; errors are of the whole.
    window: Option<Window>,
}

/// Part of a picture: a square around all that is no background.
#[derive(Clone, Copy)]
struct Window {
    corner: (usize, usize),
    side: usize,
}

impl Window {
    /// The part, where it is less than half of the picture each way.
    fn of(picture: &Picture, background: Vec3) -> Option<Self> {
        let Size { width, height } = picture.size();
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let covered: Vec<(usize, usize)> =
            places.filter(|(x, y)| picture.row(*y)[*x] != background).collect();
        let range = |of: fn(&(usize, usize)) -> usize| {
            covered.iter().map(of).fold((usize::MAX, 0), |(low, high), v| (low.min(v), high.max(v)))
        };
        let ((left, right), (top, bottom)) = (range(|at| at.0), range(|at| at.1));
        if left > right {
            return None;
        }
        let side = (right - left).max(bottom - top) + 5;
        let corner = |low: usize, high: usize, all: usize| {
            ((low + high + 1).saturating_sub(side) / 2).min(all.saturating_sub(side))
        };
        (2 * side < width.min(height))
            .then(|| Self { corner: (corner(left, right, width), corner(top, bottom, height)), side })
    }

    /// The part of a picture, enlarged to nearly its size.
    fn cut(self, picture: &Grid<Rgb>) -> Grid<Rgb> {
        let size = Size { width: self.side, height: self.side };
        let part = Grid::from_fn(size, |x, y| picture.row(self.corner.1 + y)[self.corner.0 + x]);
        enlarged(&part, picture.size().width / self.side * self.side)
    }
}

impl Shown {
    /// A picture as it is shown.
    fn panel(&self, picture: &Grid<Rgb>) -> Panel {
        let cut = self.window.map(|window| window.cut(picture));
        Panel::of(enlarged(&cut.unwrap_or_else(|| picture.clone()), LEAST_SIDE))
    }

    /// Relative L2 error of a picture.
    pub(crate) fn l2(&self, at: usize) -> f64 {
        relative_l2(&self.pictures[at], &self.truth)
    }

    /// Colour error of a picture.
    pub(crate) fn colour(&self, at: usize) -> f64 {
        color_error(&self.pictures[at], &self.truth, self.exposure)
    }

    /// A row of pictures, and one of their differences from the truth.
    fn rows(&self, colours: DifferenceColours) -> [SheetRow; 2] {
        let panel = |p: &Picture| self.panel(&to_bytes(p, self.exposure));
        let part = self.window.map(|w| format!("part of {0} × {0} pixels", w.side));
        let said = [format!("{} rays a pixel", self.rays), format!("noise {:.4}", self.noise)];
        let said: Vec<String> = said.into_iter().chain(part).collect();
        let pictures = self.pictures.iter().map(panel);
        let differences = self.pictures.iter().enumerate().map(|(at, picture)| {
            let apart = colours.draw(picture, &self.truth, self.exposure);
            let said = [format!("colour {:.4}", self.colour(at)), format!("L2 {:.3}", self.l2(at))];
            Some(self.panel(&apart).said(said))
        });
        [
            SheetRow {
                head: vec![self.head.clone()],
                panels: std::iter::once(panel(&self.truth).said(said)).chain(pictures).map(Some).collect(),
            },
            SheetRow {
                head: vec!["difference".to_owned()],
                panels: std::iter::once(None).chain(differences).collect(),
            },
        ]
    }
}

/// Display values of a picture, large enough to be judged.
pub(crate) fn shown(picture: &Picture, exposure: f32) -> Grid<Rgb> {
    enlarged(&to_bytes(picture, exposure), LEAST_SIDE)
}

/// Sheet of views: truth and every method, with their differences.
pub(crate) fn sheet<'a>(
    title: impl Into<String>,
    names: impl IntoIterator<Item = &'a str>,
    all: &[Shown],
) -> Sheet {
    let pairs = all.iter().flat_map(|shown| shown.pictures.iter().map(|picture| (picture, &shown.truth)));
    let colours = DifferenceColours::of(pairs, all.first().map_or(1.0, |shown| shown.exposure));
    let columns = std::iter::once("truth").chain(names).map(str::to_owned).collect();
    Sheet {
        title: title.into(),
        columns,
        rows: all.iter().flat_map(|shown| shown.rows(colours)).collect(),
        scale: Some(colours.scale()),
    }
}

/// Built-in scene with maps of a size.
pub(crate) fn scene(name: &str, map_size: Size) -> SceneSpec {
    SceneSpec { scene: name.to_owned(), map_size: Some(map_size), ..SceneSpec::default() }
}

/// Part of a picture, from its upper left corner.
pub(crate) fn part(picture: &Picture, corner: (usize, usize), size: Size) -> Picture {
    Picture::from_fn(size, |x, y| picture.row(corner.1 + y)[corner.0 + x])
}
