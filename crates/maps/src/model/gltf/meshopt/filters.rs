//! Filters of decoded attributes (`KHR_meshopt_compression`, appendix B). What they do with numbers out of
//! range is unspecified: here it is some number.

use std::f32::consts::FRAC_1_SQRT_2;

/// Integer of one or two bytes, low first.
fn signed(component: &[u8]) -> i32 {
    match component {
        [byte] => i32::from(*byte as i8),
        [low, high, ..] => i32::from(i16::from_le_bytes([*low, *high])),
        [] => 0,
    }
}

fn unsigned(component: &[u8]) -> i32 {
    signed(component) & ((1 << (8 * component.len())) - 1)
}

/// Rounds to the nearest, halves away from zero, and keeps the low bytes.
fn store(component: &mut [u8], value: f32) {
    let size = component.len();
    component.copy_from_slice(&(value.round() as i32).to_le_bytes()[..size]);
}

/// Unit vectors on an octahedron, filter 1: x, y, and what stands for one in them; the fourth is left alone.
pub(super) fn octahedral(element: &mut [u8]) {
    let size = element.len() / 4;
    let number = |i: usize| signed(&element[i * size..][..size]) as f32;
    let one = number(2);
    let [mut x, mut y] = [number(0) / one, number(1) / one];
    let z = 1.0 - x.abs() - y.abs();
    // Below, the corners are folded out.
    let fold = z.min(0.0);
    x -= fold.copysign(x);
    y -= fold.copysign(y);
    let largest = ((1_i32 << (8 * size - 1)) - 1) as f32 / (x * x + y * y + z * z).sqrt();
    for (component, value) in element.chunks_exact_mut(size).zip([x, y, z]) {
        store(component, value * largest);
    }
}

/// Unit quaternions, filter 2: three components times √2, and the place of the largest, with what stands for
/// one in the others.
pub(super) fn quaternion(element: &mut [u8]) {
    let number = |i: usize| signed(&element[2 * i..][..2]);
    let (one, place) = ((number(3) | 3) as f32, (number(3) & 3) as usize);
    let others = [0, 1, 2].map(|i| number(i) as f32 / one * FRAC_1_SQRT_2);
    let largest = (1.0 - others.map(|v| v * v).iter().sum::<f32>()).max(0.0).sqrt();
    for (i, value) in [largest, others[0], others[1], others[2]].into_iter().enumerate() {
        store(&mut element[2 * ((place + i) % 4)..][..2], value * 32_767.0);
    }
}

/// Floats, filter 3: a mantissa of 24 bits and an exponent of 8, both signed.
pub(super) fn exponential(element: &mut [u8]) {
    for number in element.as_chunks_mut::<4>().0 {
        let code = i32::from_le_bytes(*number);
        let (exponent, mantissa) = (code >> 24, code << 8 >> 8);
        // Both are exact in double precision, and so is their product.
        let power = f64::from_bits(((1023 + exponent) as u64) << 52);
        *number = ((f64::from(mantissa) * power) as f32).to_le_bytes();
    }
}

/// Colours in YCoCg, filter 4: luma, both chromas, and alpha below a bit that tells the number of bits.
pub(super) fn color(element: &mut [u8]) {
    let size = element.len() / 4;
    let component = |i: usize| &element[i * size..][..size];
    let (y, co, cg) = (unsigned(component(0)), signed(component(1)), signed(component(2)));
    let marked = unsigned(component(3));
    let one = (1 << (i32::BITS - marked.leading_zeros())) - 1;
    let alpha = marked & (one >> 1);
    let scale = ((1_i32 << (8 * size)) - 1) as f32 / one as f32;
    let values = [y + co - cg, y + cg, y - co - cg, alpha << 1 | alpha & 1];
    for (component, value) in element.chunks_exact_mut(size).zip(values) {
        store(component, value as f32 * scale);
    }
}
