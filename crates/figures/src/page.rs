//! Files of figures: pictures, numbers as JSON, and one page of them all.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use minijinja::{Environment, context};
use ndfmap::Error;
use ndfmap::draw::Theme;
use ndfmap::maps::atomic;
use ndfmap::render::Device;
use serde::Serialize;

use crate::{Claim, Drawing, Figure, Paper, Plan, TABLE, Verdict};

/// Name of the page of all figures.
pub const PAGE: &str = "index.html";

/// Figure that was made; its JSON form is its file of numbers.
#[derive(Clone, Debug, Serialize)]
pub struct Made {
    /// Name of the figure.
    pub figure: &'static str,
    /// Paper.
    pub paper: &'static str,
    /// Place in the paper.
    pub place: &'static str,
    /// Summary in one line.
    pub summary: &'static str,
    /// Command that makes it again.
    pub command: String,
    /// True for a quick one, whose numbers are rough.
    pub quick: bool,
    /// Seed of the truths' rays.
    pub seed: u64,
    /// Outcome of its claims.
    pub verdict: Verdict,
    /// Numbers of the paper and ours.
    pub claims: Vec<Claim>,
    /// Differences from the paper, and why numbers come out or not.
    pub why: &'static str,
    /// Names of the pictures, on light paper and on dark.
    pub pictures: Vec<[String; 2]>,
    /// Seconds that it took.
    #[serde(skip)]
    pub seconds: f64,
}

/// Draws a figure and writes its files into a folder: a picture or more, on light and on dark paper, and its
/// numbers as JSON. Returns what was made, and the files.
///
/// # Errors
/// [`Error`] of the figure, and [`Error::Map`] for a file that cannot be written.
pub fn write(figure: &Figure, plan: &Plan<'_>, folder: &Path) -> Result<(Made, Vec<PathBuf>), Error> {
    let start = std::time::Instant::now();
    let Drawing { sheets, claims, why } = figure.draw(plan)?;
    let (mut pictures, mut files) = (Vec::new(), Vec::new());
    for (at, sheet) in sheets.iter().enumerate() {
        let name = if at == 0 { figure.name.to_owned() } else { format!("{}-{}", figure.name, at + 1) };
        let names = [format!("{name}.png"), format!("{name}-dark.png")];
        for (theme, name) in Theme::ALL.into_iter().zip(&names) {
            let path = folder.join(name);
            atomic::write(&path, &sheet.draw(theme).to_png()?)?;
            files.push(path);
        }
        pictures.push(names);
    }
    let seed = if plan.seed == 0 { String::new() } else { format!(" --seed {}", plan.seed) };
    let device = if matches!(plan.device, Device::Cpu) { "" } else { " --device gpu" };
    let quick = if plan.quick { " --quick" } else { "" };
    let made = Made {
        figure: figure.name,
        paper: figure.paper.title(),
        place: figure.place,
        summary: figure.summary,
        command: format!("ndfmap figure {}{quick}{seed}{device} -o DIR", figure.name),
        quick: plan.quick,
        seed: plan.seed,
        verdict: Verdict::of(&claims),
        claims,
        why,
        pictures,
        seconds: start.elapsed().as_secs_f64(),
    };
    let json = serde_json::to_string_pretty(&made).map_err(|e| Error::Failed(e.to_string()))? + "\n";
    let path = folder.join(format!("{}.json", figure.name));
    atomic::write(&path, json.as_bytes())?;
    files.push(path);
    Ok((made, files))
}

/// Page of figures that were made, paper by paper; `circumstances` are the lines at its end.
///
/// # Errors
/// [`Error::Failed`] for a page that cannot be written.
pub fn index(made: &[Made], circumstances: &[String]) -> Result<String, Error> {
    let failed = |e: minijinja::Error| Error::Failed(format!("cannot write the page: {e}"));
    let mut environment = Environment::new();
    environment.add_template(PAGE, include_str!("../templates/index.html")).map_err(failed)?;
    let of = |paper: Paper| {
        let row = |figure: &&Figure| figure.paper == paper;
        let figures = TABLE.iter().filter(row).filter_map(|f| made.iter().find(|m| m.figure == f.name));
        let figures: Vec<minijinja::Value> = figures.map(figure_context).collect();
        context! { title => paper.title(), figures => figures }
    };
    let claims: Vec<Claim> = made.iter().flat_map(|m| m.claims.clone()).collect();
    let Verdict { judged, met } = Verdict::of(&claims);
    let papers: Vec<minijinja::Value> = Paper::ALL.map(of).to_vec();
    let template = environment.get_template(PAGE).map_err(failed)?;
    let seconds = made.iter().map(|m| m.seconds).sum::<f64>();
    template
        .render(context! {
            papers => papers,
            figures => made.len(),
            judged => judged,
            met => met,
            quick => made.iter().any(|m| m.quick),
            seconds => format!("{seconds:.0}"),
            circumstances => circumstances.to_vec(),
            version => env!("CARGO_PKG_VERSION"),
        })
        .map_err(failed)
}

fn figure_context(made: &Made) -> minijinja::Value {
    let claim = |c: &Claim| {
        let mut cells = BTreeMap::from([("says", c.says.clone()), ("ours", digits(c.ours))]);
        cells.insert("paper", c.paper.map_or_else(String::new, digits));
        let outcome = c.holds.map_or("", |holds| if holds { "yes" } else { "no" });
        cells.insert("holds", outcome.to_owned());
        cells
    };
    context! {
        name => made.figure,
        place => made.place,
        summary => made.summary,
        command => made.command.clone(),
        verdict => made.verdict.to_string(),
        claims => made.claims.iter().map(claim).collect::<Vec<_>>(),
        why => made.why,
        pictures => made.pictures.clone(),
        seconds => format!("{:.1}", made.seconds),
    }
}

/// A number with three digits that count.
#[must_use]
pub fn digits(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        v if v >= 100.0 => format!("{value:.0}"),
        v if v < 1e-4 => format!("{value:.1e}"),
        v => {
            let places = (2.0 - v.log10().floor()).clamp(0.0, 6.0) as usize;
            format!("{value:.places$}")
        }
    }
}
