//! Scenes by brute force and through baked maps, side by side.

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
        let Self { plan, scene, size, lookups } = *self;
        let geometry = Geometry::displaced(scene, &scene.camera, size);
        plan.observer.begin("filtered");
        let draw = |(_, maps): &(String, BakedMaps)| {
            let filtered = Filtered { scene, geometry: &geometry, maps };
            Ok(filtered.render(&scene.camera, size, lookups, plan.observer)?)
        };
        maps.0.iter().map(draw).collect()
    }

    /// Both.
    pub(crate) fn shown(
        &self,
        maps: &Maps,
        effort: &Effort,
        head: impl Into<String>,
    ) -> Result<Shown, Error> {
        let TruePicture { picture, noise, rays } = self.truth(effort)?;
        let exposure = self.scene.exposure;
        Ok(Shown { head: head.into(), truth: picture, rays, noise, pictures: self.filtered(maps)?, exposure })
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
}

impl Shown {
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
        let panel = |p: &Picture| Panel::of(shown(p, self.exposure));
        let said = [format!("{} rays a pixel", self.rays), format!("noise {:.4}", self.noise)];
        let pictures = self.pictures.iter().map(panel);
        let differences = self.pictures.iter().enumerate().map(|(at, picture)| {
            let apart = enlarged(&colours.draw(picture, &self.truth, self.exposure), LEAST_SIDE);
            let said = [format!("colour {:.4}", self.colour(at)), format!("L2 {:.3}", self.l2(at))];
            Some(Panel::of(apart).said(said))
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
pub(crate) fn sheet(title: impl Into<String>, maps: &Maps, all: &[Shown]) -> Sheet {
    let pairs = all.iter().flat_map(|shown| shown.pictures.iter().map(|picture| (picture, &shown.truth)));
    let colours = DifferenceColours::of(pairs, all.first().map_or(1.0, |shown| shown.exposure));
    let columns = std::iter::once("truth").chain(maps.names()).map(str::to_owned).collect();
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
