//! Tables for a terminal: the library's reports as text.

use ndfmap::BakeReport;
use ndfmap::asset::{AssetReport, Gain, LayerReport, Outcome, Written};
use ndfmap::choose::Choice;
use ndfmap::compare::{Comparison, three_digits};
use ndfmap::core::measure::{Estimate, FilteringError, SURE, UNSEEN};
use ndfmap::render::{DriftReport, RenderReport};
use ndfmap::roughness::{Errors, RoughnessMips};
use ndfmap::scene::Camera;
use ndfmap_figures::{Claim, Made, Paper, TABLE, Verdict, digits};

/// List of the figures of the papers.
pub(crate) fn figures() -> String {
    let mut text = String::new();
    for paper in Paper::ALL {
        text += &format!("{}\n", paper.title());
        for row in TABLE.iter().filter(|row| row.paper == paper) {
            text += &format!("  {:15} {}: {}\n", row.name, row.place, row.summary);
        }
    }
    text
}

/// Table of figures that were made: what they claim, the papers' numbers and ours.
pub(crate) fn made(all: &[Made]) -> String {
    let claims = || all.iter().flat_map(|made| &made.claims);
    let longest = claims().map(|claim| claim.says.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for made in all {
        text += &format!("{}, {}: {}\n", made.figure, made.place, made.verdict);
        text += &format!("  {:longest$} {:>9} {:>9}  holds\n", "", "paper", "ours");
        for Claim { says, paper, ours, holds } in &made.claims {
            let paper = paper.map_or_else(|| "-".to_owned(), digits);
            let holds = holds.map_or("-", |holds| if holds { "yes" } else { "no" });
            text += &format!("  {says:longest$} {paper:>9} {:>9}  {holds}\n", digits(*ours));
        }
        text += &format!("  {}\n\n", made.why);
    }
    let Verdict { judged, met } = Verdict::of(&claims().cloned().collect::<Vec<_>>());
    text + &format!("{} figures; of {judged} statements that can be judged, {met} come out\n", all.len())
}

/// Table of a glTF model: a row a layer of a material, and what was done with it.
pub(crate) fn gltf(report: &AssetReport, written: Option<&Written>) -> String {
    let longest = report.layers.iter().map(|l| l.name.chars().count()).max().unwrap_or(0).max(8);
    let mut text = format!(
        "errors of roughness mips over those of stock ones, after compression, as an engine shades them\n\n\
         {:longest$}  layer             size  relative L2  FLIP  outcome\n",
        "material"
    );
    for LayerReport { name, layer, outcome, .. } in &report.layers {
        let row = |gain: &Gain, outcome: &str| {
            let Gain { width, height, compressed_of_stock: Errors { relative_l2, flip }, .. } = gain;
            let size = format!("{width} × {height}");
            format!("{size:>12}  {relative_l2:>11.2}  {flip:.2}  {outcome}")
        };
        let row = match outcome {
            Outcome::Fixed(gain) => row(gain, "fixed"),
            Outcome::NoBetter(gain) => row(gain, "left alone: the gain is too small"),
            Outcome::LeftAlone(reason) => {
                format!("{:>12}  {:>11}  {:>4}  left alone: {reason}", "-", "-", "-")
            }
        };
        text += &format!("{name:longest$}  {layer:9}  {row}\n");
    }
    text += &format!("\n{} of {} layers fixed", report.fixed(), report.layers.len());
    if let Some(Written { files, bytes }) = written {
        let plural = if files.len() == 1 { "" } else { "s" };
        text += &format!("; {bytes} bytes in {} file{plural}", files.len());
    }
    text + "\n"
}

/// Tables of roughness mips: a row a level, stock beside what was made; and a row for all that was tried.
pub(crate) fn roughness(mips: &RoughnessMips) -> String {
    let report = &mips.report;
    let mut text =
        "errors as an engine shades each level, against the mean of all normals under a texel\n\n".to_owned();
    text +=
        "level   size  roughness      mean: stock   made  relative L2: stock   made  FLIP: stock   made\n";
    for level in &report.levels {
        let size = mips.levels[level.level].size();
        text += &format!(
            "{:5} {:>6}  {:13} {:>12.3} {:>6.3} {:>19} {:>6} {:>12.3} {:>6.3}\n",
            level.level,
            size.width.max(size.height),
            level.by.to_string(),
            level.stock_roughness,
            level.made_roughness,
            three_digits(level.stock.relative_l2),
            three_digits(level.made.relative_l2),
            level.stock.flip,
            level.made.flip,
        );
    }
    let row = |name: &str, of: Errors| format!("{name:13} {:>11.2} {:>5.2}\n", of.relative_l2, of.flip);
    text += "\nover stock    relative L2  FLIP   (means over levels)\n";
    for tried in &report.tried {
        text += &row(&tried.by.to_string(), tried.of_stock);
    }
    text + &row("as written", report.of_stock)
}

/// Table of a comparison: a row a method, a column a level.
pub(crate) fn comparison(comparison: &Comparison) -> String {
    let (rows, brdf) = (&comparison.rows, &comparison.brdf);
    let longest = if comparison.factoring.is_empty() { "level" } else { "factors" };
    let name = rows.iter().map(|r| r.method.len()).max().unwrap_or(0).max(longest.len());
    let mut text = format!("relative L2 error of the effective lobe against the truth, {brdf}\n\n");
    text += &format!("{:name$}  bytes  bake ms", "level");
    for (level, _) in comparison.sizes.iter().enumerate() {
        text += &format!(" {level:>6}");
    }
    text += &format!("\n{:name$}               ", "size");
    for size in &comparison.sizes {
        let square = size.width == size.height;
        let said = if square { size.width.to_string() } else { format!("{}x{}", size.width, size.height) };
        text += &format!(" {said:>6}");
    }
    text.push('\n');
    for row in rows {
        text += &format!("{:name$} {:>6} {:>8.1}", row.method, row.bytes_per_texel, row.bake_seconds * 1e3);
        text += &"      -".repeat(row.from_level);
        for level in &row.levels {
            text += &format!(" {:>6}", three_digits(level.error));
        }
        text.push('\n');
    }
    if !comparison.factoring.is_empty() {
        text += &format!("{:name$}               ", "factors");
        for level in &comparison.factoring {
            text += &format!(" {:>6}", three_digits(level.error));
        }
        text += "\nfactors: the normals as they are, shaded by the factors of the material, which methods shade by\n";
    }
    if rows.iter().any(|row| !row.filtering.is_empty()) {
        text += "\nbetween texels (edges and corners): filtered, then by the reference path that shades every neighbour\n\n";
        for row in rows {
            for (what, error) in [
                ("filtered", (|e| e.filtered.error) as fn(&FilteringError) -> f64),
                ("reference", |e| e.reference.error),
            ] {
                text += &format!("{:name$} {what:>15}", row.method);
                text += &"      -".repeat(row.from_level.max(1));
                for e in &row.filtering {
                    text += &format!(" {:>6}", three_digits(error(e)));
                }
                text.push('\n');
            }
        }
    }
    text + &certainty(comparison)
}

/// Line that says how sure the errors of a comparison are; empty where all texels were measured.
fn certainty(comparison: &Comparison) -> String {
    let figures = comparison.rows.iter().flat_map(|row| {
        let at = row.levels.iter().map(|e| (e.level, "", e.estimate()));
        let between = row.filtering.iter().map(|e| (e.level, " between texels", e.filtered));
        at.chain(between).map(move |(level, place, estimate)| (&row.method, level, place, estimate))
    });
    let sampled: Vec<_> = figures.filter(|(.., e)| e.standard_error > 0.0).collect();
    if sampled.is_empty() {
        return String::new();
    }
    let part = |e: &Estimate| e.standard_error / e.error;
    let unsure = sampled.iter().filter(|(.., e)| !e.is_sure());
    let worst = unsure.max_by(|(.., a), (.., b)| part(a).total_cmp(&part(b)));
    let but = worst.map(|(method, level, place, e)| {
        format!(
            ", but for up to {:.1} % ({method}, level {level}{place}, {} places)",
            100.0 * part(e),
            e.places
        )
    });
    format!(
        "\nlarge levels are sampled: standard errors are at most {:.0} % of the error or {UNSEEN}{}\n",
        100.0 * SURE,
        but.unwrap_or_default()
    )
}

/// Table of a rendering: a row a method, and a line a truth.
pub(crate) fn rendering(report: &RenderReport) -> String {
    let name = report.methods.iter().map(String::len).max().unwrap_or(0).max("method".len());
    let measured = report.methods().any(|(_, said)| said.error.is_some());
    let columns = if measured { "  color_error  relative_l2  brightness    FLIP  sparkle" } else { "" };
    let mut text = format!("{:name$}  bake s  frame ms{columns}\n", "method");
    for (method, said) in report.methods() {
        text += &format!("{method:name$}  {:>6.1} {:>9.1}", said.bake_seconds, said.frame_ms.median);
        if let Some(e) = said.error {
            let sparkle = e.sparkle.map_or_else(|| "-".to_owned(), |v| format!("{v:.3}"));
            text += &format!(
                "  {:>11.4}  {:>11.3}  {:>10.3}  {:>6.3}  {sparkle:>7}",
                e.color_error, e.relative_l2, e.brightness, e.flip
            );
        }
        text.push('\n');
    }
    for f in &report.frames {
        let camera = numbers_of(&f.camera).map(six_digits).join(",");
        text += &format!("camera at time {}: {camera}\n", f.time);
        if let Some(truth) = f.truth {
            text += &format!(
                "truth at time {}: {} rays a pixel, noise {:.4}, {:.1} s\n",
                f.time, truth.rays, truth.noise, truth.seconds
            );
        }
        if let Some(DriftReport { change, noise }) = f.drifting {
            text += &format!("drifting: it changes by {change:.4} a step, {noise:.4} of that by noise\n");
        }
    }
    text
}

/// Numbers of a camera as `--camera` takes them: eye, target, degrees.
pub(crate) fn numbers_of(camera: &Camera) -> [f64; 7] {
    let ([a, b, c], [d, e, f]) = (camera.eye.to_array(), camera.target.to_array());
    [a, b, c, d, e, f, camera.degrees]
}

/// Number with six digits that count, and no more than it needs.
fn six_digits(value: f64) -> String {
    let rounded = format!("{value:.5e}").parse().unwrap_or(value);
    // Zero has no sign that anybody wants to read.
    format!("{}", rounded + 0.0)
}

/// Line about a baked map.
pub(crate) fn bake(output: &str, report: &BakeReport) -> String {
    let BakeReport { method, width, height, levels, layers, bytes, video_bytes, .. } = report;
    let plural = |count: &usize, one: &str| format!("{count} {one}{}", if *count == 1 { "" } else { "s" });
    format!(
        "{output}: {width} × {height}, {}, {} of {method}, {} on disk, {} in video memory",
        plural(levels, "level"),
        plural(layers, "layer"),
        binary_bytes(*bytes),
        binary_bytes(*video_bytes)
    )
}

/// Bytes in the unit that people read them in.
fn binary_bytes(bytes: u64) -> String {
    match bytes {
        0..1024 => format!("{bytes} bytes"),
        1024..1_048_576 => format!("{:.1} KiB", bytes as f64 / 1024.0),
        _ => format!("{:.1} MiB", bytes as f64 / 1_048_576.0),
    }
}

/// Table of a choice: a row a candidate, and the reason.
pub(crate) fn choice(choice: &Choice) -> String {
    let levels = choice.levels.iter().map(usize::to_string).collect::<Vec<_>>().join(" and ");
    let mut text = format!("error between texels with {}, the worst of levels {levels}:\n", choice.lobe);
    for c in &choice.candidates {
        let mark = if c.method == choice.method { "  <- chosen" } else { "" };
        let error = three_digits(c.error);
        text += &format!("  {:10} {:>4} bytes a texel {error:>7}{mark}\n", c.method, c.bytes);
    }
    text + &format!("chose `{}`: {}", choice.method, choice.why)
}
