//! Accuracy of operations on single floats, as WGSL's table of concrete floating-point expressions has it
//! (section 15.7.4.1). Vulkan's table of the precision of SPIR-V instructions holds the same numbers.

use naga::{BinaryOperator, Expression, MathFunction};

/// Unit in the last place of a single float, at most, as a share of it. What is "correctly rounded" may be
/// rounded either way, and so is off by up to one unit.
pub(super) const ULP: f32 = f32::EPSILON;

/// Error that an operation may have.
#[derive(Clone, Copy)]
pub(super) enum Error {
    /// So many units in the last place.
    Ulps(f32),
    /// This much, whatever the result.
    Absolute(f32),
    /// 3 + 2 |x| units, of the function of x.
    Exponential,
    /// 2^-21 where the result is nearer to zero than this, and 3 units elsewhere.
    Logarithm(f32),
}

/// Error of an operation's result; `None` where it is exact. What has no row stops the test: no standard
/// bounds it, or no shader of ours had it before.
pub(super) fn error_of(operation: &Expression) -> Option<Error> {
    Some(match operation {
        Expression::Binary { op: BinaryOperator::Divide, .. } => Error::Ulps(2.5),
        Expression::Binary { op, .. } => match op {
            BinaryOperator::Add | BinaryOperator::Subtract | BinaryOperator::Multiply => Error::Ulps(1.0),
            BinaryOperator::Modulo => unreachable!("no row for the remainder of floats"),
            _ => return None,
        },
        Expression::Math { fun, .. } => match fun {
            MathFunction::Abs
            | MathFunction::Min
            | MathFunction::Max
            | MathFunction::Clamp
            | MathFunction::Saturate
            | MathFunction::Sign
            | MathFunction::Ceil
            | MathFunction::Floor
            | MathFunction::Round
            | MathFunction::Trunc
            | MathFunction::Transpose => return None,
            MathFunction::Dot | MathFunction::Cross | MathFunction::Mix | MathFunction::Fract => {
                Error::Ulps(1.0)
            }
            MathFunction::InverseSqrt => Error::Ulps(2.0),
            // 1 / inverseSqrt(x).
            MathFunction::Sqrt => Error::Ulps(4.5),
            // sqrt(dot(x, x)), where halving makes 1.5 of the 3 units of a sum of three squares.
            MathFunction::Length => Error::Ulps(6.0),
            MathFunction::Distance => Error::Ulps(7.0),
            // x / length(x).
            MathFunction::Normalize => Error::Ulps(8.5),
            MathFunction::Atan2 => Error::Ulps(4096.0),
            MathFunction::Acos => Error::Absolute(6.77e-5),
            MathFunction::Exp | MathFunction::Exp2 => Error::Exponential,
            MathFunction::Log => Error::Logarithm(std::f32::consts::LN_2),
            MathFunction::Log2 => Error::Logarithm(1.0),
            other => unreachable!("no row for {other:?}"),
        },
        Expression::Derivative { .. } => unreachable!("nothing bounds a derivative"),
        // Access, selection, negation, conversion from integers: nothing is computed that is not exact, or
        // (of whole numbers beyond 2²⁴, which no shader of ours has) correctly rounded.
        _ => return None,
    })
}
