//! Colours of heat maps and of lines.

use super::Rgb;

/// Colour of a heat map at `t` from 0 to 1, from dark to light in one order of hues: readable in grey and by
/// the colour-blind.
#[must_use]
pub fn heat(t: f64) -> Rgb {
    const STOPS: [Rgb; 5] = [[16, 14, 24], [66, 40, 126], [190, 55, 90], [250, 150, 60], [252, 250, 240]];
    let at = t.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let i = (at as usize).min(STOPS.len() - 2);
    let mix = |c: usize| {
        let (a, b) = (f64::from(STOPS[i][c]), f64::from(STOPS[i + 1][c]));
        (a + (b - a) * (at - i as f64)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// Colours of a plot's lines: as many as there are lines, no two alike.
///
/// Up to seven are Okabe and Ito's, which the colour-blind can tell apart, without black and yellow, which
/// vanish on dark and on light paper. More are hues in even steps around the circle of `OKLCh` (Ottosson
/// 2020), light and dark by turns.
#[must_use]
pub fn line_colours(lines: usize) -> Vec<Rgb> {
    const FEW: [Rgb; 7] = [
        [0, 114, 178],
        [213, 94, 0],
        [0, 158, 115],
        [204, 121, 167],
        [86, 180, 233],
        [230, 159, 0],
        [140, 140, 140],
    ];
    if lines <= FEW.len() {
        return FEW[..lines].to_vec();
    }
    let colour = |i: usize| {
        let hue = std::f64::consts::TAU * i as f64 / lines as f64;
        of_oklab([if i.is_multiple_of(2) { 0.55 } else { 0.74 }, 0.125 * hue.cos(), 0.125 * hue.sin()])
    };
    (0..lines).map(colour).collect()
}

/// Display colour of lightness and two chromatic axes of Oklab, cut to what a display shows.
fn of_oklab([l, a, b]: [f64; 3]) -> Rgb {
    let cube = |x: f64| x * x * x;
    let l_ = cube(l + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m_ = cube(l - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s_ = cube(l - 0.089_484_177_5 * a - 1.291_485_548 * b);
    let linear = [
        4.076_741_662_1 * l_ - 3.307_711_591_3 * m_ + 0.230_969_929_2 * s_,
        -1.268_438_004_6 * l_ + 2.609_757_401_1 * m_ - 0.341_319_396_5 * s_,
        -0.004_196_086_3 * l_ - 0.703_418_614_7 * m_ + 1.707_614_701 * s_,
    ];
    linear.map(|v| (ndfmap_scene::metrics::display_value(v as f32) * 255.0).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_have_colours_that_differ() {
        for lines in 1..=24 {
            let colours = line_colours(lines);
            assert_eq!(colours.len(), lines);
            for (i, a) in colours.iter().enumerate() {
                for b in &colours[..i] {
                    let apart: i32 =
                        a.iter().zip(b).map(|(a, b)| (i32::from(*a) - i32::from(*b)).abs()).sum();
                    // 24 lines are 40 apart, over three channels of 255.
                    assert!(apart >= 30, "{lines}: {a:?} {b:?}");
                }
            }
        }
    }

    #[test]
    fn oklab_has_its_known_colours() {
        assert_eq!(of_oklab([1.0, 0.0, 0.0]), [255; 3]);
        assert_eq!(of_oklab([0.0, 0.0, 0.0]), [0; 3]);
        // Red of sRGB (Ottosson 2020, and CSS Color 4).
        assert_eq!(of_oklab([0.627_955, 0.224_863, 0.125_846]), [255, 0, 0]);
    }

    #[test]
    fn heat_grows_lighter() {
        let light = |t: f64| heat(t).iter().map(|c| u32::from(*c)).sum::<u32>();
        assert!((0..100).all(|i| light(f64::from(i) / 100.0) < light(f64::from(i + 1) / 100.0)));
    }
}
